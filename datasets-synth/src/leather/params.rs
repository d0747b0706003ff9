//! Parameters of leather and of its capture.
//!
//! | parameter | unit | default | valid |
//! |---|---|---|---|
//! | grain (size of a pebble) | mm | 1.1 | 0.2 to 10 |
//! | relief (height of a pebble) | mm | 0.14 | 0 to 1 |
//! | wrinkles | - | 1 | 0 to 3 |
//! | pores (share of follicles that show) | - | 0.45 | 0 to 1 |
//! | colour (body, lit and seen from above) | linear sRGB | cognac | 0.002 to 0.8 |
//! | antique (pigment gathered in creases) | - | 0.6 | 0 to 2 |
//!
//! For the parameters of the finish see [`FinishParams`].

use crate::error::{SynthError, check_ranges};
use crate::leather::finish::FinishParams;
use crate::surface::capture_params::CaptureParams;

/// Parameters of leather; see the table of the module.
#[derive(Debug, Clone, PartialEq)]
pub struct LeatherParams {
    /// Patch, directions and images of the capture.
    pub capture: CaptureParams,
    /// Mean size of a pebble in millimetres, 0.2 to 10.
    pub grain_mm: f64,
    /// Height of a pebble over the crease around it in millimetres, 0 to 1.
    pub relief_mm: f64,
    /// Strength of the fine wrinkles, 0 to 3.
    pub wrinkles: f64,
    /// Share of the hair follicles that show as pores, 0 to 1.
    pub pores: f64,
    /// Colour of the body below the finish, lit and seen from above, linear sRGB, 0.002 to 0.8.
    pub colour: [f64; 3],
    /// Additional pigment in the creases, 0 to 2.
    pub antique: f64,
    /// Finish on top of the grain.
    pub finish: FinishParams,
    /// Whether light that was reflected by other pebbles is counted.
    pub bounce: bool,
}

impl Default for LeatherParams {
    /// Returns a cognac-brown pebbled leather, 256 x 256 texels of 16 x 16 mm.
    fn default() -> LeatherParams {
        LeatherParams {
            capture: CaptureParams::new(16.0),
            grain_mm: 1.1,
            relief_mm: 0.14,
            wrinkles: 1.0,
            pores: 0.45,
            colour: [0.24, 0.095, 0.038],
            antique: 0.6,
            finish: FinishParams::default(),
            bounce: true,
        }
    }
}

impl LeatherParams {
    /// Checks every range.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for the first that is out of its range.
    pub fn check(&self) -> Result<(), SynthError> {
        self.capture.check()?;
        self.finish.check()?;
        check_ranges(&[
            ("--grain-mm", self.grain_mm, 0.2, 10.0),
            ("--relief-mm", self.relief_mm, 0.0, 1.0),
            ("--wrinkles", self.wrinkles, 0.0, 3.0),
            ("--pores", self.pores, 0.0, 1.0),
            ("--antique", self.antique, 0.0, 2.0),
        ])?;
        check_ranges(&self.colour.map(|c| ("--colour", c, 0.002, 0.8)))
    }

    /// Describes the parameters in one line, for the provenance of the capture.
    pub fn provenance(&self) -> String {
        format!(
            "btf-synth leather: grain {} mm, relief {} mm, wrinkles {}, pores {}, body colour {:?}, antique {}, \
             finish of index {}, roughness {} and tail {}, bounce {}, seed {}, synthetic",
            self.grain_mm,
            self.relief_mm,
            self.wrinkles,
            self.pores,
            self.colour,
            self.antique,
            self.finish.index,
            self.finish.roughness,
            self.finish.tail,
            self.bounce,
            self.capture.seed,
        )
    }
}
