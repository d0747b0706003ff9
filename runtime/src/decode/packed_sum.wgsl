// Sums the residual of a texel from packed bases. Twin: decode/packed_sum.rs.

// Rows of the colour frame. Twin: asset/residual.rs, COLOUR_FRAME.
const FRAME_GREY: vec3<f32> = vec3<f32>(0.57735026, 0.57735026, 0.57735026);
const FRAME_RED_BLUE: vec3<f32> = vec3<f32>(0.70710677, 0.0, -0.70710677);
const FRAME_GREEN_MAGENTA: vec3<f32> = vec3<f32>(0.4082483, -0.8164966, 0.4082483);

// Returns the residual at the pairs of `view` with three `lights`; where they are not `wanted` it may be anything.
fn packed_sum(t: Texel, view: u32, lights: vec3<u32>) -> mat3x3<f32> {
    let at = t.base + asset_word(t.layer + BLOCK_BASIS);
    let place = at + PACKED_PLACES + PLACE_WORDS * t.cluster;
    let pairs = view * asset_word(t.layer + BLOCK_LIGHT_COUNT) + lights;
    let rows = at + asset_word(place) + asset_word(place + 1u) * pairs;
    let unit = asset_f32(at);
    let bases = at + asset_word(at + 2u) + t.cluster * asset_word(at + 1u);
    // The codes of a texel end where its lobe references begin.
    let codes = t.base + asset_word(t.layer + BLOCK_REFS) + t.first_ref - asset_word(place + 2u);
    // Of each channel of the colour frame, the sums at the three lights.
    var sums = mat3x3<f32>();
    var words = vec3<u32>(0u);
    // Places of the next number in the rows, and of the next code.
    var bit = 0u;
    var code_bit = 0u;
    for (var index = 0u; index < t.bases; index++) {
        let basis = asset_word(bases + index);
        var weight = unpack2x16float(basis).x * unit;
        if index > 0u {
            let width = basis >> 28u;
            if width == 0u {
                continue;
            }
            weight *= f32(packed_bits(codes, code_bit, width));
            code_bit += width;
        }
        for (var c = 0u; c < 3u; c++) {
            let width = (basis >> (16u + 4u * c)) & 0xfu;
            if width == 0u {
                continue;
            }
            let first = bit % 32u;
            if first == 0u {
                words = packed_read(rows, bit / 32u);
            }
            var bits = words >> vec3<u32>(first);
            if first + width > 32u {
                words = packed_read(rows, bit / 32u + 1u);
                bits |= words << vec3<u32>(32u - first);
            }
            bit += width;
            let down = vec3<u32>(32u - width);
            let level = vec3<f32>(bitcast<vec3<i32>>(bits << down) >> down) + 0.5;
            sums[c] += weight * level * (0.5 + packed_bend(width) * abs(level));
        }
    }
    let grey = sums[0];
    let red_blue = sums[1];
    let green_magenta = sums[2];
    return mat3x3<f32>(
        grey.x * FRAME_GREY + red_blue.x * FRAME_RED_BLUE + green_magenta.x * FRAME_GREEN_MAGENTA,
        grey.y * FRAME_GREY + red_blue.y * FRAME_RED_BLUE + green_magenta.y * FRAME_GREEN_MAGENTA,
        grey.z * FRAME_GREY + red_blue.z * FRAME_RED_BLUE + green_magenta.z * FRAME_GREEN_MAGENTA,
    );
}

// Reads word number `word` of each row.
fn packed_read(rows: vec3<u32>, word: u32) -> vec3<u32> {
    return vec3<u32>(asset_word(rows.x + word), asset_word(rows.y + word), asset_word(rows.z + word));
}
