//! Translates a WGSL module to the other languages with naga.

use crate::error::ShaderError;
use naga::back::{glsl, hlsl, msl, spv};
use naga::front::wgsl;
use naga::proc::BoundsCheckPolicies;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{Module, ResourceBinding};
use std::collections::BTreeMap;
use std::fmt::Display;

/// Shader model of the HLSL: the first that dxc compiles.
const SHADER_MODEL: hlsl::ShaderModel = hlsl::ShaderModel::V6_0;
/// Metal Shading Language 2.0, of macOS 10.13 and iOS 11; naga refuses features that need a newer version.
const METAL_VERSION: (u8, u8) = (2, 0);
/// SPIR-V of Vulkan 1.1: storage buffers without an extension.
const SPIRV_VERSION: (u8, u8) = (1, 3);
/// Capabilities that the library needs beyond naga's least: `unpack2x16float`, which is core WGSL.
const CAPABILITIES: Capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;

/// The language of a [`ShaderFile`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Language {
    /// WGSL itself.
    Wgsl,
    /// HLSL, shader model 6.0.
    Hlsl,
    /// Metal Shading Language 2.0.
    Msl,
    /// GLSL ES 3.10, one file for each entry point.
    GlslEs310,
    /// GLSL 4.60, one file for each entry point.
    Glsl460,
    /// SPIR-V 1.3 as a file: little-endian words.
    SpirV,
}

impl Language {
    /// Returns the end of the name of a file in this language.
    pub fn extension(self) -> &'static str {
        match self {
            Language::Wgsl => "wgsl",
            Language::Hlsl => "hlsl",
            Language::Msl => "metal",
            Language::GlslEs310 => "es310.glsl",
            Language::Glsl460 => "460.glsl",
            Language::SpirV => "spv",
        }
    }
}

/// A module in one language.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShaderFile {
    /// File name.
    pub name: String,
    /// Language of the file.
    pub language: Language,
    /// Names of the module's entry points, as `(in WGSL, in this file)`.
    pub entry_points: Vec<(String, String)>,
    /// Text, or words of SPIR-V.
    pub bytes: Vec<u8>,
}

/// Translates `wgsl`, a whole module of compute entry points, to all languages; file names begin with `module_name`.
/// Deterministic: equal texts give equal bytes.
///
/// Binding `b` of group 0 has number `b` in every language: HLSL's register of its kind, Metal's `[[buffer(b)]]`,
/// GLSL's `binding = b`. naga adds no checks of indices and no bounds of loops: the library reads only words that
/// `btf_runtime::Resident` has laid out, and its loops end.
///
/// # Errors
/// [`ShaderError::Wgsl`] if the text is not valid core WGSL, [`ShaderError::Translation`] if a language lacks
/// something.
pub fn translate(module_name: &str, wgsl: &str) -> Result<Vec<ShaderFile>, ShaderError> {
    let (module, info) = validated(wgsl)?;
    let same_names = || module.entry_points.iter().map(|entry| (entry.name.clone(), entry.name.clone())).collect();
    let mut files = vec![ShaderFile {
        name: file_name(module_name, Language::Wgsl, None),
        language: Language::Wgsl,
        entry_points: same_names(),
        bytes: wgsl.as_bytes().to_vec(),
    }];
    files.push(hlsl_file(module_name, &module, &info)?);
    files.push(msl_file(module_name, &module, &info)?);
    for language in [Language::GlslEs310, Language::Glsl460] {
        for entry in &module.entry_points {
            files.push(glsl_file(module_name, &module, &info, language, &entry.name)?);
        }
    }
    files.push(spirv_file(module_name, &module, &info, same_names())?);
    Ok(files)
}

/// Parses and validates a text; returns the module and naga's analysis of it.
pub(crate) fn validated(wgsl_text: &str) -> Result<(Module, ModuleInfo), ShaderError> {
    let options = wgsl::Options { capabilities: CAPABILITIES, ..wgsl::Options::new() };
    let module = wgsl::Frontend::new_with_options(options)
        .parse(wgsl_text)
        .map_err(|error| ShaderError::Wgsl(error.emit_to_string(wgsl_text)))?;
    let info = Validator::new(ValidationFlags::all(), CAPABILITIES)
        .validate(&module)
        .map_err(|error| ShaderError::Wgsl(error.emit_to_string(wgsl_text)))?;
    Ok((module, info))
}

/// Returns the bindings of a module, in order.
pub(crate) fn bindings(module: &Module) -> Vec<ResourceBinding> {
    let mut bindings: Vec<_> = module.global_variables.iter().filter_map(|(_, variable)| variable.binding).collect();
    bindings.sort();
    bindings
}

/// Returns the number of the additional buffer of naga's MSL: the storage buffers' sizes in bytes, one `u32` each, in
/// order. Our texts ask no array for its length, so nothing reads the buffer, but every function passes it on.
pub(crate) fn metal_sizes_slot(module: &Module) -> u8 {
    bindings(module).last().map_or(0, |binding| binding.binding as u8 + 1)
}

/// Maps each binding of a module to `target(binding)`.
fn binding_map<T>(module: &Module, target: impl Fn(ResourceBinding) -> T) -> BTreeMap<ResourceBinding, T> {
    bindings(module).into_iter().map(|binding| (binding, target(binding))).collect()
}

/// Returns the name of a file of this language; `part` is the entry point of a file that has only one.
fn file_name(module_name: &str, language: Language, part: Option<&str>) -> String {
    let part = part.map_or(String::new(), |name| format!(".{name}"));
    format!("{module_name}{part}.{}", language.extension())
}

fn failure(file: &str) -> impl Fn(&dyn Display) -> ShaderError {
    move |error| ShaderError::Translation { file: file.to_string(), reason: error.to_string() }
}

/// Returns the names that a writer reports for the entry points, in the module's order.
fn renamed<E: Display>(
    module: &Module,
    file: &str,
    names: Vec<Result<String, E>>,
) -> Result<Vec<(String, String)>, ShaderError> {
    let pairs = module.entry_points.iter().zip(names);
    pairs.map(|(entry, name)| Ok((entry.name.clone(), name.map_err(|error| failure(file)(&error))?))).collect()
}

fn hlsl_file(module_name: &str, module: &Module, info: &ModuleInfo) -> Result<ShaderFile, ShaderError> {
    let name = file_name(module_name, Language::Hlsl, None);
    let options = hlsl::Options {
        shader_model: SHADER_MODEL,
        binding_map: binding_map(module, |binding| hlsl::BindTarget {
            space: binding.group as u8,
            register: binding.binding,
            ..Default::default()
        }),
        fake_missing_bindings: false,
        restrict_indexing: false,
        force_loop_bounding: false,
        ..Default::default()
    };
    let mut text = String::new();
    let pipeline = hlsl::PipelineOptions::default();
    let written = hlsl::Writer::new(&mut text, &options, &pipeline)
        .write(module, info, None)
        .map_err(|error| failure(&name)(&error))?;
    let entry_points = renamed(module, &name, written.entry_point_names)?;
    Ok(ShaderFile { name, language: Language::Hlsl, entry_points, bytes: text.into_bytes() })
}

fn msl_file(module_name: &str, module: &Module, info: &ModuleInfo) -> Result<ShaderFile, ShaderError> {
    let name = file_name(module_name, Language::Msl, None);
    let writable = |binding: ResourceBinding| {
        module.global_variables.iter().any(|(_, variable)| {
            let naga::AddressSpace::Storage { access } = variable.space else { return false };
            variable.binding == Some(binding) && access.contains(naga::StorageAccess::STORE)
        })
    };
    let resources = binding_map(module, |binding| msl::BindTarget {
        buffer: Some(binding.binding as u8),
        mutable: writable(binding),
        ..Default::default()
    });
    let sizes_buffer = Some(metal_sizes_slot(module));
    let resources = msl::EntryPointResources { resources, sizes_buffer, ..Default::default() };
    let options = msl::Options {
        lang_version: METAL_VERSION,
        per_entry_point_map: module.entry_points.iter().map(|e| (e.name.clone(), resources.clone())).collect(),
        fake_missing_bindings: false,
        force_loop_bounding: false,
        emit_int_div_checks: false,
        ..Default::default()
    };
    let (text, written) = msl::write_string(module, info, &options, &msl::PipelineOptions::default())
        .map_err(|error| failure(&name)(&error))?;
    let entry_points = renamed(module, &name, written.entry_point_names)?;
    Ok(ShaderFile { name, language: Language::Msl, entry_points, bytes: text.into_bytes() })
}

fn glsl_file(
    module_name: &str,
    module: &Module,
    info: &ModuleInfo,
    language: Language,
    entry: &str,
) -> Result<ShaderFile, ShaderError> {
    let name = file_name(module_name, language, Some(entry));
    let options = glsl::Options {
        version: match language {
            Language::GlslEs310 => glsl::Version::new_gles(310),
            _ => glsl::Version::Desktop(460),
        },
        writer_flags: glsl::WriterFlags::empty(),
        binding_map: binding_map(module, |binding| binding.binding as u8),
        ..Default::default()
    };
    let pipeline = glsl::PipelineOptions {
        shader_stage: naga::ShaderStage::Compute,
        entry_point: entry.to_string(),
        multiview: None,
    };
    let mut text = String::new();
    let unchecked = BoundsCheckPolicies::default();
    glsl::Writer::new(&mut text, module, info, &options, &pipeline, unchecked)
        .and_then(|mut writer| writer.write())
        .map_err(|error| failure(&name)(&error))?;
    // GLSL has one entry point a file, and one name for it.
    let entry_points = vec![(entry.to_string(), "main".to_string())];
    Ok(ShaderFile { name, language, entry_points, bytes: text.into_bytes() })
}

fn spirv_file(
    module_name: &str,
    module: &Module,
    info: &ModuleInfo,
    entry_points: Vec<(String, String)>,
) -> Result<ShaderFile, ShaderError> {
    let name = file_name(module_name, Language::SpirV, None);
    let options = spv::Options {
        lang_version: SPIRV_VERSION,
        // Names of variables and functions, for debuggers; the same in debug and release builds of this program.
        flags: spv::WriterFlags::DEBUG,
        fake_missing_bindings: false,
        binding_map: binding_map(module, |binding| spv::BindingInfo {
            descriptor_set: binding.group,
            binding: binding.binding,
            binding_array_size: None,
        }),
        force_loop_bounding: false,
        emit_int_div_checks: false,
        ..Default::default()
    };
    let words = spv::write_vec(module, info, &options, None).map_err(|error| failure(&name)(&error))?;
    let bytes = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    Ok(ShaderFile { name, language: Language::SpirV, entry_points, bytes })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::queries::{Answer, Depth, Options, Query, Range, Ray, WORKGROUP};
    use crate::texts::{ENTRY_POINTS, MODULE_NAME, depths_text, module_text};
    use std::mem::{offset_of, size_of};

    #[test]
    fn every_language_has_every_entry_point_and_twice_the_same_bytes() {
        let files = translate(MODULE_NAME, &module_text()).unwrap();
        assert_eq!(files, translate(MODULE_NAME, &module_text()).unwrap());
        for language in
            [Language::Wgsl, Language::Hlsl, Language::Msl, Language::GlslEs310, Language::Glsl460, Language::SpirV]
        {
            let of_language = files.iter().filter(|file| file.language == language);
            let mut names: Vec<_> = of_language.flat_map(|file| &file.entry_points).map(|(name, _)| name).collect();
            names.sort();
            let mut expected = ENTRY_POINTS;
            expected.sort_unstable();
            assert_eq!(names, expected, "{language:?}");
        }
        // Planted difference: another constant is another file in every language.
        let other =
            translate(MODULE_NAME, &module_text().replace("COSINE_SHARE: f32 = 0.5", "COSINE_SHARE: f32 = 0.25"))
                .unwrap();
        for (file, other) in files.iter().zip(&other) {
            assert_ne!(file.bytes, other.bytes, "{}", file.name);
        }
    }

    #[test]
    fn text_that_is_not_core_wgsl_is_refused_with_the_place() {
        let faulty =
            module_text().replace("let q = queries[range.first + id.x];", "let q = queries[range.first + id];");
        assert!(
            matches!(translate(MODULE_NAME, &faulty), Err(ShaderError::Wgsl(message)) if message.contains("range.first + id"))
        );
        let ray_query = format!("enable wgpu_ray_query;\n{}", module_text());
        assert!(matches!(translate(MODULE_NAME, &ray_query), Err(ShaderError::Wgsl(_))));
    }

    /// Returns name and offset of the fields of a struct, and its size.
    fn layout(module: &Module, name: &str) -> (Vec<(String, usize)>, usize) {
        let found = module.types.iter().find_map(|(_, kind)| match &kind.inner {
            naga::TypeInner::Struct { members, span } if kind.name.as_deref() == Some(name) => Some((members, *span)),
            _ => None,
        });
        let (members, span) = found.unwrap_or_else(|| panic!("{name} is a struct"));
        let field = |member: &naga::StructMember| (member.name.clone().unwrap_or_default(), member.offset as usize);
        (members.iter().map(field).collect(), span as usize)
    }

    macro_rules! fields {
        ($ty:ty; $($field:ident),*) => {
            (vec![$((stringify!($field).to_string(), offset_of!($ty, $field))),*], size_of::<$ty>())
        };
    }

    #[test]
    fn structs_have_the_same_fields_at_the_same_offsets_in_rust_and_wgsl() {
        let (module, _) = validated(&module_text()).unwrap();
        assert_eq!(layout(&module, "Query"), fields!(Query; wi, level, wo, asset, uv, options, pad));
        assert_eq!(layout(&module, "BtfOptions"), fields!(Options; components, lobes, interpolation, heights));
        assert_eq!(layout(&module, "Answer"), fields!(Answer; wi, density, value, pad));
        assert_eq!(layout(&module, "Range"), fields!(Range; first, count, pad));
        // Planted difference: two fields of the same size exchanged.
        assert_ne!(layout(&module, "Answer"), fields!(Answer; value, density, wi, pad));
        let (depths, _) = validated(&depths_text()).unwrap();
        assert_eq!(layout(&depths, "Ray"), fields!(Ray; origin, level, direction, volume, t0, t1, pad));
        assert_eq!(layout(&depths, "Depth"), fields!(Depth; depth, first_t, first_voxel, steps));
        assert_eq!(layout(&depths, "Range"), layout(&module, "Range"));
        let entries = module.entry_points.iter().chain(&depths.entry_points);
        assert!(entries.into_iter().all(|entry| entry.workgroup_size == [WORKGROUP, 1, 1]));
    }
}
