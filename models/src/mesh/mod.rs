//! Models: triangles with texture coordinates and the places where they stand, read from OBJ and glTF files.

mod address;
mod diffuse;
mod gltf;
mod model;
mod obj;
mod read;

pub use address::beside;
pub use diffuse::DiffuseColour;
pub use model::{ModelMesh, ModelPart};
pub use read::{is_model, read_model};
