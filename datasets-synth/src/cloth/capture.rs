//! Writes the capture of woven cloth.

use std::path::Path;

use crate::cloth::fabric::Cloth;
use crate::cloth::params::ClothParams;
use crate::error::SynthError;
use crate::surface::capture::{Progress, write_capture};

/// Weaves the cloth of `params` and writes its capture to the folder `dir`, with its height map; see [`write_capture`].
/// Equal parameters give equal files on any number of threads.
///
/// # Errors
/// [`SynthError::BadParameter`], and the errors of [`write_capture`].
pub fn write_cloth_capture(dir: impl AsRef<Path>, params: &ClothParams, progress: Progress) -> Result<(), SynthError> {
    params.check()?;
    write_capture(dir, params.capture.info("cloth", params.provenance()), || Ok(vec![Cloth::new(params)?]), progress)
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use btf_capture::{Capture, Direction, DirectionSet, ImageFormat, Pixels};

    use super::*;
    use crate::surface::capture::HEIGHT_MAP_NAME;
    use crate::surface::capture_params::CaptureParams;
    use crate::surface::rig::{Illumination, ViewHits, render};

    fn small() -> ClothParams {
        let capture = CaptureParams {
            size: 24,
            views: DirectionSet::random(2, 1).unwrap(),
            lights: DirectionSet::random(3, 2).unwrap(),
            format: ImageFormat::Exr,
            ..CaptureParams::new(2.0)
        };
        ClothParams { capture, ..ClothParams::default() }
    }

    fn image(cloth: &Cloth, wi: Direction, wo: Direction) -> Vec<f32> {
        render(cloth, &ViewHits::new(cloth, wo.unit()), &Illumination::new(cloth, wi.unit()))
    }

    fn mean(image: &[f32], channel: usize) -> f32 {
        image.iter().skip(channel).step_by(3).sum::<f32>() / (image.len() / 3) as f32
    }

    #[test]
    fn a_cloth_capture_opens_with_its_height_map_and_is_the_same_on_any_number_of_threads() {
        let parent = tempfile::tempdir().unwrap();
        let write = |name: &str, threads: usize, seed: u64| {
            let dir = parent.path().join(name);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let params = ClothParams { capture: CaptureParams { seed, ..small().capture }, ..small() };
            pool.install(|| write_cloth_capture(&dir, &params, &|_, _| ControlFlow::Continue(()))).unwrap();
            let capture = Capture::open(&dir).unwrap();
            let pixels: Vec<Pixels> = (0..6).map(|pair| capture.read(pair / 3, pair % 3).unwrap()).collect();
            (pixels, std::fs::read(dir.join(HEIGHT_MAP_NAME)).unwrap(), capture.info().clone())
        };
        let one = write("one", 1, 1);
        assert!(one == write("three", 3, 1), "threads matter");
        let other = write("other", 1, 2);
        assert!(one.0 != other.0 && one.1 != other.1, "the seed does not matter");
        assert!(one.2.provenance.contains("twill") && one.2.size_mm == Some([2.0; 2]));
    }

    #[test]
    fn images_are_finite_and_not_negative_at_grazing_angles() {
        let cloth = Cloth::new(&small()).unwrap();
        for (light, view) in [(0.0, 0.0), (88.0, 0.0), (0.0, 88.0), (88.0, 88.0)] {
            for phi in [10.0, 190.0, 270.0] {
                let image = image(&cloth, Direction::new(light, 10.0), Direction::new(view, phi));
                assert!(image.iter().all(|v| v.is_finite() && (0.0..8.0).contains(v)), "{light} {view} {phi}");
            }
        }
    }

    #[test]
    fn the_bounce_brightens_what_faces_away_from_the_light_and_never_darkens() {
        let with = Cloth::new(&small()).unwrap();
        let without = Cloth::new(&ClothParams { bounce: false, ..small() }).unwrap();
        let (light, view) = (Direction::new(65.0, 20.0), Direction::new(30.0, 200.0));
        let (with, without) = (image(&with, light, view), image(&without, light, view));
        assert!(with.iter().zip(&without).all(|(a, b)| a >= b));
        let gained = mean(&with, 0) - mean(&without, 0);
        assert!(gained > 0.01 * mean(&without, 0) && gained < 0.5 * mean(&without, 0), "{gained}");
    }

    #[test]
    fn a_cloth_of_one_white_never_sends_out_more_light_than_falls_on_it() {
        let white = [0.9; 3];
        let params = ClothParams { warp_colour: white, weft_colour: white, ..small() };
        let cloth = Cloth::new(&params).unwrap();
        let light = Direction::new(40.0, 60.0);
        // Over the upper half, evenly in solid angle with the cosine as weight.
        let (mut sum, count) = (0.0, 40);
        for i in 0..count {
            let theta = ((i as f64 + 0.5) / f64::from(count)).sqrt().asin().to_degrees();
            sum += mean(&image(&cloth, light, Direction::new(theta.min(86.0), f64::from(i) * 137.5)), 0);
        }
        let albedo = sum / count as f32 / light.unit()[2];
        assert!((0.6..0.95).contains(&albedo), "{albedo}");
    }

    #[test]
    fn satin_of_bare_warp_shines_across_its_yarns_and_not_along_them() {
        let black = [0.0; 3];
        let params = ClothParams {
            weave: crate::cloth::weave::Weave::Satin,
            plies: 1,
            twist_deg: 0.0,
            irregularity: 0.0,
            warp_colour: black,
            weft_colour: black,
            bounce: false,
            ..small()
        };
        let cloth = Cloth::new(&params).unwrap();
        // The eye above; the warp runs along y.
        let at = |phi| mean(&image(&cloth, Direction::new(50.0, phi), Direction::new(0.0, 0.0)), 1);
        assert!(at(0.0) > 1.5 * at(90.0), "{} {}", at(0.0), at(90.0));
    }
}
