//! Parts of the command line that all chores share.

use crate::failure::Failure;

/// Returns whether the user asks for a chore's own help. Arguments after `--` belong to another program.
pub fn asks_for_help(arguments: &[String]) -> bool {
    arguments.iter().take_while(|argument| *argument != "--").any(|argument| argument == "-h" || argument == "--help")
}

/// Prints `help` where the user asks for it and refuses any argument. Returns whether the chore shall run.
pub fn none(chore: &str, help: &str, arguments: &[String]) -> Result<bool, Failure> {
    if asks_for_help(arguments) {
        println!("{help}");
        return Ok(false);
    }
    match arguments.first() {
        None => Ok(true),
        Some(unknown) => Err(Failure::usage(format!("`{chore}` takes no argument, it was given '{unknown}'"))),
    }
}
