//! A picture that the CPU draws, sample by sample.

use crate::cpu::bounced_light::BouncedLight;
use crate::cpu::shader::{DetailWidths, Shader};
use crate::geometry::bvh::NO_HIT;
use crate::geometry::lod_transition::LodTransition;
use crate::light::light_grid::LightGrid;
use crate::options::ShadeOptions;
use crate::picture::PixelHit;
use crate::scene::camera::jitter;
use crate::scene::scene::Scene;
use rayon::prelude::*;
use std::sync::Arc;

/// A picture as the sum of its samples.
#[derive(Debug, Clone)]
pub struct CpuPicture {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Sum of linear radiance, row-major from the top left.
    pub sums: Vec<[f32; 3]>,
    /// Samples in the sums.
    pub samples: u32,
    /// Hit and cost of the last sample of each pixel, row-major from the top left.
    pub hits: Vec<PixelHit>,
    /// What levels of detail are chosen by, so that one picture's rays can look at all of them; `None` for its own pixels.
    pub widths: Option<DetailWidths>,
    /// What drew the lights of the last sample, where there are more than it had candidates for.
    light_grid: Option<Arc<LightGrid>>,
    /// The light after one bounce that the last sample had, where options ask for it.
    bounced_light: Option<BouncedLight>,
}

impl CpuPicture {
    /// Returns a picture without samples.
    pub fn new([width, height]: [u32; 2]) -> CpuPicture {
        let pixels = width as usize * height as usize;
        let nothing = PixelHit { primitive: NO_HIT, rays: 0, evaluations: 0 };
        CpuPicture {
            width,
            height,
            sums: vec![[0.0; 3]; pixels],
            samples: 0,
            hits: vec![nothing; pixels],
            widths: None,
            light_grid: None,
            bounced_light: None,
        }
    }

    /// Adds one sample to every pixel, rows in parallel. `row_done` is called after every row; once it returns
    /// `false` the remaining rows are left out.
    pub fn add_sample(&mut self, scene: &Scene, options: &ShadeOptions, row_done: &(dyn Fn() -> bool + Sync)) {
        // Before the rows, so that no two expand the same.
        scene.assets.iter().for_each(|asset| {
            asset.resident();
        });
        let light_grid = scene.light_grid(options.light_samples, &mut self.light_grid);
        let bounced = BouncedLight::of_sample(&mut self.bounced_light, scene, options, self.samples);
        let shader = Shader {
            jitter: jitter(self.samples),
            sample: self.samples,
            light_grid: light_grid.as_deref(),
            irradiance_volume: bounced.as_deref(),
            widths: self.widths,
            ..Shader::with_camera(scene, scene.camera.frame(self.width, self.height), *options)
        };
        let width = self.width as usize;
        let rows = self.sums.par_chunks_mut(width).zip(self.hits.par_chunks_mut(width)).enumerate();
        // An early end is not an error here; the caller knows that it asked for it.
        let _ = rows.try_for_each(|(y, (sums, hits))| {
            for x in 0..width {
                let pixel = [x as u32, y as u32];
                let eye = shader.camera.eye;
                let lod_transition = LodTransition::of_path(eye, shader.pixel_width(), pixel, shader.sample);
                let (radiance, hit) = Shader { lod_transition, ..shader }.path_radiance(pixel);
                for channel in 0..3 {
                    sums[x][channel] += radiance[channel];
                }
                hits[x] = hit;
            }
            row_done().then_some(())
        });
        self.samples += 1;
    }

    /// Returns the mean linear radiance per pixel.
    pub fn radiance(&self) -> Vec<[f32; 3]> {
        let count = self.samples.max(1) as f32;
        self.sums.iter().map(|sum| sum.map(|x| x / count)).collect()
    }
}
