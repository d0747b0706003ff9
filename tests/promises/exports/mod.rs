//! Files for other programs, judged by those programs.

mod filtered_textures;
pub mod gltf_export;
mod materialx_export;
mod usd_export;
