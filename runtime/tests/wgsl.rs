//! The WGSL library beside its Rust twin: it parses and validates with nothing beyond core WGSL, its
//! constants are the twin's, and the twin files hold the same functions in the same order.

use btf_runtime::{
    ASSET_LAYERS, COLOUR_FRAME, COSINE_SHARE, DIRECTION_WORDS, EDGE_WORDS, EDIT_WORDS, EXPANSION_WGSL,
    EXPANSION_WORKGROUP, ExpansionChannel, ExpansionShape, ExpansionSlice, FACTOR_ONE, HIDDEN_SHARE, INSIDE_TOLERANCE,
    ITEM_EDGE, Interpolation, LEAF_MIN_HALF, LEAF_WGSL, LIGHT_ROWS, LOBE_RESIDENT_WORDS, LeafMode, LobeFamily,
    LobeRole, MAX_ABSORPTION, MAX_EXPONENT, MAX_LOG, MAX_RAY_STEPS, MAX_SLOPE, MIN_ALPHA, MIN_AXIS, MIN_COS_VIEW,
    MIN_EYE, MIN_FACET, MIN_HALF, MIN_RAY_STEPS, MIN_SHARE, MIN_UP, OUTSIDE_SHARE, RATIO_EPSILON, RATIO_RANGE,
    RAY_STEP, ROOT, ResidualKind, SHIFT_SLOPE, SPHERE_HEADER_WORDS, THETA_P, THETA_Q, TRIANGLE_WORDS, UNIT_RANGE,
    VOLTEX_WGSL, WGSL, block, leaf_wgsl, leaf_words, voltex, voltex_wgsl, wgsl_library,
};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{Expression, Literal, Module};

/// The least that an includer adds: the binding and an entry point.
const INCLUDER: &str = "
@group(0) @binding(0) var<storage, read> words: array<u32>;
@group(0) @binding(1) var<storage, read_write> result: array<vec4<f32>>;

fn asset_word(index: u32) -> u32 {
    return words[index];
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let options = BtfOptions(0xffffffffu, 0xffffffffu, id.y, 1u);
    let layer = btf_layer_for_sides(0u, 0u, 0u, 0u);
    let texel = btf_texel(0u, layer, vec2<f32>(0.25, f32(id.x) / 64.0));
    let wi = normalize(vec3<f32>(0.1, 0.2, 1.0));
    result[id.x] = vec4<f32>(btf_decode(0u, layer, texel, wi, vec3<f32>(0.0, 0.0, 1.0), options), 1.0);
}
";

/// All that the library needs. `unpack2x16float` is core WGSL; naga counts it as a capability of its own
/// because some OpenGL drivers, and Mesa's software Vulkan without 16-bit floats, lack it.
const CAPABILITIES: Capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;

fn module_from(source: &str, capabilities: Capabilities) -> Result<Module, String> {
    let module = naga::front::wgsl::parse_str(source).map_err(|error| error.emit_to_string(source))?;
    Validator::new(ValidationFlags::all(), capabilities)
        .validate(&module)
        .map_err(|error| error.emit_to_string(source))?;
    Ok(module)
}

/// The library, the functions of leaves and of volumes behind it, and the includer.
fn text() -> String {
    [&wgsl_library(), &leaf_wgsl(), &voltex_wgsl(), INCLUDER].map(|part| part as &str).join("\n")
}

fn library() -> Module {
    module_from(&text(), CAPABILITIES).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_library_is_valid_with_exactly_the_capability_that_it_names() {
    let module = library();
    assert!(module_from(&text(), Capabilities::empty()).is_err(), "it is needed");
    assert_eq!(module.entry_points.len(), 1);
    for name in
        ["btf_decode", "btf_texel", "btf_size", "btf_layer_for_sides", "btf_evaluate", "btf_sample", "btf_density"]
            .into_iter()
            .chain(["leaf_new", "leaf_light", "leaf_sample_direction", "leaf_sample_density"])
            .chain(["voltex_cell", "voltex_voxel", "voltex_walk_next", "voltex_shade", "voltex_shared_at"])
    {
        assert!(module.functions.iter().any(|(_, function)| function.name.as_deref() == Some(name)), "{name}");
    }
    // The library alone lacks the includer's reader, and a planted type error is seen.
    assert!(module_from(&wgsl_library(), CAPABILITIES).is_err());
    let broken = text().replace("MIN_COS_VIEW: f32 = 0.02", "MIN_COS_VIEW: f32 = 2u");
    assert!(module_from(&broken, CAPABILITIES).is_err());
}

#[test]
fn the_library_binds_nothing_and_has_no_entry_points() {
    for (name, text) in WGSL.iter().chain(LEAF_WGSL).chain(VOLTEX_WGSL) {
        for word in ["@group", "@binding", "@compute", "@fragment", "@vertex", "var<storage", "var<uniform"] {
            assert!(!text.contains(word), "{name} has {word}");
        }
    }
}

/// Name and value of every constant of the module, as doubles (every u32 and f32 fits one exactly).
fn constants(module: &Module) -> Vec<(String, f64)> {
    let mut found: Vec<(String, f64)> = module
        .constants
        .iter()
        .filter_map(|(_, constant)| {
            let value = match module.global_expressions[constant.init] {
                Expression::Literal(Literal::U32(value)) => f64::from(value),
                Expression::Literal(Literal::F32(value)) => f64::from(value),
                _ => return None,
            };
            Some((constant.name.clone()?, value))
        })
        .collect();
    found.sort_by(|a, b| a.0.cmp(&b.0));
    found
}

/// The twin of every WGSL constant.
fn expected_constants() -> Vec<(String, f64)> {
    let words = [
        ("SPHERE_HEADER_WORDS", SPHERE_HEADER_WORDS),
        ("DIRECTION_WORDS", DIRECTION_WORDS),
        ("TRIANGLE_WORDS", TRIANGLE_WORDS),
        ("EDGE_WORDS", EDGE_WORDS),
        ("ITEM_EDGE", ITEM_EDGE as usize),
        ("LOBE_RESIDENT_WORDS", LOBE_RESIDENT_WORDS),
        ("RESIDUAL_ADDITIVE", ResidualKind::Additive as usize),
        ("RESIDUAL_LOG", ResidualKind::Log as usize),
        ("RESIDUAL_ROOT", ResidualKind::Root as usize),
        ("LOBE_ROLE_GUIDE", LobeRole::Guide as usize),
        ("INTERPOLATION_EXACT", Interpolation::Exact as usize),
        ("ASSET_LAYERS", ASSET_LAYERS),
        ("LIGHT_ROWS", LIGHT_ROWS),
        ("BLOCK_LIGHT_SIDE", block::LIGHT_SIDE),
        ("BLOCK_VIEW_SIDE", block::VIEW_SIDE),
        ("BLOCK_RESIDUAL_KIND", block::RESIDUAL_KIND),
        ("BLOCK_EPSILON", block::EPSILON),
        ("BLOCK_BASES", block::BASES),
        ("BLOCK_CHANNEL_WORDS", block::CHANNEL_WORDS),
        ("BLOCK_LIGHTS", block::LIGHTS),
        ("BLOCK_VIEWS", block::VIEWS),
        ("BLOCK_RECORDS", block::RECORDS),
        ("BLOCK_REFS", block::REFS),
        ("BLOCK_DICTIONARIES", block::DICTIONARIES),
        ("BLOCK_BASIS", block::BASIS),
        ("BLOCK_CODES", block::CODES),
        ("BLOCK_CODE_WORDS", block::CODE_WORDS),
        ("BLOCK_LIGHT_COUNT", block::LIGHT_COUNT),
        ("BLOCK_PAIRS", block::PAIRS),
        ("BLOCK_HORIZON", block::HORIZON),
        ("BLOCK_LOBE_ROLE", block::LOBE_ROLE),
        ("BLOCK_HEIGHTS", block::HEIGHTS),
        ("BLOCK_HEIGHT_STEP", block::HEIGHT_STEP),
        ("BLOCK_MIN_HEIGHT", block::MIN_HEIGHT),
        ("BLOCK_MAX_HEIGHT", block::MAX_HEIGHT),
        ("BLOCK_WIDTH", block::WIDTH),
        ("BLOCK_ROWS", block::ROWS),
        ("BLOCK_EDITS", block::EDITS),
        ("EDIT_WORDS", EDIT_WORDS),
        ("NO_LAYER", u32::MAX as usize),
        ("LEAF_BANDS_AT", leaf_words::BANDS_AT),
        ("LEAF_BAND_WORDS", leaf_words::BAND_WORDS),
        ("LEAF_ALBEDO_AT", leaf_words::ALBEDO_AT),
        ("LEAF_ALBEDO_ROWS", leaf_words::ALBEDO_ROWS),
        ("LEAF_ALBEDO_COLUMNS", leaf_words::ALBEDO_COLUMNS),
        ("LEAF_TABLE_AT", leaf_words::TABLE_AT),
        ("LEAF_TABLE_ENTRIES", leaf_words::TABLE_ENTRIES),
        ("LEAF_LEVELS_AT", leaf_words::LEVELS_AT),
        ("LEAF_TEXEL_WORDS", leaf_words::TEXEL_WORDS),
        ("LEAF_RATIONAL", LeafMode::Rational as usize),
        ("LEAF_N_LAYERS", LeafMode::NLayers as usize),
        ("VOLTEX_LEVEL_COUNT_AT", voltex::words::LEVEL_COUNT_AT),
        ("VOLTEX_NODES_AT", voltex::words::NODES_AT),
        ("VOLTEX_VOXELS_AT", voltex::words::VOXELS_AT),
        ("VOLTEX_MATERIALS_AT", voltex::words::MATERIALS_AT),
        ("VOLTEX_LEVELS_AT", voltex::words::LEVELS_AT),
        ("VOLTEX_FLAGS_AT", voltex::words::FLAGS_AT),
        ("VOLTEX_EXTENT_AT", voltex::words::EXTENT_AT),
        ("VOLTEX_SIDE_AT", voltex::words::SIDE_AT),
        ("VOLTEX_MATERIAL_WORDS", voltex::words::MATERIAL_WORDS),
        ("VOLTEX_CLUMPING_AT", voltex::words::CLUMPING_AT),
        ("VOLTEX_FACETS_AT", voltex::words::FACETS_AT),
        ("VOLTEX_LEVEL_WORDS", voltex::words::LEVEL_WORDS),
        ("VOLTEX_VOXEL_WORDS", voltex::VOXEL_WORDS),
        ("VOLTEX_OTHER_AT", voltex::OTHER_AT),
        ("VOLTEX_NODE_WORDS", voltex::NODE_WORDS),
        ("VOLTEX_NO_VOXEL", voltex::NO_VOXEL as usize),
    ];
    let floats = [
        ("INSIDE_TOLERANCE", INSIDE_TOLERANCE),
        // The twin's infinity: WGSL must make none.
        ("FAR", 1e30),
        ("MIN_COS_VIEW", MIN_COS_VIEW),
        ("MIN_HALF", MIN_HALF),
        ("ROOT", ROOT),
        ("MAX_LOG", MAX_LOG),
        ("RATIO_EPSILON", RATIO_EPSILON),
        ("RATIO_MIN", RATIO_RANGE[0]),
        ("RATIO_MAX", RATIO_RANGE[1]),
        ("MAX_SLOPE", MAX_SLOPE),
        ("RAY_STEP", RAY_STEP),
        ("MIN_RAY_STEPS", MIN_RAY_STEPS),
        ("MAX_RAY_STEPS", MAX_RAY_STEPS),
        ("HIDDEN_SHARE", HIDDEN_SHARE),
        ("OUTSIDE_SHARE", OUTSIDE_SHARE),
        ("SHIFT_SLOPE", SHIFT_SLOPE),
        ("COSINE_SHARE", COSINE_SHARE),
        ("MIN_ALPHA", MIN_ALPHA),
        ("MIN_AXIS", MIN_AXIS),
        ("UNIT_MIN", *UNIT_RANGE.start()),
        ("UNIT_MAX", *UNIT_RANGE.end()),
        ("DRAW_MAX", 1.0 - f32::EPSILON),
        ("SAMPLE_PI", std::f32::consts::PI),
        ("SAMPLE_TAU", std::f32::consts::TAU),
        ("LEAF_TABLE_HALF", leaf_words::TABLE_HALF),
        ("LEAF_MAX_ABSORPTION", MAX_ABSORPTION),
        ("LEAF_THETA_P", THETA_P),
        ("LEAF_THETA_Q1", THETA_Q[0]),
        ("LEAF_THETA_Q2", THETA_Q[1]),
        ("LEAF_THETA_Q3", THETA_Q[2]),
        ("LEAF_FACTOR_ONE", FACTOR_ONE),
        ("LEAF_MIN_FACET", MIN_FACET),
        ("LEAF_MIN_HALF", LEAF_MIN_HALF),
        ("LEAF_MAX_EXPONENT", MAX_EXPONENT),
        ("LEAF_MIN_EYE", MIN_EYE),
        ("LEAF_MIN_UP", MIN_UP),
        ("LEAF_MIN_SHARE", MIN_SHARE),
        ("VOLTEX_MIN_DIRECTION", voltex::MIN_DIRECTION),
        // The twin's infinity.
        ("VOLTEX_FAR", 3e38),
        ("VOLTEX_MIN_ROOT", voltex::MIN_ROOT),
        ("VOLTEX_SERIES_DEPTH", voltex::SERIES_DEPTH),
        ("VOLTEX_MIN_ROUGHNESS", voltex::MIN_ROUGHNESS),
        ("VOLTEX_MIN_HALF2", voltex::MIN_HALF2),
        ("VOLTEX_MAX_DENSER", voltex::MAX_DENSER),
        ("VOLTEX_MIN_REFRACTED", voltex::MIN_REFRACTED),
        // The twin's exponential may be infinite.
        ("VOLTEX_MAX_DEPTH", 80.0),
        ("VOLTEX_HALF_PI", std::f32::consts::FRAC_PI_2),
        ("VOLTEX_DEGREES", 1f32.to_degrees()),
    ];
    let mut all: Vec<(String, f64)> = words.iter().map(|(name, value)| (name.to_string(), *value as f64)).collect();
    all.extend(floats.iter().map(|(name, value)| (name.to_string(), f64::from(*value))));
    all.sort_by(|a, b| a.0.cmp(&b.0));
    all
}

#[test]
fn every_wgsl_constant_is_its_rust_twins() {
    assert_eq!(constants(&library()), expected_constants());
    // Planted difference: two fields of a layer block swapped.
    let swapped = text()
        .replace("BLOCK_BASIS: u32 = 11u", "BLOCK_BASIS: u32 = 12u")
        .replace("BLOCK_CODES: u32 = 12u", "BLOCK_CODES: u32 = 11u");
    assert_ne!(constants(&module_from(&swapped, CAPABILITIES).expect("still valid")), expected_constants());
}

/// The numbers of a vector that is a constant.
fn vector_constant(module: &Module, name: &str) -> Vec<f32> {
    let (_, constant) = module.constants.iter().find(|(_, constant)| constant.name.as_deref() == Some(name)).unwrap();
    let Expression::Compose { components, .. } = &module.global_expressions[constant.init] else { panic!("a vector") };
    let number = |expression| match module.global_expressions[expression] {
        Expression::Literal(Literal::F32(value)) => value,
        _ => panic!("a number"),
    };
    components.iter().map(|component| number(*component)).collect()
}

#[test]
fn the_angles_of_hotspots_are_rusts() {
    let angles = |module: &Module| {
        let [near, wide] = ["VOLTEX_NEAR_DEG", "VOLTEX_WIDE_DEG"].map(|name| vector_constant(module, name));
        [vec![0.0], near, wide, vec![180.0]].concat()
    };
    assert_eq!(angles(&library()), voltex::HOTSPOT_DEG);
    // Planted difference: another angle.
    let other = text().replace("(40.0, 70.0", "(45.0, 70.0");
    assert_ne!(angles(&module_from(&other, CAPABILITIES).expect("still valid")), voltex::HOTSPOT_DEG);
}

#[test]
fn the_options_lie_in_wgsl_as_documented() {
    let module = library();
    let (_, options) = module.types.iter().find(|(_, kind)| kind.name.as_deref() == Some("BtfOptions")).unwrap();
    let naga::TypeInner::Struct { members, span } = &options.inner else { panic!("BtfOptions is a struct") };
    let fields: Vec<(&str, u32)> =
        members.iter().map(|member| (member.name.as_deref().unwrap_or(""), member.offset)).collect();
    assert_eq!((fields, *span), (vec![("components", 0), ("lobes", 4), ("interpolation", 8), ("parallax", 12)], 16));
}

/// Names after `fn`, in order of appearance.
fn function_names(text: &str) -> Vec<&str> {
    let after_fn = |line: &'_ str| -> Option<usize> {
        let code = line.trim_start();
        let start =
            ["fn ", "pub fn ", "pub(crate) fn ", "pub(super) fn "].iter().find(|head| code.starts_with(**head))?;
        Some(line.len() - code.len() + start.len())
    };
    text.lines()
        .filter_map(|line| after_fn(line).map(|start| &line[start..]))
        .map(|name| &name[..name.find(['(', '<']).unwrap_or(name.len())])
        .collect()
}

/// The first WGSL function that has no Rust twin in its place.
fn first_out_of_order<'a>(rust: &str, wgsl: &'a str, prefix: &str, alone: &[&str]) -> Option<&'a str> {
    let rust = rust.split("#[cfg(test)]").next().unwrap_or(rust);
    let mut twins = function_names(rust).into_iter();
    function_names(wgsl)
        .into_iter()
        .filter(|name| !alone.contains(name))
        .find(|name| !twins.any(|twin| twin == name.strip_prefix(prefix).unwrap_or(name)))
}

#[test]
fn twin_files_hold_the_same_functions_in_the_same_order() {
    let wgsl = |name: &str| WGSL.iter().chain(LEAF_WGSL).chain(VOLTEX_WGSL).find(|(file, _)| *file == name).unwrap().1;
    // Rust file, WGSL file, the prefix that stands for Rust's module or type, and what WGSL has alone.
    type Twin<'a> = (&'a str, &'a str, &'a str, &'a [&'a str]);
    let twins: [Twin; 23] = [
        (include_str!("../src/numeric/quantize.rs"), "quantize.wgsl", "", &["asset_f32"]),
        (include_str!("../src/asset/sphere.rs"), "sphere.wgsl", "sphere_", &[]),
        (include_str!("../src/asset/lobe.rs"), "lobe.wgsl", "lobe_", &["lobe_from_resident"]),
        (include_str!("../src/asset/residual.rs"), "residual.wgsl", "residual_", &[]),
        (include_str!("../src/decode/parallax.rs"), "parallax.wgsl", "height_", &["height_field"]),
        (include_str!("../src/decode/texel.rs"), "texel.wgsl", "texel_", &["texel_lobe", "texel_residual"]),
        (include_str!("../src/decode/viewed_texel.rs"), "viewed_texel.wgsl", "viewed_", &[]),
        (include_str!("../src/decode/sample.rs"), "sample.wgsl", "", &["sample_lobe_at"]),
        (
            include_str!("../src/decode/decode.rs"),
            "decode.wgsl",
            "btf_",
            &["btf_layers", "btf_levels", "btf_size", "btf_texel", "btf_layer_for_sides"],
        ),
        (include_str!("../src/decode/evaluate.rs"), "evaluate.wgsl", "btf_", &[]),
        (include_str!("../src/leaf/theta.rs"), "leaf_theta.wgsl", "leaf_", &[]),
        (include_str!("../src/leaf/texture.rs"), "leaf_texture.wgsl", "leaf_", &[]),
        (include_str!("../src/leaf/body.rs"), "leaf_body.wgsl", "leaf_", &[]),
        (include_str!("../src/leaf/lobe.rs"), "leaf_lobe.wgsl", "leaf_", &[]),
        (include_str!("../src/leaf/viewed.rs"), "viewed_leaf.wgsl", "leaf_", &[]),
        (include_str!("../src/voltex/matrix.rs"), "voltex_matrix.wgsl", "voltex_", &[]),
        (
            include_str!("../src/voltex/words.rs"),
            "voltex_words.wgsl",
            "voltex_",
            &["voltex_shadow_offset", "voltex_three"],
        ),
        (include_str!("../src/voltex/voxel.rs"), "voltex_voxel.wgsl", "voltex_voxel_", &["voltex_voxel_halves"]),
        (include_str!("../src/voltex/node.rs"), "voltex_node.wgsl", "voltex_", &[]),
        (include_str!("../src/voltex/tree.rs"), "voltex_tree.wgsl", "voltex_", &[]),
        (include_str!("../src/voltex/walk.rs"), "voltex_walk.wgsl", "voltex_walk_", &[]),
        (include_str!("../src/voltex/shade.rs"), "voltex_shade.wgsl", "voltex_", &["voltex_acos"]),
        (
            include_str!("../src/voltex/gloss.rs"),
            "voltex_gloss.wgsl",
            "voltex_",
            &["voltex_fresnel", "voltex_facets_seen"],
        ),
    ];
    for (rust, file, prefix, alone) in twins {
        assert_eq!(first_out_of_order(rust, wgsl(file), prefix, alone), None, "{file}");
        for name in alone {
            assert!(function_names(wgsl(file)).contains(name), "{name} is no longer in {file}");
        }
    }
    // Planted difference: two lobes exchanged.
    let exchanged = wgsl("lobe.wgsl")
        .replace("fn lobe_ward(", "fn x(")
        .replace("fn lobe_ggx(", "fn lobe_ward(")
        .replace("fn x(", "fn lobe_ggx(");
    let found = first_out_of_order(include_str!("../src/asset/lobe.rs"), &exchanged, "lobe_", &["lobe_from_resident"]);
    assert!(found.is_some());
}

#[test]
fn twins_that_volumetric_textures_name_are_there() {
    let rust = [
        include_str!("../src/voltex/matrix.rs"),
        include_str!("../src/voltex/words.rs"),
        include_str!("../src/voltex/voxel.rs"),
        include_str!("../src/voltex/node.rs"),
        include_str!("../src/voltex/tree.rs"),
        include_str!("../src/voltex/walk.rs"),
        include_str!("../src/voltex/shade.rs"),
        include_str!("../src/voltex/gloss.rs"),
    ]
    .join("\n");
    let named: Vec<&str> =
        rust.split("Twin: `voltex_").skip(1).map(|rest| rest.split('`').next().unwrap_or_default()).collect();
    // What stands in WGSL alone.
    let alone = ["shadow_offset", "voxel_halves", "acos", "fresnel", "facets_seen", "three"];
    let unmatched = |text: &str| -> Vec<String> {
        let defined: Vec<&str> = function_names(text).iter().filter_map(|name| name.strip_prefix("voltex_")).collect();
        let unnamed = defined.iter().filter(|name| !named.contains(name) && !alone.contains(name));
        let missing = named.iter().filter(|name| !defined.contains(name));
        unnamed.chain(missing).map(|name| name.to_string()).collect()
    };
    let text = voltex_wgsl();
    assert_eq!(unmatched(&text), [""; 0]);
    // Planted difference: a function with another name.
    assert_eq!(unmatched(&text.replace("fn voltex_rank(", "fn voltex_order(")), ["order", "rank"]);
}

#[test]
fn the_lobe_switch_has_a_case_for_each_family() {
    let lobes = WGSL.iter().find(|(file, _)| *file == "lobe.wgsl").unwrap().1;
    for family in LobeFamily::ALL {
        // lobe_oren_nayar from OrenNayar; Lambertian, 0, is the default.
        let name = format!("{family:?}").chars().fold(String::from("lobe"), |name, c| {
            if c.is_uppercase() { name + "_" + &c.to_lowercase().to_string() } else { name + &c.to_string() }
        });
        let case = format!("case {}u: {{ return {name}(", family as u32);
        assert_eq!(lobes.contains(&case), family != LobeFamily::Lambertian, "{case}");
    }
    assert!(lobes.contains("default: { return ci; }"));
}

fn expansion_module() -> Module {
    module_from(EXPANSION_WGSL, CAPABILITIES).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_expansion_is_a_program_of_its_own_with_six_storage_buffers() {
    let module = expansion_module();
    assert!(module_from(EXPANSION_WGSL, Capabilities::empty()).is_err(), "the capability is needed");
    assert!(module_from(&EXPANSION_WGSL.replace("WORKGROUP: u32", "WORKGROUP: f32"), CAPABILITIES).is_err());
    let names: Vec<&str> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
    assert_eq!(names, ["cores_main", "viewed_main", "lit_main"]);
    assert!(module.entry_points.iter().all(|entry| entry.workgroup_size == [EXPANSION_WORKGROUP, 1, 1]));
    // WebGPU's default is eight a stage.
    let is_storage = |space| matches!(space, naga::AddressSpace::Storage { .. });
    assert_eq!(module.global_variables.iter().filter(|(_, variable)| is_storage(variable.space)).count(), 6);
}

#[test]
fn the_expansions_structs_have_the_same_fields_at_the_same_offsets() {
    use std::mem::{offset_of, size_of};
    macro_rules! fields {
        ($ty:ty; $($field:ident),*) => {
            (size_of::<$ty>(), vec![$((stringify!($field), offset_of!($ty, $field))),*])
        };
    }
    let module = expansion_module();
    let in_wgsl = |name: &str| {
        let found = module.types.iter().find_map(|(_, ty)| match &ty.inner {
            naga::TypeInner::Struct { members, span } if ty.name.as_deref() == Some(name) => Some((members, *span)),
            _ => None,
        });
        let (members, span) = found.unwrap();
        let fields: Vec<(&str, usize)> =
            members.iter().map(|member| (member.name.as_deref().unwrap(), member.offset as usize)).collect();
        (span as usize, fields)
    };
    let all = [
        (
            "Channel",
            fields!(ExpansionChannel; view_rank, light_rank, first_core, first_row, view_at, light_at, pad0, pad1),
        ),
        (
            "Shape",
            fields!(ExpansionShape; channels, views, lights, channel_words, quads, shared_bases, cores, rows, pad0),
        ),
        ("Slice", fields!(ExpansionSlice; first_cluster, bases_at, piece_from, piece_words)),
    ];
    for (name, mut twin) in all {
        assert_eq!(in_wgsl(name), twin, "{name}");
        // Planted difference: two fields of the same size exchanged.
        twin.1.swap(0, 1);
        assert_ne!(in_wgsl(name), twin, "{name}");
    }
}

#[test]
fn the_expansions_colours_are_the_frames() {
    let found = constants(&expansion_module());
    let value = |name: &str| found.iter().find(|(known, _)| known == name).unwrap().1;
    let [grey, red_blue, green_magenta] = ["GREY", "RED_BLUE", "GREEN_MAGENTA"].map(value);
    let rows = [[grey; 3], [red_blue, 0.0, -red_blue], [green_magenta, -2.0 * green_magenta, green_magenta]];
    for (row, expected) in rows.iter().flatten().zip(COLOUR_FRAME.as_flattened()) {
        assert!((row - f64::from(*expected)).abs() < 1e-7, "{row} {expected}");
    }
    assert_eq!(value("MAX_HALF"), 65504.0);
}
