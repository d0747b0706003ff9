//! Level-of-detail transition from meshes to the volumes that stand in for them where their leaves are small in the
//! picture. Twin: `lod_transition.wgsl`.
//!
//! A leaf `w` wide at distance d is `w / (d * pixel_width)` pixels wide. Where that is [`MESH_PIXELS`] or more, the
//! mesh is seen; where it is [`VOLUME_PIXELS`] or less, its volume; between, both in shares that change with the
//! logarithm of d. Each path from the eye draws one radius for each leaf width: within that sphere about the eye the
//! scene has the meshes, beyond it the volumes, for the path's further rays and those to lights as well. Every place
//! has one of the two, so nothing is there twice and nothing is lost, even where the eye is within a plant; and no
//! instance needs a state of its own. Shells of skins that are coarser with distance are chosen by the same spheres.

use crate::sampler;
use glam::Vec3;

/// Width in pixels from which on a leaf is shown by its mesh.
pub const MESH_PIXELS: f32 = 2.0;
/// Width in pixels up to which a leaf is shown by its volume. Two octaves of distance: from one side and under one
/// light the two differ in brightness by up to 15 %, which is 2 % for each quarter of an octave.
pub const VOLUME_PIXELS: f32 = 0.5;
/// Factor by which the shells of skins lie farther beside their place for rays to lights than for those of the eye: one level
/// coarser.
pub(crate) const COARSER_TO_LIGHT: f32 = 3.0;
/// Stream of the sampler from which radii are drawn.
pub(crate) const STREAM: u32 = 0x5bd1_e995;
/// Steps of the R2 sequence [Roberts 2018] in fractions of 2^32: radii of neighbouring pixels are far from each other.
pub(crate) const PIXEL_STEPS: [u32; 2] = [0xc13f_a9a9, 0x91e1_0da6];

/// The levels of detail of one path: what is a mesh, what a volume, and which level of that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LodTransition {
    eye: Vec3,
    /// Radius of the spheres, in widths of leaves.
    radius_widths: f32,
    /// The number, from 0 to below 1, by which a level of a volume is taken of the two between which a width lies: where
    /// the width is nearer to the coarser one than this, the coarser one.
    pub(crate) level_share: f32,
    /// The factor on the radius of the spheres beyond which a coarser shell of a skin is taken.
    shell_factor: f32,
}

impl LodTransition {
    /// Every mesh is one, however far away, and every skin has its finest shell.
    pub const MESHES: LodTransition = LodTransition { radius_widths: f32::INFINITY, ..LodTransition::VOLUMES };

    /// No mesh is one for which a volume stands in, however near, and every skin has its coarsest shell.
    pub(crate) const VOLUMES: LodTransition =
        LodTransition { eye: Vec3::ZERO, radius_widths: 0.0, level_share: 0.5, shell_factor: 1.0 };

    /// Returns the transition about an eye, where a pixel is `pixel_width` wide at distance 1. `share` is how far the
    /// radius lies from the inner sphere to the outer one, 0 to 1. Of volumes it has the nearest level.
    pub fn new(eye: Vec3, pixel_width: f32, share: f32) -> LodTransition {
        let pixels = MESH_PIXELS * (VOLUME_PIXELS / MESH_PIXELS).powf(share);
        LodTransition { eye, radius_widths: 1.0 / (pixels * pixel_width), ..LodTransition::VOLUMES }
    }

    /// Draws the transition of a sample of a pixel: stratified over any power of two of samples, and over neighbouring
    /// pixels.
    pub(crate) fn of_path(eye: Vec3, pixel_width: f32, [x, y]: [u32; 2], sample: u32) -> LodTransition {
        let lattice = |x: u32, y: u32| {
            let steps = x.wrapping_mul(PIXEL_STEPS[0]).wrapping_add(y.wrapping_mul(PIXEL_STEPS[1]));
            (steps >> 8) as f32 * 5.960_464_5e-8
        };
        let [own, of_level] = sampler::two(sample, STREAM);
        let transition = LodTransition::new(eye, pixel_width, (own + lattice(x, y)).fract());
        // By the same lattice, turned: what is a volume has all levels.
        LodTransition { level_share: (of_level + lattice(y, x)).fract(), ..transition }
    }

    /// Returns the transition for rays to lights: with shells that may lie some pixels beside their place, which shadows do not
    /// show.
    pub(crate) fn to_light(self) -> LodTransition {
        LodTransition { shell_factor: 1.0 / COARSER_TO_LIGHT, ..self }
    }

    /// Returns where a ray of unit direction lies within the spheres.
    pub(crate) fn along(&self, origin: Vec3, direction: Vec3) -> SpheresAlong {
        let to_eye = self.eye - origin;
        let nearest = to_eye.dot(direction);
        let apart2 = (to_eye - nearest * direction).length_squared();
        SpheresAlong { nearest, apart2, radius_widths: self.radius_widths, shell_factor: self.shell_factor }
    }
}

/// The places at which a ray passes the spheres about the eye.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SpheresAlong {
    /// Distance along the ray to where it is nearest to the eye, and the distance from there to the eye, squared.
    nearest: f32,
    apart2: f32,
    radius_widths: f32,
    shell_factor: f32,
}

impl SpheresAlong {
    /// Returns from where to where along the ray a mesh exists whose leaves are so wide; the whole ray for width 0,
    /// which no volume stands in for. The end lies before the start where the ray passes the sphere.
    #[inline(always)]
    pub fn mesh(&self, leaf_width: f32) -> [f32; 2] {
        if leaf_width <= 0.0 {
            return [f32::NEG_INFINITY, f32::INFINITY];
        }
        let radius = leaf_width * self.radius_widths;
        let half2 = radius * radius - self.apart2;
        if half2 < 0.0 {
            return [f32::INFINITY, f32::NEG_INFINITY];
        }
        let half = half2.sqrt();
        [self.nearest - half, self.nearest + half]
    }

    /// Tells whether the place at `t` is beyond the sphere of one shell's width and within that of another; 0 is no sphere.
    #[inline(always)]
    pub fn is_between(&self, inner_width: f32, outer_width: f32, t: f32) -> bool {
        let along = t - self.nearest;
        let distance2 = self.apart2 + along * along;
        let [inner, outer] = [inner_width, outer_width].map(|width| width * self.shell_factor * self.radius_widths);
        (inner_width <= 0.0 || distance2 >= inner * inner) && (outer_width <= 0.0 || distance2 < outer * outer)
    }

    /// Returns from where to where along the ray, from `first` on, places lie beyond the sphere of one shell's width and within that of another, 0
    /// being no sphere; some between may not. The end lies before the begin where none do.
    #[inline(always)]
    pub fn range_between(&self, inner_width: f32, outer_width: f32, first: f32) -> [f32; 2] {
        let [begin, end] = self.mesh(outer_width * self.shell_factor);
        let begin = begin.max(first);
        let [enter, leave] = if inner_width > 0.0 { self.mesh(inner_width * self.shell_factor) } else { [0.0; 2] };
        [if (enter..leave).contains(&begin) { leave } else { begin }, end]
    }

    /// Returns the parts of the stretch from `t0` to `t1` that lie before and behind the mesh that a volume stands in
    /// for: two stretches, of which those that end where they begin or before are empty.
    pub fn volume(&self, leaf_width: f32, [t0, t1]: [f32; 2]) -> [[f32; 2]; 2] {
        let [enter, leave] = self.mesh(leaf_width);
        if leaf_width <= 0.0 || leave <= enter {
            return [[t0, t1], [t1, t1]];
        }
        [[t0, t1.min(enter)], [t0.max(leave), t1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::testing::Random;

    fn point(random: &mut Random, reach: f32) -> Vec3 {
        Vec3::from([(); 3].map(|()| random.within(-reach, reach)))
    }

    #[test]
    fn every_place_along_a_ray_is_a_mesh_or_a_volume_as_its_distance_from_the_eye_says() {
        let mut random = Random::new(3);
        let mut counts = [0; 2];
        for _ in 0..4000 {
            let eye = point(&mut random, 40.0);
            let lod_transition = LodTransition::new(eye, 1e-3, random.within(0.0, 1.0));
            let width = random.within(0.001, 0.1);
            let radius = width * lod_transition.radius_widths;
            let (origin, direction) = (point(&mut random, 60.0), point(&mut random, 1.0).normalize());
            let along = lod_transition.along(origin, direction);
            let [t0, t1] = [random.within(0.0, 20.0), random.within(20.0, 90.0)];
            let [enter, leave] = along.mesh(width);
            let volume = along.volume(width, [t0, t1]);
            for _ in 0..8 {
                let t = random.within(t0, t1);
                let distance = (origin + t * direction).distance(eye);
                if (distance - radius).abs() < 1e-3 * radius {
                    continue;
                }
                let is_mesh = (enter..leave).contains(&t);
                let is_volume = volume.iter().filter(|[from, to]| (*from..*to).contains(&t)).count();
                assert_eq!((is_mesh, is_volume), (distance < radius, usize::from(distance > radius)));
                counts[usize::from(is_mesh)] += 1;
            }
        }
        assert!(counts.iter().all(|count| *count > 1000), "{counts:?}");
    }

    #[test]
    fn what_has_no_volume_is_always_a_mesh_and_every_mesh_can_be_kept() {
        let along = LodTransition::new(Vec3::ZERO, 1.0, 0.3).along(Vec3::X, Vec3::Y);
        assert_eq!(along.mesh(0.0), [f32::NEG_INFINITY, f32::INFINITY]);
        assert_eq!(along.volume(0.0, [2.0, 3.0]), [[2.0, 3.0], [3.0, 3.0]]);
        let all = LodTransition::MESHES.along(Vec3::X, Vec3::Y);
        assert_eq!(all.mesh(1e-9), [f32::NEG_INFINITY, f32::INFINITY]);
        assert!(all.volume(1e-9, [2.0, 3.0]).iter().all(|[from, to]| from >= to));
    }

    #[test]
    fn shares_change_with_the_logarithm_of_distance_and_are_spread_over_samples_and_pixels() {
        let radius = |share| LodTransition::new(Vec3::ZERO, 0.5, share).radius_widths;
        assert_eq!([radius(0.0), radius(1.0)], [1.0, 4.0]);
        assert!((radius(0.5) - 2.0).abs() < 1e-6);
        // Of the radii of n samples of a pixel, and of the first sample of 3 x 3 pixels, the largest gap.
        let gap = |mut shares: Vec<f32>| {
            shares.sort_by(f32::total_cmp);
            let around = 1.0 - shares[shares.len() - 1] + shares[0];
            shares.windows(2).map(|pair| pair[1] - pair[0]).fold(around, f32::max)
        };
        let share = |pixel, sample| 0.5 * LodTransition::of_path(Vec3::ZERO, 0.5, pixel, sample).radius_widths.log2();
        for i in 0..40u32 {
            let pixel = [7 * i, 1000 - 3 * i];
            assert!(gap((0..16).map(|sample| share(pixel, sample)).collect()) < 2.0 / 16.0 + 1e-4);
            let around = (0..9).map(|k| share([pixel[0] + k % 3, pixel[1] + k / 3], i)).collect();
            assert!(gap(around) < 2.5 / 9.0);
        }
        // Planted: samples that are drawn without order leave a larger gap.
        assert!((0..40).any(|i| gap((0..16).map(|k| sampler::one(16 * i + k)).collect()) > 2.0 / 16.0));
    }
}
