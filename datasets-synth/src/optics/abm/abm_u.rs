//! `abm-u`: the one-sided (unifacial) leaf of the later algorithmic model, such as maize: alike from both
//! faces, with an air space somewhere in the middle of its mesophyll [Baranoski 2006; Baranoski 2007].
//!
//! Parameters as in `abm_b`; palisade cell caps are not used. From the adaxial face down:
//!
//! ```text
//! 1  air | cuticle          cuticle undulations outside, epidermal caps inside
//! 2  cuticle | mesophyll    epidermal caps above, spongy caps below
//!    mesophyll, a share p of it, absorbs
//! 3  mesophyll | air        spongy caps
//! 4  air | mesophyll        spongy caps
//!    mesophyll, the share 1 - p, absorbs
//! 5  mesophyll | cuticle    spongy caps above, epidermal caps below
//! 6  cuticle | air          spongy caps above, cuticle undulations outside
//! ```
//!
//! p is drawn evenly from 0 to 1 for every ray.
//!
//! Differs from the papers in: tables are read linearly between their entries. The lower cuticle spreads
//! inside by the spongy caps as in the authors' program, where the upper one spreads by the epidermal caps:
//! with a maize leaf's ratios (both 5) it makes no difference.
//!
//! When it is wrong: as `abm_b`; a leaf whose veins are wrapped in bundle sheaths (maize) holds much of its
//! chlorophyll there, which no plane layer shows.

use crate::optics::abm::specimen::Specimen;
use crate::optics::abm::stack::{Crossing, Interface, Medium, PathRule, Spread, Stack};
use crate::optics::abm::tissue::{DepthParts, Tissue};
use crate::optics::tables::abm as tables;
use crate::optics::units::Nanometres;

/// Unifacial leaf.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AbmU {
    /// Specimen of the leaf.
    pub specimen: Specimen,
    /// Length of a slanted crossing; the authors' default is the sieve rule.
    pub path: PathRule,
}

impl Default for AbmU {
    /// Returns the maize leaf with the sieve rule.
    fn default() -> AbmU {
        AbmU { specimen: Specimen::maize(), path: PathRule::Sieve }
    }
}

impl Tissue for AbmU {
    fn stack(&self, wavelength: Nanometres) -> Stack {
        let aspect = &self.specimen.aspect;
        let [cuticle, epidermis, spongy] = [aspect.cuticle, aspect.epidermis, aspect.spongy].map(Spread::exponent);
        let (n_cuticle, n_mesophyll) = (tables::cuticle_index(wavelength), tables::mesophyll_index(wavelength));
        let all_spongy = |above: f64, below: f64| Interface {
            reflected_above: spongy,
            refracted_above: spongy,
            refracted_below: spongy,
            reflected_below: spongy,
            ..Interface::plain(above, below)
        };
        let interfaces = vec![
            Interface {
                reflected_above: cuticle,
                refracted_below: epidermis,
                reflected_below: epidermis,
                ..Interface::plain(1.0, n_cuticle)
            },
            Interface { reflected_above: epidermis, refracted_above: epidermis, ..all_spongy(n_cuticle, n_mesophyll) },
            all_spongy(n_mesophyll, 1.0),
            all_spongy(1.0, n_mesophyll),
            Interface { refracted_below: epidermis, reflected_below: epidermis, ..all_spongy(n_mesophyll, n_cuticle) },
            Interface {
                reflected_above: spongy,
                refracted_above: spongy,
                reflected_below: cuticle,
                ..Interface::plain(n_cuticle, 1.0)
            },
        ];
        let media = vec![Medium::Clear, Medium::UpperPart, Medium::Clear, Medium::LowerPart, Medium::Clear];
        Stack::new(interfaces, media, self.path, Crossing::Resample)
    }

    fn depth_parts(&self, wavelength: Nanometres) -> DepthParts {
        self.specimen.depth_parts(wavelength)
    }

    fn has_constant_indices(&self) -> bool {
        false
    }
}
