//! Models that are lit, drawn and turned into volumes: leaves as description files with appearance textures, triangle
//! meshes from OBJ and glTF files, and scripts of shapes.
//!
//! A leaf is a [`LeafDescription`] with its [`LeafContents`], each of the [`LEAF_QUANTITIES`] within its range. A
//! [`LeafPreset`] or a [`Species`] gives usual values, and [`TextureImages`] is the folder of appearance textures
//! beside the description. A mesh is read by [`read_model`]. A program that needs more of a glTF file than its mesh
//! opens the file by [`open_gltf`], which checks it. [`shapes`] is the script of solids, sheets and fur that volumetric
//! textures are painted from. [`glb`] writes the container of binary glTF files. [`ModelError`] says in one sentence
//! what is wrong with a file.

mod error;
pub mod glb;
mod leaf;
mod mesh;
pub mod shapes;

pub use error::ModelError;
pub use leaf::contents::LeafContents;
pub use leaf::description::{LeafDescription, PlantVariation};
pub use leaf::preset::LeafPreset;
pub use leaf::quantity::{LEAF_QUANTITIES, LeafQuantity};
pub use leaf::species::{Deficiency, LeafGloss, Species, SpeciesPreset};
pub use leaf::table::{CLASSES, LeafTable, TABLE_GRID};
pub use leaf::texture_folder::{TEXTURES_NAME, TextureGrid, TextureImages, write_textures};
pub use leaf::texture_image::{MAX_TEXTURE_TEXELS, TextureKind};
pub use mesh::{DiffuseColour, ModelMesh, ModelPart, beside, field_m, gltf_buffers, is_model, open_gltf, read_model};
