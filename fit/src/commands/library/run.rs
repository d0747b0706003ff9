//! `btf-fit library run`.

use crate::commands::failure::Failure;
use crate::commands::options::Shared;
use crate::commands::output::{check_file, complain, is_stdout, say, tell};
use crate::commands::progress;
use btf_capture::text_from_bytes;
use btf_fit::{RunNews, RunOutcome, RunParams, bytes_from_text, glob_from_text, run_library};
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;

/// Fit the materials of a plan that are not yet done
///
/// Any number of workers may run at the same time, on one machine or on many that share the folder. A worker that is
/// stopped gives its material back; one that is killed loses it to another after --stale-after. A fault stops its own
/// material alone.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  btf-fit library run library.toml
  btf-fit library run library.toml --shard 3/16          # begins with the third sixteenth, then helps with the others
  btf-fit library run library.toml --again 'leather*'    # anew, as after a capture has changed")]
pub(super) struct RunArgs {
    /// The plan
    #[arg(value_name = "PLAN.toml")]
    plan: PathBuf,
    /// Begin with this part of the plan, as 3/16, so that workers that start together do not ask for the same materials
    #[arg(long, value_name = "I/N", default_value = "1/1", value_parser = shard)]
    shard: (usize, usize),
    /// Only materials whose names match this glob; may be given several times
    #[arg(long, value_name = "GLOB")]
    only: Vec<String>,
    /// Fit the materials whose names match this glob again, though they are done; may be given several times
    #[arg(long, value_name = "GLOB")]
    again: Vec<String>,
    /// Fit again what has failed
    #[arg(long)]
    retry: bool,
    /// Wait until the other workers have finished, and take over what they leave
    #[arg(long)]
    wait: bool,
    /// Seconds without a sign of life after which a worker counts as lost
    #[arg(long, value_name = "SECONDS", default_value_t = 300.0, value_parser = seconds)]
    stale_after: f64,
    /// Most memory of a fit, where the plan names none
    #[arg(long, value_name = "SIZE", value_parser = bytes_from_text)]
    memory: Option<u64>,
    /// Write what this worker has done as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

fn shard(text: &str) -> Result<(usize, usize), String> {
    let numbers = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
    let known = |(i, n): &(usize, usize)| (1..=*n).contains(i);
    numbers.filter(known).ok_or_else(|| "it is a part and a number of parts, as 3/16, with parts from 1".into())
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (1.0..=1e6).contains(seconds));
    seconds.ok_or_else(|| "it is a number of seconds from 1 to 1000000".into())
}

pub(super) fn run(args: &RunArgs, shared: &Shared) -> Result<(), Failure> {
    let globs = |texts: &[String]| texts.iter().map(|text| glob_from_text(text)).collect::<Result<Vec<_>, _>>();
    let params = RunParams {
        shard: args.shard,
        only: globs(&args.only)?,
        again: globs(&args.again)?,
        retry: args.retry,
        wait: args.wait,
        stale_after: Duration::from_secs_f64(args.stale_after),
        memory_bytes: args.memory,
    };
    if let Some(path) = &args.json {
        check_file(path, std::slice::from_ref(&args.plan))?;
    }
    let monitor = progress::monitor(shared, None)?;
    // What is written as JSON to standard output stands there alone.
    let quiet = shared.quiet || args.json.as_deref().is_some_and(is_stdout);
    let outcome = run_library(&args.plan, &params, &monitor, &|news| match news {
        RunNews::Begun(_) => {}
        RunNews::Fitted(name, fitted) if !quiet => {
            let size = text_from_bytes(fitted.bytes);
            say(&format!("{name}: {size}, {:.2} dB", fitted.metrics.psnr_db));
            fitted.remarks.iter().for_each(|remark| complain(&format!("note: {name}: {remark}")));
        }
        RunNews::Fitted(..) => {}
        RunNews::Failed(name, reason) => complain(&format!("{name} failed: {reason}")),
    })?;
    tell(args.json.as_deref(), quiet, &outcome, || summary(&outcome))?;
    if outcome.failed.is_empty() {
        return Ok(());
    }
    let names: Vec<&str> = outcome.failed.keys().map(String::as_str).take(5).collect();
    Err(Failure::Path(format!(
        "{} failed ({}{}); correct what is wrong with them and run again with --retry",
        if outcome.failed.len() == 1 { "1 material".into() } else { format!("{} materials", outcome.failed.len()) },
        names.join(", "),
        if outcome.failed.len() > names.len() { ", ..." } else { "" }
    )))
}

fn summary(outcome: &RunOutcome) -> String {
    let mut parts = vec![format!("{} fitted here", outcome.fitted), format!("{} done before", outcome.done_before)];
    if outcome.failed_before > 0 {
        parts.push(format!("{} failed before (--retry tries them again)", outcome.failed_before));
    }
    if outcome.with_others > 0 {
        parts.push(format!("{} with other workers", outcome.with_others));
    }
    parts.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_count_from_one() {
        assert_eq!(shard("3/16"), Ok((3, 16)));
        assert_eq!(shard("1/1"), Ok((1, 1)));
        for odd in ["0/4", "5/4", "1", "a/b", "-1/2", "1/0"] {
            assert!(shard(odd).is_err(), "{odd}");
        }
    }
}
