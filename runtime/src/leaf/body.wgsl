// The body of a leaf at one place: the shares of the light that entered which leave again on either side. Twin:
// leaf/body.rs.

const LEAF_RATIONAL: u32 = 1u;
const LEAF_N_LAYERS: u32 = 2u;
const LEAF_TWO_SIDED: u32 = 3u;
const LEAF_MIN_BETWEEN: f32 = 1e-6;

struct LeafBody {
    // Share of the light on the face, the front or the seen one, that leaves by it again, linear sRGB; may be negative.
    reflectance: vec3<f32>,
    // Share of the light on the other face that leaves by that again.
    far_reflectance: vec3<f32>,
    // Share of the light that leaves on the other side.
    transmittance: vec3<f32>,
}

// Returns the body as it is seen from the other face.
fn leaf_swapped(body: LeafBody) -> LeafBody {
    return LeafBody(body.far_reflectance, body.reflectance, body.transmittance);
}

// Returns the absorption of one layer by pigments, and by all else, in the band whose first word is number `at`; the thickness
// is left out.
fn leaf_absorption(at: u32, factors: vec4<f32>) -> vec2<f32> {
    let pigments = factors.x * asset_f32(at) + factors.y * asset_f32(at + 1u) + factors.z * asset_f32(at + 2u);
    return vec2<f32>(pigments, asset_f32(at + 3u));
}

// Returns reflectance and transmittance of a pile of layers at absorption `k`, from the table whose first word is number `at`.
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

// Returns the reflectance of the upper face, of the lower one, and the transmittance of an upper and a lower pile, as shares of
// the light that passes the surface, whose transmittance is `entry`.
fn leaf_two_piles(upper: vec2<f32>, lower: vec2<f32>, entry: f32) -> vec3<f32> {
    let between = 1.0 / max(1.0 - upper.x * lower.x, LEAF_MIN_BETWEEN);
    let reflected = vec2<f32>(
        upper.x + upper.y * upper.y * lower.x * between,
        lower.x + lower.y * lower.y * upper.x * between,
    );
    // Less than one layer may reflect less than its own surface.
    let entered = max((reflected - (1.0 - entry)) / entry, vec2<f32>(0.0));
    return vec3<f32>(entered, upper.y * lower.y * between / entry);
}

fn leaf_printed_plate(theta: f32) -> vec2<f32> {
    let theta2 = theta * theta;
    return vec2<f32>((0.031 + 0.240 * theta2) / (1.0 - 0.296 * theta2), 0.44 * theta / (1.0 - 0.001 * theta2));
}

fn leaf_body(base: u32, factors: vec4<f32>) -> LeafBody {
    let mode = asset_word(base + 4u);
    let bands = asset_word(base + 5u);
    var body = LeafBody(vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0));
    for (var band = 0u; band < bands; band++) {
        let at = base + LEAF_BANDS_AT + band * LEAF_BAND_WORDS;
        let table = base + LEAF_TABLE_AT + band * LEAF_TABLE_ENTRIES;
        let absorbed = leaf_absorption(at, factors);
        let k = absorbed.x + absorbed.y;
        // Reflectance of the front, of the back, and transmittance.
        var optics = vec3<f32>(0.0);
        if mode == LEAF_N_LAYERS {
            optics = leaf_tabulated(table, factors.w * k).xxy;
        } else if mode == LEAF_TWO_SIDED {
            let upper = vec2<f32>(asset_f32(base + LEAF_HALVES_AT), asset_f32(base + LEAF_HALVES_AT + 1u));
            let lower = vec2<f32>(asset_f32(base + LEAF_HALVES_AT + 2u), asset_f32(base + LEAF_HALVES_AT + 3u));
            optics = leaf_two_piles(
                leaf_tabulated(table, factors.w * dot(upper, absorbed)),
                leaf_tabulated(base + LEAF_LOWER_TABLE_AT + band * LEAF_TABLE_ENTRIES, factors.w * dot(lower, absorbed)),
                asset_f32(at + 7u),
            );
        } else if mode == LEAF_RATIONAL {
            optics = leaf_exact_plate(leaf_rational_theta(factors.w * k), asset_f32(at + 7u)).xxy;
        } else {
            optics = (leaf_printed_plate(leaf_three_piece_theta(k)) * vec2<f32>(1.0, factors.w)).xxy;
        }
        let shares = vec3<f32>(asset_f32(at + 4u), asset_f32(at + 5u), asset_f32(at + 6u));
        body.reflectance += shares * optics.x;
        body.far_reflectance += shares * optics.y;
        body.transmittance += shares * optics.z;
    }
    // Limits the sum to 1: the red of a pure yellow is more than that of white, and the printed thickness brightens.
    let reflected = max(body.reflectance, body.far_reflectance);
    let scale = 1.0 / max(reflected + body.transmittance, vec3<f32>(1.0));
    return LeafBody(body.reflectance * scale, body.far_reflectance * scale, body.transmittance * scale);
}

// Places the body, as it is seen from one face, between two faces: reflectance of light on the seen face and transmittance of light on the far one,
// both towards the seen face; `lets_out` are the shares that the gloss of either face transmits from inside, `hidden`
// those that tilted normals send below their own horizon.
fn leaf_between_faces(body: LeafBody, lets_out: vec2<f32>, hidden: vec2<f32>) -> LeafBody {
    let share = lets_out / (0.5 * (lets_out.x + lets_out.y));
    // Shares that leave by the seen face, and by the far one.
    let through_seen = body.transmittance * share.x;
    let through_far = body.transmittance * share.y;
    let seen = body.reflectance + body.transmittance - through_far;
    let kept = 1.0 - hidden.y * (body.far_reflectance + body.transmittance - through_seen);
    let scale = 1.0 / ((1.0 - hidden.x * seen) * kept - hidden.x * hidden.y * through_seen * through_far);
    let reflectance = scale * (seen * kept + hidden.y * through_seen * through_far);
    return LeafBody(reflectance, body.far_reflectance, scale * through_seen);
}
