//! A small capture that lobes predict in part.

use btf_capture::{CaptureInfo, CaptureWriter, DirectionSet, ImageFormat};
use std::path::{Path, PathBuf};

/// Writes a capture of a bumpy, tinted surface with a highlight, 10 x 9 texels, `directions` lights and views.
pub fn capture(folder: &Path, name: &str, directions: usize, seed: u64) -> PathBuf {
    let set = DirectionSet::random(directions, seed).unwrap();
    let path = folder.join(name);
    let info = CaptureInfo::new(name, 10, 9, set.clone(), set.clone(), ImageFormat::Png);
    let writer = CaptureWriter::create(&path, info).unwrap();
    for (view, wo) in set.units().iter().enumerate() {
        for (light, wi) in set.units().iter().enumerate() {
            let sample = |t: usize, c: usize| {
                let (x, y) = ((t % 10) as f32 * 0.9, (t / 10) as f32 * 0.7);
                let n = [0.3 * x.sin(), 0.3 * y.cos(), 1.0f32];
                let half = [wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]];
                let dot = |a: [f32; 3]| a.iter().zip(n).map(|(a, n)| a * n).sum::<f32>().max(0.0);
                let gloss = (dot(half) / (2.2 * dot([0.0, 0.0, 1.0]))).min(1.0).powi(12);
                [0.5, 0.4, 0.2][c] * dot(*wi) * (1.0 + 0.3 * (x * y).sin()) + 0.3 * gloss * wi[2]
            };
            writer.write(view, light, &(0..270).map(|i| sample(i / 3, i % 3)).collect::<Vec<_>>()).unwrap();
        }
    }
    writer.finish().unwrap();
    path
}
