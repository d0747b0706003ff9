//! The bricks of the scene's volumes that the camera needs, loaded beside the pictures once the camera rests.

use crate::error::ViewerError;
use crate::render::bricks::{BrickReport, plan_bricks};
use crate::scene::camera::Camera;
use crate::scene::scene::Scene;
use crate::volume::source::LoadedBricks;
use crate::work::in_background;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::Duration;
use web_time::Instant;

/// How long the camera rests before bricks are loaded for it: a moving one would ask for others again and again.
const REST: Duration = Duration::from_millis(300);
/// Frames of a picture that rests, by which its rays become narrower.
const FRAMES: u32 = 16;

/// The bricks of a scene's volumes.
pub(super) struct Bricks {
    budget_mb: u32,
    /// What the picture shows, and since when.
    seen: Option<(Camera, [u32; 2], Instant)>,
    /// Whether bricks are there for what is seen, or are being loaded.
    is_planned: bool,
    work: Option<Receiver<Result<LoadedBricks, ViewerError>>>,
    report: Option<BrickReport>,
}

impl Bricks {
    /// Begins without bricks, of which at most so many megabytes are loaded.
    pub fn new(budget_mb: u32) -> Bricks {
        Bricks { budget_mb, seen: None, is_planned: false, work: None, report: None }
    }

    /// Loads what the camera needs for a picture of `size` pixels, beside the calling thread. Returns whether the scene
    /// has other bricks than before.
    ///
    /// # Errors
    /// [`ViewerError::Read`] and [`ViewerError::Volume`] for the volumes' files; bricks stay as they were.
    pub fn follow(&mut self, scene: &mut Scene, size: [u32; 2]) -> Result<bool, ViewerError> {
        let now = Instant::now();
        if self.seen.is_none_or(|(camera, other, _)| (camera, other) != (scene.camera, size)) {
            // The first picture has not been waited for.
            let since = if self.seen.is_some() { now } else { now.checked_sub(REST).unwrap_or(now) };
            (self.seen, self.is_planned) = (Some((scene.camera, size, since)), false);
        }
        let rests = self.seen.is_some_and(|(.., since)| now.duration_since(since) >= REST);
        if self.work.is_none() && rests && !self.is_planned {
            self.is_planned = true;
            let plan = plan_bricks(scene, &[scene.camera], size, FRAMES, self.budget_mb);
            self.report = plan.as_ref().map(|(report, _)| *report);
            self.work = plan.and_then(|(_, job)| job).map(|job| in_background(move || job.run()));
        }
        let loaded = match self.work.as_ref().map(Receiver::try_recv) {
            None | Some(Err(TryRecvError::Empty)) => return Ok(false),
            Some(loaded) => loaded,
        };
        self.work = None;
        // A thread that ended without an answer has panicked, and said so.
        let (Ok(loaded), Some(volumes)) = (loaded, &mut scene.volumes) else { return Ok(false) };
        Arc::make_mut(volumes).take_bricks(loaded?);
        Ok(true)
    }

    /// Tells whether [`Bricks::follow`] has something to do soon though nothing else happens.
    pub fn waits(&self, scene: &Scene) -> bool {
        let has_bricks = scene.volumes.as_ref().is_some_and(|volumes| volumes.sources().next().is_some());
        has_bricks && (self.work.is_some() || !self.is_planned)
    }

    /// Begins anew with another scene.
    pub fn restart(&mut self) {
        *self = Bricks::new(self.budget_mb);
    }

    /// Returns a sentence about what is loaded; `None` where no volume is stored by brick.
    pub fn told(&self) -> Option<String> {
        let BrickReport { bytes, coarser_octaves } = self.report?;
        let loading = if self.work.is_some() { ", loading" } else { "" };
        let coarser =
            if coarser_octaves > 0.0 { format!(", {coarser_octaves:.1} octaves coarser") } else { String::new() };
        Some(format!("volumes: {} of {} MB{coarser}{loading}", bytes >> 20, self.budget_mb))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::bricks::tests::scene_with_bricks;
    use crate::scene::file::load_scene;

    /// Follows the camera until the scene has other bricks, or nothing is left to wait for; returns whether it has.
    fn followed(bricks: &mut Bricks, scene: &mut Scene) -> bool {
        let since = Instant::now();
        while since.elapsed() < Duration::from_secs(60) {
            if bricks.follow(scene, [64, 64]).unwrap() {
                return true;
            }
            if !bricks.waits(scene) {
                return false;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("it waits for nothing");
    }

    #[test]
    fn bricks_are_loaded_beside_the_picture_once_the_camera_rests() {
        let folder = tempfile::tempdir().unwrap();
        let mut scene = load_scene(&scene_with_bricks(folder.path()), Vec::new()).unwrap();
        let words = |scene: &Scene| scene.volumes.as_ref().unwrap().volume(0).words().len();
        let coarse = words(&scene);
        let mut bricks = Bricks::new(64);
        assert!(bricks.told().is_none() && followed(&mut bricks, &mut scene));
        let fine = words(&scene);
        assert!(fine > coarse && !bricks.waits(&scene), "{fine} {coarse}");
        assert!(bricks.told().is_some_and(|told| told.contains("of 64 MB") && !told.contains("coarser")));
        // A camera that moves asks for nothing, and one that has gone away for nothing else.
        let way = scene.camera.eye - scene.camera.target;
        scene.camera.eye = scene.camera.target + 30.0 * way;
        assert!(!bricks.follow(&mut scene, [64, 64]).unwrap() && bricks.waits(&scene) && bricks.work.is_none());
        assert!(!followed(&mut bricks, &mut scene) && words(&scene) == fine);
        // With no memory there is less, and the panel says so.
        let mut bricks = Bricks::new(0);
        scene.camera.eye = scene.camera.target + way;
        let mut scene = load_scene(&scene_with_bricks(folder.path()), Vec::new()).unwrap();
        assert!(followed(&mut bricks, &mut scene) && words(&scene) < coarse);
        assert!(bricks.told().is_some_and(|told| told.contains("octaves coarser")), "{:?}", bricks.told());
        // A file that is gone is named, and what was there stays.
        std::fs::remove_file(folder.path().join("v.voltex")).unwrap();
        let mut bricks = Bricks::new(64);
        let error = loop {
            match bricks.follow(&mut scene, [64, 64]) {
                Ok(changed) => assert!(!changed),
                Err(error) => break error.to_string(),
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        assert!(error.contains("v.voltex") && words(&scene) < coarse, "{error}");
    }
}
