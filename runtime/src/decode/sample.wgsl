// Importance sampling: directions to light drawn where the lobes of a texel are large for an eye, with their density.
// Twin: decode/sample.rs, which says how each family is drawn.

const COSINE_SHARE: f32 = 0.5;
const MIN_ALPHA: f32 = 0.02;
const MIN_AXIS: f32 = 1e-3;
const MIN_FRESNEL: f32 = 0.02;
const MIN_FACET_COS: f32 = 1e-6;
const SAMPLE_PI: f32 = 3.14159265;
const SAMPLE_TAU: f32 = 6.2831853;

// Returns the roughness along tangent and bitangent of a family over a half vector, and 0 for the others.
fn sample_alpha(lobe: LobeSetup) -> vec2<f32> {
    let p = lobe.params;
    var alpha = vec2<f32>(0.0);
    switch lobe.family {
        case 2u: { alpha = vec2<f32>(sqrt(2.0 / (p.x + 2.0))); }
        case 3u: { alpha = p.xy; }
        case 4u, 7u: { alpha = vec2<f32>(p.x); }
        case 6u: { alpha = sqrt(2.0 / (p.xy + 2.0)); }
        default: { return alpha; }
    }
    return max(alpha, vec2<f32>(MIN_ALPHA));
}

// Returns the axis of a Lafortune lobe in its own frame, and the axis' length.
fn sample_axis(lobe: LobeSetup, wo: vec3<f32>) -> vec4<f32> {
    let bitangent = cross(lobe.normal, lobe.tangent);
    let a = lobe.params.xyz * vec3<f32>(dot(lobe.tangent, wo), dot(bitangent, wo), dot(lobe.normal, wo));
    let size = length(a);
    return vec4<f32>(a / max(size, MIN_AXIS), size);
}

// Returns the direction to the eye in the lobe's frame, in which the facets are stretched to those of a sphere.
fn sample_stretched(lobe: LobeSetup, wo: vec3<f32>, a: vec2<f32>) -> vec3<f32> {
    let bitangent = cross(lobe.normal, lobe.tangent);
    return vec3<f32>(a * vec2<f32>(dot(lobe.tangent, wo), dot(bitangent, wo)), dot(lobe.normal, wo));
}

// Turns a vector from the lobe's frame to the layer's.
fn sample_world(lobe: LobeSetup, v: vec3<f32>) -> vec3<f32> {
    return lobe.tangent * v.x + cross(lobe.normal, lobe.tangent) * v.y + lobe.normal * v.z;
}

// Draws a direction about +z with the density (exponent + 1) / (2 pi) cos^exponent.
fn sample_about_z(exponent: f32, at: vec2<f32>) -> vec3<f32> {
    let c = pow(max(at.x, 1e-12), 1.0 / (exponent + 1.0));
    let s = sqrt(max(1.0 - c * c, 0.0));
    return vec3<f32>(s * cos(SAMPLE_TAU * at.y), s * sin(SAMPLE_TAU * at.y), c);
}

// Turns a vector by the rotation that takes +z to the unit vector `axis` [Duff 2017].
fn sample_turned(v: vec3<f32>, axis: vec3<f32>) -> vec3<f32> {
    let sign = select(1.0, -1.0, axis.z < 0.0);
    let a = -1.0 / (sign + axis.z);
    let b = axis.x * axis.y * a;
    let x = vec3<f32>(1.0 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x);
    let y = vec3<f32>(b, sign + axis.y * axis.y * a, -axis.y);
    return x * v.x + y * v.y + axis * v.z;
}

fn sample_lobe_direction(lobe: LobeSetup, wo: vec3<f32>, at: vec2<f32>) -> vec3<f32> {
    let a = sample_alpha(lobe);
    if a.x > 0.0 {
        let eye = normalize(sample_stretched(lobe, wo, a));
        let c = (1.0 - at.x) * (1.0 + eye.z) - eye.z;
        let s = sqrt(max(1.0 - c * c, 0.0));
        let facet = vec3<f32>(s * cos(SAMPLE_TAU * at.y), s * sin(SAMPLE_TAU * at.y), c) + eye;
        let h = sample_world(lobe, normalize(vec3<f32>(a * facet.xy, max(facet.z, MIN_FACET_COS))));
        return 2.0 * dot(wo, h) * h - wo;
    }
    if lobe.family == 5u {
        let axis = sample_axis(lobe, wo);
        if axis.w > MIN_AXIS {
            return sample_world(lobe, sample_turned(sample_about_z(lobe.params.w, at), axis.xyz));
        }
    }
    return sample_world(lobe, sample_about_z(1.0, at));
}

fn sample_lobe_density(lobe: LobeSetup, wi: vec3<f32>, wo: vec3<f32>) -> f32 {
    let a = sample_alpha(lobe);
    if a.x > 0.0 {
        let sum = wi + wo;
        let size = length(sum);
        if size < 1e-4 {
            return 0.0;
        }
        let h = sum * (select(1.0, -1.0, dot(lobe.normal, sum) < 0.0) / size);
        let bitangent = cross(lobe.normal, lobe.tangent);
        let x = dot(lobe.tangent, h) / a.x;
        let y = dot(bitangent, h) / a.y;
        let z = dot(lobe.normal, h);
        let q = x * x + y * y + z * z;
        let d = 1.0 / (SAMPLE_PI * a.x * a.y * max(q * q, 1e-12));
        // Twice what the facets that the eye sees cover, projected on the plane across it. Both forms are equal; the
        // second does not cancel where the eye is below the lobe's horizon.
        let eye = sample_stretched(lobe, wo, a);
        var seen = eye.z + length(eye);
        if eye.z <= 0.0 {
            seen = dot(eye.xy, eye.xy) / (length(eye) - eye.z);
        }
        return select(0.0, d / (2.0 * max(seen, 1e-12)), dot(wo, h) > 0.0);
    }
    if lobe.family == 5u {
        let axis = sample_axis(lobe, wo);
        if axis.w > MIN_AXIS {
            let exponent = lobe.params.w;
            return (exponent + 1.0) / SAMPLE_TAU * power(max(dot(sample_world(lobe, axis.xyz), wi), 0.0), exponent);
        }
    }
    return max(dot(lobe.normal, wi), 0.0) / SAMPLE_PI;
}

// Returns about the share of a white sky that a lobe of weight 1 sends to the eye.
fn sample_share(lobe: LobeSetup, wo: vec3<f32>) -> f32 {
    let p = lobe.params;
    switch lobe.family {
        case 4u, 7u: { return max(schlick(p.y, dot(lobe.normal, wo)), MIN_FRESNEL); }
        case 6u: { return max(schlick(p.z, dot(lobe.normal, wo)), MIN_FRESNEL); }
        case 5u: {
            let axis = sample_axis(lobe, wo);
            let width = 1.0 / (p.w + 2.0);
            return 2.0 * width * power(min(axis.w, 1.0), p.w) * max(axis.z, sqrt(width));
        }
        case 8u: { return exp(max(p.x * (dot(p.yzw, wo) - 1.0), -80.0)); }
        default: { return 1.0; }
    }
}

// A lobe of a texel and its importance.
struct SampleLobe {
    lobe: LobeSetup,
    importance: f32,
}

fn sample_lobe_at(t: Texel, slot: u32, wo: vec3<f32>) -> SampleLobe {
    let reference = asset_word(t.base + asset_word(t.layer + BLOCK_REFS) + t.first_ref + slot);
    let dictionary = texel_dictionary(t, t.edit);
    let one = texel_lobe(dictionary, reference);
    let weight = (one.weights.x + one.weights.y + one.weights.z) / 3.0;
    return SampleLobe(one.lobe, weight * sample_share(one.lobe, wo));
}

// Draws a direction to light that matters to this eye, in the texel's frame; it may lie where the value is 0.
fn sample_direction(viewed: ViewedTexel, at: vec3<f32>) -> vec3<f32> {
    let t = viewed.t;
    var total = 0.0;
    for (var slot = 0u; slot < t.lobes; slot++) {
        total += sample_lobe_at(t, slot, viewed.wo).importance;
    }
    var wi = sample_about_z(1.0, at.xy);
    if total > 0.0 && at.z >= COSINE_SHARE {
        var rest = (at.z - COSINE_SHARE) / (1.0 - COSINE_SHARE) * total;
        for (var slot = 0u; slot < t.lobes; slot++) {
            let one = sample_lobe_at(t, slot, viewed.wo);
            if rest < one.importance || slot + 1u == t.lobes {
                wi = sample_lobe_direction(one.lobe, viewed.wo, at.xy);
                break;
            }
            rest -= one.importance;
        }
    }
    if asset_word(t.layer + BLOCK_LIGHT_SIDE) == 1u {
        wi.z = -wi.z;
    }
    return wi;
}

fn sample_density(viewed: ViewedTexel, wi_given: vec3<f32>) -> f32 {
    let t = viewed.t;
    var wi = wi_given;
    if asset_word(t.layer + BLOCK_LIGHT_SIDE) == 1u {
        wi.z = -wi.z;
    }
    let cosine = max(wi.z, 0.0) / SAMPLE_PI;
    var sum = 0.0;
    var total = 0.0;
    for (var slot = 0u; slot < t.lobes; slot++) {
        let one = sample_lobe_at(t, slot, viewed.wo);
        sum += one.importance * sample_lobe_density(one.lobe, wi, viewed.wo);
        total += one.importance;
    }
    if total > 0.0 {
        return COSINE_SHARE * cosine + (1.0 - COSINE_SHARE) * sum / total;
    }
    return cosine;
}
