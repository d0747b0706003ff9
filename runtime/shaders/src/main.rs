//! `btf-shaders FOLDER`: writes the decoder as complete compute shaders. `cargo xtask shaders` starts it.

use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut arguments = std::env::args_os().skip(1);
    let is_option = |folder: &std::ffi::OsString| folder.to_string_lossy().starts_with('-');
    let (Some(folder), None) = (arguments.next().filter(|folder| !is_option(folder)), arguments.next()) else {
        eprintln!("error: one argument is needed, the folder to write to: btf-shaders FOLDER");
        return ExitCode::from(2);
    };
    match run(&PathBuf::from(folder)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(sentence) => {
            eprintln!("error: {sentence}");
            ExitCode::FAILURE
        }
    }
}

/// Writes every file; those that exist are overwritten.
fn run(folder: &std::path::Path) -> Result<(), String> {
    let files = btf_shaders::files().map_err(|error| error.to_string())?;
    std::fs::create_dir_all(folder).map_err(|error| format!("{} cannot be made: {error}", folder.display()))?;
    for (name, bytes) in &files {
        let path = folder.join(name);
        std::fs::write(&path, bytes).map_err(|error| format!("{} cannot be written: {error}", path.display()))?;
        println!("{} ({} bytes)", path.display(), bytes.len());
    }
    Ok(())
}
