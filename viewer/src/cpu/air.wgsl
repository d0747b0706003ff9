// Aerial perspective: what the air between the eye and a place takes away and adds. Twin: air.rs, which says where it is
// wrong.

// Height over the horizon of the row of the sky's picture that is next to it: half a row of 128, as the sine of an angle.
const HORIZON_SINE: f32 = 0.0122715;

// Returns the share of light that passes the air of `t` along a path's ray. All passes where there is no air, and on the
// ways between surfaces, which are short.
fn air_passed(path: Path, t: f32) -> vec3<f32> {
    if (path.instance & SCATTERED) != 0u || most(frame.air) <= 0.0 {
        return vec3<f32>(1.0);
    }
    return exp(-frame.air * t);
}

// Returns the radiance that the air would have along a ray without an end.
fn air_radiance(direction: vec3<f32>) -> vec3<f32> {
    if !with_environment || frame.environment.x == 0u {
        return vec3<f32>(0.0);
    }
    let length2 = dot(direction.xz, direction.xz);
    let level = select(vec2<f32>(0.0, -1.0), direction.xz * inverseSqrt(max(length2, 1e-30)), length2 > 1e-30);
    let cosine = sqrt(1.0 - HORIZON_SINE * HORIZON_SINE);
    return environment_radiance(vec3<f32>(level.x * cosine, HORIZON_SINE, level.y * cosine));
}
