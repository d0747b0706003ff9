//! The catalogue of a library: one page that opens without a network, and its figures as CSV.

use crate::library::collect::{CollectedMaterial, Library, Status};
use crate::library::likeness::feature_names;
use crate::library::thumbnail::SHAPE_PIXELS;
use crate::report::page::page;
use maud::{PreEscaped, html};
use serde::Serialize;
use std::fmt::Write;

/// Materials most like one that a page lists.
const ALIKE: usize = 24;
/// Program of the page.
const SCRIPT: &str = include_str!("catalogue.js");
/// Style of the page, beside that of all pages.
const STYLE: &str = include_str!("catalogue.css");

/// A material as the page's program reads it.
#[derive(Serialize)]
struct Entry<'a> {
    name: &'a str,
    status: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    asset: Option<AssetEntry<'a>>,
}

#[derive(Serialize)]
struct AssetEntry<'a> {
    bytes: u64,
    psnr: Option<f64>,
    energy: f64,
    size: [usize; 2],
    layers: usize,
    seconds: f64,
    families: String,
    remarks: &'a [String],
    picture: &'a str,
    features: Vec<f32>,
}

/// Returns the page of `library`, named `title`.
pub fn catalogue_html(library: &Library, title: &str) -> String {
    let entries: Vec<Entry> = library.materials.iter().map(entry).collect();
    let data = serde_json::to_string(&entries).unwrap_or_default();
    // Within a script no closing tag may occur, whatever a material is called.
    let data = data.replace('<', "\\u003c");
    let body = html! {
        header {
            h1 { (title) }
            p {
                (library.materials.len()) " materials: " (library.count(Status::NAMES[0])) " fitted"
                @for other in &Status::NAMES[1..] {
                    @if library.count(other) > 0 { ", " (library.count(other)) " " (other) }
                }
            }
        }
        section.tools {
            input #find type="search" placeholder="Name or family, as in wool ggx" autofocus;
            label { "Sort by "
                select #sort {
                    @for (value, text) in [("name", "name"), ("bytes", "size"), ("psnr", "PSNR"), ("seconds", "time of the fit")] {
                        option value=(value) { (text) }
                    }
                }
            }
            label { input #descending type="checkbox"; " descending" }
            label { "Show "
                select #status {
                    option value="" { "all" }
                    @for status in Status::NAMES { option value=(status) { (status) } }
                }
            }
            span #told {}
        }
        div #materials {}
        button #more hidden { "Show more" }
        footer { "Pictures: a ball, a roll and a sheet with folds, under a lamp from the upper left and a weaker light from the right." }
        script { (PreEscaped(format!("const ALIKE = {ALIKE}, PIXELS = {SHAPE_PIXELS};\nconst MATERIALS = {data};\n{SCRIPT}"))) }
    };
    page(title, STYLE, &body)
}

/// Returns the figures of `library` as CSV: a heading, then a line for each material.
pub fn catalogue_csv(library: &Library) -> String {
    let mut text = String::from("name,status,reason,bytes,width,height,layers,psnr_db,energy_ratio,seconds,families");
    for name in feature_names() {
        let _ = write!(text, ",{}", field(&name));
    }
    text.push('\n');
    for material in &library.materials {
        let reason = reason(&material.status).unwrap_or_default();
        let _ = write!(text, "{},{},{}", field(&material.name), material.status.name(), field(reason));
        match &material.fitted {
            Some(fitted) => {
                let [width, height] = fitted.size;
                let _ = write!(text, ",{},{width},{height},{}", fitted.bytes, fitted.layers);
                let metrics = &fitted.metrics;
                let seconds = material.seconds.unwrap_or_default();
                let _ = write!(text, ",{},{},{seconds:.3}", metrics.psnr_db, metrics.energy_ratio);
                let _ = write!(text, ",{}", field(&families(material)));
                for feature in fitted.likeness.features() {
                    let _ = write!(text, ",{feature}");
                }
            }
            None => text.push_str(&",".repeat(8 + feature_names().len())),
        }
        text.push('\n');
    }
    text
}

fn entry(material: &CollectedMaterial) -> Entry<'_> {
    let asset = material.fitted.as_ref().map(|fitted| AssetEntry {
        bytes: fitted.bytes,
        psnr: Some(fitted.metrics.psnr_db).filter(|db| db.is_finite()),
        energy: fitted.metrics.energy_ratio,
        size: fitted.size,
        layers: fitted.layers,
        seconds: material.seconds.unwrap_or_default(),
        families: families(material),
        remarks: &fitted.remarks,
        picture: &fitted.thumbnail,
        features: fitted.likeness.features(),
    });
    let reason = reason(&material.status).map(str::to_string);
    Entry { name: &material.name, status: material.status.name(), reason, asset }
}

fn reason(status: &Status) -> Option<&str> {
    match status {
        Status::Failed { reason } | Status::Damaged { reason } => Some(reason),
        _ => None,
    }
}

/// Returns the lobe families of a material with their numbers, the most frequent first.
fn families(material: &CollectedMaterial) -> String {
    let mut families: Vec<_> = material.fitted.iter().flat_map(|fitted| &fitted.families).collect();
    families.sort_by(|a, b| b.1.cmp(a.1).then(a.0.cmp(b.0)));
    families.iter().map(|(name, count)| format!("{name} {count}")).collect::<Vec<_>>().join(", ")
}

/// Returns a field of a CSV line, in quotes where it needs them.
fn field(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.into() }
}
