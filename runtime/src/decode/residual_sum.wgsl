// Sums the residual of a texel from expanded bases. Twin: decode/residual_sum.rs.

// Returns the residual of `t` at three `lights`, a column for each: the sum over the measured `views` with their `shares`;
// 0 at lights that are not `wanted`. One pass over the bases serves all pairs. Rows must be whole quads of words.
fn residual_sum(t: Texel, views: vec3<u32>, lights: vec3<u32>, wanted: vec3<bool>, shares: vec3<f32>) -> mat3x3<f32> {
    let channel_quads = asset_word(t.layer + BLOCK_CHANNEL_WORDS) / 4u;
    let row_quads = 3u * channel_quads;
    let pairs = t.cluster * asset_word(t.layer + BLOCK_PAIRS) + views * asset_word(t.layer + BLOCK_LIGHT_COUNT);
    let first = (t.base + asset_word(t.layer + BLOCK_BASIS)) / 4u + pairs * row_quads;
    let of_light = lights * row_quads;
    let codes = t.base + asset_word(t.layer + BLOCK_CODES) + t.texel * asset_word(t.layer + BLOCK_CODE_WORDS);
    var sum = mat3x3<f32>();
    var before = 0u;
    // Eight bases at a time. Their codes begin a byte earlier than a word, because the mean has none.
    for (var base = 0u; base < t.bases; base += 8u) {
        var code = vec2<u32>(0u);
        if base + 1u < t.bases {
            code.x = asset_word(codes + base / 4u);
        }
        if base + 5u < t.bases {
            code.y = asset_word(codes + base / 4u + 1u);
        }
        let low = residual_weights((before >> 24u) | (code.x << 8u), base, t.bases);
        let high = residual_weights((code.x >> 24u) | (code.y << 8u), base + 4u, t.bases);
        before = code.y;
        // One view after the other, written out: a loop would choose from vectors by a number.
        if shares.x > 0.0 {
            sum += residual_of_view(first.x + base / 8u, of_light, wanted, channel_quads, shares.x * low, shares.x * high);
        }
        if shares.y > 0.0 {
            sum += residual_of_view(first.y + base / 8u, of_light, wanted, channel_quads, shares.y * low, shares.y * high);
        }
        if shares.z > 0.0 {
            sum += residual_of_view(first.z + base / 8u, of_light, wanted, channel_quads, shares.z * low, shares.z * high);
        }
    }
    return sum;
}

// Returns the weighted sums of eight bases of a view's rows at three lights.
fn residual_of_view(
    at: u32,
    of_light: vec3<u32>,
    wanted: vec3<bool>,
    channel_quads: u32,
    low: vec4<f32>,
    high: vec4<f32>,
) -> mat3x3<f32> {
    var sum = mat3x3<f32>();
    if wanted.x {
        sum[0] = residual_of_quads(at + of_light.x, channel_quads, low, high);
    }
    if wanted.y {
        sum[1] = residual_of_quads(at + of_light.y, channel_quads, low, high);
    }
    if wanted.z {
        sum[2] = residual_of_quads(at + of_light.z, channel_quads, low, high);
    }
    return sum;
}

// Returns the weighted sum of eight bases of a row, RGB, of which those of red lie in the quad at `at`.
fn residual_of_quads(at: u32, channel_quads: u32, low: vec4<f32>, high: vec4<f32>) -> vec3<f32> {
    let red = asset_quad(at);
    let green = asset_quad(at + channel_quads);
    let blue = asset_quad(at + 2u * channel_quads);
    return vec3<f32>(
        residual_of_eight(red, low, high),
        residual_of_eight(green, low, high),
        residual_of_eight(blue, low, high),
    );
}

fn residual_of_eight(words: vec4<u32>, low: vec4<f32>, high: vec4<f32>) -> f32 {
    return dot(low, vec4<f32>(unpack2x16float(words.x), unpack2x16float(words.y)))
        + dot(high, vec4<f32>(unpack2x16float(words.z), unpack2x16float(words.w)));
}

// Returns the residual as residual_sum does, where rows are not whole quads of words.
fn residual_sum_by_words(
    t: Texel,
    views: vec3<u32>,
    lights: vec3<u32>,
    wanted: vec3<bool>,
    shares: vec3<f32>,
) -> mat3x3<f32> {
    let channel_words = asset_word(t.layer + BLOCK_CHANNEL_WORDS);
    let row_words = 3u * channel_words;
    let pairs = t.cluster * asset_word(t.layer + BLOCK_PAIRS) + views * asset_word(t.layer + BLOCK_LIGHT_COUNT);
    let first = t.base + asset_word(t.layer + BLOCK_BASIS) + pairs * row_words;
    let of_light = lights * row_words;
    let codes = t.base + asset_word(t.layer + BLOCK_CODES) + t.texel * asset_word(t.layer + BLOCK_CODE_WORDS);
    var sum = mat3x3<f32>();
    var before = 0u;
    // Four bases at a time. Their codes begin a byte earlier than a word, because the mean has none.
    for (var base = 0u; base < t.bases; base += 4u) {
        var code = 0u;
        if base + 1u < t.bases {
            code = asset_word(codes + base / 4u);
        }
        let weights = residual_weights((before >> 24u) | (code << 8u), base, t.bases);
        before = code;
        let word = base / 2u;
        // Behind the last base there may be no second word; its weights are 0.
        let next = select(0u, 1u, word + 1u < channel_words);
        for (var v = 0u; v < 3u; v++) {
            if shares[v] <= 0.0 {
                continue;
            }
            let of_view = shares[v] * weights;
            let at = first[v] + word;
            if wanted.x {
                sum[0] += residual_of_row(at + of_light.x, next, channel_words, of_view);
            }
            if wanted.y {
                sum[1] += residual_of_row(at + of_light.y, next, channel_words, of_view);
            }
            if wanted.z {
                sum[2] += residual_of_row(at + of_light.z, next, channel_words, of_view);
            }
        }
    }
    return sum;
}

// Returns what multiplies the four bases from number `base` on, given the bytes of their codes: 1 for the mean, which is
// number 0, and 0 from number `bases` on.
fn residual_weights(bytes: u32, base: u32, bases: u32) -> vec4<f32> {
    var weights = vec4<f32>(
        coefficient_from_byte(bytes & 0xffu),
        coefficient_from_byte((bytes >> 8u) & 0xffu),
        coefficient_from_byte((bytes >> 16u) & 0xffu),
        coefficient_from_byte(bytes >> 24u),
    );
    if base == 0u {
        weights.x = 1.0;
    }
    let numbers = base + vec4<u32>(0u, 1u, 2u, 3u);
    return select(vec4<f32>(0.0), weights, numbers < vec4<u32>(bases));
}

// Returns the weighted sum of four bases of a row, RGB, of which the first two of red lie in the word at `at`, and the other
// two `next` words on.
fn residual_of_row(at: u32, next: u32, channel_words: u32, weights: vec4<f32>) -> vec3<f32> {
    let green = at + channel_words;
    let blue = green + channel_words;
    return vec3<f32>(
        dot(weights, vec4<f32>(unpack2x16float(asset_word(at)), unpack2x16float(asset_word(at + next)))),
        dot(weights, vec4<f32>(unpack2x16float(asset_word(green)), unpack2x16float(asset_word(green + next)))),
        dot(weights, vec4<f32>(unpack2x16float(asset_word(blue)), unpack2x16float(asset_word(blue + next)))),
    );
}
