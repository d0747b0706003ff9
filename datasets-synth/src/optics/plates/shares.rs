//! Reflectance and transmittance of plates.

/// Share of incident light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlateOptics {
    /// Reflected, the first surface's part included.
    pub reflectance: f64,
    /// Transmitted.
    pub transmittance: f64,
}
