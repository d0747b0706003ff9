// A texel seen from one outgoing direction: the view-dependent half of decoding, done once for any number of lights;
// and the residual, summed over the views, at the measured lights that were asked for. Twin: decode/viewed_texel.rs.

const INTERPOLATION_FAST: u32 = 0u;
const INTERPOLATION_EXACT: u32 = 1u;
const HEIGHTS_RELIEF: u32 = 2u;
const RATIO_EPSILON: f32 = 0.03;
const RATIO_MIN: f32 = 0.3;
const RATIO_MAX: f32 = 4.0;
const LIGHT_ROWS: u32 = 32u;

// The rows of one viewed texel, by measured light; a variable of this type begins without any.
struct LightRows {
    // Number of the measured light plus 1; 0 for no row.
    ids: array<u32, LIGHT_ROWS>,
    // Fast rule: the residual, less what relief adds. Exact rule: decoded linear values.
    values: array<vec3<f32>, LIGHT_ROWS>,
    // Exact rule: sums of the lobes. Fast rule with relief: shading of the points that the views show.
    others: array<vec3<f32>, LIGHT_ROWS>,
}

// Three rows, one a column.
struct ThreeRows {
    values: mat3x3<f32>,
    others: mat3x3<f32>,
}

// A light as a texel sees it.
struct Lit {
    // Unit vector to the light in the layer's frame.
    wi: vec3<f32>,
    // Whether light and eye are on the layer's side; nothing else is set where they are not.
    is_lit: bool,
    // Direction for which lobes are evaluated: that of the light, or the nearest one within the hull of the measured
    // lights.
    toward: vec3<f32>,
    // Factor of the value that comes after all else: its fade to the horizon, and its fall beyond the hull.
    fall: f32,
    // Neighbours of the light among the measured ones, where there is a residual.
    light: Neighbours,
}

struct ViewedTexel {
    t: Texel,
    options: BtfOptions,
    // Unit vector to the eye in the layer's frame. With z <= 0 the eye is on the other side, and every value is black.
    wo: vec3<f32>,
    kind: u32,
    views: vec3<u32>,
    lobe_role: u32,
    weights: vec3<f32>,
    // Whether the neighbouring views show other texels than this one: those in `shown`.
    shifted: bool,
    shown: vec3<u32>,
    exact: bool,
    // Whether the bases are packed.
    packed: bool,
    // Whether their rows, not packed, are whole quads of words.
    in_quads: bool,
    // Whether relief corrects the interpolation, with the points that are seen.
    relieved: bool,
    relief: SeenRelief,
}

// Prepares `texel` of `layer` for the eye at `wo`, a unit vector in the texel's frame.
fn viewed_new(base: u32, layer: u32, texel: u32, wo_given: vec3<f32>, options: BtfOptions) -> ViewedTexel {
    let t = texel_at(base, base + asset_word(base + ASSET_LAYERS + layer), texel, options);
    var wo = wo_given;
    if asset_word(t.layer + BLOCK_VIEW_SIDE) == 1u {
        wo.z = -wo.z;
    }
    let view = sphere_locate(base + asset_word(t.layer + BLOCK_VIEWS), wo);
    var viewed = ViewedTexel(
        t,
        options,
        wo,
        asset_word(t.layer + BLOCK_RESIDUAL_KIND),
        view.ids,
        asset_word(t.layer + BLOCK_LOBE_ROLE),
        view.weights,
        options.heights != 0u && view.beyond < 1.0 && wo.z > 0.0 && asset_word(t.layer + BLOCK_HEIGHTS) != 0u,
        vec3<u32>(texel),
        options.interpolation == INTERPOLATION_EXACT,
        asset_word(t.layer + BLOCK_CHANNEL_WORDS) == 0u,
        asset_word(t.layer + BLOCK_CHANNEL_WORDS) % 4u == 0u,
        false,
        SeenRelief(),
    );
    if viewed.shifted {
        let measured = viewed_measured_views(viewed);
        let seen = height_seen_by(height_field(base, t.layer), texel, wo, view.beyond, measured, view.weights);
        viewed.shown = seen.texels;
        viewed.weights = seen.weights;
    }
    if options.heights == HEIGHTS_RELIEF
        && !viewed.exact
        && t.bases > 0u
        && wo.z > 0.0
        && asset_word(t.layer + BLOCK_RELIEF) != 0u
    {
        let eye = sphere_within_hull(base + asset_word(t.layer + BLOCK_VIEWS), wo, view);
        viewed.relieved = true;
        viewed.relief = relief_seen(t, wo, eye, viewed_measured_views(viewed), viewed.shown, viewed.weights);
        viewed.weights = relief_view_weights(viewed.relief, viewed.weights);
    }
    return viewed;
}

fn viewed_measured_views(viewed: ViewedTexel) -> array<vec3<f32>, 3> {
    let at = viewed.t.base + asset_word(viewed.t.layer + BLOCK_VIEWS);
    return array<vec3<f32>, 3>(
        sphere_direction(at, viewed.views.x),
        sphere_direction(at, viewed.views.y),
        sphere_direction(at, viewed.views.z),
    );
}

// Returns the texel that neighbouring view `v` shows.
fn viewed_shown_by(viewed: ViewedTexel, v: u32) -> Texel {
    if !viewed.shifted {
        return viewed.t;
    }
    return texel_at(viewed.t.base, viewed.t.layer, viewed.shown[v], viewed.options);
}

// Sums the lobes that the eye sees, as measured (`edit` 0) or as an edit has them.
fn viewed_lobe_sum(viewed: ViewedTexel, edit: u32, wi: vec3<f32>) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    // One loop serves both cases, because shader compilers inline every call.
    for (var v = 0u; v < select(1u, 3u, viewed.shifted); v++) {
        let weight = select(1.0, viewed.weights[v], viewed.shifted);
        if weight > 0.0 {
            sum += weight * texel_lobe_sum(viewed_shown_by(viewed, v), edit, wi, viewed.wo);
        }
    }
    return sum;
}

// Computes the rows of three measured lights; those not `wanted` stay 0.
fn viewed_rows(viewed: ViewedTexel, lights: vec3<u32>, wanted: vec3<bool>, epsilon: f32) -> ThreeRows {
    var rows = ThreeRows(mat3x3<f32>(), mat3x3<f32>());
    var measured = viewed_measured_views(viewed);
    let base_share = select(1.0, 0.0, viewed.lobe_role == LOBE_ROLE_GUIDE);
    // The exact rule takes the views one by one. One loop serves both rules, because shader compilers inline every call.
    for (var v = 0u; v < select(1u, 3u, viewed.exact); v++) {
        let weight = viewed.weights[v];
        if viewed.exact && weight <= 0.0 {
            continue;
        }
        let own = select(vec3<f32>(0.0), vec3<f32>(1.0), vec3<u32>(0u, 1u, 2u) == vec3<u32>(v));
        let residual = viewed_residual(viewed, lights, wanted, select(viewed.weights, own, viewed.exact));
        if !viewed.exact {
            rows.values = residual;
            continue;
        }
        let t = viewed_shown_by(viewed, v);
        for (var l = 0u; l < 3u; l++) {
            if wanted[l] {
                let wi = sphere_direction(t.base + asset_word(t.layer + BLOCK_LIGHTS), lights[l]);
                let lobes = texel_lobe_sum(t, 0u, wi, measured[v]);
                rows.values[l] += weight * residual_combine(viewed.kind, base_share * lobes, residual[l], epsilon, 1.0);
                rows.others[l] += weight * lobes;
            }
        }
    }
    if viewed.relieved {
        for (var l = 0u; l < 3u; l++) {
            if wanted[l] {
                let wi = sphere_direction(viewed.t.base + asset_word(viewed.t.layer + BLOCK_LIGHTS), lights[l]);
                let terms = relief_of_views(viewed.relief, wi, measured, viewed.weights, epsilon);
                rows.values[l] -= terms.added;
                rows.others[l] = terms.shading;
            }
        }
    }
    return rows;
}

// Sums the residual at three measured lights over the neighbouring views, with their shares; 0 at lights that are not
// `wanted`.
fn viewed_residual(viewed: ViewedTexel, lights: vec3<u32>, wanted: vec3<bool>, shares: vec3<f32>) -> mat3x3<f32> {
    var sum = mat3x3<f32>();
    // Where the views show one texel, one pass serves them all.
    for (var v = 0u; v < select(1u, 3u, viewed.shifted); v++) {
        let own = select(vec3<f32>(0.0), shares, vec3<u32>(0u, 1u, 2u) == vec3<u32>(v));
        let of_views = select(shares, own, viewed.shifted);
        if all(of_views <= vec3<f32>(0.0)) {
            continue;
        }
        let t = viewed_shown_by(viewed, v);
        if viewed.packed {
            sum += packed_sum(t, viewed.views, lights, of_views);
        } else if viewed.in_quads {
            sum += residual_sum(t, viewed.views, lights, wanted, of_views);
        } else {
            sum += residual_sum_by_words(t, viewed.views, lights, wanted, of_views);
        }
    }
    for (var l = 0u; l < 3u; l++) {
        if !wanted[l] {
            sum[l] = vec3<f32>(0.0);
        }
    }
    return sum;
}

// Returns reflectance times cosine times pi for the light at `wi`, a unit vector in the texel's frame; 0 where light or
// eye are on another side than the layer's. `rows` must be those of this viewed texel.
fn viewed_light(viewed: ViewedTexel, rows: ptr<function, LightRows>, wi: vec3<f32>) -> vec3<f32> {
    let lit = viewed_lit(viewed, wi);
    let groups = shown_groups(viewed.t.base);
    var sum = vec3<f32>(0.0);
    for (var group = 0u; group < groups; group++) {
        let weights = shown_weights(viewed.t.base, group);
        if !lit.is_lit || !shown_asks(weights) {
            continue;
        }
        let of_group = viewed_of_group(viewed, lit, group, groups);
        var found = ThreeRows(mat3x3<f32>(), mat3x3<f32>());
        if viewed.t.bases > 0u {
            found = viewed_found_rows(viewed, rows, of_group.light);
        }
        sum += weights * min(viewed_value(viewed, of_group, found), vec3<f32>(MAX_CHANNEL));
    }
    return max(sum, vec3<f32>(0.0));
}

// Returns the value of viewed_light for a light that shares its rows with no other. Kept rows take 1152 bytes of each
// thread.
fn viewed_light_alone(viewed: ViewedTexel, wi: vec3<f32>) -> vec3<f32> {
    let lit = viewed_lit(viewed, wi);
    let groups = shown_groups(viewed.t.base);
    var sum = vec3<f32>(0.0);
    for (var group = 0u; group < groups; group++) {
        let weights = shown_weights(viewed.t.base, group);
        if !lit.is_lit || !shown_asks(weights) {
            continue;
        }
        let of_group = viewed_of_group(viewed, lit, group, groups);
        var found = ThreeRows(mat3x3<f32>(), mat3x3<f32>());
        if viewed.t.bases > 0u {
            // All three, without a choice: seldom is the share of one 0.
            let ids = of_group.light.ids;
            found = viewed_rows(viewed, ids, vec3<bool>(true), asset_f32(viewed.t.layer + BLOCK_EPSILON));
        }
        sum += weights * min(viewed_value(viewed, of_group, found), vec3<f32>(MAX_CHANNEL));
    }
    return max(sum, vec3<f32>(0.0));
}

// Returns `lit` with the measured lights of a group of channels.
fn viewed_of_group(viewed: ViewedTexel, lit: Lit, group: u32, groups: u32) -> Lit {
    var of_group = lit;
    of_group.light.ids += vec3<u32>(group * (asset_word(viewed.t.layer + BLOCK_LIGHT_COUNT) / groups));
    return of_group;
}

// Prepares the light at `wi`.
fn viewed_lit(viewed: ViewedTexel, wi_given: vec3<f32>) -> Lit {
    let t = viewed.t;
    var wi = wi_given;
    if asset_word(t.layer + BLOCK_LIGHT_SIDE) == 1u {
        wi.z = -wi.z;
    }
    var lit = Lit(wi, wi.z > 0.0 && viewed.wo.z > 0.0, wi, 0.0, Neighbours());
    if !lit.is_lit {
        return lit;
    }
    lit.fall = min(wi.z / asset_f32(t.layer + BLOCK_HORIZON), 1.0);
    if t.bases > 0u {
        let at = t.base + asset_word(t.layer + BLOCK_LIGHTS);
        lit.light = sphere_locate(at, wi);
        if viewed.lobe_role == LOBE_ROLE_BASE && !viewed.exact {
            // Beyond the measured lights the value at their hull falls with the light's cosine.
            lit.toward = sphere_within_hull(at, wi, lit.light);
            lit.fall *= lit.light.beyond;
        }
    }
    return lit;
}

// Returns the value for `lit`, given the rows of the measured lights around it.
fn viewed_value(viewed: ViewedTexel, lit: Lit, found: ThreeRows) -> vec3<f32> {
    let t = viewed.t;
    if !lit.is_lit {
        return vec3<f32>(0.0);
    }
    // The lobes as measured and as edited.
    var lobes = mat2x3<f32>();
    // Lobes that only guide are not part of the value, and the fast rule does not evaluate them.
    let needed = viewed.lobe_role != LOBE_ROLE_GUIDE || viewed.exact || t.bases == 0u || t.edit > 0u;
    let asked = vec2<bool>(needed, t.edit > 0u);
    for (var i = 0u; i < 2u; i++) {
        if asked[i] {
            lobes[i] = viewed_lobe_sum(viewed, i * t.edit, lit.toward);
        }
    }
    var value = max(lobes[0], vec3<f32>(0.0));
    if t.bases > 0u {
        value = viewed_measured(viewed, found, lit, lobes[0]);
    }
    if t.edit > 0u {
        value = viewed_edited(viewed, value, lobes[0], lobes[1]);
    }
    return value * lit.fall;
}

// Applies the texel's edit to a measured value, given the measured lobe sum `here` and the edited one; the equation is
// that of asset/edit.rs.
fn viewed_edited(viewed: ViewedTexel, value: vec3<f32>, here: vec3<f32>, lobes: vec3<f32>) -> vec3<f32> {
    let t = viewed.t;
    let at = t.base + asset_word(t.layer + BLOCK_EDITS) + (t.edit - 1u) * EDIT_WORDS;
    let tint = vec3<f32>(asset_f32(at), asset_f32(at + 1u), asset_f32(at + 2u));
    let epsilon = asset_f32(t.layer + BLOCK_EPSILON);
    let left = residual_encode(viewed.kind, value, epsilon) - residual_encode(viewed.kind, here, epsilon);
    let value_edited = residual_combine(viewed.kind, lobes, asset_f32(at + 3u) * left, epsilon, 1.0);
    return tint * min(value_edited, vec3<f32>(1e37));
}

// Returns the measured value for `lit` without its fall towards the horizon, given the rows of the measured lights around
// it; `here` are the lobes, where they are needed.
fn viewed_measured(viewed: ViewedTexel, found: ThreeRows, lit: Lit, here: vec3<f32>) -> vec3<f32> {
    let t = viewed.t;
    let epsilon = asset_f32(t.layer + BLOCK_EPSILON);
    let light = lit.light;
    var weights = light.weights;
    var added = vec3<f32>(0.0);
    if viewed.relieved {
        let compared = relief_here(viewed.relief, lit.toward, viewed.weights, epsilon);
        weights = relief_light_weights(viewed.relief, light.weights, compared.shading, found.others);
        added = compared.added;
        if light.beyond < 1.0 {
            // Beyond the measured lights the terms are those of the light itself, over what the value then loses.
            added = relief_here(viewed.relief, lit.wi, viewed.weights, epsilon).added / max(light.beyond, MIN_BEYOND);
        }
    }
    let value = found.values * weights + added;
    if !viewed.exact {
        let guide = viewed.lobe_role == LOBE_ROLE_GUIDE;
        let base = select(here, vec3<f32>(0.0), guide);
        let scaled = select(1.0, light.beyond, viewed.lobe_role == LOBE_ROLE_OLD_BASE);
        return residual_combine(viewed.kind, base, value, epsilon, scaled) * select(1.0, light.beyond, guide);
    }
    let lobes = found.others * light.weights;
    let ratio = (here + RATIO_EPSILON) / (lobes + RATIO_EPSILON);
    return value * clamp(ratio, vec3<f32>(RATIO_MIN), vec3<f32>(RATIO_MAX));
}

// Returns the rows of the measured lights around a light: those that are kept in `rows`, and the missing ones, which are
// kept from then on.
fn viewed_found_rows(viewed: ViewedTexel, rows: ptr<function, LightRows>, light: Neighbours) -> ThreeRows {
    let place = light.ids % LIGHT_ROWS;
    var wanted = light.weights > vec3<f32>(0.0);
    var found = ThreeRows(mat3x3<f32>(), mat3x3<f32>());
    for (var l = 0u; l < 3u; l++) {
        if wanted[l] && (*rows).ids[place[l]] == light.ids[l] + 1u {
            found.values[l] = (*rows).values[place[l]];
            if viewed.exact || viewed.relieved {
                found.others[l] = (*rows).others[place[l]];
            }
            wanted[l] = false;
        }
    }
    if any(wanted) {
        let made = viewed_rows(viewed, light.ids, wanted, asset_f32(viewed.t.layer + BLOCK_EPSILON));
        for (var l = 0u; l < 3u; l++) {
            if wanted[l] {
                found.values[l] = made.values[l];
                (*rows).ids[place[l]] = light.ids[l] + 1u;
                (*rows).values[place[l]] = made.values[l];
                if viewed.exact || viewed.relieved {
                    found.others[l] = made.others[l];
                    (*rows).others[place[l]] = made.others[l];
                }
            }
        }
    }
    return found;
}
