//! From a leaf's parameters to a capture folder.

use std::path::Path;

use btf_capture::CaptureInfo;

use crate::error::SynthError;
use crate::leaf::patch::{Leaf, LeafParams};
use crate::surface::capture::{Progress, write_capture};

/// Makes the leaf of `params` and writes its capture to the folder `dir`, with its height map; see
/// [`write_capture`]. The same parameters give the same files on any number of threads.
///
/// # Errors
/// [`SynthError::BadParameter`]; otherwise as [`write_capture`].
pub fn write_leaf_capture(dir: impl AsRef<Path>, params: &LeafParams, progress: Progress) -> Result<(), SynthError> {
    params.check()?;
    let mut info =
        CaptureInfo::new("leaf", params.size, params.size, params.views.clone(), params.lights.clone(), params.format);
    info.size_mm = Some([params.size_mm; 2]);
    info.provenance = params.provenance();
    write_capture(dir, info, || Leaf::new(params), progress)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::ops::ControlFlow;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use btf_capture::{Capture, ImageFormat, Pixels};

    use super::*;
    use crate::leaf::patch::tests::small;

    fn go_on(_: usize, _: usize) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn all_pixels(dir: &Path) -> Vec<Pixels> {
        let capture = Capture::open(dir).unwrap();
        let lights = capture.info().lights.len();
        (0..capture.info().pair_count()).map(|pair| capture.read(pair / lights, pair % lights).unwrap()).collect()
    }

    #[test]
    fn a_leaf_capture_opens_and_says_what_it_is() {
        let parent = tempfile::tempdir().unwrap();
        let dir = parent.path().join("leaf");
        let counted = AtomicUsize::new(0);
        write_leaf_capture(&dir, &small(), &|done, total| {
            assert!(done <= total && total == 20);
            counted.fetch_max(done, Ordering::Relaxed);
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(counted.into_inner(), 20);
        let capture = Capture::open(&dir).unwrap();
        let info = capture.info();
        assert_eq!((info.width, info.height, info.views.len(), info.lights.len()), (48, 48, 4, 5));
        assert_eq!(info.size_mm, Some([20.0, 20.0]));
        assert!(info.provenance.contains("plate-exact") && info.provenance.contains("seed 1"));
        assert_eq!(all_pixels(&dir).len(), 20);
    }

    #[test]
    fn the_files_are_the_same_on_one_thread_and_on_three() {
        let parent = tempfile::tempdir().unwrap();
        let write = |name: &str, threads: usize, seed: u64| {
            let dir = parent.path().join(name);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let params = LeafParams { seed, format: ImageFormat::Exr, ..small() };
            pool.install(|| write_leaf_capture(&dir, &params, &go_on)).unwrap();
            all_pixels(&dir)
        };
        let one = write("one", 1, 1);
        assert!(one == write("three", 3, 1), "threads matter");
        assert!(one != write("other", 1, 2), "the seed does not matter");
    }

    #[test]
    fn stopping_leaves_nothing_behind_and_a_full_folder_is_left_alone() {
        let parent = tempfile::tempdir().unwrap();
        let dir = parent.path().join("leaf");
        let stopped = write_leaf_capture(&dir, &small(), &|done, _| {
            if done >= 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert!(matches!(stopped, Err(SynthError::Stopped)));
        assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 0);
        fs::create_dir(&dir).unwrap();
        fs::write(dir.join("precious"), b"keep").unwrap();
        assert!(matches!(write_leaf_capture(&dir, &small(), &go_on), Err(SynthError::Capture(_))));
        assert_eq!(fs::read(dir.join("precious")).unwrap(), b"keep");
    }
}
