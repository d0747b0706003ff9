//! Ray marching through a volume under lights far away: what passes and what is reflected along a ray.

use crate::model::microflakes::luminance;
use crate::rays::along_ray::{Seen, depth_along, seen_along};
use crate::rays::projection::spread_directions;
use btf_runtime::voltex::{LevelShadow, Sym3, Voltex};
use glam::Vec3;

/// Parameters of looking at a volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MarchParams {
    /// Rays along each side of a pixel.
    pub rays: usize,
    /// Voxels along each side of a pixel, as a binary logarithm: best as many as rays.
    pub finer: u32,
    /// Rule by which microflakes reflect.
    pub reflection: Reflection,
}

impl Default for MarchParams {
    fn default() -> MarchParams {
        MarchParams { rays: 2, finer: 1, reflection: Reflection::ClosedForm }
    }
}

/// Rule by which the light of a voxel's microflakes is summed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reflection {
    /// The closed form, [`shade`](btf_runtime::voltex::shade).
    ClosedForm,
    /// A sum over normals of the ellipsoid that the microflakes are spread on [Neyret 1996].
    Ellipsoid,
}

/// Normals that an ellipsoid's light is summed over.
const NORMALS: usize = 64;

/// A volume that rays march through.
pub struct March<'a> {
    voltex: &'a Voltex,
    level: u32,
    /// Side of a voxel.
    side: f32,
    shadow: LevelShadow,
    /// For sums over ellipsoids.
    ellipsoids: Option<Ellipsoids>,
}

/// The matrix of each voxel that makes an ellipsoid of a sphere, and the sphere's normals.
type Ellipsoids = (Vec<Sym3>, Vec<Vec3>);

impl March<'_> {
    /// Prepares rays through `level` of a volume.
    pub fn new(voltex: &Voltex, level: u32, reflection: Reflection) -> March<'_> {
        let ellipsoids = (reflection == Reflection::Ellipsoid).then(|| {
            // The moment is S to the power of 3/4; an ellipsoid of extinction S is the sphere under its root.
            let root = |number| voltex.voxel(number).moment.mapped(|x| x.max(0.0).powf(2.0 / 3.0));
            ((0..voltex.voxel_count() as u32).map(root).collect(), spread_directions(NORMALS, 0.0))
        });
        March { voltex, level, side: voltex.voxel_side(level), shadow: voltex.shadow(level), ellipsoids }
    }

    /// Returns the share of light that passes a ray, and adds to `seen` the luminance that is seen under each of
    /// `lights`; 1 is a white surface lit along its normal.
    pub fn ray(&self, origin: Vec3, direction: Vec3, lights: &[Vec3], seen: &mut [f32]) -> f32 {
        let eye = -direction;
        seen_along(self.voltex, self.level, origin, direction, |part| {
            for (light, seen) in lights.iter().zip(&mut *seen) {
                let diffuse = match &self.ellipsoids {
                    Some(ellipsoids) => self.light_of_ellipsoids(ellipsoids, part, eye, *light),
                    None => part.diffuse(self.voltex, eye, *light),
                };
                let value = diffuse + part.specular(self.voltex, self.level, eye, *light);
                let towards = part.towards(self.voltex, *light).normalize_or_zero() * self.side;
                let depth = depth_along(self.voltex, self.level, part.at + towards * self.shadow.offset, *light);
                let apart = 1.0 - self.shadow.shared_at(light.dot(eye));
                let brighter = self.voltex.brighter_between(self.level, eye.into(), (*light).into());
                *seen += brighter * part.weight * value * (-apart * depth).exp();
            }
        })
    }

    /// Returns the luminance that a part of a ray sends on evenly, summed over the normals of ellipsoids.
    fn light_of_ellipsoids(&self, (roots, normals): &Ellipsoids, part: &Seen, eye: Vec3, light: Vec3) -> f32 {
        let value = self.voltex.microflakes(part.number).map(|(number, voxel)| {
            let material = self.voltex.material(voxel.material);
            let shown = voxel.extinction_along(eye.into());
            let [same, other] = ellipsoid_light(&roots[number as usize], normals, eye, light).map(|x| x * shown);
            luminance(material.reflectance) * same + luminance(material.transmittance) * other
        });
        value.sum::<f32>() / part.sigma
    }
}

/// Returns the light that microflakes in view, spread on an ellipsoid, reflect from a light on their side and transmit
/// from a light on the other: means over the area in view.
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
    use btf_runtime::voltex::shade;

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
