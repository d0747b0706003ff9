//! Compares the WGSL library with its Rust twin: it parses and validates with nothing beyond core WGSL, every constant
//! has a twin or a stated exception, and the twin files hold the same functions in the same order.

#[path = "wgsl/twins.rs"]
mod twins;

use btf_runtime::{
    COLOUR_FRAME, EXPANSION_WGSL, EXPANSION_WORKGROUP, ExpansionChannel, ExpansionShape, ExpansionSlice, LEAF_WGSL,
    LobeFamily, VOLTEX_WGSL, WGSL, leaf_wgsl, voltex_wgsl, wgsl_library,
};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{Expression, Literal, Module};
use twins::Constants;

/// The least code that an includer adds: the binding and an entry point.
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

/// Capabilities that the library needs. `unpack2x16float` is core WGSL; naga counts it as a capability of its own
/// because some OpenGL drivers, and Mesa's software Vulkan without 16-bit floats, lack it.
const CAPABILITIES: Capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;

fn module_from(source: &str, capabilities: Capabilities) -> Result<Module, String> {
    let module = naga::front::wgsl::parse_str(source).map_err(|error| error.emit_to_string(source))?;
    Validator::new(ValidationFlags::all(), capabilities)
        .validate(&module)
        .map_err(|error| error.emit_to_string(source))?;
    Ok(module)
}

/// Returns the library, the functions of leaves and of volumes behind it, and the includer.
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

/// Returns every constant of the module by name. A constant of another form than a literal or a vector of literals is a
/// panic, so that none escapes the comparison.
fn constants(module: &Module) -> Constants {
    let number = |expression| match module.global_expressions[expression] {
        Expression::Literal(Literal::U32(value)) => f64::from(value),
        Expression::Literal(Literal::I32(value)) => f64::from(value),
        Expression::Literal(Literal::F32(value)) => f64::from(value),
        Expression::Literal(Literal::Bool(value)) => f64::from(value),
        ref other => panic!("no number that this test reads: {other:?}"),
    };
    let numbers = |expression| match &module.global_expressions[expression] {
        Expression::Compose { components, .. } => components.iter().map(|component| number(*component)).collect(),
        _ => vec![number(expression)],
    };
    let named = module.constants.iter().filter_map(|(_, constant)| Some((constant.name.clone()?, constant.init)));
    named.map(|(name, init)| (name, numbers(init))).collect()
}

/// Returns the names of the constants that a text declares. naga leaves out those without a type that nothing uses.
fn declared_constants(text: &str) -> Vec<&str> {
    let after = text.lines().filter_map(|line| line.strip_prefix("const "));
    after.map(|rest| rest.split([':', ' ', '=']).next().unwrap_or_default()).collect()
}

/// Returns the names of the constants of a valid text whose value is not the expected one, that are not expected, or
/// that are missing.
fn unlike(text: &str, expected: &Constants) -> Vec<String> {
    let found = constants(&module_from(text, CAPABILITIES).unwrap_or_else(|error| panic!("{error}")));
    let unread = declared_constants(text).into_iter().filter(|name| !found.contains_key(*name)).map(String::from);
    let unexpected = found.iter().filter(|(name, value)| expected.get(*name) != Some(*value));
    let missing = expected.keys().filter(|name| !found.contains_key(*name));
    unexpected.map(|(name, _)| name).chain(missing).cloned().chain(unread).collect()
}

#[test]
fn every_constant_of_the_library_has_a_rust_twin_or_a_stated_exception() {
    let expected = twins::library();
    assert_eq!(unlike(&text(), &expected), [""; 0]);
    // Planted differences: two fields of a layer block swapped, another angle, and constants that no table has.
    let swapped = text()
        .replace("BLOCK_BASIS: u32 = 11u", "BLOCK_BASIS: u32 = 12u")
        .replace("BLOCK_CODES: u32 = 12u", "BLOCK_CODES: u32 = 11u");
    assert_eq!(unlike(&swapped, &expected), ["BLOCK_BASIS", "BLOCK_CODES"]);
    assert_eq!(unlike(&text().replace("(40.0, 70.0", "(45.0, 70.0"), &expected), ["VOLTEX_WIDE_DEG"]);
    for planted in [
        "const PLANTED: f32 = 0.5;",
        "const PLANTED = vec2<f32>(0.5, 1.0);",
        "const PLANTED: i32 = -1;",
        "const PLANTED = 3;",
    ] {
        assert_eq!(unlike(&format!("{}\n{planted}\n", text()), &expected), ["PLANTED"], "{planted}");
    }
    // Planted difference: a constant that Rust has and WGSL has lost.
    let without = text().replace("BLOCK_WIDTH", "BLOCK_BREADTH");
    assert_eq!(unlike(&without, &expected), ["BLOCK_BREADTH", "BLOCK_WIDTH"]);
}

#[test]
fn the_options_lie_in_wgsl_as_documented() {
    let module = library();
    let (_, options) = module.types.iter().find(|(_, kind)| kind.name.as_deref() == Some("BtfOptions")).unwrap();
    let naga::TypeInner::Struct { members, span } = &options.inner else { panic!("BtfOptions is a struct") };
    let fields: Vec<(&str, u32)> =
        members.iter().map(|member| (member.name.as_deref().unwrap_or(""), member.offset)).collect();
    assert_eq!((fields, *span), (vec![("components", 0), ("lobes", 4), ("interpolation", 8), ("heights", 12)], 16));
}

/// Returns the names after `fn`, in order of appearance.
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

/// Returns the first WGSL function that has no Rust twin in its place.
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
    let twins: [Twin; 31] = [
        (include_str!("../src/numeric/quantize.rs"), "quantize.wgsl", "", &["asset_f32"]),
        (include_str!("../src/asset/sphere.rs"), "sphere.wgsl", "sphere_", &[]),
        (include_str!("../src/asset/lobe.rs"), "lobe.wgsl", "lobe_", &["lobe_from_resident"]),
        (include_str!("../src/asset/residual.rs"), "residual.wgsl", "residual_", &[]),
        (include_str!("../src/resident/layout.rs"), "layout.wgsl", "", &[]),
        (include_str!("../src/asset/height_field.rs"), "height_field.wgsl", "height_", &[]),
        (include_str!("../src/decode/parallax.rs"), "parallax.wgsl", "height_", &["height_field"]),
        (include_str!("../src/resident/packed_part.rs"), "packed_part.wgsl", "", &[]),
        (include_str!("../src/decode/packed_sum.rs"), "packed_sum.wgsl", "", &["packed_words", "packed_levels"]),
        (include_str!("../src/decode/texel.rs"), "texel.wgsl", "texel_", &["texel_lobe"]),
        (
            include_str!("../src/decode/residual_sum.rs"),
            "residual_sum.wgsl",
            "",
            &[
                "residual_of_view",
                "residual_of_quads",
                "residual_of_eight",
                "residual_sum_by_words",
                "residual_weights",
                "residual_of_row",
            ],
        ),
        (
            include_str!("../src/decode/relief.rs"),
            "relief.wgsl",
            "relief_",
            &["relief_light", "relief_seen", "relief_of_views", "relief_here"],
        ),
        (include_str!("../src/decode/shown.rs"), "shown.wgsl", "shown_", &[]),
        (include_str!("../src/decode/viewed_texel.rs"), "viewed_texel.wgsl", "viewed_", &["viewed_found_rows"]),
        (include_str!("../src/decode/sample.rs"), "sample.wgsl", "", &["sample_lobe_at"]),
        (
            include_str!("../src/decode/decode.rs"),
            "decode.wgsl",
            "btf_",
            &["btf_layers", "btf_levels", "btf_size", "btf_texel", "btf_texel_between", "btf_layer_for_sides"],
        ),
        (include_str!("../src/decode/evaluate.rs"), "evaluate.wgsl", "btf_", &[]),
        (include_str!("../src/leaf/theta.rs"), "leaf_theta.wgsl", "leaf_", &[]),
        (include_str!("../src/leaf/texture.rs"), "leaf_texture.wgsl", "leaf_", &[]),
        (include_str!("../src/leaf/body.rs"), "leaf_body.wgsl", "leaf_", &[]),
        (include_str!("../src/leaf/scatter.rs"), "leaf_scatter.wgsl", "leaf_", &[]),
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
fn the_expansion_is_a_program_of_its_own_with_seven_storage_buffers() {
    let module = expansion_module();
    assert!(module_from(EXPANSION_WGSL, Capabilities::empty()).is_err(), "the capability is needed");
    assert!(module_from(&EXPANSION_WGSL.replace("WORKGROUP: u32", "WORKGROUP: f32"), CAPABILITIES).is_err());
    let names: Vec<&str> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
    assert_eq!(names, ["cores_main", "viewed_main", "lit_main"]);
    assert!(module.entry_points.iter().all(|entry| entry.workgroup_size == [EXPANSION_WORKGROUP, 1, 1]));
    // WebGPU's default is eight a stage.
    let is_storage = |space| matches!(space, naga::AddressSpace::Storage { .. });
    assert_eq!(module.global_variables.iter().filter(|(_, variable)| is_storage(variable.space)).count(), 7);
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
            fields!(
                ExpansionShape; channels, views, lights, channel_words, quads, shared_bases, cores, rows, taken_quads,
                residual_kind, epsilon, pad0, pad1
            ),
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
fn every_constant_of_the_expansion_has_a_rust_twin() {
    let expected = twins::expansion();
    // The shader has the colours to seven digits; one of them is all but the frame's own number.
    let near = |text: &str| {
        let found = constants(&module_from(text, CAPABILITIES).unwrap_or_else(|error| panic!("{error}")));
        let alike = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-7;
        found.keys().eq(expected.keys())
            && found.values().flatten().zip(expected.values().flatten()).all(alike)
            && declared_constants(text).len() == found.len()
    };
    assert!(near(EXPANSION_WGSL));
    // The rows of the frame are those that the shader makes of one number each.
    let [grey, red_blue, green_magenta] = ["GREY", "RED_BLUE", "GREEN_MAGENTA"].map(|name| expected[name][0]);
    let rows = [[grey; 3], [red_blue, 0.0, -red_blue], [green_magenta, -2.0 * green_magenta, green_magenta]];
    for (row, frame) in rows.iter().flatten().zip(COLOUR_FRAME.as_flattened()) {
        assert!((row - f64::from(*frame)).abs() < 1e-7, "{row} {frame}");
    }
    // Planted differences: another value, and a constant more.
    assert!(!near(&EXPANSION_WGSL.replace("MAX_HALF: f32 = 65504.0", "MAX_HALF: f32 = 65535.0")));
    assert!(!near(&format!("{EXPANSION_WGSL}\nconst PLANTED: u32 = 1u;\n")));
}
