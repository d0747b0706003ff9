// The decoder: from texel, light and eye to reflectance times cosine. Twin: decode/decode.rs.

// Answer of btf_layer_for_sides where the asset has no such layer.
const NO_LAYER: u32 = 0xffffffffu;

fn btf_layers(base: u32) -> u32 {
    return asset_word(base + 2u);
}

// Returns the number of levels, the finest included.
fn btf_levels(base: u32) -> u32 {
    return asset_word(base + 4u);
}

// Returns columns and rows of a layer, as btf_layer_for_sides numbers it.
fn btf_size(base: u32, layer: u32) -> vec2<u32> {
    return level_size(base + asset_word(base + ASSET_LAYERS + layer));
}

// Returns the texel nearest to a texture coordinate; u to the right, v up, both wrap.
fn btf_texel(base: u32, layer: u32, uv: vec2<f32>) -> u32 {
    let size = btf_size(base, layer);
    let wrapped = vec2<f32>(fract(uv.x), fract(1.0 - uv.y));
    let xy = min(vec2<u32>(wrapped * vec2<f32>(size)), size - vec2<u32>(1u));
    return xy.y * size.x + xy.x;
}

// Returns one of the four texels around a texture coordinate, drawn by two numbers in [0, 1): values at evenly spread
// numbers have the bilinear interpolation of the four as their mean. With 0.5 twice it is the nearest one.
fn btf_texel_between(base: u32, layer: u32, uv: vec2<f32>, at: vec2<f32>) -> u32 {
    let size = btf_size(base, layer);
    let sides = vec2<f32>(size);
    var moved = floor(vec2<f32>(fract(uv.x), fract(1.0 - uv.y)) * sides + (at - 0.5));
    // Moved by one texel at most.
    moved = select(moved, moved + sides, moved < vec2<f32>(0.0));
    moved = select(moved, vec2<f32>(0.0), moved >= sides);
    return u32(moved.y) * size.x + u32(moved.x);
}

// Returns the number that decoders take of the layer for a light and an eye on these sides (1: back) at a level, 0 the
// finest; NO_LAYER where the asset has none.
fn btf_layer_for_sides(base: u32, level: u32, light_side: u32, view_side: u32) -> u32 {
    let layers = btf_layers(base);
    for (var layer = level * layers; layer < (level + 1u) * layers; layer++) {
        let at = base + asset_word(base + ASSET_LAYERS + layer);
        if asset_word(at + BLOCK_LIGHT_SIDE) == light_side && asset_word(at + BLOCK_VIEW_SIDE) == view_side {
            return layer;
        }
    }
    return NO_LAYER;
}

// Decodes the value of a texel for one light; viewed_texel.wgsl is cheaper for several.
fn btf_decode(base: u32, layer: u32, texel: u32, wi: vec3<f32>, wo: vec3<f32>, options: BtfOptions) -> vec3<f32> {
    return viewed_light_alone(viewed_new(base, layer, texel, wo, options), wi);
}
