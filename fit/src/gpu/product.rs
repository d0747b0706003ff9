//! Matrix products on an adapter. Twin of the shader: product.wgsl.

use crate::gpu::device::GpuDevice;
use half::f16;
use half::slice::{HalfBitsSliceExt, HalfFloatSliceExt};
use ndarray::{Array2, ArrayView2};
use wgpu::BufferUsages;

/// Rows and columns of C that a workgroup makes. Twin: `TILE`.
const TILE: usize = 128;
/// Bytes of `Shape` in the shader.
const SHAPE_BYTES: u64 = 32;

/// Pipelines of the products on an open adapter.
pub(crate) struct GpuProducts {
    gpu: GpuDevice,
    /// By `[transposed][halves]`.
    pipelines: [[wgpu::ComputePipeline; 2]; 2],
}

/// Precision in which a left factor is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Precision {
    /// 32 bits a number.
    Single,
    /// 16 bits a number; sums are in single precision all the same.
    Half,
}

/// A matrix in the adapter's memory, row by row.
pub(crate) struct GpuMatrix {
    buffer: wgpu::Buffer,
    /// Number of rows and of columns.
    pub shape: [usize; 2],
    precision: Precision,
}

/// Place of a product in its result.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Place {
    /// Row of C from which the product is written on.
    pub c_first: usize,
    /// Row of B from which the product reads on.
    pub b_first: usize,
    /// Whether the product is added to what is there.
    pub adds: bool,
}

impl GpuProducts {
    /// Makes the pipelines on `gpu`.
    ///
    /// # Errors
    /// The driver's words where it refuses them.
    pub fn new(gpu: GpuDevice) -> Result<GpuProducts, String> {
        let pipeline = |transposed: bool, halves: bool| {
            let number = |flag: bool| f64::from(u8::from(flag));
            let constants = [("TRANSPOSED", number(transposed)), ("HALVES", number(halves))];
            gpu.pipeline("product", include_str!("product.wgsl"), "product", &constants)
        };
        let pipelines = [false, true].map(|transposed| [false, true].map(|halves| pipeline(transposed, halves)));
        match gpu.fault() {
            Some(fault) => Err(format!("the adapter {} refuses matrix products ({fault})", gpu.name)),
            None => Ok(GpuProducts { gpu, pipelines }),
        }
    }

    /// Returns the adapter.
    pub fn gpu(&self) -> &GpuDevice {
        &self.gpu
    }

    /// Returns the rows of `columns` numbers that fit into one buffer.
    pub fn most_rows(&self, columns: usize, precision: Precision) -> usize {
        // The shader counts numbers in 32 bits.
        let of_words = u64::from(u32::MAX) / columns.max(1) as u64;
        of_words.min(self.gpu.largest_buffer() / (columns.max(1) as u64 * precision.bytes())) as usize
    }

    /// Makes a matrix of zeros; `None` where the adapter has no room for it.
    pub fn zeros(&self, shape: [usize; 2]) -> Option<GpuMatrix> {
        self.empty(shape, Precision::Single)
    }

    /// Makes a matrix that is to be written; `None` where the adapter has no room for it.
    pub fn empty(&self, shape: [usize; 2], precision: Precision) -> Option<GpuMatrix> {
        if shape[0] > self.most_rows(shape[1], precision) {
            return None;
        }
        let bytes = shape[0] as u64 * shape[1] as u64 * precision.bytes();
        // Buffers are zero until they are written.
        let buffer = self.gpu.buffer(bytes, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        self.gpu.fault().is_none().then_some(GpuMatrix { buffer, shape, precision })
    }

    /// Copies a matrix to the adapter; `None` where it has no room for it.
    pub fn upload(&self, matrix: &Array2<f32>) -> Option<GpuMatrix> {
        let made = self.empty([matrix.nrows(), matrix.ncols()], Precision::Single)?;
        self.write(&made, 0, &matrix.view());
        self.gpu.fault().is_none().then_some(made)
    }

    /// Copies `rows` into `matrix` from its row `first` on. In halves, `first` times the number of columns must be even.
    pub fn write(&self, matrix: &GpuMatrix, first: usize, rows: &ArrayView2<f32>) {
        let standard = rows.as_standard_layout();
        let values = standard.as_slice().unwrap_or_default();
        let at = (first * matrix.shape[1]) as u64 * matrix.precision.bytes();
        match matrix.precision {
            Precision::Single => self.gpu.queue.write_buffer(&matrix.buffer, at, bytemuck::cast_slice(values)),
            Precision::Half => {
                // Whole words are written; what follows the last row is not read.
                let mut halves = vec![0u16; values.len().next_multiple_of(2)];
                halves[..values.len()].reinterpret_cast_mut::<f16>().convert_from_f32_slice(values);
                self.gpu.queue.write_buffer(&matrix.buffer, at, bytemuck::cast_slice(&halves));
            }
        }
    }

    /// Submits `c (+)= a[..rows] b`, with `rows` of A, or `c (+)= a[..rows]' b` where `transposed`.
    ///
    /// Cost: `2 rows x columns of A x columns of B` operations.
    pub fn multiply(&self, a: &GpuMatrix, rows: usize, transposed: bool, b: &GpuMatrix, c: &GpuMatrix, place: Place) {
        let [out, inner] = if transposed { [a.shape[1], rows] } else { [rows, a.shape[1]] };
        let columns = b.shape[1];
        let shape = [out, columns, inner, a.shape[1], place.b_first, place.c_first, usize::from(place.adds), 0];
        let uniform = self.gpu.buffer(SHAPE_BYTES, BufferUsages::UNIFORM);
        self.gpu.queue.write_buffer(&uniform, 0, bytemuck::cast_slice(&shape.map(|number| number as u32)));
        let pipeline = &self.pipelines[usize::from(transposed)][usize::from(a.precision == Precision::Half)];
        let group = self.gpu.bind(pipeline, &[&a.buffer, &b.buffer, &c.buffer, &uniform]);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        GpuDevice::dispatch(&mut encoder, pipeline, &group, [out.div_ceil(TILE), columns.div_ceil(TILE)]);
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// Copies a matrix of singles back; `None` after an error of the driver.
    pub fn download(&self, matrix: &GpuMatrix) -> Option<Array2<f32>> {
        let [rows, columns] = matrix.shape;
        let values = self.gpu.read(&matrix.buffer, 4 * (rows * columns) as u64);
        let sound = self.gpu.fault().is_none();
        values.filter(|_| sound).and_then(|values| Array2::from_shape_vec((rows, columns), values).ok())
    }
}

impl Precision {
    /// Returns the bytes of a number.
    pub fn bytes(self) -> u64 {
        match self {
            Precision::Single => 4,
            Precision::Half => 2,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::device::GpuChoice;
    use crate::gpu::speed::open_for_test;

    fn matrix(rows: usize, columns: usize, seed: usize) -> Array2<f32> {
        Array2::from_shape_fn((rows, columns), |(i, j)| ((i * 37 + j * 101 + seed * 13) % 199) as f32 / 199.0 - 0.4)
    }

    fn largest_difference(a: &Array2<f32>, b: &Array2<f32>) -> f32 {
        assert_eq!(a.dim(), b.dim());
        a.iter().zip(b).fold(0.0, |largest, (a, b)| (a - b).abs().max(largest))
    }

    #[test]
    fn products_are_those_of_the_cpu_in_every_form_and_at_every_edge() {
        let Some(products) = open_for_test("products_are_those_of_the_cpu_in_every_form_and_at_every_edge") else {
            return;
        };
        // Sizes below, at and beyond a tile, and odd ones.
        for (rows, inner, columns) in [(1, 1, 1), (128, 8, 128), (129, 77, 131), (300, 19, 5), (7, 400, 260)] {
            let (a, b) = (matrix(rows, inner, 1), matrix(inner, columns, 2));
            let other = matrix(rows, columns, 3);
            for precision in [Precision::Single, Precision::Half] {
                let close = if precision == Precision::Half { 2e-3 } else { 2e-5 } * (inner.max(rows) as f32).sqrt();
                let left = products.empty([rows, inner], precision).unwrap();
                products.write(&left, 0, &a.view());
                let c = products.zeros([rows, columns]).unwrap();
                products.multiply(&left, rows, false, &products.upload(&b).unwrap(), &c, Place::default());
                let found = products.download(&c).unwrap();
                assert!(largest_difference(&found, &a.dot(&b)) < close, "{rows} {inner} {columns} {precision:?}");
                // Once more, added; and transposed.
                products.multiply(
                    &left,
                    rows,
                    false,
                    &products.upload(&b).unwrap(),
                    &c,
                    Place { adds: true, ..Place::default() },
                );
                assert!(largest_difference(&products.download(&c).unwrap(), &(2.0 * a.dot(&b))) < 2.0 * close);
                let z = products.zeros([inner, columns]).unwrap();
                products.multiply(&left, rows, true, &products.upload(&other).unwrap(), &z, Place::default());
                assert!(largest_difference(&products.download(&z).unwrap(), &a.t().dot(&other)) < close);
                // What is planted is seen.
                let mut wrong = found.clone();
                wrong[[rows - 1, columns - 1]] += 2.0 * close;
                assert!(largest_difference(&wrong, &a.dot(&b)) > close);
            }
        }
    }

    #[test]
    fn parts_of_a_product_are_put_together_where_they_belong() {
        let Some(products) = open_for_test("parts_of_a_product_are_put_together_where_they_belong") else { return };
        let (a, b) = (matrix(20, 30, 4), matrix(30, 9, 5));
        let right = products.upload(&b).unwrap();
        let c = products.zeros([20, 9]).unwrap();
        let y = products.upload(&matrix(20, 9, 6)).unwrap();
        let z = products.zeros([30, 9]).unwrap();
        for first in [0, 12] {
            let rows = a.slice(ndarray::s![first..(first + 12).min(20), ..]).to_owned();
            let left = products.empty([12, 30], Precision::Half).unwrap();
            products.write(&left, 0, &rows.view());
            products.multiply(&left, rows.nrows(), false, &right, &c, Place { c_first: first, ..Place::default() });
            let place = Place { b_first: first, adds: true, ..Place::default() };
            products.multiply(&left, rows.nrows(), true, &y, &z, place);
        }
        assert!(largest_difference(&products.download(&c).unwrap(), &a.dot(&b)) < 5e-3);
        assert!(largest_difference(&products.download(&z).unwrap(), &a.t().dot(&matrix(20, 9, 6))) < 5e-3);
        assert!(products.empty([usize::MAX / 8, 1], Precision::Single).is_none());
    }

    #[test]
    fn an_adapter_that_is_switched_off_has_no_products() {
        assert!(GpuDevice::open(&GpuChoice::Off).unwrap().is_err());
    }
}
