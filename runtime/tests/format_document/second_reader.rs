//! Compares the numbers of this crate with those of the reader that was written in Python from docs/reference/format.md alone
//! (`tests/peers/spmm_reader.py`), in the worked example and in random assets, in both forms.

use super::document::{output_of, python};
use super::{block, document_bytes, example};
use btf_runtime::testing::{FileParts, Random, core_at_pair, sample_asset, sample_grouped_asset, sample_heights};
use btf_runtime::{
    Asset, DictionaryLobe, EDGE_WORDS, Edit, Edits, Layer, LevelTexels, Lobe, LobeFamily, LobeRef, PredictedGroup,
    ResidentFile, ResidualKind, SPHERE_HEADER_WORDS, SectionKind, Sphere, TRIANGLE_WORDS, pack, read_directory, serial,
    with_levels,
};
use half::f16;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Lines that the second reader prints, by name.
pub(super) type Lines = BTreeMap<String, String>;

/// Returns the lines that the reader in Python prints of `bytes`, with the values of `queries` (`value 0` and so on).
pub(super) fn read_by_the_document(name: &str, bytes: &[u8], options: &[&str], queries: &str) -> Lines {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (file, queries_file) = (folder.join(format!("{name}.spmm")), folder.join(format!("{name}.queries")));
    std::fs::write(&file, bytes).expect("the file is written");
    std::fs::write(&queries_file, queries).expect("the queries are written");
    let output = output_of(reader().arg(&file).args(options).arg("--decode").arg(&queries_file));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let pair = |line: &str| {
        let (name, numbers) = line.split_once(" =").expect("name = numbers");
        (name.to_string(), numbers.trim().to_string())
    };
    String::from_utf8(output.stdout).expect("UTF-8").lines().map(pair).collect()
}

/// Returns the reasons for which the reader in Python refuses each of the files; `None` for a file that it reads.
fn refused_by_the_document(name: &str, files: &[Vec<u8>]) -> Vec<Option<String>> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let paths: Vec<PathBuf> = (0..files.len()).map(|i| folder.join(format!("{name}-{i}.spmm"))).collect();
    for (path, bytes) in paths.iter().zip(files) {
        std::fs::write(path, bytes).expect("the file is written");
    }
    let output = output_of(reader().args(&paths));
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(!text.contains("Traceback"), "{text}");
    let refusals: BTreeMap<&str, &str> = text.lines().filter_map(|line| line.split_once(" cannot be read: ")).collect();
    paths.iter().map(|path| refusals.get(path.to_str().expect("UTF-8")).map(|reason| reason.to_string())).collect()
}

fn reader() -> Command {
    python("spmm_reader.py")
}

/// Numbers of an asset by name, as [`numbers_of`] finds them.
type Numbers = BTreeMap<String, Vec<f64>>;

/// Returns the numbers of an asset as this crate reads them: integers and halves exact, others to be compared within
/// rounding.
fn numbers_of(asset: &Asset) -> Numbers {
    let mut all = Numbers::new();
    for (number, edit) in asset.edits.list.iter().enumerate() {
        let [x, y] = edit.tilt;
        let numbers = [&edit.tint[..], &[edit.diffuse, edit.specular, edit.roughness, x, y, edit.fade]].concat();
        all.insert(format!("edit {}", number + 1), wide(&numbers));
    }
    for (number, layer) in asset.layers.iter().enumerate() {
        let name = |what: &str| format!("layer {number}: {what}");
        all.extend(numbers_of_sphere("light", &layer.lights).map(|(what, numbers)| (name(&what), numbers)));
        all.extend(numbers_of_sphere("view", &layer.views).map(|(what, numbers)| (name(&what), numbers)));
        all.extend(numbers_of_residual(layer).into_iter().map(|(what, numbers)| (name(&what), numbers)));
        let codes =
            layer.residual.iter().flat_map(|residual| residual.coefficients.iter().map(|plane| plane.codes.clone()));
        let finest = LevelTexels {
            heights: layer.heights.clone(),
            clusters: layer.texel_clusters.clone(),
            lobe_counts: layer.texel_lobe_counts.clone(),
            lobe_refs: layer.lobe_refs.clone(),
            codes: codes.collect(),
        };
        let name = |level: usize, what: &str| format!("layer {number} level {level}: {what}");
        if !asset.edits.list.is_empty() {
            all.insert(name(0, "edits"), wide(&asset.edits.texels));
        }
        let sizes =
            std::iter::once((asset.width, asset.height)).chain(asset.levels.iter().map(|l| (l.width, l.height)));
        let texels = std::iter::once(&finest).chain(asset.levels.iter().map(|level| &level.layers[number]));
        for (level, ((width, height), texels)) in sizes.zip(texels).enumerate() {
            all.insert(name(level, "size"), vec![width as f64, height as f64]);
            all.insert(name(level, "clusters"), wide(&texels.clusters));
            all.insert(name(level, "lobe counts"), wide(&texels.lobe_counts));
            let reference = |r: &LobeRef| [r.lobe, r.weight[0], r.weight[1], r.weight[2]];
            all.insert(
                name(level, "lobe references"),
                wide(&texels.lobe_refs.iter().flat_map(reference).collect::<Vec<_>>()),
            );
            for (j, codes) in texels.codes.iter().enumerate() {
                all.insert(name(level, &format!("coefficients {}", j + 1)), wide(codes));
            }
            if let Some(heights) = &texels.heights {
                all.insert(name(level, "height step"), wide(&[heights.step]));
                all.insert(name(level, "heights"), wide(&heights.codes));
            }
        }
    }
    all
}

pub(super) fn wide<T: Copy + Into<f64>>(numbers: &[T]) -> Vec<f64> {
    numbers.iter().map(|x| (*x).into()).collect()
}

/// Returns the numbers of a direction set, and of all that follows from it.
fn numbers_of_sphere(name: &str, sphere: &Sphere) -> [(String, Vec<f64>); 6] {
    let words = sphere.words();
    let [n, t, e, side] = [0, 1, 2, 3].map(|i| words[i] as usize);
    let singles = |words: &[u32]| words.iter().map(|word| f64::from(f32::from_bits(*word))).collect::<Vec<_>>();
    let triangles_at = SPHERE_HEADER_WORDS + 3 * n;
    let edges_at = triangles_at + TRIANGLE_WORDS * t;
    let cells_at = edges_at + EDGE_WORDS * e;
    let triangle = |words: &[u32]| [singles(&words[..6]), wide(&words[6..9])].concat();
    let edge = |words: &[u32]| [singles(&words[..5]), wide(&words[5..7])].concat();
    let triangles = words[triangles_at..edges_at].chunks_exact(TRIANGLE_WORDS);
    let (offsets, items) = words[cells_at..].split_at(side * side + 1);
    [
        ("directions", singles(&words[SPHERE_HEADER_WORDS..triangles_at])),
        ("triangles", triangles.flat_map(triangle).collect()),
        ("edges", words[edges_at..cells_at].chunks_exact(EDGE_WORDS).flat_map(edge).collect()),
        ("cells a side", vec![side as f64]),
        ("cell offsets", wide(offsets)),
        ("items", wide(items)),
    ]
    .map(|(what, numbers)| (format!("{name} {what}"), numbers))
}

/// Returns the bases' codes, the mixed cores, and the residual of every texel at every pair.
fn numbers_of_residual(layer: &Layer) -> Numbers {
    let mut all = Numbers::new();
    let Some(residual) = &layer.residual else { return all };
    all.insert("shared bases".to_string(), wide(&residual.shared.values));
    for (j, basis) in residual.bases.iter().enumerate() {
        all.insert(format!("basis {j}"), wide(&basis.values));
        for k in 0..layer.dictionary.len() {
            all.insert(format!("core {j} of cluster {k}"), wide(&residual.core(j, k)));
        }
    }
    for (texel, cluster) in layer.texel_clusters.iter().enumerate() {
        let core = |j: usize| residual.core(j, usize::from(*cluster));
        let mut mixed = core(0);
        for (j, plane) in residual.coefficients.iter().enumerate() {
            let y = plane.step * f32::from(plane.codes[texel]);
            mixed.iter_mut().zip(core(j + 1)).for_each(|(sum, x)| *sum += y * x);
        }
        let [views, lights] = residual.factors.shape;
        let pairs = (0..views * lights)
            .flat_map(|pair| core_at_pair(&residual.factors, &mixed, pair / lights, pair % lights).map(f64::from));
        all.insert(format!("residual of texel {texel}"), pairs.collect());
    }
    all
}

pub(super) fn parsed(text: &str) -> Vec<f64> {
    text.split_whitespace().map(|word| word.parse().expect("a number")).collect()
}

/// Returns the first name, of those that both have, whose numbers differ.
fn first_difference(read: &Lines, expected: &Numbers) -> Option<String> {
    expected.iter().find_map(|(name, expected)| {
        let got = parsed(read.get(name)?);
        // Cores and residuals are sums in single precision here and in double precision there.
        let scale = expected.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        let tolerance = if name.contains(": core") || name.contains(": residual") { 1e-5 * scale } else { 0.0 };
        let same = got.len() == expected.len() && got.iter().zip(expected).all(|(a, b)| (a - b).abs() <= tolerance);
        (!same).then(|| name.clone())
    })
}

/// Returns a random asset whose streams take every branch of the coder: patches of clusters, codes of every size,
/// heights, edits and levels.
fn busy_asset() -> Asset {
    let mut asset = sample_asset(11, 24, 17, ResidualKind::Root);
    let texels = asset.texel_count();
    let layer = &mut asset.layers[0];
    for (texel, cluster) in layer.texel_clusters.iter_mut().enumerate() {
        if texel % 7 != 0 {
            *cluster = ((texel % 24 / 5 + texel / 24 / 4) % 3) as u8;
        }
    }
    layer.heights = Some(sample_heights(11, texels));
    add_extreme_lobes(layer);
    asset.edits = edits(texels);
    // Levels are made of moderate numbers; extreme ones come after, and stay at the finest level.
    let mut asset = with_levels(&asset, &serial);
    let level = &mut asset.levels[1].layers[0];
    level.heights = Some(sample_heights(12, level.clusters.len()));
    let residual = asset.layers[0].residual.as_mut().unwrap();
    let sizes = [i16::MIN, i16::MAX, 0, 1, -1, 4097, -300, 0, 0, 20_000, 15];
    residual.shared.values.iter_mut().zip(sizes.iter().cycle()).skip(5).for_each(|(code, size)| *code = *size);
    residual.bases[1].values.iter_mut().for_each(|code| *code = code.saturating_mul(600));
    residual.coefficients[2].codes[100..200].fill(0);
    residual.coefficients[0].codes[7] = i8::MIN;
    asset
}

/// Returns three edits, on three of seven texels.
pub(super) fn edits(texels: usize) -> Edits {
    let tilted = Edit { tint: [0.9, 0.4, 1.5], roughness: 1.5, tilt: [0.1, 0.2], ..Edit::default() };
    let sharp = Edit { diffuse: 0.5, specular: 2.0, roughness: 0.3, tilt: [-0.5, 0.7], fade: 0.5, ..Edit::default() };
    let tinted = Edit { tint: [0.2, 1.0, 3.0], ..Edit::default() };
    let texels = (0..texels).map(|texel| if texel % 7 <= 3 { (texel % 7) as u8 } else { 0 }).collect();
    Edits { list: vec![tilted, sharp, tinted], texels }
}

/// Adds lobes that an edit takes to the ends of their ranges: axes near the horizon, an exponent near its largest. Two
/// of three texels of the first cluster have one in place of their first lobe.
pub(super) fn add_extreme_lobes(layer: &mut Layer) {
    let near_horizon = [0.75, 0.6484375];
    let lobe = |family, normal_xy, params| DictionaryLobe {
        lobe: Lobe { family, normal_xy, tangent_rad: 0.5, params },
        weight_scale: 0.5,
    };
    let first = layer.dictionary[0].len() as u8;
    layer.dictionary[0].extend([
        lobe(LobeFamily::Lambertian, near_horizon, [0.0; 4]),
        lobe(LobeFamily::Lafortune, [0.125, -0.25], [-1.0, -0.5, 1.0, 256.0]),
        lobe(LobeFamily::WindowedCosine, [0.0; 2], [20.0, near_horizon[0], near_horizon[1], 0.0]),
    ]);
    let mut at = 0;
    for (texel, count) in layer.texel_lobe_counts.iter().enumerate() {
        if layer.texel_clusters[texel] == 0 && *count > 0 && texel % 3 > 0 {
            layer.lobe_refs[at].lobe = first + (texel % 4).min(2) as u8;
        }
        at += usize::from(*count);
    }
}

/// Shared bases of [`asset_of_two_parts`], and those of its first part.
const SHARED_OF_TWO_PARTS: usize = 60;
pub(super) const SHARED_OF_FIRST_PART: usize = 24;

/// Returns a [`sample_grouped_asset`] with more shared bases than SharedBasesPart 0 holds, of which every cluster's bases
/// are mixtures. One cluster lacks the last component, as before.
pub(super) fn asset_of_two_parts(seed: u64, width: usize, height: usize, kind: ResidualKind) -> Asset {
    let mut asset = sample_grouped_asset(seed, width, height, kind);
    let mut random = Random::new(seed + 200);
    let mut code = |most: usize| random.below(2 * most + 1) as i16 - most as i16;
    let residual = asset.layers[0].residual.as_mut().unwrap();
    let before = residual.shared.steps.len();
    let more = SHARED_OF_TWO_PARTS - before;
    let core = residual.factors.core_len();
    // The second part's are the larger ones, so that values tell whether they are there.
    residual
        .shared
        .steps
        .extend((before..SHARED_OF_TWO_PARTS).map(|r| if r < SHARED_OF_FIRST_PART { 0.004 } else { 0.1 }));
    residual.shared.values.extend((0..more * core).map(|_| code(40)));
    for basis in &mut residual.bases {
        let mixture = |row: &[i16]| {
            let has = row.iter().any(|code| *code != 0);
            let codes: Vec<i16> = (0..more).map(|_| if has { code(20) } else { 0 }).collect();
            [row, &codes].concat()
        };
        basis.values = basis.values.chunks_exact(before).flat_map(mixture).collect();
    }
    asset
}

pub(super) fn resident_bytes(asset: &Asset) -> Vec<u8> {
    ResidentFile::of_asset(asset.clone(), &serial).pack().unwrap()
}

#[test]
fn a_reader_written_from_the_document_reads_the_same_numbers() {
    let busy = busy_asset();
    // Predicted coefficients; without lobe weights, so that nothing is subtracted from the residual.
    let mut grouped = asset_of_two_parts(14, 12, 9, ResidualKind::Root);
    grouped.layers[0].lobe_weights = None;
    let grouped = with_levels(&grouped, &serial);
    for (name, asset, bytes) in [
        ("worked-example", example(), document_bytes()),
        ("busy-asset", busy.clone(), pack(&busy).unwrap()),
        ("grouped-asset", grouped.clone(), pack(&grouped).unwrap()),
    ] {
        let read = read_by_the_document(name, &bytes, &["--residuals"], "");
        let expected = numbers_of(&asset);
        let texels = asset.texel_count();
        let missing: Vec<_> = expected.keys().filter(|name| !read.contains_key(*name)).collect();
        assert!(missing.is_empty(), "{name}: {missing:?}");
        assert!(expected.len() > 25 + texels, "{name}: {}", expected.len());
        assert_eq!(first_difference(&read, &expected), None, "{name}");
        // Ids, counts, references; shared bases, in two parts and with factors where coefficients are predicted; for each
        // basis its codes; for each component or group its coefficients; heights, edits, levels.
        let optional = [asset.layers[0].heights.is_some(), !asset.edits.list.is_empty()].map(usize::from);
        let residual = asset.layers[0].residual.as_ref().unwrap();
        let (shared, coefficients) = match residual.groups.len() {
            0 => (1, residual.coefficients.len()),
            groups => (3, groups),
        };
        let of_residual = shared + residual.bases.len() + coefficients;
        let streams = 3 + of_residual + optional[0] + optional[1] + asset.levels.len();
        let all = format!("{streams} {streams}");
        assert_eq!(read["streams, those that the encoder of the text makes again"], all, "{name}");

        // Planted differences: one code, one weight, one step, one code of a level.
        let differs = |change: &dyn Fn(&mut Asset)| {
            let mut other = asset.clone();
            change(&mut other);
            first_difference(&read, &numbers_of(&other))
        };
        let code = differs(&|a| a.layers[0].residual.as_mut().unwrap().coefficients[0].codes[3] ^= 1);
        assert_eq!(code.as_deref(), Some("layer 0 level 0: coefficients 1"), "{name}");
        let weight = differs(&|a| a.layers[0].lobe_refs[2].weight[2] ^= 1);
        assert_eq!(weight.as_deref(), Some("layer 0 level 0: lobe references"), "{name}");
        let step = differs(&|a| a.layers[0].residual.as_mut().unwrap().bases[0].steps[0] *= 1.01);
        assert_eq!(step.as_deref(), Some("layer 0: core 0 of cluster 0"), "{name}");
        let factor = differs(&|a| {
            let x = &mut a.layers[0].residual.as_mut().unwrap().factors.light[0][0];
            *x = f16::from_f32(x.to_f32() + 0.25);
        });
        assert!(factor.is_some_and(|name| name.starts_with("layer 0: residual of texel")), "{name}");
        let coarse = differs(&|a| a.levels[0].layers[0].codes[0][0] ^= 1);
        assert_eq!(coarse.as_deref(), Some("layer 0 level 1: coefficients 1"), "{name}");
        if name == "busy-asset" {
            assert_eq!(asset.levels.len(), 4);
            let edit = differs(&|a| a.edits.list[1].tilt[1] += 0.01);
            assert_eq!(edit.as_deref(), Some("edit 2"));
            let texel = differs(&|a| a.edits.texels[5] = 1);
            assert_eq!(texel.as_deref(), Some("layer 0 level 0: edits"));
            let height = differs(&|a| a.levels[1].layers[0].heights.as_mut().unwrap().codes[2] ^= 1);
            assert_eq!(height.as_deref(), Some("layer 0 level 2: heights"));
        }
    }
}

#[test]
fn both_forms_hold_the_same_texels_and_edits() {
    let busy = busy_asset();
    let file = read_by_the_document("busy-file-form", &pack(&busy).unwrap(), &[], "");
    let resident = |name: &str, asset: &Asset| read_by_the_document(name, &resident_bytes(asset), &[], "");
    // What both print: codes alike; lobes, edited ones too, and `keep` follow from others, here in single precision.
    let first_difference = |resident: &Lines| {
        resident.iter().filter(|(name, _)| name.starts_with("layer")).find_map(|(name, numbers)| {
            let (a, b) = (parsed(numbers), parsed(&file[name]));
            let follows = name.ends_with("keep") || name.contains("dictionary");
            let share = if follows { 5e-7 } else { 0.0 };
            let same = a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= share * b.abs().max(1.0));
            (!same).then(|| name.clone())
        })
    };
    let read = resident("busy-resident", &busy);
    let texels_and_edits = file.keys().filter(|name| name.starts_with("layer 0 level"));
    assert_eq!(read.keys().filter(|name| name.starts_with("layer")).count(), texels_and_edits.count());
    assert_eq!(first_difference(&read), None);
    // Planted differences: one edit fades faster, one is rougher by a little.
    let mut other = busy.clone();
    other.edits.list[0].fade += 1e-4;
    let differs = first_difference(&resident("busy-other", &other));
    assert_eq!(differs.as_deref(), Some("layer 0 level 0: edit 1: tint, keep"));
    let mut other = busy.clone();
    other.edits.list[1].roughness *= 1.0 + 1e-5;
    let differs = first_difference(&resident("busy-other", &other));
    assert!(differs.is_some_and(|name| name.starts_with("layer 0 level 0: edit 2: dictionary")));
}

/// Gives predicted coefficients what takes every branch of their coder.
fn make_extreme(layer: &mut Layer) {
    let residual = layer.residual.as_mut().unwrap();
    // Inputs from another cluster that are not finite: one alone, and with others.
    residual.groups = vec![
        PredictedGroup { components: 1, inputs: [1, 0, 0, 0], own: 0 },
        PredictedGroup { components: 3, inputs: [4, 3, 1, 2], own: 1 },
    ];
    residual.coefficients[0].step = f32::from_bits(1);
    residual.coefficients[1].step = 1e9;
    residual.bases[2].steps.iter_mut().for_each(|step| *step = 1e4);
    residual.coefficients[2].step = 0.0;
    // Differences of every size.
    let sizes = [-128, 127, 90, -60, 30, -18, 17, 19, 0, 1];
    let codes = residual.coefficients[1].codes.iter_mut().skip(60);
    codes.zip(sizes.iter().cycle()).for_each(|(code, size)| *code = *size);
    // Columns of codes of every size.
    let core = residual.factors.core_len();
    let mut random = Random::new(17);
    for (i, code) in residual.shared.values.iter_mut().enumerate() {
        *code = ((random.below(65536) as i32 - 32768) / (1 << (i % core % 17))) as i16;
    }
    // Factors that few digits do not tell.
    residual.factors.view[0][0] = f16::from_bits(0x3555);
    residual.factors.view[0].iter_mut().skip(1).for_each(|x| *x = f16::from_bits(x.to_bits() | 1));
    let mut weights = layer.lobe_weights.take().unwrap();
    weights.nodes = weights.nodes_of_texels(&layer.texel_clusters, &layer.coefficient_planes(), 20);
    layer.lobe_weights = Some(weights);
    layer.predict_lobes();
}

/// Coefficients that are predicted, in every tier: the same codes, and the same bases of those at hand.
#[test]
fn predicted_coefficients_are_read_by_the_document_from_every_tier() {
    for kind in [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root] {
        let mut asset = asset_of_two_parts(30 + kind as u64, 14, 11, kind);
        if kind == ResidualKind::Log {
            make_extreme(&mut asset.layers[0]);
        }
        let bytes = pack(&with_levels(&asset, &serial)).unwrap();
        for (tier, length) in read_directory(&bytes).unwrap().tiers.iter().enumerate() {
            let cut = &bytes[..*length as usize];
            let read = read_by_the_document(&format!("grouped-{}-{tier}", kind as u32), cut, &[], "");
            let mut asset = Asset::parse(cut).unwrap();
            // The decoder's tests have the residuals' values, from which lobes take their part.
            let mut expected = numbers_of(&asset);
            expected.retain(|name, _| !name.contains("residual of texel"));
            let missing: Vec<_> = expected.keys().filter(|name| !read.contains_key(*name)).collect();
            assert!(missing.is_empty(), "{kind:?} {tier}: {missing:?}");
            assert_eq!(first_difference(&read, &expected), None, "{kind:?} {tier}");
            // Planted differences: a code of the last component at hand; another shared basis.
            let Some(residual) = &mut asset.layers[0].residual else { continue };
            let shared = if tier == 2 { SHARED_OF_FIRST_PART } else { SHARED_OF_TWO_PARTS };
            assert_eq!(residual.shared.steps.len(), shared, "{kind:?} {tier}");
            let last = residual.coefficients.len();
            residual.coefficients[last - 1].codes[5] ^= 1;
            let differs = first_difference(&read, &numbers_of(&asset));
            assert_eq!(differs, Some(format!("layer 0 level 0: coefficients {last}")), "{kind:?} {tier}");
            let mut asset = Asset::parse(cut).unwrap();
            asset.layers[0].residual.as_mut().unwrap().shared.values[1] ^= 1 << 12;
            let differs = first_difference(&read, &numbers_of(&asset)).unwrap();
            assert!(differs.starts_with("layer 0: core"), "{kind:?} {tier}: {differs}");
        }
    }
}

/// A cluster of so many texels that its sizes no longer are means of all of them: loud at first, then quiet.
#[test]
fn a_large_cluster_is_read_by_the_document() {
    let [width, height] = [40, 30];
    let mut asset = sample_grouped_asset(62, width, height, ResidualKind::Root);
    let layer = &mut asset.layers[0];
    layer.lobe_weights = None;
    layer.texel_clusters.fill(0);
    let mut random = Random::new(5);
    for (j, plane) in layer.residual.as_mut().unwrap().coefficients.iter_mut().enumerate() {
        for (texel, code) in plane.codes.iter_mut().enumerate() {
            let most = [[40, 20, 8, 3], [6, 3, 1, 1]][texel / (width * height / 2)][j];
            *code = (random.below(2 * most + 1) as i32 - most as i32) as i8;
        }
    }
    // One lobe a texel, which every cluster's dictionary has.
    layer.texel_lobe_counts.fill(1);
    layer.lobe_refs = vec![LobeRef { lobe: 0, weight: [100; 3] }; width * height];
    let read = read_by_the_document("large-cluster", &pack(&asset).unwrap(), &[], "");
    let mut expected = numbers_of(&asset);
    assert_eq!(first_difference(&read, &expected), None);
    // Planted difference: the last code.
    *expected.get_mut("layer 0 level 0: coefficients 4").unwrap().last_mut().unwrap() += 1.0;
    assert_eq!(first_difference(&read, &expected).as_deref(), Some("layer 0 level 0: coefficients 4"));
}

/// Codes with more digits than a half has, some of them midway between two halves. Our writer makes none.
#[test]
fn both_readers_round_factor_codes_to_halves() {
    let mut asset = sample_grouped_asset(15, 6, 5, ResidualKind::Root);
    asset.layers[0].lobe_weights = None;
    let residual = asset.layers[0].residual.as_mut().unwrap();
    assert_eq!(residual.factors.shape, [17, 20]);
    residual.factors.ranks = [[1, 1], [0, 0], [0, 0]];
    residual.factors.view = [vec![f16::ONE; 17], vec![], vec![]];
    residual.factors.light = [vec![f16::ONE; 20], vec![], vec![]];
    residual.shared.values = vec![1, -2, 3];
    let mut parts = FileParts::from_bytes(&pack(&asset).unwrap()).unwrap();
    let section = parts.sections.iter_mut().find(|section| section.head[0] == SectionKind::FactorCodes as u32).unwrap();
    // Exponents 11 and 15. The stream's views are 2049, 2051, -4099, 4098, 0, ..., its lights 0, ..., 32767, -32768, 0,
    // 6001.
    let stream = [
        0xbf, 0xf7, 0x86, 0xc1, 0x67, 0x7e, 0x96, 0xf1, 0x19, 0xd8, 0xb7, 0xbc, 0xdb, 0xe4, 0x3d, 0xaf, 0xaf, 0xab,
        0xff, 0xf2, 0x5a, 0x48, 0x5e, 0x08, 0xdc, 0x9c, 0x28, 0x4c,
    ];
    section.bytes.truncate(32);
    section.bytes.extend([11, 15, 0, 0]);
    section.bytes.extend(stream);
    let bytes = parts.to_bytes();
    let mut asset = Asset::parse(&bytes).unwrap();
    let factors = &mut asset.layers[0].residual.as_mut().unwrap().factors;
    let halves = |codes: &[f32], step: f32| codes.iter().map(|code| f16::from_f32(code * step)).collect::<Vec<_>>();
    assert_eq!(factors.view[0][..5], halves(&[2048.0, 2052.0, -4100.0, 4096.0, 0.0], 2.0f32.powi(-11)));
    assert_eq!(factors.light[0][15..], halves(&[0.0, 32768.0, -32768.0, 0.0, 6000.0], 2.0f32.powi(-15)));
    let read = read_by_the_document("rounded-factors", &bytes, &["--residuals"], "");
    assert_eq!(first_difference(&read, &numbers_of(&asset)), None);
    // Planted difference: the half on the other side of 2049.
    asset.layers[0].residual.as_mut().unwrap().factors.view[0][0] = f16::from_f32(2050.0 / 2048.0);
    let differs = first_difference(&read, &numbers_of(&asset));
    assert!(differs.is_some_and(|name| name.starts_with("layer 0: residual of texel")));
}

#[test]
fn the_documents_decisions_are_those_of_the_first_coefficients() {
    let bytes = document_bytes();
    let read = read_by_the_document("decisions", &bytes, &["--decisions"], "");
    // Streams are numbered as they stand in the file: those before the first coefficients are five of the lobes and of
    // the shared bases, and two bases.
    let coded = FileParts::from_bytes(&bytes).unwrap().sections.into_iter().map(|section| section.head[0]);
    let coded: Vec<u32> = coded.filter(|kind| STREAMS.iter().any(|stream| *stream as u32 == *kind)).collect();
    let stream = coded.iter().position(|kind| *kind == SectionKind::Coefficients as u32).expect("it is there");
    assert_eq!((stream, coded.len()), (6, 8), "the level's stream is the last one");
    let mut decisions = 0;
    for row in block("decisions") {
        // `-> number: remark` tells what the decisions above it gave.
        if row.starts_with("->") {
            continue;
        }
        let words: Vec<&str> = row.split_whitespace().collect();
        let [_, "range", range, "code", code, "p", p, "bound", bound, "result", result] = words[..] else {
            panic!("{row}")
        };
        let hex = |word: &str| u32::from_str_radix(word, 16).expect("hex").to_string();
        let expected = [hex(range), hex(code), p.to_string(), hex(bound), result.to_string()].join(" ");
        assert_eq!(read[&format!("decision {decisions} of stream {stream}")], expected, "{row}");
        decisions += 1;
    }
    assert!(!read.contains_key(&format!("decision {decisions} of stream {stream}")), "all decisions are there");
    assert_eq!(decisions, 24);
}

/// Kinds of sections that hold a stream.
const STREAMS: [SectionKind; 9] = [
    SectionKind::TexelClusters,
    SectionKind::TexelLobeCounts,
    SectionKind::LobeRefs,
    SectionKind::SharedBases,
    SectionKind::Basis,
    SectionKind::Coefficients,
    SectionKind::Height,
    SectionKind::Level,
    SectionKind::Edits,
];

/// Those where coefficients are predicted.
const PREDICTED_STREAMS: [SectionKind; 3] =
    [SectionKind::PredictedCoefficients, SectionKind::SharedBasesPart, SectionKind::FactorCodes];

#[test]
fn both_readers_refuse_a_stream_that_is_not_consumed_exactly() {
    let mut asset = sample_asset(12, 6, 5, ResidualKind::Log);
    asset.layers[0].heights = Some(sample_heights(12, asset.texel_count()));
    asset.edits = edits(asset.texel_count());
    let bytes = pack(&with_levels(&asset, &serial)).unwrap();
    let predicted = pack(&sample_grouped_asset(12, 12, 9, ResidualKind::Root)).unwrap();
    let changed = |kind: SectionKind, longer: bool| {
        let parts = FileParts::from_bytes(if STREAMS.contains(&kind) { &bytes } else { &predicted }).unwrap();
        let at = parts.sections.iter().position(|section| section.head[0] == kind as u32).unwrap();
        let mut changed = parts.clone();
        let section = &mut changed.sections[at].bytes;
        if longer {
            section.push(0);
        } else {
            section.pop();
        }
        changed.to_bytes()
    };
    let kinds = STREAMS.into_iter().chain(PREDICTED_STREAMS);
    let files: Vec<Vec<u8>> = kinds.flat_map(|kind| [true, false].map(|longer| changed(kind, longer))).collect();
    let controls = vec![bytes.clone(), predicted.clone()];
    let refusals = refused_by_the_document("not-exact", &[files.clone(), controls].concat());
    for (i, file) in files.iter().enumerate() {
        assert!(Asset::parse(file).is_err(), "{i}");
        assert_eq!(refusals[i].as_deref(), Some("a stream is not as long as its numbers need"), "{i}");
    }
    assert_eq!(refusals[files.len()..], [None, None], "the controls must pass");
}

/// What the chapters of predicted coefficients forbid, one thing each.
#[test]
fn both_readers_refuse_what_predicted_coefficients_must_not_hold() {
    use SectionKind::{Basis, FactorCodes, PredictedCoefficients, SharedBasesPart};
    let asset = asset_of_two_parts(16, 12, 9, ResidualKind::Root);
    let parts = FileParts::from_bytes(&pack(&asset).unwrap()).unwrap();
    let place = |parts: &FileParts, kind: SectionKind, index: u32| {
        parts.sections.iter().position(|section| section.head[..3] == [kind as u32, 0, index]).unwrap()
    };
    let with = |kind, index, change: &dyn Fn(&mut Vec<u8>)| {
        let mut parts = parts.clone();
        let at = place(&parts, kind, index);
        change(&mut parts.sections[at].bytes);
        parts.to_bytes()
    };
    let with_word = |kind, index, word: usize, value: u32| {
        with(kind, index, &|bytes| bytes[4 * word..][..4].copy_from_slice(&value.to_le_bytes()))
    };
    let without = |kind, index| {
        let mut parts = parts.clone();
        let at = place(&parts, kind, index);
        parts.sections.remove(at);
        parts.sections.last_mut().unwrap().ends_tier = true;
        parts.to_bytes()
    };
    // 15 inputs of 1024 texels.
    let mut large =
        FileParts::from_bytes(&pack(&sample_grouped_asset(16, 32, 32, ResidualKind::Root)).unwrap()).unwrap();
    let at = place(&large, PredictedCoefficients, 2);
    let section = &mut large.sections[at].bytes;
    section.truncate(4 * 9 + 1);
    [4u32, 4, 4, 1].iter().enumerate().for_each(|(i, n)| section[8 + 4 * i..][..4].copy_from_slice(&n.to_le_bytes()));
    let above = |most: f32| most.next_up().to_bits();
    let (q, shared) = (SHARED_OF_TWO_PARTS as u32, "a number of shared bases is not allowed");
    let (inputs, components) =
        ("a group's inputs are out of their range", "a group's components are out of their range");
    let (missing, step) = ("a part of a residual is missing", "a step is out of its range");
    let files = [
        (with_word(PredictedCoefficients, 1, 0, 1025), shared),
        (with_word(PredictedCoefficients, 2, 0, q + 1), shared),
        (with_word(PredictedCoefficients, 1, 1, 0), components),
        (with_word(PredictedCoefficients, 2, 1, 3), components),
        (with_word(PredictedCoefficients, 1, 2, 3), inputs),
        (with_word(PredictedCoefficients, 2, 5, 5), inputs),
        (with_word(PredictedCoefficients, 1, 6, 1), inputs),
        (with_word(PredictedCoefficients, 2, 6, 3), inputs),
        (with_word(PredictedCoefficients, 2, 7, above(1e9)), step),
        // One byte is too little for so many shared bases, and for so many texels.
        (
            with(PredictedCoefficients, 2, &|bytes| bytes.truncate(4 * 9 + 1)),
            "a group takes too much memory for its bytes",
        ),
        (large.to_bytes(), "a group takes too long for its bytes"),
        (with_word(SharedBasesPart, 0, 0, q + 1), "there are too many shared bases"),
        (with_word(SharedBasesPart, 1, 0, q), "there are too many shared bases"),
        (with_word(SharedBasesPart, 1, 1, above(1e4)), step),
        (with_word(FactorCodes, 0, 0, 257), "a rank is out of its range"),
        (with_word(FactorCodes, 0, 7, 1), "a rank is out of its range"),
        (with(FactorCodes, 0, &|bytes| bytes[32] = 25), "an exponent is out of its range"),
        (without(PredictedCoefficients, 2), missing),
        (without(SharedBasesPart, 0), missing),
        (without(SharedBasesPart, 1), missing),
        (without(FactorCodes, 0), missing),
        (without(Basis, 3), missing),
        // The last part without a basis: fewer than are told.
        (with(SharedBasesPart, 1, &|bytes| *bytes = vec![0; 8]), "there are too few shared bases"),
    ];
    let bytes: Vec<Vec<u8>> = files.iter().map(|(bytes, _)| bytes.clone()).chain([parts.to_bytes()]).collect();
    let refusals = refused_by_the_document("not-allowed", &bytes);
    for (i, (bytes, reason)) in files.iter().enumerate() {
        assert!(Asset::parse(bytes).is_err(), "{i}: {reason}");
        assert_eq!(refusals[i].as_deref(), Some(*reason), "{i}");
    }
    assert_eq!(refusals[files.len()], None, "the control must pass");
    assert!(Asset::parse(&parts.to_bytes()).is_ok(), "the control must pass");
}

#[test]
fn the_second_reader_refuses_a_changed_byte_of_either_form() {
    let asset = with_levels(&sample_asset(13, 5, 4, ResidualKind::Log), &serial);
    for (name, bytes) in [("changed-file-form", pack(&asset).unwrap()), ("changed-resident", resident_bytes(&asset))] {
        // The version, the checksum, the first entry of the section table, and places all over the file.
        let places = [4, 49, 90].into_iter().chain((1..8).map(|part| bytes.len() / 8 * part + part));
        let changed = places.chain([bytes.len() - 1]).map(|at| {
            let mut changed = bytes.clone();
            changed[at] ^= 1;
            changed
        });
        let files: Vec<Vec<u8>> = changed.chain([bytes.clone()]).collect();
        let refusals = refused_by_the_document(name, &files);
        let (control, changed) = refusals.split_last().expect("files");
        assert_eq!(*control, None, "the control must pass");
        assert!(changed.iter().all(Option::is_some), "{name}: {changed:?}");
        let checksums = changed.iter().flatten().filter(|reason| reason.contains("checksum"));
        assert!(checksums.count() >= 5, "{name}: {changed:?}");
    }
}
