//! UsdPreviewSurface in its specular workflow: reflectance, and the textures that a glTF fit gives.

use crate::export::gltf::brdf::{DIELECTRIC_F0, GltfTexel};
use crate::export::gltf::fit::GltfFit;
use crate::export::openpbr::textures::{OpenPbrTexture, OpenPbrTextures};

/// Names of the textures, in the order of [`preview_textures`].
pub const PREVIEW_TEXTURES: [&str; 4] =
    ["preview_diffuse_color", "preview_specular_color", "preview_normal", "preview_roughness"];

/// Returns a texel as UsdPreviewSurface has it: the reflectance at normal incidence is a colour, that at grazing incidence 1.
fn preview_texel(texel: &GltfTexel) -> GltfTexel {
    let f0 = match texel.metallic > 0.5 {
        true => texel.base_colour,
        false => texel.specular_colour.map(|x| texel.specular * (DIELECTRIC_F0 * x).min(1.0)),
    };
    let diffuse =
        if texel.metallic > 0.5 { [0.0; 3] } else { texel.base_colour.map(|x| x * (1.0 - texel.transmission)) };
    GltfTexel {
        base_colour: diffuse,
        roughness: texel.roughness,
        normal: texel.normal,
        specular: 1.0,
        specular_colour: f0.map(|x| x / DIELECTRIC_F0),
        metallic: 0.0,
        ..GltfTexel::PLAIN
    }
}

/// Makes the textures of UsdPreviewSurface.
pub fn preview_textures(fit: &GltfFit) -> OpenPbrTextures {
    let texels: Vec<GltfTexel> = fit.texels.iter().map(preview_texel).collect();
    let of = |name, srgb, of: &dyn Fn(&GltfTexel) -> [f32; 3]| OpenPbrTexture::new(name, srgb, &texels, of);
    let [diffuse, specular, normal, roughness] = PREVIEW_TEXTURES;
    OpenPbrTextures {
        width: fit.width,
        height: fit.height,
        textures: vec![
            of(diffuse, true, &|t| t.base_colour),
            of(specular, true, &|t| t.specular_colour.map(|x| x * DIELECTRIC_F0)),
            of(normal, false, &|t| t.normal.map(|x| 0.5 * x + 0.5)),
            of(roughness, false, &|t| [t.roughness; 3]),
        ],
    }
}

/// Returns what a renderer reads at a texel, as the glTF texel that reflects the same.
pub fn read_preview(textures: &OpenPbrTextures, texel: usize) -> GltfTexel {
    let read = |index: usize| textures.textures[index].read(texel);
    let normal = read(2).map(|x| 2.0 * x - 1.0);
    let length = normal.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-6);
    GltfTexel {
        base_colour: read(0),
        specular_colour: read(1).map(|x| x / DIELECTRIC_F0),
        normal: normal.map(|x| x / length),
        roughness: read(3)[0],
        ..GltfTexel::PLAIN
    }
}
