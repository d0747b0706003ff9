//! Strides over direction pairs that miss no view and no light.

/// Returns the smallest stride from `least` on that is coprime to the number of lights, so that every so many pairs
/// visit all lights and views alike.
pub fn stride_over_pairs(least: usize, lights: usize) -> usize {
    let common = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    (least.max(1)..).find(|stride| common(*stride, lights) == 1).unwrap_or(least)
}
