//! Reads BDI files, which hold all samples of a texel together, in half precision and without compression.

use half::f16;

use super::colour_model::ToRgb;
use super::header::{Cursor, Header, read_rotations};

/// Marker of a texel that is not in the file.
const ABSENT: u32 = u32::MAX;

/// Places of the samples of each texel.
#[derive(Debug)]
pub(super) struct Bdi {
    /// Index of each texel among those stored, or [`ABSENT`].
    stored: Vec<u32>,
    /// Offset of the samples of each chunk.
    chunks: Vec<usize>,
    texels_per_chunk: usize,
    /// Bytes of a texel: `[view, light, channel]`.
    texel_bytes: usize,
    lights: usize,
    channels: usize,
    to_rgb: ToRgb,
}

impl Bdi {
    /// Reads everything but the samples. Rotations are stored in `header`.
    pub(super) fn read(cursor: &mut Cursor, header: &mut Header, to_rgb: ToRgb) -> Result<Bdi, String> {
        const WHAT: &str = "its table of chunks";
        let lines = cursor.count(WHAT)?;
        let compression = cursor.u8(WHAT)?;
        let is_sparse = match compression {
            0 => false,
            2 => true,
            1 => return Err("its samples are packed by bzip2, which is not read; save it unpacked".into()),
            other => return Err(format!("its kind of compression is {other}; 0 and 2 are read")),
        };
        if lines == 0 {
            return Err("its chunks have no scanlines".into());
        }
        let mask = cursor.take(header.texel_count(), "its mask")?;
        let mut count = 0u32;
        let stored = mask.iter().map(|&there| {
            if is_sparse && there == 0 {
                return ABSENT;
            }
            count += 1;
            count - 1
        });
        let stored: Vec<u32> = stored.collect();
        let (lights, channels) = (header.lights.in_file.len(), header.channels.len());
        let too_large = || "its texels have more samples than can be counted".to_string();
        let texel_bytes =
            header.pair_count().checked_mul(channels).and_then(|n| n.checked_mul(2)).ok_or_else(too_large)?;
        let texels_per_chunk = lines.checked_mul(header.width).ok_or_else(too_large)?;
        let chunks = |cursor: Cursor| read_chunks(cursor, count as usize, texels_per_chunk, texel_bytes);

        // The rotations' count is there by the published reader; files without it are known by their length.
        let mut behind = cursor.clone();
        let with_rotations = read_rotations(&mut behind).and_then(|found| Ok((found, chunks(behind)?)));
        let (rotations, chunks) = match with_rotations {
            Ok(found) => found,
            Err(reason) => (Vec::new(), chunks(cursor.clone()).map_err(|_| reason)?),
        };
        header.rotations = rotations;
        Ok(Bdi { stored, chunks, texels_per_chunk, texel_bytes, lights, channels, to_rgb })
    }

    /// Returns linear sRGB, `[light, texel, channel]`, of the view `view` of the file under its lights `lights`. Texels
    /// that the file lacks are black.
    pub(super) fn images(&self, bytes: &[u8], view: usize, lights: &[usize]) -> Vec<f32> {
        let texels = self.stored.len();
        let mut images = vec![0f32; lights.len() * texels * 3];
        let mut sample = vec![0f32; self.channels];
        for (texel, &stored) in self.stored.iter().enumerate() {
            if stored == ABSENT {
                continue;
            }
            let stored = stored as usize;
            let chunk = self.chunks[stored / self.texels_per_chunk];
            let start =
                chunk + stored % self.texels_per_chunk * self.texel_bytes + view * self.lights * self.channels * 2;
            for (i, &light) in lights.iter().enumerate() {
                let at = start + light * self.channels * 2;
                let halves = bytes[at..at + self.channels * 2].chunks_exact(2);
                sample.iter_mut().zip(halves).for_each(|(value, b)| *value = f16::from_le_bytes([b[0], b[1]]).to_f32());
                let to = (i * texels + texel) * 3;
                images[to..to + 3].copy_from_slice(&self.to_rgb.rgb(&mut sample));
            }
        }
        images
    }
}

/// Returns the offsets of the samples of each chunk. The last chunk may be filled up to the size of the others.
fn read_chunks(
    mut cursor: Cursor,
    stored: usize,
    texels_per_chunk: usize,
    texel_bytes: usize,
) -> Result<Vec<usize>, String> {
    let mut chunks = Vec::new();
    let mut left = stored;
    while left > 0 {
        let here = left.min(texels_per_chunk);
        let what = format!("its chunk {}", chunks.len());
        let size = cursor.count(&what)?;
        let needed = here.checked_mul(texel_bytes);
        if Some(size) != needed && Some(size) != texels_per_chunk.checked_mul(texel_bytes) {
            return Err(format!("{what} claims {size} bytes for {here} texels of {texel_bytes} bytes"));
        }
        chunks.push(cursor.at);
        cursor.take(size, &what)?;
        left -= here;
    }
    cursor.expect_end()?;
    Ok(chunks)
}
