//! The error that ends a chore, with its exit status.

use std::fmt;

/// A sentence for the user and the exit code that goes with it.
#[derive(Debug)]
pub struct Failure {
    message: String,
    exit_code: u8,
}

impl Failure {
    /// Makes a failure of a chore that could not do its work: exit code 1.
    pub fn new(message: impl Into<String>) -> Failure {
        Failure { message: message.into(), exit_code: 1 }
    }

    /// Makes a failure with exit code 1 and no sentence, where everything has been said already.
    pub fn silent() -> Failure {
        Failure::new("")
    }

    /// Makes a failure for wrong arguments: exit code 2.
    pub fn usage(message: impl Into<String>) -> Failure {
        Failure { message: message.into(), exit_code: 2 }
    }

    /// Makes a failure of a program that the chore started: with the exit code of the program, or 1 where a signal
    /// ended it.
    pub fn of_program(message: impl Into<String>, code: Option<i32>) -> Failure {
        let exit_code = code.and_then(|code| u8::try_from(code).ok()).filter(|code| *code != 0).unwrap_or(1);
        Failure { message: message.into(), exit_code }
    }

    /// Returns the exit code of the chore, which is never 0.
    pub fn exit_code(&self) -> u8 {
        self.exit_code
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_passes_its_code_on_and_a_signal_becomes_one() {
        assert_eq!(Failure::of_program("", Some(130)).exit_code(), 130);
        assert_eq!(Failure::of_program("", None).exit_code(), 1);
        // Windows has codes beyond a byte, and a failure must never end as success.
        assert_eq!(Failure::of_program("", Some(0)).exit_code(), 1);
        assert_eq!(Failure::of_program("", Some(-1_073_741_510)).exit_code(), 1);
    }
}
