//! Species: course and depth of the veins, and variation of the tissue. For contents and specular lobe of a species see
//! [`Species::preset`].
//!
//! | species | veins |
//! |---|---|
//! | maize | parallel, wide midrib, commissures |
//! | soybean | pinnate, fine reticulum |
//! | tree | pinnate, strong secondaries, ladder tertiaries |
//! | grass | parallel, narrow midrib: maize at a quarter of its lengths |
//! | spruce | a shoot: its twig is the midrib, the gaps between its needles are secondaries |
//! | none | pinnate, two Voronoi networks |
//!
//! Where the numbers come from: lengths are the usual sizes of such leaves within a tenth or so (maize: laterals 1 to 2
//! mm apart with some ten small veins between, of which a texel of 0.1 mm can carry three; midrib 2 to 4 mm; broad
//! leaves: secondaries 5 to 10 mm apart on either side, tertiaries 1 to 3 mm).
//!
//! Differs from the paper in: the paper gives veins more carotenoids than the mesophyll (V_c); the midrib of maize has
//! less here, because it is white and not yellow.
//!
//! When it is wrong: a species is a look, no botanical measurement; cultivar, age and growth change every number by
//! half. Hairs are a weaker, rougher lobe and not hairs.

use btf_models::Species;

use crate::leaf::venation::traits::{ParallelTraits, PinnateTraits, RungTraits, TertiaryTraits, VenationTraits};

/// Traits of a species that shape the faces of a leaf.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Traits {
    pub venation: VenationTraits,
    pub relief: ReliefTraits,
    pub tissue: TissueTraits,
}

/// Depths and heights in millimetres. Four numbers are for the main, secondary, tertiary and finest veins.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ReliefTraits {
    /// Depth of the grooves over the veins in the adaxial face.
    pub groove_mm: [f32; 4],
    /// Height of the ridges under the veins on the abaxial face.
    pub ridge_mm: [f32; 4],
    /// Width of groove and ridge over that of the vein, of the two great orders.
    pub groove_widths: [f32; 2],
    /// Half-width of tertiary and of the finest veins.
    pub fine_half_widths_mm: [f32; 2],
    /// Height of the adaxial blade between great veins over the blade beside them.
    pub bulge_mm: f32,
    /// Distance from a great vein over which the blade rises.
    pub bulge_reach_mm: f32,
    /// Difference of the distances to two great veins below which the blade is rounded between them.
    pub axil_mm: f32,
    /// Height of the blade inside a tertiary area over its border.
    pub areole_bulge_mm: f32,
    /// Distance from a tertiary vein over which the area rises.
    pub areole_reach_mm: f32,
    /// Wavelength and amplitude of the slow waves of the whole blade.
    pub waves_mm: [(f32, f32); 2],
    /// Wavelength and amplitude of the epidermis' bumps.
    pub bumps_mm: [(f32, f32); 3],
    /// Ratio of the heights of the bumps of the abaxial and of the adaxial face.
    pub abaxial_bumps: f32,
    /// Ratio of the lengths of waves, bumps and mottle along the blade and across it.
    pub stretch: f32,
}

/// Factors on the contents. Four numbers are for the finest, tertiary, secondary and main veins.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TissueTraits {
    pub chlorophyll: [f32; 4],
    pub carotenoid: [f32; 4],
    pub brown: [f32; 4],
    pub gloss: [f32; 4],
    pub thickness: [f32; 4],
    /// Visibility of a tertiary and of a finest vein.
    pub fine_strength: [f32; 2],
    /// Strength of the specular lobe of the blade.
    pub blade_gloss: f32,
    /// Strength of the specular lobe of the abaxial face over that of the adaxial one.
    pub abaxial_gloss: f32,
    /// Unevenness of the chlorophyll, 1 for the plain leaf.
    pub mottle: f32,
}

/// Plain leaf, used without a species.
const PLAIN: Traits = Traits {
    venation: VenationTraits::Pinnate(PinnateTraits {
        main_half_width_mm: 0.42,
        main_taper_per_mm: 0.008,
        secondary_half_width_mm: 0.17,
        secondary_length_mm: 22.0,
        secondary_share_of_patch: 0.0,
        secondary_spacing_mm: 3.4,
        secondary_angles_deg: [62.0, 28.0],
        secondary_angle_jitter: 0.06,
        secondary_wave_deg: 6.0,
        tertiary: TertiaryTraits::Network { cell_mm: 1.7 },
        finest_cell_mm: 0.62,
    }),
    relief: ReliefTraits {
        groove_mm: [0.20, 0.11, 0.028, 0.008],
        ridge_mm: [0.24, 0.14, 0.035, 0.009],
        groove_widths: [1.3, 1.4],
        fine_half_widths_mm: [0.075, 0.045],
        bulge_mm: 0.20,
        bulge_reach_mm: 1.1,
        axil_mm: 0.0,
        areole_bulge_mm: 0.05,
        areole_reach_mm: 0.35,
        waves_mm: [(9.0, 0.12), (3.6, 0.035)],
        bumps_mm: [(0.55, 0.010), (0.34, 0.006), (0.22, 0.0035)],
        abaxial_bumps: 1.3,
        stretch: 1.0,
    },
    tissue: TissueTraits {
        chlorophyll: [0.82, 0.62, 0.38, 0.26],
        carotenoid: [1.0, 1.05, 1.2, 1.3],
        brown: [1.0, 1.1, 1.6, 2.0],
        gloss: [0.70, 0.72, 0.85, 0.95],
        thickness: [1.02, 1.06, 1.25, 1.5],
        fine_strength: [0.8, 0.6],
        blade_gloss: 0.70,
        abaxial_gloss: 0.7,
        mottle: 1.0,
    },
};

const TREE: Traits = Traits {
    venation: VenationTraits::Pinnate(PinnateTraits {
        main_half_width_mm: 0.50,
        main_taper_per_mm: 0.006,
        secondary_half_width_mm: 0.24,
        secondary_length_mm: 26.0,
        secondary_share_of_patch: 1.25,
        secondary_spacing_mm: 3.9,
        secondary_angles_deg: [50.0, 36.0],
        secondary_angle_jitter: 0.04,
        secondary_wave_deg: 1.5,
        tertiary: TertiaryTraits::Rungs(RungTraits {
            spacing_mm: 1.7,
            spacing_jitter: 0.16,
            wander_mm: 0.30,
            bow: 0.05,
            forks: 0.22,
            ties: 0.0,
        }),
        finest_cell_mm: 0.55,
    }),
    relief: ReliefTraits {
        groove_mm: [0.20, 0.13, 0.024, 0.007],
        ridge_mm: [0.25, 0.18, 0.06, 0.012],
        groove_widths: [1.3, 1.4],
        fine_half_widths_mm: [0.070, 0.040],
        bulge_mm: 0.19,
        bulge_reach_mm: 1.3,
        axil_mm: 0.9,
        areole_bulge_mm: 0.024,
        areole_reach_mm: 0.40,
        waves_mm: [(11.0, 0.11), (4.0, 0.025)],
        bumps_mm: [(0.55, 0.007), (0.34, 0.004), (0.22, 0.0025)],
        abaxial_bumps: 1.6,
        stretch: 1.0,
    },
    tissue: TissueTraits {
        chlorophyll: [0.80, 0.55, 0.28, 0.17],
        carotenoid: [1.0, 1.0, 1.02, 1.05],
        brown: [1.0, 1.1, 1.6, 2.0],
        gloss: [0.85, 0.85, 0.92, 0.97],
        thickness: [1.02, 1.06, 1.2, 1.35],
        fine_strength: [0.8, 0.55],
        blade_gloss: 0.85,
        abaxial_gloss: 0.45,
        mottle: 0.8,
    },
};

const SOYBEAN: Traits = Traits {
    venation: VenationTraits::Pinnate(PinnateTraits {
        main_half_width_mm: 0.36,
        main_taper_per_mm: 0.009,
        secondary_half_width_mm: 0.16,
        secondary_length_mm: 24.0,
        secondary_share_of_patch: 1.25,
        secondary_spacing_mm: 4.3,
        secondary_angles_deg: [56.0, 26.0],
        secondary_angle_jitter: 0.07,
        secondary_wave_deg: 5.0,
        tertiary: TertiaryTraits::Rungs(RungTraits {
            spacing_mm: 2.2,
            spacing_jitter: 0.26,
            wander_mm: 0.80,
            bow: 0.03,
            forks: 0.15,
            ties: 0.8,
        }),
        finest_cell_mm: 0.72,
    }),
    relief: ReliefTraits {
        groove_mm: [0.15, 0.09, 0.030, 0.012],
        ridge_mm: [0.26, 0.16, 0.05, 0.016],
        groove_widths: [1.3, 1.5],
        fine_half_widths_mm: [0.060, 0.045],
        bulge_mm: 0.16,
        bulge_reach_mm: 1.4,
        axil_mm: 0.9,
        areole_bulge_mm: 0.06,
        areole_reach_mm: 0.45,
        waves_mm: [(9.0, 0.13), (3.4, 0.045)],
        bumps_mm: [(0.55, 0.014), (0.34, 0.009), (0.22, 0.005)],
        abaxial_bumps: 1.8,
        stretch: 1.0,
    },
    tissue: TissueTraits {
        chlorophyll: [0.72, 0.45, 0.32, 0.22],
        carotenoid: [1.0, 1.0, 1.02, 1.05],
        brown: [1.0, 1.1, 1.5, 1.8],
        gloss: [0.40, 0.42, 0.50, 0.58],
        thickness: [1.04, 1.08, 1.2, 1.35],
        fine_strength: [0.75, 0.75],
        blade_gloss: 0.38,
        abaxial_gloss: 0.7,
        mottle: 1.1,
    },
};

const MAIZE: Traits = Traits {
    venation: VenationTraits::Parallel(ParallelTraits {
        main_half_width_mm: 1.25,
        main_taper_per_mm: 0.006,
        lateral_half_width_mm: 0.10,
        lateral_spacing_mm: 1.55,
        fine_spacing_mm: 0.36,
        commissure_spacing_mm: 1.5,
    }),
    relief: ReliefTraits {
        groove_mm: [0.34, 0.030, 0.008, 0.003],
        ridge_mm: [0.42, 0.055, 0.012, 0.004],
        groove_widths: [0.9, 1.6],
        fine_half_widths_mm: [0.060, 0.035],
        bulge_mm: 0.045,
        bulge_reach_mm: 0.5,
        axil_mm: 0.3,
        areole_bulge_mm: 0.012,
        areole_reach_mm: 0.15,
        waves_mm: [(10.0, 0.10), (4.2, 0.020)],
        bumps_mm: [(0.55, 0.005), (0.34, 0.004), (0.22, 0.003)],
        abaxial_bumps: 1.2,
        stretch: 4.0,
    },
    tissue: TissueTraits {
        chlorophyll: [0.86, 0.78, 0.55, 0.07],
        // The midrib is parenchyma with few plastids of any kind: white, not the yellow of lesser veins.
        carotenoid: [1.0, 1.0, 1.02, 0.30],
        brown: [1.0, 1.05, 1.3, 1.6],
        gloss: [0.60, 0.64, 0.72, 0.80],
        thickness: [1.0, 1.03, 1.12, 1.3],
        fine_strength: [0.75, 0.35],
        blade_gloss: 0.58,
        abaxial_gloss: 0.85,
        mottle: 0.55,
    },
};

/// Grass of a lawn, whose blades are a twentieth as wide as those of maize: a shallow midrib, ribs close together.
const GRASS: Traits = Traits {
    venation: VenationTraits::Parallel(ParallelTraits {
        main_half_width_mm: 0.22,
        main_taper_per_mm: 0.006,
        lateral_half_width_mm: 0.06,
        lateral_spacing_mm: 0.55,
        fine_spacing_mm: 0.18,
        commissure_spacing_mm: 0.9,
    }),
    relief: ReliefTraits {
        groove_mm: [0.10, 0.020, 0.006, 0.002],
        ridge_mm: [0.12, 0.030, 0.008, 0.003],
        bulge_mm: 0.015,
        bulge_reach_mm: 0.2,
        axil_mm: 0.1,
        fine_half_widths_mm: [0.030, 0.020],
        waves_mm: [(4.0, 0.02), (1.5, 0.006)],
        ..MAIZE.relief
    },
    tissue: MAIZE.tissue,
};

/// Shoot of a spruce from above: a bare twig, and needles at 50 degrees to it, 1 to 1.5 mm from each other, with gaps between
/// them that lie deep in the shade of the needles below.
const SPRUCE: Traits = Traits {
    venation: VenationTraits::Pinnate(PinnateTraits {
        main_half_width_mm: 1.0,
        main_taper_per_mm: 0.006,
        secondary_half_width_mm: 0.22,
        secondary_length_mm: 60.0,
        secondary_share_of_patch: 1.0,
        secondary_spacing_mm: 1.3,
        secondary_angles_deg: [52.0, 44.0],
        secondary_angle_jitter: 0.08,
        secondary_wave_deg: 0.0,
        tertiary: TertiaryTraits::Network { cell_mm: 6.0 },
        finest_cell_mm: 3.0,
    }),
    relief: ReliefTraits {
        groove_mm: [0.30, 0.40, 0.0, 0.0],
        ridge_mm: [0.45, -0.40, 0.0, 0.0],
        groove_widths: [1.2, 1.6],
        fine_half_widths_mm: [0.05, 0.04],
        bulge_mm: 0.20,
        bulge_reach_mm: 0.6,
        axil_mm: 0.3,
        areole_bulge_mm: 0.0,
        areole_reach_mm: 0.3,
        waves_mm: [(12.0, 0.10), (5.0, 0.04)],
        bumps_mm: [(0.55, 0.004), (0.34, 0.003), (0.22, 0.002)],
        abaxial_bumps: 1.0,
        stretch: 1.0,
    },
    tissue: TissueTraits {
        chlorophyll: [1.0, 1.0, 1.0, 0.12],
        carotenoid: [1.0, 1.0, 1.0, 0.9],
        brown: [1.0, 1.0, 1.0, 2.0],
        gloss: [0.45, 0.45, 0.45, 0.6],
        thickness: [1.0, 1.0, 1.3, 1.5],
        fine_strength: [0.0, 0.0],
        blade_gloss: 0.45,
        abaxial_gloss: 0.8,
        mottle: 0.8,
    },
};

impl VenationTraits {
    /// Returns half the width of a secondary vein at its start.
    pub fn secondary_half_width_mm(&self) -> f32 {
        match self {
            VenationTraits::Pinnate(traits) => traits.secondary_half_width_mm,
            VenationTraits::Parallel(traits) => traits.lateral_half_width_mm,
        }
    }
}

impl Traits {
    /// Returns the traits of a species, or of the plain leaf.
    pub fn of(species: Option<Species>) -> Traits {
        match species {
            None => PLAIN,
            Some(Species::Maize) => MAIZE,
            Some(Species::Soybean) => SOYBEAN,
            Some(Species::Tree) => TREE,
            Some(Species::Grass) => GRASS,
            Some(Species::Spruce) => SPRUCE,
        }
    }
}
