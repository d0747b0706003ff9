//! Orders images with their angles as a grid of views x lights.

use std::collections::HashMap;

use crate::direction::{Direction, DirectionSet, MAX_DIRECTIONS};
use crate::error::CaptureError;
use crate::images::file_format::FileFormat;
use crate::images::homography::Homography;
use crate::layout::source::Source;

/// Pairs that views and lights of an incomplete capture make for each image, at most.
const MAX_PAIRS_AN_IMAGE: usize = 200;

/// An image of a source, with its pair of directions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GridImage {
    /// Index of the file in the source.
    pub file: usize,
    pub light: Direction,
    pub view: Direction,
    pub format: FileFormat,
    /// Exposure relative to the capture's other images, above 0; 1 where none is told.
    pub exposure: f32,
    /// Map from texels to the image's pixels, where it is to be rectified.
    pub homography: Option<Homography>,
}

/// A photograph of a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shot {
    /// Index of the file in the source.
    pub file: usize,
    /// Exposure and map, see [`GridImage`].
    pub exposure: f32,
    pub homography: Option<Homography>,
}

/// Sets of views and lights that images form.
#[derive(Debug)]
pub(crate) struct Grid {
    pub views: DirectionSet,
    pub lights: DirectionSet,
    pub format: FileFormat,
    /// Photographs of each pair, `view * lights + light`, the shortest exposure first; none for a pair without an image.
    pub shots: Vec<Vec<Shot>>,
}

/// Gives the images of a capture whose directions differ from view to view those of `views` and `lights` that are nearest. Of
/// poses that come to the same pair the nearest stays, with all of its exposures. Returns the largest angle in degrees by which a
/// direction was moved, and how many images were left out.
pub(crate) fn snap(
    images: &mut Vec<GridImage>,
    views: Option<&DirectionSet>,
    lights: Option<&DirectionSet>,
) -> (f64, usize) {
    let nearest = |direction: Direction, set: Option<&DirectionSet>| {
        let Some(set) = set else { return (direction, 0.0) };
        let angles = set.directions().iter().map(|other| (*other, direction.angle_deg(*other)));
        angles.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((direction, 0.0))
    };
    let pair = |image: &GridImage| [image.view.bits(), image.light.bits()];
    // Angle, pair that the image counts as, pose.
    let moved: Vec<(f64, GridImage, _)> = images
        .iter()
        .map(|image| {
            let ((view, by_view), (light, by_light)) = (nearest(image.view, views), nearest(image.light, lights));
            (f64::max(by_view, by_light), GridImage { view, light, ..*image }, pair(image))
        })
        .collect();
    let mut best = HashMap::new();
    for (by, image, pose) in &moved {
        let kept = best.entry(pair(image)).or_insert((*by, *pose));
        if by < &kept.0 {
            *kept = (*by, *pose);
        }
    }
    let kept: Vec<_> = moved.into_iter().filter(|(_, image, pose)| best[&pair(image)].1 == *pose).collect();
    let (largest, before) = (kept.iter().fold(0.0f64, |most, (by, ..)| most.max(*by)), images.len());
    *images = kept.into_iter().map(|(_, image, _)| image).collect();
    (largest, before - images.len())
}

/// Orders `images`, at least one, as a grid. `missing_name` names the image that a pair lacks, from the grid (without
/// files), the view and the light; that is an error unless the capture may be `incomplete`.
pub(crate) fn grid_of(
    source: &Source,
    images: &[GridImage],
    incomplete: bool,
    missing_name: &dyn Fn(&Grid, usize, usize) -> String,
) -> Result<Grid, CaptureError> {
    let root = source.root().display().to_string();
    // Two files of one pair, which two formats of one image are, too.
    let mut shots_of_pair: HashMap<_, Vec<Shot>> = HashMap::with_capacity(images.len());
    for image in images {
        let shots = shots_of_pair.entry([image.light.bits(), image.view.bits()]).or_default();
        if let Some(other) = shots.iter().find(|shot| shot.exposure == image.exposure) {
            return Err(CaptureError::DoubledPair {
                first: source.shown(other.file),
                second: source.shown(image.file),
            });
        }
        shots.push(Shot { file: image.file, exposure: image.exposure, homography: image.homography });
    }
    shots_of_pair.values_mut().for_each(|shots| shots.sort_by(|a, b| a.exposure.total_cmp(&b.exposure)));
    let format = images[0].format;
    if let Some(other) = images.iter().find(|image| image.format != format) {
        let (first, second) = (source.shown(images[0].file), source.shown(other.file));
        return Err(CaptureError::MixedFormats { first, second });
    }

    let distinct = |directions: &mut dyn Iterator<Item = Direction>| {
        let by_key: HashMap<_, _> = directions.map(|d| (d.bits(), d)).collect();
        if by_key.len() > MAX_DIRECTIONS {
            let reason = format!("{root} names {} directions; at most {MAX_DIRECTIONS} are allowed", by_key.len());
            return Err(CaptureError::BadDirections { reason });
        }
        DirectionSet::new(by_key.into_values().collect())
    };
    let views = distinct(&mut images.iter().map(|image| image.view))?;
    let lights = distinct(&mut images.iter().map(|image| image.light))?;

    let mut grid = Grid { views, lights, format, shots: Vec::new() };
    let (view_count, light_count) = (grid.views.len(), grid.lights.len());
    let expected_count = view_count * light_count;
    let missing = expected_count - shots_of_pair.len();
    if incomplete && expected_count > MAX_PAIRS_AN_IMAGE * images.len() {
        return Err(CaptureError::TooSparse {
            path: root,
            images: images.len(),
            views: view_count,
            lights: light_count,
        });
    }
    let pairs = || (0..view_count).flat_map(|view| (0..light_count).map(move |light| (view, light)));
    let shots_of = |(view, light): (usize, usize)| {
        shots_of_pair.get(&[grid.lights.directions()[light].bits(), grid.views.directions()[view].bits()]).cloned()
    };
    if missing > 0 && !incomplete {
        let (view, light) = pairs().find(|&pair| shots_of(pair).is_none()).unwrap_or((0, 0));
        return Err(CaptureError::MissingPair {
            path: root,
            expected: missing_name(&grid, view, light),
            missing,
            expected_count,
            views: view_count,
            lights: light_count,
        });
    }
    let shots = pairs().map(|pair| shots_of(pair).unwrap_or_default()).collect();
    grid.shots = shots;
    Ok(grid)
}
