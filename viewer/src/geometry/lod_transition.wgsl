// Level-of-detail transition from meshes to the volumes that stand in for them where their leaves are small in the
// picture. Twin: lod_transition.rs.

// A leaf that is so many pixels wide is a mesh's.
const MESH_PIXELS: f32 = 2.0;
// A leaf that is so many pixels wide is a volume's.
const VOLUME_PIXELS: f32 = 0.5;
// Factor by which the shells of skins lie farther beside their place for rays to lights than for those of the eye.
const COARSER_TO_LIGHT: f32 = 3.0;
// Stream of the sampler from which radii are drawn.
const LOD_TRANSITION_STREAM: u32 = 0x5bd1e995u;
// Steps of the R2 sequence [Roberts 2018] in fractions of 2^32: radii of neighbouring pixels are far from each other.
const PIXEL_STEP_X: u32 = 0xc13fa9a9u;
const PIXEL_STEP_Y: u32 = 0x91e10da6u;

// What is a mesh, what a volume, and which level of that, for one path.
struct LodTransition {
    eye: vec3<f32>,
    // Radius of the spheres, in widths of leaves.
    radius_widths: f32,
    // The number, from 0 to below 1, by which a level of a volume is taken of the two between which a width lies.
    level_share: f32,
    // The factor on the radius of the spheres beyond which a coarser shell of a skin is taken.
    shell_factor: f32,
}

// Where a ray is within the spheres about the eye.
struct SpheresAlong {
    // Where it is nearest to the eye, and how near, squared.
    nearest: f32,
    apart2: f32,
    radius_widths: f32,
    shell_factor: f32,
}

// Whether the scene hands anything over.
override with_lod_transition: bool = true;
// That of the path which this invocation follows.
var<private> lod_transition: LodTransition;

// Returns the transition about an eye, where a pixel is `pixel_width` wide at distance 1. `share` is how far the radius
// lies from the inner sphere to the outer one. Of volumes it has the nearest level.
fn lod_transition_new(eye: vec3<f32>, pixel_width: f32, share: f32) -> LodTransition {
    let leaf_pixels = MESH_PIXELS * pow(VOLUME_PIXELS / MESH_PIXELS, share);
    return LodTransition(eye, 1.0 / (leaf_pixels * pixel_width), 0.5, 1.0);
}

// Draws the transition of a sample of a pixel.
fn lod_transition_of_path(eye: vec3<f32>, pixel_width: f32, pixel: vec2<u32>, sample: u32) -> LodTransition {
    // By the same lattice, turned, for the level: what is a volume has all levels.
    let lattice = vec2<u32>(pixel.x * PIXEL_STEP_X + pixel.y * PIXEL_STEP_Y, pixel.y * PIXEL_STEP_X + pixel.x * PIXEL_STEP_Y);
    let shares = fract(sampler_two(sample, LOD_TRANSITION_STREAM) + vec2<f32>(lattice >> vec2<u32>(8u)) * 5.9604645e-8);
    var transition = lod_transition_new(eye, pixel_width, shares.x);
    transition.level_share = shares.y;
    return transition;
}

// Returns the transition for a ray that may be one to a light: that with shells that may lie some pixels beside their place.
fn lod_transition_to_light(own: LodTransition, to_light: bool) -> LodTransition {
    var for_ray = own;
    for_ray.shell_factor = select(1.0, 1.0 / COARSER_TO_LIGHT, to_light);
    return for_ray;
}

// Returns where a ray of unit direction lies within the spheres.
fn lod_transition_along(own: LodTransition, origin: vec3<f32>, direction: vec3<f32>) -> SpheresAlong {
    let to_eye = own.eye - origin;
    let nearest = dot(to_eye, direction);
    let apart = to_eye - nearest * direction;
    return SpheresAlong(nearest, dot(apart, apart), own.radius_widths, own.shell_factor);
}

// Returns from where to where along the ray a mesh exists whose leaves are so wide; the whole ray for width 0, which no
// volume stands in for. The end lies before the start where the ray passes the sphere.
fn lod_transition_mesh(spheres: SpheresAlong, leaf_width: f32) -> vec2<f32> {
    if leaf_width <= 0.0 {
        return vec2<f32>(-TRACE_FAR, TRACE_FAR);
    }
    let radius = leaf_width * spheres.radius_widths;
    let half2 = radius * radius - spheres.apart2;
    if half2 < 0.0 {
        return vec2<f32>(TRACE_FAR, -TRACE_FAR);
    }
    let half = sqrt(half2);
    return vec2<f32>(spheres.nearest - half, spheres.nearest + half);
}

// Tells whether the place at `t` is beyond the sphere of one shell's width and within that of another; 0 is no sphere.
fn lod_transition_is_between(spheres: SpheresAlong, inner_width: f32, outer_width: f32, t: f32) -> bool {
    let along = t - spheres.nearest;
    let distance2 = spheres.apart2 + along * along;
    let inner = inner_width * spheres.shell_factor * spheres.radius_widths;
    let outer = outer_width * spheres.shell_factor * spheres.radius_widths;
    return (inner_width <= 0.0 || distance2 >= inner * inner) && (outer_width <= 0.0 || distance2 < outer * outer);
}

// Returns from where to where along the ray, from `first` on, places lie beyond the sphere of one shell's width and within that of another, 0
// being no sphere; some between may not. The end lies before the begin where none do.
fn lod_transition_range_between(spheres: SpheresAlong, inner_width: f32, outer_width: f32, first: f32) -> vec2<f32> {
    let outer = lod_transition_mesh(spheres, outer_width * spheres.shell_factor);
    let begin = max(outer.x, first);
    let inner = select(vec2<f32>(0.0), lod_transition_mesh(spheres, inner_width * spheres.shell_factor), inner_width > 0.0);
    return vec2<f32>(select(begin, inner.y, inner.x <= begin && begin < inner.y), outer.y);
}

// Returns the parts of the stretch from `t0` to `t1` that lie before (x, y) and behind (z, w) the mesh that a volume
// stands in for; those that end where they begin or before are empty.
fn lod_transition_volume(spheres: SpheresAlong, leaf_width: f32, t0: f32, t1: f32) -> vec4<f32> {
    let there = lod_transition_mesh(spheres, leaf_width);
    if leaf_width <= 0.0 || there.y <= there.x {
        return vec4<f32>(t0, t1, t1, t1);
    }
    return vec4<f32>(t0, min(t1, there.x), max(t0, there.y), t1);
}
