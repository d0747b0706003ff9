//! The shader texts, joined as plain text in a fixed order.

use crate::gpu::pieces::{ASSETS, NODES, PieceLayout, TRIANGLES, VERTICES};

const SCENE: &str = include_str!("../shaders/scene.wgsl");
const SAMPLER: &str = include_str!("../sampler.wgsl");
const ENVIRONMENT: &str = include_str!("../light/environment.wgsl");
const SUN_DISC: &str = include_str!("../light/sun_disc.wgsl");
const SURFACE: &str = include_str!("../geometry/surface.wgsl");
const RELIEF: &str = include_str!("../shading/relief.wgsl");
const VIEWED_BODY: &str = include_str!("../shading/viewed_body.wgsl");
const LOD_TRANSITION: &str = include_str!("../geometry/lod_transition.wgsl");
const SHADE: &str = include_str!("../cpu/shade.wgsl");
const PASSES: &str = include_str!("../shaders/passes.wgsl");
const SHEAR: &str = include_str!("../geometry/shear.wgsl");
const BVH: &str = include_str!("../geometry/bvh.wgsl");
const TRACE_BVH: &str = include_str!("../shaders/trace_bvh.wgsl");
const TRACE_RAY_QUERY: &str = include_str!("../shaders/trace_ray_query.wgsl");
const SKIN_WALK: &str = include_str!("../volume/skin/walk.wgsl");
const SKIN_CELL: &str = include_str!("../volume/skin/cell.wgsl");
const SKIN_PATTERN: &str = include_str!("../volume/skin/pattern.wgsl");
const VOLUMES: &str = include_str!("../volume/volumes.wgsl");
const VOLUME_LIGHT: &str = include_str!("../volume/light.wgsl");
const VOLUME_SHADE: &str = include_str!("../cpu/volumes.wgsl");
const NO_VOLUMES: &str = include_str!("../shaders/no_volumes.wgsl");
const SKIN_QUERIES: &str = include_str!("../shaders/skin_queries.wgsl");
const DECODE_QUERIES: &str = include_str!("../shaders/decode_queries.wgsl");
/// Shows a picture in a window.
pub(crate) const BLIT: &str = include_str!("../window/blit.wgsl");

/// How a GPU finds what a ray hits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GpuTracer {
    /// Acceleration structures and ray queries; needs an adapter that has them.
    RayQuery,
    /// A bounding volume hierarchy in storage buffers; runs everywhere.
    Bvh,
}

impl GpuTracer {
    /// The backend's name on the command line and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            GpuTracer::RayQuery => "ray-query",
            GpuTracer::Bvh => "bvh",
        }
    }
}

/// How the large arrays of a module are cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ModuleLayout {
    /// The assets' words.
    pub assets: PieceLayout,
    /// Vertices.
    pub vertices: PieceLayout,
    /// Triangles.
    pub triangles: PieceLayout,
    /// Nodes of the hierarchy, for the tracer that has one.
    pub nodes: PieceLayout,
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
        volumes: true,
    };
}

/// The whole module of a tracer: entry points that draw (`passes.wgsl`) and `decode_main`, which decodes a list of samples.
pub fn trace_module(tracer: GpuTracer, layout: ModuleLayout) -> String {
    let mut arrays =
        [layout.assets.wgsl(&ASSETS), layout.vertices.wgsl(&VERTICES), layout.triangles.wgsl(&TRIANGLES)].join("\n");
    if tracer == GpuTracer::Bvh {
        arrays += &layout.nodes.wgsl(&NODES);
    }
    let library = btf_runtime::wgsl_library();
    let voltex = btf_runtime::voltex_wgsl();
    let volumes: &[&str] = match layout.volumes {
        true => &[&voltex, SKIN_WALK, SKIN_CELL, SKIN_PATTERN, VOLUMES, VOLUME_LIGHT, VOLUME_SHADE],
        false => &[NO_VOLUMES],
    };
    // The file with the enable directive comes first.
    let tracer_parts: &[&str] = match tracer {
        GpuTracer::RayQuery => &[TRACE_RAY_QUERY],
        GpuTracer::Bvh => &[TRACE_BVH, BVH],
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
            SUN_DISC,
            SURFACE,
            RELIEF,
            VIEWED_BODY,
            SHEAR,
            LOD_TRANSITION,
        ],
        volumes,
        &[SHADE, PASSES, DECODE_QUERIES],
    ]
    .concat()
    .join("\n")
}

/// The module that walks rays through a shell (`skin_queries.wgsl`); a tracer's module has the same texts but for the last.
pub(crate) fn walk_module(assets: PieceLayout) -> String {
    [&assets.wgsl(&ASSETS) as &str, SAMPLER, SHEAR, SKIN_WALK, SKIN_CELL, SKIN_PATTERN, SKIN_QUERIES].join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::bvh::{BvhNode, NO_HIT, STACK};
    use crate::geometry::geometry::{Instance, Triangle, Vertex};
    use crate::gpu::acceleration_structure::{HANDED_OVER, MESHES, PROXIES};
    use crate::gpu::decode_queries::{GpuQuery, GpuQueryParams};
    use crate::gpu::tracer::{Frame, GpuLight, GpuMaterial, GpuPath, GpuPixel};
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    use std::mem::{offset_of, size_of};

    const CUT: ModuleLayout = ModuleLayout {
        assets: PieceLayout { pieces: 3, shift: 20 },
        vertices: PieceLayout { pieces: 2, shift: 12 },
        triangles: PieceLayout { pieces: 4, shift: 14 },
        nodes: PieceLayout { pieces: 2, shift: 16 },
        volumes: false,
    };

    /// What every WebGPU implementation has: halves in storage are read with `unpack2x16float`.
    const PORTABLE: Capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;

    fn parse(text: &str) -> Result<naga::Module, String> {
        let mut frontend = naga::front::wgsl::Frontend::new_with_options(naga::front::wgsl::Options {
            capabilities: Capabilities::RAY_QUERY,
            ..naga::front::wgsl::Options::new()
        });
        frontend.parse(text).map_err(|error| error.emit_to_string(text))
    }

    fn validate(text: &str, capabilities: Capabilities) -> Result<naga::Module, String> {
        let module = parse(text)?;
        Validator::new(ValidationFlags::all(), capabilities)
            .validate(&module)
            .map_err(|error| error.emit_to_string(text))?;
        Ok(module)
    }

    /// Differences between a WGSL struct and `(name, offset)` of its Rust twin.
    fn layout_difference(module: &naga::Module, name: &str, size: usize, fields: &[(&str, usize)]) -> Option<String> {
        let found = module.types.iter().find_map(|(_, ty)| match &ty.inner {
            naga::TypeInner::Struct { members, span } if ty.name.as_deref() == Some(name) => Some((members, *span)),
            _ => None,
        });
        let (members, span) = found?;
        let in_wgsl: Vec<(String, usize)> =
            members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset as usize)).collect();
        let in_rust: Vec<(String, usize)> = fields.iter().map(|(n, o)| ((*n).to_string(), *o)).collect();
        (in_wgsl != in_rust || span as usize != size)
            .then(|| format!("{name}: WGSL {in_wgsl:?} span {span}, Rust {in_rust:?} size {size}"))
    }

    fn constant(module: &naga::Module, name: &str) -> Option<naga::Literal> {
        let (_, constant) = module.constants.iter().find(|(_, c)| c.name.as_deref() == Some(name))?;
        match module.global_expressions[constant.init] {
            naga::Expression::Literal(literal) => Some(literal),
            _ => None,
        }
    }

    #[test]
    fn every_module_is_valid_with_exactly_the_capabilities_that_we_ask_for() {
        validate(&trace_module(GpuTracer::Bvh, ModuleLayout::WHOLE), PORTABLE).unwrap();
        validate(&trace_module(GpuTracer::Bvh, CUT), PORTABLE).unwrap();
        validate(BLIT, Capabilities::empty()).unwrap();
        // The skin's functions are core WGSL.
        validate(&walk_module(PieceLayout::WHOLE), Capabilities::empty()).unwrap();
        let ray_query = trace_module(GpuTracer::RayQuery, ModuleLayout::WHOLE);
        validate(&ray_query, PORTABLE | Capabilities::RAY_QUERY).unwrap();
        // The check can fail: without the capability the same text is refused, as is a module with a fault.
        assert!(validate(&ray_query, PORTABLE).is_err());
        let faulty = trace_module(GpuTracer::Bvh, ModuleLayout::WHOLE).replace("light_pass(id.xy)", "light_pass(id)");
        assert!(validate(&faulty, PORTABLE).is_err());
    }

    #[test]
    fn only_the_ray_query_file_needs_the_extension() {
        assert!(trace_module(GpuTracer::RayQuery, ModuleLayout::WHOLE).starts_with("enable wgpu_ray_query;"));
        assert!(!trace_module(GpuTracer::Bvh, ModuleLayout::WHOLE).contains("ray_query"));
    }

    macro_rules! fields {
        ($ty:ty; $($field:ident),*) => {
            (size_of::<$ty>(), vec![$((stringify!($field), offset_of!($ty, $field))),*])
        };
    }

    #[test]
    fn structs_have_the_same_fields_at_the_same_offsets_in_rust_and_wgsl() {
        let module = parse(&trace_module(GpuTracer::Bvh, ModuleLayout::WHOLE)).unwrap();
        let all = [
            (
                "Frame",
                fields!(Frame; eye, width, forward, height, right, light_count, up, sample, background, interpolation, ambient, occlusion_distance, jitter, components, lobes, parallax, first_row, rows, mode, light_samples, environment_at, environment, pixel_width, levels, root, sky, sun_direction, sun_part, sun_irradiance, volume_root, volumes_at, proxies_at, first_proxy, volume_reach, volume_slice, widest_leaf, pad0, pad1),
            ),
            ("Vertex", fields!(Vertex; position, u, normal, v, tangent)),
            ("Triangle", fields!(Triangle; vertices, material)),
            (
                "Material",
                fields!(GpuMaterial; diffuse, asset, transmitted, leaf, mirror, displacement, uv_scale, pad0, pad1),
            ),
            ("Light", fields!(GpuLight; position, pad0, intensity, pad1)),
            (
                "Path",
                fields!(GpuPath; origin, primitive, direction, u, throughput, v, instance, density, travelled, sunk),
            ),
            ("Pixel", fields!(GpuPixel; sum, seen, rays, evaluations, depth)),
            ("BvhNode", fields!(BvhNode; lo, first, hi, count)),
            (
                "Instance",
                fields!(Instance; object_from_world, world_from_object, factors, root, first_triangle, handedness, leaf_width),
            ),
            ("Query", fields!(GpuQuery; wi, texel, wo, layer)),
            ("QueryParams", fields!(GpuQueryParams; count, components, lobes, interpolation, parallax)),
        ];
        for (name, (size, fields)) in &all {
            assert_eq!(layout_difference(&module, name, *size, fields), None);
            // Swapped fields of the same size are noticed.
            let mut swapped = fields.clone();
            swapped.swap(0, 1);
            assert!(layout_difference(&module, name, *size, &swapped).is_some());
        }
        #[cfg(feature = "window")]
        {
            let blit = parse(BLIT).unwrap();
            let (size, fields) = fields!(crate::window::GpuBlit; picture, window, gain, first_row, rows, split, other_from, difference_gain, pad0);
            assert_eq!(layout_difference(&blit, "Blit", size, &fields), None);
        }
    }

    #[test]
    fn the_walks_structs_and_constants_are_equal_in_rust_and_wgsl() {
        use crate::MAX_CELLS;
        use crate::NO_LINK;
        use crate::WalkQuery;
        use crate::WalkSum;
        use crate::volume::skin::{CELL_CONSTANTS, GpuWalkPlace, PATTERN_CONSTANTS, SHELL_CONSTANTS, WALK_CONSTANTS};
        let module = parse(&walk_module(PieceLayout::WHOLE)).unwrap();
        for (name, (size, fields)) in [
            ("WalkQuery", fields!(WalkQuery; origin, link, direction, t_min, t_max, pad0, pad1, pad2)),
            ("WalkSum", fields!(WalkSum; volume, length, texels, chosen, intervals, spans, width, pad0, pad1, pad2)),
            ("WalkPlace", fields!(GpuWalkPlace; shell, patterns, count, pad0)),
        ] {
            assert_eq!(layout_difference(&module, name, size, &fields), None);
            let mut swapped = fields;
            swapped.swap(0, 1);
            assert!(layout_difference(&module, name, size, &swapped).is_some());
        }
        let words = [("NO_LINK", NO_LINK), ("MAX_CELLS", MAX_CELLS)];
        let shell = SHELL_CONSTANTS.iter().map(|(name, value)| (*name, *value as u32));
        for (name, value) in words.into_iter().chain(shell).chain(PATTERN_CONSTANTS.iter().copied()) {
            assert_eq!(constant(&module, name), Some(naga::Literal::U32(value)), "{name}");
        }
        for (name, value) in WALK_CONSTANTS.iter().chain(CELL_CONSTANTS) {
            assert_eq!(constant(&module, name), Some(naga::Literal::F32(*value)), "{name}");
        }
    }

    /// Names of a text's functions, in order.
    fn function_names(text: &str) -> Vec<&str> {
        let name = |line: &'_ str| -> Option<usize> {
            let code = line.trim_start();
            let head =
                ["fn ", "pub fn ", "pub(crate) fn ", "pub(crate) fn "].iter().find(|head| code.starts_with(**head))?;
            Some(line.len() - code.len() + head.len())
        };
        let names = text.lines().filter_map(|line| name(line).map(|start| &line[start..]));
        names.map(|name| &name[..name.find(['(', '<']).unwrap_or(name.len())]).collect()
    }

    /// The first WGSL function without a Rust twin in its place, but for those that WGSL has `alone`.
    fn first_out_of_order<'a>(rust: &str, wgsl: &'a str, prefix: &str, alone: &[&str]) -> Option<&'a str> {
        let rust = rust.split("#[cfg(test)]\nmod tests").next().unwrap_or(rust);
        let mut twins = function_names(rust).into_iter();
        let is_twin = |name: &str, twin: &str| twin == name || Some(twin) == name.strip_prefix(prefix);
        function_names(wgsl)
            .into_iter()
            .filter(|name| !alone.contains(name))
            .find(|name| !twins.any(|twin| is_twin(name, twin)))
    }

    #[test]
    fn twins_hold_the_same_functions_in_the_same_order() {
        let alone = [
            "shell_float",
            "shell_vector",
            "shell_position",
            "shell_texture",
            "shell_tet",
            "shell_pattern",
            "shell_boundary",
            "shell_face",
            "volume_times",
            "volume_determinant",
            "volume_scale",
            "volume_level_of",
            "volume_cell_light",
            "volume_normal_towards",
            "volume_slot_of",
            "volume_offset",
            "volume_pass",
            "pass_volumes",
            "volume_point_light",
            "volume_surroundings",
        ];
        let twins = [
            (include_str!("../geometry/shear.rs"), SHEAR, "shear_"),
            (include_str!("../geometry/lod_transition.rs"), LOD_TRANSITION, "lod_transition_"),
            (include_str!("../volume/skin/walk.rs"), SKIN_WALK, "shell_"),
            (include_str!("../volume/skin/cell.rs"), SKIN_CELL, "cell_"),
            (include_str!("../volume/skin/pattern.rs"), SKIN_PATTERN, "pattern_"),
            (include_str!("../volume/volumes.rs"), VOLUMES, "volume_"),
            (include_str!("../volume/light.rs"), VOLUME_LIGHT, "volume_"),
            (include_str!("../cpu/volumes.rs"), VOLUME_SHADE, "volume_"),
        ];
        for (rust, wgsl, prefix) in twins {
            assert_eq!(first_out_of_order(rust, wgsl, prefix, &alone), None);
        }
        // Planted: two functions exchanged.
        let exchanged = SKIN_WALK
            .replace("fn shell_edge(", "fn x(")
            .replace("fn shell_step(", "fn shell_edge(")
            .replace("fn x(", "fn shell_step(");
        assert!(first_out_of_order(include_str!("../volume/skin/walk.rs"), &exchanged, "shell_", &alone).is_some());
    }

    #[test]
    fn constants_are_equal_in_rust_and_wgsl() {
        let module = parse(&trace_module(GpuTracer::Bvh, ModuleLayout::WHOLE)).unwrap();
        assert_eq!(constant(&module, "BVH_STACK"), Some(naga::Literal::U32(STACK as u32)));
        assert_eq!(constant(&module, "NO_HIT"), Some(naga::Literal::U32(NO_HIT)));
        assert_eq!(
            constant(&module, "MAX_MATERIALS"),
            Some(naga::Literal::U32(crate::gpu::tracer::MAX_MATERIALS as u32))
        );
        assert_eq!(constant(&module, "NO_ASSET"), Some(naga::Literal::U32(crate::gpu::tracer::NO_ASSET)));
        assert_eq!(
            constant(&module, "LIGHT_CANDIDATES"),
            Some(naga::Literal::U32(crate::cpu::cpu::LIGHT_CANDIDATES as u32))
        );
        for (name, value) in [
            ("IRRADIANCE_ROWS", crate::light::sky_irradiance::IRRADIANCE_ROWS as u32),
            ("IRRADIANCE_COLUMNS", crate::light::sky_irradiance::IRRADIANCE_COLUMNS as u32),
            ("SKY_IRRADIANCE", crate::SkyLight::Irradiance as u32),
        ] {
            assert_eq!(constant(&module, name), Some(naga::Literal::U32(value)), "{name}");
        }
        let ray_query = parse(&trace_module(GpuTracer::RayQuery, ModuleLayout::WHOLE)).unwrap();
        for (name, mask) in [("RAY_MESHES", MESHES), ("RAY_PROXIES", PROXIES), ("RAY_HANDED_OVER", HANDED_OVER)] {
            assert_eq!(constant(&ray_query, name), Some(naga::Literal::U32(mask.into())), "{name}");
        }
        for (name, value) in [
            ("NO_VOLUME", crate::NO_VOLUME),
            ("MAX_PASSAGES", crate::volume::volumes::MAX_PASSAGES as u32),
            ("LOD_TRANSITION_STREAM", crate::geometry::lod_transition::STREAM),
            ("PIXEL_STEP_X", crate::geometry::lod_transition::PIXEL_STEPS[0]),
            ("PIXEL_STEP_Y", crate::geometry::lod_transition::PIXEL_STEPS[1]),
            ("HIT_ANY", crate::AnyHit::Yes as u32),
            ("HIT_NEAREST", crate::AnyHit::No as u32),
            ("HIT_FRONT", crate::AnyHit::Front as u32),
            ("VOLUME_CHOICE_NUMBERS", crate::cpu::cpu::Numbers::VolumeChoice as u32),
            ("VOLUME_SCATTER_NUMBERS", crate::cpu::cpu::Numbers::VolumeScatter as u32),
            ("VOLUME_LIGHT_NUMBERS", crate::cpu::cpu::Numbers::VolumeLight as u32),
        ] {
            assert_eq!(constant(&module, name), Some(naga::Literal::U32(value)), "{name}");
        }
        assert_eq!(constant(&module, "MODE_PATH"), Some(naga::Literal::U32(crate::RenderMode::Path as u32)));
        for (name, value) in crate::geometry::bvh::CONSTANTS
            .iter()
            .chain(crate::cpu::cpu::CONSTANTS)
            .chain(crate::geometry::surface::CONSTANTS)
            .chain(crate::shading::relief::CONSTANTS)
            .chain(&[("MESH_PIXELS", crate::MESH_PIXELS), ("VOLUME_PIXELS", crate::VOLUME_PIXELS)])
            .chain(crate::volume::light::CONSTANTS)
            .chain(crate::cpu::volumes::CONSTANTS)
        {
            assert_eq!(constant(&module, name), Some(naga::Literal::F32(*value)), "{name}");
        }
    }

    #[test]
    fn a_stage_binds_at_most_eight_storage_buffers() {
        for tracer in [GpuTracer::Bvh, GpuTracer::RayQuery] {
            let module = parse(&trace_module(tracer, ModuleLayout::WHOLE)).unwrap();
            let info =
                Validator::new(ValidationFlags::all(), PORTABLE | Capabilities::RAY_QUERY).validate(&module).unwrap();
            for entry in 0..module.entry_points.len() {
                let used = module.global_variables.iter().filter(|(handle, variable)| {
                    matches!(variable.space, naga::AddressSpace::Storage { .. })
                        && !info.get_entry_point(entry)[*handle].is_empty()
                });
                let used = used.count();
                assert!((1..=8).contains(&used), "{used} storage buffers");
            }
        }
    }
}
