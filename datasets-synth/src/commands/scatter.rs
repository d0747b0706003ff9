//! `btf-synth scatter`: the table of an algorithmic leaf model, by which viewers draw the model live.

use std::path::PathBuf;
use std::time::Instant;

use btf_synth::{LeafModel, leaf_table};
use clap::Args;
use serde_json::json;

use super::arguments::whole_number;
use super::failure::Failure;
use super::model::{Model, TissueArgs};
use super::run_args::RunArgs;

#[derive(Args)]
#[command(after_help = "Examples:
  btf-synth scatter abm97.leaftable
  btf-synth scatter abm-b.leaftable --model abm-b
  btf-view --leaf leaf.toml --leaf-table abm-b.leaftable")]
pub struct ScatterArgs {
    /// File to write
    out: PathBuf,
    /// Model of the leaf's optics: abm97, abm-b or abm-u
    #[arg(long, value_enum, default_value_t = Model::Abm97)]
    model: Model,
    #[command(flatten)]
    tissue: TissueArgs,
    #[command(flatten)]
    run: RunArgs,
    /// Rays of each of 20 incidences on either face, such as 1e6
    #[arg(long, value_parser = whole_number, default_value = "1e6")]
    rays: u64,
    /// Seed of the rays
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Traces the table and writes it.
pub fn run(args: &ScatterArgs) -> Result<(), Failure> {
    if !(1000..=1_000_000_000).contains(&args.rays) {
        return Err(Failure::Usage(format!("--rays {} is out of range; give 1e3 to 1e9", args.rays)));
    }
    let model = args.tissue.leaf_model(args.model, None, None)?;
    let unit = args.tissue.leaf_model(args.model, Some(1.0), Some(1.0))?;
    let own = match &model {
        LeafModel::Abm97(leaf) => [leaf.chlorophyll, leaf.carotenoid],
        LeafModel::AbmB(leaf) => [leaf.specimen.chlorophyll_per_area(), leaf.specimen.carotenoid_per_area()],
        LeafModel::AbmU(leaf) => [leaf.specimen.chlorophyll_per_area(), leaf.specimen.carotenoid_per_area()],
        LeafModel::Plate(_) | LeafModel::TwoSided(_) => {
            return Err(Failure::Usage(format!(
                "{} needs no table: btf-view draws plates live by themselves; give --model abm97, abm-b or abm-u",
                args.model
            )));
        }
    };
    let own = own.map(|content| content.0 as f32);
    let started = Instant::now();
    let table = args
        .run
        .work("table", "traces", 2, |progress| leaf_table(&unit, own, args.rays, args.seed, progress))?
        .ok_or_else(|| Failure::Usage("a model of plates has no table".into()))?;
    table.write(&args.out).map_err(|error| Failure::Failed(error.to_string()))?;
    let channels = table.channels();
    let bytes = std::fs::metadata(&args.out).map_or(0, |about| about.len());
    let result = json!({
        "path": args.out.display().to_string(),
        "model": table.model,
        "channels": channels,
        "ways": table.ways,
        "chlorophyll_ug_per_cm2": own[0],
        "carotenoid_ug_per_cm2": own[1],
        "rays": args.rays,
        "bytes": bytes,
        "seed": args.seed,
        "seconds": started.elapsed().as_secs_f64(),
    });
    let line = format!("{}: {} for {channels} channels, {bytes} bytes", args.out.display(), table.model);
    args.run.report(&result, &line)
}
