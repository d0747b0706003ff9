// The surface where a ray hits it. Twin: surface.rs.

struct Hit {
    t: f32,
    primitive: u32,
    u: f32,
    v: f32,
    instance: u32,
}

const NO_HIT: u32 = 0xffffffffu;
// Which hit a traversal is for: any will do; only the nearest; only the nearest of those whose front the ray meets.
const HIT_ANY: u32 = 0u;
const HIT_NEAREST: u32 = 1u;
const HIT_FRONT: u32 = 2u;
// Cosine to which an eye below the shading horizon is lifted; interpolated normals turn away at silhouettes.
const MIN_EYE_COS: f32 = 1e-3;

struct Surface {
    position: vec3<f32>,
    material: u32,
    // Of the triangle, on the side of the shading normal.
    flat: vec3<f32>,
    // The ray came from behind.
    view_back: bool,
    // Frame of the texel: x, y, z.
    tangent: vec3<f32>,
    bitangent: vec3<f32>,
    normal: vec3<f32>,
    // Towards the eye, in that frame.
    wo: vec3<f32>,
    uv: vec2<f32>,
    // Numbers by which one of the texels around uv is taken; 0.5 twice for the nearest.
    texel_at: vec2<f32>,
    // Length of the texture on a unit of length, in the mean over the triangle.
    texture_per_unit: f32,
    // Where rays begin that leave on the front, and on the back.
    above: vec3<f32>,
    below: vec3<f32>,
}

// Returns the unit vector along v, or `other` where v is nearly zero.
fn normalize_or(v: vec3<f32>, other: vec3<f32>) -> vec3<f32> {
    let length2 = dot(v, v);
    if length2 > 1e-20 {
        return v * inverseSqrt(length2);
    }
    return other;
}

// Returns a vector perpendicular to the unit n.
fn perpendicular(n: vec3<f32>) -> vec3<f32> {
    if abs(n.x) < 0.9 {
        return normalize(vec3<f32>(0.0, -n.z, n.y));
    }
    return normalize(vec3<f32>(n.z, 0.0, -n.x));
}

// Moves a point off a surface by some units in the last place [Waechter and Binder 2019].
fn offset_along(p: vec3<f32>, n: vec3<f32>) -> vec3<f32> {
    let steps = vec3<i32>(n * 256.0);
    let moved = bitcast<vec3<f32>>(bitcast<vec3<i32>>(p) + select(steps, -steps, p < vec3<f32>(0.0)));
    return select(moved, p + n / 65536.0, abs(p) < vec3<f32>(1.0 / 32.0));
}

// Lifts a point of a flat triangle onto the curved surface that its normals mean, which keeps the shadow's edge on a
// curved object smooth [Hanika 2021]. `side` is 1 or -1, the side of the light.
fn lift(p: vec3<f32>, weights: vec3<f32>, corners: array<Vertex, 3>, side: f32) -> vec3<f32> {
    var at = vec3<f32>(0.0);
    for (var i = 0u; i < 3u; i++) {
        let normal = corners[i].normal * side;
        at += weights[i] * (p - normal * min(dot(p - corners[i].position, normal), 0.0));
    }
    return at;
}

// Transforms a point (w 1) or a direction (w 0) of the world into an instance's space.
fn object_from_world(instance: u32, v: vec4<f32>) -> vec3<f32> {
    let rows = instances[instance].object_from_world;
    return vec3<f32>(dot(rows[0], v), dot(rows[1], v), dot(rows[2], v));
}

// Transforms a vertex of a mesh to where an instance has it.
fn vertex_in_world(given: Vertex, instance: Instance) -> Vertex {
    var vertex = given;
    let rows = instance.world_from_object;
    let position = vec4<f32>(given.position, 1.0);
    vertex.position = vec3<f32>(dot(rows[0], position), dot(rows[1], position), dot(rows[2], position));
    // Normals follow the transposed inverse.
    let inverse = instance.object_from_world;
    let n = given.normal;
    vertex.normal = normalize_or(inverse[0].xyz * n.x + inverse[1].xyz * n.y + inverse[2].xyz * n.z, vec3<f32>(0.0, 0.0, 1.0));
    let t = given.tangent.xyz;
    vertex.tangent = vec4<f32>(
        dot(rows[0].xyz, t),
        dot(rows[1].xyz, t),
        dot(rows[2].xyz, t),
        given.tangent.w * instance.handedness,
    );
    return vertex;
}

// Returns the corners of the triangle that a ray hit, in the world.
fn corners_of(hit: Hit) -> array<Vertex, 3> {
    let corner = triangle_at(hit.primitive).vertices;
    var corners = array<Vertex, 3>(vertex_at(corner.x), vertex_at(corner.y), vertex_at(corner.z));
    if instances[hit.instance].handedness != 0.0 {
        let instance = instances[hit.instance];
        for (var i = 0u; i < 3u; i++) {
            corners[i] = vertex_in_world(corners[i], instance);
        }
    }
    return corners;
}

// Returns the length of the texture on a unit of length; `area` is twice that of the triangle.
fn texture_per_unit(corners: array<Vertex, 3>, area: f32) -> f32 {
    let a = corners[0];
    let e = vec2<f32>(corners[1].u - a.u, corners[1].v - a.v);
    let f = vec2<f32>(corners[2].u - a.u, corners[2].v - a.v);
    return sqrt(abs(e.x * f.y - e.y * f.x) / max(area, 1e-20));
}

// Returns the surface that a ray along `direction` hit.
fn surface_at(hit: Hit, direction: vec3<f32>) -> Surface {
    let corners = corners_of(hit);
    let a = corners[0];
    let b = corners[1];
    let c = corners[2];
    let weights = vec3<f32>(1.0 - hit.u - hit.v, hit.u, hit.v);
    let p = a.position * weights.x + b.position * weights.y + c.position * weights.z;
    let uv = vec2<f32>(
        a.u * weights.x + b.u * weights.y + c.u * weights.z,
        a.v * weights.x + b.v * weights.y + c.v * weights.z,
    );

    // The flat normal, on the side of the shading normal; the frame of the texel.
    var flat = normalize_or(cross(b.position - a.position, c.position - a.position), vec3<f32>(0.0, 0.0, 1.0));
    let normal = normalize_or(a.normal * weights.x + b.normal * weights.y + c.normal * weights.z, flat);
    if dot(flat, normal) < 0.0 {
        flat = -flat;
    }
    let slanted = a.tangent.xyz * weights.x + b.tangent.xyz * weights.y + c.tangent.xyz * weights.z;
    let tangent = normalize_or(slanted - normal * dot(normal, slanted), perpendicular(normal));
    let bitangent = cross(normal, tangent) * a.tangent.w;

    let wo_world = -direction;
    let view_back = dot(flat, wo_world) < 0.0;
    var wo = vec3<f32>(dot(tangent, wo_world), dot(bitangent, wo_world), dot(normal, wo_world));
    wo.z = select(max(wo.z, MIN_EYE_COS), min(wo.z, -MIN_EYE_COS), view_back);
    return Surface(
        p,
        triangle_at(hit.primitive).material,
        flat,
        view_back,
        tangent,
        bitangent,
        normal,
        normalize(wo),
        uv,
        vec2<f32>(0.5),
        texture_per_unit(corners, length(cross(b.position - a.position, c.position - a.position))),
        offset_along(lift(p, weights, corners, 1.0), flat),
        offset_along(lift(p, weights, corners, -1.0), -flat),
    );
}

// Transforms a direction of the world into the frame of the texel.
fn local_from_world(s: Surface, d: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(s.tangent, d), dot(s.bitangent, d), dot(s.normal, d));
}

// Transforms a direction from the frame of the texel into the world.
fn world_from_local(s: Surface, d: vec3<f32>) -> vec3<f32> {
    return s.tangent * d.x + s.bitangent * d.y + s.normal * d.z;
}
