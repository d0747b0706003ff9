// Entry point that a trade times; joined with the library's text, which it gives its words.

struct Query {
    wi: vec3<f32>,
    texel: u32,
    wo: vec3<f32>,
    pad: u32,
}

@group(0) @binding(0) var<storage, read> words: array<u32>;
@group(0) @binding(1) var<uniform> options: BtfOptions;
@group(0) @binding(2) var<storage, read> queries: array<Query>;
@group(0) @binding(3) var<storage, read_write> decoded: array<vec4<f32>>;

fn asset_word(index: u32) -> u32 {
    return words[index];
}

@compute @workgroup_size(64)
fn time_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&queries) {
        let q = queries[id.x];
        decoded[id.x] = vec4<f32>(btf_decode(0u, 0u, q.texel, q.wi, q.wo, options), 0.0);
    }
}
