// The nine lobe families. Twin: asset/lobe.rs; equations in docs/reference/model.md, section 3.

const MIN_COS_VIEW: f32 = 0.02;
const MIN_HALF: f32 = 1e-3;
const LOBE_RESIDENT_WORDS: u32 = 16u;

struct LobeSetup {
    normal: vec3<f32>,
    family: u32,
    tangent: vec3<f32>,
    weight_scale: f32,
    params: vec4<f32>,
}

fn power(base: f32, exponent: f32) -> f32 {
    // WGSL's pow has no promise at base 0, and an underflow may trap a denormal: clamp as the twin does.
    if base <= 1e-12 {
        return 0.0;
    }
    return exp2(max(exponent * log2(base), -126.0));
}

fn schlick(f0: f32, cos_angle: f32) -> f32 {
    let m = 1.0 - clamp(cos_angle, 0.0, 1.0);
    return f0 + (1.0 - f0) * m * m * m * m * m;
}

// Products of the half vector with a lobe's frame: n.h, t.h, b.h, v.h.
fn half_vector(lobe: LobeSetup, wi: vec3<f32>, wo: vec3<f32>) -> vec4<f32> {
    let sum = wi + wo;
    let h = sum / max(sqrt(dot(sum, sum)), MIN_HALF);
    let bitangent = cross(lobe.normal, lobe.tangent);
    return vec4<f32>(
        clamp(dot(lobe.normal, h), 0.0, 1.0),
        dot(lobe.tangent, h),
        dot(bitangent, h),
        clamp(dot(wo, h), MIN_HALF, 1.0),
    );
}

fn lobe_eval(lobe: LobeSetup, wi: vec3<f32>, wo: vec3<f32>) -> f32 {
    let ci = dot(lobe.normal, wi);
    if ci <= 0.0 {
        return 0.0;
    }
    switch lobe.family {
        case 1u: { return lobe_oren_nayar(lobe, ci, wi, wo); }
        case 2u: { return lobe_blinn_phong(lobe, ci, wi, wo); }
        case 3u: { return lobe_ward(lobe, ci, wi, wo); }
        case 4u: { return lobe_cook_torrance(lobe, ci, wi, wo); }
        case 5u: { return lobe_lafortune(lobe, ci, wi, wo); }
        case 6u: { return lobe_ashikhmin_shirley(lobe, ci, wi, wo); }
        case 7u: { return lobe_ggx(lobe, ci, wi, wo); }
        case 8u: { return lobe_windowed_cosine(lobe, ci, wo); }
        default: { return ci; }
    }
}

fn lobe_cos_view(lobe: LobeSetup, wo: vec3<f32>) -> f32 {
    return max(dot(lobe.normal, wo), MIN_COS_VIEW);
}

fn lobe_oren_nayar(lobe: LobeSetup, ci: f32, wi: vec3<f32>, wo: vec3<f32>) -> f32 {
    let co = lobe_cos_view(lobe, wo);
    let s2 = lobe.params.x * lobe.params.x;
    let a = 1.0 - 0.5 * s2 / (s2 + 0.33);
    let b = 0.45 * s2 / (s2 + 0.09);
    let s = max(dot(wi, wo) - ci * co, 0.0);
    return ci * (a + b * s / max(ci, co));
}

fn lobe_blinn_phong(lobe: LobeSetup, ci: f32, wi: vec3<f32>, wo: vec3<f32>) -> f32 {
    let h = half_vector(lobe, wi, wo);
    return ci * (lobe.params.x + 8.0) * 0.125 * power(h.x, lobe.params.x);
}

fn lobe_ward(lobe: LobeSetup, ci: f32, wi: vec3<f32>, wo: vec3<f32>) -> f32 {
    let h = half_vector(lobe, wi, wo);
    let ax = lobe.params.x;
    let ay = lobe.params.y;
    let nh2 = max(h.x * h.x, 1e-6);
    let x = h.y / ax;
    let y = h.z / ay;
    let e = exp(max(-(x * x + y * y) / nh2, -80.0));
    return sqrt(ci / lobe_cos_view(lobe, wo)) * e / (4.0 * ax * ay);
}

fn lobe_cook_torrance(lobe: LobeSetup, ci: f32, wi: vec3<f32>, wo: vec3<f32>) -> f32 {
    let h = half_vector(lobe, wi, wo);
    let co = lobe_cos_view(lobe, wo);
    let m2 = lobe.params.x * lobe.params.x;
    let c2 = max(h.x * h.x, 1e-6);
    let d = exp(max((c2 - 1.0) / (m2 * c2), -80.0)) / (m2 * c2 * c2);
    let g = min(2.0 * h.x * min(ci, co) / h.w, 1.0);
    return schlick(lobe.params.y, h.w) * d * g / (4.0 * co);
}

fn lobe_lafortune(lobe: LobeSetup, ci: f32, wi: vec3<f32>, wo: vec3<f32>) -> f32 {
    let bitangent = cross(lobe.normal, lobe.tangent);
    let base = lobe.params.x * dot(lobe.tangent, wi) * dot(lobe.tangent, wo)
        + lobe.params.y * dot(bitangent, wi) * dot(bitangent, wo)
        + lobe.params.z * ci * dot(lobe.normal, wo);
    return ci * power(clamp(base, 0.0, 1.0), lobe.params.w);
}

fn lobe_ashikhmin_shirley(lobe: LobeSetup, ci: f32, wi: vec3<f32>, wo: vec3<f32>) -> f32 {
    let h = half_vector(lobe, wi, wo);
    let nu = lobe.params.x;
    let nv = lobe.params.y;
    let s2 = max(1.0 - h.x * h.x, 1e-6);
    let exponent = (nu * h.y * h.y + nv * h.z * h.z) / s2;
    let norm = sqrt((nu + 1.0) * (nv + 1.0)) * 0.125;
    return ci * norm * power(h.x, exponent) * schlick(lobe.params.z, h.w) / (h.w * max(ci, lobe_cos_view(lobe, wo)));
}

fn lobe_ggx(lobe: LobeSetup, ci: f32, wi: vec3<f32>, wo: vec3<f32>) -> f32 {
    let h = half_vector(lobe, wi, wo);
    let co = lobe_cos_view(lobe, wo);
    let a2 = lobe.params.x * lobe.params.x;
    let q = h.x * h.x * (a2 - 1.0) + 1.0;
    let d = a2 / max(q * q, 1e-12);
    let v = 0.5 / (ci * sqrt(co * co * (1.0 - a2) + a2) + co * sqrt(ci * ci * (1.0 - a2) + a2));
    return schlick(lobe.params.y, h.w) * d * v * ci;
}

fn lobe_windowed_cosine(lobe: LobeSetup, ci: f32, wo: vec3<f32>) -> f32 {
    return ci * exp(max(lobe.params.x * (dot(lobe.params.yzw, wo) - 1.0), -80.0));
}

fn lobe_from_resident(at: u32) -> LobeSetup {
    return LobeSetup(
        vec3<f32>(asset_f32(at + 1u), asset_f32(at + 2u), asset_f32(at + 3u)),
        asset_word(at),
        vec3<f32>(asset_f32(at + 4u), asset_f32(at + 5u), asset_f32(at + 6u)),
        asset_f32(at + 11u),
        vec4<f32>(asset_f32(at + 7u), asset_f32(at + 8u), asset_f32(at + 9u), asset_f32(at + 10u)),
    );
}
