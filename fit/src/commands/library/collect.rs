//! `btf-fit library collect`.

use crate::commands::failure::Failure;
use crate::commands::options::Shared;
use crate::commands::output::{check_distinct, check_file, complain, is_stdout, say, write_json};
use crate::commands::progress;
use btf_capture::write_file_atomically;
use btf_fit::{Library, Status, catalogue_csv, catalogue_html, collect_library};
use clap::Args;
use std::path::{Path, PathBuf};

/// Check every asset of a plan, tell what failed and why, and write a catalogue
///
/// The catalogue is a page that opens without a network, with a picture of each material on three shapes, sorting,
/// searching, and the materials that look like one; the same figures are written as JSON and CSV.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  btf-fit library collect library.toml && xdg-open library.html")]
pub(super) struct CollectArgs {
    /// The plan
    #[arg(value_name = "PLAN.toml")]
    plan: PathBuf,
    /// The page to write; that of the plan's name if not given
    #[arg(short, long, value_name = "CATALOGUE.html")]
    output: Option<PathBuf>,
    /// Where to write the figures as JSON, - for standard output; beside the page if not given
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Where to write the figures as CSV; beside the page if not given
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

pub(super) fn run(args: &CollectArgs, shared: &Shared) -> Result<(), Failure> {
    let page = args.output.clone().unwrap_or_else(|| args.plan.with_extension("html"));
    let json = args.json.clone().unwrap_or_else(|| page.with_extension("json"));
    let csv = args.csv.clone().unwrap_or_else(|| page.with_extension("csv"));
    if is_stdout(&page) || is_stdout(&csv) {
        return Err(Failure::Usage("the page and the CSV file are files; only --json may be -".into()));
    }
    let outputs: [&Path; 3] = [&page, &json, &csv];
    check_distinct(&outputs)?;
    for path in outputs {
        check_file(path, std::slice::from_ref(&args.plan))?;
    }
    let monitor = progress::monitor(shared, None)?;
    let library = collect_library(&args.plan, &monitor)?;
    let title = args.plan.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    monitor.check()?;
    write_file_atomically(&page, catalogue_html(&library, &title).as_bytes())?;
    write_file_atomically(&csv, catalogue_csv(&library).as_bytes())?;
    write_json(&json, &library)?;
    if !shared.quiet && !is_stdout(&json) {
        report(&library, &page);
    }
    let bad = library.materials.iter().filter(|m| matches!(m.status, Status::Failed { .. } | Status::Damaged { .. }));
    match bad.count() {
        0 => Ok(()),
        1 => Err(Failure::Path("1 material has no sound asset; correct what is wrong and run the plan again".into())),
        count => Err(Failure::Path(format!(
            "{count} materials have no sound asset; correct what is wrong and run the plan again"
        ))),
    }
}

fn report(library: &Library, page: &Path) {
    for material in &library.materials {
        match &material.status {
            Status::Failed { reason } => complain(&format!("{} failed: {reason}", material.name)),
            Status::Damaged { reason } => {
                complain(&format!(
                    "{} is damaged: {reason}; fit it anew with --again {}",
                    material.name, material.name
                ));
            }
            Status::InWork { worker, silent_s } => {
                complain(&format!("{} is in work at {worker}, last heard of {silent_s} s ago", material.name));
            }
            Status::Fitted | Status::Open => {}
        }
    }
    let counts: Vec<String> = Status::NAMES
        .into_iter()
        .filter(|name| library.count(name) > 0)
        .map(|name| format!("{} {name}", library.count(name)))
        .collect();
    say(&format!("{}: {}", page.display(), counts.join(", ")));
}
