//! Reads and writes `capture.toml`, which holds what the file names cannot say about a capture.

use serde::{Deserialize, Serialize};

use crate::colour::spectrum::PLAUSIBLE_NM;
use crate::direction::{Direction, DirectionSet};
use crate::error::CaptureError;
use crate::images::bands::MAX_BANDS;
use crate::info::{CaptureInfo, ImageFormat};

/// Name of the manifest, beside the view folders.
pub(crate) const MANIFEST_NAME: &str = "capture.toml";

/// Largest side of rectified images, texels.
const MAX_SIDE: usize = 8192;

/// Largest manifest that is read, in bytes.
pub(crate) const MAX_MANIFEST_BYTES: u64 = 1 << 20;

/// Keys of the manifest, all optional when reading.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    #[serde(skip_serializing_if = "Option::is_none")]
    name: Option<String>,
    /// Transfer curve: `srgb`, `linear` or `gamma:2.2`.
    #[serde(skip_serializing_if = "Option::is_none")]
    transfer: Option<toml::Spanned<String>>,
    /// Cosine of incidence: `included` or `excluded`.
    #[serde(skip_serializing_if = "Option::is_none")]
    cosine: Option<toml::Spanned<String>>,
    /// Factor from linear file values to reflectance.
    #[serde(skip_serializing_if = "Option::is_none")]
    scale: Option<toml::Spanned<f64>>,
    /// Side: `front`, `back`, `transmission-back` (light behind) or `transmission-front` (eye behind); see
    /// [`crate::Side`] for the frame of each.
    #[serde(skip_serializing_if = "Option::is_none")]
    side: Option<toml::Spanned<String>>,
    /// Width and height in millimetres.
    #[serde(skip_serializing_if = "Option::is_none")]
    size_mm: Option<toml::Spanned<Vec<f64>>>,
    /// Whether pairs of a view and a light may have no image.
    #[serde(skip_serializing_if = "Option::is_none")]
    incomplete: Option<bool>,
    /// Where the next row of the files lies: `down` (the default) or `up`.
    #[serde(skip_serializing_if = "Option::is_none")]
    rows: Option<toml::Spanned<String>>,
    /// Image of no light.
    #[serde(skip_serializing_if = "Option::is_none")]
    black: Option<toml::Spanned<String>>,
    /// Image of a white target under the same light.
    #[serde(skip_serializing_if = "Option::is_none")]
    flat: Option<toml::Spanned<String>>,
    /// Texels a row and rows of images that are rectified.
    #[serde(skip_serializing_if = "Option::is_none")]
    rectified: Option<toml::Spanned<Vec<usize>>>,
    /// Image that is black where texels are invalid.
    #[serde(skip_serializing_if = "Option::is_none")]
    mask: Option<toml::Spanned<String>>,
    /// Share of the largest file value from which on a sample is saturated.
    #[serde(skip_serializing_if = "Option::is_none")]
    saturation: Option<toml::Spanned<f64>>,
    /// The views, or the lights, that images count as: `bonn81`, `dome151` or `[theta, phi]` in degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    views: Option<toml::Spanned<toml::Value>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    lights: Option<toml::Spanned<toml::Value>>,
    /// Wavelengths of the bands of TIFF and ENVI images in nanometres, in the files' order.
    #[serde(skip_serializing_if = "Option::is_none")]
    wavelengths_nm: Option<toml::Spanned<Vec<f64>>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    provenance: Option<String>,
}

/// Keys that say how a capture's files are read.
#[derive(Debug, Clone, Default)]
pub(crate) struct Reading {
    /// Whether pairs may have no image.
    pub incomplete: bool,
    /// Whether the files' first row is the lowest.
    pub rows_up: bool,
    /// Names of the images of black level, flat field and mask, relative to the manifest.
    pub black: Option<String>,
    pub flat: Option<String>,
    pub mask: Option<String>,
    /// Texels a row and rows of images that are rectified.
    pub rectified: Option<[usize; 2]>,
    /// Share of the largest file value from which on a sample is saturated.
    pub saturation: Option<f32>,
    /// Directions that images count as.
    pub views: Option<DirectionSet>,
    pub lights: Option<DirectionSet>,
    /// Wavelengths of the bands in nanometres, in the files' order; empty where none are told.
    pub wavelengths_nm: Vec<f64>,
}

impl Reading {
    /// Returns whether any key is there that only captures of image files take.
    pub fn is_of_files(&self) -> bool {
        let names = [&self.black, &self.flat, &self.mask].iter().any(|name| name.is_some());
        let sets = self.views.is_some() || self.lights.is_some();
        let bands = !self.wavelengths_nm.is_empty();
        self.incomplete || names || sets || bands || self.rectified.is_some() || self.saturation.is_some()
    }
}

/// Returns the keys in `text` that say how files are read. `path` is for messages.
pub(crate) fn reading(text: &str, path: &str) -> Result<Reading, CaptureError> {
    let (manifest, bad) = parsed(text, path)?;
    let nominal = |key: Option<toml::Spanned<toml::Value>>, name: &str| {
        let Some(key) = key else { return Ok(None) };
        let reason = || format!("{name} must be \"bonn81\", \"dome151\" or [[theta, phi], ...] in degrees");
        let set = directions_of(key.get_ref()).ok_or_else(|| bad(key.span().start, reason()))?;
        set.map(Some).map_err(|error| bad(key.span().start, format!("{name}: {error}")))
    };
    let rows_up = match &manifest.rows {
        None => false,
        Some(word) if word.get_ref() == "down" => false,
        Some(word) if word.get_ref() == "up" => true,
        Some(word) => {
            let reason = format!("rows is `{}`; write \"down\" or \"up\"", word.get_ref());
            return Err(bad(word.span().start, reason));
        }
    };
    if let Some(share) =
        manifest.saturation.as_ref().filter(|share| share.get_ref().is_nan() || *share.get_ref() <= 0.0)
    {
        return Err(bad(share.span().start, "saturation must be above 0".into()));
    }
    let rectified = match &manifest.rectified {
        None => None,
        Some(sides) => match sides.get_ref()[..] {
            [width, height] if (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height) => {
                Some([width, height])
            }
            _ => {
                let reason = format!("rectified must be two whole numbers of texels, 1 to {MAX_SIDE}");
                return Err(bad(sides.span().start, reason));
            }
        },
    };
    let wavelengths_nm = match manifest.wavelengths_nm {
        None => Vec::new(),
        Some(nm) => {
            let fault = fault_of(nm.get_ref());
            fault.map_or(Ok(()), |fault| Err(bad(nm.span().start, format!("wavelengths_nm {fault}"))))?;
            nm.into_inner()
        }
    };
    let name = |key: Option<toml::Spanned<String>>| key.map(toml::Spanned::into_inner);
    Ok(Reading {
        incomplete: manifest.incomplete == Some(true),
        rows_up,
        rectified,
        saturation: manifest.saturation.map(|share| share.into_inner() as f32),
        black: name(manifest.black),
        flat: name(manifest.flat),
        mask: name(manifest.mask),
        views: nominal(manifest.views, "views")?,
        lights: nominal(manifest.lights, "lights")?,
        wavelengths_nm,
    })
}

/// Returns why numbers cannot be the wavelengths in nanometres of a file's bands; `None` where they can.
fn fault_of(wavelengths_nm: &[f64]) -> Option<String> {
    let mut sorted = wavelengths_nm.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (from, to) = (PLAUSIBLE_NM.start(), PLAUSIBLE_NM.end());
    if sorted.is_empty() || sorted.len() > MAX_BANDS {
        return Some(format!("must have a number for each band, 1 to {MAX_BANDS}"));
    }
    if let Some(nm) = sorted.iter().find(|nm| !PLAUSIBLE_NM.contains(*nm)) {
        return Some(format!("has {nm}; wavelengths go from {from} to {to} nm"));
    }
    let twice = sorted.windows(2).find(|pair| pair[0] == pair[1])?;
    Some(format!("has {} twice; each band has a wavelength of its own", twice[0]))
}

/// Returns the directions that a value names or lists; `None` where it does neither.
fn directions_of(value: &toml::Value) -> Option<Result<DirectionSet, CaptureError>> {
    match value.as_str() {
        Some("bonn81") => return Some(Ok(DirectionSet::bonn81())),
        Some("dome151") => return Some(Ok(DirectionSet::dome151())),
        _ => {}
    }
    let number = |value: &toml::Value| value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64));
    let directions = value.as_array()?.iter().map(|angles| match angles.as_array()?.as_slice() {
        [theta, phi] => Some(Direction::new(number(theta)?, number(phi)?)),
        _ => None,
    });
    Some(DirectionSet::new(directions.collect::<Option<_>>()?))
}

/// Parses the manifest in `text`; also returns what makes an error of a place in it and a reason.
fn parsed<'a>(
    text: &'a str,
    path: &'a str,
) -> Result<(Manifest, impl Fn(usize, String) -> CaptureError + 'a), CaptureError> {
    let bad = move |offset: usize, reason: String| {
        let line = text.as_bytes()[..offset.min(text.len())].iter().filter(|&&byte| byte == b'\n').count() + 1;
        let reason = reason.split_whitespace().collect::<Vec<_>>().join(" ");
        CaptureError::BadManifest { path: path.into(), line, reason }
    };
    let manifest =
        toml::from_str(text).map_err(|error| bad(error.span().map_or(0, |span| span.start), error.message().into()))?;
    Ok((manifest, bad))
}

/// Applies the keys in `text` to `info`; other fields keep their values. `path` is for messages.
pub(crate) fn apply(text: &str, path: &str, info: &mut CaptureInfo) -> Result<(), CaptureError> {
    let (manifest, bad) = parsed(text, path)?;
    let bad = &bad;
    let at = |span: std::ops::Range<usize>| move |error: CaptureError| bad(span.start, error.to_string());
    if let Some(name) = manifest.name {
        info.name = name;
    }
    if let Some(word) = manifest.transfer {
        let transfer = word.get_ref().parse().map_err(at(word.span()))?;
        if info.format == ImageFormat::Exr && transfer != crate::Transfer::Linear {
            let reason = format!("its images are linear, so transfer cannot be `{transfer}`; write \"linear\"");
            return Err(bad(word.span().start, reason));
        }
        info.transfer = transfer;
    }
    if let Some(word) = manifest.cosine {
        info.cosine = word.get_ref().parse().map_err(at(word.span()))?;
    }
    if let Some(scale) = manifest.scale {
        info.scale = *scale.get_ref() as f32;
        if !(info.scale > 0.0 && info.scale.is_finite()) {
            return Err(bad(scale.span().start, "scale must be a positive number".into()));
        }
    }
    if let Some(word) = manifest.side {
        info.side = word.get_ref().parse().map_err(at(word.span()))?;
    }
    if let Some(size) = manifest.size_mm {
        let positive = |value: &f64| *value > 0.0 && (*value as f32).is_finite();
        match size.get_ref().as_slice() {
            [width, height] if positive(width) && positive(height) => {
                info.size_mm = Some([*width as f32, *height as f32]);
            }
            _ => {
                let reason = "size_mm must be two positive numbers, width and height in millimetres";
                return Err(bad(size.span().start, reason.into()));
            }
        }
    }
    if let Some(provenance) = manifest.provenance {
        info.provenance = provenance;
    }
    Ok(())
}

/// Returns the text of the manifest of `info`.
pub(crate) fn to_text(info: &CaptureInfo) -> Result<String, String> {
    let word = |value: String| Some(toml::Spanned::new(0..0, value));
    // Through the decimal form, so that 0.1 is written as 0.1 and not as the double nearest to it.
    let number = |value: f32| value.to_string().parse::<f64>().unwrap_or(f64::from(value));
    let manifest = Manifest {
        name: Some(info.name.clone()),
        transfer: word(info.transfer.to_string()),
        cosine: word(info.cosine.to_string()),
        scale: Some(toml::Spanned::new(0..0, number(info.scale))),
        side: word(info.side.to_string()),
        size_mm: info.size_mm.map(|size| toml::Spanned::new(0..0, size.map(number).to_vec())),
        incomplete: (!info.missing.is_empty()).then_some(true),
        rows: None,
        rectified: None,
        black: None,
        flat: None,
        mask: None,
        saturation: None,
        views: None,
        lights: None,
        wavelengths_nm: None,
        provenance: (!info.provenance.is_empty()).then(|| info.provenance.clone()),
    };
    let body = toml::to_string(&manifest).map_err(|error| error.to_string())?;
    Ok(format!("# What the file names cannot say about this capture.\n{body}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cosine, DirectionSet, Side, Transfer};

    fn info() -> CaptureInfo {
        let set = DirectionSet::bonn81();
        CaptureInfo::new("default", 4, 4, set.clone(), set, ImageFormat::Png)
    }

    #[test]
    fn a_written_manifest_is_read_back_whole() {
        let full = CaptureInfo {
            transfer: Transfer::Gamma(2.2),
            cosine: Cosine::Excluded,
            scale: 0.1,
            side: Side::TransmissionBack,
            size_mm: Some([20.0, 12.5]),
            name: "a \"leaf\"".into(),
            provenance: "made\nup".into(),
            ..info()
        };
        let text = to_text(&full).unwrap();
        assert!(text.contains("scale = 0.1\n"), "{text}");
        let mut read = info();
        apply(&text, "capture.toml", &mut read).unwrap();
        assert_eq!(read, full);
        assert_ne!(read, info());
    }

    #[test]
    fn an_absent_key_keeps_its_default() {
        let mut read = info();
        apply("name = \"x\"", "capture.toml", &mut read).unwrap();
        assert_eq!(read, CaptureInfo { name: "x".into(), ..info() });
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        for (text, line, part) in [
            ("name = \"x\"\ntransfer = \"rec709\"", 2, "rec709"),
            ("name = \"x\"\n\ncosine = \"maybe\"", 3, "maybe"),
            ("scale = 0", 1, "positive"),
            ("scale = nan", 1, "positive"),
            ("scale = \"big\"", 1, ""),
            ("side = \"left\"", 1, "left"),
            ("size_mm = [1]", 1, "two positive"),
            ("size_mm = [1, -1]", 1, "two positive"),
            ("# a\nnam = \"x\"", 2, "nam"),
            ("# a\n\nname = ", 3, ""),
        ] {
            match apply(text, "d/capture.toml", &mut info()) {
                Err(error @ CaptureError::BadManifest { line: found, .. }) => {
                    let message = error.to_string();
                    assert_eq!(found, line, "{text:?}: {message}");
                    assert!(message.contains(part) && message.contains("d/capture.toml"), "{message}");
                    assert!(!message.contains('\n'), "{message}");
                }
                other => panic!("{text:?}: {other:?}"),
            }
        }
    }

    #[test]
    fn wavelengths_are_read_in_the_order_of_the_files() {
        let read = |text: &str| reading(text, "d/capture.toml").map(|reading| reading.wavelengths_nm);
        assert_eq!(read("wavelengths_nm = [650, 450.5, 550]").unwrap(), [650.0, 450.5, 550.0]);
        assert!(read("name = \"x\"").unwrap().is_empty());
        let many: Vec<String> = (0..=MAX_BANDS).map(|i| (400 + i).to_string()).collect();
        for (list, part) in [
            (String::new(), "1 to 256"),
            (many.join(", "), "1 to 256"),
            ("450, 0.55".into(), "has 0.55"),
            ("450, nan".into(), "has NaN"),
            ("450, 650, 450".into(), "has 450 twice"),
        ] {
            let message = read(&format!("# a\nwavelengths_nm = [{list}]")).unwrap_err().to_string();
            assert!(message.contains(part) && message.contains("capture.toml line 2"), "{message}");
        }
    }

    #[test]
    fn an_exr_capture_cannot_have_a_curve() {
        let mut exr = info().in_format(ImageFormat::Exr);
        assert!(apply("transfer = \"srgb\"", "capture.toml", &mut exr).is_err());
        apply("transfer = \"linear\"", "capture.toml", &mut exr).unwrap();
    }
}
