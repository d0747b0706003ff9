// Shading by relief between the measured directions. Twin: decode/relief.rs.

const RELIEF_WORDS: u32 = 4u;
const SLOPE_STEP: f32 = 0.0001220703125;
const HORIZON_STEP: f32 = 0.015625;
const MAX_ALBEDO: f32 = 2.0;
const EVEN_LIGHT: f32 = 0.2;
const SHADOW_EDGE: f32 = 0.2;
const GLOSS_ALPHA: f32 = 0.3;
const GLOSS_NORMAL: f32 = 0.04;
const MIN_COS_EYE: f32 = 0.02;
const MIN_BEYOND: f32 = 0.3;
const NORMAL_SHARE: f32 = 0.1;

// A surface point, interpolated between texels.
struct ReliefPoint {
    normal: vec3<f32>,
    // Root of the albedo over MAX_ALBEDO.
    code: vec3<f32>,
    // Tangents of the horizon's elevation, the first four azimuths and the others.
    horizons: mat2x4<f32>,
}

// A light as the shading of points needs it.
struct ReliefLight {
    wi: vec3<f32>,
    // Tangent of the elevation.
    tangent: f32,
    // Share of each azimuth's horizon.
    azimuths: mat2x4<f32>,
}

// The surface points of a texel that are seen from one eye.
struct SeenRelief {
    likeness: f32,
    shading: f32,
    gloss: f32,
    // Unit vector to the eye, or to the nearest one within the hull of the measured views.
    eye: vec3<f32>,
    own: ReliefPoint,
    of_views: array<ReliefPoint, 3>,
    // Albedo of an upright plane at the texel of each neighbouring view, one a column.
    flat: mat3x3<f32>,
}

// What relief adds at a light, in the root curve.
struct ReliefTerms {
    added: vec3<f32>,
    shading: vec3<f32>,
}

fn relief_albedo(code: vec3<f32>) -> vec3<f32> {
    return MAX_ALBEDO * code * code;
}

// Reads the point at `place`, columns and rows, of the layer whose block begins at word `layer` of the asset at word
// `base`.
fn relief_read(base: u32, layer: u32, given: vec2<f32>) -> ReliefPoint {
    let size = level_size(layer);
    let most = size - vec2<u32>(1u);
    let place = clamp(given, vec2<f32>(0.0), vec2<f32>(most));
    let first = vec2<u32>(place);
    let next = min(first + vec2<u32>(1u), most);
    let part = place - vec2<f32>(first);
    let records = base + asset_word(layer + BLOCK_RELIEF);
    var slopes = vec2<f32>(0.0);
    var point = ReliefPoint(vec3<f32>(0.0), vec3<f32>(0.0), mat2x4<f32>());
    for (var corner = 0u; corner < 4u; corner++) {
        let right = (corner & 1u) == 1u;
        let below = corner >= 2u;
        let weight = select(1.0 - part.x, part.x, right) * select(1.0 - part.y, part.y, below);
        let texel = select(first.y, next.y, below) * size.x + select(first.x, next.x, right);
        let at = records + RELIEF_WORDS * texel;
        let words = asset_word(at);
        // Both halves are signed.
        slopes += weight * SLOPE_STEP * vec2<f32>(f32(bitcast<i32>(words << 16u) >> 16u), f32(bitcast<i32>(words) >> 16u));
        point.code += weight * unpack4x8unorm(asset_word(at + 1u)).xyz;
        point.horizons[0] += (weight * HORIZON_STEP * 255.0) * unpack4x8unorm(asset_word(at + 2u));
        point.horizons[1] += (weight * HORIZON_STEP * 255.0) * unpack4x8unorm(asset_word(at + 3u));
    }
    point.normal = vec3<f32>(-slopes, 1.0) / sqrt(1.0 + dot(slopes, slopes));
    return point;
}

// Returns how unlike two points are.
fn relief_unlikeness(a: ReliefPoint, b: ReliefPoint) -> f32 {
    let code = a.code - b.code;
    let normal = a.normal - b.normal;
    return dot(code, code) / 3.0 + NORMAL_SHARE * dot(normal, normal);
}

// Returns the factor on the albedo under `light`, and the gloss towards the eye at `wo`.
fn relief_shade(point: ReliefPoint, light: ReliefLight, wo: vec3<f32>) -> vec2<f32> {
    let cos_light = max(dot(point.normal, light.wi), 0.0);
    let lit = relief_share(light, point.horizons) * cos_light;
    let sum = light.wi + wo;
    let half = sum / sqrt(max(dot(sum, sum), 1e-12));
    let cos_eye = max(dot(point.normal, wo), MIN_COS_EYE);
    let cos_half = max(dot(point.normal, half), 0.0);
    let alpha2 = GLOSS_ALPHA * GLOSS_ALPHA;
    let around = cos_half * cos_half * (alpha2 - 1.0) + 1.0;
    let masked = cos_light * sqrt(cos_eye * cos_eye * (1.0 - alpha2) + alpha2)
        + cos_eye * sqrt(cos_light * cos_light * (1.0 - alpha2) + alpha2);
    let grazing = clamp(1.0 - dot(wo, half), 0.0, 1.0);
    let grazing2 = grazing * grazing;
    let fresnel = GLOSS_NORMAL + (1.0 - GLOSS_NORMAL) * grazing2 * grazing2 * grazing;
    let gloss = fresnel * alpha2 / (around * around) * 0.5 / (masked + 1e-6) * lit;
    return vec2<f32>(lit + EVEN_LIGHT * light.wi.z, gloss);
}

fn relief_light(wi: vec3<f32>) -> ReliefLight {
    let xy = abs(wi.xy);
    // The tangent of the angle within an octant stands for the angle, in units of 45 degrees.
    let within = min(xy.x, xy.y) / max(max(xy.x, xy.y), 1e-6);
    let quadrant = select(within, 2.0 - within, xy.y > xy.x);
    let upper = select(quadrant, 4.0 - quadrant, wi.x < 0.0);
    let around = select(upper, 8.0 - upper, wi.y < 0.0);
    let first = floor(around);
    let near = u32(first) % 8u;
    let far = (near + 1u) % 8u;
    let part = around - first;
    var azimuths = mat2x4<f32>();
    for (var azimuth = 0u; azimuth < 8u; azimuth++) {
        let share = select(0.0, 1.0 - part, azimuth == near) + select(0.0, part, azimuth == far);
        azimuths[azimuth / 4u][azimuth % 4u] = share;
    }
    return ReliefLight(wi, wi.z / max(length(wi.xy), 1e-4), azimuths);
}

// Returns the share of the light that horizons leave.
fn relief_share(light: ReliefLight, horizons: mat2x4<f32>) -> f32 {
    let horizon = dot(light.azimuths[0], horizons[0]) + dot(light.azimuths[1], horizons[1]);
    return clamp((light.tangent - horizon) / (2.0 * SHADOW_EDGE) + 0.5, 0.0, 1.0);
}

// Finds the surface points that the eye at `wo` sees in texel `t`, and that the measured `views` show in the texels
// `shown`. `eye` is the eye's nearest direction within the hull of the measured views.
fn relief_seen(
    t: Texel,
    wo: vec3<f32>,
    eye: vec3<f32>,
    given_views: array<vec3<f32>, 3>,
    shown: vec3<u32>,
    weights: vec3<f32>,
) -> SeenRelief {
    var views = given_views;
    let field = height_field(t.base, t.layer);
    let width = field.size.x;
    var seen: SeenRelief;
    seen.likeness = asset_f32(t.layer + BLOCK_RELIEF_LIKENESS);
    seen.shading = asset_f32(t.layer + BLOCK_RELIEF_SHADING);
    seen.gloss = asset_f32(t.layer + BLOCK_RELIEF_GLOSS);
    seen.eye = eye;
    let records = t.base + asset_word(t.layer + BLOCK_RELIEF);
    // One loop serves the eye too, its number 3, because shader compilers inline every call.
    for (var v = 0u; v < 4u; v++) {
        if v == 3u || weights[min(v, 2u)] > 0.0 {
            let texel = select(t.texel, shown[min(v, 2u)], v < 3u);
            let place = vec2<f32>(vec2<u32>(texel % width, texel / width));
            let towards = select(wo, views[min(v, 2u)], v < 3u);
            let point = relief_read(t.base, t.layer, height_seen_place(field, place, towards));
            if v < 3u {
                seen.of_views[v] = point;
                let code = unpack4x8unorm(asset_word(records + RELIEF_WORDS * texel + 1u)).xyz;
                seen.flat[v] = (1.0 + EVEN_LIGHT) * relief_albedo(code);
            } else {
                seen.own = point;
            }
        }
    }
    return seen;
}

// Returns the weights of the neighbouring views, less where a view shows a point unlike the eye's; they sum up to 1.
fn relief_view_weights(given: SeenRelief, weights: vec3<f32>) -> vec3<f32> {
    var seen = given;
    var weighed = vec3<f32>(0.0);
    for (var v = 0u; v < 3u; v++) {
        if weights[v] > 0.0 {
            weighed[v] = weights[v] / (1.0 + seen.likeness * relief_unlikeness(seen.own, seen.of_views[v]));
        }
    }
    return weighed / (weighed.x + weighed.y + weighed.z);
}

// Returns the weights of three measured lights, less where the shading `of_lights` of the neighbouring views is unlike
// `here`; they sum up to 1.
fn relief_light_weights(
    seen: SeenRelief,
    weights: vec3<f32>,
    here: vec3<f32>,
    of_lights: mat3x3<f32>,
) -> vec3<f32> {
    let off = of_lights - mat3x3<f32>(here, here, here);
    let squares = vec3<f32>(dot(off[0], off[0]), dot(off[1], off[1]), dot(off[2], off[2]));
    let weighed = weights / (vec3<f32>(1.0) + seen.likeness / 3.0 * squares);
    return weighed / (weighed.x + weighed.y + weighed.z);
}

// Returns the terms of a point of an upright plane of albedo `flat`, seen from `wo`.
fn relief_terms(
    seen: SeenRelief,
    point: ReliefPoint,
    light: ReliefLight,
    wo: vec3<f32>,
    flat: vec3<f32>,
    epsilon: f32,
) -> ReliefTerms {
    let shade = relief_shade(point, light, wo);
    let body = relief_albedo(point.code) * shade.x;
    let shine = select(0.0, shade.y, seen.gloss > 0.0);
    let of_body = residual_encode(RESIDUAL_ROOT, body, epsilon);
    let whole = residual_encode(RESIDUAL_ROOT, body + shine, epsilon);
    let upright = residual_encode(RESIDUAL_ROOT, flat * light.wi.z, epsilon);
    return ReliefTerms(seen.shading * (of_body - upright) + seen.gloss * (whole - of_body), whole);
}

// Returns the terms of what neighbouring `views` show, with their weights, under a measured light at `wi`.
fn relief_of_views(
    given: SeenRelief,
    wi: vec3<f32>,
    given_views: array<vec3<f32>, 3>,
    weights: vec3<f32>,
    epsilon: f32,
) -> ReliefTerms {
    var seen = given;
    var views = given_views;
    let light = relief_light(wi);
    var sum = ReliefTerms(vec3<f32>(0.0), vec3<f32>(0.0));
    for (var v = 0u; v < 3u; v++) {
        if weights[v] > 0.0 {
            let terms = relief_terms(seen, seen.of_views[v], light, views[v], seen.flat[v], epsilon);
            sum.added += weights[v] * terms.added;
            sum.shading += weights[v] * terms.shading;
        }
    }
    return sum;
}

// Returns the terms of the point that the eye sees under the light at `wi`.
fn relief_here(seen: SeenRelief, wi: vec3<f32>, weights: vec3<f32>, epsilon: f32) -> ReliefTerms {
    return relief_terms(seen, seen.own, relief_light(wi), seen.eye, seen.flat * weights, epsilon);
}
