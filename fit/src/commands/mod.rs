//! The command line: one file per subcommand.

mod bench;
mod compare;
mod compare_voltex;
mod convert;
mod expand;
mod export_gltf;
mod export_ktx2;
mod export_mtlx;
mod export_usd;
mod failure;
mod fit;
mod info;
mod library;
mod maps;
mod options;
mod output;
mod priors;
mod progress;
mod trade;
mod validate;
mod voltex;

use clap::{Parser, Subcommand};
use failure::Exit;
use options::Shared;

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
    ExportMtlx(export_mtlx::ExportMtlxArgs),
    ExportUsd(export_usd::ExportUsdArgs),
    Voltex(voltex::VoltexArgs),
    Library(library::LibraryArgs),
    Bench(bench::BenchArgs),
    LearnPriors(priors::learn::LearnPriorsArgs),
    ProposeDirections(priors::propose::ProposeDirectionsArgs),
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
        Command::ExportMtlx(args) => export_mtlx::run(args, &cli.shared),
        Command::ExportUsd(args) => export_usd::run(args, &cli.shared),
        Command::Voltex(args) => voltex::run(args, &cli.shared),
        Command::Library(args) => library::run(args, &cli.shared),
        Command::Bench(args) => bench::run(args, &cli.shared),
        Command::LearnPriors(args) => priors::learn::run(args, &cli.shared),
        Command::ProposeDirections(args) => priors::propose::run(args, &cli.shared),
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
    fn the_adapter_of_a_fit_is_auto_off_or_a_name() {
        let fit = |arguments: &[&str]| match Cli::try_parse_from([&["btf-fit", "fit"], arguments].concat())
            .unwrap()
            .command
        {
            Command::Fit(args) => format!("{args:?}"),
            _ => unreachable!("it is a fit"),
        };
        let told = fit(&["--gpu", "auto", "WOOL", "-o", "wool.spmm"]);
        assert!(told.contains("captures: [\"WOOL\"]") && told.contains("gpu: Best"), "{told}");
        assert!(fit(&["WOOL", "--gpu=h100", "-o", "wool.spmm"]).contains("gpu: Named(\"h100\")"));
        assert!(fit(&["WOOL", "--gpu", "off", "-o", "wool.spmm"]).contains("gpu: Off"));
        assert!(fit(&["WOOL", "-o", "wool.spmm"]).contains("gpu: Off"));
    }

    #[test]
    fn the_command_line_is_well_formed_and_every_command_has_an_example() {
        Cli::command().debug_assert();
        for command in Cli::command().get_subcommands() {
            let help = command.clone().render_long_help().to_string();
            assert!(help.contains(&format!("btf-fit {}", command.get_name())), "{help}");
        }
    }
}
