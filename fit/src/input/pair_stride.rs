//! Strides over direction pairs that miss no view and no light.

use btf_capture::CaptureInfo;

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

/// Returns about as many pairs with an image as a `stride` over all pairs of a full grid visits, spread over those that there are.
pub fn pairs_at_stride(info: &CaptureInfo, stride: usize) -> Vec<usize> {
    if info.missing.is_empty() {
        return (0..info.pair_count()).step_by(stride.max(1)).collect();
    }
    let present: Vec<usize> = info.present_pairs().collect();
    let wanted = info.pair_count().div_ceil(stride.max(1)).clamp(1, present.len().max(1));
    (0..wanted).filter_map(|i| present.get(i * present.len() / wanted).copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_capture::{DirectionSet, ImageFormat};

    #[test]
    fn a_sparse_capture_is_visited_as_often_as_a_full_one() {
        let set = DirectionSet::bonn81();
        let mut info = CaptureInfo::new("sparse", 4, 4, set.clone(), set, ImageFormat::Png);
        assert_eq!(pairs_at_stride(&info, 100).len(), 66);
        info.missing = (0..6561).filter(|pair| pair % 20 != 3).collect();
        let chosen = pairs_at_stride(&info, 100);
        assert!(chosen.len() == 66 && chosen.iter().all(|pair| info.has_image(*pair)) && chosen.is_sorted());
        assert_eq!(pairs_at_stride(&info, 1).len(), 328);
    }
}
