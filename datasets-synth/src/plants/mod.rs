//! Plants: L-systems that a turtle interprets as organs, organs as meshes, meshes as a canopy in a glTF file, or all of
//! them as a script of shapes.

pub(crate) mod blade;
pub(crate) mod canopy;
pub(crate) mod gltf;
pub(crate) mod grass;
pub(crate) mod lsystem;
pub(crate) mod maize;
pub(crate) mod mesh;
pub(crate) mod params;
pub(crate) mod plant;
pub(crate) mod script;
pub(crate) mod soybean;
pub(crate) mod spruce;
pub(crate) mod tree;
pub(crate) mod turtle;
pub(crate) mod vec3;
pub(crate) mod write;
