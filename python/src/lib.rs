//! The compiled part of the Python module `btf`: packed assets and captures on numpy arrays. A user reads the doc strings and
//! `package/btf/__init__.pyi`.
//!
//! | File | |
//! |---|---|
//! | `asset` | `btf.open` and `btf.Asset` |
//! | `capture` | `btf.Capture` |
//! | `fit` | `btf.fit` and `btf.compare` |
//! | `leaf` | `btf.leaf.invert` |
//! | `work` | long work on threads, with progress and Control-C |
//! | `arrays` | numpy arrays in, broadcast, and out |
//! | `faults` | our errors as Python's |

mod arrays;
mod asset;
mod capture;
mod faults;
mod fit;
mod leaf;
mod work;

/// The compiled part of `btf`.
#[pyo3::pymodule]
mod _btf {
    #[pymodule_export]
    use super::asset::{PyAsset, open};
    #[pymodule_export]
    use super::capture::PyCapture;
    #[pymodule_export]
    use super::fit::{compare, fit};
    #[pymodule_export]
    use super::leaf::invert_leaves;

    #[allow(non_upper_case_globals, reason = "Python's name for it")]
    #[pymodule_export]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
