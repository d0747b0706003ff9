//! Speed of products on an adapter, as `btf-fit bench gemm` tells it.

use crate::error::FitError;
#[cfg(test)]
use crate::gpu::device::gpu_is_left_out;
use crate::gpu::device::{GpuChoice, GpuDevice};
use crate::gpu::product::{GpuProducts, Place, Precision};
use crate::matrix_product::product;
use ndarray::Array2;
use serde::Serialize;
use std::time::Instant;
use wgpu::BufferUsages;

/// Threads and operations of each in a pass of the shader that measures the peak. Twin: `ROUNDS` in speed.wgsl.
const PEAK_THREADS: [usize; 2] = [256 * 4096, 256 * 16];
const PEAK_OPERATIONS: f64 = 512.0 * 8.0 * 4.0 * 2.0;

/// Numbers of a matrix at most: 4 GB in single precision.
const MAX_NUMBERS: usize = 1_000_000_000;

/// Speed of a product.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProductSpeed {
    /// `single` or `half`: how the left factor is stored.
    pub precision: &'static str,
    /// Whether the left factor is stored by columns.
    pub transposed: bool,
    /// Rows of C, length of the sums, columns of C.
    pub size: [usize; 3],
    /// Billions of operations a second, factors and result in the adapter's memory.
    pub gflops: f64,
    /// Billions of operations a second with the left factor copied to the adapter each time.
    pub gflops_with_copy: f64,
    /// Share of the adapter's peak, without copying.
    pub share_of_peak: f64,
    /// Billions of operations a second of this product on all threads of the CPU.
    pub cpu_gflops: f64,
}

/// Speeds of an adapter. The names are the keys of `bench gemm --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GemmBench {
    /// Name of the adapter.
    pub adapter: String,
    /// Whether it computes on the CPU.
    pub software: bool,
    /// Billions of operations a second of fused multiply-adds in registers.
    pub peak_gflops: f64,
    /// The products.
    pub products: Vec<ProductSpeed>,
}

/// Measures products of `[rows, inner, columns]` on the adapter of `choice`; `Ok(Err(...))` says in words why there is none. Each time
/// is the least of `repeats`.
///
/// # Errors
/// A named adapter that does not exist.
pub fn bench_gemm(choice: &GpuChoice, size: [usize; 3], repeats: usize) -> Result<Result<GemmBench, String>, FitError> {
    let products = match GpuDevice::open(choice)?.and_then(GpuProducts::new) {
        Ok(products) => products,
        Err(reason) => return Ok(Err(reason)),
    };
    let gpu = products.gpu();
    let Some(peak_gflops) = peak(gpu, repeats) else {
        return Ok(Err(format!("the adapter {} fails", gpu.name)));
    };
    let [rows, inner, columns] = size;
    for (a, b) in [(rows, inner), (inner, rows), (inner, columns), (rows, columns)] {
        if a > products.most_rows(b, Precision::Single) || a * b > MAX_NUMBERS {
            return Ok(Err(format!("a matrix of {a} x {b} numbers is too large for {} or for this bench", gpu.name)));
        }
    }
    let mut speeds = Vec::new();
    for transposed in [false, true] {
        for precision in [Precision::Single, Precision::Half] {
            match of_product(&products, size, transposed, precision, repeats, peak_gflops) {
                Some(speed) => speeds.push(speed),
                None => return Ok(Err(format!("the adapter {} fails at a product", gpu.name))),
            }
        }
    }
    Ok(Ok(GemmBench { adapter: gpu.name.clone(), software: gpu.software, peak_gflops, products: speeds }))
}

/// Returns the least of `repeats` times of `work`, in seconds, after one that does not count.
fn least(repeats: usize, mut work: impl FnMut() -> bool) -> Option<f64> {
    let mut least = f64::INFINITY;
    for round in 0..=repeats.max(1) {
        let start = Instant::now();
        if !work() {
            return None;
        }
        if round > 0 {
            least = least.min(start.elapsed().as_secs_f64());
        }
    }
    Some(least)
}

fn of_product(
    products: &GpuProducts,
    size: [usize; 3],
    transposed: bool,
    precision: Precision,
    repeats: usize,
    peak_gflops: f64,
) -> Option<ProductSpeed> {
    let [rows, inner, columns] = size;
    let value = |i: usize, j: usize| ((i * 31 + j * 17) % 97) as f32 / 97.0;
    let [stored_rows, stored_columns] = if transposed { [inner, rows] } else { [rows, inner] };
    let a = Array2::from_shape_fn((stored_rows, stored_columns), |(i, j)| value(i, j));
    let b = Array2::from_shape_fn((inner, columns), |(i, j)| value(j, i));
    let left = products.empty([stored_rows, stored_columns], precision)?;
    let (right, c) = (products.upload(&b)?, products.zeros([rows, columns])?);
    products.write(&left, 0, &a.view());
    let multiply = |copies: bool| {
        if copies {
            products.write(&left, 0, &a.view());
        }
        products.multiply(&left, stored_rows, transposed, &right, &c, Place::default());
        products.gpu().wait() && products.gpu().fault().is_none()
    };
    let operations = 2e-9 * (rows * inner * columns) as f64;
    let gflops = operations / least(repeats, || multiply(false))?;
    let gflops_with_copy = operations / least(repeats, || multiply(true))?;
    let cpu_gflops = operations / least(repeats, || cpu_product(&a, transposed, &b))?;
    Some(ProductSpeed {
        precision: if precision == Precision::Half { "half" } else { "single" },
        transposed,
        size,
        gflops,
        gflops_with_copy,
        share_of_peak: gflops / peak_gflops,
        cpu_gflops,
    })
}

/// Multiplies on all threads of the CPU, a share of the rows on each.
fn cpu_product(a: &Array2<f32>, transposed: bool, b: &Array2<f32>) -> bool {
    use ndarray::{Axis, parallel::prelude::*};
    let a = if transposed { a.t() } else { a.view() };
    let share = a.nrows().div_ceil(rayon::current_num_threads()).max(1);
    a.axis_chunks_iter(Axis(0), share).into_par_iter().for_each(|rows| {
        std::hint::black_box(product(&rows, b));
    });
    true
}

/// Returns the billions of operations a second of fused multiply-adds in registers.
fn peak(gpu: &GpuDevice, repeats: usize) -> Option<f64> {
    let threads = PEAK_THREADS[usize::from(gpu.software)];
    let pipeline = gpu.pipeline("peak", include_str!("speed.wgsl"), "peak", &[]);
    let found = gpu.buffer(4 * threads as u64, BufferUsages::STORAGE);
    let group = gpu.bind(&pipeline, &[&found]);
    let seconds = least(repeats, || {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        GpuDevice::dispatch(&mut encoder, &pipeline, &group, [threads / 256, 1]);
        gpu.queue.submit([encoder.finish()]);
        gpu.wait() && gpu.fault().is_none()
    })?;
    Some(1e-9 * PEAK_OPERATIONS * threads as f64 / seconds)
}

/// Opens the best adapter for a test; `None` where `BTF_SKIP_GPU=1` leaves GPU tests out, which is noted as a skipped test.
///
/// # Panics
/// If no adapter answers.
#[cfg(test)]
pub(crate) fn open_for_test(test: &str) -> Option<GpuProducts> {
    if gpu_is_left_out(test) {
        return None;
    }
    let opened = GpuDevice::open(&GpuChoice::Best).unwrap().and_then(GpuProducts::new);
    Some(opened.unwrap_or_else(|reason| panic!("{reason}; BTF_SKIP_GPU=1 skips this test")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_timed_as_shares_of_the_peak() {
        if open_for_test("products_are_timed_as_shares_of_the_peak").is_none() {
            return;
        }
        let found = bench_gemm(&GpuChoice::Best, [64, 96, 40], 1).unwrap().unwrap();
        assert_eq!(found.products.len(), 4);
        assert!(found.peak_gflops > 0.0);
        for speed in &found.products {
            assert!(
                speed.gflops > 0.0 && speed.cpu_gflops > 0.0 && (0.0..1.0).contains(&speed.share_of_peak),
                "{speed:?}"
            );
        }
    }
}
