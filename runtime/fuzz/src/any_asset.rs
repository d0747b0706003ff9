//! Makes an asset of any bytes, one that keeps to the format.

use btf_runtime::{
    Asset, BAND_RANGE_NM, Basis, Coefficients, DictionaryLobe, Edit, Edits, Factors, Heights, Layer, Level,
    LevelTexels, Lobe, LobeFamily, LobeRef, LobeRole, LobeWeights, MAX_BAND_WEIGHT, MAX_GROUPS, PredictedGroup, Relief,
    Residual, ResidualKind, SharedBases, Spectrum, Sphere, SurfaceSide,
};

/// A source of numbers taken from bytes; zeros when they are used up.
struct Source<'a>(&'a [u8]);

impl Source<'_> {
    fn byte(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else { return 0 };
        self.0 = rest;
        *first
    }

    /// Returns a number below `count`, which is at most 256.
    fn below(&mut self, count: usize) -> usize {
        usize::from(self.byte()) % count
    }

    fn flag(&mut self) -> bool {
        self.byte() & 1 == 1
    }

    fn short(&mut self) -> i16 {
        i16::from_le_bytes([self.byte(), self.byte()])
    }

    /// Returns a number within `least..=most`.
    fn within(&mut self, least: f32, most: f32) -> f32 {
        let share = f32::from(u16::from_le_bytes([self.byte(), self.byte()])) / 65535.0;
        (least + (most - least) * share).clamp(least, most)
    }

    fn list<T>(&mut self, count: usize, mut one: impl FnMut(&mut Self) -> T) -> Vec<T> {
        (0..count).map(|_| one(self)).collect()
    }

    fn halves(&mut self, count: usize) -> Vec<half::f16> {
        self.list(count, |source| half::f16::from_f32(source.within(-2.0, 2.0)))
    }
}

/// Returns the asset that `bytes` describe: up to 8 x 8 texels, 4 layers, 3 clusters, 6 directions a set, with or
/// without residual, heights, levels, edits and a spectrum of up to 5 bands. The bytes determine every choice and every number.
pub fn any_asset(bytes: &[u8]) -> Asset {
    let source = &mut Source(bytes);
    let (width, height) = (1 + source.below(8), 1 + source.below(8));
    let layer_count = 1 + source.below(4);
    let spectrum = source.flag().then(|| any_spectrum(source));
    let groups = spectrum.as_ref().map_or(1, |spectrum| spectrum.groups);
    let layers: Vec<Layer> = (0..layer_count).map(|number| any_layer(source, number, groups, width * height)).collect();
    let mut levels = Vec::new();
    let mut size = [width, height];
    for _ in 0..source.below(4) {
        if size == [1, 1] {
            break;
        }
        size = size.map(|side| (side / 2).max(1));
        let layers = layers.iter().map(|layer| any_level(source, layer, size[0] * size[1])).collect();
        levels.push(Level { width: size[0], height: size[1], layers });
    }
    let list = source.below(4);
    let edits = match list {
        0 => Edits::default(),
        _ => Edits {
            list: source.list(list, any_edit),
            texels: source.list(width * height, |source| source.below(list + 1) as u8),
        },
    };
    Asset {
        width,
        height,
        size_mm: source.flag().then(|| [source.within(1e-3, 1e6), source.within(1e-3, 1e6)]),
        seamless: [source.flag(), source.flag()],
        spectrum,
        material: String::from_utf8_lossy(&source.0[..source.0.len().min(40)]).into_owned(),
        layers,
        levels,
        edits,
    }
}

fn any_spectrum(source: &mut Source) -> Spectrum {
    let (bands, groups) = (1 + source.below(5), 1 + source.below(MAX_GROUPS));
    let weights = |source: &mut Source| {
        let mut weights = [0.0; 3 * MAX_GROUPS];
        weights[..3 * groups].fill_with(|| source.within(-MAX_BAND_WEIGHT, MAX_BAND_WEIGHT));
        weights
    };
    let step = (BAND_RANGE_NM.end() - BAND_RANGE_NM.start()) / bands as f32;
    Spectrum {
        wavelengths_nm: (0..bands)
            .map(|band| BAND_RANGE_NM.start() + step * (band as f32 + source.within(0.0, 0.9)))
            .collect(),
        groups,
        weights: source.list(bands, weights),
        shown: [(); 3].map(|()| weights(source)),
    }
}

fn any_edit(source: &mut Source) -> Edit {
    Edit {
        tint: [0; 3].map(|_| source.within(0.0, 16.0)),
        diffuse: source.within(0.0, 16.0),
        specular: source.within(0.0, 16.0),
        roughness: source.within(0.1, 10.0),
        tilt: [0; 2].map(|_| source.within(-0.9, 0.9)),
        fade: source.within(0.0, 16.0),
    }
}

/// Returns up to 6 directions, the pole and points on rings that do not coincide, `rounds` times.
fn any_sphere(source: &mut Source, rounds: usize) -> Sphere {
    let mut directions = vec![[0.0, 0.0, 1.0]];
    for number in 0..source.below(6) {
        let (radius, turn) = (source.within(0.1, 0.99), number as f32 + source.within(0.0, 0.5));
        directions.push([radius * turn.cos(), radius * turn.sin(), (1.0 - radius * radius).sqrt()]);
    }
    Sphere::of_rounds(&directions.repeat(rounds), rounds).expect("distinct unit vectors above the horizon")
}

fn any_lobe(source: &mut Source) -> DictionaryLobe {
    let family = LobeFamily::ALL[source.below(9)];
    let normal_xy = [0; 2].map(|_| source.within(-0.99, 0.99));
    let tangent_rad = source.within(-4.0, 4.0);
    let params = family.ranges().map(|(least, most)| source.within(least, most));
    DictionaryLobe {
        lobe: Lobe { family, normal_xy, tangent_rad, params }.clamped().rounded(),
        weight_scale: half::f16::from_f32(source.within(0.0, 10.0)).to_f32(),
    }
}

/// Returns clusters, lobe counts and references of texels.
fn any_texels(
    source: &mut Source,
    texels: usize,
    dictionary: &[Vec<DictionaryLobe>],
) -> (Vec<u8>, Vec<u8>, Vec<LobeRef>) {
    let clusters = source.list(texels, |source| source.below(dictionary.len()) as u8);
    let lobes = |cluster: u8| dictionary[usize::from(cluster)].len();
    let counts: Vec<u8> =
        clusters.iter().map(|cluster| if lobes(*cluster) == 0 { 0 } else { source.below(4) as u8 }).collect();
    let mut refs = Vec::new();
    for (cluster, count) in clusters.iter().zip(&counts) {
        for _ in 0..*count {
            let lobe = source.below(lobes(*cluster)) as u8;
            refs.push(LobeRef { lobe, weight: [source.byte(), source.byte(), source.byte()] });
        }
    }
    (clusters, counts, refs)
}

fn any_heights(source: &mut Source, texels: usize) -> Option<Heights> {
    let step = source.within(0.0, 1.0);
    (step > 0.0).then(|| Heights { step, codes: source.list(texels, |source| source.byte() as i8) })
}

fn any_layer(source: &mut Source, number: usize, groups: usize, texels: usize) -> Layer {
    // No two layers have the same sides.
    let side = |bit: usize| if number >> bit & 1 == 1 { SurfaceSide::Back } else { SurfaceSide::Front };
    let clusters = 1 + source.below(3);
    let dictionary: Vec<Vec<DictionaryLobe>> = (0..clusters)
        .map(|_| {
            let lobes = source.below(4);
            source.list(lobes, any_lobe)
        })
        .collect();
    let (lights, views) = (any_sphere(source, groups), any_sphere(source, 1));
    let (texel_clusters, texel_lobe_counts, lobe_refs) = any_texels(source, texels, &dictionary);
    let residual = source.flag().then(|| any_residual(source, [views.len(), lights.len()], clusters, texels));
    let mut layer = Layer {
        light_side: side(0),
        view_side: side(1),
        lobe_role: [LobeRole::Base, LobeRole::Guide, LobeRole::OldBase][source.below(3)],
        residual_kind: [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root][source.below(3)],
        epsilon: source.within(1e-6, 1.0),
        heights: any_heights(source, texels),
        relief: None,
        lights,
        views,
        texel_clusters,
        texel_lobe_counts,
        dictionary,
        lobe_refs,
        lobe_weights: None,
        residual,
    };
    if source.flag() {
        add_groups(source, &mut layer);
    }
    if source.flag() {
        add_lobe_weights(source, &mut layer);
    }
    if layer.may_have_relief() && source.flag() {
        let numbers = [source.within(0.0, 1e4), source.within(0.0, 1.0), source.within(0.0, 1.0)];
        layer.relief = Relief::from_numbers(numbers);
    }
    layer
}

/// Adds lobe weights, with nodes of texels or others, and with references that follow from them or others.
fn add_lobe_weights(source: &mut Source, layer: &mut Layer) {
    let inputs = source.below(4);
    let lobes: usize = layer.dictionary.iter().map(Vec::len).sum();
    let mut weights = LobeWeights {
        step: source.within(1e-3, 1.0),
        units: source.list(inputs, |source| source.within(1e-2, 100.0)),
        codes: source.list(3 * lobes * (1 + inputs), |source| i16::from(source.byte()) - 100),
        nodes: Vec::new(),
    };
    let most = source.below(5);
    weights.nodes = match source.flag() {
        true => weights.nodes_of_texels(&layer.texel_clusters, &layer.coefficient_planes(), most),
        false => source.list(layer.dictionary.len(), |source| {
            let nodes = source.below(most + 1);
            source.list(nodes, |source| source.list(inputs, |source| source.byte() as i8))
        }),
    };
    layer.lobe_weights = Some(weights);
    if source.flag() {
        layer.predict_lobes();
    }
}

fn any_residual(source: &mut Source, shape: [usize; 2], clusters: usize, texels: usize) -> Residual {
    let ranks = [0; 3].map(|_| [source.below(4), source.below(4)]);
    let factors = Factors {
        shape,
        ranks,
        view: ranks.map(|[rank, _]| source.halves(shape[0] * rank)),
        light: ranks.map(|[_, rank]| source.halves(shape[1] * rank)),
    };
    let shared = source.below(4);
    let steps = |source: &mut Source, count: usize| source.list(count, |source| source.within(0.0, 100.0));
    let shared_bases =
        SharedBases { steps: steps(source, shared), values: source.list(shared * factors.core_len(), Source::short) };
    let components = source.below(5);
    let bases = (0..=components)
        .map(|_| Basis { steps: steps(source, clusters), values: source.list(clusters * shared, Source::short) })
        .collect();
    let coefficients = (0..components)
        .map(|_| Coefficients {
            step: source.within(0.0, 100.0),
            codes: source.list(texels, |source| source.byte() as i8),
        })
        .collect();
    Residual { factors, shared: shared_bases, bases, coefficients, groups: Vec::new() }
}

/// Has the coefficients of `layer` predicted, in one or two groups of any inputs that are allowed.
fn add_groups(source: &mut Source, layer: &mut Layer) {
    let Some(residual) = &mut layer.residual else { return };
    let components = residual.coefficients.len();
    let mut first = 0;
    while first < components {
        let count = 1 + source.below(components - first);
        let end = first + count;
        let inputs = [0; 4].map(|_| source.below(end + 1) as u8);
        residual.groups.push(PredictedGroup { components: count, inputs, own: source.below(first + 1) as u8 });
        first = end;
    }
    // No coefficients of what a cluster lacks.
    for j in 0..components {
        let has: Vec<bool> =
            (0..layer.dictionary.len()).map(|cluster| residual.has_component(cluster, j + 1)).collect();
        let codes = residual.coefficients[j].codes.iter_mut().zip(&layer.texel_clusters);
        codes.filter(|(_, cluster)| !has[usize::from(**cluster)]).for_each(|(code, _)| *code = 0);
    }
}

fn any_level(source: &mut Source, layer: &Layer, texels: usize) -> LevelTexels {
    let (clusters, lobe_counts, lobe_refs) = any_texels(source, texels, &layer.dictionary);
    let components = layer.residual.as_ref().map_or(0, |residual| residual.coefficients.len());
    let planes = source.below(components + 1);
    LevelTexels {
        heights: any_heights(source, texels),
        clusters,
        lobe_counts,
        lobe_refs,
        codes: (0..planes).map(|_| source.list(texels, |source| source.byte() as i8)).collect(),
    }
}
