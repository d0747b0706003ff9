//! What a frame asks for, and the buffers that a frame reads and writes as shaders see them.

use crate::light::light_grid::LightGrid;
use crate::options::ShadeOptions;
use crate::picture::PixelHit;
use crate::scene::camera::jitter;
use crate::scene::material::{Body, Material};
use crate::scene::scene::Scene;

/// The asset offset of a plain material. Twin: `NO_ASSET` in `scene.wgsl`.
pub(crate) const NO_ASSET: u32 = u32::MAX;
/// Materials of a scene at most: as many as a uniform binding holds. Twin: `MAX_MATERIALS` in `scene.wgsl`.
pub(crate) const MAX_MATERIALS: usize = 1024;

/// One sample of every pixel of a picture.
#[derive(Clone, Copy)]
pub struct FrameRequest<'a> {
    /// The scene that was uploaded; its camera, lights, materials and background may have changed since.
    pub scene: &'a Scene,
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// The settings that trade speed for accuracy.
    pub options: ShadeOptions,
    /// Number of the sample; 0 starts the accumulation anew.
    pub sample: u32,
}

/// The uniforms of a frame. Twin: `Frame` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuFrame {
    pub eye: [f32; 3],
    pub width: u32,
    pub forward: [f32; 3],
    pub height: u32,
    pub right: [f32; 3],
    pub light_count: u32,
    pub up: [f32; 3],
    pub sample: u32,
    pub background: [f32; 3],
    pub interpolation: u32,
    pub ambient: [f32; 3],
    pub occlusion_distance: f32,
    pub jitter: [f32; 2],
    pub components: u32,
    pub lobes: u32,
    pub heights: u32,
    pub first_row: u32,
    pub rows: u32,
    pub mode: u32,
    pub light_samples: u32,
    pub environment_at: u32,
    pub environment: [u32; 2],
    pub pixel_width: f32,
    pub levels: u32,
    pub root: u32,
    pub sky: u32,
    pub sun_direction: [f32; 3],
    pub sun_part: f32,
    pub sun_irradiance: [f32; 3],
    pub volume_root: u32,
    pub volumes_at: u32,
    pub proxies_at: u32,
    pub first_proxy: u32,
    pub volume_reach: f32,
    pub volume_slice: f32,
    pub widest_leaf: f32,
    pub filtered: u32,
    pub irradiance_at: u32,
    pub air: [f32; 3],
    pub pad2: u32,
}

/// A material. Twin: `Material` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuMaterial {
    pub diffuse: [f32; 3],
    pub asset: u32,
    pub transmitted: [f32; 3],
    pub leaf: u32,
    pub mirror: [f32; 3],
    pub displacement: f32,
    pub uv_scale: [f32; 2],
    pub noise: u32,
    pub pad0: u32,
}

/// A point light. Twin: `Light` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuLight {
    pub position: [f32; 3],
    pub pad0: u32,
    pub intensity: [f32; 3],
    pub pad1: u32,
}

/// The path of a pixel between two passes. Twin: `Path` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuPath {
    pub origin: [f32; 3],
    pub primitive: u32,
    pub direction: [f32; 3],
    pub u: f32,
    pub throughput: [f32; 3],
    pub v: f32,
    pub instance: u32,
    pub density: f32,
    pub travelled: f32,
    pub sunk: f32,
}

/// A pixel. Twin: `Pixel` in `scene.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct GpuPixel {
    pub sum: [f32; 4],
    pub primitive: u32,
    pub rays: u32,
    pub evaluations: u32,
    pub depth: u32,
}

impl GpuPixel {
    /// Returns a pixel that the CPU drew, from the sum of its samples.
    pub(crate) fn of_sum([r, g, b]: [f32; 3], samples: u32, hit: &PixelHit) -> GpuPixel {
        GpuPixel {
            sum: [r, g, b, samples as f32],
            primitive: hit.primitive,
            rays: hit.rays,
            evaluations: hit.evaluations,
            depth: 0,
        }
    }

    /// Returns the mean of the samples, linear radiance.
    pub(crate) fn radiance(&self) -> [f32; 3] {
        let [r, g, b, count] = self.sum;
        [r / count, g / count, b / count]
    }

    /// Returns what the last sample did.
    pub(crate) fn hit(&self) -> PixelHit {
        PixelHit { primitive: self.primitive, rays: self.rays, evaluations: self.evaluations }
    }
}

/// The places of a scene in the buffers of a tracer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ScenePlaces {
    /// First words of the environment and of the table of the volumes; 0 where there is none.
    pub environment_at: u32,
    pub volumes_at: u32,
    /// Node where the hierarchy over the volumes' proxies begins.
    pub volume_root: u32,
    /// [`Geometry::widest_leaf`](crate::Geometry::widest_leaf).
    pub widest_leaf: f32,
    /// The quad of the lights' buffer where the irradiance volume begins; 0 for none.
    pub irradiance_at: u32,
}

impl GpuFrame {
    /// Returns the uniforms of a band of `rows` rows from `first_row` on.
    pub(crate) fn new(request: &FrameRequest, [first_row, rows]: [u32; 2], places: &ScenePlaces) -> GpuFrame {
        let FrameRequest { scene, size: [width, height], options, sample } = *request;
        let camera = scene.camera.frame(width, height);
        let decode = &options.decode;
        let volumes = scene.volumes.as_ref();
        GpuFrame {
            eye: camera.eye.to_array(),
            width,
            forward: camera.forward.to_array(),
            height,
            right: camera.right.to_array(),
            light_count: scene.lights.len() as u32,
            up: camera.up.to_array(),
            sample,
            background: scene.background,
            interpolation: decode.interpolation as u32,
            ambient: scene.ambient.radiance,
            occlusion_distance: scene.ambient.distance,
            jitter: jitter(sample),
            components: decode.components,
            lobes: decode.lobes,
            heights: decode.heights as u32,
            first_row,
            rows,
            mode: options.mode as u32,
            light_samples: options.light_samples,
            environment_at: places.environment_at,
            environment: scene.environment.as_ref().map_or([0; 2], |environment| environment.size()),
            pixel_width: camera.pixel_width(),
            levels: options.uses_levels().into(),
            root: scene.geometry.root(),
            sky: options.sky as u32,
            sun_direction: scene.sun.map_or([0.0, 1.0, 0.0], |sun| sun.direction.to_array()),
            sun_part: scene.sun.map_or(0.0, |sun| sun.sun_part()),
            sun_irradiance: scene.sun.map_or([0.0; 3], |sun| sun.irradiance),
            volume_root: places.volume_root,
            volumes_at: places.volumes_at,
            proxies_at: places.volumes_at + volumes.map_or(0, |volumes| volumes.volume_count() as u32),
            first_proxy: scene.geometry.instances().len() as u32,
            volume_reach: volumes.map_or(0.0, |volumes| volumes.reach()),
            volume_slice: volumes.map_or(0.0, |volumes| volumes.slice()),
            widest_leaf: places.widest_leaf,
            filtered: options.filter as u32,
            irradiance_at: places.irradiance_at,
            air: scene.air,
            pad2: 0,
        }
    }
}

impl GpuMaterial {
    /// Returns `material`, with the first words of its asset or leaf.
    pub(crate) fn new(material: &Material, asset_at: impl Fn(usize) -> u32, leaf_at: impl Fn(usize) -> u32) -> Self {
        GpuMaterial {
            diffuse: match material.body {
                Body::Plain(colour) => colour.reflectance,
                _ => material.tint,
            },
            asset: material.asset().map_or(NO_ASSET, asset_at),
            transmitted: match material.body {
                Body::Plain(colour) => colour.transmittance,
                _ => [0.0; 3],
            },
            leaf: match material.body {
                Body::Leaf(leaf) => leaf_at(leaf),
                _ => NO_ASSET,
            },
            mirror: material.mirror,
            displacement: material.displacement,
            uv_scale: material.uv_scale,
            noise: match (material.body, material.noise) {
                // The last byte is not 0: a factor may be.
                (Body::Plain(_), Some([r, g, b])) => {
                    u32::from_le_bytes([r, g, b, 2.0].map(|x| (127.0 * x).round() as u8))
                }
                _ => 0,
            },
            pad0: 0,
        }
    }
}

/// Returns the point lights of a scene, in the order of the grid that draws them where there is one.
pub(crate) fn gpu_lights(scene: &Scene, grid: Option<&LightGrid>) -> Vec<GpuLight> {
    let light = |index| {
        let light = &scene.lights[grid.map_or(index, |grid| grid.number(index))];
        // One that is not drawn adds nothing.
        let intensity = if light.position.is_finite() { light.intensity } else { [0.0; 3] };
        GpuLight { position: light.position.to_array(), pad0: 0, intensity, pad1: 0 }
    };
    (0..scene.lights.len()).map(light).collect()
}
