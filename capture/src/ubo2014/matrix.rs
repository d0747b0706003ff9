//! Reads matrices that stay in the file, row after row in half, single or double precision.

use half::f16;
use half::slice::HalfFloatSliceExt;

use super::header::Cursor;

/// Precision of a matrix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    Half,
    Single,
    Double,
}

impl Scalar {
    pub(super) fn read(cursor: &mut Cursor) -> Result<Scalar, String> {
        match cursor.u8("its size of a number")? {
            2 => Ok(Scalar::Half),
            4 => Ok(Scalar::Single),
            8 => Ok(Scalar::Double),
            other => Err(format!("its numbers have {other} bytes; 2, 4 and 8 are read")),
        }
    }

    pub(super) fn bytes(self) -> usize {
        match self {
            Scalar::Half => 2,
            Scalar::Single => 4,
            Scalar::Double => 8,
        }
    }
}

/// Matrix in the bytes of a file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Matrix {
    at: usize,
    /// Number of values per row in the file.
    pub(super) columns: usize,
    scalar: Scalar,
}

impl Matrix {
    /// Returns the matrix at `cursor` and moves past its data.
    pub(super) fn skip(
        cursor: &mut Cursor,
        rows: usize,
        columns: usize,
        scalar: Scalar,
        what: &str,
    ) -> Result<Matrix, String> {
        let at = cursor.at;
        let count = rows.checked_mul(columns).ok_or_else(|| format!("{what} would have {rows} x {columns} numbers"))?;
        cursor.take_many(count, scalar.bytes(), what)?;
        Ok(Matrix { at, columns, scalar })
    }

    /// Appends the first `used` numbers of row `row` to `out`.
    pub(super) fn push_row(&self, bytes: &[u8], row: usize, used: usize, out: &mut Vec<f32>) {
        if used == self.columns {
            return self.push_rows(bytes, row, 1, out);
        }
        let start = out.len();
        self.push_rows(bytes, row, 1, out);
        out.truncate(start + used);
    }

    /// Appends `count` whole rows from row `first` on to `out`.
    pub(super) fn push_rows(&self, bytes: &[u8], first: usize, count: usize, out: &mut Vec<f32>) {
        let size = self.scalar.bytes();
        let (start, numbers) = (self.at + first * self.columns * size, count * self.columns);
        push_numbers(&bytes[start..start + numbers * size], self.scalar, out);
    }
}

/// Appends all numbers in `bytes`, little endian, to `out`.
pub(super) fn push_numbers(bytes: &[u8], scalar: Scalar, out: &mut Vec<f32>) {
    match scalar {
        Scalar::Half => {
            // In pieces that stay in the cache: the file's bytes need not be aligned.
            const PIECE: usize = 2048;
            let mut halves = [f16::ZERO; PIECE];
            for piece in bytes.chunks(2 * PIECE) {
                let halves = &mut halves[..piece.len() / 2];
                for (half, bytes) in halves.iter_mut().zip(piece.chunks_exact(2)) {
                    *half = f16::from_le_bytes([bytes[0], bytes[1]]);
                }
                let start = out.len();
                out.resize(start + halves.len(), 0.0);
                halves.convert_to_f32_slice(&mut out[start..]);
            }
        }
        Scalar::Single => {
            out.extend(bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])));
        }
        Scalar::Double => out.extend(
            bytes.chunks_exact(8).map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]) as f32),
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_read_in_every_precision_at_any_alignment() {
        let numbers: Vec<f32> = (0..5 * 3000).map(|i| i as f32 * 0.25 - 900.0).collect();
        for (scalar, lead) in [(Scalar::Half, 1), (Scalar::Single, 3), (Scalar::Double, 5)] {
            let mut bytes = vec![0xAA; lead];
            for &number in &numbers {
                match scalar {
                    Scalar::Half => bytes.extend(f16::from_f32(number).to_le_bytes()),
                    Scalar::Single => bytes.extend(number.to_le_bytes()),
                    Scalar::Double => bytes.extend(f64::from(number).to_le_bytes()),
                }
            }
            let mut cursor = Cursor::new(&bytes);
            cursor.at = lead;
            let matrix = Matrix::skip(&mut cursor, 5, 3000, scalar, "a matrix").unwrap();
            assert!(cursor.expect_end().is_ok());
            let mut rows = vec![7.0];
            matrix.push_rows(&bytes, 1, 3, &mut rows);
            let expected = |range: std::ops::Range<usize>| -> Vec<f32> {
                let round =
                    |&number: &f32| if scalar == Scalar::Half { f16::from_f32(number).to_f32() } else { number };
                numbers[range].iter().map(round).collect()
            };
            assert_eq!(rows[1..], expected(3000..12000));
            let mut part = Vec::new();
            matrix.push_row(&bytes, 4, 10, &mut part);
            assert_eq!(part, expected(12000..12010));
        }
    }

    #[test]
    fn a_matrix_beyond_the_file_or_beyond_counting_is_refused() {
        let bytes = [0; 64];
        for (rows, columns) in [(5, 4), (usize::MAX, 2), (1 << 62, 1 << 3)] {
            assert!(Matrix::skip(&mut Cursor::new(&bytes), rows, columns, Scalar::Single, "it").is_err());
        }
        assert!(Matrix::skip(&mut Cursor::new(&bytes), 4, 4, Scalar::Single, "it").is_ok());
    }
}
