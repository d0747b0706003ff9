//! Programs that others have written and that tests need: finds them, installs them (Debian packages as root; packages
//! of npm and pip below the target folder), or says in one sentence what to install.

pub mod apt;
pub mod asset_tools;
pub mod blender;
pub mod browser;
pub mod c_package;
pub mod compilers;
pub mod driver;
mod npm;
pub mod peers;
pub mod python_environment;
pub mod python_module;
pub mod shader_tools;
pub mod slurm;
pub mod viewer_page;
pub mod wasm;
pub mod wasm_bindgen;
pub mod web_package;
pub mod window_tools;
