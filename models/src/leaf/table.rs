//! The file of an algorithmic leaf model's table, by which a viewer draws the model live.
//!
//! Little-endian: the eight bytes `LEAFTABL`; version 1, channels (1 or 3), rows, bytes of the model's name, as u32; the name in
//! UTF-8; chlorophyll and carotenoids of the model's own leaf in ug/cm2, as f32; for each row a wavelength in nm and the optical
//! depths of a straight crossing, for 1 ug/cm2 of chlorophyll, for 1 ug/cm2 of carotenoids, and of all else, as f32; for each face
//! and side the lengths of [`CLASSES`] classes of ways in straight crossings, as f32; and the cells, [`CLASSES`] half floats each.

use std::io::Read;
use std::path::Path;

use crate::error::ModelError;
use btf_capture::files;
use btf_capture::write_file_atomically;

/// Number of classes of ways through the tissue, the first of which is the surface.
pub const CLASSES: usize = 4;
/// Cells of a face, a side and a channel: incidences, classes of the eye's cosine, classes of the azimuth.
pub const TABLE_GRID: [usize; 3] = [20, 16, 12];

/// Number of those cells.
const CELLS: usize = TABLE_GRID[0] * TABLE_GRID[1] * TABLE_GRID[2];

/// First bytes of the file.
const MAGIC: [u8; 8] = *b"LEAFTABL";
/// Bytes before the name.
const HEAD: usize = 24;
/// Largest number of rows: every nanometre from 400 to 2500.
const MAX_ROWS: usize = 2101;
/// Longest name in bytes.
const MAX_NAME: usize = 64;
/// Largest file in bytes, with room to spare.
const MAX_BYTES: u64 = 1 << 20;
const REMEDY: &str = "make it again with `btf-synth scatter`";

/// Table of an algorithmic leaf model.
#[derive(Debug, Clone, PartialEq)]
pub struct LeafTable {
    /// Name of the model, such as `abm97`; at most 64 bytes.
    pub model: String,
    /// Chlorophyll and carotenoids of the model's own leaf, ug/cm2.
    pub own_pigments: [f32; 2],
    /// Wavelength in nm, and the optical depths of a straight crossing: for 1 ug/cm2 of chlorophyll, for 1 ug/cm2 of carotenoids,
    /// and of all else.
    pub rows: Vec<[f32; 4]>,
    /// Lengths of the ways of each class in straight crossings: for light on the adaxial face, on its side and on the other, then on
    /// the abaxial face.
    pub ways: [[f32; CLASSES]; 4],
    /// Values of `pi f` of each class as half floats: for light on the adaxial and the abaxial face, on its side and on the other,
    /// for one channel or each of three, by incidence, cosine and azimuth ([`TABLE_GRID`]).
    pub cells: Vec<[u16; CLASSES]>,
}

impl LeafTable {
    /// Reads a table.
    ///
    /// # Errors
    /// [`ModelError::Leaf`] for a file that cannot be read or is no such table.
    pub fn read(path: &Path) -> Result<LeafTable, ModelError> {
        let mut bytes = Vec::new();
        let read = files::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes));
        read.map_err(|error| ModelError::leaf(path, format!("cannot be read ({error})"), "name a file that can"))?;
        LeafTable::from_bytes(&bytes).map_err(|fault| ModelError::leaf(path, fault, REMEDY))
    }

    /// Writes a table, whole or not at all.
    ///
    /// # Errors
    /// [`ModelError::File`].
    pub fn write(&self, path: &Path) -> Result<(), ModelError> {
        Ok(write_file_atomically(path, &self.to_bytes())?)
    }

    /// Returns the number of channels: 1 or 3.
    pub fn channels(&self) -> usize {
        self.cells.len() / (4 * CELLS)
    }

    fn to_bytes(&self) -> Vec<u8> {
        let name = self.model.as_bytes();
        let mut bytes = MAGIC.to_vec();
        for number in [1, self.channels(), self.rows.len(), name.len()] {
            bytes.extend((number as u32).to_le_bytes());
        }
        bytes.extend(name);
        let floats = self.own_pigments.iter().chain(self.rows.iter().flatten()).chain(self.ways.iter().flatten());
        bytes.extend(floats.flat_map(|x| x.to_le_bytes()));
        bytes.extend(self.cells.iter().flatten().flat_map(|x| x.to_le_bytes()));
        bytes
    }

    fn from_bytes(bytes: &[u8]) -> Result<LeafTable, String> {
        let number = |i: usize| {
            let at = MAGIC.len() + 4 * i;
            bytes.get(at..at + 4).and_then(|four| four.try_into().ok()).map_or(0, u32::from_le_bytes) as usize
        };
        if bytes.get(..MAGIC.len()) != Some(&MAGIC) || bytes.len() < HEAD {
            return Err("is no table of a leaf model".to_owned());
        }
        let [version, channels, rows, name] = [0, 1, 2, 3].map(number);
        if version != 1 {
            return Err(format!(
                "has version {version} of the tables of leaf models, and this program reads version 1"
            ));
        }
        if !(channels == 1 || channels == 3) || rows > MAX_ROWS || name > MAX_NAME {
            return Err(format!("has {channels} channels, {rows} wavelengths and a name of {name} bytes"));
        }
        let cells = 4 * channels * CELLS;
        let numbers_at = HEAD + name;
        let cells_at = numbers_at + 4 * (2 + 4 * rows + 4 * CLASSES);
        if bytes.len() != cells_at + 2 * CLASSES * cells {
            return Err(format!("has {} bytes and should have {}", bytes.len(), cells_at + 2 * CLASSES * cells));
        }
        let model = String::from_utf8(bytes[HEAD..numbers_at].to_vec()).map_err(|_| "has a name that is no text")?;
        let floats: Vec<f32> =
            bytes[numbers_at..cells_at].chunks_exact(4).map(|x| f32::from_le_bytes([x[0], x[1], x[2], x[3]])).collect();
        if floats.iter().any(|x| !x.is_finite() || *x < 0.0) {
            return Err("has a number that is none".to_owned());
        }
        let (own, rest) = floats.split_at(2);
        let (row_numbers, ways) = rest.split_at(4 * rows);
        let halves = bytes[cells_at..].chunks_exact(2).map(|x| u16::from_le_bytes([x[0], x[1]]));
        let halves: Vec<u16> = halves.collect();
        Ok(LeafTable {
            model,
            own_pigments: [own[0], own[1]],
            rows: row_numbers.chunks_exact(4).map(|row| [row[0], row[1], row[2], row[3]]).collect(),
            ways: std::array::from_fn(|table| std::array::from_fn(|class| ways[CLASSES * table + class])),
            cells: halves.chunks_exact(CLASSES).map(|cell| [cell[0], cell[1], cell[2], cell[3]]).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(channels: usize) -> LeafTable {
        let cells = 4 * channels * CELLS;
        LeafTable {
            model: "abm97".to_owned(),
            own_pigments: [43.6, 0.0],
            rows: vec![[400.0, 0.1, 0.2, 0.0], [410.0, 0.2, 0.1, 0.3]],
            ways: [[0.0, 0.5, 1.5, 4.0], [0.0, 0.6, 1.6, 4.1], [0.0, 0.7, 1.7, 4.2], [0.0, 0.8, 1.8, 4.3]],
            cells: (0..cells).map(|i| [i as u16 & 0x3bff, 1, 2, 3]).collect(),
        }
    }

    #[test]
    fn a_table_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        for channels in [1, 3] {
            let path = folder.path().join("a.leaftable");
            table(channels).write(&path).unwrap();
            assert_eq!(LeafTable::read(&path).unwrap(), table(channels));
        }
    }

    #[test]
    fn what_is_no_table_is_told_in_a_sentence() {
        let whole = table(1).to_bytes();
        let fault = |bytes: &[u8]| LeafTable::from_bytes(bytes).unwrap_err();
        assert!(fault(b"").contains("no table") && fault(b"LEAFTABL").contains("no table"));
        assert!(fault(&whole[..whole.len() - 1]).contains("bytes and should have"));
        let with = |at: usize, byte: u8| {
            let mut bytes = whole.clone();
            bytes[at] = byte;
            bytes
        };
        assert!(fault(&with(8, 9)).contains("version 9"));
        assert!(fault(&with(12, 2)).contains("2 channels"));
        assert!(fault(&with(19, 255)).contains("wavelengths"));
        assert!(fault(&with(HEAD, 0xff)).contains("no text"));
        // The highest byte of a float: infinite, or not a number.
        assert!(fault(&[&whole[..HEAD + 5], &[0, 0, 0xc0, 0x7f], &whole[HEAD + 9..]].concat()).contains("is none"));
        let missing = LeafTable::read(Path::new("nowhere.leaftable")).unwrap_err().to_string();
        assert!(missing.contains("nowhere.leaftable cannot be read"), "{missing}");
    }
}
