//! A plane of coefficients in BC4.

use crate::export::ktx2::filtered::bc4::{BLOCK_BYTES, decode_block, encode_block};

/// The value between 0 and 255 that stands for 0, and the largest distance from it.
pub const ZERO: f32 = 128.0;
const MOST: f32 = 127.0;

/// A plane: a coefficient is `scale * (value - 128)`.
pub struct Plane {
    /// Coefficient of a step of the 8-bit values.
    pub scale: f32,
    /// Texels a row and rows.
    pub size: [usize; 2],
    /// Blocks, row by row.
    pub blocks: Vec<[u8; BLOCK_BYTES]>,
}

/// Returns the scale of planes whose coefficients are at most `largest`.
pub fn scale_of(largest: f32) -> f32 {
    (largest / MOST).max(f32::MIN_POSITIVE)
}

/// Encodes the coefficients of all texels, row by row; those beyond 127 steps are clamped. Blocks that stand over the
/// edge repeat it.
pub fn encode_plane(coefficients: &[f32], size: [usize; 2], scale: f32) -> Plane {
    let [width, height] = size;
    let (columns, rows) = (width.div_ceil(4), height.div_ceil(4));
    let blocks = (0..rows * columns)
        .map(|block| {
            let (x, y) = (block % columns * 4, block / columns * 4);
            encode_block(&std::array::from_fn(|i| {
                let texel = (y + i / 4).min(height - 1) * width + (x + i % 4).min(width - 1);
                (coefficients[texel] / scale + ZERO).clamp(0.0, 255.0)
            }))
        })
        .collect();
    Plane { scale, size, blocks }
}

impl Plane {
    /// Returns the coefficients of all texels, row by row.
    pub fn decoded(&self) -> Vec<f32> {
        let [width, height] = self.size;
        let mut out = vec![0.0; width * height];
        for (block, bytes) in self.blocks.iter().enumerate() {
            let (x, y) = (block % width.div_ceil(4) * 4, block / width.div_ceil(4) * 4);
            for (i, value) in decode_block(bytes).iter().enumerate() {
                let (x, y) = (x + i % 4, y + i / 4);
                if x < width && y < height {
                    out[y * width + x] = self.scale * (value - ZERO);
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_of_any_size_decode_to_what_they_were() {
        for size in [[8, 8], [9, 6], [2, 1], [1, 1]] {
            let [width, height] = size;
            let values: Vec<f32> =
                (0..width * height).map(|i| 0.3 * ((i % width) as f32 - 2.0) + 0.1 * (i / width) as f32).collect();
            let largest = values.iter().fold(0.0f32, |most, x| most.max(x.abs()));
            let decoded = encode_plane(&values, size, scale_of(largest)).decoded();
            let most = values.iter().zip(&decoded).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(most <= 0.11 * largest + 1e-6, "{size:?}: {most} of {largest}");
            let mut swapped = decoded.clone();
            swapped.reverse();
            let planted = values.iter().zip(&swapped).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(width * height < 3 || planted > 0.5 * largest, "{size:?}: {planted}");
        }
    }
}
