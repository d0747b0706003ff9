//! Plots as SVG: bars, histograms, lines, values over the disk of directions. Coordinates are pixels of
//! the view box, y down.

use crate::measure::heatmap::{short_number, viridis};
use btf_capture::Direction;
use maud::{Markup, html};

/// Colour of bars and lines.
const ACCENT: &str = "#2a788e";

/// Returns the colour of `t` on the map viridis as `#rrggbb`.
fn colour(t: f64) -> String {
    let [r, g, b] = viridis(t as f32);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Returns a coordinate with one decimal: enough for a screen, and the page stays small.
fn px(x: f64) -> String {
    format!("{x:.1}")
}

/// Returns a chart with a horizontal bar per row: label, value, text behind the bar.
pub(crate) fn bars(rows: &[(String, f64, String)]) -> Markup {
    const LABEL: f64 = 130.0;
    const BAR: f64 = 280.0;
    const ROW: f64 = 24.0;
    let most = rows.iter().map(|row| row.1).fold(f64::MIN_POSITIVE, f64::max);
    html! {
        svg viewBox={"0 0 520 " (px(ROW * rows.len() as f64))} width="520" role="img" {
            @for (i, (label, value, text)) in rows.iter().enumerate() {
                @let y = i as f64 * ROW;
                @let length = (value / most * BAR).max(1.0);
                text x=(px(LABEL - 8.0)) y=(px(y + 16.0)) text-anchor="end" { (label) }
                rect x=(px(LABEL)) y=(px(y + 4.0)) width=(px(length)) height=(px(ROW - 8.0)) rx="2" fill=(ACCENT) {}
                text.muted x=(px(LABEL + length + 8.0)) y=(px(y + 16.0)) { (text) }
            }
        }
    }
}

/// Returns a chart with a vertical bar per bin, its label below and its share in percent above.
pub(crate) fn histogram(bins: &[(String, u64)], x_label: &str) -> Markup {
    const WIDTH: f64 = 440.0;
    const PLOT: f64 = 150.0;
    const TOP: f64 = 18.0;
    let total = bins.iter().map(|bin| bin.1).sum::<u64>().max(1) as f64;
    let most = bins.iter().map(|bin| bin.1).max().unwrap_or(0).max(1) as f64;
    let step = WIDTH / bins.len().max(1) as f64;
    html! {
        svg viewBox={"0 0 " (WIDTH) " " (TOP + PLOT + 40.0)} width=(WIDTH) role="img" {
            @for (i, (label, count)) in bins.iter().enumerate() {
                @let height = *count as f64 / most * PLOT;
                @let centre = (i as f64 + 0.5) * step;
                rect x=(px(i as f64 * step + 0.1 * step)) y=(px(TOP + PLOT - height)) width=(px(0.8 * step))
                    height=(px(height)) fill=(ACCENT) {}
                @if step >= 30.0 && *count > 0 {
                    text.muted x=(px(centre)) y=(px(TOP + PLOT - height - 4.0)) text-anchor="middle" {
                        (format!("{:.0} %", 100.0 * *count as f64 / total))
                    }
                }
                @if step >= 12.0 || i % 4 == 0 {
                    text x=(px(centre)) y=(px(TOP + PLOT + 16.0)) text-anchor="middle" { (label) }
                }
            }
            line x1="0" x2=(WIDTH) y1=(TOP + PLOT) y2=(TOP + PLOT) stroke="#999" {}
            text.muted x=(WIDTH / 2.0) y=(TOP + PLOT + 34.0) text-anchor="middle" { (x_label) }
        }
    }
}

/// Returns round numbers between `least` and `most`, about `count` of them.
fn ticks(least: f64, most: f64, count: usize) -> Vec<f64> {
    let span = (most - least).max(1e-9);
    let raw = span / count as f64;
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|step| *step >= raw).unwrap_or(raw);
    let first = (least / step).ceil() as i64;
    let last = (most / step + 1e-9).floor() as i64;
    (first..=last).map(|i| i as f64 * step).collect()
}

/// Returns the text of a tick without the rounding noise of its multiplication.
fn tick_text(tick: f64) -> String {
    format!("{}", (tick * 1e6).round() / 1e6)
}

/// Returns a plot of points joined by a line, with round numbers on the axes.
pub(crate) fn line(points: &[(f64, f64)], x_label: &str, y_label: &str) -> Markup {
    const WIDTH: f64 = 440.0;
    const HEIGHT: f64 = 240.0;
    const LEFT: f64 = 46.0;
    const BOTTOM: f64 = 40.0;
    let range = |axis: &dyn Fn(&(f64, f64)) -> f64| {
        let (least, most) =
            points.iter().map(axis).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), x| (l.min(x), m.max(x)));
        let pad = 0.06 * (most - least).max(1e-3);
        (least - pad, most + pad)
    };
    let (x0, x1) = range(&|p| p.0);
    let (y0, y1) = range(&|p| p.1);
    let x = |value: f64| LEFT + (value - x0) / (x1 - x0) * (WIDTH - LEFT - 10.0);
    let y = |value: f64| 10.0 + (y1 - value) / (y1 - y0) * (HEIGHT - BOTTOM - 10.0);
    let path: Vec<String> = points.iter().map(|p| format!("{:.1},{:.1}", x(p.0), y(p.1))).collect();
    html! {
        svg viewBox={"0 0 " (WIDTH) " " (HEIGHT)} width=(WIDTH) role="img" {
            @for tick in &ticks(x0, x1, 6) {
                line x1=(px(x(*tick))) x2=(px(x(*tick))) y1="10" y2=(HEIGHT - BOTTOM) stroke="#e4e4e4" {}
                text.muted x=(px(x(*tick))) y=(HEIGHT - BOTTOM + 15.0) text-anchor="middle" { (tick_text(*tick)) }
            }
            @for tick in &ticks(y0, y1, 5) {
                line x1=(LEFT) x2=(WIDTH - 10.0) y1=(px(y(*tick))) y2=(px(y(*tick))) stroke="#e4e4e4" {}
                text.muted x=(LEFT - 6.0) y=(px(y(*tick) + 4.0)) text-anchor="end" { (tick_text(*tick)) }
            }
            polyline points=(path.join(" ")) fill="none" stroke=(ACCENT) stroke-width="2" {}
            @for p in points {
                circle cx=(px(x(p.0))) cy=(px(y(p.1))) r="3.5" fill=(ACCENT) {}
            }
            text.muted x=((LEFT + WIDTH) / 2.0) y=(HEIGHT - 6.0) text-anchor="middle" { (x_label) }
            text.muted transform={"translate(11 " (HEIGHT / 2.0 - 10.0) ") rotate(-90)"} text-anchor="middle" { (y_label) }
        }
    }
}

/// Shape of a [`Dot`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Mark {
    Circle,
    Square,
    Triangle,
}

impl Mark {
    /// Returns the shape around a place, as wide as a circle of this radius.
    fn at(self, x: f64, y: f64, radius: f64, paint: Paint, title: Option<&str>) -> Markup {
        let Paint { fill, opacity, stroke } = paint;
        let title = html! { @if let Some(title) = title { title { (title) } } };
        let r = radius;
        match self {
            Mark::Circle => html! {
                circle cx=(px(x)) cy=(px(y)) r=(px(r)) fill=(fill) fill-opacity=(opacity) stroke=(stroke) { (title) }
            },
            Mark::Square => html! {
                rect x=(px(x - 0.9 * r)) y=(px(y - 0.9 * r)) width=(px(1.8 * r)) height=(px(1.8 * r)) fill=(fill)
                    fill-opacity=(opacity) stroke=(stroke) { (title) }
            },
            Mark::Triangle => {
                let corners = [(0.0, -1.3), (1.2, 0.9), (-1.2, 0.9)];
                let corners: Vec<String> =
                    corners.iter().map(|(dx, dy)| format!("{:.1},{:.1}", x + dx * r, y + dy * r)).collect();
                html! {
                    polygon points=(corners.join(" ")) fill=(fill) fill-opacity=(opacity) stroke=(stroke) { (title) }
                }
            }
        }
    }
}

/// Fill and edge of a shape.
struct Paint {
    fill: &'static str,
    opacity: &'static str,
    stroke: &'static str,
}

/// A point of a [`scatter`].
pub(crate) struct Dot {
    /// Horizontal place, above 0 because the axis is logarithmic.
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// Index of the group.
    pub(crate) group: usize,
    pub(crate) mark: Mark,
    /// Whether the dot is drawn large and joined with the others of its front by a line.
    pub(crate) front: bool,
    /// Text that is shown where the pointer rests on the dot.
    pub(crate) title: String,
}

/// Colours of groups: distinct in hue and in lightness.
const GROUPS: [&str; 6] = ["#440154", "#2a788e", "#5ab55a", "#d8a016", "#c2452d", "#7a7a7a"];

/// Returns a plot of dots over a logarithmic x axis, those of the front joined by a line, with a legend of the groups
/// and, where there are several, of the marks. Dots without a finite place are left out. The SVG is complete, so that
/// it can also be a file.
pub(crate) fn scatter(dots: &[Dot], groups: &[String], marks: &[(Mark, &str)], x_label: &str, y_label: &str) -> Markup {
    const WIDTH: f64 = 560.0;
    const HEIGHT: f64 = 360.0;
    const LEFT: f64 = 46.0;
    const TOP: f64 = 46.0;
    const BOTTOM: f64 = 40.0;
    // A character's width at this size of type, with room for the widest.
    const CHARACTER: f64 = 6.2;
    let mut dots: Vec<&Dot> = dots.iter().filter(|dot| dot.x > 0.0 && dot.x.is_finite() && dot.y.is_finite()).collect();
    // The front last, so that nothing hides it.
    dots.sort_by(|a, b| a.front.cmp(&b.front).then(a.x.total_cmp(&b.x)));
    let range = |axis: &dyn Fn(&Dot) -> f64, least_span: f64| {
        let (least, most) =
            dots.iter().map(|dot| axis(dot)).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), x| (l.min(x), m.max(x)));
        let (least, most) = if least <= most { (least, most) } else { (0.0, 1.0) };
        let pad = (0.04 * (most - least)).max(0.5 * (least_span - (most - least)));
        (least - pad, most + pad)
    };
    let (x0, x1) = range(&|dot| dot.x.log10(), 0.2);
    let (y0, y1) = range(&|dot| dot.y, 1.0);
    let x = |value: f64| LEFT + (value.log10() - x0) / (x1 - x0) * (WIDTH - LEFT - 10.0);
    let y = |value: f64| TOP + (y1 - value) / (y1 - y0) * (HEIGHT - BOTTOM - TOP);
    let path: Vec<String> =
        dots.iter().filter(|dot| dot.front).map(|dot| format!("{:.1},{:.1}", x(dot.x), y(dot.y))).collect();
    // Legends run from the left, each entry as long as its text.
    let places = |texts: &mut dyn Iterator<Item = usize>| -> Vec<f64> {
        let place = |at: &mut f64, length: usize| {
            let here = *at;
            *at += 28.0 + CHARACTER * length as f64;
            Some(here)
        };
        texts.scan(LEFT, place).collect()
    };
    let group_places = places(&mut groups.iter().map(String::len));
    let mark_places = places(&mut marks.iter().map(|(_, text)| text.len()));
    html! {
        svg viewBox={"0 0 " (WIDTH) " " (HEIGHT)} width=(WIDTH) role="img" font-family="sans-serif" font-size="11.5" {
            @for ((number, group), at) in groups.iter().enumerate().zip(&group_places) {
                (Mark::Circle.at(at + 5.0, 9.0, 4.0, Paint { fill: GROUPS[number % GROUPS.len()], opacity: "1", stroke: "none" }, None))
                text x=(px(at + 14.0)) y="13" { (group) }
            }
            @if marks.len() > 1 {
                @for ((mark, text), at) in marks.iter().zip(&mark_places) {
                    (mark.at(at + 5.0, 27.0, 4.0, Paint { fill: "#8a949b", opacity: "1", stroke: "none" }, None))
                    text x=(px(at + 14.0)) y="31" { (text) }
                }
            }
            @for tick in &logarithmic_ticks(x0, x1) {
                line x1=(px(x(*tick))) x2=(px(x(*tick))) y1=(TOP) y2=(HEIGHT - BOTTOM) stroke="#e4e4e4" {}
                text.muted x=(px(x(*tick))) y=(HEIGHT - BOTTOM + 15.0) text-anchor="middle" { (tick_text(*tick)) }
            }
            @for tick in &ticks(y0, y1, 6) {
                line x1=(LEFT) x2=(WIDTH - 10.0) y1=(px(y(*tick))) y2=(px(y(*tick))) stroke="#e4e4e4" {}
                text.muted x=(LEFT - 6.0) y=(px(y(*tick) + 4.0)) text-anchor="end" { (tick_text(*tick)) }
            }
            @if path.len() > 1 {
                polyline points=(path.join(" ")) fill="none" stroke="#1d2327" stroke-width="1.2" {}
            }
            @for dot in &dots {
                @let fill = GROUPS[dot.group % GROUPS.len()];
                @let paint = if dot.front {
                    Paint { fill, opacity: "1", stroke: "#fff" }
                } else {
                    Paint { fill, opacity: "0.45", stroke: "none" }
                };
                (dot.mark.at(x(dot.x), y(dot.y), if dot.front { 4.5 } else { 2.4 }, paint, Some(&dot.title)))
            }
            text.muted x=((LEFT + WIDTH) / 2.0) y=(HEIGHT - 6.0) text-anchor="middle" { (x_label) }
            text.muted transform={"translate(11 " ((TOP + HEIGHT - BOTTOM) / 2.0) ") rotate(-90)"} text-anchor="middle" { (y_label) }
        }
    }
}

/// Returns round numbers between the powers of ten `least` and `most`.
fn logarithmic_ticks(least: f64, most: f64) -> Vec<f64> {
    let steps: &[f64] = if most - least > 2.5 { &[1.0] } else { &[1.0, 2.0, 5.0] };
    let decades = least.floor() as i32..=most.ceil() as i32;
    let all = decades.flat_map(|decade| steps.iter().map(move |step| step * 10f64.powi(decade)));
    all.filter(|tick| (least..=most).contains(&tick.log10())).collect()
}

/// Returns a plot of a value per direction as a dot on the disk seen from above: radius = polar angle with rings at 30,
/// 60 and 90 degrees, phi = 0 to the right, counter-clockwise. `range` is the colour map's.
pub(crate) fn polar(directions: &[Direction], values: &[Option<f64>], range: (f64, f64)) -> Markup {
    const SIDE: f64 = 250.0;
    const RADIUS: f64 = 118.0;
    let centre = SIDE / 2.0;
    let dot = (95.0 / (directions.len() as f64).sqrt()).clamp(2.0, 10.0);
    let share = |value: f64| (value - range.0) / (range.1 - range.0).max(1e-9);
    html! {
        svg viewBox={"0 0 " (SIDE) " " (SIDE)} width=(SIDE) role="img" {
            @for theta in [30.0, 60.0, 90.0] {
                circle cx=(centre) cy=(centre) r=(px(theta / 90.0 * RADIUS)) fill="none" stroke="#ddd" {}
            }
            @for (direction, value) in directions.iter().zip(values) {
                @let theta = direction.theta_deg.min(180.0 - direction.theta_deg);
                @let (sin, cos) = direction.phi_deg.to_radians().sin_cos();
                @let (x, y) = (centre + theta / 90.0 * RADIUS * cos, centre - theta / 90.0 * RADIUS * sin);
                @let fill = value.map_or("#bbb".to_string(), |value| colour(share(value)));
                circle cx=(px(x)) cy=(px(y)) r=(px(dot)) fill=(fill) {
                    title {
                        "theta " (direction.theta_deg) "° phi " (direction.phi_deg) "°"
                        @if let Some(value) = value { ": " (format!("{value:.2}")) }
                    }
                }
            }
        }
    }
}

/// Returns the colour map as a bar with its range.
pub(crate) fn legend(range: (f64, f64), unit: &str) -> Markup {
    const STEPS: usize = 48;
    const WIDTH: f64 = 250.0;
    let step = WIDTH / STEPS as f64;
    html! {
        svg viewBox={"0 0 " (WIDTH) " 30"} width=(WIDTH) role="img" {
            @for i in 0..STEPS {
                rect x=(px(i as f64 * step)) y="0" width=(px(step + 0.5)) height="10"
                    fill=(colour(i as f64 / (STEPS - 1) as f64)) {}
            }
            text.muted x="0" y="25" { (short_number(range.0 as f32)) }
            text.muted x=(WIDTH / 2.0) y="25" text-anchor="middle" { (unit) }
            text.muted x=(WIDTH) y="25" text-anchor="end" { (short_number(range.1 as f32)) }
        }
    }
}

/// Returns the least and largest finite value; (0, 1) where there is none.
pub(crate) fn finite_range<'a>(values: impl IntoIterator<Item = &'a Option<f64>>) -> (f64, f64) {
    let range = values
        .into_iter()
        .flatten()
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| (least.min(*value), most.max(*value)));
    if range.0 <= range.1 { range } else { (0.0, 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_range() {
        assert_eq!(ticks(0.0, 10.0, 5), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        let found = ticks(31.3, 34.2, 5);
        assert!(found.len() >= 2 && found.iter().all(|t| (31.3..=34.2).contains(t)), "{found:?}");
        assert!(ticks(5.0, 5.0, 4).len() <= 1);
        let text: Vec<String> = ticks(0.0, 0.7, 4).into_iter().map(tick_text).collect();
        assert_eq!(text, ["0", "0.2", "0.4", "0.6"]);
    }

    #[test]
    fn a_light_from_the_right_stands_right_and_one_along_y_above() {
        let set = [Direction::new(45.0, 0.0), Direction::new(45.0, 90.0)];
        let text = polar(&set, &[Some(1.0), None], (0.0, 1.0)).into_string();
        assert!(text.contains(r#"cx="184.0" cy="125.0""#), "{text}");
        assert!(text.contains(r##"cx="125.0" cy="66.0" r="10.0" fill="#bbb""##), "{text}");
    }

    fn dot(x: f64, y: f64, front: bool) -> Dot {
        Dot { x, y, group: 0, mark: Mark::Circle, front, title: String::new() }
    }

    #[test]
    fn a_scatter_joins_its_front_and_nothing_else() {
        assert_eq!(logarithmic_ticks(1.0, 2.0), [10.0, 20.0, 50.0, 100.0]);
        let dots = [dot(100.0, 2.0, true), dot(10.0, 1.0, true), dot(50.0, 1.0, false)];
        let text = scatter(&dots, &["two lobes".into()], &[], "x", "y").into_string();
        assert_eq!(text.matches("<circle").count(), 4, "three dots and the legend's");
        let (_, line) = text.split_once("<polyline points=\"").unwrap();
        let line = line.split_once('"').unwrap().0;
        let corners: Vec<f64> = line.split([' ', ',']).map(|x| x.parse().unwrap()).collect();
        assert!(corners.len() == 4 && corners[0] < corners[2] && corners[1] > corners[3], "{line}");
    }

    #[test]
    fn plots_hold_no_number_that_is_not_finite() {
        for markup in [
            line(&[(1.0, 2.0)], "x", "y"),
            scatter(&[], &[], &[], "x", "y"),
            scatter(&[dot(0.0, 1.0, true), dot(3.0, f64::INFINITY, true), dot(2.0, 5.0, false)], &[], &[], "x", "y"),
            bars(&[("none".into(), 0.0, "0".into())]),
            histogram(&[], "x"),
            legend(finite_range(&[None, Some(f64::INFINITY)]), "dB"),
        ] {
            let text = markup.into_string();
            assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
        }
    }
}
