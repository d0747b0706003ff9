//! Writes fisheye pictures of a clear sky, the zenith in the middle, north above and east to the left, exposed by
//! themselves: `cargo run --release -p btf-viewer --example sky_picture OUT_DIR 52.5,13.4 2026-06-21T12:00+02:00 ...`.

use btf_viewer::{Daylight, Picture};
use glam::Vec3;
use std::path::Path;
use std::time::Instant;

/// Pixels on a side.
const SIDE: u32 = 384;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, place, moments @ ..] = &arguments[..] else { panic!("OUT_DIR PLACE TIME ... are missing") };
    for moment in moments {
        let daylight = Daylight::new(moment, place).unwrap_or_else(|error| panic!("{error}"));
        let position = daylight.sun_position().expect("it was checked");
        let start = Instant::now();
        let light = daylight.sun_and_sky().expect("it was checked");
        let seconds = start.elapsed().as_secs_f64();
        let level = light.environment.irradiance(Vec3::Y);
        println!(
            "{moment}: sun {:.2} degrees high at {:.2}, {:?}, level sky {level:?}, {seconds:.3} s",
            position.elevation_deg,
            position.azimuth_deg,
            light.sun.map(|sun| sun.irradiance)
        );
        let radiance = (0..SIDE * SIDE).map(|at| {
            let [x, y] = [at % SIDE, at / SIDE].map(|x| (x as f32 + 0.5) / SIDE as f32 * 2.0 - 1.0);
            let radius = x.hypot(y);
            let polar = radius * std::f32::consts::FRAC_PI_2;
            let across = polar.sin() / radius.max(1e-6);
            if radius > 1.0 {
                [0.0; 3]
            } else {
                light.environment.radiance(Vec3::new(-x * across, polar.cos(), y * across)).to_array()
            }
        });
        let picture = Picture { width: SIDE, height: SIDE, radiance: radiance.collect() };
        // The mean of the sky at a third of white.
        let exposure_ev = (level[1].max(1e-30) / std::f32::consts::PI * 3.0).log2();
        let name = moment.replace(':', "");
        picture
            .write_png(&Path::new(folder).join(format!("{name}.png")), -exposure_ev)
            .expect("the folder can be written");
    }
}
