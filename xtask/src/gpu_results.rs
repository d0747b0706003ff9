//! What `btf-view bench gpu` wrote, read by name.

use serde_json::Value;

/// Returns whether results are of a whole run on a GPU, and not of a software driver or a quick run.
pub fn is_of_a_gpu(results: &Value) -> bool {
    let interface = adapter(results).and_then(|row| row["interface"].as_str());
    results["quick"] == false && interface.is_some_and(|interface| !interface.ends_with("Cpu"))
}

/// Returns the rows of a step.
pub fn rows<'a>(results: &'a Value, step: &str) -> impl Iterator<Item = &'a Value> {
    let steps = results["steps"].as_array().into_iter().flatten();
    let step = steps.filter(move |found| found["name"] == *step).collect::<Vec<_>>();
    step.into_iter().flat_map(|step| step["rows"].as_array().into_iter().flatten())
}

/// Returns the first timed picture of a step that leaves nothing out and that is wanted.
pub fn frame<'a>(results: &'a Value, step: &str, wanted: impl Fn(&Value) -> bool) -> Option<&'a Value> {
    rows(results, step).find(|row| row["kind"] == "frame" && row["variant"] == "" && wanted(row))
}

/// Returns what the adapter said of itself.
pub fn adapter(results: &Value) -> Option<&Value> {
    rows(results, "adapter").next()
}

/// Returns a text, empty where there is none.
pub fn text(value: &Value) -> &str {
    value.as_str().unwrap_or("")
}

/// Returns a number in three digits or more, or a dash where there is none.
pub fn number(value: &Value) -> String {
    match value.as_f64() {
        None => "-".into(),
        Some(x) if x == 0.0 || x.abs() >= 100.0 => format!("{x:.0}"),
        Some(x) if x.abs() >= 10.0 => format!("{x:.1}"),
        Some(x) if x.abs() >= 1.0 => format!("{x:.2}"),
        Some(x) => format!("{x:.3}"),
    }
}

/// Returns a number times `factor`, see [`number`].
pub fn scaled(value: &Value, factor: f64) -> String {
    number(&value.as_f64().map_or(Value::Null, |x| (x * factor).into()))
}
