// A direction set on the disk: triangles, hull edges, compact grid. Twin: asset/sphere.rs.

const SPHERE_HEADER_WORDS: u32 = 8u;
const DIRECTION_WORDS: u32 = 3u;
const TRIANGLE_WORDS: u32 = 12u;
const EDGE_WORDS: u32 = 8u;
const ITEM_EDGE: u32 = 0x80000000u;
const INSIDE_TOLERANCE: f32 = -1e-5;
// Larger than any squared distance on the disk; the twin has infinity.
const FAR: f32 = 1e30;

struct Neighbours {
    ids: vec3<u32>,
    beyond: f32,
    weights: vec3<f32>,
    pad: f32,
}

fn sphere_direction(at: u32, id: u32) -> vec3<f32> {
    let base = at + SPHERE_HEADER_WORDS + id * DIRECTION_WORDS;
    return vec3<f32>(asset_f32(base), asset_f32(base + 1u), asset_f32(base + 2u));
}

fn sphere_locate(at: u32, d: vec3<f32>) -> Neighbours {
    let side = asset_word(at + 3u);
    let triangles_at = at + SPHERE_HEADER_WORDS + asset_word(at) * DIRECTION_WORDS;
    let edges_at = triangles_at + asset_word(at + 1u) * TRIANGLE_WORDS;
    let cells_at = edges_at + asset_word(at + 2u) * EDGE_WORDS;
    let items_at = cells_at + side * side + 1u;
    let cell_xy = vec2<u32>(clamp((d.xy + 1.0) * 0.5 * f32(side), vec2<f32>(0.0), vec2<f32>(f32(side) - 1.0)));
    let cell = cell_xy.y * side + cell_xy.x;

    var best_inside = -FAR;
    var best_distance = FAR;
    var inside = Neighbours(vec3<u32>(0u), 1.0, vec3<f32>(1.0, 0.0, 0.0), 0.0);
    var outside = inside;
    let last = asset_word(cells_at + cell + 1u);
    for (var slot = asset_word(cells_at + cell); slot < last; slot++) {
        let item = asset_word(items_at + slot);
        if (item & ITEM_EDGE) == 0u {
            let t = triangles_at + item * TRIANGLE_WORDS;
            let x = d.x - asset_f32(t);
            let y = d.y - asset_f32(t + 1u);
            let w1 = asset_f32(t + 2u) * x + asset_f32(t + 3u) * y;
            let w2 = asset_f32(t + 4u) * x + asset_f32(t + 5u) * y;
            let w0 = 1.0 - w1 - w2;
            let least = min(w0, min(w1, w2));
            if least > best_inside {
                best_inside = least;
                inside.ids = vec3<u32>(asset_word(t + 6u), asset_word(t + 7u), asset_word(t + 8u));
                inside.weights = vec3<f32>(w0, w1, w2);
                if least >= 0.0 {
                    break;
                }
            }
        } else {
            let e = edges_at + (item & ~ITEM_EDGE) * EDGE_WORDS;
            let a = vec2<f32>(asset_f32(e), asset_f32(e + 1u));
            let extent = vec2<f32>(asset_f32(e + 2u), asset_f32(e + 3u));
            let t = clamp(dot(d.xy - a, extent) * asset_f32(e + 4u), 0.0, 1.0);
            let p = a + t * extent;
            let off = d.xy - p;
            let distance2 = dot(off, off);
            if distance2 < best_distance {
                best_distance = distance2;
                let cos_hull = sqrt(max(1.0 - dot(p, p), 1e-6));
                let first = asset_word(e + 5u);
                outside.ids = vec3<u32>(first, asset_word(e + 6u), first);
                outside.weights = vec3<f32>(1.0 - t, t, 0.0);
                outside.beyond = min(d.z / cos_hull, 1.0);
            }
        }
    }
    if best_inside >= INSIDE_TOLERANCE || best_distance == FAR {
        let clamped = max(inside.weights, vec3<f32>(0.0));
        inside.weights = clamped / (clamped.x + clamped.y + clamped.z);
        return inside;
    }
    return outside;
}

// Returns the direction within the hull that is nearest to `d`, whose neighbours are `place`. It returns at its end
// alone: with an early return glslang makes garbage of naga's HLSL.
fn sphere_within_hull(at: u32, d: vec3<f32>, place: Neighbours) -> vec3<f32> {
    var nearest = d;
    if place.beyond < 1.0 {
        let p = sphere_direction(at, place.ids.x).xy;
        let q = sphere_direction(at, place.ids.y).xy;
        let xy = place.weights.x * p + place.weights.y * q;
        nearest = vec3<f32>(xy, sqrt(max(1.0 - dot(xy, xy), 1e-6)));
    }
    return nearest;
}
