//! Frame of the HTML pages: one file each, with its style, opened without a network.

use maud::{DOCTYPE, Markup, PreEscaped, html};

/// Returns a whole page of `body`, whose style sheet is followed by `more_style`.
pub(crate) fn page(title: &str, more_style: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(more_style)) }
            }
            body { (body) }
        }
    };
    page.into_string()
}

/// The pages' style sheet.
const STYLE: &str = "
:root { color-scheme: light; }
body { font: 15px/1.5 system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif; color: #1d2327; background: #f5f6f7; margin: 0 auto; max-width: 1200px; padding: 24px; }
h1 { font-size: 30px; margin: 0; } h2 { font-size: 19px; margin: 0 0 12px; } header p { margin: 4px 0 20px; color: #5a646b; }
section { background: #fff; border: 1px solid #e2e5e8; border-radius: 8px; padding: 18px 20px; margin: 18px 0; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(125px, 1fr)); gap: 12px; }
.tile { background: #fff; border: 1px solid #e2e5e8; border-radius: 8px; padding: 12px 14px; }
.tile b { display: block; font-size: 22px; font-weight: 600; white-space: nowrap; font-variant-numeric: tabular-nums; } .tile span { color: #5a646b; font-size: 13px; display: block; }
.row { display: flex; flex-wrap: wrap; gap: 26px; align-items: flex-start; }
figure { margin: 0; } figcaption { font-size: 13px; color: #39434a; margin-bottom: 8px; max-width: 440px; min-height: 20px; }
img { image-rendering: pixelated; display: block; background: #000; }
svg { display: block; max-width: 100%; height: auto; } img + svg { margin-top: 6px; } svg + svg { margin-top: 6px; } svg text { font-size: 11.5px; fill: #1d2327; } svg text.muted { fill: #68727a; }
table { border-collapse: collapse; font-size: 14px; } td, th { text-align: left; padding: 4px 18px 4px 0; vertical-align: top; font-weight: normal; } th { color: #5a646b; }
.pictures td { padding: 0 14px 12px 0; } .pictures th { padding: 0 12px 8px 0; font-size: 13px; width: 250px; } .pictures th:first-child { width: 70px; } .pictures strong { color: #1d2327; } .pictures small { display: block; }
footer { color: #68727a; font-size: 13px; }
";

/// Returns a number in a box, with a label above and a note below.
pub(crate) fn tile(label: &str, value: &str, note: &str) -> Markup {
    html! { div.tile { span { (label) } b { (value) } span { (note) } } }
}

/// Returns decibels as text, an infinite number as a sign.
pub(crate) fn decibel_text(db: f64) -> String {
    if db.is_finite() { format!("{db:.2}") } else { "∞".into() }
}
