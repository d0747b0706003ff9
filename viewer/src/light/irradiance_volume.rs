//! The irradiance volume [Greger 1998]: a grid over the scene that holds the light which arrives after one bounce, as spherical
//! harmonics of the first order. Twin: `irradiance_volume.wgsl`.
//!
//! Of each channel a cell has the mean radiance `a` over all directions and a vector `b`: what comes from the direction w is
//! about `a + b.w`. A surface of normal n then has the irradiance `pi (a + 2/3 b.n)` [Ramamoorthi 2001], which is exact for light
//! that is the same everywhere and for two halves that differ, where n is their axis.

use crate::geometry::bvh_node::Bounds;
use glam::{Vec3, Vec4};

/// Quads of numbers before those of the cells. Twin: `IRRADIANCE_VOLUME_HEAD`.
pub(crate) const IRRADIANCE_VOLUME_HEAD: usize = 3;
/// Quads of a cell, one for each channel. Twin: `IRRADIANCE_VOLUME_QUADS`.
pub(crate) const IRRADIANCE_VOLUME_QUADS: usize = 3;
/// What a surface sees of `b` in its irradiance over pi.
const IRRADIANCE_SLOPE: f32 = 2.0 / 3.0;

/// The constant that the shader has too.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[("IRRADIANCE_SLOPE", IRRADIANCE_SLOPE)];

/// The cells of a grid, cubes that stand on the box of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct IrradianceCells {
    /// Least corner.
    pub lo: Vec3,
    /// Length of a cell's sides.
    pub side: f32,
    /// Cells on each axis.
    pub counts: [usize; 3],
}

impl IrradianceCells {
    /// Returns cubes over `lit`, `along` of them on its longest side and at least one on each. They reach half a cell beyond what they
    /// cover, so that a plane lies within them.
    pub(crate) fn over(lit: Bounds, along: u32) -> IrradianceCells {
        let sides = (lit.hi - lit.lo).max(Vec3::ZERO);
        let longest = sides.max_element();
        if !(longest >= f32::MIN_POSITIVE && longest.is_finite()) {
            return IrradianceCells { lo: Vec3::ZERO, side: 1.0, counts: [1; 3] };
        }
        let side = longest / (along as f32 - 0.999).max(0.5);
        let counts = sides.to_array().map(|length| (length / side).ceil() as usize + 1).map(|count| count.max(1));
        let around = 0.5 * (Vec3::from(counts.map(|count| count as f32)) * side - sides);
        IrradianceCells { lo: lit.lo - around, side, counts }
    }

    /// Returns how many cells there are.
    pub(crate) fn count(&self) -> usize {
        self.counts.iter().product()
    }

    /// Returns the place of a cell on each axis, x fastest.
    pub(crate) fn place(&self, cell: usize) -> [usize; 3] {
        let [x, y, _] = self.counts;
        [cell % x, cell / x % y, cell / (x * y)]
    }
}

/// The light of the cells.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct IrradianceVolume {
    /// Least corner and cells along x; the same times one over a cell's side and cells along y; zeros and cells along z. Then the
    /// cells, x fastest, each with a quad for each channel: `b`, then `a`.
    quads: Vec<[f32; 4]>,
}

impl IrradianceVolume {
    /// Makes a volume of the light of each cell: `[b, a]` of each channel.
    pub(crate) fn new(cells: &IrradianceCells, light: impl Iterator<Item = [Vec4; 3]>) -> IrradianceVolume {
        let count = cells.counts.map(|count| count as f32);
        let mut quads = vec![
            cells.lo.extend(count[0]).to_array(),
            Vec3::splat(1.0 / cells.side).extend(count[1]).to_array(),
            [0.0, 0.0, 0.0, count[2]],
        ];
        quads.extend(light.flatten().map(|quad| quad.to_array()));
        IrradianceVolume { quads }
    }

    /// Returns the numbers as shaders read them.
    pub(crate) fn quads(&self) -> &[[f32; 4]] {
        &self.quads
    }

    /// Returns the light at a place, `[b, a]` of each channel, trilinear between the middles of cells; beyond them that of the
    /// nearest.
    pub(crate) fn at(&self, position: Vec3) -> [Vec4; 3] {
        let [low, per_unit, last] = [0, 1, 2].map(|quad| Vec4::from(self.quads[quad]));
        let count = Vec3::new(low.w, per_unit.w, last.w);
        let at = (position - low.truncate()) * per_unit.truncate() - 0.5;
        let at = at.max(Vec3::ZERO).min(count - 1.0);
        let first = at.floor();
        let part = at - first;
        let next = (first + 1.0).min(count - 1.0);
        let mut sum = [Vec4::ZERO; 3];
        for corner in 0..8 {
            let (mut place, mut weight) = (first, 1.0);
            for axis in 0..3 {
                let upper = corner >> axis & 1 == 1;
                place[axis] = if upper { next[axis] } else { first[axis] };
                weight *= if upper { part[axis] } else { 1.0 - part[axis] };
            }
            let cell = (place.z as usize * count.y as usize + place.y as usize) * count.x as usize + place.x as usize;
            for (channel, sum) in sum.iter_mut().enumerate() {
                let quad = self.quads[IRRADIANCE_VOLUME_HEAD + IRRADIANCE_VOLUME_QUADS * cell + channel];
                *sum += weight * Vec4::from(quad);
            }
        }
        sum
    }
}

/// Returns about what comes from the direction `towards`, of the light of a [place](IrradianceVolume::at).
pub(crate) fn radiance_from(light: &[Vec4; 3], towards: Vec3) -> Vec3 {
    Vec3::from(light.map(|quad| quad.dot(towards.extend(1.0)))).max(Vec3::ZERO)
}

/// Returns the irradiance over pi of a surface of this normal, of the light of a [place](IrradianceVolume::at).
pub(crate) fn irradiance_of(light: &[Vec4; 3], normal: Vec3) -> Vec3 {
    Vec3::from(light.map(|quad| quad.dot((IRRADIANCE_SLOPE * normal).extend(1.0)))).max(Vec3::ZERO)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler;
    use std::f32::consts::PI;

    const BOX: Bounds = Bounds { lo: Vec3::new(-1.0, 2.0, 3.0), hi: Vec3::new(7.0, 4.0, 3.0) };

    #[test]
    fn cells_are_cubes_that_cover_the_scene() {
        for along in [1, 2, 5, 32] {
            let cells = IrradianceCells::over(BOX, along);
            let hi = cells.lo + cells.side * Vec3::from(cells.counts.map(|count| count as f32));
            assert!(cells.lo.cmplt(BOX.lo).all() && hi.cmpgt(BOX.hi).all(), "{along}: {cells:?}");
            assert!(cells.counts[0] <= along as usize + 1 && cells.counts[0] >= along as usize, "{along}: {cells:?}");
            assert!(cells.counts[2] == 1 && cells.place(cells.count() - 1) == cells.counts.map(|count| count - 1));
        }
        assert_eq!(IrradianceCells::over(Bounds { lo: Vec3::ONE, hi: Vec3::ONE }, 9).counts, [1; 3]);
        assert_eq!(IrradianceCells::over(Bounds::EMPTY, 9).counts, [1; 3]);
        assert_eq!(IrradianceCells::over(Bounds { lo: Vec3::ZERO, hi: Vec3::INFINITY }, 9).counts, [1; 3]);
    }

    /// A light that changes evenly over the scene.
    fn ramp(place: Vec3) -> [Vec4; 3] {
        [0.0, 1.0, 2.0].map(|channel| Vec4::new(place.x, -place.y, 0.5 * place.z, 3.0 + place.x + channel * place.y))
    }

    #[test]
    fn light_between_cells_is_that_of_a_ramp_and_a_moved_grid_is_told_apart() {
        let cells = IrradianceCells::over(Bounds { hi: Vec3::new(7.0, 4.0, 6.0), ..BOX }, 12);
        let volume = |moved: Vec3| {
            let light = |cell| {
                let middle = Vec3::from(cells.place(cell).map(|at| at as f32 + 0.5));
                ramp(cells.lo + cells.side * middle + moved)
            };
            IrradianceVolume::new(&cells, (0..cells.count()).map(light))
        };
        let right = volume(Vec3::ZERO);
        assert_eq!(right.quads().len(), IRRADIANCE_VOLUME_HEAD + IRRADIANCE_VOLUME_QUADS * cells.count());
        let farthest = |volume: &IrradianceVolume| {
            (0..200).fold(0f32, |farthest, i| {
                let share = Vec3::from([0, 1, 2].map(|axis| sampler::one(3 * i + axis)));
                let place = BOX.lo + share * Vec3::new(8.0, 2.0, 3.0);
                let (found, wanted) = (volume.at(place), ramp(place));
                let apart = (0..3).map(|channel| (found[channel] - wanted[channel]).abs().max_element());
                farthest.max(apart.fold(0.0, f32::max))
            })
        };
        assert!(farthest(&right) < 1e-4, "{}", farthest(&right));
        // Planted: a grid that stands half a cell beside.
        assert!(farthest(&volume(Vec3::X * 0.5 * cells.side)) > 0.1);
        assert!(right.at(Vec3::splat(f32::NAN)).iter().all(|quad| quad.is_finite()));
        assert_eq!(right.at(Vec3::splat(1e30)), right.at(BOX.hi + 100.0));
    }

    #[test]
    fn halves_of_light_give_a_surface_what_they_do() {
        // Radiance of an upper and a lower half space, as mean and slope.
        let halves = |above: f32, below: f32| [Vec4::new(0.0, 0.75 * (above - below), 0.0, 0.5 * (above + below)); 3];
        for (above, below) in [(1.0, 1.0), (2.0, 0.0), (0.0, 0.3)] {
            let light = halves(above, below);
            for (normal, wanted) in [(Vec3::Y, above), (Vec3::NEG_Y, below), (Vec3::X, 0.5 * (above + below))] {
                assert!(
                    (irradiance_of(&light, normal) - wanted).abs().max_element() < 1e-6,
                    "{above} {below} {normal}"
                );
            }
        }
        // The mean of what comes from everywhere is that of the cell, and its mean by the cosine the irradiance.
        let light = [Vec4::new(0.3, -0.2, 0.1, 1.0); 3];
        let normal = Vec3::new(0.6, 0.8, 0.0);
        let directions: Vec<Vec3> = (0..4096).map(|i| sampler::sphere(sampler::two(i, 3))).collect();
        let mean = directions.iter().map(|d| radiance_from(&light, *d).x).sum::<f32>() / 4096.0;
        let irradiance = directions.iter().map(|d| radiance_from(&light, *d).x * d.dot(normal).max(0.0)).sum::<f32>();
        let irradiance = irradiance * 4.0 * PI / 4096.0;
        assert!((mean - 1.0).abs() < 1e-3 && (irradiance / (PI * irradiance_of(&light, normal).x) - 1.0).abs() < 2e-3);
    }
}
