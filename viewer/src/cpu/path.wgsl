// Random numbers of a pixel's path, and when it ends. Twin: path.rs.

// What random numbers are for.
const AMBIENT_NUMBERS: u32 = 0u;
const SCATTER_NUMBERS: u32 = 1u;
const CHOICE_NUMBERS: u32 = 2u;
const LIGHT_NUMBERS: u32 = 3u;
const SUN_NUMBERS: u32 = 4u;
const TEXEL_NUMBERS: u32 = 8u;
// Least probability with which Russian roulette keeps a path.
const MIN_KEPT: f32 = 0.05;

// Returns the seed of the pixel's random numbers at a depth of its path, for one purpose.
fn seed_of(pixel: vec2<u32>, depth: u32, purpose: u32) -> u32 {
    return sampler_hash(pixel.x + sampler_hash(pixel.y + sampler_hash(depth + (purpose << 16u))));
}

// Plays Russian roulette with the number `at` in [0, 1): dim paths end, the others carry the share of those. Returns
// the throughput of a path that goes on, 0 of one that ends.
fn roulette(throughput: vec3<f32>, at: f32) -> vec3<f32> {
    let kept = clamp(most(throughput), MIN_KEPT, 1.0);
    if most(throughput) <= 0.0 || at >= kept {
        return vec3<f32>(0.0);
    }
    return throughput / kept;
}
