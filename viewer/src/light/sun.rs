//! Where the sun stands, and what of its light arrives.

use glam::Vec3;
use solar_positioning::time::JulianDate;
use solar_positioning::{Location, SolarPositions, delta_t};
use std::f64::consts::PI;

/// Mean angular diameter of the sun's disc.
pub const SUN_DIAMETER_DEG: f32 = 0.533;

/// Height in which the pressure falls to 1 / e, near the ground.
const PRESSURE_SCALE_M: f64 = 8400.0;

/// The sun as a light at infinity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sun {
    /// Unit vector towards the middle of what is visible of the disc: +y is up, -z north, +x east.
    pub direction: Vec3,
    /// Angular diameter of the disc, degrees.
    pub angular_diameter_deg: f32,
    /// Irradiance on a surface that faces the sun at the ground, through the air: linear sRGB; pi makes a white
    /// diffuser 1. Goes to 0 without a step as the disc sets.
    pub irradiance: [f32; 3],
}

/// The position of the sun in a sky.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SunPosition {
    /// Azimuth from north over east, 0 to 360 degrees.
    pub azimuth_deg: f64,
    /// Elevation of the disc's middle over the level as one sees it, with refraction, degrees.
    pub elevation_deg: f64,
    /// Elevation without refraction by air, degrees.
    pub geometric_elevation_deg: f64,
    /// Distance from the earth to the sun, in astronomical units.
    pub distance_au: f64,
}

impl SunPosition {
    /// Returns the unit vector towards the sun: +y is up, -z north, +x east.
    pub fn direction(&self) -> Vec3 {
        direction(self.azimuth_deg, self.elevation_deg)
    }
}

/// Returns the unit vector of an azimuth (from north over east) and an elevation: +y is up, -z north, +x east.
pub(crate) fn direction(azimuth_deg: f64, elevation_deg: f64) -> Vec3 {
    let (azimuth, elevation) = (azimuth_deg * PI / 180.0, elevation_deg * PI / 180.0);
    let level = elevation.cos();
    Vec3::new((level * azimuth.sin()) as f32, elevation.sin() as f32, (-level * azimuth.cos()) as f32)
}

/// Returns a moment in days: `year`, `month`, `day`, `hour`, `minute`, `second` on a clock that is `offset_minutes`
/// ahead of UTC.
///
/// # Errors
/// What is wrong with the date or the time.
pub(crate) fn julian_date(
    [year, month, day]: [u32; 3],
    [hour, minute]: [u32; 2],
    second: f64,
    offset_minutes: i32,
) -> Result<JulianDate, solar_positioning::Error> {
    let delta_t_s = delta_t::estimate(f64::from(year) + (f64::from(month) - 0.5) / 12.0)?;
    // A leap second counts as the one before.
    let local = JulianDate::from_utc(year as i32, month, day, hour, minute, second.min(59.999), delta_t_s)?;
    JulianDate::new(local.julian_date() - f64::from(offset_minutes) / (24.0 * 60.0), delta_t_s)
}

/// Computes where the sun stands, by NREL's SPA [Reda 2004] (0.0003 degrees) and refraction of standard air
/// [Saemundsson 1986] (some 0.1 minutes of arc; at the horizon weather makes more).
///
/// # Errors
/// What is wrong with the place or the time.
pub(crate) fn sun_position(
    date: JulianDate,
    [latitude_deg, longitude_deg]: [f64; 2],
    height_m: f64,
) -> Result<SunPosition, solar_positioning::Error> {
    let prepared = SolarPositions::new().for_time_from_julian(date)?;
    let place = Location { latitude: latitude_deg, longitude: longitude_deg };
    let position = prepared.at(place, height_m, None)?;
    let geometric_elevation_deg = position.elevation_angle();
    Ok(SunPosition {
        azimuth_deg: position.azimuth(),
        elevation_deg: geometric_elevation_deg + refraction_deg(geometric_elevation_deg, height_m),
        geometric_elevation_deg,
        distance_au: prepared.earth_radius_vector().unwrap_or(1.0),
    })
}

/// Returns how much higher air lifts what stands at a geometric elevation, at 10 degrees Celsius and standard pressure
/// [Saemundsson 1986].
///
/// Differs from the source below -1 degree, where it is no longer meant: there the lift fades to 0 at -6 degrees,
/// because twilight's light comes through high, thin air. So it has no step anywhere.
fn refraction_deg(geometric_deg: f64, height_m: f64) -> f64 {
    let elevation = geometric_deg.max(-1.0);
    let minutes = 1.02 / ((elevation + 10.3 / (elevation + 5.11)) * PI / 180.0).tan();
    let fade = ((geometric_deg + 6.0) / 5.0).clamp(0.0, 1.0);
    minutes.max(0.0) / 60.0 * fade * (-height_m / PRESSURE_SCALE_M).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn position(date: [u32; 3], hour: u32, place: [f64; 2]) -> SunPosition {
        sun_position(julian_date(date, [hour, 0], 0.0, 0).unwrap(), place, 0.0).unwrap()
    }

    #[test]
    fn the_worked_example_of_spa_comes_out() {
        // [Reda 2004, appendix A.5]: 12:30:30 at UTC - 7, 1830.14 m.
        let place = [39.742_476, -105.178_6];
        let date = julian_date([2003, 10, 17], [12, 30], 30.0, -7 * 60).unwrap();
        let found = sun_position(date, place, 1830.14).unwrap();
        assert!((found.azimuth_deg - 194.340_24).abs() < 1e-3, "{found:?}");
        assert!((found.geometric_elevation_deg - 39.872_046).abs() < 1e-3, "{found:?}");
        // Its pressure and temperature are its own.
        assert!((90.0 - found.elevation_deg - 50.111_62).abs() < 2e-3, "{found:?}");
        assert!((found.distance_au - 0.996_542_297_4).abs() < 1e-6, "{found:?}");
        // Planted difference: the offset's other sign.
        let wrong = julian_date([2003, 10, 17], [12, 30], 30.0, 7 * 60).unwrap();
        assert!((sun_position(wrong, place, 1830.14).unwrap().azimuth_deg - 194.34).abs() > 10.0);
    }

    #[test]
    fn solstices_equinoxes_and_poles_are_where_geometry_has_them() {
        // Noon at Greenwich, which the equation of time puts within two degrees of the meridian.
        let tilt = 23.436;
        for (date, declination) in [([2026, 6, 21], tilt), ([2026, 12, 21], -tilt), ([2026, 3, 20], 0.0)] {
            for latitude in [-60.0, -45.0, 50.0, 60.0] {
                let found = position(date, 12, [latitude, 0.0]).geometric_elevation_deg;
                let expected = 90.0 - f64::abs(latitude - declination);
                assert!((found - expected).abs() < 0.25, "{date:?} at {latitude}: {found} {expected}");
            }
        }
        // Midnight sun and polar night.
        assert!(position([2026, 6, 21], 0, [80.0, 0.0]).elevation_deg > 13.0);
        assert!(position([2026, 12, 21], 12, [80.0, 0.0]).elevation_deg < -13.0);
        // At a pole the sun stands as high all day, the declination.
        for hour in [0, 7, 15] {
            let (north, south) =
                (position([2026, 6, 21], hour, [90.0, 0.0]), position([2026, 6, 21], hour, [-90.0, 0.0]));
            assert!((north.geometric_elevation_deg - tilt).abs() < 0.01, "{north:?}");
            assert!((south.geometric_elevation_deg + tilt).abs() < 0.01, "{south:?}");
        }
        // It rises in the east.
        let rising = position([2026, 3, 20], 6, [0.0, 0.0]);
        assert!((rising.azimuth_deg - 90.0).abs() < 0.5 && rising.direction().x > 0.99, "{rising:?}");
        for year in [1900, 2100] {
            assert!((position([year, 6, 21], 12, [51.5, 0.0]).geometric_elevation_deg - 61.9).abs() < 0.2);
        }
    }

    #[test]
    fn directions_have_north_at_minus_z_and_east_at_x() {
        assert!((direction(0.0, 0.0) - Vec3::NEG_Z).length() < 1e-6);
        assert!((direction(90.0, 0.0) - Vec3::X).length() < 1e-6);
        assert!((direction(200.0, 90.0) - Vec3::Y).length() < 1e-6);
    }

    #[test]
    fn refraction_lifts_the_horizon_by_34_minutes_and_has_no_step() {
        // What stands at -34' is seen at the horizon [Saemundsson 1986].
        assert!(
            (refraction_deg(-34.0 / 60.0, 0.0) - 34.0 / 60.0).abs() < 0.01,
            "{}",
            refraction_deg(-34.0 / 60.0, 0.0)
        );
        assert!((refraction_deg(10.0, 0.0) * 60.0 - 5.4).abs() < 0.1);
        assert!(refraction_deg(10.0, 5000.0) < 0.6 * refraction_deg(10.0, 0.0));
        assert_eq!((refraction_deg(90.0, 0.0), refraction_deg(-8.0, 0.0)), (0.0, 0.0));
        let seen: Vec<f64> =
            (-900..=9000).map(|i| 0.01 * f64::from(i) + refraction_deg(0.01 * f64::from(i), 0.0)).collect();
        assert!(seen.windows(2).all(|pair| (0.005..0.013).contains(&(pair[1] - pair[0]))));
    }
}
