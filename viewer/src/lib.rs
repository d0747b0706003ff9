//! Draws surfaces that carry packed BTF assets: a window, pictures without one, and the tests' ways in.
//!
//! ```text
//! SceneAsset::load, Scene::built_in | load_scene --> Scene --render--> Picture --write_png--> PNG
//!                                                      \---run_window--> a window
//! ```
//!
//! One primary ray per pixel and sample, point lights and the sun with shadow rays, skies, perfect mirrors, progressive
//! ambient occlusion, traced paths. Surfaces are plain, packed assets, or leaves whose optics are evaluated live;
//! volumetric textures stand alone or lie on skins. Three backends trace the same rays over the same instances of meshes
//! and decode the same bytes: ray query (`shaders/trace_ray_query.wgsl`), a bounding volume hierarchy in storage buffers
//! (`shaders/trace_bvh.wgsl`), and the CPU (`cpu/`), which is the reference. Each `.wgsl` file with formulas is the twin of
//! the `.rs` file beside it.
//!
//! Decoded values hold the cosine: radiance = intensity / distance^2 x visibility x decoded / pi.
//!
//! Limits: an asset's nearest texel; at most 2^24 triangles, in at most 2^20 places.

#![cfg_attr(not(feature = "window"), allow(dead_code, reason = "some of it serves the window alone"))]

#[cfg(not(target_arch = "wasm32"))]
mod bench;
#[cfg(not(target_arch = "wasm32"))]
mod canopy;
mod cpu;
mod denoise;
mod error;
mod geometry;
mod gpu;
mod light;
mod motion;
mod operations;
mod options;
mod picture;
mod render;
mod sampler;
mod scene;
mod shading;
mod volume;
#[cfg(feature = "controls")]
mod window;
mod window_params;
#[cfg(not(feature = "window"))]
mod without_window;
mod work;

#[cfg(not(target_arch = "wasm32"))]
pub use bench::bench::{BenchKind, BenchParams, BenchReport, BenchRow, REFERENCE_SAMPLES, TRADE_SAMPLES, run_bench};
#[cfg(not(target_arch = "wasm32"))]
pub use bench::gpu::params::GpuBenchParams;
#[cfg(not(target_arch = "wasm32"))]
pub use bench::gpu::results::{GPU_RESULTS_FILE, GpuResults, StepRecord};
#[cfg(not(target_arch = "wasm32"))]
pub use bench::gpu::runner::{GpuBenchRun, run_gpu_bench};
#[cfg(not(target_arch = "wasm32"))]
pub use bench::gpu::stand_in::write_stand_in_asset;
#[cfg(not(target_arch = "wasm32"))]
pub use bench::gpu::step::run_gpu_step;
#[cfg(not(target_arch = "wasm32"))]
pub use bench::leaf_modes::LeafModeRow;
#[cfg(not(target_arch = "wasm32"))]
pub use bench::plot::bench_svg;
#[cfg(not(target_arch = "wasm32"))]
pub use canopy::cell::CanopyCell;
#[cfg(not(target_arch = "wasm32"))]
pub use canopy::measure::{
    CanopyLight, CanopyMeasurement, CanopyParams, Figures, LayerLight, LeafLight, MAX_PHOTONS, ViewLight,
    measure_canopy,
};
#[cfg(not(target_arch = "wasm32"))]
pub use canopy::optics::{CanopyOptics, MAX_CANOPY_BANDS, SpectraTable};
#[cfg(not(target_arch = "wasm32"))]
pub use canopy::plot::canopy_svg;
#[cfg(not(target_arch = "wasm32"))]
pub use canopy::structure::{CanopyStructure, Gap, INCLINATION_CLASSES};
pub use cpu::picture::CpuPicture;
pub use cpu::shader::DetailWidths;
pub use error::ViewerError;
pub use geometry::bvh::{AnyHit, Hit, NO_HIT};
pub use geometry::bvh_node::BvhNode;
pub use geometry::geometry::{Geometry, Instance, MAX_INSTANCES, Mesh, Placement, Triangle, Vertex};
pub use geometry::lod_transition::{LodTransition, MESH_PIXELS, VOLUME_PIXELS};
pub use gpu::backend::{BackendChoice, Expansion, GpuTracer};
pub use gpu::device::Gpu;
pub use gpu::frame::FrameRequest;
pub use gpu::pass_shaders::{PassShader, pass_shaders};
pub use gpu::results::timer::{GpuTimer, PassTimes};
pub use gpu::scene_change::{SceneChange, Updated};
pub use gpu::tracer::Tracer;
pub use light::daylight::{Daylight, Place, SKY_SIZE, SunAndSky};
pub use light::environment::{Environment, MAX_COLUMNS};
pub use light::solar_spectrum::{WHITE_ILLUMINANCE_LUX, luminance};
pub use light::sun::{SUN_DIAMETER_DEG, Sun, SunPosition};
pub use motion::motion_picture::{BACKGROUND_DEPTH, MotionPicture, MotionPixel};
pub use options::{
    DecoderForm, Filter, MAX_DEPTH, MAX_IRRADIANCE_CELLS, MAX_LIGHT_SAMPLES, RenderMode, ShadeOptions, SkyLight,
};
pub use picture::{Picture, PixelHit};
pub use render::bricks::{BrickReport, USUAL_VOLUME_BUDGET_MB};
pub use render::control::Control;
pub use render::governor::Spending;
pub use render::headless::{MAX_SIDE, RenderParams, RenderReport, Rendered, Sequence, render, render_sequence};
pub use render::plan::{Plan, PlannedAsset, plan};
#[cfg(not(target_arch = "wasm32"))]
pub use render::server::{PictureRequest, PictureServer};
pub use render::transition_cost::{
    TRANSITION_PIXELS, TransitionCost, USUAL_TRANSITION_PIXELS, cheapest, least_cost, measure_transitions,
};
pub use scene::asset::{FileForm, SceneAsset, UNKNOWN_SIZE_MM};
pub use scene::camera::{Camera, CameraFrame};
pub use scene::file::{SceneView, load_scene, scene_with_assets};
pub use scene::landscape::{Landscape, LandscapeCounts, LandscapeParams};
pub use scene::leaf::{SceneLeaf, scattering_of};
pub use scene::material::{Body, Material, OwnBodies, Shown};
pub use scene::mesh::{MeshPart, cube, plane, quad, sphere};
pub use scene::mesh_file::{FileMesh, load_meshes};
pub use scene::scene::{
    AMBIENT_RADIANCE, Ambient, BACKGROUND, DaylightParts, LightRig, MeshChoice, Outdoors, PointLight, Scene, SceneMesh,
    SceneObject, intensity_for,
};
pub use scene::volume::{load_volume, standing};
pub use volume::skin::{
    CellMap, CellSpan, CellWalk, Corners, DiscreteJitter, Interval, Jitter, LayerSpan, MAX_MERGED, Merged, NO_LINK,
    NO_VOLUME, Noise, Pattern, Shell, ShellLevel, ShellParams, ShellReport, Skin, SkinFace, SkinVertex, Tet,
    TextureMap, TextureRay, Variant, Walk, Wind,
};
pub use volume::volumes::{SceneSkin, SkinTet, VolumePlace, Volumes};
#[cfg(feature = "window")]
pub use window::desktop::run_window;
#[cfg(all(feature = "controls", target_arch = "wasm32"))]
pub use window::page::{Page, PageFrame};
#[cfg(all(feature = "controls", target_arch = "wasm32"))]
pub use window::page_picture::draw_picture;
pub use window_params::WindowParams;
#[cfg(not(feature = "window"))]
pub use without_window::run_window;

/// Ways into single parts of the renderers, for tests and measurements; no part of the interface.
#[doc(hidden)]
pub mod testing {
    #[cfg(not(target_arch = "wasm32"))]
    pub use crate::bench::gpu::parity::{ABSOLUTE, RELATIVE, count_differences, difference, random_queries};
    #[cfg(not(target_arch = "wasm32"))]
    pub use crate::bench::instanced_scene::instanced_scene;
    pub use crate::gpu::queries::decode_queries::{DecodeQuery, gpu_decode};
    pub use crate::gpu::queries::expand_queries::{gpu_expand, time_gpu_expand, time_upload};
    pub use crate::gpu::queries::walk_queries::{WalkQuery, WalkSum, cpu_walk, gpu_walk};
    pub use crate::scene::camera::jitter;
    pub use crate::scene::plant_variation::plant_factors;
}
