//! Radiance of the clear sky: the sun's light scattered once, exactly along each ray of a round earth, and what is
//! scattered again, from the first moments of the radiance at every height and between night and day.
//!
//! Each order of scattering is integrated over all directions from the one before, as in [Bruneton 2008], but kept as
//! spherical harmonics of three degrees instead of a table of directions: air's scattering has no more, and of
//! aerosol's the narrow rest counts as not scattered [Wiscombe 1977]. What aerosol scatters once has its whole lobe
//! [Nakajima 1988].

use crate::light::atmosphere::{
    AEROSOL_MOMENTS, AIR_MOMENTS, Atmosphere, Ray, RayStep, TOP_KM, aerosol_phase, dip_rad, phase_of,
};
use crate::light::solar_spectrum::{BANDS, Spectrum};
use btf_runtime::exp;
use rayon::prelude::*;
use std::f32::consts::{PI, TAU};

/// Heights at which the field is kept, denser below.
const HEIGHTS: usize = 16;
/// Elevations of the sun at which it is kept: that of the place in the middle, denser near it.
const ELEVATIONS: usize = 29;
/// Greatest distance from the middle one: no ray crosses more of the earth.
const MAX_APART_RAD: f32 = 21.0 * PI / 180.0;
/// Directions of a node: from the horizon to the vertical, up and down each, and over half a circle.
const POLAR: usize = 6;
const AZIMUTHS: usize = 4;
/// Orders of scattering that are integrated; later ones shrink as the last two do.
const ORDERS: usize = 4;
/// Steps along the rays of a node, and along those of the sky.
const NODE_STEPS: usize = 24;
const SKY_STEPS: usize = 48;
/// Most that an order has of the one before, where it still grows: light that just comes round into the earth's shadow.
const MAX_RATIO: f32 = 0.8;

/// Middles and weights of the Gauss-Legendre rule on [0, 1] with [`POLAR`] points.
const GAUSS: [[f32; 2]; POLAR] = [
    [0.033_765_24, 0.085_662_246],
    [0.169_395_31, 0.180_380_79],
    [0.380_690_4, 0.233_956_97],
    [0.619_309_6, 0.233_956_97],
    [0.830_604_7, 0.180_380_79],
    [0.966_234_76, 0.085_662_246],
];

/// Spherical harmonics up to the second degree that are even about the plane of the sun.
const HARMONICS: usize = 6;
/// Degree of each.
const DEGREE: [usize; HARMONICS] = [0, 1, 1, 2, 2, 2];

/// The sky of one moment, for unit irradiance of the sun outside the atmosphere in every band.
pub(crate) struct Sky {
    atmosphere: Atmosphere,
    sun_elevation_rad: f32,
    ground_albedo: f32,
    /// Light that was scattered before, all orders.
    scattered: Field,
}

/// The radiance at heights and elevations of the sun, and what arrives at the ground.
#[derive(Clone)]
struct Field {
    /// Coefficients of the radiance's harmonics, `[height][elevation]`.
    harmonics: Vec<[Spectrum; HARMONICS]>,
    /// Irradiance of the level ground, `[elevation]`.
    ground: Vec<Spectrum>,
}

/// The light that a ray gathers.
enum Sources<'a> {
    /// Sunlight, which aerosol scatters with as many moments as a field has.
    Sun,
    /// A field's light.
    Field(&'a Field),
    /// Sunlight, which aerosol scatters with its whole lobe, and a field's light.
    Both(&'a Field),
}

/// A ray and the sun as seen from its start.
struct View {
    ray: Ray,
    /// Of the sun's elevation.
    sun_sine: f32,
    /// Cosine between the ray and the sun.
    towards_sun: f32,
}

impl Sky {
    /// Computes the radiance that the air scatters, without the sun's disc, for a sun at `sun_elevation_rad` over flat
    /// ground of uniform albedo. Takes about 0.3 s of processor time, shared by all cores.
    pub(crate) fn new(atmosphere: Atmosphere, sun_elevation_rad: f32, ground_albedo: f32) -> Sky {
        let nothing = Field { harmonics: Vec::new(), ground: Vec::new() };
        let mut sky = Sky { atmosphere, sun_elevation_rad, ground_albedo, scattered: nothing };
        let mut order = sky.gather(&Sources::Sun);
        let mut all = order.clone();
        for number in 2..=ORDERS {
            let next = sky.gather(&Sources::Field(&order));
            all.add(&next, (number == ORDERS).then_some(&order));
            order = next;
        }
        sky.scattered = all;
        sky
    }

    /// Returns the radiance from a direction above the horizon, over the sun's irradiance outside the atmosphere, 1/sr,
    /// without the sun's disc. `cosine`: from the vertical; `azimuth_rad`: from the sun's.
    pub(crate) fn radiance(&self, cosine: f32, azimuth_rad: f32) -> Spectrum {
        let sun_sine = self.sun_elevation_rad.sin();
        let view = View {
            ray: Ray::new(0.0, cosine.max(0.0), true),
            sun_sine,
            towards_sun: between(cosine, sun_sine, azimuth_rad),
        };
        self.march(&view, &Sources::Both(&self.scattered), SKY_STEPS).map(|x| x.max(0.0))
    }

    /// Returns the share of the sun's irradiance outside the atmosphere that reaches the ground, on a surface that
    /// faces the disc.
    pub(crate) fn sunlight(&self) -> Spectrum {
        let (column, visible) = self.atmosphere.towards_sun(0.0, self.sun_elevation_rad.sin());
        self.atmosphere.transmittance(column).map(|x| x * visible)
    }

    /// Returns the air that scatters.
    pub(crate) fn atmosphere(&self) -> &Atmosphere {
        &self.atmosphere
    }

    /// Gathers the field of the light that `sources` send, once on its way.
    fn gather(&self, sources: &Sources) -> Field {
        let (harmonics, ground): (Vec<_>, Vec<_>) = (0..HEIGHTS * ELEVATIONS)
            .into_par_iter()
            .map(|at| {
                self.gather_at(node_height_km(at / ELEVATIONS), self.node_elevation_rad(at % ELEVATIONS).sin(), sources)
            })
            .unzip();
        Field { harmonics, ground: ground[..ELEVATIONS].to_vec() }
    }

    /// Harmonics of the radiance at a node, and what arrives there on the level.
    fn gather_at(&self, height_km: f32, sun_sine: f32, sources: &Sources) -> ([Spectrum; HARMONICS], Spectrum) {
        let horizon = -dip_rad(height_km).sin();
        let (mut found, mut level) = ([[0.0; BANDS]; HARMONICS], [0.0; BANDS]);
        for (upwards, [share, weight]) in [true, false].into_iter().flat_map(|up| GAUSS.map(|point| (up, point))) {
            // Closest together at the horizon, where twilight is.
            let (range, sign) = if upwards { (1.0 - horizon, 1.0) } else { (1.0 + horizon, -1.0) };
            let cosine = horizon + sign * range * share * share;
            let solid_angle = 2.0 * share * range * weight * TAU / AZIMUTHS as f32;
            let ray = Ray::new(height_km, cosine, upwards);
            for azimuth in 0..AZIMUTHS {
                let towards_sun = between(cosine, sun_sine, PI * (azimuth as f32 + 0.5) / AZIMUTHS as f32);
                let radiance = self.march(&View { ray, sun_sine, towards_sun }, sources, NODE_STEPS);
                let basis = harmonics(cosine, sun_sine, towards_sun);
                for band in 0..BANDS {
                    let light = radiance[band] * solid_angle;
                    for (found, basis) in found.iter_mut().zip(basis) {
                        found[band] += light * basis;
                    }
                    level[band] += light * cosine.max(0.0);
                }
            }
        }
        (found, level)
    }

    /// Marches along a ray and returns the radiance at its start.
    fn march(&self, view: &View, sources: &Sources, steps: usize) -> Spectrum {
        let atmosphere = &self.atmosphere;
        let (sun, field) = match *sources {
            Sources::Sun => (Some(phase_of(AEROSOL_MOMENTS, view.towards_sun)), None),
            Sources::Field(field) => (None, Some(field)),
            Sources::Both(field) => (Some(aerosol_phase(view.towards_sun)), Some(field)),
        };
        let air_phase = phase_of(AIR_MOMENTS, view.towards_sun);
        let (mut radiance, mut left) = ([0.0; BANDS], [1.0; BANDS]);
        for step in view.ray.steps(steps) {
            let [air, ozone, aerosol] = atmosphere.density(step.height_km);
            let sun_sine = view.sun_sine_at(&step);
            // What a kilometre of air and of aerosol sends along the ray, over what they scatter.
            let (mut by_air, mut by_aerosol) = ([0.0; BANDS], [0.0; BANDS]);
            if let Some(aerosol_phase) = sun {
                let (column, visible) = atmosphere.towards_sun(step.height_km, sun_sine);
                if visible > 0.0 {
                    let sunlight = atmosphere.scaled_transmittance(column);
                    by_air = sunlight.map(|x| x * visible * air_phase);
                    by_aerosol = sunlight.map(|x| x * visible * aerosol_phase);
                }
            }
            if let Some(field) = field {
                let basis = harmonics(view.ray.cosine_at(&step), sun_sine, view.towards_sun);
                let degrees = self.degrees_at(field, step.height_km, sun_sine, &basis);
                for degree in 0..3 {
                    for band in 0..BANDS {
                        by_air[band] += AIR_MOMENTS[degree] * degrees[degree][band];
                        by_aerosol[band] += AEROSOL_MOMENTS[degree] * degrees[degree][band];
                    }
                }
            }
            for band in 0..BANDS {
                let scattered_by_air = atmosphere.air[band] * air;
                let source = by_air[band] * scattered_by_air + by_aerosol[band] * atmosphere.aerosol[band] * aerosol;
                let extinction =
                    scattered_by_air + atmosphere.ozone[band] * ozone + atmosphere.aerosol_scaled[band] * aerosol;
                let depth = extinction * step.length_km;
                let passes = exp(-depth);
                // Over which length the step's light still reaches its start: in thin air 1 - passes would be all
                // rounding.
                let length = if depth > 0.02 {
                    (1.0 - passes) / extinction.max(f32::MIN_POSITIVE)
                } else {
                    step.length_km * (1.0 - depth * (0.5 - depth / 6.0))
                };
                radiance[band] += left[band] * source * length;
                left[band] *= passes;
            }
        }
        if view.ray.meets_ground {
            let sent = self.sent_by_ground(view.sun_sine_at(&view.ray.end()), sun.is_some(), field);
            for band in 0..BANDS {
                radiance[band] += left[band] * sent[band];
            }
        }
        radiance
    }

    /// Returns the radiance of the ground where the sun's elevation has this sine, lit by the sun, a field, or both.
    fn sent_by_ground(&self, sun_sine: f32, sunlit: bool, field: Option<&Field>) -> Spectrum {
        let mut irradiance = [0.0; BANDS];
        if let Some(field) = field {
            let (first, along) = self.place(sun_sine);
            let (a, b) = (&field.ground[first], &field.ground[first + 1]);
            irradiance = std::array::from_fn(|band| a[band] + along * (b[band] - a[band]));
        }
        if sunlit {
            let (column, visible) = self.atmosphere.towards_sun(0.0, sun_sine);
            let sunlight = self.atmosphere.scaled_transmittance(column);
            for band in 0..BANDS {
                irradiance[band] += sunlight[band] * visible * sun_sine.max(0.0);
            }
        }
        irradiance.map(|x| x * self.ground_albedo / PI)
    }

    /// Returns the elevation of the sun at a node; beyond the vertical it is that on the other side.
    fn node_elevation_rad(&self, node: usize) -> f32 {
        let middle = (ELEVATIONS / 2) as f32;
        let share = (node as f32 - middle) / middle;
        self.sun_elevation_rad + MAX_APART_RAD * share * share.abs()
    }

    /// Returns between which nodes an elevation lies, and where.
    fn place(&self, sun_sine: f32) -> (usize, f32) {
        let apart = (sun_sine.clamp(-1.0, 1.0).asin() - self.sun_elevation_rad) / MAX_APART_RAD;
        let share = apart.abs().min(1.0).sqrt().copysign(apart);
        let at = (1.0 + share) * (ELEVATIONS / 2) as f32;
        let below = (at as usize).min(ELEVATIONS - 2);
        (below, at - below as f32)
    }

    /// Returns a field's radiance in a direction, by degree.
    #[inline(always)]
    fn degrees_at(&self, field: &Field, height_km: f32, sun_sine: f32, basis: &[f32; HARMONICS]) -> [Spectrum; 3] {
        let (first, along) = self.place(sun_sine);
        let at = (height_km / TOP_KM).clamp(0.0, 1.0).sqrt() * (HEIGHTS - 1) as f32;
        let row = (at as usize).min(HEIGHTS - 2);
        let up = at - row as f32;
        let corner = row * ELEVATIONS + first;
        let corners = [
            (corner, (1.0 - along) * (1.0 - up)),
            (corner + 1, along * (1.0 - up)),
            (corner + ELEVATIONS, (1.0 - along) * up),
            (corner + ELEVATIONS + 1, along * up),
        ];
        let mut degrees = [[0.0; BANDS]; 3];
        for (node, weight) in corners {
            let node = &field.harmonics[node];
            for harmonic in 0..HARMONICS {
                let weight = weight * basis[harmonic];
                for band in 0..BANDS {
                    degrees[DEGREE[harmonic]][band] += weight * node[harmonic][band];
                }
            }
        }
        degrees
    }
}

impl Field {
    /// Adds an order; with the one `before` it, all that follow, too, as a geometric series of their means.
    fn add(&mut self, order: &Field, before: Option<&Field>) {
        let series = |order: f32, before: Option<f32>| {
            let ratio = before.map_or(0.0, |before| order / before.max(f32::MIN_POSITIVE));
            1.0 / (1.0 - ratio.clamp(0.0, MAX_RATIO))
        };
        for (node, all) in self.harmonics.iter_mut().enumerate() {
            for band in 0..BANDS {
                let before = before.map(|before| before.harmonics[node][0][band]);
                let factor = series(order.harmonics[node][0][band], before);
                for harmonic in 0..HARMONICS {
                    all[harmonic][band] += factor * order.harmonics[node][harmonic][band];
                }
            }
        }
        for (node, all) in self.ground.iter_mut().enumerate() {
            for band in 0..BANDS {
                let order = order.ground[node][band];
                all[band] += order * series(order, before.map(|before| before.ground[node][band]));
            }
        }
    }
}

impl View {
    /// Returns the sine of the sun's elevation above the level of a place on the ray.
    fn sun_sine_at(&self, step: &RayStep) -> f32 {
        self.ray.cosine_there(step, self.sun_sine, self.towards_sun)
    }
}

fn node_height_km(node: usize) -> f32 {
    TOP_KM * (node as f32 / (HEIGHTS - 1) as f32).powi(2)
}

/// Returns the cosine between a direction of this cosine from the vertical and the sun, at an azimuth from it.
fn between(cosine: f32, sun_sine: f32, azimuth_rad: f32) -> f32 {
    let across = ((1.0 - cosine * cosine) * (1.0 - sun_sine * sun_sine)).max(0.0).sqrt();
    (cosine * sun_sine + across * azimuth_rad.cos()).clamp(-1.0, 1.0)
}

/// Returns the real harmonics of a direction of this cosine from the vertical (z) where the sun (in x and z) has this
/// sine and lies at the angle of this cosine from it.
fn harmonics(cosine: f32, sun_sine: f32, towards_sun: f32) -> [f32; HARMONICS] {
    let level = (1.0 - sun_sine * sun_sine).max(1e-6).sqrt();
    let widest = (1.0 - cosine * cosine).max(0.0).sqrt();
    let (x, z) = (((towards_sun - cosine * sun_sine) / level).clamp(-widest, widest), cosine);
    // x^2 - y^2 of a unit vector.
    let squares = 2.0 * x * x + z * z - 1.0;
    [
        0.282_094_8,
        0.488_602_5 * z,
        0.488_602_5 * x,
        0.315_391_6 * (3.0 * z * z - 1.0),
        1.092_548_4 * x * z,
        0.546_274_2 * squares,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::atmosphere::{AEROSOL_ALBEDO, AEROSOL_ASYMMETRY, EARTH_RADIUS_KM};
    use crate::light::solar_spectrum::{RgbFromSunlight, WHITE_ILLUMINANCE_LUX, luminance};
    use glam::DVec3;

    /// The sky by random walks from the eye: every scattering with its own density, nothing tabulated, nothing scaled.
    /// Shares the composition of the air with the code above, and nothing else.
    struct Walk<'a> {
        atmosphere: &'a Atmosphere,
        band: usize,
        sun: DVec3,
        ground_albedo: f64,
        state: u64,
    }

    impl Walk<'_> {
        /// A number in [0, 1): SplitMix64.
        fn random(&mut self) -> f64 {
            self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
        }

        /// Scattering of air, that of aerosol, and all extinction, 1/km.
        fn coefficients(&self, position: DVec3) -> [f64; 3] {
            let [air, ozone, aerosol] = self.atmosphere.density((position.length() - EARTH_RADIUS_KM) as f32);
            let at = |spectrum: &Spectrum, density: f32| f64::from(spectrum[self.band] * density);
            let by_aerosol = at(&self.atmosphere.aerosol, aerosol);
            let by_air = at(&self.atmosphere.air, air);
            [by_air, by_aerosol, by_air + at(&self.atmosphere.ozone, ozone) + by_aerosol / f64::from(AEROSOL_ALBEDO)]
        }

        /// Where a ray has passed this optical depth; else where it ends and whether it does so at the ground. Third:
        /// the depth passed.
        fn pass(&self, from: DVec3, towards: DVec3, depth: f64) -> (DVec3, Option<bool>, f64) {
            let (mut position, mut passed) = (from, 0.0);
            loop {
                let height = position.length() - EARTH_RADIUS_KM;
                let step = 0.05 + 0.05 * height.max(0.0);
                let next = position + towards * step;
                let extinction = self.coefficients(position + towards * (0.5 * step))[2];
                if passed + extinction * step >= depth {
                    return (position + towards * ((depth - passed) / extinction), None, depth);
                }
                passed += extinction * step;
                let next_height = next.length() - EARTH_RADIUS_KM;
                if next_height < 0.0 {
                    return (next.normalize() * EARTH_RADIUS_KM, Some(true), passed);
                }
                if next_height > f64::from(TOP_KM) {
                    return (next, Some(false), passed);
                }
                position = next;
            }
        }

        /// What is left of the sun's light at a place.
        fn sunlight(&self, position: DVec3) -> f64 {
            match self.pass(position, self.sun, 60.0) {
                (_, Some(false), passed) => (-passed).exp(),
                _ => 0.0,
            }
        }

        /// A direction at an angle of this cosine from another one, at a random azimuth.
        fn turned(&mut self, from: DVec3, cosine: f64) -> DVec3 {
            let azimuth = std::f64::consts::TAU * self.random();
            let (a, b) = from.any_orthonormal_pair();
            from * cosine + (a * azimuth.cos() + b * azimuth.sin()) * (1.0 - cosine * cosine).max(0.0).sqrt()
        }

        fn scatter(&mut self, towards: DVec3, by_aerosol: bool) -> DVec3 {
            if by_aerosol {
                // Henyey and Greenstein's density, inverted.
                let g = f64::from(AEROSOL_ASYMMETRY);
                let part = (1.0 - g * g) / (1.0 - g + 2.0 * g * self.random());
                return self.turned(towards, (1.0 + g * g - part * part) / (2.0 * g));
            }
            loop {
                let cosine = 2.0 * self.random() - 1.0;
                if self.random() * f64::from(phase_of(AIR_MOMENTS, 1.0))
                    < f64::from(phase_of(AIR_MOMENTS, cosine as f32))
                {
                    return self.turned(towards, cosine);
                }
            }
        }

        /// Mean and standard error of the radiance from a direction.
        fn radiance(&mut self, towards: DVec3, count: usize) -> [f64; 2] {
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..count {
                let found = self.path(towards);
                sum += found;
                squares += found * found;
            }
            let mean = sum / count as f64;
            [mean, ((squares / count as f64 - mean * mean) / count as f64).sqrt()]
        }

        fn path(&mut self, towards: DVec3) -> f64 {
            let mut position = DVec3::new(0.0, EARTH_RADIUS_KM + 1e-4, 0.0);
            let (mut direction, mut weight, mut radiance) = (towards, 1.0, 0.0);
            for _ in 0..200 {
                let depth = -(1.0 - self.random()).ln();
                let (place, end, _) = self.pass(position, direction, depth);
                position = place;
                match end {
                    Some(false) => break,
                    Some(true) => {
                        let up = position.normalize();
                        position += up * 1e-4;
                        weight *= self.ground_albedo;
                        radiance += weight * self.sunlight(position) * up.dot(self.sun).max(0.0) / std::f64::consts::PI;
                        let cosine = self.random().sqrt();
                        direction = self.turned(up, cosine);
                    }
                    None => {
                        let [by_air, by_aerosol, all] = self.coefficients(position);
                        weight *= (by_air + by_aerosol) / all;
                        let towards_sun = direction.dot(self.sun) as f32;
                        let share = by_aerosol / (by_air + by_aerosol);
                        let phase = share * f64::from(aerosol_phase(towards_sun))
                            + (1.0 - share) * f64::from(phase_of(AIR_MOMENTS, towards_sun));
                        radiance += weight * phase * self.sunlight(position);
                        let by_aerosol = self.random() < share;
                        direction = self.scatter(direction, by_aerosol);
                    }
                }
                // Most of the weight is gone: one in four goes on for the others.
                if weight < 0.1 {
                    if self.random() > 0.25 {
                        break;
                    }
                    weight *= 4.0;
                }
            }
            radiance
        }
    }

    fn towards(elevation_deg: f64, azimuth_deg: f64) -> DVec3 {
        let (elevation, azimuth) = (elevation_deg.to_radians(), azimuth_deg.to_radians());
        DVec3::new(elevation.cos() * azimuth.cos(), elevation.sin(), elevation.cos() * azimuth.sin())
    }

    /// Largest difference between the sky and random walks beside four of their standard errors, as a share.
    fn farthest_from_walks(sky: &Sky, atmosphere: &Atmosphere, sun_deg: f64, albedo: f64) -> f64 {
        let mut farthest = 0.0f64;
        for band in [2, 8] {
            for (elevation_deg, azimuth_deg) in [(90.0, 0.0), (30.0, 20.0), (30.0, 180.0), (8.0, 60.0)] {
                let seed = (elevation_deg + 7.0 * azimuth_deg) as u64 + band as u64;
                let sun = towards(sun_deg, 0.0);
                let mut walk = Walk { atmosphere, band, sun, ground_albedo: albedo, state: seed };
                let [expected, error] = walk.radiance(towards(elevation_deg, azimuth_deg), 6000);
                let cosine = (elevation_deg as f32).to_radians().sin();
                let found = f64::from(sky.radiance(cosine, (azimuth_deg as f32).to_radians())[band]);
                farthest = farthest.max(((found - expected).abs() - 4.0 * error) / expected);
            }
        }
        farthest
    }

    #[test]
    fn the_sky_is_that_of_random_walks() {
        for (turbidity, sun_deg, albedo, allowed) in
            [(1.0, 40.0, 0.15, 0.02), (3.0, 30.0, 0.15, 0.03), (3.0, 60.0, 1.0, 0.03), (8.0, 30.0, 0.15, 0.12)]
        {
            let atmosphere = Atmosphere::new(turbidity, 0.0);
            let sky = Sky::new(atmosphere.clone(), (sun_deg as f32).to_radians(), albedo as f32);
            let found = farthest_from_walks(&sky, &atmosphere, sun_deg, albedo);
            assert!(found < allowed, "turbidity {turbidity}, sun at {sun_deg}: {found}");
        }
        // Planted differences: a little more haze, and light that is scattered once only.
        let atmosphere = Atmosphere::new(3.0, 0.0);
        let mut sky = Sky::new(Atmosphere::new(4.0, 0.0), 30f32.to_radians(), 0.15);
        assert!(farthest_from_walks(&sky, &atmosphere, 30.0, 0.15) > 0.1);
        sky.atmosphere = atmosphere.clone();
        sky.scattered.harmonics.fill([[0.0; BANDS]; HARMONICS]);
        assert!(farthest_from_walks(&sky, &atmosphere, 30.0, 0.15) > 0.2);
    }

    const ELEVATIONS_DEG: [f32; 7] = [5.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0];
    const AZIMUTHS_DEG: [f32; 5] = [0.0, 45.0, 90.0, 135.0, 180.0];

    /// Candela per square metre, and lux, in one of the units of linear sRGB; irradiance is over pi.
    const CANDELA: f64 = WHITE_ILLUMINANCE_LUX / std::f64::consts::PI;

    fn luminance_of(spectrum: &Spectrum) -> f64 {
        CANDELA * luminance(RgbFromSunlight::new(1.0).rgb(spectrum).map(f64::from))
    }

    /// Turbidity 3, albedo 0.15: illuminance of a surface that faces the sun, of the level by the sky, and luminances.
    fn figures(sun_deg: f32) -> (f64, f64, Vec<f64>) {
        let sky = Sky::new(Atmosphere::new(3.0, 0.0), sun_deg.to_radians(), 0.15);
        let at = |elevation: f32, azimuth: f32| {
            luminance_of(&sky.radiance(elevation.to_radians().sin(), azimuth.to_radians()))
        };
        let table = ELEVATIONS_DEG.iter().flat_map(|e| AZIMUTHS_DEG.map(|a| at(*e, a))).collect();
        (luminance_of(&sky.sunlight()), level_lux(&sky), table)
    }

    /// Illuminance of the level by the sky.
    fn level_lux(sky: &Sky) -> f64 {
        let (rows, columns) = (16, 24);
        let mut sum = 0.0;
        for row in 0..rows {
            let cosine = ((row as f32 + 0.5) / rows as f32).sqrt();
            for column in 0..columns {
                sum += luminance_of(&sky.radiance(cosine, PI * (column as f32 + 0.5) / columns as f32));
            }
        }
        sum * std::f64::consts::PI / f64::from(rows * columns)
    }

    /// What tests/peers/sky.py prints.
    struct Reference {
        sun_deg: f32,
        sun_lux: f64,
        sky_lux: f64,
        luminance: [[f64; 5]; 7],
    }

    // Mitsuba 3.9.1, sunsky [Hosek 2012], turbidity 3.0, albedo 0.15.
    const HOSEK: [Reference; 3] = [
        Reference {
            sun_deg: 10.0,
            sun_lux: 44886.0,
            sky_lux: 9072.0,
            luminance: [
                [37065.0, 9533.0, 5909.0, 7450.0, 9140.0],
                [20067.0, 6170.0, 4261.0, 4920.0, 5702.0],
                [6440.0, 3572.0, 2733.0, 2938.0, 3231.0],
                [2864.0, 2290.0, 1924.0, 1970.0, 2077.0],
                [1743.0, 1607.0, 1461.0, 1453.0, 1481.0],
                [1290.0, 1260.0, 1215.0, 1198.0, 1198.0],
                [1137.0, 1137.0, 1137.0, 1137.0, 1137.0],
            ],
        },
        Reference {
            sun_deg: 30.0,
            sun_lux: 77071.0,
            sky_lux: 14465.0,
            luminance: [
                [25838.0, 13651.0, 9202.0, 10761.0, 12680.0],
                [21638.0, 9180.0, 6209.0, 6633.0, 7440.0],
                [17741.0, 5983.0, 4038.0, 3957.0, 4203.0],
                [8052.0, 4207.0, 3005.0, 2799.0, 2845.0],
                [3831.0, 3052.0, 2444.0, 2243.0, 2218.0],
                [2521.0, 2377.0, 2154.0, 2024.0, 1988.0],
                [2063.0, 2063.0, 2063.0, 2063.0, 2063.0],
            ],
        },
        Reference {
            sun_deg: 60.0,
            sun_lux: 87773.0,
            sky_lux: 16883.0,
            luminance: [
                [13933.0, 12398.0, 10822.0, 11016.0, 11517.0],
                [10008.0, 8608.0, 7200.0, 6940.0, 7063.0],
                [8244.0, 6276.0, 4842.0, 4396.0, 4340.0],
                [9875.0, 5700.0, 3897.0, 3390.0, 3280.0],
                [12472.0, 5781.0, 3569.0, 3011.0, 2881.0],
                [6566.0, 5014.0, 3614.0, 3078.0, 2940.0],
                [3719.0, 3719.0, 3719.0, 3719.0, 3719.0],
            ],
        },
    ];

    /// Root mean square of the logarithms (base 2) of the ratios, without their mean.
    fn pattern_difference(a: &[f64], b: &[f64]) -> f64 {
        let logs: Vec<f64> = a.iter().zip(b).map(|(a, b)| (a / b).log2()).collect();
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        (logs.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / logs.len() as f64).sqrt()
    }

    /// The standard clear sky, type 12 [CIE S 011]: luminance over that of the zenith.
    fn cie_clear(sun_deg: f64, elevation_deg: f64, azimuth_deg: f64) -> f64 {
        let gradation = |sine: f64| 1.0 - (-0.32 / sine.max(1e-3)).exp();
        let indicatrix = |angle: f64| {
            1.0 + 10.0 * ((-3.0 * angle).exp() - (-1.5 * std::f64::consts::PI).exp()) + 0.45 * angle.cos().powi(2)
        };
        let angle = towards(sun_deg, 0.0).dot(towards(elevation_deg, azimuth_deg)).clamp(-1.0, 1.0).acos();
        indicatrix(angle) * gradation(elevation_deg.to_radians().sin())
            / (indicatrix((90.0 - sun_deg).to_radians()) * gradation(1.0))
    }

    #[test]
    fn the_sky_s_pattern_is_that_of_the_standard_clear_sky_and_near_that_of_hosek() {
        for reference in HOSEK {
            let (sun_lux, sky_lux, found) = figures(reference.sun_deg);
            let cie: Vec<f64> = ELEVATIONS_DEG
                .iter()
                .flat_map(|e| {
                    AZIMUTHS_DEG.map(|a| cie_clear(f64::from(reference.sun_deg), f64::from(*e), f64::from(a)))
                })
                .collect();
            let hosek = reference.luminance.concat();
            let differences = [
                pattern_difference(&found, &cie),
                pattern_difference(&found, &hosek),
                pattern_difference(&hosek, &cie),
            ];
            assert!(
                differences[0] < 0.3 && differences[1] < 0.65 && differences[0] < differences[2],
                "{differences:?}"
            );
            assert!((0.45..1.1).contains(&(sun_lux / reference.sun_lux)), "{sun_lux}");
            assert!((0.95..1.5).contains(&(sky_lux / reference.sky_lux)), "{sky_lux}");
            // Planted difference: the sun stands elsewhere.
            let (.., other) = figures(if reference.sun_deg < 45.0 { reference.sun_deg + 20.0 } else { 30.0 });
            let apart = [pattern_difference(&other, &cie), pattern_difference(&other, &hosek)];
            assert!(apart[0] > 0.4 && apart[1] > 0.7, "{apart:?}");
        }
    }

    #[test]
    fn twilight_is_as_dark_as_published() {
        // Illuminance of the level at the end of civil and of nautical twilight [Seidelmann 1992].
        for (sun_deg, lux) in [(-6.0f32, 3.4), (-12.0, 0.008)] {
            let found = |turbidity: f64, sun_deg: f32| {
                level_lux(&Sky::new(Atmosphere::new(turbidity, 0.0), sun_deg.to_radians(), 0.15))
            };
            assert!((0.8..1.25).contains(&(found(2.0, sun_deg) / lux)), "{sun_deg}: {}", found(2.0, sun_deg));
            // Planted difference: a degree lower.
            assert!(found(2.0, sun_deg - 1.0) / lux < 0.6);
        }
        // Polar night: nothing, and nothing else.
        let night = Sky::new(Atmosphere::new(3.0, 0.0), -0.7, 0.8);
        assert!((0.0..1e-9).contains(&level_lux(&night)) && night.sunlight() == [0.0; BANDS]);
    }

    #[test]
    fn nothing_jumps_as_the_sun_sets() {
        let look = |elevation_deg: f32| {
            let sky = Sky::new(Atmosphere::new(3.0, 0.0), elevation_deg.to_radians(), 0.15);
            let at = |elevation: f32, azimuth: f32| luminance_of(&sky.radiance(elevation.to_radians().sin(), azimuth));
            [at(90.0, 0.0), at(1.0, 0.0), at(10.0, PI), at(20.0, 1.0), luminance_of(&sky.sunlight())]
        };
        for elevation_deg in [-18.0, -6.0, -1.0, -0.27, -0.025, 0.25, 2.0] {
            let (lower, upper) = (look(elevation_deg), look(elevation_deg + 0.05));
            for view in 0..4 {
                let growth = upper[view] / lower[view] - 1.0;
                assert!((0.0..0.08).contains(&growth), "{elevation_deg}: {growth}");
            }
            // Against what the sky gives the level, roughly.
            let growth = (upper[4] - lower[4]) / (std::f64::consts::PI * lower[0]);
            assert!((0.0..0.05).contains(&growth), "{elevation_deg}: {growth}");
        }
    }
}
