//! Starting other programs.

use crate::failure::Failure;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};

/// Returns the repository's root, which is the folder above this package.
pub fn root() -> PathBuf {
    // Cargo sets the variable when it runs the program, so a checkout that was moved is found too.
    let package =
        std::env::var_os("CARGO_MANIFEST_DIR").map_or_else(|| env!("CARGO_MANIFEST_DIR").into(), PathBuf::from);
    package.parent().map_or(package.clone(), Path::to_path_buf)
}

/// Returns the command `cargo ARGUMENTS` in the repository's root, with the cargo that started this program.
pub fn cargo(arguments: &[&str]) -> Command {
    let program = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(program);
    command.args(arguments).current_dir(root());
    command
}

/// Returns the command line as a user would type it.
pub fn line_of(command: &Command) -> String {
    let mut words = vec![
        Path::new(command.get_program()).file_stem().unwrap_or(command.get_program()).to_string_lossy().into_owned(),
    ];
    for argument in command.get_args() {
        let argument = argument.to_string_lossy();
        let is_plain =
            !argument.is_empty() && argument.chars().all(|c| c.is_alphanumeric() || "-_./=:,@+\\".contains(c));
        words.push(if is_plain { argument.into_owned() } else { format!("'{argument}'") });
    }
    words.join(" ")
}

/// Prints the command line of a program and runs it with this program's input and output.
pub fn run(command: &mut Command) -> Result<ExitStatus, Failure> {
    println!("$ {}", line_of(command));
    // Otherwise our line may come after the program's where output is piped.
    let _ = std::io::stdout().flush();
    command.status().map_err(|error| cannot_start(command, &error))
}

/// Calls [`run`] and turns anything but success into a failure with the program's exit code.
pub fn run_checked(command: &mut Command) -> Result<(), Failure> {
    let status = run(command)?;
    match status.success() {
        true => Ok(()),
        false => Err(Failure::of_program(format!("`{}` failed", line_of(command)), status.code())),
    }
}

/// Builds the three programs in a profile of cargo's. All of the workspace is chosen, and in the tests' profile one of its tests, so that
/// what they use has the features that it has in the tests, and is not compiled once more.
pub fn build_programs(profile: &str) -> Result<(), Failure> {
    let programs = ["btf-view", "btf-fit", "btf-synth"].into_iter().flat_map(|program| ["--bin", program]);
    let mut build = cargo(&["build", "--quiet", "--workspace", "--profile", profile]);
    build.args(programs);
    if profile == "dev" {
        build.args(["--test", "vectors"]);
    }
    run_checked(&mut build)
}

/// Returns the folder below the target folder that has what a profile of cargo's makes.
pub fn folder_of(profile: &str) -> &str {
    if profile == "dev" { "debug" } else { profile }
}

/// Returns the name of a program's file.
pub fn program_file(name: &str) -> String {
    format!("{name}{}", std::env::consts::EXE_SUFFIX)
}

/// Runs a program while its output is passed on line by line, and returns that output, both streams together.
pub fn run_and_read(command: &mut Command) -> Result<(ExitStatus, String), Failure> {
    println!("$ {}", line_of(command));
    let _ = std::io::stdout().flush();
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| cannot_start(command, &error))?;
    let stdout = child.stdout.take();
    let stderr = child.stderr.take();
    let (from_stdout, from_stderr) = std::thread::scope(|scope| {
        let errors = scope.spawn(move || stderr.map_or(String::new(), |stream| pass_on(stream, std::io::stderr())));
        let output = stdout.map_or(String::new(), |stream| pass_on(stream, std::io::stdout()));
        (output, errors.join().unwrap_or_default())
    });
    let status = child.wait().map_err(|error| cannot_start(command, &error))?;
    Ok((status, from_stdout + &from_stderr))
}

/// Runs a program whose messages are passed on line by line, each as `map` makes it. Standard output is not touched.
pub fn run_and_map(command: &mut Command, mut map: impl FnMut(&str) -> String) -> Result<ExitStatus, Failure> {
    println!("$ {}", line_of(command));
    let _ = std::io::stdout().flush();
    let mut child = command.stderr(Stdio::piped()).spawn().map_err(|error| cannot_start(command, &error))?;
    if let Some(messages) = child.stderr.take() {
        for line in BufReader::new(messages).lines().map_while(Result::ok) {
            eprintln!("{}", map(&line));
        }
    }
    child.wait().map_err(|error| cannot_start(command, &error))
}

/// Returns the standard output of a program that only answers a question, or `None` where the program is absent or
/// fails.
pub fn answer_of(command: &mut Command) -> Option<String> {
    let output = command.stdin(Stdio::null()).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Returns a field of /etc/os-release, in which an operating system describes itself.
pub fn os_release(name: &str) -> Option<String> {
    field(&std::fs::read_to_string("/etc/os-release").unwrap_or_default(), name)
}

fn field(release: &str, name: &str) -> Option<String> {
    release.lines().find_map(|line| Some(line.strip_prefix(name)?.strip_prefix('=')?.trim_matches('"').to_string()))
}

fn cannot_start(command: &Command, error: &std::io::Error) -> Failure {
    Failure::new(format!("`{}` does not start: {error}", line_of(command)))
}

/// Copies `from` to `to` line by line and returns the whole text. A closed `to` (`| head`) does not stop the copying.
fn pass_on(from: impl Read, mut to: impl Write) -> String {
    let mut reader = BufReader::new(from);
    let mut all = String::new();
    let mut line = Vec::new();
    while matches!(reader.read_until(b'\n', &mut line), Ok(length) if length > 0) {
        let _ = to.write_all(&line);
        let _ = to.flush();
        all.push_str(&String::from_utf8_lossy(&line));
        line.clear();
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_line_is_quoted_so_that_it_can_be_typed() {
        let mut command = Command::new("some/folder/cargo");
        command.args(["nextest", "run", "-E", "not test(slow::)", ""]);
        assert_eq!(line_of(&command), "cargo nextest run -E 'not test(slow::)' ''");
    }

    #[test]
    fn output_is_read_and_the_status_kept() {
        let (status, text) = run_and_read(&mut cargo(&["--version"])).unwrap();
        assert!(status.success() && text.starts_with("cargo "), "{text}");
        let (status, text) = run_and_read(&mut cargo(&["no-such-command"])).unwrap();
        assert!(!status.success() && text.contains("no-such-command"), "{text}");
    }

    #[test]
    fn messages_are_mapped_line_by_line_and_the_status_kept() {
        let mut lines = 0;
        let status = run_and_map(&mut cargo(&["no-such-command"]), |line| {
            lines += 1;
            format!("{lines}: {line}")
        });
        assert!(!status.unwrap().success() && lines > 0);
    }

    #[test]
    fn release_files_are_read() {
        assert_eq!(field("NAME=\"Debian\"\nID=debian\nVERSION_CODENAME=bookworm\n", "ID").as_deref(), Some("debian"));
        assert_eq!(field("ID_LIKE=debian\n", "ID"), None);
    }

    #[test]
    fn a_program_that_is_not_there_is_named() {
        let failure = run_checked(&mut Command::new("btf-no-such-program")).unwrap_err();
        assert!(failure.to_string().contains("btf-no-such-program"));
        assert_eq!(answer_of(&mut Command::new("btf-no-such-program")), None);
    }
}
