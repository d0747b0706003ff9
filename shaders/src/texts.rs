//! The WGSL texts: the library as it is published, and the module that is translated.

use btf_runtime::{WGSL, wgsl_library};

/// File name of [`library_text`].
pub const LIBRARY_FILE: &str = "btf.wgsl";
/// File name of `btf_runtime::EXPANSION_WGSL`, the passes that make a resident form's bases on the GPU.
pub const EXPANSION_FILE: &str = "btf_expansion.wgsl";
/// Beginning of the file names of [`module_text`] and its translations.
pub const MODULE_NAME: &str = "btf_queries";
/// Entry points of the module, all of them compute.
pub const ENTRY_POINTS: [&str; 3] = ["evaluate_main", "sample_main", "density_main"];

const QUERIES: &str = include_str!("queries.wgsl");

/// What stands above the library; its functions come after it.
const LIBRARY_HEAD: &str = "\
// The decoder of packed BTF assets (.spmm): pure functions in core WGSL, without bindings and entry points.
//
// An includer joins its own text with this one, in any order, and defines
//
//     fn asset_word(index: u32) -> u32
//
// which returns word `index` of a buffer with one or several assets in resident form (docs/FORMAT.md, \"Resident
// form\"), little-endian 32-bit words as they lie in memory. Functions take the number of an asset's first word there
// as `base`. It may read from several bindings where a buffer is larger than one may be. Example: btf_queries.wgsl.
//
// Values are pi times BRDF times |n.wi|: 1 is a white Lambertian lit at normal incidence. The cosine is inside; never
// multiply by another one. `wi` points to the light and `wo` to the eye, unit vectors in the frame of tangent,
// bitangent and normal. BtfOptions(0xffffffffu, 0xffffffffu, 0u, 1u) is everything there is, by the fast rule.
//
// What a renderer calls:
//
";

/// `btf.wgsl`: the library with a head that says what an includer defines and what there is to call.
pub fn library_text() -> String {
    let functions: String = published_functions().iter().map(|line| format!("//     {line}\n")).collect();
    let parts: String = WGSL.iter().map(|(name, text)| format!("\n// ==== {name}\n\n{text}")).collect();
    format!("{LIBRARY_HEAD}{functions}{parts}")
}

/// `btf_queries.wgsl`: library, bindings and entry points, a module that is complete.
pub fn module_text() -> String {
    format!("{QUERIES}\n{}", wgsl_library())
}

/// Signatures of the functions that are meant for includers, each on one line.
fn published_functions() -> Vec<String> {
    let library = wgsl_library();
    let signatures = library.match_indices("\nfn btf_").map(|(at, _)| {
        let signature = library[at..].split('{').next().unwrap_or_default();
        let words = signature.split_whitespace().collect::<Vec<_>>().join(" ");
        words.replace("( ", "(").replace(", )", ")")
    });
    signatures.collect()
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
    fn the_module_has_the_entry_points_and_the_whole_library() {
        let text = module_text();
        assert!(ENTRY_POINTS.iter().all(|name| text.contains(&format!("fn {name}("))));
        assert_eq!(text.matches("@compute").count(), ENTRY_POINTS.len());
        assert!(WGSL.iter().all(|(_, part)| text.contains(part)));
    }
}
