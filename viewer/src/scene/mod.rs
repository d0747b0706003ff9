//! What is drawn: meshes, materials, assets, leaves, volumes, lights and cameras.

pub(crate) mod asset;
pub(crate) mod builtin;
pub(crate) mod camera;
pub(crate) mod file;
pub(crate) mod gltf_asset;
pub(crate) mod illuminant;
pub(crate) mod landscape;
pub(crate) mod leaf;
pub(crate) mod leaf_width;
pub(crate) mod material;
pub(crate) mod mesh;
pub(crate) mod mesh_file;
pub(crate) mod plant_variation;
pub(crate) mod scene;
pub(crate) mod volume;
