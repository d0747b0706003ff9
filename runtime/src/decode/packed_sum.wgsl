// Sums the residual of a texel from packed bases. Twin: decode/packed_sum.rs.

// Rows of the colour frame. Twin: asset/residual.rs, COLOUR_FRAME.
const FRAME_GREY: vec3<f32> = vec3<f32>(0.57735026, 0.57735026, 0.57735026);
const FRAME_RED_BLUE: vec3<f32> = vec3<f32>(0.70710677, 0.0, -0.70710677);
const FRAME_GREEN_MAGENTA: vec3<f32> = vec3<f32>(0.4082483, -0.8164966, 0.4082483);

// Returns the residual of `t` at three `lights`, a column for each: the sum over the measured `views` with their `shares`.
// One pass over the bases serves all pairs.
fn packed_sum(t: Texel, views: vec3<u32>, lights: vec3<u32>, shares: vec3<f32>) -> mat3x3<f32> {
    let at = t.base + asset_word(t.layer + BLOCK_BASIS);
    let place = at + PACKED_PLACES + PLACE_WORDS * t.cluster;
    let row_words = asset_word(place + 1u);
    let of_light = at + asset_word(place) + row_words * lights;
    let of_view = row_words * asset_word(t.layer + BLOCK_LIGHT_COUNT) * views;
    let unit = asset_f32(at);
    let bases = at + asset_word(at + 2u) + t.cluster * asset_word(at + 1u);
    // The codes of a texel end where its lobe references begin.
    let codes = t.base + asset_word(t.layer + BLOCK_REFS) + t.first_ref - asset_word(place + 2u);
    let shown = shares > vec3<f32>(0.0);
    // Of each channel of the colour frame, the sums at the three lights.
    var sums = mat3x3<f32>();
    // The words of the rows that are being read, of each view.
    var first_words = vec3<u32>(0u);
    var second_words = vec3<u32>(0u);
    var third_words = vec3<u32>(0u);
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
            let rows = of_light + bit / 32u;
            let bend = packed_bend(width);
            bit += width;
            var of_views = vec3<f32>(0.0);
            if shown.x {
                let read = packed_read(rows + of_view.x, first_words, first, width);
                first_words = read.words;
                of_views += shares.x * packed_levels(read.numbers, bend);
            }
            if shown.y {
                let read = packed_read(rows + of_view.y, second_words, first, width);
                second_words = read.words;
                of_views += shares.y * packed_levels(read.numbers, bend);
            }
            if shown.z {
                let read = packed_read(rows + of_view.z, third_words, first, width);
                third_words = read.words;
                of_views += shares.z * packed_levels(read.numbers, bend);
            }
            sums[c] += weight * of_views;
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

// Numbers of three rows, and the words of the rows that are being read.
struct PackedRead {
    numbers: vec3<i32>,
    words: vec3<u32>,
}

// Reads the numbers of `width` bits that follow the `first` bits of the words at `at`. `words` are these words, unless `first`
// is 0.
fn packed_read(at: vec3<u32>, words: vec3<u32>, first: u32, width: u32) -> PackedRead {
    var read = PackedRead(vec3<i32>(0), words);
    if first == 0u {
        read.words = packed_words(at);
    }
    read.numbers = extractBits(bitcast<vec3<i32>>(read.words), first, width);
    if first + width > 32u {
        let bits = read.words >> vec3<u32>(first);
        read.words = packed_words(at + 1u);
        read.numbers = extractBits(bitcast<vec3<i32>>(bits | (read.words << vec3<u32>(32u - first))), 0u, width);
    }
    return read;
}

fn packed_words(at: vec3<u32>) -> vec3<u32> {
    return vec3<u32>(asset_word(at.x), asset_word(at.y), asset_word(at.z));
}

// Returns what numbers stand for, in steps.
fn packed_levels(numbers: vec3<i32>, bend: f32) -> vec3<f32> {
    let level = vec3<f32>(numbers) + 0.5;
    return level * (0.5 + bend * abs(level));
}
