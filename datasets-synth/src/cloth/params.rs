//! Parameters of cloth and of its capture.
//!
//! | parameter | unit | default | valid |
//! |---|---|---|---|
//! | weave | - | twill | plain, twill, satin |
//! | warp, weft count | yarns per cm | 20, 18 | 4 to 80 |
//! | flatness (thickness over width) | - | 0.5 | 0.2 to 1 |
//! | twist | degrees | 32 | -50 to 50 |
//! | plies | - | 2 | 1 to 4 |
//! | fuzz (height of loose fibres) | micrometres | 3 | 0 to 30 |
//! | irregularity | - | 0.35 | 0 to 1 |
//! | warp, weft colour (diffuse albedo) | linear sRGB | blue, near white | 0 to 0.9 |
//!
//! For the parameters of the fibre see [`FibreParams`].

use crate::cloth::fibre::FibreParams;
use crate::cloth::weave::Weave;
use crate::error::{SynthError, check_ranges};
use crate::surface::capture_params::CaptureParams;

/// Parameters of cloth; see the table of the module.
#[derive(Debug, Clone, PartialEq)]
pub struct ClothParams {
    /// Patch, directions and images of the capture.
    pub capture: CaptureParams,
    /// Interlacing of warp and weft.
    pub weave: Weave,
    /// Warp yarns per centimetre, 4 to 80; they run along y.
    pub warp_per_cm: f64,
    /// Weft yarns per centimetre, 4 to 80; they run along x.
    pub weft_per_cm: f64,
    /// Thickness of a yarn over its width, 0.2 to 1.
    pub flatness: f64,
    /// Angle of the outermost fibres of a single yarn, or of the plies of a plied one, against the yarn in degrees, -50
    /// to 50; the sign is the sense of twist.
    pub twist_deg: f64,
    /// Strands that a yarn is plied of, 1 to 4.
    pub plies: u32,
    /// Root mean square height of the smallest bumps in micrometres, 0 to 30.
    pub fuzz_um: f64,
    /// Variation of the width and course of yarns, 0 to 1.
    pub irregularity: f64,
    /// Diffuse albedo of flat cloth of the fibres of the warp, linear sRGB, 0 to 0.9. The surface reflection of a fibre
    /// (some percent) is its lower bound.
    pub warp_colour: [f64; 3],
    /// Diffuse albedo of flat cloth of the fibres of the weft, linear sRGB, 0 to 0.9.
    pub weft_colour: [f64; 3],
    /// Fibre that warp and weft are spun of.
    pub fibre: FibreParams,
    /// Whether light that was reflected by other yarns is counted.
    pub bounce: bool,
}

impl Default for ClothParams {
    /// Returns a blue and white cotton twill, 256 x 256 texels of 10 x 10 mm.
    fn default() -> ClothParams {
        ClothParams {
            capture: CaptureParams::new(10.0),
            weave: Weave::Twill,
            warp_per_cm: 20.0,
            weft_per_cm: 18.0,
            flatness: 0.5,
            twist_deg: 32.0,
            plies: 2,
            fuzz_um: 3.0,
            irregularity: 0.35,
            warp_colour: [0.045, 0.075, 0.19],
            weft_colour: [0.58, 0.56, 0.50],
            fibre: FibreParams::default(),
            bounce: true,
        }
    }
}

impl ClothParams {
    /// Checks every range.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first that is out of its range.
    pub fn check(&self) -> Result<(), SynthError> {
        self.capture.check()?;
        self.fibre.check()?;
        check_ranges(&[
            ("--warp-per-cm", self.warp_per_cm, 4.0, 80.0),
            ("--weft-per-cm", self.weft_per_cm, 4.0, 80.0),
            ("--flatness", self.flatness, 0.2, 1.0),
            ("--twist-deg", self.twist_deg, -50.0, 50.0),
            ("--plies", f64::from(self.plies), 1.0, 4.0),
            ("--fuzz-um", self.fuzz_um, 0.0, 30.0),
            ("--irregularity", self.irregularity, 0.0, 1.0),
        ])?;
        for (name, colour) in [("--warp-colour", self.warp_colour), ("--weft-colour", self.weft_colour)] {
            check_ranges(&colour.map(|c| (name, c, 0.0, 0.9)))?;
        }
        Ok(())
    }

    /// Describes the parameters in one line, for the provenance of the capture.
    pub fn provenance(&self) -> String {
        format!(
            "btf-synth cloth: {} weave of {} warp and {} weft yarns per cm, flatness {}, twist {} degrees, {} plies, \
             fuzz {} um, irregularity {}, warp albedo {:?}, weft albedo {:?}, fibre index {}, bounce {}, seed {}, \
             synthetic",
            self.weave,
            self.warp_per_cm,
            self.weft_per_cm,
            self.flatness,
            self.twist_deg,
            self.plies,
            self.fuzz_um,
            self.irregularity,
            self.warp_colour,
            self.weft_colour,
            self.fibre.index,
            self.bounce,
            self.capture.seed,
        )
    }
}
