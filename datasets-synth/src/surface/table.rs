//! Tables of functions of a cosine, dense towards grazing.

/// Number of entries of a table, even in the root of the cosine.
const ENTRIES: usize = 129;

/// Function of a cosine in [0, 1], linearly interpolated over its root.
#[derive(Debug, Clone)]
pub(crate) struct CosineTable {
    values: Vec<f32>,
}

impl CosineTable {
    /// Tabulates `function`; the value at 0 is taken a little above.
    pub fn new(function: impl Fn(f64) -> f64) -> CosineTable {
        let entry = |i: usize| {
            let root = i as f64 / (ENTRIES - 1) as f64;
            function((root * root).max(1e-6)) as f32
        };
        CosineTable { values: (0..ENTRIES).map(entry).collect() }
    }

    /// Returns the tabulated function at `cosine`, clamped to [0, 1].
    #[inline]
    pub fn at(&self, cosine: f32) -> f32 {
        let position = cosine.clamp(0.0, 1.0).sqrt() * (ENTRIES - 1) as f32;
        let cell = (position as usize).min(ENTRIES - 2);
        let t = position - cell as f32;
        self.values[cell] * (1.0 - t) + self.values[cell + 1] * t
    }

    /// Returns the mean over the hemisphere with the cosine as weight.
    pub fn mean(&self) -> f64 {
        let count = 4096;
        // Even steps of sin^2.
        (0..count).map(|i| f64::from(self.at((1.0 - (i as f32 + 0.5) / count as f32).sqrt()))).sum::<f64>()
            / f64::from(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_follows_its_function_and_has_its_mean() {
        let table = CosineTable::new(|c| 1.0 - 0.5 * c);
        for i in 0..=1000 {
            let cosine = i as f32 / 1000.0;
            assert!((table.at(cosine) - (1.0 - 0.5 * cosine)).abs() < 3e-5);
        }
        // The mean cosine of a diffuse hemisphere is 2/3.
        assert!((table.mean() - 2.0 / 3.0).abs() < 1e-4);
        assert_eq!(table.at(-1.0), table.at(0.0));
    }
}
