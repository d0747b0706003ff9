//! The lines of a vector's values, and the folder of the vectors.

use btf_runtime::{DecodeOptions, Interpolation, Query, ResidentFile, evaluate};
use std::path::{Path, PathBuf};

/// Returns the folder of the vectors.
pub fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/vectors/v1")
}

/// A line of a values file: the query and the colour.
pub struct Line {
    pub interpolation: Interpolation,
    pub level: u32,
    pub query: Query,
    pub value: [f32; 3],
}

impl Line {
    /// Returns the line as it stands in the file.
    pub fn text(&self) -> String {
        let Query { uv, wi, wo } = self.query;
        let join = |numbers: &[f32]| numbers.iter().map(f32::to_string).collect::<Vec<_>>().join(" ");
        let name = self.interpolation.name();
        format!("{name} {} {} {} {} = {}\n", self.level, join(&uv), join(&wi), join(&wo), join(&self.value))
    }

    /// Parses a line of [`Line::text`], without the end of the line.
    pub fn parse(text: &str) -> Line {
        let (asked, value) = text.split_once(" = ").expect("asked = value");
        let words: Vec<&str> = asked.split(' ').collect();
        let numbers = |words: &[&str]| words.iter().map(|word| word.parse().expect("a number")).collect::<Vec<f32>>();
        let all = numbers(&words[2..]);
        let three = |at: usize| [all[at], all[at + 1], all[at + 2]];
        let value = numbers(&value.split(' ').collect::<Vec<_>>());
        Line {
            interpolation: if words[0] == "exact" { Interpolation::Exact } else { Interpolation::Fast },
            level: words[1].parse().expect("a level"),
            query: Query { uv: [all[0], all[1]], wi: three(2), wo: three(5) },
            value: [value[0], value[1], value[2]],
        }
    }
}

/// Returns the asset's colour for the query of `line`.
pub fn decoded(file: &ResidentFile, line: &Line) -> [f32; 3] {
    let options = DecodeOptions { interpolation: line.interpolation, ..DecodeOptions::default() };
    evaluate(&file.resident, line.level, &line.query, &options)
}
