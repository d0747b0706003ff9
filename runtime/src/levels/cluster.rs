//! A cluster at the pairs at which levels are fitted, and the clusters among which a coarse texel chooses.

use crate::asset::dictionary::LobeRef;
use crate::levels::bases::Bases;
use crate::numeric::quantize::weight_from_byte;
use crate::resident::expansion::Expansion;

/// Number that each cluster's lobes have in the dictionary of the levels' own cluster, `[cluster][lobe]`; `None` for a
/// lobe that the dictionary lacks.
pub(super) type OwnLobes = Vec<Vec<Option<u8>>>;

/// Number of first components by which the cluster and lobes of a coarse texel are chosen.
const CHOICE_COMPONENTS: usize = 24;

/// A cluster evaluated at the sampled pairs.
#[derive(Default)]
pub(super) struct Cluster {
    /// Mean of the residual, `[pair, rgb]`.
    pub mean: Vec<f32>,
    /// Components of the residual, whose samples are `[pair, rgb]`.
    pub components: Bases,
    /// Products of the first components with each other, by which a cluster is chosen.
    pub first_gram: Vec<f32>,
    /// Values of the lobes, `[lobe][pair]`.
    pub lobes: Vec<Vec<f32>>,
    /// Values of the lobes times the tone weights of the pairs; their products with each other follow.
    pub toned: Vec<Vec<f32>>,
    pub toned_gram: Vec<f32>,
    pub scales: Vec<f32>,
}

/// A cluster from which a coarse texel may choose, because some of the covered texels have it.
pub(super) struct Candidate {
    pub cluster: u8,
    /// Share of the covered texels that have the cluster.
    pub share: f32,
    /// Weights of the cluster's lobes: the sum over its covered texels, by share; in the end their mean.
    pub weights: Vec<[f32; 3]>,
}

impl Candidate {
    pub(super) fn new(cluster: u8, lobes: usize) -> Candidate {
        Candidate { cluster, share: 0.0, weights: vec![[0.0; 3]; lobes] }
    }

    pub(super) fn add(&mut self, share: f32, refs: &[LobeRef], scales: &[f32]) {
        self.share += share;
        for reference in refs {
            let lobe = usize::from(reference.lobe);
            let weights = reference.weight.map(|q| weight_from_byte(q.into(), scales[lobe]));
            (0..3).for_each(|c| self.weights[lobe][c] += share * weights[c]);
        }
    }
}

/// Expands the bases of a cluster at the sampled pairs, which must ascend: `[basis][pair, rgb]`, the mean and the
/// components for a code of 1.
pub(super) fn bases_at(
    expansion: &Expansion,
    bases: usize,
    cluster: usize,
    pairs: &[usize],
    lights: usize,
) -> Vec<Vec<f32>> {
    let padded = expansion.padded();
    let mut samples = vec![Vec::with_capacity(3 * pairs.len()); bases];
    let mut wanted = pairs.iter().peekable();
    expansion.rows(cluster, |view, rows| {
        while let Some(pair) = wanted.next_if(|pair| **pair / lights == view) {
            for row in rows.chunks_exact(padded).skip(pair % lights * 3).take(3) {
                samples.iter_mut().zip(row).for_each(|(values, x)| values.push(*x));
            }
        }
    });
    samples
}

impl Cluster {
    pub(super) fn set_bases(&mut self, mut bases: Vec<Vec<f32>>) {
        self.components = Bases::new(&bases.split_off(bases.len().min(1)));
        self.first_gram = self.components.first_gram(self.components.count.min(CHOICE_COMPONENTS));
        self.mean = bases.pop().unwrap_or_default();
    }
}
