//! Checks accessors of a glTF file before their elements are read, because the readers of the `gltf` crate do not.

use super::model::fault;
use crate::error::ModelError;
use gltf::accessor::sparse::IndexType;
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::{Data, View};
use gltf::{Accessor, Gltf};
use std::path::Path;

/// Elements that may be read per byte of the buffers. Parts may share vertices, and each gets a copy; without a limit a
/// file of some kilobytes could ask for any amount of memory.
const MAX_ELEMENTS_PER_BYTE: usize = 64;

/// Checker of the accessors of one file, with the number of elements that may still be read.
pub(super) struct Accessors<'a> {
    path: &'a Path,
    pub buffers: &'a [Data],
    left: usize,
}

impl<'a> Accessors<'a> {
    /// Checks that every accessor of the file lies within its buffers.
    pub fn new(path: &'a Path, gltf: &Gltf, buffers: &'a [Data]) -> Result<Accessors<'a>, ModelError> {
        for accessor in gltf.accessors() {
            accessor_fault(&accessor, buffers).map_or(Ok(()), |reason| {
                Err(fault(path, format!("accessor {} {reason}, export it again", accessor.index())))
            })?;
        }
        let bytes: usize = buffers.iter().map(|buffer| buffer.len()).sum();
        Ok(Accessors { path, buffers, left: bytes.saturating_mul(MAX_ELEMENTS_PER_BYTE) })
    }

    /// Checks that the elements of `accessor` have the type that their use asks for, and counts them as read. `what`
    /// names them in messages.
    pub fn take(
        &mut self,
        accessor: &Accessor,
        types: &[DataType],
        dimensions: Dimensions,
        what: &str,
    ) -> Result<(), ModelError> {
        let wrong = |reason: &str| fault(self.path, format!("accessor {} {reason}, export it again", accessor.index()));
        if accessor.dimensions() != dimensions || !types.contains(&accessor.data_type()) {
            return Err(wrong(&format!("has {what} in a type that glTF does not allow for them")));
        }
        if accessor.count() == 0 {
            return Err(wrong(&format!("has no {what}")));
        }
        match self.left.checked_sub(accessor.count()) {
            Some(left) => self.left = left,
            None => return Err(wrong(&format!("has more {what} than its file has data for"))),
        }
        Ok(())
    }

    /// Returns the bytes of a buffer, as the crate's readers ask for them.
    pub fn bytes(&self, buffer: &gltf::Buffer) -> Option<&'a [u8]> {
        self.buffers.get(buffer.index()).map(|data| data.0.as_slice())
    }
}

/// Returns the fault of the place of an accessor's elements as a verb phrase.
fn accessor_fault(accessor: &Accessor, buffers: &[Data]) -> Option<&'static str> {
    const BEYOND: &str = "reaches beyond its buffer";
    let size = accessor.size();
    if accessor.count() > u32::MAX as usize {
        return Some("has more elements than 32 bits count");
    }
    if let Some(view) = accessor.view() {
        if view.stride().is_some_and(|stride| stride < size) {
            return Some("has elements that lie in each other");
        }
        if !fits(&view, accessor.offset(), accessor.count(), size, buffers) {
            return Some(BEYOND);
        }
    }
    let sparse = accessor.sparse()?;
    let (indices, values, count) = (sparse.indices(), sparse.values(), sparse.count());
    let index_size = match indices.index_type() {
        IndexType::U8 => 1,
        IndexType::U16 => 2,
        IndexType::U32 => 4,
    };
    if count == 0 || count > accessor.count() {
        return Some("replaces no elements or more than it has");
    }
    let is_wide = |view: &View, size: usize| view.stride().is_none_or(|stride| stride >= size);
    if !is_wide(&indices.view(), index_size) || !is_wide(&values.view(), size) {
        return Some("has elements that lie in each other");
    }
    let within = fits(&indices.view(), indices.offset(), count, index_size, buffers)
        && fits(&values.view(), values.offset(), count, size, buffers);
    (!within).then_some(BEYOND)
}

/// Returns whether `count` elements of `size` bytes from `offset` on lie within the buffer view, and the view within
/// its buffer.
fn fits(view: &View, offset: usize, count: usize, size: usize, buffers: &[Data]) -> bool {
    let stride = view.stride().unwrap_or(size);
    let span =
        count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size)?.checked_add(offset));
    let end = view.offset().checked_add(view.length());
    span.is_some_and(|span| span <= view.length())
        && end.is_some_and(|end| buffers.get(view.buffer().index()).is_some_and(|buffer| end <= buffer.len()))
}
