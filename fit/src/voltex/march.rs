//! What an eye sees of a volume along a ray, under lights far away: what passes and what is reflected.

use super::projection::spread_directions;
use super::shadow::{END, depth_towards};
use btf_runtime::voltex::{LevelShadow, NO_VOXEL, Sym3, Voltex, VoltexRay, Walk, seen_at, shade};
use glam::Vec3;

/// How a volume is looked at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarchParams {
    /// Rays along each side of a pixel.
    pub rays: usize,
    /// Voxels along each side of a pixel, as a binary logarithm: 1 for voxels of half a pixel.
    pub finer: u32,
    /// How flakes reflect.
    pub reflection: Reflection,
}

impl Default for MarchParams {
    fn default() -> MarchParams {
        MarchParams { rays: 2, finer: 1, reflection: Reflection::ClosedForm }
    }
}

/// How the light of a voxel's flakes is summed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reflection {
    /// [`shade`].
    ClosedForm,
    /// Over normals of the ellipsoid that the flakes are spread on [Neyret 1996].
    Ellipsoid,
}

/// Normals that an ellipsoid's light is summed over.
const NORMALS: usize = 64;

/// A volume to look at.
pub struct March<'a> {
    voltex: &'a Voltex,
    level: u32,
    /// Side of a voxel.
    side: f32,
    shadow: LevelShadow,
    /// Where light is summed over ellipsoids: of each voxel the matrix that makes a sphere one, and the sphere's normals.
    ellipsoids: Option<(Vec<Sym3>, Vec<Vec3>)>,
}

impl March<'_> {
    /// At `level` of a volume.
    pub fn new(voltex: &Voltex, level: u32, reflection: Reflection) -> March<'_> {
        let ellipsoids = (reflection == Reflection::Ellipsoid).then(|| {
            // The moment is S to the power of 3/4; an ellipsoid of extinction S is the sphere under its root.
            let root = |number| voltex.voxel(number).moment.mapped(|x| x.max(0.0).powf(2.0 / 3.0));
            ((0..voltex.voxel_count() as u32).map(root).collect(), spread_directions(NORMALS, 0.0))
        });
        let side = (1u32 << level) as f32 / (1u32 << voltex.level_count()) as f32;
        March { voltex, level, side, shadow: voltex.shadow(level), ellipsoids }
    }

    /// The share of light that passes a ray, and, added to `seen`, what it sees under each of `lights`; 1 is a white
    /// surface lit along its normal.
    pub fn ray(&self, origin: Vec3, direction: Vec3, lights: &[Vec3], seen: &mut [f32]) -> f32 {
        let d = direction.to_array();
        let ray = VoltexRay { origin: origin.into(), direction: d };
        let mut walk = Walk::new(ray, 0.0, 4.0, self.voltex.level_count());
        let mut through = 1.0;
        while let Some(segment) = walk.next(self.voltex, self.level) {
            if segment.cell.voxel == NO_VOXEL {
                continue;
            }
            let voxel = self.voltex.voxel(segment.cell.voxel);
            let sigma = voxel.extinction.form(d, d).max(0.0).sqrt();
            let length = segment.t1 - segment.t0;
            let alpha = 1.0 - (-sigma * length).exp();
            if alpha <= 0.0 {
                continue;
            }
            let material = self.voltex.material(voxel.material);
            let grey = |rgb: [f32; 3]| (rgb[0] + rgb[1] + rgb[2]) / 3.0;
            let at = origin + direction * (segment.t0 + seen_at(sigma * length, length));
            for (light, seen) in lights.iter().zip(&mut *seen) {
                let [same, other] = match &self.ellipsoids {
                    Some((roots, normals)) => {
                        ellipsoid_light(&roots[segment.cell.voxel as usize], normals, -direction, *light)
                    }
                    None => shade(&voxel.moment, (-direction).into(), (*light).into()).map(|sum| sum / sigma),
                };
                let value = grey(material.reflectance) * same + grey(material.transmittance) * other;
                let towards = Vec3::from(voxel.moment.times((*light).into())).normalize_or_zero() * self.side;
                let depth = depth_towards(self.voltex, self.level, at + towards * self.shadow.offset, *light);
                let apart = 1.0 - self.shadow.shared_at(light.dot(-direction));
                *seen += through * alpha * value * (-apart * depth).exp();
            }
            through *= 1.0 - alpha;
            if through < END {
                return 0.0;
            }
        }
        through
    }
}

/// Of flakes spread on an ellipsoid, the light that those in view send on, where it comes from their side and from the other:
/// means over what they show.
fn ellipsoid_light(root: &Sym3, normals: &[Vec3], v: Vec3, l: Vec3) -> [f32; 2] {
    let (mut sums, mut shown) = ([0.0; 2], 0.0);
    for normal in normals {
        let q = Vec3::from(root.times((*normal).into()));
        let product = q.dot(v) * q.dot(l) / q.length().max(1e-30);
        sums[usize::from(product < 0.0)] += product.abs();
        shown += q.dot(v).abs();
    }
    sums.map(|sum| sum / shown.max(1e-30))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ellipsoid_s_light_is_the_closed_form_s_where_that_is_exact() {
        let normals = spread_directions(20_000, 0.0);
        let isotropic = Sym3([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
        let flat = Sym3([0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
        let (v, l) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.6, -0.8));
        for (moment, sigma) in [(isotropic, 1.5), (flat, v.z.abs())] {
            let found = ellipsoid_light(&moment, &normals, v, l);
            let expected = shade(&moment, v.into(), l.into()).map(|sum| sum / sigma);
            let apart = |a: [f32; 2]| (a[0] - expected[0]).abs().max((a[1] - expected[1]).abs());
            assert!(apart(found) < 1e-3, "{found:?} {expected:?}");
            // Planted difference: the sides taken for each other.
            assert!(apart([found[1], found[0]]) > 0.1, "{found:?}");
        }
    }
}
