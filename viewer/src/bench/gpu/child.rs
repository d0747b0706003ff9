//! A step as a process: its rows as they come, its end, and its end by force.

use crate::bench::gpu::results::StepRecord;
use crate::error::ViewerError;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;
use web_time::Instant;

/// How often the process is looked at.
const LOOK: Duration = Duration::from_millis(20);
/// How long a process that was killed may take to go: one that hangs in its driver may never.
const FAREWELL: Duration = Duration::from_secs(5);
/// How long what a process has written may take to arrive after its end: its own children may hold the pipe.
const REST: Duration = Duration::from_secs(2);

/// Runs a step until it ends or `deadline` has passed. Whatever happens to the process is told by the record.
///
/// # Errors
/// [`ViewerError::Interrupted`] where `cancelled` says so; the process is ended first.
pub(super) fn run_child(
    name: &str,
    command: &mut Command,
    deadline: Duration,
    cancelled: &(dyn Fn() -> bool + Sync),
) -> Result<StepRecord, ViewerError> {
    let start = Instant::now();
    let record =
        |status: String, rows| StepRecord { name: name.into(), status, seconds: start.elapsed().as_secs_f64(), rows };
    let spawned = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = match spawned {
        Ok(child) => child,
        Err(error) => return Ok(record(format!("failed: the process does not start: {error}"), Vec::new())),
    };
    let (rows, messages) = (lines_of(child.stdout.take()), lines_of(child.stderr.take()));
    let end = loop {
        match child.try_wait() {
            Ok(None) if cancelled() => {
                end_by_force(&mut child);
                return Err(ViewerError::Interrupted);
            }
            Ok(None) if start.elapsed() < deadline => std::thread::sleep(LOOK),
            Ok(status) => break status,
            Err(_) => break None,
        }
    };
    if end.is_none() {
        end_by_force(&mut child);
    }
    let rows = received(&rows).iter().filter_map(|line| serde_json::from_str(line).ok()).collect();
    let status = match end {
        None => "timed out".into(),
        Some(status) if status.success() => "ok".into(),
        Some(status) => format!("failed: {}", reason(status, &received(&messages))),
    };
    Ok(record(status, rows))
}

fn end_by_force(child: &mut Child) {
    let start = Instant::now();
    // It may have ended by itself meanwhile.
    let _ = child.kill();
    while matches!(child.try_wait(), Ok(None)) && start.elapsed() < FAREWELL {
        std::thread::sleep(LOOK);
    }
}

/// Reads lines on a thread, so that a full pipe never stops the process.
fn lines_of(stream: Option<impl Read + Send + 'static>) -> Receiver<String> {
    let (sender, receiver) = channel();
    if let Some(stream) = stream {
        std::thread::spawn(move || {
            let lines = BufReader::new(stream).split(b'\n').map_while(Result::ok);
            // The receiver is gone only where nobody asks any more.
            lines
                .map(|line| String::from_utf8_lossy(&line).into_owned())
                .map_while(|line| sender.send(line).ok())
                .count()
        });
    }
    receiver
}

/// Returns the lines until the stream's end, or until none has come for a while.
fn received(lines: &Receiver<String>) -> Vec<String> {
    std::iter::from_fn(|| lines.recv_timeout(REST).ok()).collect()
}

/// Returns why a process failed, in a line: its own message, or how it ended.
fn reason(status: ExitStatus, messages: &[String]) -> String {
    let own = messages.iter().rev().find_map(|line| line.strip_prefix("error: "));
    let panicked = messages.iter().position(|line| line.contains("panicked at"));
    match (own, panicked) {
        (Some(own), _) => own.into(),
        (None, Some(at)) => messages[at..].iter().take(2).map(|line| line.trim()).collect::<Vec<_>>().join(" "),
        (None, None) => format!("the process ended by itself, {status}"),
    }
}
