//! Bonn's layout: file names that carry the angles, and finding the product grid in them.
//!
//! `tvTTT_pvPPP/NNNNN tlTTT plPPP tvTTT pvPPP.EXT`: angles in degrees, three digits before the
//! point (`tl023.5`), NNNNN = light * views + view. The number is written but never trusted when
//! reading: the angles decide.

use std::collections::HashMap;

use crate::direction::{Direction, DirectionSet, MAX_DIRECTIONS, angle_name};
use crate::error::CaptureError;
use crate::info::ImageFormat;
use crate::source::{Source, folders_of};

/// A capture's grid and the source's file of each pair.
#[derive(Debug)]
pub(crate) struct Layout {
    pub views: DirectionSet,
    pub lights: DirectionSet,
    pub format: ImageFormat,
    /// File of pair `view * lights + light`.
    pub files: Vec<usize>,
}

/// Name of the folder of a view, `tvTTT_pvPPP`.
pub(crate) fn folder_name(view: Direction) -> String {
    format!("tv{}_pv{}", angle_name(view.theta_deg), angle_name(view.phi_deg))
}

/// Name of an image below its folder.
pub(crate) fn file_name(
    views: &DirectionSet,
    lights: &DirectionSet,
    view: usize,
    light: usize,
    extension: &str,
) -> String {
    let (v, l) = (views.directions()[view], lights.directions()[light]);
    format!(
        "{:05} tl{} pl{} tv{} pv{}.{extension}",
        light * views.len() + view,
        angle_name(l.theta_deg),
        angle_name(l.phi_deg),
        angle_name(v.theta_deg),
        angle_name(v.phi_deg),
    )
}

/// Whether reading a capture would take a file of this name for one of its images.
pub(crate) fn is_image_name(name: &str) -> bool {
    parse_name(name).is_some()
}

/// The light and view that a file name states, and its format; `None` for other files.
fn parse_name(path: &str) -> Option<(Direction, Direction, ImageFormat)> {
    let name = path.rsplit('/').next()?;
    let (stem, extension) = name.rsplit_once('.')?;
    let format = ImageFormat::from_extension(extension)?;
    // Light theta, light phi, view theta, view phi.
    let mut angles = [None; 4];
    for word in stem.split([' ', '_']) {
        let Some(slot) = ["tl", "pl", "tv", "pv"].iter().position(|prefix| word.starts_with(prefix)) else { continue };
        let Some(angle) = parse_angle(&word[2..]) else { continue };
        if angles[slot].replace(angle).is_some() {
            return None;
        }
    }
    let [Some(tl), Some(pl), Some(tv), Some(pv)] = angles else { return None };
    (tl <= 180.0 && tv <= 180.0).then(|| (Direction::new(tl, pl), Direction::new(tv, pv), format))
}

/// Digits with at most one point among them; no sign, no exponent.
fn parse_angle(text: &str) -> Option<f64> {
    let plain = text.starts_with(|c: char| c.is_ascii_digit())
        && text.len() <= 24
        && text.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
    if plain { text.parse().ok() } else { None }
}

/// Finds the product grid of views and lights in the names of `source`.
pub(crate) fn find_layout(source: &Source) -> Result<Layout, CaptureError> {
    let root = source.root().display().to_string();
    if source.names().is_empty() {
        return Err(CaptureError::Empty { path: root });
    }
    let found: Vec<(usize, Direction, Direction, ImageFormat)> = source
        .names()
        .iter()
        .enumerate()
        .filter_map(|(file, name)| parse_name(name).map(|(light, view, format)| (file, light, view, format)))
        .collect();
    let Some(&(first, _, _, format)) = found.first() else {
        return Err(CaptureError::NoImages { path: root, files: source.names().len() });
    };

    // Two files of one pair, which two formats of one image are, too.
    let key = |d: Direction| (d.theta_deg.to_bits(), d.phi_deg.to_bits());
    let mut file_of_pair = HashMap::with_capacity(found.len());
    for &(file, light, view, _) in &found {
        if let Some(other) = file_of_pair.insert((key(light), key(view)), file) {
            return Err(CaptureError::DoubledPair { first: source.shown(other), second: source.shown(file) });
        }
    }
    if let Some(&(other, ..)) = found.iter().find(|&&(.., f)| f != format) {
        return Err(CaptureError::MixedFormats { first: source.shown(first), second: source.shown(other) });
    }

    let distinct = |directions: &mut dyn Iterator<Item = Direction>| {
        let by_key: HashMap<_, _> = directions.map(|d| (key(d), d)).collect();
        if by_key.len() > MAX_DIRECTIONS {
            let reason = format!("{root} names {} directions; at most {MAX_DIRECTIONS} are allowed", by_key.len());
            return Err(CaptureError::BadDirections { reason });
        }
        DirectionSet::new(by_key.into_values().collect())
    };
    let views = distinct(&mut found.iter().map(|&(_, _, view, _)| view))?;
    let lights = distinct(&mut found.iter().map(|&(_, light, _, _)| light))?;

    let expected_count = views.len() * lights.len();
    let missing = expected_count - found.len();
    if missing > 0 {
        let (view, light) = (0..views.len())
            .flat_map(|view| (0..lights.len()).map(move |light| (view, light)))
            .find(|&(view, light)| {
                !file_of_pair.contains_key(&(key(lights.directions()[light]), key(views.directions()[view])))
            })
            .unwrap_or((0, 0));
        let (_, extension) = source.names()[first].rsplit_once('.').unwrap_or(("", format.extension()));
        let name = file_name(&views, &lights, view, light, extension);
        let nested = folders_of(found.iter().map(|&(file, ..)| source.names()[file].as_str())).len() > 1;
        let expected = if nested { format!("{}/{name}", folder_name(views.directions()[view])) } else { name };
        return Err(CaptureError::MissingPair {
            path: root,
            expected,
            missing,
            expected_count,
            views: views.len(),
            lights: lights.len(),
        });
    }
    let files = views
        .directions()
        .iter()
        .flat_map(|&view| lights.directions().iter().map(move |&light| (light, view)))
        .map(|(light, view)| file_of_pair[&(key(light), key(view))])
        .collect();
    Ok(Layout { views, lights, format, files })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_written_as_bonn_does_and_read_back() {
        let set = DirectionSet::bonn81();
        let name = file_name(&set, &set, 0, 1, "jpg");
        assert_eq!(name, "00081 tl015 pl000 tv000 pv000.jpg");
        assert_eq!(file_name(&set, &set, 8, 0, "jpg"), "00008 tl000 pl000 tv030 pv030.jpg");
        assert_eq!(folder_name(set.directions()[80]), "tv075_pv345");
        for directions in [DirectionSet::dome151(), DirectionSet::random(40, 2).unwrap()] {
            for (i, &view) in directions.directions().iter().enumerate() {
                let light = (i * 7) % directions.len();
                let name = format!("a/b/{}", file_name(&directions, &directions, i, light, "EXR"));
                assert_eq!(parse_name(&name), Some((directions.directions()[light], view, ImageFormat::Exr)));
            }
        }
    }

    #[test]
    fn other_files_are_passed_over() {
        for name in [
            "capture.toml",
            "00000 tl000 pl000 tv000.png",
            "00000 tl000 pl000 tv000 pv000.txt",
            "00000 tl-15 pl000 tv000 pv000.png",
            "00000 tl1e1 pl000 tv000 pv000.png",
            "00000 tl000 tl000 pl000 tv000 pv000.png",
            "00000 tl190 pl000 tv000 pv000.png",
            "tl",
        ] {
            assert_eq!(parse_name(name), None, "{name}");
        }
        let spectral_order = parse_name("tv015_pv060_tl030_pl090.exr").unwrap();
        assert_eq!(spectral_order.0, Direction::new(30.0, 90.0));
    }
}
