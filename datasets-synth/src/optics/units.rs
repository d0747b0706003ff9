//! Units of the tissue models, carried by types: the 1997 paper's one fatal misprint is a unit (its
//! concentration in ug/cm2 is used as if it were ug/cm3), so here that cannot be written.
//!
//! Each type is a number of the unit in its name. Only products that mean something exist:
//!
//! | product | is |
//! |---|---|
//! | [`SquareCentimetresPerMicrogram`] x [`MicrogramsPerSquareCentimetre`] | optical depth, a plain number |
//! | [`SquareCentimetresPerGram`] x [`GramsPerCubicCentimetre`] | [`PerCentimetre`] |
//! | [`PerCentimetre`] x [`Centimetres`] | optical depth |
//! | optical depth / [`Centimetres`] | [`PerCentimetre`] |

use std::ops::{Add, Div, Mul};

macro_rules! unit {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
        pub struct $name(pub f64);

        impl Mul<f64> for $name {
            type Output = $name;
            fn mul(self, factor: f64) -> $name {
                $name(self.0 * factor)
            }
        }

        impl Add for $name {
            type Output = $name;
            fn add(self, other: $name) -> $name {
                $name(self.0 + other.0)
            }
        }
    };
}

unit!(
    /// Length in cm.
    Centimetres
);
unit!(
    /// Wavelength in nm.
    Nanometres
);
unit!(
    /// Absorption per length, natural logarithm, 1/cm.
    PerCentimetre
);
unit!(
    /// Pigment per area of leaf, ug/cm2.
    MicrogramsPerSquareCentimetre
);
unit!(
    /// Specific absorption of a pigment given per area, cm2/ug.
    SquareCentimetresPerMicrogram
);
unit!(
    /// Substance per volume of tissue, g/cm3.
    GramsPerCubicCentimetre
);
unit!(
    /// Specific absorption of a substance given per volume, cm2/g.
    SquareCentimetresPerGram
);

unit!(
    /// Optical depth, `-ln` of the share of light that a straight crossing leaves: `A_g t_m`, a plain number.
    OpticalDepth
);

impl Mul<MicrogramsPerSquareCentimetre> for SquareCentimetresPerMicrogram {
    type Output = OpticalDepth;
    fn mul(self, content: MicrogramsPerSquareCentimetre) -> OpticalDepth {
        OpticalDepth(self.0 * content.0)
    }
}

impl Mul<GramsPerCubicCentimetre> for SquareCentimetresPerGram {
    type Output = PerCentimetre;
    fn mul(self, content: GramsPerCubicCentimetre) -> PerCentimetre {
        PerCentimetre(self.0 * content.0)
    }
}

impl Mul<Centimetres> for PerCentimetre {
    type Output = OpticalDepth;
    fn mul(self, length: Centimetres) -> OpticalDepth {
        OpticalDepth(self.0 * length.0)
    }
}

impl Div<Centimetres> for OpticalDepth {
    type Output = PerCentimetre;
    fn div(self, length: Centimetres) -> PerCentimetre {
        PerCentimetre(self.0 / length.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Baranoski 1997, Table 1, at 550 nm: 43.62 ug/cm2 in 0.0072 cm.
    #[test]
    fn a_content_per_area_becomes_an_absorption_per_length_through_the_thickness() {
        let depth = SquareCentimetresPerMicrogram(0.01286) * MicrogramsPerSquareCentimetre(43.62);
        let thickness = Centimetres(0.0072);
        assert!((depth.0 - 0.561).abs() < 1e-3, "U2 of the units test: tau 0.561");
        let per_length = depth / thickness;
        assert!((per_length.0 - 77.9).abs() < 0.1);
        assert!(((per_length * thickness).0 - depth.0).abs() < 1e-15);
        // The printed reading takes 0.01286 * 43.62 for 1/cm: 140 times too little.
        let printed = PerCentimetre(0.01286 * 43.62) * thickness;
        assert!((printed.0 - 0.004).abs() < 1e-4);
    }
}
