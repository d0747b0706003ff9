// Entry point that decodes a list of samples; joined with either tracer's text, so that exactly the text that draws
// is what the comparison with the CPU decoder runs.

struct Query {
    wi: vec3<f32>,
    texel: u32,
    wo: vec3<f32>,
    layer: u32,
}

struct QueryParams {
    count: u32,
    components: u32,
    lobes: u32,
    interpolation: u32,
    heights: u32,
}

@group(0) @binding(8) var<uniform> query_params: QueryParams;
@group(0) @binding(9) var<storage, read> queries: array<Query>;
@group(0) @binding(10) var<storage, read_write> decoded: array<vec4<f32>>;

// Decodes one sample.
@compute @workgroup_size(64)
fn decode_main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.y * groups.x * 64u + id.x;
    if index < query_params.count {
        let q = queries[index];
        let options = BtfOptions(query_params.components, query_params.lobes, query_params.interpolation, query_params.heights);
        decoded[index] = vec4<f32>(btf_decode(0u, q.layer, q.texel, q.wi, q.wo, options), 0.0);
    }
}
