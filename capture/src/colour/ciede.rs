//! Colour difference CIEDE2000 [Sharma 2005] of colours in sRGB's primaries under D65.

use crate::colour::transfer::Transfer;

/// A colour in CIE L*a*b*.
pub type Lab = [f64; 3];

/// Matrix from linear sRGB to CIE XYZ with four digits [IEC 61966-2-1].
const XYZ_FROM_SRGB: [[f64; 3]; 3] = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];

/// 25^7, a constant of the CIEDE2000 formula.
const POW25_7: f64 = 6_103_515_625.0;

/// Converter from 8-bit RGB values of a known curve to L*a*b*; white is (255, 255, 255).
#[derive(Debug, Clone)]
pub struct LabConverter {
    linear: [f64; 256],
}

impl LabConverter {
    /// Returns a converter for values encoded with `transfer`.
    pub fn new(transfer: Transfer) -> LabConverter {
        LabConverter { linear: std::array::from_fn(|code| transfer.linear_from_encoded(code as f32 / 255.0).into()) }
    }

    /// Returns L*a*b* of one colour.
    pub fn lab(&self, rgb: [u8; 3]) -> Lab {
        lab_from_linear(rgb.map(|code| self.linear[usize::from(code)]))
    }
}

/// Returns L*a*b* of linear sRGB; white is (1, 1, 1).
pub fn lab_from_linear(linear: [f64; 3]) -> Lab {
    // White is the matrix's own, so that grey has no colour.
    let f = XYZ_FROM_SRGB.map(|row| {
        let white: f64 = row.iter().sum();
        let value: f64 = row.iter().zip(linear).map(|(m, x)| m * x).sum();
        lab_curve(value / white)
    });
    [116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])]
}

/// Evaluates the cube root that is linear near black [CIE 15].
fn lab_curve(t: f64) -> f64 {
    const DELTA: f64 = 6.0 / 29.0;
    if t > DELTA * DELTA * DELTA { cube_root(t) } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
}

/// Returns the cube root of a normal positive number within 1e-14: divides the exponent by three, then takes a step of
/// Halley's iteration. Several times faster than a cube root that is right to the last bit.
fn cube_root(t: f64) -> f64 {
    // Two thirds of the exponent's bias, and what makes the error of the guess alike on both sides.
    const BIAS: u64 = 0x2A9F_7893_0000_0000;
    let mut y = f64::from_bits(t.to_bits() / 3 + BIAS);
    for _ in 0..3 {
        let cube = y * y * y;
        y *= (cube + 2.0 * t) / (2.0 * cube + t);
    }
    y
}

/// Returns the colour difference CIEDE2000 with unit weights [Sharma 2005, eqs. 2 to 22].
pub fn delta_e00(x: Lab, y: Lab) -> f64 {
    let chroma = |a: f64, b: f64| (a * a + b * b).sqrt();
    let mean_chroma = 0.5 * (chroma(x[1], x[2]) + chroma(y[1], y[2]));
    let compress = |c: f64| {
        let c7 = c.powi(7);
        (c7 / (c7 + POW25_7)).sqrt()
    };
    let g = 0.5 * (1.0 - compress(mean_chroma));
    let (a1, a2) = ((1.0 + g) * x[1], (1.0 + g) * y[1]);
    let (c1, c2) = (chroma(a1, x[2]), chroma(a2, y[2]));
    let hue = |a: f64, b: f64| if a == 0.0 && b == 0.0 { 0.0 } else { b.atan2(a).to_degrees().rem_euclid(360.0) };
    let (h1, h2) = (hue(a1, x[2]), hue(a2, y[2]));

    let grey = c1 * c2 == 0.0;
    let turn = match h2 - h1 {
        _ if grey => 0.0,
        d if d > 180.0 => d - 360.0,
        d if d < -180.0 => d + 360.0,
        d => d,
    };
    let d_lightness = y[0] - x[0];
    let d_chroma = c2 - c1;
    let d_hue = 2.0 * (c1 * c2).sqrt() * (0.5 * turn).to_radians().sin();

    let lightness = 0.5 * (x[0] + y[0]);
    let c = 0.5 * (c1 + c2);
    let h = match h1 + h2 {
        sum if grey => sum,
        sum if (h1 - h2).abs() <= 180.0 => 0.5 * sum,
        sum if sum < 360.0 => 0.5 * (sum + 360.0),
        sum => 0.5 * (sum - 360.0),
    };
    let cos = |degrees: f64| degrees.to_radians().cos();
    let t = 1.0 - 0.17 * cos(h - 30.0) + 0.24 * cos(2.0 * h) + 0.32 * cos(3.0 * h + 6.0) - 0.20 * cos(4.0 * h - 63.0);
    let from_middle = (lightness - 50.0) * (lightness - 50.0);
    let s_lightness = 1.0 + 0.015 * from_middle / (20.0 + from_middle).sqrt();
    let s_chroma = 1.0 + 0.045 * c;
    let s_hue = 1.0 + 0.015 * c * t;
    let rotation = 30.0 * (-((h - 275.0) / 25.0) * ((h - 275.0) / 25.0)).exp();
    let r = -2.0 * compress(c) * (2.0 * rotation).to_radians().sin();
    let (l, c, h) = (d_lightness / s_lightness, d_chroma / s_chroma, d_hue / s_hue);
    (l * l + c * c + h * h + r * c * h).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cube_root_is_the_cube_root() {
        for i in 1..20_000 {
            let t = 1.3f64.powi(i % 60 - 30) * (1.0 + f64::from(i) * 1e-4);
            assert!((cube_root(t) / t.cbrt() - 1.0).abs() < 1e-14, "{t}");
        }
    }

    /// The 34 pairs of [Sharma 2005, table 1]: two colours and their difference, four decimals.
    const SHARMA: [(Lab, Lab, f64); 34] = [
        ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
        ([50.0, 3.1571, -77.2803], [50.0, 0.0, -82.7485], 2.8615),
        ([50.0, 2.8361, -74.0200], [50.0, 0.0, -82.7485], 3.4412),
        ([50.0, -1.3802, -84.2814], [50.0, 0.0, -82.7485], 1.0000),
        ([50.0, -1.1848, -84.8006], [50.0, 0.0, -82.7485], 1.0000),
        ([50.0, -0.9009, -85.5211], [50.0, 0.0, -82.7485], 1.0000),
        ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
        ([50.0, -1.0, 2.0], [50.0, 0.0, 0.0], 2.3669),
        ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0009], 7.1792),
        ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0010], 7.1792),
        ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0011], 7.2195),
        ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0012], 7.2195),
        ([50.0, -0.001, 2.49], [50.0, 0.0009, -2.49], 4.8045),
        ([50.0, -0.001, 2.49], [50.0, 0.0010, -2.49], 4.8045),
        ([50.0, -0.001, 2.49], [50.0, 0.0011, -2.49], 4.7461),
        ([50.0, 2.5, 0.0], [50.0, 0.0, -2.5], 4.3065),
        ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
        ([50.0, 2.5, 0.0], [61.0, -5.0, 29.0], 22.8977),
        ([50.0, 2.5, 0.0], [56.0, -27.0, -3.0], 31.9030),
        ([50.0, 2.5, 0.0], [58.0, 24.0, 15.0], 19.4535),
        ([50.0, 2.5, 0.0], [50.0, 3.1736, 0.5854], 1.0000),
        ([50.0, 2.5, 0.0], [50.0, 3.2972, 0.0], 1.0000),
        ([50.0, 2.5, 0.0], [50.0, 1.8634, 0.5757], 1.0000),
        ([50.0, 2.5, 0.0], [50.0, 3.2592, 0.3350], 1.0000),
        ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
        ([63.0109, -31.0961, -5.8663], [62.8187, -29.7946, -4.0864], 1.2630),
        ([61.2901, 3.7196, -5.3901], [61.4292, 2.2480, -4.9620], 1.8731),
        ([35.0831, -44.1164, 3.7933], [35.0232, -40.0716, 1.5901], 1.8645),
        ([22.7233, 20.0904, -46.6940], [23.0331, 14.9730, -42.5619], 2.0373),
        ([36.4612, 47.8580, 18.3852], [36.2715, 50.5065, 21.2231], 1.4146),
        ([90.8027, -2.0831, 1.4410], [91.1528, -1.6435, 0.0447], 1.4441),
        ([90.9257, -0.5406, -0.9208], [88.6381, -0.8985, -0.7239], 1.5381),
        ([6.7747, -0.2908, -2.4247], [5.8714, -0.0985, -2.2286], 0.6377),
        ([2.0776, 0.0795, -1.1350], [0.9033, -0.0636, -0.5514], 0.9082),
    ];

    #[test]
    fn agrees_with_the_published_test_pairs_in_both_directions() {
        for (i, (x, y, published)) in SHARMA.into_iter().enumerate() {
            for got in [delta_e00(x, y), delta_e00(y, x)] {
                assert!((got - published).abs() <= 0.5e-4 + 1e-9, "pair {}: {got}, published {published}", i + 1);
            }
            // Planted difference: the plain distance CIE76 is another figure.
            let plain = (0..3).map(|i| (x[i] - y[i]).powi(2)).sum::<f64>().sqrt();
            assert!((plain - published).abs() > 1e-2, "pair {}", i + 1);
        }
    }

    #[test]
    fn white_black_and_primaries_have_their_known_coordinates() {
        let converter = LabConverter::new(Transfer::Srgb);
        let near = |rgb, lab: Lab, tolerance: f64| {
            let got = converter.lab(rgb);
            (0..3).all(|i| (got[i] - lab[i]).abs() < tolerance)
        };
        assert!(near([255; 3], [100.0, 0.0, 0.0], 1e-6));
        assert!(near([0; 3], [0.0, 0.0, 0.0], 1e-6));
        // sRGB red and blue under D65 as colour calculators print them, to 0.1.
        assert!(near([255, 0, 0], [53.2, 80.1, 67.2], 0.1), "{:?}", converter.lab([255, 0, 0]));
        assert!(near([0, 0, 255], [32.3, 79.2, -107.9], 0.1), "{:?}", converter.lab([0, 0, 255]));
        assert!(!near([254, 0, 0], [53.2, 80.1, 67.2], 0.1), "one step away is seen");
    }
}
