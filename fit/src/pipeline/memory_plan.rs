//! Shares the memory limit of a fit out before anything is read.

use crate::error::FitError;
use crate::gpu::fit_gpu::BATCH_BYTES;
use crate::numeric::principal_directions::ROW_BLOCK;
use crate::params::ValidFitParams;
use crate::pipeline::representatives::REPRESENTATIVES;
use crate::priors::functions::MAX_FUNCTIONS;
use crate::stages::candidates::MAX_CANDIDATES;
use crate::stages::heights;
use crate::stages::lobe_dictionaries::DICTIONARY_SIZE;
use btf_capture::CaptureInfo;

/// Principal directions that clusters are found in.
pub const FEATURE_DIMENSIONS: usize = 64;
/// Direction pairs that a dictionary is fitted on at most.
pub const DICTIONARY_PAIRS: usize = 3400;
/// Shared bases that are looked for at least where the size of the asset is given.
const MIN_SHARED_BASES: usize = 280;
/// Further shared bases per byte of a texel's budget: too few bound the error of a large asset (docs/results/results.md), and
/// more than a small one can use cost time.
const SHARED_BASES_PER_BYTE: f64 = 7.0;
/// Shared bases that are looked for at most.
const MAX_SHARED_BASES: usize = 640;
/// Shared bases that are looked for where no size is given.
const SHARED_BASES: usize = 320;
/// Texels that shared bases are found from at most.
const SHARED_SAMPLE: usize = 8192;

/// Bytes of a texel's choices beside its coordinates: labels, lobe references and weights, codes of the coefficients
/// and their planes while they are packed.
const CHOICE_BYTES: usize = 1024;
/// Texels of a block of the capture that is being read ([`crate::TileCache`]).
const BLOCK_TEXELS: usize = 1024;
/// Bytes of a sample in a block: half precision at most.
const SAMPLE_BYTES: usize = 2;
/// Bytes of the program itself: code, its pages, and what the allocator keeps.
const PROGRAM_BYTES: usize = 40_000_000;
/// Bytes of a thread: its stack, a decoder of images, and what the allocator keeps for it.
const THREAD_BYTES: usize = 8_000_000;

/// Returns how many shared bases are looked for in a capture of `texels` texels.
pub fn shared_bases(params: &ValidFitParams, texels: usize) -> usize {
    let Some(bytes) = params.bytes() else {
        return SHARED_BASES;
    };
    let more = SHARED_BASES_PER_BYTE * bytes as f64 / texels as f64;
    (MIN_SHARED_BASES + more as usize).min(MAX_SHARED_BASES)
}

/// Bytes that the memory limit leaves for those parts of a layer's fit whose size can be chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryPlan {
    /// Texels of the sample that shared bases are found from.
    pub sample: usize,
    /// Bytes for the decoded capture; where it needs more, it lies in a file.
    pub cache_bytes: u64,
}

/// What beside the capture and the parameters a layer's fit needs memory for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Surroundings {
    /// Other layers that wait for their step with their coordinates in memory.
    pub waiting: usize,
    /// Number of threads.
    pub threads: usize,
    /// Whether an adapter multiplies, whose memory may be this machine's.
    pub gpu: bool,
}

/// Plans the memory of one layer's fit.
///
/// # Errors
/// [`FitError::Memory`] with the least limit that suffices.
pub fn plan_memory(
    info: &CaptureInfo,
    params: &ValidFitParams,
    surroundings: Surroundings,
) -> Result<MemoryPlan, FitError> {
    let (texels, samples) = (info.texel_count(), info.pair_count() * 3);
    let rank = shared_bases(params, texels).min(samples).min(texels);
    let fixed = fixed_bytes(info, params, rank, surroundings);
    let limit = params.memory_bytes() as usize;
    let least_sample = (2 * rank).min(SHARED_SAMPLE).min(texels);
    // Sampled texels lie in the form of the cache.
    let needed = fixed + SAMPLE_BYTES * least_sample * samples;
    if limit < needed {
        return Err(FitError::Memory { given: bytes_in_words(limit), needed: bytes_in_words(needed) });
    }
    let sample = ((limit - fixed) / 2 / (SAMPLE_BYTES * samples).max(1)).clamp(least_sample, SHARED_SAMPLE.min(texels));
    Ok(MemoryPlan { sample, cache_bytes: (limit - fixed - SAMPLE_BYTES * sample * samples) as u64 })
}

/// Returns the bytes of all parts of a layer's fit whose size is given, at the stage that needs most.
fn fixed_bytes(info: &CaptureInfo, params: &ValidFitParams, rank: usize, surroundings: Surroundings) -> usize {
    let Surroundings { waiting, threads, gpu } = surroundings;
    let (texels, pairs) = (info.texel_count(), info.pair_count());
    let samples = pairs * 3;
    let clusters = params.clusters().min(texels);
    const FLOAT: usize = size_of::<f32>();
    const DOUBLE: usize = size_of::<f64>();
    let (coordinates, bases) = (texels * FLOAT * rank, FLOAT * rank * samples);
    // Tables of the dictionaries: a number for each lobe and pair.
    let tables = clusters * pairs * FLOAT * DICTIONARY_SIZE;
    // Alive in every stage: coordinates, bases and tables of this layer and of those that wait, labels and references.
    let kept = (1 + waiting) * (coordinates + bases + tables) + texels * (CHOICE_BYTES / 8);
    // One block as it is read and as it is cut into texels, and its rows as floats on every thread.
    let of_blocks =
        BLOCK_TEXELS.min(texels) * samples * 2 * SAMPLE_BYTES + threads * FLOAT * ROW_BLOCK.min(texels) * samples;
    let project = 5 * bases + of_blocks;
    let cluster = 3 * texels * FLOAT * FEATURE_DIMENSIONS;
    // Tables of all candidate lobes, two per thread beside the common one, their Gram matrix, and the representatives'
    // functions.
    let dictionary = (2 * threads + 1) * FLOAT * DICTIONARY_PAIRS.min(pairs) * MAX_CANDIDATES
        + threads * DOUBLE * MAX_CANDIDATES * MAX_CANDIDATES
        + clusters * samples * FLOAT * REPRESENTATIVES / 2;
    // Products of every texel with the lobes.
    let weights = of_blocks + tables + texels * 3 * FLOAT * DICTIONARY_SIZE + texels * CHOICE_BYTES / 2;
    // Coordinates twice more, codes and their planes.
    let encode = 2 * coordinates + 2 * bases + texels * CHOICE_BYTES;
    let heights = if params.finds_heights() { texels * heights::bytes_per_texel() + bases } else { 0 };
    // Functions of the priors, those that have a share once more, and the weights of the prediction.
    let predicts = params.leave_out() > 0.0 || !info.missing.is_empty();
    let prediction = if predicts { 3 * FLOAT * MAX_FUNCTIONS * pairs } else { 0 };
    let most = [project, cluster, dictionary, weights, encode, heights, prediction].into_iter().fold(0, usize::max);
    // A batch and as much on its way to the adapter, the factors there, and the rows of a block until they are pushed.
    let on_gpu = if gpu {
        2 * (BATCH_BYTES as usize).min(FLOAT * texels * samples)
            + 2 * (coordinates + bases)
            + FLOAT * BLOCK_TEXELS.min(texels) * samples
    } else {
        0
    };
    kept + most + on_gpu + PROGRAM_BYTES + threads * THREAD_BYTES
}

fn bytes_in_words(bytes: usize) -> String {
    format!("{:.0} MB", bytes as f64 / 1e6)
}
