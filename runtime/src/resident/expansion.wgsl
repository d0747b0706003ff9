// Expands the bases of a layer's clusters in three passes, from the file form to the resident form, on the GPU. Twin:
// resident/expansion.rs. A program of its own and no part of the library, because decoders do not need it; it takes
// asset/residual.wgsl from the library.
//
// A dispatch makes a slice of clusters, as many as its z counts. x and y count items, WORKGROUP of them a workgroup, in
// any shape; surplus items do nothing. The buffers `cores` and `viewed` lie between the passes. Items are, with four
// bases side by side in a quad:
//
//     cores_main     core entries x quads
//     viewed_main    (views / 4, rounded up) x light ranks of all channels x quads
//     lit_main       views x (lights / 4, rounded up) x quads

const WORKGROUP: u32 = 64u;
// Largest half-precision number: infinity times a zero weight is NaN.
const MAX_HALF: f32 = 65504.0;
// Rows of the colour frame: grey, red-blue and green-magenta, each by the size of its least entry that is not 0.
const GREY: f32 = 0.57735026;
const RED_BLUE: f32 = 0.70710677;
const GREEN_MAGENTA: f32 = 0.4082483;

struct Channel {
    view_rank: u32,
    light_rank: u32,
    // Number of the channel's first core entry, and of its first light rank, among those of all channels.
    first_core: u32,
    first_row: u32,
    // Index of the channel's first view factors, and of its first light factors.
    view_at: u32,
    light_at: u32,
    pad0: u32,
    pad1: u32,
}

struct Shape {
    channels: array<Channel, 3>,
    views: u32,
    lights: u32,
    // Number of words of a pair and colour.
    channel_words: u32,
    quads: u32,
    // Number of shared bases.
    shared_bases: u32,
    // Number of core entries, and of light ranks, of all channels.
    cores: u32,
    rows: u32,
    // Number of quads from which lobes take a part, 0 for none.
    taken_quads: u32,
    residual_kind: u32,
    epsilon: f32,
    pad0: u32,
    pad1: u32,
}

// The part that a dispatch makes: `words` holds the words from `piece_from` on of an array in which the layer's bases
// begin at `bases_at`. Words outside of `words` are not written.
struct Slice {
    first_cluster: u32,
    bases_at: u32,
    piece_from: u32,
    piece_words: u32,
}

@group(0) @binding(0) var<uniform> shape: Shape;
@group(0) @binding(1) var<uniform> slice: Slice;
// Index of the first term of each core entry, and at last the number of all terms; then two words a term: a value of a
// shared core (f32), the number of the shared basis.
@group(0) @binding(2) var<storage, read> terms: array<u32>;
// For each channel [view / 4, view rank], four views side by side, then lights likewise.
@group(0) @binding(3) var<storage, read> factors: array<vec4<f32>>;
// [cluster, shared basis, quad]
@group(0) @binding(4) var<storage, read> mixtures: array<vec4<f32>>;
// [cluster of the slice, core entry, quad]
@group(0) @binding(5) var<storage, read_write> cores: array<vec4<f32>>;
// [cluster of the slice, view, light rank, quad]
@group(0) @binding(6) var<storage, read_write> viewed: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> words: array<u32>;
// What predicted lobes take from the bases is made from this. For each cluster four words: its nodes, its lobes, the
// index of its numbers (f32), 0. Its numbers are the lobes' values [lobe, pair], the lobes' weights [node, lobe, rgb] and
// the nodes' factors [node, quad].
@group(0) @binding(8) var<storage, read> nodes: array<u32>;

fn item(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.x + id.y * groups.x * WORKGROUP;
}

@compute @workgroup_size(WORKGROUP)
fn cores_main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let quad = item(id, groups) % shape.quads;
    let entry = item(id, groups) / shape.quads;
    if entry >= shape.cores {
        return;
    }
    let mixture = (slice.first_cluster + id.z) * shape.shared_bases;
    var sum = vec4<f32>();
    let end = terms[entry + 1u];
    for (var term = terms[entry]; term < end; term++) {
        let at = shape.cores + 1u + 2u * term;
        sum += bitcast<f32>(terms[at]) * mixtures[(mixture + terms[at + 1u]) * shape.quads + quad];
    }
    cores[(id.z * shape.cores + entry) * shape.quads + quad] = sum;
}

@compute @workgroup_size(WORKGROUP)
fn viewed_main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let quad = item(id, groups) % shape.quads;
    let rest = item(id, groups) / shape.quads;
    if shape.rows == 0u || 4u * (rest / shape.rows) >= shape.views {
        return;
    }
    let row = rest % shape.rows;
    let tile = rest / shape.rows;
    let number = u32(row >= shape.channels[1].first_row) + u32(row >= shape.channels[2].first_row);
    let channel = shape.channels[number];
    var sums = mat4x4<f32>();
    var core = (id.z * shape.cores + channel.first_core + row - channel.first_row) * shape.quads + quad;
    for (var r = 0u; r < channel.view_rank; r++) {
        sums += outer(cores[core], factors[channel.view_at + tile * channel.view_rank + r]);
        core += channel.light_rank * shape.quads;
    }
    let first = (id.z * shape.views + 4u * tile) * shape.rows + row;
    let left = shape.views - 4u * tile;
    // Stores the sums one by one: an index that is not known at compile time keeps the sums out of registers.
    viewed[first * shape.quads + quad] = sums[0];
    if left > 1u {
        viewed[(first + shape.rows) * shape.quads + quad] = sums[1];
    }
    if left > 2u {
        viewed[(first + 2u * shape.rows) * shape.quads + quad] = sums[2];
    }
    if left > 3u {
        viewed[(first + 3u * shape.rows) * shape.quads + quad] = sums[3];
    }
}

@compute @workgroup_size(WORKGROUP)
fn lit_main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let tiles = (shape.lights + 3u) / 4u;
    let quad = item(id, groups) % shape.quads;
    let rest = item(id, groups) / shape.quads;
    let tile = rest % tiles;
    let view = rest / tiles;
    if view >= shape.views {
        return;
    }
    let at = (id.z * shape.views + view) * shape.rows * shape.quads + quad;
    let grey = GREY * lit(0u, at, tile);
    let red_blue = RED_BLUE * lit(1u, at, tile);
    let green_magenta = GREEN_MAGENTA * lit(2u, at, tile);
    let red = grey + red_blue + green_magenta;
    let green = grey - 2.0 * green_magenta;
    let blue = grey - red_blue + green_magenta;
    let pair = ((slice.first_cluster + id.z) * shape.views + view) * shape.lights + 4u * tile;
    let left = shape.lights - 4u * tile;
    put(pair, quad, red[0], green[0], blue[0]);
    if left > 1u {
        put(pair + 1u, quad, red[1], green[1], blue[1]);
    }
    if left > 2u {
        put(pair + 2u, quad, red[2], green[2], blue[2]);
    }
    if left > 3u {
        put(pair + 3u, quad, red[3], green[3], blue[3]);
    }
}

// Returns one channel of four lights, from the view's sums at `at`.
fn lit(number: u32, at: u32, tile: u32) -> mat4x4<f32> {
    let channel = shape.channels[number];
    var sums = mat4x4<f32>();
    var row = at + channel.first_row * shape.quads;
    for (var s = 0u; s < channel.light_rank; s++) {
        sums += outer(viewed[row], factors[channel.light_at + tile * channel.light_rank + s]);
        row += shape.quads;
    }
    return sums;
}

// Returns the matrix whose column i is `quad` times weight i.
fn outer(quad: vec4<f32>, weights: vec4<f32>) -> mat4x4<f32> {
    return mat4x4<f32>(quad * weights.x, quad * weights.y, quad * weights.z, quad * weights.w);
}

// Writes four bases of a pair, without what lobes take from them.
fn put(pair: u32, quad: u32, red: vec4<f32>, green: vec4<f32>, blue: vec4<f32>) {
    var taken = mat3x4<f32>();
    if quad < shape.taken_quads {
        taken = taken_by_lobes(pair, quad);
    }
    let at = slice.bases_at + pair * 3u * shape.channel_words + 2u * quad;
    put_colour(at, quad, red - taken[0]);
    put_colour(at + shape.channel_words, quad, green - taken[1]);
    put_colour(at + 2u * shape.channel_words, quad, blue - taken[2]);
}

// Returns what lobes take from four bases of a pair in red, green and blue: the sum over the nodes of their factors
// times the lobes there, in the residual's curve.
fn taken_by_lobes(pair: u32, quad: u32) -> mat3x4<f32> {
    let pairs = shape.views * shape.lights;
    let head = 4u * (pair / pairs);
    let lobes = nodes[head + 1u];
    let tables = nodes[head + 2u];
    let weights = tables + lobes * pairs;
    let factors_at = weights + 3u * nodes[head] * lobes;
    let nothing = residual_encode(shape.residual_kind, vec3<f32>(0.0), shape.epsilon);
    var sum = mat3x4<f32>();
    for (var node = 0u; node < nodes[head]; node++) {
        var value = vec3<f32>(0.0);
        for (var lobe = 0u; lobe < lobes; lobe++) {
            let at = weights + 3u * (node * lobes + lobe);
            let weight = vec3<f32>(number(at), number(at + 1u), number(at + 2u));
            value += weight * number(tables + lobe * pairs + pair % pairs);
        }
        let y = residual_encode(shape.residual_kind, value, shape.epsilon) - nothing;
        let at = factors_at + 4u * (node * shape.taken_quads + quad);
        let factor = vec4<f32>(number(at), number(at + 1u), number(at + 2u), number(at + 3u));
        sum += mat3x4<f32>(factor * y.x, factor * y.y, factor * y.z);
    }
    return sum;
}

// Returns a number of the nodes.
fn number(at: u32) -> f32 {
    return bitcast<f32>(nodes[at]);
}

// Writes two words; the last quad has only one where the words of a pair and colour are odd.
fn put_colour(index: u32, quad: u32, bases: vec4<f32>) {
    let clamped = clamp(bases, vec4<f32>(-MAX_HALF), vec4<f32>(MAX_HALF));
    // An index before the piece wraps to beyond its end.
    let at = index - slice.piece_from;
    if at < slice.piece_words {
        words[at] = pack2x16float(clamped.xy);
    }
    if at + 1u < slice.piece_words && 2u * quad + 1u < shape.channel_words {
        words[at + 1u] = pack2x16float(clamped.zw);
    }
}
