//! The residual's curve, tabulated: a fit evaluates it a thousand million times.

use btf_runtime::{ROOT, ResidualKind};

/// Bits of a float that a table step spans: relative width 2^-11, so that linear interpolation errs by less than 1e-7.
const STEP_BITS: u32 = 12;
/// Smallest and largest tabulated magnitude, 2^-30 and 2^17.
const LEAST: f32 = 9.313_226e-10;
const MOST: f32 = 131_072.0;

/// The residual's curve `g` ([`ResidualKind::encode`]) as a table with linear interpolation.
pub struct Curve {
    kind: ResidualKind,
    epsilon: f32,
    /// Value of `g` at every table step from `LEAST` on; empty for the additive kind.
    table: Vec<f32>,
}

impl Curve {
    /// Tabulates the curve of `kind`.
    pub fn new(kind: ResidualKind, epsilon: f32) -> Curve {
        let steps = (MOST.to_bits() - LEAST.to_bits()) >> STEP_BITS;
        let table = match kind {
            ResidualKind::Additive => Vec::new(),
            _ => (0..=steps + 1)
                .map(|i| kind.encode(f32::from_bits(LEAST.to_bits() + (i << STEP_BITS)), epsilon))
                .collect(),
        };
        Curve { kind, epsilon, table }
    }

    /// Returns `g(x)` within 2e-6 of the exact value, relative to values above 0.1.
    #[inline]
    pub fn encode(&self, x: f32) -> f32 {
        if self.table.is_empty() {
            return x;
        }
        if !(LEAST..MOST).contains(&x) {
            return self.kind.encode(x, self.epsilon);
        }
        let offset = x.to_bits() - LEAST.to_bits();
        let index = (offset >> STEP_BITS) as usize;
        let t = (offset & ((1 << STEP_BITS) - 1)) as f32 / (1u32 << STEP_BITS) as f32;
        self.table[index] + t * (self.table[index + 1] - self.table[index])
    }

    /// Returns the power of its argument that the curve is about; 0 for a logarithm, which is none.
    pub fn power(&self) -> f32 {
        match self.kind {
            ResidualKind::Additive => 1.0,
            ResidualKind::Root => 1.0 / ROOT,
            ResidualKind::Log => 0.0,
        }
    }

    /// Returns the exact curve `g`, for tables of samples.
    pub fn exact(&self) -> impl Fn(f32) -> f32 + Sync + Send + 'static {
        let (kind, epsilon) = (self.kind, self.epsilon);
        move |x| kind.encode(x, epsilon)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_agrees_with_the_curve() {
        for kind in [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root] {
            let curve = Curve::new(kind, 0.001);
            for i in 0..200_000 {
                let x = (f64::from(i) * 1e-4 - 12.0).exp() as f32;
                let (fast, exact) = (curve.encode(x), kind.encode(x, 0.001));
                assert!((fast - exact).abs() <= 2e-6 * exact.abs().max(0.1), "{kind:?} {x}: {fast} {exact}");
            }
            assert_eq!(curve.encode(0.0), kind.encode(0.0, 0.001));
            assert_eq!(curve.encode(-0.05), kind.encode(-0.05, 0.001));
        }
    }
}
