// Stands in for volumetric textures in scenes that have none: what compilers do not see costs nothing. The other text:
// cpu/volumes.wgsl.

const WITH_VOLUMES: bool = false;

// Returns 0 where a mesh is in the way of light, else 1.
fn past_volumes(origin: vec3<f32>, direction: vec3<f32>, distance: f32, width: f32) -> f32 {
    return select(1.0, 0.0, distance > 0.0 && trace_occluded(origin, direction, distance));
}

// Does nothing: no path meets a volume.
fn volume_pass(at: vec2<u32>) {
}
