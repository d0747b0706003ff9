//! Analytic covariances between direction pairs, beside those that are learnt from materials: they know nothing but that
//! near directions look alike, and keep a prediction sane where a material is unlike every material of the priors.

use btf_runtime::Sphere;

/// Exponent of the light's cosine in the standard deviation: a sample is a reflectance times that cosine, in a curve that is
/// about a square root.
const COSINE_EXPONENT: f64 = 0.4;
/// Least cosine of the light in that.
const MIN_COSINE: f64 = 0.05;

/// An analytic covariance. Distances are angles in radians; each falls as `exp(-distance / scale)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kernel {
    /// One value at all pairs but for the light's cosine.
    Constant,
    /// Falls with the distance between the views and with that between the lights, at this scale.
    Separable(f64),
    /// Falls with the distance between the half vectors, at the first scale, and with the difference of the angles between
    /// half vector and light, at the second.
    Half(f64, f64),
    /// Noise of each pair's own.
    Noise,
}

/// The kernels that are tried.
pub const KERNELS: [Kernel; 8] = [
    Kernel::Constant,
    Kernel::Separable(1.5),
    Kernel::Separable(0.5),
    Kernel::Separable(0.2),
    Kernel::Half(0.1, f64::INFINITY),
    Kernel::Half(0.25, 0.3),
    Kernel::Half(0.6, 0.3),
    Kernel::Noise,
];

/// What kernels take of each pair.
#[derive(Debug, Clone)]
pub struct PairGeometry {
    lights: usize,
    /// Distances between views `[a * views + b]` and between lights, radians.
    view_angles: Vec<f64>,
    light_angles: Vec<f64>,
    views: usize,
    /// Unit half vector of each pair.
    halves: Vec<[f64; 3]>,
    /// Angle between half vector and light of each pair, radians.
    differences: Vec<f64>,
    /// Standard deviation of each light.
    deviations: Vec<f64>,
}

impl PairGeometry {
    /// Computes what kernels take, for all pairs of `views` and `lights`.
    pub fn new(views: &Sphere, lights: &Sphere) -> PairGeometry {
        let units = |sphere: &Sphere| -> Vec<[f64; 3]> {
            (0..sphere.len() as u32).map(|id| sphere.direction(id).map(f64::from)).collect()
        };
        let (views, lights) = (units(views), units(lights));
        let angles = |units: &[[f64; 3]]| -> Vec<f64> {
            units.iter().flat_map(|a| units.iter().map(|b| angle(*a, *b))).collect()
        };
        let halves: Vec<[f64; 3]> = views
            .iter()
            .flat_map(|view| lights.iter().map(|light| normalized([0, 1, 2].map(|i| view[i] + light[i]))))
            .collect();
        let differences =
            halves.iter().enumerate().map(|(pair, half)| angle(*half, lights[pair % lights.len()])).collect();
        let deviations = lights.iter().map(|light| light[2].max(MIN_COSINE).powf(COSINE_EXPONENT)).collect();
        let (view_angles, light_angles) = (angles(&views), angles(&lights));
        PairGeometry {
            lights: lights.len(),
            views: views.len(),
            view_angles,
            light_angles,
            halves,
            differences,
            deviations,
        }
    }

    /// Returns the number of pairs.
    pub fn pair_count(&self) -> usize {
        self.halves.len()
    }

    /// Returns the covariance of `kernel` between the pairs `a` and `b`.
    pub fn covariance(&self, kernel: Kernel, a: usize, b: usize) -> f64 {
        let ([av, al], [bv, bl]) = ([a / self.lights, a % self.lights], [b / self.lights, b % self.lights]);
        let correlation = match kernel {
            Kernel::Constant => 1.0,
            Kernel::Separable(scale) => {
                let sum = self.view_angles[av * self.views + bv] + self.light_angles[al * self.lights + bl];
                (-sum / scale).exp()
            }
            Kernel::Half(half_scale, difference_scale) => {
                let apart = angle(self.halves[a], self.halves[b]) / half_scale;
                (-apart - (self.differences[a] - self.differences[b]).abs() / difference_scale).exp()
            }
            Kernel::Noise => return if a == b { 1.0 } else { 0.0 },
        };
        correlation * self.deviations[al] * self.deviations[bl]
    }
}

fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]).clamp(-1.0, 1.0).acos()
}

fn normalized(v: [f64; 3]) -> [f64; 3] {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    // Light and eye opposite each other, both on the horizon, have no half vector; the normal is as good as any.
    if length > 1e-9 { v.map(|x| x / length) } else { [0.0, 0.0, 1.0] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_capture::DirectionSet;
    use nalgebra::DMatrix;

    #[test]
    fn kernels_are_covariances_that_fall_with_distance() {
        let sphere = |seed| Sphere::new(&DirectionSet::random(7, seed).unwrap().units()).unwrap();
        let geometry = PairGeometry::new(&sphere(1), &sphere(2));
        for kernel in KERNELS {
            let matrix = DMatrix::from_fn(49, 49, |a, b| geometry.covariance(kernel, a, b));
            assert!((matrix.transpose() - &matrix).abs().max() < 1e-12, "{kernel:?}");
            let least = matrix.clone().symmetric_eigenvalues().min();
            assert!(least > -1e-9, "{kernel:?} has the eigenvalue {least}");
            for a in 0..49 {
                assert!((0..49).all(|b| matrix[(a, b)].powi(2) <= matrix[(a, a)] * matrix[(b, b)] * (1.0 + 1e-12)));
            }
        }
        let near = geometry.covariance(Kernel::Separable(0.2), 0, 1);
        assert!(near < geometry.covariance(Kernel::Separable(1.5), 0, 1));
    }
}
