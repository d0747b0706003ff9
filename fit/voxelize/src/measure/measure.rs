//! Comparison of a volume with its model: both are looked at along parallel rays, from directions and under lights that
//! volumes are not fitted to, in pixels of several sizes.

use crate::build::lit::met_light;
use crate::error::VoxelizeError;
use crate::measure::ablations::Ablation;
use crate::measure::simplify::simplify;
use crate::model::frame::Frame;
use crate::model::triangle_model::TriangleModel;
use crate::rays::march::{March, MarchParams};
use crate::rays::occluder::{Met, Occluder};
use crate::rays::projection::{HALF_SIDE, Projection};
use btf_runtime::voltex::{Voltex, Volume};
use glam::Vec3;
use rayon::prelude::*;
use serde::Serialize;
use std::ops::ControlFlow;

/// Directions of the eye, of any length. The views of the fits are spread over the sphere by another rule.
const VIEWS: [Vec3; 5] = [
    Vec3::new(0.9, 0.3, 0.2),
    Vec3::new(-0.3, 0.7, -0.5),
    Vec3::new(0.2, -0.8, 0.1),
    Vec3::new(0.5, 0.5, -0.7),
    Vec3::new(-0.7, -0.1, 0.3),
];
/// Angles between light and eye in degrees, none of which shadows are fitted at.
const LIGHT_DEG: [f32; 7] = [1.0, 3.5, 7.0, 28.0, 55.0, 90.0, 149.0];
/// Turns of the light round the eye in radians; the turns of each view are a radian on from those of the view before.
const TURNS: [f32; 2] = [0.7, 3.9];
/// Pixels along the side of the unit cube, each half of the one before.
const PIXELS: [u32; 3] = [32, 16, 8];
/// Rays past a model along each side of the smallest pixel.
const MODEL_RAYS: usize = 8;
/// Bytes of a triangle's three corners.
pub const TRIANGLE_BYTES: usize = 36;

/// Pictures in pixels of one size.
#[derive(Clone)]
struct Pictures {
    /// Share of light that passes, of each view and pixel.
    through: Vec<Vec<f32>>,
    /// Light that is seen, of each view, light and pixel.
    light: Vec<Vec<f32>>,
}

/// Differences of pictures from those of the model, in pixels of one size. The names are the keys of `compare --json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PixelFigures {
    /// Pixels along the side of the unit cube.
    pub pixels: u32,
    /// Opacity of the volume over that of the model.
    pub opacity_ratio: f64,
    /// Root of the mean squared error of the share of light that passes, over pixels that are not clear in both.
    pub transmittance_rmse: f64,
    /// `sqrt(sum of squared errors / sum of squares)` of the light over all views and lights.
    pub rel_rmse: f64,
    /// Figures by the angle between light and eye.
    pub angles: Vec<AngleFigures>,
}

/// Figures under lights of one angle to the eye.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AngleFigures {
    /// Angle between light and eye in degrees.
    pub angle_deg: f32,
    /// Light in all over the light of the model.
    pub energy_ratio: f64,
    /// `sqrt(sum of squared errors / sum of squares)` of the light at this angle.
    pub rel_rmse: f64,
}

impl PixelFigures {
    /// Returns the least and greatest energy of all angles.
    pub fn energy(&self) -> [f64; 2] {
        self.angles.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], angle| {
            [least.min(angle.energy_ratio), most.max(angle.energy_ratio)]
        })
    }
}

/// A substitute of the model, and how well it stands for the model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VoltexRow {
    /// Name of the substitute: `volume`, or how it differs from that.
    pub rule: String,
    /// Figures by pixel size, the smallest first; none where the volume has no voxels so small.
    pub pixels: Vec<PixelFigures>,
}

/// Pictures of a model, and the model itself.
pub struct VoltexTruth {
    cube: TriangleModel,
    pictures: Vec<Pictures>,
}

impl VoltexTruth {
    /// Renders the pictures of a model.
    ///
    /// Cost: a hundred million rays at most.
    ///
    /// # Errors
    /// [`VoxelizeError::Model`] for a model without extent.
    pub fn new(model: &TriangleModel) -> Result<VoltexTruth, VoxelizeError> {
        let cube = model.in_cube(&Frame::around(model.bounds())?);
        let pictures = pictures_of_model(&cube);
        Ok(VoltexTruth { cube, pictures })
    }

    /// Measures how well a volume stands for the model, looked at by `params`.
    pub fn measure(&self, rule: &str, voltex: &Voltex, params: &MarchParams) -> VoltexRow {
        let pixels = PIXELS.iter().zip(&self.pictures).filter_map(|(pixels, truth)| {
            // The finest where there is none of the voxels that are asked for.
            let level = voltex.level_count().checked_sub(pixels.ilog2())?.saturating_sub(params.finer);
            let march = March::new(voltex, level, params.reflection);
            Some(figures(*pixels, &pictures_of_volume(&march, *pixels, params.rays), truth))
        });
        VoltexRow { rule: rule.into(), pixels: pixels.collect() }
    }

    /// Measures how well the model itself stands for the model with so many rays along each side of a pixel: what
    /// nothing that is looked at by as many unfiltered rays falls below.
    pub fn measure_rays(&self, rule: &str, rays: usize) -> VoltexRow {
        let occluder = Occluder::new(&self.cube.triangles);
        let pixels = PIXELS.iter().zip(&self.pictures);
        let found = |pixels: u32| pictures_by_rays(&self.cube, &occluder, pixels, rays);
        VoltexRow {
            rule: rule.into(),
            pixels: pixels.map(|(pixels, truth)| figures(*pixels, &found(*pixels), truth)).collect(),
        }
    }

    /// Measures how well a share of the model's triangles, enlarged in place of the others, stands for the model: as
    /// many as fit into `bytes`.
    pub fn measure_simplified(&self, rule: &str, bytes: usize) -> VoltexRow {
        let found = pictures_of_model(&simplify(&self.cube, bytes / TRIANGLE_BYTES));
        let pixels = PIXELS.iter().zip(found.iter().zip(&self.pictures));
        VoltexRow {
            rule: rule.into(),
            pixels: pixels.map(|(pixels, (found, truth))| figures(*pixels, found, truth)).collect(),
        }
    }
}

/// Measures how well a volume of `bytes` bytes stands for the model that it was built of. Every one of `ablations` adds
/// a row; if there is any, so does a part of the triangles in as many bytes. `progress(done, total)` can stop the work.
///
/// # Errors
/// [`VoxelizeError::Model`] if the model has no extent or another one than the volume; [`VoxelizeError::Interrupted`].
pub fn measure_voltex(
    model: &TriangleModel,
    volume: &Volume,
    bytes: usize,
    ablations: &[Ablation],
    progress: impl Fn(usize, usize) -> ControlFlow<()>,
) -> Result<Vec<VoltexRow>, VoxelizeError> {
    let side_m = Frame::around(model.bounds())?.side_m;
    if (volume.side_m / side_m - 1.0).abs() > SIDE_TOLERANCE {
        return Err(VoxelizeError::Model(format!(
            "the volume's side is {} m and the model needs {side_m} m; give the model that the volume was built of",
            volume.side_m
        )));
    }
    let steps = 2 + ablations.len();
    let report = |done: usize| match progress(done, steps) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(VoxelizeError::Interrupted),
    };
    report(0)?;
    let truth = VoltexTruth::new(model)?;
    report(1)?;
    let voltex = Voltex::new(volume);
    let mut rows = vec![truth.measure("volume", &voltex, &MarchParams::default())];
    for (done, ablation) in ablations.iter().enumerate() {
        report(2 + done)?;
        let (other, params) = ablation.apply(model, volume)?;
        rows.push(truth.measure(ablation.name(), &Voltex::new(&other), &params));
    }
    if !ablations.is_empty() {
        for (rule, room) in [
            ("mesh simplified to the file's bytes", bytes),
            ("mesh simplified to the resident form's bytes", 4 * voltex.words().len()),
        ] {
            rows.push(truth.measure_simplified(rule, room));
        }
    }
    Ok(rows)
}

/// Differences of pictures from those of the model, in pixels of one size. The names are the keys of `compare --json`.
const SIDE_TOLERANCE: f32 = 1e-5;

fn projections() -> [Projection; VIEWS.len()] {
    VIEWS.map(|view| Projection::new(view.normalize()))
}

/// Returns the lights of a view, in the order of their angles.
fn lights(view: usize, projection: &Projection) -> Vec<Vec3> {
    let light = |angle: f32, turn: f32| {
        let (sin, cos) = angle.to_radians().sin_cos();
        -projection.direction * cos + projection.across(turn + view as f32) * sin
    };
    LIGHT_DEG.iter().flat_map(|angle| TURNS.map(|turn| light(*angle, turn))).collect()
}

/// Returns the pixels along a side of a picture.
fn count(pixels: u32) -> usize {
    // Whole pixels of the largest size, so that pixels of all sizes cover the same square.
    let largest = PIXELS[PIXELS.len() - 1];
    (2.0 * HALF_SIDE * largest as f32).ceil() as usize * (pixels / largest) as usize
}

/// Renders pictures with `rays`^2 rays a pixel; `ray` returns the share of light that passes and adds to the light of
/// each of a view's lights.
fn pictures(pixels: u32, rays: usize, ray: impl Fn(Vec3, Vec3, &[Vec3], &mut [f32]) -> f32 + Sync) -> Pictures {
    let count = count(pixels);
    let mut pictures = Pictures { through: Vec::new(), light: Vec::new() };
    for (view, projection) in projections().iter().enumerate() {
        let lights = lights(view, projection);
        let at = |i: usize, s: usize| (i as f32 + (s as f32 + 0.5) / rays as f32) / pixels as f32 - HALF_SIDE;
        let pixel = |i: usize| {
            let (mut through, mut seen) = (0.0, vec![0.0; lights.len()]);
            for s in 0..rays * rays {
                let origin = projection.origin(at(i % count, s % rays), at(i / count, s / rays));
                through += ray(origin, projection.direction, &lights, &mut seen);
            }
            let share = 1.0 / (rays * rays) as f32;
            seen.iter_mut().for_each(|seen| *seen *= share);
            (through * share, seen)
        };
        let all: Vec<(f32, Vec<f32>)> = (0..count * count).into_par_iter().map(pixel).collect();
        pictures.through.push(all.iter().map(|(through, _)| *through).collect());
        pictures.light.extend((0..lights.len()).map(|k| all.iter().map(|(_, seen)| seen[k]).collect::<Vec<f32>>()));
    }
    pictures
}

fn pictures_of_volume(march: &March, pixels: u32, rays: usize) -> Pictures {
    pictures(pixels, rays, |origin, direction, lights, seen| march.ray(origin, direction, lights, seen))
}

/// Renders the pictures of a model in the unit cube for each of [`PIXELS`].
fn pictures_of_model(cube: &TriangleModel) -> Vec<Pictures> {
    let occluder = Occluder::new(&cube.triangles);
    let mut all = vec![pictures_by_rays(cube, &occluder, PIXELS[0], MODEL_RAYS)];
    for pixels in &PIXELS[1..] {
        let finer = &all[all.len() - 1];
        let halved = |pictures: &[Vec<f32>]| pictures.iter().map(|picture| halved(picture, count(*pixels))).collect();
        all.push(Pictures { through: halved(&finer.through), light: halved(&finer.light) });
    }
    all
}

/// Renders the pictures of a model with so many rays along each side of a pixel.
fn pictures_by_rays(cube: &TriangleModel, occluder: &Occluder, pixels: u32, rays: usize) -> Pictures {
    pictures(pixels, rays, |origin, direction, lights, seen| {
        let Some(met): Option<Met> = occluder.trace(origin, direction, 4.0) else { return 1.0 };
        for (light, seen) in lights.iter().zip(seen) {
            *seen += met_light(occluder, cube, &met, origin, direction, *light);
        }
        0.0
    })
}

/// Returns a picture of `count` pixels a side, each the mean of four.
fn halved(picture: &[f32], count: usize) -> Vec<f32> {
    let mean = |i: usize| {
        let first = 4 * (i / count) * count + 2 * (i % count);
        0.25 * (picture[first] + picture[first + 1] + picture[first + 2 * count] + picture[first + 2 * count + 1])
    };
    (0..count * count).map(mean).collect()
}

fn figures(pixels: u32, found: &Pictures, truth: &Pictures) -> PixelFigures {
    let mut through = Sums::default();
    for (found, truth) in found.through.iter().zip(&truth.through) {
        for (found, truth) in found.iter().zip(truth).filter(|(found, truth)| **found < CLEAR || **truth < CLEAR) {
            through.add(1.0 - found, 1.0 - truth);
        }
    }
    let mut of_angles = vec![Sums::default(); LIGHT_DEG.len()];
    for (k, (found, truth)) in found.light.iter().zip(&truth.light).enumerate() {
        let angle = k / TURNS.len() % LIGHT_DEG.len();
        found.iter().zip(truth).for_each(|(found, truth)| of_angles[angle].add(*found, *truth));
    }
    let mut light = Sums::default();
    of_angles.iter().for_each(|sums| light.join(sums));
    let angle = |(angle_deg, sums): (&f32, &Sums)| AngleFigures {
        angle_deg: *angle_deg,
        energy_ratio: sums.ratio(),
        rel_rmse: sums.relative(),
    };
    PixelFigures {
        pixels,
        opacity_ratio: through.ratio(),
        transmittance_rmse: (through.squared_error / through.count.max(1.0)).sqrt(),
        rel_rmse: light.relative(),
        angles: LIGHT_DEG.iter().zip(&of_angles).map(angle).collect(),
    }
}

/// Share of light that passes clear pixels at least.
const CLEAR: f32 = 0.9999;

/// Sums over pairs of what was found and what is true.
#[derive(Clone, Default)]
struct Sums {
    count: f64,
    found: f64,
    truth: f64,
    squared_error: f64,
    squared_truth: f64,
}

impl Sums {
    fn add(&mut self, found: f32, truth: f32) {
        let (found, truth) = (f64::from(found), f64::from(truth));
        self.join(&Sums {
            count: 1.0,
            found,
            truth,
            squared_error: (found - truth).powi(2),
            squared_truth: truth * truth,
        });
    }

    fn join(&mut self, other: &Sums) {
        self.count += other.count;
        self.found += other.found;
        self.truth += other.truth;
        self.squared_error += other.squared_error;
        self.squared_truth += other.squared_truth;
    }

    fn ratio(&self) -> f64 {
        self.found / self.truth.max(1e-30)
    }

    fn relative(&self) -> f64 {
        (self.squared_error / self.squared_truth.max(1e-30)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::build::{VoltexParams, build_voltex};
    use crate::build::refit::RefitParams;
    use crate::model::microflakes::MicroflakeColour;

    /// Returns the leaves in all directions within a cube.
    fn shrub() -> TriangleModel {
        let directions = crate::rays::projection::spread_directions(300, 0.4);
        let colour = MicroflakeColour { reflectance: [0.5; 3], transmittance: [0.3; 3], ..MicroflakeColour::default() };
        let mut model = TriangleModel { colours: vec![colour], weights: vec![1.0], ..TriangleModel::default() };
        for (i, n) in directions.iter().enumerate() {
            // Places by an additive recurrence, apart from the directions.
            let at = Vec3::from([0.8191725, 0.6710436, 0.5497005].map(|step: f32| (0.5 + step * i as f32).fract()));
            let u = n.any_orthonormal_vector() * 0.08;
            model.triangles.push([at, at + u, at + n.cross(u)]);
            model.materials.push(0);
        }
        model
    }

    #[test]
    fn figures_are_those_of_a_worked_example_and_a_model_stands_for_itself() {
        let picture = |through: [f32; 2], light: f32| Pictures {
            through: vec![through.to_vec()],
            light: vec![vec![light, 0.0]; LIGHT_DEG.len() * TURNS.len()],
        };
        let truth = picture([0.5, 1.0], 2.0);
        let own = figures(8, &picture([0.3, 1.0], 1.0), &truth);
        assert!((own.opacity_ratio - 1.4).abs() < 1e-6 && (own.transmittance_rmse - 0.2).abs() < 1e-6, "{own:?}");
        assert_eq!((own.rel_rmse, own.energy()), (0.5, [0.5, 0.5]));
        let same = figures(8, &truth, &truth);
        assert_eq!((same.opacity_ratio, same.transmittance_rmse, same.rel_rmse), (1.0, 0.0, 0.0));
        assert_eq!(
            halved(&[1.0, 3.0, 0.0, 0.0, 1.0, 3.0, 0.0, 4.0, 0.0, 0.0, 8.0, 8.0, 0.0, 0.0, 8.0, 8.0], 2),
            [2.0, 1.0, 0.0, 8.0]
        );
        // A mesh that is left as it is.
        let truth = VoltexTruth::new(&shrub()).unwrap();
        let row = truth.measure_simplified("all", 300 * TRIANGLE_BYTES);
        assert!(row.pixels.iter().all(|of_pixel| of_pixel.rel_rmse == 0.0), "{row:?}");
        // Planted difference: four fifths of it.
        let row = truth.measure_simplified("fewer", 240 * TRIANGLE_BYTES);
        assert!(row.pixels.iter().all(|of_pixel| of_pixel.rel_rmse > 0.1), "{row:?}");
    }

    #[test]
    fn volumes_of_other_models_are_refused_and_coarse_ones_lack_small_pixels() {
        let model = shrub();
        let refit = RefitParams { views: 0, ..RefitParams::default() };
        let volume = build_voltex(&model, &VoltexParams { resolution: 16, refit, ..VoltexParams::default() }).unwrap();
        let rows = measure_voltex(&model, &volume, 1000, &[], |_, _| ControlFlow::Continue(())).unwrap();
        assert_eq!(rows.len(), 1);
        assert_eq!(rows[0].pixels.iter().map(|of_pixel| of_pixel.pixels).collect::<Vec<_>>(), [16, 8]);
        let mut larger = model;
        larger.triangles.iter_mut().flatten().for_each(|p| *p *= 1.01);
        let error =
            measure_voltex(&larger, &volume, 1000, &[], |_, _| ControlFlow::Continue(())).unwrap_err().to_string();
        assert!(error.contains("give the model that the volume was built of"), "{error}");
    }
}
