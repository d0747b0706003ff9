//! Checks arrays of vectors, broadcasts them against each other, and makes arrays of results.

use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyMemoryError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// An argument of the shape (..., n), single precision.
pub struct Vectors<'py> {
    array: Bound<'py, PyArrayDyn<f32>>,
    name: &'static str,
}

impl<'py> Vectors<'py> {
    /// Takes any argument of which numpy makes real numbers, with `last` of them on the last axis. Single precision is
    /// not converted.
    ///
    /// # Errors
    /// ValueError for other types and shapes.
    pub fn new(value: &Bound<'py, PyAny>, name: &'static str, last: usize) -> PyResult<Vectors<'py>> {
        let array = value.py().import("numpy")?.call_method1("asarray", (value,))?;
        let dtype = array.getattr("dtype")?;
        let kind: String = dtype.getattr("kind")?.extract()?;
        if !["f", "i", "u"].contains(&kind.as_str()) {
            return Err(PyValueError::new_err(format!(
                "{name} is an array of {dtype}: give real numbers, float32 or float64"
            )));
        }
        let array = array.call_method1("astype", ("float32", "K", "unsafe", true, false))?;
        let array = array.cast_into::<PyArrayDyn<f32>>()?;
        if array.shape().last() != Some(&last) {
            let shape = shape_text(array.shape());
            return Err(PyValueError::new_err(format!("{name} has the shape {shape}: its last axis must have {last}")));
        }
        Ok(Vectors { array, name })
    }

    /// Returns the array itself.
    pub fn into_array(self) -> Bound<'py, PyArrayDyn<f32>> {
        self.array
    }

    /// Returns all axes but the last.
    fn leading(&self) -> &[usize] {
        &self.array.shape()[..self.array.ndim() - 1]
    }

    fn described(&self) -> String {
        format!("{} {}", self.name, shape_text(self.array.shape()))
    }
}

/// Returns a shape as Python writes a tuple.
fn shape_text(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        axes => format!("({})", axes.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// The common shape of several arguments, without the last axis.
pub struct Shape(Vec<usize>);

impl Shape {
    /// Broadcasts the arguments' shapes.
    ///
    /// # Errors
    /// ValueError if they do not broadcast.
    pub fn of(arguments: &[&Vectors<'_>]) -> PyResult<Shape> {
        let most = arguments.iter().map(|argument| argument.leading().len()).max().unwrap_or(0);
        let mut shape = vec![1; most];
        for argument in arguments {
            let axes = argument.leading();
            for (common, own) in shape[most - axes.len()..].iter_mut().zip(axes) {
                if *common == 1 {
                    *common = *own;
                } else if *own != 1 && own != common {
                    let all: Vec<String> = arguments.iter().map(|argument| argument.described()).collect();
                    return Err(PyValueError::new_err(format!(
                        "the shapes do not broadcast: {}; all axes but the last must be equal or 1",
                        all.join(", ")
                    )));
                }
            }
        }
        Ok(Shape(shape))
    }

    /// Allocates an item for each place of the shape.
    ///
    /// # Errors
    /// MemoryError if there is not enough memory.
    pub fn room<T>(&self) -> PyResult<Vec<T>> {
        let mut room = Vec::new();
        let count = self.0.iter().try_fold(1usize, |count, axis| count.checked_mul(*axis));
        match count.map(|count| room.try_reserve_exact(count)) {
            Some(Ok(())) => Ok(room),
            _ => Err(PyMemoryError::new_err(format!("there is no memory for the shape {}", shape_text(&self.0)))),
        }
    }

    /// Calls `each` with every vector of an argument that has `N` numbers on its last axis, the last axis fastest.
    pub fn visit<const N: usize>(&self, vectors: &Vectors<'_>, mut each: impl FnMut([f32; N])) -> PyResult<()> {
        let array = &vectors.array;
        let whole = PyTuple::new(array.py(), [&self.0[..], &[N]].concat())?;
        let wide = array.py().import("numpy")?.call_method1("broadcast_to", (array, whole))?;
        let wide: PyReadonlyArrayDyn<'_, f32> = wide.extract()?;
        for row in wide.as_array().rows() {
            each(std::array::from_fn(|axis| row[axis]));
        }
        Ok(())
    }

    /// Makes an array of the shape, or with an axis of `last` more, of `numbers` in the order of [`Shape::visit`].
    pub fn array<'py>(
        &self,
        py: Python<'py>,
        numbers: Vec<f32>,
        last: Option<usize>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let shape: Vec<usize> = self.0.iter().copied().chain(last).collect();
        PyArray1::from_vec(py, numbers).reshape(shape)
    }
}
