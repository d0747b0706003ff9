// Evaluation and sampling at a texture coordinate for renderers: values, directions drawn from them and their
// densities, whichever sides light and eye are on. Twin: decode/evaluate.rs. `base` is the asset's first word, `level`
// below btf_levels(base).

const UNIT_MIN: f32 = 0.99;
const UNIT_MAX: f32 = 1.01;
// Upper clamp of a number to draw with: 1 - 2^-23.
const DRAW_MAX: f32 = 0.99999988;

// A direction that btf_sample has drawn; all zeros where it has drawn none.
struct BtfSample {
    // Unit vector to the light.
    wi: vec3<f32>,
    // Probability density, per steradian.
    density: f32,
    // Value of btf_evaluate for a light in this direction.
    value: vec3<f32>,
    pad: f32,
}

// Returns whether `v` is a direction: of length 1 within half a percent. NaN is not.
fn btf_is_unit(v: vec3<f32>) -> bool {
    // A longer vector is no direction, and its square may overflow.
    let near = clamp(v, vec3<f32>(-2.0), vec3<f32>(2.0));
    let square = dot(near, near);
    return btf_finite(v) && square >= UNIT_MIN && square <= UNIT_MAX;
}

// Tests the bits, because compilers may assume that all numbers are finite.
fn btf_finite(numbers: vec3<f32>) -> bool {
    let exponents = bitcast<vec3<u32>>(numbers) & vec3<u32>(0x7f800000u);
    return all(exponents != vec3<u32>(0x7f800000u));
}

// Evaluates pi times BRDF times |n.wi| (BTDF where light and eye are on different sides), linear RGB, at least 0. Black
// where the asset has no layer for these sides, where a number is not finite, and where a direction is not a unit
// vector.
fn btf_evaluate(
    base: u32,
    level: u32,
    uv: vec2<f32>,
    wi: vec3<f32>,
    wo: vec3<f32>,
    options: BtfOptions,
) -> vec3<f32> {
    if !(btf_finite(vec3<f32>(uv, 0.0)) && btf_is_unit(wi) && btf_is_unit(wo)) {
        return vec3<f32>(0.0);
    }
    let layer = btf_layer_for_sides(base, level, select(0u, 1u, wi.z < 0.0), select(0u, 1u, wo.z < 0.0));
    if layer == NO_LAYER {
        return vec3<f32>(0.0);
    }
    return btf_decode(base, layer, btf_texel(base, layer, uv), wi, wo, options);
}

// Returns the layers that an eye on one side sees: lit from its own side, and from the other.
fn btf_seen_layers(base: u32, level: u32, wo: vec3<f32>) -> vec2<u32> {
    let view_side = select(0u, 1u, wo.z < 0.0);
    return vec2<u32>(
        btf_layer_for_sides(base, level, view_side, view_side),
        btf_layer_for_sides(base, level, 1u - view_side, view_side),
    );
}

// Draws a direction to light that matters to the eye at `wo`, from three numbers `at` in [0, 1). The density is 0 where
// the eye sees no layer, where a number is not finite or `wo` not a unit vector, and where the direction drawn lies on
// the side of another layer; such a path carries nothing.
fn btf_sample(
    base: u32,
    level: u32,
    uv: vec2<f32>,
    wo: vec3<f32>,
    at: vec3<f32>,
    options: BtfOptions,
) -> BtfSample {
    var drawn: BtfSample;
    if !(btf_finite(vec3<f32>(uv, 0.0)) && btf_is_unit(wo) && btf_finite(at)) {
        return drawn;
    }
    var numbers = clamp(at, vec3<f32>(0.0), vec3<f32>(DRAW_MAX));
    let layers = btf_seen_layers(base, level, wo);
    var layer = select(layers.x, layers.y, layers.x == NO_LAYER);
    if layer == NO_LAYER {
        return drawn;
    }
    var share = 1.0;
    if all(layers != vec2<u32>(NO_LAYER)) {
        layer = select(layers.y, layers.x, numbers.z < 0.5);
        numbers.z = fract(2.0 * numbers.z);
        share = 0.5;
    }
    let viewed = viewed_new(base, layer, btf_texel(base, layer, uv), wo, options);
    let wi = sample_direction(viewed, numbers);
    let density = share * sample_density(viewed, wi);
    let light_sign = select(1.0, -1.0, asset_word(viewed.t.layer + BLOCK_LIGHT_SIDE) == 1u);
    if wi.z * light_sign > 0.0 && density > 0.0 {
        drawn = BtfSample(wi, density, viewed_light_alone(viewed, wi), 0.0);
    }
    return drawn;
}

// Returns the density with which btf_sample draws `wi`, per steradian; 0 where it never does.
fn btf_density(
    base: u32,
    level: u32,
    uv: vec2<f32>,
    wi: vec3<f32>,
    wo: vec3<f32>,
    options: BtfOptions,
) -> f32 {
    if !(btf_finite(vec3<f32>(uv, 0.0)) && btf_is_unit(wi) && btf_is_unit(wo)) {
        return 0.0;
    }
    let layers = btf_seen_layers(base, level, wo);
    let layer = select(layers.x, layers.y, (wi.z < 0.0) != (wo.z < 0.0));
    if layer == NO_LAYER {
        return 0.0;
    }
    let share = select(1.0, 0.5, all(layers != vec2<u32>(NO_LAYER)));
    let viewed = viewed_new(base, layer, btf_texel(base, layer, uv), wo, options);
    return share * sample_density(viewed, wi);
}
