//! Executes the worked example of docs/reference/format.md: parses its bytes, compares every field that it names, decodes its
//! values, and packs the same asset from parts to the same bytes. A second reader, written in Python from the document
//! alone, finds the same numbers (`second_reader`) and decodes the same values (`second_decoder`).

mod document;
#[path = "format_document/second_decoder.rs"]
mod second_decoder;
#[path = "format_document/second_reader.rs"]
mod second_reader;

use btf_runtime::{
    Asset, Basis, Coefficients, DecodeOptions, DictionaryLobe, Factors, Interpolation, Layer, Level, LevelTexels, Lobe,
    LobeFamily, LobeRef, LobeRole, Resident, Residual, ResidualKind, SharedBases, Sphere, SurfaceSide, decode, pack,
    read_directory, weight_from_byte,
};
use half::f16;

const DOCUMENT: &str = include_str!("../../docs/reference/format.md");

/// Returns the lines of the document's fenced block with this info string.
fn block(name: &str) -> Vec<&'static str> {
    document::block(DOCUMENT, name)
}

/// Returns the `name = value` lines of a block.
fn named(name: &str) -> Vec<(String, String)> {
    let pair = |line: &str| {
        let (name, value) = line.split_once('=').expect("name = value");
        (name.trim().to_string(), value.trim().to_string())
    };
    block(name).into_iter().map(pair).collect()
}

fn halves(numbers: &[f32]) -> Vec<f16> {
    numbers.iter().map(|x| f16::from_f32(*x)).collect()
}

/// Builds the example from its parts, as a fitter would hand it to the packer.
fn example() -> Asset {
    let factors = Factors {
        shape: [1, 3],
        ranks: [[1, 1], [1, 1], [0, 0]],
        view: [halves(&[1.0]), halves(&[1.0]), vec![]],
        light: [halves(&[1.0, 0.5, 0.25]), halves(&[0.0, 1.0, -1.0]), vec![]],
    };
    let residual = Residual {
        shared: SharedBases { steps: vec![0.125, 0.0625], values: vec![2, 1, 1, -2] },
        bases: vec![
            Basis { steps: vec![0.5, 0.25], values: vec![1, 0, 2, -1] },
            Basis { steps: vec![0.25, 0.5], values: vec![4, -2, 0, 3] },
        ],
        coefficients: vec![Coefficients { step: 0.25, codes: vec![3, -1, 2, 0, -5, 1] }],
        factors,
        groups: Vec::new(),
    };
    let upright = |family, params| Lobe { family, normal_xy: [0.0; 2], tangent_rad: 0.0, params };
    let diffuse = DictionaryLobe { lobe: upright(LobeFamily::Lambertian, [0.0; 4]), weight_scale: 1.0 };
    let glossy = DictionaryLobe { lobe: upright(LobeFamily::BlinnPhong, [32.0, 0.0, 0.0, 0.0]), weight_scale: 0.125 };
    let reference = |lobe, weight| LobeRef { lobe, weight };
    let layer = Layer {
        light_side: SurfaceSide::Front,
        view_side: SurfaceSide::Front,
        lobe_role: LobeRole::OldBase,
        residual_kind: ResidualKind::Additive,
        epsilon: 0.5,
        lights: Sphere::new(&[[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, 0.6, 0.8]]).unwrap(),
        views: Sphere::new(&[[0.0, 0.0, 1.0]]).unwrap(),
        heights: None,
        relief: None,
        texel_clusters: vec![0, 0, 1, 0, 1, 1],
        texel_lobe_counts: vec![1, 1, 2, 1, 2, 1],
        dictionary: vec![vec![diffuse], vec![diffuse, glossy]],
        lobe_refs: vec![
            reference(0, [255, 204, 51]),
            reference(0, [250, 200, 50]),
            reference(0, [128, 120, 128]),
            reference(1, [255, 255, 255]),
            reference(0, [255, 206, 54]),
            reference(0, [120, 114, 119]),
            reference(1, [240, 240, 240]),
            reference(0, [130, 122, 130]),
        ],
        lobe_weights: None,
        residual: Some(residual),
    };
    Asset {
        width: 3,
        height: 2,
        size_mm: Some([3.0, 2.0]),
        seamless: [true, false],
        spectrum: None,
        material: r#"{"name":"example"}"#.to_string(),
        layers: vec![layer],
        levels: vec![Level {
            width: 1,
            height: 1,
            layers: vec![LevelTexels {
                heights: None,
                clusters: vec![1],
                lobe_counts: vec![1],
                lobe_refs: vec![reference(0, [128, 121, 119])],
                codes: vec![vec![1]],
            }],
        }],
        edits: Default::default(),
    }
}

/// Returns every field of the example by its name in the document, in the document's order.
fn fields(bytes: &[u8]) -> Vec<(String, String)> {
    let (directory, asset) = (read_directory(bytes).unwrap(), Asset::parse(bytes).unwrap());
    let layer = &asset.layers[0];
    let (entry, glossy, reference) = (&layer.dictionary[0][0], &layer.dictionary[1][1], &layer.lobe_refs[0]);
    let residual = layer.residual.as_ref().unwrap();
    let plane = &residual.coefficients[0];
    let (level, coarse) = (&asset.levels[0], &asset.levels[0].layers[0]);
    let list = |halves: &[f16]| halves.iter().map(|x| x.to_f32().to_string()).collect::<Vec<_>>().join(" ");
    let counts = |sphere: &Sphere| sphere.words()[..5].iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
    let offsets: Vec<String> = directory.sections.iter().map(|section| section.offset.to_string()).collect();
    let tiers: Vec<String> = directory.tiers.iter().map(u32::to_string).collect();
    let reference_text = |r: &LobeRef| format!("{} ({} {} {})", r.lobe, r.weight[0], r.weight[1], r.weight[2]);
    let references: Vec<String> = layer.lobe_refs.iter().map(reference_text).collect();
    let weights = reference.weight.map(|q| format!("{:.4}", weight_from_byte(q.into(), entry.weight_scale)));
    [
        ("length", bytes.len().to_string()),
        ("width", asset.width.to_string()),
        ("height", asset.height.to_string()),
        ("size in mm", format!("{:?}", asset.size_mm.unwrap())),
        ("seamless", format!("{:?}", asset.seamless)),
        ("layer_count", directory.head.layers.to_string()),
        ("section_count", directory.sections.len().to_string()),
        ("section offsets", offsets.join(" ")),
        ("tier lengths", tiers.join(" ")),
        ("material", asset.material.clone()),
        ("light_side", format!("{:?}", layer.light_side)),
        ("view_side", format!("{:?}", layer.view_side)),
        ("lobe_role", format!("{:?}", layer.lobe_role)),
        ("residual_kind", format!("{:?}", layer.residual_kind)),
        ("epsilon", layer.epsilon.to_string()),
        ("clusters", layer.dictionary.len().to_string()),
        ("components", residual.coefficients.len().to_string()),
        ("light set: directions triangles edges side items", counts(&layer.lights)),
        ("light 1", format!("{:?}", layer.lights.direction(1))),
        ("view set: directions triangles edges side items", counts(&layer.views)),
        ("clusters of the texels", format!("{:?}", layer.texel_clusters)),
        ("lobes of the texels", format!("{:?}", layer.texel_lobe_counts)),
        ("lobes of the dictionaries", format!("{:?}", layer.dictionary.iter().map(Vec::len).collect::<Vec<_>>())),
        ("family of lobe 1 of cluster 1", format!("{:?}", glossy.lobe.family)),
        ("exponent of lobe 1 of cluster 1", glossy.lobe.params[0].to_string()),
        ("weight scale of lobe 1 of cluster 1", glossy.weight_scale.to_string()),
        ("references, texel by texel", references.join(", ")),
        ("weights of texel 0", weights.join(" ")),
        ("ranks", format!("{:?}", residual.factors.ranks)),
        ("light factors, channel 0", list(&residual.factors.light[0])),
        ("light factors, channel 1", list(&residual.factors.light[1])),
        ("steps of the shared bases", format!("{:?}", residual.shared.steps)),
        ("codes of the shared bases", format!("{:?}", residual.shared.values)),
        ("codes of the means", format!("{:?} of {:?}", residual.bases[0].values, residual.bases[0].steps)),
        ("codes of component 1", format!("{:?} of {:?}", residual.bases[1].values, residual.bases[1].steps)),
        ("core of the mean of cluster 0", format!("{:?}", residual.core(0, 0))),
        ("core of component 1 in cluster 0", format!("{:?}", residual.core(1, 0))),
        ("core of the mean of cluster 1", format!("{:?}", residual.core(0, 1))),
        ("core of component 1 in cluster 1", format!("{:?}", residual.core(1, 1))),
        ("step of component 1's coefficients", plane.step.to_string()),
        ("codes of the texels", format!("{:?}", plane.codes)),
        ("level 1: width height components", format!("{} {} {}", level.width, level.height, coarse.codes.len())),
        ("level 1: clusters", format!("{:?}", coarse.clusters)),
        ("level 1: lobes", format!("{:?}", coarse.lobe_counts)),
        ("level 1: references", coarse.lobe_refs.iter().map(reference_text).collect::<Vec<_>>().join(", ")),
        ("level 1: codes of component 1", format!("{:?}", coarse.codes[0])),
    ]
    .into_iter()
    .map(|(name, value)| (name.to_string(), value))
    .collect()
}

/// Returns the example's bytes as the document has them.
fn document_bytes() -> Vec<u8> {
    document::bytes_from_dump(&block("hexdump"))
}

#[test]
fn the_documents_bytes_parse_and_every_named_field_is_there() {
    let bytes = document_bytes();
    assert_eq!(named("fields"), fields(&bytes));
    // Planted difference: another weight is another line.
    let mut other = example();
    other.layers[0].lobe_refs[0].weight[1] = 205;
    assert_ne!(named("fields"), fields(&pack(&other).unwrap()));
}

#[test]
fn the_example_packed_from_its_parts_gives_the_documents_bytes() {
    let packed = pack(&example()).unwrap();
    let bytes = document_bytes();
    assert_eq!(Asset::parse(&bytes).unwrap(), example());
    let first = packed.iter().zip(&bytes).position(|(a, b)| a != b);
    assert_eq!((first, packed.len()), (None, bytes.len()), "first different byte, length");
}

#[test]
fn one_changed_byte_of_the_document_is_refused() {
    let bytes = document_bytes();
    assert!(Asset::parse(&bytes).is_ok());
    for at in 0..bytes.len() {
        let mut changed = bytes.clone();
        changed[at] = changed[at].wrapping_add(1);
        assert!(Asset::parse(&changed).is_err(), "byte {at:#x}");
    }
}

#[test]
fn the_documents_decoded_values_are_what_the_decoder_gives() {
    let bytes = document_bytes();
    let tiers = read_directory(&bytes).unwrap().tiers;
    let mut rows = 0;
    for (input, output) in named("decoded") {
        let words: Vec<&str> = input.split_whitespace().collect();
        let ["tier", tier, rule, "level", level, "texel", texel, "wi", direction @ ..] = &words[..] else {
            panic!("{input}")
        };
        let numbers = |words: &[&str]| -> [f32; 3] {
            let numbers: Vec<f32> = words.iter().map(|word| word.parse().expect("a number")).collect();
            numbers.try_into().expect("three numbers")
        };
        let wi = numbers(direction);
        let expected = numbers(&output.split_whitespace().collect::<Vec<_>>());
        let interpolation = match *rule {
            "fast" => Interpolation::Fast,
            "exact" => Interpolation::Exact,
            _ => panic!("{input}"),
        };
        let length = tiers[tier.parse::<usize>().expect("a tier")] as usize;
        let resident = Resident::from_asset(&Asset::parse(&bytes[..length]).unwrap());
        let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
        let layer = resident
            .layer_for_sides(level.parse().expect("a level"), SurfaceSide::Front, SurfaceSide::Front)
            .expect("it is there");
        let got = decode(&resident, layer, texel.parse().expect("a texel"), wi, [0.0, 0.0, 1.0], &options);
        let close = |expected: [f32; 3]| (0..3).all(|c| (got[c] - expected[c]).abs() <= 1e-4);
        assert!(close(expected), "{input}: {got:?}");
        assert!(!close([expected[0], expected[1], expected[2] + 3e-4]), "the planted value must not pass");
        rows += 1;
    }
    assert_eq!(rows, 14);
}

#[test]
fn the_documents_lobe_families_are_the_codes() {
    let rows = block("families");
    assert_eq!(rows.len(), LobeFamily::ALL.len());
    for (family, row) in LobeFamily::ALL.into_iter().zip(rows) {
        let mut expected = format!("{} {family:?}", family as u32);
        for (i, (least, most)) in family.ranges().into_iter().enumerate() {
            if (least, most) != (0.0, 0.0) {
                expected += &format!(" p{i} {least} {most}");
            }
        }
        assert_eq!(row.split_whitespace().collect::<Vec<_>>().join(" "), expected);
    }
}
