//! Products of many rows that pass by once, block by block, on an adapter where that is quicker than on the CPU.

use crate::error::FitError;
use crate::gpu::device::{GpuChoice, GpuDevice};
use crate::gpu::product::{GpuMatrix, GpuProducts, Place, Precision};
use ndarray::Array2;
use rayon::prelude::*;
use std::sync::OnceLock;
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
            Ok(GpuRows { products: GpuProducts::new(gpu)?, named, quicker: OnceLock::new() })
        }))
    }

    /// Returns the name of the adapter.
    pub fn name(&self) -> &str {
        &self.products.gpu().name
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

    /// Returns whether the adapter was found to be quicker, or was asked for by its name.
    pub fn is_quicker(&self) -> bool {
        self.named || self.quicker.get().copied().unwrap_or(false)
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
            let blocks = self.batch_rows(block.ncols(), precision) / block.nrows().max(1);
            let start = Instant::now();
            let mut stream = RowStream::times(self, blocks * block.nrows(), right, precision)?;
            (0..blocks).try_for_each(|_| stream.push(block))?;
            stream.finish()?;
            gpu_s = start.elapsed().as_secs_f64() / blocks.max(1) as f64;
        }
        Some(gpu_s < MAX_SHARE * cpu_s)
    }

    /// Returns the rows that are multiplied together.
    fn batch_rows(&self, columns: usize, precision: Precision) -> usize {
        let of_bytes = (BATCH_BYTES / (columns.max(1) as u64 * precision.bytes())) as usize;
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
        let result = gpu.products.zeros([count, right.ncols()])?;
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
        let result = gpu.products.zeros([columns, right.ncols()])?;
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
        if batch == 0 {
            return None;
        }
        let left = gpu.products.empty([batch, columns], precision)?;
        let right = gpu.products.upload(right)?;
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
        self.gpu.products.gpu().wait().then_some(())
    }

    /// Returns the product of all rows; `None` after an error of the driver.
    pub fn finish(mut self) -> Option<Array2<f32>> {
        if self.held > 0 {
            self.multiply()?;
        }
        self.gpu.products.download(&self.result)
    }
}
