//! Writes the capture of leather.

use std::path::Path;

use crate::error::SynthError;
use crate::leather::hide::Leather;
use crate::leather::params::LeatherParams;
use crate::surface::capture::{Progress, write_capture};

/// Generates the leather of `params` and writes its capture to the folder `dir`, with its height map; see
/// [`write_capture`]. Equal parameters give equal files on any number of threads.
///
/// # Errors
/// [`SynthError::BadParameter`], and the errors of [`write_capture`].
pub fn write_leather_capture(
    dir: impl AsRef<Path>,
    params: &LeatherParams,
    progress: Progress,
) -> Result<(), SynthError> {
    params.check()?;
    write_capture(
        dir,
        params.capture.info("leather", params.provenance()),
        || Ok(vec![Leather::new(params)?]),
        progress,
    )
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use btf_capture::{Capture, Direction, DirectionSet, ImageFormat, Pixels};

    use super::*;
    use crate::surface::capture::HEIGHT_MAP_NAME;
    use crate::surface::capture_params::CaptureParams;
    use crate::surface::rig::{Illumination, ViewHits, render};

    fn small() -> LeatherParams {
        let capture = CaptureParams {
            size: 24,
            views: DirectionSet::random(2, 1).unwrap(),
            lights: DirectionSet::random(3, 2).unwrap(),
            format: ImageFormat::Exr,
            ..CaptureParams::new(4.0)
        };
        LeatherParams { capture, ..LeatherParams::default() }
    }

    fn image(leather: &Leather, wi: Direction, wo: Direction) -> Vec<f32> {
        render(leather, &ViewHits::new(leather, wo.unit()), &Illumination::new(leather, wi.unit()))
    }

    fn mean(image: &[f32], channel: usize) -> f32 {
        image.iter().skip(channel).step_by(3).sum::<f32>() / (image.len() / 3) as f32
    }

    #[test]
    fn a_leather_capture_opens_with_its_height_map_and_is_the_same_on_any_number_of_threads() {
        let parent = tempfile::tempdir().unwrap();
        let write = |name: &str, threads: usize, seed: u64| {
            let dir = parent.path().join(name);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let params = LeatherParams { capture: CaptureParams { seed, ..small().capture }, ..small() };
            pool.install(|| write_leather_capture(&dir, &params, &|_, _| ControlFlow::Continue(()))).unwrap();
            let capture = Capture::open(&dir).unwrap();
            let pixels: Vec<Pixels> = (0..6).map(|pair| capture.read(pair / 3, pair % 3).unwrap()).collect();
            (pixels, std::fs::read(dir.join(HEIGHT_MAP_NAME)).unwrap(), capture.info().clone())
        };
        let one = write("one", 1, 1);
        assert!(one == write("three", 3, 1), "threads matter");
        let other = write("other", 1, 2);
        assert!(one.0 != other.0 && one.1 != other.1, "the seed does not matter");
        assert!(one.2.provenance.contains("grain 1.1 mm") && one.2.size_mm == Some([4.0; 2]));
    }

    #[test]
    fn images_are_finite_and_not_negative_at_grazing_angles() {
        let leather = Leather::new(&small()).unwrap();
        for (light, view) in [(0.0, 0.0), (88.0, 0.0), (0.0, 88.0), (88.0, 88.0)] {
            for phi in [10.0, 190.0, 270.0] {
                let image = image(&leather, Direction::new(light, 10.0), Direction::new(view, phi));
                assert!(image.iter().all(|v| v.is_finite() && (0.0..60.0).contains(v)), "{light} {view} {phi}");
            }
        }
    }

    #[test]
    fn the_bounce_brightens_what_faces_away_from_the_light_and_never_darkens() {
        let with = Leather::new(&small()).unwrap();
        let without = Leather::new(&LeatherParams { bounce: false, ..small() }).unwrap();
        let (light, view) = (Direction::new(65.0, 20.0), Direction::new(30.0, 200.0));
        let (with, without) = (image(&with, light, view), image(&without, light, view));
        assert!(with.iter().zip(&without).all(|(a, b)| a >= b));
        let gained = mean(&with, 0) - mean(&without, 0);
        assert!(gained > 0.002 * mean(&without, 0) && gained < 0.5 * mean(&without, 0), "{gained}");
    }

    #[test]
    fn a_pale_leather_never_sends_out_more_light_than_falls_on_it() {
        let leather = Leather::new(&LeatherParams { colour: [0.8; 3], antique: 0.0, ..small() }).unwrap();
        let light = Direction::new(40.0, 60.0);
        // Over the upper half, evenly in solid angle with the cosine as weight.
        let (mut sum, count) = (0.0, 40);
        for i in 0..count {
            let theta = ((i as f64 + 0.5) / f64::from(count)).sqrt().asin().to_degrees();
            sum += mean(&image(&leather, light, Direction::new(theta.min(86.0), f64::from(i) * 137.5)), 0);
        }
        let albedo = sum / count as f32 / light.unit()[2];
        assert!((0.6..0.95).contains(&albedo), "{albedo}");
    }

    #[test]
    fn leather_glosses_towards_the_mirror_and_keeps_its_colour_elsewhere() {
        let leather = Leather::new(&small()).unwrap();
        let at = |view: Direction| {
            let image = image(&leather, Direction::new(60.0, 0.0), view);
            [mean(&image, 0), mean(&image, 2)]
        };
        let (mirror, back) = (at(Direction::new(60.0, 180.0)), at(Direction::new(60.0, 0.0)));
        assert!(mirror[1] > 3.0 * back[1], "{mirror:?} {back:?}");
        assert!(back[0] / back[1] > 2.0 * mirror[0] / mirror[1], "{mirror:?} {back:?}");
    }
}
