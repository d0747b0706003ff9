//! The WGSL texts: the library as published, and the modules that are translated.

use btf_runtime::{VOLTEX_WGSL, WGSL, voltex_wgsl, wgsl_library};

/// File name of [`library_text`].
pub const LIBRARY_FILE: &str = "btf.wgsl";
/// File name of `btf_runtime::EXPANSION_WGSL`, the passes that make a resident form's bases on the GPU.
pub const EXPANSION_FILE: &str = "btf_expansion.wgsl";
/// Beginning of the file names of [`module_text`] and its translations.
pub const MODULE_NAME: &str = "btf_queries";
/// Entry points of the module, all of them compute.
pub const ENTRY_POINTS: [&str; 3] = ["evaluate_main", "sample_main", "density_main"];

/// File name of [`voltex_library_text`].
pub const VOLTEX_LIBRARY_FILE: &str = "btf_voltex.wgsl";
/// Beginning of the file names of [`depths_text`] and its translations; its entry point is `depth_main`.
pub const DEPTHS_NAME: &str = "btf_depths";

const QUERIES: &str = include_str!("queries.wgsl");
const DEPTHS: &str = include_str!("depths.wgsl");

/// Text above the library; its functions come after it.
const LIBRARY_HEAD: &str = "\
// The decoder of packed BTF assets (.spmm): pure functions in core WGSL, without bindings and entry points.
//
// An includer joins its own text with this one, in any order, and defines
//
//     fn asset_word(index: u32) -> u32
//
// which returns word `index` of a buffer with one or several assets in resident form (docs/reference/format.md, \"Resident
// form\"), little-endian 32-bit words as they lie in memory. Functions take the number of an asset's first word there
// as `base`, a multiple of 4. It may read from several bindings where a buffer is larger than one may be. Example:
// btf_queries.wgsl.
//
// Values are pi times BRDF times |n.wi|: 1 is a white Lambertian lit at normal incidence. The cosine is inside; never
// multiply by another one. `wi` points to the light and `wo` to the eye, unit vectors in the frame of tangent,
// bitangent and normal. BtfOptions(0xffffffffu, 0xffffffffu, 0u, 1u) is everything there is, by the fast rule.
//
// What a renderer calls:
//
";

/// Text above the functions of volumetric textures.
const VOLTEX_HEAD: &str = "\
// Volumetric textures: pure functions in core WGSL, without bindings and entry points, of voxels that hold microflakes
// at several levels.
//
// An includer joins its own text with this one, in any order, and with btf.wgsl or the function that is used of it,
//
//     fn asset_f32(index: u32) -> f32 { return bitcast<f32>(asset_word(index)); }
//
// and defines `fn asset_word(index: u32) -> u32`, which returns word `index` of a buffer with one or several volumes as
// `btf_runtime::voltex::Voltex::words` has them. Functions take the number of a volume's first word there as `base`.
// Example: btf_depths.wgsl.
//
// Texture space is the unit cube. Rays need no unit direction: t stays that of the world. In what follows `v` and `l`
// are unit vectors to the eye and to the light.
//
// What a renderer calls:
//
";
/// Functions that a renderer calls; the others serve them.
const VOLTEX_CALLED: [&str; 18] = [
    "voltex_level_count",
    "voltex_cyclic",
    "voltex_extent",
    "voltex_side_m",
    "voltex_voxel",
    "voltex_other",
    "voltex_extinction_along",
    "voltex_material",
    "voltex_shadow_offset",
    "voltex_clumping_along",
    "voltex_facets_along",
    "voltex_brighter_between",
    "voltex_walk_new",
    "voltex_walk_next",
    "voltex_shade",
    "voltex_gloss",
    "voltex_seen_at",
    "voltex_shared_at",
];

/// Returns `btf.wgsl`: the library with a head that says what an includer defines and what there is to call.
pub fn library_text() -> String {
    let called: Vec<String> = signatures(&wgsl_library()).filter(|line| line.starts_with("fn btf_")).collect();
    with_head(LIBRARY_HEAD, &called, WGSL)
}

/// Returns `btf_voltex.wgsl`: the functions of volumetric textures with a head that says what there is to call.
pub fn voltex_library_text() -> String {
    let is_called = |line: &String| line[3..].split('(').next().is_some_and(|name| VOLTEX_CALLED.contains(&name));
    let called: Vec<String> = signatures(&voltex_wgsl()).filter(is_called).collect();
    with_head(VOLTEX_HEAD, &called, VOLTEX_WGSL)
}

/// Joins the head, a line for each function that is called, and the files.
fn with_head(head: &str, called: &[String], files: &[(&str, &str)]) -> String {
    let functions: String = called.iter().map(|line| format!("//     {line}\n")).collect();
    let parts: String = files.iter().map(|(name, text)| format!("\n// ==== {name}\n\n{text}")).collect();
    format!("{head}{functions}{parts}")
}

/// Returns `btf_depths.wgsl`, a complete module: volumetric textures, bindings and an entry point.
pub fn depths_text() -> String {
    let quantize = WGSL.iter().find(|(name, _)| *name == "quantize.wgsl").map_or("", |(_, text)| *text);
    [DEPTHS, quantize, &voltex_wgsl()].join("\n")
}

/// Returns `btf_queries.wgsl`, a complete module: library, bindings and entry points.
pub fn module_text() -> String {
    format!("{QUERIES}\n{}", wgsl_library())
}

/// Returns the signatures of the functions of a text, each on one line.
fn signatures(text: &str) -> impl Iterator<Item = String> {
    text.match_indices("\nfn ").map(|(at, _)| {
        let signature = text[at..].split('{').next().unwrap_or_default();
        let words = signature.split_whitespace().collect::<Vec<_>>().join(" ");
        words.replace("( ", "(").replace(", )", ")")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_head_names_every_function_for_includers_on_a_line_of_its_own() {
        let text = library_text();
        let head = text.split("// ====").next().unwrap();
        for line in [
            "//     fn btf_decode(base: u32, layer: u32, texel: u32, wi: vec3<f32>, wo: vec3<f32>, options: BtfOptions) -> vec3<f32>\n",
            "//     fn btf_evaluate(base: u32, level: u32, uv: vec2<f32>, wi: vec3<f32>, wo: vec3<f32>, options: BtfOptions) -> vec3<f32>\n",
            "//     fn btf_levels(base: u32) -> u32\n",
        ] {
            assert!(head.contains(line), "{line}{head}");
        }
        assert_eq!(head.matches("//     fn btf_").count(), text.matches("\nfn btf_").count());
        // The head is comments only: what is valid without it is valid with it.
        assert!(head.lines().all(|line| line.is_empty() || line.starts_with("//")));
    }

    #[test]
    fn the_head_of_volumetric_textures_names_what_is_called() {
        let text = voltex_library_text();
        let head = text.split("// ====").next().unwrap();
        for name in VOLTEX_CALLED {
            assert_eq!(head.matches(&format!("//     fn {name}(")).count(), 1, "{name}{head}");
        }
        assert_eq!(head.matches("//     fn voltex_").count(), VOLTEX_CALLED.len());
        assert!(head.contains("//     fn voltex_voxel(base: u32, number: u32) -> VoltexVoxel\n"), "{head}");
        assert!(head.lines().all(|line| line.is_empty() || line.starts_with("//")));
        assert!(VOLTEX_WGSL.iter().all(|(_, part)| text.contains(part) && depths_text().contains(part)));
    }

    #[test]
    fn the_module_has_the_entry_points_and_the_whole_library() {
        let text = module_text();
        assert!(ENTRY_POINTS.iter().all(|name| text.contains(&format!("fn {name}("))));
        assert_eq!(text.matches("@compute").count(), ENTRY_POINTS.len());
        assert!(WGSL.iter().all(|(_, part)| text.contains(part)));
    }

    /// Returns the names of the constants of a text that the library, whose constants have twins in Rust, does not
    /// declare.
    fn own_constants(text: &str) -> Vec<String> {
        let names = |text: &str| -> Vec<String> {
            let module = crate::languages::validated(text).unwrap().0;
            let named = module.constants.iter().filter_map(|(_, constant)| constant.name.clone());
            // naga leaves out constants without a type that nothing uses.
            let declared = text.lines().filter_map(|line| line.strip_prefix("const "));
            named
                .chain(declared.map(|rest| rest.split([':', ' ', '=']).next().unwrap_or_default().to_string()))
                .collect()
        };
        let library = [wgsl_library(), voltex_wgsl()].concat();
        let is_own = |name: &String| {
            !library.contains(&format!("const {name}:")) && !library.contains(&format!("const {name} "))
        };
        let mut own: Vec<String> = names(text).into_iter().filter(is_own).collect();
        own.dedup();
        own
    }

    #[test]
    fn the_modules_have_no_constants_without_a_twin() {
        for text in [module_text(), depths_text()] {
            assert_eq!(own_constants(&text), [""; 0]);
            // Planted differences: constants of their own, with and without a type.
            for planted in ["const PLANTED: u32 = 1u;", "const PLANTED = 3;"] {
                assert_eq!(own_constants(&format!("{planted}\n{text}")), ["PLANTED"], "{planted}");
            }
        }
    }
}
