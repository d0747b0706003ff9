// Well-spread random numbers: Sobol's sequence in two dimensions, its digits and its order scrambled after Owen by a
// hash [Burley 2020]. Twin: sampler.rs.

// Hashes a word.
fn sampler_hash(given: u32) -> u32 {
    var x = given;
    x ^= x >> 16u;
    x *= 0x7feb352du;
    x ^= x >> 15u;
    x *= 0x846ca68bu;
    return x ^ (x >> 16u);
}

// Scrambles the digits of x from the lowest up, each by those below it [Laine and Karras 2011].
fn sampler_permute(given: u32, seed: u32) -> u32 {
    var x = given + seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    return x ^ (x * 0x8d22f6e6u);
}

// Scrambles the digits of x from the highest down, each by those above it.
fn sampler_scramble(x: u32, seed: u32) -> u32 {
    return reverseBits(sampler_permute(reverseBits(x), seed));
}

// Returns the number `index` of Sobol's second dimension, binary digits behind the point.
fn sampler_second(given: u32) -> u32 {
    var index = given;
    var direction = 0x80000000u;
    var x = 0u;
    while index != 0u {
        if (index & 1u) == 1u {
            x ^= direction;
        }
        index >>= 1u;
        direction ^= direction >> 1u;
    }
    return x;
}

// Returns two numbers in [0, 1): those of `sample` in the stream `seed`. Any power of two of samples in a row is
// stratified.
fn sampler_two(sample: u32, seed: u32) -> vec2<f32> {
    let hashed = sampler_hash(seed);
    let index = sampler_scramble(sample, hashed);
    let x = sampler_scramble(reverseBits(index), sampler_hash(hashed ^ 0x9e3779b9u));
    let y = sampler_scramble(sampler_second(index), sampler_hash(hashed ^ 0x3c6ef372u));
    // 24 bits, so that 1 is not reached by rounding.
    return vec2<f32>(vec2<u32>(x, y) >> vec2<u32>(8u)) * 5.9604645e-8;
}

// Returns a number in [0, 1) without any order.
fn sampler_one(seed: u32) -> f32 {
    return f32(sampler_hash(seed) >> 8u) * 5.9604645e-8;
}

// Draws a direction about +z whose density is its cosine over pi.
fn sampler_cosine(at: vec2<f32>) -> vec3<f32> {
    let angle = 6.2831855 * at.y;
    let radius = sqrt(at.x);
    return vec3<f32>(radius * cos(angle), radius * sin(angle), sqrt(1.0 - at.x));
}

// Draws a direction with the same density everywhere on the sphere.
fn sampler_sphere(at: vec2<f32>) -> vec3<f32> {
    let z = 1.0 - 2.0 * at.x;
    let angle = 6.2831855 * at.y;
    let radius = sqrt(max(1.0 - z * z, 0.0));
    return vec3<f32>(radius * cos(angle), radius * sin(angle), z);
}
