// Traversal of the hierarchies. Twin: bvh.rs, which also says where the constants come from.

struct BvhNode {
    lo: vec3<f32>,
    first: u32,
    hi: vec3<f32>,
    count: u32,
}

// In the module of a scene, as many as the scene needs: a GPU writes zeros to all of them for every ray.
const BVH_STACK: u32 = 80u;
const BOX_SLACK: f32 = 1.000001;
const MIN_DIRECTION: f32 = 1e-15;
const MIN_DETERMINANT: f32 = 1e-30;
const EDGE_SLACK: f32 = 2.4e-7;
const NO_INSTANCE: u32 = 0xffffffffu;

// Traces a ray from node `root` on: returns the hit that `which` asks for, one of HIT_ANY, HIT_NEAREST and HIT_FRONT.
fn bvh_trace(root: u32, origin: vec3<f32>, direction: vec3<f32>, t_max: f32, which: u32) -> Hit {
    var best = Hit(t_max, NO_HIT, 0.0, 0.0, 0u);
    let spheres = lod_transition_along(lod_transition, origin, direction);
    // Where the mesh that the ray is in begins to be there, and beyond what nothing counts.
    var from_t = 0.0;
    var reach = t_max;
    let world = box_ray(origin, direction);
    var ray = world;
    var shear = shear_new(direction);
    // Nodes that wait.
    var stack: array<u32, BVH_STACK>;
    var size = 0u;
    // The instance that the ray is in, and where the stack stood before.
    var instance = NO_INSTANCE;
    var below = 0u;
    var node = node_at(root);
    if bvh_enter(node, ray, reach) >= reach {
        return best;
    }
    loop {
        if node.count == 0u {
            let left = node_at(node.first);
            let right = node_at(node.first + 1u);
            let t_left = bvh_enter(left, ray, reach);
            let t_right = bvh_enter(right, ray, reach);
            // Go to the nearer child, keep the farther one.
            let left_first = t_left <= t_right;
            if min(t_left, t_right) < reach {
                if max(t_left, t_right) < reach && size < BVH_STACK {
                    stack[size] = select(node.first, node.first + 1u, left_first);
                    size += 1u;
                }
                node.first = select(right.first, left.first, left_first);
                node.count = select(right.count, left.count, left_first);
                continue;
            }
        } else if instance == NO_INSTANCE {
            // Into the mesh's own space, where t is the same because the direction is not made unit again.
            instance = node.first;
            below = size;
            let own = object_from_world(instance, vec4<f32>(direction, 0.0));
            ray = box_ray(object_from_world(instance, vec4<f32>(origin, 1.0)), own);
            shear = shear_new(own);
            node = node_at(instances[instance].root);
            // Fronts are those of volumes' proxies, which are entered wherever they are.
            if with_lod_transition && which != HIT_FRONT {
                let there = lod_transition_mesh(spheres, instances[instance].leaf_width);
                from_t = there.x;
                reach = min(best.t, there.y);
            }
            if bvh_enter(node, ray, reach) < reach {
                continue;
            }
        } else {
            for (var primitive = node.first; primitive < node.first + node.count; primitive++) {
                let hit = bvh_intersect(ray.origin, shear, primitive, which == HIT_FRONT);
                if hit.primitive != NO_HIT && hit.t < reach && hit.t >= from_t {
                    best = hit;
                    reach = hit.t;
                    best.instance = instance;
                    if which == HIT_ANY {
                        return best;
                    }
                }
            }
        }
        if size == below {
            instance = NO_INSTANCE;
            below = 0u;
            ray = world;
            reach = best.t;
        }
        if size == 0u {
            return best;
        }
        size -= 1u;
        node = node_at(stack[size]);
    }
    return best;
}

// A ray made ready for boxes.
struct BoxRay {
    origin: vec3<f32>,
    inverse: vec3<f32>,
}

// Prepares a ray for boxes.
fn box_ray(origin: vec3<f32>, direction: vec3<f32>) -> BoxRay {
    let least = select(vec3<f32>(MIN_DIRECTION), vec3<f32>(-MIN_DIRECTION), direction < vec3<f32>(0.0));
    return BoxRay(origin, 1.0 / select(direction, least, abs(direction) < vec3<f32>(MIN_DIRECTION)));
}

// Returns the distance at which a ray enters a box, or `t_max` if it does not before that.
fn bvh_enter(node: BvhNode, ray: BoxRay, t_max: f32) -> f32 {
    let a = (node.lo - ray.origin) * ray.inverse;
    let b = (node.hi - ray.origin) * ray.inverse;
    let lo = min(a, b);
    let hi = max(a, b);
    let near = max(max(lo.x, max(lo.y, lo.z)), 0.0);
    let far = min(hi.x, min(hi.y, hi.z)) * BOX_SLACK;
    return select(t_max, near, near <= far && near < t_max);
}

// Returns twice the signed area of the origin, p and q, and how much of it is rounding.
fn bvh_edge(p: vec3<f32>, q: vec3<f32>) -> vec2<f32> {
    let a = p.x * q.y;
    let b = p.y * q.x;
    return vec2<f32>(a - b, EDGE_SLACK * (abs(a) + abs(b)));
}

// Intersects a ray and a triangle: returns (t, u, v), seen from either side, without gaps between triangles that share
// an edge [Woop 2013]. With `front`, only triangles that are seen counter-clockwise count.
fn bvh_intersect(origin: vec3<f32>, shear: Shear, primitive: u32, front: bool) -> Hit {
    let miss = Hit(0.0, NO_HIT, 0.0, 0.0, 0u);
    let corner = triangle_at(primitive).vertices;
    let a = shear_apply(shear, vertex_position(corner.x) - origin);
    let b = shear_apply(shear, vertex_position(corner.y) - origin);
    let c = shear_apply(shear, vertex_position(corner.z) - origin);
    let wa = bvh_edge(c, b);
    let wb = bvh_edge(a, c);
    let wc = bvh_edge(b, a);
    let positive = wa.x >= -wa.y && wb.x >= -wb.y && wc.x >= -wc.y;
    let negative = wa.x <= wa.y && wb.x <= wb.y && wc.x <= wc.y;
    let determinant = wa.x + wb.x + wc.x;
    if !(positive || negative) || abs(determinant) < MIN_DETERMINANT {
        return miss;
    }
    if front && !shear_is_towards(shear, -determinant) {
        return miss;
    }
    let inverse = 1.0 / determinant;
    let t = (wa.x * a.z + wb.x * b.z + wc.x * c.z) * inverse;
    if t <= 0.0 {
        return miss;
    }
    let u = clamp(wb.x * inverse, 0.0, 1.0);
    return Hit(t, primitive, u, clamp(wc.x * inverse, 0.0, 1.0 - u), 0u);
}
