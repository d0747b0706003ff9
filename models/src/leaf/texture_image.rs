//! Kinds of appearance textures, and one of them as an image, read from and written to PNG.

use std::io::{Cursor, Read};
use std::path::Path;

use crate::error::ModelError;
use btf_capture::files;

/// Largest number of texels of a texture: 8192 x 8192.
pub const MAX_TEXTURE_TEXELS: usize = 1 << 26;

/// Largest texture file in bytes: [`MAX_TEXTURE_TEXELS`] of 16-bit RGB without compression.
const MAX_FILE_BYTES: u64 = 6 * MAX_TEXTURE_TEXELS as u64 + (1 << 20);

/// Kind of an appearance texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextureKind {
    /// Main vein, lesser veins and mesophyll as red, green and blue.
    Structure,
    /// Factors V_a, V_c and V_b on chlorophyll, carotenoids and brown pigment as red, green and blue.
    Pigment,
    /// Factor V_g on the specular lobe of the adaxial face.
    Gloss,
    /// Factor V_g on the specular lobe of the abaxial face.
    GlossAbaxial,
    /// Factor V_t on the thickness.
    Thickness,
    /// Height of the adaxial face in millimetres.
    Height,
    /// Height of the abaxial face in millimetres, out of that face.
    HeightAbaxial,
    /// Cosine and sine of twice the angle of the vein direction as red and green.
    Direction,
}

impl TextureKind {
    /// Every kind, in the order of the description file.
    pub const ALL: [TextureKind; 8] = [
        TextureKind::Structure,
        TextureKind::Pigment,
        TextureKind::Gloss,
        TextureKind::GlossAbaxial,
        TextureKind::Thickness,
        TextureKind::Height,
        TextureKind::HeightAbaxial,
        TextureKind::Direction,
    ];

    /// Returns the name of the file without `.png`, which is also the name of its table in the description file.
    pub fn name(self) -> &'static str {
        match self {
            TextureKind::Structure => "structure",
            TextureKind::Pigment => "pigment",
            TextureKind::Gloss => "gloss",
            TextureKind::GlossAbaxial => "gloss-abaxial",
            TextureKind::Thickness => "thickness",
            TextureKind::Height => "height",
            TextureKind::HeightAbaxial => "height-abaxial",
            TextureKind::Direction => "direction",
        }
    }

    /// Returns the meaning of the channels for people.
    pub fn meaning(self) -> &'static str {
        match self {
            TextureKind::Structure => {
                "red: main vein; green: lesser veins (secondary 1, tertiary up to 0.5, finest up to 0.25); blue: \
                 mesophyll; together 1"
            }
            TextureKind::Pigment => {
                "red: V_a, factor on chlorophyll; green: V_c, factor on carotenoids; blue: V_b, factor on brown pigment"
            }
            TextureKind::Gloss => "V_g, strength of the adaxial face's gloss, 0 to 1",
            TextureKind::GlossAbaxial => "V_g, strength of the abaxial face's gloss, 0 to 1",
            TextureKind::Thickness => "V_t, factor on the absorption of everything in the blade",
            TextureKind::Height => "height of the adaxial face in millimetres, up out of that face",
            TextureKind::HeightAbaxial => {
                "height of the abaxial face in millimetres, up out of that face, seen through the leaf from the \
                 adaxial side like all the others"
            }
            TextureKind::Direction => {
                "red: cosine, green: sine of twice the angle from the columns' direction (x) to the vein direction"
            }
        }
    }

    /// Returns the number of channels: 1 or 3.
    pub fn channels(self) -> usize {
        match self {
            TextureKind::Structure | TextureKind::Pigment | TextureKind::Direction => 3,
            _ => 1,
        }
    }

    /// Returns the default values of black and of white.
    pub fn default_range(self) -> [f64; 2] {
        match self {
            TextureKind::Structure | TextureKind::Gloss | TextureKind::GlossAbaxial => [0.0, 1.0],
            TextureKind::Pigment | TextureKind::Thickness => [0.0, 2.0],
            TextureKind::Height | TextureKind::HeightAbaxial => [-0.5, 0.5],
            TextureKind::Direction => [-1.0, 1.0],
        }
    }

    /// Returns the widest range that is accepted.
    pub fn allowed_range(self) -> [f64; 2] {
        match self {
            TextureKind::Pigment | TextureKind::Thickness => [0.0, 20.0],
            TextureKind::Height | TextureKind::HeightAbaxial => [-10.0, 10.0],
            _ => self.default_range(),
        }
    }
}

/// Decoded texture with 16 bits a channel, the channels that its kind needs, and row 0 at the top.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct TextureImage {
    width: usize,
    height: usize,
    channels: usize,
    /// Values `[texel, channel]`.
    values: Vec<u16>,
}

impl TextureImage {
    /// Reads a PNG of 1 to 16 bits, grey, RGB or with a palette. Grey is copied to all channels, and RGB is averaged
    /// where one channel is needed. Transparency is ignored. Colour profiles are not applied, because pixels are
    /// numbers.
    ///
    /// # Errors
    /// [`ModelError::Leaf`] for a file that cannot be read, is damaged or cut, or is too large.
    pub fn read(path: &Path, channels: usize) -> Result<TextureImage, ModelError> {
        let bad = |fault: String, remedy: &'static str| ModelError::leaf(path, fault, remedy);
        let unreadable =
            |error: std::io::Error| bad(format!("cannot be read ({error})"), "check the file and its rights");
        let file = files::open(path).map_err(unreadable)?;
        let mut bytes = Vec::new();
        file.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes).map_err(unreadable)?;
        if bytes.len() as u64 > MAX_FILE_BYTES {
            return Err(bad(format!("is larger than {MAX_FILE_BYTES} bytes"), "scale the image down"));
        }
        TextureImage::decode(&bytes, channels).map_err(|fault| match fault {
            Fault::Size(width, height) => bad(
                format!("claims {width} x {height} texels and {MAX_TEXTURE_TEXELS} in all are allowed"),
                "scale the image down",
            ),
            Fault::Damaged(reason) => {
                bad(format!("is no whole PNG image ({reason})"), "save it again as a PNG of 8 or 16 bits")
            }
        })
    }

    fn decode(bytes: &[u8], channels: usize) -> Result<TextureImage, Fault> {
        let damaged = |error: png::DecodingError| Fault::Damaged(error.to_string());
        let limits = png::Limits { bytes: MAX_TEXTURE_TEXELS * 8 };
        let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
        decoder.set_transformations(png::Transformations::EXPAND);
        decoder.ignore_checksums(false);
        let mut reader = decoder.read_info().map_err(damaged)?;
        let (width, height) = reader.info().size();
        let texels = (width as usize).checked_mul(height as usize);
        if texels.is_none_or(|texels| texels == 0 || texels > MAX_TEXTURE_TEXELS) {
            return Err(Fault::Size(width, height));
        }
        let size = reader.output_buffer_size().ok_or(Fault::Size(width, height))?;
        let mut bytes = vec![0; size];
        let frame = reader.next_frame(&mut bytes).map_err(damaged)?;
        // Reads on to the end marker: a file cut behind its last row is refused, too.
        reader.finish().map_err(damaged)?;
        let found = frame.color_type.samples();
        let wide: Vec<u16> = match frame.bit_depth {
            png::BitDepth::Sixteen => bytes.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect(),
            _ => bytes.into_iter().map(|b| u16::from(b) * 257).collect(),
        };
        let values = wide
            .chunks_exact(found)
            .flat_map(|texel| {
                // Without alpha, which is the second or fourth channel.
                let rgb = if found < 3 { [texel[0]; 3] } else { [texel[0], texel[1], texel[2]] };
                let mean = ((rgb.iter().map(|&v| u32::from(v)).sum::<u32>() + 1) / 3) as u16;
                if channels == 1 { [mean, 0, 0] } else { rgb }.into_iter().take(channels)
            })
            .collect();
        Ok(TextureImage { width: width as usize, height: height as usize, channels, values })
    }

    /// Returns an image of `values`, `[texel, channel]`, which are clamped to `range` and rounded.
    pub fn from_values(width: usize, channels: usize, values: &[f32], range: [f64; 2]) -> TextureImage {
        let scale = 65535.0 / (range[1] - range[0]);
        // `as` saturates and maps NaN to 0.
        let values: Vec<u16> = values.iter().map(|&v| ((f64::from(v) - range[0]) * scale).round() as u16).collect();
        TextureImage { width, height: values.len() / channels / width, channels, values }
    }

    /// Encodes the image as a PNG of 16 bits a channel, or of 8 for any other depth.
    pub fn encode(&self, depth: png::BitDepth) -> Result<Vec<u8>, png::EncodingError> {
        let sixteen_bits = depth == png::BitDepth::Sixteen;
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width as u32, self.height as u32);
        encoder.set_color(if self.channels == 1 { png::ColorType::Grayscale } else { png::ColorType::Rgb });
        encoder.set_depth(if sixteen_bits { png::BitDepth::Sixteen } else { png::BitDepth::Eight });
        let data: Vec<u8> = if sixteen_bits {
            self.values.iter().flat_map(|v| v.to_be_bytes()).collect()
        } else {
            self.values.iter().map(|&v| ((u32::from(v) + 128) / 257) as u8).collect()
        };
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&data)?;
        writer.finish()?;
        Ok(bytes)
    }

    /// Returns the width and height in texels.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Returns all values, `[texel, channel]`, scaled to `range`, row 0 at the top.
    pub fn values(&self, range: [f64; 2]) -> Vec<f32> {
        self.values.iter().map(|&value| value_of(f64::from(value), range)).collect()
    }

    /// Returns the bilinearly interpolated value, scaled to `range`, at a place from 0 (left, top) to 1 (right,
    /// bottom). Beyond the edges the image is mirrored. Channels that the image lacks are 0.
    pub fn sample(&self, place: [f64; 2], range: [f64; 2]) -> [f32; 3] {
        let along = |u: f64, count: usize| {
            let u = u.rem_euclid(2.0);
            let mirrored = if u > 1.0 { 2.0 - u } else { u };
            let at = (mirrored * count as f64 - 0.5).clamp(0.0, (count - 1) as f64);
            let first = (at as usize).min(count.saturating_sub(2));
            (first, (first + 1).min(count - 1), at - first as f64)
        };
        let (x0, x1, fx) = along(place[0], self.width);
        let (y0, y1, fy) = along(place[1], self.height);
        std::array::from_fn(|channel| {
            if channel >= self.channels {
                return 0.0;
            }
            let at = |x: usize, y: usize| f64::from(self.values[(y * self.width + x) * self.channels + channel]);
            let top = at(x0, y0) * (1.0 - fx) + at(x1, y0) * fx;
            let bottom = at(x0, y1) * (1.0 - fx) + at(x1, y1) * fx;
            value_of(top * (1.0 - fy) + bottom * fy, range)
        })
    }
}

/// Returns the value in `range` that a number from 0 to 65535 stands for.
fn value_of(code: f64, range: [f64; 2]) -> f32 {
    (range[0] + code / 65535.0 * (range[1] - range[0])) as f32
}

/// Fault of the bytes of a PNG.
#[derive(Debug)]
enum Fault {
    Size(u32, u32),
    Damaged(String),
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Returns a PNG of `data` in one of the library's colour types.
    pub(crate) fn png_bytes(size: [u32; 2], colour: png::ColorType, depth: png::BitDepth, data: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(data).unwrap();
        writer.finish().unwrap();
        bytes
    }

    #[test]
    fn grey_rgb_alpha_and_both_depths_are_read() {
        use png::{BitDepth, ColorType};
        let first = |colour, depth, data: &[u8], channels| {
            TextureImage::decode(&png_bytes([1, 1], colour, depth, data), channels).unwrap().values
        };
        assert_eq!(first(ColorType::Grayscale, BitDepth::Eight, &[7], 3), [7 * 257; 3]);
        assert_eq!(first(ColorType::GrayscaleAlpha, BitDepth::Eight, &[7, 3], 1), [7 * 257]);
        assert_eq!(first(ColorType::Rgb, BitDepth::Eight, &[3, 6, 9], 1), [6 * 257]);
        assert_eq!(first(ColorType::Rgba, BitDepth::Eight, &[3, 6, 9, 0], 3), [3 * 257, 6 * 257, 9 * 257]);
        assert_eq!(first(ColorType::Grayscale, BitDepth::Sixteen, &[1, 2], 1), [258]);
    }

    #[test]
    fn every_prefix_and_an_enormous_claim_is_refused() {
        let image = TextureImage::from_values(5, 3, &(0..75).map(|i| i as f32).collect::<Vec<_>>(), [0.0, 75.0]);
        for depth in [png::BitDepth::Sixteen, png::BitDepth::Eight] {
            let bytes = image.encode(depth).unwrap();
            for length in 0..bytes.len() {
                assert!(TextureImage::decode(&bytes[..length], 3).is_err(), "prefix of {length}");
            }
            assert!(TextureImage::decode(&bytes, 3).is_ok());
        }
        // A header with the right checksum that claims 60000 x 60000 texels.
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 60_000, 60_000);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header().unwrap();
        writer.write_chunk(png::chunk::IDAT, &[0x78, 0x9C]).unwrap();
        drop(writer);
        assert!(matches!(TextureImage::decode(&bytes, 3), Err(Fault::Size(60_000, 60_000))));
    }

    #[test]
    fn a_flipped_bit_is_refused_or_harmless() {
        let image = TextureImage::from_values(4, 1, &(0..16).map(|i| i as f32).collect::<Vec<_>>(), [0.0, 16.0]);
        let bytes = image.encode(png::BitDepth::Sixteen).unwrap();
        for position in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[position] ^= 0x10;
            if let Ok(other) = TextureImage::decode(&damaged, 1) {
                assert_eq!(other, image, "byte {position}");
            }
        }
    }

    #[test]
    fn sampling_is_exact_on_texels_linear_between_and_mirrored_beyond() {
        let image = TextureImage::from_values(4, 1, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], [0.0, 8.0]);
        let at = |x: f64, y: f64| image.sample([x / 4.0, y / 2.0], [0.0, 8.0])[0];
        for (x, y, expected) in
            [(0.5, 0.5, 0.0), (3.5, 1.5, 7.0), (2.0, 0.5, 1.5), (2.0, 1.0, 3.5), (-0.5, 0.5, 0.0), (4.5, 0.5, 3.0)]
        {
            assert!((at(x, y) - expected).abs() < 2e-4, "{x} {y}: {}", at(x, y));
        }
        let one = TextureImage::from_values(1, 1, &[0.25], [0.0, 1.0]);
        assert!((one.sample([17.3, -4.0], [0.0, 1.0])[0] - 0.25).abs() < 1e-5);
    }
}
