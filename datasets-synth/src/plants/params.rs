//! Parameters of plants and canopies.

use btf_models::Species;

use crate::error::{SynthError, check_range, check_ranges};

/// Largest number of plants of a canopy.
pub const MAX_PLANTS: usize = 10_000_000;

/// Largest number of unique triangles of a file; with more, its indices and bytes no longer make sense for one file.
pub const MAX_UNIQUE_TRIANGLES: usize = 50_000_000;

/// Number of plants in a canopy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CanopySize {
    /// Number of plants, in a field as square as rows allow.
    Plants(usize),
    /// Number of rows, and of plants in each.
    Rows(usize, usize),
    /// Smallest number of plants that gives at least this number of instanced triangles.
    Triangles(u64),
}

/// Form in which plants are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Triangles and instances, as binary glTF.
    Mesh,
    /// Cones and sheets, as a script of shapes ([`btf_models::shapes`]).
    Shapes,
}

/// How far the blades of maize stand from the vertical, as mean inclinations to the horizontal of a full-grown stand.
///
/// Published ellipsoidal distributions of maize have x = 0.76 to 2.52 [Campbell 1998, table 15.1], which are means of 62 to 33
/// degrees [Campbell 1990]; breeding has made blades more upright [Duvick 2005].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Habit {
    /// Blades that arch over and hang, as single plants and old varieties have them: 37 degrees, x = 2.2.
    Spreading,
    /// Between the others: 48 degrees, x = 1.4.
    Intermediate,
    /// Blades that stand up, as modern hybrids have them: 57 degrees, x = 0.97.
    Upright,
}

impl Habit {
    /// Returns [`PlantsParams::leaf_angle_deg`] and [`PlantsParams::bend`].
    pub fn blades(self) -> (f64, f64) {
        match self {
            Habit::Spreading => (35.0, 1.0),
            Habit::Intermediate => (25.0, 0.64),
            Habit::Upright => (21.0, 0.45),
        }
    }
}

/// Ground below the plants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ground {
    /// No ground.
    None,
    /// A rectangle of soil under the whole field.
    Soil,
}

/// Parameters of plants and their places. docs/guide/plants.md describes the effect of each parameter on each species.
#[derive(Debug, Clone, PartialEq)]
pub struct PlantsParams {
    /// Species.
    pub species: Species,
    /// Growth from just emerged (0) to flowering, or to the full-grown tree (1).
    pub stage: f64,
    /// Mean leaf angle in degrees, 5 to 85. Maize: between stalk and midrib at the collar. Grass: between the vertical
    /// and the blade's base. Others: between the horizontal and the blade or, of a spruce, the shoot.
    pub leaf_angle_deg: f64,
    /// How far the blades of maize bend, over what the plant's age and the blade's length make of it, 0 to 1.5.
    pub bend: f64,
    /// Number of triangles of a blade, 4 to 4000; rounded to whole rows.
    pub detail: usize,
    /// Number of different plants, of which the canopy has instances; 1 to 1000, no more than there are plants.
    pub variants: usize,
    /// Number of plants.
    pub size: CanopySize,
    /// Distance between rows in millimetres, 20 to 100000.
    pub row_spacing_mm: f64,
    /// Distance between plants in a row in millimetres, 20 to 100000.
    pub spacing_mm: f64,
    /// Number of branches of a full-grown tree, its trunk included, 1 to 100000.
    pub branches: usize,
    /// Number of leaves of a full-grown tree, of a spruce of its shoots, 1 to 1000000.
    pub leaves: usize,
    /// Number of blades of a patch of grass, 1 to 100000.
    pub blades: usize,
    /// Share of patches of grass that have a flower, 0 to 1.
    pub flowers: f64,
    /// Ground below the plants.
    pub ground: Ground,
    /// Form in which the plants are written.
    pub form: Form,
    /// Seed of everything random.
    pub seed: u64,
}

impl PlantsParams {
    /// Returns the parameters of one full-grown plant of a species, at its usual distances.
    pub fn of(species: Species) -> PlantsParams {
        let (leaf_angle_deg, detail, row_spacing_mm, spacing_mm) = match species {
            Species::Maize => (35.0, 200, 750.0, 180.0),
            Species::Soybean => (30.0, 40, 500.0, 80.0),
            Species::Tree => (35.0, 8, 4000.0, 4000.0),
            Species::Grass => (20.0, 14, 40.0, 40.0),
            Species::Spruce => (35.0, 8, 2000.0, 2000.0),
        };
        PlantsParams {
            species,
            stage: 1.0,
            leaf_angle_deg,
            bend: 1.0,
            detail,
            variants: 8,
            size: CanopySize::Plants(1),
            row_spacing_mm,
            spacing_mm,
            branches: 2000,
            leaves: 6000,
            blades: 16,
            flowers: 0.5,
            ground: Ground::None,
            form: Form::Mesh,
            seed: 1,
        }
    }

    /// Returns the numbers of branches and leaves of a tree at its stage, which grow with the square of its height; at
    /// least 1 each.
    pub(crate) fn branches_and_leaves(&self) -> [usize; 2] {
        let share = self.stage.max(0.05).powi(2);
        [self.branches, self.leaves].map(|count| ((count as f64 * share).round() as usize).max(1))
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first that is out of its range.
    pub fn check(&self) -> Result<(), SynthError> {
        check_ranges(&[
            ("--stage", self.stage, 0.0, 1.0),
            ("--leaf-angle-deg", self.leaf_angle_deg, 5.0, 85.0),
            ("--bend", self.bend, 0.0, 1.5),
            ("--detail", self.detail as f64, 4.0, 4000.0),
            ("--variants", self.variants as f64, 1.0, 1000.0),
            ("--row-spacing-mm", self.row_spacing_mm, 20.0, 100_000.0),
            ("--spacing-mm", self.spacing_mm, 20.0, 100_000.0),
            ("--branches", self.branches as f64, 1.0, 100_000.0),
            ("--leaves", self.leaves as f64, 1.0, 1_000_000.0),
            ("--blades", self.blades as f64, 1.0, 100_000.0),
            ("--flowers", self.flowers, 0.0, 1.0),
        ])?;
        let most = MAX_PLANTS as f64;
        match self.size {
            CanopySize::Plants(plants) => check_range("--plants", plants as f64, 1.0, most),
            CanopySize::Rows(rows, columns) => {
                check_ranges(&[("--rows", rows as f64, 1.0, most), ("--columns", columns as f64, 1.0, most)])?;
                check_range("--rows times --columns", rows as f64 * columns as f64, 1.0, most)
            }
            CanopySize::Triangles(triangles) => check_range("--triangles", triangles as f64, 1.0, 1e12),
        }
    }
}

/// Returns 0 below `from`, 1 above `to`, and a smooth step between.
pub(crate) fn smooth(from: f64, to: f64, x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
