//! Error of batches of pairs, on the CPU or on an adapter where that is quicker. Every batch is counted once, whatever fails.

use crate::gpu::fit_gpu::{FitGpu, MAX_SHARE};
use crate::measure::batch_sizes::BatchSizes;
use crate::measure::gpu_errors::{GpuErrors, Pending};
use crate::measure::image_decoder::ImageDecoder;
use crate::measure::tile_errors::{Coding, PairWork, TileErrors};
use rayon::prelude::*;
use std::time::Instant;

/// Largest relative difference between what the CPU and an adapter find in a batch.
const MAX_DIFFERENCE: f64 = 1e-3;

/// Sums over the batches so far.
pub(crate) struct BatchErrors<'a> {
    decoder: &'a ImageDecoder<'a>,
    coding: &'a Coding,
    /// Sums of each tile.
    tiles: Vec<TileErrors>,
    /// Sum of squared differences of 8-bit values, per pair of the capture.
    pairs: Vec<u64>,
    adapter: Option<Adapter<'a>>,
}

/// An adapter that may measure.
struct Adapter<'a> {
    fit: &'a FitGpu,
    errors: GpuErrors<'a>,
    /// Whether the first batch found it good enough.
    is_chosen: bool,
    /// Batch that it is measuring.
    busy: Option<(Pending, Vec<PairWork>)>,
}

impl<'a> BatchErrors<'a> {
    /// Begins with no batch, and with `gpu` if it can measure and more than one batch will come.
    pub fn new(
        decoder: &'a ImageDecoder<'a>,
        coding: &'a Coding,
        sizes: BatchSizes,
        gpu: Option<&'a FitGpu>,
    ) -> BatchErrors<'a> {
        let may = |fit: &&FitGpu| coding.is_of_codes() && !fit.has_failed() && sizes.measured > sizes.batch;
        let adapter = gpu.filter(may).and_then(|fit| {
            let made = GpuErrors::new(fit.device(), decoder, coding, sizes);
            made.map_err(|because| fit.note_refused(because)).ok().map(|errors| Adapter {
                fit,
                errors,
                is_chosen: false,
                busy: None,
            })
        });
        let (tiles, pairs) = (vec![TileErrors::default(); decoder.tiles().len()], vec![0; sizes.pairs]);
        BatchErrors { decoder, coding, tiles, pairs, adapter }
    }

    /// Adds `batch`. On an adapter it is measured while the caller prepares the next one.
    pub fn take(&mut self, batch: Vec<PairWork>) {
        self.collect();
        match self.adapter.as_mut().filter(|_| GpuErrors::takes(&batch)) {
            None => self.take_on_cpu(&batch),
            Some(adapter) if adapter.is_chosen => adapter.busy = Some((adapter.errors.submit(&batch), batch)),
            Some(_) => self.take_on_both(&batch),
        }
    }

    /// Adds what an adapter is still measuring, and returns the sums of each tile and those of squared differences of 8-bit values
    /// of each pair of the capture.
    pub fn finish(mut self) -> (Vec<TileErrors>, Vec<u64>) {
        self.collect();
        (self.tiles, self.pairs)
    }

    /// Adds the batch that the adapter was measuring, if any; where it failed, on the CPU, as everything that follows.
    fn collect(&mut self) {
        let Some(adapter) = &mut self.adapter else { return };
        let Some((pending, batch)) = adapter.busy.take() else { return };
        match adapter.errors.collect(pending, &batch, self.decoder, self.coding, &mut self.tiles) {
            Some(errors) => {
                adapter.fit.note_measured();
                batch.iter().zip(errors).for_each(|(work, error)| self.pairs[work.pair] += error);
            }
            None => {
                adapter.fit.note_refused("fails");
                self.adapter = None;
                self.take_on_cpu(&batch);
            }
        }
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

    /// Adds the first batch on the CPU, and chooses the adapter if it finds the same in less time.
    fn take_on_both(&mut self, batch: &[PairWork]) {
        let before = self.tiles.clone();
        let start = Instant::now();
        self.take_on_cpu(batch);
        let cpu_s = start.elapsed().as_secs_f64();
        let Some(mut adapter) = self.adapter.take() else { return };
        // The first time makes the driver ready.
        let tried = self.seconds_on(&adapter, batch, &before).and_then(|_| self.seconds_on(&adapter, batch, &before));
        let is_quick = |gpu_s: f64| adapter.fit.is_named() || gpu_s < MAX_SHARE * cpu_s;
        match tried.and_then(|gpu_s| is_quick(gpu_s).then_some(()).ok_or("was not quicker")) {
            Ok(()) => {
                adapter.is_chosen = true;
                self.adapter = Some(adapter);
            }
            Err(because) => adapter.fit.note_refused(because),
        }
    }

    /// Returns the seconds in which `adapter` measures `batch`, which the CPU has added to the tiles that were `before`; or why not.
    fn seconds_on(&self, adapter: &Adapter, batch: &[PairWork], before: &[TileErrors]) -> Result<f64, &'static str> {
        let mut tiles = before.to_vec();
        let start = Instant::now();
        let pending = adapter.errors.submit(batch);
        let found = adapter.errors.collect(pending, batch, self.decoder, self.coding, &mut tiles).ok_or("fails")?;
        let seconds = start.elapsed().as_secs_f64();
        let is_same = |(work, error): (&PairWork, u64)| is_near(self.pairs[work.pair] as f64, error as f64);
        let agrees = batch.iter().zip(found).all(is_same) && are_alike(&self.tiles, &tiles);
        agrees.then_some(seconds).ok_or("finds other errors")
    }
}

/// Returns whether two counts of squared differences are the same but for a few codes at the border of two values.
fn is_near(a: f64, b: f64) -> bool {
    (a - b).abs() <= MAX_DIFFERENCE * a.max(b) + 64.0
}

/// Returns whether the sums over all tiles are the same but for rounding.
fn are_alike(a: &[TileErrors], b: &[TileErrors]) -> bool {
    let sums = |tiles: &[TileErrors]| {
        tiles.iter().fold([0.0; 4], |mut all: [f64; 4], tile| {
            let own = tile.sums();
            let of_tile = [tile.linear_error.iter().sum(), own.linear_square, own.linear_sum, own.decoded_sum];
            all.iter_mut().zip(of_tile).for_each(|(sum, x): (&mut f64, f64)| *sum += x);
            all
        })
    };
    let (a, b) = (sums(a), sums(b));
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= MAX_DIFFERENCE * a.abs().max(b.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::speed::open_for_test;
    use crate::measure::image_decoder::Spot;
    use crate::measure::tile_errors::TiledImage;
    use crate::sample_asset::{number, sample_asset_with};
    use btf_capture::{CaptureInfo, DirectionSet, ImageFormat, Pixels};
    use btf_runtime::{DecodeOptions, Resident, ResidualKind};

    #[test]
    fn every_batch_is_counted_once_also_where_an_adapter_fails_or_cannot_take_one() {
        let test = "every_batch_is_counted_once_also_where_an_adapter_fails_or_cannot_take_one";
        let Some(products) = open_for_test(test) else { return };
        let gpu = FitGpu::new(products, true, 4096);
        let (views, lights) = (DirectionSet::random(4, 3).unwrap(), DirectionSet::random(5, 4).unwrap());
        let asset = sample_asset_with(21, 13, &views, &lights, ResidualKind::Root);
        let resident = Resident::from_asset(&asset);
        let decoder = ImageDecoder::new(&asset, &resident, 0, &DecodeOptions::default());
        let info = CaptureInfo::new("sample", 21, 13, views, lights, ImageFormat::Png);
        let coding = Coding::new(&info, None);
        let batch = |first: usize, is_linear: bool| -> Vec<PairWork> {
            let work = |pair: usize| {
                let values = (0..21 * 13 * 3).map(|i| 0.5 + 0.5 * number(pair * 1000 + i));
                let pixels = match is_linear {
                    true => Pixels::Linear(values.collect()),
                    false => Pixels::Encoded8(values.map(|x| (255.0 * x) as u8).collect()),
                };
                let plan = decoder.plan(Spot::Measured(pair / 5), Spot::Measured(pair % 5));
                PairWork {
                    pair,
                    light: pair % 5,
                    plan,
                    images: TiledImage::sets_of(&pixels, 3, decoder.tiles()),
                    colour_every: None,
                }
            };
            (first..first + 4).map(work).collect()
        };
        let sizes = BatchSizes { lights: 5, pairs: 20, measured: 20, batch: 4, memory_bytes: 1 << 30 };
        // Batches 0, 4, 8 and 16 are of codes, batch 12 is of linear values; the adapter fails from `failing` on.
        let found = |gpu: Option<&FitGpu>, failing: usize| {
            let mut errors = BatchErrors::new(&decoder, &coding, sizes, gpu);
            for first in (0..20).step_by(4) {
                if let Some(adapter) = errors.adapter.as_ref().filter(|_| first >= failing) {
                    adapter.errors.break_for_test();
                }
                errors.take(batch(first, first == 12));
            }
            errors.finish()
        };
        let (tiles, pairs) = found(None, 99);
        assert!(pairs.iter().all(|error| *error > 0));
        for failing in [99, 0, 8, 16] {
            let (found_tiles, found_pairs) = found(Some(&gpu), failing);
            let near = pairs.iter().zip(&found_pairs).all(|(a, b)| is_near(*a as f64, *b as f64));
            assert!(near && are_alike(&tiles, &found_tiles), "{failing}: {pairs:?} {found_pairs:?}");
        }
        // A batch that is missing or counted twice is seen.
        let mut twice = tiles.clone();
        twice.iter_mut().for_each(|tile| tile.linear_error.iter_mut().for_each(|error| *error *= 1.25));
        assert!(!are_alike(&tiles, &twice) && !is_near(pairs[3] as f64, 0.0));
        assert!(gpu.in_words().unwrap().contains("in part"), "{:?}", gpu.in_words());
    }
}
