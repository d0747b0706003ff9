// Stands in for volumetric textures in scenes that have none: what compilers do not see costs nothing. Twin: volume_shade.wgsl.

const WITH_VOLUMES: bool = false;

fn past_volumes(origin: vec3<f32>, direction: vec3<f32>, distance: f32, width: f32) -> f32 {
    return select(1.0, 0.0, distance > 0.0 && trace_occluded(origin, direction, distance));
}

fn volume_pass(at: vec2<u32>) {
}
