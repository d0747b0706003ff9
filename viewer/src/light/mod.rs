//! Light from outside a scene: sun, sky, environment maps; and what draws point lights.

pub(crate) mod atmosphere;
pub(crate) mod daylight;
pub(crate) mod environment;
pub(crate) mod irradiance_volume;
pub(crate) mod light_grid;
pub(crate) mod light_tree;
pub(crate) mod sky;
pub(crate) mod sky_irradiance;
pub(crate) mod solar_spectrum;
pub(crate) mod sun;
pub(crate) mod sun_disc;
