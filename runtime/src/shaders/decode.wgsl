// The decoder: from texel, light and eye to reflectance times cosine. Twin: decode.rs.

fn btf_size(base: u32) -> vec2<u32> {
    return vec2<u32>(asset_word(base), asset_word(base + 1u));
}

fn btf_layers(base: u32) -> u32 {
    return asset_word(base + 2u);
}

// Nearest texel of a texture coordinate; u to the right, v up, both wrap.
fn btf_texel(base: u32, uv: vec2<f32>) -> u32 {
    let size = btf_size(base);
    let wrapped = vec2<f32>(fract(uv.x), fract(1.0 - uv.y));
    let xy = min(vec2<u32>(wrapped * vec2<f32>(size)), size - vec2<u32>(1u));
    return xy.y * size.x + xy.x;
}

// Index of the layer for a light and an eye on these sides (1: back), or the layer count.
fn btf_layer_for_sides(base: u32, light_side: u32, view_side: u32) -> u32 {
    let layers = btf_layers(base);
    for (var layer = 0u; layer < layers; layer++) {
        let at = base + asset_word(base + ASSET_LAYERS + layer);
        if asset_word(at + BLOCK_LIGHT_SIDE) == light_side && asset_word(at + BLOCK_VIEW_SIDE) == view_side {
            return layer;
        }
    }
    return layers;
}

// One light alone; for several, see viewed_texel.wgsl.
fn btf_decode(base: u32, layer: u32, texel: u32, wi: vec3<f32>, wo: vec3<f32>, options: BtfOptions) -> vec3<f32> {
    var rows: LightRows;
    return viewed_light(viewed_new(base, layer, texel, wo, options), &rows, wi);
}
