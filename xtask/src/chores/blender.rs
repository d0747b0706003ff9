//! `cargo xtask blender`.

use crate::arguments;
use crate::failure::Failure;
use crate::metadata::Metadata;
use crate::tools::python_module::{self, Build};
use crate::tools::{blender, peers};

const HELP: &str = "\
Builds the add-on for Blender as an extension, with the Python module and the programs in it, and tests it in Blender, which
comes as a Python module (bpy) into an environment of its own under the target folder (peers/blender). Blender's module
needs Python 3.11.

Usage: cargo xtask blender

The extension is target/blender/btf_materials-VERSION.zip: in Blender, Edit > Preferences > Get Extensions > Install from
Disk.";

/// Runs the chore.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if arguments::none("blender", HELP, arguments)? {
        let target = Metadata::read()?.target_directory;
        println!("{}", peers::ensure(&target)?);
        println!("{}", blender::ensure(&target)?);
        println!("{}", python_module::build_and_test(&target, Build::Release)?);
        let extension = blender::build(&target, Build::Release)?;
        let counts = blender::test(&target, &extension, Build::Release)?;
        println!("{counts}");
        if counts.failed > 0 {
            return Err(Failure::new("the add-on's tests failed: see runtime/blender/tests".to_string()));
        }
        println!("{}", extension.display());
    }
    Ok(())
}
