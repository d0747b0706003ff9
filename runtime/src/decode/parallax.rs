//! Parallax outside the measured views: which texels of the neighbouring views show the surface point that an eye
//! outside their hull sees. Twin: `decode/parallax.wgsl`.
//!
//! A capture is rectified: the mean plane of the surface stays where it is, and a point at height `z` above texel `p`
//! is seen at `p - z s(v)` from view `v`, with `s(v) = (v.x, -v.y) / v.z` in columns and rows. Texel `x` therefore
//! shows different points from different views. Between the measured views their mean predicts a texel best all the
//! same (docs/results/results.md); outside, where slopes grow fast, the neighbours are shifted.

use crate::asset::height_field::HeightField;
use crate::resident::layout::{ASSET_LAYERS, block, level_size};
use crate::resident::resident::Resident;

/// Steepest slope of a ray, columns or rows per unit of height: 84 degrees.
pub const MAX_SLOPE: f32 = 10.0;
/// Length of a ray's step along the mean plane, in texels.
pub const RAY_STEP: f32 = 0.5;
/// Least number of steps of a ray.
pub const MIN_RAY_STEPS: f32 = 8.0;
/// Largest number of steps of a ray.
pub const MAX_RAY_STEPS: f32 = 64.0;
/// Rate of the shift outside the hull: 0 at the hull, the whole shift where `beyond` of [`crate::Neighbours`] is lower
/// by one over this.
pub const SHIFT_SLOPE: f32 = 5.0;
/// Share of its weight that a neighbour keeps where the point is hidden from it.
pub const HIDDEN_SHARE: f32 = 0.05;
/// Share of its weight that a neighbour keeps where the point lies outside the patch.
pub const OUTSIDE_SHARE: f32 = 0.1;

/// The surface point that an eye sees in a texel, as the three neighbouring views show it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenBy {
    /// Texel of each neighbour that shows the point.
    pub texels: [u32; 3],
    /// Weights of the neighbours, which sum up to 1: those of the interpolation, reduced where the point is hidden.
    pub weights: [f32; 3],
}

impl<'a> HeightField<'a> {
    /// Returns the displacement map of the layer whose block begins at word `layer` of a resident asset; `None` if the
    /// layer has none.
    pub(crate) fn of_layer(words: &'a [u32], layer: usize) -> Option<HeightField<'a>> {
        let float = |field: usize| f32::from_bits(words[layer + field]);
        let at = words[layer + block::HEIGHTS] as usize;
        let size = level_size(words, layer);
        (at > 0).then(|| HeightField {
            codes: bytemuck::cast_slice(&words[at..at + (size[0] * size[1]).div_ceil(4)]),
            size,
            step: float(block::HEIGHT_STEP),
            range: [float(block::MIN_HEIGHT), float(block::MAX_HEIGHT)],
        })
    }

    /// Returns the displacement map of a layer, as [`crate::Resident::layer_for_sides`] numbers it; `None` if the layer
    /// has none.
    pub fn of_resident(resident: &'a Resident, layer: u32) -> Option<HeightField<'a>> {
        let words = resident.words();
        HeightField::of_layer(words, words[ASSET_LAYERS + layer as usize] as usize)
    }

    /// Returns the height of the first point that a ray meets; the ray has slope `s` and passes the mean plane at
    /// `place`.
    fn first_hit(&self, place: [f32; 2], s: [f32; 2]) -> f32 {
        let [least, most] = self.range;
        let depth = most - least;
        // A little less, so that rounding does not decide where the quotient is whole.
        let length = (s[0] * s[0] + s[1] * s[1]).sqrt() * depth / RAY_STEP - 1e-4;
        let steps = length.ceil().clamp(MIN_RAY_STEPS, MAX_RAY_STEPS);
        let above = |z: f32| z - self.at([place[0] + z * s[0], place[1] + z * s[1]]);
        let (mut free, mut clear) = (most, above(most).max(0.0));
        for i in 1..=steps as u32 {
            let z = most - depth * (i as f32 / steps);
            let now = above(z);
            if now <= 0.0 {
                // Straight between the last two: what the ray passes there is nearly a plane.
                return free + (z - free) * (clear / (clear - now).max(1e-12));
            }
            (free, clear) = (z, now);
        }
        least
    }

    /// Returns the place of the surface point that an eye at `direction` sees at `place` of the mean plane. Cost: a ray of
    /// at most 64 steps.
    pub(crate) fn seen_place(&self, place: [f32; 2], direction: [f32; 3]) -> [f32; 2] {
        let s = Self::slope(direction);
        let z = self.first_hit(place, s);
        [place[0] + z * s[0], place[1] + z * s[1]]
    }

    /// Returns the slope of a ray towards `direction`: columns and rows per unit of height, at most [`MAX_SLOPE`].
    pub fn slope(direction: [f32; 3]) -> [f32; 2] {
        let s = [direction[0], -direction[1]].map(|x| x / direction[2].max(1e-6));
        let steep = (s[0] * s[0] + s[1] * s[1]).sqrt() / MAX_SLOPE;
        s.map(|x| x / steep.max(1.0))
    }

    /// Finds the surface point that the eye at `wo` sees in `texel`, as the neighbouring `views` show it, which are
    /// interpolated with `weights`. `beyond` is that of [`crate::Neighbours`]. Directions are unit vectors with z > 0,
    /// in the layer's frame.
    ///
    /// Cost: four rays of at most 64 steps.
    pub fn seen_by(&self, texel: u32, wo: [f32; 3], beyond: f32, views: &[[f32; 3]; 3], weights: &[f32; 3]) -> SeenBy {
        let part = ((1.0 - beyond) * SHIFT_SLOPE).clamp(0.0, 1.0);
        let size = self.size;
        let place = [(texel as usize % size[0]) as f32, (texel as usize / size[0]) as f32];
        let s = Self::slope(wo);
        let z = self.first_hit(place, s);
        let mut seen = SeenBy { texels: [texel; 3], weights: [0.0; 3] };
        let mut sum = 0.0;
        for i in 0..3 {
            if weights[i] <= 0.0 {
                continue;
            }
            let towards = Self::slope(views[i]);
            let shown = [0, 1].map(|axis| place[axis] + z * (s[axis] - towards[axis]));
            let moved = [0, 1].map(|axis| place[axis] + part * (shown[axis] - place[axis]));
            let [column, row] = [0, 1].map(|axis| (moved[axis] + 0.5).floor().clamp(0.0, (size[axis] - 1) as f32));
            let outside = (0..2).any(|axis| shown[axis] < -0.5 || shown[axis] > size[axis] as f32 - 0.5);
            let gap = self.first_hit(shown, towards) - z;
            let open = 1.0 - (gap * gap).min(1.0);
            let seen_here = 1.0 + part * (open * open * if outside { OUTSIDE_SHARE } else { 1.0 } - 1.0);
            seen.texels[i] = row as u32 * size[0] as u32 + column as u32;
            seen.weights[i] = weights[i] * (HIDDEN_SHARE + (1.0 - HIDDEN_SHARE) * seen_here);
            sum += seen.weights[i];
        }
        seen.weights = seen.weights.map(|weight| weight / sum);
        seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::asset::Asset;
    use crate::asset::heights::Heights;
    use crate::asset::limits::MAX_HEIGHT_STEP;
    use crate::asset::residual::ResidualKind;
    use crate::decode::decode::decode;
    use crate::decode::options::{DecodeOptions, HeightUse, Interpolation};
    use crate::error::FormatError;
    use crate::pack;
    use crate::testing::{Random, direction_from_degrees, sample_asset, sample_heights};

    const SIZE: [usize; 2] = [20, 10];

    fn heights(of_column: impl Fn(usize) -> i8) -> Heights {
        Heights { step: 0.5, codes: (0..SIZE[0] * SIZE[1]).map(|texel| of_column(texel % SIZE[0])).collect() }
    }

    fn seen(heights: &Heights, texel: u32, wo: [f32; 3], views: [[f32; 3]; 3], weights: [f32; 3]) -> SeenBy {
        heights.field(SIZE).seen_by(texel, wo, 0.0, &views, &weights)
    }

    const POLE: [f32; 3] = [0.0, 0.0, 1.0];
    const HALVES: [f32; 3] = [0.5, 0.5, 0.0];

    #[test]
    fn a_raised_plane_is_seen_shifted_by_its_height_times_the_slopes() {
        // Slope 1 towards +x and towards +y: 45 degrees; columns run along x, rows against y.
        let (right, up) = (direction_from_degrees(45.0, 0.0), direction_from_degrees(45.0, 90.0));
        let texel = 5 * 20 + 10;
        let found = seen(&heights(|_| 4), texel, POLE, [right, up, POLE], HALVES);
        assert_eq!(found.texels, [5 * 20 + 8, 7 * 20 + 10, texel]);
        let near = |weights: [f32; 3]| (0..3).all(|i| (weights[i] - HALVES[i]).abs() < 1e-5);
        assert!(near(found.weights), "{found:?}");
        // Below the plane the other way; an eye that is not upright shifts the point itself.
        assert_eq!(seen(&heights(|_| -4), texel, POLE, [right, up, POLE], HALVES).texels[..2], [112, 70]);
        assert_eq!(seen(&heights(|_| 4), texel, right, [right, POLE, POLE], HALVES).texels[..2], [texel, 112]);
        // Level ground shifts nothing.
        assert_eq!(seen(&heights(|_| 0), texel, right, [POLE, up, POLE], HALVES).texels, [texel; 3]);
    }

    #[test]
    fn a_view_from_which_the_point_is_hidden_counts_little() {
        // A wall of three texel widths in columns 12 and beyond; the ground before it is hidden from the right.
        let wall = heights(|column| if column >= 12 { 6 } else { 0 });
        let (left, right) = (direction_from_degrees(60.0, 180.0), direction_from_degrees(60.0, 0.0));
        let found = seen(&wall, 5 * 20 + 10, POLE, [left, right, POLE], HALVES);
        assert!((found.weights[0] - 1.0 / (1.0 + HIDDEN_SHARE)).abs() < 1e-4, "{found:?}");
        assert_eq!(found.texels[0], 110);
        // A point that lies outside of the patch counts less too.
        let edge = seen(&heights(|_| 6), 5 * 20 + 1, POLE, [left, right, POLE], HALVES);
        assert!(edge.weights[1] < 0.15 && edge.texels[1] == 100, "{edge:?}");
    }

    #[test]
    fn no_height_and_no_direction_gives_anything_but_texels_and_weights() {
        let mut random = Random::new(3);
        for round in 0..2000 {
            let step = [1e-6, 0.125, MAX_HEIGHT_STEP][round % 3];
            let codes = (0..200).map(|_| random.below(256) as u8 as i8).collect();
            let heights = Heights { step, codes };
            let mut wo = random.direction();
            if round % 5 == 0 {
                wo = [0.6, -0.8, 1e-30];
            }
            let views = [0; 3].map(|_| random.direction());
            let found = seen(&heights, random.below(200) as u32, wo, views, [0.2, 0.5, 0.3]);
            assert!(found.texels.iter().all(|texel| *texel < 200));
            let sum: f32 = found.weights.iter().sum();
            assert!(found.weights.iter().all(|weight| *weight > 0.0) && (sum - 1.0).abs() < 1e-5, "{found:?}");
        }
    }

    fn with_heights(kind: ResidualKind) -> Asset {
        let mut asset = sample_asset(4, 9, 7, kind);
        asset.layers[0].heights = Some(sample_heights(4, 63));
        asset
    }

    #[test]
    fn measured_views_are_left_alone_and_others_are_not() {
        for kind in [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root] {
            let asset = with_heights(kind);
            let resident = Resident::from_asset(&asset);
            for interpolation in [Interpolation::Fast, Interpolation::Exact] {
                let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
                let flat = DecodeOptions { heights: HeightUse::None, ..options };
                let both = |wo| {
                    [options, flat]
                        .map(|options| decode(&resident, 0, 31, direction_from_degrees(40.0, 20.0), wo, &options))
                };
                for view in 0..asset.layers[0].views.len() as u32 {
                    let [a, b] = both(asset.layers[0].views.direction(view));
                    assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-4 + 1e-3 * b[c]), "{kind:?} {a:?} {b:?}");
                }
                let [a, b] = both(direction_from_degrees(45.0, 77.0));
                assert_eq!(a, b, "{kind:?}: between the views");
                let [a, b] = both(direction_from_degrees(83.0, 77.0));
                assert!((0..3).any(|c| (a[c] - b[c]).abs() > 1e-3), "{kind:?} {a:?} {b:?}");
            }
        }
    }

    #[test]
    fn heights_come_back_from_a_file_and_bad_ones_are_refused() {
        let asset = with_heights(ResidualKind::Root);
        assert_eq!(Asset::parse(&pack(&asset).unwrap()).unwrap(), asset);
        let refused = |change: fn(&mut Heights)| {
            let mut asset = asset.clone();
            change(asset.layers[0].heights.as_mut().unwrap());
            matches!(pack(&asset), Err(FormatError::Pack { .. }))
        };
        assert!(refused(|heights| heights.step = 0.0));
        assert!(refused(|heights| heights.step = f32::NAN));
        assert!(refused(|heights| heights.step = 17.0));
        assert!(refused(|heights| heights.codes.truncate(62)));
        assert!(!refused(|heights| heights.codes[5] = -128));
    }
}
