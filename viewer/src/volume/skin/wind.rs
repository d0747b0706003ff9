//! Wind: height vectors and texture coordinates as functions of time [Neyret 1995]; the volumes stay as they are.
//!
//! Gusts are carried along at the mean wind's speed as they are [Taylor 1938]. At a place x along the wind and a time t
//! the wind is
//!
//! u = U (1 + g (sin(2 pi s / L) + noise((x - U t w) / L)) / 2), s = x . w - U t,
//!
//! and a height vector leans towards it as what its own weight holds upright: drag, which grows with u^2, against
//! weight gives
//!
//! tan(lean) = (u / u45)^2.
//!
//! The height vector keeps its length. The displacement grows along it, from nothing at the surface. Flutter swings the
//! texture's top within the skin, which needs no other tetrahedra nor another hierarchy of the scene.
//!
//! | Quantity | Unit | Range | Default |
//! |---|---|---|---|
//! | U, mean wind | m/s | 0 to 60 | 5 |
//! | L, length of a gust | m | above 0 | 20 |
//! | g, gustiness | | 0 to 1 | 0.5 |
//! | u45, wind that leans by 45 degrees | m/s | above 0 | 12 |
//! | flutter | texels | 0 to 0.5 | 0 |
//! | flutter's period | s | above 0 | 0.7 |
//!
//! Wrong where stalks swing: they follow the wind at once, without inertia or resonance; and where one shelters the
//! other.

use super::height_noise::Noise;
use super::thick_skin::{Skin, SkinVertex};
use glam::{Quat, Vec3};
use serde::{Deserialize, Deserializer};
use std::f64::consts::TAU;

/// Fastest wind, m/s: a hurricane.
pub(crate) const MAX_WIND_SPEED: f32 = 60.0;
/// Largest flutter, texels: as far as a neighbour's middle.
const MAX_FLUTTER: f32 = 0.5;
/// How much slower flutter swings along v than along u, so that it goes round in no circle.
const SLOWER_ALONG_V: f64 = 0.79;

/// A wind over a skin whose positions are in metres.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Wind {
    /// Mean wind speed, m/s.
    #[serde(rename = "speed")]
    pub speed_m_per_s: f32,
    /// Direction that the wind blows to; any length but zero.
    #[serde(deserialize_with = "vector")]
    pub direction: Vec3,
    /// Distance from gust to gust, m.
    #[serde(rename = "gust_wavelength")]
    pub gust_wavelength_m: f32,
    /// Share by which gusts differ from the mean, 0 to 1.
    pub gustiness: f32,
    /// Wind in which height vectors lean by 45 degrees, m/s.
    #[serde(rename = "leaning_speed")]
    pub leaning_speed_m_per_s: f32,
    /// Largest swing of the texture's top, texels, at `leaning_speed_m_per_s`.
    pub flutter: f32,
    /// Time of a swing, s.
    #[serde(rename = "flutter_period")]
    pub flutter_period_s: f32,
    /// Which gusts.
    pub seed: u32,
}

fn vector<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec3, D::Error> {
    <[f32; 3]>::deserialize(deserializer).map(Vec3::from)
}

impl Default for Wind {
    /// Returns a fresh breeze along x over grass.
    fn default() -> Wind {
        Wind {
            speed_m_per_s: 5.0,
            direction: Vec3::X,
            gust_wavelength_m: 20.0,
            gustiness: 0.5,
            leaning_speed_m_per_s: 12.0,
            flutter: 0.0,
            flutter_period_s: 0.7,
            seed: 0,
        }
    }
}

impl Wind {
    /// Checks the parameters.
    ///
    /// # Errors
    /// A sentence that names the quantity that is out of range.
    pub fn check(&self) -> Result<(), String> {
        let beyond_zero = f32::MIN_POSITIVE;
        for (name, value, least, most, unit) in [
            ("speed", self.speed_m_per_s, 0.0, MAX_WIND_SPEED, "m/s"),
            ("gust wavelength", self.gust_wavelength_m, beyond_zero, f32::MAX, "m"),
            ("gustiness", self.gustiness, 0.0, 1.0, "of the mean"),
            ("leaning speed", self.leaning_speed_m_per_s, beyond_zero, f32::MAX, "m/s"),
            ("flutter", self.flutter, 0.0, MAX_FLUTTER, "texels"),
            ("flutter period", self.flutter_period_s, beyond_zero, f32::MAX, "s"),
        ] {
            if !(least..=most).contains(&value) {
                return Err(format!("the wind's {name} is {value}, and must be {least} to {most} {unit}"));
            }
        }
        match self.direction.try_normalize() {
            Some(_) => Ok(()),
            None => Err(format!("the wind blows to {}, and must blow somewhere", self.direction)),
        }
    }

    /// Returns the wind speed at a place and time, m/s.
    pub fn speed_at(&self, position: Vec3, time_s: f64) -> f32 {
        let to = self.direction.normalize_or_zero();
        let wavelength = f64::from(self.gust_wavelength_m);
        let carried_m = f64::from(self.speed_m_per_s) * time_s;
        let phase = ((f64::from(position.dot(to)) - carried_m) / wavelength).rem_euclid(1.0);
        // The noise repeats along the wind's axes far away, and its lattice stays within what single precision tells
        // apart.
        let lattice = Noise { wavelength: self.gust_wavelength_m, period: [PERIOD; 3], seed: self.seed };
        let carried = to.as_dvec3() * carried_m;
        let repeat = f64::from(PERIOD) * wavelength;
        let moved = carried - (carried / repeat).floor() * repeat;
        let gust = ((TAU * phase).sin() as f32 + lattice.at(position - moved.as_vec3())) / 2.0;
        self.speed_m_per_s * (1.0 + self.gustiness * gust)
    }

    /// Displaces a skin at rest to where the wind has it at a time, seconds. Vertices at one place stay one. Cost: some
    /// noises a vertex.
    ///
    /// # Errors
    /// As [`Wind::check`], and if the time is not finite.
    pub fn displace(&self, rest: &Skin, time_s: f64) -> Result<Skin, String> {
        self.check()?;
        if !time_s.is_finite() {
            return Err(format!("the wind's time is {time_s}, and must be a number of seconds"));
        }
        let to = self.direction.normalize_or_zero();
        let phases = Noise { wavelength: self.gust_wavelength_m, period: [0; 3], seed: self.seed ^ 0x9e37_79b9 };
        Ok(rest.with_vertices(|vertex| {
            let share = self.speed_at(vertex.position, time_s) / self.leaning_speed_m_per_s;
            let height = vertex.height;
            let lean = (share * share).atan().min(height.angle_between(to));
            let turn = match height.cross(to).try_normalize() {
                Some(axis) => Quat::from_axis_angle(axis, lean),
                None => Quat::IDENTITY,
            };
            let swings = time_s / f64::from(self.flutter_period_s);
            let phase = phases.three_at(vertex.position);
            let swing =
                |rate: f64, phase: f32| (TAU * ((swings * rate).rem_euclid(1.0) + f64::from(phase))).sin() as f32;
            let flutter = Vec3::new(swing(1.0, phase.x), swing(SLOWER_ALONG_V, phase.y), 0.0);
            SkinVertex { height: turn * height, rise: vertex.rise + flutter * self.flutter * share.min(1.0), ..*vertex }
        }))
    }
}

/// Gusts after which the noise repeats.
const PERIOD: u32 = 4096;

#[cfg(test)]
mod tests {
    use super::super::shell::Shell;
    use super::super::testing::grid;
    use super::*;

    const WIND: Wind = Wind {
        speed_m_per_s: 6.0,
        direction: Vec3::new(1.0, 0.5, 0.0),
        gust_wavelength_m: 4.0,
        gustiness: 0.8,
        leaning_speed_m_per_s: 8.0,
        flutter: 0.1,
        flutter_period_s: 0.5,
        seed: 2,
    };

    #[test]
    fn gusts_travel_with_the_wind_and_lean_what_they_meet() {
        let to = WIND.direction.normalize();
        for place in [Vec3::ZERO, Vec3::new(3.0, -7.0, 0.4), Vec3::new(0.1, 50.0, 9.0)] {
            // A second later the same gust is 6 m further.
            let (here, later) = (WIND.speed_at(place, 3.0), WIND.speed_at(place + 6.0 * to, 4.0));
            assert!((here - later).abs() < 1e-3, "{here} {later}");
            // Planted: another direction is not where it went.
            assert!((here - WIND.speed_at(place + 6.0 * Vec3::Y, 4.0)).abs() > 1e-2);
        }
        let skin = grid(20, 20);
        let mut speeds = Vec::new();
        for time in [0.0, 0.3, 1e7] {
            let blown = WIND.displace(&skin, time).unwrap();
            for (rest, vertex) in skin.vertices().iter().zip(blown.vertices()) {
                let speed = WIND.speed_at(vertex.position, time);
                speeds.push(speed);
                let lean = rest.height.angle_between(vertex.height);
                assert!((lean.tan() - (speed / 8.0).powi(2)).abs() < 1e-3);
                assert!((vertex.height.length() - 1.0).abs() < 1e-5 && vertex.height.dot(to) >= 0.0);
                assert_eq!((rest.position, rest.texture), (vertex.position, vertex.texture));
                assert!((vertex.rise - rest.rise).abs().max_element() <= 0.1);
            }
        }
        let range = speeds.iter().fold([f32::MAX, f32::MIN], |[a, b], x| [a.min(*x), b.max(*x)]);
        assert!(range[0] >= 6.0 * 0.2 - 1e-4 && range[1] <= 6.0 * 1.8 + 1e-4 && range[1] - range[0] > 4.0, "{range:?}");
    }

    #[test]
    fn a_calm_changes_nothing_a_storm_lays_the_skin_down_and_it_stays_walkable() {
        let skin = grid(4, 4);
        let calm = Wind { speed_m_per_s: 0.0, ..WIND };
        let still = calm.displace(&skin, 5.0).unwrap();
        assert!(still.vertices().iter().zip(skin.vertices()).all(|(a, b)| (a.height - b.height).length() < 1e-6));
        let storm = Wind { speed_m_per_s: 60.0, leaning_speed_m_per_s: 0.01, ..WIND };
        let mut shell = Shell::new(&skin, &Default::default()).unwrap();
        shell.refresh(&storm.displace(&skin, 1.0).unwrap()).unwrap();
        let report = shell.counted();
        assert_eq!(report.tets, 96);
        assert!(shell.positions().iter().all(|position| position.is_finite()));
        for (wind, name) in [
            (Wind { speed_m_per_s: 61.0, ..WIND }, "speed"),
            (Wind { gust_wavelength_m: 0.0, ..WIND }, "gust wavelength"),
            (Wind { gustiness: f32::NAN, ..WIND }, "gustiness"),
            (Wind { direction: Vec3::ZERO, ..WIND }, "blow somewhere"),
        ] {
            assert!(wind.displace(&skin, 0.0).unwrap_err().contains(name), "{name}");
        }
        assert!(WIND.displace(&skin, f64::NAN).is_err());
    }
}
