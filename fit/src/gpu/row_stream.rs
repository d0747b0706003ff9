//! Products of many rows that pass by once, block by block, on an adapter where that is quicker than on the CPU.

use crate::error::FitError;
use crate::gpu::device::{GpuChoice, GpuDevice};
use crate::gpu::product::{GpuMatrix, GpuProducts, Place, Precision};
use ndarray::Array2;
use rayon::prelude::*;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

/// Bytes of rows that are multiplied together, and as many on their way to the adapter.
pub const BATCH_BYTES: u64 = 256_000_000;
/// Share of the CPU's time that an adapter may take at most to be chosen.
const MAX_SHARE: f64 = 0.95;

/// An adapter that a fit may multiply on.
pub(crate) struct GpuRows {
    products: GpuProducts,
    /// Whether the adapter was asked for by its name: then it multiplies whatever its speed.
    named: bool,
    quicker: OnceLock<bool>,
    /// Bytes of rows that are multiplied together.
    batch_bytes: u64,
    /// Products that were finished.
    finished: AtomicUsize,
    /// Whether the adapter had no room, failed, or gave what is no number: then the CPU goes on.
    failed: AtomicBool,
}

impl GpuRows {
    /// Opens the adapter of `choice`; `Ok(Err(...))` says in words why there is none. A driver that computes on the CPU must be
    /// asked for by its name.
    ///
    /// # Errors
    /// A named adapter that does not exist, with the names of those that do.
    pub fn open(choice: &GpuChoice) -> Result<Result<GpuRows, String>, FitError> {
        let named = matches!(choice, GpuChoice::Named(_));
        Ok(GpuDevice::open(choice)?.and_then(|gpu| {
            if gpu.software && !named {
                return Err(format!("the adapter {} computes on the CPU itself", gpu.name));
            }
            Ok(GpuRows::new(GpuProducts::new(gpu)?, named, BATCH_BYTES))
        }))
    }

    fn new(products: GpuProducts, named: bool, batch_bytes: u64) -> GpuRows {
        let (finished, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
        GpuRows { products, named, quicker: OnceLock::new(), batch_bytes, finished, failed }
    }

    /// Tells what the adapter did; `None` where it was not asked.
    pub fn in_words(&self) -> Option<String> {
        let name = &self.products.gpu().name;
        let finished = self.finished.load(Ordering::Relaxed);
        if self.failed.load(Ordering::Relaxed) {
            return Some(format!("{name} has no room for the matrices or fails; the CPU multiplied what it did not"));
        }
        match (finished, self.quicker.get()) {
            (0, Some(false)) => Some(format!("the CPU multiplied all matrices: {name} was not quicker")),
            (0, _) => None,
            _ => Some(format!("matrices were multiplied on {name}")),
        }
    }

    /// Returns whether [`GpuRows::try_on`] was called, or need not be.
    pub fn is_tried(&self) -> bool {
        self.named || self.quicker.get().is_some()
    }

    /// Measures whether the adapter multiplies rows such as `block` by `right` quicker than all threads of the CPU, copies
    /// included.
    pub fn try_on(&self, block: &Array2<f32>, right: &Array2<f32>, precision: Precision) {
        self.quicker.get_or_init(|| self.measure(block, right, precision).unwrap_or(false));
    }

    /// Returns whether the adapter was found to be quicker, or was asked for by its name, and works.
    pub fn is_quicker(&self) -> bool {
        let chosen = self.named || self.quicker.get().copied().unwrap_or(false);
        chosen && !self.failed.load(Ordering::Relaxed)
    }

    /// Notes where a step of a product has failed.
    fn noted<T>(&self, step: Option<T>) -> Option<T> {
        if step.is_none() {
            self.failed.store(true, Ordering::Relaxed);
        }
        step
    }

    fn measure(&self, block: &Array2<f32>, right: &Array2<f32>, precision: Precision) -> Option<bool> {
        let threads = rayon::current_num_threads();
        let start = Instant::now();
        (0..threads).into_par_iter().for_each(|_| {
            std::hint::black_box(block.dot(right));
        });
        let cpu_s = start.elapsed().as_secs_f64() / threads as f64;
        // The first batch makes the driver ready.
        let mut gpu_s = f64::INFINITY;
        for _ in 0..2 {
            let blocks = (self.batch_rows(block.ncols(), precision) / block.nrows().max(1)).max(1);
            let start = Instant::now();
            let mut stream = RowStream::times(self, blocks * block.nrows(), right, precision)?;
            (0..blocks).try_for_each(|_| stream.push(block))?;
            stream.finish()?;
            gpu_s = start.elapsed().as_secs_f64() / blocks as f64;
        }
        // These were no products of a fit.
        self.finished.store(0, Ordering::Relaxed);
        Some(gpu_s < MAX_SHARE * cpu_s)
    }

    /// Returns the rows that are multiplied together.
    fn batch_rows(&self, columns: usize, precision: Precision) -> usize {
        let of_bytes = (self.batch_bytes / (columns.max(1) as u64 * precision.bytes())) as usize;
        // An even number: halves are copied in pairs.
        of_bytes.min(self.products.most_rows(columns, precision)) / 2 * 2
    }
}

/// A product that rows are added to one block after the other.
pub(crate) struct RowStream<'a> {
    gpu: &'a GpuRows,
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
    pub fn times(gpu: &'a GpuRows, count: usize, right: &Array2<f32>, precision: Precision) -> Option<RowStream<'a>> {
        let result = gpu.noted(gpu.products.zeros([count, right.ncols()]))?;
        RowStream::new(gpu, [count, right.nrows()], right, result, precision, false)
    }

    /// Begins `X' right`, where X are rows of `columns` numbers that are pushed, as many as `right` has; `None` where the adapter
    /// has no room for it.
    pub fn transposed_times(
        gpu: &'a GpuRows,
        columns: usize,
        right: &Array2<f32>,
        precision: Precision,
    ) -> Option<RowStream<'a>> {
        let result = gpu.noted(gpu.products.zeros([columns, right.ncols()]))?;
        RowStream::new(gpu, [right.nrows(), columns], right, result, precision, true)
    }

    fn new(
        gpu: &'a GpuRows,
        [count, columns]: [usize; 2],
        right: &Array2<f32>,
        result: GpuMatrix,
        precision: Precision,
        transposed: bool,
    ) -> Option<RowStream<'a>> {
        let batch = gpu.batch_rows(columns, precision).min(count.next_multiple_of(2));
        let left = gpu.noted((batch > 0).then(|| gpu.products.empty([batch, columns], precision)).flatten())?;
        let right = gpu.noted(gpu.products.upload(right))?;
        Some(RowStream { gpu, left, right, result, transposed, batch, first: 0, held: 0 })
    }

    /// Adds rows, an even number of them but for the last; `None` after an error of the driver.
    pub fn push(&mut self, rows: &Array2<f32>) -> Option<()> {
        let mut from = 0;
        while from < rows.nrows() {
            let some = (rows.nrows() - from).min(self.batch - self.held);
            let part = rows.slice(ndarray::s![from..from + some, ..]);
            self.gpu.products.write(&self.left, self.held, &part);
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
        self.gpu.products.multiply(&self.left, self.held, self.transposed, &self.right, &self.result, place);
        self.first += self.held;
        self.held = 0;
        // No more than a batch is on its way.
        self.gpu.noted(self.gpu.products.gpu().wait().then_some(()))
    }

    /// Returns the product of all rows; `None` after an error of the driver, and where a result is no number.
    pub fn finish(mut self) -> Option<Array2<f32>> {
        if self.held > 0 {
            self.multiply()?;
        }
        let found = self.gpu.products.download(&self.result);
        let found = self.gpu.noted(found.filter(|found| found.iter().all(|x| x.is_finite())))?;
        self.gpu.finished.fetch_add(1, Ordering::Relaxed);
        Some(found)
    }
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
        let gpu = GpuRows::new(products, false, 6 * 27 * 2);
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
        let gpu = GpuRows::new(products, false, 4096);
        assert!(!gpu.is_tried() && !gpu.is_quicker() && gpu.in_words().is_none());
        let (block, right) = (matrix(8, 16, 1), matrix(16, 4, 2));
        assert!(gpu.measure(&block, &right, Precision::Half).is_some());
        gpu.try_on(&block, &right, Precision::Half);
        assert!(gpu.is_tried() && gpu.in_words().is_none_or(|words| words.contains("was not quicker")));
        // What is no number is not taken.
        let gpu = GpuRows::new(gpu.products, true, 4096);
        assert!(gpu.is_quicker());
        let mut stream = RowStream::times(&gpu, 8, &right, Precision::Single).unwrap();
        let mut bad = block.clone();
        bad[[3, 3]] = f32::NAN;
        stream.push(&bad).unwrap();
        assert!(stream.finish().is_none() && !gpu.is_quicker());
        assert!(gpu.in_words().unwrap().contains("the CPU multiplied"));
    }
}
