//! Tests of `heights.rs`.

use super::*;
use btf_capture::{Capture, CaptureWriter, Direction, DirectionSet, ImageFormat};
use std::path::Path;

const SIZE: [usize; 2] = [48, 40];

/// Returns smooth noise, the same at every call.
fn texture(column: f32, row: f32) -> f32 {
    let waves = [(0.9, 0.4, 0.0), (-0.5, 1.1, 1.0), (1.7, 0.3, 2.0), (0.2, -1.9, 3.0), (1.3, 1.4, 4.0)];
    let sum: f32 = waves.iter().map(|(a, b, phase)| (a * column + b * row + phase).sin()).sum();
    0.4 + 0.07 * sum
}

fn relief(column: f32, height: f32) -> f32 {
    height * (column * std::f32::consts::TAU / SIZE[0] as f32).sin()
}

/// Returns a textured relief, the same under every light; a height of 0 is a flat picture.
fn capture(path: &Path, height: f32) -> Capture {
    let ring =
        |theta: f64, count: usize| (0..count).map(move |i| Direction::new(theta, 360.0 * i as f64 / count as f64));
    let views: Vec<Direction> =
        [(0.0, 1), (25.0, 6), (45.0, 10), (60.0, 12)].iter().flat_map(|&(t, n)| ring(t, n)).collect();
    let views = DirectionSet::new(views).unwrap();
    let lights = DirectionSet::new([(30.0, 4), (60.0, 3)].iter().flat_map(|&(t, n)| ring(t, n)).collect()).unwrap();
    let info = CaptureInfo::new("relief", SIZE[0], SIZE[1], views.clone(), lights.clone(), ImageFormat::Png);
    let writer = CaptureWriter::create(path, info).unwrap();
    for (v, direction) in views.units().into_iter().enumerate() {
        let s = slope(direction);
        for l in 0..lights.len() {
            let mut image = Vec::new();
            for row in 0..SIZE[1] {
                for column in 0..SIZE[0] {
                    // The point that is seen: slopes are gentle enough for this to settle.
                    let (mut z, x) = (0.0, column as f32);
                    for _ in 0..40 {
                        z = 0.5 * z + 0.5 * relief(x + z * s[0], height);
                    }
                    image.extend([texture(x + z * s[0], row as f32 + z * s[1]); 3]);
                }
            }
            writer.write(v, l, &image).unwrap();
        }
    }
    writer.finish().unwrap();
    Capture::open(path).unwrap()
}

fn found(height: f32) -> Option<Heights> {
    let folder = tempfile::tempdir().unwrap();
    let capture = capture(&folder.path().join("capture"), height);
    let monitor = Monitor::default();
    let cache = TileCache::build(&capture, 1_000_000_000, folder.path(), &monitor).unwrap();
    find_heights(&cache, capture.info(), &monitor).unwrap()
}

#[test]
fn a_relief_is_found_in_its_capture() {
    let heights = found(2.0).unwrap();
    let mut errors: Vec<f32> = (0..SIZE[0] * SIZE[1])
        .map(|texel| (f32::from(heights.codes[texel]) * heights.step - relief((texel % SIZE[0]) as f32, 2.0)).abs())
        .collect();
    errors.sort_by(f32::total_cmp);
    assert!(errors[errors.len() / 2] < 0.2, "half within {}", errors[errors.len() / 2]);
    assert!(errors[errors.len() * 8 / 10] < 0.5, "four of five within {}", errors[errors.len() * 8 / 10]);
    // Planted difference: turned upside down, which the wrong sign of a slope would give.
    let upside_down =
        |texel: usize| f32::from(heights.codes[texel]) * heights.step + relief((texel % SIZE[0]) as f32, 2.0);
    assert!((0..SIZE[0] * SIZE[1]).filter(|&texel| upside_down(texel).abs() < 0.5).count() < 800);
}

#[test]
fn a_flat_material_gets_none() {
    assert_eq!(found(0.0), None);
}

#[test]
fn an_even_choice_has_no_doubles() {
    assert_eq!(spread(&[1, 2, 3], 5), [1, 2, 3]);
    assert_eq!(spread(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9], 2), [2, 7]);
    assert!(spread(&[], 3).is_empty());
}

#[test]
fn smoothing_carries_what_is_sure_to_what_is_not() {
    // One texel knows its height, the others of its row do not care.
    let levels = tried().len();
    let mut costs = vec![vec![0.1; 9]; levels];
    (0..levels).filter(|level| *level != 7).for_each(|level| costs[level][4] = 0.5);
    costs[7][4] = 0.0;
    let heights = lowest(&smoothed(&costs, [9, 1]));
    assert!(heights.iter().all(|z| (z - tried()[7]).abs() < 0.01), "{heights:?}");
}
