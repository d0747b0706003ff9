//! Fills the irradiance volume: traces rays from places in its cells and asks for the direct light of what they meet.

use crate::cpu::path::{Path, PathVertex};
use crate::cpu::shader::Shader;
use crate::geometry::bvh::NO_HIT;
use crate::geometry::geometry::Geometry;
use crate::geometry::lod_transition::LodTransition;
use crate::geometry::surface::Surface;
use crate::light::environment::Environment;
use crate::light::irradiance_volume::{IrradianceCells, IrradianceVolume};
use crate::light::light_grid::LightGrid;
use crate::light::sun::Sun;
use crate::options::{RenderMode, ShadeOptions};
use crate::picture::PixelHit;
use crate::sampler;
use crate::scene::asset::SceneAsset;
use crate::scene::camera::CameraFrame;
use crate::scene::material::{Body, Material};
use crate::scene::scene::{Ambient, PointLight, Scene};
use crate::volume::volumes::Volumes;
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::{Arc, Weak};

/// Places in a cell from which a pass traces rays.
const PLACES: u32 = 4;
/// Rays from a place, stratified over the sphere.
const RAYS: u32 = 4;
/// Passes at most: 512 rays from every cell.
const MAX_PASSES: u32 = 32;
/// Point lights that are asked of where a ray ends.
const LIGHT_SAMPLES: u32 = 4;
/// Width at distance 1 of what a ray of the first pass stands for, a 1000th of the sphere.
const RAY_WIDTH: f32 = 0.1;
/// The weight of a place from which a ray sees the back of an opaque surface: it is below the ground or within a body.
const HIDDEN_WEIGHT: f32 = 1e-6;
/// Places of a cell after which it has no more where all were hidden.
const HIDDEN_PLACES: u32 = 16;
/// The weight of a cell's neighbours in it: a cell whose places are hidden has their light.
const NEIGHBOUR_WEIGHT: f32 = 1e-3;

/// What a volume was filled for.
#[derive(Debug, Clone)]
struct LitBy {
    geometry: Weak<Geometry>,
    volumes: Weak<Volumes>,
    assets: Vec<Weak<SceneAsset>>,
    /// Hash of all words of the leaves.
    leaves: u64,
    materials: Vec<Material>,
    lights: Vec<PointLight>,
    sun: Option<Sun>,
    ambient: Ambient,
    environment: Weak<Environment>,
    options: ShadeOptions,
}

impl LitBy {
    fn of(scene: &Scene, options: &ShadeOptions) -> LitBy {
        let mut hasher = DefaultHasher::new();
        scene.leaves.iter().for_each(|leaf| leaf.leaf.words().hash(&mut hasher));
        LitBy {
            geometry: Arc::downgrade(&scene.geometry),
            volumes: scene.volumes.as_ref().map_or_else(Weak::new, Arc::downgrade),
            assets: scene.assets.iter().map(Arc::downgrade).collect(),
            leaves: hasher.finish(),
            materials: scene.materials.clone(),
            lights: scene.lights.clone(),
            sun: scene.sun,
            ambient: scene.ambient,
            environment: scene.environment.as_ref().map_or_else(Weak::new, Arc::downgrade),
            options: *options,
        }
    }

    /// Tells whether nothing has changed that the light depends on.
    fn is(&self, other: &LitBy) -> bool {
        let same_assets = || self.assets.iter().zip(&other.assets).all(|(a, b)| a.ptr_eq(b));
        self.geometry.ptr_eq(&other.geometry)
            && self.volumes.ptr_eq(&other.volumes)
            && self.environment.ptr_eq(&other.environment)
            && (self.assets.len() == other.assets.len() && same_assets())
            && (self.leaves, self.sun, self.ambient) == (other.leaves, other.sun, other.ambient)
            && self.lights == other.lights
            && self.materials == other.materials
            && self.options == other.options
    }
}

/// What rays from a cell have met.
#[derive(Debug, Clone, Copy, Default)]
struct CellSum {
    /// Of each channel the weighted sums of three times radiance times direction, and of radiance.
    light: [Vec4; 3],
    weight: f32,
}

impl CellSum {
    fn add(&mut self, other: &CellSum, share: f32) {
        for (light, other) in self.light.iter_mut().zip(other.light) {
            *light += share * other;
        }
        self.weight += share * other.weight;
    }

    fn mean(&self) -> [Vec4; 3] {
        self.light.map(|quad| quad / self.weight.max(f32::MIN_POSITIVE))
    }
}

/// An irradiance volume in the making: with every sample of a picture it is filled by one more pass, until it has all.
#[derive(Debug, Clone)]
pub(crate) struct BouncedLight {
    lit_by: LitBy,
    cells: IrradianceCells,
    light_grid: Option<Arc<LightGrid>>,
    sums: Vec<CellSum>,
    passes: u32,
    volume: Arc<IrradianceVolume>,
}

impl BouncedLight {
    /// Returns the volume for a picture's sample: what is `kept` where the scene's light is the same, with one more pass where
    /// the sample has not had one. `None` where the options ask for none. Cost of a pass: 16 rays from each cell and as many to
    /// each of its lights, on all threads.
    pub(crate) fn of_sample(
        kept: &mut Option<BouncedLight>,
        scene: &Scene,
        options: &ShadeOptions,
        sample: u32,
    ) -> Option<Arc<IrradianceVolume>> {
        if !options.uses_irradiance_volume() {
            *kept = None;
            return None;
        }
        let options = ShadeOptions { depth: 1, light_samples: options.light_samples.min(LIGHT_SAMPLES), ..*options };
        let lit_by = LitBy::of(scene, &options);
        let own = kept.take().filter(|own| own.lit_by.is(&lit_by));
        let own = kept.insert(own.unwrap_or_else(|| BouncedLight::new(scene, lit_by)));
        while own.passes <= sample.min(MAX_PASSES - 1) {
            own.fill(scene);
        }
        Some(own.volume.clone())
    }

    /// Returns a volume without light.
    fn new(scene: &Scene, lit_by: LitBy) -> BouncedLight {
        let cells = scene.irradiance_cells(lit_by.options.irradiance_cells);
        let dark = std::iter::repeat_n([Vec4::ZERO; 3], cells.count());
        BouncedLight {
            volume: Arc::new(IrradianceVolume::new(&cells, dark)),
            light_grid: scene.light_grid(lit_by.options.light_samples, &mut None),
            sums: vec![CellSum::default(); cells.count()],
            passes: 0,
            lit_by,
            cells,
        }
    }

    /// Traces the rays of one more pass.
    fn fill(&mut self, scene: &Scene) {
        let BouncedLight { lit_by, cells, light_grid, sums, passes, .. } = self;
        let options = ShadeOptions { mode: RenderMode::Direct, ..lit_by.options };
        let camera = CameraFrame {
            eye: Vec3::ZERO,
            forward: Vec3::NEG_Z,
            right: Vec3::X,
            up: Vec3::Y * (0.5 * RAY_WIDTH),
            width: 1,
            height: 1,
        };
        let shader = |sample| Shader {
            sample,
            light_grid: light_grid.as_deref(),
            lod_transition: LodTransition::VOLUMES,
            ..Shader::with_camera(scene, camera, options)
        };
        let first = *passes * PLACES;
        let is_hidden = |sum: &CellSum| first >= HIDDEN_PLACES && sum.weight < 1.0;
        sums.par_iter_mut().enumerate().filter(|(_, sum)| !is_hidden(sum)).for_each(|(cell, sum)| {
            for place in first..first + PLACES {
                sum.add(&place_sum(cells, cell, place, &shader), 1.0);
            }
        });
        *passes += 1;
        let light: Vec<[Vec4; 3]> = (0..self.sums.len()).into_par_iter().map(|cell| self.light_of(cell)).collect();
        self.volume = Arc::new(IrradianceVolume::new(&self.cells, light.into_iter()));
    }

    /// Returns the light of a cell, and a little of that of its neighbours.
    fn light_of(&self, cell: usize) -> [Vec4; 3] {
        let [x, y, z] = self.cells.place(cell);
        let counts = self.cells.counts;
        let around = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
        let mut sum = self.sums[cell];
        for k in around(z, counts[2]) {
            for j in around(y, counts[1]) {
                for i in around(x, counts[0]) {
                    sum.add(&self.sums[(k * counts[1] + j) * counts[0] + i], NEIGHBOUR_WEIGHT);
                }
            }
        }
        sum.mean()
    }
}

/// Returns what the rays from place number `place` of a cell meet.
fn place_sum<'a>(cells: &IrradianceCells, cell: usize, place: u32, shader: &impl Fn(u32) -> Shader<'a>) -> CellSum {
    let seed = sampler::hash(cell as u32);
    let [x, y] = sampler::two(place, seed ^ 1);
    let [z, _] = sampler::two(place, seed ^ 2);
    let corner = Vec3::from(cells.place(cell).map(|at| at as f32));
    let origin = cells.lo + cells.side * (corner + Vec3::new(x, y, z));
    let mut sum = CellSum::default();
    let mut hidden = false;
    for ray in RAYS * place..RAYS * (place + 1) {
        let direction = sampler::sphere(sampler::two(ray, seed));
        let vertex = PathVertex { pixel: [cell as u32, u32::MAX], depth: 1 };
        let (radiance, is_back) = shader(ray).bounced_radiance(origin, direction, vertex);
        hidden |= is_back;
        for (light, radiance) in sum.light.iter_mut().zip(radiance.to_array()) {
            *light += radiance * (3.0 * direction).extend(1.0);
        }
        sum.weight += 1.0;
    }
    let mut weighted = CellSum::default();
    weighted.add(&sum, if hidden { HIDDEN_WEIGHT } else { 1.0 });
    weighted
}

impl Shader<'_> {
    /// Returns the direct light that comes along a ray from what it meets, and whether that is the back of an opaque surface.
    fn bounced_radiance(&self, origin: Vec3, direction: Vec3, vertex: PathVertex) -> (Vec3, bool) {
        let mut path = Path { scattered: true, ..Path::from_eye(origin, direction) };
        let mut done = PixelHit { primitive: NO_HIT, rays: 0, evaluations: 0 };
        let mut radiance = Vec3::ZERO;
        let (hit, sunk) = self.trace_closest(origin, direction);
        if let Some(volumes) = &self.scene.volumes {
            self.pass_volumes(volumes, &mut path, hit.t, vertex, &mut radiance, &mut done);
        }
        if hit.primitive == NO_HIT {
            return (radiance, false);
        }
        path.travelled = hit.t;
        let (mut s, relief) = self.surface_of(&hit, sunk, direction);
        let is_back = s.view_back && self.is_opaque(&s);
        let leaf = self.leaf_at(&s, &hit, &path, vertex);
        radiance += path.throughput * self.surface_light(&mut s, &relief, &leaf, &path, vertex, &mut done);
        (radiance, is_back)
    }

    /// Tells whether a surface shows nothing on its back of what is before it.
    fn is_opaque(&self, s: &Surface) -> bool {
        match self.scene.materials[s.material].body {
            Body::Plain(colour) => Vec3::from(colour.transmittance).max_element() <= 0.0,
            Body::Asset(asset) => {
                self.scene.assets[asset].head().layer_for_sides(0, false.into(), true.into()).is_none()
            }
            Body::Leaf(_) => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::picture::CpuPicture;
    use crate::light::irradiance_volume::irradiance_of;
    use crate::scene::camera::{Camera, jitter};
    use crate::scene::mesh::{self, MeshPart};
    use crate::scene::scene::SceneObject;
    use glam::Mat4;

    /// Cells of all but one test.
    const CELLS: u32 = 16;

    fn scene(parts: Vec<(MeshPart, [f32; 3])>) -> Scene {
        let object =
            |(part, reflectance): (MeshPart, [f32; 3])| SceneObject { part, material: Material::plain(reflectance) };
        let objects = parts.into_iter().map(object).collect();
        let mut scene = Scene::from_objects(std::path::Path::new("test"), objects, Vec::new()).unwrap();
        scene.lights.clear();
        scene.background = [0.0; 3];
        scene
    }

    fn level(mut part: MeshPart) -> MeshPart {
        part.transform(Mat4::from_rotation_x(-std::f32::consts::FRAC_PI_2));
        part
    }

    fn options() -> ShadeOptions {
        ShadeOptions { irradiance_cells: CELLS, ..ShadeOptions::default() }
    }

    fn filled(scene: &Scene, options: &ShadeOptions) -> Arc<IrradianceVolume> {
        BouncedLight::of_sample(&mut None, scene, options, MAX_PASSES).unwrap()
    }

    #[test]
    fn within_a_lit_sphere_all_light_is_that_of_its_wall() {
        // An integrating sphere: the wall has the irradiance I / r^2 of a lamp in its middle and sends back rho of it, evenly.
        let (reflectance, intensity) = ([0.5, 0.2, 0.0], 3.0);
        let mut scene = scene(vec![(mesh::sphere(), reflectance)]);
        scene.lights = vec![PointLight { position: Vec3::ZERO, intensity: [intensity; 3] }];
        let volume = filled(&scene, &options());
        let wanted = Vec3::from(reflectance) * (intensity / std::f32::consts::PI);
        for i in 0..30 {
            let place = 0.35 * sampler::sphere(sampler::two(i, 5));
            let normal = sampler::sphere(sampler::two(i, 6));
            let found = irradiance_of(&volume.at(place), normal);
            assert!((found - wanted).abs().max_element() < 0.03 * wanted.x, "{place}: {found}, {wanted}");
            // Planted: as if the wall were lit once more.
            assert!((found * 1.5 - wanted).abs().max_element() > 0.03 * wanted.x);
        }
    }

    #[test]
    fn above_a_ground_under_an_even_sky_light_comes_from_below_and_a_turned_grid_is_told_apart() {
        let reflectance = [0.6, 0.3, 0.1];
        let mut scene = scene(vec![(level(mesh::plane()), reflectance)]);
        scene.surround(Environment::new(32, 16, &[1.0; 32 * 16 * 3]));
        // Cells so low that the ground's edge is far from them.
        let volume = filled(&scene, &ShadeOptions { irradiance_cells: 32, ..options() });
        let light = volume.at(Vec3::new(0.1, 0.0, -0.1));
        // The half below sends rho of what comes from the half above.
        let agrees = |light: &[Vec4; 3]| {
            [(Vec3::NEG_Y, 1.0), (Vec3::X, 0.5), (Vec3::NEG_Z, 0.5), (Vec3::Y, 0.0)].iter().all(|(normal, share)| {
                let apart = irradiance_of(light, *normal) - *share * Vec3::from(reflectance);
                apart.abs().max_element() < 0.03
            })
        };
        assert!(agrees(&light), "{light:?}");
        // Planted: vectors turned by a right angle, and turned round.
        assert!(!agrees(&light.map(|quad| Vec4::new(quad.y, quad.x, quad.z, quad.w))));
        assert!(!agrees(&light.map(|quad| (-quad.truncate()).extend(quad.w))));
    }

    /// A ground before a red wall, under a lamp.
    fn corner() -> Scene {
        let mut wall = mesh::plane();
        wall.transform(Mat4::from_translation(Vec3::new(0.0, 1.0, -1.0)));
        let mut scene = scene(vec![(level(mesh::plane()), [0.7; 3]), (wall, [0.8, 0.1, 0.1])]);
        scene.lights = vec![PointLight { position: Vec3::new(0.0, 1.2, 0.4), intensity: [2.0; 3] }];
        scene.camera =
            Camera { eye: Vec3::new(0.0, 2.0, 4.0), target: Vec3::new(0.0, 0.5, 0.0), up: Vec3::Y, fov_deg: 35.0 };
        scene
    }

    const SIZE: [u32; 2] = [24, 18];
    const SAMPLES: u32 = 64;
    /// Samples of what is traced.
    const TRACED: u32 = 1024;

    fn drawn(scene: &Scene, options: &ShadeOptions, samples: u32) -> Vec<[f32; 3]> {
        let mut picture = CpuPicture::new(SIZE);
        for _ in 0..samples {
            picture.add_sample(scene, options, &|| true);
        }
        picture.radiance()
    }

    /// Draws what a picture has with a given volume.
    fn drawn_with(scene: &Scene, volume: &IrradianceVolume) -> Vec<[f32; 3]> {
        let camera = scene.camera.frame(SIZE[0], SIZE[1]);
        let pixel = |pixel: u32| {
            let mut sum = Vec3::ZERO;
            for sample in 0..SAMPLES {
                let shader = Shader {
                    sample,
                    jitter: jitter(sample),
                    irradiance_volume: Some(volume),
                    ..Shader::with_camera(scene, camera, options())
                };
                sum += Vec3::from(shader.path_radiance([pixel % SIZE[0], pixel / SIZE[0]]).0);
            }
            (sum / SAMPLES as f32).to_array()
        };
        (0..SIZE[0] * SIZE[1]).map(pixel).collect()
    }

    /// Root mean square of what two pictures differ by.
    fn apart(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
        let squares = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b) * (a - b));
        (squares.sum::<f32>() / (3 * a.len()) as f32).sqrt()
    }

    #[test]
    fn a_picture_has_nearly_the_bounce_of_paths_and_a_moved_grid_is_told_apart() {
        let scene = corner();
        let path = ShadeOptions { mode: RenderMode::Path, depth: 2, ..ShadeOptions::default() };
        let traced = drawn(&scene, &path, TRACED);
        let direct = apart(&drawn(&scene, &ShadeOptions::default(), SAMPLES), &traced);
        let volume = filled(&scene, &options());
        let cached = drawn_with(&scene, &volume);
        assert!(apart(&cached, &traced) < 0.3 * direct, "{} {direct}", apart(&cached, &traced));
        // What a picture makes itself is that, but for the first passes.
        assert!(apart(&drawn(&scene, &options(), SAMPLES), &cached) < 0.1 * direct);
        // Planted: a grid that stands beside by the width of the scene's half, and one that is upside down.
        let BouncedLight { cells, .. } = BouncedLight::new(&scene, LitBy::of(&scene, &options()));
        let light = |at: &dyn Fn(Vec3) -> Vec3| -> Vec<[Vec4; 3]> {
            let middle = |cell| cells.lo + cells.side * Vec3::from(cells.place(cell).map(|at| at as f32 + 0.5));
            (0..cells.count()).map(|cell| volume.at(at(middle(cell)))).collect()
        };
        let same = IrradianceVolume::new(&cells, light(&|place| place).into_iter());
        assert!(apart(&drawn_with(&scene, &same), &cached) < 1e-4);
        let moved = IrradianceVolume::new(&cells, light(&|place| place + Vec3::Z).into_iter());
        assert!(apart(&drawn_with(&scene, &moved), &traced) > 0.3 * direct);
        let turned = light(&|place| place).into_iter().map(|light| light.map(|q| (-q.truncate()).extend(q.w)));
        assert!(apart(&drawn_with(&scene, &IrradianceVolume::new(&cells, turned)), &traced) > 0.3 * direct);
    }

    #[test]
    fn a_volume_is_filled_once_for_a_scene_and_anew_when_its_light_changes() {
        let mut scene = corner();
        let mut kept = None;
        let of = |kept: &mut Option<BouncedLight>, scene: &Scene, sample| {
            let volume = BouncedLight::of_sample(kept, scene, &options(), sample);
            (volume.unwrap(), kept.as_ref().map_or(0, |kept| kept.passes))
        };
        let (first, passes) = of(&mut kept, &scene, 0);
        assert_eq!(passes, 1);
        let (second, passes) = of(&mut kept, &scene, 1);
        assert!(passes == 2 && !Arc::ptr_eq(&first, &second));
        // A camera that moves begins a picture anew, and not the volume.
        scene.camera.eye += Vec3::X;
        let (third, passes) = of(&mut kept, &scene, 0);
        assert!(passes == 2 && Arc::ptr_eq(&second, &third));
        assert_eq!(of(&mut kept, &scene, 1000).1, MAX_PASSES);
        for change in [
            &(|scene: &mut Scene| scene.lights[0].intensity[1] *= 2.0) as &dyn Fn(&mut Scene),
            &|scene| scene.materials[0] = Material::plain([0.1; 3]),
            &|scene| scene.surround(Environment::new(4, 2, &[1.0; 24])),
            &|scene| {
                let _ = Arc::make_mut(&mut scene.geometry);
            },
        ] {
            change(&mut scene);
            assert_eq!(of(&mut kept, &scene, 0).1, 1);
        }
        // The same seeds give the same light.
        assert_eq!(of(&mut None, &scene, 3), of(&mut None, &scene, 3));
        assert!(BouncedLight::of_sample(&mut kept, &scene, &ShadeOptions::default(), 0).is_none() && kept.is_none());
    }
}
