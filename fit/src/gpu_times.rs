//! Times of evaluations on a GPU, as `btf-view bench --json` writes them: this crate drives no GPU itself.

use crate::error::FitError;
use crate::trade::Rule;
use serde::Deserialize;
use std::path::Path;

/// Times read from a bench.
#[derive(Debug, Clone, PartialEq)]
pub struct GpuTimes {
    adapter: String,
    file: String,
    rows: Vec<Row>,
}

#[derive(Debug, Clone, PartialEq)]
struct Row {
    components: usize,
    rule: Rule,
    nanoseconds: f64,
}

#[derive(Deserialize)]
struct Bench {
    #[serde(default)]
    adapter: String,
    rows: Vec<BenchRow>,
}

#[derive(Deserialize)]
struct BenchRow {
    components: usize,
    frame_ms: Option<f64>,
    spmm_evaluations: Option<f64>,
    ns_per_evaluation: Option<f64>,
    interpolation: Option<String>,
}

impl GpuTimes {
    /// Reads the JSON of a bench. Each row needs `components` and either `ns_per_evaluation` or `frame_ms` and
    /// `spmm_evaluations`, whose quotient is then taken (a frame's other work counts as the evaluations'); rows
    /// without `interpolation` are of the fast rule.
    ///
    /// # Errors
    /// What is missing, with the file's name.
    pub fn read(path: &Path) -> Result<GpuTimes, FitError> {
        let text = std::fs::read_to_string(path).map_err(|source| FitError::File {
            path: path.to_path_buf(),
            action: "reading the times of a GPU",
            source,
            remedy: "give --gpu the file that `btf-view bench components ASSET.spmm --json FILE` wrote",
        })?;
        let refuse = |what: String| {
            FitError::Params(format!(
                "{}: {what}; give --gpu the file that `btf-view bench components ASSET.spmm --json FILE` wrote",
                path.display()
            ))
        };
        let bench: Bench = serde_json::from_str(&text).map_err(|error| refuse(format!("not such a JSON ({error})")))?;
        let rows = bench.rows.into_iter().enumerate().map(|(number, row)| {
            let quotient = || Some(row.frame_ms? * 1e6 / row.spmm_evaluations.filter(|count| *count > 0.0)?);
            let rule = match row.interpolation.as_deref() {
                None | Some("fast") => Rule::Fast,
                Some("exact") => Rule::Exact,
                Some(other) => return Err(refuse(format!("row {number} has the unknown interpolation `{other}`"))),
            };
            let nanoseconds = row.ns_per_evaluation.or_else(quotient).filter(|ns| ns.is_finite() && *ns >= 0.0);
            let nanoseconds =
                nanoseconds.ok_or_else(|| refuse(format!("row {number} lacks `frame_ms` and `spmm_evaluations`")))?;
            Ok(Row { components: row.components, rule, nanoseconds })
        });
        let rows = rows.collect::<Result<_, _>>()?;
        let file = path.file_name().map_or(String::new(), |name| name.to_string_lossy().into_owned());
        Ok(GpuTimes { adapter: bench.adapter, file, rows })
    }

    /// Nanoseconds with exactly these components, if the bench has them.
    pub(crate) fn nanoseconds(&self, components: usize, rule: Rule) -> Option<f64> {
        self.rows.iter().find(|row| row.components == components && row.rule == rule).map(|row| row.nanoseconds)
    }

    /// Where the times come from.
    pub(crate) fn words(&self) -> String {
        let adapter = if self.adapter.is_empty() { "a GPU that the file does not name" } else { &self.adapter };
        format!(
            "from {} ({adapter}), by number of components and rule, half precision, of the asset that was timed there; empty where it has no such row",
            self.file
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<GpuTimes, FitError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bench.json");
        std::fs::write(&path, text).unwrap();
        GpuTimes::read(&path)
    }

    #[test]
    fn a_bench_gives_nanoseconds_by_components_and_rule() {
        let times = read(
            r#"{"adapter": "X", "backend": "bvh", "rows": [
                {"components": 8, "frame_ms": 2.0, "spmm_evaluations": 1000000},
                {"components": 8, "interpolation": "exact", "ns_per_evaluation": 9.5}]}"#,
        )
        .unwrap();
        assert_eq!(times.nanoseconds(8, Rule::Fast), Some(2.0));
        assert_eq!(times.nanoseconds(8, Rule::Exact), Some(9.5));
        assert_eq!(times.nanoseconds(4, Rule::Fast), None);
        assert!(times.words().contains("X"));
    }

    #[test]
    fn what_is_no_bench_is_refused_in_one_sentence() {
        for (text, word) in [
            ("rows", "not such a JSON"),
            (r#"{"rows": [{"components": 8, "frame_ms": 2.0}]}"#, "spmm_evaluations"),
            (r#"{"rows": [{"components": 8, "frame_ms": 2.0, "spmm_evaluations": 0}]}"#, "spmm_evaluations"),
            (r#"{"rows": [{"components": 8, "ns_per_evaluation": 1, "interpolation": "best"}]}"#, "best"),
        ] {
            let message = read(text).unwrap_err().to_string();
            assert!(message.contains(word) && message.contains("bench.json") && !message.contains('\n'), "{message}");
        }
        assert!(GpuTimes::read(Path::new("nowhere.json")).unwrap_err().to_string().contains("nowhere.json"));
    }
}
