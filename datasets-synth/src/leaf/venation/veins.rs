//! Venation of any kind: finds the place of a point among the veins.

use crate::leaf::venation::parallel::ParallelVenation;
use crate::leaf::venation::pinnate::PinnateVenation;
use crate::leaf::venation::site::VeinSite;
use crate::leaf::venation::traits::VenationTraits;

/// Veins of one leaf, in millimetres from the lower left corner of the patch; the tip of the leaf lies upwards.
#[derive(Debug, Clone)]
pub(crate) enum Venation {
    /// Pinnate veins, whose secondaries leave a main vein to either side: most broad leaves.
    Pinnate(PinnateVenation),
    /// Parallel veins, which all run along the blade: grasses.
    Parallel(ParallelVenation),
    /// Other veins, shifted row by row so that the main vein runs straight up at x = `middle_mm`.
    Centred { veins: Box<Venation>, middle_mm: f32 },
}

impl Venation {
    /// Generates the veins of a patch of `size_mm` with `margin_mm` around it. Equal seeds give equal veins at any
    /// resolution.
    pub fn new(traits: &VenationTraits, size_mm: f32, margin_mm: f32, seed: u64) -> Venation {
        match traits {
            VenationTraits::Pinnate(traits) => {
                Venation::Pinnate(PinnateVenation::new(traits, size_mm, margin_mm, seed))
            }
            VenationTraits::Parallel(traits) => {
                Venation::Parallel(ParallelVenation::new(traits, size_mm, margin_mm, seed))
            }
        }
    }

    /// Generates veins whose main vein runs straight up the middle of the patch, for a patch that is a whole blade.
    /// Directions of veins keep the lean that the main vein had, a few degrees.
    pub fn centred(traits: &VenationTraits, size_mm: f32, margin_mm: f32, seed: u64) -> Venation {
        /// Largest distance of a main vein from the middle, as a share of the patch.
        const FARTHEST: f32 = 0.35;
        let veins = Venation::new(traits, size_mm, margin_mm + FARTHEST * size_mm, seed);
        Venation::Centred { veins: Box::new(veins), middle_mm: 0.5 * size_mm }
    }

    /// Returns the place of `position_mm` among the veins.
    pub fn site(&self, position_mm: [f32; 2]) -> VeinSite {
        match self {
            Venation::Pinnate(veins) => veins.site(position_mm),
            Venation::Parallel(veins) => veins.site(position_mm),
            Venation::Centred { veins, middle_mm } => {
                let [x, y] = position_mm;
                veins.site([x - veins.site([*middle_mm, y]).across, y])
            }
        }
    }
}
