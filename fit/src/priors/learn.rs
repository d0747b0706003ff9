//! Makes priors of captures: a mosaic of their texels, which is fitted like any capture.

use crate::error::FitError;
use crate::input::texel_sample::texel_sample;
use crate::monitor::Monitor;
use btf_capture::{Capture, CaptureInfo, ImageFormat, Pixels, text_from_bytes};
use rayon::prelude::*;

/// Largest mosaic, bytes: a few hundred texels of a hundred captures of Bonn's directions.
const MAX_MOSAIC_BYTES: usize = 4_000_000_000;

/// Returns a capture in memory whose texels are `texels` of each of `captures`, drawn by `seed`, one capture after the other:
/// `texels` columns and a row for each capture. A fit of it with about as many clusters is a prior.
///
/// # Errors
/// [`FitError::Params`] for captures of different directions, incomplete ones, and too few or too many texels; an image that
/// cannot be read.
pub fn prior_capture(captures: &[Capture], texels: usize, seed: u64, monitor: &Monitor) -> Result<Capture, FitError> {
    let first =
        captures.first().ok_or_else(|| FitError::Params("priors are learnt from at least one capture".into()))?;
    let (views, lights) = (&first.info().views, &first.info().lights);
    for capture in captures {
        let info = capture.info();
        if (&info.views, &info.lights, info.side) != (views, lights, first.info().side) {
            return Err(FitError::Params(format!(
                "{} has other directions or another side than {}: priors are learnt from captures of the same",
                info.name,
                first.info().name
            )));
        }
        if !info.missing.is_empty() {
            return Err(FitError::Params(format!(
                "{} lacks {} of its pairs: priors are learnt from complete captures",
                info.name,
                info.missing.len()
            )));
        }
        if info.texel_count() < texels {
            return Err(FitError::Params(format!(
                "{} has {} texels, fewer than --texels {texels}; give a smaller number",
                info.name,
                info.texel_count()
            )));
        }
    }
    let (pairs, width) = (first.info().pair_count(), texels);
    let image = 3 * width * captures.len();
    let bytes = 4 * pairs * image;
    if image == 0 || bytes > MAX_MOSAIC_BYTES {
        return Err(FitError::Params(format!(
            "--texels {texels} of {} captures take {}: give 1 or more that take at most {}",
            captures.len(),
            text_from_bytes(bytes as u64),
            text_from_bytes(MAX_MOSAIC_BYTES as u64)
        )));
    }
    let mut images = vec![0.0; pairs * image];
    for (number, capture) in captures.iter().enumerate() {
        let info = capture.info();
        let chosen = texel_sample(info.texel_count(), texels, seed);
        images.par_chunks_exact_mut(image).enumerate().try_for_each(|(pair, image)| -> Result<(), FitError> {
            monitor.check()?;
            let (view, light) = (pair / lights.len(), pair % lights.len());
            let row = &mut image[3 * width * number..][..3 * width];
            match capture.read(view, light)? {
                Pixels::Encoded8(codes) => {
                    let table = info.linear_from_encoded8(light);
                    for (to, texel) in row.chunks_exact_mut(3).zip(&chosen) {
                        (0..3).for_each(|channel| to[channel] = table[usize::from(codes[3 * texel + channel])]);
                    }
                }
                Pixels::Linear(values) => {
                    for (to, texel) in row.chunks_exact_mut(3).zip(&chosen) {
                        to.copy_from_slice(&values[3 * texel..3 * texel + 3]);
                    }
                }
            }
            Ok(())
        })?;
        monitor.report("read", number + 1, captures.len())?;
    }
    let name = "priors".to_string();
    let info = CaptureInfo::new(&name, width, captures.len(), views.clone(), lights.clone(), ImageFormat::Exr);
    Ok(Capture::from_linear(CaptureInfo { side: first.info().side, ..info }, images)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_capture::DirectionSet;

    #[test]
    fn a_mosaic_has_texels_of_every_capture_and_unlike_captures_are_refused() {
        let set = DirectionSet::random(4, 1).unwrap();
        let capture = |name: &str, value: f32, set: &DirectionSet| {
            let info = CaptureInfo::new(name, 5, 4, set.clone(), set.clone(), ImageFormat::Exr);
            let images = (0..set.len() * set.len() * 60).map(|i| value + (i % 60 / 3) as f32 * 0.01).collect();
            Capture::from_linear(info, images).unwrap()
        };
        let captures = [capture("dark", 0.1, &set), capture("bright", 0.7, &set)];
        let mosaic = prior_capture(&captures, 6, 1, &Monitor::default()).unwrap();
        assert_eq!((mosaic.info().width, mosaic.info().height, mosaic.info().pair_count()), (6, 2, 16));
        let Pixels::Linear(image) = mosaic.read(3, 2).unwrap() else { panic!("linear") };
        assert!(
            image[..18].iter().all(|x| (0.1..0.3).contains(x)) && image[18..].iter().all(|x| (0.7..0.9).contains(x))
        );
        assert!(image[0] < image[15], "texels stay in order");
        let other = DirectionSet::random(4, 2).unwrap();
        let refused = |captures: &[Capture], texels| {
            prior_capture(captures, texels, 1, &Monitor::default()).err().unwrap().to_string()
        };
        assert!(refused(&[captures[0].clone(), capture("odd", 0.5, &other)], 6).contains("odd has other directions"));
        assert!(refused(&captures, 21).contains("fewer than --texels 21"));
        assert!(refused(&captures, 0).contains("give 1 or more"));
    }
}
