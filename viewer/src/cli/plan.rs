//! `btf-view plan`: trims assets to what a scene's pictures need of them.

use super::assets::load_assets;
use super::parse::{parse_positive, parse_size};
use super::progress::with_progress;
use super::render_arguments::RenderArguments;
use super::report::write_json;
use btf_capture::bytes_from_text;
use btf_viewer::{Plan, RenderParams, Scene, ViewerError, load_scene, plan, scene_with_assets};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(super) struct PlanArguments {
    /// Scene description; its cameras are those that the assets must suffice for
    pub(super) scene: PathBuf,
    /// Packed assets that the scene names by number
    pub(super) assets: Vec<PathBuf>,
    /// Folder for the trimmed assets and a scene.toml that names them
    #[arg(short, long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Size of the pictures in pixels
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "512x512")]
    pub(super) size: [u32; 2],
    /// How near an asset's pixels stay to those of the whole asset, dB
    #[arg(long, value_name = "DB", value_parser = parse_positive, default_value = "40")]
    pub(super) psnr: f32,
    /// Write resident forms that all together take at most this size of memory, such as 40MB
    #[arg(long, value_name = "SIZE", value_parser = bytes_from_text)]
    pub(super) memory_budget: Option<u64>,
    /// Frames to average
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) frames: u32,
    #[command(flatten)]
    pub(super) render: RenderArguments,
    /// Writes the figures as JSON; - is stdout
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// [`ViewerError::Usage`] where a file that is read would be overwritten, and for packed bases of each asset; those of
/// [`plan`] and of writing files.
pub(super) fn run(arguments: &PlanArguments) -> Result<(), ViewerError> {
    let render = &arguments.render;
    if render.packing().is_some() {
        return Err(ViewerError::Usage(
            "a plan shares memory out among all assets; give --memory-budget in place of --resident-bytes and \
             --resident-psnr"
                .into(),
        ));
    }
    let scene = load_scene(&arguments.scene, load_assets(&arguments.assets)?)?;
    let params = RenderParams {
        size: arguments.size,
        frames: arguments.frames,
        backend: render.backend(),
        adapter: render.adapter.clone(),
        shade: render.shade(),
        volume_budget_mb: render.volume_budget,
        ..RenderParams::default()
    };
    let folder = &arguments.out;
    // Before the work, so that nobody waits for a refusal.
    let files = planned_files(&scene, arguments)?;
    btf_capture::atomic::create_folder(folder)?;
    let plan = with_progress(render.quiet, |control| {
        plan(&scene, &params, arguments.psnr.into(), arguments.memory_budget, control)
    })?;
    let text = scene_with_assets(&arguments.scene, &scene.assets, &files, folder)?;
    for (asset, file) in plan.assets.iter().zip(&files) {
        let path = folder.join(file);
        btf_capture::atomic::write_file_atomically(&path, &asset.packed)?;
    }
    btf_capture::atomic::write_file_atomically(folder.join("scene.toml"), text.as_bytes())?;
    write_json(arguments.json.as_deref(), &plan)?;
    if arguments.json.as_deref().is_some_and(|path| path.as_os_str() == "-") || render.quiet {
        return Ok(());
    }
    print_plan(&plan, arguments);
    Ok(())
}

/// Prints what the plan keeps of each asset, and what is saved.
fn print_plan(plan: &Plan, arguments: &PlanArguments) {
    println!(
        "{:<16} {:>8} {:>13} {:>22} {:>14} {:>10} {:>22} {:>24} {:>8}",
        "asset", "pixels", "level", "texels", "components", "lobes", "bytes", "bytes in memory", "dB"
    );
    for asset in &plan.assets {
        let [[w, h], [kept_w, kept_h]] = asset.texels;
        println!(
            "{:<16} {:>8} {:>13} {:>22} {:>14} {:>10} {:>22} {:>24} {:>8}",
            asset.name,
            asset.pixels,
            if asset.pixels == 0 { "not seen".into() } else { asset.level.to_string() },
            format!("{w}x{h} -> {kept_w}x{kept_h}"),
            format!("{} -> {}", asset.components[0], asset.components[1]),
            format!("{} -> {}", asset.lobes[0], asset.lobes[1]),
            format!("{} -> {}", asset.bytes[0], asset.bytes[1]),
            format!("{} -> {}", asset.resident_bytes[0], asset.resident_bytes[1]),
            asset.psnr_db.map_or("-".into(), |psnr| format!("{psnr:.1}"))
        );
    }
    let told = |[whole, kept]: [usize; 2]| format!("{kept} bytes in place of {whole}");
    println!(
        "files take {}, in memory {}; pictures differ by {:.1} dB",
        told(plan.bytes),
        told(plan.resident_bytes),
        plan.psnr_db
    );
    if plan.assets.iter().any(|asset| asset.psnr_db.is_some_and(|psnr| psnr < f64::from(arguments.psnr))) {
        println!("{} dB are not reached everywhere; keep the whole assets where that matters", arguments.psnr);
    }
    println!("written to {}", arguments.out.display());
}

/// Returns names for the files of a plan's assets, without a folder, in the order of `scene.assets`.
///
/// # Errors
/// [`ViewerError::Usage`] where the plan would overwrite what it reads.
fn planned_files(scene: &Scene, arguments: &PlanArguments) -> Result<Vec<String>, ViewerError> {
    // Assets of the same name, letters large or small, are told apart by numbers.
    let mut files: Vec<String> = Vec::new();
    for asset in &scene.assets {
        let extension = if arguments.memory_budget.is_some() { "resident.spmm" } else { "spmm" };
        let numbered = |number: usize| match number {
            0 => format!("{}.{extension}", asset.name),
            _ => format!("{}_{number}.{extension}", asset.name),
        };
        let free = |name: &String| files.iter().all(|known| known.to_lowercase() != name.to_lowercase());
        let name = (0..=files.len()).map(numbered).find(free);
        files.extend(name);
    }
    let mut sources: Vec<&Path> = scene.assets.iter().filter_map(|asset| asset.path.as_deref()).collect();
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

/// Tells whether two paths name the same file; `false` where one of them does not exist.
fn same_file(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}
