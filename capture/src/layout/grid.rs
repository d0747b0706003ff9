//! Orders images with their angles as a grid of views x lights.

use std::collections::HashMap;

use crate::direction::{Direction, DirectionSet, MAX_DIRECTIONS};
use crate::error::CaptureError;
use crate::images::file_format::FileFormat;
use crate::layout::source::Source;

/// An image of a source, with its pair of directions.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GridImage {
    /// Index of the file in the source.
    pub file: usize,
    pub light: Direction,
    pub view: Direction,
    pub format: FileFormat,
}

/// Sets of views and lights that images form.
#[derive(Debug)]
pub(crate) struct Grid {
    pub views: DirectionSet,
    pub lights: DirectionSet,
    pub format: FileFormat,
    /// Index of the file of each pair, `view * lights + light`; `None` for a pair without an image.
    pub files: Vec<Option<usize>>,
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
    let key = |d: Direction| (d.theta_deg.to_bits(), d.phi_deg.to_bits());
    let mut file_of_pair = HashMap::with_capacity(images.len());
    for image in images {
        if let Some(other) = file_of_pair.insert((key(image.light), key(image.view)), image.file) {
            return Err(CaptureError::DoubledPair { first: source.shown(other), second: source.shown(image.file) });
        }
    }
    let format = images[0].format;
    if let Some(other) = images.iter().find(|image| image.format != format) {
        let (first, second) = (source.shown(images[0].file), source.shown(other.file));
        return Err(CaptureError::MixedFormats { first, second });
    }

    let distinct = |directions: &mut dyn Iterator<Item = Direction>| {
        let by_key: HashMap<_, _> = directions.map(|d| (key(d), d)).collect();
        if by_key.len() > MAX_DIRECTIONS {
            let reason = format!("{root} names {} directions; at most {MAX_DIRECTIONS} are allowed", by_key.len());
            return Err(CaptureError::BadDirections { reason });
        }
        DirectionSet::new(by_key.into_values().collect())
    };
    let views = distinct(&mut images.iter().map(|image| image.view))?;
    let lights = distinct(&mut images.iter().map(|image| image.light))?;

    let mut grid = Grid { views, lights, format, files: Vec::new() };
    let (view_count, light_count) = (grid.views.len(), grid.lights.len());
    let expected_count = view_count * light_count;
    let missing = expected_count - images.len();
    let pairs = || (0..view_count).flat_map(|view| (0..light_count).map(move |light| (view, light)));
    let file_of = |(view, light): (usize, usize)| {
        file_of_pair.get(&(key(grid.lights.directions()[light]), key(grid.views.directions()[view]))).copied()
    };
    if missing > 0 && !incomplete {
        let (view, light) = pairs().find(|&pair| file_of(pair).is_none()).unwrap_or((0, 0));
        return Err(CaptureError::MissingPair {
            path: root,
            expected: missing_name(&grid, view, light),
            missing,
            expected_count,
            views: view_count,
            lights: light_count,
        });
    }
    let files = pairs().map(file_of).collect();
    grid.files = files;
    Ok(grid)
}
