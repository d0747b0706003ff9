//! Place of a point among the veins.

/// Place of a point among the veins. Distances are in millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct VeinSite {
    /// Distance to the main vein's middle.
    pub main: f32,
    /// Half-width of the main vein there.
    pub main_half_width: f32,
    /// Distance to the nearest secondary vein's middle.
    pub secondary: f32,
    /// Half-width of that vein there.
    pub secondary_half_width: f32,
    /// Distance to the nearest tertiary vein.
    pub tertiary: f32,
    /// Distance to the nearest vein of the finest order.
    pub quaternary: f32,
    /// Distance to the right of the main vein along x, negative to its left, without a limit.
    pub across: f32,
    /// Unit vector along the nearby veins of the two great orders, weighted by nearness; y is not negative.
    pub direction: [f32; 2],
}
