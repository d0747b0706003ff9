//! `btf.Capture`: folders and arrays as captures.

use crate::arrays::Vectors;
use crate::faults::{capture_error, value_error};
use btf_capture::{Capture, CaptureInfo, Direction, DirectionSet, ImageFormat, Pixels, Side};
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Photographs of a flat material under several lights from several views.
///
/// Capture(images, lights, views): of an array (views, lights, rows, columns, 3), linear reflectance times the cosine of the
/// light: 1 is a white Lambertian lit at normal incidence. Rows from the top. It is copied, in single precision. `lights` and
/// `views` are unit vectors (n, 3) away from the surface, x along columns, y upwards along rows.
///
/// size_mm: physical width and height, where known.
/// side: "front", "back", "transmission-back" or "transmission-front"; docs/guide/captures.md tells their frames.
/// name: a short name, which the asset keeps.
/// wavelengths_nm: of bands in place of three channels, ascending.
///
/// Raises ValueError for shapes that do not fit and directions that are none.
#[pyclass(name = "Capture", module = "btf", frozen)]
pub struct PyCapture {
    pub(crate) capture: Capture,
}

#[pymethods]
impl PyCapture {
    #[new]
    #[pyo3(signature = (images, lights, views, *, size_mm=None, side="front", name="array", wavelengths_nm=None))]
    fn new(
        images: &Bound<'_, PyAny>,
        lights: &Bound<'_, PyAny>,
        views: &Bound<'_, PyAny>,
        size_mm: Option<[f32; 2]>,
        side: &str,
        name: &str,
        wavelengths_nm: Option<Vec<f64>>,
    ) -> PyResult<PyCapture> {
        let (lights, views) = (directions(lights, "lights")?, directions(views, "views")?);
        let wavelengths_nm = wavelengths_nm.unwrap_or_default();
        let channels = if wavelengths_nm.is_empty() { 3 } else { wavelengths_nm.len() };
        let images = Vectors::new(images, "images", channels)?.into_array();
        let shape = images.shape().to_vec();
        let [_, _, rows, columns, _] = shape[..] else {
            return Err(value_error("images has not five axes: views, lights, rows, columns and channels"));
        };
        if shape[..2] != [views.order.len(), lights.order.len()] {
            return Err(value_error(format!(
                "images has {} views and {} lights, the directions are {} and {}",
                shape[0],
                shape[1],
                views.order.len(),
                lights.order.len()
            )));
        }
        let side: Side = side.parse().map_err(|error| value_error(format!("{error}")))?;
        let mut info = CaptureInfo::new(name, columns, rows, views.set, lights.set, ImageFormat::Exr);
        (info.side, info.size_mm, info.wavelengths_nm) = (side, size_mm, wavelengths_nm);
        let images: PyReadonlyArrayDyn<'_, f32> = images.extract()?;
        let images = images.as_array();
        let mut values = Vec::new();
        values.try_reserve_exact(images.len()).map_err(|_| {
            pyo3::exceptions::PyMemoryError::new_err("there is no memory for a copy of the images".to_string())
        })?;
        for view in &views.order {
            for light in &lights.order {
                let image = images.index_axis(numpy::ndarray::Axis(0), *view);
                values.extend(image.index_axis(numpy::ndarray::Axis(0), *light).iter());
            }
        }
        let capture = Capture::from_linear(info, values).map_err(|error| capture_error(&error))?;
        Ok(PyCapture { capture })
    }

    /// Opens a capture: a folder or a zip of images, a list of images (.csv), or a UBO2014 file (.btf).
    ///
    /// Raises OSError if it cannot be read and ValueError if it is no capture.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<PyCapture> {
        let capture = py.detach(|| Capture::open(&path)).map_err(|error| capture_error(&error))?;
        Ok(PyCapture { capture })
    }

    /// Returns the unit vectors to the lights, (lights, 3), in the order of `image`.
    #[getter]
    fn lights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        units(py, &self.capture.info().lights)
    }

    /// Returns the unit vectors to the eyes, (views, 3), in the order of `image`.
    #[getter]
    fn views<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        units(py, &self.capture.info().views)
    }

    /// Returns the (view, light) of each pair that has no image, in ascending order.
    #[getter]
    fn missing(&self) -> Vec<(usize, usize)> {
        let info = self.capture.info();
        info.missing.iter().map(|pair| (pair / info.lights.len(), pair % info.lights.len())).collect()
    }

    /// Returns the wavelengths of the bands in nanometres, ascending; empty for colours.
    #[getter]
    fn wavelengths_nm<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.capture.info().wavelengths_nm.clone())
    }

    /// Returns (rows, columns).
    #[getter]
    fn shape(&self) -> (usize, usize) {
        let info = self.capture.info();
        (info.height, info.width)
    }

    /// Returns the physical width and height in millimetres, or None.
    #[getter]
    fn size_mm(&self) -> Option<(f32, f32)> {
        self.capture.info().size_mm.map(|[width, height]| (width, height))
    }

    /// Returns the short name.
    #[getter]
    fn name(&self) -> &str {
        &self.capture.info().name
    }

    /// Reads the image of a view under a light, (rows, columns, 3), linear reflectance times cosine, rows from the top.
    ///
    /// Raises IndexError for a view or a light that is not there, ValueError for an image that is damaged.
    fn image<'py>(&self, py: Python<'py>, view: usize, light: usize) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let info = self.capture.info();
        self.check_pair(view, light)?;
        let pixels = py.detach(|| self.capture.read(view, light)).map_err(|error| capture_error(&error))?;
        let linear = match pixels {
            Pixels::Linear(values) => values,
            Pixels::Encoded8(codes) => {
                let table = info.linear_from_encoded8(light);
                codes.iter().map(|code| table[usize::from(*code)]).collect()
            }
        };
        PyArray1::from_vec(py, linear).reshape(vec![info.height, info.width, 3])
    }

    /// Reads all bands of an image, (rows, columns, bands), linear reflectance times cosine, rows from the top.
    ///
    /// Raises IndexError for a view or a light that is not there, ValueError for a capture of colours and a damaged image.
    fn image_bands<'py>(&self, py: Python<'py>, view: usize, light: usize) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let info = self.capture.info();
        self.check_pair(view, light)?;
        let bands = py.detach(|| self.capture.read_bands(view, light)).map_err(|error| capture_error(&error))?;
        PyArray1::from_vec(py, bands).reshape(vec![info.height, info.width, info.wavelengths_nm.len()])
    }

    fn __repr__(&self) -> String {
        let info = self.capture.info();
        let (views, lights) = (info.views.len(), info.lights.len());
        format!("<btf.Capture {}: {} x {} texels, {views} views, {lights} lights>", info.name, info.width, info.height)
    }
}

impl PyCapture {
    /// Refuses a view or a light that is not there.
    fn check_pair(&self, view: usize, light: usize) -> PyResult<()> {
        let info = self.capture.info();
        let [views, lights] = [info.views.len(), info.lights.len()];
        match view < views && light < lights {
            true => Ok(()),
            false => Err(pyo3::exceptions::PyIndexError::new_err(format!(
                "there are {views} views and {lights} lights, counted from 0"
            ))),
        }
    }
}

/// Directions in the order of a set, and where each stood in the array.
struct Ordered {
    set: DirectionSet,
    order: Vec<usize>,
}

/// Takes unit vectors, (n, 3).
fn directions(value: &Bound<'_, PyAny>, name: &'static str) -> PyResult<Ordered> {
    let array = Vectors::new(value, name, 3)?.into_array();
    if array.ndim() != 2 {
        return Err(value_error(format!("{name} is no list of vectors: its shape must be (n, 3)")));
    }
    let readonly: PyReadonlyArrayDyn<'_, f32> = array.extract()?;
    let mut found = Vec::new();
    for (number, row) in readonly.as_array().rows().into_iter().enumerate() {
        let vector = [0, 1, 2].map(|axis| f64::from(row[axis]));
        let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
        // A NaN is outside, too.
        if !(0.995..=1.005).contains(&length) {
            return Err(value_error(format!("{name}[{number}] is no unit vector: its length is {length:.3}")));
        }
        found.push(Direction::of_vector(vector));
    }
    let set = DirectionSet::new(found.clone()).map_err(|error| value_error(format!("{name}: {error}")))?;
    let place = |direction: &Direction| found.iter().position(|other| other == direction).unwrap_or(0);
    let order = set.directions().iter().map(place).collect();
    Ok(Ordered { set, order })
}

fn units<'py>(py: Python<'py>, set: &DirectionSet) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    PyArray1::from_vec(py, set.units().into_flattened()).reshape(vec![set.len(), 3])
}

/// Takes a path or a `btf.Capture`.
///
/// # Errors
/// TypeError for anything else; those of opening.
pub fn capture_of(value: &Bound<'_, PyAny>) -> PyResult<Capture> {
    if let Ok(capture) = value.cast::<PyCapture>() {
        return Ok(capture.get().capture.clone());
    }
    let path: PathBuf = value.extract().map_err(|_| {
        pyo3::exceptions::PyTypeError::new_err("a capture is a path or a btf.Capture, which arrays make".to_string())
    })?;
    Ok(PyCapture::open(value.py(), path)?.capture)
}
