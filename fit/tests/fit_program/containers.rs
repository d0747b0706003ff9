//! A UBO2014 file goes the whole way through `btf-fit`, and its asset is that of the same data as a folder.

#[path = "../../../capture/tests/support/ubo2014_writer.rs"]
mod ubo2014_writer;

use btf_capture::{CaptureInfo, CaptureWriter, Direction, DirectionSet, ImageFormat};
use std::path::Path;
use std::process::{Command, Stdio};
use ubo2014_writer::{Scene, Style, dfmf};

const SIZE: usize = 12;

fn btf_fit(arguments: &[&str], folder: &Path) -> serde_json::Value {
    let output = Command::new(env!("CARGO_BIN_EXE_btf-fit"))
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .expect("btf-fit starts");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap_or_default()
}

fn directions() -> Vec<[f64; 2]> {
    // Not in the order of the sorted set.
    vec![[60.0, 45.0], [0.0, 0.0], [30.0, 300.0], [30.0, 120.0], [67.5, 7.5], [45.0, 200.0]]
}

/// Tilted, tinted facets with a highlight above 1 that moves with light and view.
fn sample(view: [f64; 2], light: [f64; 2], texel: usize) -> [f64; 3] {
    let unit = |[theta, phi]: [f64; 2]| Direction::new(theta, phi).unit_f64();
    let (wo, wi) = (unit(view), unit(light));
    let slope = 0.3 * ((texel % SIZE) as f64 * 0.9).sin();
    let cosine = (wi[2] + slope * wi[0]).max(0.0);
    let half: Vec<f64> = (0..3).map(|i| wi[i] + wo[i]).collect();
    let length = half.iter().map(|x| x * x).sum::<f64>().sqrt();
    let gloss = 1.5 * ((half[2] + slope * half[0]) / length / 1.05).clamp(0.0, 1.0).powi(60);
    let shade = 0.6 + 0.4 * ((texel / SIZE) as f64 * 0.7).cos();
    [0.5, 0.3, 0.15].map(|albedo| shade * albedo * cosine + gloss * wi[2])
}

/// The file as UBO2014 has it: YUV with the logarithm of Y and the ratios to it, in numbers of `scalar` bytes.
fn container(scalar: u8, sample: impl Fn([f64; 2], [f64; 2], usize) -> [f64; 3]) -> Vec<u8> {
    const EPS: f64 = 1e-5;
    let set = directions();
    let mut values = Vec::new();
    for &view in &set {
        for &light in &set {
            for texel in 0..SIZE * SIZE {
                let [r, g, b] = sample(view, light, texel);
                // The inverse of the matrix from YUV to RGB, solved by hand: U and V from the differences to Y.
                let weights = [0.39465 / 2.03211, 1.0, 0.5806 / 1.13983];
                let y = (weights[0] * b + g + weights[2] * r) / weights.iter().sum::<f64>();
                let (u, v) = ((b - y) / 2.03211, (r - y) / 1.13983);
                values.extend([(y + EPS).ln(), u / (y + EPS), v / (y + EPS)]);
            }
        }
    }
    let channels = ["R", "G", "B"].map(String::from).to_vec();
    let scene = Scene { width: SIZE, height: SIZE, views: set.clone(), lights: set, channels, values };
    dfmf(&scene, &Style { scalar, ..Style::default() }, 11, [0.0; 3], [0.0; 9])
}

fn folder(path: &Path) {
    let set = DirectionSet::new(directions().into_iter().map(|[t, p]| Direction::new(t, p)).collect()).unwrap();
    let info = CaptureInfo::new("folder", SIZE, SIZE, set.clone(), set.clone(), ImageFormat::Exr);
    let writer = CaptureWriter::create(path, info).unwrap();
    let angles = |d: &Direction| [d.theta_deg, d.phi_deg];
    for (v, view) in set.directions().iter().enumerate() {
        for (l, light) in set.directions().iter().enumerate() {
            let image: Vec<f32> = (0..SIZE * SIZE)
                .flat_map(|texel| sample(angles(view), angles(light), texel).map(|value| value as f32))
                .collect();
            writer.write(v, l, &image).unwrap();
        }
    }
    writer.finish().unwrap();
}

#[test]
fn a_dfmf_file_fits_like_the_same_data_as_a_folder() {
    let here = tempfile::tempdir().unwrap();
    let here = here.path();
    folder(&here.join("folder"));
    std::fs::write(here.join("cloth.btf"), container(4, sample)).unwrap();
    std::fs::write(here.join("half.btf"), container(2, sample)).unwrap();
    // A planted difference: the light's azimuth turned.
    let turned = |view, [theta, phi]: [f64; 2], texel| sample(view, [theta, phi + 90.0], texel);
    std::fs::write(here.join("turned.btf"), container(4, turned)).unwrap();

    let fit = |capture: &str, asset: &str| {
        btf_fit(&["fit", capture, "-o", asset, "--clusters", "4", "--json", "-"], here)["psnr_db"].as_f64().unwrap()
    };
    let compare = |capture: &str, asset: &str| {
        btf_fit(&["compare", capture, asset, "--json", "-"], here)["psnr_db"].as_f64().unwrap()
    };
    let from_folder = fit("folder", "folder.spmm");
    let from_file = fit("cloth.btf", "cloth.spmm");
    // The folder's images are rounded to half precision, the file's are not.
    assert!((from_folder - from_file).abs() < 1.0, "{from_folder} dB and {from_file} dB");
    let crossed = compare("folder", "cloth.spmm");
    assert!((crossed - from_file).abs() < 1.0 && crossed > 40.0, "{crossed} dB and {from_file} dB");
    // Half precision of logarithms moves values by a third of a percent.
    fit("half.btf", "half.spmm");
    let half = compare("folder", "half.spmm");
    assert!(half > 40.0, "{half} dB");
    fit("turned.btf", "turned.spmm");
    let wrong = compare("folder", "turned.spmm");
    assert!(wrong < half - 10.0, "{wrong} dB and {half} dB");
}
