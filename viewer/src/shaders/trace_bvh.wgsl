// The tracer that runs everywhere: a bounding volume hierarchy in storage buffers.

fn trace_closest(origin: vec3<f32>, direction: vec3<f32>) -> Hit {
    return bvh_trace(origin, direction, TRACE_FAR, false);
}

fn trace_occluded(origin: vec3<f32>, direction: vec3<f32>, distance: f32) -> bool {
    return bvh_trace(origin, direction, distance, true).primitive != NO_HIT;
}
