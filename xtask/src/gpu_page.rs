//! The page of a GPU's figures, from what `btf-view bench gpu` wrote.

use crate::gpu_goals::goals;
use crate::gpu_results::{adapter, number, rows, scaled, text};
use serde_json::Value;
use std::fmt::Write;

/// Steps of frames, with what their tables show.
const FRAME_STEPS: [(&str, &str); 8] = [
    ("cornell", "Cornell box that fills its picture"),
    ("resolutions", "Cornell box on larger screens, which it fills"),
    ("lights", "Lights"),
    ("models", "Shoe, boots, pullover"),
    ("canopy", "Canopy of as many triangles as Miao's"),
    ("canopies", "Canopies under sun and sky, with one ray for what occludes the sky"),
    ("landscapes", "Landscapes of volumetric textures"),
    ("workgroups", "Workgroups of other shapes"),
];

/// Makes the page; `head` is the commit of the checkout, which is told where the program did not know its own.
///
/// # Errors
/// A sentence where these are no results.
pub fn page(results: &Value, head: Option<&str>) -> Result<String, String> {
    if !results["steps"].is_array() {
        return Err("these are no results of `btf-view bench gpu`, there is no list of steps".into());
    }
    let sections = [
        introduction(results, head),
        goals(results),
        parity(results),
        roofline(results),
        operations(results),
        FRAME_STEPS.iter().map(|(step, title)| frames(results, step, title)).collect(),
        transitions(results),
        expansion(results),
        steps(results),
    ];
    Ok(sections.concat())
}

fn introduction(results: &Value, head: Option<&str>) -> String {
    let nothing = Value::Null;
    let adapter = adapter(results).unwrap_or(&nothing);
    // The folders of one machine are nobody else's.
    let name = |word: &str| word.rsplit(['/', '\\']).next().unwrap_or(word).to_string();
    let words = results["command"].as_array().into_iter().flatten().filter_map(Value::as_str);
    let words: Vec<String> = words.map(name).collect();
    let assets: Vec<&str> = results["assets"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    let commit = match (results["commit"].as_str(), head) {
        (Some(commit), _) => format!("commit `{commit}`"),
        (None, Some(head)) => format!("a build that does not know its commit, reported at commit `{head}`"),
        (None, None) => "a build that does not know its commit".into(),
    };
    let timer = if adapter["timestamps"] == true { "GPU timestamps" } else { "the wall clock" };
    let canopy = results["mesh"].as_str().unwrap_or("a plant that comes with the viewer, in diffuse sheets");
    format!(
        "# Measured on a GPU\n\n`btf-view {}`, {commit}, {} s.\n\n- Adapter: {} ({}), driver {} {}, rays by {}.\n- Assets: \
         {}.\n- Canopies: {canopy}.\n\nTimes are medians, by {timer}. Written by `cargo xtask gpu-report`.\n\n",
        words.join(" "),
        number(&results["seconds"]),
        adapter["name"].as_str().unwrap_or("not known"),
        text(&adapter["interface"]),
        text(&adapter["driver"]),
        text(&adapter["driver_info"]),
        text(&adapter["tracer"]),
        assets.join(", "),
    )
}

fn parity(results: &Value) -> String {
    let mut table = String::from(
        "## Parity with the CPU\n\n| | form | | differing | allowed | worst |\n|---|---|---|---|---|---|\n",
    );
    for row in rows(results, "parity-decode") {
        let what = format!("{} decoded samples, {}", row["samples"], text(&row["interpolation"]));
        let worst = format!("{} tolerances", number(&row["worst"]));
        let (form, asset) = (text(&row["form"]), text(&row["asset"]));
        let _ = writeln!(table, "| {what} | {form} | {asset} | {} | {} | {worst} |", row["differing"], row["allowed"]);
    }
    for row in rows(results, "parity-pictures") {
        let what = format!("{} x {} pixels, {}", row["width"], row["height"], text(&row["scene"]));
        let worst = format!("{} dB", number(&row["psnr_db"]));
        let (form, backend) = (text(&row["form"]), text(&row["backend"]));
        let _ =
            writeln!(table, "| {what} | {form} | {backend} | {} | {} | {worst} |", row["differing"], row["allowed"]);
    }
    table + &not_run(results, &["parity-decode", "parity-pictures"])
}

fn roofline(results: &Value) -> String {
    let mut section = String::from("## Roofline\n\n");
    if let Some(row) = rows(results, "roofline").next() {
        let _ = writeln!(
            section,
            "Copies of {} MB take {} GB/s, bytes read and written together; multiply-adds in registers come at {} T/s.",
            scaled(&row["copied_bytes"], 1e-6),
            number(&row["copy_gigabytes_per_s"]),
            number(&row["tera_multiply_adds_per_s"])
        );
    }
    section + &not_run(results, &["roofline"])
}

fn operations(results: &Value) -> String {
    const KINDS: [&str; 5] = ["float", "special", "integer", "loaded_words", "branches"];
    let mut table = String::from(
        "## Operations\n\nCounted by a shader that counts itself ([cost on a GPU](gpu-cost.md)): floating-point operations, \
         special ones, integer ones, 4-byte words read from buffers, branches.\n\n| scene | form | lights | components | of an \
         evaluation | of a ray | of a pixel beside | evaluations, rays a pixel |\n|---|---|---|---|---|---|---|---|\n",
    );
    for row in rows(results, "operations") {
        let of = |part: &str| {
            let counts = KINDS.map(|kind| format!("{:.0}", row[part][kind].as_f64().unwrap_or(f64::NAN)));
            counts.join(", ")
        };
        let _ = writeln!(
            table,
            "| {} | {} | {} | {} | {} | {} | {} | {}, {} |",
            [text(&row["mesh"]), text(&row["variant"])].join(" ").trim_end(),
            text(&row["form"]),
            row["lights"],
            row["components"],
            of("evaluation"),
            of("ray"),
            of("pixel"),
            number(&row["evaluations_per_pixel"]),
            number(&row["rays_per_pixel"]),
        );
    }
    table + &not_run(results, &["operations"])
}

fn frames(results: &Value, step: &str, title: &str) -> String {
    let mut table = format!(
        "## {title}\n\n| scene | form | size | lights | components | triangles | ms | camera, volume, light, bounce | not waited \
         for | M rays/s | M evaluations/s | GB/s, of copying |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n"
    );
    let copied = rows(results, "roofline").next().and_then(|row| row["copy_gigabytes_per_s"].as_f64());
    for row in rows(results, step) {
        let passes = ["camera_ms", "volume_ms", "light_ms", "bounce_ms"].map(|pass| number(&row["passes"][pass]));
        let bytes = match (row["gigabytes_per_s"].as_f64(), copied) {
            (Some(x), Some(copied)) => format!("{}, {:.2}", number(&x.into()), x / copied),
            _ => "-".into(),
        };
        let bands = match row["bands"].as_u64() {
            Some(bands) if bands > 1 => format!(" ({bands} bands)"),
            _ => String::new(),
        };
        let _ = writeln!(
            table,
            "| {} | {} | {} x {} | {} | {} | {} | {}{bands} | {} | {} | {} | {} | {bytes} |",
            [text(&row["mesh"]), text(&row["variant"])].join(" ").trim_end(),
            text(&row["form"]),
            row["width"],
            row["height"],
            row["lights"],
            row["components"],
            row["triangles"],
            number(&row["frame_ms"]),
            passes.join(", "),
            number(&row["unwaited_ms"]),
            scaled(&row["rays_per_s"], 1e-6),
            scaled(&row["evaluations_per_s"], 1e-6),
        );
    }
    table + &not_run(results, &[step])
}

fn transitions(results: &Value) -> String {
    let mut table = String::from(
        "## Meshes or volumes\n\nThe time to a noise by the width of leaves where meshes pass into the volumes that stand in for them \
         ([how](voltex.md#meshes-or-volumes-by-measured-cost)).\n\n| scene | size | leaves, pixels | ms | variance | times the least \
         |\n|---|---|---|---|---|---|\n",
    );
    for row in rows(results, "transitions") {
        let taken = if row["is_taken"] == true { ", taken" } else { "" };
        let _ = writeln!(
            table,
            "| {} | {} x {} | {} | {} | {} | {}{taken} |",
            [text(&row["mesh"]), text(&row["variant"])].join(" ").trim_end(),
            row["width"],
            row["height"],
            number(&row["pixels"]),
            number(&row["frame_ms"]),
            format_args!("{:.1e}", row["variance"].as_f64().unwrap_or(f64::NAN)),
            number(&row["relative_cost"]),
        );
    }
    table + &not_run(results, &["transitions"])
}

fn expansion(results: &Value) -> String {
    let mut table = String::from(
        "## Into memory\n\n| asset | MB expanded | packed | expanded on the CPU, ms | uploaded, ms | GB/s | packed, uploaded, \
         ms | expanded on the GPU, ms: first, again |\n|---|---|---|---|---|---|---|---|\n",
    );
    for row in rows(results, "expansion") {
        let _ = writeln!(
            table,
            "| {} | {} | {} | {} | {} | {} | {} | {}, {} |",
            text(&row["asset"]),
            scaled(&row["expanded_bytes"], 1e-6),
            scaled(&row["packed_bytes"], 1e-6),
            number(&row["cpu_ms"]),
            number(&row["upload_ms"][1]),
            number(&row["upload_gigabytes_per_s"]),
            number(&row["packed_upload_ms"]),
            number(&row["gpu_ms"][0]),
            number(&row["gpu_ms"][1]),
        );
    }
    table + &not_run(results, &["expansion"])
}

/// Returns a paragraph that says which of these steps gave nothing or ended early; an empty line where none did.
fn not_run(results: &Value, names: &[&str]) -> String {
    let steps = || results["steps"].as_array().into_iter().flatten();
    let mut said = String::from("\n");
    for name in names {
        let status = steps().find(|step| step["name"] == **name).map_or("not run", |step| text(&step["status"]));
        if status != "ok" {
            let _ = writeln!(said, "`{name}`: {status}.\n");
        }
    }
    said
}

fn steps(results: &Value) -> String {
    let mut table = String::from("## Steps\n\n| step | seconds | rows | |\n|---|---|---|---|\n");
    for step in results["steps"].as_array().into_iter().flatten() {
        let count = step["rows"].as_array().map_or(0, Vec::len);
        let (name, status) = (text(&step["name"]), text(&step["status"]));
        let _ = writeln!(table, "| {name} | {} | {count} | {status} |", number(&step["seconds"]));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu_results::is_of_a_gpu;
    use serde_json::json;

    fn frame_row(form: &str, size: [u32; 2], lights: u32, components: u32, frame_ms: f64) -> Value {
        json!({
            "kind": "frame", "mesh": "cornell", "variant": "", "form": form, "width": size[0], "height": size[1],
            "lights": lights, "components": components, "triangles": 1000, "frame_ms": frame_ms, "unwaited_ms": null,
            "passes": {"camera_ms": 0.1, "volume_ms": 0.0, "light_ms": 0.2, "bounce_ms": 0.0}, "bands": 1,
            "rays_per_s": 2e9, "evaluations_per_s": 1e9, "gigabytes_per_s": 500.0,
        })
    }

    fn operations_row() -> Value {
        let counts = |float: f64| {
            json!({"float": float, "special": 2.4, "integer": 3.0, "loaded_words": 4.0, "stored_words": 5.0,
                   "array_words": 6.0, "branches": 7.0})
        };
        json!({"kind": "operations", "mesh": "cornell", "variant": "", "form": "packed", "lights": 1, "components": 81,
               "evaluations_per_pixel": 0.9, "rays_per_pixel": 1.9, "evaluation": counts(1000.4), "ray": counts(700.0),
               "pixel": counts(30.0)})
    }

    fn results() -> Value {
        let step = |name: &str, status: &str, rows: Vec<Value>| json!({"name": name, "status": status, "seconds": 1.5, "rows": rows});
        let adapter = json!({"kind": "adapter", "name": "Fast 1", "interface": "vulkan DiscreteGpu", "driver": "d",
                             "driver_info": "5", "tracer": "bvh"});
        let roofline = json!({"kind": "roofline", "copy_gigabytes_per_s": 1000.0, "tera_multiply_adds_per_s": 20.0,
                              "copied_bytes": 512_000_000});
        json!({
            "version": "0.1.0", "commit": null, "command": ["bench", "gpu", "-o", "far/x"], "assets": ["cloth"], "mesh": null,
            "quick": false, "seconds": 77.0, "finished": true,
            "steps": [
                step("adapter", "ok", vec![adapter]),
                step("roofline", "ok", vec![roofline]),
                step("operations", "ok", vec![operations_row()]),
                step("cornell", "ok", vec![
                    frame_row("expanded", [512, 512], 1, 8, 0.1),
                    frame_row("expanded", [512, 512], 1, 81, 0.25),
                    frame_row("packed", [512, 512], 1, 81, 0.5),
                ]),
                step("resolutions", "failed: the device was lost", vec![frame_row("expanded", [1920, 1080], 1, 8, 0.9)]),
                step("lights", "ok", vec![
                    frame_row("packed", [512, 512], 1, 81, 0.5), frame_row("packed", [512, 512], 16, 81, 2.5),
                ]),
                step("transitions", "ok", vec![json!({
                    "kind": "transition", "mesh": "lawn", "variant": "nearer", "width": 1920, "height": 1080, "pixels": 0.5,
                    "frame_ms": 7.25, "variance": 0.02, "relative_cost": 1.0, "is_taken": true,
                })]),
            ],
        })
    }

    #[test]
    fn goals_stand_beside_their_figures_and_what_was_not_run_says_so() {
        let page = page(&results(), Some("abc1234")).unwrap();
        for line in [
            "| Cornell box, 512 x 512, one light, all components: frames a second | at least 3,000 | 4000, met | 2000, not met |",
            "| the same filling 1920 x 1080, 8 components: ms | at most 1 | 0.900, met | not run |",
            "| the same filling 1920 x 1080, all components: ms | at most 3 | not run | not run |",
            "| Cornell box, 512 x 512, time with 16 lights over one: times | at most 4 | not run | 5.00, not met |",
            "| lawn nearer | 1920 x 1080 | 0.500 | 7.25 | 2.0e-2 | 1.00, taken |",
            "`resolutions`: failed: the device was lost.",
            "`canopies`: not run.",
            "| cornell | packed | 1 | 81 | 1000, 2, 3, 4, 7 | 700, 2, 3, 4, 7 | 30, 2, 3, 4, 7 | 0.900, 1.90 |",
            "`btf-view bench gpu -o x`, a build that does not know its commit, reported at commit `abc1234`, 77.0 s.",
            "- Adapter: Fast 1 (vulkan DiscreteGpu), driver d 5, rays by bvh.",
        ] {
            assert!(page.lines().any(|found| found == line), "{line}\n{page}");
        }
        assert!(page.contains("| 500, 0.50 |"), "{page}");
        // Planted: frames that take longer than the goal.
        let mut slow = results();
        slow["steps"][3]["rows"][1]["frame_ms"] = json!(0.4);
        assert!(super::page(&slow, None).unwrap().contains("| 2500, not met |"));
    }

    #[test]
    fn pictures_of_other_sizes_meet_no_goal() {
        let mut quick = results();
        for step in [3, 5] {
            quick["steps"][step]["rows"].as_array_mut().unwrap().iter_mut().for_each(|row| row["width"] = json!(64));
        }
        let page = page(&quick, None).unwrap();
        assert!(
            page.contains("at least 3,000 | not run | not run |") && page.contains("at most 4 | not run | not run |")
        );
    }

    #[test]
    fn only_a_whole_run_on_a_gpu_is_for_the_documents() {
        assert!(is_of_a_gpu(&results()));
        let mut other = results();
        other["quick"] = json!(true);
        assert!(!is_of_a_gpu(&other));
        let mut other = results();
        other["steps"][0]["rows"][0]["interface"] = json!("vulkan Cpu");
        assert!(!is_of_a_gpu(&other));
        assert!(page(&json!({}), None).is_err());
    }
}
