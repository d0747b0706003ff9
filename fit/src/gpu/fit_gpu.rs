//! The adapter that a fit computes on, where that is quicker than on the CPU.

use crate::error::FitError;
use crate::gpu::device::{GpuChoice, GpuDevice};
use crate::gpu::product::{GpuProducts, Precision};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Bytes of rows that are multiplied together, and as many on their way to the adapter.
pub const BATCH_BYTES: u64 = 256_000_000;
/// Share of the CPU's time that an adapter may take at most to be chosen.
pub(crate) const MAX_SHARE: f64 = 0.95;

/// An adapter that a fit may compute on.
pub(crate) struct FitGpu {
    products: GpuProducts,
    /// Whether the adapter was asked for by its name: then it computes whatever its speed.
    named: bool,
    quicker: OnceLock<bool>,
    /// Bytes of rows that are multiplied together.
    batch_bytes: u64,
    /// Products that were finished.
    finished: AtomicUsize,
    /// Whether the adapter had no room, failed, or gave what is no number: then the CPU goes on.
    failed: AtomicBool,
    /// Batches of pairs whose error the adapter measured.
    measured: AtomicUsize,
    /// Why it did not measure others.
    refused: OnceLock<&'static str>,
}

impl FitGpu {
    /// Opens the adapter of `choice`; `Ok(Err(...))` says in words why there is none. A driver that computes on the CPU must be
    /// asked for by its name.
    ///
    /// # Errors
    /// A named adapter that does not exist, with the names of those that do.
    pub fn open(choice: &GpuChoice) -> Result<Result<FitGpu, String>, FitError> {
        let named = matches!(choice, GpuChoice::Named(_));
        Ok(GpuDevice::open(choice)?.and_then(|gpu| {
            if gpu.software && !named {
                return Err(format!("the adapter {} computes on the CPU itself", gpu.name));
            }
            Ok(FitGpu::new(GpuProducts::new(gpu)?, named, BATCH_BYTES))
        }))
    }

    /// Returns `products` as the adapter of a fit that multiplies `batch_bytes` of rows together.
    pub fn new(products: GpuProducts, named: bool, batch_bytes: u64) -> FitGpu {
        let (finished, failed) = (AtomicUsize::new(0), AtomicBool::new(false));
        FitGpu {
            products,
            named,
            quicker: OnceLock::new(),
            batch_bytes,
            finished,
            failed,
            measured: AtomicUsize::new(0),
            refused: OnceLock::new(),
        }
    }

    /// Tells what the adapter did; `None` where it was not asked.
    pub fn in_words(&self) -> Option<String> {
        let name = &self.device().name;
        let finished = self.finished.load(Ordering::Relaxed);
        let products = match (finished, self.quicker.get()) {
            _ if self.has_failed() => {
                Some(format!("{name} has no room for the matrices or fails; the CPU multiplied what it did not"))
            }
            (0, Some(false)) => Some(format!("the CPU multiplied all matrices: {name} was not quicker")),
            (0, _) => None,
            _ => Some(format!("matrices were multiplied on {name}")),
        };
        let error = match (self.measured.load(Ordering::Relaxed), self.refused.get()) {
            (0, None) => None,
            (_, None) => Some(format!("the error was measured on {name}")),
            (0, Some(because)) => Some(format!("the CPU measured the error: {name} {because}")),
            (_, Some(because)) => Some(format!("the error was measured on {name} in part: it {because}")),
        };
        let sentences: Vec<String> = products.into_iter().chain(error).collect();
        (!sentences.is_empty()).then(|| sentences.join("; "))
    }

    /// Returns the adapter.
    pub fn device(&self) -> &GpuDevice {
        self.products.gpu()
    }

    /// Returns the products on the adapter.
    pub fn products(&self) -> &GpuProducts {
        &self.products
    }

    /// Returns whether the adapter was asked for by its name.
    pub fn is_named(&self) -> bool {
        self.named
    }

    /// Returns whether it is known if products are quicker on the adapter, or need not be.
    pub fn is_tried(&self) -> bool {
        self.named || self.quicker.get().is_some()
    }

    /// Notes whether products are quicker on the adapter, as `measure` finds it the first time.
    pub fn note_speed(&self, measure: impl FnOnce() -> bool) {
        self.quicker.get_or_init(|| {
            let quicker = measure();
            // Those were no products of a fit.
            self.finished.store(0, Ordering::Relaxed);
            quicker
        });
    }

    /// Returns whether the adapter multiplies: it was found to be quicker, or was asked for by its name, and works.
    pub fn is_quicker(&self) -> bool {
        let chosen = self.named || self.quicker.get().copied().unwrap_or(false);
        chosen && !self.has_failed()
    }

    /// Notes that a product was finished.
    pub fn note_product(&self) {
        self.finished.fetch_add(1, Ordering::Relaxed);
    }

    /// Returns whether a product failed.
    pub fn has_failed(&self) -> bool {
        self.failed.load(Ordering::Relaxed)
    }

    /// Notes that the adapter measured the error of a batch of pairs.
    pub fn note_measured(&self) {
        self.measured.fetch_add(1, Ordering::Relaxed);
    }

    /// Notes that the adapter does not measure errors, with a verb phrase that says why; the first one counts.
    pub fn note_refused(&self, because: &'static str) {
        let _ = self.refused.set(because);
    }

    /// Notes where a step of a product has failed.
    pub fn noted<T>(&self, step: Option<T>) -> Option<T> {
        if step.is_none() {
            self.failed.store(true, Ordering::Relaxed);
        }
        step
    }

    /// Returns the rows that are multiplied together.
    pub fn batch_rows(&self, columns: usize, precision: Precision) -> usize {
        let of_bytes = (self.batch_bytes / (columns.max(1) as u64 * precision.bytes())) as usize;
        // An even number: halves are copied in pairs.
        of_bytes.min(self.products.most_rows(columns, precision)) / 2 * 2
    }
}
