//! Conversion between a capture's own frame and the one frame that all layers of an asset share.
//!
//! A capture of a face that is seen from behind ([`Side::is_turned_over`]) has its images and
//! directions as the camera saw the sample turned over about its y axis: a direction (x, y, z) there
//! is (-x, y, -z) in the front's frame, and column `c` is column `width - 1 - c`. An asset's layers
//! have the front's texel grid and the front's x and y; directions behind the surface are stored
//! mirrored in its plane, so that z > 0 (docs/reference/model.md, section 7). Together: columns and x are mirrored
//! where the capture is turned over, z loses its sign, and nothing else changes.

use crate::error::FitError;
use btf_capture::{Direction, DirectionSet, Side};
use btf_runtime::{Layer, Sphere, SurfaceSide};

/// Returns the sides of light and eye of a capture of `side`, as a layer stores them.
pub fn sides_of_capture(side: Side) -> (SurfaceSide, SurfaceSide) {
    match side {
        Side::Front => (SurfaceSide::Front, SurfaceSide::Front),
        Side::Back => (SurfaceSide::Back, SurfaceSide::Back),
        Side::TransmissionBack => (SurfaceSide::Back, SurfaceSide::Front),
        Side::TransmissionFront => (SurfaceSide::Front, SurfaceSide::Back),
    }
}

/// Returns the capture side that a layer's sides stand for.
pub fn side_of_layer(layer: &Layer) -> Side {
    Side::ALL
        .into_iter()
        .find(|side| sides_of_capture(*side) == (layer.light_side, layer.view_side))
        .unwrap_or(Side::Front)
}

/// Returns the unit vectors that a layer stores for `set`, views or lights of a capture of `side`, in the set's order.
/// A direction and its mirror image in the surface give the same vector.
pub fn layer_directions(set: &DirectionSet, side: Side) -> Vec<[f32; 3]> {
    set.units().into_iter().map(|[x, y, z]| [mirrored_x(x, side), y, z.abs()]).collect()
}

/// Returns the view and light directions of a layer as the file names of a capture of `side` give them: the inverse of
/// [`layer_directions`].
///
/// # Errors
/// If two directions of the layer have the same angles.
pub fn capture_directions(layer: &Layer, side: Side) -> Result<(DirectionSet, DirectionSet), FitError> {
    let set = |sphere: &Sphere, behind: bool| {
        let directions = (0..sphere.distinct() as u32).map(|id| {
            let [x, y, z] = sphere.direction(id);
            angles_from_unit([mirrored_x(x, side), y, if behind { -z } else { z }])
        });
        DirectionSet::new(directions.collect())
    };
    Ok((set(&layer.views, false)?, set(&layer.lights, side.is_transmission())?))
}

/// Mirrors the columns of an image `[row, column, channel]` of `width` columns, in place, where a capture of `side` is
/// turned over: from the capture's frame to the front's and back alike.
pub(crate) fn turn_image<T>(image: &mut [T], width: usize, side: Side) {
    turn_channels(image, IMAGE_SAMPLES, width, side);
}

/// Mirrors an image like [`turn_image`], of `channels` channels.
pub(crate) fn turn_channels<T>(image: &mut [T], channels: usize, width: usize, side: Side) {
    if !side.is_turned_over() {
        return;
    }
    // With the samples of a texel in reverse order the whole row is reversed; they are put back after.
    for row in image.chunks_exact_mut(channels * width) {
        row.reverse();
        row.chunks_exact_mut(channels).for_each(<[T]>::reverse);
    }
}

/// Mirrors the columns of a map with one value per texel, in place, where a capture of `side` is turned over
/// ([`turn_image`] does so for images).
pub(crate) fn turn_map<T>(map: &mut [T], width: usize, side: Side) {
    if side.is_turned_over() {
        map.chunks_exact_mut(width).for_each(<[T]>::reverse);
    }
}

/// Channels of an image.
const IMAGE_SAMPLES: usize = 3;

fn mirrored_x(x: f32, side: Side) -> f32 {
    // Not -x: a zero stays positive, as the same direction of another capture has it.
    if side.is_turned_over() { 0.0 - x } else { x }
}

/// Largest difference of a component between a unit vector and the angles read back from it: two
/// roundings of single precision near 1.
const SAME_COMPONENT: f64 = 1.2e-7;

/// Returns the direction of a unit vector of single precision, with the fewest decimals of a degree that give the same
/// vector again; five where none of them does.
fn angles_from_unit(unit: [f32; 3]) -> Direction {
    let [x, y, z] = unit.map(f64::from);
    let theta = (x * x + y * y).sqrt().atan2(z).to_degrees();
    let phi = y.atan2(x).to_degrees().rem_euclid(360.0);
    let rounded = |decimals: i32| {
        let scale = 10f64.powi(decimals);
        Direction::new((theta * scale).round() / scale, (phi * scale).round() / scale)
    };
    let same = |direction: &Direction| {
        let back = direction.unit_f64();
        (0..3).all(|i| (back[i] - f64::from(unit[i])).abs() < SAME_COMPONENT)
    };
    (0..5).map(rounded).find(same).unwrap_or_else(|| rounded(5))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::sample_asset_with;
    use btf_runtime::ResidualKind;

    #[test]
    fn every_angle_of_the_known_sets_comes_back_exactly_from_its_vector() {
        for name in ["bonn81", "dome151", "random:200"] {
            for direction in DirectionSet::by_name(name).unwrap().directions() {
                assert_eq!(angles_from_unit(direction.unit()), *direction);
            }
        }
        // Planted difference: a hundredth of a degree is not rounded away.
        for odd in [Direction::new(44.99, 12.34), Direction::new(104.99, 359.01)] {
            assert_eq!(angles_from_unit(odd.unit()), odd);
        }
    }

    #[test]
    fn a_left_light_of_the_turned_over_sample_is_a_right_light_of_the_front() {
        let left = DirectionSet::new(vec![Direction::new(30.0, 180.0)]).unwrap();
        let up_left_behind = DirectionSet::new(vec![Direction::new(120.0, 135.0)]).unwrap();
        let close = |found: [f32; 3], wanted: [f64; 3]| (0..3).all(|i| (f64::from(found[i]) - wanted[i]).abs() < 1e-6);
        for (side, sign) in [(Side::Front, -1.0), (Side::Back, 1.0), (Side::TransmissionBack, -1.0)] {
            assert!(close(layer_directions(&left, side)[0], [sign * 0.5, 0.0, 0.75f64.sqrt()]), "{side}");
        }
        let c = 0.375f64.sqrt();
        assert!(close(layer_directions(&up_left_behind, Side::TransmissionBack)[0], [-c, c, 0.5]));
        assert!(close(layer_directions(&up_left_behind, Side::TransmissionFront)[0], [c, c, 0.5]));
    }

    #[test]
    fn the_directions_of_every_side_come_back_as_the_files_had_them() {
        let (views, front) = (DirectionSet::random(7, 3).unwrap(), DirectionSet::random(9, 4).unwrap());
        for side in Side::ALL {
            let lights = if side.is_transmission() { front.behind().unwrap() } else { front.clone() };
            let mut layer = sample_asset_with(2, 2, &views, &front, ResidualKind::Root).layers.remove(0);
            layer.views = Sphere::new(&layer_directions(&views, side)).unwrap();
            layer.lights = Sphere::new(&layer_directions(&lights, side)).unwrap();
            assert_eq!(capture_directions(&layer, side).unwrap(), (views.clone(), lights.clone()), "{side}");
            // Planted difference: another side gives other directions.
            let other = Side::ALL[(Side::ALL.iter().position(|s| *s == side).unwrap() + 1) % 4];
            assert_ne!(capture_directions(&layer, other).unwrap(), (views.clone(), lights));
        }
    }

    #[test]
    fn turning_mirrors_columns_keeps_channels_and_rows_and_undoes_itself() {
        let image: Vec<u32> = (0..2 * 3 * 3).collect();
        let mut turned = image.clone();
        turn_image(&mut turned, 3, Side::Back);
        assert_eq!(turned, [6, 7, 8, 3, 4, 5, 0, 1, 2, 15, 16, 17, 12, 13, 14, 9, 10, 11]);
        turn_image(&mut turned, 3, Side::TransmissionFront);
        assert_eq!(turned, image);
        turn_image(&mut turned, 3, Side::TransmissionBack);
        assert_eq!(turned, image);
        let mut map = [1, 2, 3, 4, 5, 6];
        turn_map(&mut map, 3, Side::TransmissionFront);
        assert_eq!(map, [3, 2, 1, 6, 5, 4]);
        turn_map(&mut map, 3, Side::Front);
        assert_eq!(map, [3, 2, 1, 6, 5, 4]);
    }
}
