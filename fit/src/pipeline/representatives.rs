//! The texels that stand for their cluster where its lobe dictionary is fitted.

use ndarray::{Array1, ArrayView1, ArrayView2};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

/// Representative texels per cluster at most.
pub const REPRESENTATIVES: usize = 12;

/// Chooses at most [`REPRESENTATIVES`] texels of each cluster: the texel nearest to the centroid, then texels by
/// distance-squared sampling, so that the cluster's variety is seen. `scores` is `[texel, dimension]`.
pub fn representatives(labels: &[u32], clusters: usize, scores: ArrayView2<f32>, seed: u64) -> Vec<Vec<usize>> {
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); clusters];
    for (texel, label) in labels.iter().enumerate() {
        members[*label as usize].push(texel);
    }
    let of_cluster = |(cluster, members): (usize, &Vec<usize>)| {
        let random = Xoshiro256PlusPlus::seed_from_u64(seed.wrapping_add(cluster as u64 * 7919));
        representatives_of(members, scores, random)
    };
    members.par_iter().enumerate().map(of_cluster).collect()
}

/// Chooses the representatives among the texels `members` of one cluster.
fn representatives_of(members: &[usize], scores: ArrayView2<f32>, mut random: Xoshiro256PlusPlus) -> Vec<usize> {
    let distance = |texel: usize, other: ArrayView1<f32>| -> f32 {
        scores.row(texel).iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum()
    };
    let mut centroid = Array1::<f32>::zeros(scores.ncols());
    members.iter().for_each(|&texel| centroid += &scores.row(texel));
    centroid /= members.len().max(1) as f32;
    let centroid = centroid.view();
    let Some(first) = members.iter().copied().min_by(|&a, &b| distance(a, centroid).total_cmp(&distance(b, centroid)))
    else {
        return Vec::new();
    };
    let mut chosen = vec![first];
    let mut nearest: Vec<f32> = members.iter().map(|&texel| distance(texel, scores.row(first))).collect();
    while chosen.len() < REPRESENTATIVES.min(members.len()) {
        let total: f64 = nearest.iter().map(|x| f64::from(*x)).sum();
        if total <= 0.0 {
            break;
        }
        let mut target = random.r#gen::<f64>() * total;
        let index = nearest.iter().position(|x| {
            target -= f64::from(*x);
            target < 0.0
        });
        let texel = members[index.unwrap_or(members.len() - 1)];
        chosen.push(texel);
        for (near, &member) in nearest.iter_mut().zip(members) {
            *near = near.min(distance(member, scores.row(texel)));
        }
    }
    chosen
}
