//! MaterialX accepts an exported document, and its own renderer draws the values of the model that was fitted.
//!
//! `cargo xtask test` installs MaterialX beside Mitsuba under the target folder; its renderer needs OpenGL in an X server.
//! Without them these tests are skipped, and counted as such.

use crate::mitsuba_peers::interpreter;
use btf_fit::{MaterialXNames, OpenPbrFit, OpenPbrTexel, OpenPbrTextures, materialx_document};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Width and height of the pictures.
const SIZE: usize = 12;
/// Most difference of `pi * BRDF * cosine`, beside a share of the value: the albedo of
/// the diffuse base is a polynomial within 0.1 %.
const MAX_DIFFERENCE: f64 = 1e-3;

/// Writes a material of one texel into `folder`; returns the document's path and the texel as a renderer reads it.
fn write_material(folder: &Path, name: &str, texel: OpenPbrTexel) -> (PathBuf, OpenPbrTexel) {
    let fit = OpenPbrFit {
        width: 2,
        height: 2,
        texels: vec![texel; 4],
        coat: texel.coat > 0.0,
        fuzz: texel.fuzz > 0.0,
        transmission: Vec::new(),
        tried: Vec::new(),
    };
    let textures = OpenPbrTextures::new(&fit);
    let names = MaterialXNames {
        material: name.into(),
        textures: format!("{name}_"),
        asset: "wool & felt.spmm".into(),
        checksum: "0123456789abcdef".into(),
        size_m: Some([0.03, 0.02]),
    };
    let path = folder.join(format!("{name}.mtlx"));
    std::fs::write(&path, materialx_document(&textures, &names).unwrap()).unwrap();
    for texture in &textures.textures {
        std::fs::write(folder.join(format!("{name}_{}.png", texture.name)), textures.png(texture).unwrap()).unwrap();
    }
    (path, textures.texel(0))
}

/// An X server without a screen, which ends with its owner.
struct Display {
    server: Child,
    name: String,
}

impl Display {
    /// Starts the server; `None` where there is none.
    fn open() -> Option<Display> {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "640x480x24", "-nolisten", "tcp", "-noreset"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let mut number = String::new();
        BufReader::new(server.stdout.take()?).read_line(&mut number).ok()?;
        Some(Display { server, name: format!(":{}", number.trim()) })
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// Python with MaterialX and a display for its renderer; `None` with a line for the skip count where one is missing.
fn renderer() -> Option<(PathBuf, Display)> {
    let python = interpreter()?;
    let display = Display::open();
    if display.is_none() {
        btf_tests::absent("MaterialX's renderer needs Xvfb (Debian: apt-get install xvfb)");
    }
    Some((python, display?))
}

/// Asks MaterialX to validate a document and to draw a plane under lights.
fn draw((python, display): &(PathBuf, Display), document: &Path, material: &str, lights: &[[f64; 3]]) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/materialx/render_plane.py");
    let query = json!({ "document": document, "material": material, "lights": lights, "size": SIZE });
    let mut command = Command::new(python);
    command.arg(script).env("DISPLAY", &display.name).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = command.spawn().expect("Python starts");
    child.stdin.take().unwrap().write_all(query.to_string().as_bytes()).expect("the query is written");
    let output = child.wait_with_output().expect("the answer is read");
    assert!(output.status.success(), "MaterialX's script failed: {}", output.status);
    serde_json::from_slice(&output.stdout).expect("the answer is JSON")
}

fn vector(value: &Value) -> [f32; 3] {
    [0, 1, 2].map(|i| value[i].as_f64().unwrap() as f32)
}

/// Returns the largest difference of the pictures from the model, beyond a two hundredth of the value.
fn largest_difference(answer: &Value, texel: &OpenPbrTexel, lights: &[[f64; 3]]) -> f64 {
    let mut largest = 0.0f64;
    for (light, picture) in lights.iter().zip(answer["pictures"].as_array().unwrap()) {
        for (pixel, eye) in picture.as_array().unwrap().iter().zip(answer["eyes"].as_array().unwrap()) {
            let (shown, value) = (vector(pixel), texel.reflected(light.map(|x| x as f32), vector(eye)));
            for c in 0..3 {
                largest = largest.max(f64::from((shown[c] - value[c]).abs() - 0.005 * value[c]));
            }
        }
    }
    largest
}

fn direction(theta_deg: f64, phi_deg: f64) -> [f64; 3] {
    let (sin, cos) = theta_deg.to_radians().sin_cos();
    let (s, c) = phi_deg.to_radians().sin_cos();
    [sin * c, sin * s, cos]
}

#[test]
fn materialx_draws_the_model_that_was_fitted() {
    let Some(renderer) = renderer() else { return };
    let folder = tempfile::tempdir().unwrap();
    let lights = [direction(0.0, 0.0), direction(40.0, 25.0), direction(65.0, 160.0), direction(50.0, 290.0)];
    let plain = OpenPbrTexel {
        base_colour: [0.6, 0.3, 0.1],
        diffuse_roughness: 0.0,
        roughness: 0.4,
        f0: 0.05,
        ..OpenPbrTexel::PLAIN
    };
    let turned = OpenPbrTexel {
        diffuse_roughness: 0.8,
        normal: [0.2, -0.15],
        roughness: 0.55,
        anisotropy: [0.1, 0.5],
        f0: 0.3,
        specular_colour: [1.0, 0.7, 0.4],
        ..plain
    };
    let coated = OpenPbrTexel {
        coat: 0.7,
        coat_colour: [0.9, 0.6, 0.5],
        coat_normal: [-0.2, 0.1],
        coat_roughness: 0.35,
        coat_anisotropy: [-0.3, 0.2],
        ..turned
    };
    let fuzzy =
        OpenPbrTexel { fuzz: 0.6, fuzz_colour: [0.2, 0.4, 0.9], fuzz_roughness: 0.6, normal: [0.1, 0.05], ..coated };
    for (name, texel) in [("plain", plain), ("turned", turned), ("coated", coated), ("fuzzy", fuzzy)] {
        let (document, read) = write_material(folder.path(), name, texel);
        let answer = draw(&renderer, &document, &format!("M_{name}"), &lights);
        assert_eq!(answer["complaints"], "");
        let largest = largest_difference(&answer, &read, &lights);
        println!("{name}: {largest:.5}");
        assert!(largest < MAX_DIFFERENCE, "{name}: {largest}");
        // Planted: a rougher lobe, and an anisotropy across.
        let rougher = OpenPbrTexel { roughness: read.roughness + 0.1, ..read };
        assert!(largest_difference(&answer, &rougher, &lights) > 2.0 * MAX_DIFFERENCE, "{name}: planted");
        let across = OpenPbrTexel { anisotropy: read.anisotropy.map(|x| -x), ..read };
        assert!(name == "plain" || largest_difference(&answer, &across, &lights) > 2.0 * MAX_DIFFERENCE, "{name}");
    }
}

#[test]
fn the_validator_accepts_all_parts_and_rejects_a_broken_document() {
    let Some(renderer) = renderer() else { return };
    let folder = tempfile::tempdir().unwrap();
    let texel = OpenPbrTexel { coat: 0.5, fuzz: 0.5, ..OpenPbrTexel::PLAIN };
    let (document, _) = write_material(folder.path(), "all", texel);
    let lights = [direction(0.0, 0.0)];
    // The second material, a Standard Surface, is drawn, too.
    let answer = draw(&renderer, &document, "M_all_standard", &lights);
    assert_eq!(answer["complaints"], "");
    let text = std::fs::read_to_string(&document).unwrap();
    assert!(
        text.contains("btf_asset=\"wool &amp; felt.spmm\"") && text.contains("btf_size_m=\"0.03, 0.02\""),
        "{text}"
    );
    let middle = vector(&answer["pictures"][0][SIZE * SIZE / 2]);
    assert!(middle.iter().all(|x| *x > 0.3), "{middle:?}");
    // Planted: an output that is not there.
    std::fs::write(&document, text.replacen("output=\"base_color_out\"", "output=\"base_colour_out\"", 1)).unwrap();
    let answer = draw(&renderer, &document, "M_all", &lights);
    assert!(answer["complaints"].as_str().unwrap().contains("base_color"), "{answer}");
}
