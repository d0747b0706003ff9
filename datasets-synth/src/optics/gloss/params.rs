//! Parameters of a specular lobe.
//!
//! | parameter | symbol | unit | default | valid |
//! |---|---|---|---|---|
//! | index | n | - | 1.42 | 1.01 to 3 |
//! | roughness along the vein direction (square root of twice the slope variance of its facets, Beckmann's alpha) | gamma_along | - | 0.3 | 0.05 to 1 |
//! | roughness across it | gamma_across | - | 0.3 | 0.05 to 1 |
//! | form | - | - | corrected | corrected, legacy-4x, printed |
//! | coupling to the body below | - | - | energy | energy, none |

use btf_models::LeafGloss;

use crate::error::{SynthError, check_ranges};

/// Smallest roughness; a narrower lobe falls between the directions of every known sampling.
pub const MIN_ROUGHNESS: f64 = LeafGloss::MIN_ROUGHNESS;

/// Refractive index of a leaf's cuticle, for the specular lobe [Miao, text after eq. 6].
pub const CUTICLE_INDEX: f64 = LeafGloss::CUTICLE_INDEX;

/// Form of the lobe: the reading of Miao's eq. 7 that it follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GlossForm {
    /// Corrected form: factor 1/4, Fresnel at v.h, G over v.h.
    #[default]
    Corrected,
    /// Form with the printed factor alone, which is four times the corrected lobe exactly. Fresnel and G are as
    /// corrected.
    Legacy4x,
    /// Form as printed: four times too bright, Fresnel at n.h (no rise towards grazing), and the angle between normal
    /// and half vector in radians as the denominator of G. Costs an arc cosine and a Fresnel term per sample; only for
    /// reporting the error of `plate-paper`.
    Printed,
}

impl GlossForm {
    /// All forms.
    pub const ALL: [GlossForm; 3] = [GlossForm::Corrected, GlossForm::Legacy4x, GlossForm::Printed];

    /// Returns the name on a command line.
    pub fn name(self) -> &'static str {
        match self {
            GlossForm::Corrected => "corrected",
            GlossForm::Legacy4x => "legacy-4x",
            GlossForm::Printed => "printed",
        }
    }

    /// Returns the ratio of the form's prefactor and the right one.
    pub(super) fn gain(self) -> f64 {
        match self {
            GlossForm::Corrected => 1.0,
            GlossForm::Legacy4x | GlossForm::Printed => 4.0,
        }
    }
}

/// Coupling of the lobe to the body: whether light that the lobe reflects is missing from what enters the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GlossCoupling {
    /// Coupled: lobe and body together reflect at most what came in.
    #[default]
    Energy,
    /// Not coupled, as in the papers: the lobe is added on top.
    None,
}

/// Parameters of a specular lobe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GlossParams {
    /// Refractive index, 1.01 to 3.
    pub index: f64,
    /// Roughness along the vein direction, [`MIN_ROUGHNESS`] to 1; a smaller one is raised.
    pub gamma_along: f64,
    /// Roughness across the vein direction, [`MIN_ROUGHNESS`] to 1; a smaller one is raised.
    pub gamma_across: f64,
    /// Form of the lobe, corrected or as printed.
    pub form: GlossForm,
    /// Coupling to the body.
    pub coupling: GlossCoupling,
}

impl Default for GlossParams {
    fn default() -> GlossParams {
        GlossParams::from(LeafGloss::default())
    }
}

impl From<LeafGloss> for GlossParams {
    /// Returns the corrected lobe, coupled.
    fn from(LeafGloss { index, gamma_along, gamma_across }: LeafGloss) -> GlossParams {
        GlossParams { index, gamma_along, gamma_across, form: GlossForm::default(), coupling: GlossCoupling::default() }
    }
}

impl GlossParams {
    /// Returns the corrected lobe, coupled, with one roughness.
    pub fn isotropic(index: f64, gamma: f64) -> GlossParams {
        GlossParams::from(LeafGloss { index, gamma_along: gamma, gamma_across: gamma })
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first that is out of its range.
    pub fn check(&self) -> Result<(), SynthError> {
        check_ranges(&[
            ("the gloss's index", self.index, 1.01, 3.0),
            ("--gamma", self.gamma_along, MIN_ROUGHNESS, 1.0),
            ("--gamma-across", self.gamma_across, MIN_ROUGHNESS, 1.0),
        ])
    }

    /// Returns both roughnesses raised to the floor; a NaN becomes the floor.
    pub(super) fn gammas(&self) -> [f64; 2] {
        [self.gamma_along.max(MIN_ROUGHNESS), self.gamma_across.max(MIN_ROUGHNESS)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_out_of_range_are_named() {
        let named = |params: GlossParams| params.check().unwrap_err().to_string();
        let good = GlossParams::default();
        good.check().unwrap();
        assert!(named(GlossParams { gamma_along: 0.04, ..good }).contains("--gamma is 0.04"));
        assert!(named(GlossParams { gamma_across: f64::NAN, ..good }).contains("--gamma-across"));
        assert!(named(GlossParams { index: 1.0, ..good }).contains("index is 1"));
        let names: Vec<&str> = GlossForm::ALL.into_iter().map(GlossForm::name).collect();
        assert_eq!(names, ["corrected", "legacy-4x", "printed"]);
    }
}
