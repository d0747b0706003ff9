//! The Python module gives what Rust gives, and Mitsuba 3, which shades through it, draws the picture that our CPU
//! renderer
//! draws: camera, point light, frame, texture orientation and the decoder's meaning are right, or wrong in two
//! renderers that share nothing else.
//!
//! `cargo xtask python` builds the module under the target folder, as `cargo xtask test` does; without it these tests
//! are skipped, and counted as such.

use crate::mitsuba_peers::interpreter;
use btf_capture::RadianceMap;
use btf_runtime::testing::{Random, sample_asset, sample_heights};
use btf_runtime::{
    Asset, DecodeOptions, Interpolation, Query, Resident, ResidualKind, density, evaluate, pack, serial, with_levels,
};
use btf_viewer::{
    BackendChoice, Control, Filter, RenderMode, RenderParams, SceneAsset, ShadeOptions, load_scene, render,
};
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::SystemTime;

const SIZE: [u32; 2] = [96, 64];
/// Repetitions of the asset along each side of the plane.
const UV_SCALE: f32 = 2.0;
/// Difference of two pictures that are the same: in the mean, and of all channels but the hundredth that differs
/// most, which leaves room for pixels whose middle lies on the border of two texels.
const SAME: f64 = 0.005;
/// Difference of half of the channels: what single precision leaves of a camera's ray and a light's direction.
const ROUNDING: f64 = 1e-4;

/// Returns the time of the newest file below a folder.
fn newest(folder: &Path) -> SystemTime {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let times = entries.map(|entry| {
        let entry = entry.unwrap();
        let data = entry.metadata().unwrap();
        if data.is_dir() { newest(&entry.path()) } else { data.modified().unwrap() }
    });
    times.max().unwrap_or(SystemTime::UNIX_EPOCH)
}

/// Returns a Python that finds the module, with a script of tests/peers, or `None` where there is none.
fn python(script: &str) -> Option<Command> {
    let program = interpreter()?;
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("the target folder holds its tmp");
    let module = target.join("peers/btf");
    // Written last, so that half an installation has none.
    let Ok(stamp) = module.join("installed.txt").metadata().and_then(|data| data.modified()) else {
        btf_tests::absent("the Python module is not in target/peers (`cargo xtask python` builds it)");
        return None;
    };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let sources = ["runtime/src", "fit/src", "capture/src", "python/src", "python/package"]
        .map(|folder| newest(&root.join(folder)));
    let sources = sources.into_iter().max().unwrap_or(SystemTime::UNIX_EPOCH);
    assert!(sources <= stamp, "the Python module is older than its sources: run `cargo xtask python`");
    let mut command = Command::new(program);
    command.arg(root.join("tests/peers").join(script)).env("PYTHONPATH", module).env("PYTHONDONTWRITEBYTECODE", "1");
    Some(command)
}

fn answer_of(mut command: Command, input: &[u8]) -> Vec<u8> {
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("the Python starts");
    // Dropped at the end of the statement, which ends the script's input.
    child.stdin.take().unwrap().write_all(input).expect("the query is written");
    let output = child.wait_with_output().expect("the answer is read");
    assert!(output.status.success(), "the script failed: {}", output.status);
    output.stdout
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

/// Six by five texels, no two alike, with heights.
fn asset() -> Asset {
    let mut asset = sample_asset(31, 6, 5, ResidualKind::Root);
    asset.layers[0].heights = Some(sample_heights(4, 30));
    // Narrow lobes would turn the last bits of a direction into a difference.
    for lobe in asset.layers[0].dictionary.iter_mut().flatten() {
        lobe.lobe.params = lobe.lobe.params.map(|p| p.min(4.0));
    }
    asset
}

fn write_asset(folder: &Path) -> PathBuf {
    let path = folder.join("asset.spmm");
    std::fs::write(&path, pack(&asset()).unwrap()).unwrap();
    path
}

/// Largest difference of numbers that should be equal but for rounding, relative to one and a little.
fn worst(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / (a.abs() + 1e-2)).fold(0.0, f32::max)
}

#[test]
fn python_gets_the_values_and_densities_that_rust_gets() {
    let folder = tempfile::tempdir().unwrap();
    let path = write_asset(folder.path());
    let asset = Asset::parse(&std::fs::read(&path).unwrap()).unwrap();
    let resident = Resident::from_asset(&with_levels(&asset, &serial));
    for (rule, interpolation, level) in
        [("fast", Interpolation::Fast, 0), ("exact", Interpolation::Exact, 0), ("fast", Interpolation::Fast, 1)]
    {
        let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
        let mut random = Random::new(9);
        let (mut places, mut expected) = (Vec::new(), Vec::new());
        for _ in 0..500 {
            let uv = [random.within(-2.0, 3.0), random.within(-2.0, 3.0)];
            let query = Query { uv, wi: random.direction(), wo: random.direction() };
            places.extend([&uv[..], &query.wi, &query.wo].concat());
            expected.extend(evaluate(&resident, level, &query, &options));
            expected.push(density(&resident, level, &query, &options));
        }
        let Some(mut command) = python("btf_values.py") else { return };
        command.arg(&path).arg(rule).arg(level.to_string());
        let places: Vec<u8> = places.iter().flat_map(|x: &f32| x.to_le_bytes()).collect();
        let answer = floats(&answer_of(command, &places));
        let difference = worst(&expected, &answer);
        println!("{rule}, level {level}: largest difference {difference:e}");
        assert!(difference < 1e-5, "{rule} {level}: {difference:e}");
        // Planted difference: one number a thousandth off.
        let mut planted = answer;
        planted[801] = 1.001 * planted[801] + 1e-4;
        assert!(worst(&expected, &planted) > 1e-5);
    }
}

/// Differences of two pictures.
#[derive(Debug)]
struct Difference {
    /// Mean absolute difference over the first one's mean.
    mean: f64,
    /// Relative difference that half of the channels that are lit in either, and 99 in 100, do not exceed.
    median: f64,
    p99: f64,
}

impl Difference {
    fn of(a: &[f32], b: &[f32]) -> Difference {
        assert_eq!(a.len(), b.len());
        let (mut sum, mut whole, mut relative) = (0.0, 0.0, Vec::new());
        for (a, b) in a.iter().zip(b).map(|(a, b)| (f64::from(*a), f64::from(*b))).filter(|(a, b)| a.max(*b) > 1e-6) {
            sum += (a - b).abs();
            whole += a;
            relative.push((a - b).abs() / a.max(1e-6));
        }
        relative.sort_by(f64::total_cmp);
        let lit = relative.len();
        assert!(lit > a.len() / 4, "only {lit} of {} channels are lit", a.len());
        Difference { mean: sum / whole, median: relative[lit / 2], p99: relative[lit * 99 / 100] }
    }

    fn is_none(&self) -> bool {
        self.mean <= SAME && self.p99 <= SAME && self.median <= ROUNDING
    }
}

/// The plane as our CPU renderer draws it, one ray through each pixel's middle: radiance, rows from the top.
fn our_picture(folder: &Path, asset: &Path, camera: &Value, light: &Value) -> Vec<f32> {
    let scene = format!(
        "background = [0.0, 0.0, 0.0]\n[camera]\neye = {}\ntarget = {}\nup = {}\nfov_deg = {}\n\
         [[material]]\nname = \"sample\"\nasset = 0\nuv_scale = [{UV_SCALE:?}, {UV_SCALE:?}]\n\
         [[object]]\nmesh = \"plane\"\nmaterial = \"sample\"\n[[light]]\nposition = {}\nintensity = {}\n",
        camera["eye"], camera["target"], camera["up"], camera["fov_deg"], light["position"], light["intensity"],
    );
    let path = folder.join("scene.toml");
    std::fs::write(&path, scene).unwrap();
    let scene = load_scene(&path, vec![Arc::new(SceneAsset::load(asset).unwrap())]).unwrap();
    let params = RenderParams {
        size: SIZE,
        backend: BackendChoice::Cpu,
        // Mitsuba asks the finest level.
        shade: ShadeOptions { levels: false, ..ShadeOptions::default() },
        ..RenderParams::default()
    };
    render(&scene, &params, &Control::SILENT).unwrap().picture.radiance.into_flattened()
}

#[test]
fn mitsuba_draws_the_plane_that_our_renderer_draws() {
    let folder = tempfile::tempdir().unwrap();
    let asset = write_asset(folder.path());
    let Some(command) = python("mitsuba_plane.py") else { return };
    let camera = json!({ "eye": [0.9, -1.6, 2.1], "target": [0.1, 0.05, 0.0], "up": [0.1, 1.0, 0.2], "fov_deg": 40.0 });
    let light = json!({ "position": [-0.7, 0.5, 1.3], "intensity": [3.0, 2.0, 1.0] });
    let [upright, flipped] = ["upright.f32", "flipped.f32"].map(|name| folder.path().join(name));
    let query = json!({
        "asset": asset, "uv_scale": UV_SCALE, "size": SIZE, "camera": camera, "light": light,
        "pictures": [[false, upright], [true, flipped]], "eyes": [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [-0.48, 0.64, 0.6]],
    });
    let answer: Value = serde_json::from_slice(&answer_of(command, query.to_string().as_bytes())).unwrap();

    let ours = our_picture(folder.path(), &asset, &camera, &light);
    let read = |path: &Path| floats(&std::fs::read(path).unwrap());
    let theirs = read(&upright);
    let same = Difference::of(&ours, &theirs);
    println!("Mitsuba {}: {same:?}", answer["version"]);
    assert!(same.is_none(), "{same:?}");
    // Planted differences: the texture upside down, rows from the bottom, a light a hundredth brighter, channels
    // turned.
    let rows_turned: Vec<f32> = theirs.chunks(3 * SIZE[0] as usize).rev().flatten().copied().collect();
    let brighter: Vec<f32> = theirs.iter().map(|x| 1.01 * x).collect();
    let turned: Vec<f32> = theirs.chunks(3).flat_map(|rgb| [rgb[1], rgb[2], rgb[0]]).collect();
    for planted in [read(&flipped), rows_turned, brighter, turned] {
        let different = Difference::of(&ours, &planted);
        assert!(!different.is_none(), "{different:?}");
    }

    // What paths need: draws add up to the whole, with the densities that are told.
    for row in answer["furnace"].as_array().unwrap() {
        let [sampled, integrated, density] = [0, 1, 2].map(|i| row[i].as_f64().unwrap());
        println!("reflected: {sampled:.4} by samples, {integrated:.4} by all directions; densities {density:e}");
        assert!((sampled / integrated - 1.0).abs() < 0.03 && density < 1e-4, "{row}");
    }
}

/// Pixels of the pictures of paths, and samples of each.
const PATH_SIZE: [u32; 2] = [48, 32];
const PATH_SAMPLES: u32 = 1024;
/// Pixels of a block, along each side, over which pictures are averaged: what is left of the noise is well below one percent.
const BLOCK: usize = 8;

/// Means over blocks of pixels.
fn block_means(pixels: &[f32]) -> Vec<f64> {
    let [width, height] = PATH_SIZE.map(|side| side as usize);
    let mut means = vec![0.0; width / BLOCK * (height / BLOCK) * 3];
    for (at, value) in pixels.iter().enumerate() {
        let (x, y, channel) = (at / 3 % width / BLOCK, at / 3 / width / BLOCK, at % 3);
        means[(y * (width / BLOCK) + x) * 3 + channel] += f64::from(*value) / (BLOCK * BLOCK) as f64;
    }
    means
}

/// Mean difference of blocks, relative to their values.
fn block_difference(a: &[f32], b: &[f32]) -> f64 {
    let (a, b) = (block_means(a), block_means(b));
    assert_eq!(a.len(), b.len());
    a.iter().zip(&b).map(|(a, b)| (a - b).abs() / a.max(1e-6)).sum::<f64>() / a.len() as f64
}

/// Columns and rows of the sky: so many that it does not count how renderers interpolate between them.
const SKY_SIZE: [usize; 2] = [128, 64];

/// A sky with a red and a blue light, `[row, column, rgb]`.
fn sky() -> Vec<[f32; 3]> {
    let light = |x: f32, y: f32, at: [f32; 2], width: f32| (-((x - at[0]).powi(2) + (y - at[1]).powi(2)) / width).exp();
    let pixel = |pixel: usize| {
        // In sixteenths of a turn.
        let (x, y) = ((pixel % SKY_SIZE[0]) as f32 / 8.0, (pixel / SKY_SIZE[0]) as f32 / 8.0);
        [0.3 + 2.0 * light(x, y, [11.0, 2.0], 3.0), 0.3, 0.3 + 1.5 * light(x, y, [3.0, 3.0], 4.0)]
    };
    (0..SKY_SIZE[0] * SKY_SIZE[1]).map(pixel).collect()
}

#[test]
fn mitsuba_traces_the_paths_that_our_renderer_traces() {
    let folder = tempfile::tempdir().unwrap();
    let asset = write_asset(folder.path());
    let Some(command) = python("mitsuba_paths.py") else { return };
    let camera = json!({ "eye": [0.3, -2.6, 1.6], "target": [0.0, 0.3, 0.4], "up": [0.0, 0.0, 1.0], "fov_deg": 40.0 });
    let rows: Vec<Vec<[f32; 3]>> = sky().chunks(SKY_SIZE[0]).map(<[_]>::to_vec).collect();
    let [same, turned] = ["same.f32", "turned.f32"].map(|name| folder.path().join(name));
    let query = json!({
        "asset": asset, "uv_scale": 3.0, "size": PATH_SIZE, "depth": 4, "samples": PATH_SAMPLES, "camera": camera,
        "environment": rows, "pictures": [[false, same], [true, turned]],
    });
    let answer: Value = serde_json::from_slice(&answer_of(command, query.to_string().as_bytes())).unwrap();

    if let Some(sentence) = answer["absent"].as_str() {
        return btf_tests::absent(sentence);
    }
    let map = RadianceMap { width: SKY_SIZE[0], height: SKY_SIZE[1], rgb: sky().into_flattened() };
    std::fs::write(folder.path().join("sky.exr"), map.exr().unwrap()).unwrap();
    let scene = format!(
        "[camera]\neye = {}\ntarget = {}\nup = {}\nfov_deg = {}\n[environment]\nfile = \"sky.exr\"\n\
         [[material]]\nname = \"m\"\nasset = 0\nuv_scale = [3.0, 3.0]\n[[object]]\nmesh = \"plane\"\nmaterial = \"m\"\n\
         [[object]]\nmesh = \"plane\"\nmaterial = \"m\"\nrotate_deg = [90, 0, 0]\ntranslate = [0, 1, 1]\n",
        camera["eye"], camera["target"], camera["up"], camera["fov_deg"],
    );
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, scene).unwrap();
    let scene = load_scene(&path, vec![Arc::new(SceneAsset::load(&asset).unwrap())]).unwrap();
    let shade = ShadeOptions {
        levels: false,
        filter: Filter::Nearest,
        mode: RenderMode::Path,
        depth: 4,
        ..ShadeOptions::default()
    };
    let backend = BackendChoice::Cpu;
    let params = RenderParams { size: PATH_SIZE, frames: PATH_SAMPLES, backend, shade, ..RenderParams::default() };
    let ours = render(&scene, &params, &Control::SILENT).unwrap().picture.radiance.into_flattened();

    let read = |path: &Path| floats(&std::fs::read(path).unwrap());
    let difference = block_difference(&ours, &read(&same));
    println!("Mitsuba {}, paths of 4 rays: blocks differ by {:.2} %", answer["version"], 100.0 * difference);
    assert!(difference < 0.01, "{difference}");
    let furnace = answer["furnace"].as_f64().unwrap();
    println!("a white sphere in surroundings of radiance 1 has {furnace:.4}");
    assert!((furnace - 1.0).abs() < 0.01, "{furnace}");
    // Planted differences: the sky turned, two percent more light, and paths that end at the first surface.
    assert!(block_difference(&ours, &read(&turned)) > 0.05);
    let brighter: Vec<f32> = ours.iter().map(|x| 1.02 * x).collect();
    assert!(block_difference(&ours, &brighter) > 0.015);
    let shorter = RenderParams { shade: ShadeOptions { depth: 1, ..shade }, ..params };
    let shorter = render(&scene, &shorter, &Control::SILENT).unwrap().picture.radiance.into_flattened();
    let without = block_difference(&ours, &shorter);
    println!("without the further rays blocks differ by {:.2} %", 100.0 * without);
    assert!(without > 0.015, "{without}");
}
