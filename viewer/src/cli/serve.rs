//! `btf-view serve`: pictures for another program, over standard input and output.

use super::render_arguments::RenderArguments;
use btf_viewer::{Control, Picture, PictureRequest, PictureServer, RenderParams, ViewerError};
use serde_json::json;
use std::io::{BufRead, Write};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Arguments of `btf-view serve`.
#[derive(clap::Args)]
pub(super) struct ServeArguments {
    #[command(flatten)]
    pub(super) render: RenderArguments,
}

/// Answers requests, one JSON object a line, until the input ends. Each is answered by lines of JSON: `progress` and
/// `note` while it works; at last either `error`, one sentence, or the picture's figures, whose `bytes` then follow.
///
/// # Errors
/// [`ViewerError::Usage`] when standard input or output fail. What is wrong with a request is an answer.
pub(super) fn run(arguments: &ServeArguments) -> Result<(), ViewerError> {
    let render = &arguments.render;
    let usual = RenderParams {
        size: [1, 1],
        backend: render.backend(),
        adapter: render.adapter.clone(),
        shade: render.shade(),
        volume_budget_mb: render.volume_budget,
        ..RenderParams::default()
    };
    let mut server = PictureServer::new(usual, render.packing());
    let ended =
        |error: std::io::Error| ViewerError::Usage(format!("the program that asks for pictures ended: {error}"));
    for line in std::io::stdin().lock().lines() {
        let line = line.map_err(ended)?;
        if !line.trim().is_empty() {
            answer(&mut server, &line).map_err(ended)?;
        }
    }
    Ok(())
}

/// Answers one request.
fn answer(server: &mut PictureServer, line: &str) -> std::io::Result<()> {
    // Nobody reads any more: the program that asked has ended, and so does the picture.
    let is_alone = AtomicBool::new(false);
    let tell = |told: &serde_json::Value| {
        if say(told, &[]).is_err() {
            is_alone.store(true, Ordering::Relaxed);
        }
    };
    // Rows finish on many threads.
    let last_percent = Mutex::new(0);
    let progress = |share: f32| {
        let percent = (100.0 * share) as u32;
        if let Ok(mut last) = last_percent.lock()
            && percent > *last
        {
            *last = percent;
            tell(&json!({ "progress": share }));
        }
    };
    let note = |text: &str| tell(&json!({ "note": text }));
    let control = Control { cancelled: &|| is_alone.load(Ordering::Relaxed), progress: &progress, notice: &note };
    let request: Result<PictureRequest, _> = serde_json::from_str(line);
    let drawn = match request {
        Ok(request) => server.draw(&request, &control),
        Err(error) => Err(ViewerError::Usage(format!("this is no request for a picture: {error}"))),
    };
    match drawn {
        Err(error) => say(&json!({ "error": error.to_string() }), &[]),
        Ok(rendered) => {
            let pixels = pixels_of(&rendered.picture);
            let mut told = serde_json::to_value(&rendered.report)?;
            told["bytes"] = pixels.len().into();
            say(&told, &pixels)
        }
    }
}

/// Writes a line of JSON, and bytes behind it.
fn say(told: &serde_json::Value, bytes: &[u8]) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{told}")?;
    out.write_all(bytes)?;
    out.flush()
}

/// Returns linear radiance as single-precision RGBA, little-endian, alpha 1, rows from the bottom up.
fn pixels_of(picture: &Picture) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(16 * picture.radiance.len());
    for row in picture.radiance.chunks_exact(picture.width as usize).rev() {
        for [r, g, b] in row {
            [*r, *g, *b, 1.0].iter().for_each(|value: &f32| bytes.extend(value.to_le_bytes()));
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_go_from_the_lower_left_to_the_upper_right() {
        let radiance = vec![[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.5, 0.25], [4.0, 0.0, 0.0]];
        let bytes = pixels_of(&Picture { width: 2, height: 2, radiance });
        let values: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        assert_eq!(values[..4], [3.0, 0.5, 0.25, 1.0]);
        assert_eq!([values[4], values[8], values[12]], [4.0, 1.0, 2.0]);
    }
}
