// The diffuse light that the microflakes of a voxel send to the eye, in closed form. Twin: voltex/shade.rs, which has
// the equations.

const VOLTEX_MIN_ROOT: f32 = 1e-30;
const VOLTEX_SERIES_DEPTH: f32 = 1.0;
// Optical depth behind which nothing is visible; its exponential is finite.
const VOLTEX_MAX_DEPTH: f32 = 80.0;
const VOLTEX_HALF_PI: f32 = 1.5707964;
const VOLTEX_DEGREES: f32 = 57.29578;
// Angles between light and eye in degrees, besides 0 and 180, for which a level has shares of common gaps.
const VOLTEX_NEAR_DEG = vec4<f32>(2.0, 5.0, 10.0, 20.0);
const VOLTEX_WIDE_DEG = vec4<f32>(40.0, 70.0, 110.0, 150.0);

// Returns the angle with a cosine within -1 to 1, to 2e-8 before rounding [Abramowitz & Stegun 1964, 4.4.46]: WGSL's
// own function may be wrong by 2e-3.
fn voltex_acos(cosine: f32) -> f32 {
    let x = abs(cosine);
    let high = -0.0170881256 + x * (0.0066700901 - x * 0.0012624911);
    let low = 0.0889789874 + x * (-0.0501743046 + x * (0.0308918810 + x * high));
    let angle = sqrt(1.0 - x) * (1.5707963050 + x * (-0.2145988016 + x * low));
    return select(angle, 2.0 * VOLTEX_HALF_PI - angle, cosine < 0.0);
}

// Returns two sums over the microflakes of `a |n.v| |n.l|` for light from `l`, seen from `v`, unit vectors away from
// the microflakes: over those with both directions on one side, and over those with the directions on two sides.
fn voltex_shade(moment: VoltexMatrix, v: vec3<f32>, l: vec3<f32>) -> vec2<f32> {
    let across = voltex_times(moment, l);
    let c = dot(v, across);
    let root = sqrt(max(voltex_form(moment, v, v) * dot(l, across), 0.0));
    let r = clamp(c / max(root, VOLTEX_MIN_ROOT), -1.0, 1.0);
    let both = (root * sqrt((1.0 - r) * (1.0 + r)) + c * (VOLTEX_HALF_PI - voltex_acos(r))) / VOLTEX_HALF_PI;
    return max(vec2<f32>(0.5 * (both + c), 0.5 * (both - c)), vec2<f32>(0.0));
}

// Returns the mean distance, from where a ray enters a cell, of the microflakes that it sees there.
fn voltex_seen_at(depth: f32, length: f32) -> f32 {
    if depth >= VOLTEX_SERIES_DEPTH {
        return length * (1.0 / depth - 1.0 / (exp(min(depth, VOLTEX_MAX_DEPTH)) - 1.0));
    }
    let d2 = depth * depth;
    return length * (0.5 - depth / 12.0 * (1.0 - d2 / 60.0 * (1.0 - d2 / 42.0 * (1.0 - d2 / 40.0))));
}

// Returns the share of gaps of a level that eye and light have in common at an angle with a cosine: light is attenuated
// by `exp(-(1 - share) depth)`.
fn voltex_shared_at(base: u32, level: u32, cosine: f32) -> f32 {
    let degrees = vec4<f32>(VOLTEX_DEGREES * voltex_acos(clamp(cosine, -1.0, 1.0)));
    let near = degrees >= VOLTEX_NEAR_DEG;
    let wide = degrees >= VOLTEX_WIDE_DEG;
    let passed = select(vec4<f32>(0.0), vec4<f32>(1.0), near) + select(vec4<f32>(0.0), vec4<f32>(1.0), wide);
    let below = max(select(vec4<f32>(0.0), VOLTEX_NEAR_DEG, near), select(vec4<f32>(0.0), VOLTEX_WIDE_DEG, wide));
    let above = min(select(VOLTEX_NEAR_DEG, vec4<f32>(180.0), near), select(VOLTEX_WIDE_DEG, vec4<f32>(180.0), wide));
    let low = max(max(below.x, below.y), max(below.z, below.w));
    let high = min(min(above.x, above.y), min(above.z, above.w));
    let at = voltex_shadow(base, level) + 1u + u32(dot(passed, vec4<f32>(1.0)));
    return mix(asset_f32(at), asset_f32(at + 1u), clamp((degrees.x - low) / (high - low), 0.0, 1.0));
}
