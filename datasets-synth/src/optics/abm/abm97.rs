//! `abm97`: the algorithmic model of 1997, a random walk over four interfaces [Baranoski 1997].
//!
//! | parameter | symbol | unit | default | valid |
//! |---|---|---|---|---|
//! | index of the epidermis' outer wall, per face | eta_c | - | 1.6 | 1.3 to 1.7 |
//! | oblateness of epidermal cells, per face | ob | - | 5 | 1 to 20 (any >= 0 works) |
//! | index of the mesophyll's cell wall | eta_m | - | 1.41 | 1.3 to 1.6 |
//! | index of the antidermal wall | eta_a | - | 1.42 | 1.3 to 1.6 |
//! | chlorophyll a + b | c | ug/cm2 | 43.62 | 0 to 100 |
//! | carotenoids | | ug/cm2 | 0 | 0 to 25 |
//! | water, share of the mesophyll's volume | | - | 1 | 0 to 1 |
//! | leaf thickness | | cm | 0.016 | 0.003 to 0.03 |
//! | share that is pigmented mesophyll | | - | 0.45 (palisade) | 0.45 or 0.75 |
//!
//! The defaults are the soybean leaf of the paper's Table 1: t_m = 0.45 x 0.016 cm = 0.0072 cm.
//!
//! From the adaxial face down, with the indices that each interface uses:
//!
//! ```text
//! 1  air 1       | epidermis eta_c     reflected outside: eq. 5; into the mesophyll: eq. 6
//!    mesophyll, absorbs
//! 2  mesophyll eta_m | air 1           eq. 6 on both sides
//!    air space
//! 3  air 1       | antidermal wall eta_a   eq. 5 on both sides
//!    wall
//! 4  epidermis eta_c | air 1           eq. 5 on both sides
//! ```
//!
//! Absorption: `A_g = A c / t_m`, so a straight crossing has the optical depth `A c`; a slanted one
//! `1 / cos` of it; water adds `A_w t_m` (it matters beyond 700 nm).
//!
//! Differs from the paper in: `c` is a content per area and is divided by `t_m` (used raw, as printed,
//! absorption vanishes and reflectance is 0.39 to 0.46 everywhere); total reflection has F = 1, which
//! eq. 2 leaves out; free paths draw from (0, 1], so that no logarithm is infinite. The paper's figures
//! 3 and 4 say which rays are spread and are not readable in its scans: [`Abm97Switches`] hold the
//! readings.
//!
//! When it is wrong: light enters at eta_c and leaves at eta_m without an interface between the two, so
//! etendue is not conserved and the model is not reciprocal (without absorption diffuse transmittance is
//! 0.465 from one face and 0.480 from the other); the cosine lobes about slanted rays send too much
//! light towards grazing transmission; the back's reflectance at 680 nm is 0.18 where measured broad
//! leaves have 0.11 on average (states 3 and 4 unspread give 0.10). `abm_b` mends the interfaces.

use crate::error::{SynthError, check_range};
use crate::optics::abm::stack::{Crossing, Interface, Medium, PathRule, Spread, Stack};
use crate::optics::abm::tissue::{DepthParts, Tissue};
use crate::optics::tables::abm::water;
use crate::optics::tables::interpolated;
use crate::optics::tables::leaf_table::{LEAF_FIRST_NM, LEAF_LAST_NM, PROSPECT_5};
use crate::optics::units::{Centimetres, MicrogramsPerSquareCentimetre, Nanometres, SquareCentimetresPerMicrogram};

/// Epidermis of one face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Epidermis {
    /// Refractive index of the outer wall, eta_c.
    pub index: f64,
    /// Oblateness of the cells, ob; large is nearly specular.
    pub oblateness: f64,
}

impl Default for Epidermis {
    /// Returns the epidermis of the paper's Table 1.
    fn default() -> Epidermis {
        Epidermis { index: 1.6, oblateness: 5.0 }
    }
}

/// Kind of mesophyll, which sets the pigmented share of the thickness [Baranoski 1997, sec. 3.2].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MesophyllKind {
    /// Palisade tissue over spongy tissue: 45 %.
    #[default]
    Palisade,
    /// Undifferentiated, of spongy cells only: 75 %.
    Undifferentiated,
}

impl MesophyllKind {
    fn share(self) -> f64 {
        match self {
            MesophyllKind::Palisade => 0.45,
            MesophyllKind::Undifferentiated => 0.75,
        }
    }
}

/// Spread of light that enters through state 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum EntryLobe {
    /// Diffusely, eq. 6: "when light passes to the mesophyll its direction of travel is randomized". Gives
    /// T = 0.136 at 550 nm.
    #[default]
    Diffuse,
    /// About the refracted ray with the cells' oblateness, eq. 5: T = 0.245.
    Oblateness,
}

/// States that are walked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum States {
    /// All four states.
    #[default]
    All,
    /// Reduced form of the paper for scenes with many leaves: states 1 and 2 alone, so the leaf ends below its
    /// mesophyll [Baranoski 1997, sec. 5].
    Reduced,
}

/// Choices where the paper leaves the reading open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Abm97Switches {
    /// Spread of the refracted ray in state 1.
    pub entry: EntryLobe,
    /// Whether states 3 and 4 spread by the oblateness, as the text says; unspread they fit measured backs better.
    pub spongy_side_spreads: bool,
    /// Rule for lobes that cross the interface which they have just left.
    pub crossing: Crossing,
    /// Length of a slanted crossing; the paper's is [`PathRule::Slant`].
    pub path: PathRule,
    /// States that are walked.
    pub states: States,
}

impl Default for Abm97Switches {
    fn default() -> Abm97Switches {
        Abm97Switches {
            entry: EntryLobe::Diffuse,
            spongy_side_spreads: true,
            crossing: Crossing::Resample,
            path: PathRule::Slant,
            states: States::All,
        }
    }
}

/// Leaf of the 1997 model; see the table of the module.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Abm97 {
    /// Upper epidermis.
    pub adaxial: Epidermis,
    /// Lower epidermis.
    pub abaxial: Epidermis,
    /// Refractive index of the mesophyll's cell wall.
    pub mesophyll_index: f64,
    /// Refractive index of the antidermal wall.
    pub antidermal_index: f64,
    /// Chlorophyll a + b.
    pub chlorophyll: MicrogramsPerSquareCentimetre,
    /// Carotenoids.
    pub carotenoid: MicrogramsPerSquareCentimetre,
    /// Share of the mesophyll's volume that is water.
    pub water_share: f64,
    /// Thickness of the whole leaf.
    pub leaf_thickness: Centimetres,
    /// Kind of mesophyll, which sets the pigmented share of the thickness.
    pub mesophyll: MesophyllKind,
    /// Choices where the paper leaves the reading open.
    pub switches: Abm97Switches,
}

impl Default for Abm97 {
    /// Returns the soybean leaf of the paper's Table 1.
    fn default() -> Abm97 {
        Abm97 {
            adaxial: Epidermis::default(),
            abaxial: Epidermis::default(),
            mesophyll_index: 1.41,
            antidermal_index: 1.42,
            chlorophyll: MicrogramsPerSquareCentimetre(43.62),
            carotenoid: MicrogramsPerSquareCentimetre(0.0),
            water_share: 1.0,
            leaf_thickness: Centimetres(0.016),
            mesophyll: MesophyllKind::Palisade,
            switches: Abm97Switches::default(),
        }
    }
}

impl Abm97 {
    /// Returns the thickness of the pigmented tissue, t_m.
    pub fn mesophyll_thickness(&self) -> Centimetres {
        self.leaf_thickness * self.mesophyll.share()
    }

    /// Checks every range. The ranges are wider than those of the table where the walk itself still means something.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first that is out of range.
    pub fn check(&self) -> Result<(), SynthError> {
        for epidermis in [self.adaxial, self.abaxial] {
            check_range("--cuticle-index", epidermis.index, 1.0, 2.0)?;
            check_range("--oblateness", epidermis.oblateness, 0.0, 1e6)?;
        }
        check_range("--mesophyll-index", self.mesophyll_index, 1.0, 2.0)?;
        check_range("--antidermal-index", self.antidermal_index, 1.0, 2.0)?;
        check_range("--cab", self.chlorophyll.0, 0.0, 100.0)?;
        check_range("--car", self.carotenoid.0, 0.0, 25.0)?;
        check_range("the water share", self.water_share, 0.0, 1.0)?;
        check_range("--thickness-cm", self.leaf_thickness.0, 0.003, 0.05)
    }
}

impl Tissue for Abm97 {
    fn stack(&self, _: Nanometres) -> Stack {
        let Abm97Switches { entry, spongy_side_spreads, crossing, path, states } = self.switches;
        let cells = |epidermis: Epidermis| Spread::exponent(epidermis.oblateness);
        let upper = Interface {
            index_above: 1.0,
            index_below: self.adaxial.index,
            reflected_above: cells(self.adaxial),
            refracted_below: match entry {
                EntryLobe::Diffuse => Spread::diffuse(),
                EntryLobe::Oblateness => cells(self.adaxial),
            },
            reflected_below: Spread::diffuse(),
            refracted_above: cells(self.adaxial),
        };
        let diffuse = Spread::diffuse();
        let mesophyll = Interface {
            index_above: self.mesophyll_index,
            index_below: 1.0,
            reflected_above: diffuse,
            refracted_below: diffuse,
            reflected_below: diffuse,
            refracted_above: diffuse,
        };
        if states == States::Reduced {
            return Stack::new(vec![upper, mesophyll], vec![Medium::Mesophyll], path, crossing);
        }
        let spongy = if spongy_side_spreads { cells(self.abaxial) } else { Spread::None };
        let spread = |above: f64, below: f64| Interface {
            index_above: above,
            index_below: below,
            reflected_above: spongy,
            refracted_below: spongy,
            reflected_below: spongy,
            refracted_above: spongy,
        };
        let wall = spread(1.0, self.antidermal_index);
        let lower = spread(self.abaxial.index, 1.0);
        let media = vec![Medium::Mesophyll, Medium::Clear, Medium::Clear];
        Stack::new(vec![upper, mesophyll, wall, lower], media, path, crossing)
    }

    fn depth_parts(&self, wavelength: Nanometres) -> DepthParts {
        // A_g t_m = (A c / t_m) t_m = A c: a content per area needs no thickness, and none can be 0.
        let thickness = self.mesophyll_thickness();
        DepthParts {
            chlorophyll: chlorophyll(wavelength) * self.chlorophyll,
            carotenoid: carotenoid(wavelength) * self.carotenoid,
            rest: water(wavelength) * self.water_share * thickness,
        }
    }

    fn has_constant_indices(&self) -> bool {
        true
    }
}

/// Returns the specific absorption of chlorophyll a + b [Feret 2008].
fn chlorophyll(wavelength: Nanometres) -> SquareCentimetresPerMicrogram {
    SquareCentimetresPerMicrogram(prospect_5(&PROSPECT_5.chlorophyll, wavelength))
}

/// Returns the specific absorption of carotenoids [Feret 2008].
fn carotenoid(wavelength: Nanometres) -> SquareCentimetresPerMicrogram {
    SquareCentimetresPerMicrogram(prospect_5(&PROSPECT_5.carotenoid, wavelength))
}

/// Returns the value of a pigment's column of PROSPECT-5, beyond its ends that of its ends.
fn prospect_5(column: &[f64], wavelength: Nanometres) -> f64 {
    interpolated(column, LEAF_FIRST_NM, 1.0, wavelength.0.clamp(LEAF_FIRST_NM, LEAF_LAST_NM))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::abm::path_lengths::{Face, Parallel, TracedBeam, trace_path_lengths};

    const GREEN: Nanometres = Nanometres(550.0);
    const RED: Nanometres = Nanometres(680.0);

    fn traced(leaf: &Abm97, face: Face, theta_deg: f64) -> TracedBeam {
        trace_path_lengths(&leaf.stack(GREEN), &Parallel::onto(face, theta_deg), 200_000, 1)
    }

    fn with(switches: Abm97Switches) -> Abm97 {
        Abm97 { switches, ..Abm97::default() }
    }

    #[test]
    fn the_optical_depths_are_those_of_the_only_reading_of_the_units_that_works() {
        let leaf = Abm97::default();
        assert!((leaf.optical_depth(GREEN).0 - 0.561).abs() < 1e-3);
        assert!((leaf.optical_depth(RED).0 - 2.46).abs() < 1e-2);
        assert!((leaf.mesophyll_thickness().0 - 0.0072).abs() < 1e-12);
        // Absorption per length is what the printed eq. 9 wants, and is finite down to no thickness at all.
        let per_length = leaf.depth_parts(GREEN).chlorophyll / leaf.mesophyll_thickness();
        assert!((per_length.0 - 77.9).abs() < 0.1, "A_g in 1/cm");
        let none = Abm97 { leaf_thickness: Centimetres(0.0), ..leaf };
        assert!((none.optical_depth(RED).0 - leaf.optical_depth(RED).0).abs() < 1e-4 && none.check().is_err());
        // Water: nothing in the visible, all of it at its band.
        let dry = Abm97 { water_share: 0.0, ..leaf };
        assert!((dry.optical_depth(GREEN).0 - leaf.optical_depth(GREEN).0).abs() < 1e-5);
        let band = Nanometres(1940.0);
        assert!(dry.optical_depth(band).0 == 0.0 && leaf.optical_depth(band).0 > 0.5);
    }

    /// Reflectance and transmittance at 550 nm over the angle, from another implementation.
    #[test]
    fn the_angle_of_incidence_does_what_it_should() {
        let leaf = Abm97::default();
        let depth = leaf.optical_depth(GREEN).0;
        for (theta, r, t) in [
            (0.0, 0.093, 0.136),
            (30.0, 0.093, 0.133),
            (45.0, 0.101, 0.128),
            (60.0, 0.139, 0.118),
            (75.0, 0.298, 0.093),
            (85.0, 0.636, 0.048),
            (89.0, 0.910, 0.012),
        ] {
            let beam = traced(&leaf, Face::Adaxial, theta);
            let (mine_r, mine_t) = (beam.reflectance(depth).mean, beam.transmittance(depth).mean);
            assert!((mine_r - r).abs() < 0.004 && (mine_t - t).abs() < 0.004, "{theta}: {mine_r} {mine_t}");
        }
    }

    #[test]
    fn its_limits_without_absorption_and_with_full_absorption_are_known() {
        let leaf = Abm97::default();
        let (face, back) = (traced(&leaf, Face::Adaxial, 8.0), traced(&leaf, Face::Abaxial, 8.0));
        assert_eq!((face.lost, back.lost), (0, 0));
        assert!((face.reflectance(0.0).mean + face.transmittance(0.0).mean - 1.0).abs() < 1e-12);
        assert!((face.reflectance(0.0).mean - 0.502).abs() < 0.004);
        assert!((face.reflectance(1e12).mean - 0.0533).abs() < 0.0015 && face.transmittance(1e12).mean == 0.0);
        assert!((back.reflectance(1e12).mean - 0.181).abs() < 0.003);
    }

    #[test]
    fn every_switch_moves_the_figures_where_it_is_known_to() {
        let red = Abm97::default().optical_depth(RED).0;
        let green = Abm97::default().optical_depth(GREEN).0;
        let unspread = with(Abm97Switches { spongy_side_spreads: false, ..Abm97Switches::default() });
        let back = traced(&unspread, Face::Abaxial, 8.0).reflectance(red).mean;
        assert!((back - 0.099).abs() < 0.004, "{back}");
        let directed = with(Abm97Switches { entry: EntryLobe::Oblateness, ..Abm97Switches::default() });
        let through = traced(&directed, Face::Adaxial, 8.0).transmittance(green).mean;
        assert!((through - 0.245).abs() < 0.006, "{through}");
        let mirrored = with(Abm97Switches { crossing: Crossing::Mirror, ..Abm97Switches::default() });
        let default = traced(&Abm97::default(), Face::Adaxial, 8.0).reflectance(green).mean;
        assert!(traced(&mirrored, Face::Adaxial, 8.0).reflectance(green).mean < default - 0.002);
        let reduced = with(Abm97Switches { states: States::Reduced, ..Abm97Switches::default() });
        let two = traced(&reduced, Face::Adaxial, 8.0).reflectance(green).mean;
        assert!(two < default - 0.01, "the spongy side sends light back: {two} {default}");
        let spongy = Abm97 { mesophyll: MesophyllKind::Undifferentiated, ..Abm97::default() };
        assert!((spongy.mesophyll_thickness().0 - 0.012).abs() < 1e-12);
        assert!((spongy.optical_depth(GREEN).0 - green).abs() < 1e-4, "the content per area is what counts");
    }

    #[test]
    fn the_two_epidermes_have_parameters_of_their_own() {
        let waxy = Abm97 { abaxial: Epidermis { index: 1.3, oblateness: 20.0 }, ..Abm97::default() };
        let red = waxy.optical_depth(RED).0;
        let same = traced(&Abm97::default(), Face::Adaxial, 8.0).reflectance(red).mean;
        assert!((traced(&waxy, Face::Adaxial, 8.0).reflectance(red).mean - same).abs() < 0.003);
        let back = traced(&waxy, Face::Abaxial, 8.0).reflectance(red).mean;
        assert!(back < 0.13, "a weaker back reflects less: {back}");
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let bad = Abm97 { chlorophyll: MicrogramsPerSquareCentimetre(-1.0), ..Abm97::default() };
        assert!(bad.check().unwrap_err().to_string().contains("--cab is -1"));
        let bad = Abm97 { leaf_thickness: Centimetres(f64::NAN), ..Abm97::default() };
        assert!(bad.check().is_err());
        Abm97::default().check().unwrap();
    }
}
