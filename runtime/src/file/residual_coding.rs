//! Codes the shared bases and the factors of layers whose coefficients are predicted.

use crate::asset::residual::Factors;
use crate::container::entropy::{BinaryCoder, Encoder, Signed, code_columns, code_plane};
use half::f16;

/// Largest exponent of a factor's step: halves are multiples of 2^-24.
pub(crate) const MAX_EXPONENT: u8 = 24;

/// Returns the stream of the codes of some shared bases, `core` numbers each.
pub(crate) fn shared_stream(values: &[i16], core: usize) -> Vec<u8> {
    let mut coder = Encoder::new();
    code_columns(&mut coder, &mut values.to_vec(), core);
    coder.finish()
}

/// The factor matrices as codes: each column, a rank's, in steps of a power of two.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FactorCodes {
    /// Exponents e of the steps 2^-e: of each channel those of the view ranks, then those of the light ranks.
    pub exponents: Vec<u8>,
    /// Codes, `[rank][direction]`, of each channel the view matrix and the light matrix.
    pub matrices: [[Vec<i16>; 2]; 3],
}

impl FactorCodes {
    /// Returns the codes of `factors`; `None` where one would not fit 16 bits.
    pub(crate) fn of(factors: &Factors) -> Option<FactorCodes> {
        let mut codes = FactorCodes { exponents: Vec::new(), matrices: Default::default() };
        for channel in 0..3 {
            for (side, matrix) in [&factors.view[channel], &factors.light[channel]].into_iter().enumerate() {
                let rank = factors.ranks[channel][side];
                for column in 0..rank {
                    let values = || matrix.iter().skip(column).step_by(rank).map(|x| f64::from(x.to_f32()));
                    let is_whole = |exponent: &u8| values().all(|x| (x * f64::from(*exponent).exp2()).fract() == 0.0);
                    let exponent = (0..=MAX_EXPONENT).find(is_whole)?;
                    let scale = f64::from(exponent).exp2();
                    if values().any(|x| (x * scale).abs() > f64::from(i16::MAX)) {
                        return None;
                    }
                    codes.exponents.push(exponent);
                    codes.matrices[channel][side].extend(values().map(|x| (x * scale) as i16));
                }
            }
        }
        Some(codes)
    }

    /// Returns the factors of `shape` views and lights.
    pub(crate) fn factors(&self, shape: [usize; 2], ranks: [[usize; 2]; 3]) -> Factors {
        let mut exponents = self.exponents.iter();
        let mut factors = Factors { shape, ranks, view: Default::default(), light: Default::default() };
        for channel in 0..3 {
            for side in 0..2 {
                let (rank, codes) = (ranks[channel][side], &self.matrices[channel][side]);
                let mut matrix = vec![f16::ZERO; codes.len()];
                for (column, (codes, exponent)) in
                    codes.chunks(shape[side].max(1)).zip(exponents.by_ref().take(rank)).enumerate()
                {
                    let step = f32::from(*exponent).exp2().recip();
                    for (direction, code) in codes.iter().enumerate() {
                        matrix[direction * rank + column] = f16::from_f32(f32::from(*code) * step);
                    }
                }
                if side == 0 { factors.view[channel] = matrix } else { factors.light[channel] = matrix }
            }
        }
        factors
    }

    /// Codes all matrices; the decoder fills them. Returns false if it met a number that does not fit.
    pub(crate) fn code(&mut self, coder: &mut impl BinaryCoder, shape: [usize; 2]) -> bool {
        let mut fits = true;
        for matrices in &mut self.matrices {
            for (matrix, width) in matrices.iter_mut().zip(shape) {
                fits &= code_plane(coder, &mut Signed::new(), matrix, width);
            }
        }
        fits
    }
}
