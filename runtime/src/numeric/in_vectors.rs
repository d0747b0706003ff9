//! Runs loops in the processor's vectors.

use pulp::WithSimd;

/// Runs `work` in the widest vectors that the processor has.
#[cfg(not(target_arch = "wasm32"))]
#[inline(always)]
pub(crate) fn in_vectors<W: WithSimd>(work: W) -> W::Output {
    pulp::Arch::new().dispatch(work)
}

/// Runs `work` in vectors of 128 bits. pulp would compile it once more with relaxed operations where another package asks for
/// them, and browsers without these refuse the whole program.
#[cfg(target_arch = "wasm32")]
#[inline(always)]
pub(crate) fn in_vectors<W: WithSimd>(work: W) -> W::Output {
    use pulp::Simd;
    match pulp::wasm::Simd128::try_new() {
        Some(simd) => Simd::vectorize(simd, work),
        None => Simd::vectorize(pulp::Scalar, work),
    }
}
