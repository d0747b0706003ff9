// One voxel: its microflakes as two matrices. Twin: voltex/voxel.rs.

const VOLTEX_VOXEL_WORDS: u32 = 9u;
const VOLTEX_OTHER_AT: u32 = 8u;

struct VoltexVoxel {
    // Extinction matrix S: the root of `d' S d` is the optical depth along d, a vector of texture space.
    extinction: VoltexMatrix,
    // Moment N: sum over the microflakes of `a n n'`.
    moment: VoltexMatrix,
    // Number of the material.
    material: u32,
}

// Reads six halves from word `at` on.
fn voltex_voxel_halves(at: u32) -> VoltexMatrix {
    let a = unpack2x16float(asset_word(at));
    let b = unpack2x16float(asset_word(at + 1u));
    return VoltexMatrix(vec3<f32>(a, b.x), vec3<f32>(b.y, unpack2x16float(asset_word(at + 2u))));
}

// Reads the voxel at a word.
fn voltex_voxel_at(at: u32) -> VoltexVoxel {
    let scale = asset_f32(at);
    let extinction = voltex_scale(voltex_voxel_halves(at + 1u), scale * scale);
    let moment = voltex_scale(voltex_voxel_halves(at + 4u), scale);
    return VoltexVoxel(extinction, moment, asset_word(at + 7u));
}
