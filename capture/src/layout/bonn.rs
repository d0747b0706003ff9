//! Bonn's layout, in which file names carry the angles: UBO2003, ATRIUM, and with the view first the spectral sets.
//!
//! `tvTTT_pvPPP/NNNNN tlTTT plPPP tvTTT pvPPP.EXT`: angles in degrees, three digits before the
//! point (`tl023.5`), NNNNN = light * views + view. The number is written but never trusted when
//! reading: the angles decide, in whatever order the name has them.

use crate::direction::{Direction, DirectionSet, angle_name};
use crate::images::file_format::FileFormat;
use crate::layout::grid::{Grid, GridImage};
use crate::layout::source::{Source, folders_of};

/// Returns the name of the folder of a view, `tvTTT_pvPPP`.
pub(crate) fn folder_name(view: Direction) -> String {
    format!("tv{}_pv{}", angle_name(view.theta_deg), angle_name(view.phi_deg))
}

/// Returns the name of an image below its folder.
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

/// Returns whether a reader of captures would take a file of this name for an image.
pub(crate) fn is_image_name(name: &str) -> bool {
    parse_name(name).is_some()
}

/// Returns the light and view that a file name states, and its format; `None` for other files.
fn parse_name(path: &str) -> Option<(Direction, Direction, FileFormat)> {
    let name = path.rsplit('/').next()?;
    let (stem, extension) = name.rsplit_once('.')?;
    let format = FileFormat::from_extension(extension)?;
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

/// Parses an angle of digits with at most one point among them; signs and exponents are refused.
fn parse_angle(text: &str) -> Option<f64> {
    let plain = text.starts_with(|c: char| c.is_ascii_digit())
        && text.len() <= 24
        && text.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
    if plain { text.parse().ok() } else { None }
}

/// Returns the images whose names in `source` carry angles; empty if there are none.
pub(crate) fn find_images(source: &Source) -> Vec<GridImage> {
    let names = source.names().iter().enumerate();
    names
        .filter_map(|(file, name)| {
            let (light, view, format) = parse_name(name)?;
            Some(GridImage { file, light, view, format, exposure: 1.0, homography: None })
        })
        .collect()
}

/// Returns the name that the image of a pair would have beside `images`.
pub(crate) fn missing_name(source: &Source, images: &[GridImage], grid: &Grid, view: usize, light: usize) -> String {
    let names = || images.iter().map(|image| source.names()[image.file].as_str());
    let extension = names().next().and_then(|name| name.rsplit_once('.')).map_or("", |(_, extension)| extension);
    let name = file_name(&grid.views, &grid.lights, view, light, extension);
    let nested = folders_of(names()).len() > 1;
    if nested { format!("{}/{name}", folder_name(grid.views.directions()[view])) } else { name }
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
                assert_eq!(parse_name(&name), Some((directions.directions()[light], view, FileFormat::Exr)));
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
