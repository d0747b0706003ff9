//! Renders pictures into files, without a window.

use super::lod_transition::TransitionReport;
use super::progress::with_progress;
use super::report::write_json;
use super::scene_options::PictureArguments;
use btf_viewer::{LandscapeCounts, RenderParams, RenderReport, Scene, Sequence, ViewerError, render_sequence};
use std::path::{Path, PathBuf};

/// Pictures per second of a sequence, where `--fps` is not given.
const USUAL_FPS: f32 = 25.0;

/// What is told of the scene of a picture; keys of `--json`.
#[derive(Clone, serde::Serialize)]
pub(super) struct SceneReport {
    /// Counts of a landscape.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub landscape: Option<LandscapeCounts>,
    /// Where meshes pass into volumes, where these stand in for them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lod_transition: Option<TransitionReport>,
}

/// Figures of a picture, and of the scene that it shows; the keys of `--json`.
#[derive(serde::Serialize)]
struct PictureReport {
    #[serde(flatten)]
    picture: RenderReport,
    #[serde(flatten)]
    scene: SceneReport,
}

/// Renders one picture, a turntable or a sequence, writes the files and reports the figures.
///
/// # Errors
/// The errors of [`render_sequence`]; [`ViewerError::Write`].
pub(super) fn write_pictures(
    arguments: &PictureArguments,
    scene: &Scene,
    params: RenderParams,
    out: &Path,
    told: SceneReport,
) -> Result<(), ViewerError> {
    let quiet = arguments.render.quiet;
    let mut reports = Vec::new();
    let several = arguments.turntable.or(arguments.sequence).is_some();
    let sequence = match arguments.sequence {
        Some(pictures) => {
            let interval_s = 1.0 / f64::from(arguments.fps.unwrap_or(USUAL_FPS));
            Sequence { pictures, turn_rad: 0.0, interval_s }
        }
        None => Sequence::turntable(arguments.turntable.unwrap_or(1)),
    };
    with_progress(quiet, |control| {
        render_sequence(scene, &params, &sequence, control, &mut |number, rendered| {
            if (control.cancelled)() {
                return Err(ViewerError::Interrupted);
            }
            let path = if several { numbered(out, number) } else { out.to_path_buf() };
            rendered.picture.write(&path, scene.exposure_ev)?;
            if let Some(motion) = &rendered.motion {
                motion.write(&motion_path(&path))?;
            }
            reports.push((path, PictureReport { picture: rendered.report, scene: told.clone() }));
            Ok(())
        })
    })?;
    match (arguments.json.as_deref(), reports.as_slice()) {
        (path @ Some(_), [(_, report)]) if !several => write_json(path, report)?,
        (path @ Some(_), all) => write_json(path, &all.iter().map(|(_, report)| report).collect::<Vec<_>>())?,
        (None, _) if quiet => {}
        (None, _) => print_pictures(&reports, &told),
    }
    Ok(())
}

/// Prints a line for each picture that was written, after what is told of the scene.
fn print_pictures(reports: &[(PathBuf, PictureReport)], told: &SceneReport) {
    if let Some(counts) = &told.landscape {
        println!("{counts}");
    }
    if let Some(transition) = &told.lod_transition {
        print!("{transition}");
    }
    for (path, PictureReport { picture: report, .. }) in reports {
        println!(
            "{}: {}x{}, {} on {}, {:.2} ms per frame ({})",
            path.display(),
            report.width,
            report.height,
            report.backend,
            report.adapter,
            report.frame_ms,
            report.timer
        );
    }
}

/// Returns the name of picture `number` of several: of `a/b.png` and 7 it is `a/b_007.png`.
fn numbered(path: &Path, number: u32) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_os_string();
    name.push(format!("_{number:03}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// Returns the name of the file of a picture's motion: of `a/b_007.png` it is `a/b_007-motion.exr`.
fn motion_path(path: &Path) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_os_string();
    name.push("-motion.exr");
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motion_lies_beside_its_picture() {
        assert_eq!(motion_path("a/b_007.png".as_ref()), PathBuf::from("a/b_007-motion.exr"));
        assert_eq!(motion_path("b".as_ref()), PathBuf::from("b-motion.exr"));
    }

    #[test]
    fn pictures_are_numbered_before_the_extension() {
        assert_eq!(numbered("a/b.png".as_ref(), 7), PathBuf::from("a/b_007.png"));
        assert_eq!(numbered("b".as_ref(), 1234), PathBuf::from("b_1234"));
    }
}
