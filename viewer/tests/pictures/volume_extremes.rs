//! Pictures of volumetric textures at the edge: an eye within, light along the shell, patches without area, volumes
//! smaller than a pixel and than the spacing of numbers. Every picture is finite and shows something, or a sentence
//! says why not.

use btf_viewer::{BackendChoice, Control, RenderMode, RenderParams, Scene, ShadeOptions, load_scene, render};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

const SIZE: [u32; 2] = [32, 24];
/// Rays a pixel where a volume is smaller than one: those that miss its box see nothing of it.
const RAYS: u32 = 1024;

/// Head of every scene: a dark floor far below, so that what is drawn is the volume, a lamp, and light from all around.
const HEAD: &str = r#"
background = [0.0, 0.0, 0.0]
[ambient]
radiance = [0.3, 0.3, 0.3]
[[material]]
name = "black"
diffuse = [0.0, 0.0, 0.0]
[[object]]
mesh = "plane"
material = "black"
rotate_deg = [-90.0, 0.0, 0.0]
translate = [0.0, -1000.0, 0.0]
"#;
const LAMP: &str = "[[light]]\nposition = [30.0, 60.0, 40.0]\nintensity = [20000.0, 20000.0, 20000.0]\n";

/// A folder with the volumes that come with the viewer.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["tree.voltex", "lawn.voltex", "lawn_flower.voltex", "forest.voltex", "forest_spruce.voltex"] {
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/scene/builtin");
        fs::copy(models.join(name), folder.path().join(name)).unwrap();
    }
    folder
}

fn scene_of(folder: &TempDir, text: &str) -> Result<Scene, String> {
    let path = folder.path().join("scene.toml");
    fs::write(&path, format!("{HEAD}{text}")).unwrap();
    load_scene(&path, Vec::new()).map_err(|error| error.to_string())
}

/// Linear pixels of the mean of `frames` samples.
fn pixels(scene: &Scene, mode: RenderMode, frames: u32) -> Vec<[f32; 3]> {
    let shade = ShadeOptions { mode, depth: 4, ..ShadeOptions::default() };
    let params = RenderParams { size: SIZE, frames, backend: BackendChoice::Cpu, shade, ..RenderParams::default() };
    render(scene, &params, &Control::SILENT).unwrap().picture.radiance
}

fn faults(pixels: &[[f32; 3]]) -> usize {
    pixels.iter().flatten().filter(|x| !(x.is_finite() && **x >= 0.0)).count()
}

fn mean(pixels: &[[f32; 3]]) -> f32 {
    pixels.as_flattened().iter().sum::<f32>() / (3 * pixels.len()) as f32
}

/// Draws in both modes, sees that all pixels are numbers, and tells how bright the direct one is. Without its volumes
/// the scene is black.
fn brightness(what: &str, scene: &Scene) -> f32 {
    let [direct, path] = [RenderMode::Direct, RenderMode::Path].map(|mode| pixels(scene, mode, 2));
    assert_eq!(faults(&direct) + faults(&path), 0, "{what}");
    assert_eq!(mean(&pixels(&Scene { volumes: None, ..scene.clone() }, RenderMode::Direct, 1)), 0.0);
    mean(&direct)
}

fn camera(eye: [f32; 3], target: [f32; 3], fov_deg: f32) -> String {
    format!("[camera]\neye = {eye:?}\ntarget = {target:?}\nfov_deg = {fov_deg:?}\n")
}

fn tree(translate: [f32; 3], scale: f32) -> String {
    format!("[[volume]]\nfile = \"tree.voltex\"\ntranslate = {translate:?}\nscale = {scale:?}\n")
}

/// A lawn of 6 x 6 texels.
fn lawn(more: &str) -> String {
    format!(
        "[[skin]]\npatches = [6, 6]\nheight = 1.0\nvolumes = [\"lawn.voltex\", [\"lawn.voltex\", \"lawn_flower.voltex\"]]\n\
         {more}\n"
    )
}

#[test]
fn the_scan_finds_a_number_that_is_none() {
    assert_eq!(faults(&[[0.0, 1.0, 2.0], [f32::NAN, -1e-6, f32::INFINITY]]), 3);
}

#[test]
fn an_eye_within_a_volume_and_on_its_faces() {
    let folder = folder();
    let tree = tree([0.0; 3], 1.0);
    let side = btf_viewer::load_volume(&folder.path().join("tree.voltex")).unwrap().side_m();
    let (half, crown) = (0.5 * side, 0.6 * side);
    for (what, eye, target) in [
        ("middle", [0.0, crown, 0.0], [1.0, crown + 0.1, 0.3]),
        ("along an axis", [0.0, crown, 0.0], [0.0, crown, -1.0]),
        ("on a face", [half, crown, 0.0], [0.0, crown, 0.0]),
        ("on an edge", [half, crown, half], [0.0, crown, 0.0]),
        ("at a corner", [half, side, half], [0.0, crown, 0.0]),
        ("on a border of voxels", [side / 64.0, 0.5 * side, side / 32.0], [side / 64.0, 0.5 * side, -1.0]),
    ] {
        let scene = scene_of(&folder, &[&camera(eye, target, 90.0), &tree, LAMP].concat()).unwrap();
        assert!(brightness(what, &scene) > 1e-3, "{what}");
        // Away from it there is nothing.
        if what == "on a face" {
            let away = [2.0 * side, crown, 0.0];
            let scene = scene_of(&folder, &[&camera(eye, away, 60.0), &tree, LAMP].concat()).unwrap();
            assert_eq!(brightness(what, &scene), 0.0);
        }
    }
    for eye in [[0.3, 0.5, 0.2], [0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.5, 1e-7, 0.5]] {
        let scene =
            scene_of(&folder, &[&camera(eye, [eye[0], eye[1], eye[2] - 1.0], 80.0), &lawn(""), LAMP].concat()).unwrap();
        assert!(brightness("in a skin", &scene) > 1e-4, "{eye:?}");
    }
}

#[test]
fn light_and_eye_along_the_shell() {
    let folder = folder();
    for (what, height) in [("base", 0.0), ("within", 0.5), ("lid", 1.0), ("above", 1.0001)] {
        let along = camera([0.0, height, 9.0], [0.0, height, 0.0], 30.0);
        let scene = scene_of(&folder, &[&along, &lawn(""), LAMP].concat()).unwrap();
        let seen = brightness(what, &scene);
        assert_eq!(seen > 1e-4, height < 0.9 || seen > 0.0, "{what}: {seen}");
        let lamp = format!("[[light]]\nposition = [90.0, {height:?}, 0.0]\nintensity = [9e4, 9e4, 9e4]\n");
        let above = camera([0.0, 8.0, 4.0], [0.0, 0.0, 0.0], 40.0);
        let low = brightness(what, &scene_of(&folder, &[&above, lawn("").as_str(), &lamp].concat()).unwrap());
        let high = brightness(what, &scene_of(&folder, &[&above, &lawn(""), LAMP].concat()).unwrap());
        assert!(low > 1e-4 && high > low, "{what}: {low} {high}");
    }
    // The sun at the horizon and below it.
    let above = camera([0.0, 8.0, 4.0], [0.0, 0.0, 0.0], 40.0);
    for hour in ["03:30", "04:50", "20:30", "23:00"] {
        let day = format!("[daylight]\ndate_time = \"2026-06-21T{hour}+02:00\"\nplace = \"52.5,13.4\"\n");
        let scene = scene_of(&folder, &[&above, lawn("").as_str(), &day].concat()).unwrap();
        assert_eq!(faults(&pixels(&scene, RenderMode::Direct, 2)), 0, "{hour}");
    }
}

#[test]
fn patches_without_area_folded_skins_and_meshes_that_are_none() {
    let folder = folder();
    let above = camera([0.0, 8.0, 4.0], [0.0, 0.0, 0.0], 40.0);
    let scene = |skin: &str| scene_of(&folder, &[&above, skin, LAMP].concat());
    let bright = brightness("straight", &scene(&lawn("")).unwrap());
    for (what, more) in [
        ("needles", "scale = [1.0, 1.0, 1e-4]"),
        ("combed flat", "lean = [30.0, 0.0, 0.0]"),
        ("jittered", "jitter = { wavelength = 0.9, coordinates = 9.0, length = 0.95, angle_deg = 80.0 }"),
        ("upside down", "rotate_deg = [180.0, 0.0, 0.0]"),
        ("mirrored", "scale = [-1.0, 1.0, 1.0]"),
        ("texture without area", "uv_scale = [0.0, 0.0]"),
        ("texture without digits", "uv_scale = [1e30, -1e30]"),
    ] {
        brightness(what, &scene(&lawn(more)).unwrap());
    }
    assert!((brightness("turned", &scene(&lawn("rotate_deg = [0.0, 90.0, 0.0]")).unwrap()) / bright - 1.0).abs() < 0.3);
    for (what, from, to, parts) in [
        ("no height", "height = 1.0", "height = 0.0", ["none of the skin's 36 faces", "[[skin]]"]),
        ("flat", "height = 1.0", "height = 1.0\nscale = [1.0, 1.0, 0.0]", ["[[skin]]", "flattened"]),
        ("lying", "height = 1.0", "height = 1.0\nlean = [1.0, -1.0, 0.0]", ["none of the skin's 36 faces", "height"]),
        ("nan", "height = 1.0", "height = nan", ["not finite", "vertex 0"]),
        ("nothing", "patches = [6, 6]\n", "", ["either mesh or patches", "[[skin]]"]),
        ("no patches", "[6, 6]", "[0, 6]", ["none of the skin's 0 faces", "[[skin]]"]),
        ("too many", "[6, 6]", "[100000, 100000]", ["too large", "2^24"]),
        ("no volume", "volumes = [", "volumes = []\n#", ["without a volume", "[[skin]]"]),
        ("no file", "lawn_flower", "daisies", ["daisies.voltex", "cannot be read"]),
    ] {
        let message = scene(&lawn("").replace(from, to)).unwrap_err();
        assert!(parts.iter().all(|part| message.contains(part)), "{what}: {message}");
    }
    // A mesh with triangles that have none of an area, three times over, and one that goes through itself.
    let obj = "v 0 0 0\nv 1 0 0\nv 0 0 -1\nv 0.2 1 -0.2\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\nf 1/1 2/2 3/3\nf 1/1 2/2 3/3\n\
               f 1/1 1/1 2/2\nf 1/1 2/2 2/2\nf 1/1 2/2 4/4\nf 3/3 1/1 4/4\n";
    fs::write(folder.path().join("bad.obj"), obj).unwrap();
    let skin = "[[skin]]\nmesh = \"bad.obj\"\nheight = 0.5\nvolumes = [\"lawn.voltex\"]\nscale = [4.0, 4.0, 4.0]\n";
    assert!(brightness("a bad mesh", &scene(skin).unwrap()) > 1e-4);
    fs::write(folder.path().join("bad.obj"), "v 0 0 0\nv 1 0 0\nv 0 0 -1\nf 1 2 3\n").unwrap();
    let message = scene(skin).unwrap_err();
    assert!(message.contains("no texture coordinates") && message.contains("[[skin]]"), "{message}");
}

#[test]
fn volumes_smaller_than_a_pixel_are_as_bright_as_their_share_of_it() {
    let folder = folder();
    let side = btf_viewer::load_volume(&folder.path().join("tree.voltex")).unwrap().side_m();
    // The same tree at the same angle from ever farther away, in a picture that shows as much of the world around it.
    let seen = |distance: f32, fov_deg: f32| {
        let target = [0.0, 0.5 * side, 0.0];
        let text = [&camera([0.0, target[1], distance * side], target, fov_deg), &tree([0.0; 3], 1.0), LAMP].concat();
        let pixels = pixels(&scene_of(&folder, &text).unwrap(), RenderMode::Direct, RAYS);
        assert_eq!(faults(&pixels), 0);
        // Over the square of the picture's width at the tree.
        mean(&pixels) * (distance * (0.5 * fov_deg.to_radians()).tan()).powi(2)
    };
    let near = seen(40.0, 3.0);
    // A tree of 8 pixels, of 1, and of a quarter.
    for (distance, fov_deg) in [(40.0, 4.2), (40.0, 34.0), (160.0, 34.0)] {
        let far = seen(distance, fov_deg);
        assert!((far / near - 1.0).abs() < 0.2, "{distance}: {far} {near}");
    }
    // Planted: a tree that is a third smaller is told apart.
    let smaller = {
        let text =
            [&camera([0.0, 0.0, 40.0 * side], [0.0, 0.4 * side, 0.0], 34.0), &tree([0.0; 3], 0.67), LAMP].concat();
        mean(&pixels(&scene_of(&folder, &text).unwrap(), RenderMode::Direct, RAYS))
            * (40.0f32 * 17f32.to_radians().tan()).powi(2)
    };
    assert!((smaller / near - 1.0).abs() > 0.25, "{smaller} {near}");
}

#[test]
fn voxels_smaller_than_the_spacing_of_numbers() {
    let folder = folder();
    // A tree of some metres as far from the origin as a number of single precision has steps of a metre, and small
    // ones.
    for (at, scale) in [(1e7f32, 1.0f32), (1e5, 0.01), (1e3, 1e-5), (1e12, 1e6)] {
        let reach = 30.0 * scale.max(at * 3e-7);
        let place = camera([at, 0.3 * reach, at + reach], [at, 0.0, at], 30.0);
        let scene = scene_of(&folder, &[&place, &tree([at, 0.0, at], scale), LAMP].concat()).unwrap();
        brightness(&format!("{at} {scale}"), &scene);
    }
    let far = "translate = [1e6, 0.0, 1e6]\nscale = [0.01, 0.01, 0.01]";
    let place = camera([1e6, 10.0, 1e6], [1e6, 0.0, 1e6 + 1.0], 30.0);
    if let Ok(scene) = scene_of(&folder, &[&place, &lawn(far), LAMP].concat()) {
        brightness("a skin far off", &scene);
    }
    for (scale, part) in
        [(0.0, "correct its scale"), (-1.0, "correct its scale"), (1e-20, "1e-9"), (f32::INFINITY, "inf large")]
    {
        let message = scene_of(&folder, &tree([0.0; 3], scale)).unwrap_err();
        assert!(
            message.contains("scene.toml") && message.contains("tree.voltex") && message.contains(part),
            "{message}"
        );
    }
    let message = scene_of(&folder, &tree([0.0, f32::INFINITY, 0.0], 1.0)).unwrap_err();
    assert!(message.contains("not finite"), "{message}");
}

#[test]
fn a_volume_that_is_cut_off_is_refused_by_name() {
    let folder = folder();
    let whole = fs::read(folder.path().join("tree.voltex")).unwrap();
    for length in [0, 7, 80, whole.len() / 2, whole.len() - 1] {
        fs::write(folder.path().join("cut.voltex"), &whole[..length]).unwrap();
        let text = tree([0.0; 3], 1.0).replace("tree.voltex", "cut.voltex");
        // Where a tier ends a file is whole, and coarser.
        match scene_of(&folder, &text) {
            Ok(scene) => assert!(brightness("a tier", &scene) >= 0.0),
            Err(message) => assert!(message.contains("cut.voltex"), "{message}"),
        }
    }
    assert!(scene_of(&folder, &tree([0.0; 3], 1.0)).is_ok());
}
