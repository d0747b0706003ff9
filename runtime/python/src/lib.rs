//! The Python module `btf`: packed assets on numpy arrays. A user reads the doc strings and `btf.pyi`.
//!
//! | File | |
//! |---|---|
//! | `asset` | `btf.open` and `btf.Asset` |
//! | `arrays` | numpy arrays in, broadcast, and out |

mod arrays;
mod asset;

/// Packed BTF assets (.spmm): `btf.open(path)`, then `eval`, `sample` and `pdf` on numpy arrays.
///
/// Values are pi x BRDF x |cosine of the light|, linear RGB: 1 is a white Lambertian lit at normal incidence.
#[pyo3::pymodule]
mod btf {
    #[pymodule_export]
    use super::asset::{PyAsset, open};

    #[allow(non_upper_case_globals, reason = "Python's name for it")]
    #[pymodule_export]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
