//! `btf-fit propose-directions`.

use crate::commands::failure::Failure;
use crate::commands::options::{PriorsArg, Shared};
use crate::commands::output::{check_file, is_stdout, say};
use btf_capture::{Direction, DirectionSet, write_file_atomically};
use btf_fit::{ProposeParams, propose_directions};
use clap::Args;
use std::fmt::Write;
use std::path::PathBuf;

/// Propose which pairs of a view and a light to photograph where there is no time for all
///
/// Writes a list of images (docs/guide/captures.md) with the N pairs that tell most about all pairs of the set under the
/// priors, the most telling first, so that a list may be cut short anywhere. Photograph them under the names of the list, put
/// `incomplete = true` into a capture.toml beside it, and `btf-fit fit` the folder.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-fit propose-directions 328 -o wool/list.csv                 # of Bonn's 81 x 81 pairs
  btf-fit propose-directions 200 -o list.csv --directions dome151")]
pub(in crate::commands) struct ProposeDirectionsArgs {
    /// Number of pairs
    #[arg(value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    count: u32,
    /// The list to write; - for standard output
    #[arg(short, long, value_name = "LIST.csv")]
    output: PathBuf,
    /// Views and lights to choose from: bonn81, dome151, random:N, or a file of `theta phi` lines in degrees
    #[arg(long, value_name = "SET", default_value = "bonn81", value_parser = DirectionSet::by_name)]
    directions: DirectionSet,
    #[command(flatten)]
    priors: PriorsArg,
}

pub(in crate::commands) fn run(args: &ProposeDirectionsArgs, shared: &Shared) -> Result<(), Failure> {
    check_file(&args.output, &[])?;
    let params = ProposeParams { count: args.count as usize, priors: args.priors.priors() };
    let set = &args.directions;
    let pairs = propose_directions(set, set, &params)?;
    let mut list = String::from("file,theta_v,phi_v,theta_l,phi_l\n");
    for (number, pair) in pairs.iter().enumerate() {
        let [view, light] = [pair / set.len(), pair % set.len()].map(|id| set.directions()[id]);
        let angles = |Direction { theta_deg, phi_deg }: Direction| format!("{theta_deg},{phi_deg}");
        // Writing to a string cannot fail.
        let _ = writeln!(list, "{:05}.png,{},{}", number + 1, angles(view), angles(light));
    }
    if is_stdout(&args.output) {
        say(list.trim_end());
        return Ok(());
    }
    write_file_atomically(&args.output, list.as_bytes())?;
    if !shared.quiet {
        let share = 100.0 * pairs.len() as f64 / (set.len() * set.len()) as f64;
        say(&format!(
            "{}: {} pairs, {share:.1} % of {} x {}",
            args.output.display(),
            pairs.len(),
            set.len(),
            set.len()
        ));
    }
    Ok(())
}
