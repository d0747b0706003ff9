//! `--maps` of the exports that fit a material, and what they tell of it.

use btf_fit::{Maps, TriedPart};
use clap::ValueEnum;

/// Which optional parts to fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum MapsArg {
    /// Only parts that save a twentieth of the squared error
    Auto,
    /// All parts
    All,
}

impl From<MapsArg> for Maps {
    fn from(arg: MapsArg) -> Maps {
        match arg {
            MapsArg::Auto => Maps::Auto,
            MapsArg::All => Maps::All,
        }
    }
}

/// Returns a line about a part that was tried.
pub(super) fn line_of_part(part: &TriedPart) -> String {
    let verdict = if part.used { "used" } else { "left out" };
    format!("{:10} saves {:.1} % of the squared error, {verdict}", part.name, 100.0 * part.saved)
}
