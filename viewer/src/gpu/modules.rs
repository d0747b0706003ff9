//! The shader texts, joined as plain text in a fixed order.

use crate::geometry::bvh::STACK;
use crate::geometry::geometry::Geometry;
use crate::gpu::backend::GpuTracer;
use crate::gpu::pieces::{ASSETS, ASSETS_IN_QUADS, NODES, PieceLayout, TRIANGLES, VERTICES};
use crate::scene::scene::Scene;
use std::collections::HashMap;

pub(super) const SCENE: &str = include_str!("../shaders/scene.wgsl");
pub(super) const SAMPLER: &str = include_str!("../sampler.wgsl");
pub(super) const ENVIRONMENT: &str = include_str!("../light/environment.wgsl");
pub(super) const IRRADIANCE_VOLUME: &str = include_str!("../light/irradiance_volume.wgsl");
pub(super) const LIGHT_GRID: &str = include_str!("../light/light_grid.wgsl");
pub(super) const SUN_DISC: &str = include_str!("../light/sun_disc.wgsl");
pub(super) const SURFACE: &str = include_str!("../geometry/surface.wgsl");
pub(super) const RELIEF: &str = include_str!("../shading/relief.wgsl");
pub(super) const FRACTAL_NOISE: &str = include_str!("../shading/fractal_noise.wgsl");
pub(super) const VIEWED_BODY: &str = include_str!("../shading/viewed_body.wgsl");
pub(super) const LOD_TRANSITION: &str = include_str!("../geometry/lod_transition.wgsl");
pub(super) const SHADER: &str = include_str!("../cpu/shader.wgsl");
pub(super) const PATH: &str = include_str!("../cpu/path.wgsl");
pub(super) const DIRECT_LIGHT: &str = include_str!("../cpu/direct_light.wgsl");
pub(super) const SCATTER: &str = include_str!("../cpu/scatter.wgsl");
pub(super) const AIR: &str = include_str!("../cpu/air.wgsl");
pub(super) const INTEGRATOR: &str = include_str!("../cpu/integrator.wgsl");
pub(super) const PASSES: &str = include_str!("../shaders/passes.wgsl");
pub(super) const SHEAR: &str = include_str!("../geometry/shear.wgsl");
pub(super) const BVH: &str = include_str!("../geometry/bvh.wgsl");
pub(super) const TRACE_BVH: &str = include_str!("../shaders/trace_bvh.wgsl");
pub(super) const TRACE_RAY_QUERY: &str = include_str!("../shaders/trace_ray_query.wgsl");
pub(super) const SKIN_WALK: &str = include_str!("../volume/skin/walk.wgsl");
pub(super) const SKIN_CELL: &str = include_str!("../volume/skin/cell.wgsl");
pub(super) const SKIN_PATTERN: &str = include_str!("../volume/skin/pattern.wgsl");
pub(super) const VOLUMES: &str = include_str!("../volume/volumes.wgsl");
pub(super) const VOLUME_LIGHT: &str = include_str!("../volume/light.wgsl");
pub(super) const VOLUMES_ON_PATHS: &str = include_str!("../cpu/volumes.wgsl");
pub(super) const NO_VOLUMES: &str = include_str!("../shaders/no_volumes.wgsl");
pub(super) const WALK_QUERIES: &str = include_str!("../shaders/walk_queries.wgsl");
pub(super) const DECODE_QUERIES: &str = include_str!("../shaders/decode_queries.wgsl");
/// Measures what the adapter can do at most.
pub(crate) const ROOFLINE: &str = include_str!("../shaders/roofline.wgsl");
/// Shows a picture in a window.
pub(crate) const BLIT: &str = include_str!("../window/pictures/blit.wgsl");

/// A part of a tracer's module, for counting what it takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
pub(crate) enum ModulePart {
    /// Follows paths: lights, materials, pixels.
    Shade,
    /// Finds what rays hit.
    Trace,
    /// Decodes assets.
    Decode,
}

/// Number of [`ModulePart`]s.
pub(crate) const MODULE_PARTS: usize = 3;

/// Returns the part of each function of a tracer's module that traces or decodes.
pub(crate) fn part_of_functions() -> HashMap<String, ModulePart> {
    let library = btf_runtime::wgsl_library();
    let texts = [(ModulePart::Trace, TRACE_BVH), (ModulePart::Trace, BVH), (ModulePart::Decode, &library)];
    let names = |text: &str| -> Vec<String> {
        let names = text.lines().filter_map(|line| line.strip_prefix("fn ")?.split('(').next());
        names.map(String::from).collect()
    };
    let mut parts: HashMap<_, _> =
        texts.into_iter().flat_map(|(part, text)| names(text).into_iter().map(move |name| (name, part))).collect();
    for array in [&VERTICES, &TRIANGLES, &NODES] {
        parts.extend(array.readers.iter().map(|reader| (String::from(reader.name), ModulePart::Trace)));
    }
    parts.extend(ASSETS_IN_QUADS.readers.iter().map(|reader| (String::from(reader.name), ModulePart::Decode)));
    parts
}

/// The cuts of the large arrays of a module, and what the module has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ModuleLayout {
    /// Cut of the assets' words.
    pub assets: PieceLayout,
    /// Cut of the vertices.
    pub vertices: PieceLayout,
    /// Cut of the triangles.
    pub triangles: PieceLayout,
    /// Cut of the nodes of the hierarchy, for the tracer that has one.
    pub nodes: PieceLayout,
    /// Whether assets are read in quads of words, which pays where bases are expanded.
    pub quads: bool,
    /// Entries of the stack of the compute hierarchy.
    pub stack: usize,
    /// Whether there are volumetric textures.
    pub volumes: bool,
}

impl ModuleLayout {
    /// Everything in one piece each, and volumes.
    pub const WHOLE: ModuleLayout = ModuleLayout {
        assets: PieceLayout::WHOLE,
        vertices: PieceLayout::WHOLE,
        triangles: PieceLayout::WHOLE,
        nodes: PieceLayout::WHOLE,
        quads: true,
        stack: STACK,
        volumes: true,
    };

    /// Returns the layout for a scene where no array is cut. `tops` are the nodes where hierarchies over instances begin in
    /// `geometry`, which has the proxies of volumes behind what the scene has.
    pub(crate) fn of_scene(scene: &Scene, tracer: GpuTracer, geometry: &Geometry, tops: &[u32]) -> ModuleLayout {
        ModuleLayout {
            quads: scene.assets.iter().any(|asset| asset.head().has_even_rows()),
            stack: match tracer {
                GpuTracer::Bvh => geometry.stack_entries(tops),
                GpuTracer::RayQuery => STACK,
            },
            volumes: scene.volumes.is_some(),
            ..ModuleLayout::WHOLE
        }
    }

    /// Tells whether a module of this layout also serves where `needed` would do.
    pub(crate) fn serves(self, needed: ModuleLayout) -> bool {
        let ModuleLayout { quads, stack, .. } = self;
        self == ModuleLayout { quads, stack, ..needed } && quads >= needed.quads && stack >= needed.stack
    }
}

/// Joins the module of a tracer: entry points that draw (`passes.wgsl`) and `decode_main`, which decodes a list of
/// samples.
pub fn trace_module(tracer: GpuTracer, layout: ModuleLayout) -> String {
    let (assets, library) = match layout.quads {
        true => (&ASSETS_IN_QUADS, btf_runtime::wgsl_library_of_quads()),
        false => (&ASSETS, btf_runtime::wgsl_library()),
    };
    let mut arrays =
        [layout.assets.wgsl(assets), layout.vertices.wgsl(&VERTICES), layout.triangles.wgsl(&TRIANGLES)].join("\n");
    if tracer == GpuTracer::Bvh {
        arrays += &layout.nodes.wgsl(&NODES);
    }
    let voltex = btf_runtime::voltex_wgsl();
    let volumes: &[&str] = match layout.volumes {
        true => &[&voltex, SKIN_WALK, SKIN_CELL, SKIN_PATTERN, VOLUMES, VOLUME_LIGHT, VOLUMES_ON_PATHS],
        false => &[NO_VOLUMES],
    };
    // The file with the enable directive comes first.
    let bvh = BVH.replace(&stack_wgsl(STACK), &stack_wgsl(layout.stack));
    let tracer_parts: &[&str] = match tracer {
        GpuTracer::RayQuery => &[TRACE_RAY_QUERY],
        GpuTracer::Bvh => &[TRACE_BVH, &bvh],
    };
    [
        tracer_parts,
        &[
            SCENE,
            &arrays,
            &library,
            &btf_runtime::leaf_wgsl(),
            SAMPLER,
            ENVIRONMENT,
            LIGHT_GRID,
            IRRADIANCE_VOLUME,
            SUN_DISC,
            SURFACE,
            RELIEF,
            FRACTAL_NOISE,
            VIEWED_BODY,
            SHEAR,
            LOD_TRANSITION,
        ],
        volumes,
        &[SHADER, PATH, DIRECT_LIGHT, SCATTER, AIR, INTEGRATOR, PASSES, DECODE_QUERIES],
    ]
    .concat()
    .join("\n")
}

/// Returns the line of `bvh.wgsl` that tells how many entries the stack has.
fn stack_wgsl(entries: usize) -> String {
    format!("const BVH_STACK: u32 = {entries}u;")
}

/// Joins the module that walks rays through a shell (`walk_queries.wgsl`); a tracer's module has the same texts but for
/// the last.
pub(crate) fn walk_module(assets: PieceLayout) -> String {
    [&assets.wgsl(&ASSETS) as &str, SAMPLER, SHEAR, SKIN_WALK, SKIN_CELL, SKIN_PATTERN, WALK_QUERIES].join("\n")
}
