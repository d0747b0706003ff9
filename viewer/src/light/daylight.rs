//! Date, time and place to the light of a clear day: the sun, the sky, and what the sky gives a surface.

use crate::error::ViewerError;
use crate::light::atmosphere::{Atmosphere, middle_above_horizon_rad};
use crate::light::environment::Environment;
use crate::light::sky::Sky;
use crate::light::sky_irradiance::irradiance_at;
use crate::light::solar_spectrum::{BANDS, RgbFromSunlight};
use crate::light::sun::{SUN_DIAMETER_DEG, Sun, SunPosition, direction, julian_date, sun_position};
use glam::Vec3;
use rayon::prelude::*;
use solar_positioning::time::JulianDate;
use std::f32::consts::{PI, TAU};
use std::str::FromStr;
use toml::value::{Datetime, Offset};

/// Columns and rows of a sky's picture.
pub const SKY_SIZE: [usize; 2] = [256, 128];
/// The way over which the air's extinction is that of white: what is seen of a landscape beyond is little.
const AIR_WAY_KM: f32 = 5.0;

/// A place on earth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// North of the equator, -90 to 90.
    pub latitude_deg: f64,
    /// East of Greenwich, -180 to 180.
    pub longitude_deg: f64,
    /// Above sea level, -500 to 9000.
    pub height_m: f64,
}

/// A clear day's light.
#[derive(Debug, Clone, PartialEq)]
pub struct Daylight {
    /// Date, time of day and offset from UTC, years 1000 to 2999.
    pub date_time: Datetime,
    /// Place of the scene.
    pub place: Place,
    /// Turbidity of the air, 1 (air alone) to 10 [Preetham 1999]; 2 is very clear, 3 clear, 6 hazy.
    pub turbidity: f64,
    /// Albedo of the ground all around, 0 to 1; 0.15 is grass and soil, 0.8 snow.
    pub ground_albedo: f64,
}

/// The light of a clear day. All radiance is linear sRGB in units in which a white diffuser under
/// [`crate::WHITE_ILLUMINANCE_LUX`] has 1.
#[derive(Debug, Clone, PartialEq)]
pub struct SunAndSky {
    /// `None` when no part of the disc is up.
    pub sun: Option<Sun>,
    /// The sky without the sun's disc, and below the horizon the ground.
    pub environment: Environment,
    /// Share of light that a metre of the air at the ground takes away, RGB.
    pub air_extinction_per_m: [f32; 3],
}

impl FromStr for Place {
    type Err = ViewerError;

    /// Parses `latitude,longitude` or `latitude,longitude,height`, degrees and metres.
    fn from_str(text: &str) -> Result<Place, ViewerError> {
        let numbers: Vec<f64> = text.split(',').map_while(|part| part.trim().parse().ok()).collect();
        let parts = text.split(',').count();
        match (&numbers[..], parts) {
            (&[latitude_deg, longitude_deg], 2) => Ok(Place { latitude_deg, longitude_deg, height_m: 0.0 }),
            (&[latitude_deg, longitude_deg, height_m], 3) => Ok(Place { latitude_deg, longitude_deg, height_m }),
            _ => Err(ViewerError::Usage(format!(
                "'{text}' is no place: write degrees north and east, and metres above the sea if you like, such as 52.5,13.4 or 52.5,13.4,35"
            ))),
        }
    }
}

impl Daylight {
    /// Returns the daylight of a date and time such as `2026-06-21T12:00+02:00` and a place such as `52.5,13.4`, with
    /// turbidity 3 and ground albedo 0.15.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] for text that is neither, or out of range.
    pub fn new(date_time: &str, place: &str) -> Result<Daylight, ViewerError> {
        let date_time = date_time.parse().map_err(|error| {
            ViewerError::Usage(format!(
                "'{date_time}' is no date and time ({error}): write one with its offset from UTC, such as 2026-06-21T12:00+02:00"
            ))
        })?;
        let daylight = Daylight { date_time, place: place.parse()?, turbidity: 3.0, ground_albedo: 0.15 };
        daylight.check()?;
        Ok(daylight)
    }

    /// Checks date, place, turbidity and albedo.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] names what is missing or out of range.
    pub fn check(&self) -> Result<(), ViewerError> {
        let ranges = [
            ("the latitude", self.place.latitude_deg, -90.0..=90.0, "degrees"),
            ("the longitude", self.place.longitude_deg, -180.0..=180.0, "degrees"),
            ("the height", self.place.height_m, -500.0..=9000.0, "metres"),
            ("the turbidity", self.turbidity, 1.0..=10.0, ""),
            ("the ground's albedo", self.ground_albedo, 0.0..=1.0, ""),
        ];
        for (name, value, range, unit) in ranges {
            if !range.contains(&value) {
                let (least, most) = (range.start(), range.end());
                let allowed = format!("{name} is {value}, but must lie between {least} and {most} {unit}");
                return Err(ViewerError::Usage(allowed.trim_end().to_string()));
            }
        }
        self.julian_date().map(|_| ())
    }

    /// Computes where the sun stands.
    ///
    /// # Errors
    /// As [`Daylight::check`].
    pub fn sun_position(&self) -> Result<SunPosition, ViewerError> {
        self.check()?;
        let place = [self.place.latitude_deg, self.place.longitude_deg];
        sun_position(self.julian_date()?, place, self.place.height_m).map_err(|error| self.bad_date(&error.to_string()))
    }

    /// Computes the sun and the clear sky. Cost: some 0.5 s of one core, shared by all; the result is the same on any
    /// number of threads.
    ///
    /// # Errors
    /// As [`Daylight::check`].
    pub fn sun_and_sky(&self) -> Result<SunAndSky, ViewerError> {
        let position = self.sun_position()?;
        let atmosphere = Atmosphere::new(self.turbidity, self.place.height_m / 1000.0);
        Ok(sun_and_sky(atmosphere, position, self.ground_albedo as f32))
    }

    fn julian_date(&self) -> Result<JulianDate, ViewerError> {
        let (Some(date), Some(time), Some(offset)) = (self.date_time.date, self.date_time.time, self.date_time.offset)
        else {
            return Err(self.bad_date("a date, a time of day and the offset from UTC belong to it"));
        };
        if !(1000..3000).contains(&date.year) {
            return Err(self.bad_date("its year must lie between 1000 and 2999"));
        }
        let offset_minutes = match offset {
            Offset::Z => 0,
            Offset::Custom { minutes } => i32::from(minutes),
        };
        let second = f64::from(time.second.unwrap_or(0)) + 1e-9 * f64::from(time.nanosecond.unwrap_or(0));
        let date = [u32::from(date.year), u32::from(date.month), u32::from(date.day)];
        julian_date(date, [u32::from(time.hour), u32::from(time.minute)], second, offset_minutes)
            .map_err(|error| self.bad_date(&error.to_string()))
    }

    fn bad_date(&self, reason: &str) -> ViewerError {
        ViewerError::Usage(format!("{}: {reason}; write it as 2026-06-21T12:00+02:00", self.date_time))
    }
}

/// Computes the light of a sun at a position, below an atmosphere.
fn sun_and_sky(atmosphere: Atmosphere, position: SunPosition, ground_albedo: f32) -> SunAndSky {
    let elevation_rad = position.elevation_deg.to_radians() as f32;
    let azimuth_rad = position.azimuth_deg.to_radians() as f32;
    let sky = Sky::new(atmosphere, elevation_rad, ground_albedo);
    let colour = RgbFromSunlight::new(position.distance_au);
    // The sky over the horizon, then the ground that it and the sun light.
    let [width, height] = SKY_SIZE;
    let pixel = |at: usize| {
        let azimuth = TAU * (((at % width) as f32 + 0.5) / width as f32 - 0.5);
        let polar = PI * ((at / width) as f32 + 0.5) / height as f32;
        colour.rgb(&sky.radiance(polar.cos(), azimuth - azimuth_rad))
    };
    let above: Vec<[f32; 3]> = (0..width * height / 2).into_par_iter().map(pixel).collect();
    let mut rgb = above.concat();
    rgb.resize(width * height * 3, 0.0);
    let sunlight = colour.rgb(&sky.sunlight());
    let visible_deg = f64::from(middle_above_horizon_rad(elevation_rad).to_degrees());
    let direction = direction(position.azimuth_deg, visible_deg);
    let from_sky = irradiance_at(width, height, &rgb, Vec3::Y);
    let ground: [f32; 3] = std::array::from_fn(|c| (from_sky[c] + sunlight[c] * direction.y) * ground_albedo / PI);
    for pixel in rgb[width * height / 2 * 3..].chunks_exact_mut(3) {
        pixel.copy_from_slice(&ground);
    }
    let sun = Sun { direction, angular_diameter_deg: SUN_DIAMETER_DEG, irradiance: sunlight };
    SunAndSky {
        sun: sunlight.iter().any(|x| *x > 0.0).then_some(sun),
        environment: Environment::new(width, height, &rgb),
        air_extinction_per_m: air_extinction_per_m(sky.atmosphere(), &colour),
    }
}

/// Returns the extinction of the air at the ground. Colours do not fade by one exponential; this one is right for white at
/// [`AIR_WAY_KM`].
fn air_extinction_per_m(atmosphere: &Atmosphere, colour: &RgbFromSunlight) -> [f32; 3] {
    let density = atmosphere.density(0.0);
    let passed = colour.rgb(&atmosphere.transmittance(density.map(|density| density * AIR_WAY_KM)));
    let white = colour.rgb(&[1.0; BANDS]);
    std::array::from_fn(|c| -(passed[c] / white[c]).ln() / (1000.0 * AIR_WAY_KM))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler;

    #[test]
    fn text_becomes_a_day_and_nonsense_one_sentence() {
        let daylight = Daylight::new("2026-06-21T12:00+02:00", "52.5,13.4").unwrap();
        assert_eq!(daylight.place, Place { latitude_deg: 52.5, longitude_deg: 13.4, height_m: 0.0 });
        assert_eq!((daylight.turbidity, daylight.ground_albedo), (3.0, 0.15));
        let same = Daylight::new("2026-06-21 10:00:00Z", " 52.5, 13.4 , 0").unwrap();
        assert_eq!(same.sun_position().unwrap(), daylight.sun_position().unwrap());
        for (date_time, place, named) in [
            ("noon", "52.5,13.4", "'noon' is no date and time"),
            ("2026-06-21T12:00", "52.5,13.4", "offset from UTC"),
            ("2026-06-21", "52.5,13.4", "time of day"),
            ("2026-02-30T12:00Z", "52.5,13.4", "2026-02-30"),
            ("0999-06-21T12:00Z", "52.5,13.4", "between 1000 and 2999"),
            ("2026-06-21T12:00Z", "Berlin", "'Berlin' is no place"),
            ("2026-06-21T12:00Z", "52.5", "'52.5' is no place"),
            ("2026-06-21T12:00Z", "1,2,3,4", "is no place"),
            ("2026-06-21T12:00Z", "52.5,x,3", "is no place"),
            ("2026-06-21T12:00Z", "90.1,0", "the latitude is 90.1"),
            ("2026-06-21T12:00Z", "nan,0", "the latitude is NaN"),
            ("2026-06-21T12:00Z", "0,181", "the longitude is 181"),
            ("2026-06-21T12:00Z", "0,0,9001", "the height is 9001"),
        ] {
            let error = Daylight::new(date_time, place).unwrap_err();
            assert!(matches!(error, ViewerError::Usage(_)), "{error}");
            assert!(error.to_string().contains(named) && !error.to_string().contains('\n'), "{error}");
        }
        for (turbidity, ground_albedo) in [(0.9, 0.2), (11.0, 0.2), (f64::NAN, 0.2), (3.0, -0.1), (3.0, 1.1)] {
            let error = Daylight { turbidity, ground_albedo, ..daylight.clone() }.sun_and_sky().unwrap_err();
            assert!(error.to_string().contains("but must lie between"), "{error}");
        }
    }

    #[test]
    fn air_at_the_ground_takes_away_what_air_and_aerosol_do() {
        let light = |turbidity| {
            let day = Daylight::new("2026-06-21T13:00+02:00", "52.5,13.4").unwrap();
            Daylight { turbidity, ..day }.sun_and_sky().unwrap()
        };
        let clean = light(1.0).air_extinction_per_m;
        // Rayleigh scattering at 15 degrees and 1013 hPa, 1/km, at 610, 550 and 460 nm [Penndorf 1957, table 1].
        for (found, published) in clean.into_iter().zip([0.0075e-3, 0.0115e-3, 0.0240e-3]) {
            assert!((found / published - 1.0).abs() < 0.25, "{clean:?}");
        }
        // Angstrom's law: from 550 nm on a way of 1 km, with a vertical depth over 1.2 km.
        let hazy = light(3.0).air_extinction_per_m;
        let aerosol = 0.04608 * 2.0 * 0.55f32.powf(-1.3) / 1200.0;
        assert!(((hazy[1] - clean[1]) / aerosol - 1.0).abs() < 0.05, "{hazy:?} {aerosol}");
        assert!(hazy[0] < hazy[1] && hazy[1] < hazy[2]);
        // What docs/reference/model.md says.
        assert!((2f32.ln() / hazy[1] - 3_800.0).abs() < 50.0, "{hazy:?}");
    }

    /// Irradiance of the level by the sky, green.
    fn level(light: &SunAndSky) -> f32 {
        light.environment.irradiance(Vec3::Y)[1]
    }

    #[test]
    fn noon_has_the_sun_where_the_sky_is_brightest_and_blue_elsewhere() {
        let daylight = Daylight::new("2026-06-21T13:00+02:00", "52.5,13.4").unwrap();
        let (light, position) = (daylight.sun_and_sky().unwrap(), daylight.sun_position().unwrap());
        let sun = light.sun.unwrap();
        assert!((sun.direction - position.direction()).length() < 1e-6);
        // Some 90,000 lux on a surface that faces it.
        assert!((0.8 * PI..PI).contains(&sun.irradiance[1]) && sun.irradiance[0] > sun.irradiance[2], "{sun:?}");
        let aside = Vec3::new(sun.direction.z, 0.8, -sun.direction.x).normalize();
        let (near, far) = (light.environment.radiance(sun.direction), light.environment.radiance(aside));
        assert!(near.y > 5.0 * far.y && far.z > 1.3 * far.x, "{near} {far}");
        assert!(light.environment.radiance(sun.direction * Vec3::new(-1.0, 1.0, 1.0)).y < near.y);
        // The ground: what its albedo makes of both.
        let ground = light.environment.radiance(Vec3::NEG_Y);
        let expected = 0.15 / PI * (sun.irradiance[1] * sun.direction.y + level(&light));
        assert!((ground.y / expected - 1.0).abs() < 0.02, "{ground} {expected}");
        // What the table tells is what the environment gives.
        for normal in [Vec3::Y, Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, -1.0, 0.0), Vec3::new(0.48, 0.6, -0.64)] {
            let count = 4096;
            let sum: Vec3 = (0..count)
                .map(|i| {
                    let d = light.environment.sample(sampler::two(i, 9));
                    light.environment.radiance(d) * normal.dot(d).max(0.0) / light.environment.density(d)
                })
                .sum();
            let (found, expected) = (light.environment.irradiance(normal)[1], sum.y / count as f32);
            assert!((found / expected - 1.0).abs() < 0.03, "{normal}: {found} {expected}");
        }
    }

    #[test]
    fn every_day_and_place_has_finite_light() {
        let cases = [
            ("1900-01-01T00:00Z", "-90,0,2800", 3.0, 0.9),
            ("2100-12-31T23:59:59+14:00", "90,180", 1.0, 1.0),
            ("2026-12-21T12:00+01:00", "78.2,15.6", 10.0, 1.0),
            ("2026-06-21T12:00Z", "23.44,0.5,9000", 1.0, 0.0),
            ("2026-03-20T18:10Z", "0,0", 10.0, 0.0),
            ("2026-03-20T19:20Z", "0,0,-430", 10.0, 1.0),
        ];
        for (date_time, place, turbidity, ground_albedo) in cases {
            let light = Daylight { turbidity, ground_albedo, ..Daylight::new(date_time, place).unwrap() }
                .sun_and_sky()
                .unwrap();
            let numbers = light.environment.table().iter();
            assert!(numbers.clone().all(|x| x.is_finite() && *x >= 0.0), "{date_time} {place}");
            if let Some(sun) = light.sun {
                assert!(sun.direction.y > 0.0 && sun.irradiance.iter().all(|x| x.is_finite() && *x >= 0.0), "{sun:?}");
            }
        }
    }

    #[test]
    fn the_light_is_the_same_on_any_number_of_threads() {
        let daylight = Daylight::new("2026-06-21T20:00+02:00", "52.5,13.4").unwrap();
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| daylight.sun_and_sky().unwrap())
        };
        assert_eq!(on(1), on(3));
        // Planted difference.
        assert_ne!(on(1), Daylight { turbidity: 3.01, ..daylight.clone() }.sun_and_sky().unwrap());
    }
}
