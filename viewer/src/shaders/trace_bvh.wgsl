// Entry point of the tracer that runs everywhere: a bounding volume hierarchy in storage buffers.

fn trace_closest(origin: vec3<f32>, direction: vec3<f32>) -> Hit {
    return bvh_trace(origin, direction, TRACE_FAR, false);
}

fn trace_occluded(origin: vec3<f32>, direction: vec3<f32>, distance: f32) -> bool {
    return bvh_trace(origin, direction, distance, true).primitive != NO_HIT;
}

@compute @workgroup_size(8, 8)
fn trace_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < frame.width && id.y < frame.height {
        shade_pixel(id.xy);
    }
}
