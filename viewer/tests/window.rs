//! The window of the real program, under Xvfb, with a real mouse and real keys (xdotool): a light is dragged, an asset
//! is painted on and saved, closing asks where edits are unsaved, the wheel stops before surfaces, a double click chooses
//! what drags turn about, a file is chosen, and the window is drawn and closes while shaders are being compiled.
//!
//! Where Xvfb, xdotool or a Vulkan driver are missing, the test says so and is counted as skipped; in CI (`CI`
//! or `BTF_CI` is set) it fails instead. `BTF_SKIP_GPU=1` leaves it out, because the window needs a driver to
//! show pictures.

mod support;

use btf_runtime::Asset;
use btf_viewer::{Gpu, MeshChoice, Scene, SceneAsset};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Width and height of the window, pixels.
const SIZE: [u32; 2] = [900, 640];
/// Width of the panel beside the picture, pixels.
const PANEL_WIDTH: u32 = 290;
/// Distance of a light's handle from the scene's centre, in the scene's radii.
const HANDLE_RADII: f32 = 1.15;
/// Longest time that anything is waited for: a loaded machine without a graphics card compiles shaders that long.
const PATIENCE: Duration = Duration::from_secs(120);
/// Time after which a window that does not ask would have closed.
const HESITATION: Duration = Duration::from_secs(3);
/// Longest time that closing takes: what goes on is not waited for.
const CLOSING: Duration = Duration::from_secs(10);
/// Time in which the turns of a wheel come to rest: the window spreads them over some frames.
const SCROLLING: Duration = Duration::from_secs(2);
/// Largest difference of a picture's first samples from its later ones, steps of 8 bits; 1.2 were seen.
const SETTLING: f64 = 4.0;
/// Names of the window, without and with unsaved edits.
const TITLES: [&str; 2] = ["BTF viewer", "* BTF viewer"];

/// Tells whether the test cannot run here, and says why.
///
/// # Panics
/// Where everything must be there.
fn is_left_out() -> bool {
    if support::gpu_is_left_out("the window") {
        return true;
    }
    let is_missing = |tool: &&str| Command::new(tool).arg("-version").stderr(Stdio::null()).output().is_err();
    let missing: Vec<&str> = ["Xvfb", "xdotool"].into_iter().filter(|tool| is_missing(tool)).collect();
    let driver = Gpu::headless(None).err().map(|error| error.to_string());
    let missing = missing.into_iter().map(|tool| format!("{tool} is not installed")).chain(driver);
    let missing = missing.collect::<Vec<_>>().join(", ");
    if missing.is_empty() {
        return false;
    }
    let is_ci = ["CI", "BTF_CI"].iter().any(|name| std::env::var_os(name).is_some_and(|value| !value.is_empty()));
    assert!(!is_ci, "the window cannot be tested: {missing}");
    support::skip(&format!("the window: {missing}"));
    true
}

/// A program that ends with its owner.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// An X server without a screen.
struct Display {
    _server: Running,
    name: String,
    /// Where the server keeps what its screen shows.
    folder: tempfile::TempDir,
}

impl Display {
    fn open() -> Display {
        let size = format!("{}x{}x24", SIZE[0] + 100, SIZE[1] + 100);
        let folder = tempfile::tempdir().unwrap();
        // Without -noreset the server starts anew, and refuses connections meanwhile, whenever its last client leaves:
        // each xdotool that runs before the program is connected.
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", &size, "-nolisten", "tcp", "-noreset", "-fbdir"])
            .arg(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        Display { _server: Running(server), name: format!(":{}", number.trim()), folder }
    }

    /// Counts the colours in columns of the screen, from the server's picture of it: big-endian numbers of 4 bytes, of
    /// which the first tells where its table of colours begins, number 12 the bytes of a row and number 19 the colours in
    /// that table, 12 bytes each; then pixels of 4 bytes.
    fn count_colours(&self, columns: std::ops::Range<u32>) -> usize {
        let screen = std::fs::read(self.folder.path().join("Xvfb_screen0")).unwrap();
        let number = |at: usize| u32::from_be_bytes(screen[4 * at..4 * at + 4].try_into().unwrap()) as usize;
        let (rows, row_bytes) = (&screen[number(0) + 12 * number(19)..], number(12));
        let [left, right] = [columns.start, columns.end].map(|column| 4 * column as usize);
        let pixels = rows.chunks_exact(row_bytes).flat_map(|row| row[left..right].chunks_exact(4));
        pixels.collect::<std::collections::HashSet<_>>().len()
    }

    /// Moves the mouse, presses keys and asks about windows; returns what xdotool prints.
    fn xdotool(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool").args(arguments).env("DISPLAY", &self.name).output().unwrap();
        String::from_utf8_lossy(&output.stdout).trim().into()
    }
}

/// The program with its window.
struct Viewer<'a> {
    display: &'a Display,
    program: Running,
    window: String,
    folder: PathBuf,
}

impl Viewer<'_> {
    /// Opens an asset in `folder`, where the program also keeps its settings and its pictures, and waits until it follows
    /// its keys.
    fn open<'a>(display: &'a Display, folder: &Path, asset: &str) -> Viewer<'a> {
        Viewer::open_with(display, folder, &[asset])
    }

    /// Opens an asset with more arguments.
    fn open_with<'a>(display: &'a Display, folder: &Path, arguments: &[&str]) -> Viewer<'a> {
        let mut viewer = Viewer::start(display, folder, arguments, "cpu");
        // Keys are lost until the window has the keyboard.
        viewer.wait_until_keys_are_followed();
        viewer
    }

    /// Starts the program with a backend; what Mesa has compiled before is not used.
    fn start<'a>(display: &'a Display, folder: &Path, arguments: &[&str], backend: &str) -> Viewer<'a> {
        let program = Command::new(env!("CARGO_BIN_EXE_btf-view"))
            .args(arguments)
            .args(["--backend", backend, "--size", &format!("{}x{}", SIZE[0], SIZE[1])])
            .current_dir(folder)
            .env("DISPLAY", &display.name)
            .env("XDG_CONFIG_HOME", folder)
            .env("MESA_SHADER_CACHE_DISABLE", "true")
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .spawn()
            .unwrap();
        let mut viewer =
            Viewer { display, program: Running(program), window: String::new(), folder: folder.to_path_buf() };
        viewer.wait_until("the window is there", |viewer| {
            viewer.window = display.xdotool(&["search", "--onlyvisible", "--name", TITLES[0]]);
            !viewer.window.is_empty()
        });
        // Without a window manager nobody else gives the window the keyboard.
        display.xdotool(&["windowfocus", "--sync", &viewer.window]);
        viewer
    }

    /// Presses P until a picture is written.
    fn wait_until_keys_are_followed(&mut self) {
        let next = self.picture_path(self.next_picture());
        self.wait_until("the window follows its keys", |viewer| {
            viewer.press("p");
            std::thread::sleep(Duration::from_millis(500));
            next.exists()
        });
        // Of keys that were late, pictures may still come.
        for _ in 0..3 {
            self.settle();
        }
    }

    fn wait_until(&mut self, what: &str, mut is_so: impl FnMut(&mut Self) -> bool) {
        let start = Instant::now();
        while !is_so(self) {
            if let Some(status) = self.exit_status() {
                panic!("the program ended with {status} before {what}");
            }
            assert!(start.elapsed() < PATIENCE, "{what}: not after {PATIENCE:?}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn exit_status(&mut self) -> Option<ExitStatus> {
        self.program.0.try_wait().unwrap()
    }

    /// Waits until the program has ended; returns its exit code.
    fn exit_code(&mut self) -> Option<i32> {
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            if let Some(status) = self.exit_status() {
                return status.code();
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        panic!("the program did not end in {PATIENCE:?}");
    }

    fn press(&self, key: &str) {
        self.display.xdotool(&["key", key]);
    }

    fn title(&self) -> String {
        self.display.xdotool(&["getwindowname", &self.window])
    }

    fn wait_for_title(&mut self, title: &str) {
        self.wait_until(&format!("the title is '{title}'"), |viewer| viewer.title() == title);
    }

    fn picture_path(&self, number: u32) -> PathBuf {
        self.folder.join(format!("btf-view_{number:03}.png"))
    }

    /// Returns the number of the next picture: pictures are numbered without gaps, and written whole.
    fn next_picture(&self) -> u32 {
        (1..).find(|number| !self.picture_path(*number).exists()).unwrap()
    }

    /// Waits until the window has drawn what it was told so far: the key P writes a picture, after all earlier keys and
    /// mouse moves. Returns that picture's file.
    fn settle(&mut self) -> PathBuf {
        let number = self.next_picture();
        self.press("p");
        self.wait_until("a picture is written", |viewer| viewer.picture_path(number).exists());
        self.picture_path(number)
    }

    /// Returns the picture as it is after all earlier keys and mouse moves.
    fn picture(&mut self) -> image::RgbImage {
        // A frame writes the picture of the one before it.
        self.settle();
        image::open(self.settle()).unwrap().to_rgb8()
    }

    /// Drags the mouse with the left button, places in pixels of the window.
    fn drag(&mut self, from: [f32; 2], by: [f32; 2]) {
        let move_to = |viewer: &mut Self, share: f32| {
            let [x, y] = [0, 1].map(|i| (from[i] + share * by[i]).round().to_string());
            viewer.display.xdotool(&["mousemove", "--window", &viewer.window, &x, &y]);
            viewer.settle();
        };
        move_to(self, 0.0);
        self.display.xdotool(&["mousedown", "1"]);
        self.settle();
        [0.25, 0.5, 0.75, 1.0].into_iter().for_each(|share| move_to(self, share));
        self.display.xdotool(&["mouseup", "1"]);
        self.settle();
    }

    /// Moves the mouse to a place of the window and clicks a button there.
    fn click(&self, [x, y]: [f32; 2], button: &str, times: u32) {
        let [x, y] = [x, y].map(|x| x.round().to_string());
        self.display.xdotool(&["mousemove", "--window", &self.window, &x, &y]);
        // Close together, so that two are a double click although a frame takes long.
        self.display.xdotool(&["click", "--repeat", &times.to_string(), "--delay", "20", button]);
    }

    /// Chooses the brush and paints on the middle of the picture, where the asset is.
    fn paint(&mut self) {
        self.press("2");
        self.drag([0.5 * (SIZE[0] - PANEL_WIDTH) as f32, 0.5 * SIZE[1] as f32], [20.0, 0.0]);
        self.wait_for_title(TITLES[1]);
    }
}

/// Where the handle of the first light is in the window at first, pixels.
fn light_handle(asset: SceneAsset) -> [f32; 2] {
    let scene = Scene::built_in(&MeshChoice::Sphere, vec![Arc::new(asset)], [1.0; 2]).unwrap();
    let (centre, radius) = scene.geometry.bounding_sphere();
    let towards = (scene.lights[0].position - centre).normalize() * (HANDLE_RADII * radius);
    scene.camera.frame(SIZE[0] - PANEL_WIDTH, SIZE[1]).pixel_of(centre + towards).unwrap()
}

/// Mean difference of two pictures, steps of 8 bits.
fn difference(a: &image::RgbImage, b: &image::RgbImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let sum: f64 = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
    sum / a.as_raw().len() as f64
}

/// Mean difference of pixels that lie side by side, steps of 8 bits.
fn roughness(picture: &image::RgbImage) -> f64 {
    let [width, height] = [picture.width(), picture.height()];
    let pairs = (0..height).flat_map(|y| (1..width).map(move |x| (x, y)));
    let apart = |(x, y)| f64::from(picture.get_pixel(x, y)[1].abs_diff(picture.get_pixel(x - 1, y)[1]));
    pairs.map(apart).sum::<f64>() / f64::from((width - 1) * height)
}

fn folder_with_asset() -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("weave.spmm");
    std::fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/src/scene/builtin/weave.spmm"), &path).unwrap();
    (dir, path)
}

#[test]
fn a_light_is_dragged_edits_are_saved_and_closing_asks_about_unsaved_ones() {
    if is_left_out() {
        return;
    }
    let (dir, path) = folder_with_asset();
    let edited = dir.path().join("weave_edited.spmm");
    let original = std::fs::read(&path).unwrap();
    let display = Display::open();

    // First run: drag the light, paint, save, close.
    let mut viewer = Viewer::open(&display, dir.path(), "weave.spmm");
    let (before, again) = (viewer.picture(), viewer.picture());
    viewer.drag(light_handle(SceneAsset::load(&path).unwrap()), [90.0, 60.0]);
    let after = viewer.picture();
    let [same, other] = [&again, &after].map(|picture| difference(&before, picture));
    assert!(other > 3.0 && same < 1.0, "the dragged light changes the picture by {other}, nothing by {same}");
    assert_eq!(viewer.title(), TITLES[0], "a light is no edit");
    viewer.paint();
    assert!(!edited.exists());
    viewer.press("ctrl+s");
    viewer.wait_for_title(TITLES[0]);
    let [measured, saved] = [&path, &edited].map(|path| Asset::parse(&std::fs::read(path).unwrap()).unwrap());
    let painted = saved.edits.texels.iter().filter(|edit| **edit == 1).count();
    assert!(saved.edits.list.len() == 1 && (10..2000).contains(&painted), "{painted} texels");
    assert!(saved.layers == measured.layers && measured.edits.list.is_empty());
    viewer.press("ctrl+q");
    assert_eq!(viewer.exit_code(), Some(0));
    let settings = std::fs::read_to_string(dir.path().join("btf-view/settings.toml")).unwrap();
    assert!(settings.contains(&format!("size = [{}, {}]", SIZE[0], SIZE[1])), "{settings}");

    // Second run: with unsaved edits the window asks; Escape keeps it open, D closes it without saving.
    let (dir, path) = folder_with_asset();
    let mut viewer = Viewer::open(&display, dir.path(), "weave.spmm");
    viewer.paint();
    viewer.press("ctrl+q");
    std::thread::sleep(HESITATION);
    assert_eq!((viewer.exit_status(), viewer.title().as_str()), (None, TITLES[1]));
    viewer.press("Escape");
    // The question, which takes all keys while it is there, is gone: D closes nothing.
    viewer.wait_until_keys_are_followed();
    viewer.press("d");
    viewer.settle();
    assert_eq!(viewer.title(), TITLES[1]);
    viewer.press("ctrl+q");
    std::thread::sleep(HESITATION);
    assert_eq!(viewer.exit_status(), None);
    viewer.press("d");
    assert_eq!(viewer.exit_code(), Some(0));
    assert!(!dir.path().join("weave_edited.spmm").exists() && std::fs::read(&path).unwrap() == original);
}

#[test]
fn noise_is_filtered_while_nothing_moves_and_the_raw_picture_is_there_at_once_when_something_does() {
    if is_left_out() {
        return;
    }
    let (dir, _path) = folder_with_asset();
    let display = Display::open();
    // Of 64 lamps each sample asks one, so that samples differ.
    let mut viewer = Viewer::open_with(&display, dir.path(), &["weave.spmm", "--lights", "64", "--light-samples", "1"]);
    let middle = [0.5 * (SIZE[0] - PANEL_WIDTH) as f32, 0.5 * SIZE[1] as f32];
    // A filtered picture stays for twice its samples; the raw one changes with each.
    let rests = |viewer: &mut Viewer| {
        let first = viewer.picture();
        (first == viewer.picture()).then_some(first)
    };
    assert!((0..3).all(|_| rests(&mut viewer).is_none()), "without the filter the picture changes all the time");
    viewer.press("n");
    let mut filtered = None;
    viewer.wait_until("the noise is filtered", |viewer| {
        filtered = rests(viewer);
        filtered.is_some()
    });
    // Turned by a drag that is not at its end: the picture of the newest samples, with all their noise.
    let [x, y] = middle.map(|x| x.round().to_string());
    viewer.display.xdotool(&["mousemove", "--window", &viewer.window, &x, &y]);
    viewer.display.xdotool(&["mousedown", "1"]);
    viewer.settle();
    let mut raw = 0f64;
    for step in 1..6 {
        let x = (middle[0] + 6.0 * step as f32).round().to_string();
        viewer.display.xdotool(&["mousemove", "--window", &viewer.window, &x, &y]);
        raw = raw.max(roughness(&image::open(viewer.settle()).unwrap().to_rgb8()));
    }
    viewer.display.xdotool(&["mouseup", "1"]);
    let smooth = roughness(&filtered.unwrap());
    println!("roughness: {smooth} filtered, {raw} raw");
    assert!(raw > 1.2 * smooth, "{raw} {smooth}");
    viewer.wait_until("the noise is filtered again", |viewer| rests(viewer).is_some());
    viewer.press("n");
    viewer.settle();
    assert!(rests(&mut viewer).is_none(), "the filter is off");
    viewer.press("ctrl+q");
    assert_eq!(viewer.exit_code(), Some(0));
}

#[test]
fn the_wheel_stops_before_the_surface_and_a_double_click_chooses_what_drags_turn_about() {
    if is_left_out() {
        return;
    }
    let (dir, _path) = folder_with_asset();
    let display = Display::open();
    let mut viewer = Viewer::open(&display, dir.path(), "weave.spmm");
    let off_middle = [0.3 * (SIZE[0] - PANEL_WIDTH) as f32, 0.45 * SIZE[1] as f32];
    // The sphere nearly fills the picture; from within it would be black.
    let before = viewer.picture();
    viewer.click(off_middle, "5", 3);
    viewer.click(off_middle, "4", 3);
    std::thread::sleep(SCROLLING);
    let back = viewer.picture();
    let moved = difference(&before, &back);
    viewer.click(off_middle, "4", 60);
    std::thread::sleep(SCROLLING);
    let near = viewer.picture();
    let mean = near.as_raw().iter().map(|x| f64::from(*x)).sum::<f64>() / near.as_raw().len() as f64;
    let changed = difference(&before, &near);
    assert!(
        moved < SETTLING && changed > 5.0 * SETTLING,
        "out and in changes the picture by {moved}, to the surface by {changed}"
    );
    assert!(mean > 20.0, "after sixty clicks the picture has a mean of {mean} of 255");
    drop(viewer);

    // The same drag, about the middle and about a place that a double click chose.
    let turned = |clicks: u32| {
        let (dir, _path) = folder_with_asset();
        let mut viewer = Viewer::open(&display, dir.path(), "weave.spmm");
        let before = viewer.picture();
        viewer.click(off_middle, "1", clicks);
        let clicked = viewer.picture();
        viewer.drag([0.5 * (SIZE[0] - PANEL_WIDTH) as f32, 0.7 * SIZE[1] as f32], [60.0, 20.0]);
        (difference(&before, &clicked), viewer.picture())
    };
    let [(once, about_middle), (twice, about_place)] = [1, 2].map(turned);
    assert!(once < SETTLING && twice < SETTLING, "clicks change the picture by {once} and {twice}");
    let differs = difference(&about_middle, &about_place);
    println!(
        "wheel: out and in {moved:.1}, nearer {changed:.1}, mean {mean:.0}; clicks {once:.2}, {twice:.2}; drags {differs:.1}"
    );
    assert!(differs > 2.0 * SETTLING, "the drags' pictures differ by {differs}");
}

#[test]
fn a_file_is_chosen_and_opened_with_the_keyboard() {
    if is_left_out() {
        return;
    }
    let (dir, _path) = folder_with_asset();
    std::fs::write(dir.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
        .unwrap();
    let display = Display::open();
    let mut viewer = Viewer::open(&display, dir.path(), "weave.spmm");
    let sphere = viewer.picture();
    // Escape leaves everything as it was; the dialog has the keys until then.
    viewer.press("ctrl+o");
    std::thread::sleep(HESITATION);
    viewer.press("Down");
    viewer.press("Escape");
    viewer.wait_until_keys_are_followed();
    let still = viewer.picture();
    viewer.press("ctrl+o");
    // The folder is read on another thread.
    std::thread::sleep(HESITATION);
    viewer.press("Down");
    viewer.press("Return");
    viewer.wait_until_keys_are_followed();
    let triangle = viewer.picture();
    let [same, other] = [&still, &triangle].map(|picture| difference(&sphere, picture));
    assert!(
        same < SETTLING && other > 5.0 * SETTLING,
        "no choice changes the picture by {same}, another mesh by {other}"
    );
}

#[test]
fn the_window_is_drawn_and_closes_while_shaders_are_compiled() {
    if is_left_out() {
        return;
    }
    let (dir, _path) = folder_with_asset();
    let display = Display::open();
    let start = Instant::now();
    let mut viewer = Viewer::start(&display, dir.path(), &["weave.spmm"], "bvh");
    let picture = SIZE[0] - PANEL_WIDTH;
    viewer.wait_until("the window shows a picture and its panel", |_| {
        display.count_colours(0..picture) > 40 && display.count_colours(picture..SIZE[0]) > 40
    });
    let drawn = start.elapsed();
    // What stands in for the picture is not saved.
    viewer.press("p");
    std::thread::sleep(HESITATION);
    let is_ready = viewer.picture_path(1).exists();
    let (closing, driver) = (Instant::now(), Gpu::headless(None).unwrap().interface());
    viewer.press("ctrl+q");
    assert_eq!(viewer.exit_code(), Some(0));
    let closed = closing.elapsed();
    println!("{driver}: drawn after {drawn:.1?}, renderer ready by then: {is_ready}, closed in {closed:.1?}");
    // A software driver takes far longer than that to compile.
    assert!(!is_ready || !driver.ends_with("Cpu"), "the window was drawn only after {drawn:?}, when all was compiled");
    assert!(closed < CLOSING, "{closed:?}");
}
