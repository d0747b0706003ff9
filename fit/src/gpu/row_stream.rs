//! Products of many rows that pass by once, block by block, on an adapter.

use crate::gpu::fit_gpu::{FitGpu, MAX_SHARE};
use crate::gpu::product::{GpuMatrix, Place, Precision};
use crate::matrix_product::product;
use ndarray::Array2;
use rayon::prelude::*;
use std::time::Instant;

/// A product that rows are added to one block after the other.
pub(crate) struct RowStream<'a> {
    gpu: &'a FitGpu,
    left: GpuMatrix,
    right: GpuMatrix,
    result: GpuMatrix,
    transposed: bool,
    /// Rows of `left`.
    batch: usize,
    /// First row of the batch, and rows of it that are there.
    first: usize,
    held: usize,
}

impl<'a> RowStream<'a> {
    /// Begins `X right`, where X are `count` rows that are pushed; `None` where the adapter has no room for it.
    pub fn times(gpu: &'a FitGpu, count: usize, right: &Array2<f32>, precision: Precision) -> Option<RowStream<'a>> {
        let result = gpu.noted(gpu.products().zeros([count, right.ncols()]))?;
        RowStream::new(gpu, [count, right.nrows()], right, result, precision, false)
    }

    /// Begins `X' right`, where X are rows of `columns` numbers that are pushed, as many as `right` has; `None` where the adapter
    /// has no room for it.
    pub fn transposed_times(
        gpu: &'a FitGpu,
        columns: usize,
        right: &Array2<f32>,
        precision: Precision,
    ) -> Option<RowStream<'a>> {
        let result = gpu.noted(gpu.products().zeros([columns, right.ncols()]))?;
        RowStream::new(gpu, [right.nrows(), columns], right, result, precision, true)
    }

    fn new(
        gpu: &'a FitGpu,
        [count, columns]: [usize; 2],
        right: &Array2<f32>,
        result: GpuMatrix,
        precision: Precision,
        transposed: bool,
    ) -> Option<RowStream<'a>> {
        let batch = gpu.batch_rows(columns, precision).min(count.next_multiple_of(2));
        let left = gpu.noted((batch > 0).then(|| gpu.products().empty([batch, columns], precision)).flatten())?;
        let right = gpu.noted(gpu.products().upload(right))?;
        Some(RowStream { gpu, left, right, result, transposed, batch, first: 0, held: 0 })
    }

    /// Adds rows, an even number of them but for the last; `None` after an error of the driver.
    pub fn push(&mut self, rows: &Array2<f32>) -> Option<()> {
        let mut from = 0;
        while from < rows.nrows() {
            let some = (rows.nrows() - from).min(self.batch - self.held);
            let part = rows.slice(ndarray::s![from..from + some, ..]);
            self.gpu.products().write(&self.left, self.held, &part);
            self.held += some;
            from += some;
            if self.held == self.batch {
                self.multiply()?;
            }
        }
        Some(())
    }

    /// Multiplies the rows that are there.
    fn multiply(&mut self) -> Option<()> {
        let place = if self.transposed {
            Place { b_first: self.first, adds: true, ..Place::default() }
        } else {
            Place { c_first: self.first, ..Place::default() }
        };
        self.gpu.products().multiply(&self.left, self.held, self.transposed, &self.right, &self.result, place);
        self.first += self.held;
        self.held = 0;
        // No more than a batch is on its way.
        self.gpu.noted(self.gpu.device().wait().then_some(()))
    }

    /// Returns the product of all rows; `None` after an error of the driver, and where a result is no number.
    pub fn finish(mut self) -> Option<Array2<f32>> {
        if self.held > 0 {
            self.multiply()?;
        }
        let found = self.gpu.products().download(&self.result);
        let found = self.gpu.noted(found.filter(|found| found.iter().all(|x| x.is_finite())))?;
        self.gpu.note_product();
        Some(found)
    }
}

/// Measures whether `gpu` multiplies rows such as `block` by `right` quicker than all threads of the CPU, copies included, and
/// has it note that.
pub(crate) fn try_on(gpu: &FitGpu, block: &Array2<f32>, right: &Array2<f32>, precision: Precision) {
    gpu.note_speed(|| is_quicker(gpu, block, right, precision).unwrap_or(false));
}

fn is_quicker(gpu: &FitGpu, block: &Array2<f32>, right: &Array2<f32>, precision: Precision) -> Option<bool> {
    let threads = rayon::current_num_threads();
    let start = Instant::now();
    (0..threads).into_par_iter().for_each(|_| {
        std::hint::black_box(product(block, right));
    });
    let cpu_s = start.elapsed().as_secs_f64() / threads as f64;
    // The first batch makes the driver ready.
    let mut gpu_s = f64::INFINITY;
    for _ in 0..2 {
        let blocks = (gpu.batch_rows(block.ncols(), precision) / block.nrows().max(1)).max(1);
        let start = Instant::now();
        let mut stream = RowStream::times(gpu, blocks * block.nrows(), right, precision)?;
        (0..blocks).try_for_each(|_| stream.push(block))?;
        stream.finish()?;
        gpu_s = start.elapsed().as_secs_f64() / blocks as f64;
    }
    Some(gpu_s < MAX_SHARE * cpu_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::speed::open_for_test;

    fn matrix(rows: usize, columns: usize, seed: usize) -> Array2<f32> {
        Array2::from_shape_fn((rows, columns), |(i, j)| ((i * 29 + j * 83 + seed * 17) % 211) as f32 / 211.0 - 0.5)
    }

    #[test]
    fn rows_that_pass_in_blocks_and_batches_give_the_whole_product() {
        let Some(products) = open_for_test("rows_that_pass_in_blocks_and_batches_give_the_whole_product") else {
            return;
        };
        // Batches of six rows of 27 halves or of three, made even, of singles; blocks of four rows and an odd last one.
        let gpu = FitGpu::new(products, false, 6 * 27 * 2);
        let (rows, right, other) = (matrix(23, 27, 1), matrix(27, 5, 2), matrix(23, 5, 3));
        let largest = |a: &Array2<f32>, b: &Array2<f32>| a.iter().zip(b).fold(0.0f32, |m, (a, b)| m.max((a - b).abs()));
        for (precision, close) in [(Precision::Half, 4e-3), (Precision::Single, 1e-5)] {
            let mut times = RowStream::times(&gpu, 23, &right, precision).unwrap();
            let mut back = RowStream::transposed_times(&gpu, 27, &other, precision).unwrap();
            for first in (0..23).step_by(4) {
                let block = rows.slice(ndarray::s![first..(first + 4).min(23), ..]).to_owned();
                times.push(&block).unwrap();
                back.push(&block).unwrap();
            }
            let (times, back) = (times.finish().unwrap(), back.finish().unwrap());
            assert!(largest(&times, &rows.dot(&right)) < close, "{precision:?}");
            assert!(largest(&back, &rows.t().dot(&other)) < close, "{precision:?}");
            assert!(largest(&times, &matrix(23, 27, 4).dot(&right)) > close);
        }
        assert!(gpu.in_words().unwrap().starts_with("matrices were multiplied on "));
    }

    #[test]
    fn an_adapter_is_chosen_by_its_speed_and_not_again_after_a_failure() {
        let Some(products) = open_for_test("an_adapter_is_chosen_by_its_speed_and_not_again_after_a_failure") else {
            return;
        };
        let gpu = FitGpu::new(products, false, 4096);
        assert!(!gpu.is_tried() && !gpu.is_quicker() && gpu.in_words().is_none());
        let (block, right) = (matrix(8, 16, 1), matrix(16, 4, 2));
        assert!(is_quicker(&gpu, &block, &right, Precision::Half).is_some());
        try_on(&gpu, &block, &right, Precision::Half);
        assert!(gpu.is_tried() && gpu.in_words().is_none_or(|words| words.contains("was not quicker")));
        // What is no number is not taken.
        let Some(products) = open_for_test("an_adapter_is_chosen_by_its_speed_and_not_again_after_a_failure") else {
            return;
        };
        let gpu = FitGpu::new(products, true, 4096);
        assert!(gpu.is_quicker());
        let mut stream = RowStream::times(&gpu, 8, &right, Precision::Single).unwrap();
        let mut bad = block.clone();
        bad[[3, 3]] = f32::NAN;
        stream.push(&bad).unwrap();
        assert!(stream.finish().is_none() && !gpu.is_quicker());
        assert!(gpu.in_words().unwrap().contains("the CPU multiplied"));
    }
}
