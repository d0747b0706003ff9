//! Writes what `--json` asks for.

use btf_viewer::ViewerError;
use std::path::Path;

/// Writes `value` as JSON to the file `path`, to stdout where it is `-`, and nowhere where there is none.
///
/// # Errors
/// [`ViewerError::Write`].
pub(super) fn write_json(path: Option<&Path>, value: &impl serde::Serialize) -> Result<(), ViewerError> {
    let json = serde_json::to_string_pretty(value).unwrap_or_default();
    match path {
        Some(path) if path.as_os_str() == "-" => println!("{json}"),
        Some(path) => btf_capture::atomic::write_file_atomically(path, json.as_bytes())?,
        None => {}
    }
    Ok(())
}
