//! `cargo xtask demo`: the toolkit's main job on a capture that it makes itself.

use crate::arguments::asks_for_help;
use crate::failure::Failure;
use crate::metadata::Metadata;
use crate::shell::{answer_of, cargo, root, run_and_map, run_checked};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

const HELP: &str = "\
Makes two captures of a synthetic leaf in Bonn's layout (81 x 81 directions; lit from the front and from behind), fits
them into one asset, measures it, renders a leaf's blade that carries it under sun and sky, and writes a report. Needs no
GPU and no root.

Usage: cargo xtask demo [--size TEXELS] [--out FOLDER]

  --size TEXELS   width and height of the capture, 128 to 1024 [default: 256]
  --out FOLDER    where the results go [default: target/demo]

Example: cargo xtask demo --size 128 --out leaf-demo";

/// The packages that the demo needs.
const PROGRAMS: [&str; 3] = ["btf-synth", "btf-fit", "btf-viewer"];
/// Files and folders that the demo writes, and removes before it writes them again.
const OUTPUTS: [&str; 8] =
    ["leaf", "leaf-behind", "leaf.spmm", "leaf.png", "leaf.html", "fit.json", "compare.json", "view.json"];
/// Options of the leaf that is captured: a glossy tree's, a patch as wide as a blade, and a straight main vein.
const LEAF: [&str; 6] = ["--species", "tree", "--size-mm", "60", "--seed", "9"];
/// Options of the picture: a day in June at noon, in Berlin.
const PICTURE: [&str; 14] = [
    "--mesh",
    "leaf",
    "--daylight",
    "2026-06-21T12:00+02:00",
    "--place",
    "52.5,13.4",
    "--exposure",
    "1.2",
    "--headless",
    "--size",
    "512x512",
    "--frames",
    "32",
    "--out",
];
/// Bytes of the asset for each texel, both layers together.
const BYTES_PER_TEXEL: u64 = 32;
/// Name of the file that marks a folder as written by the demo.
const MARK: &str = ".btf-demo";

/// Options of the demo.
struct Options {
    size: u32,
    out: Option<PathBuf>,
}

/// Runs the demo.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if asks_for_help(arguments) {
        println!("{HELP}");
        return Ok(());
    }
    let options = parse(arguments)?;
    let target = Metadata::read()?.target_directory;
    let out = options.out.unwrap_or_else(|| target.join("demo"));
    prepare(&out)?;

    build()?;
    let program = |name: &str| {
        let mut command = Command::new(target.join("release").join(format!("{name}{}", std::env::consts::EXE_SUFFIX)));
        command.current_dir(root());
        command
    };
    let path = |name: &str| out.join(name);
    let size = options.size.to_string();
    let captures = [path("leaf"), path("leaf-behind")];
    for (capture, light) in captures.iter().zip([None, Some("--transmission")]) {
        run_checked(program("btf-synth").arg("leaf").arg(capture).args(LEAF).args(["--size", &size]).args(light))?;
    }
    let bytes = (BYTES_PER_TEXEL * u64::from(options.size).pow(2)).to_string();
    // Twelve clusters: in so few texels the bases, which every cluster has, weigh more than the texels.
    run_checked(
        program("btf-fit")
            .arg("fit")
            .args(&captures)
            .arg("-o")
            .arg(path("leaf.spmm"))
            .args(["--bytes", &bytes, "--clusters", "12", "--report"])
            .arg(path("leaf.html"))
            .arg("--json")
            .arg(path("fit.json")),
    )?;
    run_checked(
        program("btf-fit")
            .arg("compare")
            .args([path("leaf"), path("leaf.spmm")])
            .arg("--json")
            .arg(path("compare.json")),
    )?;
    run_checked(
        program("btf-view")
            .arg(path("leaf.spmm"))
            .args(PICTURE)
            .arg(path("leaf.png"))
            .arg("--json")
            .arg(path("view.json")),
    )?;
    summary(&out, options.size)
}

/// Builds the three programs, the viewer without its window. Prints every crate with its number among all.
fn build() -> Result<(), Failure> {
    let packages = PROGRAMS.iter().flat_map(|name| ["--package", name]);
    let packages: Vec<&str> = packages.chain(["--no-default-features"]).collect();
    // The tree lists a crate wherever it is used, and marks repetitions with a star.
    let tree = ["tree", "--edges", "normal,build", "--prefix", "none"];
    let tree = answer_of(cargo(&tree).args(&packages)).unwrap_or_default();
    let crates: BTreeSet<&str> = tree.lines().map(|line| line.trim_end_matches(" (*)")).collect();
    let total = crates.iter().filter(|line| !line.is_empty()).count();
    println!(
        "building {} without a window: {total} crates, those that are built already are not listed",
        PROGRAMS.join(", ")
    );
    let mut count = 0;
    let mut build = cargo(&["build", "--release"]);
    let status = run_and_map(build.args(&packages), |line| match line.trim_start().strip_prefix("Compiling ") {
        Some(name) => {
            count += 1;
            format!("{count:4} of {total}  {name}")
        }
        None => line.to_string(),
    })?;
    match status.success() {
        true => Ok(()),
        false => Err(Failure::of_program("the programs of the demo could not be built", status.code())),
    }
}

fn parse(arguments: &[String]) -> Result<Options, Failure> {
    let mut options = Options { size: 256, out: None };
    let mut rest = arguments.iter();
    while let Some(name) = rest.next() {
        let value = rest.next().ok_or_else(|| Failure::usage(format!("`{name}` needs a value\n\n{HELP}")))?;
        match name.as_str() {
            "--size" => {
                options.size = value
                    .parse()
                    .ok()
                    .filter(|size| (128..=1024).contains(size))
                    .ok_or_else(|| Failure::usage(format!("--size must be 128 to 1024, it is '{value}'")))?;
            }
            "--out" => options.out = Some(std::path::absolute(value).unwrap_or_else(|_| PathBuf::from(value))),
            unknown => return Err(Failure::usage(format!("`demo` has no option '{unknown}'\n\n{HELP}"))),
        }
    }
    Ok(options)
}

/// Makes the output folder, or removes the outputs of an earlier demo from it. Refuses a folder with other content.
fn prepare(out: &Path) -> Result<(), Failure> {
    let failed =
        |error: std::io::Error| Failure::new(format!("{}: {error}; choose another folder with --out", out.display()));
    if out.exists() && !out.join(MARK).exists() && std::fs::read_dir(out).map_err(failed)?.next().is_some() {
        return Err(Failure::new(format!(
            "{} is not empty and not of an earlier demo; choose another folder with --out",
            out.display()
        )));
    }
    std::fs::create_dir_all(out).map_err(failed)?;
    std::fs::write(out.join(MARK), "made by cargo xtask demo\n").map_err(failed)?;
    for name in OUTPUTS {
        let path = out.join(name);
        let removed = if path.is_dir() { std::fs::remove_dir_all(&path) } else { std::fs::remove_file(&path) };
        match removed {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(failed(error)),
            _ => {}
        }
    }
    Ok(())
}

fn figures(path: &Path) -> Result<serde_json::Value, Failure> {
    let text = std::fs::read_to_string(path).map_err(|error| Failure::new(format!("{}: {error}", path.display())))?;
    serde_json::from_str(&text).map_err(|error| Failure::new(format!("{}: {error}", path.display())))
}

fn summary(out: &Path, size: u32) -> Result<(), Failure> {
    let (fit, compare, view) =
        (figures(&out.join("fit.json"))?, figures(&out.join("compare.json"))?, figures(&out.join("view.json"))?);
    let number = |value: &serde_json::Value, key: &str| value[key].as_f64().unwrap_or(f64::NAN);
    // Two captures of three 8-bit channels.
    let raw = 2.0 * f64::from(size).powi(2) * 81.0 * 81.0 * 3.0;
    println!();
    println!("asset    {}", out.join("leaf.spmm").display());
    println!("picture  {}", out.join("leaf.png").display());
    println!("report   {}", out.join("leaf.html").display());
    println!();
    println!(
        "size     {:.0} kB, 1 : {:.0} of the raw captures",
        number(&fit, "bytes") / 1e3,
        raw / number(&fit, "bytes")
    );
    println!(
        "error    {:.2} dB PSNR (8-bit values, lit from the front), {:.2} CIEDE2000",
        number(&compare, "psnr_db"),
        number(&compare, "delta_e00_mean")
    );
    println!(
        "fit      {:.0} s, {:.0} MB of memory at most",
        number(&fit, "seconds"),
        number(&fit, "peak_memory_bytes") / 1e6
    );
    let backend = view["backend"].as_str().unwrap_or("?");
    match backend {
        "cpu" => println!(
            "picture  no GPU adapter answered: rendered with the CPU decoder (on Debian the package mesa-vulkan-drivers brings a software one)"
        ),
        _ => println!("picture  {backend} on {}", view["adapter"].as_str().unwrap_or("?")),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_with_other_content_is_left_alone_and_an_earlier_demo_is_replaced() {
        let out = std::env::temp_dir().join(format!("btf-demo-test-{}", std::process::id()));
        std::fs::create_dir_all(&out).unwrap();
        std::fs::write(out.join("leaf.spmm"), "mine").unwrap();
        assert!(prepare(&out).unwrap_err().to_string().contains("--out"));
        assert_eq!(std::fs::read_to_string(out.join("leaf.spmm")).unwrap(), "mine");
        std::fs::write(out.join(MARK), "").unwrap();
        std::fs::write(out.join("notes"), "kept").unwrap();
        prepare(&out).unwrap();
        assert!(!out.join("leaf.spmm").exists() && out.join("notes").exists());
        std::fs::remove_dir_all(&out).unwrap();
    }
}
