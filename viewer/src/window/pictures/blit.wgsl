// Shows the accumulated picture in a window: mean, exposure, sRGB curve.

struct Blit {
    // Pixels of the picture.
    picture: vec2<u32>,
    // Pixels of the window.
    window: vec2<u32>,
    // 2^exposure_ev.
    gain: f32,
    // The band of rows that `picture` holds.
    first_row: u32,
    rows: u32,
    // 0 for one picture, 1 for two side by side, 2 for their difference.
    split: u32,
    // Column of the window from which on the other picture is shown.
    other_from: u32,
    difference_gain: f32,
    pad0: vec2<u32>,
}

// As the tracer writes it (scene.wgsl); what the sample did is not looked at.
struct BlitPixel {
    sum: vec4<f32>,
    done: vec4<u32>,
}

@group(0) @binding(0) var<uniform> blit: Blit;
@group(0) @binding(1) var<storage, read> picture: array<BlitPixel>;
// The other one of a split view, else the same.
@group(0) @binding(2) var<storage, read> other: array<BlitPixel>;

// One triangle that covers the window.
@vertex
fn blit_vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    return vec4<f32>(f32((index << 1u) & 2u) * 2.0 - 1.0, f32(index & 2u) * 2.0 - 1.0, 0.0, 1.0);
}

// IEC 61966-2-1. Twin: btf_capture::Transfer::Srgb.
fn srgb_from_linear(x: vec3<f32>) -> vec3<f32> {
    let clamped = clamp(x, vec3<f32>(0.0), vec3<f32>(1.0));
    let curve = 1.055 * pow(clamped, vec3<f32>(1.0 / 2.4)) - 0.055;
    return select(curve, clamped * 12.92, clamped <= vec3<f32>(0.0031308));
}

@fragment
fn blit_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let scaled = position.xy * vec2<f32>(blit.picture) / vec2<f32>(blit.window);
    let pixel = min(vec2<u32>(scaled), blit.picture - vec2<u32>(1u));
    if pixel.y < blit.first_row || pixel.y >= blit.first_row + blit.rows {
        discard;
    }
    let index = (pixel.y - blit.first_row) * blit.picture.x + pixel.x;
    let here = picture[index].sum;
    let there = other[index].sum;
    let a = srgb_from_linear(here.rgb / max(here.w, 1.0) * blit.gain);
    let b = srgb_from_linear(there.rgb / max(there.w, 1.0) * blit.gain);
    if blit.split == 2u {
        return vec4<f32>(abs(a - b) * blit.difference_gain, 1.0);
    }
    return vec4<f32>(select(a, b, blit.split == 1u && u32(position.x) >= blit.other_from), 1.0);
}
