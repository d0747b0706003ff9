//! A bench as a picture: time of a frame over what was varied.

use crate::bench::params::BenchKind;
use crate::bench::report::{BenchReport, BenchRow};
use plotters::prelude::*;

/// Returns what a bench varies, as a number above 0.
fn varied(kind: BenchKind, row: &BenchRow) -> f64 {
    match kind {
        BenchKind::Lights | BenchKind::Ablations => row.lights as f64,
        BenchKind::Materials => row.materials as f64,
        BenchKind::Coverage => row.coverage.max(1e-3),
        BenchKind::Resolution => f64::from(row.width) * f64::from(row.height),
        BenchKind::Triangles => row.triangles as f64,
        BenchKind::Landscapes => row.rays as f64,
        BenchKind::Trade => row.psnr_db.unwrap_or_default(),
        // One more, for the mean.
        BenchKind::Components => f64::from(row.components) + 1.0,
    }
}

fn axis(kind: BenchKind) -> &'static str {
    match kind {
        BenchKind::Lights | BenchKind::Ablations => "lights",
        BenchKind::Materials => "materials",
        BenchKind::Coverage => "share of the pixels that show an asset",
        BenchKind::Resolution => "pixels",
        BenchKind::Components => "components + 1",
        BenchKind::Triangles => "triangles",
        BenchKind::Landscapes => "rays",
        BenchKind::Trade => "PSNR against the path-traced picture, dB",
    }
}

/// Draws the report as SVG: both axes logarithmic, one line a mesh or variant.
///
/// # Errors
/// A sentence, where the report has no rows or a time of 0.
pub fn bench_svg(report: &BenchReport) -> Result<String, String> {
    let points: Vec<(&str, f64, f64)> = report
        .rows
        .iter()
        .map(|row| {
            let line = if row.variant.is_empty() { row.mesh } else { row.variant };
            (line, varied(report.bench, row), row.frame_ms)
        })
        .collect();
    if points.is_empty() || points.iter().any(|(_, x, y)| !(*x > 0.0 && *y > 0.0)) {
        return Err("there is nothing to plot: a point has no time".into());
    }
    let range = |of: fn(&(&str, f64, f64)) -> f64| {
        let (least, most) = points.iter().map(of).fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        (least / 1.2..most * 1.2).log_scale()
    };
    let mut names: Vec<&str> = points.iter().map(|(name, _, _)| *name).collect();
    names.dedup();
    names.sort_unstable();
    names.dedup();
    let mut svg = String::new();
    let drawn = (|| -> Result<(), Box<dyn std::error::Error>> {
        let root = SVGBackend::with_string(&mut svg, (640, 420)).into_drawing_area();
        root.fill(&WHITE)?;
        let title = format!("{}: {} on {}", report.bench.name(), report.backend, report.adapter);
        let mut chart = ChartBuilder::on(&root)
            .caption(title, ("sans-serif", 15))
            .margin(12)
            .x_label_area_size(40)
            .y_label_area_size(56)
            .build_cartesian_2d(range(|p| p.1), range(|p| p.2))?;
        let y_title = format!("ms a frame ({})", report.timer);
        chart.configure_mesh().x_desc(axis(report.bench)).y_desc(y_title).light_line_style(WHITE).draw()?;
        for (number, name) in names.iter().enumerate() {
            let colour = Palette99::pick(number).to_rgba();
            let line: Vec<(f64, f64)> =
                points.iter().filter(|(other, _, _)| other == name).map(|(_, x, y)| (*x, *y)).collect();
            chart
                .draw_series(LineSeries::new(line.clone(), colour.stroke_width(2)).point_size(3))?
                .label(*name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2)));
        }
        let mut style = chart.configure_series_labels();
        style.position(SeriesLabelPosition::UpperLeft).background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3));
        style.draw()?;
        root.present()?;
        Ok(())
    })();
    drawn.map_err(|error| format!("the plot cannot be drawn: {error}"))?;
    Ok(svg)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report() -> BenchReport {
        let row = |mesh, lights: usize| BenchRow {
            mesh,
            variant: "",
            interpolation: "fast",
            psnr_db: None,
            front: false,
            frame_ms: 2.0 * lights as f64,
            passes: None,
            frames: 3,
            unwaited_ms: None,
            bands: 1,
            lights,
            materials: 1,
            coverage: 0.5,
            width: 8,
            height: 8,
            components: 4,
            spmm_evaluations: 1,
            rays: 2,
            triangles: 3,
            instances: 1,
        };
        BenchReport {
            bench: BenchKind::Lights,
            adapter: "an adapter".into(),
            interface: "none".into(),
            backend: "bvh",
            timer: "wall-clock",
            assets: vec!["a".into()],
            resident_bytes: 4,
            rows: [1, 4, 16].iter().flat_map(|n| [row("cornell", *n), row("shoe", *n)]).collect(),
            leaf_modes: Vec::new(),
        }
    }

    #[test]
    fn a_plot_names_its_lines_and_axes_and_draws_them() {
        let svg = bench_svg(&report()).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        for text in ["cornell", "shoe", "lights", "ms a frame", "an adapter"] {
            assert!(svg.contains(text), "{text}");
        }
        // Planted difference: a report of one mesh has a line less.
        let mut one = report();
        one.rows.retain(|row| row.mesh == "shoe");
        assert!(bench_svg(&one).unwrap().matches("<polyline").count() < svg.matches("<polyline").count());
        let mut empty = report();
        empty.rows.clear();
        assert!(bench_svg(&empty).is_err());
    }
}
