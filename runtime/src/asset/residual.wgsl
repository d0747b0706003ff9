// The residual's curves. Twin: asset/residual.rs, which also holds what only the packer and the loader do.

const ROOT: f32 = 2.4;
const MAX_LOG: f32 = 12.0;
const RESIDUAL_ADDITIVE: u32 = 0u;
const RESIDUAL_LOG: u32 = 1u;
const RESIDUAL_ROOT: u32 = 2u;

fn residual_encode(kind: u32, x: vec3<f32>, epsilon: f32) -> vec3<f32> {
    // max() keeps log and pow away from 0, where WGSL promises nothing.
    let positive = max(max(x, vec3<f32>(0.0)) + epsilon, vec3<f32>(1e-30));
    if kind == RESIDUAL_LOG {
        return log(positive);
    }
    if kind == RESIDUAL_ROOT {
        return pow(positive, vec3<f32>(1.0 / ROOT));
    }
    return x;
}

fn residual_decode(kind: u32, y: vec3<f32>, epsilon: f32) -> vec3<f32> {
    if kind == RESIDUAL_LOG {
        return exp(clamp(y, vec3<f32>(-MAX_LOG), vec3<f32>(MAX_LOG))) - epsilon;
    }
    if kind == RESIDUAL_ROOT {
        return pow(max(y, vec3<f32>(1e-12)), vec3<f32>(ROOT)) - epsilon;
    }
    return y;
}

fn residual_combine(kind: u32, s: vec3<f32>, r: vec3<f32>, epsilon: f32, beyond: f32) -> vec3<f32> {
    var scaled = r;
    if kind == RESIDUAL_ADDITIVE {
        scaled = r * beyond;
    } else if kind == RESIDUAL_ROOT {
        scaled = r * pow(max(beyond, 1e-12), 1.0 / ROOT);
    }
    return max(residual_decode(kind, residual_encode(kind, s, epsilon) + scaled, epsilon), vec3<f32>(0.0));
}
