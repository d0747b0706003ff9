//! Lobes at all measured pairs: their values, and sums of a texel's lobes.

use crate::asset::dictionary::LobeRef;
use crate::asset::lobe::Lobe;
use crate::asset::sphere::Sphere;
use crate::numeric::quantize::weight_from_byte;

/// Sums a texel's lobes at every measured pair: `out` is `[view, light, rgb]`. `tables` are the [`lobe_tables`] of the
/// texel's cluster, `scales` the weight scales of its lobes. Fitting and measuring use these sums instead of
/// [`crate::decode`].
#[inline(always)]
pub fn lobe_sum_at_pairs(refs: &[LobeRef], scales: &[f32], tables: &[Vec<f32>], out: &mut [f32]) {
    out.fill(0.0);
    for reference in refs {
        let table = &tables[usize::from(reference.lobe)];
        let weights = reference.weight.map(|q| weight_from_byte(q.into(), scales[usize::from(reference.lobe)]));
        for (out, value) in out.chunks_exact_mut(3).zip(table) {
            for c in 0..3 {
                out[c] += weights[c] * value;
            }
        }
    }
}

/// Evaluates each lobe at every pair of `views` x `lights`: `[lobe][view * L + light]` with L lights.
pub fn lobe_tables(lobes: &[Lobe], views: &Sphere, lights: &Sphere) -> Vec<Vec<f32>> {
    lobes
        .iter()
        .map(|lobe| {
            let setup = lobe.setup();
            let mut table = Vec::with_capacity(views.len() * lights.len());
            for v in 0..views.len() as u32 {
                for l in 0..lights.len() as u32 {
                    table.push(setup.eval(lights.direction(l), views.direction(v)));
                }
            }
            table
        })
        .collect()
}
