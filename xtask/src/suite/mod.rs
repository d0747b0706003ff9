//! `cargo xtask test`: everything that CI runs, and its quick tier.

mod runners;
mod steps;

use crate::arguments::asks_for_help;
use crate::checks::{arrows, header, licences, links, locks, rooms, words};
use crate::chores::check::{CLIPPY, CLIPPY_WITHOUT_WINDOW, DOCS, DOCS_FLAGS, FORMAT};
use crate::chores::fuzz;
use crate::counts::Counts;
use crate::failure::Failure;
use crate::metadata::Metadata;
use crate::shell::root;
use crate::tools::python_module::{self, Build};
use crate::tools::{
    asset_tools, blender, browser, c_package, compilers, driver, peers, shader_tools, slurm, viewer_page, wasm,
    wasm_bindgen, web_package, window_tools,
};
use std::path::Path;
use steps::Suite;

const HELP: &str = "\
Runs everything that CI runs and goes on after a failure. First come the tests that need nothing but Rust, then format,
dependency arrows, folders, licences, words, links of the documents, lock files, the C header, doc tests, clippy and docs; then what other programs need is
installed (a software Vulkan driver, Xvfb, compilers and valgrind; below the target folder judges of shaders and files,
Mitsuba, the Python module and Blender), and the tests run that use it, and the fuzz targets for some seconds. At the end everything
that failed is listed; the last line sums it up: N passed, N failed, N skipped.

Usage: cargo xtask test [--quick]

  --quick   the tier for every edit: no GPU, no integration tests, no docs (under 5 minutes)

BTF_SKIP_GPU=1 leaves the GPU tests out, BTF_SKIP_RAY_QUERY=1 those by ray queries, which an adapter may lack,
BTF_SKIP_PEERS=1 the comparisons with Mitsuba, the Python module, the add-on for Blender and what shader compilers say, BTF_SKIP_VALGRIND=1 the C
interface under valgrind, BTF_SKIP_WEB=1 the package for browsers; all are counted as skipped. A program that is not there and cannot be installed (a C compiler, valgrind, Node.js, Python) leaves out what needs it, which is counted as
skipped, too; in CI, where CI or BTF_CI is set, that is a failure. BTF_PEERS_PYTHON names a Python that has Mitsuba and
maturin already. BTF_DATA names the folder of the measured data, without which the tests that use it are skipped.

Example: BTF_SKIP_GPU=1 cargo xtask test";

/// Runs the chore.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if asks_for_help(arguments) {
        println!("{HELP}");
        return Ok(());
    }
    let quick = match arguments {
        [] => false,
        [quick] if quick == "--quick" => true,
        _ => return Err(Failure::usage(format!("`test` does not know '{}'\n\n{HELP}", arguments.join(" ")))),
    };
    let mut suite = Suite::default();
    match Metadata::read() {
        Ok(metadata) if quick => run_quick(&mut suite, &metadata),
        Ok(metadata) => run_all(&mut suite, &metadata),
        Err(failure) => suite.step("metadata", || Err(failure.to_string())),
    }
    suite.finish()
}

fn run_quick(suite: &mut Suite, metadata: &Metadata) {
    suite.tests("unit tests", || runners::unit_tests(metadata));
    check(suite, metadata);
    suite.cargo("clippy", CLIPPY, &[]);
    suite.step("left out by --quick", || {
        println!("integration tests, GPU tests, doc tests and docs: `cargo xtask test` runs them");
        Ok(Counts::SKIPPED)
    });
}

fn run_all(suite: &mut Suite, metadata: &Metadata) {
    let target = metadata.target_directory.as_path();
    suite.tests("tests that need nothing but Rust", || runners::independent_tests(metadata));
    check(suite, metadata);
    suite.tests("doc tests", runners::doc_tests);
    suite.cargo("clippy", CLIPPY, &[]);
    suite.cargo("clippy without the window", CLIPPY_WITHOUT_WINDOW, &[]);
    suite.cargo("docs", DOCS, &[DOCS_FLAGS]);
    install(suite, target);
    suite.tests("tests with other programs", || runners::dependent_tests(metadata));
    suite.tests("unit tests on the GPU", || runners::gpu_unit_tests(metadata));
    suite.step("fuzz", || {
        if !fuzz::has_compiler() {
            return steps::absent("no C++ compiler");
        }
        println!("{}", fuzz::fuzz(target, None, fuzz::RUNS).map_err(|failure| failure.to_string())?);
        Ok(Counts::PASSED)
    });
}

/// Runs the checks that take a second each.
fn check(suite: &mut Suite, metadata: &Metadata) {
    suite.cargo("format", FORMAT, &[]);
    suite.check("arrows", || arrows::check(metadata, &root()));
    suite.check("licences", || licences::check(metadata));
    suite.check("rooms", || rooms::check(&root()));
    suite.check("words", || words::check(&root()));
    suite.check("links", || links::check(&root()));
    suite.check("lock files", || locks::check(&root(), fuzz::folders()));
    suite.check("header", header::check);
}

/// Finds or installs what other programs the tests need, and runs the tests of the Python module and of the rival
/// codecs.
fn install(suite: &mut Suite, target: &Path) {
    const NO_GPU: Option<&str> = Some("BTF_SKIP_GPU");
    const NO_PEERS: Option<&str> = Some("BTF_SKIP_PEERS");
    const NO_WEB: Option<&str> = Some("BTF_SKIP_WEB");
    // Without a driver the tests fail and say how to get one: a renderer that was never drawn with is no renderer.
    suite.required_tool("driver", NO_GPU, driver::ensure);
    suite.tool("window tools", NO_GPU, window_tools::ensure);
    // Not every machine can install it; the test then says that it was left out.
    suite.step("Slurm", || match slurm::ensure() {
        Ok(said) => {
            println!("{said}");
            Ok(Counts::PASSED)
        }
        Err(failure) => {
            println!("{failure}");
            Ok(Counts::SKIPPED)
        }
    });
    if suite.tool("tools for C", None, compilers::ensure) {
        suite.check("package for C++", || c_package::test(target, "dev").map_err(|failure| failure.to_string()));
    }
    suite.tool("shader tools", NO_PEERS, shader_tools::ensure_validators);
    suite.tool("shader compiler", NO_PEERS, || shader_tools::ensure_dawn(target));
    suite.tool("asset tools", NO_PEERS, || asset_tools::ensure(target));
    if suite.tool("peers", NO_PEERS, || peers::ensure(target)) {
        let said = |result: Result<String, Failure>| result.map_err(|failure| failure.to_string());
        suite.tool("LLVM", None, || peers::ensure_llvm(target));
        suite.check("rival codecs", || said(peers::check_peers(target)));
        suite.check("python", || said(python_module::build_and_test(target, Build::Tests)));
        if suite.tool("Blender", None, || blender::ensure(target)) {
            suite.step("add-on for Blender", || {
                let extension = blender::build(target, Build::Tests).map_err(|failure| failure.to_string())?;
                blender::test(target, &extension, Build::Tests).map_err(|failure| failure.to_string())
            });
        }
    }
    if suite.tool("WebAssembly", NO_WEB, || wasm::ensure(target)) {
        suite.tool("browser", NO_WEB, || browser::ensure(target));
        let mut package = None;
        suite.step("package for browsers", || {
            let made = web_package::build(target, "dev").map_err(|failure| failure.to_string())?;
            let counts = web_package::test(target, &made, "dev").map_err(|failure| failure.to_string());
            package = Some(made);
            counts
        });
        if suite.tool("wasm-bindgen", NO_WEB, || wasm_bindgen::ensure(target)) {
            suite.step("page", || {
                let page = viewer_page::build(target, "dev").map_err(|failure| failure.to_string())?;
                let package = package.ok_or("the package for browsers was not made")?;
                viewer_page::test(target, &page, &package, "dev").map_err(|failure| failure.to_string())
            });
        }
    }
}
