// Rays as the z axis [Woop 2013]. Twin: shear.rs.

struct Shear {
    factors: vec3<f32>,
    axis: u32,
}

// Prepares a direction that need not be unit, but not zero.
fn shear_new(direction: vec3<f32>) -> Shear {
    let size = abs(direction);
    let axis = select(select(2u, 1u, size.y > size.z), 0u, size.x > size.y && size.x > size.z);
    let d = shear_turn(direction, axis);
    let inverse = 1.0 / d.z;
    return Shear(vec3<f32>(d.x * inverse, d.y * inverse, inverse), axis);
}

// Shears a point relative to the ray's origin: returns two coordinates across the ray, and t.
fn shear_apply(shear: Shear, given: vec3<f32>) -> vec3<f32> {
    let v = shear_turn(given, shear.axis);
    return vec3<f32>(v.x - shear.factors.x * v.z, v.y - shear.factors.y * v.z, v.z * shear.factors.z);
}

// Returns whether a triangle that is counter-clockwise from outside, and is seen with this area, has its outside
// towards the ray.
fn shear_is_towards(shear: Shear, area: f32) -> bool {
    return area * shear.factors.z < 0.0;
}

// Turns the components in cyclic order so that `axis` becomes z.
fn shear_turn(v: vec3<f32>, axis: u32) -> vec3<f32> {
    return select(select(v, v.zxy, axis == 1u), v.yzx, axis == 0u);
}
