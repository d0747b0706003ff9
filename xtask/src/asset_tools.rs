//! Programs of others that judge the files we export: the Khronos glTF validator, and a strict reader of KTX2.

use crate::failure::Failure;
use crate::npm::{self, Package};
use std::path::Path;

const VALIDATORS: Package = Package {
    name: "The glTF validator",
    file: "tests/peers/gltf/package.json",
    folder: "gltf",
    purpose: "exported files are checked by Khronos' glTF validator",
};

/// Finds or installs them in `target`/peers/gltf; the sentence says so.
pub fn ensure(target: &Path) -> Result<String, Failure> {
    npm::ensure(target, &VALIDATORS)
}
