//! An array in as many storage buffers as the adapter's largest binding asks for, and the WGSL that reads it.

use crate::error::ViewerError;
use crate::gpu::device::Gpu;
use std::fmt::Write;

/// The cut of an array: all pieces hold 2^shift elements, but for the last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PieceLayout {
    /// Pieces, at least 1.
    pub pieces: u32,
    /// Binary logarithm of a piece's elements.
    pub shift: u32,
}

impl PieceLayout {
    /// Everything in one piece: as many elements as a word can number.
    pub const WHOLE: PieceLayout = PieceLayout { pieces: 1, shift: 32 };

    /// Cuts `count` elements into bindings of at most `most` elements.
    pub(crate) fn of(count: usize, most: usize) -> PieceLayout {
        if count <= most {
            return PieceLayout::WHOLE;
        }
        let shift = most.max(1).ilog2();
        PieceLayout { pieces: count.div_ceil(1 << shift) as u32, shift }
    }

    /// Returns the elements of piece `piece` of `count`.
    pub(crate) fn range(self, piece: u32, count: usize) -> std::ops::Range<usize> {
        if self.pieces == 1 {
            return 0..count;
        }
        let first = (piece as usize) << self.shift;
        first..((piece as usize + 1) << self.shift).min(count)
    }

    /// Declares the pieces of `array<ty>` in `group` at `binding` and the next ones, and the array's readers.
    pub(crate) fn wgsl(self, array: &PieceArray) -> String {
        let PieceArray { group, name, ty, .. } = array;
        let mut text = String::new();
        for (piece, binding) in self.bindings(array).enumerate() {
            let _ =
                writeln!(text, "@group({group}) @binding({binding}) var<storage, read> {name}_{piece}: array<{ty}>;");
        }
        for Reader { name: reader, read, result, shift } in array.readers {
            let _ = writeln!(text, "\nfn {reader}(index: u32) -> {result} {{");
            let of = |piece: u32, at: &str| format!("{name}_{piece}{}", read.replace("AT", at));
            if self.pieces == 1 {
                let _ = writeln!(text, "    return {};\n}}", of(0, "index"));
                continue;
            }
            let shift = self.shift - shift;
            let mask = (1u32 << shift) - 1;
            let _ = writeln!(text, "    let at = index & {mask}u;\n    switch index >> {shift}u {{");
            for piece in 1..self.pieces {
                let _ = writeln!(text, "        case {piece}u: {{ return {}; }}", of(piece, "at"));
            }
            let _ = writeln!(text, "        default: {{ return {}; }}\n    }}\n}}", of(0, "at"));
        }
        text
    }

    /// Returns the bindings of the pieces, in order.
    pub(crate) fn bindings(self, array: &PieceArray) -> impl Iterator<Item = u32> {
        let first = array.binding;
        (0..self.pieces).map(move |piece| first + piece)
    }
}

/// An array of a shader that may lie in pieces.
pub(crate) struct PieceArray {
    pub group: u32,
    /// Binding of the first piece.
    pub binding: u32,
    /// Name, to which the pieces' numbers are added.
    pub name: &'static str,
    /// Type of an element of the array in the shader.
    pub ty: &'static str,
    /// Functions that read it.
    pub readers: &'static [Reader],
}

/// A function that reads an array by a number: `fn name(index: u32) -> result`.
pub(crate) struct Reader {
    pub name: &'static str,
    /// What comes behind the name of the piece; AT stands for the number within it.
    pub read: &'static str,
    pub result: &'static str,
    /// Binary logarithm of how many elements, as [`PieceLayout`] counts them, one number stands for.
    pub shift: u32,
}

impl Reader {
    const fn new(name: &'static str, read: &'static str, result: &'static str) -> Reader {
        Reader { name, read, result, shift: 0 }
    }
}

/// The assets' words, see `arena.rs`.
pub(crate) const ASSETS: PieceArray = PieceArray {
    group: 0,
    binding: 100,
    name: "assets",
    ty: "u32",
    readers: &[Reader::new("asset_word", "[AT]", "u32")],
};
/// The assets' words where rows are read in quads: a quad is one read, and a single word takes more than in [`ASSETS`]. The cut
/// counts words.
pub(crate) const ASSETS_IN_QUADS: PieceArray = PieceArray {
    ty: "vec4<u32>",
    readers: &[
        Reader::new("asset_word", "[AT >> 2u][AT & 3u]", "u32"),
        Reader { shift: 2, ..Reader::new("asset_quad", "[AT]", "vec4<u32>") },
    ],
    ..ASSETS
};
/// A scene's vertices.
pub(crate) const VERTICES: PieceArray = PieceArray {
    group: 1,
    binding: 100,
    name: "vertices",
    ty: "Vertex",
    readers: &[
        Reader::new("vertex_at", "[AT]", "Vertex"),
        Reader::new("vertex_position", "[AT].position", "vec3<f32>"),
    ],
};
/// A scene's triangles.
pub(crate) const TRIANGLES: PieceArray = PieceArray {
    group: 1,
    binding: 200,
    name: "triangles",
    ty: "Triangle",
    readers: &[Reader::new("triangle_at", "[AT]", "Triangle")],
};
/// The nodes of its hierarchy.
pub(crate) const NODES: PieceArray = PieceArray {
    group: 1,
    binding: 300,
    name: "nodes",
    ty: "BvhNode",
    readers: &[Reader::new("node_at", "[AT]", "BvhNode")],
};

/// An array on a GPU.
pub(crate) struct Pieces {
    queue: wgpu::Queue,
    pub layout: PieceLayout,
    pub buffers: Vec<wgpu::Buffer>,
    /// Elements in all.
    count: usize,
}

impl Pieces {
    /// Returns an array of `count` elements that lie in `buffers`.
    pub(crate) fn of_buffers(gpu: &Gpu, layout: PieceLayout, buffers: Vec<wgpu::Buffer>, count: usize) -> Pieces {
        Pieces { queue: gpu.queue.clone(), layout, buffers, count }
    }

    /// Uploads `values`; `label` is what messages call them.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the driver has no memory for them.
    pub(crate) fn new<T: bytemuck::Pod>(
        gpu: &Gpu,
        label: &str,
        values: &[T],
        usage: wgpu::BufferUsages,
    ) -> Result<Pieces, ViewerError> {
        let layout = PieceLayout::of(values.len(), gpu.max_binding_bytes() as usize / size_of::<T>());
        let buffers = (0..layout.pieces)
            .map(|piece| {
                let part = &values[layout.range(piece, values.len())];
                gpu.buffer(label, bytemuck::cast_slice(part), wgpu::BufferUsages::STORAGE | usage)
            })
            .collect::<Result<_, _>>()?;
        Ok(Pieces::of_buffers(gpu, layout, buffers, values.len()))
    }

    /// Writes `values` over those from number `first` on.
    pub(crate) fn write<T: bytemuck::Pod>(&self, first: usize, values: &[T]) {
        let piece_size = match self.layout.pieces {
            1 => usize::MAX,
            _ => 1usize << self.layout.shift,
        };
        let (mut at, mut rest) = (first, values);
        while !rest.is_empty() {
            let within = at % piece_size;
            let (now, later) = rest.split_at(rest.len().min(piece_size - within));
            let offset = (within * size_of::<T>()) as u64;
            self.queue.write_buffer(&self.buffers[at / piece_size], offset, bytemuck::cast_slice(now));
            at += now.len();
            rest = later;
        }
    }

    /// Returns the elements of each piece.
    pub(crate) fn places(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        (0..self.layout.pieces).map(|piece| self.layout.range(piece, self.count))
    }

    /// Returns what a bind group of `array` holds.
    pub(crate) fn entries(&self, array: &PieceArray) -> Vec<(u32, wgpu::BindingResource<'_>)> {
        self.layout.bindings(array).zip(self.buffers.iter().map(wgpu::Buffer::as_entire_binding)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_hold_every_element_once() {
        let layout = PieceLayout::of(2500, 1100);
        assert_eq!(layout, PieceLayout { pieces: 3, shift: 10 });
        let ranges: Vec<_> = (0..3).map(|piece| layout.range(piece, 2500)).collect();
        assert_eq!(ranges, [0..1024, 1024..2048, 2048..2500]);
        assert_eq!(PieceLayout::of(1100, 1100), PieceLayout::WHOLE);
        assert_eq!(PieceLayout::WHOLE.range(0, 7), 0..7);
    }

    #[test]
    fn one_piece_is_read_without_a_choice() {
        let text = PieceLayout::WHOLE.wgsl(&VERTICES);
        assert!(text.contains("return vertices_0[index];") && text.contains("return vertices_0[index].position;"));
        let text = PieceLayout { pieces: 2, shift: 4 }.wgsl(&ASSETS);
        assert!(text.contains("case 1u: { return assets_1[at]; }") && text.contains("index & 15u"));
        let text = PieceLayout { pieces: 2, shift: 4 }.wgsl(&ASSETS_IN_QUADS);
        assert!(text.contains("case 1u: { return assets_1[at >> 2u][at & 3u]; }") && text.contains("index & 15u"));
        assert!(text.contains("case 1u: { return assets_1[at]; }") && text.contains("index >> 2u"));
    }
}
