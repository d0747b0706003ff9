//! Parameters of a leaf and of its capture.

use btf_capture::{ImageFormat, MAX_BANDS, Side};
use btf_models::{LeafContents, LeafDescription, Species, TextureImages};

use crate::error::SynthError;
use crate::leaf::chlorosis::Chlorosis;
use crate::leaf::look::LeafLook;
use crate::leaf::model::LeafModel;
use crate::leaf::relief::RELIEF_BOUND_MM;
use crate::optics::abm::abm_b::AbmB;
use crate::optics::abm::abm_u::AbmU;
use crate::optics::abm::path_lengths::Face;
use crate::optics::abm::scatter_table::Passage;
use crate::optics::colour::RgbBands;
use crate::optics::gloss::params::GlossParams;
use crate::optics::plates::model::PlateModel;
use crate::optics::plates::two_halves::TwoHalves;
use crate::optics::specific_absorption::LEAF_TABLE_NM;
use crate::surface::capture_params::CaptureParams;
use crate::surface::grid::Grid;

/// Parameters of a leaf and of its capture.
#[derive(Debug, Clone, PartialEq)]
pub struct LeafParams {
    /// Patch, directions and images. For transmission the lights are turned to the far side, from `theta` to
    /// `180 - theta`.
    pub capture: CaptureParams,
    /// Optical model of the blade.
    pub model: LeafModel,
    /// Contents of the blade for the plate models; veins deviate from them. The algorithmic models have contents of
    /// their own.
    pub contents: LeafContents,
    /// Wavelengths of the plate models' colour.
    pub bands: RgbBands,
    /// Bands of the capture in nanometres, ascending, 400 to 2500; empty for colours.
    pub wavelengths_nm: Vec<f64>,
    /// Specular lobe of the plate models. For `plate-paper` it is never coupled to the body.
    pub gloss: GlossParams,
    /// Species, deficiency, and textures that the user supplies.
    pub look: LeafLook,
    /// Face that is seen.
    pub side: Face,
    /// Whether the light falls on the visible face or on the other one.
    pub passage: Passage,
}

impl Default for LeafParams {
    /// Returns a green leaf of `plate-n`, its adaxial face in reflection, 256 x 256 texels of 20 x 20 mm, Bonn's 81 x
    /// 81 directions, png, seed 1.
    fn default() -> LeafParams {
        LeafParams {
            capture: CaptureParams::new(20.0),
            model: LeafModel::default(),
            contents: LeafContents::default(),
            bands: RgbBands::Spectral31,
            wavelengths_nm: Vec::new(),
            gloss: GlossParams::default(),
            look: LeafLook::default(),
            side: Face::Adaxial,
            passage: Passage::Reflection,
        }
    }
}

impl LeafParams {
    /// Returns the parameters of a species: patch, contents and specular lobe of its preset, otherwise the defaults.
    pub fn of(species: Species) -> LeafParams {
        LeafParams::described(&LeafDescription::of(Some(species), None), TextureImages::default())
    }

    /// Returns the parameters of a description, with the textures that it names ([`LeafDescription::textures_beside`]),
    /// otherwise the defaults. The variation of a description is for callers that make many leaves.
    pub fn described(leaf: &LeafDescription, images: TextureImages) -> LeafParams {
        let chlorosis = leaf.deficiency.map(|deficiency| Chlorosis { deficiency, severity: leaf.severity });
        LeafParams {
            capture: CaptureParams { seed: leaf.seed, ..CaptureParams::new(leaf.size_mm as f32) },
            contents: leaf.contents,
            gloss: leaf.gloss.into(),
            look: LeafLook { species: leaf.species, chlorosis, images, ..LeafLook::default() },
            ..LeafParams::default()
        }
    }

    /// Returns the grid of the patch with the margin that its steepest view needs.
    pub(crate) fn grid(&self) -> Grid {
        self.capture.grid(RELIEF_BOUND_MM)
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first that is out of its range.
    pub fn check(&self) -> Result<(), SynthError> {
        self.capture.check()?;
        self.gloss.check()?;
        self.look.check()?;
        self.check_bands()?;
        match &self.model {
            LeafModel::Plate(model) => model.check(model.default_table(), &self.contents)?,
            LeafModel::TwoSided(halves) => {
                halves.check()?;
                PlateModel::N.check(PlateModel::N.default_table(), &self.contents)?;
            }
            LeafModel::Abm97(leaf) => leaf.check()?,
            LeafModel::AbmB(leaf) => leaf.specimen.check()?,
            LeafModel::AbmU(leaf) => leaf.specimen.check()?,
        }
        self.capture.check_grid(RELIEF_BOUND_MM)
    }

    /// Checks the bands of the capture.
    fn check_bands(&self) -> Result<(), SynthError> {
        let nm = &self.wavelengths_nm;
        let refuse = |value: String, allowed: &str| {
            Err(SynthError::BadParameter { name: "--bands", value, allowed: allowed.to_owned() })
        };
        if nm.is_empty() {
            return Ok(());
        }
        if nm.len() > MAX_BANDS || !nm.windows(2).all(|pair| pair[0] < pair[1]) {
            return refuse(format!("{} wavelengths", nm.len()), "at most 256, each above the one before");
        }
        if let Some(nm) = nm.iter().find(|nm| !(LEAF_TABLE_NM[0]..=LEAF_TABLE_NM[1]).contains(*nm)) {
            return refuse(format!("{nm} nm"), "wavelengths from 400 to 2500 nm");
        }
        if self.model == LeafModel::Plate(PlateModel::Paper) {
            return refuse(self.model.name().to_owned(), "another model: plate-paper is printed for three wavelengths");
        }
        if self.capture.format != ImageFormat::Exr {
            return refuse(format!("{} images", self.capture.format), "exr images: give --format exr");
        }
        Ok(())
    }

    /// Returns the bands of the capture, three by three: what is left over repeats the last one.
    pub(crate) fn threes_of_bands(&self) -> Vec<[f64; 3]> {
        let last = self.wavelengths_nm.last().copied().unwrap_or(0.0);
        let three = |bands: &[f64]| std::array::from_fn(|i| bands.get(i).copied().unwrap_or(last));
        self.wavelengths_nm.chunks(3).map(three).collect()
    }

    /// Returns the side of the capture, from the face that is seen and the side of the light.
    pub fn capture_side(&self) -> Side {
        match (self.side, self.passage) {
            (Face::Adaxial, Passage::Reflection) => Side::Front,
            (Face::Abaxial, Passage::Reflection) => Side::Back,
            (Face::Adaxial, Passage::Transmission) => Side::TransmissionBack,
            (Face::Abaxial, Passage::Transmission) => Side::TransmissionFront,
        }
    }

    /// Describes the parameters in one line, for the provenance of the capture.
    pub fn provenance(&self) -> String {
        let face = match self.side {
            Face::Adaxial => "adaxial",
            Face::Abaxial => "abaxial",
        };
        let light = match self.passage {
            Passage::Reflection => "reflection",
            Passage::Transmission => "transmission",
        };
        let c = &self.contents;
        let optics = match &self.model {
            LeafModel::Plate(_) | LeafModel::TwoSided(_) => format!(
                "chlorophyll {} ug/cm2, carotenoids {} ug/cm2, anthocyanins {} ug/cm2, brown {}, water {} cm, dry \
                 matter {} g/cm2, N {}, gloss {} of index {}, roughness {} along and {} across the veins, {}",
                c.chlorophyll_ug_per_cm2,
                c.carotenoid_ug_per_cm2,
                c.anthocyanin_ug_per_cm2,
                c.brown,
                c.water_cm,
                c.dry_matter_g_per_cm2,
                c.structure,
                self.gloss.form.name(),
                self.gloss.index,
                self.gloss.gamma_along,
                self.gloss.gamma_across,
                self.bands.name(),
            ),
            LeafModel::Abm97(leaf) => format!(
                "chlorophyll {} ug/cm2, carotenoids {} ug/cm2, mesophyll {:.4} cm",
                leaf.chlorophyll.0,
                leaf.carotenoid.0,
                leaf.mesophyll_thickness().0
            ),
            LeafModel::AbmB(AbmB { specimen, .. }) | LeafModel::AbmU(AbmU { specimen, .. }) => format!(
                "chlorophyll {:.2} ug/cm2, carotenoids {:.2} ug/cm2, mesophyll {:.4} cm",
                specimen.chlorophyll_per_area().0,
                specimen.carotenoid_per_area().0,
                specimen.mesophyll_thickness().0
            ),
        };
        let model = match &self.model {
            LeafModel::TwoSided(TwoHalves { layers, pigments, body }) => format!(
                "{} (palisade with {layers} of the layers, {pigments} of the pigments, {body} of water and dry matter)",
                self.model.name()
            ),
            model => model.name().to_owned(),
        };
        let look = self.look.provenance();
        format!(
            "btf-synth leaf: model {model}, {optics}{look}, {face} face in {light}, seed {}, synthetic",
            self.capture.seed
        )
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use btf_capture::DirectionSet;

    use super::*;
    use crate::optics::abm::abm97::Abm97;
    use crate::optics::units::Centimetres;

    /// Returns the default leaf with a changed capture.
    pub(crate) fn with(change: impl FnOnce(&mut CaptureParams)) -> LeafParams {
        let mut params = LeafParams::default();
        change(&mut params.capture);
        params
    }

    pub(crate) fn small() -> LeafParams {
        with(|capture| {
            capture.size = 48;
            capture.views = DirectionSet::random(4, 1).unwrap();
            capture.lights = DirectionSet::random(5, 2).unwrap();
        })
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let named = |params: LeafParams| params.check().unwrap_err().to_string();
        assert!(named(with(|capture| capture.size = 7)).contains("--size is 7"));
        assert!(named(LeafParams { gloss: GlossParams::isotropic(1.42, f64::NAN), ..small() }).contains("--gamma"));
        let contents = LeafContents { structure: 0.5, ..LeafContents::default() };
        assert!(named(LeafParams { contents, ..small() }).contains("--n is 0.5"));
        let lights = DirectionSet::new(vec![btf_capture::Direction::new(89.0, 0.0)]).unwrap();
        assert!(named(with(|capture| capture.lights = lights)).contains("--directions"));
        let thin = Abm97 { leaf_thickness: Centimetres(0.0), ..Abm97::default() };
        assert!(named(LeafParams { model: LeafModel::Abm97(thin), ..small() }).contains("--thickness-cm"));
        let tiny = with(|capture| (capture.size, capture.size_mm) = (2048, 1.0));
        assert!(named(tiny).contains("--size-mm is 1 for 2048 texels"));
        with(|capture| capture.size = 2048).check().unwrap();
        small().check().unwrap();
    }

    #[test]
    fn every_species_is_valid_parameters() {
        for species in Species::ALL {
            let (params, preset) = (LeafParams::of(species), species.preset());
            params.check().unwrap();
            assert_eq!((f64::from(params.capture.size_mm), params.contents), (preset.size_mm, preset.contents));
            assert_eq!((params.gloss, params.look.species), (preset.gloss.into(), Some(species)));
        }
        assert_eq!(LeafParams::described(&LeafDescription::default(), TextureImages::default()), LeafParams::default());
    }
}
