// The body of a leaf at one place: the shares of the light that entered which leave again on either side. Twin:
// leaf/body.rs.

const LEAF_RATIONAL: u32 = 1u;
const LEAF_N_LAYERS: u32 = 2u;

struct LeafBody {
    // Share of the light that leaves on the side where it entered, linear sRGB; may be negative.
    reflectance: vec3<f32>,
    // Share of the light that leaves on the other side.
    transmittance: vec3<f32>,
}

// Returns the absorption of one layer in the band whose first word is number `at`; the thickness is left out.
fn leaf_absorption(at: u32, factors: vec4<f32>) -> f32 {
    return factors.x * asset_f32(at) + factors.y * asset_f32(at + 1u) + factors.z * asset_f32(at + 2u) + asset_f32(at + 3u);
}

// Returns reflectance and transmittance of a band's pile of layers, from the table whose first word is number `at`.
fn leaf_tabulated(at: u32, k: f32) -> vec2<f32> {
    let position = k / (k + LEAF_TABLE_HALF) * f32(LEAF_TABLE_ENTRIES - 1u);
    let cell = min(u32(position), LEAF_TABLE_ENTRIES - 2u);
    let low = unpack2x16unorm(asset_word(at + cell));
    let high = unpack2x16unorm(asset_word(at + cell + 1u));
    return mix(low, high, position - f32(cell));
}

fn leaf_exact_plate(theta: f32, exit: f32) -> vec2<f32> {
    let back = theta * (1.0 - exit);
    let behind = theta * exit / (1.0 - back * back);
    return vec2<f32>(back * behind, behind);
}

fn leaf_printed_plate(theta: f32) -> vec2<f32> {
    let theta2 = theta * theta;
    return vec2<f32>((0.031 + 0.240 * theta2) / (1.0 - 0.296 * theta2), 0.44 * theta / (1.0 - 0.001 * theta2));
}

fn leaf_body(base: u32, factors: vec4<f32>) -> LeafBody {
    let mode = asset_word(base + 4u);
    let bands = asset_word(base + 5u);
    var body = LeafBody(vec3<f32>(0.0), vec3<f32>(0.0));
    for (var band = 0u; band < bands; band++) {
        let at = base + LEAF_BANDS_AT + band * LEAF_BAND_WORDS;
        let k = leaf_absorption(at, factors);
        var optics = vec2<f32>(0.0);
        if mode == LEAF_N_LAYERS {
            optics = leaf_tabulated(base + LEAF_TABLE_AT + band * LEAF_TABLE_ENTRIES, factors.w * k);
        } else if mode == LEAF_RATIONAL {
            optics = leaf_exact_plate(leaf_rational_theta(factors.w * k), asset_f32(at + 7u));
        } else {
            optics = leaf_printed_plate(leaf_three_piece_theta(k)) * vec2<f32>(1.0, factors.w);
        }
        let shares = vec3<f32>(asset_f32(at + 4u), asset_f32(at + 5u), asset_f32(at + 6u));
        body.reflectance += shares * optics.x;
        body.transmittance += shares * optics.y;
    }
    // Limits the sum to 1: the red of a pure yellow is more than that of white, and the printed thickness brightens.
    let scale = 1.0 / max(body.reflectance + body.transmittance, vec3<f32>(1.0));
    return LeafBody(body.reflectance * scale, body.transmittance * scale);
}

// Places the body between two faces: reflectance of light on the seen face and transmittance of light on the far one,
// both towards the seen face; `lets_out` are the shares that the gloss of either face transmits from inside, `hidden`
// those that tilted normals send below their own horizon.
fn leaf_between_faces(body: LeafBody, lets_out: vec2<f32>, hidden: vec2<f32>) -> LeafBody {
    let share = lets_out / (0.5 * (lets_out.x + lets_out.y));
    let all = body.reflectance + body.transmittance;
    // Shares that leave by the seen face, and by the far one.
    let through_seen = body.transmittance * share.x;
    let through_far = body.transmittance * share.y;
    let seen = all - through_far;
    let kept = 1.0 - hidden.y * (all - through_seen);
    let scale = 1.0 / ((1.0 - hidden.x * seen) * kept - hidden.x * hidden.y * through_seen * through_far);
    return LeafBody(scale * (seen * kept + hidden.y * through_seen * through_far), scale * through_seen);
}
