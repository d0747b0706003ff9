//! Evaluation and sampling at a texture coordinate for renderers: values, directions drawn from them and their
//! densities, whichever sides light and eye are on. The sides of light and eye select the layer. Twin:
//! `decode/evaluate.wgsl`.

use crate::asset::asset::SurfaceSide;
use crate::asset::lobe::ResidentLobe;
use crate::asset::spectrum::Spectrum;
use crate::decode::lobe_queue::LobeQueue;
use crate::decode::options::DecodeOptions;
use crate::decode::part_queue::PartQueue;
use crate::decode::shown::shows_first_channels;
use crate::decode::texel::Texel;
use crate::decode::viewed_texel::ViewedTexel;
use crate::resident::resident::Resident;

/// A place of the surface with a light and an eye.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C)]
pub struct Query {
    /// Texture coordinate: u to the right, v up, one repetition a unit.
    pub uv: [f32; 2],
    /// Unit vector to the light, in the frame of tangent, bitangent and normal; z < 0 lies behind the surface.
    pub wi: [f32; 3],
    /// Unit vector to the eye, in the frame of `wi`.
    pub wo: [f32; 3],
}

/// A direction that [`sample`] has drawn, with its density and value.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C)]
pub struct Sample {
    /// Unit vector to the light.
    pub wi: [f32; 3],
    /// Probability density, per steradian.
    pub density: f32,
    /// Value of [`evaluate`] for a light in this direction.
    pub value: [f32; 3],
}

/// Number of queries that [`evaluate_many`] evaluates together: their texels and lobes stay in the nearest cache.
const BATCH: usize = 32;

/// Range of the squared length of a vector that counts as unit.
pub const UNIT_RANGE: std::ops::RangeInclusive<f32> = 0.99..=1.01;

/// Returns whether `v` is a direction: of length 1 within half a percent. NaN is not.
pub fn is_unit(v: [f32; 3]) -> bool {
    UNIT_RANGE.contains(&(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]))
}

/// Returns `level`, or the coarsest level if the asset has fewer.
fn known_level(resident: &Resident, level: u32) -> u32 {
    level.min(resident.levels() - 1)
}

fn finite(numbers: &[f32]) -> bool {
    numbers.iter().all(|x| x.is_finite())
}

/// Returns layer and texel of `query`; `None` where [`evaluate`] is black because of the sides or invalid numbers.
fn place(resident: &Resident, level: u32, Query { uv, wi, wo }: &Query) -> Option<(u32, u32)> {
    if !(finite(uv) && is_unit(*wi) && is_unit(*wo)) {
        return None;
    }
    let layer = resident.layer_for_sides(known_level(resident, level), SurfaceSide::of(*wi), SurfaceSide::of(*wo))?;
    Some((layer, resident.texel(layer, *uv)))
}

/// Evaluates `pi * BRDF * |n.wi|` (BTDF where light and eye are on different sides), linear RGB, at least 0. `level` 0
/// is the finest; a level beyond the coarsest gives the coarsest.
///
/// The value is black where the asset has no layer for these sides, where a number is not finite, and where a direction
/// is not a unit vector within half a percent.
///
/// Cost: as [`crate::decode()`].
pub fn evaluate(resident: &Resident, level: u32, query: &Query, options: &DecodeOptions) -> [f32; 3] {
    place(resident, level, query).map_or([0.0; 3], |(layer, texel)| {
        ViewedTexel::new(resident, layer, texel, query.wo, options).light_alone(query.wi)
    })
}

/// Evaluates each of `queries` into `values`, with the same bits as [`evaluate`] at a fraction of the cost: memory is
/// prefetched, and lobes of one family are evaluated side by side. Of an asset in bands that holds for the colours under D65;
/// others cost as much as by [`evaluate`].
///
/// # Panics
/// If there are fewer values than queries.
pub fn evaluate_many(
    resident: &Resident,
    level: u32,
    queries: &[Query],
    options: &DecodeOptions,
    values: &mut [[f32; 3]],
) {
    if !shows_first_channels(resident.words()) {
        let values = values[..queries.len()].iter_mut();
        return values.zip(queries).for_each(|(value, query)| *value = evaluate(resident, level, query, options));
    }
    let (mut lobes, mut parts) = (LobeQueue::new(), PartQueue::default());
    let (mut places, mut texels, mut ahead) = (Vec::new(), Vec::new(), Vec::new());
    for (queries, values) in queries.chunks(BATCH).zip(values[..queries.len()].chunks_mut(BATCH)) {
        places.clear();
        places.extend(queries.iter().map(|query| place(resident, level, query)));
        ahead.extend(places.iter().flatten().flat_map(|(layer, texel)| Texel::own_words(resident, *layer, *texel)));
        fetch(resident, &mut ahead);

        texels.clear();
        texels.extend(queries.iter().zip(&places).map(|(query, place)| {
            let (layer, texel) = (*place)?;
            let viewed = ViewedTexel::new(resident, layer, texel, query.wo, options);
            let lit = viewed.lit(query.wi)?;
            viewed.ahead(&lit, |word| ahead.push(word));
            Some((viewed, lit))
        }));
        fetch(resident, &mut ahead);

        for (viewed, lit) in texels.iter().flatten() {
            viewed.ask_lobes(|lobe| lobes.push(lobe, lit.toward(), viewed.eye()));
        }
        let mut lobes = lobes.finish();
        let mut value_of = |_: &ResidentLobe| lobes.next().unwrap_or_default();
        for (index, texel) in texels.iter().enumerate() {
            values[index] = [0.0; 3];
            let Some((viewed, lit)) = texel else { continue };
            match viewed.parts(lit, &mut value_of) {
                Some(of_value) => parts.push(of_value, viewed.curve(), index, values),
                None => values[index] = viewed.value(None, lit, &mut value_of),
            }
        }
        parts.finish(values);
    }
}

/// Evaluates the bands of an asset with a [`Spectrum`], as [`evaluate`] does its colours, each at least 0. Bands come in the
/// order of [`Resident::spectrum`], which must be that of `resident`.
///
/// # Panics
/// If there is not a value for each band.
pub fn evaluate_bands(
    resident: &Resident,
    spectrum: &Spectrum,
    level: u32,
    query: &Query,
    options: &DecodeOptions,
    values: &mut [f32],
) {
    assert_eq!(values.len(), spectrum.weights.len(), "a value for each band");
    let channels = place(resident, level, query).and_then(|(layer, texel)| {
        ViewedTexel::new(resident, layer, texel, query.wo, options).channels_alone(query.wi)
    });
    match channels {
        None => values.fill(0.0),
        Some(channels) => values.iter_mut().zip(spectrum.bands(channels)).for_each(|(value, band)| *value = band),
    }
}

/// Reads `words`, so that they are in the cache when they are needed. The reads wait for memory together; later reads
/// would wait one after the other.
fn fetch(resident: &Resident, words: &mut Vec<usize>) {
    let all = resident.words();
    std::hint::black_box(words.drain(..).fold(0, |sum, word| sum ^ all[word]));
}

/// Returns the layers that an eye on one side sees: lit from its own side, and from the other.
fn seen_layers(resident: &Resident, level: u32, wo: [f32; 3]) -> [Option<u32>; 2] {
    let (level, view) = (known_level(resident, level), SurfaceSide::of(wo));
    [view, view.other()].map(|light| resident.layer_for_sides(level, light, view))
}

/// Draws a direction to light that matters to the eye at `wo`, from three numbers `at` in [0, 1). An asset with light
/// from both sides gets either with the same probability.
///
/// Returns `None` where the eye sees no layer, where a number is not finite or `wo` not a unit vector, and where the
/// direction drawn lies on the side of another layer; such a path carries nothing.
pub fn sample(
    resident: &Resident,
    level: u32,
    uv: [f32; 2],
    wo: [f32; 3],
    at: [f32; 3],
    options: &DecodeOptions,
) -> Option<Sample> {
    if !(finite(&uv) && is_unit(wo) && finite(&at)) {
        return None;
    }
    let [u, v, mut rest] = at.map(|x| x.clamp(0.0, 1.0 - f32::EPSILON));
    let (layer, share) = match seen_layers(resident, level, wo) {
        [Some(own), Some(other)] => {
            let choice = if rest < 0.5 { own } else { other };
            rest = (2.0 * rest).fract();
            (choice, 0.5)
        }
        [own, other] => (own.or(other)?, 1.0),
    };
    let viewed = ViewedTexel::new(resident, layer, resident.texel(layer, uv), wo, options);
    let wi = viewed.sample_direction([u, v, rest]);
    let density = share * viewed.sample_density(wi);
    let on_its_side = wi[2] * viewed.light_sign() > 0.0;
    (on_its_side && density > 0.0).then(|| Sample { wi, density, value: viewed.light_alone(wi) })
}

/// Returns the density with which [`sample`] draws `wi`, per steradian; 0 where it never does.
pub fn density(resident: &Resident, level: u32, query: &Query, options: &DecodeOptions) -> f32 {
    let Query { uv, wi, wo } = *query;
    if !(finite(&uv) && is_unit(wi) && is_unit(wo)) {
        return 0.0;
    }
    let layers = seen_layers(resident, level, wo);
    let share = if layers.iter().flatten().count() == 2 { 0.5 } else { 1.0 };
    let other_side = (wi[2] < 0.0) != (wo[2] < 0.0);
    match layers[usize::from(other_side)] {
        Some(layer) => {
            let viewed = ViewedTexel::new(resident, layer, resident.texel(layer, uv), wo, options);
            share * viewed.sample_density(wi)
        }
        None => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::asset::Asset;
    use crate::asset::residual::ResidualKind;
    use crate::asset::spectrum::weighted_channels;
    use crate::decode::decode::decode;
    use crate::decode::viewed_texel::LightRows;
    use crate::testing::{Random, direction_from_degrees, sample_asset};
    use crate::testing::{sample_grouped_spectrum, sample_spectral_asset};

    /// Returns an asset with reflection and transmission for an eye in front.
    fn two_sided() -> Resident {
        let mut asset = sample_asset(31, 6, 5, ResidualKind::Root);
        let mut through = asset.layers[0].clone();
        through.light_side = SurfaceSide::Back;
        through.residual = None;
        asset.layers.push(through);
        for lobe in asset.layers.iter_mut().flat_map(|layer| layer.dictionary.iter_mut().flatten()) {
            lobe.lobe.params = lobe.lobe.params.map(|p| p.min(4.0));
        }
        Resident::from_asset(&asset)
    }

    #[test]
    fn the_layer_is_that_of_the_sides_and_the_texel_that_of_the_coordinate() {
        let (resident, mut random) = (two_sided(), Random::new(8));
        let options = DecodeOptions::default();
        let mut queries = Vec::new();
        for _ in 0..500 {
            let (mut wi, wo) = (random.direction(), random.direction());
            wi[2] *= [1.0, -1.0][random.below(2)];
            let (column, row) = (random.below(6), random.below(5));
            let uv = [(column as f32 + 0.5) / 6.0 + 2.0, 1.0 - (row as f32 + 0.5) / 5.0];
            let query = Query { uv, wi, wo };
            let expected = decode(&resident, u32::from(wi[2] < 0.0), (row * 6 + column) as u32, wi, wo, &options);
            assert_eq!(evaluate(&resident, 0, &query, &options), expected);
            // An eye behind sees no layer of this asset.
            let behind = Query { wo: [wo[0], wo[1], -wo[2]], ..query };
            assert_eq!(evaluate(&resident, 0, &behind, &options), [0.0; 3]);
            assert_eq!(
                (density(&resident, 0, &behind, &options), sample(&resident, 0, uv, behind.wo, [0.5; 3], &options)),
                (0.0, None)
            );
            queries.push(query);
        }
        let mut values = vec![[0.0; 3]; 500];
        evaluate_many(&resident, 0, &queries, &options, &mut values);
        assert!(queries.iter().zip(&values).all(|(query, value)| evaluate(&resident, 0, query, &options) == *value));
    }

    #[test]
    fn bands_colours_and_many_at_once_are_sums_of_the_same_channels() {
        for asset in [sample_spectral_asset(6, 6, 5), sample_grouped_spectrum(6, 6, 5)] {
            let resident = Resident::from_asset(&asset);
            let (spectrum, mut random) = (resident.spectrum().unwrap(), Random::new(9));
            assert_eq!(Some(&spectrum), asset.spectrum.as_ref());
            // The first group's channels, which colours hold as they are.
            let plain = Resident::from_asset(&Asset { spectrum: None, ..asset });
            assert!(!plain.is_spectral() && plain.spectrum().is_none());
            let options = DecodeOptions::default();
            let query = |random: &mut Random| {
                let (wi, wo) = (random.direction(), random.direction());
                Query { uv: [random.within(0.0, 1.0), random.within(0.0, 1.0)], wi, wo }
            };
            let queries: Vec<Query> = (0..300).map(|_| query(&mut random)).collect();
            let mut many = vec![[0.0; 3]; queries.len()];
            evaluate_many(&resident, 0, &queries, &options, &mut many);
            let mut differs = 0;
            for (query, of_many) in queries.iter().zip(many) {
                let (layer, texel) = place(&resident, 0, query).unwrap();
                let viewed = ViewedTexel::new(&resident, layer, texel, query.wo, &options);
                let channels = viewed.channels_alone(query.wi).unwrap();
                assert_eq!(channels[..3], evaluate(&plain, 0, query, &options));
                let value = evaluate(&resident, 0, query, &options);
                for (value, weights) in value.iter().zip(&spectrum.shown) {
                    assert!((value - weighted_channels(weights, &channels)).abs() < 1e-5, "{query:?}");
                }
                let mut rows = LightRows::default();
                let kept = viewed.light(&mut rows, query.wi);
                assert!((0..3).all(|c| (kept[c] - value[c]).abs() < 1e-5), "{kept:?} {value:?}");
                assert_eq!(of_many, value);
                let mut bands = vec![0.0; spectrum.weights.len()];
                evaluate_bands(&resident, &spectrum, 0, query, &options, &mut bands);
                assert!(bands.iter().copied().eq(spectrum.bands(channels)));
                differs += usize::from(channels[3..6] != channels[..3]);
            }
            assert!(differs > 250, "{differs}");
            // The colours alone, side by side.
            let (mut colours, mut many) = (resident.clone(), vec![[0.0; 3]; queries.len()]);
            colours.set_shown(std::array::from_fn(|value| std::array::from_fn(|i| f32::from(u8::from(i == value)))));
            assert!(shows_first_channels(colours.words()));
            evaluate_many(&colours, 0, &queries, &options, &mut many);
            for (query, of_many) in queries.iter().zip(many) {
                let of_plain = evaluate(&plain, 0, query, &options);
                assert_eq!((of_many, evaluate(&colours, 0, query, &options)), (of_plain, of_plain));
            }
            // Three of the bands, and nothing that is no number.
            let mut three = resident.clone();
            let row = |at: usize, x: f32| std::array::from_fn(|i| if i == at { x } else { 0.0 });
            three.set_shown([row(1, 0.5), row(0, f32::NAN), row(0, f32::INFINITY)]);
            let (first, x) = (evaluate(&three, 0, &queries[0], &options), evaluate(&plain, 0, &queries[0], &options));
            assert_eq!(first, [0.5 * x[1], 0.0, 1000.0 * x[0]]);
        }
    }

    #[test]
    fn samples_over_their_density_sum_up_to_what_is_reflected_and_transmitted() {
        let (resident, options) = (two_sided(), DecodeOptions::default());
        let (uv, wo) = ([0.3, 0.7], direction_from_degrees(35.0, 20.0));
        // All directions evenly.
        let (mut whole, side) = (0.0f64, 400);
        for i in 0..side {
            for j in 0..side {
                let z = 2.0 * (i as f32 + 0.5) / side as f32 - 1.0;
                let (sin, cos) = ((j as f32 + 0.5) / side as f32 * std::f32::consts::TAU).sin_cos();
                let wi = [(1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z];
                whole += f64::from(evaluate(&resident, 0, &Query { uv, wi, wo }, &options)[1]);
            }
        }
        whole *= 4.0 / f64::from(side * side);
        let mut random = Random::new(12);
        let (mut sum, mut planted, count) = (0.0f64, 0.0f64, 60_000);
        for _ in 0..count {
            let at = [0; 3].map(|_| random.within(0.0, 1.0));
            if let Some(drawn) = sample(&resident, 0, uv, wo, at, &options) {
                let told = density(&resident, 0, &Query { uv, wi: drawn.wi, wo }, &options);
                assert!((told - drawn.density).abs() <= 1e-4 * told, "{told} {}", drawn.density);
                let share = f64::from(drawn.value[1] / drawn.density) / std::f64::consts::PI;
                sum += share;
                // Planted difference: the choice between two sides left out.
                planted += 0.5 * share;
            }
        }
        let [sum, planted] = [sum, planted].map(|sum| sum / f64::from(count) / whole);
        assert!((sum - 1.0).abs() < 0.02, "{sum}");
        assert!((planted - 1.0).abs() > 0.1, "{planted}");
    }

    #[test]
    fn any_numbers_give_finite_values() {
        let (resident, options) = (two_sided(), DecodeOptions::default());
        let odd = [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e38, -1e38, 0.0, -0.0, 1e-45, 1.0, -1.0, 0.3];
        let mut random = Random::new(3);
        let mut seen = 0;
        for _ in 0..40_000 {
            let mut any = || odd[random.below(odd.len())];
            let [uv, at] = [[any(), any(), any()], [any(), any(), any()]];
            let mut directions = [[any(), any(), any()], [any(), any(), any()]];
            for direction in &mut directions {
                if random.below(2) == 0 {
                    *direction = random.direction();
                }
            }
            let query = Query { uv: [uv[0], uv[1]], wi: directions[0], wo: directions[1] };
            let value = evaluate(&resident, 0, &query, &options);
            assert!(value.iter().all(|x| x.is_finite() && *x >= 0.0), "{query:?} {value:?}");
            let told = density(&resident, 0, &query, &options);
            assert!(!told.is_nan() && told >= 0.0, "{query:?} {told}");
            if let Some(drawn) = sample(&resident, 0, query.uv, query.wo, at, &options) {
                seen += 1;
                assert!(drawn.density > 0.0 && finite(&drawn.value), "{query:?} {drawn:?}");
            }
        }
        assert!(seen > 100, "{seen}");
    }
}
