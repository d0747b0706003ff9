//! Error of batches of pairs, on the CPU or on an adapter where that is quicker.

use crate::gpu::fit_gpu::{FitGpu, MAX_SHARE};
use crate::measure::gpu_errors::{GpuErrors, Pending};
use crate::measure::image_decoder::ImageDecoder;
use crate::measure::tile_errors::{Coding, PairWork, TileErrors};
use rayon::prelude::*;
use std::time::Instant;

/// Largest relative difference between the squared differences that the CPU and an adapter count in a batch.
const MAX_DIFFERENCE: f64 = 1e-3;

/// Sums over the batches so far.
pub(crate) struct BatchErrors<'a> {
    decoder: &'a ImageDecoder<'a>,
    coding: &'a Coding,
    /// Sums of each tile.
    pub tiles: Vec<TileErrors>,
    /// Sum of squared differences of 8-bit values, per pair of the capture.
    pub pairs: Vec<u64>,
    adapter: Option<Adapter<'a>>,
}

/// An adapter that may measure.
struct Adapter<'a> {
    fit: &'a FitGpu,
    errors: GpuErrors<'a>,
    /// Whether the first batch found it good enough; `None` before it.
    chosen: Option<Result<(), &'static str>>,
    /// Batch that it is measuring.
    busy: Option<(Pending, Vec<PairWork>)>,
}

impl<'a> BatchErrors<'a> {
    /// Begins with no batch. The capture has `lights` lights and `pairs` pairs, a batch at most `most`.
    pub fn new(
        decoder: &'a ImageDecoder<'a>,
        coding: &'a Coding,
        [lights, pairs, most]: [usize; 3],
        gpu: Option<&'a FitGpu>,
    ) -> BatchErrors<'a> {
        let adapter = gpu.filter(|_| coding.is_plain()).and_then(|fit| {
            let errors = GpuErrors::new(fit.device(), decoder, coding, lights, most);
            if errors.is_none() {
                fit.note_measured(Err("has no room for it"));
            }
            Some(Adapter { fit, errors: errors?, chosen: None, busy: None })
        });
        let (tiles, pairs) = (vec![TileErrors::default(); decoder.tiles().len()], vec![0; pairs]);
        BatchErrors { decoder, coding, tiles, pairs, adapter }
    }

    /// Adds `batch`. On an adapter it is measured while the caller prepares the next one.
    pub fn take(&mut self, batch: Vec<PairWork>) {
        let Some(mut adapter) = self.adapter.take().filter(|_| GpuErrors::takes(&batch)) else {
            return self.take_on_cpu(&batch);
        };
        if adapter.chosen.is_none() {
            let start = Instant::now();
            self.take_on_cpu(&batch);
            let chosen = self.is_good(&adapter, &batch, start.elapsed().as_secs_f64());
            adapter.fit.note_measured(chosen);
            adapter.chosen = Some(chosen);
            self.adapter = Some(adapter).filter(|_| chosen.is_ok());
            return;
        }
        let before = adapter.busy.replace((adapter.errors.submit(&batch), batch));
        self.adapter = Some(adapter);
        self.collect(before);
    }

    /// Adds what an adapter is still measuring.
    pub fn finish(&mut self) {
        let busy = self.adapter.as_mut().and_then(|adapter| adapter.busy.take());
        self.collect(busy);
    }

    /// Adds a batch that an adapter was measuring; where it failed, on the CPU.
    fn collect(&mut self, busy: Option<(Pending, Vec<PairWork>)>) {
        let Some((pending, batch)) = busy else { return };
        let found = self
            .adapter
            .as_ref()
            .and_then(|adapter| adapter.errors.collect(pending, &batch, self.decoder, self.coding, &mut self.tiles));
        let Some(errors) = found else { return self.take_on_cpu(&batch) };
        batch.iter().zip(errors).for_each(|(work, error)| self.pairs[work.pair] += error);
    }

    fn take_on_cpu(&mut self, batch: &[PairWork]) {
        let (decoder, coding) = (self.decoder, self.coding);
        let errors: Vec<Vec<u64>> = self
            .tiles
            .par_iter_mut()
            .enumerate()
            .map(|(number, errors)| errors.take(decoder, number, coding, batch))
            .collect();
        for errors in errors {
            batch.iter().zip(errors).for_each(|(work, error)| self.pairs[work.pair] += error);
        }
    }

    /// Returns whether the adapter finds the errors of `batch`, which took the CPU `cpu_s`, and in less time; or why it is not
    /// taken.
    fn is_good(&self, adapter: &Adapter, batch: &[PairWork], cpu_s: f64) -> Result<(), &'static str> {
        let mut gpu_s = f64::INFINITY;
        // The first time makes the driver ready.
        for _ in 0..2 {
            let start = Instant::now();
            let mut tiles = vec![TileErrors::default(); self.tiles.len()];
            let pending = adapter.errors.submit(batch);
            let found = adapter.errors.collect(pending, batch, self.decoder, self.coding, &mut tiles);
            let found = found.ok_or("fails")?.iter().sum::<u64>() as f64;
            gpu_s = start.elapsed().as_secs_f64();
            let counted = batch.iter().map(|work| self.pairs[work.pair]).sum::<u64>() as f64;
            if (found - counted).abs() > MAX_DIFFERENCE * counted.max(1.0) {
                return Err("counts another error");
            }
        }
        let is_quicker = adapter.fit.is_named() || gpu_s < MAX_SHARE * cpu_s;
        is_quicker.then_some(()).ok_or("was not quicker")
    }
}
