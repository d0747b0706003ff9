//! A glTF material's textures: 8-bit channels as the specification and its extensions lay them out, and what a viewer
//! reads from them.

use crate::error::FitError;
use crate::export::gltf::brdf::{GltfTexel, Sheen};
use crate::export::gltf::fit::GltfFit;
use crate::export::png::{byte, number, png};
use btf_capture::Transfer;

/// A picture of one texture.
#[derive(Debug, Clone, PartialEq)]
pub struct GltfImage {
    /// Name of the image's content in camel case.
    pub name: &'static str,
    /// 3 or 4 channels a texel, row by row.
    pub channels: usize,
    /// Samples of the image.
    pub samples: Vec<u8>,
}

/// The textures of a material, and the factors that stand beside them.
#[derive(Debug, Clone, PartialEq)]
pub struct GltfTextures {
    /// Texels a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Base colour, sRGB.
    pub base_colour: GltfImage,
    /// Roughness in green, metallic in blue, linear.
    pub metallic_roughness: GltfImage,
    /// Normal, -1 to 1 in 0 to 255; y is up.
    pub normal: GltfImage,
    /// Specular colour over its factor, sRGB, and specular strength in alpha.
    pub specular: Option<GltfImage>,
    /// Factor of the specular colour.
    pub specular_colour_factor: f32,
    /// Sheen colour over its factor, sRGB.
    pub sheen: Option<(GltfImage, Sheen)>,
    /// Factor of the sheen colour.
    pub sheen_colour_factor: f32,
    /// Colour of the light that comes through, sRGB, and its share in alpha.
    pub transmission: Option<GltfImage>,
}

impl GltfTextures {
    /// Encodes a fit.
    pub fn new(fit: &GltfFit) -> GltfTextures {
        let image = |name, channels, of: &dyn Fn(&GltfTexel) -> [u8; 4]| {
            let samples = fit.texels.iter().flat_map(|texel| of(texel).into_iter().take(channels)).collect();
            GltfImage { name, channels, samples }
        };
        let largest = |of: &dyn Fn(&GltfTexel) -> [f32; 3]| {
            let most = fit.texels.iter().flat_map(of).fold(0.0, f32::max);
            if most > 0.0 { most } else { 1.0 }
        };
        let specular_colour_factor = if fit.specular { largest(&|texel| texel.specular_colour) } else { 1.0 };
        let sheen_colour_factor = if fit.sheen.is_some() { largest(&|texel| texel.sheen_colour).min(1.0) } else { 1.0 };
        let srgb = |[r, g, b]: [f32; 3], factor: f32, alpha: f32| {
            let [r, g, b] = [r, g, b].map(|x| byte(Transfer::Srgb.encoded_from_linear(x / factor)));
            [r, g, b, byte(alpha)]
        };
        GltfTextures {
            width: fit.width,
            height: fit.height,
            base_colour: image("baseColor", 3, &|texel| srgb(texel.base_colour, 1.0, 1.0)),
            metallic_roughness: image("metallicRoughness", 3, &|texel| {
                [255, byte(texel.roughness), byte(texel.metallic), 255]
            }),
            normal: image("normal", 3, &|texel| {
                let [x, y, z] = texel.normal.map(|x| byte(0.5 * x + 0.5));
                [x, y, z, 255]
            }),
            specular: fit
                .specular
                .then(|| image("specular", 4, &|t| srgb(t.specular_colour, specular_colour_factor, t.specular))),
            specular_colour_factor,
            sheen: fit.sheen.as_ref().map(|sheen| {
                (image("sheenColor", 3, &|texel| srgb(texel.sheen_colour, sheen_colour_factor, 1.0)), sheen.clone())
            }),
            sheen_colour_factor,
            transmission: fit.transmission.then(|| {
                image("diffuseTransmission", 4, &|texel| srgb(texel.transmission_colour, 1.0, texel.transmission))
            }),
        }
    }

    /// Returns the images that there are.
    pub fn images(&self) -> Vec<&GltfImage> {
        let always = [&self.base_colour, &self.metallic_roughness, &self.normal];
        let sheen = self.sheen.as_ref().map(|(image, _)| image);
        always.into_iter().chain(&self.specular).chain(sheen).chain(&self.transmission).collect()
    }

    /// Returns what a viewer that knows all extensions reads at a texel.
    pub fn texel(&self, texel: usize) -> GltfTexel {
        let linear = |image: &GltfImage, factor: f32| {
            let at = &image.samples[texel * image.channels..];
            [0, 1, 2].map(|c| factor * Transfer::Srgb.linear_from_encoded(number(at[c])))
        };
        let alpha = |image: &GltfImage| number(image.samples[texel * image.channels + 3]);
        let at = &self.metallic_roughness.samples[texel * 3..];
        let normal = [0, 1, 2].map(|i| 2.0 * number(self.normal.samples[texel * 3 + i]) - 1.0);
        let length = normal.iter().map(|x| x * x).sum::<f32>().sqrt();
        let mut read = GltfTexel {
            base_colour: linear(&self.base_colour, 1.0),
            roughness: number(at[1]),
            metallic: number(at[2]),
            normal: normal.map(|x| x / length),
            ..GltfTexel::PLAIN
        };
        if let Some(image) = &self.specular {
            (read.specular_colour, read.specular) = (linear(image, self.specular_colour_factor), alpha(image));
        }
        if let Some((image, _)) = &self.sheen {
            read.sheen_colour = linear(image, self.sheen_colour_factor);
        }
        if let Some(image) = &self.transmission {
            (read.transmission_colour, read.transmission) = (linear(image, 1.0), alpha(image));
        }
        read
    }

    /// Returns the sheen that lies on all texels.
    pub fn sheen(&self) -> Option<&Sheen> {
        self.sheen.as_ref().map(|(_, sheen)| sheen)
    }

    /// Returns an image as a PNG file.
    ///
    /// # Errors
    /// If it is larger than PNG allows.
    pub fn png(&self, image: &GltfImage) -> Result<Vec<u8>, FitError> {
        png([self.width, self.height], image.channels, &image.samples)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_viewer_reads_what_was_fitted_within_a_step_of_8_bits() {
        let texels: Vec<GltfTexel> = (0..6)
            .map(|i| {
                let x = i as f32 / 6.0;
                let (tilt, y) = (0.5 * x - 0.2, 0.1);
                GltfTexel {
                    base_colour: [x, 0.5 * x, 1.0 - x],
                    metallic: 0.0,
                    roughness: 0.2 + 0.7 * x,
                    normal: [tilt, y, (1.0 - tilt * tilt - y * y).sqrt()],
                    specular: 0.4 + 0.1 * x,
                    specular_colour: [3.0 * x, 5.0, 1.0],
                    sheen_colour: [0.2 * x, 0.1, 0.0],
                    transmission: 0.3,
                    transmission_colour: [1.0, x, 0.0],
                }
            })
            .collect();
        let fit = GltfFit {
            width: 3,
            height: 2,
            texels,
            specular: true,
            sheen: Some(Sheen::new(0.5)),
            transmission: true,
            tried: Vec::new(),
        };
        let textures = GltfTextures::new(&fit);
        let numbers = |t: &GltfTexel| {
            let three =
                [t.base_colour, t.normal, t.specular_colour.map(|x| x / 5.0), t.sheen_colour, t.transmission_colour];
            [three.as_flattened(), &[t.roughness, t.metallic, t.specular, t.transmission]].concat()
        };
        for (i, texel) in fit.texels.iter().enumerate() {
            let read = textures.texel(i);
            let far = |a: &GltfTexel| numbers(a).iter().zip(numbers(texel)).any(|(a, b)| (a - b).abs() > 0.006);
            assert!(!far(&read), "{read:?} {texel:?}");
            assert!(far(&textures.texel((i + 1) % 6)), "planted: the next texel");
        }
        assert_eq!(textures.images().len(), 6);
        let png = textures.png(textures.specular.as_ref().unwrap()).unwrap();
        let back = image::load_from_memory(&png).unwrap().into_rgba8();
        assert_eq!(back.into_raw(), textures.specular.unwrap().samples);
    }
}
