//! `btf-view`: shows packed BTF assets in a window, or renders them into a picture.

use btf_runtime::{DecodeOptions, Interpolation};
use btf_viewer::{
    Ambient, BackendChoice, BenchKind, BenchParams, Control, Daylight, DaylightParts, Environment, GpuTracer,
    Landscape, LandscapeCounts, LandscapeParams, MeshChoice, Outdoors, RenderMode, RenderParams, RenderReport, Scene,
    SceneAsset, SceneLeaf, Sequence, ShadeOptions, Shown, SkyLight, ViewerError, WindowParams, bench_svg, load_scene,
    plan, render_sequence, run_bench, run_window, scene_with_assets,
};
use clap::{Parser, ValueEnum};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const EXAMPLES: &str = "\
Examples:
  btf-view leaf.spmm
  btf-view leaf.spmm --headless --out leaf.png --size 512x512
  btf-view leaf.spmm cloth.spmm --mesh cornell --lights 3
  btf-view --scene scene.toml --headless --out picture.png --json -
  btf-view bench lights cloth.spmm --plot lights.svg

In the window: drag turns, the wheel zooms, Shift or the right button moves.";

/// Pictures of a sequence in a second.
const USUAL_FPS: f32 = 25.0;

/// Shows packed BTF assets (.spmm) on a mesh, lit by point lights.
#[derive(Parser)]
#[command(name = "btf-view", version, after_help = EXAMPLES, args_conflicts_with_subcommands = true,
          subcommand_help_heading = "Other commands")]
struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    view: ViewArguments,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Measures how the time of a frame grows, and with what
    #[command(after_help = "Example: btf-view bench lights cloth.spmm --json lights.json --plot lights.svg")]
    Bench(BenchArguments),
    /// Says what a scene's pictures need of its assets, and writes assets that hold no more
    #[command(after_help = "Example: btf-view plan scene.toml -o trimmed && btf-view --scene trimmed/scene.toml")]
    Plan(PlanArguments),
    /// Shows a lawn, a grove or a forest of volumetric textures
    #[command(after_help = "Examples:
  btf-view scene lawn
  btf-view scene forest --headless --out forest.png --size 768x576 --frames 16
  btf-view scene grove --times 10 --camera 3 --headless --out grove.png --json -
  btf-view scene lawn --wind 4 --camera 2 --headless --out wind.png --sequence 50")]
    Scene(LandscapeArguments),
}

#[derive(clap::Args)]
struct LandscapeArguments {
    /// Which landscape
    #[arg(value_enum)]
    landscape: Landscape,
    /// So many times the published counts, on so much more land
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    times: u32,
    /// Finer volumes in place of those that come with the program, by `btf-fit voltex`; the lawn takes two, without and with
    /// a flower
    #[arg(long, value_name = "FILE.voltex")]
    volume: Vec<PathBuf>,
    /// Models of the plants, by `btf-synth plants`, which are seen where leaves are wider than pixels; the lawn takes two, without
    /// and with a flower, the forest its two trees
    #[arg(long, value_name = "FILE")]
    mesh: Vec<PathBuf>,
    /// 1 from afar, 2 nearer, 3 from close by
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=3))]
    camera: u32,
    /// Wind from the west, metres a second; see --time and --sequence
    #[arg(long, value_name = "M/S", value_parser = parse_wind)]
    wind: Option<f32>,
    #[command(flatten)]
    picture: PictureArguments,
}

#[derive(clap::Args)]
struct PlanArguments {
    /// Scene description; its cameras are those that the assets must suffice for
    scene: PathBuf,
    /// Packed assets that the scene names by number
    assets: Vec<PathBuf>,
    /// Folder for the trimmed assets and a scene.toml that names them
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    /// Size of the pictures in pixels
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "512x512")]
    size: [u32; 2],
    /// How near an asset's pixels stay to those of the whole asset, dB
    #[arg(long, value_name = "DB", value_parser = parse_positive, default_value = "40")]
    psnr: f32,
    /// Frames to average
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    #[command(flatten)]
    common: CommonArguments,
    /// Writes the figures as JSON; - is stdout
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(clap::Args)]
struct BenchArguments {
    /// What is varied
    #[arg(value_enum)]
    kind: BenchKind,
    /// Packed assets [default: a small one that comes with the program]
    assets: Vec<PathBuf>,
    /// Model that `triangles` places ever more often, and `resolution` if it is given: an .obj, .gltf or .glb file
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "512x512")]
    size: [u32; 2],
    #[command(flatten)]
    common: CommonArguments,
    /// Writes the rows as JSON; - is stdout
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Writes a plot
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

/// What every command understands.
#[derive(clap::Args)]
struct CommonArguments {
    /// What traces rays and decodes
    #[arg(long, value_enum, default_value_t = BackendName::Auto)]
    backend: BackendName,
    /// Part of the name of the adapter to use, where there are several
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Residual components at most [default: all]
    #[arg(long, value_name = "N")]
    components: Option<u32>,
    /// Lobes per texel at most [default: all]
    #[arg(long, value_name = "N")]
    lobes: Option<u32>,
    /// How the residual is carried between measured directions
    #[arg(long, value_enum, default_value_t = InterpolationName::Fast)]
    interpolation: InterpolationName,
    /// Leave the parallax of eyes beyond the measured views, also where an asset has heights
    #[arg(long)]
    no_parallax: bool,
    /// Which light is followed: straight from lamps and surroundings, or on any way
    #[arg(long, value_enum, default_value_t = RenderMode::Direct)]
    mode: RenderMode,
    /// Point lights of which a frame asks at most; of more it draws those that matter
    #[arg(long, value_name = "N", default_value_t = ShadeOptions::default().light_samples,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(btf_viewer::MAX_LIGHT_SAMPLES)))]
    light_samples: u32,
    /// Rays of a path at most: 1 shows no mirror images
    #[arg(long, value_name = "N", default_value_t = ShadeOptions::default().depth,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(btf_viewer::MAX_DEPTH)))]
    depth: u32,
    /// Always the finest texels, however small they are in the picture
    #[arg(long)]
    no_levels: bool,
    /// How a sky lights surfaces: by rays to its parts, or by the irradiance of the normal times how much is open
    #[arg(long, value_enum, default_value_t = SkyLight::Rays)]
    sky: SkyLight,
    /// Threads of the CPU decoder [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    threads: Option<u32>,
    /// Prints nothing but errors
    #[arg(long)]
    quiet: bool,
}

impl CommonArguments {
    fn shade(&self) -> ShadeOptions {
        let decode = DecodeOptions {
            components: self.components.unwrap_or(u32::MAX),
            lobes: self.lobes.unwrap_or(u32::MAX),
            interpolation: match self.interpolation {
                InterpolationName::Fast => Interpolation::Fast,
                InterpolationName::Exact => Interpolation::Exact,
            },
            parallax: !self.no_parallax,
        };
        ShadeOptions {
            decode,
            mode: self.mode,
            light_samples: self.light_samples,
            depth: self.depth,
            levels: !self.no_levels,
            sky: self.sky,
        }
    }

    fn backend(&self) -> BackendChoice {
        match self.backend {
            BackendName::Auto => BackendChoice::Auto,
            BackendName::RayQuery => BackendChoice::Gpu(GpuTracer::RayQuery),
            BackendName::Bvh => BackendChoice::Gpu(GpuTracer::Bvh),
            BackendName::Cpu => BackendChoice::Cpu,
        }
    }
}

#[derive(clap::Args)]
struct ViewArguments {
    /// Packed assets, made by `btf-fit fit CAPTURE -o ASSET.spmm`
    assets: Vec<PathBuf>,
    /// A leaf that is evaluated live: contents, gloss and textures, as `btf-synth leaf --write-leaf` writes them
    #[arg(long, value_name = "LEAF.toml")]
    leaf: Vec<PathBuf>,
    /// Scene description: meshes, materials, lights, camera
    #[arg(long, value_name = "SCENE.toml", conflicts_with_all = ["mesh", "uv_scale"])]
    scene: Option<PathBuf>,
    /// sphere, plane, leaf, cornell, cloth, shoe, boots, pullover, or an .obj, .gltf or .glb file
    #[arg(long, default_value = "sphere", value_name = "MESH")]
    mesh: String,
    /// How often the material is repeated along u and v
    #[arg(long, default_value = "1", value_name = "N|UxV", value_parser = parse_scale)]
    uv_scale: [f32; 2],
    /// Displaces surfaces by their assets' heights times this: 1 as they are, 0 not at all
    #[arg(long, value_name = "SCALE", value_parser = parse_scale_of_heights)]
    displacement: Option<f32>,
    /// An asset to compare with: the window's split view shows it in place of the leaf, or of the first asset
    #[arg(long, value_name = "ASSET.spmm", conflicts_with = "headless")]
    compare: Option<PathBuf>,
    /// Which of the scene's cameras, counted from 1
    #[arg(long, value_name = "N", requires = "scene", value_parser = clap::value_parser!(u32).range(1..))]
    camera: Option<u32>,
    #[command(flatten)]
    picture: PictureArguments,
}

/// How a scene is lit, and the picture or window that shows it.
#[derive(clap::Args)]
struct PictureArguments {
    /// Number of point lights, of the same brightness together [default: 1, or the scene's own]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    lights: Option<u32>,
    /// Light from all around, an equirectangular .exr or .hdr picture; --lights then adds lamps
    #[arg(long, value_name = "FILE")]
    environment: Option<PathBuf>,
    /// Sun and clear sky of this moment, as in 2026-06-21T12:00+02:00; --lights then adds lamps
    #[arg(long, value_name = "DATE-TIME", requires = "place", conflicts_with = "environment")]
    daylight: Option<String>,
    /// Where: latitude and longitude in degrees, north and east positive, as in 52.5,13.4
    #[arg(long, value_name = "LAT,LON", requires = "daylight", allow_hyphen_values = true)]
    place: Option<String>,
    /// Turbidity of the air, 1 (none but the air itself) to 10 (haze) [default: 3]
    #[arg(long, value_name = "T", requires = "daylight")]
    turbidity: Option<f64>,
    /// Sun and sky, or one of them
    #[arg(long, value_enum, default_value_t = DaylightParts::Both, requires = "daylight")]
    daylight_parts: DaylightParts,
    /// Ambient light with progressive occlusion: one stratified ray per pixel and frame
    #[arg(long)]
    ao: bool,
    /// Radiance of the ambient light, where a white surface has 1 [default: 0.4, or the scene's own]; turns --ao on
    #[arg(long, value_name = "R", value_parser = parse_positive)]
    ambient: Option<f32>,
    /// What lies farther away does not occlude, scene units [default: half the scene's radius]; turns --ao on
    #[arg(long, value_name = "D", value_parser = parse_positive)]
    ao_distance: Option<f32>,
    /// Exposure in stops [default: 0, or the scene's own]
    #[arg(long, value_name = "EV", allow_hyphen_values = true)]
    exposure: Option<f32>,
    /// Renders a picture instead of opening a window
    #[arg(long, requires = "out")]
    headless: bool,
    /// The picture, 8-bit sRGB PNG
    #[arg(long, value_name = "FILE.png", requires = "headless")]
    out: Option<PathBuf>,
    /// Size of the picture or window in pixels
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<[u32; 2]>,
    /// Renders N pictures around the scene, FILE_000.png and so on
    #[arg(long, value_name = "N", requires = "headless", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    turntable: Option<u32>,
    /// The moment at which a scene with a wind is seen, seconds [default: 0]
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds, allow_hyphen_values = true)]
    time: Option<f64>,
    /// Renders N pictures of the wind, one after the other, FILE_000.png and so on
    #[arg(long, value_name = "N", requires = "headless", conflicts_with = "turntable",
          value_parser = clap::value_parser!(u32).range(1..=10_000))]
    sequence: Option<u32>,
    /// Pictures of a sequence in a second [default: 25]
    #[arg(long, value_name = "N", requires = "sequence", value_parser = parse_positive)]
    fps: Option<f32>,
    /// Milliseconds that a frame may take: components, lobes and lights are saved until it does
    #[arg(long, value_name = "N", value_parser = parse_positive)]
    target_ms: Option<f32>,
    /// Frames to average: each adds a sample per pixel, the first through its middle
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Writes the figures as JSON; - is stdout
    #[arg(long, value_name = "FILE", requires = "headless")]
    json: Option<PathBuf>,
    #[command(flatten)]
    common: CommonArguments,
}

#[derive(Clone, Copy, ValueEnum)]
enum BackendName {
    Auto,
    RayQuery,
    Bvh,
    Cpu,
}

#[derive(Clone, Copy, ValueEnum)]
enum InterpolationName {
    Fast,
    Exact,
}

fn parse_size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    sides
        .filter(|sides: &[u32; 2]| sides.iter().all(|side| (1..=btf_viewer::MAX_SIDE).contains(side)))
        .ok_or_else(|| format!("a size is WIDTHxHEIGHT, as in 512x512, each 1 to {}", btf_viewer::MAX_SIDE))
}

fn parse_scale(text: &str) -> Result<[f32; 2], String> {
    let scale = match text.split_once('x') {
        Some((u, v)) => u.parse().ok().zip(v.parse().ok()).map(|(u, v)| [u, v]),
        None => text.parse().ok().map(|both| [both, both]),
    };
    scale
        .filter(|scale: &[f32; 2]| scale.iter().all(|x| x.is_finite() && *x > 0.0))
        .ok_or_else(|| "a scale is a number above 0, as in 2, or two, as in 2x3".into())
}

fn parse_positive(text: &str) -> Result<f32, String> {
    text.parse()
        .ok()
        .filter(|x: &f32| x.is_finite() && *x > 0.0)
        .ok_or_else(|| "it is a number above 0, as in 0.5".into())
}

fn parse_seconds(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| "it is a number of seconds, as in 2.5".into())
}

fn parse_wind(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|x: &f32| (0.0..=60.0).contains(x)).ok_or_else(|| "it is a number from 0 to 60".into())
}

fn parse_scale_of_heights(text: &str) -> Result<f32, String> {
    text.parse().ok().filter(|x: &f32| (0.0..=100.0).contains(x)).ok_or_else(|| "it is a number from 0 to 100".into())
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), ViewerError> {
    let common = match &arguments.command {
        Some(Command::Bench(bench)) => &bench.common,
        Some(Command::Plan(plan)) => &plan.common,
        Some(Command::Scene(landscape)) => &landscape.picture.common,
        None => &arguments.view.picture.common,
    };
    if let Some(threads) = common.threads {
        // The pool can only be set once, and this is the first use.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(threads as usize).build_global();
    }
    match &arguments.command {
        Some(Command::Bench(bench)) => measure(bench),
        Some(Command::Plan(plan)) => trim(plan),
        Some(Command::Scene(landscape)) => show_landscape(landscape),
        None => {
            let view = &arguments.view;
            let compare = view.compare.iter().map(|path| SceneAsset::load(path).map(Arc::new)).next().transpose()?;
            show(&view.picture, make_scene(view)?, compare, None)
        }
    }
}

fn show_landscape(arguments: &LandscapeArguments) -> Result<(), ViewerError> {
    let params = LandscapeParams {
        times: arguments.times,
        volumes: arguments.volume.clone(),
        meshes: arguments.mesh.clone(),
        wind_m_per_s: arguments.wind,
    };
    let (mut scene, counts) = arguments.landscape.scene(&params)?;
    choose_camera(&mut scene, arguments.camera)?;
    light_scene(&mut scene, &arguments.picture)?;
    show(&arguments.picture, scene, None, Some(counts))
}

/// Writes the picture that is asked for, or opens a window. `counts` are a landscape's.
fn show(
    arguments: &PictureArguments,
    mut scene: Scene,
    compare: Option<Arc<SceneAsset>>,
    counts: Option<LandscapeCounts>,
) -> Result<(), ViewerError> {
    let common = &arguments.common;
    let (backend, adapter, shade) = (common.backend(), common.adapter.clone(), common.shade());
    let target_ms = arguments.target_ms.map(f64::from);
    if scene.wind.is_none() && (arguments.time.is_some() || arguments.sequence.is_some()) {
        return Err(ViewerError::Usage(
            "nothing moves in this scene: give `btf-view scene` a --wind, or the scene's file skins and a [wind]"
                .into(),
        ));
    }
    scene.blow(arguments.time.unwrap_or(0.0))?;
    match &arguments.out {
        Some(out) => {
            let size = arguments.size.unwrap_or([512, 512]);
            let params = RenderParams { size, frames: arguments.frames, backend, adapter, shade, target_ms };
            headless(arguments, &scene, params, out, counts)
        }
        None => run_window(scene, WindowParams { size: arguments.size, backend, adapter, shade, target_ms, compare }),
    }
}

fn measure(arguments: &BenchArguments) -> Result<(), ViewerError> {
    let common = &arguments.common;
    let mut assets = load_assets(&arguments.assets)?;
    if assets.is_empty() {
        assets.push(Arc::new(SceneAsset::built_in()));
    }
    let params = BenchParams {
        kind: arguments.kind,
        mesh: arguments.mesh.clone(),
        size: arguments.size,
        backend: common.backend(),
        adapter: common.adapter.clone(),
        shade: common.shade(),
    };
    let report = with_progress(common.quiet, |control| run_bench(&assets, &params, control))?;
    if let Some(path) = &arguments.plot {
        let svg = bench_svg(&report).map_err(ViewerError::Usage)?;
        btf_capture::atomic::write_file_atomically(path, svg.as_bytes())?;
    }
    match arguments.json.as_deref() {
        path @ Some(_) => write_json(path, &report)?,
        None if common.quiet => {}
        None => {
            println!("{} on {} ({}), {}", report.backend, report.adapter, report.timer, report.assets.join(", "));
            println!(
                "mesh       lights materials coverage       size components  triangles    ms a frame   dB  variant"
            );
            for row in &report.rows {
                println!(
                    "{:<10} {:>6} {:>9} {:>8.3} {:>10} {:>10} {:>10} {:>13.3} {:>5} {} {}{}",
                    row.mesh,
                    row.lights,
                    row.materials,
                    row.coverage,
                    format!("{}x{}", row.width, row.height),
                    row.components,
                    row.triangles,
                    row.frame_ms,
                    row.psnr_db.map_or(String::new(), |psnr| format!("{psnr:.1}")),
                    row.interpolation,
                    row.variant,
                    if row.front { " *" } else { "" }
                );
            }
            for row in &report.leaf_modes {
                println!(
                    "live leaf, {:<11}: Delta E00 {:.2} mean, {:.2} max; {:.0} ns for place and eye, {:.0} ns for a light",
                    row.mode, row.delta_e00_mean, row.delta_e00_max, row.view_ns, row.light_ns
                );
            }
        }
    }
    Ok(())
}

fn trim(arguments: &PlanArguments) -> Result<(), ViewerError> {
    let common = &arguments.common;
    let scene = load_scene(&arguments.scene, load_assets(&arguments.assets)?)?;
    let params = RenderParams {
        size: arguments.size,
        frames: arguments.frames,
        backend: common.backend(),
        adapter: common.adapter.clone(),
        shade: common.shade(),
        target_ms: None,
    };
    let folder = &arguments.out;
    // Before the work, so that nobody waits for a refusal.
    let files = planned_files(&scene, arguments)?;
    btf_capture::atomic::create_folder(folder)?;
    let plan = with_progress(common.quiet, |control| plan(&scene, &params, arguments.psnr.into(), control))?;
    let text = scene_with_assets(&arguments.scene, &scene.assets, &files, folder)?;
    for (asset, file) in plan.assets.iter().zip(&files) {
        let path = folder.join(file);
        btf_capture::atomic::write_file_atomically(&path, &asset.packed)?;
    }
    btf_capture::atomic::write_file_atomically(folder.join("scene.toml"), text.as_bytes())?;
    write_json(arguments.json.as_deref(), &plan)?;
    if arguments.json.as_deref().is_some_and(|path| path.as_os_str() == "-") || common.quiet {
        return Ok(());
    }
    println!(
        "{:<16} {:>8} {:>13} {:>22} {:>14} {:>10} {:>22} {:>8}",
        "asset", "pixels", "level", "texels", "components", "lobes", "bytes", "dB"
    );
    for asset in &plan.assets {
        let [[w, h], [kept_w, kept_h]] = asset.texels;
        println!(
            "{:<16} {:>8} {:>13} {:>22} {:>14} {:>10} {:>22} {:>8}",
            asset.name,
            asset.pixels,
            if asset.pixels == 0 { "not seen".into() } else { asset.level.to_string() },
            format!("{w}x{h} -> {kept_w}x{kept_h}"),
            format!("{} -> {}", asset.components[0], asset.components[1]),
            format!("{} -> {}", asset.lobes[0], asset.lobes[1]),
            format!("{} -> {}", asset.bytes[0], asset.bytes[1]),
            asset.psnr_db.map_or("-".into(), |psnr| format!("{psnr:.1}"))
        );
    }
    let [whole, kept] = plan.bytes;
    println!(
        "saved {} of {whole} bytes ({:.0} %); pictures differ by {:.1} dB",
        whole.saturating_sub(kept),
        100.0 * (1.0 - kept as f64 / whole.max(1) as f64),
        plan.psnr_db
    );
    if plan.assets.iter().any(|asset| asset.psnr_db.is_some_and(|psnr| psnr < f64::from(arguments.psnr))) {
        println!("{} dB are not reached everywhere; keep the whole assets where that matters", arguments.psnr);
    }
    println!("written to {}", folder.display());
    Ok(())
}

/// Names of the files of a plan's assets.
///
/// # Errors
/// [`ViewerError::Usage`] where the plan would overwrite what it reads.
fn planned_files(scene: &Scene, arguments: &PlanArguments) -> Result<Vec<String>, ViewerError> {
    // Assets of the same name, letters large or small, are told apart by numbers.
    let mut files: Vec<String> = Vec::new();
    for asset in &scene.assets {
        let numbered = |number: usize| match number {
            0 => format!("{}.spmm", asset.name),
            _ => format!("{}_{number}.spmm", asset.name),
        };
        let free = |name: &String| files.iter().all(|known| known.to_lowercase() != name.to_lowercase());
        let name = (0..=files.len()).map(numbered).find(free);
        files.extend(name);
    }
    let mut sources: Vec<&std::path::Path> = scene.assets.iter().filter_map(|asset| asset.path.as_deref()).collect();
    sources.push(&arguments.scene);
    for file in files.iter().map(String::as_str).chain(["scene.toml"]) {
        let path = arguments.out.join(file);
        if sources.iter().any(|source| same_file(source, &path)) {
            return Err(ViewerError::Usage(format!(
                "{} belongs to the scene and would be overwritten; give another folder with -o",
                path.display()
            )));
        }
    }
    Ok(files)
}

fn same_file(a: &std::path::Path, b: &std::path::Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// To a file, or to stdout where it is `-`.
fn write_json(path: Option<&std::path::Path>, value: &impl serde::Serialize) -> Result<(), ViewerError> {
    let json = serde_json::to_string_pretty(value).unwrap_or_default();
    match path {
        Some(path) if path.as_os_str() == "-" => println!("{json}"),
        Some(path) => btf_capture::atomic::write_file_atomically(path, json.as_bytes())?,
        None => {}
    }
    Ok(())
}

fn load_assets(paths: &[PathBuf]) -> Result<Vec<Arc<SceneAsset>>, ViewerError> {
    paths.iter().map(|path| SceneAsset::load(path).map(Arc::new)).collect()
}

/// Runs `work` with a progress bar, notices on stderr, and an ear for Ctrl-C.
fn with_progress<T>(quiet: bool, work: impl FnOnce(&Control) -> Result<T, ViewerError>) -> Result<T, ViewerError> {
    static CANCELLED: AtomicBool = AtomicBool::new(false);
    // Without a handler Ctrl-C ends the program anyway, only not with 130.
    let _ = ctrlc::set_handler(|| CANCELLED.store(true, Ordering::Relaxed));
    const STEPS: f32 = 1000.0;
    let bar = if quiet {
        indicatif::ProgressBar::hidden()
    } else {
        indicatif::ProgressBar::new(STEPS as u64).with_style(
            indicatif::ProgressStyle::with_template("{bar:40} {percent}% {eta}").unwrap_or_else(|_| {
                // The template is a constant; the default style is as good.
                indicatif::ProgressStyle::default_bar()
            }),
        )
    };
    let notice = |text: &str| {
        if !quiet {
            eprintln!("note: {text}");
        }
    };
    let control = Control {
        cancelled: &|| CANCELLED.load(Ordering::Relaxed),
        progress: &|share| bar.set_position((share * STEPS) as u64),
        notice: &notice,
    };
    let result = work(&control);
    bar.finish_and_clear();
    if CANCELLED.load(Ordering::Relaxed) {
        return Err(ViewerError::Interrupted);
    }
    result
}

fn make_scene(arguments: &ViewArguments) -> Result<Scene, ViewerError> {
    let leaves = arguments.leaf.iter().map(|path| SceneLeaf::load(path)).collect::<Result<_, _>>()?;
    let shown = Shown { assets: load_assets(&arguments.assets)?, leaves };
    let mesh = MeshChoice::from_argument(&arguments.mesh);
    let mut scene = match &arguments.scene {
        Some(path) => load_scene(path, shown)?,
        None => Scene::built_in(&mesh, shown, arguments.uv_scale)?,
    };
    choose_camera(&mut scene, arguments.camera.unwrap_or(1))?;
    light_scene(&mut scene, &arguments.picture)?;
    if let Some(scale) = arguments.displacement {
        if scale > 0.0 && !scene.assets.iter().any(|asset| asset.has_heights()) {
            return Err(ViewerError::Usage(
                "--displacement needs an asset with heights; fit it with `btf-fit fit CAPTURE -o ASSET.spmm --heights`"
                    .into(),
            ));
        }
        scene.displace(scale);
    }
    Ok(scene)
}

/// Looks through one of the scene's cameras, counted from 1.
fn choose_camera(scene: &mut Scene, number: u32) -> Result<(), ViewerError> {
    if number > 1 {
        scene.camera = *scene.more_cameras.get(number as usize - 2).ok_or_else(|| {
            ViewerError::Usage(format!("--camera {number}: the scene has {}", scene.more_cameras.len() + 1))
        })?;
    }
    Ok(())
}

/// Gives the scene the lights and the exposure that are asked for.
fn light_scene(scene: &mut Scene, arguments: &PictureArguments) -> Result<(), ViewerError> {
    if let Some(path) = &arguments.environment {
        scene.surround(Environment::load(path, 1.0)?);
    }
    if let (Some(date_time), Some(place)) = (&arguments.daylight, &arguments.place) {
        let mut daylight = Daylight::new(date_time, place)?;
        daylight.turbidity = arguments.turbidity.unwrap_or(daylight.turbidity);
        let light = daylight.sun_and_sky()?;
        scene.stand_outdoors(Outdoors { daylight, parts: arguments.daylight_parts }, light);
    }
    if let Some(count) = arguments.lights {
        scene.place_lights(count as usize);
    }
    if arguments.ao || arguments.ambient.is_some() || arguments.ao_distance.is_some() {
        let usual = scene.usual_ambient();
        if scene.ambient == Ambient::NONE {
            scene.ambient = usual;
        }
        if let Some(radiance) = arguments.ambient {
            scene.ambient.radiance = [radiance; 3];
        }
        scene.ambient.distance = arguments.ao_distance.unwrap_or(scene.ambient.distance);
    }
    scene.exposure_ev = arguments.exposure.unwrap_or(scene.exposure_ev);
    Ok(())
}

/// A picture's figures, and those of the landscape on it.
#[derive(serde::Serialize)]
struct PictureReport {
    #[serde(flatten)]
    picture: RenderReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    landscape: Option<LandscapeCounts>,
}

fn headless(
    arguments: &PictureArguments,
    scene: &Scene,
    params: RenderParams,
    out: &std::path::Path,
    counts: Option<LandscapeCounts>,
) -> Result<(), ViewerError> {
    let quiet = arguments.common.quiet;
    let mut reports = Vec::new();
    let several = arguments.turntable.or(arguments.sequence).is_some();
    let sequence = match arguments.sequence {
        Some(pictures) => {
            let interval_s = 1.0 / f64::from(arguments.fps.unwrap_or(USUAL_FPS));
            Sequence { pictures, turn_rad: 0.0, interval_s }
        }
        None => Sequence::turntable(arguments.turntable.unwrap_or(1)),
    };
    with_progress(quiet, |control| {
        render_sequence(scene, &params, &sequence, control, &mut |number, rendered| {
            if (control.cancelled)() {
                return Err(ViewerError::Interrupted);
            }
            let path = if several { numbered(out, number) } else { out.to_path_buf() };
            rendered.picture.write_png(&path, scene.exposure_ev)?;
            reports.push((path, PictureReport { picture: rendered.report, landscape: counts.clone() }));
            Ok(())
        })
    })?;
    match (arguments.json.as_deref(), reports.as_slice()) {
        (path @ Some(_), [(_, report)]) if !several => write_json(path, report)?,
        (path @ Some(_), all) => write_json(path, &all.iter().map(|(_, report)| report).collect::<Vec<_>>())?,
        (None, _) if quiet => {}
        (None, _) => {
            if let Some(counts) = &counts {
                println!("{counts}");
            }
            for (path, PictureReport { picture: report, .. }) in &reports {
                println!(
                    "{}: {}x{}, {} on {}, {:.2} ms per frame ({})",
                    path.display(),
                    report.width,
                    report.height,
                    report.backend,
                    report.adapter,
                    report.frame_ms,
                    report.timer
                );
            }
        }
    }
    Ok(())
}

/// `a/b.png` as `a/b_007.png`.
fn numbered(path: &std::path::Path, number: u32) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_os_string();
    name.push(format!("_{number:03}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn arguments_are_consistent_and_sizes_and_scales_are_checked() {
        Arguments::command().debug_assert();
        assert_eq!(parse_size("640x480"), Ok([640, 480]));
        assert!(["640", "0x5", "5x", "axb", "99999x2"].iter().all(|text| parse_size(text).is_err()));
        assert_eq!(numbered("a/b.png".as_ref(), 7), PathBuf::from("a/b_007.png"));
        assert_eq!(numbered("b".as_ref(), 1234), PathBuf::from("b_1234"));
        assert_eq!(parse_scale("2"), Ok([2.0, 2.0]));
        assert_eq!(parse_scale("2x0.5"), Ok([2.0, 0.5]));
        assert!(["0", "-1", "nan", "2x", "x"].iter().all(|text| parse_scale(text).is_err()));
    }
}
