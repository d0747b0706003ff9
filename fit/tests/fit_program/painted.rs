//! `btf-fit voltex` of scripts of shapes.

use crate::support::{btf_fit, refusal};
use btf_models::LeafDescription;
use serde_json::Value;
use std::fs;

const SCRIPT: &str = r#"
[space]
least_m = [0.0, 0.0, 0.0]
most_m = [0.2, 0.2, 0.1]
cyclic = [true, true]

[[materials]]
name = "leaf"
from = "leaf.toml"

[[materials]]
name = "stone"
reflectance = [0.4, 0.4, 0.4]

[[strokes]]
material = "stone"
shapes = [{ kind = "difference", of = [
  { kind = "sphere", centre_m = [0.0, 0.1, 0.05], radius_m = 0.04 },
  { kind = "cylinder", ends_m = [[0.0, 0.1, 0.0], [0.0, 0.1, 0.1]], radius_m = 0.02 },
] }]

[[strokes]]
material = "leaf"
shapes = [{ kind = "sheet", rows_m = [[[0.1, 0.0, 0.0], [0.15, 0.0, 0.0]], [[0.12, 0.25, 0.09]]] }]
"#;

#[test]
fn a_script_becomes_a_volume_and_a_bad_one_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::write(here.join("a.shapes.toml"), SCRIPT).unwrap();
    LeafDescription::default().write(here.join("leaf.toml")).unwrap();
    let build = |out: &str, more: &[&str]| {
        let line = ["voltex", "a.shapes.toml", "-o", out, "--resolution", "16", "--views", "4", "--json", "-"];
        let output = btf_fit(&[&line, more].concat(), here);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let json: Value = serde_json::from_slice(&output.stdout).unwrap();
        (json, fs::read(here.join(out)).unwrap())
    };
    let (told, bytes) = build("a.voltex", &[]);
    assert!((told["side_m"].as_f64().unwrap() - 0.2).abs() < 1e-6 && told["triangles"].as_u64().unwrap() > 100);
    assert!(told["materials"].as_u64().unwrap() >= 2);
    assert!(btf_fit(&["validate", "a.voltex"], here).status.success());
    // The same line gives the same bytes.
    assert!(bytes == build("b.voltex", &[]).1);
    // Planted difference: a smaller hole.
    fs::write(here.join("a.shapes.toml"), SCRIPT.replace("radius_m = 0.02", "radius_m = 0.01")).unwrap();
    assert!(bytes != build("b.voltex", &[]).1);

    for (from, to, parts) in [
        ("radius_m = 0.04", "radius_m = -1.0", ["a.shapes.toml has `radius_m` as -1", "shape 1 in stroke 1"]),
        ("leaf.toml", "none.toml", ["none.toml cannot be read", "point to the description of a leaf"]),
        ("[[0.12, 0.25, 0.09]]", "[[1e5, 0.25, 0.09]]", ["has a sheet that covers its cyclic [space]", "enlarge"]),
    ] {
        fs::write(here.join("a.shapes.toml"), SCRIPT.replace(from, to)).unwrap();
        let (code, message) = refusal(&btf_fit(&["voltex", "a.shapes.toml", "-o", "c.voltex"], here));
        assert!(code == 1 && parts.iter().all(|part| message.contains(part)), "{message}");
        assert!(!here.join("c.voltex").exists());
    }
}
