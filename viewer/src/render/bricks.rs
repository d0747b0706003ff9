//! Loads the bricks of a scene's volumes that pictures need, within a budget of memory.

use crate::cpu::shader::MAX_RAYS_ACROSS;
use crate::error::ViewerError;
use crate::render::control::Control;
use crate::scene::camera::Camera;
use crate::scene::scene::Scene;
use crate::volume::bricks::{BrickPlan, BrickView};
use crate::volume::source::BrickJob;
use serde::Serialize;
use std::sync::Arc;

/// Memory that volumes take at most where no other is asked for, megabytes.
pub const USUAL_VOLUME_BUDGET_MB: u32 = 1024;

/// The bricks that are loaded of a scene's volumes; the keys of `--json`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BrickReport {
    /// Bytes of all volumes that are stored by brick, in memory.
    pub bytes: u64,
    /// Octaves by which voxels are coarser than the picture asks for, so that the budget is kept; 0 where it suffices.
    pub coarser_octaves: f32,
}

/// Returns what a camera sees whose picture has `frames` samples a pixel.
fn view_of(camera: &Camera, [width, height]: [u32; 2], frames: u32) -> BrickView {
    let frame = camera.frame(width, height);
    let pixel_width = frame.pixel_width();
    BrickView {
        eye: frame.eye,
        forward: frame.forward,
        right: frame.right,
        up: frame.up,
        pixel_width,
        voxel_width: pixel_width / (frames as f32).sqrt().clamp(1.0, MAX_RAYS_ACROSS),
    }
}

/// Returns what `cameras` need, as [`load_bricks`] loads it, and the work of loading it; `None` where no volume is stored
/// by brick, and no work where all is loaded.
pub(crate) fn plan_bricks(
    scene: &Scene,
    cameras: &[Camera],
    size: [u32; 2],
    frames: u32,
    budget_mb: u32,
) -> Option<(BrickReport, Option<BrickJob>)> {
    let volumes = scene.volumes.as_ref().filter(|volumes| volumes.sources().next().is_some())?;
    let views: Vec<BrickView> = cameras.iter().map(|camera| view_of(camera, size, frames)).collect();
    let plan = BrickPlan::new(volumes, &views, u64::from(budget_mb) << 20);
    Some((BrickReport { bytes: plan.bytes, coarser_octaves: plan.coarser }, plan.job(volumes)))
}

/// Loads what `cameras` need, each for a picture of `size` pixels with `frames` samples, as fine as `budget_mb` allows;
/// where that makes voxels coarser, whoever watches is told. Returns what is loaded, `None` where no volume is stored by
/// brick, and whether anything else was before.
///
/// # Errors
/// [`ViewerError::Read`] and [`ViewerError::Volume`] for the volumes' files.
pub(crate) fn load_bricks(
    scene: &mut Scene,
    cameras: &[Camera],
    size: [u32; 2],
    frames: u32,
    budget_mb: u32,
    control: &Control,
) -> Result<(Option<BrickReport>, bool), ViewerError> {
    let Some((report, job)) = plan_bricks(scene, cameras, size, frames, budget_mb) else { return Ok((None, false)) };
    let changed = job.is_some();
    if let (Some(job), Some(volumes)) = (job, &mut scene.volumes) {
        Arc::make_mut(volumes).take_bricks(job.run()?);
    }
    if report.coarser_octaves > 0.0 {
        (control.notice)(&format!(
            "the volumes are drawn {:.1} octaves coarser than the picture could show, so that they take {budget_mb} MB; \
             give them more with --volume-budget",
            report.coarser_octaves
        ));
    }
    Ok((Some(report), changed))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::gpu::backend::BackendChoice;
    use crate::render::headless::{RenderParams, Rendered, render};
    use crate::scene::file::load_scene;
    use crate::scene::volume::load_volume;
    use crate::volume::volumes::{VolumePlace, Volumes};
    use btf_runtime::testing::{Random, random_volume};
    use glam::Vec3;
    use std::path::Path;

    /// Writes a volume of 256 voxels a side and a scene with it, and returns the scene's path.
    pub(crate) fn scene_with_bricks(folder: &Path) -> std::path::PathBuf {
        let mut volume = random_volume(&mut Random::new(3), 8, 0.25);
        (volume.side_m, volume.extent, volume.cyclic) = (2.0, [1.0; 3], [false; 2]);
        for level in &mut volume.levels {
            // Thin enough that what is behind shows.
            level.voxels.iter_mut().for_each(|(_, voxel)| *voxel = voxel.scaled(0.3));
            level.others.iter_mut().for_each(|(_, voxel)| *voxel = voxel.scaled(0.3));
            (level.shadow.offset, level.clumping) = (0.5, Default::default());
        }
        std::fs::write(folder.join("v.voltex"), volume.pack().unwrap()).unwrap();
        let path = folder.join("s.toml");
        let text = "[[object]]\nmesh = \"plane\"\n[[volume]]\nfile = \"v.voltex\"\n[camera]\neye = [0.0, 1.2, 6.5]\n\
                    target = [0.0, 1.0, 0.0]\nfov_deg = 25.0\n[[light]]\nposition = [2.0, 5.0, 3.0]\nintensity = [40.0, 40.0, 40.0]\n";
        std::fs::write(&path, text).unwrap();
        path
    }

    fn drawn(scene: &Scene, frames: u32, volume_budget_mb: u32) -> Rendered {
        let params = RenderParams {
            size: [48, 48],
            frames,
            backend: BackendChoice::Cpu,
            volume_budget_mb,
            ..RenderParams::default()
        };
        render(scene, &params, &Control::SILENT).unwrap()
    }

    fn difference(a: &Rendered, b: &Rendered) -> f32 {
        let pairs = a.picture.radiance.as_flattened().iter().zip(b.picture.radiance.as_flattened());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn a_picture_shows_the_same_with_the_bricks_that_it_needs_as_with_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = scene_with_bricks(folder.path());
        let scene = load_scene(&path, Vec::new()).unwrap();
        let voltex = load_volume(&folder.path().join("v.voltex")).unwrap();
        let all_bytes = 4 * voltex.words().len() as u64;
        let mut whole = scene.clone();
        let places = [VolumePlace {
            volume: 0,
            world_from_volume: crate::scene::volume::standing(&voltex, Vec3::ZERO, 0.0, 1.0),
            leaf_width: 0.0,
        }];
        whole.volumes = Some(Arc::new(Volumes::new(vec![voltex], &places, Vec::new()).unwrap()));
        for (frames, most) in [(1, 0.2), (16, 1.0)] {
            let [own, truth] = [&scene, &whole].map(|scene| drawn(scene, frames, 64));
            let report = own.report.volume_bricks.unwrap();
            println!("{frames} frames: {report:?} of {all_bytes}");
            assert_eq!((report.coarser_octaves, truth.report.volume_bricks), (0.0, None));
            assert!(report.bytes as f64 <= most * all_bytes as f64, "{report:?} of {all_bytes}");
            assert!(difference(&own, &truth) < 1e-3, "{frames}: {}", difference(&own, &truth));
        }
        // Planted: what is loaded without a budget is coarser, and shows.
        let [coarse, fine] = [0, 64].map(|budget_mb| drawn(&scene, 16, budget_mb));
        let report = coarse.report.volume_bricks.unwrap();
        assert!(report.coarser_octaves > 3.0 && difference(&coarse, &fine) > 0.05, "{report:?}");
        // But nothing is missing.
        let mean = |drawn: &Rendered| drawn.picture.radiance.as_flattened().iter().sum::<f32>();
        assert!((mean(&coarse) / mean(&fine) - 1.0).abs() < 0.2, "{} {}", mean(&coarse), mean(&fine));
    }

    #[test]
    fn a_budget_of_bytes_is_kept_and_spent_where_the_camera_looks() {
        let folder = tempfile::tempdir().unwrap();
        let path = scene_with_bricks(folder.path());
        let mut scene = load_scene(&path, Vec::new()).unwrap();
        let bytes_of = |scene: &Scene| 4 * scene.volumes.as_ref().unwrap().volume(0).words().len() as u64;
        let view = view_of(&scene.camera, [512, 512], 16);
        let plan = |budget: u64, view: BrickView| BrickPlan::new(scene.volumes.as_ref().unwrap(), &[view], budget);
        let all = plan(1 << 40, view);
        for share in [0.9, 0.5, 0.2, 0.05] {
            let budget = (share * all.bytes as f64) as u64;
            let part = plan(budget, view);
            assert!(part.bytes <= budget && part.coarser > 0.0 && part.coarser < 6.0, "{share}: {part:?}");
        }
        // An eye within the volume, whose voxels are of no width there, is no exception.
        let within = BrickView { eye: Vec3::new(0.1, 1.0, 0.1), ..view };
        let part = plan(all.bytes / 10, within);
        assert!(part.bytes <= all.bytes / 10 && part.coarser > 0.0, "{part:?}");
        // Close to a corner that corner alone is as fine as if all were seen, and what is behind the camera is coarse.
        let eye = Vec3::new(0.9, 1.9, 1.6);
        let near = BrickView { eye, ..view_of(&scene.camera, [24, 24], 1) };
        let [everywhere, aside] =
            [100.0, 1.0].map(|zoom| BrickView { right: zoom * near.right, up: zoom * near.up, ..near });
        let behind = BrickView { forward: -near.forward, ..aside };
        let [everywhere, aside, behind] = [everywhere, aside, behind].map(|view| plan(1 << 40, view).bytes);
        assert!(behind < aside && aside < everywhere, "{behind} {aside} {everywhere}");
        // What is loaded takes the bytes that were told, and is not loaded again.
        let camera = scene.camera;
        let load = |scene: &mut Scene| load_bricks(scene, &[camera], [64, 64], 1, 64, &Control::SILENT).unwrap();
        let (report, changed) = load(&mut scene);
        assert_eq!((report.unwrap().bytes, changed), (bytes_of(&scene), true));
        assert!(!load(&mut scene).1);
        let mut far = scene.camera;
        far.eye = far.target + 20.0 * (far.eye - far.target);
        assert!(
            !load_bricks(&mut scene, &[far], [64, 64], 1, 64, &Control::SILENT).unwrap().1,
            "finer bricks serve as well"
        );
    }
}
