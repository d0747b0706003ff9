// Stands in for volumetric textures in scenes that have none: what compilers do not see costs nothing. The other text:
// cpu/volumes.wgsl.

const WITH_VOLUMES: bool = false;

// Returns 0 where a mesh is in the way of light, else 1.
fn past_volumes(origin: vec3<f32>, direction: vec3<f32>, distance: f32, width: f32, chance: f32) -> f32 {
    return select(1.0, 0.0, distance > 0.0 && trace_occluded(origin, direction, distance));
}

// Does nothing: no path meets a volume.
fn volume_pass(at: vec2<u32>) {
}

// Returns the whole ray: no front is asked for.
fn volume_range(spheres: SpheresAlong, instance: u32, begin: f32) -> vec2<f32> {
    return vec2<f32>(0.0, TRACE_FAR);
}

// Returns true: no front is asked for.
fn volume_is_there(spheres: SpheresAlong, instance: u32, begin: f32, t: f32) -> bool {
    return true;
}
