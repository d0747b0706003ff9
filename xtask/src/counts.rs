//! Numbers of tests that passed, failed and were skipped, read from the output of the test runners.

use std::fmt;
use std::ops::AddAssign;

/// Numbers of tests, printed as the last line of `cargo xtask test`. Scripts read that line.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    pub passed: usize,
    pub failed: usize,
    pub skipped: usize,
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Counts) {
        self.passed += other.passed;
        self.failed += other.failed;
        self.skipped += other.skipped;
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} passed, {} failed, {} skipped", self.passed, self.failed, self.skipped)
    }
}

impl Counts {
    /// One check that passed.
    pub const PASSED: Counts = Counts { passed: 1, failed: 0, skipped: 0 };
    /// One check that failed.
    pub const FAILED: Counts = Counts { passed: 0, failed: 1, skipped: 0 };
    /// One check that was left out on purpose.
    pub const SKIPPED: Counts = Counts { passed: 0, failed: 0, skipped: 1 };

    /// Moves tests that ended well only because they had nothing to work with from the passed to the skipped.
    pub fn with_skipped(self, count: usize) -> Counts {
        let moved = count.min(self.passed);
        Counts { passed: self.passed - moved, failed: self.failed, skipped: self.skipped + moved }
    }
}

/// Reads the end of Python's unittest: `Ran 5 tests in 1.2s`, then `OK` or `FAILED (failures=1, errors=1, skipped=1)`.
/// `None` where there is no such line.
pub fn from_unittest(output: &str) -> Option<Counts> {
    let words = output.lines().rev().find_map(|line| line.strip_prefix("Ran "))?;
    let ran: usize = words.split_whitespace().next()?.parse().ok()?;
    let outcome = output.lines().rev().find(|line| line.starts_with("OK") || line.starts_with("FAILED"))?;
    let named = |name: &str| {
        let (_, rest) = outcome.split_once(&format!("{name}="))?;
        rest.split(|c: char| !c.is_ascii_digit()).next()?.parse::<usize>().ok()
    };
    let failed = named("failures").unwrap_or(0) + named("errors").unwrap_or(0);
    let skipped = named("skipped").unwrap_or(0);
    Some(Counts { passed: ran.checked_sub(failed + skipped)?, failed, skipped })
}

/// Sums up cargo test's `test result: ok. 3 passed; 0 failed; 1 ignored; 0 measured; 2 filtered out; ...`, one line per
/// test program. Ignored and filtered tests did not run, so they are skipped. `None` where there is no such line.
pub fn from_cargo_test(output: &str) -> Option<Counts> {
    let mut sum = None;
    for line in output.lines() {
        let Some((_, rest)) = line.split_once("test result: ") else { continue };
        let Some((_, parts)) = rest.split_once(". ") else { continue };
        let counts: &mut Counts = sum.get_or_insert_default();
        for (number, what) in parts.split(';').filter_map(number_and_word) {
            match what {
                "passed" => counts.passed += number,
                "failed" => counts.failed += number,
                "ignored" | "filtered" => counts.skipped += number,
                _ => {}
            }
        }
    }
    sum
}

/// Reads nextest's `Summary [   1.234s] 10 tests run: 8 passed (1 slow), 1 failed, 1 timed out, 2 skipped`. Whatever
/// ran and did not pass has failed. `None` where there is no such line.
pub fn from_nextest(output: &str) -> Option<Counts> {
    let line = output.lines().rev().find(|line| line.trim_start().starts_with("Summary ["))?;
    let (_, parts) = line.split_once(" run: ")?;
    let mut counts = Counts::default();
    for (number, what) in without_parentheses(parts).split(',').filter_map(number_and_word) {
        match what {
            "passed" => counts.passed += number,
            "skipped" => counts.skipped += number,
            _ => counts.failed += number,
        }
    }
    Some(counts)
}

/// Returns the tests that failed as `package: test`, from nextest's lines `FAIL [   0.003s] (1/2) package test`.
/// Sorted.
pub fn nextest_failures(output: &str) -> Vec<String> {
    // What nextest prints instead of PASS: FAIL, FAIL + LEAK, TIMEOUT, ABORT, SIGSEGV, XFAIL (could not be started).
    let is_failure = |status: &str| {
        let status = status.trim();
        ["FAIL", "TIMEOUT", "ABORT", "SIG", "XFAIL"].iter().any(|word| status.starts_with(word))
    };
    let mut names: Vec<String> = Vec::new();
    for line in output.lines() {
        let Some((status, rest)) = line.split_once(" [") else { continue };
        let Some((_, rest)) = rest.split_once("] ") else { continue };
        if is_failure(status) {
            let rest = rest.trim_start();
            let rest = if rest.starts_with('(') { rest.split_once(')').map_or(rest, |(_, rest)| rest) } else { rest };
            names.push(rest.split_whitespace().collect::<Vec<_>>().join(": "));
        }
    }
    names.sort();
    names.dedup();
    names
}

/// Returns the tests that failed, from cargo test's lines `test name ... FAILED`. Sorted.
pub fn cargo_test_failures(output: &str) -> Vec<String> {
    let name_of = |line: &str| Some(line.strip_prefix("test ")?.strip_suffix(" ... FAILED")?.to_string());
    let mut names: Vec<String> = output.lines().filter_map(name_of).collect();
    names.sort();
    names.dedup();
    names
}

/// Reads `3 filtered out` as `(3, "filtered")`.
fn number_and_word(part: &str) -> Option<(usize, &str)> {
    let mut words = part.split_whitespace();
    Some((words.next()?.parse().ok()?, words.next()?))
}

/// Leaves out what stands in (parentheses).
fn without_parentheses(text: &str) -> String {
    let mut depth = 0_usize;
    let keep = |c: &char| {
        match c {
            '(' => depth += 1,
            ')' => depth = depth.saturating_sub(1),
            _ => return depth == 0,
        }
        false
    };
    text.chars().filter(keep).collect()
}

/// Reads the last lines of TAP as Node.js writes it: `# pass 3`, `# fail 0`, `# cancelled 0`, `# skipped 1`. `None` where no test ran.
pub fn from_tap(output: &str) -> Option<Counts> {
    let number = |name: &str| -> Option<usize> {
        output.lines().rev().find_map(|line| line.strip_prefix(name)?.trim().parse().ok())
    };
    let [passed, failed, skipped] = ["# pass ", "# fail ", "# skipped "].map(number);
    let failed = failed? + number("# cancelled ").unwrap_or(0);
    let counts = Counts { passed: passed?, failed, skipped: skipped? };
    (counts != Counts::default()).then_some(counts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unittest_counts_what_ran() {
        let of = |end: &str| from_unittest(&format!("noise\nRan 5 tests in 1.2s\n\n{end}\n"));
        assert_eq!(of("OK"), Some(Counts { passed: 5, failed: 0, skipped: 0 }));
        assert_eq!(of("FAILED (failures=1, errors=2, skipped=1)"), Some(Counts { passed: 1, failed: 3, skipped: 1 }));
        assert_eq!(of("OK (skipped=2)"), Some(Counts { passed: 3, failed: 0, skipped: 2 }));
        assert_eq!((of("killed"), from_unittest("Ran away\nOK")), (None, None));
    }

    const CARGO_TEST: &str = "\
running 4 tests
test kmeans::tests::finds_the_centres ... ok
test kmeans::tests::needs_a_network ... ignored
test pack::tests::round_trips ... FAILED
test result: FAILED. 2 passed; 1 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.01s

test result: ok. 5 passed; 0 failed; 0 ignored; 0 measured; 3 filtered out; finished in 0.00s";

    const NEXTEST: &str = "\
        PASS [   0.006s] (1/5) btf-fit kmeans::tests::finds_the_centres
        FAIL [   0.003s] (2/5) btf-fit pack::tests::round_trips
     TIMEOUT [  60.003s] (3/5) btf-viewer::gpu decoders_agree
     SIGSEGV [   0.003s] (4/5) btf-viewer::gpu tracers_agree
        FAIL [   0.003s] (2/5) btf-fit pack::tests::round_trips
     Summary [  60.013s] 5 tests run: 2 passed (1 slow, 1 leaky), 2 failed, 1 timed out, 3 skipped
error: test run failed";

    #[test]
    fn the_last_line_has_the_wording_that_scripts_read() {
        let counts = Counts { passed: 12, failed: 3, skipped: 1 };
        assert_eq!(counts.to_string(), "12 passed, 3 failed, 1 skipped");
    }

    #[test]
    fn cargo_test_programs_are_summed_up() {
        assert_eq!(from_cargo_test(CARGO_TEST), Some(Counts { passed: 7, failed: 1, skipped: 4 }));
        assert_eq!(cargo_test_failures(CARGO_TEST), ["pack::tests::round_trips"]);
    }

    #[test]
    fn nextest_counts_everything_that_did_not_pass_as_failed() {
        assert_eq!(from_nextest(NEXTEST), Some(Counts { passed: 2, failed: 3, skipped: 3 }));
        assert_eq!(
            nextest_failures(NEXTEST),
            ["btf-fit: pack::tests::round_trips", "btf-viewer::gpu: decoders_agree", "btf-viewer::gpu: tracers_agree"]
        );
        assert_eq!(
            from_nextest("Summary [   0.013s] 1 test run: 1 passed, 0 skipped"),
            Some(Counts { passed: 1, failed: 0, skipped: 0 })
        );
    }

    #[test]
    fn output_without_a_summary_is_not_taken_for_zero_tests() {
        assert_eq!(from_cargo_test("error: could not compile `btf-fit`"), None);
        assert_eq!(from_nextest("error: could not compile `btf-fit`"), None);
    }

    #[test]
    fn skips_are_taken_from_the_passed_ones_only() {
        let counts = Counts { passed: 3, failed: 1, skipped: 0 };
        assert_eq!(counts.with_skipped(2), Counts { passed: 1, failed: 1, skipped: 2 });
        assert_eq!(counts.with_skipped(9), Counts { passed: 0, failed: 1, skipped: 3 });
    }

    #[test]
    fn tap_is_summed_up_with_what_was_skipped_or_cancelled() {
        let output = "ok 1 - a\n# tests 6\n# pass 3\n# fail 1\n# cancelled 1\n# skipped 1\n";
        assert_eq!(from_tap(output), Some(Counts { passed: 3, failed: 2, skipped: 1 }));
        assert_eq!(from_tap("# pass 0\n# fail 0\n# cancelled 0\n# skipped 0\n"), None);
        assert_eq!(from_tap("no test"), None);
    }
}
