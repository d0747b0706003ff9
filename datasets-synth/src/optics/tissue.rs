//! What the instruments and the captures ask of a tissue model.

use crate::optics::stack::Stack;
use crate::optics::units::{Nanometres, OpticalDepth};

/// A leaf as a stack of interfaces around an absorbing mesophyll.
pub trait Tissue: Sync {
    /// The interfaces at a wavelength.
    fn stack(&self, wavelength: Nanometres) -> Stack;

    /// Optical depth of a straight crossing of the whole mesophyll, `A_g t_m`.
    fn optical_depth(&self, wavelength: Nanometres) -> OpticalDepth;

    /// Whether [`Tissue::stack`] is the same at every wavelength, so that one trace serves all.
    fn has_constant_indices(&self) -> bool;
}
