// What decoders give for values of an asset's channels. Twin: decode/shown.rs.

const MAX_CHANNEL: f32 = 1e30;
const SPECTRUM_HEAD: u32 = 2u;

// Returns the number of groups of channels.
fn shown_groups(base: u32) -> u32 {
    let offset = asset_word(base + ASSET_SPECTRUM);
    if offset == 0u {
        return 1u;
    }
    return asset_word(base + offset + 1u);
}

// Returns the weights of a group's channels in the three values, a column for each channel.
fn shown_weights(base: u32, group: u32) -> mat3x3<f32> {
    let offset = asset_word(base + ASSET_SPECTRUM);
    if offset == 0u {
        return mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    }
    let at = base + offset;
    let groups = asset_word(at + 1u);
    var weights: mat3x3<f32>;
    for (var value = 0u; value < 3u; value++) {
        let row = at + SPECTRUM_HEAD + 3u * (groups * value + group);
        weights[0u][value] = asset_f32(row);
        weights[1u][value] = asset_f32(row + 1u);
        weights[2u][value] = asset_f32(row + 2u);
    }
    return weights;
}

// Returns whether any of a group's channels has a weight.
fn shown_asks(weights: mat3x3<f32>) -> bool {
    let sizes = abs(weights[0]) + abs(weights[1]) + abs(weights[2]);
    return sizes.x + sizes.y + sizes.z > 0.0;
}
