//! `btf-view ASSET ...`: shows assets and leaves on a mesh, or the scene of a file.

use super::assets::load_assets;
use super::parse::{parse_leaf_mode, parse_scale, parse_scale_of_heights};
use super::scene_options::{PictureArguments, choose_camera, light_scene};
use super::show::show;
use btf_runtime::LeafMode;
use btf_viewer::{MeshChoice, Scene, SceneAsset, SceneLeaf, Shown, ViewerError, load_scene};
use std::path::PathBuf;
use std::sync::Arc;

#[derive(clap::Args)]
pub(super) struct ViewArguments {
    /// Packed assets, made by `btf-fit fit CAPTURE -o ASSET.spmm`
    pub(super) assets: Vec<PathBuf>,
    /// A leaf that is evaluated live: contents, gloss and textures, as `btf-synth leaf --write-leaf` writes them
    #[arg(long, value_name = "LEAF.toml")]
    pub(super) leaf: Vec<PathBuf>,
    /// Table of an algorithmic model by which live leaves are drawn, as `btf-synth scatter` writes it
    #[arg(long, value_name = "MODEL.leaftable")]
    pub(super) leaf_table: Option<PathBuf>,
    /// How the bodies of live leaves are evaluated: n-layers, two-sided (a back paler than its front), rational or three-piece
    #[arg(long, value_name = "MODE", value_parser = parse_leaf_mode, conflicts_with = "leaf_table")]
    pub(super) leaf_mode: Option<LeafMode>,
    /// Scene description: meshes, materials, lights, camera
    #[arg(long, value_name = "SCENE.toml", conflicts_with_all = ["mesh", "uv_scale"])]
    pub(super) scene: Option<PathBuf>,
    /// sphere, plane, leaf, cornell, cloth, shoe, boots, pullover, or an .obj, .gltf or .glb file
    #[arg(long, default_value = "sphere", value_name = "MESH")]
    pub(super) mesh: String,
    /// How often the material is repeated along u and v
    #[arg(long, default_value = "1", value_name = "N|UxV", value_parser = parse_scale)]
    pub(super) uv_scale: [f32; 2],
    /// Displaces surfaces by their assets' heights times this: 1 as they are, 0 not at all
    #[arg(long, value_name = "SCALE", value_parser = parse_scale_of_heights)]
    pub(super) displacement: Option<f32>,
    /// An asset to compare with: the window's split view shows it in place of the leaf, or of the first asset
    #[arg(long, value_name = "ASSET.spmm", conflicts_with = "headless")]
    pub(super) compare: Option<PathBuf>,
    /// Which of the scene's cameras, counted from 1
    #[arg(long, value_name = "N", requires = "scene", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) camera: Option<u32>,
    #[command(flatten)]
    pub(super) picture: PictureArguments,
}

/// Runs the command.
///
/// # Errors
/// The errors of the files that it names, and of the window or the picture.
pub(super) fn run(arguments: &ViewArguments) -> Result<(), ViewerError> {
    let compare = arguments.compare.iter().map(|path| SceneAsset::load(path).map(Arc::new)).next().transpose()?;
    show(&arguments.picture, make_scene(arguments)?, compare, None)
}

/// Makes the scene of a file, or the built-in one with the mesh that is asked for, as the options light and displace
/// it.
fn make_scene(arguments: &ViewArguments) -> Result<Scene, ViewerError> {
    let leaves = arguments.leaf.iter().map(|path| SceneLeaf::load(path)).collect::<Result<_, _>>()?;
    let shown = Shown { assets: load_assets(&arguments.assets)?, leaves };
    let mesh = MeshChoice::from_argument(&arguments.mesh);
    let mut scene = match &arguments.scene {
        Some(path) => load_scene(path, shown)?,
        None => Scene::built_in(&mesh, shown, arguments.uv_scale)?,
    };
    draw_leaves(&mut scene, arguments)?;
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

/// Draws the scene's live leaves in the mode, or by the table, that is asked for.
fn draw_leaves(scene: &mut Scene, arguments: &ViewArguments) -> Result<(), ViewerError> {
    if (arguments.leaf_mode.is_some() || arguments.leaf_table.is_some()) && scene.leaves.is_empty() {
        return Err(ViewerError::Usage(
            "--leaf-mode and --leaf-table need a live leaf; name one with `--leaf LEAF.toml`, which `btf-synth leaf \
             --write-leaf` writes"
                .into(),
        ));
    }
    for leaf in &mut scene.leaves {
        if let Some(table) = &arguments.leaf_table {
            leaf.add_table(table)?;
        }
        if let Some(mode) = arguments.leaf_mode {
            leaf.describe(leaf.description.clone(), mode)?;
        }
    }
    Ok(())
}
