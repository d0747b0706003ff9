// Traversal of the hierarchies. Twins: bvh.rs, and lanes.rs, which also say where the constants come from.

struct BvhNode {
    lo: vec3<f32>,
    // A byte for each axis; the last byte has a bit for every slot that holds a node.
    exponents: u32,
    first_child: u32,
    first_primitive: u32,
    // A byte for each slot, as all that follow.
    slots: vec2<u32>,
    // Least x, greatest x, least y, greatest y, least z, greatest z.
    planes: array<vec2<u32>, 6>,
}

// In the module of a scene, as many as the scene needs: a GPU writes zeros to all of them for every ray.
const BVH_STACK: u32 = 64u;
const BOX_SLACK: f32 = 1.000001;
const MIN_DIRECTION: f32 = 1e-15;
const MIN_DETERMINANT: f32 = 1e-30;
const EDGE_SLACK: f32 = 2.4e-7;
const NO_INSTANCE: u32 = 0xffffffffu;
// Bits of a group that say which nodes are met; below them, of a group of nodes the slots that hold nodes, of a group of leaves the
// primitives that are met.
const NODES_MET: u32 = 0xff000000u;

// Traces a ray from node `root` on: returns the hit that `which` asks for, one of HIT_ANY, HIT_NEAREST and HIT_FRONT [Ylitie 2017]. Of
// fronts, those count that are there; `begin` is where `origin` is along the ray that they are entered by.
fn bvh_trace(root: u32, origin: vec3<f32>, direction: vec3<f32>, begin: f32, t_max: f32, which: u32) -> Hit {
    var best = Hit(t_max, NO_HIT, 0.0, 0.0, 0u);
    let spheres = lod_transition_along(lod_transition, origin, direction);
    // Where the mesh that the ray is in begins to be there, and beyond what nothing counts.
    var from_t = 0.0;
    var reach = t_max;
    let world = box_ray(origin, direction);
    var ray = world;
    var shear = shear_new(direction);
    // Groups that wait: the first node or primitive of a node's children, and which of them are met.
    var stack: array<vec2<u32>, BVH_STACK>;
    var size = 0u;
    // The instance that the ray is in, and where the stack stood before.
    var instance = NO_INSTANCE;
    var below = 0u;
    // As if it had met the root alone.
    var nodes = vec2<u32>(root, 0x80000000u);
    loop {
        var primitives = vec2<u32>(0u);
        if nodes.y > 0x00ffffffu {
            // Into the nearest node by the ray's octant; the others wait.
            let bit = firstLeadingBit(nodes.y);
            let slot = (bit - 24u) ^ ray.octant;
            let number = nodes.x + countOneBits(nodes.y & ((1u << slot) - 1u) & 0xffu);
            nodes.y &= ~(1u << bit);
            if nodes.y > 0x00ffffffu && size < BVH_STACK {
                stack[size] = nodes;
                size += 1u;
            }
            let node = node_at(number);
            let met = bvh_enter(node, ray, reach);
            nodes = vec2<u32>(node.first_child, (met & NODES_MET) | (node.exponents >> 24u));
            primitives = vec2<u32>(node.first_primitive, met & ~NODES_MET);
        } else {
            // A group of leaves that has waited.
            primitives = nodes;
            nodes = vec2<u32>(0u);
        }
        if instance == NO_INSTANCE && primitives.y != 0u {
            // Into the mesh's own space, where t is the same because the direction is not made unit again. What else is met waits.
            let bit = firstLeadingBit(primitives.y);
            primitives.y &= ~(1u << bit);
            if nodes.y > 0x00ffffffu && size < BVH_STACK {
                stack[size] = nodes;
                size += 1u;
            }
            if primitives.y != 0u && size < BVH_STACK {
                stack[size] = primitives;
                size += 1u;
            }
            instance = primitives.x + bit;
            below = size;
            let own = object_from_world(instance, vec4<f32>(direction, 0.0));
            ray = box_ray(object_from_world(instance, vec4<f32>(origin, 1.0)), own);
            shear = shear_new(own);
            nodes = vec2<u32>(instances[instance].root, 0x80000000u);
            if with_lod_transition {
                var there = vec2<f32>(0.0);
                if which == HIT_FRONT {
                    there = volume_range(spheres, instance, begin);
                } else {
                    there = lod_transition_mesh(spheres, instances[instance].leaf_width);
                }
                from_t = there.x;
                reach = min(best.t, there.y);
                if from_t >= reach {
                    nodes.y = 0u;
                }
            }
            continue;
        }
        while primitives.y != 0u {
            // In the order of their numbers, so that of two that are met at once all tracers keep the same.
            let bit = firstTrailingBit(primitives.y);
            primitives.y &= ~(1u << bit);
            let hit = bvh_intersect(ray.origin, shear, primitives.x + bit, which == HIT_FRONT);
            if hit.primitive != NO_HIT && hit.t < reach && hit.t >= from_t {
                if with_lod_transition && which == HIT_FRONT && !volume_is_there(spheres, instance, begin, hit.t) {
                    continue;
                }
                best = hit;
                reach = hit.t;
                best.instance = instance;
                if which == HIT_ANY {
                    return best;
                }
            }
        }
        if nodes.y <= 0x00ffffffu {
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
            nodes = stack[size];
        }
    }
    return best;
}

// A ray made ready for boxes.
struct BoxRay {
    origin: vec3<f32>,
    inverse: vec3<f32>,
    // A bit for each axis along which the ray goes: 4 for x, 2 for y, 1 for z. Slots are filled so that it meets first what is in
    // the slot whose number has all other bits.
    octant: u32,
}

// Prepares a ray for boxes.
fn box_ray(origin: vec3<f32>, direction: vec3<f32>) -> BoxRay {
    let least = select(vec3<f32>(MIN_DIRECTION), vec3<f32>(-MIN_DIRECTION), direction < vec3<f32>(0.0));
    let inverse = 1.0 / select(direction, least, abs(direction) < vec3<f32>(MIN_DIRECTION));
    let along = select(vec3<u32>(4u, 2u, 1u), vec3<u32>(0u), inverse < vec3<f32>(0.0));
    return BoxRay(origin, inverse, along.x | along.y | along.z);
}

// Returns which children of a node a ray meets before `reach`: nodes as bits from 24 on, the nearest by its octant highest, and
// primitives by their number from the node's first on.
fn bvh_enter(node: BvhNode, ray: BoxRay, reach: f32) -> u32 {
    let exponents = bytes_of(node.exponents).xyz << vec3<u32>(23u);
    let step = bitcast<vec3<f32>>(exponents) * ray.inverse;
    let first = (node.lo - ray.origin) * ray.inverse;
    let backward = ray.inverse < vec3<f32>(0.0);
    // By which planes the ray enters, and by which it leaves.
    let near_x = select(node.planes[0], node.planes[1], backward.x);
    let far_x = select(node.planes[1], node.planes[0], backward.x);
    let near_y = select(node.planes[2], node.planes[3], backward.y);
    let far_y = select(node.planes[3], node.planes[2], backward.y);
    let near_z = select(node.planes[4], node.planes[5], backward.z);
    let far_z = select(node.planes[5], node.planes[4], backward.z);
    return bvh_met(node.slots.x, ray.octant, reach, step, first, vec3<u32>(near_x.x, near_y.x, near_z.x), vec3<u32>(far_x.x, far_y.x, far_z.x))
        | bvh_met(node.slots.y, ray.octant, reach, step, first, vec3<u32>(near_x.y, near_y.y, near_z.y), vec3<u32>(far_x.y, far_y.y, far_z.y));
}

// Returns which of four slots a ray meets, by the planes by which it enters and leaves, a byte for each.
fn bvh_met(slots: u32, octant: u32, reach: f32, step: vec3<f32>, first: vec3<f32>, enter: vec3<u32>, leave: vec3<u32>) -> u32 {
    let near_x = vec4<f32>(bytes_of(enter.x)) * step.x + first.x;
    let near_y = vec4<f32>(bytes_of(enter.y)) * step.y + first.y;
    let near_z = vec4<f32>(bytes_of(enter.z)) * step.z + first.z;
    let far_x = vec4<f32>(bytes_of(leave.x)) * step.x + first.x;
    let far_y = vec4<f32>(bytes_of(leave.y)) * step.y + first.y;
    let far_z = vec4<f32>(bytes_of(leave.z)) * step.z + first.z;
    let near = max(max(near_x, near_y), max(near_z, vec4<f32>(0.0)));
    let far = min(min(far_x, far_y), far_z) * BOX_SLACK;
    // Numbers from 24 on are those of nodes, 24 + the slot's, which the octant puts in order.
    let holds = bytes_of(slots);
    let numbers = holds & vec4<u32>(31u);
    let places = select(numbers, numbers ^ vec4<u32>(octant), numbers >= vec4<u32>(24u));
    let bits = (holds >> vec4<u32>(5u)) << places;
    let met = select(vec4<u32>(0u), bits, (near <= far) & (near < vec4<f32>(reach)));
    return met.x | met.y | met.z | met.w;
}

// Returns the four bytes of a word.
fn bytes_of(word: u32) -> vec4<u32> {
    return (vec4<u32>(word) >> vec4<u32>(0u, 8u, 16u, 24u)) & vec4<u32>(255u);
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
