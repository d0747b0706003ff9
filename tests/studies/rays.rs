//! Rays a second through triangles, on one core of the CPU, as Markdown: `cargo run --release -p btf-tests -- rays
//! CANOPY.glb [EMBREE.so]`, beside Embree where its library is named.
//!
//! Four kinds of rays: through the pixels of a picture; from what these meet towards the sun, and in a random direction of the
//! sky (any hit will do); and in another random direction, to what reflects light (the nearest hit). Those to the sky are also traced in
//! the order of their octants and places, whose making counts for ours. The canopy is placed as
//! often as makes so many triangles, or written out as one mesh; the forest is that of `btf-view scene forest` as triangles.
//! Both tracers take turns, and the least of their times counts. Rows also tell how many rays meet something else.

use crate::embree::{Embree, own_vertices};
use crate::landscape_costs::as_triangles;
use btf_viewer::testing::instanced_scene;
use btf_viewer::{AnyHit, Geometry, Instance, Landscape, Mesh, NO_HIT, Scene, Triangle, Vertex};
use glam::{Mat4, Vec3, Vec4};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

/// Pixels through which rays go, one each.
const SIZE: [u32; 2] = [768, 432];
/// Triangles of the canopies.
const CANOPIES: [u64; 2] = [8_600_000, 100_000_000];
/// Towards the sun.
const SUN: Vec3 = Vec3::new(0.5, 0.6, 0.62);
/// Turns of both tracers.
const TURNS: usize = 5;
/// How far before a surface rays begin that leave it, as a share of the distance from the eye.
const OFFSET: f32 = 1e-4;
/// Relative difference of two distances that counts as another hit.
const SAME_DISTANCE: f32 = 1e-3;
/// Farthest hit that is looked for.
const FAR: f32 = 1e30;

/// Rays of one kind.
struct RaySet {
    name: &'static str,
    any: AnyHit,
    /// Origins and unit directions.
    rays: Vec<[Vec3; 2]>,
    /// Seconds that went into their order.
    sorting_s: f64,
}

/// The four kinds of rays of a scene.
fn ray_sets(scene: &Scene) -> Vec<RaySet> {
    let [width, height] = SIZE;
    let frame = scene.camera.frame(width, height);
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let camera: Vec<[Vec3; 2]> = pixels.map(|(x, y)| [frame.eye, frame.direction(x, y, [0.0; 2])]).collect();
    let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
    let [mut sun, mut sky, mut bounce] = [const { Vec::new() }; 3];
    for [eye, direction] in &camera {
        let hit = scene.geometry.trace(*eye, *direction, FAR, AnyHit::No);
        if hit.primitive == NO_HIT {
            continue;
        }
        let normal = normal(&scene.geometry, hit.instance, hit.primitive);
        let normal = if normal.dot(*direction) > 0.0 { -normal } else { normal };
        let origin = *eye + *direction * (hit.t * (1.0 - OFFSET));
        let mut by_cosine = || {
            // A point of the unit sphere on top of the normal.
            let z = random.gen_range(-1.0f32..1.0);
            let (sin, cos) = random.gen_range(0.0f32..std::f32::consts::TAU).sin_cos();
            let across = (1.0 - z * z).sqrt();
            (normal + Vec3::new(across * cos, across * sin, z)).normalize_or(normal)
        };
        sky.push([origin, by_cosine()]);
        bounce.push([origin, by_cosine()]);
        sun.push([origin, SUN.normalize()]);
    }
    let start = Instant::now();
    let sorted = sorted(&sky);
    let sorting_s = start.elapsed().as_secs_f64();
    vec![
        RaySet { name: "camera", any: AnyHit::No, rays: camera, sorting_s: 0.0 },
        RaySet { name: "sun", any: AnyHit::Yes, rays: sun, sorting_s: 0.0 },
        RaySet { name: "sky", any: AnyHit::Yes, rays: sky, sorting_s: 0.0 },
        RaySet { name: "sky, sorted", any: AnyHit::Yes, rays: sorted, sorting_s },
        RaySet { name: "bounce", any: AnyHit::No, rays: bounce, sorting_s: 0.0 },
    ]
}

/// Sorts rays by the octant of their direction, and in it by their origin's place on a Morton curve.
fn sorted(rays: &[[Vec3; 2]]) -> Vec<[Vec3; 2]> {
    const CELLS: f32 = 1023.0;
    let (lo, hi) = rays.iter().fold((Vec3::MAX, Vec3::MIN), |(lo, hi), [origin, _]| (lo.min(*origin), hi.max(*origin)));
    let spread = |cell: u32| (0..10).fold(0, |code, bit| code | (cell >> bit & 1) << (3 * bit));
    let key = |[origin, direction]: &[Vec3; 2]| {
        let cell = (*origin - lo) / (hi - lo).max(Vec3::splat(f32::MIN_POSITIVE)) * CELLS;
        let place = spread(cell.x as u32) | spread(cell.y as u32) << 1 | spread(cell.z as u32) << 2;
        ([direction.x, direction.y, direction.z].map(|x| x < 0.0), place)
    };
    let mut rays = rays.to_vec();
    rays.sort_by_cached_key(key);
    rays
}

/// Returns the map that places an instance in the world.
fn map_of(instance: &Instance) -> Mat4 {
    let [x, y, z] = instance.world_from_object.map(Vec4::from);
    Mat4::from_cols(x, y, z, Vec4::W).transpose()
}

/// Returns the unit normal of a triangle in the world.
fn normal(geometry: &Geometry, instance: u32, primitive: u32) -> Vec3 {
    let map = map_of(&geometry.instances()[instance as usize]);
    let [a, b, c] = geometry.corners(primitive).map(|corner| map.transform_point3(corner));
    (b - a).cross(c - a).normalize_or(Vec3::Y)
}

/// Returns the distances of all hits, negative without one, and the seconds of that.
fn timed(rays: &RaySet, trace: impl Fn(Vec3, Vec3) -> f32) -> (Vec<f32>, f64) {
    let start = Instant::now();
    let hits = rays.rays.iter().map(|[origin, direction]| trace(*origin, *direction)).collect();
    (hits, start.elapsed().as_secs_f64())
}

/// Traces rays by our hierarchy.
fn by_ours(geometry: &Geometry, rays: &RaySet) -> (Vec<f32>, f64) {
    timed(rays, |origin, direction| {
        let hit = geometry.trace(origin, direction, FAR, rays.any);
        match (hit.primitive, rays.any) {
            (NO_HIT, _) => -1.0,
            (_, AnyHit::Yes) => 0.0,
            _ => hit.t,
        }
    })
}

/// Traces rays by Embree.
fn by_embree(embree: &Embree, rays: &RaySet) -> (Vec<f32>, f64) {
    timed(rays, |origin, direction| {
        let [origin, direction] = [origin.to_array(), direction.to_array()];
        match rays.any {
            AnyHit::Yes => -f32::from(!embree.occluded(origin, direction, FAR)),
            _ => embree.nearest(origin, direction, FAR).unwrap_or(-1.0),
        }
    })
}

/// Tells whether two distances, negative without a hit, are of different hits.
fn is_other_hit(a: f32, b: f32) -> bool {
    (a - b).abs() > SAME_DISTANCE * a.abs().max(b.abs())
}

/// Prints the rows of a scene.
fn measure(name: &str, scene: &Scene, embree: Option<&Path>) -> Result<(), Box<dyn Error>> {
    let geometry = &*scene.geometry;
    let embree = embree.map(|library| Embree::new(library, geometry)).transpose()?;
    for rays in ray_sets(scene) {
        let count = rays.rays.len() as f64;
        let (mut ours, mut theirs) = (f64::MAX, f64::MAX);
        let mut differing = 0;
        for _ in 0..TURNS {
            let (hits, seconds) = by_ours(geometry, &rays);
            ours = ours.min(seconds + rays.sorting_s);
            if let Some(embree) = &embree {
                let (their_hits, seconds) = by_embree(embree, &rays);
                theirs = theirs.min(seconds);
                differing = hits.iter().zip(&their_hits).filter(|(a, b)| is_other_hit(**a, **b)).count();
            }
        }
        let m_rays = |seconds: f64| 1e-6 * count / seconds;
        print!("| {name} | {} | {} | {count} | {:.2} |", geometry.placed_triangles(), rays.name, m_rays(ours));
        match &embree {
            Some(_) => println!(" {:.2} | {:.2} | {differing} |", m_rays(theirs), theirs / ours),
            None => println!(" | | |"),
        }
    }
    Ok(())
}

/// Writes all instances of a scene out as one mesh.
fn flattened(geometry: &Geometry) -> Result<Geometry, String> {
    let meshes: Vec<&[Triangle]> = geometry.mesh_triangles().collect();
    let mut mesh = Mesh::default();
    for (number, instance) in geometry.instances().iter().enumerate() {
        let map = map_of(instance);
        let triangles = meshes[geometry.mesh_of(number)];
        let (first, own) = own_vertices(geometry.vertices(), triangles);
        let before = mesh.vertices.len() as u32;
        let placed =
            |vertex: &Vertex| Vertex { position: map.transform_point3(vertex.position.into()).to_array(), ..*vertex };
        mesh.vertices.extend(own.iter().map(placed));
        mesh.triangles.extend(triangles.iter().map(|triangle| Triangle {
            vertices: triangle.vertices.map(|vertex| vertex - first + before),
            ..*triangle
        }));
    }
    Geometry::new(mesh.vertices, mesh.triangles)
}

/// Runs the study.
///
/// # Errors
/// Those of reading the canopy and opening Embree.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [canopy, rest @ ..] = arguments else { return Err("name the canopy, a .glb file".into()) };
    let embree = rest.first().map(Path::new);
    println!("| scene | triangles | rays | number | ours, M/s | Embree, M/s | ours of Embree's | other hits |");
    println!("|{}", "---|".repeat(8));
    for triangles in CANOPIES {
        measure("canopy", &instanced_scene(Path::new(canopy), triangles)?, embree)?;
    }
    let mut scene = instanced_scene(Path::new(canopy), CANOPIES[0])?;
    *std::sync::Arc::make_mut(&mut scene.geometry) = flattened(&scene.geometry)?;
    measure("canopy as one mesh", &scene, embree)?;
    let folder = tempfile::tempdir()?;
    measure("forest", &as_triangles(Landscape::Forest, folder.path())?, embree)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_hits_are_told_from_the_same() {
        for (a, b) in [(5.0, 5.004), (-1.0, -1.0), (0.0, -0.0), (1e9, 1.0005e9)] {
            assert!(!is_other_hit(a, b) && !is_other_hit(b, a), "{a} {b}");
        }
        for (a, b) in [(5.0, 5.1), (5.0, -1.0), (0.0, -1.0), (1e-6, -1.0), (1e20, -1.0), (1e9, 1.01e9)] {
            assert!(is_other_hit(a, b) && is_other_hit(b, a), "{a} {b}");
        }
    }
}
