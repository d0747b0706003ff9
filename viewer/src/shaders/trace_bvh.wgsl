// The tracer that runs everywhere: a bounding volume hierarchy in storage buffers.

// Returns the nearest hit of a mesh.
fn trace_mesh(origin: vec3<f32>, direction: vec3<f32>) -> Hit {
    return bvh_trace(frame.root, origin, direction, 0.0, TRACE_FAR, HIT_NEAREST);
}

// Returns whether a mesh is in the way.
fn trace_occluded(origin: vec3<f32>, direction: vec3<f32>, distance: f32) -> bool {
    return bvh_trace(frame.root, origin, direction, 0.0, distance, HIT_ANY).primitive != NO_HIT;
}

// Returns any hit of a mesh, or the nearest face by which the ray enters a volume's proxy, from `begin` on.
fn trace_any_or_front(meshes: bool, origin: vec3<f32>, direction: vec3<f32>, begin: f32, t_max: f32) -> Hit {
    let root = select(frame.volume_root, frame.root, meshes);
    let which = select(HIT_FRONT, HIT_ANY, meshes);
    return bvh_trace(root, origin + direction * begin, direction, begin, t_max - begin, which);
}
