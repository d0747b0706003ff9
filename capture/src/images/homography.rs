//! Photographs of a flat sample seen aslant, rectified to its texels.

/// Pixels along a texel's side that are looked at, at most.
const MAX_SAMPLES: usize = 8;

/// A projective map from texels to pixels: row-major 3 x 3, of `(column, row, 1)`, both counted from the corner of the first
/// texel or pixel.
pub(crate) type Homography = [f64; 9];

/// Returns the place in pixels of a place in texels; `None` on or behind the horizon.
fn pixel_of(h: &Homography, x: f64, y: f64) -> Option<[f64; 2]> {
    let [u, v, w] = [0, 3, 6].map(|row| h[row] * x + h[row + 1] * y + h[row + 2]);
    (w > 1e-12).then(|| [u / w, v / w])
}

/// Returns whether all corners of a grid of `texels` come to places within a picture of `pixels`, columns and rows.
pub(crate) fn is_within(h: &Homography, texels: [usize; 2], pixels: [usize; 2]) -> bool {
    let [width, height] = texels.map(|side| side as f64);
    [[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]].iter().all(|[x, y]| {
        pixel_of(h, *x, *y).is_some_and(|place| (0..2).all(|i| (0.0..=pixels[i] as f64).contains(&place[i])))
    })
}

/// Returns the texels of a picture `[pixel, channel]` of `pixels` columns and rows: the mean of the bilinear picture over each
/// texel, at up to 8 x 8 places. A texel that touches a pixel that is not `valid` is not valid itself.
pub(crate) fn rectify(
    values: &[f32],
    valid: &[bool],
    pixels: [usize; 2],
    h: &Homography,
    texels: [usize; 2],
) -> (Vec<f32>, Vec<bool>) {
    let mut out = vec![0.0; texels[0] * texels[1] * 3];
    let mut seen = vec![true; out.len()];
    for (texel, (rgb, seen)) in out.chunks_exact_mut(3).zip(seen.chunks_exact_mut(3)).enumerate() {
        let [x, y] = [texel % texels[0], texel / texels[0]].map(|i| i as f64);
        let samples = samples_a_side(h, x, y);
        for sample in 0..samples * samples {
            let [i, j] = [sample % samples, sample / samples].map(|i| (i as f64 + 0.5) / samples as f64);
            let Some(place) = pixel_of(h, x + i, y + j) else { continue };
            for (at, weight) in corners(place, pixels) {
                for c in 0..3 {
                    rgb[c] += weight * values[3 * at + c] / (samples * samples) as f32;
                    seen[c] &= valid[3 * at + c] || weight == 0.0;
                }
            }
        }
    }
    (out, seen)
}

/// Returns how many places along a texel's sides are looked at: as many as it covers pixels.
fn samples_a_side(h: &Homography, x: f64, y: f64) -> usize {
    let place = |dx: f64, dy: f64| pixel_of(h, x + dx, y + dy).unwrap_or([0.0; 2]);
    let ([a, b, c], far) = ([place(0.0, 0.0), place(1.0, 0.0), place(0.0, 1.0)], |p: [f64; 2], q: [f64; 2]| {
        (p[0] - q[0]).hypot(p[1] - q[1])
    });
    (far(a, b).max(far(a, c)).ceil() as usize).clamp(1, MAX_SAMPLES)
}

/// Returns the four pixels about a place with their bilinear weights; the edges go on.
fn corners([x, y]: [f64; 2], [width, height]: [usize; 2]) -> [(usize, f32); 4] {
    let within = |t: f64, count: usize| (t - 0.5).clamp(0.0, (count - 1) as f64);
    let (x, y) = (within(x, width), within(y, height));
    let (column, row) = (x as usize, y as usize);
    let (p, q) = ((x - column as f64) as f32, (y - row as f64) as f32);
    let (right, below) = ((column + 1).min(width - 1), (row + 1).min(height - 1));
    [
        (row * width + column, (1.0 - p) * (1.0 - q)),
        (row * width + right, p * (1.0 - q)),
        (below * width + column, (1.0 - p) * q),
        (below * width + right, p * q),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A view that is turned, tapers off and is three pixels a texel near.
    const ASLANT: Homography = [3.0, 0.5, 4.0, -0.4, 2.5, 9.0, 0.002, 0.01, 1.0];

    #[test]
    fn a_photograph_aslant_comes_back_as_the_sample() {
        let (pixels, texels) = ([90, 70], [20, 16]);
        assert!(is_within(&ASLANT, texels, pixels) && !is_within(&ASLANT, texels, [40, 70]));
        // A smooth sample, photographed: each pixel's middle is taken back by the inverse map.
        let sample = |x: f64, y: f64| [0.3 + 0.2 * (x / 4.0).sin(), 0.4 + 0.01 * y, 0.02 * x].map(|v| v as f32);
        let inverse = nalgebra_free_inverse(&ASLANT);
        let values: Vec<f32> = (0..pixels[0] * pixels[1])
            .flat_map(|i| {
                let [u, v] = [i % pixels[0], i / pixels[0]].map(|i| i as f64 + 0.5);
                let [x, y] = pixel_of(&inverse, u, v).unwrap_or([0.0; 2]);
                sample(x, y)
            })
            .collect();
        let mut valid = vec![true; values.len()];
        let (found, seen) = rectify(&values, &valid, pixels, &ASLANT, texels);
        assert!(seen.iter().all(|seen| *seen));
        for (texel, rgb) in found.chunks_exact(3).enumerate() {
            let [x, y] = [texel % 20, texel / 20].map(|i| i as f64 + 0.5);
            let wanted = sample(x, y);
            assert!(rgb.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 0.01), "{texel}: {rgb:?} {wanted:?}");
        }
        // Planted: the map without its taper.
        let mut flat = ASLANT;
        (flat[6], flat[7]) = (0.0, 0.0);
        let (wrong, _) = rectify(&values, &valid, pixels, &flat, texels);
        assert!(wrong.iter().zip(&found).any(|(a, b)| (a - b).abs() > 0.05));
        let [x, y] = pixel_of(&ASLANT, 10.5, 8.5).unwrap();
        valid[3 * (y as usize * pixels[0] + x as usize)] = false;
        let (_, seen) = rectify(&values, &valid, pixels, &ASLANT, texels);
        assert!(!seen[3 * (8 * 20 + 10)] && seen.iter().filter(|seen| !**seen).count() < 6);
    }

    /// The inverse up to a factor, made positive in its last entry: the matrix of cofactors, transposed.
    fn nalgebra_free_inverse(h: &Homography) -> Homography {
        let [a, b, c, d, e, f, g, i, k] = *h;
        [
            e * k - f * i,
            c * i - b * k,
            b * f - c * e,
            f * g - d * k,
            a * k - c * g,
            c * d - a * f,
            d * i - e * g,
            b * g - a * i,
            a * e - b * d,
        ]
    }
}
