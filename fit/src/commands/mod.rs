//! The command line: one file per subcommand, and what they share.

mod compare;
mod compare_voltex;
mod convert;
mod expand;
mod export_gltf;
mod export_ktx2;
mod fit;
mod info;
mod output;
mod progress;
mod trade;
mod validate;
mod voltex;

use btf_capture::CaptureError;
use btf_fit::FitError;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::process::ExitCode;

/// Fits a measured or synthetic BTF and packs it into one small file.
#[derive(Debug, Parser)]
#[command(name = "btf-fit", version, subcommand_required = true, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    shared: Shared,
}

#[derive(Debug, Subcommand)]
enum Command {
    Fit(fit::FitArgs),
    Expand(expand::ExpandArgs),
    Compare(compare::CompareArgs),
    Convert(convert::ConvertArgs),
    Info(info::InfoArgs),
    Validate(validate::ValidateArgs),
    Trade(trade::TradeArgs),
    ExportGltf(export_gltf::ExportGltfArgs),
    ExportKtx2(export_ktx2::ExportKtx2Args),
    Voltex(voltex::VoltexArgs),
}

/// Options of every subcommand.
#[derive(Debug, Clone, Args)]
struct Shared {
    /// Threads to compute on; all cores if not given. The result does not depend on it
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print nothing but errors and what --json asks for
    #[arg(long, global = true)]
    quiet: bool,
}

/// How decoded values are carried to directions that were not measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Interpolation {
    /// Interpolate the residual, then add it to the lobes
    Fast,
    /// Decode the neighbours, interpolate those, follow the lobes between them
    Exact,
}

/// How much of an asset is decoded.
#[derive(Debug, Clone, Args)]
struct Decoding {
    /// Use at most this many residual components
    #[arg(long, value_name = "N")]
    components: Option<u32>,
    /// Use at most this many lobes per texel
    #[arg(long, value_name = "N")]
    lobes: Option<u32>,
    /// Rule for directions that the asset has not measured
    #[arg(long, value_enum, default_value = "exact")]
    interpolation: Interpolation,
    /// Leave the parallax of eyes beyond the measured views, also where the asset has heights
    #[arg(long)]
    no_parallax: bool,
}

impl Decoding {
    fn options(&self) -> btf_runtime::DecodeOptions {
        btf_runtime::DecodeOptions {
            components: self.components.unwrap_or(u32::MAX),
            lobes: self.lobes.unwrap_or(u32::MAX),
            interpolation: match self.interpolation {
                Interpolation::Fast => btf_runtime::Interpolation::Fast,
                Interpolation::Exact => btf_runtime::Interpolation::Exact,
            },
            parallax: !self.no_parallax,
        }
    }
}

/// How the program ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Exit {
    Success = 0,
    Failure = 1,
    Usage = 2,
    /// 128 + SIGINT, as shells count.
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> ExitCode {
        ExitCode::from(exit as u8)
    }
}

/// Why a command did not succeed; its text is what stands behind `error: `.
#[derive(Debug, thiserror::Error)]
enum Failure {
    /// Options that do not go together or are out of range.
    #[error("{0}")]
    Usage(String),
    #[error("{0}")]
    Path(String),
    #[error("interrupted; run the same command again to go on after the last finished stage")]
    Suspended,
    #[error(transparent)]
    Fit(#[from] FitError),
}

impl From<CaptureError> for Failure {
    fn from(error: CaptureError) -> Failure {
        Failure::Fit(error.into())
    }
}

impl From<btf_voxelize::VoxelizeError> for Failure {
    fn from(error: btf_voxelize::VoxelizeError) -> Failure {
        Failure::Fit(error.into())
    }
}

impl Failure {
    fn exit(&self) -> Exit {
        match self {
            Failure::Usage(_) => Exit::Usage,
            Failure::Suspended | Failure::Fit(FitError::Interrupted) => Exit::Interrupted,
            Failure::Path(_) | Failure::Fit(_) => Exit::Failure,
        }
    }
}

/// Runs the command; errors go to stderr as one sentence.
pub(crate) fn run(cli: Cli) -> Exit {
    if let Some(threads) = cli.shared.threads {
        // Fails only where a pool exists already, and none does at the start.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global();
    }
    let result = match &cli.command {
        Command::Fit(args) => fit::run(args, &cli.shared),
        Command::Expand(args) => expand::run(args, &cli.shared),
        Command::Compare(args) => compare::run(args, &cli.shared),
        Command::Convert(args) => convert::run(args, &cli.shared),
        Command::Info(args) => info::run(args),
        Command::Validate(args) => validate::run(args, &cli.shared),
        Command::Trade(args) => trade::run(args, &cli.shared),
        Command::ExportGltf(args) => export_gltf::run(args, &cli.shared),
        Command::ExportKtx2(args) => export_ktx2::run(args, &cli.shared),
        Command::Voltex(args) => voltex::run(args, &cli.shared),
    };
    match result {
        Ok(()) => Exit::Success,
        Err(failure) => {
            output::complain(&format!("error: {failure}"));
            failure.exit()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_well_formed_and_every_command_has_an_example() {
        Cli::command().debug_assert();
        for command in Cli::command().get_subcommands() {
            let help = command.clone().render_long_help().to_string();
            assert!(help.contains(&format!("btf-fit {}", command.get_name())), "{help}");
        }
    }

    #[test]
    fn every_failure_has_its_exit_code() {
        assert_eq!(Failure::Usage(String::new()).exit() as u8, 2);
        assert_eq!(Failure::Path(String::new()).exit() as u8, 1);
        assert_eq!(Failure::Suspended.exit() as u8, 130);
        assert_eq!(Failure::from(FitError::Interrupted).exit() as u8, 130);
        assert_eq!(Failure::from(FitError::Params(String::new())).exit() as u8, 1);
    }
}
