//! The scenes that come with the viewer: made by formulas, in metres, y up. No asset files.
//!
//! Every part of a model is one chart: a grid over the unit square, seams at its borders. Texture coordinates are
//! lengths along the surface in units of [`TILE_M`], so that an asset of 256 x 256 texels lies on it with 2.56 texels a
//! millimetre at `uv_scale` 1.

mod boots;
mod cloth;
mod cornell;
mod last;
mod leaf_blade;
mod patch;
mod plant;
mod pullover;
mod shoe;

pub(crate) use boots::boots;
pub(crate) use cloth::cloth;
pub(crate) use cornell::cornell;
pub(crate) use leaf_blade::leaf_blade;
pub(crate) use patch::TILE_M;
#[cfg(not(target_arch = "wasm32"))]
pub(crate) use plant::plant;
pub(crate) use pullover::pullover;
pub(crate) use shoe::shoe;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::mesh::MeshPart;
    use glam::{Vec2, Vec3};

    /// Texture tiles' lengths in metres over the triangles of a part: how much of the area has them within `range`.
    fn share_within(part: &MeshPart, range: std::ops::Range<f32>) -> f32 {
        let (mut within, mut all) = (0.0, 0.0);
        for triangle in &part.triangles {
            let [a, b, c] = triangle.map(|i| &part.vertices[i as usize]);
            let corner = |v: &crate::geometry::geometry::Vertex| (Vec3::from(v.position), Vec2::new(v.u, v.v));
            let [(pa, ta), (pb, tb), (pc, tc)] = [corner(a), corner(b), corner(c)];
            let area = (pb - pa).cross(pc - pa).length();
            let tile = (area / (tb - ta).perp_dot(tc - ta).abs().max(1e-12)).sqrt();
            all += area;
            within += if range.contains(&tile) { area } else { 0.0 };
        }
        within / all
    }

    #[test]
    fn every_model_has_its_triangles_and_texel_density() {
        for (name, parts) in [("cloth", cloth()), ("shoe", shoe()), ("boots", boots()), ("pullover", pullover())] {
            let triangles: usize = parts.iter().map(|part| part.triangles.len()).sum();
            assert!(triangles >= 50_000, "{name}: {triangles}");
            for part in &parts {
                assert!(part.has_uv && part.vertices.iter().all(|v| v.position.iter().all(|x| x.is_finite())));
                // Nearly everywhere within a third of the stated density, and not of another one.
                let share = share_within(part, 0.67 * TILE_M..1.5 * TILE_M);
                assert!(share > 0.9, "{name}, {}: {share}", part.name);
                assert!(share_within(part, 2.0 * TILE_M..3.0 * TILE_M) < 0.05);
            }
        }
    }

    /// Share of a part's area whose normal points away from the middle of the part's slice at that height.
    fn share_outwards(part: &MeshPart) -> f32 {
        const SLICES: usize = 12;
        let heights = part.vertices.iter().map(|v| v.position[1]);
        let (least, most) = (heights.clone().fold(f32::MAX, f32::min), heights.fold(f32::MIN, f32::max));
        let slice =
            |y: f32| (((y - least) / (most - least).max(1e-6)) * SLICES as f32).min(SLICES as f32 - 1.0) as usize;
        let mut middles = [(Vec3::ZERO, 0.0); SLICES];
        for vertex in &part.vertices {
            let (sum, count) = &mut middles[slice(vertex.position[1])];
            *sum += Vec3::from(vertex.position);
            *count += 1.0;
        }
        let (mut outwards, mut all) = (0.0, 0.0);
        for vertex in &part.vertices {
            let (sum, count) = middles[slice(vertex.position[1])];
            let away = Vec3::from(vertex.position) - sum / count;
            outwards += if away.dot(Vec3::from(vertex.normal)) > 0.0 { 1.0 } else { 0.0 };
            all += 1.0;
        }
        outwards / all
    }

    #[test]
    fn closed_models_show_their_outside() {
        for parts in [shoe(), boots(), pullover()] {
            for mut part in parts {
                assert!(share_outwards(&part) > 0.8, "{}: {}", part.name, share_outwards(&part));
                part.vertices.iter_mut().for_each(|v| v.normal = v.normal.map(|x| -x));
                assert!(share_outwards(&part) < 0.2, "the planted inside must not pass");
            }
        }
    }

    #[test]
    fn normals_are_unit_and_on_their_triangles_side() {
        for parts in [cloth(), shoe(), boots(), pullover()] {
            for part in parts {
                let mut agree = 0;
                for triangle in &part.triangles {
                    let [a, b, c] = triangle.map(|i| Vec3::from(part.vertices[i as usize].position));
                    let flat = (b - a).cross(c - a);
                    let normal = Vec3::from(part.vertices[triangle[0] as usize].normal);
                    assert!((normal.length() - 1.0).abs() < 1e-3, "{}", part.name);
                    agree += usize::from(flat.dot(normal) >= 0.0);
                }
                assert!(agree as f32 > 0.99 * part.triangles.len() as f32, "{}", part.name);
            }
        }
    }
}
