//! The virtual camera and lamp: what each texel of the reference plane sees of a leaf.
//!
//! The reference plane is the leaf's mean height. For a view, the ray through each of four points
//! in a texel is marched along the relief to the first surface point: parallax and masking. For a
//! light, the way from each node of the relief towards it is marched for what stands in the way:
//! shadows, with the penumbra of a lamp of half a degree radius. A texel is the mean over its
//! points of `pi f_r cos_i` times visibility.
//!
//! Not done: light that bounces from leaf to leaf, and light through the leaf.

use rayon::prelude::*;

use crate::leaf::patch::Leaf;
use crate::optics::gloss::LobeAngles;

/// Points per texel and axis.
pub(crate) const SUPERSAMPLES: usize = 2;

/// Longest step of a march, in cells of the relief's grid.
const STEP_CELLS: f32 = 0.75;

/// Halvings of the last step of a march to the surface.
const REFINEMENTS: usize = 6;

/// Angular radius of the lamp in radians (half a degree).
const LAMP_RADIUS_RAD: f32 = 0.00873;

/// What one point of a texel sees under one view.
#[derive(Debug, Clone, Copy)]
struct Hit {
    /// Place on the grid in cells.
    place: [f32; 2],
    normal: [f32; 3],
    cos_o: f32,
    /// Body colour, times what the gloss lets out towards the view.
    body: [f32; 3],
    gloss: f32,
}

/// Everything that a leaf shows in one view, before any light.
#[derive(Debug, Clone)]
pub struct ViewHits {
    wo: [f32; 3],
    /// `[texel, point]`.
    hits: Vec<Hit>,
}

/// Share of the lamp that each node of a leaf's grid sees.
#[derive(Debug, Clone)]
pub struct LightVisibility {
    wi: [f32; 3],
    /// 0 to 255.
    share: Vec<u8>,
}

impl ViewHits {
    /// Marches the rays of the view `wo` (unit, towards the eye, in front of the leaf), in
    /// parallel over rows.
    pub fn new(leaf: &Leaf, wo: [f32; 3]) -> ViewHits {
        let texel_mm = leaf.size_mm / leaf.size as f32;
        let point_mm = texel_mm / SUPERSAMPLES as f32;
        let hits = (0..leaf.size)
            .into_par_iter()
            .flat_map_iter(|row| {
                (0..leaf.size * SUPERSAMPLES * SUPERSAMPLES).map(move |i| {
                    let (column, point) = (i / (SUPERSAMPLES * SUPERSAMPLES), i % (SUPERSAMPLES * SUPERSAMPLES));
                    let (px, py) = (point % SUPERSAMPLES, point / SUPERSAMPLES);
                    let x = column as f32 * texel_mm + (px as f32 + 0.5) * point_mm;
                    // Row 0 is at the top, where y is largest.
                    let y = leaf.size_mm - (row as f32 * texel_mm + (py as f32 + 0.5) * point_mm);
                    hit(leaf, march_down(leaf, leaf.grid.cells([x, y]), wo), wo)
                })
            })
            .collect();
        ViewHits { wo, hits }
    }
}

impl LightVisibility {
    /// Marches from every node of the grid towards the light `wi` (unit, in front of the leaf),
    /// on the calling thread.
    pub fn new(leaf: &Leaf, wi: [f32; 3]) -> LightVisibility {
        let side = leaf.grid.side;
        let share = (0..leaf.grid.len())
            .map(|node| (march_up(leaf, node % side, node / side, wi) * 255.0 + 0.5) as u8)
            .collect();
        LightVisibility { wi, share }
    }

    /// Share of the lamp seen from the relief at a position in millimetres, 0 to 1.
    pub fn share_at(&self, leaf: &Leaf, position_mm: [f32; 2]) -> f32 {
        leaf.grid.corners(leaf.grid.cells(position_mm)).sample_share(&self.share)
    }

    /// Bytes that the visibility of one light takes for this leaf.
    pub(crate) fn bytes(leaf: &Leaf) -> usize {
        leaf.grid.len()
    }
}

/// Renders one image of reflectance x cosine, linear sRGB, `[texel, channel]`.
pub fn render(leaf: &Leaf, view: &ViewHits, light: &LightVisibility) -> Vec<f32> {
    const POINTS: usize = SUPERSAMPLES * SUPERSAMPLES;
    let (wi, wo) = (light.wi, view.wo);
    let sum: [f32; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
    let inverse_length = 1.0 / dot(sum, sum).sqrt();
    let half = sum.map(|c| c * inverse_length);
    // Light and view are parallel, so the angle at the facets is one for the whole image.
    let o_dot_h = dot(wo, half);
    let fresnel = leaf.lobe.fresnel(o_dot_h);
    let mut image = Vec::with_capacity(view.hits.len() / POINTS * 3);
    for points in view.hits.chunks_exact(POINTS) {
        let mut texel = [0f32; 3];
        for hit in points {
            let cos_i = dot(hit.normal, wi);
            if cos_i <= 0.0 {
                continue;
            }
            let visible = leaf.grid.corners(hit.place).sample_share(&light.share);
            if visible <= 0.0 {
                continue;
            }
            let angles = LobeAngles { cos_i, cos_o: hit.cos_o, cos_h: dot(hit.normal, half), o_dot_h };
            let gloss = hit.gloss * leaf.lobe.pi_brdf_cos(fresnel, angles);
            let body = leaf.lobe.lets_in(hit.gloss, leaf.lobe.albedo(cos_i)) * cos_i;
            for channel in 0..3 {
                texel[channel] += visible * (hit.body[channel] * body + gloss);
            }
        }
        image.extend(texel.map(|c| c * (1.0 / POINTS as f32)));
    }
    image
}

/// Surface and shading half that depends on the view alone.
fn hit(leaf: &Leaf, place: [f32; 2], wo: [f32; 3]) -> Hit {
    let [slope_x, slope_y, r, g, b, gloss] = leaf.grid.corners(place).sample_all(&leaf.surface);
    let scale = 1.0 / (1.0 + slope_x * slope_x + slope_y * slope_y).sqrt();
    let normal = [-slope_x * scale, -slope_y * scale, scale];
    // Interpolated normals may turn from the eye at a silhouette, where the surface itself does not.
    let cos_o = dot(normal, wo).max(1e-3);
    let lets_out = leaf.lobe.coupling(gloss, 0.0, leaf.lobe.albedo(cos_o));
    Hit { place, normal, cos_o, body: [r, g, b].map(|c| c * lets_out), gloss }
}

/// From the top of the relief down along the ray that passes the reference plane at `start` (in
/// cells) towards `wo`, to the first surface point.
fn march_down(leaf: &Leaf, start: [f32; 2], wo: [f32; 3]) -> [f32; 2] {
    // Way on the grid per millimetre of height.
    let drift = [wo[0] / wo[2] / leaf.grid.cell_mm, wo[1] / wo[2] / leaf.grid.cell_mm];
    let at = |z: f32| [start[0] + drift[0] * z, start[1] + drift[1] * z];
    let above = |z: f32| z > leaf.grid.corners(at(z)).sample(&leaf.height_mm);
    let depth = leaf.highest_mm - leaf.lowest_mm;
    let way = (drift[0] * drift[0] + drift[1] * drift[1]).sqrt() * depth;
    let steps = (way / STEP_CELLS).ceil().max(1.0);
    let mut free = leaf.highest_mm;
    let mut blocked = leaf.lowest_mm;
    for i in 1..=steps as usize {
        let z = leaf.highest_mm - depth * (i as f32 / steps);
        if !above(z) {
            blocked = z;
            break;
        }
        free = z;
    }
    for _ in 0..REFINEMENTS {
        let middle = 0.5 * (free + blocked);
        if above(middle) { free = middle } else { blocked = middle }
    }
    at(0.5 * (free + blocked))
}

/// Share of the lamp that a node sees: from how far the relief keeps clear of the way to the
/// lamp's middle.
fn march_up(leaf: &Leaf, column: usize, row: usize, wi: [f32; 3]) -> f32 {
    let sin2 = wi[0] * wi[0] + wi[1] * wi[1];
    if sin2 < 1e-10 {
        return 1.0;
    }
    let sin = sin2.sqrt();
    let step = [wi[0] / sin * STEP_CELLS, wi[1] / sin * STEP_CELLS];
    let step_mm = STEP_CELLS * leaf.grid.cell_mm;
    let rise_mm = step_mm * wi[2] / sin;
    let mut height = leaf.height_mm[row * leaf.grid.side + column];
    let mut place = [column as f32, row as f32];
    let mut away_mm = 0.0;
    // Smallest angle between the way to the lamp and the relief's edge, seen from the node.
    let mut clearance = f32::MAX;
    loop {
        place = [place[0] + step[0], place[1] + step[1]];
        height += rise_mm;
        away_mm += step_mm;
        if height > leaf.highest_mm + away_mm * LAMP_RADIUS_RAD / sin2 {
            break;
        }
        let gap_mm = height - leaf.grid.corners(place).sample(&leaf.height_mm);
        clearance = clearance.min(gap_mm * sin2 / away_mm);
        if clearance < -LAMP_RADIUS_RAD {
            return 0.0;
        }
    }
    let t = ((clearance + LAMP_RADIUS_RAD) / (2.0 * LAMP_RADIUS_RAD)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[inline]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use btf_capture::{Direction, DirectionSet};

    use super::*;
    use crate::LeafParams;
    use crate::leaf::patch::tests::small;

    fn leaf() -> Leaf {
        let set = DirectionSet::new(vec![Direction::new(75.0, 0.0)]).unwrap();
        Leaf::new(&LeafParams { size: 64, views: set.clone(), lights: set, ..small() }).unwrap()
    }

    /// A leaf whose relief is replaced: `height` in millimetres over the position, one body
    /// colour, no gloss.
    fn shaped(height: impl Fn([f32; 2]) -> f32, gloss: f32) -> Leaf {
        let mut leaf = leaf();
        let (grid, side) = (leaf.grid, leaf.grid.side);
        leaf.height_mm = (0..grid.len()).map(|node| height(grid.position_mm(node % side, node / side))).collect();
        leaf.lowest_mm = leaf.height_mm.iter().copied().fold(f32::MAX, f32::min);
        leaf.highest_mm = leaf.height_mm.iter().copied().fold(f32::MIN, f32::max);
        for node in 0..grid.len() {
            let [x, y] = grid.position_mm(node % side, node / side);
            let d = grid.cell_mm;
            let slope_x = (height([x + d, y]) - height([x - d, y])) / (2.0 * d);
            let slope_y = (height([x, y + d]) - height([x, y - d])) / (2.0 * d);
            leaf.surface[node] = [slope_x, slope_y, 0.5, 0.4, 0.3, gloss];
        }
        leaf
    }

    fn image(leaf: &Leaf, wi: Direction, wo: Direction) -> Vec<f32> {
        render(leaf, &ViewHits::new(leaf, wo.unit()), &LightVisibility::new(leaf, wi.unit()))
    }

    #[test]
    fn a_flat_matt_leaf_is_its_body_colour_times_the_cosine() {
        let flat = shaped(|_| 0.0, 0.0);
        for (light, view) in [(0.0, 0.0), (60.0, 30.0), (75.0, 75.0)] {
            let image = image(&flat, Direction::new(light, 40.0), Direction::new(view, 200.0));
            let cos = light.to_radians().cos() as f32;
            for texel in image.chunks_exact(3) {
                assert!((texel[0] - 0.5 * cos).abs() < 1e-5 && (texel[2] - 0.3 * cos).abs() < 1e-5, "{texel:?}");
            }
        }
    }

    #[test]
    fn a_flat_glossy_leaf_is_brightest_in_the_mirror_direction_and_obeys_reciprocity() {
        let flat = shaped(|_| 0.0, 1.0);
        let first = |wi: Direction, wo: Direction| image(&flat, wi, wo)[0];
        let light = Direction::new(45.0, 0.0);
        let mirror = first(light, Direction::new(45.0, 180.0));
        assert!(mirror > 1.2 * first(light, Direction::new(0.0, 0.0)));
        let (a, b) = (Direction::new(20.0, 10.0), Direction::new(70.0, 150.0));
        let forward = first(a, b) / a.unit()[2];
        let backward = first(b, a) / b.unit()[2];
        assert!((forward - backward).abs() < 1e-4 * forward, "{forward} {backward}");
    }

    #[test]
    fn a_tilted_plane_has_the_cosine_of_its_own_normal() {
        let tilted = shaped(|p| 0.2 * (p[0] - 10.0), 0.0);
        let light = Direction::new(30.0, 0.0);
        let image = image(&tilted, light, Direction::new(0.0, 0.0));
        let scale = 1.0 / (1.0f32 + 0.04).sqrt();
        let expected = 0.5 * (-0.2 * scale * light.unit()[0] + scale * light.unit()[2]);
        // Texels away from the grid's edge, where the plane goes on.
        let middle = (32 * 64 + 32) * 3;
        assert!((image[middle] - expected).abs() < 1e-3, "{} {expected}", image[middle]);
    }

    /// A wall along y of 0.4 mm height and 1 mm width in the middle of the patch.
    fn wall() -> Leaf {
        shaped(|p| if (p[0] - 10.0).abs() < 0.5 { 0.4 } else { 0.0 }, 0.0)
    }

    #[test]
    fn a_wall_throws_a_shadow_of_the_right_length_to_the_side_away_from_the_light() {
        let wall = wall();
        // From the right (+x) at 60 degrees: 0.4 mm * tan 60 = 0.69 mm of shadow to the left.
        let visible = LightVisibility::new(&wall, Direction::new(60.0, 0.0).unit());
        for y in [3.0, 12.3] {
            assert!(visible.share_at(&wall, [9.5 - 0.35, y]) < 0.05, "in the shadow");
            assert!(visible.share_at(&wall, [9.5 - 1.3, y]) > 0.95, "beyond it");
            assert!(visible.share_at(&wall, [10.5 + 0.5, y]) > 0.95, "on the lit side");
        }
        let noon = LightVisibility::new(&wall, [0.0, 0.0, 1.0]);
        assert_eq!(noon.share_at(&wall, [9.3, 5.0]), 1.0);
    }

    #[test]
    fn a_grazing_view_sees_the_wall_shifted_and_not_what_it_hides() {
        let wall = wall();
        let wo = Direction::new(60.0, 0.0).unit();
        // The eye stands to the right: the ray through a point of the reference plane left of the
        // wall meets it.
        let place =
            |x: f32| march_down(&wall, wall.grid.cells([x, 10.0]), wo)[0] * wall.grid.cell_mm - wall.grid.margin_mm;
        assert!((place(5.0) - 5.0).abs() < 0.02, "plain ground");
        assert!((place(9.3) - (9.3 + 0.4 * 60f32.to_radians().tan())).abs() < 0.1, "the wall's top: {}", place(9.3));
        assert!((place(11.0) - 11.0).abs() < 0.02, "the ground on the eye's side");
        assert!((place(9.5 - 0.35) - 9.5).abs() < 0.35, "the hidden ground is not seen: {}", place(9.15));
    }

    #[test]
    fn a_hit_lies_on_the_surface_and_nothing_stands_before_it() {
        let leaf = leaf();
        for (theta, phi) in [(30.0, 20.0), (75.0, 200.0), (85.0, 300.0)] {
            let wo = Direction::new(theta, phi).unit();
            for i in 0..100 {
                let start = leaf.grid.cells([(i % 10) as f32 * 2.0 + 0.3, (i / 10) as f32 * 2.0 + 0.3]);
                let place = march_down(&leaf, start, wo);
                // Height of the ray over that place.
                let along = ((place[0] - start[0]) * wo[0] + (place[1] - start[1]) * wo[1]) * leaf.grid.cell_mm;
                let z = along * wo[2] / (wo[0] * wo[0] + wo[1] * wo[1]);
                let surface = leaf.grid.corners(place).sample(&leaf.height_mm);
                assert!((z - surface).abs() < 5e-3, "{theta}: ray {z} surface {surface}");
            }
        }
    }

    #[test]
    fn images_are_finite_and_a_light_below_the_local_horizon_gives_black() {
        let leaf = leaf();
        for (light, view) in [(0.0, 0.0), (75.0, 75.0), (88.0, 88.0)] {
            let image = image(&leaf, Direction::new(light, 10.0), Direction::new(view, 190.0));
            assert!(image.iter().all(|v| v.is_finite() && *v >= -0.1));
        }
        let steep = shaped(|p| 2.0 * p[0], 0.0);
        let image = image(&steep, Direction::new(80.0, 0.0), Direction::new(0.0, 0.0));
        assert_eq!(image[(32 * 64 + 32) * 3], 0.0);
    }
}
