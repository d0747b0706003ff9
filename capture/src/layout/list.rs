//! Lists of images with their directions: a table in text form beside images of any names.
//!
//! The first line names the columns; `file`, `theta_v`, `phi_v`, `theta_l` and `phi_l` must be among them, in any
//! order, angles in degrees. Commas, semicolons or tabs separate values. A value that contains a separator stands in
//! quotes, and a quote in it is doubled. Empty lines and lines that start with `#` are ignored.

use std::collections::{HashMap, HashSet};

use crate::direction::Direction;
use crate::error::CaptureError;
use crate::images::file_format::FileFormat;
use crate::layout::grid::{Grid, GridImage};
use crate::layout::source::{Source, safe_name};

/// Extension of a list's name.
pub(crate) const LIST_EXTENSION: &str = "csv";

/// Largest list that is read, in bytes: 300,000 long lines.
const MAX_LIST_BYTES: u64 = 32 << 20;

/// The columns that a list must have.
const COLUMNS: [&str; 5] = ["file", "theta_v", "phi_v", "theta_l", "phi_l"];

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
    /// Position of each of [`COLUMNS`].
    columns: [usize; 5],
    /// Line of the columns' names, from 1.
    heading: usize,
}

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
    let separator = [',', ';', '\t'].into_iter().max_by_key(|&c| line.matches(c).count()).unwrap_or(',');
    let Ok(names) = fields(line, separator) else { return Ok(Err("its first line does not name columns".into())) };
    let mut columns = [0; 5];
    for (place, column) in columns.iter_mut().zip(COLUMNS) {
        let mut at = names.iter().enumerate().filter(|(_, name)| name.eq_ignore_ascii_case(column)).map(|(at, _)| at);
        match (at.next(), at.next()) {
            (Some(at), None) => *place = at,
            (None, _) => return Ok(Err(format!("it has no column `{column}`"))),
            (Some(_), Some(_)) => return Ok(Err(format!("it has the column `{column}` twice"))),
        }
    }
    let folder = source.names()[file].rsplit_once('/').map_or(String::new(), |(folder, _)| format!("{folder}/"));
    Ok(Ok(List { shown, folder, text, separator, columns, heading }))
}

/// Returns the lines that are neither empty nor comments, each with its number from 1.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let numbered = text.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    numbered.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

fn images_of(source: &Source, list: &List) -> Result<Vec<GridImage>, CaptureError> {
    let by_name: HashMap<&str, usize> = source.names().iter().map(String::as_str).zip(0..).collect();
    let mut listed = HashSet::new();
    let mut images = Vec::new();
    for (line, text) in lines(&list.text).filter(|&(line, _)| line > list.heading) {
        let bad = |reason: String| CaptureError::BadList { path: list.shown.clone(), line, reason };
        let fields = fields(text, list.separator).map_err(|reason| bad(reason.into()))?;
        let field = |column: usize| {
            let place = list.columns[column];
            fields.get(place).map(String::as_str).ok_or_else(|| bad(format!("it has no `{}`", COLUMNS[column])))
        };
        let angle = |column: usize| {
            let text = field(column)?;
            let degrees = text.parse::<f64>().ok().filter(|angle| angle.is_finite() && angle.abs() <= 1e4);
            let degrees =
                degrees.ok_or_else(|| bad(format!("`{}` is `{text}`, not an angle in degrees", COLUMNS[column])))?;
            Ok::<f64, CaptureError>((degrees * PARTS_OF_A_DEGREE).round() / PARTS_OF_A_DEGREE)
        };
        let theta = |column: usize| match angle(column)? {
            theta if (0.0..=180.0).contains(&theta) => Ok(theta),
            theta => Err(bad(format!("`{}` is {theta}; it goes from 0 to 180 degrees", COLUMNS[column]))),
        };
        let written = field(0)?;
        let name = safe_name(written).map(|name| format!("{}{name}", list.folder));
        let file = name
            .and_then(|name| by_name.get(name.as_str()).copied())
            .ok_or_else(|| bad(format!("there is no file `{}` beside it", written.escape_debug())))?;
        if !listed.insert(file) {
            return Err(bad(format!("`{written}` stands in it twice")));
        }
        let extension = written.rsplit_once('.').map_or("", |(_, extension)| extension);
        let format = FileFormat::from_extension(extension)
            .ok_or_else(|| bad(format!("`{written}` is none of png, jpg, exr or hdr")))?;
        let (view, light) = (Direction::new(theta(1)?, angle(2)?), Direction::new(theta(3)?, angle(4)?));
        images.push(GridImage { file, light, view, format });
    }
    if images.is_empty() {
        let reason = "no image follows the names of the columns".to_string();
        return Err(CaptureError::BadList { path: list.shown.clone(), line: list.heading, reason });
    }
    Ok(images)
}

/// Returns the values of a line.
fn fields(line: &str, separator: char) -> Result<Vec<String>, &'static str> {
    let mut fields = Vec::new();
    let mut rest = line;
    loop {
        rest = rest.trim_start_matches(' ');
        if let Some(quoted) = rest.strip_prefix('"') {
            let mut value = String::new();
            let mut characters = quoted.char_indices();
            let end = loop {
                match characters.next() {
                    Some((at, '"')) => match quoted[at + 1..].starts_with('"') {
                        true => {
                            value.push('"');
                            characters.next();
                        }
                        false => break at + 1,
                    },
                    Some((_, other)) => value.push(other),
                    None => return Err("a quote in it is not closed"),
                }
            };
            fields.push(value);
            rest = quoted[end..].trim_start_matches(' ');
            match rest.strip_prefix(separator) {
                Some(tail) => rest = tail,
                None if rest.is_empty() => return Ok(fields),
                None => return Err("something stands behind a closing quote"),
            }
        } else {
            match rest.split_once(separator) {
                Some((value, tail)) => {
                    fields.push(value.trim().to_string());
                    rest = tail;
                }
                None => {
                    fields.push(rest.trim().to_string());
                    return Ok(fields);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_split_at_its_separators_and_quotes_hold_together() {
        assert_eq!(fields("a.png, 30 ,-90,0,0", ',').unwrap(), ["a.png", "30", "-90", "0", "0"]);
        assert_eq!(fields("\"a, \"\"b\"\".png\" ;30;1", ';').unwrap(), ["a, \"b\".png", "30", "1"]);
        assert_eq!(fields("a\t\tb", '\t').unwrap(), ["a", "", "b"]);
        assert_eq!(fields("a,", ',').unwrap(), ["a", ""]);
        for bad in ["\"a", "\"a\"b,c"] {
            assert!(fields(bad, ',').is_err(), "{bad}");
        }
    }
}
