//! What each form of the algorithmic leaf models costs and how far it is off: rows of docs/results/trade.md and
//! docs/guide/leaves.md as Markdown. `cargo run --release -p btf-tests -- abm_trade`

use std::error::Error;
use std::hint::black_box;
use std::ops::ControlFlow;
use std::time::Instant;

use crate::leaf::trade::delta_e00_linear;
use btf_synth::{
    Abm97, Abm97Switches, AbmB, AbmU, Diffuse, Estimate, Face, Goniophotometer, Method, Nanometres, Parallel, Passage,
    PathRule, Rays, RgbBands, RgbFromSpectrum, ScatterTable, Spectrophotometer, States, Tissue, trace_path_lengths,
    trace_splitting,
};

fn go_on(_: usize, _: usize) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// One thread: figures are per core.
pub fn run(_: &[String]) -> Result<(), Box<dyn Error>> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("one thread");
    pool.install(|| {
        speed();
        rays_for_a_precision();
        reuse();
        texels();
        residuals();
        fixed_indices();
    });
    Ok(())
}

fn speed() {
    println!("## abm97 at 550 nm, soybean, 8 degrees, one core\n");
    println!("| form | rays | M rays/s | R | T | error of R, T |\n|---|---|---|---|---|---|");
    let green = Nanometres(550.0);
    let full = Abm97::default();
    let reduced = Abm97 { switches: Abm97Switches { states: States::Reduced, ..Abm97Switches::default() }, ..full };
    let beam = Spectrophotometer::parallel();
    let truth = trace_path_lengths(&full.stack(green), &Parallel::onto(Face::Adaxial, 8.0), 20_000_000, 99);
    let depth = full.optical_depth(green).0;
    let (r0, t0) = (truth.reflectance(depth).mean, truth.transmittance(depth).mean);
    let forms: [(&str, &Abm97, Method, u64); 5] = [
        ("four states, absorption drawn (the paper's)", &full, Method::Direct, 4_000_000),
        ("four states, one trace for all wavelengths", &full, Method::PathLengths, 4_000_000),
        ("four states, Fresnel-weighted splitting and roulette", &full, Method::Splitting, 500_000),
        ("two states, absorption drawn", &reduced, Method::Direct, 4_000_000),
        ("two states, one trace for all wavelengths", &reduced, Method::PathLengths, 4_000_000),
    ];
    for (name, leaf, method, rays) in forms {
        let start = Instant::now();
        let s = beam.measure(leaf, &[550.0], Rays::Count(rays), method, 1, &go_on).expect("measured");
        let speed = rays as f64 / start.elapsed().as_secs_f64() / 1e6;
        let (r, t) = (s.reflectance[0].mean, s.transmittance[0].mean);
        println!("| {name} | {rays:.0e} | {speed:.2} | {r:.4} | {t:.4} | {:+.4}, {:+.4} |", r - r0, t - t0);
    }
}

fn rays_for_a_precision() {
    println!("\n## Rays to +-0.001 (95 of 100), abm97, 400 to 700 nm every 10 nm\n");
    println!("| form | rays | seconds, one core |\n|---|---|---|");
    let nm: Vec<f64> = (0..31).map(|i| 400.0 + 10.0 * f64::from(i)).collect();
    let beam = Spectrophotometer::parallel();
    let start = Instant::now();
    let reuse =
        beam.measure(&Abm97::default(), &nm, Rays::Precision(1e-3), Method::PathLengths, 1, &go_on).expect("measured");
    println!("| one trace for all wavelengths | {} | {:.2} |", reuse.rays, start.elapsed().as_secs_f64());
    let start = Instant::now();
    let direct =
        beam.measure(&Abm97::default(), &nm, Rays::Precision(1e-3), Method::Direct, 1, &go_on).expect("measured");
    println!("| each wavelength by itself | 31 x {} | {:.2} |", direct.rays, start.elapsed().as_secs_f64());
}

fn reuse() {
    println!("\n## Path-length reuse against direct simulation, abm97, 1e6 rays\n");
    println!("| nm | R reuse | R direct | T reuse | T direct | apart in standard errors |\n|---|---|---|---|---|---|");
    let nm = [450.0, 550.0, 650.0, 680.0, 700.0];
    let beam = Spectrophotometer::parallel();
    let leaf = Abm97::default();
    let of = |method, seed| beam.measure(&leaf, &nm, Rays::Count(1_000_000), method, seed, &go_on).expect("measured");
    let (a, b) = (of(Method::PathLengths, 1), of(Method::Direct, 2));
    let apart = |a: Estimate, b: Estimate| (a.mean - b.mean).abs() / a.standard_error.hypot(b.standard_error);
    for i in 0..nm.len() {
        println!(
            "| {} | {:.4} | {:.4} | {:.4} | {:.4} | {:.1}, {:.1} |",
            nm[i],
            a.reflectance[i].mean,
            b.reflectance[i].mean,
            a.transmittance[i].mean,
            b.transmittance[i].mean,
            apart(a.reflectance[i], b.reflectance[i]),
            apart(a.transmittance[i], b.transmittance[i]),
        );
    }
}

/// A direction pair at a texel: table lookup and sum against tracing rays for it.
fn texels() {
    println!("\n## A direction pair of abm97 at a texel, 16 classes of ways, three channels, one core\n");
    println!("| form | ns a pair | relative error of the BRDF at 550 nm, mean |\n|---|---|---|");
    let leaf = Abm97::default();
    let green = Nanometres(550.0);
    let stack = leaf.stack(green);
    let start = Instant::now();
    let table = ScatterTable::trace(&stack, Face::Adaxial, Passage::Reflection, 1_000_000, 1);
    let build = start.elapsed().as_secs_f64();
    let depth = leaf.optical_depth(green).0 as f32;
    let left = table.ways().map(|way| (-depth * way).exp());
    let colours = [left; 3];
    let pairs = 2_000_000;
    let start = Instant::now();
    let mut sum = [0f32; 3];
    for i in 0..pairs {
        let u = (i % 97) as f32 / 97.0;
        let ways = table.pi_f(0.2 + 0.8 * u, 1.0 - 0.8 * u, 2.0 * u - 1.0);
        for (channel, colour) in sum.iter_mut().zip(&colours) {
            *channel += ways.iter().zip(colour).map(|(w, c)| w * c).sum::<f32>();
        }
    }
    black_box(sum);
    let lookup = start.elapsed().as_secs_f64() * 1e9 / f64::from(pairs);
    // Error against a fine goniogram at 45 degrees.
    let instrument = Goniophotometer { latitudes: 40, ..Goniophotometer::default() };
    let gram = instrument.measure(&leaf, green, 20_000_000, 3, &go_on).expect("measured");
    let (mut error, mut count) = (0.0, 0);
    for (i, theta) in gram.theta_deg.iter().enumerate().take(17) {
        for (j, phi) in gram.phi_deg.iter().enumerate() {
            let ways =
                table.pi_f(45f32.to_radians().cos(), theta.to_radians().cos() as f32, phi.to_radians().cos() as f32);
            let f = f64::from(ways.iter().zip(&left).map(|(w, c)| w * c).sum::<f32>()) / std::f64::consts::PI;
            error += (f / gram.brdf[i * gram.phi_deg.len() + j] - 1.0).abs();
            count += 1;
        }
    }
    let error = error / f64::from(count);
    println!("| table of way classes (built in {build:.1} s) | {lookup:.0} | {error:.3} |");
    let start = Instant::now();
    let rays = 1_000_000;
    let traced = trace_path_lengths(&stack, &Parallel::onto(Face::Adaxial, 45.0), rays, 1);
    let per_ray = start.elapsed().as_secs_f64() * 1e9 / rays as f64;
    black_box(traced);
    // A patch of 1/800 of the sphere at f = 0.03 / sr catches a ray in some 5000; 1 % takes 10^4 of them.
    let solid = 2.0 * std::f64::consts::PI / 400.0 * 0.5;
    let needed = 1e4 / (0.03 * solid);
    println!("| rays until the patch of a 20 x 40 sphere is known to 1 % | {:.1e} | 0.01 |", per_ray * needed);
}

fn residuals() {
    println!("\n## Energy and reciprocity\n");
    println!(
        "| model | R + T - 1 without absorption | diffuse T down, up | BRDF 45 to 75, 75 to 45 (1/sr) |\n|---|---|---|---|"
    );
    let sieve = PathRule::Sieve;
    let flat = Abm97Switches { spongy_side_spreads: false, ..Abm97Switches::default() };
    let models: [(&str, Box<dyn Tissue>); 4] = [
        ("abm97", Box::new(Abm97::default())),
        ("abm97, states 3 and 4 unspread", Box::new(Abm97 { switches: flat, ..Abm97::default() })),
        ("abm-b", Box::new(AbmB { path: sieve, ..AbmB::default() })),
        ("abm-u", Box::new(AbmU { path: sieve, ..AbmU::default() })),
    ];
    for (name, tissue) in models {
        let stack = tissue.stack(Nanometres(550.0));
        let of = |face| trace_path_lengths(&stack, &Diffuse { face }, 4_000_000, 5);
        let (down, up) = (of(Face::Adaxial), of(Face::Abaxial));
        let excess = down.reflectance(0.0).mean + down.transmittance(0.0).mean - 1.0;
        // BRDF at 550 nm between two directions in the plane, forward.
        let f = |from: f64, to: f64| {
            let instrument =
                Goniophotometer { latitudes: 36, longitudes: 36, incidence_deg: from, face: Face::Adaxial };
            let gram = instrument.measure(tissue.as_ref(), Nanometres(550.0), 20_000_000, 7, &go_on).expect("measured");
            let plane = gram.in_plane(&gram.brdf);
            let near = |p: &&(f64, f64)| (p.0 - to).abs() < 2.6;
            let (sum, n) = plane.iter().filter(near).fold((0.0, 0), |(s, n), p| (s + p.1, n + 1));
            sum / f64::from(n)
        };
        println!(
            "| {name} | {excess:.0e} ({} lost) | {:.4}, {:.4} | {:.3}, {:.3} |",
            down.lost + up.lost,
            down.transmittance(0.0).mean,
            up.transmittance(0.0).mean,
            f(45.0, 75.0),
            f(75.0, 45.0),
        );
    }
    let stack = Abm97::default().stack(Nanometres(550.0));
    let split = trace_splitting(&stack, &Diffuse { face: Face::Adaxial }, 400_000, 5);
    let total = split.reflectance(0.0).mean + split.transmittance(0.0).mean;
    println!("| abm97 by splitting | {:+.0e} (roulette keeps the mean only) | | |", total - 1.0);
}

/// Captures trace a table with the refractive indices of each channel's mean wavelength; spectra use each wavelength's.
fn fixed_indices() {
    println!("\n## Indices of few wavelengths for all, 8 degrees, 4e5 rays\n");
    println!("| model | side | quantity | linear sRGB, every wavelength's indices | the channels' three | 550 nm |");
    println!("|---|---|---|---|---|---|");
    let convert = RgbFromSpectrum::new(RgbBands::Spectral31);
    let models: [(&str, Box<dyn Tissue>); 2] =
        [("abm-b", Box::new(AbmB::default())), ("abm-u", Box::new(AbmU::default()))];
    for (name, tissue) in models {
        for face in [Face::Adaxial, Face::Abaxial] {
            let beam = Parallel::onto(face, 8.0);
            let of = |nm: f64| trace_path_lengths(&tissue.stack(Nanometres(nm)), &beam, 400_000, 1);
            let channels = convert.mean_wavelengths_nm().map(of);
            let green = of(550.0);
            // Reflectance and transmittance: with every wavelength's indices, those of red, green and blue, and of 550 nm.
            let mut spectra = [const { [const { Vec::new() }; 5] }; 2];
            for &nm in convert.wavelengths_nm() {
                let depth = tissue.optical_depth(Nanometres(nm)).0;
                let own = of(nm);
                for (i, traced) in [&own, &channels[0], &channels[1], &channels[2], &green].into_iter().enumerate() {
                    spectra[0][i].push(traced.reflectance(depth).mean);
                    spectra[1][i].push(traced.transmittance(depth).mean);
                }
            }
            for (quantity, spectra) in ["R", "T"].into_iter().zip(&spectra) {
                let [own, red, green, blue, fixed] = spectra.each_ref().map(|spectrum| convert.rgb(spectrum));
                let three = [red[0], green[1], blue[2]];
                let cell = |rgb: [f64; 3]| format!("{:.4} {:.4} {:.4}", rgb[0], rgb[1], rgb[2]);
                let told = |rgb| format!("{}, Delta E00 {:.2}", cell(rgb), delta_e00_linear(own, rgb));
                println!("| {name} | {face:?} | {quantity} | {} | {} | {} |", cell(own), told(three), told(fixed));
            }
        }
    }
}
