// A place of a leaf seen from one outgoing direction: the view-dependent half of shading; and directions drawn for a
// path. Twin: leaf/viewed.rs, which has the equations.

const LEAF_MIN_EYE: f32 = 1e-3;
const LEAF_MIN_SINES: f32 = 1e-12;
const LEAF_MIN_UP: f32 = 0.04;
const LEAF_MIN_SHARE: f32 = 0.02;
const LEAF_LUMINANCE: vec3<f32> = vec3<f32>(0.2126, 0.7152, 0.0722);

struct ViewedLeaf {
    base: u32,
    // Side of the eye: 1 for the front, -1 for the back. Multiplies z to change to the frame of the seen face.
    side: f32,
    lobe: LeafLobe,
    // Unit vector to the eye in the seen face's frame.
    wo: vec3<f32>,
    cos_o: f32,
    seen: LeafFace,
    far: LeafFace,
    // Shares of the body, reflected and transmitted, times the share that the seen gloss transmits to the eye.
    reflected: vec3<f32>,
    transmitted: vec3<f32>,
    // Whether the table of an algorithmic model takes the place of body and gloss, and the colours of the classes of its ways, from
    // the seen face back and from the far one through the leaf.
    is_tissue: bool,
    ways_back: mat4x3<f32>,
    ways_through: mat4x3<f32>,
    // Probabilities with which the body's two sides and the gloss are drawn.
    shares: vec3<f32>,
}

fn leaf_face(tilt: vec2<f32>, veins: vec2<f32>, gloss: f32) -> LeafFace {
    let normal = normalize(vec3<f32>(tilt, sqrt(max(1.0 - dot(tilt, tilt), LEAF_MIN_UP))));
    let size = length(veins);
    let cos2 = select(-1.0, veins.x / max(size, 1e-6), size > 1e-6);
    var v = sqrt(max(vec2<f32>(0.5 + 0.5 * cos2, 0.5 - 0.5 * cos2), vec2<f32>(0.0)));
    if veins.y < 0.0 {
        v.x = -v.x;
    }
    let along = normalize(vec3<f32>(v, -dot(normal.xy, v) / normal.z));
    return LeafFace(normal, gloss, along, cross(normal, along));
}

fn leaf_reflected_by(base: u32, lobe: LeafLobe, face: LeafFace, cosine: f32, w: vec3<f32>) -> f32 {
    return face.gloss * leaf_albedo(base, lobe, cosine, vec2<f32>(dot(face.along, w), dot(face.across, w)));
}

// Returns the cosine of the azimuth between two directions whose sines have the product of squares `squares`.
fn leaf_azimuth(product: f32, squares: f32) -> f32 {
    return select(-1.0, product / sqrt(max(squares, LEAF_MIN_SINES)), squares > LEAF_MIN_SINES);
}

fn leaf_turned(w: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(w.xy, -w.z);
}

// Prepares a place of the leaf whose first word is number `base`: `uv` of `level`, seen from `wo`, a unit vector in the
// frame of the front; `factors` are those of the plant, 1 for no change.
fn leaf_new(base: u32, uv: vec2<f32>, level: u32, factors: vec4<f32>, eye: vec3<f32>) -> ViewedLeaf {
    let lobe = LeafLobe(
        asset_f32(base + 6u),
        asset_f32(base + 9u),
        vec2<f32>(asset_f32(base + 7u), asset_f32(base + 8u)),
    );
    let texel = leaf_texel_at(base, uv, level);
    var seen = leaf_face(texel.tilt.xy, texel.veins, texel.gloss.x);
    var far = leaf_face(texel.tilt.zw, texel.veins, texel.gloss.y);
    let side = select(1.0, -1.0, eye.z < 0.0);
    if eye.z < 0.0 {
        let front = seen;
        seen = far;
        far = front;
    }
    let wo = vec3<f32>(eye.xy, eye.z * side);
    let cos_o = max(dot(seen.normal, wo), LEAF_MIN_EYE);
    let lost = leaf_reflected_by(base, lobe, seen, cos_o, wo);
    let lets_out = 1.0 - lobe.mean_albedo * vec2<f32>(seen.gloss, far.gloss);
    let passes = (1.0 - lost) / lets_out.x;
    let hidden = 0.5 - 0.5 * vec2<f32>(seen.normal.z, far.normal.z);
    let is_tissue = asset_word(base + 4u) == LEAF_TISSUE;
    var ways_back = mat4x3<f32>();
    var ways_through = mat4x3<f32>();
    var reflected = vec3<f32>(0.0);
    var transmitted = vec3<f32>(0.0);
    var shine = lost;
    if is_tissue {
        let face = select(0u, 1u, eye.z < 0.0);
        ways_back = leaf_way_colours(base, texel.factors * factors, face, 0u);
        ways_through = leaf_way_colours(base, texel.factors * factors, 1u - face, 1u);
        let near = leaf_way_totals(base, face, 0u);
        let through = leaf_way_totals(base, 1u - face, 1u);
        reflected = ways_back * vec4<f32>(0.0, near.yzw);
        transmitted = ways_through * vec4<f32>(0.0, through.yzw);
        shine = near.x;
    } else {
        var held = leaf_body(base, texel.factors * factors);
        if eye.z < 0.0 {
            held = leaf_swapped(held);
        }
        let body = leaf_between_faces(held, lets_out, hidden);
        reflected = body.reflectance * passes;
        transmitted = body.transmittance * passes;
    }
    let shares = max(
        vec3<f32>(dot(LEAF_LUMINANCE, reflected), dot(LEAF_LUMINANCE, transmitted), shine),
        vec3<f32>(LEAF_MIN_SHARE),
    );
    let total = shares.x + shares.y + shares.z;
    return ViewedLeaf(base, side, lobe, wo, cos_o, seen, far, reflected, transmitted, is_tissue, ways_back, ways_through, shares / total);
}

// Returns pi times BRDF (BTDF on the other side) times |cos_i| for a light at `wi`, a unit vector in the frame of the
// front.
fn leaf_light(viewed: ViewedLeaf, light: vec3<f32>) -> vec3<f32> {
    var wi = vec3<f32>(light.xy, light.z * viewed.side);
    if wi.z == 0.0 || viewed.wo.z == 0.0 {
        return vec3<f32>(0.0);
    }
    if viewed.is_tissue {
        return leaf_of_tissue(viewed, wi);
    }
    if wi.z < 0.0 {
        wi = leaf_turned(wi);
        let cos_i = max(dot(viewed.far.normal, wi), 0.0);
        let enters = 1.0 - leaf_reflected_by(viewed.base, viewed.lobe, viewed.far, cos_i, wi);
        return viewed.transmitted * (enters * cos_i);
    }
    let cos_i = max(dot(viewed.seen.normal, wi), 0.0);
    let enters = 1.0 - leaf_reflected_by(viewed.base, viewed.lobe, viewed.seen, cos_i, wi);
    let shine = viewed.seen.gloss * leaf_lobe(viewed.lobe, viewed.seen, wi, viewed.wo, cos_i, viewed.cos_o);
    return viewed.reflected * (enters * cos_i) + shine;
}

// Returns leaf_light by the table of an algorithmic model, for a light in the seen face's frame.
fn leaf_of_tissue(viewed: ViewedLeaf, wi: vec3<f32>) -> vec3<f32> {
    let face = select(0u, 1u, viewed.side < 0.0);
    let cos_o = min(viewed.cos_o, 1.0);
    var cos_i = 0.0;
    var cos_phi = 0.0;
    var place = vec2<u32>(face, 0u);
    var ways = viewed.ways_back;
    if wi.z < 0.0 {
        // The two faces have two normals; the leaf's plane decides.
        cos_i = max(dot(viewed.far.normal, leaf_turned(wi)), 0.0);
        cos_phi = leaf_azimuth(dot(wi.xy, viewed.wo.xy), dot(wi.xy, wi.xy) * dot(viewed.wo.xy, viewed.wo.xy));
        place = vec2<u32>(1u - face, 1u);
        ways = viewed.ways_through;
    } else {
        cos_i = max(dot(viewed.seen.normal, wi), 0.0);
        let sines = (1.0 - cos_i * cos_i) * (1.0 - cos_o * cos_o);
        cos_phi = leaf_azimuth(dot(wi, viewed.wo) - cos_i * cos_o, sines);
    }
    let cosines = vec3<f32>(min(cos_i, 1.0), cos_o, cos_phi);
    return leaf_scattered(viewed.base, ways, place, cosines) * cos_i;
}

// Draws a direction to light that matters to this eye, on either side, from three numbers in [0, 1).
fn leaf_sample_direction(viewed: ViewedLeaf, at: vec3<f32>) -> vec3<f32> {
    var wi = vec3<f32>(0.0);
    if at.z < viewed.shares.x + viewed.shares.y {
        let far = at.z >= viewed.shares.x;
        var face = viewed.seen;
        if far {
            face = viewed.far;
        }
        let about = sample_about_z(1.0, at.xy);
        wi = about.x * face.along + about.y * face.across + about.z * face.normal;
        if far {
            wi = leaf_turned(wi);
        }
    } else {
        wi = leaf_lobe_direction(viewed.lobe, viewed.seen, viewed.wo, at.xy);
    }
    return vec3<f32>(wi.xy, wi.z * viewed.side);
}

// Returns the density of leaf_sample_direction at `wi`, per steradian, over the whole sphere.
fn leaf_sample_density(viewed: ViewedLeaf, light: vec3<f32>) -> f32 {
    let wi = vec3<f32>(light.xy, light.z * viewed.side);
    let sum = viewed.shares.x * max(dot(viewed.seen.normal, wi), 0.0)
        + viewed.shares.y * max(dot(viewed.far.normal, leaf_turned(wi)), 0.0)
        + viewed.shares.z * leaf_lobe_density(viewed.lobe, viewed.seen, wi, viewed.wo);
    return sum / SAMPLE_PI;
}
