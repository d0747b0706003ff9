//! A `.glb` file that shows an asset: a quad of its physical size, whose material points at the asset in the extension
//! `BTF_materials_spmm` and has, for everyone else, the textures of a fitted glTF material. docs/reference/gltf.md specifies it.

use crate::error::FitError;
use crate::export::gltf::fit::{GltfFit, Maps, TriedPart, fit_gltf};
use crate::export::gltf::textures::{GltfImage, GltfTextures};
use crate::export::pairs::{front_layer, psnr_db_at_pairs, transmission_layer};
use crate::inspect::describe_resident::sides_of_resident;
use crate::inspect::load::parallel;
use crate::monitor::Monitor;
use btf_models::glb::{F32, GlbBuffer, INDICES, TRIANGLES, U16, VERTICES, escaped, glb_from};
use btf_runtime::{Form, Levels, Resident, open, read_directory};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

/// Name of the extension.
pub const EXTENSION: &str = "BTF_materials_spmm";
/// Width of an asset that does not tell its physical size, in metres.
const WIDTH_M: f32 = 0.1;
/// Words of glTF: an image's wrapping and filters.
const REPEAT: u32 = 10497;
const LINEAR: u32 = 9729;
const LINEAR_MIPMAP_LINEAR: u32 = 9987;

/// Place where a viewer finds the asset.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AssetPlace {
    /// Address of a file relative to the `.glb`.
    Uri(String),
    /// Inside the `.glb` itself.
    Embedded,
}

impl AssetPlace {
    /// Returns the place [`AssetPlace::uri_beside`] names.
    ///
    /// # Errors
    /// Those of [`AssetPlace::uri_beside`].
    pub fn beside(asset: &Path, glb: &Path) -> Result<AssetPlace, FitError> {
        AssetPlace::uri_beside(asset, glb).map(AssetPlace::Uri)
    }

    /// Returns the address by which the file `document` names the file `asset`, relative to itself and with characters
    /// escaped that an address cannot hold. `document` need not exist yet.
    ///
    /// # Errors
    /// [`FitError::File`] where a folder of theirs cannot be found.
    pub fn uri_beside(asset: &Path, document: &Path) -> Result<String, FitError> {
        let real = |path: &Path| {
            std::fs::canonicalize(path).map_err(|source| FitError::File {
                path: path.to_path_buf(),
                action: "finding its folder",
                source,
                remedy: "check the path",
            })
        };
        let folder = document.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let (asset, folder) = (real(asset)?, real(folder)?);
        let shared = asset.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
        let up = folder.components().skip(shared).map(|_| Component::ParentDir);
        let path: PathBuf = up.chain(asset.components().skip(shared)).collect();
        let parts = path.components().map(|part| part.as_os_str().to_string_lossy().into_owned());
        Ok(parts.map(|part| escaped(&part)).collect::<Vec<_>>().join("/"))
    }
}

/// A `.glb` file and figures about it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GltfExport {
    /// Bytes of the `.glb` file.
    #[serde(skip)]
    pub glb: Vec<u8>,
    /// Texels a row of the textures.
    pub width: usize,
    /// Rows of the textures.
    pub height: usize,
    /// Physical size of the quad in metres.
    pub size_m: [f32; 2],
    /// Parts of the material model that were tried beyond base colour, roughness and normal.
    pub tried: Vec<TriedPart>,
    /// Extensions that the file uses.
    pub extensions: Vec<String>,
    /// Error of the fallback against the asset: 8-bit sRGB values of all texels, each at some of the measured pairs,
    /// all pairs alike; peak 255.
    pub psnr_db: f64,
    /// Error of the transmitted light in the same measure as `psnr_db`; `None` where the asset has no such layer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub psnr_transmitted_db: Option<f64>,
}

/// Fits the fallback of the asset in `bytes`, of either form, and makes the `.glb`. `name` names the material.
///
/// Deterministic: equal assets give equal bytes on any number of threads. Cost: that of [`fit_gltf`], and measuring about
/// a third of it.
///
/// # Errors
/// A fault of the bytes; an asset without a front; a file of 4 GiB and more.
pub fn export_gltf(
    bytes: Vec<u8>,
    name: &str,
    place: AssetPlace,
    maps: Maps,
    monitor: &Monitor,
) -> Result<GltfExport, FitError> {
    let bytes = Arc::new(bytes);
    let directory = read_directory(&bytes)?;
    let file = open(bytes.clone(), Levels::AtHand, &parallel)?;
    let fit = fit_gltf(&file.resident, maps, monitor)?;
    let textures = GltfTextures::new(&fit);
    let front = front_layer(&file.resident)?;
    let psnr_db = measure(&file.resident, front, &textures, monitor)?;
    let psnr_transmitted_db = transmission_layer(&file.resident)
        .map(|layer| measure(&file.resident, layer, &textures, monitor))
        .transpose()?;

    let known_m = file.size_mm.map(|size| size.map(|side| side / 1000.0));
    let size_m = size_of_quad_m(known_m, [fit.width, fit.height]);
    let mut buffer = GlbBuffer::default();
    let asset = match &place {
        AssetPlace::Uri(uri) => json!({ "uri": uri }),
        AssetPlace::Embedded => json!({ "bufferView": buffer.push(&bytes, None) }),
    };
    let mut extension = json!({
        "asset": asset,
        "version": directory.head.version,
        "form": if directory.head.form == Form::Resident { "resident" } else { "file" },
        "byteLength": bytes.len(),
        "checksum": format!("{:016x}", directory.checksum),
        "layers": sides_of_resident(&file.resident).iter().map(ToString::to_string).collect::<Vec<_>>(),
        "width": fit.width,
        "height": fit.height,
        "seamless": file.seamless,
        "tiers": directory.tiers,
    });
    if let Some([width, height]) = file.size_mm {
        extension["size"] = json!([metres(width), metres(height)]);
    }
    let material = Material { name, fit: &fit, textures: &textures, extension };
    let (document, extensions) = material.document(&mut buffer, size_m)?;
    let glb = glb_from(&document, buffer.bytes).ok_or_else(|| {
        FitError::Params("a .glb holds less than 4 GiB; leave --embed, so that the asset stays a file".into())
    })?;
    Ok(GltfExport {
        glb,
        width: fit.width,
        height: fit.height,
        size_m,
        tried: fit.tried.clone(),
        extensions,
        psnr_db,
        psnr_transmitted_db,
    })
}

/// Measures the PSNR of the textures against `layer` in dB.
fn measure(resident: &Resident, layer: u32, textures: &GltfTextures, monitor: &Monitor) -> Result<f64, FitError> {
    let through = transmission_layer(resident) == Some(layer);
    psnr_db_at_pairs(resident, layer, [textures.width, textures.height], monitor, |texel| {
        let material = textures.texel(texel);
        move |wi: [f32; 3], wo| match through {
            true => material.transmitted(wi[2].abs()),
            false => material.reflected(textures.sheen(), wi, wo),
        }
    })
}

fn metres(mm: f32) -> f64 {
    // The nearest decimal number, not the nearest single-precision one.
    format!("{mm}").parse::<f64>().unwrap_or(f64::from(mm)) / 1000.0
}

/// Returns the physical size of the quad in metres; where it is not known, 0.1 m wide.
pub fn size_of_quad_m(known_m: Option<[f32; 2]>, texels: [usize; 2]) -> [f32; 2] {
    known_m.unwrap_or([WIDTH_M, WIDTH_M * texels[1] as f32 / texels[0] as f32])
}

/// Parts of the document.
struct Material<'a> {
    name: &'a str,
    fit: &'a GltfFit,
    textures: &'a GltfTextures,
    /// Content of the extension [`EXTENSION`].
    extension: Value,
}

impl Material<'_> {
    /// Returns the JSON document and the extensions that it uses; writes everything binary into `buffer`.
    fn document(self, buffer: &mut GlbBuffer, size_m: [f32; 2]) -> Result<(Value, Vec<String>), FitError> {
        let textures = self.textures;
        let mut images = Vec::new();
        for image in textures.images() {
            let view = buffer.push(&textures.png(image)?, None);
            images.push(json!({ "name": image.name, "mimeType": "image/png", "bufferView": view }));
        }
        let texture =
            |of: &GltfImage| json!({ "index": textures.images().iter().position(|image| image.name == of.name) });

        let mut extensions = Map::new();
        extensions.insert(EXTENSION.into(), self.extension);
        if let Some(image) = &textures.specular {
            extensions.insert(
                "KHR_materials_specular".into(),
                json!({
                    "specularTexture": texture(image),
                    "specularColorTexture": texture(image),
                    "specularColorFactor": vec![textures.specular_colour_factor; 3],
                }),
            );
        }
        if let Some((image, sheen)) = &textures.sheen {
            extensions.insert(
                "KHR_materials_sheen".into(),
                json!({
                    "sheenColorTexture": texture(image),
                    "sheenColorFactor": vec![textures.sheen_colour_factor; 3],
                    "sheenRoughnessFactor": sheen.roughness,
                }),
            );
        }
        if let Some(image) = &textures.transmission {
            extensions.insert(
                "KHR_materials_diffuse_transmission".into(),
                json!({
                    "diffuseTransmissionFactor": 1.0,
                    "diffuseTransmissionTexture": texture(image),
                    "diffuseTransmissionColorTexture": texture(image),
                }),
            );
        }
        let used: Vec<String> = extensions.keys().cloned().collect();

        let [x, y] = size_m.map(|side| 0.5 * side);
        let positions = [[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]];
        // Texture coordinates count downwards; tangents are those of rows from left to right, y up.
        let uvs: [[f32; 2]; 4] = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
        let accessors = [
            json!({ "bufferView": buffer.push(bytemuck::bytes_of(&positions), Some(VERTICES)), "componentType": F32,
                    "count": 4, "type": "VEC3", "min": positions[0], "max": positions[2] }),
            json!({ "bufferView": buffer.push(bytemuck::bytes_of(&[[0.0f32, 0.0, 1.0]; 4]), Some(VERTICES)),
                    "componentType": F32, "count": 4, "type": "VEC3" }),
            json!({ "bufferView": buffer.push(bytemuck::bytes_of(&[[1.0f32, 0.0, 0.0, 1.0]; 4]), Some(VERTICES)),
                    "componentType": F32, "count": 4, "type": "VEC4" }),
            json!({ "bufferView": buffer.push(bytemuck::bytes_of(&uvs), Some(VERTICES)), "componentType": F32,
                    "count": 4, "type": "VEC2" }),
            json!({ "bufferView": buffer.push(bytemuck::bytes_of(&[0u16, 1, 2, 0, 2, 3]), Some(INDICES)),
                    "componentType": U16, "count": 6, "type": "SCALAR" }),
        ];
        let document = json!({
            "asset": { "version": "2.0", "generator": concat!("btf-fit ", env!("CARGO_PKG_VERSION")) },
            "extensionsUsed": used,
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "name": self.name, "mesh": 0 }],
            "meshes": [{ "name": self.name, "primitives": [{
                "attributes": { "POSITION": 0, "NORMAL": 1, "TANGENT": 2, "TEXCOORD_0": 3 },
                "indices": 4, "material": 0, "mode": TRIANGLES,
            }] }],
            "materials": [{
                "name": self.name,
                "pbrMetallicRoughness": {
                    "baseColorTexture": texture(&textures.base_colour),
                    "metallicRoughnessTexture": texture(&textures.metallic_roughness),
                },
                "normalTexture": texture(&textures.normal),
                "doubleSided": self.fit.transmission,
                "extensions": extensions,
            }],
            "textures": (0..images.len()).map(|source| json!({ "sampler": 0, "source": source })).collect::<Vec<_>>(),
            "samplers": [{ "wrapS": REPEAT, "wrapT": REPEAT, "magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR }],
            "images": images,
            "accessors": accessors,
            "bufferViews": buffer.views,
            "buffers": [{ "byteLength": buffer.bytes.len() }],
        });
        Ok((document, used))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::convert::{Shape, convert};
    use crate::sample_asset::sample_asset;
    use btf_runtime::{Asset, SurfaceSide, pack};

    fn export(asset: &Asset, place: AssetPlace) -> GltfExport {
        export_gltf(pack(asset).unwrap(), "felt", place, Maps::All, &Monitor::default()).unwrap()
    }

    /// Returns the document and the binary chunk.
    fn parts(glb: &[u8]) -> (Value, Vec<u8>) {
        let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&glb[..4], word(4), word(8)), (&b"glTF"[..], 2, glb.len()));
        let text = word(12);
        assert_eq!(&glb[16..20], b"JSON");
        assert_eq!((&glb[24 + text..28 + text], word(20 + text)), (&b"BIN\0"[..], glb.len() - text - 28));
        (serde_json::from_slice(&glb[20..20 + text]).unwrap(), glb[28 + text..].to_vec())
    }

    #[test]
    fn the_extension_names_the_asset_and_tells_how_to_know_it() {
        let asset = Asset { size_mm: Some([30.0, 18.0]), seamless: [true, false], ..sample_asset() };
        let bytes = pack(&asset).unwrap();
        let export = export(&asset, AssetPlace::Uri("felt.spmm".into()));
        let (document, _) = parts(&export.glb);
        let told = &document["materials"][0]["extensions"][EXTENSION];
        assert_eq!(told["asset"], json!({ "uri": "felt.spmm" }));
        assert_eq!(told["byteLength"], bytes.len());
        assert_eq!(told["size"], json!([0.03, 0.018]));
        assert_eq!((&told["layers"], &told["seamless"]), (&json!(["front"]), &json!([true, false])));
        // The checksum is bytes 48 to 55, as format.md has them, the last one first.
        let hex: String = bytes[48..56].iter().rev().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(told["checksum"], hex);
        assert_eq!(told["tiers"].as_array().unwrap().last().unwrap(), bytes.len());
        assert!(document["extensionsUsed"].as_array().unwrap().contains(&json!(EXTENSION)));
        assert!(document.get("extensionsRequired").is_none());
        let most = [0, 1].map(|i| document["accessors"][0]["max"][i].as_f64().unwrap() as f32);
        assert_eq!(most, [0.015, 0.009]);
    }

    #[test]
    fn an_embedded_asset_is_read_back_and_both_forms_export_alike() {
        let asset = Asset::parse(&pack(&sample_asset()).unwrap()).unwrap();
        let export_file = export(&asset, AssetPlace::Embedded);
        let (document, binary) = parts(&export_file.glb);
        let told = &document["materials"][0]["extensions"][EXTENSION];
        let view = &document["bufferViews"][told["asset"]["bufferView"].as_u64().unwrap() as usize];
        let number = |key: &str| view[key].as_u64().unwrap() as usize;
        assert_eq!(binary[number("byteOffset")..][..number("byteLength")], pack(&asset).unwrap());

        let resident = convert(&asset, Shape::Resident).unwrap();
        let place = AssetPlace::Uri("felt.resident.spmm".into());
        let of_resident = export_gltf(resident, "felt", place, Maps::All, &Monitor::default()).unwrap();
        assert_eq!((of_resident.psnr_db, &of_resident.tried), (export_file.psnr_db, &export_file.tried));
        let (document, _) = parts(&of_resident.glb);
        assert_eq!(document["materials"][0]["extensions"][EXTENSION]["form"], "resident");
        let known = ["BTF_materials_spmm", "KHR_materials_sheen", "KHR_materials_specular"];
        assert_eq!(of_resident.extensions, known);
    }

    #[test]
    fn the_error_is_that_of_the_textures_in_the_file() {
        let asset = Asset::parse(&pack(&sample_asset()).unwrap()).unwrap();
        let resident = Resident::from_asset(&asset);
        let fit = fit_gltf(&resident, Maps::All, &Monitor::default()).unwrap();
        let measured = |fit: &GltfFit| measure(&resident, 0, &GltfTextures::new(fit), &Monitor::default()).unwrap();
        let whole = measured(&fit);
        assert_eq!(whole, export(&asset, AssetPlace::Embedded).psnr_db);
        let mut black = fit.clone();
        black.texels.iter_mut().for_each(|texel| texel.base_colour = [0.0; 3]);
        assert!(measured(&black) < whole - 0.5, "planted: {} {whole}", measured(&black));
    }

    #[test]
    fn the_asset_is_named_as_the_file_beside_it_would_say() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("scenes")).unwrap();
        let asset = folder.path().join("grey felt.spmm");
        std::fs::write(&asset, b"x").unwrap();
        let uri = |glb: &str| match AssetPlace::beside(&asset, &folder.path().join(glb)).unwrap() {
            AssetPlace::Uri(uri) => uri,
            AssetPlace::Embedded => panic!("not embedded"),
        };
        assert_eq!(uri("felt.glb"), "grey%20felt.spmm");
        assert_eq!(uri("scenes/felt.glb"), "../grey%20felt.spmm");
        assert!(AssetPlace::beside(&asset, &folder.path().join("none/felt.glb")).is_err());
    }

    #[test]
    fn an_asset_without_a_front_is_refused_with_the_remedy() {
        let mut asset = sample_asset();
        (asset.layers[0].light_side, asset.layers[0].view_side) = (SurfaceSide::Back, SurfaceSide::Back);
        let bytes = pack(&asset).unwrap();
        let error = export_gltf(bytes, "felt", AssetPlace::Embedded, Maps::Auto, &Monitor::default()).unwrap_err();
        assert!(error.to_string().contains("fit a capture of the front"), "{error}");
    }
}
