//! Volumetric textures of a scene: free volumes, thick skins, and light along a ray through them.

pub(crate) mod bricks;
pub(crate) mod light;
pub(crate) mod skin;
pub(crate) mod source;
pub(crate) mod volumes;
pub(crate) mod words;
