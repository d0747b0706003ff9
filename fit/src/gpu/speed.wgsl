// As many fused multiply-adds as the adapter's arithmetic units do, from registers alone: what a product's speed is a share of.

@group(0) @binding(0) var<storage, read_write> found: array<f32>;

const ROUNDS: u32 = 512u;

@compute @workgroup_size(256)
fn peak(@builtin(global_invocation_id) thread: vec3<u32>) {
    let start = f32(thread.x & 255u) * 1e-3;
    // Eight chains hide the latency of each.
    var a = vec4<f32>(start, start + 0.1, start + 0.2, start + 0.3);
    var b = a + 0.4;
    let factor = vec4<f32>(0.999);
    let more = vec4<f32>(0.001);
    for (var round = 0u; round < ROUNDS; round++) {
        a = fma(a, factor, more);
        b = fma(b, factor, more);
        a = fma(a, factor, more);
        b = fma(b, factor, more);
        a = fma(a, factor, more);
        b = fma(b, factor, more);
        a = fma(a, factor, more);
        b = fma(b, factor, more);
    }
    let sum = a + b;
    found[thread.x] = sum.x + sum.y + sum.z + sum.w;
}
