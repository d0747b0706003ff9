// The light of a leaf of an algorithmic model: a table over the directions of light and eye, by the length of the way through the
// tissue. Twin: leaf/scatter.rs, which has the contents.

const LEAF_TISSUE: u32 = 4u;

// Returns the colour of each class of the ways from a face (0 the front) to a side (0 where the light came from), where the
// textures and the plant multiply the contents of the leaf by `factors`.
fn leaf_way_colours(base: u32, factors: vec4<f32>, face: u32, side: u32) -> mat4x3<f32> {
    let at = base + asset_word(base + LEAF_SCATTER_AT) + LEAF_CLASSES * (2u * face + side);
    let ways = vec4<f32>(asset_f32(at), asset_f32(at + 1u), asset_f32(at + 2u), asset_f32(at + 3u));
    let bands = asset_word(base + 5u);
    var colours = mat4x3<f32>();
    for (var band = 0u; band < bands; band++) {
        let band_at = base + LEAF_BANDS_AT + band * LEAF_BAND_WORDS;
        let absorbed = leaf_absorption(band_at, factors);
        let left = exp(-factors.w * (absorbed.x + absorbed.y) * ways);
        let shares = vec3<f32>(asset_f32(band_at + 4u), asset_f32(band_at + 5u), asset_f32(band_at + 6u));
        colours += mat4x3<f32>(shares * left.x, shares * left.y, shares * left.z, shares * left.w);
    }
    // The red of a pure yellow is more than a white has.
    let one = vec3<f32>(1.0);
    return mat4x3<f32>(min(colours[0], one), min(colours[1], one), min(colours[2], one), min(colours[3], one));
}

// Returns the share of light from all around on a face (0 the front) that leaves on a side (0 where it came from) by each class.
fn leaf_way_totals(base: u32, face: u32, side: u32) -> vec4<f32> {
    let at = base + asset_word(base + LEAF_SCATTER_AT) + LEAF_TOTALS_AFTER + LEAF_CLASSES * (2u * face + side);
    return vec4<f32>(asset_f32(at), asset_f32(at + 1u), asset_f32(at + 2u), asset_f32(at + 3u));
}

// Returns the lower of two neighbouring places of `count`, and after it the share of the upper one.
fn leaf_between(place: f32, count: u32) -> vec2<f32> {
    let inside = clamp(place, 0.0, f32(count - 1u));
    let cell = min(floor(inside), f32(count - 2u));
    return vec2<f32>(cell, inside - cell);
}

// Returns pi f for light on the face `place.x` (0 the front) seen on the side `place.y` (0 where it came from), for the cosines of
// light, of eye and of the azimuth between them.
fn leaf_scattered(base: u32, colours: mat4x3<f32>, place: vec2<u32>, cosines: vec3<f32>) -> vec3<f32> {
    let channels = asset_word(base + LEAF_CHANNELS_AT);
    let cells = LEAF_INCIDENCES * LEAF_COSINES * LEAF_AZIMUTHS;
    let table = base + asset_word(base + LEAF_SCATTER_AT) + LEAF_CELLS_AFTER;
    let first = table + LEAF_CELL_WORDS * channels * cells * (2u * place.x + place.y);
    let i = leaf_between(sqrt(max(cosines.x, 0.0)) * f32(LEAF_INCIDENCES - 1u), LEAF_INCIDENCES);
    let c = leaf_between(cosines.y * f32(LEAF_COSINES) - 0.5, LEAF_COSINES);
    let half = sqrt(0.5 + 0.5 * clamp(cosines.z, -1.0, 1.0));
    let a = leaf_between(half * f32(LEAF_AZIMUTHS) - 0.5, LEAF_AZIMUTHS);
    var light = vec3<f32>(0.0);
    for (var channel = 0u; channel < channels; channel++) {
        var values = vec4<f32>(0.0);
        for (var corner = 0u; corner < 8u; corner++) {
            let d = vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
            let upper = vec3<f32>(i.y, c.y, a.y);
            let share = select(1.0 - upper, upper, d == vec3<u32>(1u));
            let row = (u32(i.x) + d.x) * LEAF_COSINES + u32(c.x) + d.y;
            let at = first + LEAF_CELL_WORDS * (channel * cells + row * LEAF_AZIMUTHS + u32(a.x) + d.z);
            let halves = vec4<f32>(unpack2x16float(asset_word(at)), unpack2x16float(asset_word(at + 1u)));
            values += share.x * share.y * share.z * halves;
        }
        let seen = colours * values;
        if channels == 1u {
            light = seen;
        } else {
            light[channel] = seen[channel];
        }
    }
    return light;
}
