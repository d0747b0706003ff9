//! Draws surfaces that carry packed BTF assets: a window, pictures without one, and the tests' ways in.
//!
//! ```text
//! SceneAsset::load, Scene::built_in | load_scene --> Scene --render--> Picture --write_png--> PNG
//!                                                      \---run_window--> a window
//! ```
//!
//! One primary ray per pixel and sample, point lights and the sun with shadow rays, skies, perfect mirrors, progressive ambient
//! occlusion, traced paths. Surfaces are plain, packed assets, or leaves whose optics are evaluated live. Three backends trace the
//! same rays over the same instances of meshes and decode the same bytes: ray query (`shaders/trace_ray_query.wgsl`), a bounding volume hierarchy in
//! storage buffers (`shaders/trace_bvh.wgsl`), and the CPU (`cpu.rs`), which is the reference. What they share on the
//! GPU is `shaders/shade.wgsl`.
//!
//! Decoded values hold the cosine: radiance = intensity / distance^2 x visibility x decoded / pi.
//!
//! Limits: an asset's nearest texel; at most 2^24 triangles, in at most 2^20 places.

mod acceleration_structure;
mod arena;
mod atmosphere;
mod bench;
mod bench_plot;
mod bvh;
mod bvh_build;
mod camera;
mod cpu;
mod cpu_volumes;
mod crowd;
mod daylight;
mod engine;
mod environment;
mod error;
mod geometry;
mod gltf_asset;
mod governor;
mod gpu;
mod gpu_decode;
mod gpu_expand;
mod gpu_queries;
mod gpu_timer;
mod hand_over;
mod headless;
mod landscape;
mod leaf_trade;
mod leaf_width;
mod material;
mod mesh;
mod mesh_file;
mod models;
mod options;
mod picture;
mod pieces;
mod plan;
mod plant_variation;
mod relief;
mod sampler;
mod scene;
mod scene_asset;
mod scene_file;
mod scene_leaf;
mod scene_skin;
mod scene_volume;
mod shaders;
mod shear;
mod skin;
mod sky;
mod sky_irradiance;
mod solar_spectrum;
mod sun;
mod sun_disc;
mod surface;
mod trace;
mod viewed_body;
mod volume_light;
mod volume_words;
mod volumes;
mod window;

pub use bench::{BenchKind, BenchParams, BenchReport, BenchRow, REFERENCE_SAMPLES, TRADE_SAMPLES, run_bench};
pub use bench_plot::bench_svg;
pub use bvh::{AnyHit, BvhNode, Hit, NO_HIT};
pub use camera::{Camera, CameraFrame, jitter};
pub use cpu::{CpuPicture, Picked, pick};
pub use crowd::crowd;
pub use daylight::{Daylight, Place, SKY_SIZE, SunAndSky};
pub use environment::{Environment, MOST_COLUMNS};
pub use error::ViewerError;
pub use geometry::{Geometry, Instance, MOST_INSTANCES, Mesh, Placement, Triangle, Vertex};
pub use gltf_asset::own_bodies;
pub use governor::{Governor, Spending};
pub use gpu::{BackendChoice, Gpu};
pub use gpu_decode::{DecodeQuery, gpu_decode};
pub use gpu_expand::{gpu_expand, time_gpu_expand, time_upload};
pub use gpu_timer::{GpuTimer, PassTimes};
pub use hand_over::{HandOver, MESH_PIXELS, VOLUME_PIXELS};
pub use headless::{Control, MAX_SIDE, RenderParams, RenderReport, Rendered, Sequence, render, render_sequence};
pub use landscape::{Landscape, LandscapeCounts, LandscapeParams};
pub use leaf_trade::{LeafModeRow, leaf_mode_rows};
pub use material::{Body, Material, OwnBodies, Shown};
pub use mesh::{MeshPart, cube, plane, quad, sphere};
pub use mesh_file::{FileMesh, load_meshes};
pub use options::{DecoderForm, MAX_DEPTH, MAX_LIGHT_SAMPLES, RenderMode, ShadeOptions, SkyLight};
pub use picture::Picture;
pub use pieces::PieceLayout;
pub use plan::{Plan, PlannedAsset, plan};
pub use plant_variation::plant_factors;
pub use scene::{
    AMBIENT_RADIANCE, Ambient, BACKGROUND, DaylightParts, LightRig, MeshChoice, Outdoors, PointLight, Scene, SceneMesh,
    SceneObject, intensity_for,
};
pub use scene_asset::{FileForm, SceneAsset, UNKNOWN_SIZE_MM};
pub use scene_file::{load_scene, scene_with_assets};
pub use scene_leaf::SceneLeaf;
pub use scene_volume::{load_volume, standing};
pub use shaders::{GpuTracer, ModuleLayout, trace_module};
pub use skin::{
    CellSpan, CellWalk, Corners, DiscreteJitter, Interval, Jitter, LayerSpan, MOST_CELLS, MOST_MERGED, Merged, NO_LINK,
    NO_VOLUME, Noise, Pattern, Shell, ShellParams, ShellReport, Skin, SkinFace, SkinVertex, Tet, TextureMap,
    TextureRay, Variant, Walk, WalkQuery, WalkSum, Wind, cpu_walk, gpu_walk, pattern_words,
};
pub use solar_spectrum::WHITE_ILLUMINANCE_LUX;
pub use sun::{SUN_DIAMETER_DEG, Sun, SunPosition};
pub use trace::{NO_ASSET, PixelHit, Tracer};
pub use volumes::{SceneSkin, VolumePlace, Volumes};
pub use window::{WindowParams, run_window};
