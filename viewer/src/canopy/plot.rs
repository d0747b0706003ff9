//! A canopy's reflectance over the eyes' angle as a picture.

use super::measure::CanopyMeasurement;
use plotters::prelude::*;

/// Bands that are drawn at most: evenly chosen of all.
const MAX_LINES: usize = 8;

/// Draws the reflectance factor of the first light in the eyes' first plane over their angle, one line a band, as SVG.
///
/// # Errors
/// A sentence, where nothing was measured towards two eyes or more.
pub fn canopy_svg(told: &CanopyMeasurement) -> Result<String, String> {
    let none = "there is nothing to plot: give two angles of eyes or more";
    let light = told.light.first().ok_or(none)?;
    let azimuth_deg = light.views.first().ok_or(none)?.azimuth_deg;
    let views: Vec<_> = light.views.iter().filter(|view| view.azimuth_deg == azimuth_deg).collect();
    let angles = views.iter().map(|view| view.zenith_deg);
    let (least, most) = angles.fold((f64::MAX, f64::MIN), |(least, most), deg| (least.min(deg), most.max(deg)));
    if most <= least {
        return Err(none.into());
    }
    let bands = told.wavelengths_nm.len();
    let lines = bands.min(MAX_LINES);
    let chosen: Vec<usize> = (0..lines).map(|i| i * (bands - 1) / (lines - 1).max(1)).collect();
    let value = |view: usize, band: usize| views[view].reflectance_factor.value[band];
    let top = (0..views.len()).flat_map(|view| chosen.iter().map(move |band| (view, *band)));
    let top = top.map(|(view, band)| value(view, band)).fold(1e-3, f64::max) * 1.1;
    let mut svg = String::new();
    let drawn = (|| -> Result<(), Box<dyn std::error::Error>> {
        let area = SVGBackend::with_string(&mut svg, (760, 480)).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .margin(16)
            .x_label_area_size(44)
            .y_label_area_size(60)
            .build_cartesian_2d(least..most, 0.0..top)?;
        chart
            .configure_mesh()
            .x_desc("eye from the zenith, degrees, positive on the sun's side")
            .y_desc("reflectance factor")
            .draw()?;
        for (i, band) in chosen.iter().enumerate() {
            let colour = Palette99::pick(i).to_rgba();
            let points = (0..views.len()).map(|view| (views[view].zenith_deg, value(view, *band)));
            chart
                .draw_series(LineSeries::new(points, colour.stroke_width(2)))?
                .label(format!("{} nm", told.wavelengths_nm[*band]))
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2)));
        }
        chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK).draw()?;
        area.present()?;
        Ok(())
    })();
    drawn.map_err(|error| error.to_string())?;
    Ok(svg)
}
