enable wgpu_ray_query;
// The tracer for adapters with ray queries. No browser reads this file; it comes first when the
// texts are joined, because an enable directive must.

@group(1) @binding(0) var acceleration: acceleration_structure;

const RAY_ALL_INSTANCES: u32 = 0xffu;
const RAY_FLAG_TERMINATE_ON_FIRST_HIT: u32 = 4u;

fn trace_closest(origin: vec3<f32>, direction: vec3<f32>) -> Hit {
    var query: ray_query;
    rayQueryInitialize(&query, acceleration, RayDesc(0u, RAY_ALL_INSTANCES, 0.0, TRACE_FAR, origin, direction));
    while (rayQueryProceed(&query)) {
    }
    let found = rayQueryGetCommittedIntersection(&query);
    if found.kind == RAY_QUERY_INTERSECTION_NONE {
        return Hit(TRACE_FAR, NO_HIT, 0.0, 0.0, 0u);
    }
    let instance = found.instance_custom_data;
    let primitive = instances[instance].first_triangle + found.primitive_index;
    return Hit(found.t, primitive, found.barycentrics.x, found.barycentrics.y, instance);
}

fn trace_occluded(origin: vec3<f32>, direction: vec3<f32>, distance: f32) -> bool {
    var query: ray_query;
    rayQueryInitialize(
        &query,
        acceleration,
        RayDesc(RAY_FLAG_TERMINATE_ON_FIRST_HIT, RAY_ALL_INSTANCES, 0.0, distance, origin, direction),
    );
    while (rayQueryProceed(&query)) {
    }
    return rayQueryGetCommittedIntersection(&query).kind != RAY_QUERY_INTERSECTION_NONE;
}
