// The gloss of a leaf's face: Cook-Torrance with Beckmann facets of two roughnesses. Twin: leaf/lobe.rs.

const LEAF_MIN_FACET: f32 = 1e-4;
const LEAF_MIN_HALF: f32 = 1e-6;
const LEAF_MAX_EXPONENT: f32 = 80.0;

struct LeafLobe {
    index: f32,
    mean_albedo: f32,
    // Roughness along and across the veins.
    gamma: vec2<f32>,
}

// A face of a leaf at one place, in the face's own frame (z away from the leaf).
struct LeafFace {
    normal: vec3<f32>,
    gloss: f32,
    // Unit vectors along and across the veins, in the tangent plane of the normal.
    along: vec3<f32>,
    across: vec3<f32>,
}

fn leaf_fresnel(index: f32, cosine: f32) -> f32 {
    let c = clamp(cosine, 0.0, 1.0);
    let g = sqrt(max(index * index + c * c - 1.0, 0.0));
    let ratio = (g - c) / max(g + c, 1e-9);
    let other = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
    return 0.5 * ratio * ratio * (1.0 + other * other);
}

// Returns where a vertical plane through a direction cuts the roughness: 0 for the smaller, 1 for the larger.
fn leaf_cut(lobe: LeafLobe, w: vec2<f32>) -> f32 {
    let w2 = w * w;
    let gamma2 = lobe.gamma * lobe.gamma;
    let share = w2.x / max(w2.x + w2.y, 1e-20);
    let gamma = sqrt(max(gamma2.y + (gamma2.x - gamma2.y) * share, 0.0));
    let least = min(lobe.gamma.x, lobe.gamma.y);
    return clamp((gamma - least) / max(abs(lobe.gamma.x - lobe.gamma.y), 1e-6), 0.0, 1.0);
}

// Returns the share of light that the gloss at full strength reflects, from the table of the leaf whose first word is
// number `base`.
fn leaf_albedo(base: u32, lobe: LeafLobe, cosine: f32, w: vec2<f32>) -> f32 {
    let x = leaf_cut(lobe, w) * f32(LEAF_ALBEDO_COLUMNS - 1u);
    let y = sqrt(clamp(cosine, 0.0, 1.0)) * f32(LEAF_ALBEDO_ROWS - 1u);
    let column = min(u32(x), LEAF_ALBEDO_COLUMNS - 2u);
    let row = min(u32(y), LEAF_ALBEDO_ROWS - 2u);
    let at = base + LEAF_ALBEDO_AT + row * LEAF_ALBEDO_COLUMNS + column;
    let s = x - f32(column);
    let low = mix(asset_f32(at), asset_f32(at + 1u), s);
    let high = mix(asset_f32(at + LEAF_ALBEDO_COLUMNS), asset_f32(at + LEAF_ALBEDO_COLUMNS + 1u), s);
    return mix(low, high, y - f32(row));
}

// Returns the density of facets about a unit vector, times pi.
fn leaf_facets(lobe: LeafLobe, face: LeafFace, h: vec3<f32>) -> f32 {
    let z = dot(face.normal, h);
    if z <= LEAF_MIN_FACET {
        return 0.0;
    }
    let tangent = vec2<f32>(dot(face.along, h), dot(face.across, h)) / lobe.gamma;
    let exponent = dot(tangent, tangent) / (z * z);
    if exponent >= LEAF_MAX_EXPONENT {
        return 0.0;
    }
    return exp(-exponent) / (lobe.gamma.x * lobe.gamma.y * z * z * z * z);
}

// Returns the half vector on the side of the face, and its cosine to `wo`, which is 0 where there is no half vector.
fn leaf_half_vector(face: LeafFace, wi: vec3<f32>, wo: vec3<f32>) -> vec4<f32> {
    let sum = wi + wo;
    let h = sum * (select(1.0, -1.0, dot(face.normal, sum) < 0.0) / max(length(sum), LEAF_MIN_HALF));
    return vec4<f32>(h, dot(wo, h));
}

fn leaf_lobe(lobe: LeafLobe, face: LeafFace, wi: vec3<f32>, wo: vec3<f32>, cos_i: f32, cos_o: f32) -> f32 {
    let h = leaf_half_vector(face, wi, wo);
    if cos_i <= 0.0 || cos_o <= 0.0 || h.w <= LEAF_MIN_HALF {
        return 0.0;
    }
    let shading = 2.0 * dot(face.normal, h.xyz) / h.w;
    let masked = min(min(shading * cos_i, 1.0) / cos_o, shading);
    return 0.25 * leaf_fresnel(lobe.index, h.w) * leaf_facets(lobe, face, h.xyz) * masked;
}

fn leaf_lobe_direction(lobe: LeafLobe, face: LeafFace, wo: vec3<f32>, at: vec2<f32>) -> vec3<f32> {
    let slope = sqrt(max(-log(max(1.0 - at.x, 1e-12)), 0.0));
    let tangent = lobe.gamma * slope * vec2<f32>(cos(SAMPLE_TAU * at.y), sin(SAMPLE_TAU * at.y));
    let h = (tangent.x * face.along + tangent.y * face.across + face.normal) / sqrt(1.0 + dot(tangent, tangent));
    return 2.0 * dot(wo, h) * h - wo;
}

fn leaf_lobe_density(lobe: LeafLobe, face: LeafFace, wi: vec3<f32>, wo: vec3<f32>) -> f32 {
    let h = leaf_half_vector(face, wi, wo);
    return leaf_facets(lobe, face, h.xyz) * max(dot(face.normal, h.xyz), 0.0) / (4.0 * max(abs(h.w), LEAF_MIN_HALF));
}
