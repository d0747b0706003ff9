//! Displacement: an asset's heights as relief in a shell below the mesh, met by marching [Policarpo 2005], with the
//! mesh's curvature, so that rays near a silhouette pass between the hills and leave the shell again [Oliveira 2005].
//! Twin: `relief.wgsl`.
//!
//! The mesh is the shell's lid, where the highest point lies. What is decoded is the texel at which the capture shows
//! the point that the ray meets: at scale 1 where the ray crosses the plane that the capture is rectified to, so that
//! what was measured is seen as it was measured, parallax and all.

use crate::geometry::bvh::Hit;
use crate::geometry::geometry::Geometry;
use crate::geometry::surface::{Surface, corners_of};
use crate::scene::material::Material;
use crate::scene::scene::Scene;
use btf_runtime::{HeightField, SurfaceSide};
use glam::{Vec2, Vec3};

/// Sideways way of a step, texels.
const RELIEF_STEP: f32 = 0.5;
/// Steps of a ray, at least and at most.
const MIN_RELIEF_STEPS: f32 = 8.0;
const MAX_RELIEF_STEPS: f32 = 128.0;
/// Height above the relief at which a shadow ray begins, texels.
const RELIEF_BIAS: f32 = 0.05;

/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[
    ("RELIEF_STEP", RELIEF_STEP),
    ("MIN_RELIEF_STEPS", MIN_RELIEF_STEPS),
    ("MAX_RELIEF_STEPS", MAX_RELIEF_STEPS),
    ("RELIEF_BIAS", RELIEF_BIAS),
];

/// The relief below a point of the mesh.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Relief<'a> {
    field: HeightField<'a>,
    /// Factor of the heights.
    scale: f32,
    /// Texels on a unit of length.
    pub texels_per_unit: f32,
    /// Place of the point: column and row, texel centres at whole numbers.
    place: Vec2,
    /// Change of the normal along tangent and bitangent, per texel: xx, xy, yy.
    curvature: Vec3,
    /// Columns and rows of the finest level.
    size: Vec2,
}

impl<'a> Relief<'a> {
    /// Returns the relief below a point; `None` where the material has none.
    pub(crate) fn relief_new(scene: &'a Scene, hit: &Hit, s: &Surface) -> Option<Relief<'a>> {
        let material = &scene.materials[s.material];
        if material.displacement <= 0.0 {
            return None;
        }
        let resident = scene.assets[material.asset()?].head();
        let field =
            HeightField::of_resident(resident, resident.layer_for_sides(0, SurfaceSide::Front, SurfaceSide::Front)?)?;
        let size = Vec2::new(resident.width() as f32, resident.height() as f32);
        let scale = Vec2::from(material.uv_scale);
        let tiles = size * scale.abs();
        let texels_per_unit = s.texture_per_unit * (tiles.x * tiles.y).sqrt();
        let uv = s.uv * scale;
        let place = Vec2::new(uv.x, 1.0 - uv.y) * size - 0.5;
        let curvature = relief_curvature(&scene.geometry, hit, s) / texels_per_unit.max(1e-20);
        (texels_per_unit > 0.0).then_some(Relief {
            field,
            scale: material.displacement,
            texels_per_unit,
            place,
            curvature,
            size,
        })
    }

    /// Returns how much faster than straight a ray along `l` rises above the surface, per texel of its way.
    fn relief_bend(&self, l: Vec3) -> f32 {
        self.curvature.x * l.x * l.x + 2.0 * self.curvature.y * l.x * l.y + self.curvature.z * l.y * l.y
    }

    /// Returns the column and row after the way `way` along `l`.
    fn relief_place(&self, from: Vec2, l: Vec3, way: f32) -> Vec2 {
        from + way * Vec2::new(l.x, -l.y)
    }

    /// Returns the way of a ray that enters the shell at the point along `l`, a unit vector of the texel's frame with z
    /// < 0, to what it meets, texels; negative where it leaves the shell, by the way to there.
    pub(crate) fn relief_enter(&self, l: Vec3) -> f32 {
        let [least, most] = self.field.range().map(|z| z * self.scale);
        let (depth, bend) = (most - least, self.relief_bend(l));
        // To the bottom, or to where the surface has bent away so far that the ray is out again.
        let root2 = l.z * l.z - 2.0 * bend * depth;
        let leaves = root2 < 0.0;
        let end = if leaves { -2.0 * l.z / bend } else { 2.0 * depth / (-l.z + root2.sqrt()).max(1e-6) };
        let steps = (end * l.truncate().length() / RELIEF_STEP).ceil().clamp(MIN_RELIEF_STEPS, MAX_RELIEF_STEPS);
        let above = |way: f32| {
            let z = most + way * l.z + 0.5 * bend * way * way;
            z - self.scale * self.field.at_wrapped(self.relief_place(self.place, l, way).to_array())
        };
        let (mut free, mut clear) = (0.0, above(0.0).max(0.0));
        for i in 1..=steps as u32 {
            let way = end * (i as f32 / steps);
            let now = above(way);
            if now <= 0.0 {
                // Straight between the last two.
                return free + (way - free) * (clear / (clear - now).max(1e-12));
            }
            (free, clear) = (way, now);
        }
        if leaves { -end } else { end }
    }

    /// Returns the column, row and height (unscaled) of the point after the way `way` along `l`.
    pub(crate) fn relief_point(&self, l: Vec3, way: f32) -> Vec3 {
        let z = self.field.range()[1] * self.scale + way * l.z + 0.5 * self.relief_bend(l) * way * way;
        self.relief_place(self.place, l, way).extend(z / self.scale)
    }

    /// Returns the texture coordinates of the mesh at which the capture shows `point` to an eye at `wo`.
    pub(crate) fn relief_uv(&self, material: &Material, point: Vec3, wo: Vec3) -> Vec2 {
        let shown = point.truncate() - point.z * Vec2::from(HeightField::slope(wo.to_array()));
        let at = (shown + 0.5) / self.size;
        Vec2::new(at.x, 1.0 - at.y) / Vec2::from(material.uv_scale)
    }

    /// Returns whether relief of heights times `scale` stands between the point and the light at `wi`.
    pub(crate) fn relief_blocked(&self, point: Vec3, wi: Vec3, scale: f32) -> bool {
        let most = self.field.range()[1] * scale;
        let from = point.z * scale + RELIEF_BIAS;
        let bend = self.relief_bend(wi);
        let depth = most - from;
        if depth <= 0.0 || wi.z <= 0.0 {
            return false;
        }
        // Up to the lid; a surface that bends up catches the ray at the latest where it no longer rises.
        let root2 = wi.z * wi.z + 2.0 * bend * depth;
        let end = if root2 < 0.0 { -wi.z / bend } else { 2.0 * depth / (wi.z + root2.sqrt()) };
        let steps = (end * wi.truncate().length() / RELIEF_STEP).ceil().clamp(MIN_RELIEF_STEPS, MAX_RELIEF_STEPS);
        for i in 1..=steps as u32 {
            let way = end * (i as f32 / steps);
            let z = from + way * wi.z + 0.5 * bend * way * way;
            if z < scale * self.field.at_wrapped(self.relief_place(point.truncate(), wi, way).to_array()) {
                return true;
            }
        }
        false
    }

    /// Returns whether relief takes the light at `wi` from the point, which is more than the measured values know: they
    /// hold the shadows of the relief as it was measured. `bare` values hold none.
    pub(crate) fn relief_shadowed(&self, point: Vec3, wi: Vec3, bare: bool) -> bool {
        if bare {
            return self.relief_blocked(point, wi, self.scale);
        }
        self.scale != 1.0 && self.relief_blocked(point, wi, self.scale) && !self.relief_blocked(point, wi, 1.0)
    }
}

/// Returns the change of the interpolated normal along tangent and bitangent, per unit of length: xx, xy, yy.
fn relief_curvature(geometry: &Geometry, hit: &Hit, s: &Surface) -> Vec3 {
    let [a, b, c] = &corners_of(geometry, hit);
    let [na, nb, nc] = [a, b, c].map(|vertex| Vec3::from(vertex.normal));
    let e = Vec3::from(b.position) - Vec3::from(a.position);
    let f = Vec3::from(c.position) - Vec3::from(a.position);
    let cross = e.cross(f);
    let area2 = cross.length_squared().max(1e-30);
    // Rates of the second and third corner's weights along a direction.
    let change = |d: Vec3| (nb - na) * (d.cross(f).dot(cross) / area2) + (nc - na) * (e.cross(d).dot(cross) / area2);
    let (along, across) = (change(s.tangent), change(s.bitangent));
    Vec3::new(along.dot(s.tangent), 0.5 * (along.dot(s.bitangent) + across.dot(s.tangent)), across.dot(s.bitangent))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Camera;
    use crate::Control;
    use crate::RenderParams;
    use crate::Rendered;
    use crate::geometry::geometry::Vertex;
    use crate::gpu::backend::BackendChoice;
    use crate::options::ShadeOptions;
    use crate::render;
    use crate::scene::asset::SceneAsset;
    use crate::scene::mesh::{self, MeshPart};
    use crate::scene::scene::{PointLight, SceneObject};
    use btf_runtime::testing::sample_asset;
    use btf_runtime::{DictionaryLobe, Heights, Lobe, LobeFamily, LobeRef, ResidualKind};
    use std::path::Path;
    use std::sync::Arc;

    const SIDE: usize = 32;

    /// Hills of so many texels from crest to dale, in steps of 1/16 texel.
    fn height(x: f32, y: f32) -> f32 {
        let wave = |t: f32| (std::f32::consts::TAU * t / 16.0).cos();
        3.0 * wave(x) * wave(y)
    }

    /// A diffuse white asset with hills.
    fn hills() -> SceneAsset {
        let mut asset = sample_asset(1, SIDE, SIDE, ResidualKind::Root);
        let layer = &mut asset.layers[0];
        layer.residual = None;
        let lobe = Lobe { family: LobeFamily::Lambertian, normal_xy: [0.0; 2], tangent_rad: 0.0, params: [0.0; 4] };
        layer.dictionary = vec![vec![DictionaryLobe { lobe, weight_scale: 1.0 }]; layer.dictionary.len()];
        layer.texel_lobe_counts.fill(1);
        layer.lobe_refs = vec![LobeRef { lobe: 0, weight: [255; 3] }; SIDE * SIDE];
        let codes = (0..SIDE * SIDE).map(|i| (16.0 * height((i % SIDE) as f32, (i / SIDE) as f32)).round() as i8);
        layer.heights = Some(Heights { step: 1.0 / 16.0, codes: codes.collect() });
        SceneAsset::new("hills", asset)
    }

    /// Returns the surface as geometry: a fine grid over `place(u, v) -> (point, normal)`, lowered from the highest
    /// point.
    fn explicit(
        place: impl Fn(f32, f32) -> (Vec3, Vec3),
        tiles: [f32; 2],
        texels_per_unit: f32,
        cells: u32,
    ) -> MeshPart {
        let mut part = mesh::plane();
        (part.vertices, part.triangles) = (Vec::new(), Vec::new());
        for row in 0..=cells {
            for column in 0..=cells {
                let (u, v) = (column as f32 / cells as f32, row as f32 / cells as f32);
                let (point, normal) = place(u, v);
                // Texel centres at whole numbers; rows run against v.
                let x = u * tiles[0] * SIDE as f32 - 0.5;
                let y = (1.0 - v * tiles[1]) * SIDE as f32 - 0.5;
                let sunk = (height(x, y) - 3.0) / texels_per_unit;
                part.vertices.push(Vertex {
                    position: (point + normal * sunk).to_array(),
                    u,
                    normal: normal.to_array(),
                    v,
                    tangent: mesh::tangent_of(normal, Vec3::X, 1.0),
                });
            }
        }
        let across = cells + 1;
        for row in 0..cells {
            for column in 0..cells {
                let a = row * across + column;
                part.triangles.extend([[a, a + 1, a + across + 1], [a, a + across + 1, a + across]]);
            }
        }
        part
    }

    fn picture(part: MeshPart, displacement: f32, camera: Camera, light: Vec3) -> Rendered {
        let mut material = Material::from_asset(0, [2.0, 2.0]);
        material.displacement = displacement;
        let objects = vec![SceneObject { part, material }];
        let mut scene = Scene::from_objects(Path::new("relief"), objects, vec![Arc::new(hills())]).unwrap();
        scene.camera = camera;
        scene.lights = vec![PointLight { position: light, intensity: [light.length_squared() * 3.0; 3] }];
        let shade = ShadeOptions { levels: false, ..ShadeOptions::default() };
        let backend = BackendChoice::Cpu;
        let params = RenderParams { size: [128, 128], backend, shade, ..RenderParams::default() };
        render(&scene, &params, &Control::SILENT).unwrap()
    }

    /// Shares of the pixels that are lit in one picture and not in the other, and that only one of them hits.
    fn differences(a: &Rendered, b: &Rendered) -> [f32; 2] {
        let lit = |rendered: &Rendered, i: usize| rendered.picture.radiance[i][1] > 0.02;
        let hit = |rendered: &Rendered, i: usize| rendered.hits[i].primitive != crate::NO_HIT;
        let count = a.hits.len();
        let both = |differs: &dyn Fn(usize) -> bool| (0..count).filter(|i| differs(*i)).count() as f32 / count as f32;
        [both(&|i| hit(a, i) && hit(b, i) && lit(a, i) != lit(b, i)), both(&|i| hit(a, i) != hit(b, i))]
    }

    #[test]
    fn a_displaced_plane_has_the_shadows_of_the_same_geometry() {
        // A plane 2 wide with two tiles of 32 texels: 32 texels a unit.
        let flat = |u: f32, v: f32| (Vec3::new(2.0 * u - 1.0, 2.0 * v - 1.0, 0.0), Vec3::Z);
        let camera = Camera { eye: Vec3::new(0.3, -2.5, 1.6), target: Vec3::ZERO, up: Vec3::Z, fov_deg: 40.0 };
        let light = Vec3::new(-9.0, 3.0, 2.2);
        let truth = picture(explicit(flat, [2.0; 2], 32.0, 256), 0.0, camera, light);
        let relief = picture(mesh::plane(), 1.0, camera, light);
        let level = picture(mesh::plane(), 0.0, camera, light);
        let ([shadows, _], [none, _]) = (differences(&truth, &relief), differences(&truth, &level));
        println!("shadows that differ: {shadows:.4}, without relief {none:.4}");
        assert!(none > 0.05, "the light must be low enough: {none}");
        assert!(shadows < 0.15 * none, "{shadows} of {none}");
        // Planted difference: half the height.
        let half = picture(mesh::plane(), 0.5, camera, light);
        assert!(differences(&truth, &half)[0] > 2.0 * shadows);
    }

    #[test]
    fn a_displaced_cylinder_has_the_silhouette_of_the_same_geometry() {
        // Half a cylinder of radius 0.6 seen across its axis; the texture covers 0.6 pi x 2.
        let radius = 0.6;
        let round = |u: f32, v: f32| {
            let (sin, cos) = (std::f32::consts::PI * (u - 0.5)).sin_cos();
            let normal = Vec3::new(sin, 0.0, cos);
            (normal * radius + Vec3::Y * (2.0 * v - 1.0), normal)
        };
        let smooth = |cells: u32| {
            let mut part = explicit(round, [2.0; 2], 1e9, cells);
            part.vertices
                .iter_mut()
                .for_each(|vertex| vertex.tangent = [vertex.normal[2], 0.0, -vertex.normal[0], 1.0]);
            part
        };
        // 64 x 64 texels on that area.
        let texels_per_unit = 64.0 / (std::f32::consts::PI * radius * 2.0).sqrt();
        let camera = Camera { eye: Vec3::new(0.0, 0.0, 4.0), target: Vec3::ZERO, up: Vec3::Y, fov_deg: 22.0 };
        let light = Vec3::new(1.0, 1.0, 9.0);
        let truth = picture(explicit(round, [2.0; 2], texels_per_unit, 384), 0.0, camera, light);
        let relief = picture(smooth(96), 1.0, camera, light);
        let level = picture(smooth(96), 0.0, camera, light);
        let ([_, edge], [_, none]) = (differences(&truth, &relief), differences(&truth, &level));
        println!("silhouette that differs: {edge:.4}, without relief {none:.4}");
        assert!(none > 0.01, "the hills must show at the edge: {none}");
        assert!(edge < 0.4 * none, "{edge} of {none}");
    }

    #[test]
    fn at_scale_one_the_texel_is_where_the_ray_crosses_the_mean_plane() {
        let asset = Arc::new(hills());
        let mut material = Material::from_asset(0, [2.0, 2.0]);
        let mut shown = |scale: f32| {
            material.displacement = scale;
            let objects = vec![SceneObject { part: mesh::plane(), material }];
            let scene = Scene::from_objects(Path::new("relief"), objects, vec![asset.clone()]).unwrap();
            let direction = Vec3::new(0.5, 0.3, -0.6).normalize();
            let origin = Vec3::new(0.1, 0.05, 0.0) - direction * 3.0;
            let geometry = &scene.geometry;
            let hit = geometry.trace(origin, direction, 10.0, crate::AnyHit::No);
            let s = Surface::surface_at(geometry, &hit, direction);
            let relief = Relief::relief_new(&scene, &hit, &s).unwrap();
            let way = relief.relief_enter(direction);
            let point = relief.relief_point(direction, way);
            // The point lies on the relief.
            assert!((point.z - relief.field.at_wrapped([point.x, point.y])).abs() < 0.1, "{point}");
            // Where the ray crosses the plane 3 texels below the lid: texels of 1/32.
            let crossing = s.position + direction * (3.0 * scale / 32.0 / -direction.z);
            (relief.relief_uv(&material, point, s.wo), crossing.truncate() * 0.5 + 0.5)
        };
        let (uv, crossing) = shown(1.0);
        assert!((uv - crossing).length() < 1e-3, "{uv} {crossing}");
        // Planted difference: at another scale the capture shows the point elsewhere.
        let (uv, crossing) = shown(2.0);
        assert!((uv - crossing).length() > 0.005, "{uv} {crossing}");
    }
}
