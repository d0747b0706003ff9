//! The goals for an H100, with what was measured beside them.

use crate::gpu_results::{frame, number, rows};
use serde_json::Value;
use std::fmt::Write;

/// The forms of assets in memory, as rows name them.
const FORMS: [&str; 2] = ["expanded", "packed"];
/// What an H100 should reach.
struct Goal {
    what: &'static str,
    /// The bound as a reader sees it.
    bound: &'static str,
    /// Whether a figure meets it.
    is_met: fn(f64) -> bool,
    /// Returns the figure with assets of a form, or of a scene without any.
    figure: fn(&Value, Option<&str>) -> Option<f64>,
    /// Whether there are figures for each form.
    of_forms: bool,
}

const GOALS: [Goal; 5] = [
    Goal {
        what: "Cornell box, 512 x 512, one light, all components: frames a second",
        bound: "at least 3,000",
        is_met: |per_s| per_s >= 3000.0,
        figure: |results, form| {
            let row = frame(results, "cornell", |row| is_of_box(row, form) && has_all(results, row))?;
            // Frames that wait for one another also measure the way to the GPU and back.
            Some(1e3 / row["unwaited_ms"].as_f64().or(row["frame_ms"].as_f64())?)
        },
        of_forms: true,
    },
    Goal {
        what: "the same filling 1920 x 1080, 8 components: ms",
        bound: "at most 1",
        is_met: |ms| ms <= 1.0,
        figure: |results, form| full_hd_ms(results, form, |row| row["components"] == 8),
        of_forms: true,
    },
    Goal {
        what: "the same filling 1920 x 1080, all components: ms",
        bound: "at most 3",
        is_met: |ms| ms <= 3.0,
        figure: |results, form| full_hd_ms(results, form, |row| has_all(results, row)),
        of_forms: true,
    },
    Goal {
        what: "Cornell box, 512 x 512, time with 16 lights over one: times",
        bound: "at most 4",
        is_met: |ratio| ratio <= 4.0,
        figure: |results, form| {
            let ms = |lights: u32| {
                let row = frame(results, "lights", |row| is_of_box(row, form) && row["lights"] == lights);
                row?["frame_ms"].as_f64()
            };
            Some(ms(16)? / ms(1)?)
        },
        of_forms: true,
    },
    Goal {
        what: "8.6 million triangles, 1920 x 1080, sun, sky, one occlusion ray: ms",
        bound: "at most 8",
        is_met: |ms| ms <= 8.0,
        figure: |results, _| frame(results, "canopy", |row| row["width"] == 1920)?["frame_ms"].as_f64(),
        of_forms: false,
    },
];

/// Returns whether a row has as many components as any of the run.
fn has_all(results: &Value, row: &Value) -> bool {
    let counts = ["cornell", "resolutions"].into_iter().flat_map(|step| rows(results, step));
    row["components"].as_u64() == counts.filter_map(|row| row["components"].as_u64()).max()
}

/// Returns whether a row is of the box in 512 x 512 pixels, with assets of a form.
fn is_of_box(row: &Value, form: Option<&str>) -> bool {
    row["form"] == *form.unwrap_or("") && row["width"] == 512 && row["height"] == 512
}

fn full_hd_ms(results: &Value, form: Option<&str>, wanted: impl Fn(&Value) -> bool) -> Option<f64> {
    let is_it = |row: &Value| row["form"] == *form.unwrap_or("") && row["width"] == 1920 && wanted(row);
    frame(results, "resolutions", is_it)?["frame_ms"].as_f64()
}

/// Returns the section of the page.
pub fn goals(results: &Value) -> String {
    let mut table =
        String::from("## Goals\n\nOf an H100.\n\n| | goal | expanded bases | packed bases |\n|---|---|---|---|\n");
    for goal in &GOALS {
        let told = |form: Option<&str>| match (goal.figure)(results, form) {
            None => "not run".to_string(),
            Some(x) => format!("{}, {}", number(&x.into()), if (goal.is_met)(x) { "met" } else { "not met" }),
        };
        let cells = match goal.of_forms {
            true => FORMS.map(|form| told(Some(form))),
            false => [told(None), "(no asset)".into()],
        };
        let _ = writeln!(table, "| {} | {} | {} | {} |", goal.what, goal.bound, cells[0], cells[1]);
    }
    table + "\n"
}
