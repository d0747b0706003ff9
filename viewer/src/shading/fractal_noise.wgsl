// Fractal noise over texture coordinates. Twin: fractal_noise.rs.

const NOISE_OCTAVES: u32 = 14u;
const NOISE_AMPLITUDE: f32 = 0.3;

// Returns the noise at a place, 0 to 1, a half in the mean, without its `level` finest octaves.
fn fractal_noise(uv: vec2<f32>, level: u32) -> f32 {
    var sum = 0.5;
    for (var octave = 0u; octave + level < NOISE_OCTAVES; octave++) {
        sum += NOISE_AMPLITUDE * (value_noise(uv * f32(1u << octave), octave) - 0.5);
    }
    return clamp(sum, 0.0, 1.0);
}

// Returns a noise whose values at whole places are random, 0 to 1, and between them smooth.
fn value_noise(at: vec2<f32>, seed: u32) -> f32 {
    let corner = floor(at);
    let within = at - corner;
    let blend = within * within * (3.0 - 2.0 * within);
    let x = i32(corner.x);
    let y = i32(corner.y);
    let lower = noise_value(x, y, seed) * (1.0 - blend.x) + noise_value(x + 1, y, seed) * blend.x;
    let upper = noise_value(x, y + 1, seed) * (1.0 - blend.x) + noise_value(x + 1, y + 1, seed) * blend.x;
    return lower * (1.0 - blend.y) + upper * blend.y;
}

// Returns the random value at a whole place, 0 to 1.
fn noise_value(x: i32, y: i32, seed: u32) -> f32 {
    return sampler_one(sampler_hash(u32(x) ^ sampler_hash(u32(y) ^ sampler_hash(seed))));
}
