// Answers a list of questions: three entry points over the decoder's library. A complete module to try an asset, and an
// example of how the library is called.

// A question. An entry point reads only the fields whose comments name it, and those that name none.
struct Query {
    // Unit vector to the light, in the frame of tangent, bitangent and normal; z < 0 lies behind the surface.
    // sample_main: three numbers in [0, 1) to draw with.
    wi: vec3<f32>,
    // Level, 0 the finest; a level beyond the coarsest gives the coarsest.
    level: u32,
    // Unit vector to the eye, in the frame of wi.
    wo: vec3<f32>,
    // First word of the asset in `asset_words`.
    asset: u32,
    // Texture coordinate: u to the right, v up, one repetition a unit.
    uv: vec2<f32>,
    options: BtfOptions,
    pad: vec2<u32>,
}

// The answer to a question. An entry point writes zeros to the fields whose comments do not name it.
struct Answer {
    // sample_main: the direction to the light that was drawn.
    wi: vec3<f32>,
    // density_main and sample_main: probability density, per steradian; 0 where no direction was drawn.
    density: f32,
    // evaluate_main and sample_main: pi times BRDF times |n.wi|, linear RGB.
    value: vec3<f32>,
    pad: f32,
}

// The questions that a dispatch answers: `count` of them from number `first` on. One dispatch has at most 65535
// workgroups, 4194240 questions.
struct Range {
    first: u32,
    count: u32,
    pad: vec2<u32>,
}

@group(0) @binding(0) var<storage, read> asset_words: array<u32>;
@group(0) @binding(1) var<storage, read> queries: array<Query>;
@group(0) @binding(2) var<uniform> range: Range;
@group(0) @binding(3) var<storage, read_write> answers: array<Answer>;

// The one function that an includer of the library defines.
fn asset_word(index: u32) -> u32 {
    return asset_words[index];
}

fn level_of(q: Query) -> u32 {
    return min(q.level, btf_levels(q.asset) - 1u);
}

// Evaluates the value for a light and an eye: btf_evaluate.
@compute @workgroup_size(64)
fn evaluate_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < range.count {
        let q = queries[range.first + id.x];
        let value = btf_evaluate(q.asset, level_of(q), q.uv, q.wi, q.wo, q.options);
        answers[range.first + id.x] = Answer(vec3<f32>(0.0), 0.0, value, 0.0);
    }
}

// Draws a direction to light for an eye, with density and value: btf_sample.
@compute @workgroup_size(64)
fn sample_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < range.count {
        let q = queries[range.first + id.x];
        let drawn = btf_sample(q.asset, level_of(q), q.uv, q.wo, q.wi, q.options);
        answers[range.first + id.x] = Answer(drawn.wi, drawn.density, drawn.value, 0.0);
    }
}

// Computes the density with which sample_main draws a direction: btf_density.
@compute @workgroup_size(64)
fn density_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < range.count {
        let q = queries[range.first + id.x];
        let density = btf_density(q.asset, level_of(q), q.uv, q.wi, q.wo, q.options);
        answers[range.first + id.x] = Answer(vec3<f32>(0.0), density, vec3<f32>(0.0), 0.0);
    }
}
