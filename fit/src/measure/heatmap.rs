//! Error maps as pictures: a perceptual colour map, a legend with numbers, PNG.

use crate::error::FitError;
use crate::measure::compare::Comparison;
use btf_capture::{CaptureInfo, write_file_atomically};
use image::ImageEncoder;
use image::codecs::png::PngEncoder;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Share of the values that a map's scale covers; values above have the last colour.
const COVERED: f64 = 0.995;
/// Smallest side of a written map in pixels; smaller maps are enlarged by a whole factor.
const MIN_SIDE: usize = 320;
/// Pixels per dot of a letter.
const LETTER_SCALE: usize = 2;

/// Degree-6 polynomial through the colour map viridis [Smith 2015], one row per channel, lowest power
/// first; fitted by M. Zucker (2019, public domain), within 0.01 of the table but for its last step.
const VIRIDIS: [[f32; 7]; 3] = [
    [0.277_727_33, 0.105_093_04, -0.330_861_83, -4.634_230_5, 6.228_27, 4.776_385, -5.435_456],
    [0.005_407_344_5, 1.404_613_5, 0.214_847_56, -5.799_101, 14.179_933, -13.745_145, 4.645_852_6],
    [0.334_099_8, 1.384_590_2, 0.095_095_16, -19.332_441, 56.690_55, -65.353_03, 26.312_435],
];

/// Returns the colour of `t` in [0, 1] on the map viridis: dark blue to yellow, lightness rising evenly. Values outside
/// are clamped, NaN is 0.
pub fn viridis(t: f32) -> [u8; 3] {
    let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
    VIRIDIS.map(|row| {
        let value = row.iter().rev().fold(0.0, |sum, coefficient| sum * t + coefficient);
        (value.clamp(0.0, 1.0) * 255.0).round() as u8
    })
}

/// An 8-bit RGB picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Raster {
    /// Pixels per row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Samples `[pixel, channel]`, top left first.
    pub rgb: Vec<u8>,
}

impl Raster {
    /// Returns a picture from a function of column and row.
    pub fn from_fn(width: usize, height: usize, colour: impl Fn(usize, usize) -> [u8; 3]) -> Raster {
        let rgb = (0..width * height).flat_map(|i| colour(i % width, i / width)).collect();
        Raster { width, height, rgb }
    }

    /// Returns a picture of values on the colour map from 0 to `top`; `None` is grey.
    pub fn of_values(values: &[Option<f32>], width: usize, top: f32) -> Raster {
        let grey = [128; 3];
        Raster::from_fn(width, values.len() / width, |x, y| {
            values[y * width + x].map_or(grey, |value| viridis(if top > 0.0 { value / top } else { 0.0 }))
        })
    }

    /// Returns the picture with each pixel repeated `factor` x `factor` times.
    pub fn enlarged(&self, factor: usize) -> Raster {
        Raster::from_fn(self.width * factor, self.height * factor, |x, y| self.pixel(x / factor, y / factor))
    }

    /// Returns the picture with a title above and a colour bar with numbers from 0 to `top` at its right.
    pub fn with_legend(&self, title: &str, top: f32) -> Raster {
        const MARGIN: usize = 12;
        const BAR: usize = 18;
        let line = 5 * LETTER_SCALE;
        let head = line + 2 * MARGIN;
        let numbers = 7 * 4 * LETTER_SCALE;
        let bar_x = self.width + 2 * MARGIN;
        let width = (bar_x + BAR + MARGIN / 2 + numbers).max(text_width(title) + 2 * MARGIN);
        let mut out = Raster::from_fn(width, head + self.height.max(60) + MARGIN, |_, _| [255; 3]);
        out.text(MARGIN, MARGIN, title);
        for y in 0..self.height {
            for x in 0..self.width {
                out.set(MARGIN + x, head + y, self.pixel(x, y));
            }
        }
        let bar_height = self.height.max(60);
        for y in 0..bar_height {
            let t = 1.0 - y as f32 / (bar_height - 1) as f32;
            for x in 0..BAR {
                out.set(bar_x + x, head + y, viridis(t));
            }
        }
        for (share, more) in [(0.0, ""), (0.5, ""), (1.0, "+")] {
            let y = head + ((1.0 - share) * (bar_height - line) as f32) as usize;
            out.text(bar_x + BAR + MARGIN / 2, y, &format!("{}{more}", short_number(top * share)));
        }
        out
    }

    /// Returns the picture as a PNG file.
    ///
    /// # Errors
    /// If it is larger than PNG allows.
    pub fn png(&self) -> Result<Vec<u8>, FitError> {
        let mut bytes = Vec::new();
        PngEncoder::new(&mut bytes)
            .write_image(&self.rgb, self.width as u32, self.height as u32, image::ExtendedColorType::Rgb8)
            .map_err(|error| FitError::Params(format!("a picture could not be encoded as PNG ({error})")))?;
        Ok(bytes)
    }

    pub(crate) fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let at = (y * self.width + x) * 3;
        [self.rgb[at], self.rgb[at + 1], self.rgb[at + 2]]
    }

    fn set(&mut self, x: usize, y: usize, colour: [u8; 3]) {
        if x < self.width && y < self.height {
            let at = (y * self.width + x) * 3;
            self.rgb[at..at + 3].copy_from_slice(&colour);
        }
    }

    fn text(&mut self, x: usize, y: usize, text: &str) {
        for (i, letter) in text.chars().enumerate() {
            let rows = glyph(letter);
            for dot in 0..15 {
                if rows >> (14 - dot) & 1 == 1 {
                    let (dx, dy) = (x + (i * 4 + dot % 3) * LETTER_SCALE, y + dot / 3 * LETTER_SCALE);
                    for p in 0..LETTER_SCALE * LETTER_SCALE {
                        self.set(dx + p % LETTER_SCALE, dy + p / LETTER_SCALE, [40; 3]);
                    }
                }
            }
        }
    }
}

fn text_width(text: &str) -> usize {
    text.chars().count() * 4 * LETTER_SCALE
}

/// Returns a number with three significant digits, without an exponent where that is short.
pub(crate) fn short_number(x: f32) -> String {
    match x.abs() {
        a if a == a.trunc() && a < 1e6 => format!("{x:.0}"),
        a if a >= 99.95 => format!("{x:.0}"),
        a if a >= 9.995 => format!("{x:.1}"),
        a if a >= 0.9995 => format!("{x:.2}"),
        a if a >= 0.01 => format!("{x:.3}"),
        _ => format!("{x:.1e}"),
    }
}

/// Returns a letter of 3 x 5 dots: one octal digit a row, from the top.
fn glyph(letter: char) -> u16 {
    const LETTERS: &str = "0123456789.-+ABCDEFGHIJKLMNOPQRSTUVWXYZ";
    const ROWS: [u16; 39] = [
        0o75557, 0o26227, 0o71747, 0o71717, 0o55711, 0o74717, 0o74757, 0o71111, 0o75757, 0o75717, 0o00002, 0o00700,
        0o02720, 0o25755, 0o65656, 0o34443, 0o65556, 0o74647, 0o74644, 0o34553, 0o55755, 0o72227, 0o11152, 0o55655,
        0o44447, 0o57755, 0o65555, 0o25552, 0o65644, 0o25573, 0o65655, 0o34216, 0o72222, 0o55557, 0o55552, 0o55775,
        0o55255, 0o55222, 0o71247,
    ];
    let letter = letter.to_ascii_uppercase();
    LETTERS.find(letter).map_or(0, |at| ROWS[at])
}

/// Returns the value below which 99.5 % of `values` lie, for the top of a map's scale, so that a few outliers do not
/// darken everything else.
pub fn scale_top(values: impl Iterator<Item = f32>) -> f32 {
    let mut sorted: Vec<f32> = values.collect();
    sorted.sort_by(f32::total_cmp);
    let at = (COVERED * sorted.len() as f64).ceil() as usize;
    sorted.get(at.saturating_sub(1)).copied().unwrap_or(0.0)
}

/// Writes a comparison into the folder `dir`, which is made if need be: `texel_rmse.png` (error per texel in steps of
/// 8-bit values), `pair_rmse.png` (error per pair, a row per view and a column per light) and `pairs.csv` (angles and
/// `psnr_db` of each pair). Files of these names are replaced.
///
/// # Errors
/// If the folder cannot be made or written.
pub fn write_heatmaps(dir: &Path, info: &CaptureInfo, comparison: &Comparison) -> Result<Vec<PathBuf>, FitError> {
    std::fs::create_dir_all(dir).map_err(|source| FitError::File {
        path: dir.to_path_buf(),
        action: "making the folder for the error maps",
        source,
        remedy: "give a folder that you may write to",
    })?;
    let map = |values: &[Option<f32>], width: usize, title: &str| {
        let top = scale_top(values.iter().flatten().copied());
        let raster = Raster::of_values(values, width, top);
        let factor = MIN_SIDE.div_ceil(raster.width.max(raster.height)).max(1);
        raster.enlarged(factor).with_legend(title, top).png()
    };
    let texels: Vec<_> = comparison.texel_rmse_codes().into_iter().map(Some).collect();
    let files = [
        ("texel_rmse.png", map(&texels, comparison.width, "RMSE per texel 8-bit steps")?),
        ("pair_rmse.png", map(&comparison.pair_rmse_codes(), comparison.lights, "RMSE row view column light")?),
        ("pairs.csv", pairs_csv(info, comparison).into_bytes()),
    ];
    let mut paths = Vec::new();
    for (name, bytes) in files {
        let path = dir.join(name);
        write_file_atomically(&path, &bytes)?;
        paths.push(path);
    }
    Ok(paths)
}

fn pairs_csv(info: &CaptureInfo, comparison: &Comparison) -> String {
    let mut text = String::from("view,light,view_theta_deg,view_phi_deg,light_theta_deg,light_phi_deg,psnr_db\n");
    for &pair in &comparison.pairs {
        let (view, light) = (pair / comparison.lights, pair % comparison.lights);
        let (v, l) = (info.views.directions()[view], info.lights.directions()[light]);
        let psnr = comparison.psnr_of_pairs([pair]).unwrap_or(f64::INFINITY);
        // Writing into a string cannot fail.
        let _ = writeln!(text, "{view},{light},{},{},{},{},{psnr:.4}", v.theta_deg, v.phi_deg, l.theta_deg, l.phi_deg);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_colour_map_is_viridis_and_its_lightness_rises() {
        // Ten anchors of the published table, evenly spaced.
        let anchors: [u32; 10] =
            [0x440154, 0x482878, 0x3e4989, 0x31688e, 0x26828e, 0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b, 0xfde725];
        for (i, anchor) in anchors.into_iter().enumerate() {
            let [_, r, g, b] = anchor.to_be_bytes();
            let got = viridis(i as f32 / 9.0);
            let worst = [(r, got[0]), (g, got[1]), (b, got[2])].iter().map(|(x, y)| x.abs_diff(*y)).max().unwrap();
            assert!(worst <= 6, "{i}: {got:?} {anchor:06x}");
        }
        let lightness = |t: f32| {
            let [r, g, b] = viridis(t).map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        assert!((1..=50).all(|i| lightness(i as f32 / 50.0) > lightness((i - 1) as f32 / 50.0)));
        assert_eq!((viridis(-1.0), viridis(f32::NAN), viridis(9.0)), (viridis(0.0), viridis(0.0), viridis(1.0)));
    }

    #[test]
    fn a_map_shows_where_the_error_is() {
        let mut values = vec![Some(0.1); 12];
        values[7] = Some(1.0);
        values[0] = None;
        let raster = Raster::of_values(&values, 4, 1.0);
        assert_eq!((raster.width, raster.height), (4, 3));
        assert_eq!(raster.pixel(3, 1), viridis(1.0));
        assert_eq!(raster.pixel(0, 0), [128; 3]);
        assert_eq!(raster.pixel(1, 0), viridis(0.1));
        assert_eq!(raster.enlarged(3).pixel(11, 5), viridis(1.0));
        let legend = raster.enlarged(40).with_legend("RMSE", 1.0);
        assert!(legend.width > 160 && legend.rgb.contains(&40));
    }

    #[test]
    fn a_png_is_read_back_as_it_was() {
        let raster = Raster::from_fn(5, 4, |x, y| [x as u8, y as u8, 200]);
        let back = image::load_from_memory(&raster.png().unwrap()).unwrap().into_rgb8();
        assert_eq!((back.width(), back.height(), back.into_raw()), (5, 4, raster.rgb.clone()));
    }

    #[test]
    fn the_scale_leaves_the_top_half_percent_out() {
        let values = (0..1000).map(|i| if i == 500 { 1e6 } else { i as f32 });
        assert_eq!(scale_top(values), 995.0);
        assert_eq!(scale_top([2.0, 3.0].into_iter()), 3.0);
        assert_eq!(scale_top(std::iter::empty()), 0.0);
    }
}
