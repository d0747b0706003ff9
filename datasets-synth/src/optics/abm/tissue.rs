//! Interface of a tissue model for instruments and captures.

use crate::optics::abm::stack::Stack;
use crate::optics::units::{Nanometres, OpticalDepth};

/// Optical depth by absorber, so that a map can scale each by itself.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DepthParts {
    /// Chlorophyll a + b.
    pub chlorophyll: OpticalDepth,
    /// Carotenoids.
    pub carotenoid: OpticalDepth,
    /// Everything else: water, protein, cellulose, lignin.
    pub rest: OpticalDepth,
}

/// Leaf as a stack of interfaces around an absorbing mesophyll.
pub trait Tissue: Sync {
    /// Returns the stack of interfaces at a wavelength.
    fn stack(&self, wavelength: Nanometres) -> Stack;

    /// Returns the optical depth of a straight crossing of the whole mesophyll, by absorber.
    fn depth_parts(&self, wavelength: Nanometres) -> DepthParts;

    /// Returns the optical depth of a straight crossing of the whole mesophyll, `A_g t_m`.
    fn optical_depth(&self, wavelength: Nanometres) -> OpticalDepth {
        let parts = self.depth_parts(wavelength);
        parts.chlorophyll + parts.carotenoid + parts.rest
    }

    /// Returns whether [`Tissue::stack`] is the same at every wavelength, so that one trace serves all.
    fn has_constant_indices(&self) -> bool;
}
