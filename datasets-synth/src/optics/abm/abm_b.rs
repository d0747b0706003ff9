//! `abm-b`: the two-sided (bifacial) leaf of the later algorithmic model, six interfaces, spectral indices
//! [Baranoski 2006; Baranoski 2007].
//!
//! | parameter | unit | maize | soybean | valid |
//! |---|---|---|---|---|
//! | whole leaf's thickness | cm | 0.0204 | 0.0166 | 0.003 to 0.05 |
//! | share that is mesophyll | - | 0.8 | 0.5 | 0 to 1 |
//! | aspect ratio of cuticle undulations | - | 10 | 5 | >= 0 |
//! | aspect ratio of epidermal cell caps | - | 5 | 5 | >= 0 |
//! | aspect ratio of palisade cell caps | - | 1 | 1 | >= 0 |
//! | aspect ratio of spongy cell caps | - | 5 | 5 | >= 0 |
//! | chlorophyll a, b in the mesophyll | g/cm3 | 0.002895, 0.000799 | 0.003978, 0.001161 | >= 0 |
//! | carotenoids | g/cm3 | 0.000659 | 0.001132 | >= 0 |
//! | protein | g/cm3 | 0.05309 | 0.07871 | >= 0 |
//! | cellulose | g/cm3 | 0 | 0.03776 | >= 0 |
//! | lignin | g/cm3 | 0.05925 | 0.01074 | >= 0 |
//!
//! Compositions: LOPEX leaves 0141/0142 (maize) and 0219/0220 (soybean) as the authors' group uses them: their programs show
//! the two-sided model with the latter and the one-sided model with the former.
//!
//! From the adaxial face down; an aspect ratio is the exponent of the lobe about the ray [eq. 5 of 1997]:
//!
//! ```text
//! 1  air | cuticle                cuticle undulations outside, epidermal caps inside (up-going: as it is refracted)
//! 2  cuticle | mesophyll          epidermal caps above, palisade caps below
//!    mesophyll, absorbs
//! 3  mesophyll | air              palisade caps above, spongy caps below
//! 4  air | antidermal wall        smooth
//! 5  antidermal wall | cuticle    epidermal caps below
//! 6  cuticle | air                epidermal caps above, cuticle undulations outside
//! ```
//!
//! Differs from the papers in: tables are interpolated linearly between their entries every 5 nm, not read as steps. At
//! the published wavelengths the model agrees with figures of the authors' own program within its noise.
//!
//! When it is wrong: interfaces are smooth planes with lobes about slanted rays, so two questions of reading remain:
//! lobes that cross are drawn again, and `PathRule::Sieve` gives an oblique ray a *shorter* path than Beer's law
//! (`1 / cos(cos theta)`). Reflectance at 450 and 680 nm is near its floor for any pigment.

use crate::optics::abm::specimen::Specimen;
use crate::optics::abm::stack::{Crossing, Interface, Medium, PathRule, Spread, Stack};
use crate::optics::abm::tissue::{DepthParts, Tissue};
use crate::optics::tables::abm as tables;
use crate::optics::units::Nanometres;

/// Bifacial leaf: palisade above, spongy tissue below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AbmB {
    /// Specimen of the leaf.
    pub specimen: Specimen,
    /// Length of a slanted crossing; the authors' default is the sieve rule.
    pub path: PathRule,
}

impl Default for AbmB {
    /// Returns the soybean leaf with the sieve rule.
    fn default() -> AbmB {
        AbmB { specimen: Specimen::soybean(), path: PathRule::Sieve }
    }
}

impl Tissue for AbmB {
    fn stack(&self, wavelength: Nanometres) -> Stack {
        let aspect = &self.specimen.aspect;
        let [cuticle, epidermis, palisade, spongy] =
            [aspect.cuticle, aspect.epidermis, aspect.palisade, aspect.spongy].map(Spread::exponent);
        let (n_cuticle, n_mesophyll) = (tables::cuticle_index(wavelength), tables::mesophyll_index(wavelength));
        let n_antidermal = tables::antidermal_index(wavelength);
        let interfaces = vec![
            Interface {
                reflected_above: cuticle,
                refracted_below: epidermis,
                reflected_below: epidermis,
                ..Interface::plain(1.0, n_cuticle)
            },
            Interface {
                reflected_above: epidermis,
                refracted_above: epidermis,
                refracted_below: palisade,
                reflected_below: palisade,
                ..Interface::plain(n_cuticle, n_mesophyll)
            },
            Interface {
                reflected_above: palisade,
                refracted_above: palisade,
                refracted_below: spongy,
                reflected_below: spongy,
                ..Interface::plain(n_mesophyll, 1.0)
            },
            Interface::plain(1.0, n_antidermal),
            Interface {
                refracted_below: epidermis,
                reflected_below: epidermis,
                ..Interface::plain(n_antidermal, n_cuticle)
            },
            Interface {
                reflected_above: epidermis,
                refracted_above: epidermis,
                reflected_below: cuticle,
                ..Interface::plain(n_cuticle, 1.0)
            },
        ];
        let media = vec![Medium::Clear, Medium::Mesophyll, Medium::Clear, Medium::Clear, Medium::Clear];
        Stack::new(interfaces, media, self.path, Crossing::Resample)
    }

    fn depth_parts(&self, wavelength: Nanometres) -> DepthParts {
        self.specimen.depth_parts(wavelength)
    }

    fn has_constant_indices(&self) -> bool {
        false
    }
}
