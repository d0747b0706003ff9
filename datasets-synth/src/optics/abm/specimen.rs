//! Leaf specimens of the later algorithmic models: composition, thickness and the shapes of cells
//! [Baranoski 2006]; parameter table in `abm_b`.

use crate::error::{SynthError, check_range};
use crate::optics::abm::tissue::DepthParts;
use crate::optics::tables::abm as tables;
use crate::optics::units::{Centimetres, GramsPerCubicCentimetre, MicrogramsPerSquareCentimetre, Nanometres};

/// Contents of a mesophyll per volume.
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
    /// Share of the volume that is water; the program of the authors uses 1.
    pub water_share: f64,
}

impl Composition {
    /// Returns the optical depth of a straight crossing of `thickness`, `A_g t_m` by absorber [Baranoski 2006].
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

/// Aspect ratios of the cells that spread the rays.
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

/// Leaf specimen of the later models.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Specimen {
    /// Thickness of the whole leaf.
    pub thickness: Centimetres,
    /// Share of the thickness that is mesophyll.
    pub mesophyll_share: f64,
    /// Aspect ratios.
    pub aspect: AspectRatios,
    /// Contents of the mesophyll.
    pub composition: Composition,
}

impl Specimen {
    /// Returns the maize leaf LOPEX 0141/0142.
    pub fn maize() -> Specimen {
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

    /// Returns the soybean leaf LOPEX 0219/0220.
    pub fn soybean() -> Specimen {
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

    /// Returns the thickness of the mesophyll.
    pub fn mesophyll_thickness(&self) -> Centimetres {
        self.thickness * self.mesophyll_share
    }

    /// Returns the content of chlorophyll per area of leaf.
    pub fn chlorophyll_per_area(&self) -> MicrogramsPerSquareCentimetre {
        MicrogramsPerSquareCentimetre(self.composition.chlorophyll.0 * self.mesophyll_thickness().0 * 1e6)
    }

    /// Returns the content of carotenoids per area of leaf.
    pub fn carotenoid_per_area(&self) -> MicrogramsPerSquareCentimetre {
        MicrogramsPerSquareCentimetre(self.composition.carotenoid.0 * self.mesophyll_thickness().0 * 1e6)
    }

    /// Returns the concentration that gives a content per area of leaf.
    pub fn concentration(&self, content: MicrogramsPerSquareCentimetre) -> GramsPerCubicCentimetre {
        GramsPerCubicCentimetre(content.0 * 1e-6 / self.mesophyll_thickness().0)
    }

    /// Returns the optical depth of a straight crossing of the mesophyll, by absorber.
    pub fn depth_parts(&self, wavelength: Nanometres) -> DepthParts {
        self.composition.depth(wavelength, self.mesophyll_thickness())
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
