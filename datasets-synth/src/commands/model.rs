//! Options that name a leaf model and its contents, shared by the commands.

use btf_synth::{
    Abm97, Abm97Switches, AbmB, AbmU, Centimetres, Crossing, EntryLobe, LeafContents, LeafModel, MesophyllKind,
    MicrogramsPerSquareCentimetre, PathRule, PlateModel, Specimen, States, TwoHalves,
};
use clap::{Args, ValueEnum};

use super::failure::Failure;

/// Models of a blade's optics.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Model {
    /// N-layer plates, PROSPECT-D
    PlateN,
    /// Two unequal piles of plates: faces that differ
    PlateTwoSided,
    /// One absorbing plate, exact equations, spectral index
    PlateExact,
    /// One plate as printed, with the paper's slips, for reproduction and error reports only
    PlatePaper,
    /// Random walk over four interfaces, 1997
    Abm97,
    /// Random walk over six interfaces, two-sided leaf, 2006
    AbmB,
    /// Random walk over six interfaces, one-sided leaf (maize), 2006
    AbmU,
}

impl std::fmt::Display for Model {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Model::PlateN => "plate-n",
            Model::PlateTwoSided => "plate-two-sided",
            Model::PlateExact => "plate-exact",
            Model::PlatePaper => "plate-paper",
            Model::Abm97 => "abm97",
            Model::AbmB => "abm-b",
            Model::AbmU => "abm-u",
        })
    }
}

/// Faces, as typed.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Side {
    /// The upper face
    Adaxial,
    /// The lower face
    Abaxial,
}

impl From<Side> for btf_synth::Face {
    fn from(side: Side) -> btf_synth::Face {
        match side {
            Side::Adaxial => btf_synth::Face::Adaxial,
            Side::Abaxial => btf_synth::Face::Abaxial,
        }
    }
}

/// Returns the name of a face in titles and JSON keys.
pub(super) fn side_name(side: Side) -> &'static str {
    match side {
        Side::Adaxial => "adaxial",
        Side::Abaxial => "abaxial",
    }
}

/// Readings and parameters of the models with a tissue.
#[derive(Args, Clone)]
#[command(next_help_heading = "Tissue (plate-two-sided, abm97, abm-b, abm-u)")]
pub struct TissueArgs {
    /// plate-two-sided: share of the N layers that is palisade (0.05 to 0.95) [default: 0.9]
    #[arg(long, value_name = "SHARE")]
    palisade_layers: Option<f64>,
    /// plate-two-sided: share of the pigments that is in the palisade [default: 0.99]
    #[arg(long, value_name = "SHARE")]
    palisade_pigments: Option<f64>,
    /// plate-two-sided: share of water and dry matter that is in the palisade [default: 0.95]
    #[arg(long, value_name = "SHARE")]
    palisade_body: Option<f64>,
    /// Leaf of abm-b and abm-u [default: soybean for abm-b, maize for abm-u]
    #[arg(long, value_enum)]
    specimen: Option<SpecimenName>,
    /// Thickness of the whole leaf in cm [default: abm97 0.016, soybean 0.0204, maize 0.0166]
    #[arg(long, value_name = "CM")]
    thickness_cm: Option<f64>,
    /// Oblateness of epidermal cells, both faces [default: 5]
    #[arg(long)]
    oblateness: Option<f64>,
    /// Length of a slanted crossing [default: slant for abm97, sieve for abm-b and abm-u]
    #[arg(long, value_enum)]
    path: Option<PathName>,
    /// abm97: lobe of light that enters the mesophyll
    #[arg(long, value_enum, default_value_t = Entry::Diffuse)]
    entry: Entry,
    /// abm97: states 3 and 4 do not spread light
    #[arg(long)]
    flat_spongy_side: bool,
    /// abm97: rule for lobes that cross the interface which they have just left
    #[arg(long, value_enum, default_value_t = CrossingName::Resample)]
    crossing: CrossingName,
    /// abm97: states that are walked; reduced is the paper's form of two states
    #[arg(long, value_enum, default_value_t = StatesName::All)]
    states: StatesName,
    /// abm97: pigmented share of the thickness, palisade 45 %, undifferentiated 75 %
    #[arg(long, value_enum, default_value_t = Mesophyll::Palisade)]
    mesophyll: Mesophyll,
}

#[derive(Clone, Copy, ValueEnum)]
enum SpecimenName {
    Soybean,
    Maize,
}

#[derive(Clone, Copy, ValueEnum)]
enum PathName {
    Slant,
    Sieve,
}

#[derive(Clone, Copy, ValueEnum)]
enum Entry {
    Diffuse,
    Oblateness,
}

#[derive(Clone, Copy, ValueEnum)]
enum CrossingName {
    Resample,
    Mirror,
    Keep,
}

#[derive(Clone, Copy, ValueEnum)]
enum StatesName {
    All,
    Reduced,
}

#[derive(Clone, Copy, ValueEnum)]
enum Mesophyll {
    Palisade,
    Undifferentiated,
}

impl TissueArgs {
    fn path(&self, default: PathRule) -> PathRule {
        match self.path {
            None => default,
            Some(PathName::Slant) => PathRule::Slant,
            Some(PathName::Sieve) => PathRule::Sieve,
        }
    }

    /// Returns the model with its parameters. `cab` and `car`, in ug/cm2, replace the contents of the model's own leaf
    /// where they are given.
    pub fn leaf_model(&self, model: Model, cab: Option<f64>, car: Option<f64>) -> Result<LeafModel, Failure> {
        let specimen = |default| self.specimen(default, cab, car);
        Ok(match model {
            Model::PlateN => LeafModel::Plate(PlateModel::N),
            Model::PlateTwoSided => LeafModel::TwoSided(self.halves()?),
            Model::PlateExact => LeafModel::Plate(PlateModel::Exact),
            Model::PlatePaper => LeafModel::Plate(PlateModel::Paper),
            Model::Abm97 => LeafModel::Abm97(self.abm97(cab, car)?),
            Model::AbmB => {
                LeafModel::AbmB(AbmB { specimen: specimen(Specimen::soybean())?, path: self.path(PathRule::Sieve) })
            }
            Model::AbmU => {
                LeafModel::AbmU(AbmU { specimen: specimen(Specimen::maize())?, path: self.path(PathRule::Sieve) })
            }
        })
    }

    fn halves(&self) -> Result<TwoHalves, Failure> {
        let usual = TwoHalves::default();
        let halves = TwoHalves {
            layers: self.palisade_layers.unwrap_or(usual.layers),
            pigments: self.palisade_pigments.unwrap_or(usual.pigments),
            body: self.palisade_body.unwrap_or(usual.body),
        };
        halves.check()?;
        Ok(halves)
    }

    fn abm97(&self, cab: Option<f64>, car: Option<f64>) -> Result<Abm97, Failure> {
        let mut leaf = Abm97::default();
        if let Some(cab) = cab {
            leaf.chlorophyll = MicrogramsPerSquareCentimetre(cab);
        }
        if let Some(car) = car {
            leaf.carotenoid = MicrogramsPerSquareCentimetre(car);
        }
        if let Some(cm) = self.thickness_cm {
            leaf.leaf_thickness = Centimetres(cm);
        }
        if let Some(oblateness) = self.oblateness {
            leaf.adaxial.oblateness = oblateness;
            leaf.abaxial.oblateness = oblateness;
        }
        leaf.mesophyll = match self.mesophyll {
            Mesophyll::Palisade => MesophyllKind::Palisade,
            Mesophyll::Undifferentiated => MesophyllKind::Undifferentiated,
        };
        leaf.switches = Abm97Switches {
            entry: match self.entry {
                Entry::Diffuse => EntryLobe::Diffuse,
                Entry::Oblateness => EntryLobe::Oblateness,
            },
            spongy_side_spreads: !self.flat_spongy_side,
            crossing: match self.crossing {
                CrossingName::Resample => Crossing::Resample,
                CrossingName::Mirror => Crossing::Mirror,
                CrossingName::Keep => Crossing::Keep,
            },
            path: self.path(PathRule::Slant),
            states: match self.states {
                StatesName::All => States::All,
                StatesName::Reduced => States::Reduced,
            },
        };
        leaf.check()?;
        Ok(leaf)
    }

    fn specimen(&self, default: Specimen, cab: Option<f64>, car: Option<f64>) -> Result<Specimen, Failure> {
        let mut leaf = match self.specimen {
            None => default,
            Some(SpecimenName::Soybean) => Specimen::soybean(),
            Some(SpecimenName::Maize) => Specimen::maize(),
        };
        if let Some(cm) = self.thickness_cm {
            leaf.thickness = Centimetres(cm);
        }
        if let Some(oblateness) = self.oblateness {
            leaf.aspect.epidermis = oblateness;
        }
        if let Some(cab) = cab {
            leaf.composition.chlorophyll = leaf.concentration(MicrogramsPerSquareCentimetre(cab));
        }
        if let Some(car) = car {
            leaf.composition.carotenoid = leaf.concentration(MicrogramsPerSquareCentimetre(car));
        }
        leaf.check()?;
        Ok(leaf)
    }
}

/// Contents of the leaf.
#[derive(Args, Clone)]
#[command(next_help_heading = "Contents")]
pub struct ContentsArgs {
    /// Chlorophyll a + b in ug/cm2 (0 to 100) [default: 40 for plates, else the model's own leaf]
    #[arg(long)]
    pub cab: Option<f64>,
    /// Carotenoids in ug/cm2 (0 to 25) [default: 8 for plates, else the model's own leaf]
    #[arg(long)]
    pub car: Option<f64>,
    /// Anthocyanins in ug/cm2 (0 to 15), plate-n only [default: 0]
    #[arg(long)]
    pub cant: Option<f64>,
    /// Brown pigment in arbitrary units (0 to 1), plates only [default: 0]
    #[arg(long)]
    pub cbrown: Option<f64>,
    /// Dry matter in g/cm2 (0 to 0.02), plates only [default: 0.005]
    #[arg(long)]
    pub cm: Option<f64>,
    /// Water in cm (0 to 0.04), plates only [default: 0.01]
    #[arg(long)]
    pub cw: Option<f64>,
    /// Structure parameter N (1 to 3), plates only [default: 1.5]
    #[arg(long)]
    pub n: Option<f64>,
    /// Half-angle of the cone of incident light in degrees, spectra of plates only [default: 40 for plate-n, else 0]
    #[arg(long)]
    pub cone_deg: Option<f64>,
}

impl ContentsArgs {
    /// Returns the contents for the plate models, over `default`.
    pub fn over(&self, default: LeafContents) -> LeafContents {
        LeafContents {
            chlorophyll_ug_per_cm2: self.cab.unwrap_or(default.chlorophyll_ug_per_cm2),
            carotenoid_ug_per_cm2: self.car.unwrap_or(default.carotenoid_ug_per_cm2),
            anthocyanin_ug_per_cm2: self.cant.unwrap_or(default.anthocyanin_ug_per_cm2),
            brown: self.cbrown.unwrap_or(default.brown),
            water_cm: self.cw.unwrap_or(default.water_cm),
            dry_matter_g_per_cm2: self.cm.unwrap_or(default.dry_matter_g_per_cm2),
            structure: self.n.unwrap_or(default.structure),
        }
    }
}
