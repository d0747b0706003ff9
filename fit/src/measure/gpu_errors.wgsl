// Error of tiles of texels at a batch of pairs; joined with the library's residual.wgsl, whose curves combine lobes and residual.
// Twin of the host: gpu_errors.rs; the CPU's loops are in tile_errors.rs.
//
// A workgroup is a tile, a thread one of its texels. Four pairs at a time share what is read of the texel's codes; all threads
// of a workgroup read the same rows.

struct Batch {
    tiles: u32,
    pairs: u32,
    // Words of four bases a texel has; 0 without residual.
    quads: u32,
    clusters: u32,
    // Lobes of all clusters.
    lobes: u32,
    kind: u32,
    epsilon: f32,
    // 1: lobes are part of the value.
    adds_lobes: u32,
}

// A tile: its cluster, number of texels, first slot and number of slots.
@group(0) @binding(0) var<uniform> batch: Batch;
@group(0) @binding(1) var<storage, read> tiles: array<vec4<u32>>;
// Coefficient codes, [tile, quad of bases, texel], four a word.
@group(0) @binding(2) var<storage, read> codes: array<u32>;
// Lobe and bits of the weights, [slot, texel].
@group(0) @binding(3) var<storage, read> slots: array<vec4<u32>>;
// Per light 256 linear values of the codes, then 256 thresholds above them.
@group(0) @binding(4) var<storage, read> light_tables: array<f32>;
// Per pair: light, bits of the fade, place among the images whose codes are wanted (or a number beyond), 0; then lobe values.
@group(0) @binding(5) var<storage, read> pairs: array<u32>;
// Bases, [pair, cluster, quad, channel].
@group(0) @binding(6) var<storage, read> rows: array<vec4<f32>>;
// Codes of the capture, [pair, tile, channel, texel], four a word.
@group(0) @binding(7) var<storage, read> images: array<u32>;
// [6, texel of a tile]: squared differences of codes, bits of the sums of squared linear differences, of squared linear values of
// the capture, of those values and of the decoded ones, and the largest value; then [tile, pair] squared differences of codes; then
// [image, texel of a tile] decoded codes.
@group(0) @binding(8) var<storage, read_write> found: array<u32>;

const TEXELS: u32 = 64u;
const MAX_PAIRS: u32 = 64u;
const PAIRS_AT_ONCE: u32 = 4u;
const SUMS: u32 = 6u;
const HEADER: u32 = 4u;
const TABLE: u32 = 512u;

var<workgroup> pair_errors: array<atomic<u32>, 64>;

// Returns the 8-bit value of a linear one: the number of thresholds that it reaches.
fn encoded(light: u32, value: f32) -> u32 {
    let first = light * TABLE + 256u;
    var code = 0u;
    for (var bit = 128u; bit > 0u; bit >>= 1u) {
        if (value >= light_tables[first + code + bit - 1u]) {
            code += bit;
        }
    }
    return code;
}

fn lobe_sum(tile: vec4<u32>, texel: u32, pair: u32) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var slot = tile.z; slot < tile.z + tile.w; slot++) {
        let entry = slots[slot * TEXELS + texel];
        let value = bitcast<f32>(pairs[MAX_PAIRS * HEADER + pair * batch.lobes + entry.x]);
        sum += bitcast<vec3<f32>>(entry.yzw) * value;
    }
    return sum;
}

@compute @workgroup_size(64)
fn errors(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) texel: u32) {
    let number = group.y * 65535u + group.x;
    if (number >= batch.tiles) {
        return;
    }
    let tile = tiles[number];
    let is_there = texel < tile.y;
    var code_error = 0u;
    // Linear differences and values of the capture, squared; values of the capture and decoded ones.
    var sums = vec4<f32>(0.0);
    var peak = 0.0;
    for (var first = 0u; first < batch.pairs; first += PAIRS_AT_ONCE) {
        var residual: array<vec3<f32>, 4>;
        let stride = batch.clusters * batch.quads * 3u;
        // Rows beyond the last pair are read and not used.
        var at = first * stride + tile.x * batch.quads * 3u;
        for (var quad = 0u; quad < batch.quads; quad++) {
            let four = codes[(number * batch.quads + quad) * TEXELS + texel];
            let signed = vec4<i32>(vec4<u32>(four << 24u, four << 16u, four << 8u, four)) >> vec4<u32>(24u);
            let weights = vec4<f32>(signed);
            for (var j = 0u; j < PAIRS_AT_ONCE; j++) {
                let row = at + j * stride;
                residual[j] += vec3<f32>(dot(weights, rows[row]), dot(weights, rows[row + 1u]), dot(weights, rows[row + 2u]));
            }
            at += 3u;
        }
        for (var j = 0u; j < PAIRS_AT_ONCE && first + j < batch.pairs; j++) {
            let pair = first + j;
            let light = pairs[pair * HEADER];
            let lobes = lobe_sum(tile, texel, pair);
            var value = lobes;
            if (batch.quads > 0u) {
                let base = select(vec3<f32>(0.0), lobes, batch.adds_lobes == 1u && tile.w > 0u);
                let curved = residual_encode(batch.kind, base, batch.epsilon) + residual[j];
                value = max(residual_decode(batch.kind, curved, batch.epsilon), vec3<f32>(0.0));
            }
            value *= bitcast<f32>(pairs[pair * HEADER + 1u]);
            var decoded_codes = vec3<u32>(0u);
            var original = vec3<f32>(0.0);
            var difference = vec3<i32>(0);
            let image = ((pair * batch.tiles + number) * 3u) * (TEXELS / 4u) + texel / 4u;
            for (var c = 0u; c < 3u; c++) {
                let code = (images[image + c * (TEXELS / 4u)] >> (8u * (texel % 4u))) & 255u;
                decoded_codes[c] = encoded(light, value[c]);
                original[c] = light_tables[light * TABLE + code];
                difference[c] = i32(decoded_codes[c]) - i32(code);
            }
            // Behind the last texel nothing differs.
            if (is_there) {
                let error = u32(dot(difference, difference));
                code_error += error;
                atomicAdd(&pair_errors[pair], error);
                let off = value - original;
                sums += vec4<f32>(
                    dot(off, off),
                    dot(original, original),
                    original.x + original.y + original.z,
                    value.x + value.y + value.z,
                );
                peak = max(peak, max(original.x, max(original.y, original.z)));
            }
            let slot = pairs[pair * HEADER + 2u];
            if (slot < MAX_PAIRS) {
                let colours = batch.tiles * (SUMS * TEXELS + MAX_PAIRS);
                found[colours + (slot * batch.tiles + number) * TEXELS + texel] =
                    decoded_codes.x | (decoded_codes.y << 8u) | (decoded_codes.z << 16u);
            }
        }
    }
    let own = number * TEXELS + texel;
    let row = batch.tiles * TEXELS;
    found[own] = code_error;
    found[row + own] = bitcast<u32>(sums.x);
    found[2u * row + own] = bitcast<u32>(sums.y);
    found[3u * row + own] = bitcast<u32>(sums.z);
    found[4u * row + own] = bitcast<u32>(sums.w);
    found[5u * row + own] = bitcast<u32>(peak);
    workgroupBarrier();
    found[SUMS * row + number * MAX_PAIRS + texel] = atomicLoad(&pair_errors[texel]);
}
