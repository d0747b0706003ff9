//! What the shaders answer of a leaf whose optics are evaluated live is what `btf_runtime` answers: colours, directions and
//! densities, by the software driver.

mod support;

use btf_runtime::testing::Random;
use btf_runtime::{
    LEAF_QUANTITIES, Leaf, LeafMode, LeafState, LeafTexel, LeafTexture, ViewedLeaf, leaf_wgsl, wgsl_library,
};
use btf_shaders::{Answer, Options, Query};
use support::gpu::{Program, open};

/// Absolute and relative tolerance. Both sides read the same words and add in f32; what is left is the order of sums and the
/// driver's exponentials and roots, through a lobe that is 400 times the body at its narrowest.
const ABSOLUTE: f32 = 2e-4;
const RELATIVE: f32 = 2e-3;
/// One question in this many may differ: the printed theta jumps at absorptions of 1 and 3.
const JUMPS: usize = 200;
const QUERIES: usize = 3000;

/// A query's place, eye, light or numbers, and the plant's factors in the words that a leaf needs no options for.
const ENTRY: &str = "
struct Query { wi: vec3<f32>, level: u32, wo: vec3<f32>, asset: u32, uv: vec2<f32>, low: vec2<f32>, high: vec2<f32>, pad: vec2<u32> }
struct Answer { wi: vec3<f32>, density: f32, value: vec3<f32>, pad: f32 }
struct Range { first: u32, count: u32, pad: vec2<u32> }
@group(0) @binding(0) var<storage, read> words: array<u32>;
@group(0) @binding(1) var<storage, read> queries: array<Query>;
@group(0) @binding(2) var<uniform> range: Range;
@group(0) @binding(3) var<storage, read_write> answers: array<Answer>;

fn asset_word(index: u32) -> u32 {
    return words[index];
}

@compute @workgroup_size(64)
fn leaf_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < range.count {
        let q = queries[id.x];
        let viewed = leaf_new(q.asset, q.uv, q.level, vec4<f32>(q.low, q.high), q.wo);
        let drawn = leaf_sample_direction(viewed, abs(q.wi));
        let unit = normalize(q.wi);
        answers[id.x] = Answer(drawn, leaf_sample_density(viewed, unit), leaf_light(viewed, unit), 0.0);
    }
}
";

/// Leaves of all modes under textures of some texels, one behind the other; the number of each one's first word.
fn leaves(random: &mut Random) -> (Vec<u32>, Vec<u32>) {
    let (mut words, mut firsts) = (vec![7; 5], Vec::new());
    for round in 0..12 {
        let mut values = LEAF_QUANTITIES.map(|quantity| random.within(quantity.range[0], quantity.range[1]));
        if round % 4 == 3 {
            values[9] = values[8];
        }
        let mut signed = || random.within(-1.0, 1.0);
        let texels = (0..35)
            .map(|_| LeafTexel {
                factors: std::array::from_fn(|_| 1.0 + signed()),
                gloss: [signed().abs(), signed().abs()],
                veins: [signed(), signed()],
                structure: [0.0, 0.5, 0.5],
                tilt: std::array::from_fn(|_| 0.4 * signed()),
            })
            .collect();
        let state = LeafState::from_values(LeafMode::ALL[round % 3], values);
        let leaf = Leaf::new(&state, &LeafTexture { width: 5, texels }).unwrap();
        firsts.push(words.len() as u32);
        words.extend(leaf.words());
    }
    (words, firsts)
}

#[test]
fn leaves_shine_alike_in_shaders_and_in_rust() {
    let Some(gpu) = open("leaves_shine_alike_in_shaders_and_in_rust") else { return };
    let mut random = Random::new(4);
    let (words, firsts) = leaves(&mut random);
    let queries: Vec<Query> = (0..QUERIES)
        .map(|_| Query {
            wi: random.direction().map(|x| if random.below(2) == 0 { x } else { -x }),
            level: random.below(5) as u32,
            wo: random.direction().map(|x| if random.below(2) == 0 { x } else { -x }),
            asset: firsts[random.below(firsts.len())],
            uv: [random.within(-2.0, 2.0), random.within(-2.0, 2.0)],
            options: Options {
                components: random.within(0.0, 2.0).to_bits(),
                lobes: random.within(0.0, 2.0).to_bits(),
                interpolation: random.within(0.5, 1.5).to_bits(),
                parallax: random.within(0.5, 1.5).to_bits(),
            },
            pad: [0; 2],
        })
        .collect();
    let text = [&wgsl_library(), &leaf_wgsl(), ENTRY].map(|part| part as &str).join("\n");
    let differing = |text: &str| -> Vec<String> {
        let answers = gpu.answers(&Program::Wgsl(text), "leaf_main", &words, &queries);
        queries.iter().zip(&answers).filter_map(|(query, answer)| difference(&words, query, answer)).collect()
    };
    let found = differing(&text);
    assert!(found.len() <= QUERIES / JUMPS, "{} differ, first {:?}", found.len(), &found[..found.len().min(4)]);
    // Planted: another index's Fresnel, and a transmission that keeps the lobe.
    for (right, wrong) in [("0.5 * ratio * ratio", "0.45 * ratio * ratio"), ("if wi.z < 0.0 {", "if wi.z < -2.0 {")] {
        assert!(text.contains(right));
        assert!(differing(&text.replace(right, wrong)).len() > QUERIES / 10, "{wrong}");
    }
}

/// Where an answer is not the decoder's in Rust, what both say.
fn difference(words: &[u32], query: &Query, answer: &Answer) -> Option<String> {
    let Options { components, lobes, interpolation, parallax } = query.options;
    let factors = [components, lobes, interpolation, parallax].map(f32::from_bits);
    let viewed = ViewedLeaf::new(&words[query.asset as usize..], query.uv, query.level, factors, query.wo);
    let length = query.wi.iter().map(|x| x * x).sum::<f32>().sqrt();
    let wi = query.wi.map(|x| x / length);
    let (value, density) = (viewed.light(wi), viewed.sample_density(wi));
    let drawn = viewed.sample_direction(query.wi.map(f32::abs));
    let pairs =
        value.iter().zip(&answer.value).chain([(&density, &answer.density)]).chain(drawn.iter().zip(&answer.wi));
    let apart = pairs.into_iter().any(|(x, y)| (x - y).abs() > ABSOLUTE + RELATIVE * x.abs() || !y.is_finite());
    apart.then(|| format!("{query:?}: {value:?} {density} {drawn:?}, the shader {answer:?}"))
}
