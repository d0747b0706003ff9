//! The sun's disc as a light at infinity: soft shadows by rays to its points. Twin: `sun_disc.wgsl`.

use crate::geometry::surface::perpendicular;
use crate::light::sun::Sun;
use glam::Vec3;
use std::f32::consts::TAU;

impl Sun {
    /// Returns the share of a full turn's solid angle that the disc covers, times 2: 1 less the cosine of its angular
    /// radius, without losing digits.
    pub(crate) fn sun_part(&self) -> f32 {
        let sin_half = (0.25 * self.angular_diameter_deg.to_radians()).sin();
        2.0 * sin_half * sin_half
    }

    /// Draws a direction to a point of the disc from two numbers in [0, 1), every part of the disc as likely.
    pub(crate) fn sun_sample(&self, at: [f32; 2]) -> Vec3 {
        let cos = 1.0 - at[0] * self.sun_part();
        let radius = (1.0 - cos * cos).max(0.0).sqrt();
        let (sin_angle, cos_angle) = (TAU * at[1]).sin_cos();
        let across = perpendicular(self.direction);
        let other = self.direction.cross(across);
        (self.direction * cos + (across * cos_angle + other * sin_angle) * radius).normalize()
    }

    /// Returns the radiance of the disc where it lies in `direction`, 0 beside it; a sun without a size is not seen.
    pub(crate) fn sun_radiance(&self, direction: Vec3) -> Vec3 {
        let part = self.sun_part();
        if part <= 0.0 || 1.0 - direction.dot(self.direction) > part {
            return Vec3::ZERO;
        }
        Vec3::from(self.irradiance) / (TAU * part).max(1e-9)
    }
}
