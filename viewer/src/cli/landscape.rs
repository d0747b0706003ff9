//! `btf-view scene`: shows a landscape of volumetric textures.

use super::parse::parse_wind;
use super::scene_options::{PictureArguments, choose_camera, light_scene};
use super::show::show;
use btf_viewer::{Landscape, LandscapeParams, ViewerError};
use std::path::PathBuf;

#[derive(clap::Args)]
pub(super) struct LandscapeArguments {
    /// Which landscape
    #[arg(value_enum)]
    pub(super) landscape: Landscape,
    /// Factor of the published numbers of plants, and of the land they stand on
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    pub(super) times: u32,
    /// Finer volumes in place of those that come with the program, by `btf-fit voltex`; the lawn takes two, without and
    /// with a flower, the forest two, broad-leaved trees and spruces, or one for all its trees
    #[arg(long, value_name = "FILE.voltex")]
    pub(super) volume: Vec<PathBuf>,
    /// Models of the plants, by `btf-synth plants`, which are seen where leaves are wider than pixels; the lawn takes
    /// two, without and with a flower, the forest four, two broad-leaved trees and two spruces, or two for all its trees
    #[arg(long, value_name = "FILE")]
    pub(super) mesh: Vec<PathBuf>,
    /// 1 from afar, 2 nearer, 3 from close by
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=3))]
    pub(super) camera: u32,
    /// Wind from the west, metres a second; see --time and --sequence
    #[arg(long, value_name = "M/S", value_parser = parse_wind)]
    pub(super) wind: Option<f32>,
    #[command(flatten)]
    pub(super) picture: PictureArguments,
}

/// Runs the command.
///
/// # Errors
/// The errors of [`Landscape::scene`], and of the window or the picture.
pub(super) fn run(arguments: &LandscapeArguments) -> Result<(), ViewerError> {
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
