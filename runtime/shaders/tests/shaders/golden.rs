//! Compares the answers of the running shaders with `btf_runtime`: WGSL by two compilers, SPIR-V as it was written,
//! GLSL and HLSL by way of glslang, all on the software driver.

use crate::support::gpu::{Gpu, Program, open};
use crate::support::tools::{self, Tool};
use btf_runtime::testing::{Random, sample_asset, sample_grouped_spectrum, sample_heights, sample_relief_asset};
use btf_runtime::{
    Asset, DecodeOptions, Edit, Edits, HeightUse, Interpolation, LobeRole, Resident, ResidualKind, SurfaceSide,
    density, evaluate, pack, sample, serial, with_levels,
};
use btf_shaders::{Answer, ENTRY_POINTS, Language, MODULE_NAME, Query, Range, ShaderFile, module_text, translate};

/// Absolute and relative tolerance of a channel. Both sides read the same half-precision bases and add in f32; what is
/// left is the order of sums (2^-24 each) and the driver's own powers and exponentials, some units in the last place of
/// logarithms that are multiplied by up to a thousand, and sines, of which Vulkan promises 2^-11.
const ABSOLUTE: f32 = 1e-3;
const RELATIVE: f32 = 1e-3;
/// Relative tolerance of a density, which is the height of a narrow peak: squares of half vectors divided by squares of
/// roughness from 0.02 on.
const DENSITY_RELATIVE: f32 = 1e-2;
/// One query in this many may have another answer: a ray that grazes an edge of rough heights hits it in one arithmetic
/// and misses it in another.
const GRAZING: usize = 100;

const QUERIES: usize = 900;

/// Assets one behind the other in memory, and questions about all of them.
struct Questions {
    residents: Vec<Resident>,
    words: Vec<u32>,
    /// Questions for `evaluate_main` and `density_main`, with the number of the asset.
    queries: Vec<(usize, Query)>,
}

/// Returns assets with two layers (light from the front and from behind), levels, heights, edits, lobes in either role,
/// and every residual kind; and an asset with relief.
fn residents() -> Vec<Resident> {
    let kinds = [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root];
    let one = |(seed, kind): (u64, ResidualKind)| {
        let mut asset = sample_asset(seed, 12, 8, kind);
        asset.layers[0].lobe_role = if seed == 1 { LobeRole::Guide } else { LobeRole::Base };
        asset.layers[0].heights = Some(sample_heights(seed, asset.texel_count()));
        let mut through = sample_asset(seed + 10, 12, 8, kind).layers.remove(0);
        through.light_side = SurfaceSide::Back;
        asset.layers.push(through);
        let edit = Edit { tint: [0.9, 0.4, 1.5], roughness: 1.5, tilt: [0.1, 0.2], ..Edit::default() };
        asset.edits = Edits { list: vec![edit], texels: (0..96).map(|texel| u8::from(texel % 4 == 1)).collect() };
        // Through the file form, as a user's asset goes.
        let asset = Asset::parse(&pack(&asset).unwrap()).unwrap();
        Resident::from_asset(&with_levels(&asset, &serial))
    };
    let mut all: Vec<Resident> = (0..).zip(kinds).map(one).collect();
    all.push(Resident::from_asset(&with_levels(&sample_relief_asset(4, 12, 8), &serial)));
    all.push(Resident::from_asset(&with_levels(&sample_grouped_spectrum(4, 12, 8), &serial)));
    all
}

/// Returns a direction to any side, sometimes with a NaN or too long.
fn direction(random: &mut Random) -> [f32; 3] {
    let mut d = random.direction();
    match random.below(32) {
        0 => d[random.below(3)] = [f32::NAN, f32::INFINITY, -f32::INFINITY, 3e38][random.below(4)],
        1 => d = d.map(|x| 1.1 * x),
        2 => d = [0.0, 0.0, 1.0],
        n if n < 12 => d[2] = -d[2],
        _ => {}
    }
    d
}

fn questions() -> Questions {
    let residents = residents();
    let mut words = Vec::new();
    let firsts: Vec<u32> = residents
        .iter()
        .map(|resident| {
            let first = words.len() as u32;
            words.extend_from_slice(resident.words());
            first
        })
        .collect();
    let mut random = Random::new(77);
    let random = &mut random;
    let query = |number: usize| {
        let asset = number % residents.len();
        let interpolation = [Interpolation::Fast, Interpolation::Exact][random.below(2)];
        let few = [u32::MAX, u32::MAX, 2, 0];
        let options = DecodeOptions {
            components: few[random.below(4)],
            lobes: few[random.below(4)],
            interpolation,
            heights: HeightUse::ALL[random.below(5).min(2)],
        };
        let mut uv = [random.within(-3.0, 3.0), random.within(-3.0, 3.0)];
        if random.below(40) == 0 {
            uv[random.below(2)] = [f32::NAN, f32::INFINITY, 1e38, -1e-12][random.below(4)];
        }
        let query = Query {
            wi: direction(random),
            // One more than there are: the coarsest answers.
            level: random.below(residents[asset].levels() as usize + 1) as u32,
            wo: direction(random),
            asset: firsts[asset],
            uv,
            options: options.into(),
            pad: [0; 2],
        };
        (asset, query)
    };
    let queries = (0..QUERIES).map(query).collect();
    Questions { residents, words, queries }
}

/// Returns the decoder's options of a query.
fn options_of(query: &Query) -> DecodeOptions {
    let exact = query.options.interpolation == Interpolation::Exact as u32;
    DecodeOptions {
        components: query.options.components,
        lobes: query.options.lobes,
        interpolation: if exact { Interpolation::Exact } else { Interpolation::Fast },
        heights: HeightUse::from_number(query.options.heights).expect("queries are of known uses"),
    }
}

/// Returns the questions for `sample_main`: three numbers to draw with in place of the light.
fn draws(queries: &[(usize, Query)]) -> Vec<Query> {
    let mut random = Random::new(78);
    let mut number = |_| if random.below(60) == 0 { f32::NAN } else { random.within(0.0, 1.0) };
    queries.iter().map(|(_, query)| Query { wi: [0; 3].map(&mut number), ..*query }).collect()
}

fn close(a: f32, b: f32, relative: f32) -> bool {
    (a - b).abs() <= ABSOLUTE + relative * a.abs()
}

fn all_close(a: [f32; 3], b: [f32; 3]) -> bool {
    (0..3).all(|c| close(a[c], b[c], RELATIVE))
}

impl Questions {
    fn asked(&self) -> Vec<Query> {
        self.queries.iter().map(|(_, query)| *query).collect()
    }

    /// Returns the resident asset, the level and the question of query `i` for the decoder, with the light at `wi`.
    fn on_the_cpu(&self, i: usize, wi: [f32; 3]) -> (&Resident, u32, btf_runtime::Query, DecodeOptions) {
        let (asset, query) = &self.queries[i];
        let resident = &self.residents[*asset];
        let level = query.level.min(resident.levels() - 1);
        (resident, level, btf_runtime::Query { uv: query.uv, wi, wo: query.wo }, options_of(query))
    }

    fn value(&self, i: usize, wi: [f32; 3]) -> [f32; 3] {
        let (resident, level, query, options) = self.on_the_cpu(i, wi);
        evaluate(resident, level, &query, &options)
    }

    fn density(&self, i: usize, wi: [f32; 3]) -> f32 {
        let (resident, level, query, options) = self.on_the_cpu(i, wi);
        density(resident, level, &query, &options)
    }

    /// Returns how many answers of `evaluate_main` differ from the decoder's.
    fn wrong_values(&self, answers: &[Answer]) -> usize {
        assert_eq!(answers.len(), self.queries.len());
        let right = |i: &usize| all_close(self.value(*i, self.queries[*i].1.wi), answers[*i].value);
        answers.len() - (0..answers.len()).filter(right).count()
    }

    /// Returns how many answers of `density_main` differ from the decoder's.
    fn wrong_densities(&self, answers: &[Answer]) -> usize {
        assert_eq!(answers.len(), self.queries.len());
        let right = |i: &usize| close(self.density(*i, self.queries[*i].1.wi), answers[*i].density, DENSITY_RELATIVE);
        answers.len() - (0..answers.len()).filter(right).count()
    }

    /// Returns how many answers of `sample_main` differ: from the direction that the decoder draws, and in the returned
    /// direction from the density and the value that the decoder has there.
    fn wrong_samples(&self, draws: &[Query], answers: &[Answer]) -> usize {
        assert_eq!(answers.len(), draws.len());
        let right = |i: &usize| {
            let (resident, level, query, options) = self.on_the_cpu(*i, [0.0; 3]);
            let drawn = sample(resident, level, query.uv, query.wo, draws[*i].wi, &options);
            let answer = answers[*i];
            match drawn {
                None => answer == Answer::default(),
                Some(drawn) => {
                    all_close(drawn.wi, answer.wi)
                        && close(self.density(*i, answer.wi), answer.density, DENSITY_RELATIVE)
                        && all_close(self.value(*i, answer.wi), answer.value)
                }
            }
        };
        answers.len() - (0..answers.len()).filter(right).count()
    }

    /// Returns how many answers of `entry` differ from the decoder's; `run(entry point, queries)` gives the answers.
    fn wrong(&self, entry: &str, run: impl Fn(&str, &[Query]) -> Vec<Answer>) -> usize {
        match entry {
            "sample_main" => {
                let draws = draws(&self.queries);
                self.wrong_samples(&draws, &run(entry, &draws))
            }
            "density_main" => self.wrong_densities(&run(entry, &self.asked())),
            _ => self.wrong_values(&run(entry, &self.asked())),
        }
    }

    /// Compares these entry points of a language; `run(module text, entry point, queries)` gives the answers. Changed
    /// constants in the text must be noticed by the entry points that are `planted`.
    ///
    /// A software driver compiles a new module for seconds, `sample_main` longest, so no language runs everything
    /// twice.
    fn compare(&self, name: &str, [right, planted]: [&[&str]; 2], run: impl Fn(&str, &str, &[Query]) -> Vec<Answer>) {
        let allowed = self.queries.len() / GRAZING;
        let text = module_text();
        for entry in right {
            let found = self.wrong(entry, |entry, queries| run(&text, entry, queries));
            println!("{name}, {entry}: {found} of {} answers differ, {allowed} may", self.queries.len());
            assert!(found <= allowed, "{name}, {entry}: {found}");
        }
        // Planted differences: values a fiftieth too large, and another share of cosine samples.
        let changed = text
            .replace("return value * lit.fall;", "return 1.02 * value * lit.fall;")
            .replace("const COSINE_SHARE: f32 = 0.5;", "const COSINE_SHARE: f32 = 0.25;");
        for entry in planted {
            let found = self.wrong(entry, |entry, queries| run(&changed, entry, queries));
            println!("{name}, {entry}, two constants changed: {found} differ");
            assert!(found > self.queries.len() / 10, "{name}, {entry}: {found}");
        }
    }
}

/// Entry points that most languages run: values, and the shortest module with a constant changed.
const VALUES: [&[&str]; 2] = [&["evaluate_main", "density_main"], &["density_main"]];

/// Returns the translation of `text` into `language` that has `entry`, and the name of `entry` there.
fn translated(text: &str, language: Language, entry: &str) -> (ShaderFile, String) {
    let files = translate(MODULE_NAME, text).unwrap();
    let of_entry = |file: ShaderFile| {
        let name = file.entry_points.iter().find(|(name, _)| name == entry).map(|(_, here)| here.clone())?;
        (file.language == language).then_some((file, name))
    };
    files.into_iter().find_map(of_entry).expect("every language has every entry point")
}

/// Returns the questions and the driver; `None` if the test is left out.
fn prepared(test: &str) -> Option<(Questions, Gpu)> {
    Some((questions(), open(test)?))
}

#[test]
fn the_questions_reach_every_branch() {
    let questions = questions();
    let values: Vec<_> = (0..QUERIES).map(|i| questions.value(i, questions.queries[i].1.wi)).collect();
    let black = values.iter().filter(|value| **value == [0.0; 3]).count();
    assert!((QUERIES / 4..QUERIES * 3 / 4).contains(&black), "{black}");
    let lit_through = |(i, value): &(usize, &[f32; 3])| {
        let query = &questions.queries[*i].1;
        query.wi[2] < 0.0 && value[1] > 0.0
    };
    assert!(values.iter().enumerate().filter(lit_through).count() > QUERIES / 20);
    let draws = draws(&questions.queries);
    let drawn = (0..QUERIES).filter(|i| {
        let (resident, level, query, options) = questions.on_the_cpu(*i, [0.0; 3]);
        sample(resident, level, query.uv, query.wo, draws[*i].wi, &options).is_some()
    });
    let drawn = drawn.count();
    assert!((QUERIES / 4..QUERIES * 3 / 4).contains(&drawn), "{drawn}");
    // The comparison sees one value that is two tolerances off, and one density.
    let mut answers: Vec<Answer> = values.iter().map(|value| Answer { value: *value, ..Answer::default() }).collect();
    assert_eq!(questions.wrong_values(&answers), 0);
    answers[3].value[1] += 2.0 * (ABSOLUTE + RELATIVE * answers[3].value[1]);
    assert_eq!(questions.wrong_values(&answers), 1);
}

#[test]
fn wgsl_answers_like_the_decoder() {
    let Some((questions, gpu)) = prepared("wgsl_answers_like_the_decoder") else { return };
    questions.compare("WGSL by naga", VALUES, |text, entry, queries| {
        gpu.answers(&Program::Wgsl(text), entry, &questions.words, queries)
    });
}

#[test]
fn spirv_as_it_was_written_answers_like_the_decoder() {
    let Some((questions, gpu)) = prepared("spirv_as_it_was_written_answers_like_the_decoder") else { return };
    let everything: [&[&str]; 2] = [&ENTRY_POINTS, &["evaluate_main", "density_main"]];
    questions.compare("SPIR-V", everything, |text, entry, queries| {
        let (file, name) = translated(text, Language::SpirV, entry);
        gpu.answers(&Program::SpirV(&tools::words_from_bytes(&file.bytes)), &name, &questions.words, queries)
    });
}

#[test]
fn glsl_of_both_profiles_answers_like_the_decoder() {
    let test = "glsl_of_both_profiles_answers_like_the_decoder";
    if tools::are_left_out(test, &[Tool::Glslang]) {
        return;
    }
    let Some((questions, gpu)) = prepared(test) else { return };
    // The profiles' texts differ in their heads only, so values are asked of one of them.
    let body = |language| {
        let (file, _) = translated(&module_text(), language, "evaluate_main");
        let text = String::from_utf8(file.bytes).expect("GLSL is text");
        let head = text.find("layout(local_size_x").expect("the head ends where the workgroup's size stands");
        text[head..].to_string()
    };
    assert_eq!(body(Language::Glsl460), body(Language::GlslEs310));
    let one: [&[&str]; 2] = [&["density_main"], &["density_main"]];
    for (language, label, entries) in
        [(Language::Glsl460, "GLSL 4.60", VALUES), (Language::GlslEs310, "GLSL ES 3.10", one)]
    {
        questions.compare(label, entries, |text, entry, queries| {
            let (file, name) = translated(text, language, entry);
            let words = tools::spirv_from_glsl(&file.bytes).unwrap_or_else(|text| panic!("{}: {text}", file.name));
            gpu.answers(&Program::SpirV(&words), &name, &questions.words, queries)
        });
    }
}

#[test]
fn hlsl_answers_like_the_decoder() {
    let test = "hlsl_answers_like_the_decoder";
    if tools::are_left_out(test, &[Tool::Glslang]) {
        return;
    }
    let Some((questions, gpu)) = prepared(test) else { return };
    questions.compare("HLSL", VALUES, |text, entry, queries| {
        let (file, name) = translated(text, Language::Hlsl, entry);
        let words = tools::spirv_from_hlsl(&file.bytes, &name).unwrap_or_else(|text| panic!("{entry}: {text}"));
        gpu.answers(&Program::SpirV(&words), &name, &questions.words, queries)
    });
}

#[test]
fn wgsl_in_dawn_answers_like_the_decoder() {
    let test = "wgsl_in_dawn_answers_like_the_decoder";
    if tools::are_left_out(test, &[Tool::Dawn]) {
        return;
    }
    // The driver is asked for here as well, so that a missing one is told in our words.
    let Some((questions, _gpu)) = prepared(test) else { return };
    questions.compare("WGSL by Tint", VALUES, |text, entry, queries| {
        let range = Range { first: 0, count: queries.len() as u32, pad: [0; 2] };
        let inputs: [&[u8]; 3] =
            [bytemuck::cast_slice(&questions.words), bytemuck::cast_slice(queries), bytemuck::bytes_of(&range)];
        let bytes = tools::run_in_dawn(text.as_bytes(), entry, inputs, queries.len());
        bytemuck::pod_collect_to_vec(&bytes)
    });
}
