//! Photons of the sun, or of a white sky, through a canopy: where their light goes, in all bands at once.
//!
//! A photon begins anywhere above the cell with weight 1 in every band. Each surface takes its share, sends the photon on by a
//! diffuse lobe, or that of a leaf's gloss, and is seen from every view with what it sends there (local estimate), so that one set of photons
//! gives albedo, absorption and reflectance towards all views. Weights differ by band, paths do not.

use super::cell::{CanopyCell, Met, Organ, Surface};
use super::optics::CanopyOptics;
use super::structure::direction;
use crate::render::control::Control;
use crate::sampler;
use btf_runtime::FaceGloss;
use glam::Vec3;
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Parts that photons are traced in, whose scatter gives standard errors.
pub(crate) const BATCHES: usize = 32;
/// Largest weight below which a photon is continued by chance, and the weight that it then has.
const FAINT: f64 = 0.02;
const REVIVED: f64 = 0.1;
/// Surfaces that a photon meets at most; what remains then is lost.
const MAX_MEETINGS: usize = 1000;

/// Where light comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Source {
    /// A direction to the sun: angles from the zenith, and from north over east.
    Sun { zenith_rad: f32, azimuth_rad: f32 },
    /// A sky of the same radiance everywhere.
    Sky,
}

/// Where the light of photons went, for each band in units of the light that comes onto the cell.
#[derive(Debug, Clone, Default)]
pub(crate) struct Tally {
    /// Left upwards.
    pub(crate) reflected: Vec<f64>,
    /// Absorbed: by the soil, by organs that are no leaves, by each layer's leaves (from the soil up, `[layer][band]`).
    pub(crate) soil: Vec<f64>,
    pub(crate) other: Vec<f64>,
    pub(crate) layers: Vec<f64>,
    /// Absorbed by each leaf, `[leaf][band]`; empty where not asked for.
    pub(crate) leaves: Vec<f64>,
    /// Bidirectional reflectance factor of each view, `[view][band]`.
    pub(crate) views: Vec<f64>,
    /// Not followed to its end.
    pub(crate) lost: Vec<f64>,
}

/// What is counted.
#[derive(Debug, Clone)]
pub(crate) struct Counted<'a> {
    pub(crate) cell: &'a CanopyCell,
    pub(crate) optics: &'a CanopyOptics,
    /// Layers of equal height.
    pub(crate) layers: usize,
    pub(crate) leaves: bool,
    /// Unit vectors towards the eyes, above the horizon.
    pub(crate) views: Vec<Vec3>,
}

impl Tally {
    fn new(counted: &Counted) -> Tally {
        let bands = counted.optics.wavelengths_nm.len();
        let leaves = if counted.leaves { counted.cell.leaves() } else { 0 };
        let zeros = |count: usize| vec![0.0; count * bands];
        Tally {
            reflected: zeros(1),
            soil: zeros(1),
            other: zeros(1),
            layers: zeros(counted.layers),
            leaves: zeros(leaves),
            views: zeros(counted.views.len()),
            lost: zeros(1),
        }
    }

    fn parts_mut(&mut self) -> [&mut Vec<f64>; 7] {
        [
            &mut self.reflected,
            &mut self.soil,
            &mut self.other,
            &mut self.layers,
            &mut self.leaves,
            &mut self.views,
            &mut self.lost,
        ]
    }
}

/// Traces `photons`, a multiple of [`BATCHES`], and returns the tally of each batch, each as if it were all; `None` if
/// `control` ends it. The same numbers give the same tallies on any number of threads.
pub(crate) fn trace(
    counted: &Counted,
    source: Source,
    photons: u32,
    seed: u32,
    control: &Control<'_>,
) -> Option<Vec<Tally>> {
    let each = photons / BATCHES as u32;
    let batch = |number: usize| {
        let mut tally = Tally::new(counted);
        let mut random = Xoshiro256PlusPlus::seed_from_u64((u64::from(seed) << 32) | number as u64);
        let mut photon = Photon { weights: Vec::new(), counted };
        for i in 0..each {
            if i % 256 == 0 && (control.cancelled)() {
                return None;
            }
            // One stratified set of places for all batches.
            let index = number as u32 * each + i;
            photon.run(source, index, seed, &mut random, &mut tally);
        }
        let share = 1.0 / f64::from(each.max(1));
        tally.parts_mut().into_iter().flatten().for_each(|sum| *sum *= share);
        Some(tally)
    };
    (0..BATCHES).into_par_iter().map(batch).collect()
}

/// How a photon goes on from a surface, on the side of a normal.
enum Onwards {
    /// By a diffuse lobe.
    Diffuse(Vec3),
    /// By a diffuse lobe under gloss.
    UnderGloss(Vec3),
    /// By the gloss.
    Mirrored(Vec3),
}

impl Onwards {
    /// Returns the normal of the side.
    fn side(&self) -> Vec3 {
        let (Onwards::Diffuse(side) | Onwards::UnderGloss(side) | Onwards::Mirrored(side)) = self;
        *side
    }
}

/// Returns what a body under `gloss` sends out with a cosine to the normal, over a diffuse lobe without gloss.
fn leaving(gloss: &FaceGloss, cosine: f64) -> f64 {
    f64::from((1.0 - gloss.albedo(cosine as f32)) / (1.0 - gloss.mean_albedo()))
}

/// A photon on its way.
struct Photon<'a> {
    /// Weight in each band.
    weights: Vec<f64>,
    counted: &'a Counted<'a>,
}

impl Photon<'_> {
    fn run(&mut self, source: Source, index: u32, seed: u32, random: &mut Xoshiro256PlusPlus, tally: &mut Tally) {
        let Counted { cell, optics, .. } = *self.counted;
        self.weights.clear();
        self.weights.resize(optics.wavelengths_nm.len(), 1.0);
        let mut origin = cell.above(sampler::two(index, seed));
        let mut towards = match source {
            Source::Sun { zenith_rad, azimuth_rad } => -direction(zenith_rad, azimuth_rad),
            Source::Sky => -turned(Vec3::Y, sampler::two(index, seed ^ 0x9e37_79b9)),
        };
        for _ in 0..MAX_MEETINGS {
            match cell.follow(origin, towards) {
                Met::Sky => return add(&mut tally.reflected, &self.weights),
                Met::Lost => return add(&mut tally.lost, &self.weights),
                Met::Soil(at) => {
                    self.look_from(at, Vec3::Y, [&optics.soil, &optics.soil], |_| [1.0, 0.0], tally);
                    self.absorb(&optics.soil, &mut tally.soil);
                    towards = turned(Vec3::Y, [random.r#gen(), random.r#gen()]);
                    origin = at;
                }
                Met::Surface(surface) => {
                    let onwards = self.meet(&surface, towards, random, tally);
                    let numbers = [random.r#gen(), random.r#gen()];
                    let side = onwards.side();
                    towards = match onwards {
                        Onwards::Mirrored(_) => self.mirrored(side, towards, numbers),
                        Onwards::Diffuse(_) | Onwards::UnderGloss(_) => turned(side, numbers),
                    };
                    if let Onwards::UnderGloss(_) = onwards {
                        self.leave(f64::from(side.dot(towards)));
                    }
                    origin = cell.beside(surface.at, side);
                }
            }
            let most = self.weights.iter().fold(0f64, |most, weight| most.max(*weight));
            if most <= 0.0 {
                return;
            }
            if most < FAINT {
                if random.r#gen::<f64>() >= most / REVIVED {
                    return;
                }
                self.weights.iter_mut().for_each(|weight| *weight *= REVIVED / most);
            }
        }
        add(&mut tally.lost, &self.weights);
    }

    /// Meets a surface of a plant: counts what it shows and absorbs, and returns how the photon goes on.
    fn meet(
        &mut self,
        surface: &Surface,
        towards: Vec3,
        random: &mut Xoshiro256PlusPlus,
        tally: &mut Tally,
    ) -> Onwards {
        let Counted { optics, layers, cell, leaves, .. } = *self.counted;
        let upper = surface.normal.dot(towards) < 0.0;
        let normal = if upper { surface.normal } else { -surface.normal };
        if surface.organ == Organ::Other {
            self.look_from(surface.at, normal, [&optics.other, &[]], |_| [1.0, 0.0], tally);
            self.absorb(&optics.other, &mut tally.other);
            return Onwards::Diffuse(normal);
        }
        let [r, t] = &optics.leaf[usize::from(!upper)];
        // Shares of the light that the gloss sends back, and that it lets in.
        let mirrors = optics.gloss.as_ref().map_or(0.0, |gloss| f64::from(gloss.albedo(-normal.dot(towards))));
        let enters = 1.0 - mirrors;
        let shown = |view: Vec3| {
            let Some(gloss) = &optics.gloss else { return [1.0, 0.0] };
            let cosine = normal.dot(view);
            let leaves = leaving(gloss, f64::from(cosine.abs()));
            let glossy = gloss.value(normal.into(), view.into(), (-towards).into());
            [enters * leaves, f64::from(glossy) / f64::from(cosine.abs().max(f32::MIN_POSITIVE))]
        };
        self.look_from(surface.at, normal, [r, t], shown, tally);
        let bands = self.weights.len();
        let layer = cell.layer_of(surface.at.y, layers) * bands;
        let leaf = surface.leaf as usize * bands;
        let (mut mirrored, mut reflected, mut sent) = (0.0, 0.0, 0.0);
        for (band, weight) in self.weights.iter().enumerate() {
            let absorbed = weight * (enters * (1.0 - r[band] - t[band]));
            tally.layers[layer + band] += absorbed;
            if leaves {
                tally.leaves[leaf + band] += absorbed;
            }
            mirrored += weight * mirrors;
            reflected += weight * enters * r[band];
            sent += weight * (mirrors + enters * (r[band] + t[band]));
        }
        // By the mean over the bands.
        let [mirrors, reflects] = if sent > 0.0 { [mirrored / sent, reflected / sent] } else { [0.0, 1.0] };
        let drawn = random.r#gen::<f64>();
        if drawn < mirrors {
            self.weights.iter_mut().for_each(|weight| *weight /= mirrors);
            return Onwards::Mirrored(normal);
        }
        let reflected = drawn < mirrors + reflects;
        let (share, chance) = if reflected { (r, reflects) } else { (t, 1.0 - mirrors - reflects) };
        let scale = enters / chance.max(f64::MIN_POSITIVE);
        self.weights.iter_mut().zip(share).for_each(|(weight, share)| *weight *= share * scale);
        let side = if reflected { normal } else { -normal };
        if optics.gloss.is_some() { Onwards::UnderGloss(side) } else { Onwards::Diffuse(side) }
    }

    /// Weighs a photon that leaves a body under gloss by a diffuse lobe, with a cosine to the normal.
    fn leave(&mut self, cosine: f64) {
        if let Some(gloss) = &self.counted.optics.gloss {
            let factor = leaving(gloss, cosine);
            self.weights.iter_mut().for_each(|weight| *weight *= factor);
        }
    }

    /// Sends a photon on that the gloss reflects, and weighs it; a direction into the leaf has no weight.
    fn mirrored(&mut self, normal: Vec3, towards: Vec3, at: [f32; 2]) -> Vec3 {
        let Some(gloss) = &self.counted.optics.gloss else { return towards };
        let (onwards, weight) = gloss.sample(normal.into(), (-towards).into(), at);
        self.weights.iter_mut().for_each(|own| *own *= f64::from(weight));
        Vec3::from(onwards)
    }

    /// Absorbs all but `share`.
    fn absorb(&mut self, share: &[f64], absorbed: &mut [f64]) {
        for ((weight, share), absorbed) in self.weights.iter_mut().zip(share).zip(absorbed) {
            *absorbed += *weight * (1.0 - share);
            *weight *= share;
        }
    }

    /// Adds what the views see of the light on a surface, which sends `shares` to the side of `normal` and to the other;
    /// an empty share is nothing. `shown` gives a factor on the share for a view, and what comes to all bands on top.
    fn look_from(
        &self,
        at: Vec3,
        normal: Vec3,
        shares: [&[f64]; 2],
        shown: impl Fn(Vec3) -> [f64; 2],
        tally: &mut Tally,
    ) {
        let Counted { cell, views, .. } = self.counted;
        let bands = self.weights.len();
        for (view, seen) in views.iter().zip(tally.views.chunks_exact_mut(bands)) {
            let cosine = normal.dot(*view);
            let (share, side) = if cosine >= 0.0 { (shares[0], normal) } else { (shares[1], -normal) };
            if share.is_empty() || !cell.sees_sky(cell.beside(at, side), *view) {
                continue;
            }
            let factor = f64::from(cosine.abs() / view.y);
            let [scale, on_top] = shown(*view);
            for ((seen, weight), share) in seen.iter_mut().zip(&self.weights).zip(share) {
                *seen += weight * (share * scale + on_top) * factor;
            }
        }
    }
}

fn add(sums: &mut [f64], weights: &[f64]) {
    sums.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += weight);
}

/// Returns a direction about `normal` whose density is its cosine over pi.
fn turned(normal: Vec3, at: [f32; 2]) -> Vec3 {
    let local = sampler::cosine(at);
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let turned = tangent * local.x + bitangent * local.y + normal * local.z.max(1e-4);
    turned.normalize_or(normal)
}

/// Returns the direction of a view in the sun's plane: `zenith_deg` positive towards the sun, after turning by `azimuth_deg`.
pub(crate) fn view_direction(sun_azimuth_rad: f32, zenith_deg: f64, azimuth_deg: f64) -> Vec3 {
    let azimuth = (sun_azimuth_rad + azimuth_deg.to_radians() as f32).rem_euclid(TAU);
    direction(zenith_deg.to_radians() as f32, azimuth)
}
