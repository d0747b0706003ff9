// What decoders give for values of an asset's channels. Twin: decode/shown.rs.

const MAX_CHANNEL: f32 = 1e30;

// Returns what decoders give for values of the channels: the values themselves for an asset of colours, else the weighted
// sums that its spectrum asks for, at least 0.
fn shown_value(base: u32, channels: vec3<f32>) -> vec3<f32> {
    let offset = asset_word(base + ASSET_SPECTRUM);
    if offset == 0u {
        return channels;
    }
    let held = min(channels, vec3<f32>(MAX_CHANNEL));
    var values: vec3<f32>;
    for (var value = 0u; value < 3u; value++) {
        let row = base + offset + 1u + 3u * value;
        values[value] = dot(vec3<f32>(asset_f32(row), asset_f32(row + 1u), asset_f32(row + 2u)), held);
    }
    return max(values, vec3<f32>(0.0));
}
