// Entry points that draw: each is one pass over the pixels of a band.

// Pixels of a workgroup.
override group_width: u32 = 8u;
override group_height: u32 = 8u;

// Returns whether the band has such a pixel, and draws what is a mesh, what a volume and which level of that for its path.
fn in_band(pixel: vec2<u32>) -> bool {
    lod_transition = lod_transition_of_path(frame.eye, frame.pixel_width, whole_picture(pixel), frame.sample);
    return pixel.x < frame.width && pixel.y < frame.rows;
}

// Traces the ray from the eye.
@compute @workgroup_size(group_width, group_height)
fn camera_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if in_band(id.xy) {
        camera_pass(id.xy);
    }
}

// Adds the light at what the latest ray hit.
@compute @workgroup_size(group_width, group_height)
fn light_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if in_band(id.xy) {
        light_pass(id.xy);
    }
}

// Traces the next ray of a traced path.
@compute @workgroup_size(group_width, group_height)
fn scatter_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if in_band(id.xy) {
        scatter_pass(id.xy);
    }
}

// Traces the next ray from a mirror.
@compute @workgroup_size(group_width, group_height)
fn mirror_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if in_band(id.xy) {
        mirror_pass(id.xy);
    }
}

// Adds what the latest ray meets in volumes.
@compute @workgroup_size(group_width, group_height)
fn volume_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if in_band(id.xy) {
        volume_pass(id.xy);
    }
}
