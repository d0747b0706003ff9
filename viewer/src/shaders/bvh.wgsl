// Traversal of the bounding volume hierarchy. Twin: bvh.rs, which also says where the constants come from.

struct BvhNode {
    lo: vec3<f32>,
    first: u32,
    hi: vec3<f32>,
    count: u32,
}

@group(1) @binding(0) var<storage, read> nodes: array<BvhNode>;

const BVH_STACK: u32 = 64u;
const BOX_SLACK: f32 = 1.000001;
const LEAST_DIRECTION: f32 = 1e-15;
const LEAST_DETERMINANT: f32 = 1e-20;

fn bvh_trace(origin: vec3<f32>, direction: vec3<f32>, t_max: f32, any: bool) -> Hit {
    var best = Hit(t_max, NO_HIT, 0.0, 0.0);
    let least = select(vec3<f32>(LEAST_DIRECTION), vec3<f32>(-LEAST_DIRECTION), direction < vec3<f32>(0.0));
    let inverse = 1.0 / select(direction, least, abs(direction) < vec3<f32>(LEAST_DIRECTION));
    var stack: array<u32, BVH_STACK>;
    var size = 0u;
    var at = 0u;
    if bvh_enter(nodes[0], origin, inverse, best.t) >= best.t {
        return best;
    }
    loop {
        let node = nodes[at];
        if node.count > 0u {
            for (var primitive = node.first; primitive < node.first + node.count; primitive++) {
                let hit = bvh_intersect(origin, direction, primitive);
                if hit.primitive != NO_HIT && hit.t < best.t {
                    best = hit;
                    if any {
                        return best;
                    }
                }
            }
        } else {
            let left = bvh_enter(nodes[node.first], origin, inverse, best.t);
            let right = bvh_enter(nodes[node.first + 1u], origin, inverse, best.t);
            // Go to the nearer child, keep the farther one.
            let left_first = left <= right;
            if min(left, right) < best.t {
                if max(left, right) < best.t && size < BVH_STACK {
                    stack[size] = select(node.first, node.first + 1u, left_first);
                    size += 1u;
                }
                at = select(node.first + 1u, node.first, left_first);
                continue;
            }
        }
        if size == 0u {
            return best;
        }
        size -= 1u;
        at = stack[size];
    }
    return best;
}

fn bvh_enter(node: BvhNode, origin: vec3<f32>, inverse: vec3<f32>, t_max: f32) -> f32 {
    let a = (node.lo - origin) * inverse;
    let b = (node.hi - origin) * inverse;
    let lo = min(a, b);
    let hi = max(a, b);
    let near = max(max(lo.x, max(lo.y, lo.z)), 0.0);
    let far = min(hi.x, min(hi.y, hi.z)) * BOX_SLACK;
    return select(t_max, near, near <= far && near < t_max);
}

fn bvh_intersect(origin: vec3<f32>, direction: vec3<f32>, primitive: u32) -> Hit {
    let miss = Hit(0.0, NO_HIT, 0.0, 0.0);
    let corner = triangles[primitive].vertices;
    let a = vertices[corner.x].position;
    let ab = vertices[corner.y].position - a;
    let ac = vertices[corner.z].position - a;
    let p = cross(direction, ac);
    let determinant = dot(ab, p);
    if abs(determinant) < LEAST_DETERMINANT {
        return miss;
    }
    let inverse = 1.0 / determinant;
    let s = origin - a;
    let u = dot(s, p) * inverse;
    let q = cross(s, ab);
    let v = dot(direction, q) * inverse;
    let t = dot(ac, q) * inverse;
    if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 {
        return Hit(t, primitive, u, v);
    }
    return miss;
}
