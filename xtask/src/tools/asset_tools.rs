//! Programs that judge the files we export: the Khronos glTF validator, and a strict reader of KTX2.

use super::npm::{self, Package};
use crate::failure::Failure;
use std::path::Path;

const VALIDATORS: Package = Package {
    name: "The glTF validator",
    file: "tests/peers/gltf/package.json",
    folder: "gltf",
    purpose: "exported files are checked by Khronos' glTF validator",
};

/// Finds the validators in `target`/peers/gltf or installs them there with npm. Returns one line that says so.
pub fn ensure(target: &Path) -> Result<String, Failure> {
    npm::ensure(target, &VALIDATORS)
}
