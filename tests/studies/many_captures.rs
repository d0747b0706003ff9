//! A library of thousands of tiny captures, fitted once by workers that nobody disturbs and once by workers that are killed at random:
//! `cargo run --release -p btf-tests -- many_captures BTF_FIT [COUNT [WORKERS [KILLS]]]`
//!
//! Tells the time that workers spend on anything but fits, and fails where an asset is lost, damaged, fitted twice by undisturbed
//! workers or not the same, byte for byte.

use btf_capture::{CaptureInfo, CaptureWriter, DirectionSet, ImageFormat};
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Width and height of a capture in texels, and its directions.
const SIZE: usize = 6;
const DIRECTIONS: usize = 3;
/// Options of the fits: what a tiny capture has to tell goes into few bytes.
const OPTIONS: [&str; 4] = ["--bytes", "4kB", "--rule", "*: lobes=0 clusters=1"];
/// Seconds without a sign of life after which a worker counts as lost.
const STALE_AFTER_S: &str = "2";

/// Runs the study.
pub fn run(arguments: &[String]) -> Result<(), Box<dyn Error>> {
    let [program, numbers @ ..] = arguments else {
        return Err("many_captures takes BTF_FIT [COUNT [WORKERS [KILLS]]]".into());
    };
    let number = |at: usize, usual: usize| numbers.get(at).map_or(Ok(usual), |text| text.parse());
    let (count, workers, kills) = (number(0, 10_000)?, number(1, 2)?, number(2, 200)?);
    let program = fs::canonicalize(program)?;
    let folder = tempfile::tempdir()?;
    let folder = folder.path();
    make_captures(&folder.join("captures"), count)?;
    let plan = |name: &str| {
        let arguments =
            [&["library", "plan", "captures", "-o", name, "--assets", &name[..4], "--quiet"][..], &OPTIONS].concat();
        Command::new(&program).args(arguments).current_dir(folder).status()
    };
    if !plan("calm.toml")?.success() || !plan("wild.toml")?.success() {
        return Err("planning failed".into());
    }

    let start = Instant::now();
    let mut running: Vec<Child> =
        (1..=workers).map(|worker| started(&program, folder, "calm", worker, workers)).collect::<Result<_, _>>()?;
    for worker in &mut running {
        worker.wait()?;
    }
    let calm_s = start.elapsed().as_secs_f64();
    let told = (1..=workers)
        .map(|worker| outcome(&folder.join(format!("calm{worker}.json"))))
        .collect::<Result<Vec<_>, _>>()?;
    let sum = |key: usize| told.iter().map(|outcome| outcome[key]).sum::<f64>();
    println!(
        "{count} captures, {workers} workers: {calm_s:.1} s, {:.1} s of each worker's on fits",
        sum(1) / workers as f64
    );
    println!("overhead {:.2} %", 100.0 * (1.0 - sum(1) / sum(2)));
    if sum(0) != count as f64 {
        return Err(format!("{} fits of {count} captures", sum(0)).into());
    }

    let start = Instant::now();
    let killed = disturbed(&program, folder, workers, kills, calm_s)?;
    println!("with {killed} kills at random: {:.1} s", start.elapsed().as_secs_f64());
    let (mut same, mut claims) = (0, 0);
    for entry in fs::read_dir(folder.join("calm"))? {
        let path = entry?.path();
        if path.is_file() {
            let other = folder.join("wild").join(path.file_name().unwrap_or_default());
            if fs::read(&path)? != fs::read(&other).unwrap_or_default() {
                return Err(format!("{} is lost or another", other.display()).into());
            }
            same += 1;
        }
    }
    for entry in fs::read_dir(folder.join("wild/claims"))? {
        claims += usize::from(!entry?.file_name().to_string_lossy().starts_with('.'));
    }
    println!("{same} assets are the same, byte for byte; {claims} claims are left");
    if same == count && claims == 0 { Ok(()) } else { Err("some are missing, or claims are left".into()) }
}

/// Makes `count` captures, each of another seed.
fn make_captures(folder: &Path, count: usize) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(folder)?;
    let made = (0..count).into_par_iter().try_for_each(|number| -> Result<(), String> {
        let words = |error: &dyn Error| error.to_string();
        let set = DirectionSet::random(DIRECTIONS, number as u64 + 1).map_err(|error| words(&error))?;
        let name = format!("m{number:05}");
        let info = CaptureInfo::new(&name, SIZE, SIZE, set.clone(), set, ImageFormat::Png);
        let mut random = Xoshiro256PlusPlus::seed_from_u64(number as u64);
        let writer = CaptureWriter::create(folder.join(&name), info).map_err(|error| words(&error))?;
        for pair in 0..DIRECTIONS * DIRECTIONS {
            let image: Vec<f32> = (0..3 * SIZE * SIZE).map(|_| random.gen_range(0.1..0.9)).collect();
            writer.write(pair / DIRECTIONS, pair % DIRECTIONS, &image).map_err(|error| words(&error))?;
        }
        writer.finish().map(|_| ()).map_err(|error| words(&error))
    });
    Ok(made?)
}

/// Starts a worker on the plan `name`.
fn started(program: &Path, folder: &Path, name: &str, worker: usize, workers: usize) -> std::io::Result<Child> {
    Command::new(program)
        .args(["library", "run", &format!("{name}.toml"), "--shard", &format!("{worker}/{workers}")])
        .args(["--stale-after", STALE_AFTER_S, "--threads", "1", "--quiet", "--json", &format!("{name}{worker}.json")])
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
}

/// Runs workers on the plan `wild`, and kills them `kills` times at random in about `seconds`, each time starting another. Returns
/// the number of kills.
fn disturbed(
    program: &Path,
    folder: &Path,
    workers: usize,
    kills: usize,
    seconds: f64,
) -> Result<usize, Box<dyn Error>> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(7);
    let start = |worker: usize| started(program, folder, "wild", worker + 1, workers);
    let mut running: Vec<Child> = (0..workers).map(start).collect::<Result<_, _>>()?;
    let mut killed = 0;
    while killed < kills {
        std::thread::sleep(Duration::from_secs_f64(random.gen_range(0.0..2.0) * seconds / kills.max(1) as f64));
        let worker = random.gen_range(0..workers);
        if running[worker].try_wait()?.is_some() {
            // There is nothing left to disturb.
            break;
        }
        running[worker].kill()?;
        running[worker].wait()?;
        running[worker] = start(worker)?;
        killed += 1;
    }
    for worker in &mut running {
        worker.wait()?;
    }
    // What the last ones left is taken over, and claims of what is done are cleared.
    for _ in 0..2 {
        std::thread::sleep(Duration::from_secs(3));
        let last = Command::new(program)
            .args(["library", "run", "wild.toml", "--stale-after", STALE_AFTER_S, "--wait", "--quiet"])
            .current_dir(folder)
            .status()?;
        if !last.success() {
            return Err("the last worker failed".into());
        }
    }
    Ok(killed)
}

/// Returns the fits of a worker, the seconds that they took, and the seconds of the whole worker.
fn outcome(path: &Path) -> Result<[f64; 3], Box<dyn Error>> {
    let text = fs::read_to_string(path)?;
    let number = |key: &str| -> Result<f64, Box<dyn Error>> {
        let after = text.split_once(&format!("\"{key}\":")).ok_or(format!("{} has no `{key}`", path.display()))?.1;
        Ok(after.split([',', '}', '\n']).next().unwrap_or_default().trim().parse()?)
    };
    Ok([number("fitted")?, number("fitting_s")?, number("seconds")?])
}
