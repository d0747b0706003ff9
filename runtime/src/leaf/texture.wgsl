// The appearance textures of a leaf, read between texels. Twin: leaf/texture.rs, which names the channels.

const LEAF_FACTOR_ONE: f32 = 127.0;

struct LeafTexel {
    // Factors on chlorophyll, carotenoids, brown pigment and anthocyanins, thickness.
    factors: vec4<f32>,
    // Coordinates x and y of the normals of front and back, each in its own frame.
    tilt: vec4<f32>,
    // Shares of main vein, lesser veins, mesophyll.
    structure: vec3<f32>,
    // Strength of the gloss of front and back.
    gloss: vec2<f32>,
    // Cosine and sine of twice the angle of the veins.
    veins: vec2<f32>,
}

fn leaf_unpacked(at: u32) -> LeafTexel {
    let factors = unpack4x8unorm(asset_word(at)) * 255.0 / LEAF_FACTOR_ONE;
    let shine = asset_word(at + 1u);
    let tilt = unpack4x8snorm(asset_word(at + 3u));
    return LeafTexel(
        factors * factors,
        tilt * abs(tilt),
        unpack4x8unorm(asset_word(at + 2u)).xyz,
        unpack4x8unorm(shine).xy,
        unpack4x8snorm(shine).zw,
    );
}

// Reads the textures of the leaf whose first word is number `base`, at `uv` of `level` (the coarsest if there are
// fewer), bilinear, repeated.
fn leaf_texel_at(base: u32, uv: vec2<f32>, level_given: u32) -> LeafTexel {
    let level = min(level_given, asset_word(base + 1u) - 1u);
    let width = max(asset_word(base + 2u) >> level, 1u);
    let rows = max(asset_word(base + 3u) >> level, 1u);
    let first = base + asset_word(base + LEAF_LEVELS_AT + level);
    let size = vec2<f32>(f32(width), f32(rows));
    let place = fract(vec2<f32>(uv.x, 1.0 - uv.y)) * size - 0.5;
    let share = fract(place);
    var sum = LeafTexel(vec4<f32>(0.0), vec4<f32>(0.0), vec3<f32>(0.0), vec2<f32>(0.0), vec2<f32>(0.0));
    for (var i = 0u; i < 4u; i++) {
        let corner = vec2<u32>(i & 1u, i >> 1u);
        // One width is added, because the first place may lie half a texel before 0.
        let x = u32(i32(floor(place.x)) + i32(width + corner.x)) % width;
        let y = u32(i32(floor(place.y)) + i32(rows + corner.y)) % rows;
        let weight = select(1.0 - share.x, share.x, corner.x == 1u) * select(1.0 - share.y, share.y, corner.y == 1u);
        let texel = leaf_unpacked(first + LEAF_TEXEL_WORDS * (y * width + x));
        sum.factors += weight * texel.factors;
        sum.tilt += weight * texel.tilt;
        sum.structure += weight * texel.structure;
        sum.gloss += weight * texel.gloss;
        sum.veins += weight * texel.veins;
    }
    return sum;
}
