//! A leaf patch: what was asked for, and the grids that rendering reads.

use btf_capture::{DirectionSet, ImageFormat};
use rayon::prelude::*;

use crate::error::SynthError;
use crate::leaf::relief::{RELIEF_BOUND_MM, TextureSample};
use crate::leaf::species::Species;
use crate::leaf::textures::{AppearanceTextures, LeafLook};
use crate::leaf::vein::direction_of;
use crate::optics::colour::{LeafContents, SpectrumToRgb};
use crate::optics::cook_torrance::{CUTICLE_INDEX, CookTorrance, MIN_ROUGHNESS};
use crate::surface::grid::Grid;

/// Largest side of a capture in texels.
pub const MAX_LEAF_SIZE: usize = 2048;

/// Steepest direction that a leaf is rendered under, in degrees: beyond it a ray crosses more
/// relief than the patch has.
pub const MAX_LEAF_THETA_DEG: f64 = 88.0;

/// Nodes of the relief's grid per texel and axis.
const NODES_PER_TEXEL: f32 = 2.0;

/// Margins are made for directions up to this polar angle; steeper rays read the edge.
const MARGIN_THETA_DEG: f64 = 82.0;

/// Margin beyond what the view's parallax needs, in millimetres: for shadows from outside.
const SHADOW_MARGIN_MM: f32 = 1.0;

/// A face of a leaf.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LeafFace {
    /// The upper face.
    #[default]
    Adaxial,
    /// The lower face, seen with the leaf turned over about y: what is left on the upper face is right.
    Abaxial,
}

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
    /// Face that is seen.
    pub face: LeafFace,
    /// Species, deficiency, and textures of the user's own.
    pub look: LeafLook,
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
            face: LeafFace::Adaxial,
            look: LeafLook::default(),
            seed: 1,
            views: DirectionSet::bonn81(),
            lights: DirectionSet::bonn81(),
            format: ImageFormat::Png,
        }
    }
}

impl LeafParams {
    /// The patch, contents and roughness of a species' preset, otherwise as the default.
    pub fn of(species: Species) -> LeafParams {
        let preset = species.preset();
        LeafParams {
            size_mm: preset.size_mm,
            contents: preset.contents,
            roughness: preset.gamma(),
            look: LeafLook { species: Some(species), ..LeafLook::default() },
            ..LeafParams::default()
        }
    }

    /// The nodes of the patch with the margin that its steepest view needs.
    pub(crate) fn grid(&self) -> Grid {
        let steepest = self.views.directions().iter().map(|d| d.theta_deg).fold(0.0, f64::max);
        let slope = steepest.min(MARGIN_THETA_DEG).to_radians().tan() as f32;
        let texel_mm = self.size_mm / self.size as f32;
        Grid::new(self.size_mm, texel_mm / NODES_PER_TEXEL, RELIEF_BOUND_MM * slope + SHADOW_MARGIN_MM)
    }

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
        self.look.check()?;
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
        let face = match self.face {
            LeafFace::Adaxial => "upper face",
            LeafFace::Abaxial => "lower face",
        };
        format!(
            "btf-synth leaf: model plate-exact, chlorophyll {} ug/cm2, carotenoids {} ug/cm2, brown {}, water {} cm, \
             dry matter {} g/cm2, N {}, gloss roughness {} of index {CUTICLE_INDEX}{}, {face}, seed {}, synthetic",
            c.chlorophyll_ug_per_cm2,
            c.carotenoid_ug_per_cm2,
            c.brown,
            c.water_cm,
            c.dry_matter_g_per_cm2,
            c.structure,
            self.roughness,
            self.look.provenance(),
            self.seed,
        )
    }
}

/// One face of a leaf patch on a grid: relief, body colour, gloss. Lengths in millimetres, the
/// origin at the patch's lower left corner, x to the right, y up, z towards the viewer with mean
/// height 0 over the patch.
#[derive(Debug, Clone)]
pub struct Leaf {
    pub(crate) grid: Grid,
    pub(crate) size: usize,
    pub(crate) size_mm: f32,
    pub(crate) height_mm: Vec<f32>,
    /// Slopes dz/dx, dz/dy; linear sRGB share of entered light that leaves again; gloss.
    pub(crate) surface: Vec<[f32; 6]>,
    pub(crate) lowest_mm: f32,
    pub(crate) highest_mm: f32,
    pub(crate) lobe: CookTorrance,
    /// Height of the other face out of that face, in this face's x and y; mean 0 over the patch.
    other_height_mm: Vec<f32>,
    /// Twice the angle of the vein direction, as cosine and sine.
    double_direction: Vec<[f32; 2]>,
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
        let textures = AppearanceTextures::new(params)?;
        let textures = match params.face {
            LeafFace::Adaxial => textures,
            LeafFace::Abaxial => textures.turned_over(),
        };
        let grid = textures.grid;
        let convert = SpectrumToRgb::new();
        let body: Vec<[f32; 4]> =
            textures.samples.par_iter().map(|sample| body_and_gloss(sample, &params.contents, &convert)).collect();

        // Mean height 0 over the patch itself; summed in order, so threads do not matter.
        let inside = |node: usize| {
            let p = grid.position_mm(node % grid.side, node / grid.side);
            p.iter().all(|x| (0.0..=params.size_mm).contains(x))
        };
        let centred = |face: usize| -> Vec<f32> {
            let height = |node: usize| textures.samples[node].height_mm[face];
            let (sum, count) = (0..grid.len())
                .filter(|&node| inside(node))
                .fold((0f64, 0usize), |(sum, count), node| (sum + f64::from(height(node)), count + 1));
            let mean = (sum / count as f64) as f32;
            (0..grid.len()).map(|node| height(node) - mean).collect()
        };
        let (height_mm, other_height_mm) = (centred(0), centred(1));

        let at = |column: usize, row: usize| height_mm[row * grid.side + column];
        let surface = (0..grid.len())
            .into_par_iter()
            .map(|node| {
                let (column, row) = (node % grid.side, node / grid.side);
                let (left, right) = (column.saturating_sub(1), (column + 1).min(grid.side - 1));
                let (below, above) = (row.saturating_sub(1), (row + 1).min(grid.side - 1));
                let slope_x = (at(right, row) - at(left, row)) / ((right - left) as f32 * grid.cell_mm);
                let slope_y = (at(column, above) - at(column, below)) / ((above - below) as f32 * grid.cell_mm);
                let [r, g, b, gloss] = body[node];
                [slope_x, slope_y, r, g, b, gloss]
            })
            .collect();
        let lowest_mm = height_mm.iter().copied().fold(f32::MAX, f32::min);
        let highest_mm = height_mm.iter().copied().fold(f32::MIN, f32::max);
        Ok(Leaf {
            grid,
            size: params.size,
            size_mm: params.size_mm,
            height_mm,
            surface,
            lowest_mm,
            highest_mm,
            lobe: CookTorrance::new(CUTICLE_INDEX, params.roughness),
            other_height_mm,
            double_direction: textures.samples.iter().map(|sample| sample.double_direction).collect(),
        })
    }

    /// Height of the relief in millimetres at a position in millimetres from the patch's lower
    /// left corner.
    pub fn height_mm(&self, position_mm: [f32; 2]) -> f32 {
        self.grid.corners(self.grid.cells(position_mm)).sample(&self.height_mm)
    }

    /// Unit normal of the relief at a position.
    pub fn normal(&self, position_mm: [f32; 2]) -> [f32; 3] {
        let s = self.surface_at(position_mm);
        let scale = 1.0 / (1.0 + s[0] * s[0] + s[1] * s[1]).sqrt();
        [-s[0] * scale, -s[1] * scale, scale]
    }

    /// Linear sRGB share of the light entered at a position that leaves again in front, the body
    /// colour below the gloss; signed.
    pub fn body_rgb(&self, position_mm: [f32; 2]) -> [f32; 3] {
        let s = self.surface_at(position_mm);
        [s[2], s[3], s[4]]
    }

    /// Strength of the gloss at a position, 0 to 1.
    pub fn gloss(&self, position_mm: [f32; 2]) -> f32 {
        self.surface_at(position_mm)[5]
    }

    /// Height in millimetres of the other face, out of that face, at a position of this one.
    pub fn other_height_mm(&self, position_mm: [f32; 2]) -> f32 {
        self.grid.corners(self.grid.cells(position_mm)).sample(&self.other_height_mm)
    }

    /// Unit vector along the veins near a position, in the plane of the patch; y is not negative.
    pub fn vein_direction(&self, position_mm: [f32; 2]) -> [f32; 2] {
        direction_of(self.grid.corners(self.grid.cells(position_mm)).sample_all(&self.double_direction))
    }

    /// The gloss lobe.
    pub fn lobe(&self) -> &CookTorrance {
        &self.lobe
    }

    fn surface_at(&self, position_mm: [f32; 2]) -> [f32; 6] {
        self.grid.corners(self.grid.cells(position_mm)).sample_all(&self.surface)
    }
}

/// Linear sRGB of the body and strength of the gloss of a node.
fn body_and_gloss(sample: &TextureSample, contents: &LeafContents, convert: &SpectrumToRgb) -> [f32; 4] {
    let [chlorophyll, carotenoid, brown] = sample.pigment.map(f64::from);
    let contents = LeafContents {
        chlorophyll_ug_per_cm2: contents.chlorophyll_ug_per_cm2 * chlorophyll,
        carotenoid_ug_per_cm2: contents.carotenoid_ug_per_cm2 * carotenoid,
        brown: contents.brown * brown,
        ..*contents
    };
    let [r, g, b] = convert.plate_rgb(&contents.absorption(), f64::from(sample.thickness));
    [r as f32, g as f32, b as f32, sample.gloss[0]]
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
        assert_eq!(one.height_mm, three.height_mm);
        assert_eq!(one.surface, three.surface);
        assert_ne!(one.height_mm, other.height_mm);
    }

    #[test]
    fn normals_are_the_gradient_of_the_height() {
        let leaf = Leaf::new(&LeafParams { size: 128, ..small() }).unwrap();
        let h = leaf.grid.cell_mm;
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
