//! Parsers of the values of options. Each returns a sentence that says which values are allowed.

use btf_runtime::LeafMode;

pub(super) fn parse_leaf_mode(text: &str) -> Result<LeafMode, String> {
    LeafMode::ALL
        .into_iter()
        .find(|mode| mode.name() == text)
        .ok_or_else(|| format!("a mode of live leaves is one of {}", LeafMode::ALL.map(LeafMode::name).join(", ")))
}

pub(super) fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    sides
        .filter(|sides: &[u32; 2]| sides.iter().all(|side| (1..=btf_viewer::MAX_SIDE).contains(side)))
        .ok_or_else(|| format!("a size is WIDTHxHEIGHT, as in 512x512, each 1 to {}", btf_viewer::MAX_SIDE))
}

pub(super) fn parse_scale(text: &str) -> Result<[f32; 2], String> {
    let scale = match text.split_once('x') {
        Some((u, v)) => u.parse().ok().zip(v.parse().ok()).map(|(u, v)| [u, v]),
        None => text.parse().ok().map(|both| [both, both]),
    };
    scale
        .filter(|scale: &[f32; 2]| scale.iter().all(|x| x.is_finite() && *x > 0.0))
        .ok_or_else(|| "a scale is a number above 0, as in 2, or two, as in 2x3".into())
}

pub(super) fn parse_positive(text: &str) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|x: &f32| x.is_finite() && *x > 0.0)
        .ok_or_else(|| "it is a number above 0, as in 0.5".into())
}

/// Where meshes pass into volumes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Transition {
    /// Where it costs least, as measured.
    Auto,
    /// Where leaves are so wide, pixels.
    Pixels(f32),
}

pub(super) fn parse_transition(text: &str) -> Result<Transition, String> {
    if text == "auto" {
        return Ok(Transition::Auto);
    }
    let [least, most] = btf_viewer::TRANSITION_PIXELS;
    text.parse().ok().filter(|pixels| (least..=most).contains(pixels)).map(Transition::Pixels).ok_or_else(|| {
        format!("it is a number of pixels from {least} (meshes alone) to {most} (volumes alone), or auto")
    })
}

pub(super) fn parse_seconds(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| "it is a number of seconds, as in 2.5".into())
}

pub(super) fn parse_wind(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|x: &f32| (0.0..=60.0).contains(x)).ok_or_else(|| "it is a number from 0 to 60".into())
}

pub(super) fn parse_scale_of_heights(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|x: &f32| (0.0..=100.0).contains(x)).ok_or_else(|| "it is a number from 0 to 100".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transition_is_a_width_or_measured() {
        assert_eq!(parse_transition("0.5"), Ok(Transition::Pixels(0.5)));
        assert_eq!(parse_transition("auto"), Ok(Transition::Auto));
        assert!(["0", "-1", "nan", "2000", "AUTO", ""].iter().all(|text| parse_transition(text).is_err()));
    }

    #[test]
    fn sizes_and_scales_are_checked() {
        assert_eq!(parse_size("640x480"), Ok([640, 480]));
        assert!(["640", "0x5", "5x", "axb", "99999x2"].iter().all(|text| parse_size(text).is_err()));
        assert_eq!(parse_scale("2"), Ok([2.0, 2.0]));
        assert_eq!(parse_scale("2x0.5"), Ok([2.0, 0.5]));
        assert!(["0", "-1", "nan", "2x", "x"].iter().all(|text| parse_scale(text).is_err()));
    }
}
