//! Prints how bright a volume is beside its model under lights of one elevation, and on one side of the eye, level by level,
//! as Markdown: `cargo run --release -p btf-tests -- light_directions MODEL FILE.voltex`.
//!
//! Rays are parallel, light is direct, grey and without gloss, as when shadows are fitted; each level is looked at alone.

use btf_runtime::voltex::{Voltex, Volume};
use btf_voxelize::{Frame, HALF_SIDE, March, Occluder, Projection, Reflection, TriangleModel, model_light};
use glam::Vec3;
use rayon::prelude::*;
use std::error::Error;
use std::path::Path;

/// Elevations of the eye, degrees, and where it stands around the plant. None is along an axis.
const EYES_DEG: [f32; 4] = [3.0, 20.0, 45.0, 80.0];
const AROUND_DEG: [f32; 4] = [37.0, 100.0, 220.0, 310.0];
/// Elevations of the light, degrees, and how far round from the eye.
const LIGHTS_DEG: [f32; 5] = [10.0, 20.0, 35.0, 50.0, 70.0];
const FROM_EYE_DEG: [f32; 5] = [0.0, 45.0, 90.0, 135.0, 180.0];
/// Rays along each side of a view of the volume; of the model twice as many.
const RAYS: usize = 64;
/// Levels that are looked at, from the finest.
const LEVELS: u32 = 7;

/// Light of a plant in one view under each of [`LIGHTS_DEG`] and [`FROM_EYE_DEG`].
type Lit = Vec<f64>;
/// Adds the light of a ray, by its origin and direction, to that of each of some lights.
type Ray<'a> = &'a (dyn Fn(Vec3, Vec3, &[Vec3], &mut [f32]) + Sync);

fn direction(elevation_deg: f32, azimuth_deg: f32) -> Vec3 {
    let [(sin, cos), (y, x)] = [elevation_deg, azimuth_deg].map(|degrees| degrees.to_radians().sin_cos());
    Vec3::new(cos * x, cos * y, sin)
}

/// Sums the light that `seen` adds for each light over rays of a view, `across` along each side.
fn view(projection: &Projection, across: usize, lights: usize, seen: impl Fn(Vec3, &mut [f32]) + Sync) -> Lit {
    let place = |i: usize| ((i as f32 + 0.5) / across as f32 * 2.0 - 1.0) * HALF_SIDE;
    let row = |y: usize| {
        let mut sums = vec![0f64; lights];
        for x in 0..across {
            let mut light = vec![0f32; lights];
            seen(projection.origin(place(x), place(y)), &mut light);
            sums.iter_mut().zip(light).for_each(|(sum, light)| *sum += f64::from(light));
        }
        sums
    };
    let rows: Vec<Lit> = (0..across).into_par_iter().map(row).collect();
    let share = 1.0 / (across * across) as f64;
    (0..lights).map(|k| share * rows.iter().map(|row| row[k]).sum::<f64>()).collect()
}

/// The volume's light over the model's, over all lights that are asked for.
fn ratio(found: &[Lit], truth: &[Lit], is_asked: impl Fn(usize) -> bool) -> f64 {
    let sum = |views: &[Lit]| -> f64 {
        let all = views.iter().flat_map(|lit| lit.iter().enumerate());
        all.filter(|(light, _)| is_asked(*light)).map(|(_, value)| value).sum()
    };
    sum(found) / sum(truth)
}

/// Runs the study.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [model, volume] = arguments else { return Err("light_directions takes MODEL FILE.voltex".into()) };
    let model = TriangleModel::read(Path::new(model))?;
    let cube = model.in_cube(&Frame::around(model.bounds())?);
    let occluder = Occluder::new(&cube.triangles);
    let voltex = Voltex::new(&Volume::parse(&std::fs::read(volume)?)?);
    let views = || AROUND_DEG.iter().flat_map(|around| EYES_DEG.map(|eye| (*around, eye)));
    let lights = |around: f32| -> Vec<Vec3> {
        let turned = |elevation: f32| FROM_EYE_DEG.map(|turn| direction(elevation, around + turn));
        LIGHTS_DEG.into_iter().flat_map(turned).collect()
    };
    let look = |across: usize, seen: Ray| -> Vec<Lit> {
        let one = |(around, eye): (f32, f32)| {
            let (projection, lights) = (Projection::new(-direction(eye, around)), lights(around));
            view(&projection, across, lights.len(), |origin, light| seen(origin, projection.direction, &lights, light))
        };
        views().map(one).collect()
    };
    let truth = look(2 * RAYS, &|origin, direction, lights, seen| {
        for (light, seen) in lights.iter().zip(seen) {
            *seen = model_light(&occluder, &cube, origin, direction, *light);
        }
    });
    print!("| voxels a side | all |");
    LIGHTS_DEG.iter().for_each(|elevation| print!(" light {elevation}° high |"));
    FROM_EYE_DEG.iter().for_each(|turn| print!(" {turn}° from the eye |"));
    println!("\n|{}", "---|".repeat(2 + LIGHTS_DEG.len() + FROM_EYE_DEG.len()));
    let turns = FROM_EYE_DEG.len();
    for level in 0..LEVELS.min(voltex.level_count() + 1) {
        let march = March::new(&voltex, level, Reflection::ClosedForm);
        let found = look(RAYS, &|origin, direction, lights, seen| {
            march.ray(origin, direction, lights, seen);
        });
        print!("| {} | {:.3} |", 1u32 << (voltex.level_count() - level), ratio(&found, &truth, |_| true));
        (0..LIGHTS_DEG.len()).for_each(|k| print!(" {:.3} |", ratio(&found, &truth, |light| light / turns == k)));
        (0..turns).for_each(|k| print!(" {:.3} |", ratio(&found, &truth, |light| light % turns == k)));
        println!();
    }
    Ok(())
}
