//! Results of a fit's stages as bytes and back, so that a later run can go on from them: little-endian numbers, counts
//! before lists, fields in a fixed order. The bytes are for the same program on the same kind of machine only;
//! `checkpoint.rs` sees to that.

use btf_runtime::{DictionaryLobe, Lobe, LobeFamily, LobeRef};
use ndarray::Array2;
use std::io::{Error, ErrorKind, Read, Result, Write};

/// A known number of bytes to read values from. No count in them makes a reader allocate more.
pub struct Input<'a> {
    /// Source of the bytes.
    pub from: &'a mut dyn Read,
    /// Bytes that are left.
    pub left: u64,
}

impl Input<'_> {
    fn array<const N: usize>(&mut self) -> Result<[u8; N]> {
        let mut bytes = [0; N];
        self.from.read_exact(&mut bytes)?;
        self.left = self.left.checked_sub(N as u64).ok_or(ErrorKind::UnexpectedEof)?;
        Ok(bytes)
    }

    /// Reads a count of things that take at least a byte each.
    fn count(&mut self) -> Result<usize> {
        let count = usize::take(self)?;
        if count as u64 > self.left { Err(ErrorKind::UnexpectedEof.into()) } else { Ok(count) }
    }
}

/// A value that can be kept as bytes.
pub trait Stored: Sized {
    /// Writes the value.
    fn put(&self, to: &mut dyn Write) -> Result<()>;
    /// Reads a value that [`Stored::put`] wrote.
    fn take(from: &mut Input) -> Result<Self>;
}

macro_rules! stored_numbers {
    ($($number:ty)*) => {$(
        impl Stored for $number {
            fn put(&self, to: &mut dyn Write) -> Result<()> {
                to.write_all(&self.to_le_bytes())
            }

            fn take(from: &mut Input) -> Result<$number> {
                from.array().map(<$number>::from_le_bytes)
            }
        }
    )*};
}

stored_numbers!(u8 i16 u32 u64 f32 f64);

impl Stored for usize {
    fn put(&self, to: &mut dyn Write) -> Result<()> {
        (*self as u64).put(to)
    }

    fn take(from: &mut Input) -> Result<usize> {
        usize::try_from(u64::take(from)?).map_err(Error::other)
    }
}

impl Stored for bool {
    fn put(&self, to: &mut dyn Write) -> Result<()> {
        u8::from(*self).put(to)
    }

    fn take(from: &mut Input) -> Result<bool> {
        Ok(u8::take(from)? != 0)
    }
}

impl<T: Stored> Stored for Vec<T> {
    fn put(&self, to: &mut dyn Write) -> Result<()> {
        self.len().put(to)?;
        self.iter().try_for_each(|item| item.put(to))
    }

    fn take(from: &mut Input) -> Result<Vec<T>> {
        let count = from.count()?;
        let room = from.left as usize / size_of::<T>().max(1);
        let mut items = Vec::with_capacity(count.min(room));
        for _ in 0..count {
            items.push(T::take(from)?);
        }
        Ok(items)
    }
}

impl<T: Stored, const N: usize> Stored for [T; N] {
    fn put(&self, to: &mut dyn Write) -> Result<()> {
        self.iter().try_for_each(|item| item.put(to))
    }

    fn take(from: &mut Input) -> Result<[T; N]> {
        let items: Vec<T> = (0..N).map(|_| T::take(from)).collect::<Result<_>>()?;
        items.try_into().map_err(|_| ErrorKind::UnexpectedEof.into())
    }
}

impl<T: Stored> Stored for Option<T> {
    fn put(&self, to: &mut dyn Write) -> Result<()> {
        self.is_some().put(to)?;
        self.iter().try_for_each(|item| item.put(to))
    }

    fn take(from: &mut Input) -> Result<Option<T>> {
        if bool::take(from)? { T::take(from).map(Some) } else { Ok(None) }
    }
}

impl<A: Stored, B: Stored> Stored for (A, B) {
    fn put(&self, to: &mut dyn Write) -> Result<()> {
        self.0.put(to)?;
        self.1.put(to)
    }

    fn take(from: &mut Input) -> Result<(A, B)> {
        Ok((A::take(from)?, B::take(from)?))
    }
}

impl<T: Stored + Clone> Stored for Array2<T> {
    fn put(&self, to: &mut dyn Write) -> Result<()> {
        self.nrows().put(to)?;
        self.ncols().put(to)?;
        self.iter().try_for_each(|item| item.put(to))
    }

    fn take(from: &mut Input) -> Result<Array2<T>> {
        let (rows, columns) = (usize::take(from)?, usize::take(from)?);
        let count = rows.checked_mul(columns).filter(|count| *count as u64 <= from.left);
        let count = count.ok_or(ErrorKind::UnexpectedEof)?;
        let mut items = Vec::with_capacity(count.min(from.left as usize / size_of::<T>().max(1)));
        for _ in 0..count {
            items.push(T::take(from)?);
        }
        Array2::from_shape_vec((rows, columns), items).map_err(Error::other)
    }
}

impl Stored for LobeFamily {
    fn put(&self, to: &mut dyn Write) -> Result<()> {
        (*self as u32).put(to)
    }

    fn take(from: &mut Input) -> Result<LobeFamily> {
        LobeFamily::from_number(u32::take(from)?).ok_or_else(|| ErrorKind::InvalidData.into())
    }
}

/// Implements [`Stored`] for structs, field by field in the order given: `stored_structs! { Name { field, other } }`
/// stands beside each type. A field that is left out does not compile.
macro_rules! stored_structs {
    ($($name:ident { $($field:ident),* $(,)? })*) => {$(
        impl $crate::resume::stored::Stored for $name {
            fn put(&self, to: &mut dyn std::io::Write) -> std::io::Result<()> {
                $($crate::resume::stored::Stored::put(&self.$field, to)?;)*
                Ok(())
            }

            fn take(from: &mut $crate::resume::stored::Input) -> std::io::Result<$name> {
                Ok($name { $($field: $crate::resume::stored::Stored::take(from)?),* })
            }
        }
    )*};
}
pub(crate) use stored_structs;

stored_structs! {
    Lobe { family, normal_xy, tangent_rad, params }
    DictionaryLobe { lobe, weight_scale }
    LobeRef { lobe, weight }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::sparse::Selection;

    fn bytes_of(value: &impl Stored) -> Vec<u8> {
        let mut bytes = Vec::new();
        value.put(&mut bytes).unwrap();
        bytes
    }

    fn value_of<T: Stored>(bytes: &[u8]) -> Result<T> {
        T::take(&mut Input { left: bytes.len() as u64, from: &mut &bytes[..] })
    }

    #[test]
    fn values_come_back_to_the_last_bit() {
        let lobe =
            Lobe { family: LobeFamily::Ggx, normal_xy: [0.1, -0.0], tangent_rad: -1.5, params: [0.3, 1e-40, 7.0, 0.0] };
        let selection = Selection {
            counts: vec![1, 0],
            refs: vec![LobeRef { lobe: 3, weight: [1, 2, 255] }],
            first: vec![0, 1],
            dictionary: vec![vec![DictionaryLobe { lobe, weight_scale: 0.25 }], Vec::new()],
            mean_relative_error: 0.1 + 0.2,
        };
        let back: Selection = value_of(&bytes_of(&selection)).unwrap();
        assert_eq!((back.counts, back.refs, back.first), (selection.counts, selection.refs, selection.first));
        assert_eq!(back.dictionary, selection.dictionary);
        assert_eq!(back.mean_relative_error.to_bits(), selection.mean_relative_error.to_bits());
        let array = Array2::from_shape_fn((3, 5), |(i, j)| (i as f32 - 1.0) / (j as f32));
        let nested = (vec![Some(array), None], vec![f64::INFINITY]);
        let back: (Vec<Option<Array2<f32>>>, Vec<f64>) = value_of(&bytes_of(&nested)).unwrap();
        assert_eq!(bytes_of(&back), bytes_of(&nested));
    }

    #[test]
    fn every_prefix_is_refused_and_a_huge_count_allocates_nothing() {
        let bytes = bytes_of(&vec![vec![1.0f32, 2.0], vec![3.0]]);
        for end in 0..bytes.len() {
            assert!(value_of::<Vec<Vec<f32>>>(&bytes[..end]).is_err(), "{end}");
        }
        let huge = bytes_of(&(u64::MAX, u64::MAX));
        assert!(value_of::<Vec<u8>>(&huge).is_err());
        assert!(value_of::<Array2<f32>>(&huge).is_err());
    }
}
