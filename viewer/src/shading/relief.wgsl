// Displacement: an asset's heights as relief in a shell below the mesh, met by marching. Twin: relief.rs, which says
// more.

// Sideways way of a step, texels.
const RELIEF_STEP: f32 = 0.5;
// Steps of a ray, at least and at most.
const MIN_RELIEF_STEPS: f32 = 8.0;
const MAX_RELIEF_STEPS: f32 = 128.0;
// Height above the relief at which a shadow ray begins, texels.
const RELIEF_BIAS: f32 = 0.05;

// The relief below a point of the mesh.
struct Relief {
    field: HeightField,
    // Where the point is: column and row, texel centres at whole numbers.
    place: vec2<f32>,
    // What heights are multiplied by; 0 for no relief.
    scale: f32,
    // Texels on a unit of length.
    texels_per_unit: f32,
    // Change of the normal along tangent and bitangent, per texel: xx, xy, yy.
    curvature: vec3<f32>,
}

// Returns the relief below a point; of scale 0 where the material has none.
fn relief_new(hit: Hit, s: Surface, material: Material) -> Relief {
    var relief: Relief;
    if material.displacement <= 0.0 || material.asset == NO_ASSET {
        return relief;
    }
    let layer = btf_layer_for_sides(material.asset, 0u, 0u, 0u);
    if layer == NO_LAYER {
        return relief;
    }
    relief.field = height_field(material.asset, material.asset + asset_word(material.asset + ASSET_LAYERS + layer));
    let size = vec2<f32>(btf_size(material.asset, layer));
    let tiles = size * abs(material.uv_scale);
    relief.texels_per_unit = s.texture_per_unit * sqrt(tiles.x * tiles.y);
    if relief.field.at == 0u || relief.texels_per_unit <= 0.0 {
        return relief;
    }
    relief.scale = material.displacement;
    let uv = s.uv * material.uv_scale;
    relief.place = vec2<f32>(uv.x, 1.0 - uv.y) * size - 0.5;
    relief.curvature = relief_curvature(hit, s) / max(relief.texels_per_unit, 1e-20);
    return relief;
}

// Returns how much faster than straight a ray along `l` rises above the surface, per texel of its way.
fn relief_bend(relief: Relief, l: vec3<f32>) -> f32 {
    let c = relief.curvature;
    return c.x * l.x * l.x + 2.0 * c.y * l.x * l.y + c.z * l.y * l.y;
}

// Returns the column and row after the way `way` along `l`.
fn relief_place(at: vec2<f32>, l: vec3<f32>, way: f32) -> vec2<f32> {
    return at + way * vec2<f32>(l.x, -l.y);
}

// Returns the way of a ray that enters the shell at the point along `l`, with z < 0, to what it meets, texels; negative
// where it leaves the shell, by the way to there.
fn relief_enter(relief: Relief, l: vec3<f32>) -> f32 {
    let highest = relief.field.range.y * relief.scale;
    let depth = highest - relief.field.range.x * relief.scale;
    let bend = relief_bend(relief, l);
    // To the bottom, or to where the surface has bent away so far that the ray is out again.
    let root2 = l.z * l.z - 2.0 * bend * depth;
    var end = 2.0 * depth / max(-l.z + sqrt(max(root2, 0.0)), 1e-6);
    if root2 < 0.0 {
        end = -2.0 * l.z / bend;
    }
    let steps = clamp(ceil(end * length(l.xy) / RELIEF_STEP), MIN_RELIEF_STEPS, MAX_RELIEF_STEPS);
    var free = 0.0;
    var clear = max(highest - relief.scale * height_at_wrapped(relief.field, relief.place), 0.0);
    for (var i = 1u; i <= u32(steps); i++) {
        let way = end * (f32(i) / steps);
        let z = highest + way * l.z + 0.5 * bend * way * way;
        let now = z - relief.scale * height_at_wrapped(relief.field, relief_place(relief.place, l, way));
        if now <= 0.0 {
            // Straight between the last two.
            return free + (way - free) * (clear / max(clear - now, 1e-12));
        }
        free = way;
        clear = now;
    }
    return select(end, -end, root2 < 0.0);
}

// Returns the column, row and height (unscaled) of the point after the way `way` along `l`.
fn relief_point(relief: Relief, l: vec3<f32>, way: f32) -> vec3<f32> {
    let z = relief.field.range.y * relief.scale + way * l.z + 0.5 * relief_bend(relief, l) * way * way;
    return vec3<f32>(relief_place(relief.place, l, way), z / relief.scale);
}

// Returns the texture coordinates of the mesh at which the capture shows `point` to an eye at `wo`.
fn relief_uv(relief: Relief, material: Material, point: vec3<f32>, wo: vec3<f32>) -> vec2<f32> {
    let shown = point.xy - point.z * height_slope(wo);
    let at = (shown + 0.5) / vec2<f32>(relief.field.size);
    return vec2<f32>(at.x, 1.0 - at.y) / material.uv_scale;
}

// Returns whether relief of heights times `scale` stands between the point and the light at `wi`.
fn relief_blocked(relief: Relief, point: vec3<f32>, wi: vec3<f32>, scale: f32) -> bool {
    let lowest = point.z * scale + RELIEF_BIAS;
    let bend = relief_bend(relief, wi);
    let depth = relief.field.range.y * scale - lowest;
    if depth <= 0.0 || wi.z <= 0.0 {
        return false;
    }
    // Up to the lid; a surface that bends up catches the ray at the latest where it no longer rises.
    let root2 = wi.z * wi.z + 2.0 * bend * depth;
    var end = 2.0 * depth / (wi.z + sqrt(max(root2, 0.0)));
    if root2 < 0.0 {
        end = -wi.z / bend;
    }
    let steps = clamp(ceil(end * length(wi.xy) / RELIEF_STEP), MIN_RELIEF_STEPS, MAX_RELIEF_STEPS);
    for (var i = 1u; i <= u32(steps); i++) {
        let way = end * (f32(i) / steps);
        let z = lowest + way * wi.z + 0.5 * bend * way * way;
        if z < scale * height_at_wrapped(relief.field, relief_place(point.xy, wi, way)) {
            return true;
        }
    }
    return false;
}

// Returns whether relief takes the light at `wi` from the point, which is more than the measured values know: they hold
// the shadows of the relief as it was measured. `bare` values hold none.
fn relief_shadowed(relief: Relief, point: vec3<f32>, wi: vec3<f32>, bare: bool) -> bool {
    if relief.scale <= 0.0 || (relief.scale == 1.0 && !bare) {
        return false;
    }
    if !relief_blocked(relief, point, wi, relief.scale) {
        return false;
    }
    return bare || !relief_blocked(relief, point, wi, 1.0);
}

// Returns the change of the interpolated normal along tangent and bitangent, per unit of length: xx, xy, yy.
fn relief_curvature(hit: Hit, s: Surface) -> vec3<f32> {
    let corners = corners_of(hit);
    let a = corners[0];
    let b = corners[1];
    let c = corners[2];
    let e = b.position - a.position;
    let f = c.position - a.position;
    let up = cross(e, f);
    let area2 = max(dot(up, up), 1e-30);
    // Rates of the second and third corner's weights along tangent and bitangent.
    let along = (b.normal - a.normal) * (dot(cross(s.tangent, f), up) / area2)
        + (c.normal - a.normal) * (dot(cross(e, s.tangent), up) / area2);
    let across = (b.normal - a.normal) * (dot(cross(s.bitangent, f), up) / area2)
        + (c.normal - a.normal) * (dot(cross(e, s.bitangent), up) / area2);
    return vec3<f32>(
        dot(along, s.tangent),
        0.5 * (dot(along, s.bitangent) + dot(across, s.tangent)),
        dot(across, s.bitangent),
    );
}
