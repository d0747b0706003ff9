// Parallax outside the measured views: which texels of the neighbouring views show the surface point that an eye
// outside their hull sees. Twin: decode/parallax.rs.

const MAX_SLOPE: f32 = 10.0;
const RAY_STEP: f32 = 0.5;
const MIN_RAY_STEPS: f32 = 8.0;
const MAX_RAY_STEPS: f32 = 64.0;
const SHIFT_SLOPE: f32 = 5.0;
const HIDDEN_SHARE: f32 = 0.05;
const OUTSIDE_SHARE: f32 = 0.1;

// The surface point that an eye sees in a texel, as the three neighbouring views show it; the weights sum up to 1.
struct SeenBy {
    texels: vec3<u32>,
    weights: vec3<f32>,
}

// Returns the displacement map of the layer whose block begins at word `layer`, of the asset at word `base`; `at` is 0
// if the layer has none.
fn height_field(base: u32, layer: u32) -> HeightField {
    let range = vec2<f32>(asset_f32(layer + BLOCK_MIN_HEIGHT), asset_f32(layer + BLOCK_MAX_HEIGHT));
    let offset = asset_word(layer + BLOCK_HEIGHTS);
    let at = select(base + offset, 0u, offset == 0u);
    return HeightField(at, level_size(layer), asset_f32(layer + BLOCK_HEIGHT_STEP), range);
}

// Returns the height of the first point that a ray meets; the ray has slope `s` and passes the mean plane at `place`.
fn height_first_hit(field: HeightField, place: vec2<f32>, s: vec2<f32>) -> f32 {
    let depth = field.range.y - field.range.x;
    // A little less, so that rounding does not decide where the quotient is whole.
    let steps = clamp(ceil(length(s) * depth / RAY_STEP - 1e-4), MIN_RAY_STEPS, MAX_RAY_STEPS);
    var free = field.range.y;
    var clear = max(free - height_at(field, place + free * s), 0.0);
    for (var i = 1u; i <= u32(steps); i++) {
        let z = field.range.y - depth * (f32(i) / steps);
        let now = z - height_at(field, place + z * s);
        if now <= 0.0 {
            // Interpolates linearly between the last two steps: the surface between them is nearly a plane.
            return free + (z - free) * (clear / max(clear - now, 1e-12));
        }
        free = z;
        clear = now;
    }
    return field.range.x;
}

// Returns the place of the surface point that an eye at `direction` sees at `place` of the mean plane.
fn height_seen_place(field: HeightField, place: vec2<f32>, direction: vec3<f32>) -> vec2<f32> {
    let s = height_slope(direction);
    return place + height_first_hit(field, place, s) * s;
}

fn height_slope(direction: vec3<f32>) -> vec2<f32> {
    let s = vec2<f32>(direction.x, -direction.y) / max(direction.z, 1e-6);
    return s / max(length(s) / MAX_SLOPE, 1.0);
}

// Finds the surface point that the eye at `wo` sees in `texel`, as the neighbouring `views` show it, which are
// interpolated with `weights`; `beyond` is that of the eye's Neighbours.
fn height_seen_by(
    field: HeightField,
    texel: u32,
    wo: vec3<f32>,
    beyond: f32,
    views: array<vec3<f32>, 3>,
    weights: vec3<f32>,
) -> SeenBy {
    var towards = views;
    let part = clamp((1.0 - beyond) * SHIFT_SLOPE, 0.0, 1.0);
    let most = vec2<f32>(field.size - vec2<u32>(1u));
    let place = vec2<f32>(vec2<u32>(texel % field.size.x, texel / field.size.x));
    let s = height_slope(wo);
    let z = height_first_hit(field, place, s);
    var seen = SeenBy(vec3<u32>(texel), vec3<f32>(0.0));
    for (var i = 0u; i < 3u; i++) {
        if weights[i] <= 0.0 {
            continue;
        }
        let slope = height_slope(towards[i]);
        let shown = place + z * (s - slope);
        let moved = place + part * (shown - place);
        let nearest = vec2<u32>(clamp(floor(moved + 0.5), vec2<f32>(0.0), most));
        let outside = any(shown < vec2<f32>(-0.5)) || any(shown > most + 0.5);
        let gap = height_first_hit(field, shown, slope) - z;
        let open = 1.0 - min(gap * gap, 1.0);
        let seen_here = 1.0 + part * (open * open * select(1.0, OUTSIDE_SHARE, outside) - 1.0);
        seen.texels[i] = nearest.y * field.size.x + nearest.x;
        seen.weights[i] = weights[i] * (HIDDEN_SHARE + (1.0 - HIDDEN_SHARE) * seen_here);
    }
    seen.weights /= seen.weights.x + seen.weights.y + seen.weights.z;
    return seen;
}
