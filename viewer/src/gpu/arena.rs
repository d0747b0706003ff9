//! All assets of a scene, and the picture that surrounds it, in the buffers that shaders read: one array of words, in
//! as many pieces as the adapter's largest binding asks for.

use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use crate::gpu::expand::{Expander, LayerBases, other_words};
use crate::gpu::pieces::{PieceLayout, Pieces};

/// Returns the words that are left free behind an asset of so many words, for edits: some sixteen of an asset of 240
/// lobes.
pub(crate) fn room_for_edits(words: usize) -> usize {
    (words / 8).min(1 << 16)
}

/// Assets begin at multiples of this many words, so that their sections stay aligned to 256 bytes.
const ALIGNMENT_WORDS: usize = 64;

/// Returns where arrays of so many `words` begin in pieces of at most `max_words`, and the pieces. An array that fits
/// into a piece lies in one, so that neighbouring reads go to the same buffer.
fn place(words: &[usize], max_words: usize) -> (Vec<u32>, PieceLayout, usize) {
    let piece = 1usize << max_words.max(1).ilog2();
    let mut at = 0usize;
    let mut bases = Vec::new();
    for words in words {
        at = at.next_multiple_of(ALIGNMENT_WORDS);
        if *words <= piece && at / piece != (at + words - 1) / piece {
            at = at.next_multiple_of(piece);
        }
        bases.push(at as u32);
        at += words;
    }
    // Shaders read quads of words.
    let at = at.next_multiple_of(4);
    // Where all fits into one piece none ends within, and the gaps that were left are harmless.
    (bases, PieceLayout::of(at, max_words), at)
}

/// One array of words to upload.
pub(crate) struct ArenaAsset<'a> {
    pub words: &'a [u32],
    /// The bases among the words that are expanded on the GPU in place of being uploaded.
    pub bases: &'a [LayerBases],
}

impl<'a> ArenaAsset<'a> {
    /// Returns all of `words`, to be uploaded as they are.
    pub(crate) fn whole(words: &'a [u32]) -> ArenaAsset<'a> {
        ArenaAsset { words, bases: &[] }
    }
}

/// The buffers.
pub(crate) struct Arena {
    pub pieces: Pieces,
    /// First word of each asset.
    pub bases: Vec<u32>,
    /// Words that each array may have.
    room: Vec<usize>,
}

impl Arena {
    /// Uploads the words of `assets`, with `room` for more behind an asset of so many words, and has their bases
    /// expanded where they lack them.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the adapter binds too few buffers for so many pieces, or has no memory for them.
    pub(crate) fn new(gpu: &Gpu, assets: &[ArenaAsset], room: fn(usize) -> usize) -> Result<Arena, ViewerError> {
        let max_bytes = gpu.max_binding_bytes();
        let max_buffers = gpu.max_pieces();
        let room: Vec<usize> = assets.iter().map(|asset| asset.words.len() + room(asset.words.len())).collect();
        let (bases, layout, total) = place(&room, (max_bytes / 4) as usize);
        if layout.pieces > max_buffers || total > u32::MAX as usize {
            return Err(gpu.error(format!(
                "the assets take {:.1} MiB and this adapter binds at most {:.1}; render with --backend cpu, or fit \
                 smaller assets (btf-fit fit --bytes)",
                total as f64 * 4.0 / f64::from(1 << 20),
                f64::from(max_buffers) * max_bytes as f64 / f64::from(1 << 20)
            )));
        }
        let buffers = (0..layout.pieces)
            .map(|piece| {
                let words = layout.range(piece, total).len();
                gpu.empty_buffer("assets", 4 * words as u64, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC)
            })
            .collect::<Result<Vec<_>, _>>()?;
        let arena = Arena { pieces: Pieces::of_buffers(gpu, layout, buffers, total), bases, room };
        let mut expander = None;
        for (number, asset) in assets.iter().enumerate() {
            for range in other_words(asset.words.len(), asset.bases) {
                arena.write(number, asset.words, range);
            }
            for layer in asset.bases {
                let expander = expander.get_or_insert_with(|| Expander::new(gpu));
                expander.expand(layer, arena.bases[number], &arena.pieces)?;
            }
        }
        Ok(arena)
    }

    /// Writes a `range` of an asset's words anew; `false` if the asset has outgrown its place.
    pub(crate) fn write(&self, asset: usize, words: &[u32], range: std::ops::Range<usize>) -> bool {
        if words.len() > self.room[asset] {
            return false;
        }
        self.pieces.write(self.bases[asset] as usize + range.start, &words[range]);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn assets_that_fit_into_a_piece_do_not_lie_across_two() {
        let (bases, layout, total) = place(&[700, 600, 5000, 100], 1100);
        // Pieces of 1024 words.
        assert_eq!((bases, layout, total), (vec![0, 1024, 1664, 6720], PieceLayout { pieces: 7, shift: 10 }, 6820));
        let (bases, layout, _) = place(&[700, 600], 2000);
        assert_eq!((bases, layout), (vec![0, 1024], PieceLayout::WHOLE));
        assert_eq!(place(&[], 2000).1, PieceLayout::WHOLE);
    }
}
