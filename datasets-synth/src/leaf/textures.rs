//! Appearance textures of a leaf: structure, pigment, specular strength, thickness, and the displacement of both faces,
//! on the grid of the patch [Miao, Fig. 1, eq. 9].
//!
//! | texture | symbol | multiplies | procedural range |
//! |---|---|---|---|
//! | structure | - | nothing: it tells veins and mesophyll apart | 0 to 1 |
//! | pigment | V_a, V_c, V_b | C_ab, C_r, C_b | 0 to 2 |
//! | gloss, a face each | V_g | the gloss lobe | 0 to 1 |
//! | thickness | V_t | all absorption, k | 0.9 to 2 |
//!
//! `k = V_t (K_ab V_a C_ab + K_r V_c C_r + K_b V_b C_b + K_m C_m) / N`.
//!
//! There are two sources: the leaf is generated ([`crate::Species`], [`crate::Chlorosis`]), and any texture can be the
//! user's own image ([`TextureImages`]). As in the paper the structure comes first: where the user gives only a
//! structure image, pigment, specular strength, thickness, displacement and vein direction are made from it. An image
//! is final: deficiencies change what is generated, never what is given.
//!
//! Differs from the paper in: V_t is inside k and not a factor on the transmittance, where thicker would be brighter
//! (erratum); veins of third and finest order are parts of the green of the structure; displacement and vein direction
//! are textures as well.
//!
//! When it is wrong: the factors are one set for both faces, while a real blade holds more chlorophyll
//! towards its upper one.

use std::path::Path;

use btf_models::{MAX_TEXTURE_TEXELS, ModelError, TextureGrid, TextureImages, TextureKind, write_textures};
use rayon::prelude::*;

use crate::error::SynthError;
use crate::leaf::look::BladePlace;
use crate::leaf::params::LeafParams;
use crate::leaf::relief::{Relief, TextureSample, VeinMasks};
use crate::leaf::species::Traits;
use crate::leaf::venation::vein::double_angle;
use crate::leaf::venation::veins::Venation;
use crate::surface::grid::Grid;

/// Textures of a leaf at every node of its grid, the margin included. Lengths are in millimetres, the origin is the
/// lower left corner of the patch, x points to the right, y up.
#[derive(Debug, Clone, PartialEq)]
pub struct AppearanceTextures {
    pub(crate) grid: Grid,
    size_mm: f32,
    about: String,
    /// Values by node. The first of two faces is the one that is seen: the adaxial one, unless turned over.
    pub(crate) samples: Vec<TextureSample>,
}

impl AppearanceTextures {
    /// Generates the textures of a leaf and replaces those that the user supplies, seen from the adaxial side whatever
    /// face `params` ask for. Deterministic by seed, on all threads of the current pool.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`].
    ///
    /// Cost: about a microsecond and 52 bytes per grid node, of which there are four per texel and some in the
    /// margin.
    pub fn new(params: &LeafParams) -> Result<AppearanceTextures, SynthError> {
        params.check()?;
        let (grid, look, size_mm) = (params.grid(), &params.look, params.capture.size_mm);
        let traits = Traits::of(look.species);
        let grow = match look.place {
            BladePlace::Beside => Venation::new,
            BladePlace::Whole => Venation::centred,
        };
        let venation = grow(&traits.venation, size_mm, grid.margin_mm, params.capture.seed);
        let texel_mm = params.capture.texel_mm();
        let relief = Relief::new(venation, traits, look.chlorosis, size_mm, texel_mm, params.capture.seed);
        let mut samples: Vec<TextureSample> = if look.images.has(TextureKind::Structure) {
            from_structure(&grid, &relief, size_mm, &look.images)
        } else {
            (0..grid.len()).into_par_iter().map(|node| relief.at(position(&grid, node))).collect()
        };
        if !look.images.is_empty() {
            samples
                .par_iter_mut()
                .enumerate()
                .for_each(|(node, sample)| put_in(sample, &look.images, position(&grid, node), size_mm));
        }
        let about = format!("Made by btf-synth{}, seed {}, {size_mm} mm.", look.provenance(), params.capture.seed);
        Ok(AppearanceTextures { grid, size_mm, about, samples })
    }

    /// Returns the textures of the leaf turned over about y: columns mirrored, the faces swapped.
    pub fn turned_over(mut self) -> AppearanceTextures {
        self.samples.par_chunks_exact_mut(self.grid.side).for_each(|row| {
            row.reverse();
            for sample in row {
                sample.gloss.swap(0, 1);
                sample.height_mm.swap(0, 1);
                sample.double_direction[1] = -sample.double_direction[1];
            }
        });
        self
    }

    /// Writes every texture as an image into the folder `dir`, which must be new or empty, with `textures.toml`.
    /// [`TextureImages::read`] returns the same leaf again to 1/65535 of each range. There is one texel per grid node;
    /// the structure has 8 bits, the others 16.
    ///
    /// # Errors
    /// [`SynthError::Capture`] if the folder is not empty, the textures are too many, or a file cannot be written.
    pub fn export(&self, dir: impl AsRef<Path>) -> Result<(), SynthError> {
        let (dir, side) = (dir.as_ref(), self.grid.side);
        if self.grid.len() > MAX_TEXTURE_TEXELS {
            let fault = format!("would hold images of {side} x {side} texels, and {MAX_TEXTURE_TEXELS} are allowed");
            let remedy = "give a smaller --size or a larger --size-mm";
            return Err(ModelError::Leaf { path: dir.into(), fault, remedy }.into());
        }
        let textures: Vec<TextureGrid> = TextureKind::ALL
            .into_iter()
            .map(|kind| {
                let channels = kind.channels();
                // The top row first.
                let rows = self.samples.chunks_exact(side).rev();
                let values: Vec<f32> =
                    rows.flatten().flat_map(|sample| values_of(sample, kind).into_iter().take(channels)).collect();
                let range = match kind {
                    TextureKind::Height | TextureKind::HeightAbaxial => height_range(&values),
                    _ => kind.default_range(),
                };
                TextureGrid { kind, width: side, range, values }
            })
            .collect();
        // A texel is as wide as a cell and stands around its node.
        let cell = f64::from(self.grid.cell_mm);
        let corner = -f64::from(self.grid.margin_mm) - 0.5 * cell;
        let area_mm = [corner, corner, side as f64 * cell, side as f64 * cell];
        Ok(write_textures(dir, area_mm, self.size_mm, &self.about, &textures)?)
    }
}

/// Returns the position of a node in millimetres.
fn position(grid: &Grid, node: usize) -> [f32; 2] {
    grid.position_mm(node % grid.side, node / grid.side)
}

/// Returns the channels of a kind; those beyond its number are 0.
fn values_of(sample: &TextureSample, kind: TextureKind) -> [f32; 3] {
    match kind {
        TextureKind::Structure => sample.structure,
        TextureKind::Pigment => sample.pigment,
        TextureKind::Gloss => [sample.gloss[0], 0.0, 0.0],
        TextureKind::GlossAbaxial => [sample.gloss[1], 0.0, 0.0],
        TextureKind::Thickness => [sample.thickness, 0.0, 0.0],
        TextureKind::Height => [sample.height_mm[0], 0.0, 0.0],
        TextureKind::HeightAbaxial => [sample.height_mm[1], 0.0, 0.0],
        TextureKind::Direction => [sample.double_direction[0], sample.double_direction[1], -1.0],
    }
}

/// Replaces the values of a sample that the user has images of.
fn put_in(sample: &mut TextureSample, images: &TextureImages, position_mm: [f32; 2], size_mm: f32) {
    for kind in images.kinds() {
        let Some(value) = images.sample(kind, position_mm, size_mm) else { continue };
        match kind {
            TextureKind::Structure => sample.structure = value,
            TextureKind::Pigment => sample.pigment = value,
            TextureKind::Gloss => sample.gloss[0] = value[0],
            TextureKind::GlossAbaxial => sample.gloss[1] = value[0],
            TextureKind::Thickness => sample.thickness = value[0],
            TextureKind::Height => sample.height_mm[0] = value[0],
            TextureKind::HeightAbaxial => sample.height_mm[1] = value[0],
            TextureKind::Direction => sample.double_direction = [value[0], value[1]],
        }
    }
}

/// Returns the lowest and highest value, a little apart even if the face is flat, within the range that readers accept.
fn height_range(values: &[f32]) -> [f64; 2] {
    let low = values.iter().copied().fold(f32::MAX, f32::min);
    let high = values.iter().copied().fold(f32::MIN, f32::max);
    let [least, most] = TextureKind::Height.allowed_range();
    let low = f64::from(low).clamp(least, most - 1e-3);
    [low, f64::from(high).clamp(low + 1e-3, most)]
}

/// Returns the textures that follow from the structure image of the user.
fn from_structure(grid: &Grid, relief: &Relief, size_mm: f32, images: &TextureImages) -> Vec<TextureSample> {
    /// Blur of the veins in the displacement, and of the image that their direction is taken from, in millimetres.
    const SOFT_MM: [f32; 2] = [0.06, 0.15];
    /// Blur in millimetres over which directions agree with their neighbours.
    const DIRECTION_MM: f32 = 0.5;
    /// Factor from the blurred share of veins to nearness: a single vein of 0.3 mm comes to four fifths.
    const NEARNESS: f32 = 6.0;
    let side = grid.side;
    let veins: Vec<[f32; 2]> = (0..grid.len())
        .into_par_iter()
        .map(|node| {
            let [r, g, b] = images.sample(TextureKind::Structure, position(grid, node), size_mm).unwrap_or([0.0; 3]);
            let sum = (r + g + b).max(1e-3);
            [r / sum, g / sum]
        })
        .collect();
    let channel = |k: usize| veins.iter().map(|v| v[k]).collect::<Vec<f32>>();
    let any: Vec<f32> = veins.iter().map(|v| v[0] + v[1]).collect();
    let cells = |mm: f32| (mm / grid.cell_mm).round().max(1.0) as usize;
    let (main, lesser) = (blurred(channel(0), side, cells(SOFT_MM[0])), blurred(channel(1), side, cells(SOFT_MM[0])));
    let near = blurred(any.clone(), side, cells(0.5 * relief.bulge_reach_mm()));
    // The direction along which the veins' share changes least: the structure tensor's minor axis.
    let smooth = blurred(any, side, cells(SOFT_MM[1]));
    let slope = |node: usize| -> [f32; 2] {
        let (column, row) = (node % side, node / side);
        let at = |column: usize, row: usize| smooth[row * side + column];
        [
            at((column + 1).min(side - 1), row) - at(column.saturating_sub(1), row),
            at(column, (row + 1).min(side - 1)) - at(column, row.saturating_sub(1)),
        ]
    };
    let across: Vec<[f32; 2]> = (0..grid.len()).map(|node| double_angle(slope(node))).collect();
    let across: [Vec<f32>; 2] =
        [0, 1].map(|k| blurred(across.iter().map(|d| d[k]).collect(), side, cells(DIRECTION_MM)));
    (0..grid.len())
        .into_par_iter()
        .map(|node| {
            let p = position(grid, node);
            let near = 1.0 - (-NEARNESS * near[node]).exp();
            let masks = |main: f32, secondary: f32| VeinMasks { main, secondary, tertiary: 0.0, quaternary: 0.0, near };
            let [c, s] = [across[0][node], across[1][node]];
            let length = (c * c + s * s).sqrt();
            // Far from every vein: along the blade.
            let double = if length > 1e-12 { [-c / length, -s / length] } else { double_angle([0.0, 1.0]) };
            TextureSample {
                height_mm: relief.heights_from_masks_mm(p, masks(main[node], lesser[node])),
                double_direction: double,
                ..relief.tissue(p, masks(veins[node][0], veins[node][1]), relief.across_mm(p))
            }
        })
        .collect()
}

/// Applies three box blurs of `radius` cells, nearly a Gaussian of that standard deviation. Values beyond the edges are
/// those of the edges.
fn blurred(mut values: Vec<f32>, side: usize, radius: usize) -> Vec<f32> {
    let mut other = vec![0f32; values.len()];
    for _ in 0..3 {
        for _axis in 0..2 {
            // Blur along rows into the transposed place; twice gives both axes and the place back.
            let lines: Vec<Vec<f32>> = values.par_chunks_exact(side).map(|row| box_blurred(row, radius)).collect();
            for (i, line) in lines.iter().enumerate() {
                for (j, &value) in line.iter().enumerate() {
                    other[j * side + i] = value;
                }
            }
            std::mem::swap(&mut values, &mut other);
        }
    }
    values
}

fn box_blurred(row: &[f32], radius: usize) -> Vec<f32> {
    let last = row.len() - 1;
    let at = |i: isize| f64::from(row[i.clamp(0, last as isize) as usize]);
    let radius = radius as isize;
    let mut sum: f64 = (-radius..=radius).map(at).sum();
    let scale = 1.0 / (2 * radius + 1) as f64;
    (0..row.len() as isize)
        .map(|i| {
            let mean = sum * scale;
            sum += at(i + radius + 1) - at(i - radius);
            mean as f32
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::ops::ControlFlow;

    use btf_capture::{Capture, DirectionSet, ImageFormat, Pixels};
    use btf_models::{Deficiency, LeafContents, Species};

    use super::*;
    use crate::leaf::chlorosis::Chlorosis;
    use crate::leaf::look::LeafLook;
    use crate::leaf::venation::vein::direction_of;
    use crate::surface::capture_params::CaptureParams;
    use crate::write_leaf_capture;

    fn params(species: Option<Species>) -> LeafParams {
        let params = species.map_or_else(LeafParams::default, LeafParams::of);
        let capture = CaptureParams {
            size: 40,
            views: DirectionSet::random(2, 1).unwrap(),
            lights: DirectionSet::random(3, 2).unwrap(),
            format: ImageFormat::Exr,
            ..params.capture
        };
        LeafParams { capture, ..params }
    }

    fn with_seed(params: LeafParams, seed: u64) -> LeafParams {
        LeafParams { capture: CaptureParams { seed, ..params.capture }, ..params }
    }

    fn with_images(params: &LeafParams, images: TextureImages) -> LeafParams {
        LeafParams { look: LeafLook { images, ..params.look.clone() }, ..params.clone() }
    }

    /// Returns textures as a user would supply them, over a patch of 30 mm: values from 0 (black) to 1 (white) in
    /// square images of `side` texels.
    fn given(side: usize, images: &[(TextureKind, Vec<f32>)]) -> TextureImages {
        let dir = tempfile::tempdir().unwrap();
        let grid = |(kind, shares): &(TextureKind, Vec<f32>)| {
            let range = kind.default_range();
            let values = shares.iter().map(|share| (range[0] + f64::from(*share) * (range[1] - range[0])) as f32);
            TextureGrid { kind: *kind, width: side, range, values: values.collect() }
        };
        let grids: Vec<TextureGrid> = images.iter().map(grid).collect();
        write_textures(dir.path(), [0.0, 0.0, 30.0, 30.0], 30.0, "", &grids).unwrap();
        TextureImages::read(dir.path()).unwrap()
    }

    fn capture(params: &LeafParams) -> Vec<f32> {
        let parent = tempfile::tempdir().unwrap();
        let dir = parent.path().join("leaf");
        write_leaf_capture(&dir, params, &|_, _| ControlFlow::Continue(())).unwrap();
        let capture = Capture::open(&dir).unwrap();
        let read = |pair: usize| match capture.read(pair / 3, pair % 3).unwrap() {
            Pixels::Linear(values) => values,
            Pixels::Encoded8(_) => panic!("exr is linear"),
        };
        (0..6).flat_map(read).collect()
    }

    fn mean(textures: &AppearanceTextures, chosen: impl Fn([f32; 2], &TextureSample) -> bool, channel: usize) -> f32 {
        let nodes = textures.samples.iter().enumerate();
        let values: Vec<f32> = nodes
            .filter(|(node, sample)| chosen(position(&textures.grid, *node), sample))
            .map(|(_, sample)| sample.pigment[channel])
            .collect();
        assert!(values.len() > 50, "{}", values.len());
        values.iter().sum::<f32>() / values.len() as f32
    }

    #[test]
    fn exported_textures_give_the_same_capture_again() {
        for species in [None, Some(Species::Maize)] {
            let chlorosis = Some(Chlorosis { deficiency: Deficiency::Magnesium, severity: 0.8 });
            let look = LeafLook { species, chlorosis, ..LeafLook::default() };
            let grown = LeafParams { look, ..params(species) };
            let dir = tempfile::tempdir().unwrap();
            AppearanceTextures::new(&grown).unwrap().export(dir.path()).unwrap();
            // Of another seed, so that nothing can come from growing.
            let images = TextureImages::read(dir.path()).unwrap();
            let read = with_seed(with_images(&grown, images), 99);
            let (a, b) = (capture(&grown), capture(&read));
            let worst = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            // Half precision of the files, and 16-bit heights at the edges of shadows.
            assert!(worst < 4e-3, "{species:?}: {worst}");
            // Planted difference: the seed without the images.
            let other = capture(&with_seed(grown, 99));
            assert!(a.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) > 0.05);
        }
    }

    #[test]
    fn a_folder_that_holds_files_is_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("precious"), b"keep").unwrap();
        let error = AppearanceTextures::new(&params(None)).unwrap().export(dir.path()).unwrap_err();
        assert!(error.to_string().contains("holds files already; give a folder"), "{error}");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_the_user_does_not_give_is_grown_and_what_he_gives_is_final() {
        let chlorosis = Some(Chlorosis { deficiency: Deficiency::Nitrogen, severity: 1.0 });
        let deficient = LeafParams { look: LeafLook { chlorosis, ..LeafLook::default() }, ..params(None) };
        let grown = AppearanceTextures::new(&deficient).unwrap();
        let images = given(1, &[(TextureKind::Pigment, vec![1.0, 0.0, 0.2]), (TextureKind::Gloss, vec![0.2])]);
        let mixed = AppearanceTextures::new(&with_images(&deficient, images)).unwrap();
        for (a, b) in grown.samples.iter().zip(&mixed.samples) {
            assert_eq!((a.height_mm, a.thickness, a.structure), (b.height_mm, b.thickness, b.structure));
            assert_eq!((a.gloss[1], a.double_direction), (b.gloss[1], b.double_direction));
            assert_eq!(b.pigment.map(|v| (v * 1e4).round()), [20_000.0, 0.0, 4000.0]);
            assert!((b.gloss[0] - 0.2).abs() < 1e-6);
        }
        assert_ne!(grown.samples[7].pigment, mixed.samples[7].pigment);
    }

    #[test]
    fn a_structure_image_alone_gives_veins_everywhere() {
        // One main vein on the diagonal from the lower left to the upper right of 64 x 64 texels.
        let texel = |i: usize| if (i % 64).abs_diff(63 - i / 64) < 3 { [1.0, 0.0, 0.0] } else { [0.0, 0.0, 1.0] };
        let image = given(64, &[(TextureKind::Structure, (0..64 * 64).flat_map(texel).collect())]);
        let own = with_images(&params(Some(Species::Tree)), image);
        let textures = AppearanceTextures::new(&own).unwrap();
        let inside = |p: [f32; 2]| p.iter().all(|x| (3.0..27.0).contains(x));
        let on = |p: [f32; 2]| inside(p) && (p[0] - p[1]).abs() < 0.6;
        let off = |p: [f32; 2]| inside(p) && (p[0] - p[1]).abs() > 4.0;
        assert!(mean(&textures, |p, _| on(p), 0) < 0.4 * mean(&textures, |p, _| off(p), 0));
        let heights = |chosen: &dyn Fn([f32; 2]) -> bool, face: usize| {
            let nodes = textures.samples.iter().enumerate();
            let chosen: Vec<f32> = nodes
                .filter(|(node, _)| chosen(position(&textures.grid, *node)))
                .map(|(_, sample)| sample.height_mm[face])
                .collect();
            chosen.iter().sum::<f32>() / chosen.len() as f32
        };
        assert!(heights(&on, 0) < heights(&off, 0) - 0.15, "sunk above");
        assert!(heights(&on, 1) > heights(&off, 1) + 0.15, "standing out below");
        for (node, sample) in textures.samples.iter().enumerate() {
            if on(position(&textures.grid, node)) {
                let [x, y] = direction_of(sample.double_direction);
                assert!((x * y - 0.5).abs() < 0.03, "{x} {y}");
            }
        }
    }

    #[test]
    fn thicker_never_reflects_more() {
        for contents in [LeafContents::default(), Species::Maize.preset().contents] {
            let leaf = LeafParams { contents, ..params(None) };
            let of = |thickness| capture(&with_images(&leaf, given(1, &[(TextureKind::Thickness, vec![thickness])])));
            let (thin, middle, thick) = (of(0.25), of(0.5), of(1.0));
            // Red and green; blue is out of the gamut and may rise towards 0.
            for channel in [0, 1] {
                let of = |image: &[f32]| image.iter().skip(channel).step_by(3).copied().collect::<Vec<f32>>();
                for (brighter, darker) in [(of(&thin), of(&middle)), (of(&middle), of(&thick))] {
                    // Half precision.
                    assert!(brighter.iter().zip(&darker).all(|(a, b)| b <= &(a * 1.001 + 1e-4)));
                    let sum = |values: &[f32]| values.iter().sum::<f32>();
                    assert!(sum(&darker) < 0.97 * sum(&brighter));
                }
            }
        }
    }

    #[test]
    fn nitrogen_and_magnesium_show_in_the_textures_of_a_species() {
        // Texels fine enough for a lateral vein, and no margin for oblique views.
        let views = DirectionSet::new(vec![btf_capture::Direction::new(0.0, 0.0)]).unwrap();
        let params = |species: Option<Species>| {
            let params = params(species);
            LeafParams { capture: CaptureParams { size: 128, views: views.clone(), ..params.capture }, ..params }
        };
        // Grass has its veins closer together than these texels.
        for species in [Species::Maize, Species::Soybean, Species::Tree] {
            let of = |deficiency| {
                let chlorosis = Some(Chlorosis { deficiency, severity: 0.7 });
                let look = LeafLook { species: Some(species), chlorosis, ..LeafLook::default() };
                AppearanceTextures::new(&LeafParams { look, ..params(Some(species)) }).unwrap()
            };
            let healthy = AppearanceTextures::new(&params(Some(species))).unwrap();
            let starved = of(Deficiency::Magnesium);
            let on_vein = |textures: &AppearanceTextures| mean(textures, |_, s| s.structure[1] > 0.55, 0);
            let between = |textures: &AppearanceTextures| mean(textures, |_, s| s.structure[2] > 0.9, 0);
            let kept = [on_vein(&starved) / on_vein(&healthy), between(&starved) / between(&healthy)];
            assert!(kept[0] > 0.7 && kept[0] > 1.3 * kept[1], "{species:?}: {kept:?}");
            let pale = of(Deficiency::Nitrogen);
            let tip = mean(&pale, |p, s| p[1] > 25.0 && s.structure[2] > 0.6, 0);
            let base = mean(&pale, |p, s| p[1] < 5.0 && s.structure[2] > 0.6, 0);
            match species {
                Species::Maize => assert!(tip < 0.4 * base, "{tip} {base}"),
                _ => assert!((tip / base - 1.0).abs() < 0.25 && base < 0.6, "{species:?}: {tip} {base}"),
            }
        }
    }

    #[test]
    fn seeds_matter_and_threads_do_not() {
        for species in [None, Some(Species::Maize), Some(Species::Soybean), Some(Species::Tree)] {
            let grow = |threads: usize, seed: u64| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let params = params(species);
                let params = LeafParams { capture: CaptureParams { seed, size: 24, ..params.capture }, ..params };
                pool.install(|| AppearanceTextures::new(&params).unwrap())
            };
            assert!(grow(1, 1) == grow(3, 1) && grow(1, 1) != grow(1, 2), "{species:?}");
        }
    }

    #[test]
    fn a_leaf_turned_over_is_mirrored_with_its_faces_swapped() {
        let leaf = AppearanceTextures::new(&params(Some(Species::Tree))).unwrap();
        let turned = leaf.clone().turned_over();
        let side = leaf.grid.side;
        for (row, column) in [(3, 5), (40, 17), (70, 80)] {
            let (a, b) = (leaf.samples[row * side + column], turned.samples[row * side + side - 1 - column]);
            assert_eq!((a.pigment, a.thickness, a.structure), (b.pigment, b.thickness, b.structure));
            assert_eq!((a.height_mm, a.gloss), ([b.height_mm[1], b.height_mm[0]], [b.gloss[1], b.gloss[0]]));
            assert_eq!(a.double_direction, [b.double_direction[0], -b.double_direction[1]]);
            assert_ne!(a, leaf.samples[row * side + side - 1 - column]);
        }
        assert_eq!(turned.turned_over(), leaf);
    }

    #[test]
    fn a_blur_keeps_the_mean_of_the_middle_and_both_axes_alike() {
        let side = 41;
        let mut spot = vec![0f32; side * side];
        spot[20 * side + 20] = 1.0;
        let blurred = blurred(spot, side, 2);
        assert!((blurred.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        for away in 0..8 {
            assert!((blurred[20 * side + 20 + away] - blurred[(20 - away) * side + 20]).abs() < 1e-7);
        }
        assert!(blurred[20 * side + 20] > blurred[20 * side + 22] && blurred[20 * side + 28] == 0.0);
    }
}
