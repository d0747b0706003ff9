//! `btf-fit export-ktx2`.

use super::failure::Failure;
use super::options::Shared;
use super::output::{check_distinct, check_file, tell};
use btf_capture::write_file_atomically;
use btf_fit::{export_ktx2, read_file, text_from_bytes, with_path};
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Write an asset as KTX2 textures, for engines without a reader of .spmm
///
/// FILE holds what each texel has, as planes of one array with mip levels, and says in its key/value data where
/// everything lies. The bases of each layer stand beside it, in FILE's name with .bases-front.ktx2 and so on in place
/// of .ktx2. docs/KTX2.md tells how a value is decoded from them.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  btf-fit export-ktx2 wool.spmm -o wool.ktx2")]
pub(super) struct ExportKtx2Args {
    /// The asset, in either form, or a tier of one
    #[arg(value_name = "ASSET.spmm")]
    asset: PathBuf,
    /// The file of the planes; its name ends in .ktx2
    #[arg(short = 'o', long, value_name = "FILE")]
    out: PathBuf,
    /// Write what was written as JSON; - for standard output
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Result that `export-ktx2 --json` writes.
#[derive(Debug, Serialize)]
struct Exported {
    files: Vec<Written>,
    width: usize,
    height: usize,
    planes: usize,
    levels: usize,
}

#[derive(Debug, Serialize)]
struct Written {
    file: String,
    bytes: usize,
}

pub(super) fn run(args: &ExportKtx2Args, shared: &Shared) -> Result<(), Failure> {
    let bytes = read_file(&args.asset)?;
    let inputs = std::slice::from_ref(&args.asset);
    let name = args.out.file_name().unwrap_or_default().to_string_lossy();
    let Some(stem) = name.strip_suffix(".ktx2").filter(|stem| !stem.is_empty()) else {
        return Err(Failure::Usage(format!(
            "{} does not end in .ktx2; give the output such a name, others are made of it",
            args.out.display()
        )));
    };
    check_file(&args.out, inputs)?;
    if let Some(target) = &args.json {
        check_file(target, inputs)?;
    }
    let export = export_ktx2(bytes, stem).map_err(|error| with_path(&args.asset, error))?;
    let folder = args.out.parent().unwrap_or(Path::new(""));
    let paths: Vec<PathBuf> = export.files.iter().map(|(name, _)| folder.join(name)).collect();
    for path in &paths {
        check_file(path, inputs)?;
    }
    let outputs: Vec<&Path> = paths.iter().chain(&args.json).map(PathBuf::as_path).collect();
    check_distinct(&outputs)?;
    // The file that names the others comes last.
    for (path, (_, bytes)) in paths.iter().zip(&export.files).rev() {
        write_file_atomically(path, bytes)?;
    }
    let written = paths.iter().zip(&export.files);
    let result = Exported {
        files: written
            .map(|(path, (_, bytes))| Written { file: path.display().to_string(), bytes: bytes.len() })
            .collect(),
        width: export.size[0],
        height: export.size[1],
        planes: export.planes,
        levels: export.levels,
    };
    tell(args.json.as_deref(), shared.quiet, &result, || {
        let lines: Vec<String> = result
            .files
            .iter()
            .map(|written| format!("{}: {}", written.file, text_from_bytes(written.bytes as u64)))
            .collect();
        format!(
            "{}\n{} planes of {} x {} texels, {} levels",
            lines.join("\n"),
            result.planes,
            result.width,
            result.height,
            result.levels
        )
    })
}
