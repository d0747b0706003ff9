//! A leaf patch: what was asked for, and the grids that rendering reads.

use btf_capture::{DirectionSet, ImageFormat};
use rayon::prelude::*;

use crate::error::SynthError;
use crate::leaf::relief::{RELIEF_BOUND_MM, Relief};
use crate::leaf::venation::Venation;
use crate::optics::colour::{LeafContents, SpectrumToRgb};
use crate::optics::cook_torrance::{CUTICLE_INDEX, CookTorrance, MIN_ROUGHNESS};
use crate::surface::capture_params::{MAX_CAPTURE_SIZE, MAX_CAPTURE_THETA_DEG};
use crate::surface::grid::Grid;
use crate::surface::height_field::HeightField;

/// Largest side of a capture in texels.
pub const MAX_LEAF_SIZE: usize = MAX_CAPTURE_SIZE;

/// Steepest direction that a leaf is rendered under, in degrees: beyond it a ray crosses more
/// relief than the patch has.
pub const MAX_LEAF_THETA_DEG: f64 = MAX_CAPTURE_THETA_DEG;

/// What leaf to make and how to photograph it.
#[derive(Debug, Clone, PartialEq)]
pub struct LeafParams {
    /// Width and height of the images in texels, 8 to [`MAX_LEAF_SIZE`].
    pub size: usize,
    /// Width and height of the patch in millimetres, 1 to 200.
    pub size_mm: f32,
    /// What the blade holds; veins deviate from it.
    pub contents: LeafContents,
    /// Roughness of the gloss (rms slope of its facets), 0.05 to 1.
    pub roughness: f64,
    /// Seed of veins and relief.
    pub seed: u64,
    /// Directions towards the eye, polar angle at most [`MAX_LEAF_THETA_DEG`].
    pub views: DirectionSet,
    /// Directions towards the light, the same.
    pub lights: DirectionSet,
    /// Format of the images.
    pub format: ImageFormat,
}

impl Default for LeafParams {
    /// A green leaf, 256 x 256 texels of 20 x 20 mm, Bonn's 81 x 81 directions, png, seed 1.
    fn default() -> LeafParams {
        LeafParams {
            size: 256,
            size_mm: 20.0,
            contents: LeafContents::default(),
            roughness: 0.3,
            seed: 1,
            views: DirectionSet::bonn81(),
            lights: DirectionSet::bonn81(),
            format: ImageFormat::Png,
        }
    }
}

impl LeafParams {
    /// Checks every range.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first that is out of its range.
    pub fn check(&self) -> Result<(), SynthError> {
        let contents = &self.contents;
        for (name, value, low, high) in [
            ("--size", self.size as f64, 8.0, MAX_LEAF_SIZE as f64),
            ("--size-mm", f64::from(self.size_mm), 1.0, 200.0),
            ("--cab", contents.chlorophyll_ug_per_cm2, 0.0, 100.0),
            ("--car", contents.carotenoid_ug_per_cm2, 0.0, 25.0),
            ("--cbrown", contents.brown, 0.0, 1.0),
            ("--cw", contents.water_cm, 0.0, 0.04),
            ("--cm", contents.dry_matter_g_per_cm2, 0.0, 0.02),
            ("--n", contents.structure, 1.0, 3.0),
            ("--gamma", self.roughness, MIN_ROUGHNESS, 1.0),
        ] {
            // Not `<`, so that a NaN is refused, too.
            if !(low..=high).contains(&value) {
                let allowed = format!("a number from {low} to {high}");
                return Err(SynthError::BadParameter { name, value: value.to_string(), allowed });
            }
        }
        for set in [&self.views, &self.lights] {
            if let Some(d) = set.directions().iter().find(|d| d.theta_deg > MAX_LEAF_THETA_DEG) {
                let allowed = format!("directions within {MAX_LEAF_THETA_DEG} degrees of the normal");
                return Err(SynthError::BadParameter { name: "--directions", value: d.to_string(), allowed });
            }
        }
        Ok(())
    }

    /// What was asked for in one line, for the capture's provenance.
    pub fn provenance(&self) -> String {
        let c = &self.contents;
        format!(
            "btf-synth leaf: model plate-exact, chlorophyll {} ug/cm2, carotenoids {} ug/cm2, brown {}, water {} cm, \
             dry matter {} g/cm2, N {}, gloss roughness {} of index {CUTICLE_INDEX}, upper face, seed {}, synthetic",
            c.chlorophyll_ug_per_cm2,
            c.carotenoid_ug_per_cm2,
            c.brown,
            c.water_cm,
            c.dry_matter_g_per_cm2,
            c.structure,
            self.roughness,
            self.seed,
        )
    }
}

/// A leaf patch's upper face on a grid: relief, body colour, gloss. Lengths in millimetres, the
/// origin at the patch's lower left corner, x to the right, y up, z towards the viewer with mean
/// height 0 over the patch.
#[derive(Debug, Clone)]
pub struct Leaf {
    pub(crate) face: HeightField,
    pub(crate) size: usize,
    /// Linear sRGB share of entered light that leaves again; gloss.
    pub(crate) surface: Vec<[f32; 4]>,
    pub(crate) lobe: CookTorrance,
}

impl Leaf {
    /// Grows the leaf. Deterministic by seed, on all threads of the current pool.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`].
    ///
    /// Cost: 31 plate evaluations per grid node (some microseconds), of which there are four
    /// per texel and some in the margin.
    pub fn new(params: &LeafParams) -> Result<Leaf, SynthError> {
        params.check()?;
        let texel_mm = params.size_mm / params.size as f32;
        let grid = Grid::for_patch(params.size, params.size_mm, RELIEF_BOUND_MM, &params.views);
        let venation = Venation::new(params.size_mm, grid.margin_mm, params.seed);
        let relief = Relief::new(venation, texel_mm, params.seed);
        let convert = SpectrumToRgb::new();

        let nodes: Vec<(f32, [f32; 4])> = (0..grid.len())
            .into_par_iter()
            .map(|node| {
                let (height, tissue) = relief.at(grid.position_mm(node % grid.side, node / grid.side));
                let contents = LeafContents {
                    chlorophyll_ug_per_cm2: params.contents.chlorophyll_ug_per_cm2 * f64::from(tissue.chlorophyll),
                    carotenoid_ug_per_cm2: params.contents.carotenoid_ug_per_cm2 * f64::from(tissue.carotenoid),
                    brown: params.contents.brown * f64::from(tissue.brown),
                    ..params.contents
                };
                let [r, g, b] = convert.plate_rgb(&contents.absorption(), f64::from(tissue.thickness));
                (height, [r as f32, g as f32, b as f32, tissue.gloss])
            })
            .collect();

        let (height_mm, surface) = nodes.into_iter().unzip();
        Ok(Leaf {
            face: HeightField::new(grid, params.size_mm, height_mm),
            size: params.size,
            surface,
            lobe: CookTorrance::new(CUTICLE_INDEX, params.roughness),
        })
    }

    /// Height of the relief in millimetres at a position in millimetres from the patch's lower
    /// left corner.
    pub fn height_mm(&self, position_mm: [f32; 2]) -> f32 {
        self.face.height_mm(position_mm)
    }

    /// Unit normal of the relief at a position.
    pub fn normal(&self, position_mm: [f32; 2]) -> [f32; 3] {
        self.face.normal(position_mm)
    }

    /// Linear sRGB share of the light entered at a position that leaves again in front, the body
    /// colour below the gloss; signed.
    pub fn body_rgb(&self, position_mm: [f32; 2]) -> [f32; 3] {
        let [r, g, b, _] = self.surface_at(position_mm);
        [r, g, b]
    }

    /// Strength of the gloss at a position, 0 to 1.
    pub fn gloss(&self, position_mm: [f32; 2]) -> f32 {
        self.surface_at(position_mm)[3]
    }

    /// The gloss lobe.
    pub fn lobe(&self) -> &CookTorrance {
        &self.lobe
    }

    fn surface_at(&self, position_mm: [f32; 2]) -> [f32; 4] {
        self.face.grid.corners(self.face.grid.cells(position_mm)).sample_all(&self.surface)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn small() -> LeafParams {
        LeafParams {
            size: 48,
            views: DirectionSet::random(4, 1).unwrap(),
            lights: DirectionSet::random(5, 2).unwrap(),
            ..LeafParams::default()
        }
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let named = |params: LeafParams| params.check().unwrap_err().to_string();
        assert!(named(LeafParams { size: 7, ..small() }).contains("--size is 7"));
        assert!(named(LeafParams { roughness: f64::NAN, ..small() }).contains("--gamma"));
        let contents = LeafContents { structure: 0.5, ..LeafContents::default() };
        assert!(named(LeafParams { contents, ..small() }).contains("--n is 0.5"));
        let lights = DirectionSet::new(vec![btf_capture::Direction::new(89.0, 0.0)]).unwrap();
        assert!(named(LeafParams { lights, ..small() }).contains("--directions"));
        small().check().unwrap();
    }

    #[test]
    fn the_same_seed_gives_the_same_leaf_on_any_number_of_threads() {
        let grow = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| Leaf::new(&LeafParams { seed, ..small() }).unwrap())
        };
        let (one, three, other) = (grow(1, 1), grow(3, 1), grow(1, 2));
        assert_eq!(one.face.height_map_mm(48), three.face.height_map_mm(48));
        assert_eq!(one.surface, three.surface);
        assert_ne!(one.face.height_map_mm(48), other.face.height_map_mm(48));
    }

    #[test]
    fn normals_are_the_gradient_of_the_height() {
        let leaf = Leaf::new(&LeafParams { size: 128, ..small() }).unwrap();
        let h = leaf.face.grid.cell_mm;
        for i in 0..200 {
            // On nodes, where the tabulated slope is the central difference itself.
            let node = [(40 + i % 20) as f32 * h, (60 + i / 20) as f32 * h];
            let n = leaf.normal(node);
            let difference =
                (leaf.height_mm([node[0] + h, node[1]]) - leaf.height_mm([node[0] - h, node[1]])) / (2.0 * h);
            assert!((-n[0] / n[2] - difference).abs() < 2e-3, "{n:?} {difference}");
            assert!((n.iter().map(|c| c * c).sum::<f32>() - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn the_blade_is_green_and_never_brighter_than_white() {
        let leaf = Leaf::new(&small()).unwrap();
        for i in 0..400 {
            let p = [(i % 20) as f32, (i / 20) as f32];
            let [r, g, b] = leaf.body_rgb(p);
            assert!(g > b && g < 1.0 && r < 1.0 && b > -0.1, "{r} {g} {b}");
            assert!((0.0..=1.0).contains(&leaf.gloss(p)));
        }
    }
}
