//! A plot of a leaf's reflectance and transmittance over the visible spectrum.

use btf_runtime::{LeafMode, LeafSpectrumRow, LeafState, leaf_spectrum};
use egui::{Align2, Color32, FontId, Pos2, Rect, Sense, Stroke, pos2, vec2};

/// Wavelengths at the ends of the axis, nanometres.
const ENDS_NM: [f32; 2] = [400.0, 700.0];
/// Wavelengths that the axis names.
const TICKS_NM: [f32; 4] = [400.0, 500.0, 600.0, 700.0];
/// Where the other axis can end; the first that holds everything does.
const TOPS: [f32; 3] = [0.25, 0.5, 1.0];
/// Height of the plot in points, with its axes.
const HEIGHT: f32 = 150.0;
/// Room for the axes' numbers, left and below, points.
const MARGIN: [f32; 2] = [34.0, 32.0];
const REFLECTED: Color32 = Color32::from_rgb(110, 200, 90);
const TRANSMITTED: Color32 = Color32::from_rgb(235, 180, 60);

/// Axes of the plot of shares of light over wavelengths, and its rectangle on the screen.
struct Plot {
    area: Rect,
    top: f32,
}

impl Plot {
    fn new(area: Rect, rows: &[&[LeafSpectrumRow]]) -> Plot {
        let shares = rows.iter().copied().flatten().filter(|row| is_visible(row));
        let most = shares.map(|row| row.reflectance.max(row.transmittance)).fold(0.0, f32::max);
        Plot { area, top: TOPS.into_iter().find(|top| *top >= most).unwrap_or(1.0) }
    }

    fn place(&self, wavelength_nm: f32, share: f32) -> Pos2 {
        let x = (wavelength_nm - ENDS_NM[0]) / (ENDS_NM[1] - ENDS_NM[0]);
        let y = (share / self.top).clamp(0.0, 1.0);
        pos2(self.area.min.x + x * self.area.width(), self.area.max.y - y * self.area.height())
    }
}

fn is_visible(row: &LeafSpectrumRow) -> bool {
    (ENDS_NM[0]..=ENDS_NM[1]).contains(&row.wavelength_nm)
}

/// Draws the spectrum of a leaf without textures: curves of the N layers, or of two halves, or, where the mode is another
/// one, what that has at its three wavelengths beside N layers. Cost: two calls of [`leaf_spectrum`], some 50 microseconds.
pub(crate) fn show_spectrum(ui: &mut egui::Ui, state: &LeafState) {
    let (curve, marks) = match state.mode {
        LeafMode::NLayers | LeafMode::TwoSided => (leaf_spectrum(state), Vec::new()),
        _ => (leaf_spectrum(&LeafState { mode: LeafMode::NLayers, ..*state }), leaf_spectrum(state)),
    };
    let (response, painter) = ui.allocate_painter(vec2(ui.available_width(), HEIGHT), Sense::hover());
    let [left, below] = MARGIN;
    let all = response.rect;
    let area = Rect::from_min_max(all.min + vec2(left, 6.0), all.max - vec2(10.0, below));
    let plot = Plot::new(area, &[&curve, &marks]);
    let visuals = ui.visuals();
    let (ink, faint) = (visuals.text_color(), visuals.weak_text_color());
    let grid = Stroke::new(0.5, visuals.widgets.noninteractive.bg_stroke.color);
    let font = FontId::proportional(10.0);
    painter.rect_filled(area, 0.0, visuals.extreme_bg_color);
    for nm in TICKS_NM {
        let foot = plot.place(nm, 0.0);
        painter.vline(foot.x, area.y_range(), grid);
        painter.text(foot + vec2(0.0, 2.0), Align2::CENTER_TOP, format!("{nm:.0}"), font.clone(), ink);
    }
    for part in 0..=4 {
        let share = plot.top * part as f32 / 4.0;
        let foot = plot.place(ENDS_NM[0], share);
        painter.hline(area.x_range(), foot.y, grid);
        if part % 2 == 0 {
            let text = format!("{} %", 100.0 * share);
            painter.text(foot - vec2(3.0, 0.0), Align2::RIGHT_CENTER, text, font.clone(), ink);
        }
    }
    let foot = pos2(area.center().x, all.max.y);
    painter.text(foot, Align2::CENTER_BOTTOM, "wavelength, nm", font.clone(), ink);
    type Curve = (fn(&LeafSpectrumRow) -> f32, Color32, &'static str);
    let share_of: [Curve; 2] =
        [(|row| row.reflectance, REFLECTED, "reflectance"), (|row| row.transmittance, TRANSMITTED, "transmittance")];
    for (number, (share, colour, name)) in share_of.into_iter().enumerate() {
        let point = |row: &LeafSpectrumRow| plot.place(row.wavelength_nm, share(row));
        let line = curve.iter().filter(|row| is_visible(row)).map(point).collect();
        painter.line(line, Stroke::new(1.5, colour));
        for row in &marks {
            painter.vline(point(row).x, area.y_range(), Stroke::new(0.5, faint));
            painter.circle(point(row), 3.5, colour, Stroke::new(1.0, ink));
        }
        let at = area.min + vec2(6.0, 4.0 + 12.0 * number as f32);
        painter.text(at, Align2::LEFT_TOP, name, font.clone(), colour);
    }
    if let Some(at) = response.hover_pos().filter(|at| area.contains(*at)) {
        let nm = ENDS_NM[0] + (at.x - area.min.x) / area.width() * (ENDS_NM[1] - ENDS_NM[0]);
        if let Some(row) = nearest(&curve, nm) {
            response.on_hover_text(format!(
                "{:.0} nm: {:.1} % reflected, {:.1} % transmitted, on either face\ncurves: N layers; dots: the three wavelengths \
                 of the other modes",
                row.wavelength_nm,
                100.0 * row.reflectance,
                100.0 * row.transmittance
            ));
        }
    }
}

/// Returns the row nearest to a wavelength.
fn nearest(rows: &[LeafSpectrumRow], wavelength_nm: f32) -> Option<&LeafSpectrumRow> {
    let distance = |row: &&LeafSpectrumRow| (row.wavelength_nm - wavelength_nm).abs();
    rows.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(wavelength_nm: f32, reflectance: f32, transmittance: f32) -> LeafSpectrumRow {
        LeafSpectrumRow { wavelength_nm, reflectance, transmittance }
    }

    #[test]
    fn the_axis_holds_what_is_visible_and_no_more() {
        let area = Rect::from_min_max(pos2(30.0, 10.0), pos2(330.0, 110.0));
        let of = |rows: &[LeafSpectrumRow]| Plot::new(area, &[rows, &[]]);
        let plot = of(&[row(400.0, 0.05, 0.02), row(550.0, 0.2, 0.24), row(780.0, 0.5, 0.45)]);
        assert_eq!(plot.top, 0.25);
        assert_eq!(of(&[row(550.0, 0.2, 0.26)]).top, 0.5);
        assert_eq!(of(&[row(550.0, 0.6, 0.1)]).top, 1.0);
        assert_eq!(plot.place(400.0, 0.0), pos2(30.0, 110.0));
        assert_eq!(plot.place(700.0, 0.25), pos2(330.0, 10.0));
        assert_eq!(plot.place(550.0, 0.125), pos2(180.0, 60.0));
        // As printed the three-piece mode's shares stay within, but a plot never draws beyond its frame.
        assert_eq!(plot.place(550.0, 7.0).y, 10.0);
    }

    #[test]
    fn the_curve_reaches_both_ends_and_the_marks_are_the_three_wavelengths() {
        for mode in LeafMode::ALL {
            let rows = leaf_spectrum(&LeafState { mode, ..LeafState::default() });
            let visible: Vec<f32> = rows.iter().filter(|row| is_visible(row)).map(|row| row.wavelength_nm).collect();
            match mode {
                LeafMode::NLayers | LeafMode::TwoSided => {
                    assert_eq!((visible[0], visible[visible.len() - 1]), (400.0, 700.0))
                }
                _ => assert_eq!(visible, [675.0, 546.0, 435.0]),
            }
        }
        let rows = [row(400.0, 0.0, 0.0), row(410.0, 0.0, 0.0)];
        assert_eq!(nearest(&rows, 406.0).unwrap().wavelength_nm, 410.0);
        assert!(nearest(&[], 500.0).is_none());
    }
}
