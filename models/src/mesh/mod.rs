//! Models: triangles with texture coordinates and their transforms, read from OBJ and glTF files.

mod accessors;
mod address;
mod diffuse;
mod gltf;
mod gltf_file;
mod model;
mod obj;
mod read;
#[cfg(test)]
mod tests;

pub use address::beside;
pub use diffuse::DiffuseColour;
pub use gltf_file::{gltf_buffers, open_gltf};
pub use model::{ModelMesh, ModelPart};
pub use read::{field_m, is_model, read_model};
