//! Illuminants and observers: how a spectrum of reflectance becomes a colour on a display.

use std::path::Path;

use crate::colour::cie;
use crate::delimited::{fields, lines, separator_of};
use crate::error::CaptureError;
use crate::toml_text::bounded_text;

/// Largest table that is read, in bytes.
const MAX_BYTES: u64 = 1 << 20;
/// Colour temperature of illuminant A in kelvin, and second radiation constant in nm K, as they are defined together
/// [CIE 015:2018].
const A_KELVIN: f64 = 2848.0;
const SECOND_CONSTANT: f64 = 1.435e7;
/// Matrix from XYZ to the responses of cones in which whites are adapted [Lam 1985, Bradford].
const CONES_FROM_XYZ: [[f64; 3]; 3] = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

/// Curve over wavelength: linear between its rows, and constant beyond them for power, 0 for sensitivity.
#[derive(Debug, Clone, PartialEq)]
struct Curve {
    wavelengths_nm: Vec<f64>,
    values: Vec<f64>,
}

impl Curve {
    fn of_table(values: &[f64; cie::ROWS]) -> Curve {
        let nm = |row: usize| cie::FIRST_NM + cie::STEP_NM * row as f64;
        Curve { wavelengths_nm: (0..cie::ROWS).map(nm).collect(), values: values.to_vec() }
    }

    /// Returns the value at a wavelength; `None` beyond the rows.
    fn at(&self, nm: f64) -> Option<f64> {
        let above = self.wavelengths_nm.partition_point(|known| *known <= nm);
        let (Some(below), true) = (above.checked_sub(1), nm <= *self.wavelengths_nm.last()?) else { return None };
        let (x0, y0) = (self.wavelengths_nm[below], self.values[below]);
        let Some(x1) = self.wavelengths_nm.get(above) else { return Some(y0) };
        Some(y0 + (self.values[above] - y0) * (nm - x0) / (x1 - x0))
    }
}

/// Relative spectral power of a light.
#[derive(Debug, Clone, PartialEq)]
pub struct Illuminant {
    curve: Curve,
}

impl Illuminant {
    /// Returns daylight of about 6500 K, which colours of this project are under unless it is said otherwise.
    pub fn d65() -> Illuminant {
        Illuminant { curve: Curve::of_table(&cie::D65) }
    }

    /// Returns the light of a tungsten lamp, CIE illuminant A.
    pub fn a() -> Illuminant {
        let nm: Vec<f64> = (0..=500).map(|i| 300.0 + 5.0 * f64::from(i)).collect();
        let exponent = |nm: f64| (SECOND_CONSTANT / (A_KELVIN * nm)).exp_m1();
        let values = nm.iter().map(|nm| 100.0 * (560.0 / nm).powi(5) * exponent(560.0) / exponent(*nm)).collect();
        Illuminant { curve: Curve { wavelengths_nm: nm, values } }
    }

    /// Returns the illuminant of a word: `D65`, `A`, `E` (equal power), or a table (CSV) of wavelengths in nanometres and
    /// relative power.
    ///
    /// # Errors
    /// [`CaptureError::BadCurves`] for a table that cannot be read.
    pub fn by_name(name: &str) -> Result<Illuminant, CaptureError> {
        match name {
            "D65" | "d65" => Ok(Illuminant::d65()),
            "A" | "a" => Ok(Illuminant::a()),
            "E" | "e" => {
                Ok(Illuminant { curve: Curve { wavelengths_nm: vec![100.0, 20_000.0], values: vec![1.0; 2] } })
            }
            path => {
                let [curve] = read_curves(path.as_ref(), "an illuminant (D65, A, E or a table)")?;
                Ok(Illuminant { curve })
            }
        }
    }
}

/// Eye or camera: three sensitivities over wavelength.
#[derive(Debug, Clone, PartialEq)]
pub struct Observer {
    curves: [Curve; 3],
    /// Whether the curves are X, Y and Z, so that what they see becomes linear sRGB.
    is_cie: bool,
}

impl Observer {
    /// Returns the CIE 1931 2-degree observer.
    pub fn cie_1931() -> Observer {
        Observer { curves: [&cie::X, &cie::Y, &cie::Z].map(Curve::of_table), is_cie: true }
    }

    /// Returns the observer of a word: `1931`, or a camera's table (CSV) of wavelengths in nanometres and three
    /// sensitivities, whose values become red, green and blue as they are.
    ///
    /// # Errors
    /// [`CaptureError::BadCurves`] for a table that cannot be read.
    pub fn by_name(name: &str) -> Result<Observer, CaptureError> {
        match name {
            "1931" | "cie1931" => Ok(Observer::cie_1931()),
            path => {
                Ok(Observer { curves: read_curves(path.as_ref(), "an observer (1931 or a table)")?, is_cie: false })
            }
        }
    }
}

/// Returns the weights of reflectances at `wavelengths_nm`, ascending, `[wavelength][channel]`, that sum to what
/// `observer` sees under `illuminant`, so that a perfect reflector is (1, 1, 1) exactly: of the CIE's observer linear sRGB,
/// whose white is adapted to the display's [Lam 1985].
///
/// A spectrum is linear between its wavelengths and constant beyond them, as [`crate::rgb_weights`] has it, which this is
/// under D65 to 2 digits of 8 bits. Integrates by 1 nm from 300 to 2500 nm as far as both curves go.
pub fn shown_weights(wavelengths_nm: &[f64], illuminant: &Illuminant, observer: &Observer) -> Vec<[f32; 3]> {
    let mut weights = vec![[0f64; 3]; wavelengths_nm.len()];
    let (Some(first), Some(last)) = (wavelengths_nm.first(), wavelengths_nm.last()) else { return Vec::new() };
    for nm in (300..=2500).map(f64::from) {
        let Some(power) = illuminant.curve.at(nm) else { continue };
        let seen = observer.curves.each_ref().map(|curve| power * curve.at(nm).unwrap_or(0.0));
        if seen == [0.0; 3] {
            continue;
        }
        let held = nm.clamp(*first, *last);
        let above = wavelengths_nm.partition_point(|known| *known <= held).clamp(1, wavelengths_nm.len());
        let below = above - 1;
        let above = above.min(wavelengths_nm.len() - 1);
        let gap = wavelengths_nm[above] - wavelengths_nm[below];
        let share = if gap > 0.0 { (held - wavelengths_nm[below]) / gap } else { 0.0 };
        for channel in 0..3 {
            weights[below][channel] += (1.0 - share) * seen[channel];
            weights[above][channel] += share * seen[channel];
        }
    }
    let white: [f64; 3] = std::array::from_fn(|channel| weights.iter().map(|weight| weight[channel]).sum());
    let to_display = if observer.is_cie { adapted_to_srgb(white) } else { IDENTITY };
    let shown = |weight: &[f64; 3]| to_display.map(|row| row[0] * weight[0] + row[1] * weight[1] + row[2] * weight[2]);
    let shown: Vec<[f64; 3]> = weights.iter().map(shown).collect();
    let white: [f64; 3] = std::array::from_fn(|channel| shown.iter().map(|weight| weight[channel]).sum());
    let scale = white.map(|white| if white.abs() > 1e-12 { 1.0 / white } else { 0.0 });
    shown.iter().map(|weight| [0, 1, 2].map(|channel| (weight[channel] * scale[channel]) as f32)).collect()
}

const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn product(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Returns the matrix from XYZ under a light of this white to linear sRGB, whose white is D65.
fn adapted_to_srgb(white: [f64; 3]) -> [[f64; 3]; 3] {
    let sum = |table: &[f64; cie::ROWS]| table.iter().zip(&cie::D65).map(|(x, power)| x * power).sum::<f64>();
    let d65 = [sum(&cie::X), sum(&cie::Y), sum(&cie::Z)];
    let cones = |xyz: [f64; 3]| CONES_FROM_XYZ.map(|row| row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2]);
    let (from, to) = (cones(white), cones(d65));
    // Per unit of luminance.
    let gain = [0, 1, 2].map(|i| to[i] / d65[1] / (from[i] / white[1]).max(1e-12));
    let scaled = [0, 1, 2].map(|i| CONES_FROM_XYZ[i].map(|x| gain[i] * x));
    product(&cie::RGB_FROM_XYZ, &product(&inverse(&CONES_FROM_XYZ), &scaled))
}

fn inverse(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let cofactor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * cofactor(0, j)).sum();
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| cofactor(j, i) / determinant))
}

/// Reads a table of wavelengths and `N` curves; a heading is passed over.
fn read_curves<const N: usize>(path: &Path, what: &str) -> Result<[Curve; N], CaptureError> {
    let bad = |reason: String| CaptureError::BadCurves { path: path.display().to_string(), what: what.into(), reason };
    let text = bounded_text(path, MAX_BYTES, "a table").map_err(|fault| bad(format!("it {fault}")))?;
    let text = text.trim_start_matches('\u{FEFF}');
    let separator = lines(text).next().map_or(',', |(_, line)| separator_of(line));
    let mut rows: Vec<[f64; 4]> = Vec::new();
    for (number, line) in lines(text) {
        let cells = fields(line, separator).map_err(|fault| bad(format!("line {number}: {fault}")))?;
        let parsed: Option<Vec<f64>> = cells.iter().take(1 + N).map(|cell| cell.parse().ok()).collect();
        match parsed.filter(|row| row.len() == 1 + N && row.iter().all(|x| x.is_finite())) {
            Some(row) => {
                let mut held = [0.0; 4];
                held[..1 + N].copy_from_slice(&row);
                rows.push(held);
            }
            None if rows.is_empty() => {}
            None => {
                return Err(bad(format!("line {number} has not {} numbers: a wavelength in nm and {N} more", 1 + N)));
            }
        }
    }
    rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let has_power = (1..=N).all(|column| rows.iter().any(|row| row[column] > 0.0));
    if rows.len() < 2 || rows.windows(2).any(|pair| pair[0][0] == pair[1][0]) || !has_power {
        return Err(bad(format!("it has no two rows of different wavelengths with {N} curves above 0")));
    }
    let column = |i: usize| Curve {
        wavelengths_nm: rows.iter().map(|row| row[0]).collect(),
        values: rows.iter().map(|row| row[1 + i]).collect(),
    };
    Ok(std::array::from_fn(column))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::spectrum::{rgb_of, rgb_weights};

    fn evenly(count: usize) -> Vec<f64> {
        (0..count).map(|i| 400.0 + 300.0 * i as f64 / (count - 1) as f64).collect()
    }

    fn close(a: [f32; 3], b: [f32; 3], most: f32) -> bool {
        (0..3).all(|c| (a[c] - b[c]).abs() < most)
    }

    #[test]
    fn white_is_white_under_every_light_and_d65_is_what_it_was() {
        let nm = evenly(31);
        for light in [Illuminant::d65(), Illuminant::a(), Illuminant::by_name("E").unwrap()] {
            let weights = shown_weights(&nm, &light, &Observer::cie_1931());
            assert!(close(rgb_of(&weights, &[0.4; 31]), [0.4; 3], 1e-5));
        }
        let edge: Vec<f32> = nm.iter().map(|nm| 1.0 / (1.0 + (-(nm - 580.0) / 20.0).exp()) as f32).collect();
        let d65 = rgb_of(&shown_weights(&nm, &Illuminant::d65(), &Observer::cie_1931()), &edge);
        assert!(close(d65, rgb_of(&rgb_weights(&nm).unwrap(), &edge), 2e-3), "{d65:?}");
        // Planted difference: red looks lighter by lamplight.
        let a = rgb_of(&shown_weights(&nm, &Illuminant::a(), &Observer::cie_1931()), &edge);
        assert!(a[0] > d65[0] + 0.05 || a[1] > d65[1] + 0.05, "{a:?} {d65:?}");
    }

    #[test]
    fn illuminant_a_has_its_white_and_its_printed_power() {
        // Chromaticity of A, and relative power at 400 and 700 nm [CIE 015:2018].
        let a = Illuminant::a();
        assert!(
            (a.curve.at(400.0).unwrap() - 14.708).abs() < 2e-3 && (a.curve.at(700.0).unwrap() - 198.26).abs() < 2e-2
        );
        let xyz: Vec<f64> = [&cie::X, &cie::Y, &cie::Z]
            .iter()
            .map(|table| (0..cie::ROWS).map(|row| table[row] * a.curve.at(380.0 + 5.0 * row as f64).unwrap()).sum())
            .collect();
        let sum: f64 = xyz.iter().sum();
        assert!((xyz[0] / sum - 0.44757).abs() < 2e-4 && (xyz[1] / sum - 0.40745).abs() < 2e-4);
    }

    #[test]
    fn a_camera_sees_its_own_bands_and_bad_tables_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path.display().to_string()
        };
        // Infrared, red and green as red, green and blue.
        let cir =
            path("cir.csv", "nm;r;g;b\n500;0;0;0\n550;0;0;1\n600;0;0;0\n650;0;1;0\n700;0;0;0\n850;1;0;0\n900;0;0;0\n");
        let nm: Vec<f64> = (0..13).map(|i| 400.0 + 50.0 * f64::from(i)).collect();
        let leaf: Vec<f32> = nm.iter().map(|nm| if *nm > 725.0 { 0.5 } else { 0.05 }).collect();
        let weights = shown_weights(&nm, &Illuminant::d65(), &Observer::by_name(&cir).unwrap());
        let seen = rgb_of(&weights, &leaf);
        assert!(seen[0] > 0.3 && seen[1] < 0.15 && (seen[2] - 0.05).abs() < 1e-3, "{seen:?}");
        for (text, clause) in [("", "no two rows"), ("400,1\n400,2\n", "no two rows"), ("400,1\n500,x\n", "line 2")] {
            let error = Illuminant::by_name(&path("bad.csv", text)).unwrap_err().to_string();
            assert!(error.contains("bad.csv") && error.contains(clause), "{error}");
        }
        assert!(Observer::by_name("nowhere.csv").unwrap_err().to_string().contains("nowhere.csv"));
    }
}
