//! An OpenPBR material's textures: 8-bit PNG files, and what a renderer reads from them.

use crate::error::FitError;
use crate::export::openpbr::fit::OpenPbrFit;
use crate::export::openpbr::model::OpenPbrTexel;
use crate::export::png::{byte, number, png};
use btf_capture::Transfer;

/// A texture of three channels.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenPbrTexture {
    /// Name of what it holds, in the words of OpenPBR, such as `base_color`.
    pub name: &'static str,
    /// Whether it holds colours on sRGB's curve; others are numbers.
    pub srgb: bool,
    /// Samples, three a texel, row by row.
    pub samples: Vec<u8>,
}

impl OpenPbrTexture {
    /// Encodes what `of` returns of each texel: linear colours for `srgb`, else numbers from 0 to 1.
    pub fn new<T>(name: &'static str, srgb: bool, texels: &[T], of: impl Fn(&T) -> [f32; 3]) -> OpenPbrTexture {
        let code = |x: f32| byte(if srgb { Transfer::Srgb.encoded_from_linear(x) } else { x });
        OpenPbrTexture { name, srgb, samples: texels.iter().flat_map(|texel| of(texel).map(code)).collect() }
    }

    /// Returns what a renderer reads at a texel: a linear colour or numbers from 0 to 1.
    pub fn read(&self, texel: usize) -> [f32; 3] {
        let decoded = |x: f32| if self.srgb { Transfer::Srgb.linear_from_encoded(x) } else { x };
        [0, 1, 2].map(|c| decoded(number(self.samples[3 * texel + c])))
    }
}

/// The textures of a material.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenPbrTextures {
    /// Texels a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// The textures that the material has.
    pub textures: Vec<OpenPbrTexture>,
}

impl OpenPbrTextures {
    /// Encodes a fit. [`OpenPbrTextures::texel`] tells what each channel holds.
    pub fn new(fit: &OpenPbrFit) -> OpenPbrTextures {
        let mut textures = Vec::new();
        let mut add = |name, srgb, of: &dyn Fn(&OpenPbrTexel) -> [f32; 3]| {
            textures.push(OpenPbrTexture::new(name, srgb, &fit.texels, of));
        };
        add("base_color", true, &|t| t.base_colour);
        add("specular_color", true, &|t| t.specular_colour);
        add("normal", false, &|t| packed_normal(t.normal));
        add("roughness", false, &|t| [t.roughness, t.diffuse_roughness, t.coat_roughness]);
        add("specular", false, &|t| packed_anisotropy(t.anisotropy, t.f0.sqrt()));
        if fit.coat {
            add("coat_color", true, &|t| t.coat_colour);
            add("coat_normal", false, &|t| packed_normal(t.coat_normal));
            add("coat", false, &|t| packed_anisotropy(t.coat_anisotropy, t.coat));
        }
        if fit.fuzz {
            add("fuzz_color", true, &|t| t.fuzz_colour);
            add("fuzz", false, &|t| [t.fuzz, t.fuzz_roughness, 0.0]);
        }
        if !fit.transmission.is_empty() {
            let through = &fit.transmission;
            textures.push(OpenPbrTexture::new("subsurface_color", true, through, |(_, colour)| *colour));
            textures.push(OpenPbrTexture::new("subsurface_weight", false, through, |(share, _)| [*share; 3]));
        }
        OpenPbrTextures { width: fit.width, height: fit.height, textures }
    }

    /// Returns whether there is a texture of this name.
    pub fn has(&self, name: &str) -> bool {
        self.textures.iter().any(|texture| texture.name == name)
    }

    /// Returns what a renderer reads at a texel.
    pub fn texel(&self, texel: usize) -> OpenPbrTexel {
        let mut read = OpenPbrTexel { coat: 0.0, fuzz: 0.0, ..OpenPbrTexel::PLAIN };
        let of = |name| Some(self.textures.iter().find(|texture| texture.name == name)?.read(texel));
        if let Some(colour) = of("base_color") {
            read.base_colour = colour;
        }
        if let Some(colour) = of("specular_color") {
            read.specular_colour = colour;
        }
        if let Some(packed) = of("normal") {
            read.normal = read_normal(packed);
        }
        if let Some([specular, diffuse, coat]) = of("roughness") {
            (read.roughness, read.diffuse_roughness, read.coat_roughness) = (specular, diffuse, coat);
        }
        if let Some([x, y, root]) = of("specular") {
            (read.anisotropy, read.f0) = (read_anisotropy([x, y]), root * root);
        }
        if let (Some(colour), Some(normal), Some([x, y, weight])) = (of("coat_color"), of("coat_normal"), of("coat")) {
            (read.coat_colour, read.coat_normal) = (colour, read_normal(normal));
            (read.coat_anisotropy, read.coat) = (read_anisotropy([x, y]), weight);
        }
        if let (Some(colour), Some([weight, roughness, _])) = (of("fuzz_color"), of("fuzz")) {
            (read.fuzz_colour, read.fuzz, read.fuzz_roughness) = (colour, weight, roughness);
        }
        if let Some([share, ..]) = of("subsurface_weight") {
            // Seen from the front, what comes through is missing from what is reflected.
            read.base_colour = read.base_colour.map(|x| x * (1.0 - share));
        }
        read
    }

    /// Returns the textures as PNG files, with names that start with `prefix`.
    ///
    /// # Errors
    /// If they are larger than PNG allows.
    pub fn files(&self, prefix: &str) -> Result<Vec<(String, Vec<u8>)>, FitError> {
        self.textures.iter().map(|texture| Ok((format!("{prefix}{}.png", texture.name), self.png(texture)?))).collect()
    }

    /// Returns a texture as a PNG file.
    ///
    /// # Errors
    /// If it is larger than PNG allows.
    pub fn png(&self, texture: &OpenPbrTexture) -> Result<Vec<u8>, FitError> {
        png([self.width, self.height], 3, &texture.samples)
    }
}

/// Returns a unit vector as textures hold it: -1 to 1 in 0 to 1, y up.
fn packed_normal([x, y]: [f32; 2]) -> [f32; 3] {
    [x, y, (1.0 - x * x - y * y).max(0.0).sqrt()].map(|x| 0.5 * x + 0.5)
}

fn read_normal(packed: [f32; 3]) -> [f32; 2] {
    let n = packed.map(|x| 2.0 * x - 1.0);
    let length = n.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-6);
    [n[0] / length, n[1] / length]
}

/// Returns a vector of length 1 at most as textures hold it, and a third number.
fn packed_anisotropy([x, y]: [f32; 2], third: f32) -> [f32; 3] {
    [0.5 * x + 0.5, 0.5 * y + 0.5, third]
}

fn read_anisotropy(packed: [f32; 2]) -> [f32; 2] {
    packed.map(|x| 2.0 * x - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::openpbr::model::PARAMETERS;

    #[test]
    fn a_renderer_reads_what_was_fitted_within_a_step_of_8_bits() {
        let texels: Vec<OpenPbrTexel> = (0..6)
            .map(|i| {
                let numbers: [f32; PARAMETERS] = std::array::from_fn(|p| 0.05 + 0.1 * ((i + p) % 6) as f32);
                OpenPbrTexel::from_parameters(&numbers)
            })
            .collect();
        let mut fit = OpenPbrFit {
            width: 3,
            height: 2,
            texels,
            coat: true,
            fuzz: true,
            transmission: Vec::new(),
            tried: Vec::new(),
        };
        let textures = OpenPbrTextures::new(&fit);
        for (i, texel) in fit.texels.iter().enumerate() {
            let far = |read: OpenPbrTexel| {
                read.to_parameters().iter().zip(texel.to_parameters()).any(|(a, b)| (a - b).abs() > 0.006)
            };
            assert!(!far(textures.texel(i)), "{:?} {texel:?}", textures.texel(i));
            assert!(far(textures.texel((i + 1) % 6)), "planted: the next texel");
        }
        assert_eq!(textures.textures.len(), 10);
        let png = textures.png(&textures.textures[0]).unwrap();
        assert_eq!(image::load_from_memory(&png).unwrap().into_rgb8().into_raw(), textures.textures[0].samples);

        // What comes through is not reflected; parts that are not there have no textures.
        (fit.coat, fit.fuzz) = (false, false);
        fit.transmission = vec![(0.2, [0.5; 3]); 6];
        let through = OpenPbrTextures::new(&fit);
        assert_eq!(through.textures.len(), 7);
        assert!((through.texel(0).base_colour[0] - 0.8 * textures.texel(0).base_colour[0]).abs() < 1e-3);
        assert_eq!((through.texel(0).coat, through.texel(0).fuzz), (0.0, 0.0));
    }
}
