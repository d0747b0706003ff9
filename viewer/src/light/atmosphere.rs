//! Clear air: what stands above a place on a round earth, and what is left of the sun's light on its way there.
//!
//! | part | vertical optical depth | profile | scatters |
//! |---|---|---|---|
//! | air | [Bodhaine 1999, eq. 30], 0.097 at 550 nm | US Standard Atmosphere 1976 | Rayleigh with depolarisation |
//! | ozone | 300 Dobson units, cross sections of [Serdyuchenko 2014] at 233 K | triangle, 10 to 40 km | nothing |
//! | aerosol | Angstrom's law from turbidity [Preetham 1999] | exponential, 1.2 km | Henyey-Greenstein |
//!
//! Wrong where: water vapour and oxygen absorb (beyond 680 nm), for smoke, dust and cities, under any cloud, for the
//! polarised part of the light (a few per cent of radiance in pure air).

use crate::light::solar_spectrum::{BANDS, Spectrum, band_nm};
use btf_runtime::exp;
use rayon::prelude::*;
use std::f32::consts::PI;

/// Mean radius of the earth.
pub(crate) const EARTH_RADIUS_KM: f64 = 6371.0;
/// Above it nothing is left: a millionth of the air.
pub(crate) const TOP_KM: f32 = 100.0;

/// Logarithm of the air's density over that at sea level, every 5 km from 0 to 100 km [US Standard Atmosphere 1976].
#[rustfmt::skip]
const LN_AIR_DENSITY: [f32; 21] = [
    0.0, -0.5089, -1.0860, -1.8390, -2.6231, -3.4197, -4.1978, -4.9749, -5.7255, -6.4346, -7.0841,
    -7.6762, -8.2829, -8.9237, -9.6017, -10.3316, -11.1029, -11.9119, -12.7899, -13.6868, -14.5975,
];
const AIR_STEP_KM: f32 = 5.0;

/// Depolarisation factor of air [Bodhaine 1999]: King factor 1.0480 at 550 nm.
const DEPOLARISATION: f32 = 0.0279;

/// Scale height of aerosol, km [Bruneton 2008].
const AEROSOL_SCALE_KM: f64 = 1.2;
/// Share of what aerosol takes away that it scatters: between continental average (0.93) and clean (0.97) [Hess 1998].
pub(crate) const AEROSOL_ALBEDO: f32 = 0.95;
/// Mean cosine of the angle that aerosol scatters by: continental [Hess 1998].
pub(crate) const AEROSOL_ASYMMETRY: f32 = 0.70;
/// Share of its scattering that counts as none, because it goes so nearly ahead that three moments do not tell it from
/// light that passed: the fourth moment [Wiscombe 1977].
const AEROSOL_AHEAD: f32 = AEROSOL_ASYMMETRY * AEROSOL_ASYMMETRY * AEROSOL_ASYMMETRY;

/// Middle and half width of the ozone layer, and its column [Bruneton 2017].
const OZONE_MIDDLE_KM: f32 = 25.0;
const OZONE_HALF_WIDTH_KM: f64 = 15.0;
/// Molecules: 300 Dobson units of 2.687e20.
const OZONE_PER_M2: f64 = 300.0 * 2.687e20;

/// Cross section of ozone at 233 K, mean of 20 nm about each band [Serdyuchenko 2014].
#[rustfmt::skip]
const OZONE_CROSS_SECTION_M2: [f64; BANDS] = [
    1.095e-27, 4.142e-27, 1.2136e-26, 2.9925e-26, 6.338e-26, 1.1908e-25, 1.8705e-25, 2.923e-25, 3.883e-25, 4.535e-25,
    4.86e-25, 4.0225e-25, 2.9385e-25, 2.045e-25, 1.341e-25, 8.439e-26,
];

/// Half of the sun's mean angular diameter, 0.533 degrees.
pub(crate) const SUN_RADIUS_RAD: f32 = 0.004_652;

/// Amounts of air, ozone and aerosol: km of each at its greatest density.
pub(crate) type Column = [f32; 3];

/// The air above a place.
#[derive(Debug, Clone)]
pub(crate) struct Atmosphere {
    /// Height of the ground above sea level.
    ground_km: f32,
    /// Scattering of air, 1/km at sea level.
    pub(crate) air: Spectrum,
    /// Absorption of ozone, 1/km at its greatest density.
    pub(crate) ozone: Spectrum,
    /// Scattering and extinction of aerosol, 1/km at sea level.
    pub(crate) aerosol: Spectrum,
    aerosol_extinction: Spectrum,
    /// Extinction of aerosol without what it scatters on ahead (see [`Atmosphere::scaled_transmittance`]).
    pub(crate) aerosol_scaled: Spectrum,
    /// Columns towards the sun, `[height][elevation]`.
    columns: Vec<Column>,
}

/// Nodes of the table of columns.
const HEIGHTS: usize = 33;
const ELEVATIONS: usize = 129;
/// Largest angle above the horizon, which lies 10 degrees low at the top.
const MAX_ABOVE_HORIZON_RAD: f32 = 101.0 * PI / 180.0;
/// Steps of a column's integral.
const COLUMN_STEPS: usize = 64;

impl Atmosphere {
    /// Returns the atmosphere above a ground at `ground_km` over sea level; `turbidity` is from 1 (air alone) to 10.
    /// Cost: some 30 ms of one core.
    pub(crate) fn new(turbidity: f64, ground_km: f64) -> Atmosphere {
        let nm = band_nm();
        let air_column_km = air_column_km();
        let aerosol_extinction = nm.map(|nm| (aerosol_optical_depth(turbidity, nm) / AEROSOL_SCALE_KM) as f32);
        let aerosol = aerosol_extinction.map(|x| x * AEROSOL_ALBEDO);
        let mut atmosphere = Atmosphere {
            ground_km: ground_km as f32,
            air: nm.map(|nm| (air_optical_depth(nm) / air_column_km) as f32),
            ozone: OZONE_CROSS_SECTION_M2.map(|m2| (OZONE_PER_M2 * m2 / OZONE_HALF_WIDTH_KM) as f32),
            aerosol,
            aerosol_extinction,
            aerosol_scaled: std::array::from_fn(|band| aerosol_extinction[band] - AEROSOL_AHEAD * aerosol[band]),
            columns: Vec::new(),
        };
        atmosphere.columns = (0..HEIGHTS * ELEVATIONS)
            .into_par_iter()
            .map(|at| {
                let share = |i: usize, nodes: usize| (i as f32 / (nodes - 1) as f32).powi(2);
                let height_km = TOP_KM * share(at / ELEVATIONS, HEIGHTS);
                let above_rad = MAX_ABOVE_HORIZON_RAD * share(at % ELEVATIONS, ELEVATIONS);
                atmosphere.column(height_km, (above_rad - dip_rad(height_km)).sin())
            })
            .collect();
        atmosphere
    }

    /// Returns the densities of air, ozone and aerosol at a height above the ground, as shares of their greatest
    /// densities.
    pub(crate) fn density(&self, height_km: f32) -> Column {
        let above_sea_km = height_km + self.ground_km;
        let ozone = 1.0 - (above_sea_km - OZONE_MIDDLE_KM).abs() / OZONE_HALF_WIDTH_KM as f32;
        [air_density(above_sea_km), ozone.max(0.0), exp(-height_km / AEROSOL_SCALE_KM as f32)]
    }

    /// Returns the column from a height to the top along a ray of this cosine from the vertical, which meets no ground.
    fn column(&self, height_km: f32, cosine: f32) -> Column {
        let ray = Ray::new(height_km, cosine, true);
        let mut column = [0.0; 3];
        for step in ray.steps(COLUMN_STEPS) {
            let density = self.density(step.height_km);
            for part in 0..3 {
                column[part] += density[part] * step.length_km;
            }
        }
        column
    }

    /// Returns the column towards the sun from a height, and how much of the disc stands above the earth's edge, 0 to
    /// 1. `sine`: of the elevation of the disc's middle there.
    ///
    /// Interpolated: what passes is within 0.01 of the integral's (a test). Of a disc that is cut the column is that to
    /// the middle of what is left.
    pub(crate) fn towards_sun(&self, height_km: f32, sine: f32) -> (Column, f32) {
        let above_rad = sine.clamp(-1.0, 1.0).asin() + dip_rad(height_km);
        let visible = visible_share(above_rad);
        if visible <= 0.0 {
            return ([0.0; 3], 0.0);
        }
        let above_rad = middle_above_horizon_rad(above_rad);
        let place = |share: f32, nodes: usize| {
            let at = share.clamp(0.0, 1.0).sqrt() * (nodes - 1) as f32;
            let below = (at as usize).min(nodes - 2);
            (below, at - below as f32)
        };
        let (row, down) = place(height_km / TOP_KM, HEIGHTS);
        let (first, along) = place(above_rad / MAX_ABOVE_HORIZON_RAD, ELEVATIONS);
        let at = row * ELEVATIONS + first;
        let [a, b, c, d] = [at, at + 1, at + ELEVATIONS, at + ELEVATIONS + 1].map(|at| self.columns[at]);
        let mix = |a: f32, b: f32, share: f32| a + share * (b - a);
        (std::array::from_fn(|part| mix(mix(a[part], b[part], along), mix(c[part], d[part], along), down)), visible)
    }

    /// Returns the share that a column leaves of each band of a narrow beam.
    pub(crate) fn transmittance(&self, column: Column) -> Spectrum {
        std::array::from_fn(|band| {
            exp(-(self.air[band] * column[0]
                + self.ozone[band] * column[1]
                + self.aerosol_extinction[band] * column[2]))
        })
    }

    /// Returns [`Atmosphere::transmittance`] where light that aerosol scatters ahead counts as not scattered [Nakajima
    /// 1988].
    #[inline(always)]
    pub(crate) fn scaled_transmittance(&self, column: Column) -> Spectrum {
        std::array::from_fn(|band| {
            exp(-(self.air[band] * column[0] + self.ozone[band] * column[1] + self.aerosol_scaled[band] * column[2]))
        })
    }
}

/// A straight way through the air from a height, to the top or to the ground.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    height_km: f32,
    cosine: f32,
    /// To its end.
    pub(crate) length_km: f32,
    /// Whether the ground ends the ray.
    pub(crate) meets_ground: bool,
}

/// A piece of a [`Ray`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct RayStep {
    /// Distance from the ray's start to the middle of the step.
    pub(crate) distance_km: f32,
    pub(crate) length_km: f32,
    /// Height of the step's middle above the ground.
    pub(crate) height_km: f32,
}

impl Ray {
    /// Returns the ray from `height_km` with this cosine from the vertical. `grazes` says that it passes the ground
    /// even if rounding says that it meets it.
    pub(crate) fn new(height_km: f32, cosine: f32, grazes: bool) -> Ray {
        // In double precision: a metre counts in the lowest haze, and is 2e-7 of the radius.
        let (radius, cosine_64) = (EARTH_RADIUS_KM + f64::from(height_km), f64::from(cosine));
        let half = radius * cosine_64;
        let above_ground = f64::from(height_km) * (radius + EARTH_RADIUS_KM);
        let meets_ground = !grazes && cosine < 0.0 && half * half >= above_ground;
        let length = if meets_ground {
            -half - (half * half - above_ground).sqrt()
        } else {
            let top = EARTH_RADIUS_KM + f64::from(TOP_KM);
            let below_top = (top - radius) * (top + radius);
            (half * half + below_top.max(0.0)).sqrt() - half
        };
        Ray { height_km, cosine, length_km: length.max(0.0) as f32, meets_ground }
    }

    /// Returns the height at a distance.
    fn height_at_km(&self, distance_km: f32) -> f32 {
        let (start, s, cosine) = (f64::from(self.height_km), f64::from(distance_km), f64::from(self.cosine));
        let radius = EARTH_RADIUS_KM + start;
        // r^2 - R^2, without the difference of large numbers.
        let square = start * (radius + EARTH_RADIUS_KM) + s * (s + 2.0 * radius * cosine);
        (square / ((EARTH_RADIUS_KM * EARTH_RADIUS_KM + square).sqrt() + EARTH_RADIUS_KM)).max(0.0) as f32
    }

    /// Returns the cosine from the vertical of a place on the ray, of a direction that has the cosine `vertical` from
    /// the vertical at the ray's start and `along` from the ray.
    pub(crate) fn cosine_there(&self, place: &RayStep, vertical: f32, along: f32) -> f32 {
        let radius = EARTH_RADIUS_KM as f32;
        ((radius + self.height_km) * vertical + place.distance_km * along) / (radius + place.height_km)
    }

    /// Returns the cosine between the ray and the vertical of a place on it.
    pub(crate) fn cosine_at(&self, place: &RayStep) -> f32 {
        self.cosine_there(place, self.cosine, 1.0).clamp(-1.0, 1.0)
    }

    /// Returns the distance at which the ray ends.
    pub(crate) fn end(&self) -> RayStep {
        RayStep { distance_km: self.length_km, length_km: 0.0, height_km: self.height_at_km(self.length_km) }
    }

    /// Divides the ray into pieces that are shortest at both ends, where the air may be thick.
    pub(crate) fn steps(self, count: usize) -> impl Iterator<Item = RayStep> {
        let at = move |i: usize| {
            let share = i as f32 / count as f32;
            self.length_km * share * share * (3.0 - 2.0 * share)
        };
        (0..count).map(move |i| {
            let (from, to) = (at(i), at(i + 1));
            let distance_km = 0.5 * (from + to);
            RayStep { distance_km, length_km: to - from, height_km: self.height_at_km(distance_km) }
        })
    }
}

/// Returns how far below the level the horizon lies at a height above the ground.
pub(crate) fn dip_rad(height_km: f32) -> f32 {
    let radius = EARTH_RADIUS_KM as f32;
    ((height_km * (2.0 * radius + height_km)).sqrt() / (radius + height_km)).asin()
}

/// Returns how much of the sun's disc stands above the horizon, whose middle is `above_rad` above it.
pub(crate) fn visible_share(above_rad: f32) -> f32 {
    let x = (above_rad / SUN_RADIUS_RAD).clamp(-1.0, 1.0);
    0.5 + (x * (1.0 - x * x).sqrt() + x.asin()) / PI
}

/// Returns the height above the horizon of the middle between the upper edge and what cuts the disc below.
pub(crate) fn middle_above_horizon_rad(above_rad: f32) -> f32 {
    if above_rad < SUN_RADIUS_RAD { (0.5 * (above_rad + SUN_RADIUS_RAD)).max(0.0) } else { above_rad }
}

/// Second Legendre moment of Rayleigh's scattering, 0.1 without depolarisation [Bucholtz 1995, eq. 12].
const AIR_MOMENT: f32 = {
    let g = DEPOLARISATION / (2.0 - DEPOLARISATION);
    0.1 * (1.0 - g) / (1.0 + 2.0 * g)
};

/// The first three Legendre moments of what air scatters.
pub(crate) const AIR_MOMENTS: [f32; 3] = [1.0, 0.0, AIR_MOMENT];

/// The first three of what aerosol scatters, without what counts as not scattered: not divided by the rest.
pub(crate) const AEROSOL_MOMENTS: [f32; 3] = {
    let g = AEROSOL_ASYMMETRY;
    [1.0 - AEROSOL_AHEAD, g - AEROSOL_AHEAD, g * g - AEROSOL_AHEAD]
};

/// Returns a density of scattering of these moments by the cosine of its angle, 1/sr.
pub(crate) fn phase_of(moments: [f32; 3], cosine: f32) -> f32 {
    (moments[0] + 3.0 * moments[1] * cosine + 2.5 * moments[2] * (3.0 * cosine * cosine - 1.0)) / (4.0 * PI)
}

/// Returns the density of aerosol's whole scattering by the cosine of its angle, 1/sr [Henyey 1941].
pub(crate) fn aerosol_phase(cosine: f32) -> f32 {
    let g = AEROSOL_ASYMMETRY;
    (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cosine).powf(1.5))
}

/// Returns the density of air at a height above sea level, over that at sea level.
fn air_density(above_sea_km: f32) -> f32 {
    let at = (above_sea_km / AIR_STEP_KM).min((LN_AIR_DENSITY.len() - 1) as f32);
    let below = (at.max(0.0) as usize).min(LN_AIR_DENSITY.len() - 2);
    let (low, high) = (LN_AIR_DENSITY[below], LN_AIR_DENSITY[below + 1]);
    exp(low + (at - below as f32) * (high - low))
}

/// Kilometres of air at sea level's density above sea level: the exact integral of exponentials between the table's
/// heights.
fn air_column_km() -> f64 {
    let step = |pair: &[f32]| {
        let (low, high) = (f64::from(pair[0]), f64::from(pair[1]));
        f64::from(AIR_STEP_KM) * (low.exp() - high.exp()) / (low - high)
    };
    LN_AIR_DENSITY.windows(2).map(step).sum()
}

/// Returns the optical depth of the air above sea level [Bodhaine 1999, eq. 30].
fn air_optical_depth(nm: f64) -> f64 {
    let square = (nm / 1000.0).powi(2);
    0.002_152_0 * (1.045_599_6 - 341.290_61 / square - 0.902_308_50 * square)
        / (1.0 + 0.002_705_988_9 / square - 85.968_563 * square)
}

/// Returns the optical depth of the aerosol above the ground. Differs from [Preetham 1999, appendix A.1], 0.04608 T -
/// 0.04586, by the constant: turbidity 1 is pure air.
fn aerosol_optical_depth(turbidity: f64, nm: f64) -> f64 {
    0.046_08 * (turbidity - 1.0) * (nm / 1000.0).powf(-1.3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn air_is_as_dense_and_as_thick_as_published() {
        // [US Standard Atmosphere 1976], kg/m^3 over 1.225, at heights that the table lacks.
        for (km, density) in [(1.0, 0.9075), (3.0, 0.7423), (11.0, 0.2971), (32.0, 0.01107), (71.0, 5.85e-5)] {
            assert!((air_density(km) / density - 1.0).abs() < 0.03, "{km} km: {}", air_density(km));
        }
        assert!((air_column_km() - 8.44).abs() < 0.05, "{}", air_column_km());
        // [Hansen 1974, eq. 2.30]: another fit of other measurements.
        for nm in band_nm() {
            let square = (nm / 1000.0f64).powi(-2);
            let expected = 0.008_569 * square * square * (1.0 + 0.0113 * square + 0.000_13 * square * square);
            assert!((air_optical_depth(nm) / expected - 1.0).abs() < 0.01, "{nm} nm: {}", air_optical_depth(nm));
        }
        assert_eq!(aerosol_optical_depth(1.0, 550.0), 0.0);
        assert!((aerosol_optical_depth(3.0, 550.0) - 0.2).abs() < 0.005);
    }

    #[test]
    fn columns_grow_towards_the_horizon_as_published() {
        let atmosphere = Atmosphere::new(3.0, 0.0);
        let air =
            |elevation_deg: f64| f64::from(atmosphere.towards_sun(0.0, elevation_deg.to_radians().sin() as f32).0[0]);
        // [Kasten 1989]; its rays are bent.
        for (elevation_deg, allowed) in
            [(90.0, 0.005), (60.0, 0.005), (30.0, 0.005), (10.0, 0.01), (5.0, 0.02), (1.0, 0.06)]
        {
            let expected = 1.0
                / (f64::sin(f64::to_radians(elevation_deg)) + 0.505_72 * f64::powf(elevation_deg + 6.079_95, -1.6364));
            let found = air(elevation_deg) / air(90.0);
            assert!((found / expected - 1.0).abs() < allowed, "{elevation_deg}: {found} {expected}");
        }
        assert!((air(90.0) / air_column_km() - 1.0).abs() < 0.005, "{}", air(90.0));
    }

    #[test]
    fn the_table_of_columns_is_their_integral() {
        let atmosphere = Atmosphere::new(3.0, 0.0);
        let farthest = |turned_deg: f32| {
            let mut farthest = 0.0f32;
            for height_km in [0.0, 0.3, 1.7, 9.0, 24.0, 61.0] {
                for above_deg in [0.3f32, 0.9, 3.3, 12.0, 41.0, 88.0] {
                    let elevation = above_deg.to_radians() - dip_rad(height_km);
                    let (found, visible) =
                        atmosphere.towards_sun(height_km, (elevation + turned_deg.to_radians()).sin());
                    assert_eq!(visible, 1.0);
                    let found = atmosphere.transmittance(found);
                    let expected = atmosphere.transmittance(atmosphere.column(height_km, elevation.sin()));
                    for band in 0..BANDS {
                        farthest = farthest.max((found[band] - expected[band]).abs());
                    }
                }
            }
            farthest
        };
        assert!(farthest(0.0) < 0.01, "{}", farthest(0.0));
        // Planted difference.
        assert!(farthest(0.2) > 0.02, "{}", farthest(0.2));
    }

    #[test]
    fn scattering_is_a_density_of_the_moments_that_are_named() {
        let moments = |phase: &dyn Fn(f32) -> f32| {
            let (steps, mut found) = (20_000, [0.0f64; 3]);
            for i in 0..steps {
                let x = 2.0 * (i as f32 + 0.5) / steps as f32 - 1.0;
                let part = f64::from(phase(x)) * 4.0 * std::f64::consts::PI / f64::from(steps);
                for (found, legendre) in found.iter_mut().zip([1.0, x, 1.5 * x * x - 0.5]) {
                    *found += part * f64::from(legendre);
                }
            }
            found.map(|x| x as f32)
        };
        let near = |a: [f32; 3], b: [f32; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-4);
        let g = AEROSOL_ASYMMETRY;
        assert!(near(moments(&aerosol_phase), [1.0, g, g * g]));
        assert!(near(moments(&|x| phase_of(AIR_MOMENTS, x)), AIR_MOMENTS));
        assert!(near(moments(&|x| phase_of(AEROSOL_MOMENTS, x)), AEROSOL_MOMENTS));
        // Never negative, and as bright ahead as behind for air.
        assert!((0..=100).all(|i| phase_of(AEROSOL_MOMENTS, i as f32 / 50.0 - 1.0) > 0.0));
        assert!((phase_of(AIR_MOMENTS, 1.0) / phase_of(AIR_MOMENTS, 0.0) - 1.945).abs() < 0.01);
    }

    #[test]
    fn the_disc_sets_without_a_step() {
        assert_eq!([-2.0, 0.0, 2.0].map(|x| visible_share(x * SUN_RADIUS_RAD)), [0.0, 0.5, 1.0]);
        assert_eq!(middle_above_horizon_rad(-SUN_RADIUS_RAD), 0.0);
        assert_eq!(middle_above_horizon_rad(SUN_RADIUS_RAD), SUN_RADIUS_RAD);
        let shares: Vec<f32> = (-50..=50).map(|i| visible_share(i as f32 / 45.0 * SUN_RADIUS_RAD)).collect();
        assert!(shares.windows(2).all(|pair| (0.0..0.02).contains(&(pair[1] - pair[0]))));
    }
}
