//! Compilers and validators that did not come from us. What needs one that is absent is skipped, visibly; in CI that is
//! a failure.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Environment in which SPIR-V has to be valid: that of `SPIRV_VERSION` of languages.rs.
const SPIRV_ENVIRONMENT: &str = "vulkan1.1";

/// A tool of others.
#[derive(Clone, Copy)]
pub enum Tool {
    SpirvVal,
    Glslang,
    /// Node.js and, installed by npm, Dawn.
    Dawn,
}

impl Tool {
    fn name(self) -> &'static str {
        match self {
            Tool::SpirvVal => "spirv-val",
            Tool::Glslang => "glslangValidator",
            Tool::Dawn => "Dawn in Node.js",
        }
    }

    fn is_here(self) -> bool {
        let answers = |program: &str| Command::new(program).arg("--version").output().is_ok();
        match self {
            Tool::SpirvVal | Tool::Glslang => answers(self.name()),
            Tool::Dawn => answers("node") && dawn_folder().join("package-installed.json").exists(),
        }
    }
}

/// Returns whether `test` is left out: on purpose by `BTF_SKIP_PEERS=1`, or because one of its `tools` is absent. Has
/// `cargo xtask test` count it as a skipped test.
///
/// # Panics
/// If a tool is absent in CI, with how to get it.
pub fn are_left_out(test: &str, tools: &[Tool]) -> bool {
    if super::is_set("BTF_SKIP_PEERS") {
        super::skip(&format!("{test} (BTF_SKIP_PEERS=1)"));
        return true;
    }
    let Some(absent) = tools.iter().find(|tool| !tool.is_here()) else { return false };
    let is_ci = ["CI", "BTF_CI"].iter().any(|name| std::env::var_os(name).is_some_and(|value| !value.is_empty()));
    let sentence = format!("{} is not here: `cargo xtask setup` installs it", absent.name());
    assert!(!is_ci, "{sentence}");
    super::skip(&format!("{test} ({sentence})"));
    true
}

/// Runs a program; `Err` holds what it printed where it refuses.
///
/// # Panics
/// If the program is not installed; the message says how to get it.
fn run(command: &mut Command) -> Result<(), String> {
    let output = command.output().unwrap_or_else(|error| {
        panic!(
            "{} does not start ({error}): `cargo xtask setup` installs what checks shaders, BTF_SKIP_PEERS=1 leaves it \
             out",
            command.get_program().display()
        )
    });
    let text = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    if output.status.success() { Ok(()) } else { Err(text) }
}

/// Writes one file to a new folder; returns the folder and the file's path.
fn kept(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("a temporary file");
    (folder, path)
}

/// Validates SPIR-V with spirv-val.
pub fn spirv_val(bytes: &[u8]) -> Result<(), String> {
    let (_folder, path) = kept("module.spv", bytes);
    run(Command::new("spirv-val").args(["--target-env", SPIRV_ENVIRONMENT]).arg(path))
}

/// Validates a GLSL compute shader with glslang by the rules of OpenGL (ES).
pub fn glslang(text: &[u8]) -> Result<(), String> {
    let (_folder, path) = kept("shader.glsl", text);
    run(Command::new("glslangValidator").args(["-S", "comp"]).arg(path))
}

/// Compiles a GLSL compute shader to SPIR-V words with glslang by the rules of Vulkan.
pub fn spirv_from_glsl(text: &[u8]) -> Result<Vec<u32>, String> {
    let (folder, path) = kept("shader.glsl", text);
    let out = folder.path().join("shader.spv");
    let mut command = Command::new("glslangValidator");
    command.args(["-S", "comp", "-V", "--target-env", SPIRV_ENVIRONMENT, "-o"]).arg(&out).arg(path);
    run(&mut command).map(|()| words(&out))
}

/// Compiles one entry point to SPIR-V words with glslang's HLSL front end; registers become bindings of the same
/// number.
pub fn spirv_from_hlsl(text: &[u8], entry: &str) -> Result<Vec<u32>, String> {
    let text = for_glslang(std::str::from_utf8(text).expect("HLSL is text"));
    let (folder, path) = kept("shader.hlsl", text.as_bytes());
    let out = folder.path().join("shader.spv");
    let mut command = Command::new("glslangValidator");
    command.args(["-S", "comp", "-D", "-V", "-e", entry, "--target-env", SPIRV_ENVIRONMENT, "-o"]).arg(&out).arg(path);
    run(&mut command).map(|()| words(&out))
}

/// Rewrites HLSL for glslang's front end, which lacks two things: arrays made of zero by a cast, `(float3[3])0`, become
/// lists, and matrices, `(float3x3)0`, lists of numbers, because glslang 12 fills them from memory that nobody has set.
fn for_glslang(text: &str) -> String {
    let mut text = text.to_string();
    for (rows, columns) in (2..=4).flat_map(|rows| (2..=4).map(move |columns| (rows, columns))) {
        let kind = format!("float{rows}x{columns}");
        text = text.replace(&format!("({kind})0"), &format!("{kind}({})", vec!["0.0"; rows * columns].join(", ")));
    }
    let mut out = String::new();
    let mut rest = text.as_str();
    while let Some(at) = rest.find("])0;") {
        let open = rest[..at].rfind('(').expect("a cast begins with a bracket");
        let (kind, count) = rest[open + 1..at].split_once('[').expect("an array type has a count");
        let count = count.parse().expect("the count is a number");
        let zeros = vec![format!("({kind})0"); count].join(", ");
        out += &format!("{}{{ {zeros} }};", &rest[..open]);
        rest = &rest[at + "])0;".len()..];
    }
    out + rest
}

/// Validates one entry point with dxc; `None` if dxc is not installed, because no package registry has it.
pub fn dxc(text: &[u8], entry: &str) -> Option<Result<(), String>> {
    Command::new("dxc").arg("--version").output().ok()?;
    let (folder, path) = kept("shader.hlsl", text);
    let out = folder.path().join("shader.dxil");
    Some(run(Command::new("dxc").args(["-T", "cs_6_0", "-E", entry, "-Fo"]).arg(out).arg(path)))
}

/// Returns the folder below the target folder in which npm has installed Dawn.
fn dawn_folder() -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("the target folder holds its tmp");
    target.join("peers").join("dawn")
}

/// Returns the command `node dawn.mjs PACKAGES`.
fn dawn() -> Command {
    let mut command = Command::new("node");
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/dawn/dawn.mjs")).arg(dawn_folder());
    command
}

/// Validates a WGSL module with Tint.
pub fn tint(text: &[u8]) -> Result<(), String> {
    let (_folder, path) = kept("module.wgsl", text);
    run(dawn().arg("check").arg(path))
}

/// Runs a WGSL module's entry point in Dawn over asset words, queries and range, as bytes; returns `count` answers of
/// 32 bytes.
///
/// # Panics
/// If Dawn refuses or finds no driver.
pub fn run_in_dawn(wgsl: &[u8], entry: &str, inputs: [&[u8]; 3], count: usize) -> Vec<u8> {
    let (folder, path) = kept("module.wgsl", wgsl);
    let file = |name: &str| folder.path().join(name);
    for (name, bytes) in ["words", "queries", "range"].iter().zip(inputs) {
        std::fs::write(file(name), bytes).expect("a temporary file");
    }
    let mut command = dawn();
    command.envs(super::gpu::QUICK_COMPILER);
    command.arg("run").arg(path).arg(entry).args(["words", "queries", "range", "answers"].map(file));
    run(command.arg(count.to_string())).unwrap_or_else(|text| panic!("Dawn did not run {entry}: {text}"));
    std::fs::read(file("answers")).expect("Dawn has written the answers")
}

fn words(path: &Path) -> Vec<u32> {
    let bytes = std::fs::read(path).expect("the compiler has written its output");
    words_from_bytes(&bytes)
}

/// Returns the words of a SPIR-V file, which is little-endian.
pub fn words_from_bytes(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}
