//! `abm-b`: the two-sided (bifacial) leaf of the later algorithmic model, six interfaces, spectral indices
//! [Baranoski 2006; Baranoski 2007].
//!
//! | parameter | unit | soybean | maize | valid |
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
//! Compositions: LOPEX leaves 0141/0142 (soybean) and 0219/0220 (maize) as the authors' group uses them.
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
//! Differs from the papers in: tables are read linearly between their entries every 5 nm, not as steps.
//! Compared at the published wavelengths it agrees with figures of the authors' own program to its noise.
//!
//! When it is wrong: interfaces are smooth planes with lobes about slanted rays, so two of its readings
//! remain: lobes that cross are drawn again, and `PathRule::Sieve` gives an oblique ray a *shorter* way than
//! Beer's law (`1 / cos(cos theta)`). Reflectance at 450 and 680 nm is near its floor for any pigment.

use crate::error::{SynthError, check_range};
use crate::optics::stack::{Crossing, Interface, Medium, PathRule, Spread, Stack};
use crate::optics::tables::abm as tables;
use crate::optics::tissue::{DepthParts, Tissue};
use crate::optics::units::{Centimetres, GramsPerCubicCentimetre, MicrogramsPerSquareCentimetre, Nanometres};

/// What a mesophyll holds, per volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Composition {
    /// Chlorophyll a and b together.
    pub chlorophyll: GramsPerCubicCentimetre,
    /// Carotenoids.
    pub carotenoid: GramsPerCubicCentimetre,
    /// Protein.
    pub protein: GramsPerCubicCentimetre,
    /// Cellulose.
    pub cellulose: GramsPerCubicCentimetre,
    /// Lignin, which absorbs as cellulose for want of a table.
    pub lignin: GramsPerCubicCentimetre,
    /// Share of the volume that is water; the authors' program takes 1.
    pub water_share: f64,
}

impl Composition {
    /// Optical depth of a straight crossing of `thickness`, `A_g t_m` by absorber [Baranoski 2006].
    pub fn depth(&self, wavelength: Nanometres, thickness: Centimetres) -> DepthParts {
        let solids = tables::protein(wavelength) * self.protein
            + tables::cellulose(wavelength) * (self.cellulose + self.lignin)
            + tables::water(wavelength) * self.water_share;
        DepthParts {
            chlorophyll: tables::chlorophyll(wavelength) * self.chlorophyll * thickness,
            carotenoid: tables::carotenoid(wavelength) * self.carotenoid * thickness,
            rest: solids * thickness,
        }
    }
}

/// Aspect ratios of what spreads the rays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AspectRatios {
    /// Undulations of the cuticle.
    pub cuticle: f64,
    /// Caps of epidermal cells.
    pub epidermis: f64,
    /// Caps of palisade cells.
    pub palisade: f64,
    /// Caps of spongy cells.
    pub spongy: f64,
}

/// A leaf specimen of the later models.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Specimen {
    /// Whole leaf.
    pub thickness: Centimetres,
    /// Share of the thickness that is mesophyll.
    pub mesophyll_share: f64,
    /// Aspect ratios.
    pub aspect: AspectRatios,
    /// Contents of the mesophyll.
    pub composition: Composition,
}

impl Specimen {
    /// LOPEX 0141/0142, soybean.
    pub fn soybean() -> Specimen {
        Specimen {
            thickness: Centimetres(2.04e-2),
            mesophyll_share: 0.8,
            aspect: AspectRatios { cuticle: 10.0, epidermis: 5.0, palisade: 1.0, spongy: 5.0 },
            composition: Composition {
                chlorophyll: GramsPerCubicCentimetre(0.002895146 + 0.00079866),
                carotenoid: GramsPerCubicCentimetre(0.000658895),
                protein: GramsPerCubicCentimetre(0.05308714),
                cellulose: GramsPerCubicCentimetre(0.0),
                lignin: GramsPerCubicCentimetre(0.059245619),
                water_share: 1.0,
            },
        }
    }

    /// LOPEX 0219/0220, maize.
    pub fn maize() -> Specimen {
        Specimen {
            thickness: Centimetres(1.66e-2),
            mesophyll_share: 0.5,
            aspect: AspectRatios { cuticle: 5.0, epidermis: 5.0, palisade: 1.0, spongy: 5.0 },
            composition: Composition {
                chlorophyll: GramsPerCubicCentimetre(0.0039775 + 0.0011613),
                carotenoid: GramsPerCubicCentimetre(0.0011323),
                protein: GramsPerCubicCentimetre(0.0787059),
                cellulose: GramsPerCubicCentimetre(0.0377565),
                lignin: GramsPerCubicCentimetre(0.0107441),
                water_share: 1.0,
            },
        }
    }

    /// Thickness of the mesophyll.
    pub fn mesophyll_thickness(&self) -> Centimetres {
        self.thickness * self.mesophyll_share
    }

    /// Chlorophyll per area of leaf.
    pub fn chlorophyll_per_area(&self) -> MicrogramsPerSquareCentimetre {
        MicrogramsPerSquareCentimetre(self.composition.chlorophyll.0 * self.mesophyll_thickness().0 * 1e6)
    }

    /// Carotenoids per area of leaf.
    pub fn carotenoid_per_area(&self) -> MicrogramsPerSquareCentimetre {
        MicrogramsPerSquareCentimetre(self.composition.carotenoid.0 * self.mesophyll_thickness().0 * 1e6)
    }

    /// The concentration that gives a content per area of leaf.
    pub fn concentration(&self, content: MicrogramsPerSquareCentimetre) -> GramsPerCubicCentimetre {
        GramsPerCubicCentimetre(content.0 * 1e-6 / self.mesophyll_thickness().0)
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first that is out of range.
    pub fn check(&self) -> Result<(), SynthError> {
        check_range("--thickness-cm", self.thickness.0, 0.003, 0.05)?;
        check_range("the mesophyll's share", self.mesophyll_share, 0.01, 1.0)?;
        for aspect in [self.aspect.cuticle, self.aspect.epidermis, self.aspect.palisade, self.aspect.spongy] {
            check_range("an aspect ratio", aspect, 0.0, 1e6)?;
        }
        check_range("--cab", self.chlorophyll_per_area().0, 0.0, 200.0)?;
        check_range("--car", self.carotenoid_per_area().0, 0.0, 50.0)?;
        let c = &self.composition;
        for solid in [c.protein, c.cellulose, c.lignin] {
            check_range("a concentration in g/cm3", solid.0, 0.0, 1.5)?;
        }
        check_range("the water share", c.water_share, 0.0, 1.0)
    }
}

/// A bifacial leaf: palisade above, spongy tissue below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AbmB {
    /// The leaf.
    pub specimen: Specimen,
    /// Length of a slanted crossing; the authors' default is the sieve rule.
    pub path: PathRule,
}

impl Default for AbmB {
    /// The soybean leaf, sieve rule on.
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
        self.specimen.composition.depth(wavelength, self.specimen.mesophyll_thickness())
    }

    fn has_constant_indices(&self) -> bool {
        false
    }
}
