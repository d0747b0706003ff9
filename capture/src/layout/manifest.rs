//! Reads and writes `capture.toml`, which holds what the file names cannot say about a capture.

use serde::{Deserialize, Serialize};

use crate::error::CaptureError;
use crate::info::{CaptureInfo, ImageFormat};

/// Name of the manifest, beside the view folders.
pub(crate) const MANIFEST_NAME: &str = "capture.toml";

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
    #[serde(skip_serializing_if = "Option::is_none")]
    provenance: Option<String>,
}

/// Returns whether the manifest in `text` says that pairs may have no image; `false` where it cannot be read.
pub(crate) fn is_incomplete(text: &str) -> bool {
    toml::from_str::<Manifest>(text).is_ok_and(|manifest| manifest.incomplete == Some(true))
}

/// Applies the keys in `text` to `info`; other fields keep their values. `path` is for messages.
pub(crate) fn apply(text: &str, path: &str, info: &mut CaptureInfo) -> Result<(), CaptureError> {
    let bad = |offset: usize, reason: String| {
        let line = text.as_bytes()[..offset.min(text.len())].iter().filter(|&&byte| byte == b'\n').count() + 1;
        let reason = reason.split_whitespace().collect::<Vec<_>>().join(" ");
        CaptureError::BadManifest { path: path.into(), line, reason }
    };
    let manifest: Manifest =
        toml::from_str(text).map_err(|error| bad(error.span().map_or(0, |span| span.start), error.message().into()))?;
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
    fn an_exr_capture_cannot_have_a_curve() {
        let mut exr = info().in_format(ImageFormat::Exr);
        assert!(apply("transfer = \"srgb\"", "capture.toml", &mut exr).is_err());
        apply("transfer = \"linear\"", "capture.toml", &mut exr).unwrap();
    }
}
