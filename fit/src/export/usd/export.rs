//! `export-usd`: a layer or a package of an asset's materials, and figures about them.

use crate::error::FitError;
use crate::export::gltf::document::size_of_quad_m;
use crate::export::gltf::fit::Maps;
use crate::export::openpbr::export::{FittedSurface, OpenPbrFigures, fit_surface, identifier};
use crate::export::openpbr::graph::graph_of;
use crate::export::pairs::{front_layer, psnr_db_at_pairs};
use crate::export::usd::layer::{LayerNames, usd_layer};
use crate::export::usd::preview::{preview_textures, read_preview};
use crate::monitor::Monitor;
use serde::Serialize;
use std::io::{Cursor, Write};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Bytes at whose multiples the files of a package begin, as the format demands.
const ALIGNMENT: u16 = 64;

/// A USD layer with its textures, and figures about them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UsdExport {
    /// Text of the layer.
    #[serde(skip)]
    pub layer: String,
    /// Names of the textures, relative to the layer, and their PNG files.
    #[serde(skip)]
    pub textures: Vec<(String, Vec<u8>)>,
    /// Figures about the OpenPBR material.
    #[serde(flatten)]
    pub figures: OpenPbrFigures,
    /// Error of UsdPreviewSurface against the asset, in the same measure as `psnr_db`.
    pub psnr_preview_db: f64,
}

/// Fits UsdPreviewSurface and OpenPBR to the asset in `bytes`, of either form. `stem` names the prim and the textures, `asset`
/// is the asset's address relative to the layer or the package.
///
/// Deterministic: equal assets give equal files on any number of threads. Cost: that of [`fit_gltf`] and [`fit_openpbr`].
///
/// [`fit_gltf`]: crate::fit_gltf
/// [`fit_openpbr`]: crate::fit_openpbr
///
/// # Errors
/// A fault of the bytes; an asset without a front; Ctrl-C.
pub fn export_usd(
    bytes: Vec<u8>,
    stem: &str,
    asset: &str,
    maps: Maps,
    monitor: &Monitor,
) -> Result<UsdExport, FitError> {
    let FittedSurface { resident, checksum, gltf, textures, figures } = fit_surface(bytes, maps, monitor)?;
    let preview = preview_textures(&gltf);
    let (front, size) = (front_layer(&resident)?, [figures.width, figures.height]);
    let psnr_preview_db = psnr_db_at_pairs(&resident, front, size, monitor, |texel| {
        let texel = read_preview(&preview, texel);
        move |wi, wo| texel.reflected(None, wi, wo)
    })?;
    let prefix = format!("{stem}_");
    let names = LayerNames {
        name: &identifier(stem),
        textures: &prefix,
        asset,
        checksum: &checksum,
        size_m: size_of_quad_m(figures.size_m, size),
        size_is_known: figures.size_m.is_some(),
        double_sided: gltf.transmission,
    };
    let layer = usd_layer(&names, &graph_of(&textures, &prefix));
    let files = [textures.files(&prefix)?, preview.files(&prefix)?].concat();
    Ok(UsdExport { layer, textures: files, figures, psnr_preview_db })
}

impl UsdExport {
    /// Returns the layer, named `layer`, and its textures as one `.usdz` package: a zip archive without compression.
    ///
    /// # Errors
    /// [`FitError::Params`] if it is larger than such an archive can be.
    pub fn package(&self, layer: &str) -> Result<Vec<u8>, FitError> {
        let files = std::iter::once((layer, self.layer.as_bytes()))
            .chain(self.textures.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())));
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        let options =
            SimpleFileOptions::default().compression_method(CompressionMethod::Stored).with_alignment(ALIGNMENT);
        let mut add = |name: &str, bytes: &[u8]| -> Result<(), zip::result::ZipError> {
            zip.start_file(name, options)?;
            zip.write_all(bytes)?;
            Ok(())
        };
        let failed =
            |error: zip::result::ZipError| FitError::Params(format!("the package could not be written ({error})"));
        for (name, bytes) in files {
            add(name, bytes).map_err(failed)?;
        }
        Ok(zip.finish().map_err(failed)?.into_inner())
    }
}
