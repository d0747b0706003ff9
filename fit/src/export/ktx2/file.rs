//! A KTX 2.0 file (Khronos Texture, version 2.0 of the specification): header, index, data format descriptor, key/value
//! data, mip levels. As much of it as two-dimensional textures and arrays need.

/// Format of the texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ktx2Format {
    /// `VK_FORMAT_R8_UINT`.
    R8Uint,
    /// `VK_FORMAT_R16G16B16A16_SFLOAT`.
    Rgba16Float,
    /// `VK_FORMAT_R32G32B32A32_SFLOAT`.
    Rgba32Float,
    /// `VK_FORMAT_BC5_UNORM_BLOCK`.
    Bc5,
    /// `VK_FORMAT_BC7_UNORM_BLOCK`.
    Bc7,
}

/// A channel in the data format descriptor.
struct Channel {
    number: u32,
    /// First bit in a block, and bits.
    bits: [u32; 2],
    /// Numbers that stand for 0 (or -1) and 1.
    range: [u32; 2],
}

impl Ktx2Format {
    /// Returns the number of the format in Vulkan (`VkFormat`).
    pub fn vulkan(self) -> u32 {
        match self {
            Ktx2Format::R8Uint => 13,
            Ktx2Format::Rgba16Float => 97,
            Ktx2Format::Rgba32Float => 109,
            Ktx2Format::Bc5 => 141,
            Ktx2Format::Bc7 => 145,
        }
    }

    /// Returns the number of the format's colour model in the data format descriptor.
    fn model(self) -> u32 {
        match self {
            Ktx2Format::R8Uint | Ktx2Format::Rgba16Float | Ktx2Format::Rgba32Float => 1,
            Ktx2Format::Bc5 => 132,
            Ktx2Format::Bc7 => 134,
        }
    }

    /// Returns the texels of a block's side.
    pub fn block_side(self) -> usize {
        match self {
            Ktx2Format::R8Uint | Ktx2Format::Rgba16Float | Ktx2Format::Rgba32Float => 1,
            Ktx2Format::Bc5 | Ktx2Format::Bc7 => 4,
        }
    }

    /// Returns the bytes of a block, which is a texel where the format does not compress.
    pub fn block_bytes(self) -> usize {
        match self {
            Ktx2Format::R8Uint => 1,
            Ktx2Format::Rgba16Float => 8,
            Ktx2Format::Rgba32Float | Ktx2Format::Bc5 | Ktx2Format::Bc7 => 16,
        }
    }

    /// Returns the bytes of a number, for machines that store its bytes in another order; 1 for blocks.
    fn type_bytes(self) -> u32 {
        match self {
            Ktx2Format::R8Uint | Ktx2Format::Bc5 | Ktx2Format::Bc7 => 1,
            Ktx2Format::Rgba16Float => 2,
            Ktx2Format::Rgba32Float => 4,
        }
    }

    /// Returns the channels of the data format descriptor.
    fn channels(self) -> Vec<Channel> {
        let floats = |bits: u32| {
            // Alpha has number 15; signed floating-point numbers have these qualifiers.
            let channel = |(number, i): (u32, u32)| Channel {
                number: number | (SIGNED_FLOAT << 4),
                bits: [i * bits, bits],
                range: [(-1f32).to_bits(), 1f32.to_bits()],
            };
            [0, 1, 2, 15].into_iter().zip(0..).map(channel).collect()
        };
        let block = |number: u32, bits: [u32; 2]| Channel { number, bits, range: [0, u32::MAX] };
        match self {
            Ktx2Format::R8Uint => vec![Channel { number: 0, bits: [0, 8], range: [0, 1] }],
            Ktx2Format::Rgba16Float => floats(16),
            Ktx2Format::Rgba32Float => floats(32),
            Ktx2Format::Bc5 => vec![block(0, [0, 64]), block(1, [64, 64])],
            Ktx2Format::Bc7 => vec![block(0, [0, 128])],
        }
    }
}

/// A two-dimensional texture or array of them, with its mip levels.
#[derive(Debug, Clone, PartialEq)]
pub struct Ktx2Array {
    /// Format of the texels.
    pub format: Ktx2Format,
    /// Texels a row of the finest level.
    pub width: usize,
    /// Rows of the finest level.
    pub height: usize,
    /// Number of layers of an array; 0 for a single texture.
    pub layers: usize,
    /// Blocks `[layer, row, column]` of each level, the finest first; sides halve from level to level. Blocks that stand
    /// over the edge count in whole.
    pub levels: Vec<Vec<u8>>,
    /// Key and value, UTF-8; `KTXwriter` is added.
    pub notes: Vec<(String, String)>,
}

/// First bytes of every file.
const IDENTIFIER: [u8; 12] = [0xAB, b'K', b'T', b'X', b' ', b'2', b'0', 0xBB, b'\r', b'\n', 0x1A, b'\n'];
/// Bytes of identifier, header and index before the levels' places.
const HEAD_BYTES: usize = 80;
/// Bytes of a level's entry in the index.
const LEVEL_BYTES: usize = 24;
/// Number of the linear transfer function in the data format descriptor.
const LINEAR_TRANSFER: u32 = 1;
/// Qualifiers of a sample: a signed floating-point number.
const SIGNED_FLOAT: u32 = 0xC;

impl Ktx2Array {
    /// Returns the bytes that the texture takes in memory.
    pub fn memory_bytes(&self) -> usize {
        self.levels.iter().map(Vec::len).sum()
    }

    /// Returns the bytes of the file. Equal arrays give equal bytes.
    ///
    /// # Panics
    /// If a level has not the bytes that its size asks for.
    pub fn file(&self) -> Vec<u8> {
        let side = |side: usize, level: usize| (side >> level).max(1).div_ceil(self.format.block_side());
        for (level, bytes) in self.levels.iter().enumerate() {
            let blocks = side(self.width, level) * side(self.height, level) * self.layers.max(1);
            assert_eq!(bytes.len(), blocks * self.format.block_bytes(), "level {level}");
        }
        let descriptor = self.descriptor();
        let notes = self.key_values();
        let descriptor_at = HEAD_BYTES + LEVEL_BYTES * self.levels.len();
        let notes_at = descriptor_at + descriptor.len();
        let mut end = notes_at + notes.len();
        // The smallest level comes first.
        let alignment = self.format.block_bytes().next_multiple_of(4);
        let mut places = vec![0; self.levels.len()];
        for (place, bytes) in places.iter_mut().zip(&self.levels).rev() {
            *place = end.next_multiple_of(alignment);
            end = *place + bytes.len();
        }

        let mut out = IDENTIFIER.to_vec();
        let [width, height, layers, levels] =
            [self.width, self.height, self.layers, self.levels.len()].map(|x| x as u32);
        let (format, type_size, depth, faces, scheme) = (self.format.vulkan(), self.format.type_bytes(), 0, 1, 0);
        push_words(&mut out, &[format, type_size, width, height, depth, layers, faces, levels, scheme]);
        push_words(&mut out, &[descriptor_at, descriptor.len(), notes_at, notes.len()].map(|x| x as u32));
        // Place and length of global data of a supercompression scheme.
        out.extend([0; 16]);
        for (place, bytes) in places.iter().zip(&self.levels) {
            out.extend([*place, bytes.len(), bytes.len()].map(|x| (x as u64).to_le_bytes()).as_flattened());
        }
        out.extend(descriptor);
        out.extend(notes);
        for (place, bytes) in places.iter().zip(&self.levels).rev() {
            out.resize(*place, 0);
            out.extend(bytes);
        }
        out
    }

    /// Returns the data format descriptor: its length and one basic block.
    fn descriptor(&self) -> Vec<u8> {
        let channels = self.format.channels();
        let block_bytes = 24 + 16 * channels.len() as u32;
        let side = self.format.block_side() as u32 - 1;
        // Version 2 of the descriptor; colours without primaries, whose bytes lie in one plane.
        let mut words = vec![4 + block_bytes, 0, 2 | (block_bytes << 16)];
        words.extend([self.format.model() | (LINEAR_TRANSFER << 16), side | (side << 8)]);
        words.extend([self.format.block_bytes() as u32, 0]);
        for Channel { number, bits: [first, count], range: [lower, upper] } in channels {
            words.extend([first | ((count - 1) << 16) | (number << 24), 0, lower, upper]);
        }
        let mut out = Vec::new();
        push_words(&mut out, &words);
        out
    }

    /// Returns the key/value data: keys ascending, each entry padded to whole words.
    fn key_values(&self) -> Vec<u8> {
        let mut notes = self.notes.clone();
        notes.push(("KTXwriter".into(), concat!("btf-fit ", env!("CARGO_PKG_VERSION")).into()));
        notes.sort();
        let mut out = Vec::new();
        for (key, value) in notes {
            push_words(&mut out, &[(key.len() + value.len() + 2) as u32]);
            out.extend(format!("{key}\0{value}\0").bytes());
            out.resize(out.len().next_multiple_of(4), 0);
        }
        out
    }
}

fn push_words(out: &mut Vec<u8>, words: &[u32]) {
    words.iter().for_each(|word| out.extend(word.to_le_bytes()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_array_lies_where_the_specification_says() {
        let levels = vec![(0..12).collect(), vec![20, 21]];
        let notes = vec![("a".to_string(), "b".to_string())];
        let array = Ktx2Array { format: Ktx2Format::R8Uint, width: 3, height: 2, layers: 2, levels, notes };
        let file = array.file();
        let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap());
        let long = |at: usize| u64::from_le_bytes(file[at..at + 8].try_into().unwrap()) as usize;
        assert_eq!(&file[..12], b"\xabKTX 20\xbb\r\n\x1a\n");
        assert_eq!([12, 16, 20, 24, 28, 32, 36, 40, 44].map(word), [13, 1, 3, 2, 0, 2, 1, 2, 0]);
        let [descriptor_at, descriptor_bytes, notes_at, notes_bytes] = [48, 52, 56, 60].map(|at| word(at) as usize);
        assert_eq!((descriptor_at, word(descriptor_at) as usize), (80 + 48, descriptor_bytes));
        assert_eq!(notes_at, descriptor_at + descriptor_bytes);
        // One sample: 8 bits from bit 0 on, the red channel.
        assert_eq!(word(descriptor_at + 28), 7 << 16);
        assert_eq!(&file[notes_at + 4..notes_at + 16], b"KTXwriter\0bt");
        assert!(file[notes_at..notes_at + notes_bytes].ends_with(b"\x04\0\0\0a\0b\0"));
        let places = [0, 1].map(|level| [0, 8, 16].map(|part| long(80 + 24 * level + part)));
        assert_eq!((places[0][1], places[0][2], places[1][1]), (12, 12, 2));
        assert!(places[1][0] < places[0][0] && places.iter().all(|place| place[0].is_multiple_of(4)));
        assert_eq!((&file[places[0][0]..], &file[places[1][0]..][..2]), (&array.levels[0][..], &[20, 21][..]));
    }

    #[test]
    #[should_panic(expected = "level 1")]
    fn a_level_of_another_size_is_a_mistake_of_the_caller() {
        let levels = vec![vec![0; 12], vec![0; 3]];
        let notes = Vec::new();
        Ktx2Array { format: Ktx2Format::R8Uint, width: 3, height: 2, layers: 2, levels, notes }.file();
    }
}
