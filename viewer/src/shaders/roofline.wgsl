// What an adapter can do at most: copy memory from end to end, and multiply and add in registers.

@group(0) @binding(0) var<storage, read> copied_from: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> copied_to: array<vec4<f32>>;

// Multiply-adds of each of the four vectors of an invocation.
override rounds: u32 = 256u;

// Copies one vector.
@compute @workgroup_size(256)
fn copy_main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.y * groups.x * 256u + id.x;
    if index < arrayLength(&copied_to) {
        copied_to[index] = copied_from[index];
    }
}

// Multiplies and adds four vectors that do not wait for one another.
@compute @workgroup_size(256)
fn multiply_add_main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.y * groups.x * 256u + id.x;
    if index >= arrayLength(&copied_to) {
        return;
    }
    let factor = copied_from[index];
    var a = factor;
    var b = factor + 1.0;
    var c = factor + 2.0;
    var d = factor + 3.0;
    for (var i = 0u; i < rounds; i++) {
        a = fma(a, factor, b);
        b = fma(b, factor, c);
        c = fma(c, factor, d);
        d = fma(d, factor, a);
    }
    copied_to[index] = a + b + c + d;
}
