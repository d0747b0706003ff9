//! Direction pairs that a fit does not look at (`--leave-out`), so that their error can be measured.

use btf_capture::CaptureInfo;
use btf_runtime::Sphere;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_xoshiro::Xoshiro256PlusPlus;

/// The held-back pairs and how their samples are filled from those that are seen.
#[derive(Debug, Clone, Default)]
pub struct Holdout {
    /// Held-back pairs, ascending (`view * lights + light`).
    pub pairs: Vec<usize>,
    /// Per held-back pair: the seen pairs whose mean stands in for it.
    sources: Vec<Vec<usize>>,
}

impl Holdout {
    /// Holds back `share` of the pairs, by `seed`. The fill of a pair is the mean of its seen neighbours:
    /// same view and a neighbouring light, or same light and a neighbouring view (Delaunay neighbours).
    pub fn new(info: &CaptureInfo, lights: &Sphere, views: &Sphere, share: f64, seed: u64) -> Holdout {
        let count = (info.pair_count() as f64 * share).round() as usize;
        if count == 0 {
            return Holdout::default();
        }
        let mut all: Vec<usize> = (0..info.pair_count()).collect();
        all.shuffle(&mut Xoshiro256PlusPlus::seed_from_u64(seed ^ 0x5eed_0f0e));
        let mut pairs = all[..count].to_vec();
        pairs.sort_unstable();
        let held: Vec<bool> = {
            let mut held = vec![false; info.pair_count()];
            pairs.iter().for_each(|pair| held[*pair] = true);
            held
        };
        let (light_near, view_near) = (lights.neighbours(), views.neighbours());
        let light_count = lights.len();
        let sources = pairs
            .iter()
            .map(|pair| {
                let (view, light) = (pair / light_count, pair % light_count);
                let by_light = light_near[light].iter().map(|other| view * light_count + other);
                let by_view = view_near[view].iter().map(|other| other * light_count + light);
                by_light.chain(by_view).filter(|source| !held[*source]).collect()
            })
            .collect();
        Holdout { pairs, sources }
    }

    /// Replaces the held-back samples of a texel's row `[pair, channel]`; a pair without seen neighbours becomes 0.
    pub fn fill(&self, row: &mut [f32]) {
        for (pair, sources) in self.pairs.iter().zip(&self.sources) {
            let scale = 1.0 / sources.len().max(1) as f32;
            for channel in 0..3 {
                let sum: f32 = sources.iter().map(|source| row[source * 3 + channel]).sum();
                row[pair * 3 + channel] = sum * scale;
            }
        }
    }

    /// Sets the held-back pairs of a per-pair array to 0.
    pub fn zero(&self, weights: &mut [f32]) {
        self.pairs.iter().for_each(|pair| weights[*pair] = 0.0);
    }
}
