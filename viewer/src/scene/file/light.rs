//! `[environment]`, `[daylight]`, `[sun]`, `[[light]]` and `[ambient]` of a scene file.

use super::defaults::{one, sun_diameter_deg};
use super::source::Source;
use crate::error::ViewerError;
use crate::light::daylight::Daylight;
use crate::light::environment::Environment;
use crate::light::sun::Sun;
use crate::scene::scene::{Ambient, DaylightParts, Outdoors, PointLight, Scene};
use glam::Vec3;
use serde::Deserialize;

/// `[environment]`: a picture of light from all around.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EnvironmentEntry {
    file: String,
    #[serde(default = "one")]
    gain: f32,
    #[serde(default)]
    turn_deg: f32,
}

/// `[sun]`: a light at infinity.
#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
pub(super) struct SunEntry {
    direction: [f32; 3],
    irradiance: [f32; 3],
    #[serde(default = "sun_diameter_deg")]
    angular_diameter_deg: f32,
}

/// `[daylight]`: sun and clear sky of a moment at a place.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DaylightEntry {
    date_time: String,
    place: String,
    turbidity: Option<f64>,
    ground_albedo: Option<f64>,
    #[serde(default)]
    parts: DaylightParts,
    #[serde(default)]
    air: bool,
}

/// `[ambient]`: uniform light that near surfaces occlude.
#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
pub(super) struct AmbientEntry {
    radiance: [f32; 3],
    distance: Option<f32>,
}

/// `[[light]]`: a point light.
#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
pub(super) struct LightEntry {
    position: [f32; 3],
    intensity: [f32; 3],
}

impl EnvironmentEntry {
    /// Surrounds the scene with the picture.
    ///
    /// # Errors
    /// [`ViewerError::Scene`] for a gain that is not above 0; those of [`Environment::load`].
    pub(super) fn put_into(&self, scene: &mut Scene, source: Source) -> Result<(), ViewerError> {
        if !(self.gain.is_finite() && self.gain > 0.0) {
            return Err(source.fault("[environment] needs a gain above 0"));
        }
        if !self.turn_deg.is_finite() {
            return Err(source.fault("[environment] has a turn_deg that is not a finite number"));
        }
        scene.surround(Environment::load_turned(&source.beside(&self.file), self.gain, self.turn_deg)?);
        Ok(())
    }
}

impl SunEntry {
    /// Gives the scene this sun.
    ///
    /// # Errors
    /// [`ViewerError::Scene`] for a direction that is none, an irradiance below 0 or a diameter that is not 0 to 90
    /// degrees.
    pub(super) fn put_into(&self, scene: &mut Scene, source: Source) -> Result<(), ViewerError> {
        let direction = Vec3::from(self.direction).normalize_or_zero();
        if direction == Vec3::ZERO {
            return Err(source.fault("[sun] has a direction without length, give one towards the sun"));
        }
        if !self.irradiance.iter().all(|x| x.is_finite() && *x >= 0.0) {
            return Err(source.fault("[sun] needs an irradiance of at least 0"));
        }
        if !(0.0..=90.0).contains(&self.angular_diameter_deg) {
            return Err(source.fault("[sun] needs an angular_diameter_deg of 0 to 90"));
        }
        let (irradiance, angular_diameter_deg) = (self.irradiance, self.angular_diameter_deg);
        scene.sun = Some(Sun { direction, angular_diameter_deg, irradiance });
        Ok(())
    }
}

impl DaylightEntry {
    /// Puts the scene, of which a unit is `unit_m` metres long, under sun and sky.
    ///
    /// # Errors
    /// [`ViewerError::Scene`] for a moment, a place or an air that is none, and for air without a length of a unit.
    pub(super) fn put_into(&self, scene: &mut Scene, unit_m: f32, source: Source) -> Result<(), ViewerError> {
        let wrong = |error: ViewerError| source.fault(error.to_string());
        let mut daylight = Daylight::new(&self.date_time, &self.place).map_err(wrong)?;
        daylight.turbidity = self.turbidity.unwrap_or(daylight.turbidity);
        daylight.ground_albedo = self.ground_albedo.unwrap_or(daylight.ground_albedo);
        let light = daylight.sun_and_sky().map_err(wrong)?;
        if self.air && !(unit_m.is_finite() && unit_m > 0.0) {
            return Err(source.fault("[daylight] has air, for which a unit needs a length: give a unit_mm above 0"));
        }
        scene.air_unit_m = self.air.then_some(unit_m);
        scene.stand_outdoors(Outdoors { daylight, parts: self.parts }, light);
        Ok(())
    }
}

impl AmbientEntry {
    /// Gives the scene this ambient light.
    ///
    /// # Errors
    /// [`ViewerError::Scene`] for a radiance below 0 or a distance that is not above 0.
    pub(super) fn put_into(&self, scene: &mut Scene, source: Source) -> Result<(), ViewerError> {
        let AmbientEntry { radiance, distance } = *self;
        let distance = distance.unwrap_or(scene.usual_ambient().distance);
        if !(radiance.iter().all(|x| x.is_finite() && *x >= 0.0) && distance.is_finite() && distance > 0.0) {
            return Err(source.fault("[ambient] needs a radiance of at least 0 and a distance above 0"));
        }
        scene.ambient = Ambient { radiance, distance };
        Ok(())
    }
}

impl LightEntry {
    /// Returns the light.
    pub(super) fn light(&self) -> PointLight {
        PointLight { position: Vec3::from(self.position), intensity: self.intensity }
    }
}
