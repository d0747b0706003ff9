//! Reflectance and transmittance of plates.

/// Shares of incident light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlateOptics {
    /// Reflected share, that of the first surface included.
    pub reflectance: f64,
    /// Transmitted share.
    pub transmittance: f64,
}
