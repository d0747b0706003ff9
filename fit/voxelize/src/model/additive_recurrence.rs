//! Places spread evenly over a cube by Roberts' additive recurrence.

/// Returns the steps of Roberts' additive recurrence in N dimensions: powers of the root of `x^(N + 1) = x + 1`, inverted.
pub(crate) const fn recurrence_steps<const N: usize>(root: f64) -> [f64; N] {
    let mut steps = [1.0 / root; N];
    let mut k = 1;
    while k < N {
        steps[k] = steps[k - 1] / root;
        k += 1;
    }
    steps
}

/// Returns a place of the recurrence with these steps in the unit cube; the first has number 1.
pub(crate) fn place_of<const N: usize>(steps: &[f64; N], number: u32) -> [f32; N] {
    steps.map(|step| ((0.5 + step * f64::from(number)).fract()) as f32)
}
