//! The README of the written folder. Numbers and layouts are read from the module, so that they cannot differ from it.

use crate::error::ShaderError;
use crate::languages::{Language, ShaderFile, bindings, metal_sizes_slot, validated};
use crate::texts::{DEPTHS_NAME, EXPANSION_FILE, LIBRARY_FILE, MODULE_NAME, VOLTEX_LIBRARY_FILE};
use naga::{AddressSpace, Handle, Module, StorageAccess, Type, TypeInner};
use std::fmt::Write;

/// Returns `README.md` for modules, each with the files that [`crate::translate`] made of it, the WGSL first.
///
/// # Errors
/// [`ShaderError::Wgsl`] if the text is not valid.
pub fn readme(modules: &[(&str, &[ShaderFile])]) -> Result<String, ShaderError> {
    let files: Vec<&ShaderFile> = modules.iter().flat_map(|(_, files)| *files).collect();
    let mut text = vec![head(), file_table(&files)];
    for (wgsl, files) in modules {
        let (module, _) = validated(wgsl)?;
        let name = files.first().map_or("", |file| file.name.as_str());
        text.push(format!("## `{name}` and its translations\n"));
        text.extend([binding_table(&module), struct_tables(&module), workgroups(&module)]);
    }
    text.push(languages(&files));
    Ok(text.join("\n"))
}

fn head() -> String {
    format!(
        "# BTF shaders\n\n\
         The decoder of packed BTF assets (`.spmm`), written by `cargo xtask shaders` with naga {NAGA}; do not \
         edit.\n\n\
         `{LIBRARY_FILE}` is for including: pure functions over one that you define, `asset_word`; its head says \
         how. The \
         files `{MODULE_NAME}.*` are the same library with bindings and entry points, ready to run: a list of \
         questions in, a \
         list of answers out.\n\n\
         `{VOLTEX_LIBRARY_FILE}` and `{DEPTHS_NAME}.*` are the same of volumetric textures: rays in, optical depths out. A volume \
         is bound as the words that `btf_runtime::voltex::Voltex::words` has.\n\n\
         An asset is bound in resident form: the words that `btf_runtime::Resident::words` has (docs/reference/format.md, \
         \"Resident \
         form\"). `{EXPANSION_FILE}` makes the bases in there from a file form, in WGSL alone: its head says what is bound, and \
         `btf_runtime::ExpansionInput` has that. Values are pi times BRDF times |n.wi|, linear RGB: the cosine is inside.\n"
    )
}

/// Version of naga that writes the files; a test compares it with the lock file.
pub(crate) const NAGA: &str = "30.0.1";

fn file_table(files: &[&ShaderFile]) -> String {
    let mut text = "## Files\n\n| File | Entry point | Called there |\n|---|---|---|\n".to_string();
    for file in files {
        for (entry, name) in &file.entry_points {
            let _ = writeln!(text, "| `{}` | `{entry}` | `{name}` |", file.name);
        }
    }
    text
}

fn binding_table(module: &Module) -> String {
    let mut text = "### Bindings\n\nAll in group 0 (descriptor set 0, space 0).\n\n\
                    | Number | Name | Holds | Kind | HLSL | MSL | GLSL |\n|---|---|---|---|---|---|---|\n"
        .to_string();
    for binding in bindings(module) {
        let found = module.global_variables.iter().find(|(_, variable)| variable.binding == Some(binding));
        let Some((_, variable)) = found else { continue };
        let number = binding.binding;
        let (kind, register) = match variable.space {
            AddressSpace::Uniform => ("uniform", 'b'),
            AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => ("storage, written", 'u'),
            _ => ("storage, read only", 't'),
        };
        let (name, holds) = (variable.name.as_deref().unwrap_or_default(), type_name(module, variable.ty));
        let _ = writeln!(
            text,
            "| {number} | `{name}` | `{holds}` | {kind} | `{register}{number}` | `buffer({number})` | \
             `binding = {number}` |"
        );
    }
    let _ = writeln!(
        text,
        "\nMSL has one more, `buffer({})`: the sizes in bytes of the storage buffers, one `uint` each in the table's order. \
         Every function passes it on and none reads it.",
        metal_sizes_slot(module)
    );
    text
}

/// Returns the tables of the structs of the bindings, each struct before those that hold it.
fn struct_tables(module: &Module) -> String {
    let mut text = "### Layouts\n\nOffsets and sizes in bytes, the same in every language.\n".to_string();
    let mut shared = Vec::new();
    for binding in bindings(module) {
        let found = module.global_variables.iter().find(|(_, variable)| variable.binding == Some(binding));
        if let Some((_, variable)) = found {
            collect_structs(module, variable.ty, &mut shared);
        }
    }
    for handle in shared {
        let TypeInner::Struct { members, span } = &module.types[handle].inner else { continue };
        let name = type_name(module, handle);
        let _ = write!(text, "\n`{name}`, {span} bytes\n\n| Offset | Field | Type |\n|---|---|---|\n");
        for member in members {
            let field = member.name.as_deref().unwrap_or_default();
            let _ = writeln!(text, "| {} | `{field}` | `{}` |", member.offset, type_name(module, member.ty));
        }
    }
    text
}

fn collect_structs(module: &Module, handle: Handle<Type>, found: &mut Vec<Handle<Type>>) {
    match &module.types[handle].inner {
        TypeInner::Array { base, .. } => collect_structs(module, *base, found),
        TypeInner::Struct { members, .. } if !found.contains(&handle) => {
            members.iter().for_each(|member| collect_structs(module, member.ty, found));
            found.push(handle);
        }
        _ => {}
    }
}

/// Returns a type as WGSL writes it, for the kinds of types that our bindings have.
fn type_name(module: &Module, handle: Handle<Type>) -> String {
    let kind = &module.types[handle];
    let scalar = |scalar: naga::Scalar| match scalar.kind {
        naga::ScalarKind::Float => "f32",
        naga::ScalarKind::Sint => "i32",
        _ => "u32",
    };
    match &kind.inner {
        TypeInner::Scalar(of) => scalar(*of).to_string(),
        TypeInner::Vector { size, scalar: of } => format!("vec{}<{}>", *size as u8, scalar(*of)),
        TypeInner::Array { base, .. } => format!("array<{}>", type_name(module, *base)),
        _ => kind.name.clone().unwrap_or_default(),
    }
}

fn workgroups(module: &Module) -> String {
    let mut text = "### Dispatch\n\n".to_string();
    for entry in &module.entry_points {
        let [x, y, z] = entry.workgroup_size;
        let _ = writeln!(text, "- `{}`: workgroups of {x} x {y} x {z}, one question an invocation", entry.name);
    }
    text + "\nDispatch (count + 63) / 64 workgroups along x. No subgroup operation, no barrier, no shared memory.\n"
}

/// Returns the chapter on how each language's files are compiled, and what they require.
fn languages(files: &[&ShaderFile]) -> String {
    let name =
        |language: Language| files.iter().find(|file| file.language == language).map_or("", |file| file.name.as_str());
    let (hlsl, msl) = (name(Language::Hlsl), name(Language::Msl));
    let (es, desktop) = (name(Language::GlslEs310), name(Language::Glsl460));
    format!(
        "## Languages\n\n\
         | Language | Needs | Compiled by | Checked by | A test runs it |\n|---|---|---|---|---|\n\
         | WGSL | nothing beyond core WGSL | any WebGPU | Tint, Dawn's compiler | by naga and by Tint |\n\
         | HLSL | shader model 6.0 | `dxc -T cs_6_0 -E evaluate_main {hlsl}` | glslang's HLSL front end, to which \
         casts of 0 \
         to an array are spelt out; dxc where it is installed | by glslang |\n\
         | MSL | Metal 2.0 | `xcrun metal -std=metal2.0 -c {msl}` | nobody: its only compiler is Apple's | no |\n\
         | GLSL ES 3.10 | three storage buffers in compute shaders; every driver has four | the driver, or \
         `glslangValidator -S comp {es}` | glslang | by glslang |\n\
         | GLSL 4.60 | nothing beyond it | the driver, or `glslangValidator -V -S comp {desktop}` for Vulkan | \
         glslang | by \
         glslang |\n\
         | SPIR-V 1.3 | capability Shader | Vulkan 1.1 | spirv-val | as it is |\n\n\
         `cargo xtask setup` installs the tools, `cargo test -p btf-shaders` checks and runs: on Mesa's software \
         driver, against \
         `btf_runtime::evaluate`, `sample` and `density`.\n\n\
         naga takes `unpack2x16float` for a capability of its own, SHADER_FLOAT16_IN_FLOAT32, which every WebGPU \
         device has. \
         Indices are not checked again in the translations, and loops not bounded again: bind only words that \
         `btf_runtime` has made.\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::languages::translate;
    use crate::texts::{depths_text, module_text};

    #[test]
    fn the_readme_says_what_the_module_has() {
        let wgsl = module_text();
        let depths = depths_text();
        let files = translate(DEPTHS_NAME, &depths).unwrap();
        let text = readme(&[(&wgsl, &translate(MODULE_NAME, &wgsl).unwrap()), (&depths, &files)]).unwrap();
        for line in [
            "| 0 | `asset_words` | `array<u32>` | storage, read only | `t0` | `buffer(0)` | `binding = 0` |",
            "| 2 | `range` | `Range` | uniform | `b2` | `buffer(2)` | `binding = 2` |",
            "| 3 | `answers` | `array<Answer>` | storage, written | `u3` | `buffer(3)` | `binding = 3` |",
            "`Query`, 64 bytes",
            "| 40 | `options` | `BtfOptions` |",
            "| 16 | `value` | `vec3<f32>` |",
            "- `sample_main`: workgroups of 64 x 1 x 1, one question an invocation",
            "| `btf_queries.density_main.es310.glsl` | `density_main` | `main` |",
            "## `btf_depths.wgsl` and its translations",
            "| 1 | `rays` | `array<Ray>` | storage, read only | `t1` | `buffer(1)` | `binding = 1` |",
            "`Depth`, 16 bytes",
            "| `btf_depths.spv` | `depth_main` | `depth_main` |",
        ] {
            assert!(text.lines().any(|found| found == line), "{line}\n{text}");
        }
        // Planted difference: a module with another binding number has another README.
        let moved = wgsl.replace("@binding(3)", "@binding(5)");
        let other = readme(&[(&moved, &translate(MODULE_NAME, &moved).unwrap())]).unwrap();
        assert!(other.contains("`u5`") && !text.contains("`u5`"));
    }

    #[test]
    fn the_version_of_naga_is_that_of_the_lock_file() {
        let lock = include_str!("../../../Cargo.lock");
        assert!(lock.contains(&format!("name = \"naga\"\nversion = \"{NAGA}\"\n")));
    }
}
