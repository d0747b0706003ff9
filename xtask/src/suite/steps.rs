//! The steps of the suite: runs each, prints its counts and what it cost, and remembers what failed.

use super::runners::Tested;
use crate::counts::Counts;
use crate::failure::Failure;
use crate::shell::{self, cargo};
use std::time::Instant;

/// Counts and failures of the steps so far.
#[derive(Default)]
pub struct Suite {
    counts: Counts,
    failures: Vec<String>,
}

impl Suite {
    /// Runs a step whose work returns counts. An error is one failed check.
    pub fn step(&mut self, name: &str, work: impl FnOnce() -> Result<Counts, String>) {
        self.tests(name, || work().map(|counts| Tested { counts, failed: Vec::new() }));
    }

    /// Runs a step of tests. Every failed test is named at the end.
    pub fn tests(&mut self, name: &str, work: impl FnOnce() -> Result<Tested, String>) {
        println!("\n== {name}");
        let (start, before) = (Instant::now(), processor_seconds());
        let result = work();
        let cost = cost(start.elapsed().as_secs_f64(), before, processor_seconds());
        match result {
            Ok(Tested { counts, failed }) => {
                self.counts += counts;
                println!("== {name}: {counts} ({cost})");
                match failed.is_empty() {
                    true if counts.failed > 0 => self.failures.push(name.to_string()),
                    _ => self.failures.extend(failed.iter().map(|test| format!("{name}: {test}"))),
                }
            }
            Err(sentence) => {
                self.counts += Counts::FAILED;
                eprintln!("{sentence}");
                println!("== {name}: failed ({cost})");
                self.failures.push(format!("{name}: {}", sentence.lines().next().unwrap_or_default()));
            }
        }
    }

    /// Runs a check that returns one line that says what was found.
    pub fn check(&mut self, name: &str, work: impl FnOnce() -> Result<String, String>) {
        self.step(name, || {
            println!("{}", work()?);
            Ok(Counts::PASSED)
        });
    }

    /// Runs cargo; anything but success is a failure.
    pub fn cargo(&mut self, name: &str, arguments: &[&str], variables: &[(&str, &str)]) {
        self.step(name, || {
            let mut command = cargo(arguments);
            command.envs(variables.iter().copied());
            match shell::run(&mut command) {
                Ok(status) if status.success() => Ok(Counts::PASSED),
                Ok(_) => Err(format!("`cargo {}` failed; run it alone to see more", arguments.join(" "))),
                Err(failure) => Err(failure.to_string()),
            }
        });
    }

    /// Finds or installs a tool, unless `switch` is 1. A tool that is not there is a failure in CI, elsewhere counted
    /// as skipped. Returns whether the tool is there.
    pub fn tool(&mut self, name: &str, switch: Option<&str>, find: impl FnOnce() -> Result<String, Failure>) -> bool {
        let mut found = false;
        self.step(name, || {
            if let Some(switch) = left_out(switch) {
                return Ok(switch);
            }
            match find() {
                Ok(said) => {
                    println!("{said}");
                    found = true;
                    Ok(Counts::PASSED)
                }
                Err(failure) => absent(&failure.to_string()),
            }
        });
        found
    }

    /// Finds or installs a tool, unless `switch` is 1. A tool that is not there is a failure everywhere.
    pub fn required_tool(&mut self, name: &str, switch: Option<&str>, find: impl FnOnce() -> Result<String, Failure>) {
        self.step(name, || {
            if let Some(switch) = left_out(switch) {
                return Ok(switch);
            }
            println!("{}", find().map_err(|failure| failure.to_string())?);
            Ok(Counts::PASSED)
        });
    }

    /// Prints everything that failed, and the closing line in every case.
    pub fn finish(self) -> Result<(), Failure> {
        println!();
        for failure in &self.failures {
            eprintln!("failed: {failure}");
        }
        println!("{}", self.counts);
        match self.failures.is_empty() {
            true => Ok(()),
            false => Err(Failure::silent()),
        }
    }
}

/// Returns whether this is a run of CI, where everything must be there. `.ci/run` sets `BTF_CI`; the runners of others
/// set `CI`.
fn is_ci() -> bool {
    ["CI", "BTF_CI"].iter().any(|name| std::env::var_os(name).is_some_and(|value| !value.is_empty()))
}

/// Counts a part whose tool is not there: skipped, but in CI failed.
pub fn absent(sentence: &str) -> Result<Counts, String> {
    outcome_of_absence(sentence, is_ci())
}

fn outcome_of_absence(sentence: &str, is_ci: bool) -> Result<Counts, String> {
    if is_ci {
        return Err(sentence.to_string());
    }
    println!("skipped: {sentence}");
    Ok(Counts::SKIPPED)
}

/// Returns one skipped check where `switch` is 1.
fn left_out(switch: Option<&str>) -> Option<Counts> {
    let switch = switch.filter(|name| std::env::var_os(name).is_some_and(|value| value == "1"))?;
    println!("left out: {switch}=1");
    Some(Counts::SKIPPED)
}

/// Returns the processor time of all programs that this one has started and waited for, in seconds. `None` but on
/// Linux.
fn processor_seconds() -> Option<f64> {
    processor_seconds_of(&std::fs::read_to_string("/proc/self/stat").ok()?)
}

/// Reads fields 16 and 17 of a `stat` file, user and system time of the children, in the hundredths of a second in
/// which Linux counts for programs. The name in field 2 may have blanks, so fields are counted from behind it.
fn processor_seconds_of(stat: &str) -> Option<f64> {
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(13).map(str::parse::<f64>);
    Some((fields.next()?.ok()? + fields.next()?.ok()?) / 100.0)
}

fn cost(seconds: f64, before: Option<f64>, after: Option<f64>) -> String {
    match (before, after) {
        (Some(before), Some(after)) => format!("{seconds:.0} s, {:.0} s of processor time", after - before),
        _ => format!("{seconds:.0} s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suite_goes_on_after_a_failure_and_remembers_every_one() {
        let mut suite = Suite::default();
        let mut ran = 0;
        suite.check("first", || Err("it is broken\nin two lines".to_string()));
        let counts = Counts { passed: 3, failed: 2, skipped: 1 };
        suite.tests("second", || Ok(Tested { counts, failed: vec!["a: b".into(), "a: c".into()] }));
        suite.check("third", || {
            ran += 1;
            Ok("fine".to_string())
        });
        assert_eq!(ran, 1);
        assert_eq!(suite.counts, Counts { passed: 4, failed: 3, skipped: 1 });
        assert_eq!(suite.failures, ["first: it is broken", "second: a: b", "second: a: c"]);
        assert!(suite.finish().is_err());
    }

    #[test]
    fn what_is_absent_is_skipped_but_in_ci() {
        assert_eq!(outcome_of_absence("no valgrind", false), Ok(Counts::SKIPPED));
        assert_eq!(outcome_of_absence("no valgrind", true), Err("no valgrind".to_string()));
    }

    #[test]
    fn processor_time_is_read_behind_a_name_with_blanks() {
        let stat = "7 (a b) c) S 1 2 3 4 5 6 7 8 9 10 11 12 250 50 20 0 1";
        assert_eq!(processor_seconds_of(stat), Some(3.0));
        assert_eq!(processor_seconds_of("7 (a) S"), None);
    }
}
