//! `export-mtlx`: an asset's OpenPBR material, its textures and figures about them.

use crate::error::FitError;
use crate::export::gltf::fit::{GltfFit, Maps, TriedPart, fit_gltf};
use crate::export::gltf::textures::GltfTextures;
use crate::export::openpbr::fit::{OpenPbrFit, fit_openpbr};
use crate::export::openpbr::materialx::{MaterialXNames, materialx_document};
use crate::export::openpbr::textures::OpenPbrTextures;
use crate::export::pairs::{front_layer, psnr_db_at_pairs};
use crate::inspect::load::parallel;
use crate::monitor::Monitor;
use btf_runtime::{Levels, Resident, open, read_directory};
use serde::Serialize;
use std::sync::Arc;

/// Figures about an asset's OpenPBR material.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OpenPbrFigures {
    /// Texels a row of the textures.
    pub width: usize,
    /// Rows of the textures.
    pub height: usize,
    /// Physical size of one repetition in metres, where the asset tells it.
    pub size_m: Option<[f32; 2]>,
    /// Parts of the model that were tried.
    pub tried: Vec<TriedPart>,
    /// Error of the material against the asset: 8-bit sRGB values of all texels, each at some of the measured pairs, all
    /// pairs alike; peak 255.
    pub psnr_db: f64,
    /// Error of the glTF material from which the fit started, in the same measure.
    pub psnr_gltf_db: f64,
}

/// An asset's material in the terms of others.
pub struct FittedSurface {
    /// The asset.
    pub resident: Resident,
    /// The asset's checksum as 16 hexadecimal digits.
    pub checksum: String,
    /// The glTF material.
    pub gltf: GltfFit,
    /// The OpenPBR material's textures.
    pub textures: OpenPbrTextures,
    /// Figures about it.
    pub figures: OpenPbrFigures,
}

/// Fits an OpenPBR material to the asset in `bytes`, of either form, and measures it.
///
/// # Errors
/// A fault of the bytes; an asset without a front; Ctrl-C.
pub fn fit_surface(bytes: Vec<u8>, maps: Maps, monitor: &Monitor) -> Result<FittedSurface, FitError> {
    let bytes = Arc::new(bytes);
    let directory = read_directory(&bytes)?;
    let file = open(bytes, Levels::AtHand, &parallel)?;
    let gltf = fit_gltf(&file.resident, Maps::All, monitor)?;
    let fit = fit_openpbr(&file.resident, &gltf, maps, monitor)?;
    let textures = OpenPbrTextures::new(&fit);
    let psnr_db = measure(&file.resident, &textures, monitor)?;
    let start = GltfTextures::new(&gltf);
    let front = front_layer(&file.resident)?;
    let psnr_gltf_db = psnr_db_at_pairs(&file.resident, front, [fit.width, fit.height], monitor, |texel| {
        let (texel, sheen) = (start.texel(texel), start.sheen());
        move |wi, wo| texel.reflected(sheen, wi, wo)
    })?;
    let OpenPbrFit { width, height, tried, .. } = fit;
    let size_m = file.size_mm.map(|size| size.map(|side| side / 1000.0));
    let figures = OpenPbrFigures { width, height, size_m, tried, psnr_db, psnr_gltf_db };
    let checksum = format!("{:016x}", directory.checksum);
    Ok(FittedSurface { resident: file.resident, checksum, gltf, textures, figures })
}

/// A MaterialX document with its textures, and figures about them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MaterialXExport {
    /// Text of the document.
    #[serde(skip)]
    pub document: String,
    /// Names of the textures, relative to the document, and their PNG files.
    #[serde(skip)]
    pub textures: Vec<(String, Vec<u8>)>,
    /// Figures about the OpenPBR material.
    #[serde(flatten)]
    pub figures: OpenPbrFigures,
}

/// Fits an OpenPBR material to the asset in `bytes`, of either form. `stem` names the material and its textures, `asset` is
/// the asset's address relative to the document.
///
/// Deterministic: equal assets give equal files on any number of threads. Cost: that of [`fit_gltf`] and [`fit_openpbr`].
///
/// # Errors
/// A fault of the bytes; an asset without a front; Ctrl-C.
pub fn export_materialx(
    bytes: Vec<u8>,
    stem: &str,
    asset: &str,
    maps: Maps,
    monitor: &Monitor,
) -> Result<MaterialXExport, FitError> {
    let FittedSurface { textures, checksum, figures, .. } = fit_surface(bytes, maps, monitor)?;
    let names = MaterialXNames {
        material: identifier(stem),
        textures: format!("{stem}_"),
        asset: asset.into(),
        checksum,
        size_m: figures.size_m,
    };
    let document = materialx_document(&textures, &names)?;
    Ok(MaterialXExport { document, textures: textures.files(&names.textures)?, figures })
}

/// Measures the textures against the front of the asset, in dB.
fn measure(resident: &Resident, textures: &OpenPbrTextures, monitor: &Monitor) -> Result<f64, FitError> {
    let front = front_layer(resident)?;
    psnr_db_at_pairs(resident, front, [textures.width, textures.height], monitor, |texel| {
        let texel = textures.texel(texel);
        move |wi, wo| texel.reflected(wi, wo)
    })
}

/// Returns a name of letters, digits and underscores, which MaterialX and USD ask for.
pub fn identifier(stem: &str) -> String {
    let name: String = stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    match name.starts_with(|c: char| c.is_ascii_digit()) || name.is_empty() {
        true => format!("_{name}"),
        false => name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::sample_asset;
    use btf_runtime::{Asset, SurfaceSide, pack};

    fn export(asset: &Asset, maps: Maps) -> MaterialXExport {
        export_materialx(pack(asset).unwrap(), "9 felt", "grey%20felt.spmm", maps, &Monitor::default()).unwrap()
    }

    #[test]
    fn the_document_names_its_textures_the_asset_and_what_comes_through() {
        let mut asset = Asset { size_mm: Some([30.0, 18.0]), ..sample_asset() };
        let front = export(&asset, Maps::All);
        let names: Vec<&str> = front.textures.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names.len(), 10);
        for name in names {
            assert!(front.document.contains(&format!("value=\"{name}\"")), "{name}");
        }
        for text in
            ["name=\"M__9_felt\"", "btf_asset=\"grey%20felt.spmm\"", "btf_size_m=\"0.03, 0.018\"", "coat_darkening"]
        {
            assert!(front.document.contains(text), "{text}");
        }
        assert!(!front.document.contains("thin_walled"));
        assert!(front.figures.psnr_db > front.figures.psnr_gltf_db - 1.0, "{:?}", front.figures);
        assert_eq!(export(&asset, Maps::All), front, "equal assets give equal files");

        let mut through = asset.layers[0].clone();
        (through.light_side, through.view_side) = (SurfaceSide::Back, SurfaceSide::Front);
        asset.layers.push(through);
        let both = export(&asset, Maps::Auto);
        assert!(both.document.contains("geometry_thin_walled") && both.document.contains("felt_subsurface_color.png"));
    }

    #[test]
    fn an_asset_without_a_front_is_refused_with_the_remedy() {
        let mut asset = sample_asset();
        (asset.layers[0].light_side, asset.layers[0].view_side) = (SurfaceSide::Back, SurfaceSide::Back);
        let bytes = pack(&asset).unwrap();
        let error = export_materialx(bytes, "felt", "felt.spmm", Maps::Auto, &Monitor::default()).unwrap_err();
        assert!(error.to_string().contains("fit a capture of the front"), "{error}");
    }
}
