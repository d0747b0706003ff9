// The decoder: from texel, light and eye to reflectance times cosine. Twin: decode.rs; the offsets
// are those of resident.rs (`block`), compared by a test.

const ASSET_LAYERS: u32 = 4u;
const BLOCK_LIGHT_SIDE: u32 = 0u;
const BLOCK_VIEW_SIDE: u32 = 1u;
const BLOCK_RESIDUAL_KIND: u32 = 2u;
const BLOCK_EPSILON: u32 = 3u;
const BLOCK_BASES: u32 = 4u;
const BLOCK_CHANNEL_WORDS: u32 = 5u;
const BLOCK_LIGHTS: u32 = 6u;
const BLOCK_VIEWS: u32 = 7u;
const BLOCK_RECORDS: u32 = 8u;
const BLOCK_REFS: u32 = 9u;
const BLOCK_DICTIONARIES: u32 = 10u;
const BLOCK_BASIS: u32 = 11u;
const BLOCK_CODES: u32 = 12u;
const BLOCK_CODE_WORDS: u32 = 13u;
const LOBE_ROLE_GUIDE: u32 = 1u;
const BLOCK_LIGHT_COUNT: u32 = 14u;
const BLOCK_PAIRS: u32 = 15u;
const BLOCK_HORIZON: u32 = 16u;
const BLOCK_LOBE_ROLE: u32 = 17u;
const BLOCK_HEIGHTS: u32 = 18u;
const BLOCK_HEIGHT_STEP: u32 = 19u;
const BLOCK_LEAST_HEIGHT: u32 = 20u;
const BLOCK_MOST_HEIGHT: u32 = 21u;

const INTERPOLATION_EXACT: u32 = 1u;
const RATIO_EPSILON: f32 = 0.03;
const RATIO_LEAST: f32 = 0.3;
const RATIO_MOST: f32 = 4.0;

struct BtfOptions {
    components: u32,
    lobes: u32,
    interpolation: u32,
    // 1 removes the parallax of eyes outside the views' hull, where the asset has heights.
    parallax: u32,
}

// A texel within a layer: what does not depend on the directions.
struct BtfTexel {
    base: u32,
    layer: u32,
    texel: u32,
    cluster: u32,
    lobes: u32,
    first_ref: u32,
    bases: u32,
    pad: u32,
}

fn btf_size(base: u32) -> vec2<u32> {
    return vec2<u32>(asset_word(base), asset_word(base + 1u));
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
    let layers = asset_word(base + 2u);
    for (var layer = 0u; layer < layers; layer++) {
        let at = base + asset_word(base + ASSET_LAYERS + layer);
        if asset_word(at + BLOCK_LIGHT_SIDE) == light_side && asset_word(at + BLOCK_VIEW_SIDE) == view_side {
            return layer;
        }
    }
    return layers;
}

fn btf_texel_record(base: u32, layer: u32, texel: u32, options: BtfOptions) -> BtfTexel {
    return btf_texel_at(base, base + asset_word(base + ASSET_LAYERS + layer), texel, options);
}

// The same; `at` is the layer's block.
fn btf_texel_at(base: u32, at: u32, texel: u32, options: BtfOptions) -> BtfTexel {
    let record = base + asset_word(at + BLOCK_RECORDS) + 2u * texel;
    let head = asset_word(record);
    // components + 1 without wrapping round at 0xffffffff.
    let wanted = min(options.components, 0xfffffffeu) + 1u;
    return BtfTexel(
        base,
        at,
        texel,
        head & 0xffffu,
        min(head >> 16u, options.lobes),
        asset_word(record + 1u),
        min(asset_word(at + BLOCK_BASES), wanted),
        0u,
    );
}

fn btf_lobe_sum(t: BtfTexel, wi: vec3<f32>, wo: vec3<f32>) -> vec3<f32> {
    let dictionary = t.base + asset_word(t.base + asset_word(t.layer + BLOCK_DICTIONARIES) + t.cluster);
    let refs = t.base + asset_word(t.layer + BLOCK_REFS) + t.first_ref;
    var sum = vec3<f32>(0.0);
    for (var slot = 0u; slot < t.lobes; slot++) {
        let reference = asset_word(refs + slot);
        let lobe = lobe_from_resident(dictionary + (reference & 0xffu) * LOBE_RESIDENT_WORDS);
        let value = lobe_eval(lobe, wi, wo);
        sum += value * vec3<f32>(
            weight_from_byte((reference >> 8u) & 0xffu, lobe.weight_scale),
            weight_from_byte((reference >> 16u) & 0xffu, lobe.weight_scale),
            weight_from_byte((reference >> 24u) & 0xffu, lobe.weight_scale),
        );
    }
    return sum;
}

fn btf_basis_weight(t: BtfTexel, index: u32) -> f32 {
    if index == 0u {
        return 1.0;
    }
    if index >= t.bases {
        return 0.0;
    }
    let component = index - 1u;
    let codes = t.base + asset_word(t.layer + BLOCK_CODES) + t.texel * asset_word(t.layer + BLOCK_CODE_WORDS);
    let word = asset_word(codes + component / 4u);
    return coefficient_from_byte((word >> (8u * (component % 4u))) & 0xffu);
}

// The residual of a texel at a view and three lights.
fn btf_residual(t: BtfTexel, view: u32, lights: vec3<u32>) -> mat3x3<f32> {
    let channel_words = asset_word(t.layer + BLOCK_CHANNEL_WORDS);
    let rows = t.base + asset_word(t.layer + BLOCK_BASIS)
        + t.cluster * asset_word(t.layer + BLOCK_PAIRS) * 3u * channel_words;
    let first = rows + view * asset_word(t.layer + BLOCK_LIGHT_COUNT) * 3u * channel_words;
    var sum = mat3x3<f32>();
    for (var word = 0u; word < (t.bases + 1u) / 2u; word++) {
        let weights = vec2<f32>(btf_basis_weight(t, 2u * word), btf_basis_weight(t, 2u * word + 1u));
        for (var l = 0u; l < 3u; l++) {
            let at = first + lights[l] * 3u * channel_words + word;
            sum[l] += vec3<f32>(
                dot(weights, unpack2x16float(asset_word(at))),
                dot(weights, unpack2x16float(asset_word(at + channel_words))),
                dot(weights, unpack2x16float(asset_word(at + 2u * channel_words))),
            );
        }
    }
    return sum;
}

fn btf_decode(base: u32, layer: u32, texel: u32, wi_given: vec3<f32>, wo_given: vec3<f32>, options: BtfOptions) -> vec3<f32> {
    let t = btf_texel_record(base, layer, texel, options);
    var wi = wi_given;
    var wo = wo_given;
    if asset_word(t.layer + BLOCK_LIGHT_SIDE) == 1u {
        wi.z = -wi.z;
    }
    if asset_word(t.layer + BLOCK_VIEW_SIDE) == 1u {
        wo.z = -wo.z;
    }
    if wi.z <= 0.0 || wo.z <= 0.0 {
        return vec3<f32>(0.0);
    }
    let fade = min(wi.z / asset_f32(t.layer + BLOCK_HORIZON), 1.0);
    let exact = options.interpolation == INTERPOLATION_EXACT;
    let lights_at = base + asset_word(t.layer + BLOCK_LIGHTS);
    let views_at = base + asset_word(t.layer + BLOCK_VIEWS);
    let view = sphere_locate(views_at, wo);
    var wo_measured: array<vec3<f32>, 3>;
    for (var v = 0u; v < 3u; v++) {
        wo_measured[v] = sphere_direction(views_at, view.ids[v]);
    }
    // The texel that each of the views shows.
    var seen = SeenBy(vec3<u32>(texel), view.weights);
    let shifted = options.parallax != 0u && view.beyond < 1.0 && asset_word(t.layer + BLOCK_HEIGHTS) != 0u;
    if shifted {
        let range = vec2<f32>(asset_f32(t.layer + BLOCK_LEAST_HEIGHT), asset_f32(t.layer + BLOCK_MOST_HEIGHT));
        let heights = base + asset_word(t.layer + BLOCK_HEIGHTS);
        let field = HeightField(heights, btf_size(base), asset_f32(t.layer + BLOCK_HEIGHT_STEP), range);
        seen = height_seen_by(field, texel, wo, view.beyond, wo_measured, view.weights);
    }
    var of_view: array<BtfTexel, 3>;
    for (var v = 0u; v < 3u; v++) {
        of_view[v] = t;
        if shifted {
            of_view[v] = btf_texel_at(base, t.layer, seen.texels[v], options);
        }
    }

    // Lobes that only guide are not part of the value, and the fast rule does not ask them.
    let guide = asset_word(t.layer + BLOCK_LOBE_ROLE) == LOBE_ROLE_GUIDE;
    var here = vec3<f32>(0.0);
    if !guide || exact || t.bases == 0u {
        if shifted {
            for (var v = 0u; v < 3u; v++) {
                if seen.weights[v] > 0.0 {
                    here += seen.weights[v] * btf_lobe_sum(of_view[v], wi, wo);
                }
            }
        } else {
            here = btf_lobe_sum(t, wi, wo);
        }
    }
    if t.bases == 0u {
        return max(here, vec3<f32>(0.0)) * fade;
    }
    let light = sphere_locate(lights_at, wi);
    let kind = asset_word(t.layer + BLOCK_RESIDUAL_KIND);
    let epsilon = asset_f32(t.layer + BLOCK_EPSILON);
    let base_share = select(1.0, 0.0, guide);

    var residual: array<mat3x3<f32>, 3>;
    for (var v = 0u; v < 3u; v++) {
        residual[v] = mat3x3<f32>();
        if seen.weights[v] > 0.0 {
            residual[v] = btf_residual(of_view[v], view.ids[v], light.ids);
        }
    }

    if !exact {
        var r = vec3<f32>(0.0);
        for (var i = 0u; i < 9u; i++) {
            r += seen.weights[i / 3u] * light.weights[i % 3u] * residual[i / 3u][i % 3u];
        }
        let scaled = select(light.beyond, 1.0, guide);
        let falling = select(1.0, light.beyond, guide);
        return residual_combine(kind, base_share * here, r, epsilon, scaled) * falling * fade;
    }

    var decoded = vec3<f32>(0.0);
    var lobes = vec3<f32>(0.0);
    for (var i = 0u; i < 9u; i++) {
        let weight = seen.weights[i / 3u] * light.weights[i % 3u];
        let wi_measured = sphere_direction(lights_at, light.ids[i % 3u]);
        let s = btf_lobe_sum(of_view[i / 3u], wi_measured, wo_measured[i / 3u]);
        decoded += weight * residual_combine(kind, base_share * s, residual[i / 3u][i % 3u], epsilon, 1.0);
        lobes += weight * s;
    }
    let ratio = (here + RATIO_EPSILON) / (lobes + RATIO_EPSILON);
    return decoded * clamp(ratio, vec3<f32>(RATIO_LEAST), vec3<f32>(RATIO_MOST)) * fade;
}
