//! The shader texts are valid and are twins of their Rust: structs, functions and constants.

use crate::cpu::path::Numbers;
use crate::cpu::{direct_light, shader, volumes};
use crate::geometry::bvh::{AnyHit, NO_HIT, NO_INSTANCE, STACK};
use crate::geometry::bvh_node::BvhNode;
use crate::geometry::geometry::{Instance, Triangle, Vertex};
use crate::geometry::lod_transition::{self, COARSER_TO_LIGHT, MESH_PIXELS, VOLUME_PIXELS};
use crate::gpu::acceleration_structure::{MESHES, PROXIES, WITH_VOLUMES};
use crate::gpu::backend::GpuTracer;
use crate::gpu::frame::{GpuFrame, GpuLight, GpuMaterial, GpuPath, GpuPixel, MAX_MATERIALS, NO_ASSET};
use crate::gpu::modules::{
    AIR, BLIT, DIRECT_LIGHT, FRACTAL_NOISE, INTEGRATOR, IRRADIANCE_VOLUME, LIGHT_GRID, LOD_TRANSITION, ModuleLayout,
    PATH, RELIEF, ROOFLINE, SAMPLER, SCATTER, SHADER, SHEAR, SKIN_CELL, SKIN_PATTERN, SKIN_WALK, SUN_DISC,
    VOLUME_LIGHT, VOLUMES, VOLUMES_ON_PATHS, trace_module, walk_module,
};
use crate::gpu::pieces::PieceLayout;
use crate::gpu::queries::decode_queries::{GpuQuery, GpuQueryParams};
use crate::gpu::queries::walk_queries::{GpuWalkPlace, WalkQuery, WalkSum};
use crate::light::irradiance_volume::{IRRADIANCE_VOLUME_HEAD, IRRADIANCE_VOLUME_QUADS};
use crate::light::light_grid::{BELOW_ONE, LIGHT_CANDIDATES, LIGHT_GRID_HEAD};
use crate::light::sky_irradiance;
use crate::options::{Filter, RenderMode, SkyLight};
use crate::scene::material::NOISE_OCTAVES;
use crate::volume::skin::{MAX_CELLS, NO_LINK, NO_VOLUME};
use crate::volume::volumes::MAX_PASSAGES;
use crate::volume::words::{NO_PATTERNS, PROXY_WORDS};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use std::mem::{offset_of, size_of};

const CUT: ModuleLayout = ModuleLayout {
    assets: PieceLayout { pieces: 3, shift: 20 },
    vertices: PieceLayout { pieces: 2, shift: 12 },
    triangles: PieceLayout { pieces: 4, shift: 14 },
    nodes: PieceLayout { pieces: 2, shift: 16 },
    quads: false,
    stack: 32,
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
    let enough = ModuleLayout { quads: true, stack: 64, ..CUT };
    assert!(enough.serves(CUT) && !CUT.serves(enough) && !enough.serves(ModuleLayout { volumes: true, ..CUT }));
    let cut = trace_module(GpuTracer::Bvh, CUT);
    validate(&cut, PORTABLE).unwrap();
    assert!(cut.contains("const BVH_STACK: u32 = 32u;") && !cut.contains("const BVH_STACK: u32 = 64u;"));
    validate(BLIT, Capabilities::empty()).unwrap();
    validate(ROOFLINE, Capabilities::empty()).unwrap();
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
            fields!(GpuFrame; eye, width, forward, height, right, light_count, up, sample, background, interpolation, ambient, occlusion_distance, jitter, components, lobes, heights, first_row, rows, mode, light_samples, environment_at, environment, pixel_width, levels, root, sky, sun_direction, sun_part, sun_irradiance, volume_root, volumes_at, proxies_at, first_proxy, volume_reach, volume_slice, widest_leaf, filtered, irradiance_at, air, pad2),
        ),
        ("Vertex", fields!(Vertex; position, u, normal, v, tangent)),
        ("Triangle", fields!(Triangle; vertices, material)),
        (
            "Material",
            fields!(GpuMaterial; diffuse, asset, transmitted, leaf, mirror, displacement, uv_scale, noise, pad0),
        ),
        ("Light", fields!(GpuLight; position, pad0, intensity, pad1)),
        ("Path", fields!(GpuPath; origin, primitive, direction, u, throughput, v, instance, density, travelled, sunk)),
        ("Pixel", fields!(GpuPixel; sum, primitive, rays, evaluations, depth)),
        ("BvhNode", fields!(BvhNode; lo, exponents, first_child, first_primitive, slots, planes)),
        (
            "Instance",
            fields!(Instance; object_from_world, world_from_object, factors, root, first_triangle, handedness, leaf_width),
        ),
        ("Query", fields!(GpuQuery; wi, texel, wo, layer)),
        ("QueryParams", fields!(GpuQueryParams; count, components, lobes, interpolation, heights)),
    ];
    for (name, (size, fields)) in &all {
        assert_eq!(layout_difference(&module, name, *size, fields), None);
        // Swapped fields of the same size are noticed.
        let mut swapped = fields.clone();
        swapped.swap(0, 1);
        assert!(layout_difference(&module, name, *size, &swapped).is_some());
    }
    let blit = parse(BLIT).unwrap();
    let (size, fields) = fields!(crate::window::GpuBlit; picture, window, gain, first_row, rows, split, other_from, difference_gain, pad0);
    assert_eq!(layout_difference(&blit, "Blit", size, &fields), None);
}

#[test]
fn the_walks_structs_are_equal_in_rust_and_wgsl() {
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
}

/// Names of a text's functions, in order.
fn function_names(text: &str) -> Vec<&str> {
    let name = |line: &'_ str| -> Option<usize> {
        let code = line.trim_start();
        let head =
            ["fn ", "pub fn ", "pub(crate) fn ", "pub(super) fn "].iter().find(|head| code.starts_with(**head))?;
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
        // Readers of words, where Rust has slices.
        "light_grid_pair",
        "has_irradiance_volume",
        "shell_float",
        "shell_vector",
        "shell_position",
        "shell_texture",
        "shell_tet",
        "shell_pattern",
        "shell_boundary",
        "shell_face",
        "volume_slot_of",
        // Operators and iterators of Rust.
        "most",
        "volume_times",
        "volume_determinant",
        "volume_scale",
        "volume_level_of",
        "volume_level_met",
        "volume_clumping_met",
        "volume_normal_towards",
        // Rust has these in camera.rs and material.rs.
        "camera_direction",
        "is_plain",
        // Rust follows a path whole, and all lights along one ray.
        "camera_pass",
        "light_pass",
        "mirror_pass",
        "scatter_pass",
        "volume_pass",
        "whole_picture",
        "advance_path",
        "end_ray",
        "volume_march",
        "volume_gather",
        "volume_point_light",
    ];
    let twins = [
        (include_str!("../sampler.rs"), SAMPLER, "sampler_"),
        (include_str!("../light/light_grid.rs"), LIGHT_GRID, "light_grid_"),
        (include_str!("../light/irradiance_volume.rs"), IRRADIANCE_VOLUME, "irradiance_volume_"),
        (include_str!("../light/sun_disc.rs"), SUN_DISC, ""),
        (include_str!("../geometry/shear.rs"), SHEAR, "shear_"),
        (include_str!("../geometry/lod_transition.rs"), LOD_TRANSITION, "lod_transition_"),
        (include_str!("../shading/fractal_noise.rs"), FRACTAL_NOISE, ""),
        (include_str!("../shading/relief.rs"), RELIEF, ""),
        (include_str!("../volume/skin/walk.rs"), SKIN_WALK, "shell_"),
        (include_str!("../volume/skin/cell.rs"), SKIN_CELL, "cell_"),
        (include_str!("../volume/skin/pattern.rs"), SKIN_PATTERN, "pattern_"),
        (include_str!("../volume/volumes.rs"), VOLUMES, "volume_"),
        (include_str!("../volume/light.rs"), VOLUME_LIGHT, "volume_"),
        (include_str!("../cpu/shader.rs"), SHADER, ""),
        (include_str!("../cpu/path.rs"), PATH, ""),
        (include_str!("../cpu/air.rs"), AIR, ""),
        (include_str!("../cpu/direct_light.rs"), DIRECT_LIGHT, "light_"),
        (include_str!("../cpu/scatter.rs"), SCATTER, ""),
        (include_str!("../cpu/integrator.rs"), INTEGRATOR, ""),
        (include_str!("../cpu/volumes.rs"), VOLUMES_ON_PATHS, "volume_"),
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

/// The constants of Rust that have a twin in WGSL, by the name there.
fn twin_constants() -> Vec<(&'static str, naga::Literal)> {
    use crate::volume::skin::{CELL_CONSTANTS, PATTERN_CONSTANTS, SHELL_CONSTANTS, WALK_CONSTANTS};
    use std::f32::consts::{PI, TAU};
    let words = [
        ("NO_HIT", NO_HIT),
        ("HIT_ANY", AnyHit::Yes as u32),
        ("HIT_NEAREST", AnyHit::No as u32),
        ("HIT_FRONT", AnyHit::Front as u32),
        ("BVH_STACK", STACK as u32),
        ("NO_INSTANCE", NO_INSTANCE),
        ("LOD_TRANSITION_STREAM", lod_transition::STREAM),
        ("PIXEL_STEP_X", lod_transition::PIXEL_STEPS[0]),
        ("PIXEL_STEP_Y", lod_transition::PIXEL_STEPS[1]),
        ("IRRADIANCE_ROWS", sky_irradiance::IRRADIANCE_ROWS as u32),
        ("IRRADIANCE_COLUMNS", sky_irradiance::IRRADIANCE_COLUMNS as u32),
        ("NO_ASSET", NO_ASSET),
        ("MAX_MATERIALS", MAX_MATERIALS as u32),
        ("MODE_PATH", RenderMode::Path as u32),
        ("SKY_IRRADIANCE", SkyLight::Irradiance as u32),
        ("SHELL_TRIES", shader::SHELL_TRIES as u32),
        ("TEXEL_TAPS", shader::TEXEL_TAPS),
        ("FILTER_NEAREST", Filter::Nearest as u32),
        ("FILTER_LINEAR", Filter::Linear as u32),
        ("LEVEL_CHOICE", shader::LEVEL_CHOICE),
        ("NOISE_OCTAVES", NOISE_OCTAVES),
        ("ENVIRONMENT_CHOICE", direct_light::ENVIRONMENT_CHOICE),
        ("LOBE_CHOICE", direct_light::LOBE_CHOICE),
        ("SIDE_CHOICE", direct_light::SIDE_CHOICE),
        ("ROULETTE_CHANCE", direct_light::ROULETTE_CHANCE),
        ("LIGHT_GRID_HEAD", LIGHT_GRID_HEAD as u32),
        ("LIGHT_CANDIDATES", LIGHT_CANDIDATES as u32),
        ("IRRADIANCE_VOLUME_HEAD", IRRADIANCE_VOLUME_HEAD as u32),
        ("IRRADIANCE_VOLUME_QUADS", IRRADIANCE_VOLUME_QUADS as u32),
        ("AMBIENT_NUMBERS", Numbers::Ambient as u32),
        ("SCATTER_NUMBERS", Numbers::Scatter as u32),
        ("CHOICE_NUMBERS", Numbers::Choice as u32),
        ("LIGHT_NUMBERS", Numbers::Light as u32),
        ("SUN_NUMBERS", Numbers::Sun as u32),
        ("TEXEL_NUMBERS", Numbers::Texel as u32),
        ("VOLUME_CHOICE_NUMBERS", Numbers::VolumeChoice as u32),
        ("VOLUME_SCATTER_NUMBERS", Numbers::VolumeScatter as u32),
        ("VOLUME_LIGHT_NUMBERS", Numbers::VolumeLight as u32),
        ("SKY_CANDIDATES", volumes::SKY_CANDIDATES),
        ("BOUNCE_TURN", volumes::BOUNCE_TURN),
        ("NO_VOLUME", NO_VOLUME),
        ("NO_PATTERNS", NO_PATTERNS),
        ("PROXY_WORDS", PROXY_WORDS as u32),
        ("MAX_PASSAGES", MAX_PASSAGES as u32),
        // One more, for a ray to the light.
        ("PASSAGE_SLOTS", MAX_PASSAGES as u32 + 1),
        ("NO_LINK", NO_LINK),
        ("MAX_CELLS", MAX_CELLS),
        ("RAY_MESHES", MESHES.into()),
        ("RAY_PROXIES", PROXIES.into()),
        ("RAY_WITH_VOLUMES", WITH_VOLUMES.into()),
    ];
    let numbers = [
        ("MESH_PIXELS", MESH_PIXELS),
        ("COARSER_TO_LIGHT", COARSER_TO_LIGHT),
        ("VOLUME_PIXELS", VOLUME_PIXELS),
        ("ENVIRONMENT_PI", PI),
        ("ENVIRONMENT_TAU", TAU),
        ("SUN_TAU", TAU),
        ("BELOW_ONE", BELOW_ONE),
    ];
    let shell = SHELL_CONSTANTS.iter().map(|(name, value)| (*name, *value as u32));
    let words = words.into_iter().chain(shell).chain(PATTERN_CONSTANTS.iter().copied());
    let tables = [
        crate::geometry::lanes::CONSTANTS,
        crate::geometry::surface::CONSTANTS,
        crate::cpu::air::CONSTANTS,
        crate::shading::fractal_noise::CONSTANTS,
        crate::shading::relief::CONSTANTS,
        crate::volume::light::CONSTANTS,
        crate::light::irradiance_volume::CONSTANTS,
        shader::CONSTANTS,
        crate::cpu::path::CONSTANTS,
        crate::cpu::integrator::CONSTANTS,
        volumes::CONSTANTS,
        WALK_CONSTANTS,
        CELL_CONSTANTS,
    ];
    let numbers = numbers.into_iter().chain(tables.into_iter().flatten().copied());
    let words = words.map(|(name, value)| (name, naga::Literal::U32(value)));
    words.chain(numbers.map(|(name, value)| (name, naga::Literal::F32(value)))).collect()
}

/// Constants of WGSL that Rust has none of, each with its reason.
const WITHOUT_TWIN: [(&str, &str); 12] = [
    ("NODES_MET", "Rust keeps children that wait one by one, not in groups"),
    ("BODY_NONE", "Rust has an enum, and `None`"),
    ("BODY_PLAIN", "Rust has an enum"),
    ("BODY_ASSET", "Rust has an enum"),
    ("BODY_LEAF", "Rust has an enum"),
    ("MISSED", "a state of a path between two passes; Rust follows a path whole"),
    ("IN_VOLUME", "a state of a path between two passes; Rust follows a path whole"),
    ("SCATTERED", "a bit of a path's instance between two passes; Rust has a bool"),
    ("VOLUME_BLACK", "stands for Rust's infinity"),
    ("WITH_VOLUMES", "says which of two texts was joined; Rust asks the scene"),
    ("RAY_FLAG_TERMINATE_ON_FIRST_HIT", "a value of SPIR-V's ray queries, which Rust does not trace by"),
    ("RAY_FLAG_CULL_BACK_FACING", "a value of SPIR-V's ray queries, which Rust does not trace by"),
];

/// Names of the constants that a WGSL text declares.
fn declared_constants(text: &str) -> Vec<&str> {
    let declared = text.lines().filter_map(|line| line.trim_start().strip_prefix("const "));
    declared.filter_map(|rest| rest.split([':', '=', ' ']).next()).collect()
}

/// The texts of all `.wgsl` files of the package.
fn all_texts() -> Vec<String> {
    let mut folders = vec![std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
    let mut texts = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.extension().and_then(|ending| ending.to_str()) {
                _ if path.is_dir() => folders.push(path),
                Some("wgsl") => texts.push(std::fs::read_to_string(path).unwrap()),
                _ => {}
            }
        }
    }
    texts
}

/// What is wrong with the constants of `texts`: one that has neither a twin nor a reason to be without, one of another
/// value than its twin, and twins and reasons of none.
fn constant_faults(texts: &[String], twins: &[(&str, naga::Literal)]) -> Vec<String> {
    let of_tracers = [
        parse(&trace_module(GpuTracer::Bvh, ModuleLayout::WHOLE)).unwrap(),
        parse(&trace_module(GpuTracer::RayQuery, ModuleLayout::WHOLE)).unwrap(),
    ];
    let declared: Vec<&str> = texts.iter().flat_map(|text| declared_constants(text)).collect();
    let mut faults = Vec::new();
    for name in &declared {
        let twin = twins.iter().find(|(twin, _)| twin == name);
        let reasons = WITHOUT_TWIN.iter().filter(|(without, _)| without == name).count();
        if usize::from(twin.is_some()) + reasons != 1 {
            faults.push(format!("{name} has neither a twin nor a reason to be without, or both"));
        }
        let value = of_tracers.iter().find_map(|module| constant(module, name));
        if let Some((_, expected)) = twin
            && value != Some(*expected)
        {
            faults.push(format!("{name} is {value:?} and its twin {expected:?}"));
        }
    }
    let names = twins.iter().map(|(name, _)| name).chain(WITHOUT_TWIN.iter().map(|(name, _)| name));
    faults.extend(names.filter(|name| !declared.contains(name)).map(|name| format!("{name} is declared nowhere")));
    faults
}

#[test]
fn every_wgsl_constant_has_a_twin_or_a_reason_to_be_without() {
    let (texts, twins) = (all_texts(), twin_constants());
    assert!(texts.len() > 20, "{}", texts.len());
    assert_eq!(constant_faults(&texts, &twins), Vec::<String>::new());
    // Planted: a constant that nobody knows, a twin of another value, and an entry without a constant.
    let planted = [texts.clone(), vec!["const PLANTED: u32 = 7u;".into()]].concat();
    let faults = constant_faults(&planted, &twins);
    assert!(faults.len() == 1 && faults[0].starts_with("PLANTED has neither"), "{faults:?}");
    let mut other = twins.clone();
    other[0].1 = naga::Literal::U32(5);
    assert_eq!(constant_faults(&texts, &other).len(), 1);
    other[0] = twins[0];
    other.push(("PLANTED", naga::Literal::U32(7)));
    assert_eq!(constant_faults(&texts, &other), ["PLANTED is declared nowhere"]);
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
