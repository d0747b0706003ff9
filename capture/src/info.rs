//! Description of a capture apart from its pixels, and the radiometry between file values and reflectance x cosine.

use std::fmt;
use std::str::FromStr;

use crate::colour::transfer::Transfer;
use crate::direction::DirectionSet;
use crate::error::CaptureError;

/// Whether file values contain the cosine of the light's incidence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cosine {
    /// Reflectance x cosine, as a photograph of a flat sample under a point light holds it.
    Included,
    /// Plain reflectance; the reader multiplies by |cos theta_i|.
    Excluded,
}

/// Sides of the sample that the light and the eye are on.
///
/// A camera sees the back with the sample turned over, about the y axis (the vertical one of the
/// images): a mark at the left edge of the front stands at the right edge of the back. **The images
/// and directions of a capture are always those of the face that is seen**: columns and x as the
/// camera has them, z towards the eye. So the eye's polar angle is below 90 degrees in every capture,
/// and the light's is above 90 exactly in the two transmission captures, where it stands behind the
/// face that is seen:
///
/// | Side | Light | Eye | Frame | Theta of the lights |
/// |---|---|---|---|---|
/// | `Front` | front | front | the front's | at most 90 |
/// | `Back` | back | back | turned over | at most 90 |
/// | `TransmissionBack` | back | front | the front's | above 90 |
/// | `TransmissionFront` | front | back | turned over | above 90 |
///
/// A direction (x, y, z) of a turned-over frame is (-x, y, -z) in the front's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Light and eye in front.
    Front,
    /// Light and eye behind; in the turned-over frame.
    Back,
    /// Light behind, eye in front.
    TransmissionBack,
    /// Light in front, eye behind; in the turned-over frame.
    TransmissionFront,
}

impl Side {
    /// Every side.
    pub const ALL: [Side; 4] = [Side::Front, Side::Back, Side::TransmissionBack, Side::TransmissionFront];

    /// Returns whether the eye is behind the sample, so that images and directions are in the turned-over frame.
    pub fn is_turned_over(self) -> bool {
        matches!(self, Side::Back | Side::TransmissionFront)
    }

    /// Returns whether light and eye are on different sides, so that the lights stand above 90 degrees.
    pub fn is_transmission(self) -> bool {
        matches!(self, Side::TransmissionBack | Side::TransmissionFront)
    }
}

/// File format of a capture's images.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageFormat {
    /// PNG, 8 bits a channel (16 are read too).
    Png,
    /// JPEG, 8 bits a channel.
    Jpg,
    /// OpenEXR, linear half or float.
    Exr,
}

/// Description of a capture: its size, its directions, and how file values become reflectance.
///
/// The quantity of a capture is `pi * BRDF * |n.wi|` (BTDF where light and eye are on different sides): 1.0 is a white
/// Lambertian surface lit at normal incidence. To get it from a file value, undo `transfer`, multiply by `scale`, and
/// where `cosine` is [`Cosine::Excluded`] multiply by |cos theta_i|. Images and directions are in the frame of the face
/// that is seen, see [`Side`].
#[derive(Debug, Clone, PartialEq)]
pub struct CaptureInfo {
    /// Width of every image in texels.
    pub width: usize,
    /// Height of every image in texels.
    pub height: usize,
    /// Directions towards the eye.
    pub views: DirectionSet,
    /// Directions towards the light.
    pub lights: DirectionSet,
    /// Curve of the file values; always [`Transfer::Linear`] for EXR.
    pub transfer: Transfer,
    /// Whether file values contain the cosine of incidence.
    pub cosine: Cosine,
    /// Factor from linear file values to reflectance, positive.
    pub scale: f32,
    /// Sides of light and eye.
    pub side: Side,
    /// Physical width and height of the images in millimetres, where known.
    pub size_mm: Option<[f32; 2]>,
    /// Format of the images; [`ImageFormat::Exr`] stands for all linear formats, bands and Radiance and UBO2014 files
    /// included, and [`ImageFormat::Png`] for TIFF images of 8 and 16 bits, too.
    pub format: ImageFormat,
    /// Wavelengths of the bands in nanometres, ascending; empty where images are colours.
    pub wavelengths_nm: Vec<f64>,
    /// Pairs that have no image, `view * lights + light`, ascending. Empty unless the capture says that it is incomplete.
    pub missing: Vec<usize>,
    /// Short name for people.
    pub name: String,
    /// Origin of the capture in words; empty where unknown.
    pub provenance: String,
}

impl CaptureInfo {
    /// Returns a description with the defaults of a capture without `capture.toml`: sRGB curve (linear for EXR), cosine
    /// included, front side, scale 1, size unknown, no provenance.
    pub fn new(
        name: impl Into<String>,
        width: usize,
        height: usize,
        views: DirectionSet,
        lights: DirectionSet,
        format: ImageFormat,
    ) -> CaptureInfo {
        CaptureInfo {
            width,
            height,
            views,
            lights,
            transfer: format.default_transfer(),
            cosine: Cosine::Included,
            scale: 1.0,
            side: Side::Front,
            size_mm: None,
            format,
            wavelengths_nm: Vec::new(),
            missing: Vec::new(),
            name: name.into(),
            provenance: String::new(),
        }
    }

    /// Returns the description of this capture as files of another format. A change between EXR and an 8-bit format
    /// takes the default curve of the new format. The 8-bit error figures of an EXR capture, for example, are computed
    /// on `in_format(ImageFormat::Png)`.
    pub fn in_format(&self, format: ImageFormat) -> CaptureInfo {
        let keeps_curve = (self.format == ImageFormat::Exr) == (format == ImageFormat::Exr);
        let transfer = if keeps_curve { self.transfer } else { format.default_transfer() };
        CaptureInfo { format, transfer, ..self.clone() }
    }

    /// Returns the number of (view, light) pairs. Pair index = `view * lights.len() + light`.
    pub fn pair_count(&self) -> usize {
        self.views.len() * self.lights.len()
    }

    /// Returns whether `pair` (`view * lights + light`) has an image.
    pub fn has_image(&self, pair: usize) -> bool {
        self.missing.binary_search(&pair).is_err()
    }

    /// Returns the pairs that have an image, ascending.
    pub fn present_pairs(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.pair_count()).filter(|pair| self.has_image(*pair))
    }

    /// Returns for each pair the pair whose image stands in for it: itself where it has one, else the one with the least sum of
    /// the angles between the views and between the lights, the first of equals.
    ///
    /// Cost: missing pairs times pairs.
    pub fn stand_ins(&self) -> Vec<usize> {
        let mut found: Vec<usize> = (0..self.pair_count()).collect();
        if self.missing.is_empty() {
            return found;
        }
        let angles = |set: &DirectionSet| -> Vec<Vec<f64>> {
            let all = set.directions();
            all.iter().map(|a| all.iter().map(|b| a.angle_deg(*b)).collect()).collect()
        };
        let (views, sources) = (angles(&self.views), angles(&self.lights));
        let present: Vec<usize> = self.present_pairs().collect();
        let lights = self.lights.len();
        for pair in &self.missing {
            let far = |other: &usize| views[other / lights][pair / lights] + sources[other % lights][pair % lights];
            let nearest = present.iter().min_by(|a, b| far(a).total_cmp(&far(b)));
            found[*pair] = nearest.copied().unwrap_or(*pair);
        }
        found
    }

    /// Returns the number of values of a texel in files: the bands, or three.
    pub fn channels(&self) -> usize {
        if self.wavelengths_nm.is_empty() { 3 } else { self.wavelengths_nm.len() }
    }

    /// Returns the number of texels of one image.
    pub fn texel_count(&self) -> usize {
        self.width * self.height
    }

    /// Checks that the directions agree with the side as [`Side`] tells: every view below 90 degrees, lights above 90
    /// exactly where the side is a transmission. The error is one sentence to stand behind the name of the capture.
    pub(crate) fn check_sides(&self) -> Result<(), String> {
        if let Some(view) = self.views.directions().iter().find(|view| view.theta_deg >= 90.0) {
            return Err(format!(
                "its view {view} is not in front of the face that is seen; views stand below 90 degrees on every \
                 side, the back is seen with the sample turned over (side `back` or `transmission-front`)"
            ));
        }
        let behind = |light: &&crate::Direction| light.theta_deg > 90.0;
        let lights = self.lights.directions();
        let found = if self.side.is_transmission() {
            lights.iter().find(|light| !behind(light)).map(|light| (light, "in front of", "at most", "above"))
        } else {
            lights.iter().find(behind).map(|light| (light, "behind", "above", "at most"))
        };
        match found {
            None => Ok(()),
            Some((light, place, is, must)) => Err(format!(
                "its light {light} stands {place} the face that is seen ({is} 90 degrees), but on side `{}` lights \
                 stand {must} 90; correct `side` in capture.toml, or make a capture of its own of those lights",
                self.side
            )),
        }
    }

    /// Returns the factor from linear file values to reflectance x cosine under light `light`. The cosine of a light
    /// behind the surface counts without its sign.
    pub fn linear_factor(&self, light: usize) -> f32 {
        match self.cosine {
            Cosine::Included => self.scale,
            Cosine::Excluded => {
                let cosine = self.lights.directions()[light].theta_deg.to_radians().cos().abs();
                (f64::from(self.scale) * cosine) as f32
            }
        }
    }

    /// Returns reflectance x cosine of each 8-bit file value under light `light`: a table for decoding
    /// [`crate::Pixels::Encoded8`].
    pub fn linear_from_encoded8(&self, light: usize) -> [f32; 256] {
        let factor = self.linear_factor(light);
        std::array::from_fn(|value| self.transfer.linear_from_encoded(value as f32 / 255.0) * factor)
    }

    /// Returns the file value, on the scale 0 to 255 and before rounding, of reflectance x cosine `linear` under light
    /// `light`. The result is not clamped above; negatives become 0 with a curve and stay without one. Returns 0 where
    /// the light grazes so that no file value could hold it.
    pub fn encoded_from_linear(&self, light: usize, linear: f32) -> f32 {
        255.0 * self.transfer.encoded_from_linear(file_linear(linear, self.linear_factor(light)))
    }

    /// Returns the 8-bit file value of reflectance x cosine `linear` under light `light`, as the writers store it:
    /// rounded to nearest, clamped to 0..=255, NaN becomes 0. For whole images use [`crate::Encoder8`], which gives the
    /// same values faster.
    pub fn encoded8_from_linear(&self, light: usize, linear: f32) -> u8 {
        round_to_8_bits(self.encoded_from_linear(light, linear))
    }
}

/// Returns the linear file value of reflectance x cosine, 0 where the factor is 0.
pub(crate) fn file_linear(linear: f32, factor: f32) -> f32 {
    if factor > 0.0 { linear / factor } else { 0.0 }
}

/// Rounds to nearest and clamps; a NaN becomes 0.
pub(crate) fn round_to_8_bits(value: f32) -> u8 {
    // `as` saturates and maps NaN to 0.
    (value + 0.5).floor() as u8
}

impl ImageFormat {
    /// Returns the file name extension, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            ImageFormat::Png => "png",
            ImageFormat::Jpg => "jpg",
            ImageFormat::Exr => "exr",
        }
    }

    /// Returns the format that a file name extension stands for, in any case; `None` for others.
    pub fn from_extension(extension: &str) -> Option<ImageFormat> {
        match extension.to_ascii_lowercase().as_str() {
            "png" => Some(ImageFormat::Png),
            "jpg" | "jpeg" => Some(ImageFormat::Jpg),
            "exr" => Some(ImageFormat::Exr),
            _ => None,
        }
    }

    /// Returns the curve that files of this format have where nothing says otherwise.
    pub fn default_transfer(self) -> Transfer {
        if self == ImageFormat::Exr { Transfer::Linear } else { Transfer::Srgb }
    }
}

/// Implements reading and writing of an enum by its words.
macro_rules! words {
    ($type:ty, $what:literal, $allowed:literal, $($variant:path => $word:literal),+) => {
        impl fmt::Display for $type {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self { $($variant => $word),+ })
            }
        }
        impl FromStr for $type {
            type Err = CaptureError;
            fn from_str(word: &str) -> Result<Self, CaptureError> {
                match word {
                    $($word => Ok($variant),)+
                    _ => Err(CaptureError::BadWord { word: word.into(), what: $what, allowed: $allowed }),
                }
            }
        }
    };
}

words!(Cosine, "an answer to whether the cosine is in the values", "\"included\" or \"excluded\"",
    Cosine::Included => "included", Cosine::Excluded => "excluded");
words!(Side, "a side", "\"front\", \"back\", \"transmission-back\" (light behind) or \"transmission-front\" (light in front)",
    Side::Front => "front", Side::Back => "back",
    Side::TransmissionBack => "transmission-back", Side::TransmissionFront => "transmission-front");
words!(ImageFormat, "an image format", "png, jpg or exr",
    ImageFormat::Png => "png", ImageFormat::Jpg => "jpg", ImageFormat::Exr => "exr");

#[cfg(test)]
mod tests {
    use super::*;

    fn info() -> CaptureInfo {
        let set = DirectionSet::bonn81();
        CaptureInfo::new("test", 4, 3, set.clone(), set, ImageFormat::Png)
    }

    #[test]
    fn every_8_bit_value_is_its_own_decoding_and_encoding() {
        for transfer in [Transfer::Srgb, Transfer::Gamma(2.2), Transfer::Linear] {
            for cosine in [Cosine::Included, Cosine::Excluded] {
                let info = CaptureInfo { transfer, cosine, scale: 1.7, ..info() };
                for light in [0, 30, 80] {
                    let table = info.linear_from_encoded8(light);
                    for value in 0..=255u8 {
                        assert_eq!(info.encoded8_from_linear(light, table[value as usize]), value);
                    }
                }
            }
        }
    }

    #[test]
    fn an_excluded_cosine_is_multiplied_in_and_divided_out_once() {
        let included = info();
        let excluded = CaptureInfo { cosine: Cosine::Excluded, ..info() };
        // Light 80 stands at 75 degrees.
        let cosine = 75f32.to_radians().cos();
        let ratio = excluded.linear_from_encoded8(80)[200] / included.linear_from_encoded8(80)[200];
        assert!((ratio - cosine).abs() < 1e-6);
        assert_eq!(excluded.linear_from_encoded8(0), included.linear_from_encoded8(0));
    }

    #[test]
    fn values_outside_the_range_are_clamped_and_nan_is_black() {
        let info = info();
        for (linear, value) in [(-0.05, 0), (1.0, 255), (7.0, 255), (f32::NAN, 0), (f32::INFINITY, 255)] {
            assert_eq!(info.encoded8_from_linear(0, linear), value);
        }
    }

    #[test]
    fn a_grazing_light_without_cosine_gives_black_instead_of_infinity() {
        let lights = DirectionSet::new(vec![crate::Direction::new(90.0, 0.0)]).unwrap();
        let info = CaptureInfo { lights, cosine: Cosine::Excluded, scale: 0.0, ..info() };
        assert_eq!(info.encoded_from_linear(0, 0.3), 0.0);
    }

    #[test]
    fn pair_index_and_counts_follow_views_times_lights() {
        let info = CaptureInfo { views: DirectionSet::random(3, 1).unwrap(), ..info() };
        assert_eq!(info.pair_count(), 243);
        assert_eq!(info.texel_count(), 12);
    }

    #[test]
    fn changing_to_exr_and_back_changes_the_curve() {
        let gamma = CaptureInfo { transfer: Transfer::Gamma(2.2), ..info() };
        assert_eq!(gamma.in_format(ImageFormat::Jpg).transfer, Transfer::Gamma(2.2));
        let exr = gamma.in_format(ImageFormat::Exr);
        assert_eq!(exr.transfer, Transfer::Linear);
        assert_eq!(exr.in_format(ImageFormat::Png).transfer, Transfer::Srgb);
    }
}
