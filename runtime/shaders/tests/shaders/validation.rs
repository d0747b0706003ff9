//! Validates every file that `cargo xtask shaders` writes with a tool of another origin, and checks that the tool
//! refuses a defect planted in each language. MSL is the exception: its only compiler is Apple's, and it counts as
//! unchecked.

use crate::support::tools::{self, Tool};
use btf_runtime::EXPANSION_WGSL;
use btf_shaders::{
    DEPTHS_NAME, ENTRY_POINTS, Language, MODULE_NAME, ShaderFile, depths_text, library_text, module_text, translate,
    voltex_library_text,
};

/// Returns the files of one language.
fn files(language: Language) -> Vec<ShaderFile> {
    let mut files = translate(MODULE_NAME, &module_text()).unwrap();
    files.extend(translate(DEPTHS_NAME, &depths_text()).unwrap());
    files.retain(|file| file.language == language);
    assert!(!files.is_empty(), "{language:?} has files");
    files
}

/// Returns `text` with `from`, which must be there, replaced by `to`.
fn planted(text: &[u8], from: &str, to: &str) -> Vec<u8> {
    let text = std::str::from_utf8(text).expect("a text");
    assert!(text.contains(from), "'{from}' is there to be replaced");
    text.replace(from, to).into_bytes()
}

#[test]
fn tint_accepts_the_wgsl_and_the_published_library_with_its_includer() {
    if tools::are_left_out("tint_accepts_the_wgsl_and_the_published_library_with_its_includer", &[Tool::Dawn]) {
        return;
    }
    let modules = files(Language::Wgsl);
    modules.iter().for_each(|file| tools::tint(&file.bytes).unwrap());
    let module = &modules[0].bytes;
    let includer = "
        @group(0) @binding(0) var<storage, read> some_words: array<u32>;
        fn asset_word(index: u32) -> u32 { return some_words[index]; }";
    tools::tint((library_text() + includer).as_bytes()).unwrap();
    tools::tint((library_text() + &voltex_library_text() + includer).as_bytes()).unwrap();
    tools::tint(EXPANSION_WGSL.as_bytes()).unwrap();
    // Planted: a type that does not fit, and the library without what its includer owes.
    let message = tools::tint(&planted(module, "MIN_COS_VIEW: f32 = 0.02", "MIN_COS_VIEW: u32 = 0.02")).unwrap_err();
    assert!(message.contains("u32"), "{message}");
    assert!(tools::tint(&planted(EXPANSION_WGSL.as_bytes(), "GREY: f32", "GREY: u32")).is_err());
    let message = tools::tint(library_text().as_bytes()).unwrap_err();
    assert!(message.contains("asset_word"), "{message}");
}

#[test]
fn spirv_val_accepts_the_spirv() {
    if tools::are_left_out("spirv_val_accepts_the_spirv", &[Tool::SpirvVal]) {
        return;
    }
    let modules = files(Language::SpirV);
    modules.iter().for_each(|file| tools::spirv_val(&file.bytes).unwrap());
    let module = &modules[0].bytes;
    // Planted: the word that holds the bound of all ids, made too small.
    let mut damaged = module.clone();
    damaged[12..16].copy_from_slice(&9u32.to_le_bytes());
    assert!(tools::spirv_val(&damaged).is_err());
    assert!(tools::spirv_val(&module[..module.len() - 8]).is_err());
}

#[test]
fn glslang_accepts_the_glsl_of_both_profiles() {
    if tools::are_left_out("glslang_accepts_the_glsl_of_both_profiles", &[Tool::Glslang]) {
        return;
    }
    for (language, version) in [(Language::GlslEs310, "#version 310 es\n"), (Language::Glsl460, "#version 460 core\n")]
    {
        let files = files(language);
        assert_eq!(files.len(), ENTRY_POINTS.len() + 1);
        for file in &files {
            assert!(file.bytes.starts_with(version.as_bytes()), "{}", file.name);
            tools::glslang(&file.bytes).unwrap_or_else(|text| panic!("{}: {text}", file.name));
        }
        // Planted: a constant of another type.
        let faulty = planted(&files[0].bytes, "MIN_COS_VIEW = 0.02", "MIN_COS_VIEW = uvec2(1u)");
        assert!(tools::glslang(&faulty).is_err(), "{language:?}");
    }
}

#[test]
fn glslang_and_dxc_where_it_is_accept_the_hlsl() {
    if tools::are_left_out("glslang_and_dxc_where_it_is_accept_the_hlsl", &[Tool::Glslang, Tool::SpirvVal]) {
        return;
    }
    let files = files(Language::Hlsl);
    let faulty = planted(&files[0].bytes, "MIN_COS_VIEW = 0.02", "MIN_COS_VIEW = no_such_name");
    for (file, entry) in files.iter().flat_map(|file| file.entry_points.iter().map(move |(_, entry)| (file, entry))) {
        let words = tools::spirv_from_hlsl(&file.bytes, entry).unwrap_or_else(|text| panic!("{entry}: {text}"));
        tools::spirv_val(&words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>()).unwrap();
        assert!(tools::spirv_from_hlsl(&faulty, entry).is_err());
        match tools::dxc(&file.bytes, entry) {
            Some(judgement) => {
                judgement.unwrap_or_else(|text| panic!("{entry}: {text}"));
                assert!(tools::dxc(&faulty, entry).is_some_and(|judgement| judgement.is_err()));
            }
            None => println!("not checked by dxc, which is not on this machine: {entry}"),
        }
    }
}

#[test]
fn metal_is_written_and_nobody_here_can_check_it() {
    for file in files(Language::Msl) {
        let text = std::str::from_utf8(&file.bytes).unwrap();
        for (_, name) in &file.entry_points {
            assert!(text.contains(&format!("kernel void {name}(")), "{name}");
        }
        println!("not checked: {}, whose only compiler is Apple's", file.name);
    }
}
