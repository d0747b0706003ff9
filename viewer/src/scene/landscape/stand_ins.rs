//! Where the meshes stand that a landscape's volumes stand in for.

use crate::volume::skin::{Merged, NO_VOLUME, Pattern, Shell, SkinPlace, TetPoint};
use glam::{Mat3, Mat4, Vec3, Vec4};
use std::collections::HashMap;

/// Where a plant is as its volume is, in shares of that: at its foot, which on the floor itself would be at an end of
/// the skin, and where its crown is.
const HEIGHTS: [f32; 2] = [1e-3, 0.7];
/// How far outside of a tetrahedron, in shares of it, a foot counts as within.
const SLACK: f32 = 1e-4;

/// A texel's (i, j), and its pattern.
type Texel = ([i32; 2], u32);

/// The tetrahedra in which a texel's foot lies and the point above it.
struct Found {
    /// Distance inside, in shares of the tetrahedron.
    inside: [f32; 2],
    points: [TetPoint; 2],
    texture_from_volume: Mat4,
    volumes: Merged,
}

/// Returns, of every texel that is not empty, its volumes, and where their unit cubes stand, right where `foot` is in
/// them and above that. A texel that the skin shows in several places stands in one of them. Sorted by texel. Cost: a
/// pass over the tetrahedra.
pub(super) fn plant_places(shell: &Shell, patterns: &[Pattern], foot: Vec3) -> Vec<(u32, SkinPlace)> {
    let mut found: HashMap<Texel, Found> = HashMap::new();
    for (number, tet) in shell.tets().iter().enumerate() {
        let [a, b, c, d] = tet.textures.map(|i| shell.textures()[i as usize]);
        let texture_edges = Mat3::from_cols(b - a, c - a, d - a);
        if texture_edges.determinant().abs() < 1e-12 {
            continue;
        }
        let shares_of_texture = texture_edges.inverse();
        let [least, most] = [a.min(b).min(c.min(d)), a.max(b).max(c.max(d))].map(|corner| [corner.x, corner.y]);
        let cells = |axis: usize| least[axis].floor() as i32..=most[axis].floor() as i32;
        for cell in cells(1).flat_map(|j| cells(0).map(move |i| [i, j])) {
            let pattern = &patterns[tet.pattern as usize];
            let Some(variant) = pattern.variant(cell) else { continue };
            let [x, y, z] = variant.volume_from_texture().map(Vec4::from);
            let texture_from_volume = Mat4::from_cols(x, y, z, Vec4::W).transpose().inverse();
            let points = HEIGHTS.map(|height| {
                let texture = texture_from_volume.transform_point3(foot.with_z(height));
                TetPoint { tet: number, texture }
            });
            let inside = points.map(|point| {
                let shares = shares_of_texture * (point.texture - a);
                shares.min_element().min(1.0 - shares.element_sum())
            });
            if inside.iter().all(|inside| *inside <= -SLACK) {
                continue;
            }
            let volumes = pattern.alternatives[variant.alternative as usize];
            let known = found.entry((cell, tet.pattern)).or_insert(Found {
                inside: [-SLACK; 2],
                points,
                texture_from_volume,
                volumes,
            });
            for i in 0..2 {
                if inside[i] > known.inside[i] {
                    (known.inside[i], known.points[i]) = (inside[i], points[i]);
                }
            }
        }
    }
    let mut found: Vec<_> = found.into_iter().filter(|(_, found)| found.inside.iter().all(|x| *x > -SLACK)).collect();
    found.sort_by_key(|(texel, _)| *texel);
    let places = |(_, Found { points: [foot, above], texture_from_volume, volumes, .. })| {
        let place = SkinPlace::new(foot, above, texture_from_volume);
        volumes.into_iter().take_while(|volume| *volume != NO_VOLUME).map(move |volume| (volume, place))
    };
    found.into_iter().flat_map(places).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::skin::{DiscreteJitter, ShellParams, Skin, SkinVertex};
    use btf_runtime::testing::Random;

    #[test]
    fn a_plant_stands_where_the_skin_has_its_volume() {
        // A hill on which texels are neither patches nor square.
        let vertex = |x: u32, y: u32| {
            let [x, y] = [x, y].map(|x| x as f32);
            let at = Vec3::new(x, 0.3 * (0.7 * x).sin() + 0.2 * y, -y);
            SkinVertex::new(at, Vec3::new(0.1 * x, 1.0, 0.0), [0.4 + 0.9 * x, 0.3 + 1.2 * y])
        };
        let skin = Skin::from_grid(6, 5, vertex, |_, _| 0).unwrap();
        let shell = Shell::new(&skin, &ShellParams::default()).unwrap();
        let jitter = DiscreteJitter {
            empty: 0.3,
            scale: [0.5, 0.9],
            displacement: 0.4,
            margin: 0.1,
            turns: true,
            mirrors: true,
        };
        let pattern = Pattern::isolated(3, jitter, 5);
        const FOOT: Vec3 = Vec3::new(0.4, 0.6, 0.0);
        let places: Vec<(u32, Mat4)> = plant_places(&shell, std::slice::from_ref(&pattern), FOOT)
            .into_iter()
            .map(|(volume, place)| (volume, place.world_from_object(&shell)))
            .collect();
        // Texels whose middle is on the skin: 5 and 6 along the sides, a third of them empty.
        assert!((12..30).contains(&places.len()), "{}", places.len());
        let mut random = Random::new(2);
        let (mut near, mut far) = (0f32, 0f32);
        for (volume, map) in &places {
            assert_eq!(*volume, 3);
            for height in [0.001, 0.3] {
                let at = Vec3::new(random.within(0.35, 0.45), random.within(0.55, 0.65), height);
                let world = map.transform_point3(at);
                let Some(tet) = shell.locate(world) else { continue };
                let texture = shell.map(tet).point(world);
                let cell = [texture.x, texture.y].map(|x| x.floor() as i32);
                let Some(variant) = pattern.variant(cell) else { continue };
                let off = (variant.point(texture) - at).length();
                if height < 0.01 {
                    near = near.max(off);
                } else {
                    far = far.max(off);
                }
            }
        }
        // Right at the foot, and nearly so above it.
        assert!(near < 0.03 && far < 0.15, "{near} {far}");
        // Planted: the map of another texel is far off.
        assert!((places[0].1.transform_point3(FOOT) - places[1].1.transform_point3(FOOT)).length() > 0.2);
    }
}
