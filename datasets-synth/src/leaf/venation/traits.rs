//! Sizes of veins.

/// Pattern of the veins, with their numbers, spacings and widths.
#[derive(Debug, Clone, Copy)]
pub(crate) enum VenationTraits {
    Pinnate(PinnateTraits),
    Parallel(ParallelTraits),
}

/// Sizes of pinnate veins. Lengths in millimetres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PinnateTraits {
    /// Half the width of the main vein at the patch's lower edge.
    pub main_half_width_mm: f32,
    /// Relative loss of that width per millimetre towards the tip.
    pub main_taper_per_mm: f32,
    /// Half the width of a secondary vein where it leaves the main one.
    pub secondary_half_width_mm: f32,
    /// Length over which a secondary vein thins to its end.
    pub secondary_length_mm: f32,
    /// Length over which a secondary vein thins, as a share of the patch, if that is longer.
    pub secondary_share_of_patch: f32,
    /// Distance between secondary veins along the main one, both sides counted.
    pub secondary_spacing_mm: f32,
    /// Angle between a secondary vein and the main one at its start and at its end, in degrees.
    pub secondary_angles_deg: [f32; 2],
    /// Relative jitter of those angles.
    pub secondary_angle_jitter: f32,
    /// Amplitude by which a secondary swings about its course, in degrees.
    pub secondary_wave_deg: f32,
    pub tertiary: TertiaryTraits,
    /// Mean size of the areas that the finest veins enclose.
    pub finest_cell_mm: f32,
}

/// Kind of tertiary veins between secondaries.
#[derive(Debug, Clone, Copy)]
pub(crate) enum TertiaryTraits {
    /// A network of cells of a mean size.
    Network { cell_mm: f32 },
    /// Curves from secondary to secondary.
    Rungs(RungTraits),
}

/// Sizes of parallel veins. Lengths in millimetres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ParallelTraits {
    /// Half the width of the midrib at the patch's lower edge.
    pub main_half_width_mm: f32,
    /// Relative loss of that width per millimetre towards the tip.
    pub main_taper_per_mm: f32,
    pub lateral_half_width_mm: f32,
    pub lateral_spacing_mm: f32,
    pub fine_spacing_mm: f32,
    /// Length of the stretch of a strip that holds one commissural vein.
    pub commissure_spacing_mm: f32,
}

/// Sizes of tertiary curves that join secondaries.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RungTraits {
    /// Distance between rungs along a secondary in millimetres.
    pub spacing_mm: f32,
    /// Relative jitter of that distance.
    pub spacing_jitter: f32,
    /// Distance by which a rung wanders off its smooth course in millimetres.
    pub wander_mm: f32,
    /// Distance of a rung's middle from the straight line, as a share of its length.
    pub bow: f32,
    /// Share of rungs that fork.
    pub forks: f32,
    /// Share of neighbouring rungs that a tie in the middle joins, which also breaks them there.
    pub ties: f32,
}
