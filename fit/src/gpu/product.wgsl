// Matrix product C (+)= A B over storage buffers, in tiles that a workgroup keeps in its own memory.
//
// A workgroup makes 128 x 128 values of C; each of its 256 threads makes 8 x 8 of them, as four blocks of 4 x 4 that are
// 64 rows and 64 columns apart, so that neighbouring threads read neighbouring words. Eight columns of A and eight rows of B
// at a time pass through the tiles. Twin of the host: product.rs.

struct Shape {
    // Rows of C, columns of C, length of the sums.
    rows: u32,
    columns: u32,
    inner: u32,
    // Numbers between two rows of A as it is stored, and the first row of B and of C that are meant.
    a_stride: u32,
    b_first: u32,
    c_first: u32,
    // 1: add to what C holds.
    adds: u32,
    pad: u32,
}

// Whether A is stored by columns: the product is of its transpose.
override TRANSPOSED: bool = false;
// Whether A holds halves, two a word.
override HALVES: bool = false;

@group(0) @binding(0) var<storage, read> a: array<u32>;
@group(0) @binding(1) var<storage, read> b: array<f32>;
@group(0) @binding(2) var<storage, read_write> c: array<f32>;
@group(0) @binding(3) var<uniform> shape: Shape;

const TILE: u32 = 128u;
const DEPTH: u32 = 8u;
const QUADS: u32 = 32u;

// [inner][row or column], four at a time.
var<workgroup> a_tile: array<vec4<f32>, 256>;
var<workgroup> b_tile: array<vec4<f32>, 256>;

fn a_value(row: u32, inner: u32) -> f32 {
    if (row >= shape.rows || inner >= shape.inner) {
        return 0.0;
    }
    var at = row * shape.a_stride + inner;
    if (TRANSPOSED) {
        at = inner * shape.a_stride + row;
    }
    if (HALVES) {
        let both = unpack2x16float(a[at >> 1u]);
        return select(both.x, both.y, (at & 1u) == 1u);
    }
    return bitcast<f32>(a[at]);
}

fn b_value(inner: u32, column: u32) -> f32 {
    if (inner >= shape.inner || column >= shape.columns) {
        return 0.0;
    }
    return b[(shape.b_first + inner) * shape.columns + column];
}

@compute @workgroup_size(256)
fn product(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let first_row = group.x * TILE;
    let first_column = group.y * TILE;
    let x = thread % 16u;
    let y = thread / 16u;
    // Two quads of rows by two quads of columns, a vector a row.
    var sums: array<vec4<f32>, 16>;
    for (var depth = 0u; depth < shape.inner; depth += DEPTH) {
        // By rows, threads beside each other read along a row of A; by columns, along a column.
        var inner = thread % DEPTH;
        var quad = thread / DEPTH;
        if (TRANSPOSED) {
            inner = thread / QUADS;
            quad = thread % QUADS;
        }
        let row = first_row + 4u * quad;
        a_tile[inner * QUADS + quad] = vec4<f32>(
            a_value(row, depth + inner),
            a_value(row + 1u, depth + inner),
            a_value(row + 2u, depth + inner),
            a_value(row + 3u, depth + inner),
        );
        let b_inner = depth + thread / QUADS;
        let column = first_column + 4u * (thread % QUADS);
        b_tile[thread] = vec4<f32>(
            b_value(b_inner, column),
            b_value(b_inner, column + 1u),
            b_value(b_inner, column + 2u),
            b_value(b_inner, column + 3u),
        );
        workgroupBarrier();
        for (var k = 0u; k < DEPTH; k++) {
            let a0 = a_tile[k * QUADS + y];
            let a1 = a_tile[k * QUADS + 16u + y];
            let b0 = b_tile[k * QUADS + x];
            let b1 = b_tile[k * QUADS + 16u + x];
            for (var i = 0u; i < 4u; i++) {
                sums[i] = fma(vec4<f32>(a0[i]), b0, sums[i]);
                sums[4u + i] = fma(vec4<f32>(a0[i]), b1, sums[4u + i]);
                sums[8u + i] = fma(vec4<f32>(a1[i]), b0, sums[8u + i]);
                sums[12u + i] = fma(vec4<f32>(a1[i]), b1, sums[12u + i]);
            }
        }
        workgroupBarrier();
    }
    for (var block = 0u; block < 4u; block++) {
        for (var i = 0u; i < 4u; i++) {
            let row = first_row + 64u * (block / 2u) + 4u * y + i;
            let column = first_column + 64u * (block % 2u) + 4u * x;
            let sum = sums[4u * block + i];
            for (var j = 0u; j < 4u; j++) {
                if (row < shape.rows && column + j < shape.columns) {
                    let at = (shape.c_first + row) * shape.columns + column + j;
                    c[at] = select(sum[j], c[at] + sum[j], shape.adds == 1u);
                }
            }
        }
    }
}
