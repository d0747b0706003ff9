//! Builds C programs with the system's compiler against the static and the shared library, and runs them: the test
//! program `check.c`, which compares the values in C with those in Rust, alone and under valgrind, and the example.
#![cfg(unix)]

use btf_runtime::testing::{Random, sample_asset, sample_heights};
use btf_runtime::{
    Asset, DecodeOptions, Interpolation, Query, Resident, ResidualKind, SurfaceSide, density, evaluate, pack, serial,
    with_levels,
};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Exit code of valgrind if it finds a fault.
const FOUND: i32 = 99;

fn package() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the folder of the libraries that cargo built with this test.
fn libraries() -> PathBuf {
    let program = std::env::current_exe().expect("a program knows its path");
    program.parent().expect("a program lies in a folder").into()
}

#[derive(Clone, Copy, PartialEq)]
enum Linked {
    Static,
    Shared,
}

fn text_of(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

/// Returns whether a program of others is not here. Everywhere but in CI `test` is then counted as skipped.
///
/// # Panics
/// In CI, with how to get the program.
fn is_absent(program: &str, test: &str) -> bool {
    let is_here = Command::new(program).arg("--version").output().is_ok();
    let is_ci = ["CI", "BTF_CI"].iter().any(|name| std::env::var_os(name).is_some_and(|value| !value.is_empty()));
    assert!(is_here || !is_ci, "{program} is not here: install it with `cargo xtask setup`");
    if !is_here {
        skip(&format!("{test} ({program} is not here: `cargo xtask setup` installs it)"));
    }
    !is_here
}

/// Returns a tool's output; without the tool the test fails and says how to get it.
fn run(command: &mut Command) -> Output {
    let program = command.get_program().to_string_lossy().into_owned();
    let remedy = "install it with `cargo xtask setup` (Debian: apt-get install gcc g++ valgrind)";
    // Cargo's search path holds the library of the last `cargo build`; the program knows where that of this test is.
    command.env_remove("LD_LIBRARY_PATH").env_remove("DYLD_FALLBACK_LIBRARY_PATH");
    command.output().unwrap_or_else(|error| panic!("{program} does not start ({error}): {remedy}"))
}

/// Compiles a program of ours as a user would, every warning an error.
fn build(source: &Path, folder: &Path, linked: Linked) -> PathBuf {
    let libraries = libraries();
    let program = folder.join(if linked == Linked::Static { "static" } else { "shared" });
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-g", "-O1", "-pthread", "-I"]);
    compiler.arg(package().join("include")).arg(source);
    match linked {
        Linked::Static => compiler.arg(libraries.join("libbtf.a")),
        Linked::Shared => {
            compiler.arg("-L").arg(&libraries).arg("-lbtf").arg(format!("-Wl,-rpath,{}", libraries.display()))
        }
    };
    let output = run(compiler.args(["-lpthread", "-ldl", "-lm", "-o"]).arg(&program));
    assert!(output.status.success(), "{} does not compile:\n{}", source.display(), text_of(&output));
    program
}

/// Returns an asset with reflection and transmission for an eye in front, with heights.
fn asset() -> Asset {
    let mut asset = sample_asset(31, 6, 5, ResidualKind::Root);
    let mut through = asset.layers[0].clone();
    through.light_side = SurfaceSide::Back;
    through.residual = None;
    asset.layers.push(through);
    asset.layers[0].heights = Some(sample_heights(4, 30));
    // Narrow lobes would make the sum over samples noisy.
    for lobe in asset.layers.iter_mut().flat_map(|layer| layer.dictionary.iter_mut().flatten()) {
        lobe.lobe.params = lobe.lobe.params.map(|p| p.min(4.0));
    }
    asset
}

/// Returns level, interpolation, place, value and density in the layout of `record` of `check.c`.
fn record(resident: &Resident, level: u32, exact: bool, query: &Query) -> Vec<u8> {
    let interpolation = if exact { Interpolation::Exact } else { Interpolation::Fast };
    let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
    let numbers = [&query.uv[..], &query.wi, &query.wo, &evaluate(resident, level, query, &options)].concat();
    let mut bytes = [level.to_le_bytes(), u32::from(exact).to_le_bytes()].concat();
    bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
    bytes.extend(density(resident, level, query, &options).to_le_bytes());
    bytes
}

/// The files that `check.c` reads, in a folder.
struct Files {
    folder: tempfile::TempDir,
    asset: PathBuf,
    expected: PathBuf,
    damaged: PathBuf,
}

/// Number of bytes of a record of `check.c`.
const RECORD: usize = 56;

fn write_files() -> Files {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let bytes = pack(&asset()).unwrap();
    std::fs::write(path("asset.spmm"), &bytes).unwrap();

    // What a reader of the file gets.
    let asset = Asset::parse(&bytes).unwrap();
    let resident = Resident::from_asset(&with_levels(&asset, &serial));
    let mut random = Random::new(8);
    let mut expected = Vec::new();
    for number in 0..400 {
        let (mut wi, mut wo) = (random.direction(), random.direction());
        wi[2] *= [1.0, 1.0, -1.0][random.below(3)];
        wo[2] *= [1.0, 1.0, 1.0, -1.0][random.below(4)];
        let mut uv = [random.within(-2.0, 3.0), random.within(-2.0, 3.0)];
        match random.below(40) {
            0 => wi = wi.map(|x| 2.0 * x),
            1 => wo[1] = f32::NAN,
            2 => uv[0] = f32::INFINITY,
            _ => {}
        }
        let one = record(&resident, number % resident.levels(), random.below(2) == 1, &Query { uv, wi, wo });
        assert_eq!(one.len(), RECORD);
        expected.extend(one);
    }
    std::fs::write(path("expected"), &expected).unwrap();

    std::fs::create_dir(path("damaged")).unwrap();
    let damage = |name: &str, damage: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = bytes.clone();
        damage(&mut bytes);
        std::fs::write(path("damaged").join(name), bytes).unwrap();
    };
    damage("truncated.spmm", &|bytes| bytes.truncate(bytes.len() - 7));
    damage("short.spmm", &|bytes| bytes.truncate(20));
    damage("empty.spmm", &|bytes| bytes.clear());
    damage("appended.spmm", &|bytes| bytes.extend([0; 5]));
    damage("magic.spmm", &|bytes| bytes[..4].copy_from_slice(b"\x89PNG"));
    damage("version.spmm", &|bytes| bytes[4] = 200);
    damage("flipped.spmm", &|bytes| bytes.iter_mut().rev().nth(40).into_iter().for_each(|byte| *byte ^= 1));
    Files { asset: path("asset.spmm"), expected: path("expected"), damaged: path("damaged"), folder }
}

#[test]
fn c_gets_what_rust_gets_with_either_library_and_a_changed_value_is_found() {
    if is_absent("cc", "c_gets_what_rust_gets_with_either_library_and_a_changed_value_is_found") {
        return;
    }
    let files = write_files();
    for linked in [Linked::Static, Linked::Shared] {
        let program = build(&package().join("tests/check.c"), files.folder.path(), linked);
        let check = || run(Command::new(&program).args([&files.asset, &files.expected, &files.damaged]));
        let output = check();
        assert!(output.status.success() && text_of(&output).contains("all holds"), "{}", text_of(&output));

        // Planted difference: the last bit of one number that is expected.
        let right = std::fs::read(&files.expected).unwrap();
        for number in [0, 10, 13] {
            let mut wrong = right.clone();
            // Green of a record, or its density; the first word is its level.
            wrong[200 * RECORD + 4 * number] ^= 1;
            std::fs::write(&files.expected, wrong).unwrap();
            let output = check();
            let told = text_of(&output);
            assert!(output.status.code() == Some(1) && told.contains("1 of 400 values differ"), "{number}: {told}");
        }
        std::fs::write(&files.expected, right).unwrap();
    }
}

/// Prints that a test was skipped; `cargo xtask test` counts these lines of its log.
fn skip(reason: &str) {
    eprintln!("skipped: {reason}");
    if let Some(log) = std::env::var_os("BTF_SKIP_LOG") {
        let mut file = std::fs::OpenOptions::new().create(true).append(true).open(log).expect("the skip log opens");
        writeln!(file, "{reason}").expect("the skip log is written");
    }
}

#[test]
fn valgrind_finds_nothing_but_a_planted_leak() {
    if std::env::var_os("BTF_SKIP_VALGRIND").is_some_and(|value| value == "1") {
        return skip("the C interface under valgrind (BTF_SKIP_VALGRIND=1)");
    }
    if is_absent("cc", "the C interface under valgrind") || is_absent("valgrind", "the C interface under valgrind") {
        return;
    }
    let files = write_files();
    let program = build(&package().join("tests/check.c"), files.folder.path(), Linked::Static);
    let valgrind = || {
        let mut valgrind = Command::new("valgrind");
        valgrind.args(["--quiet", "--leak-check=full", "--show-leak-kinds=all", "--errors-for-leak-kinds=all"]);
        valgrind.arg(format!("--error-exitcode={FOUND}")).arg(&program);
        valgrind
    };
    let output = run(valgrind().args([&files.asset, &files.expected, &files.damaged]));
    assert!(output.status.success(), "{}", text_of(&output));
    let output = run(valgrind().arg("leak").arg(&files.asset));
    assert_eq!(output.status.code(), Some(FOUND), "{}", text_of(&output));
}

#[test]
fn the_example_prints_a_table_or_a_sentence() {
    if is_absent("cc", "the_example_prints_a_table_or_a_sentence") {
        return;
    }
    let files = write_files();
    let program = build(&package().join("examples/evaluate.c"), files.folder.path(), Linked::Static);
    let output = run(Command::new(&program).arg(&files.asset));
    let told = text_of(&output);
    assert!(output.status.success() && told.contains("6 x 5 texels, 2 layers"), "{told}");
    // The light straight above, as Rust sees it.
    let resident = Resident::from_asset(&Asset::parse(&std::fs::read(&files.asset).unwrap()).unwrap());
    let query = Query { uv: [0.5; 2], wi: [0.0, 0.0, 1.0], wo: [0.0, 0.0, 1.0] };
    let [r, g, b] = evaluate(&resident, 0, &query, &DecodeOptions::default());
    assert!(told.contains(&format!("   0  {r:8.5} {g:8.5} {b:8.5}")), "{told}");

    let output = run(Command::new(&program).arg(files.damaged.join("magic.spmm")));
    assert_eq!(output.status.code(), Some(1));
    assert!(text_of(&output).contains("magic.spmm: this is not an SPMM asset"), "{}", text_of(&output));
}

#[test]
fn cpp_gets_what_c_gets_and_assets_close_themselves() {
    let name = "cpp_gets_what_c_gets_and_assets_close_themselves";
    if is_absent("c++", name) {
        return;
    }
    let files = write_files();
    for standard in ["-std=c++17", "-std=c++20"] {
        let program = files.folder.path().join("cpp");
        let mut compiler = Command::new("c++");
        compiler.args([standard, "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-g", "-O1", "-pthread", "-I"]);
        compiler
            .arg(package().join("include"))
            .arg(package().join("tests/check.cpp"))
            .arg(libraries().join("libbtf.a"));
        let output = run(compiler.args(["-lpthread", "-ldl", "-lm", "-o"]).arg(&program));
        assert!(output.status.success(), "{standard}:\n{}", text_of(&output));
        let arguments = [&files.asset, &files.damaged.join("flipped.spmm")];
        let output = run(Command::new(&program).args(arguments));
        assert!(output.status.success() && text_of(&output).contains("all holds"), "{standard}: {}", text_of(&output));
        let leaves_valgrind_out = std::env::var_os("BTF_SKIP_VALGRIND").is_some_and(|value| value == "1");
        if leaves_valgrind_out || is_absent("valgrind", name) {
            continue;
        }
        let mut valgrind = Command::new("valgrind");
        valgrind.args(["--quiet", "--leak-check=full", "--errors-for-leak-kinds=all"]);
        let output = run(valgrind.arg(format!("--error-exitcode={FOUND}")).arg(&program).args(arguments));
        assert!(output.status.success(), "{}", text_of(&output));
    }
}

#[test]
fn the_header_is_c99_c11_and_cpp17_without_a_warning() {
    if is_absent("cc", "the_header_is_c99_c11_and_cpp17_without_a_warning")
        || is_absent("c++", "the_header_is_c99_c11_and_cpp17_without_a_warning")
    {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let compile = |compiler: &str, standard: &str, name: &str, text: &str| {
        let source = folder.path().join(name);
        std::fs::write(&source, text).unwrap();
        let mut command = Command::new(compiler);
        command.args(["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", standard, "-I"]);
        let output = run(command.arg(package().join("include")).arg(&source));
        (output.status.success(), text_of(&output))
    };
    let c = "#include \"btf.h\"\nint main(void) { btf_options o = btf_default_options(); \
             return (int)o.heights + (int)BTF_LEVELS_ALL; }\n";
    let cpp = "#include \"btf.h\"\n#include \"btf.h\"\nint main() { btf_open_options o = btf_default_open_options(); \
               o.levels = BTF_LEVELS_ALL; btf_asset *asset = nullptr; \
               return btf_open_file(\"a\", &o, &asset) == BTF_FILE ? 0 : 1; }\n";
    for (compiler, standard, name, text) in
        [("cc", "-std=c99", "a.c", c), ("cc", "-std=c11", "a.c", c), ("c++", "-std=c++17", "a.cpp", cpp)]
    {
        let (success, told) = compile(compiler, standard, name, text);
        assert!(success, "{standard}: {told}");
        // Planted difference: a warning.
        let (success, told) = compile(compiler, standard, name, &text.replacen("return", "int unused; return", 1));
        assert!(!success && told.contains("unused"), "{standard}: {told}");
    }
}
