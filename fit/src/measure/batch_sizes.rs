//! Sizes of the batches of pairs whose error is measured.

/// Numbers that the sums over batches and the buffers of an adapter follow from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BatchSizes {
    /// Lights of the capture.
    pub lights: usize,
    /// Pairs of the capture, with an image or without.
    pub pairs: usize,
    /// Pairs that are to be measured.
    pub measured: usize,
    /// Pairs of a batch at most.
    pub batch: usize,
    /// Most bytes of memory that an adapter's copies of the texels may take.
    pub memory_bytes: u64,
}
