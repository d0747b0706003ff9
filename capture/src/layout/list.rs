//! Lists of images with their directions: a table in text form beside images of any names.
//!
//! The first line names the columns. `file` must be among them, and for view and light either the angles `theta_v`, `phi_v`,
//! `theta_l` and `phi_l` in degrees, or the places `x_v`, `y_v`, `z_v`, `x_l`, `y_l` and `z_l` of camera and lamp about the
//! sample's middle, or their poses, `v11` to `v34` and `l11` to `l34`. `exposure` may be there, and `h11` to `h33`, a map from
//! texels to pixels. Commas, semicolons or tabs separate values. A value that contains a separator stands in quotes, and a quote
//! in it is doubled. Empty lines and lines that start with `#` are ignored.

use std::collections::{HashMap, HashSet};

use crate::delimited::{fields, lines, separator_of};
use crate::direction::Direction;
use crate::error::CaptureError;
use crate::images::file_format::FileFormat;
use crate::layout::grid::{Grid, GridImage};
use crate::layout::source::{Source, safe_name};

/// Extension of a list's name.
pub(crate) const LIST_EXTENSION: &str = "csv";

/// Largest list that is read, in bytes: 300,000 long lines.
const MAX_LIST_BYTES: u64 = 32 << 20;

/// The columns of a list; it has those of each direction's angles, of its place, or of its pose: a 3 x 4 matrix from the frame of the
/// camera or the lamp to the sample's, row by row.
const FILE: &str = "file";
const EXPOSURE: &str = "exposure";
const HOMOGRAPHY: [&str; 9] = ["h11", "h12", "h13", "h21", "h22", "h23", "h31", "h32", "h33"];
const VIEW: [&[&str]; 3] = [
    &["theta_v", "phi_v"],
    &["x_v", "y_v", "z_v"],
    &["v11", "v12", "v13", "v14", "v21", "v22", "v23", "v24", "v31", "v32", "v33", "v34"],
];
const LIGHT: [&[&str]; 3] = [
    &["theta_l", "phi_l"],
    &["x_l", "y_l", "z_l"],
    &["l11", "l12", "l13", "l14", "l21", "l22", "l23", "l24", "l31", "l32", "l33", "l34"],
];

/// Largest cosine between two rows of a pose, and difference of their lengths relative to the longest.
const MAX_SKEW: f64 = 0.02;

/// Angles are rounded to this many parts of a degree, so that 29.9999999 and 30 are one direction.
const PARTS_OF_A_DEGREE: f64 = 1000.0;

/// Text of a list, with its place.
#[derive(Debug)]
struct List {
    /// Path of the list for messages.
    shown: String,
    /// Folder that file names are relative to, empty or with `/` at its end.
    folder: String,
    text: String,
    separator: char,
    file: usize,
    exposure: Option<usize>,
    homography: Option<[usize; 9]>,
    view: Columns,
    light: Columns,
    /// Line of the columns' names, from 1.
    heading: usize,
}

/// Positions and names of the columns of a direction: two angles, three coordinates, or the twelve numbers of a pose.
#[derive(Debug)]
struct Columns(Vec<(usize, &'static str)>);

/// Returns the images of the list in `source`; `None` if there is no list. `name` chooses the list; without it, any
/// file that ends in `.csv` and has the columns is one.
pub(crate) fn find_images(source: &Source, name: Option<&str>) -> Result<Option<Vec<GridImage>>, CaptureError> {
    let is_list = |path: &str| path.rsplit_once('.').is_some_and(|(_, e)| e.eq_ignore_ascii_case(LIST_EXTENSION));
    let mut found: Option<List> = None;
    for file in 0..source.names().len() {
        let path = &source.names()[file];
        if !name.map_or_else(|| is_list(path), |name| name == path) {
            continue;
        }
        match open(source, file)? {
            Ok(list) => {
                if let Some(first) = &found {
                    return Err(CaptureError::TwoLists { first: first.shown.clone(), second: list.shown });
                }
                found = Some(list);
            }
            Err(reason) if name.is_some() => {
                return Err(CaptureError::BadList { path: source.shown(file), line: 1, reason });
            }
            Err(_) => {}
        }
    }
    found.map(|list| images_of(source, &list)).transpose()
}

/// Returns the words of a message for a pair that has no image.
pub(crate) fn missing_name(grid: &Grid, view: usize, light: usize) -> String {
    let (v, l) = (grid.views.directions()[view], grid.lights.directions()[light]);
    format!("theta_v {}, phi_v {}, theta_l {}, phi_l {}", v.theta_deg, v.phi_deg, l.theta_deg, l.phi_deg)
}

/// Reads the heading of file `file`; the inner error says why it is no list.
fn open(source: &Source, file: usize) -> Result<Result<List, String>, CaptureError> {
    let shown = source.shown(file);
    let Ok(text) = String::from_utf8(source.read(file, MAX_LIST_BYTES)?) else {
        return Ok(Err("it is not UTF-8 text".into()));
    };
    let text = text.strip_prefix('\u{FEFF}').map_or(text.clone(), String::from);
    let Some((heading, line)) = lines(&text).next() else { return Ok(Err("it is empty".into())) };
    let separator = separator_of(line);
    let Ok(names) = fields(line, separator) else { return Ok(Err("its first line does not name columns".into())) };
    let find = |column: &str| {
        let mut at = names.iter().enumerate().filter(|(_, name)| name.eq_ignore_ascii_case(column)).map(|(at, _)| at);
        match (at.next(), at.next()) {
            (_, Some(_)) => Err(format!("it has the column `{column}` twice")),
            (at, None) => Ok(at),
        }
    };
    let must = |column: &str| find(column)?.ok_or_else(|| format!("it has no column `{column}`"));
    let direction = |[angles, place, pose]: [&[&'static str]; 3]| {
        let has = |kind: &[&str]| {
            let found: Vec<Option<usize>> = kind.iter().map(|column| find(column)).collect::<Result<_, String>>()?;
            Ok::<_, String>(found.iter().all(Option::is_some))
        };
        let kind = match (find(place[0])?.is_some(), has(pose)?) {
            (true, true) => return Err(format!("it has both `{}` and `{}` for one direction", place[0], pose[0])),
            (true, false) => place,
            (false, true) => pose,
            (false, false) if !has(angles)? && find(pose[0])?.is_some() => pose,
            (false, false) => angles,
        };
        let columns = kind.iter().map(|column| Ok((must(column)?, *column)));
        columns.collect::<Result<_, String>>().map(Columns)
    };
    let map = || -> Result<Option<[usize; 9]>, String> {
        if find(HOMOGRAPHY[0])?.is_none() {
            return Ok(None);
        }
        let mut places = [0; 9];
        for (place, column) in places.iter_mut().zip(HOMOGRAPHY) {
            *place = must(column)?;
        }
        Ok(Some(places))
    };
    let columns = || Ok::<_, String>((must(FILE)?, find(EXPOSURE)?, map()?, direction(VIEW)?, direction(LIGHT)?));
    let (file_at, exposure, homography, view, light) = match columns() {
        Ok(found) => found,
        Err(reason) => return Ok(Err(reason)),
    };
    let folder = source.names()[file].rsplit_once('/').map_or(String::new(), |(folder, _)| format!("{folder}/"));
    Ok(Ok(List { shown, folder, text, separator, file: file_at, exposure, homography, view, light, heading }))
}

fn rounded(degrees: f64) -> f64 {
    (degrees * PARTS_OF_A_DEGREE).round() / PARTS_OF_A_DEGREE
}

fn images_of(source: &Source, list: &List) -> Result<Vec<GridImage>, CaptureError> {
    let by_name: HashMap<&str, usize> = source.names().iter().map(String::as_str).zip(0..).collect();
    let mut listed = HashSet::new();
    let mut images = Vec::new();
    for (line, text) in lines(&list.text).filter(|&(line, _)| line > list.heading) {
        let bad = |reason: String| CaptureError::BadList { path: list.shown.clone(), line, reason };
        let fields = fields(text, list.separator).map_err(|reason| bad(reason.into()))?;
        let field = |place: usize, column: &str| {
            fields.get(place).map(String::as_str).ok_or_else(|| bad(format!("it has no `{column}`")))
        };
        let number = |place: usize, column: &str, what: &str| {
            let text = field(place, column)?;
            let number = text.parse::<f64>().ok().filter(|number| number.is_finite());
            number.ok_or_else(|| bad(format!("`{column}` is `{text}`, not {what}")))
        };
        let direction = |columns: &Columns| match columns.0[..] {
            [(theta_at, theta_name), (phi_at, phi_name)] => {
                let angle = |place, column| match number(place, column, "an angle in degrees")? {
                    degrees if degrees.abs() <= 1e4 => Ok(rounded(degrees)),
                    degrees => Err(bad(format!("`{column}` is `{degrees}`, not an angle in degrees"))),
                };
                match angle(theta_at, theta_name)? {
                    theta if (0.0..=180.0).contains(&theta) => Ok(Direction::new(theta, angle(phi_at, phi_name)?)),
                    theta => Err(bad(format!("`{theta_name}` is {theta}; it goes from 0 to 180 degrees"))),
                }
            }
            _ => {
                let what = if columns.0.len() == 3 { "a length" } else { "a number" };
                let numbers = columns.0.iter().map(|(place, column)| number(*place, column, what));
                let numbers: Vec<f64> = numbers.collect::<Result<_, _>>()?;
                let (first, last) = (columns.0[0].1, columns.0[columns.0.len() - 1].1);
                let [x, y, z] = match numbers[..] {
                    [x, y, z] => [x, y, z],
                    _ => place_of_pose(&numbers).ok_or_else(|| {
                        bad(format!(
                            "`{first}` to `{last}` are no pose: row by row a rotation to the sample's frame and, last in each row, the place"
                        ))
                    })?,
                };
                let length = x.hypot(y).hypot(z);
                if !(length > 0.0 && length.is_finite()) {
                    return Err(bad(format!("`{first}` to `{last}` are no direction")));
                }
                let theta = (z / length).clamp(-1.0, 1.0).acos().to_degrees();
                Ok(Direction::new(rounded(theta), rounded(y.atan2(x).to_degrees())))
            }
        };
        let written = field(list.file, FILE)?;
        let name = safe_name(written).map(|name| format!("{}{name}", list.folder));
        let file = name
            .and_then(|name| by_name.get(name.as_str()).copied())
            .ok_or_else(|| bad(format!("there is no file `{}` beside it", written.escape_debug())))?;
        if !listed.insert(file) {
            return Err(bad(format!("`{written}` stands in it twice")));
        }
        let extension = written.rsplit_once('.').map_or("", |(_, extension)| extension);
        let format = FileFormat::from_extension(extension)
            .ok_or_else(|| bad(format!("`{written}` is none of tif, png, jpg, exr or hdr")))?;
        let (view, light) = (direction(&list.view)?, direction(&list.light)?);
        let exposure = match list.exposure {
            None => 1.0,
            Some(place) => match number(place, EXPOSURE, "a number")? {
                exposure if (1e-9..=1e9).contains(&exposure) => exposure as f32,
                exposure => {
                    return Err(bad(format!("`exposure` is {exposure}; it goes from 1e-9 to 1e9, such as seconds")));
                }
            },
        };
        let homography = match list.homography {
            None => None,
            Some(places) => {
                let mut map = [0.0; 9];
                for ((entry, place), column) in map.iter_mut().zip(places).zip(HOMOGRAPHY) {
                    *entry = number(place, column, "a number")?;
                }
                Some(map)
            }
        };
        images.push(GridImage { file, light, view, format, exposure, homography });
    }
    if images.is_empty() {
        let reason = "no image follows the names of the columns".to_string();
        return Err(CaptureError::BadList { path: list.shown.clone(), line: list.heading, reason });
    }
    Ok(images)
}

/// Returns the place of a pose, a 3 x 4 matrix row by row; `None` where the first three columns are no rotation, up to a scale.
fn place_of_pose(numbers: &[f64]) -> Option<[f64; 3]> {
    let (rows, _) = numbers.as_chunks::<4>();
    let dot = |a: &[f64; 4], b: &[f64; 4]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let lengths: Vec<f64> = rows.iter().map(|row| dot(row, row).sqrt()).collect();
    let longest = lengths.iter().fold(0.0, |longest: f64, length| longest.max(*length));
    let even = lengths.iter().all(|length| longest - length <= MAX_SKEW * longest);
    let square = |a: usize, b: usize| dot(&rows[a], &rows[b]).abs() <= MAX_SKEW * longest * longest;
    // The third row lies along the cross product of the others, not against it.
    let [[a, b, c, _], [d, e, f, _]] = [rows[0], rows[1]];
    let is_right_handed = dot(&[b * f - c * e, c * d - a * f, a * e - b * d, 0.0], &rows[2]) > 0.0;
    let is_square = square(0, 1) && square(0, 2) && square(1, 2);
    let is_rotation = longest > 0.0 && longest.is_finite() && even && is_square && is_right_handed;
    is_rotation.then(|| [rows[0][3], rows[1][3], rows[2][3]])
}
