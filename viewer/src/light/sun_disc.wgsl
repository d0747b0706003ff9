// The sun's disc as a light at infinity: soft shadows by rays to its points. Twin: sun_disc.rs.

const SUN_TAU: f32 = 6.2831853;

// Draws a direction to a point of the disc from two numbers in [0, 1), every part of the disc as likely.
fn sun_sample(at: vec2<f32>) -> vec3<f32> {
    let cos_here = 1.0 - at.x * frame.sun_part;
    let radius = sqrt(max(1.0 - cos_here * cos_here, 0.0));
    let angle = SUN_TAU * at.y;
    let across = perpendicular(frame.sun_direction);
    let other = cross(frame.sun_direction, across);
    return normalize(frame.sun_direction * cos_here + (across * cos(angle) + other * sin(angle)) * radius);
}

// Returns the radiance of the disc where it lies in `direction`, 0 beside it; a sun without a size is not seen.
fn sun_radiance(direction: vec3<f32>) -> vec3<f32> {
    if frame.sun_part <= 0.0 || 1.0 - dot(direction, frame.sun_direction) > frame.sun_part {
        return vec3<f32>(0.0);
    }
    return frame.sun_irradiance / max(SUN_TAU * frame.sun_part, 1e-9);
}
