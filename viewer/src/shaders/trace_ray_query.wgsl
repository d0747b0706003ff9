enable wgpu_ray_query;
// The tracer for adapters with ray queries. No browser reads this file; it comes first when the
// texts are joined, because an enable directive must.

@group(1) @binding(0) var acceleration: acceleration_structure;

// Masks of the instances. Twins: MESHES, PROXIES and WITH_VOLUMES in acceleration_structure.rs.
const RAY_MESHES: u32 = 1u;
const RAY_PROXIES: u32 = 2u;
const RAY_WITH_VOLUMES: u32 = 4u;
const RAY_FLAG_TERMINATE_ON_FIRST_HIT: u32 = 4u;
// Fronts and backs are told in the mesh's own space, where mirrored instances have theirs as others do.
const RAY_FLAG_CULL_BACK_FACING: u32 = 0x10u;

// Returns the nearest hit of a mesh.
fn trace_mesh(origin: vec3<f32>, direction: vec3<f32>) -> Hit {
    return trace_with(0u, RAY_MESHES, origin, direction, 0.0, TRACE_FAR);
}

// Returns any hit of a mesh, or the nearest face by which the ray enters a volume's proxy, from `begin` on.
fn trace_any_or_front(meshes: bool, origin: vec3<f32>, direction: vec3<f32>, begin: f32, t_max: f32) -> Hit {
    let flags = select(RAY_FLAG_CULL_BACK_FACING, RAY_FLAG_TERMINATE_ON_FIRST_HIT, meshes);
    let mask = select(RAY_PROXIES, RAY_MESHES, meshes);
    return trace_with(flags, mask, origin + direction * begin, direction, begin, t_max - begin);
}

// Traces a ray through the instances of `mask`; meshes that volumes stand in for count within their spheres only. `begin` is where
// `origin` is along the ray by which volumes are entered.
fn trace_with(flags: u32, mask: u32, origin: vec3<f32>, direction: vec3<f32>, begin: f32, t_max: f32) -> Hit {
    var hit = Hit(t_max, NO_HIT, 0.0, 0.0, 0u);
    let spheres = lod_transition_along(lod_transition, origin, direction);
    let widest = lod_transition_mesh(spheres, frame.widest_leaf);
    var query: ray_query;
    // What is handed over is looked for by itself, within the widest of the spheres: all that is beyond is left out.
    let parts = select(1u, 2u, with_lod_transition && mask == RAY_MESHES);
    for (var part = 0u; part < parts; part++) {
        let from_t = select(max(widest.x, 0.0), 0.0, part == 0u);
        let reach = select(min(widest.y, hit.t), t_max, part == 0u);
        let is_enough = (flags & RAY_FLAG_TERMINATE_ON_FIRST_HIT) != 0u && hit.primitive != NO_HIT;
        if is_enough || from_t >= reach {
            break;
        }
        let asked = select(RAY_WITH_VOLUMES, mask, part == 0u);
        rayQueryInitialize(&query, acceleration, RayDesc(flags, asked, from_t, reach, origin, direction));
        while (rayQueryProceed(&query)) {
            // What is handed over is not opaque: it is there within its own sphere only, and a skin's shell between its two.
            if with_lod_transition {
                let met = rayQueryGetCandidateIntersection(&query);
                let instance = met.instance_custom_data;
                let there = lod_transition_mesh(spheres, instances[instance].leaf_width);
                var is_there = met.t >= there.x && met.t < there.y;
                if mask == RAY_PROXIES {
                    is_there = volume_is_there(spheres, instance, begin, met.t);
                }
                if is_there {
                    rayQueryConfirmIntersection(&query);
                }
            }
        }
        let found = rayQueryGetCommittedIntersection(&query);
        if found.kind != RAY_QUERY_INTERSECTION_NONE {
            let instance = found.instance_custom_data;
            let primitive = instances[instance].first_triangle + found.primitive_index;
            hit = Hit(found.t, primitive, found.barycentrics.x, found.barycentrics.y, instance);
        }
    }
    return hit;
}

// Returns whether a mesh is in the way.
fn trace_occluded(origin: vec3<f32>, direction: vec3<f32>, distance: f32) -> bool {
    return trace_with(RAY_FLAG_TERMINATE_ON_FIRST_HIT, RAY_MESHES, origin, direction, 0.0, distance).primitive != NO_HIT;
}
