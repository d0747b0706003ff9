//! Prints how much the pictures of a sequence in the wind flicker, as Markdown:
//! `cargo run --release -p btf-tests -- flicker [WIDTH [FRAMES [CAMERA [LANDSCAPE ...]]]]`.
//!
//! The change of a pixel is the difference of its luminance to that of the picture before, at the place from where motion
//! vectors say that its content has come. What should change is measured with many rays a pixel. Few rays add to that
//! what they miss or meet by chance. Every picture begins anew, as in a window in which everything moves.

use crate::dolly::luminance_of;
use btf_viewer::{
    BackendChoice, Control, CpuPicture, DetailWidths, Landscape, LandscapeParams, MotionPicture, RenderParams, Scene,
    Sequence, ShadeOptions, render_sequence,
};
use std::error::Error;

/// Rays a pixel by which is measured what should change.
const TRUTH: u32 = 256;
/// Rays a pixel that are compared with that.
const RAYS: [u32; 2] = [1, 4];
/// Rays a pixel of which motion is the median.
const MOTION_RAYS: u32 = 4;
/// Time from a picture to the next, seconds.
const INTERVAL_S: f64 = 1.0 / 24.0;
/// Mean speed of the wind, m/s: leaves and small twigs move all the time.
const WIND_M_PER_S: f32 = 5.0;
/// Largest change of few rays, relative to what should change.
const BAR: f64 = 1.2;

/// The random numbers of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seeds {
    /// Of every pixel the same in every picture, as renderers have them.
    Fixed,
    /// Others in every picture.
    Changing,
}

/// Luminance of all pixels, row by row.
type Grey = Vec<f32>;

/// The pictures of a scene at moments one after the other, each with so many rays a pixel.
fn sequence(
    scene: &Scene,
    size: [u32; 2],
    pictures: u32,
    rays: u32,
    seeds: Seeds,
) -> Result<Vec<Grey>, Box<dyn Error>> {
    let mut scene = scene.clone();
    let began_s = scene.time_s;
    let pixel = scene.camera.frame(size[0], size[1]).pixel_width();
    let mut all = Vec::new();
    for number in 0..pictures {
        scene.blow(began_s + f64::from(number) * INTERVAL_S)?;
        let mut picture = CpuPicture::new(size);
        if seeds == Seeds::Changing {
            picture.samples = number * rays;
        }
        for ray in 0..rays {
            // As of a picture's first rays, whichever numbers these have.
            picture.widths = Some(DetailWidths { pixel, ray: pixel / ((ray + 1) as f32).sqrt() });
            picture.add_sample(&scene, &ShadeOptions::default(), &|| true);
        }
        let grey = |sum: &[f32; 3]| luminance_of(sum.map(|x| f64::from(x) / f64::from(rays))) as f32;
        all.push(picture.sums.iter().map(grey).collect());
    }
    Ok(all)
}

/// The motion of every picture of a sequence but the first.
fn motions(scene: &Scene, size: [u32; 2], pictures: u32) -> Result<Vec<MotionPicture>, Box<dyn Error>> {
    let params = RenderParams {
        size,
        frames: MOTION_RAYS,
        backend: BackendChoice::Cpu,
        motion: true,
        ..RenderParams::default()
    };
    let sequence = Sequence { pictures, turn_rad: 0.0, interval_s: INTERVAL_S };
    let mut all = Vec::new();
    render_sequence(scene, &params, &sequence, &Control::SILENT, &mut |number, rendered| {
        all.extend(rendered.motion.filter(|_| number > 0));
        Ok(())
    })?;
    Ok(all)
}

/// The value of a picture at a place in pixels from its top left corner, linear between the middles of four pixels; `None`
/// beyond these.
fn at(picture: &[f32], [width, height]: [u32; 2], place: [f32; 2]) -> Option<f32> {
    let [x, y] = place.map(|x| x - 0.5);
    if !(0.0..=(width - 1) as f32).contains(&x) || !(0.0..=(height - 1) as f32).contains(&y) {
        return None;
    }
    let [column, row] = [(x as u32).min(width.saturating_sub(2)), (y as u32).min(height.saturating_sub(2))];
    let value = |right: u32, below: u32| {
        let [column, row] = [(column + right).min(width - 1), (row + below).min(height - 1)];
        picture[(row * width + column) as usize]
    };
    let [u, v] = [x - column as f32, y - row as f32];
    let [above, under] = [0, 1].map(|below| value(0, below) + (value(1, below) - value(0, below)) * u);
    Some(above + (under - above) * v)
}

/// Root mean square over pixels and pictures of the change since the picture before, along the motion and at the same
/// pixel.
pub fn change(pictures: &[Vec<f32>], motions: &[MotionPicture], size: [u32; 2]) -> [f64; 2] {
    let (mut sums, mut counts) = ([0f64; 2], [0f64; 2]);
    for (pair, motion) in pictures.windows(2).zip(motions) {
        for (pixel, moved) in motion.pixels.iter().enumerate() {
            let [x, y] = [pixel as u32 % size[0], pixel as u32 / size[0]].map(|x| x as f32 + 0.5);
            let now = pair[1][pixel];
            let along = at(&pair[0], size, [x + moved.motion[0], y + moved.motion[1]]);
            for (k, before) in [along, Some(pair[0][pixel])].into_iter().enumerate() {
                if let Some(before) = before {
                    sums[k] += f64::from(now - before).powi(2);
                    counts[k] += 1.0;
                }
            }
        }
    }
    [0, 1].map(|k| (sums[k] / counts[k].max(1.0)).sqrt())
}

/// Prints the rows of a landscape.
fn measure(landscape: Landscape, camera: usize, size: [u32; 2], pictures: u32) -> Result<(), Box<dyn Error>> {
    let params = LandscapeParams { wind_m_per_s: Some(WIND_M_PER_S), ..LandscapeParams::default() };
    let (mut scene, _) = landscape.scene(&params)?;
    scene.camera = *scene.cameras().get(camera.wrapping_sub(1)).ok_or("CAMERA is 1 to 3")?;
    let motions = motions(&scene, size, pictures)?;
    let truth = sequence(&scene, size, pictures, TRUTH, Seeds::Fixed)?;
    let mean = truth.iter().flatten().map(|x| f64::from(*x)).sum::<f64>() / (truth.len() * truth[0].len()) as f64;
    let should = change(&truth, &motions, size);
    for seeds in [Seeds::Fixed, Seeds::Changing] {
        for rays in RAYS {
            let found = change(&sequence(&scene, size, pictures, rays, seeds)?, &motions, size);
            let [along, still] = [0, 1].map(|k| found[k] / should[k]);
            let name = if seeds == Seeds::Fixed { "the same" } else { "others" };
            let verdict = if along <= BAR { "" } else { ", **missed**" };
            println!(
                "| {} | {:.1} %, {:.1} % | {name} | {rays} | {along:.2}{verdict} | {still:.2} |",
                landscape.name(),
                100.0 * should[0] / mean,
                100.0 * should[1] / mean
            );
        }
    }
    Ok(())
}

/// Runs the study.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let number = |place: usize, usual: u32| arguments.get(place).map_or(Ok(usual), |argument| argument.parse());
    let (width, pictures) = (number(0, 96)?.max(2), number(1, 32)?.max(2));
    // What is near moves by more than its pixels' noise.
    let camera = number(2, 3)? as usize;
    let asked = arguments.get(3..).unwrap_or_default();
    let all = [Landscape::Lawn, Landscape::Grove, Landscape::Forest];
    if let Some(unknown) = asked.iter().find(|own| all.iter().all(|landscape| landscape.name() != *own)) {
        return Err(format!("LANDSCAPE is lawn, grove or forest, not {unknown}").into());
    }
    println!(
        "| landscape | what should change: along the motion, at a pixel | numbers from picture to picture | rays a pixel | \
         change along the motion, bar {BAR} | at a pixel |"
    );
    println!("|{}", "---|".repeat(6));
    for landscape in all.into_iter().filter(|own| asked.is_empty() || asked.iter().any(|name| own.name() == name)) {
        measure(landscape, camera, [width, (width * 3 / 4).max(2)], pictures)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_viewer::MotionPixel;

    const SIZE: [u32; 2] = [16, 8];

    /// Pictures of a wave that moves to the right by a quarter of a pixel a picture.
    fn wave(pictures: u32, noise: f32) -> Vec<Vec<f32>> {
        let value = |number: u32, pixel: u32| {
            let x = (pixel % SIZE[0]) as f32 - 0.25 * number as f32;
            let chance = ((pixel * 7919 + number * 104_729) % 1000) as f32 / 1000.0 - 0.5;
            1.0 + 0.3 * (0.3 * x).sin() + noise * chance
        };
        (0..pictures).map(|number| (0..SIZE[0] * SIZE[1]).map(|pixel| value(number, pixel)).collect()).collect()
    }

    fn motion(x: f32) -> MotionPicture {
        let pixel = MotionPixel { motion: [x, 0.0], depth: 1.0 };
        MotionPicture { width: SIZE[0], height: SIZE[1], pixels: vec![pixel; (SIZE[0] * SIZE[1]) as usize] }
    }

    #[test]
    fn what_only_moves_does_not_change_along_its_motion_and_noise_does() {
        let [right, wrong] = [-0.25, 0.25].map(|x| vec![motion(x); 7]);
        let [along, still] = change(&wave(8, 0.0), &right, SIZE);
        assert!(along < 0.1 * still && still > 0.01, "{along} {still}");
        // Planted: motion the other way, and noise.
        assert!(change(&wave(8, 0.0), &wrong, SIZE)[0] > 1.5 * still);
        let [noisy, _] = change(&wave(8, 0.2), &right, SIZE);
        // Of two even numbers over 0.2, one of them the mean of two: between the deviations of these.
        assert!((0.05..0.09).contains(&noisy), "{noisy}");
    }
}
