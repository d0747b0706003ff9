//! The command line of `btf-view`: one file per command, and what they share.

mod assets;
mod band_picture;
mod bench;
mod gpu_bench;
mod headless;
mod landscape;
mod lod_transition;
mod measure;
mod parse;
mod plan;
mod progress;
mod render_arguments;
mod report;
mod scene_options;
mod serve;
mod show;
mod view;

use bench::BenchArguments;
use btf_viewer::ViewerError;
use clap::Parser;
use landscape::LandscapeArguments;
use measure::MeasureArguments;
use plan::PlanArguments;
use serve::ServeArguments;
use std::process::ExitCode;
use view::ViewArguments;

const EXAMPLES: &str = "\
Examples:
  btf-view leaf.spmm
  btf-view leaf.spmm --headless --out leaf.png --size 512x512
  btf-view leaf.spmm cloth.spmm --mesh cornell --lights 3
  btf-view --scene scene.toml --headless --out picture.png --json -
  btf-view bench lights cloth.spmm --plot lights.svg

In the window: drag turns, the wheel zooms, Shift or the right button moves.";

/// Shows packed BTF assets (.spmm) on a mesh, lit by point lights.
#[derive(Parser)]
#[command(name = "btf-view", version, after_help = EXAMPLES, args_conflicts_with_subcommands = true,
          subcommand_help_heading = "Other commands")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    view: ViewArguments,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Measures how the time of a frame grows, and with what
    #[command(after_help = "Example: btf-view bench lights cloth.spmm --json lights.json --plot lights.svg")]
    Bench(BenchArguments),
    /// Measures a canopy: leaf area, leaf angles, gaps, reflectance and absorbed light by band and sun
    #[command(after_help = "Examples:
  btf-synth plants field.glb --rows 4 --columns 16 && btf-synth spectrum --csv leaf.csv --both-sides
  btf-view measure field.glb --leaf leaf.csv --soil 0.2 --bands-nm 550,670,800 --sun-deg 30,60
  btf-view measure field.glb --leaf leaf.csv --soil soil.csv --sky --plot brf.svg --leaves leaves.csv --json field.json")]
    Measure(MeasureArguments),
    /// Says what a scene's pictures need of its assets, and writes assets that hold no more
    #[command(after_help = "Example: btf-view plan scene.toml -o trimmed && btf-view --scene trimmed/scene.toml")]
    Plan(PlanArguments),
    /// Shows a lawn, a grove or a forest of volumetric textures
    #[command(after_help = "Examples:
  btf-view scene lawn
  btf-view scene forest --headless --out forest.png --size 768x576 --frames 16
  btf-view scene grove --times 10 --camera 3 --headless --out grove.png --json -
  btf-view scene lawn --wind 4 --camera 2 --headless --out wind.png --sequence 50")]
    Scene(LandscapeArguments),
    /// Draws pictures for another program, which asks for them on standard input
    #[command(after_help = "A request is a line of JSON, as docs/reference/serve.md has it. Example:
  echo '{\"scene\": \"scene.toml\", \"size\": [640, 480], \"frames\": 4}' | btf-view serve > answer")]
    Serve(ServeArguments),
}

/// Runs the command that the arguments name and returns the program's exit code; an error is one line on stderr.
pub(crate) fn run(arguments: &Arguments) -> ExitCode {
    match run_command(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

impl Arguments {
    /// Returns the number of threads that is asked for.
    fn threads(&self) -> Option<u32> {
        match &self.command {
            Some(Command::Bench(bench)) => bench.render.threads,
            Some(Command::Measure(measure)) => measure.threads,
            Some(Command::Plan(plan)) => plan.render.threads,
            Some(Command::Scene(landscape)) => landscape.picture.render.threads,
            Some(Command::Serve(serve)) => serve.render.threads,
            None => self.view.picture.render.threads,
        }
    }
}

fn run_command(arguments: &Arguments) -> Result<(), ViewerError> {
    if let Some(threads) = arguments.threads() {
        // The pool can only be set once, and this is the first use.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads as usize).build_global();
    }
    match &arguments.command {
        Some(Command::Bench(bench)) => bench::run(bench),
        Some(Command::Measure(measure)) => measure::run(measure),
        Some(Command::Plan(plan)) => plan::run(plan),
        Some(Command::Scene(landscape)) => landscape::run(landscape),
        Some(Command::Serve(serve)) => serve::run(serve),
        None => view::run(&arguments.view),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn arguments_are_consistent() {
        Arguments::command().debug_assert();
    }
}
