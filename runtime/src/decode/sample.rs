//! Importance sampling: directions to light drawn where the lobes of a texel are large for an eye, with their density.
//! Twin: `decode/sample.wgsl`.
//!
//! Half of the directions follow the cosine, because a residual may be anywhere; the others follow one of the texel's
//! lobes, chosen by its weight and by what it sends to the eye. Lobes over a half vector are drawn from the facets of a
//! GGX of the same roughness that the eye sees [Heitz 2018; Dupuy 2023], whose tails are above those of the other
//! families, so that value over density stays bounded; Lafortune's from a power of the cosine about its axis. A
//! direction may lie below the horizon, where every value is 0: the density is over the whole sphere.

use crate::asset::lobe::{LobeFamily, LobeSetup, power, schlick};
use crate::decode::texel::lobe_weights;
use crate::decode::viewed_texel::ViewedTexel;
use crate::numeric::power::exp;
use crate::numeric::vector::{cross, dot};
use std::f32::consts::{PI, TAU};

/// Share of the directions that follow the cosine of the texel's own normal.
pub const COSINE_SHARE: f32 = 0.5;
/// Least roughness that half vectors are drawn with.
pub const MIN_ALPHA: f32 = 0.02;
/// Length below which a Lafortune lobe has no axis.
pub const MIN_AXIS: f32 = 1e-3;
/// Least share of the light that a lobe with a Fresnel term is taken to reflect.
pub const MIN_FRESNEL: f32 = 0.02;
/// Lower clamp of a half vector's cosine with the normal, before it is made a unit vector.
pub const MIN_FACET_COS: f32 = 1e-6;

/// Returns the roughness along tangent and bitangent of a family over a half vector, and 0 for the others.
fn sample_alpha(lobe: &LobeSetup) -> [f32; 2] {
    let [p0, p1, ..] = lobe.params;
    let of_exponent = |s: f32| (2.0 / (s + 2.0)).sqrt();
    let alpha = match lobe.family {
        LobeFamily::BlinnPhong => [of_exponent(p0); 2],
        LobeFamily::Ward => [p0, p1],
        LobeFamily::CookTorrance | LobeFamily::Ggx => [p0; 2],
        LobeFamily::AshikhminShirley => [of_exponent(p0), of_exponent(p1)],
        _ => return [0.0; 2],
    };
    alpha.map(|a| a.max(MIN_ALPHA))
}

/// Returns the axis of a Lafortune lobe in its own frame, and the axis' length.
fn sample_axis(lobe: &LobeSetup, wo: [f32; 3]) -> ([f32; 3], f32) {
    let bitangent = cross(lobe.normal, lobe.tangent);
    let [x, y, z] = [dot(lobe.tangent, wo), dot(bitangent, wo), dot(lobe.normal, wo)];
    let a = [lobe.params[0] * x, lobe.params[1] * y, lobe.params[2] * z];
    let length = dot(a, a).sqrt();
    (a.map(|x| x / length.max(MIN_AXIS)), length)
}

/// Returns the direction to the eye in the lobe's frame, in which the facets are stretched to those of a sphere.
fn sample_stretched(lobe: &LobeSetup, wo: [f32; 3], a: [f32; 2]) -> [f32; 3] {
    let bitangent = cross(lobe.normal, lobe.tangent);
    [a[0] * dot(lobe.tangent, wo), a[1] * dot(bitangent, wo), dot(lobe.normal, wo)]
}

/// Turns a vector from the lobe's frame to the layer's.
fn sample_world(lobe: &LobeSetup, v: [f32; 3]) -> [f32; 3] {
    let bitangent = cross(lobe.normal, lobe.tangent);
    [0, 1, 2].map(|i| lobe.tangent[i] * v[0] + bitangent[i] * v[1] + lobe.normal[i] * v[2])
}

/// Draws a direction about +z with the density `(exponent + 1) / (2 pi) cos^exponent`.
pub(crate) fn sample_about_z(exponent: f32, at: [f32; 2]) -> [f32; 3] {
    let cos = at[0].max(1e-12).powf(1.0 / (exponent + 1.0));
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    [sin * (TAU * at[1]).cos(), sin * (TAU * at[1]).sin(), cos]
}

/// Turns a vector by the rotation that takes +z to the unit vector `axis` [Duff 2017].
fn sample_turned(v: [f32; 3], axis: [f32; 3]) -> [f32; 3] {
    let sign = if axis[2] < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (sign + axis[2]);
    let b = axis[0] * axis[1] * a;
    let x = [1.0 + sign * axis[0] * axis[0] * a, sign * b, -sign * axis[0]];
    let y = [b, sign + axis[1] * axis[1] * a, -axis[1]];
    [0, 1, 2].map(|i| x[i] * v[0] + y[i] * v[1] + axis[i] * v[2])
}

/// Draws a direction to the light for one lobe and an eye at `wo`, from two numbers in [0, 1). The result is unit and
/// anywhere on the sphere.
pub fn sample_lobe_direction(lobe: &LobeSetup, wo: [f32; 3], at: [f32; 2]) -> [f32; 3] {
    let a = sample_alpha(lobe);
    if a[0] > 0.0 {
        // The facets are those of a sphere that is stretched: a point of the cap that the stretched eye sees.
        let eye = sample_stretched(lobe, wo, a);
        let length = dot(eye, eye).sqrt();
        let eye = eye.map(|x| x / length);
        let cos = (1.0 - at[0]) * (1.0 + eye[2]) - eye[2];
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let h = [sin * (TAU * at[1]).cos() + eye[0], sin * (TAU * at[1]).sin() + eye[1], cos + eye[2]];
        let h = [a[0] * h[0], a[1] * h[1], h[2].max(MIN_FACET_COS)];
        let length = dot(h, h).sqrt();
        let h = sample_world(lobe, h.map(|x| x / length));
        let twice = 2.0 * dot(wo, h);
        return [0, 1, 2].map(|i| twice * h[i] - wo[i]);
    }
    if lobe.family == LobeFamily::Lafortune {
        let (axis, length) = sample_axis(lobe, wo);
        if length > MIN_AXIS {
            return sample_world(lobe, sample_turned(sample_about_z(lobe.params[3], at), axis));
        }
    }
    sample_world(lobe, sample_about_z(1.0, at))
}

/// Returns the density of [`sample_lobe_direction`] at the unit vector `wi`, per steradian.
pub fn sample_lobe_density(lobe: &LobeSetup, wi: [f32; 3], wo: [f32; 3]) -> f32 {
    let a = sample_alpha(lobe);
    if a[0] > 0.0 {
        let sum = [0, 1, 2].map(|i| wi[i] + wo[i]);
        let length = dot(sum, sum).sqrt();
        if length < 1e-4 {
            // The half vector is undefined; the density there is that of its lobe's rim.
            return 0.0;
        }
        let side = if dot(lobe.normal, sum) < 0.0 { -1.0 } else { 1.0 };
        let h = sum.map(|x| side * x / length);
        let bitangent = cross(lobe.normal, lobe.tangent);
        let [x, y, z] = [dot(lobe.tangent, h) / a[0], dot(bitangent, h) / a[1], dot(lobe.normal, h)];
        let q = x * x + y * y + z * z;
        let d = 1.0 / (PI * a[0] * a[1] * (q * q).max(1e-12));
        // Twice what the facets that the eye sees cover, projected on the plane across it. Both forms are equal; the
        // second does not cancel where the eye is below the lobe's horizon.
        let eye = sample_stretched(lobe, wo, a);
        let [across, length] = [eye[0] * eye[0] + eye[1] * eye[1], dot(eye, eye).sqrt()];
        let seen = if eye[2] > 0.0 { eye[2] + length } else { across / (length - eye[2]) };
        return if dot(wo, h) > 0.0 { d / (2.0 * seen.max(1e-12)) } else { 0.0 };
    }
    if lobe.family == LobeFamily::Lafortune {
        let (axis, length) = sample_axis(lobe, wo);
        if length > MIN_AXIS {
            let exponent = lobe.params[3];
            return (exponent + 1.0) / TAU * power(dot(sample_world(lobe, axis), wi).max(0.0), exponent);
        }
    }
    dot(lobe.normal, wi).max(0.0) / PI
}

/// Returns about the share of a white sky that a lobe of weight 1 sends to the eye.
fn sample_share(lobe: &LobeSetup, wo: [f32; 3]) -> f32 {
    let [p0, p1, p2, p3] = lobe.params;
    let fresnel = |f0: f32| schlick(f0, dot(lobe.normal, wo)).max(MIN_FRESNEL);
    match lobe.family {
        LobeFamily::CookTorrance | LobeFamily::Ggx => fresnel(p1),
        LobeFamily::AshikhminShirley => fresnel(p2),
        LobeFamily::Lafortune => {
            // The cosine of the axis stands for that of the directions about it, of which half are above the horizon
            // where it is 0.
            let (axis, length) = sample_axis(lobe, wo);
            let width = 1.0 / (p3 + 2.0);
            2.0 * width * power(length.min(1.0), p3) * axis[2].max(width.sqrt())
        }
        LobeFamily::WindowedCosine => exp((p0 * (dot([p1, p2, p3], wo) - 1.0)).max(-80.0)),
        _ => 1.0,
    }
}

impl ViewedTexel<'_> {
    /// Returns the texel's lobes and their importance: the mean of the weights, times what the lobe sends to the eye.
    fn sampled_lobes(&self) -> impl Iterator<Item = (LobeSetup, f32)> {
        let t = self.texel();
        t.lobes_of(t.dictionary(t.edit)).map(|(words, reference)| {
            let lobe = LobeSetup::from_resident_words(words);
            (lobe, lobe_weights(words, reference).iter().sum::<f32>() / 3.0 * sample_share(&lobe, self.eye()))
        })
    }

    /// Draws a direction to light that matters to this eye, in the texel's frame, from three numbers in [0, 1). It may
    /// lie on another side than the layer's, where the value is 0.
    pub fn sample_direction(&self, at: [f32; 3]) -> [f32; 3] {
        let lobes = self.texel().lobes;
        let total: f32 = self.sampled_lobes().map(|(_, importance)| importance).sum();
        let side = self.light_sign();
        let mut wi = sample_about_z(1.0, [at[0], at[1]]);
        if total > 0.0 && at[2] >= COSINE_SHARE {
            let mut rest = (at[2] - COSINE_SHARE) / (1.0 - COSINE_SHARE) * total;
            for (slot, (lobe, importance)) in self.sampled_lobes().enumerate() {
                if rest < importance || slot + 1 == lobes {
                    wi = sample_lobe_direction(&lobe, self.eye(), [at[0], at[1]]);
                    break;
                }
                rest -= importance;
            }
        }
        [wi[0], wi[1], wi[2] * side]
    }

    /// Returns the density of [`ViewedTexel::sample_direction`] at the unit vector `wi`, per steradian; its integral
    /// over the whole sphere is 1.
    pub fn sample_density(&self, wi: [f32; 3]) -> f32 {
        let wi = [wi[0], wi[1], wi[2] * self.light_sign()];
        let cosine = wi[2].max(0.0) / PI;
        let (mut sum, mut total) = (0.0, 0.0);
        for (lobe, importance) in self.sampled_lobes() {
            sum += importance * sample_lobe_density(&lobe, wi, self.eye());
            total += importance;
        }
        if total > 0.0 { COSINE_SHARE * cosine + (1.0 - COSINE_SHARE) * sum / total } else { cosine }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::asset::asset::SurfaceSide;
    use crate::asset::lobe::Lobe;
    use crate::asset::residual::ResidualKind;
    use crate::decode::options::DecodeOptions;
    use crate::resident::resident::Resident;
    use crate::testing::{Random, direction_from_degrees, random_lobe, sample_asset};

    const ROWS: usize = 24;
    const COLUMNS: usize = 48;

    fn bin(d: [f32; 3]) -> usize {
        let row = (((d[2] + 1.0) * 0.5 * ROWS as f32) as usize).min(ROWS - 1);
        let column = ((d[1].atan2(d[0]) / TAU + 0.5) * COLUMNS as f32) as usize;
        row * COLUMNS + column.min(COLUMNS - 1)
    }

    /// Returns the probability of each bin: the density integrated over it by midpoints.
    fn expected(density: impl Fn([f32; 3]) -> f32) -> Vec<f64> {
        const FINE: usize = 24;
        let mut bins = vec![0.0; ROWS * COLUMNS];
        let cell = 4.0 * std::f64::consts::PI / (ROWS * COLUMNS * FINE * FINE) as f64;
        for i in 0..ROWS * FINE {
            let z = -1.0 + 2.0 * (i as f32 + 0.5) / (ROWS * FINE) as f32;
            let r = (1.0 - z * z).sqrt();
            for j in 0..COLUMNS * FINE {
                let (sin, cos) = (TAU * ((j as f32 + 0.5) / (COLUMNS * FINE) as f32 - 0.5)).sin_cos();
                bins[i / FINE * COLUMNS + j / FINE] += f64::from(density([r * cos, r * sin, z])) * cell;
            }
        }
        bins
    }

    /// Returns the deviation of Pearson's statistic from its mean, in standard deviations [Wilson and Hilferty 1931];
    /// bins that expect fewer than 5 samples are joined.
    fn chi_squared(bins: &[f64], counts: &[u32], samples: f64) -> f64 {
        let (mut statistic, mut freedom, mut rest) = (0.0, -1.0f64, (0.0, 0.0));
        for (p, count) in bins.iter().zip(counts) {
            let (e, n) = (p * samples, f64::from(*count));
            if e < 5.0 {
                rest = (rest.0 + e, rest.1 + n);
            } else {
                statistic += (n - e) * (n - e) / e;
                freedom += 1.0;
            }
        }
        if rest.0 >= 5.0 {
            statistic += (rest.1 - rest.0) * (rest.1 - rest.0) / rest.0;
            freedom += 1.0;
        } else {
            assert!(rest.1 <= rest.0 + 30.0, "{rest:?}: samples where the density is none");
        }
        let c = 2.0 / (9.0 * freedom);
        ((statistic / freedom).cbrt() - (1.0 - c)) / c.sqrt()
    }

    /// Returns the deviation of samples from their density in standard deviations, and the density's integral.
    pub(crate) fn deviation(
        sample: impl Fn([f32; 3]) -> [f32; 3],
        density: impl Fn([f32; 3]) -> f32,
        seed: u64,
    ) -> (f64, f64) {
        const SAMPLES: u32 = 60_000;
        let mut random = Random::new(seed);
        let mut counts = vec![0; ROWS * COLUMNS];
        for _ in 0..SAMPLES {
            let wi = sample([random.within(0.0, 1.0), random.within(0.0, 1.0), random.within(0.0, 1.0)]);
            assert!((dot(wi, wi) - 1.0).abs() < 1e-3, "{wi:?}");
            counts[bin(wi)] += 1;
        }
        let bins = expected(density);
        (chi_squared(&bins, &counts, f64::from(SAMPLES)), bins.iter().sum())
    }

    #[test]
    fn lobes_are_drawn_with_the_density_that_they_tell() {
        let mut random = Random::new(5);
        for family in LobeFamily::ALL {
            for i in 0..3 {
                let mut lobe = random_lobe(&mut random, family);
                // As wide as the bins that the test integrates over.
                for p in &mut lobe.params {
                    *p = match family {
                        LobeFamily::Ward | LobeFamily::CookTorrance | LobeFamily::Ggx => p.max(0.4),
                        LobeFamily::BlinnPhong | LobeFamily::AshikhminShirley => p.min(20.0),
                        LobeFamily::Lafortune => p.min(30.0),
                        _ => *p,
                    };
                }
                // Where the eye is at the lobe's horizon the density is infinite opposite to it: integrable, not by
                // midpoints.
                lobe.normal_xy = lobe.normal_xy.map(|x| 0.5 * x);
                let lobe: Lobe = lobe.clamped();
                let setup = lobe.setup();
                let wo = direction_from_degrees([5.0, 35.0, 60.0][i], 35.0 + 100.0 * i as f64);
                let sample = |at: [f32; 3]| sample_lobe_direction(&setup, wo, [at[0], at[1]]);
                let (z, sum) = deviation(sample, |wi| sample_lobe_density(&setup, wi, wo), 40 + i as u64);
                assert!(z < 4.5 && (sum - 1.0).abs() < 0.01, "{lobe:?}: {z} sigma, sum {sum}");
                // Planted difference: a lobe about another normal.
                let mut other = setup;
                other.normal = direction_from_degrees(35.0, 200.0);
                other.tangent = direction_from_degrees(90.0, 290.0);
                let (z, _) = deviation(sample, |wi| sample_lobe_density(&other, wi, wo), 40 + i as u64);
                assert!(z > 10.0, "{lobe:?}: {z}");
            }
        }
    }

    #[test]
    fn texels_are_sampled_with_their_density_on_both_sides() {
        let mut asset = sample_asset(9, 6, 5, ResidualKind::Root);
        for lobe in asset.layers[0].dictionary.iter_mut().flatten() {
            if matches!(lobe.lobe.family, LobeFamily::Ward | LobeFamily::CookTorrance | LobeFamily::Ggx) {
                lobe.lobe.params[0] = 0.4;
                lobe.lobe.params[1] = 0.5;
            } else if lobe.lobe.family != LobeFamily::WindowedCosine {
                lobe.lobe.params = lobe.lobe.params.map(|p| p.min(12.0));
            }
        }
        for side in [SurfaceSide::Front, SurfaceSide::Back] {
            asset.layers[0].light_side = side;
            let resident = Resident::from_asset(&asset);
            for texel in [0, 7, 19] {
                let wo = direction_from_degrees(40.0, 110.0);
                let viewed = ViewedTexel::new(&resident, 0, texel, wo, &DecodeOptions::default());
                let (z, sum) =
                    deviation(|at| viewed.sample_direction(at), |wi| viewed.sample_density(wi), 70 + u64::from(texel));
                assert!(z < 4.5 && (sum - 1.0).abs() < 0.01, "{side:?} {texel}: {z} sigma, sum {sum}");
                let (z, _) = deviation(
                    |at| viewed.sample_direction([at[0], at[1], 0.9 * at[2]]),
                    |wi| viewed.sample_density(wi),
                    70 + u64::from(texel),
                );
                assert!(z > 10.0, "planted: a lobe that is drawn too seldom, {z}");
            }
        }
    }
}
