//! Writes the shaders that draw an asset as SPIR-V, one file for each pass, for compilers of drivers that tell registers and
//! occupancy (`tests/peers/shader_statistics.py`).
//!
//! `cargo run --release -p btf-viewer --example pass_spirv -- DIR [ASSET.spmm] [LIGHTS] [--path] [--exact] [--general]`

use btf_viewer::{GpuTracer, MeshChoice, RenderMode, Scene, SceneAsset, ShadeOptions, pass_shaders};
use naga::back::{PipelineConstants, pipeline_constants::process_overrides, spv};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (flags, places): (Vec<String>, Vec<String>) = std::env::args().skip(1).partition(|a| a.starts_with("--"));
    let has = |flag: &str| flags.iter().any(|given| given == flag);
    let folder = PathBuf::from(
        places.first().ok_or("usage: pass_spirv DIR [ASSET.spmm] [LIGHTS] [--path] [--exact] [--general]")?,
    );
    let asset = match places.get(1) {
        Some(file) => SceneAsset::load(Path::new(file))?,
        None => SceneAsset::built_in(),
    };
    let mut scene = Scene::built_in(&MeshChoice::Cornell, vec![Arc::new(asset)], [1.0; 2])?;
    scene.place_lights(places.get(2).map_or(Ok(1), |lights| lights.parse())?);
    let mut options = ShadeOptions::default();
    if has("--path") {
        options.mode = RenderMode::Path;
    }
    if has("--exact") {
        options.decode.interpolation = btf_runtime::Interpolation::Exact;
    }
    let (wgsl, passes) = pass_shaders(&scene, &options, GpuTracer::Bvh);
    let capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;
    let module = naga::front::wgsl::parse_str(&wgsl).map_err(|error| error.emit_to_string(&wgsl))?;
    let info = Validator::new(ValidationFlags::all(), capabilities).validate(&module)?;
    std::fs::create_dir_all(&folder)?;
    for pass in passes {
        // Without constants the shaders can do everything.
        let constants = if has("--general") { Vec::new() } else { pass.constants };
        let constants: PipelineConstants =
            constants.into_iter().map(|(name, value)| (name.to_string(), value)).collect();
        let entry = (naga::ShaderStage::Compute, pass.entry_point);
        let (module, info) = process_overrides(&module, &info, Some(entry), &constants)?;
        let options = spv::Options { lang_version: (1, 3), ..spv::Options::default() };
        let pipeline = spv::PipelineOptions { shader_stage: entry.0, entry_point: entry.1.into() };
        let words = spv::write_vec(&module, &info, &options, Some(&pipeline))?;
        let file = folder.join(format!("{}.spv", pass.entry_point));
        std::fs::write(&file, words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>())?;
        println!("{}", file.display());
    }
    Ok(())
}
