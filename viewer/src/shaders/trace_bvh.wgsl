// The tracer that runs everywhere: a bounding volume hierarchy in storage buffers.

fn trace_closest(origin: vec3<f32>, direction: vec3<f32>) -> Hit {
    return bvh_trace(frame.root, origin, direction, TRACE_FAR, false);
}

fn trace_occluded(origin: vec3<f32>, direction: vec3<f32>, distance: f32) -> bool {
    return bvh_trace(frame.root, origin, direction, distance, true).primitive != NO_HIT;
}

// The nearest face of a volume's proxy.
fn trace_proxies(origin: vec3<f32>, direction: vec3<f32>, t_max: f32) -> Hit {
    return bvh_trace(frame.volume_root, origin, direction, t_max, false);
}
