//! The fit of an OpenPBR material: per texel the parameters that come nearest to what an asset decodes to.
//!
//! Each texel is searched for itself (`descent`), from the texel of the glTF material. What parts the model has, a sample of the
//! texels decides.

use crate::error::FitError;
use crate::export::gltf::brdf::{DIELECTRIC_F0, GltfTexel};
use crate::export::gltf::fit::{GltfFit, MIN_SAVED, Maps, TriedPart};
use crate::export::openpbr::descent::{Pairs, Parts, Scratch, fit_texel};
use crate::export::openpbr::model::OpenPbrTexel;
use crate::export::pairs::{PairList, front_layer};
use crate::input::pair_stride::stride_over_pairs;
use crate::monitor::Monitor;
use btf_runtime::Resident;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Pairs of directions that a texel is fitted to, first and at last, and the most steps with them: few pairs find the way,
/// many keep the model from following what is peculiar to a few.
const STAGES: [(usize, usize); 2] = [(192, 12), (1536, 4)];
/// Texels of the sample that decides which parts of the model the material needs.
const TRIAL_TEXELS: usize = 256;

/// A fitted OpenPBR material.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenPbrFit {
    /// Texels a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// All texels, row by row.
    pub texels: Vec<OpenPbrTexel>,
    /// Whether there is a coat.
    pub coat: bool,
    /// Whether there is fuzz.
    pub fuzz: bool,
    /// Of each texel what comes through: the share of the diffuse light and its colour; empty where the asset has no layer
    /// of transmission.
    pub transmission: Vec<(f32, [f32; 3])>,
    /// Optional parts that were tried.
    pub tried: Vec<TriedPart>,
}

/// Fits a material to the front of `resident`'s finest level, from the texels of a glTF material. Deterministic on any
/// number of threads.
///
/// Cost: some 10 steps a texel with 192 pairs and 4 with 1536, each with 15 evaluations of the model.
///
/// # Errors
/// [`FitError::Params`] for an asset without a layer that is lit and seen from the front; Ctrl-C.
pub fn fit_openpbr(
    resident: &Resident,
    start: &GltfFit,
    maps: Maps,
    monitor: &Monitor,
) -> Result<OpenPbrFit, FitError> {
    let layer = front_layer(resident)?;
    let stages: Vec<Stage> = STAGES.iter().map(|(pairs, steps)| Stage::new(resident, layer, *pairs, *steps)).collect();
    let (width, height, count) = (start.width, start.height, start.texels.len());
    let fitted = |texel: usize, parts: Parts, scratch: &mut Scratch| {
        let mut found = (0.0, start_of(&start.texels[texel], parts));
        for stage in &stages {
            stage.list.decode(resident, layer, texel, &mut scratch.decoded);
            found = fit_texel(&stage.pairs, stage.steps, &found.1, parts, scratch);
        }
        found
    };

    let stride = stride_over_pairs(count / TRIAL_TEXELS, width);
    let trial: Vec<usize> = (0..count.min(TRIAL_TEXELS)).map(|i| i * stride % count).collect();
    let error_of = |parts: Parts| -> Result<f64, FitError> {
        let errors = trial.par_iter().map_init(Scratch::default, |scratch, texel| {
            monitor.check()?;
            Ok(fitted(*texel, parts, scratch).0)
        });
        Ok(errors.collect::<Result<Vec<f64>, FitError>>()?.iter().sum())
    };
    let (parts, tried) = choose_parts(maps, error_of)?;

    let done = AtomicUsize::new(0);
    let texels = (0..count).into_par_iter().map_init(Scratch::default, |scratch, texel| {
        let before = done.fetch_add(1, Ordering::Relaxed);
        if before.is_multiple_of(width) {
            monitor.report("fit OpenPBR", before, count)?;
        }
        Ok(fitted(texel, parts, scratch).1)
    });
    let mut texels = texels.collect::<Result<Vec<OpenPbrTexel>, FitError>>()?;
    let mut transmission = Vec::new();
    if start.transmission {
        transmission = start.texels.iter().map(|texel| (texel.transmission, texel.transmission_colour)).collect();
        // Of the diffuse light that share comes through.
        for (texel, (share, _)) in texels.iter_mut().zip(&transmission) {
            texel.base_colour = texel.base_colour.map(|x| (x / (1.0 - share)).min(1.0));
        }
    }
    let Parts { coat, fuzz } = parts;
    Ok(OpenPbrFit { width, height, texels, coat, fuzz, transmission, tried })
}

/// A part of the search: the pairs that it looks at, and its most steps.
struct Stage {
    list: PairList,
    pairs: Pairs,
    steps: usize,
}

impl Stage {
    fn new(resident: &Resident, layer: u32, pairs: usize, steps: usize) -> Stage {
        let list = PairList::split(resident, layer, pairs).swap_remove(0);
        Stage { pairs: Pairs::new(&list), list, steps }
    }
}

/// Tries coat and fuzz; `error_of` tells a model's squared error. A part must save [`MIN_SAVED`] of it.
fn choose_parts(
    maps: Maps,
    error_of: impl Fn(Parts) -> Result<f64, FitError>,
) -> Result<(Parts, Vec<TriedPart>), FitError> {
    let mut parts = Parts { coat: false, fuzz: false };
    let mut error = error_of(parts)?;
    let mut tried = Vec::new();
    for (name, more) in [("coat", Parts { coat: true, fuzz: false }), ("fuzz", Parts { coat: false, fuzz: true })] {
        let with = Parts { coat: parts.coat || more.coat, fuzz: parts.fuzz || more.fuzz };
        let next = error_of(with)?;
        let saved = if error > 0.0 { 1.0 - next / error } else { 0.0 };
        let used = saved >= MIN_SAVED || maps == Maps::All;
        tried.push(TriedPart { name, saved, used });
        if used {
            (parts, error) = (with, next);
        }
    }
    Ok((parts, tried))
}

/// Returns the texel from which the search starts.
pub fn start_of(texel: &GltfTexel, parts: Parts) -> OpenPbrTexel {
    let [x, y, _] = texel.normal;
    let (f0, colour, base) = if texel.metallic > 0.5 {
        (0.5, texel.base_colour, [0.05; 3])
    } else {
        let f0 = texel.specular_colour.map(|x| (DIELECTRIC_F0 * x).min(1.0));
        let top = f0.into_iter().fold(1e-3, f32::max);
        (top, f0.map(|x| texel.specular * x / top), texel.base_colour)
    };
    OpenPbrTexel {
        base_colour: base,
        diffuse_roughness: 0.2,
        normal: [x, y],
        roughness: texel.roughness,
        anisotropy: [0.1, 0.0],
        f0,
        specular_colour: colour,
        coat: if parts.coat { 0.1 } else { 0.0 },
        coat_colour: [0.9; 3],
        coat_normal: [-0.5 * x, -0.5 * y],
        coat_roughness: 0.6,
        coat_anisotropy: [0.1, 0.0],
        fuzz: if parts.fuzz { 0.05 } else { 0.0 },
        fuzz_colour: [0.5; 3],
        fuzz_roughness: 0.5,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_used_where_they_help() {
        let choose = |maps, coat: f64, fuzz: f64| {
            let error_of =
                |parts: Parts| Ok(100.0 - if parts.coat { coat } else { 0.0 } - if parts.fuzz { fuzz } else { 0.0 });
            choose_parts(maps, error_of).unwrap().0
        };
        assert_eq!(choose(Maps::Auto, 10.0, 1.0), Parts { coat: true, fuzz: false });
        assert_eq!(choose(Maps::Auto, 1.0, 10.0), Parts { coat: false, fuzz: true });
        assert_eq!(choose(Maps::All, -1.0, 0.0), Parts { coat: true, fuzz: true });
    }
}
