//! Plots of measurements as self-contained SVG files: lines, goniograms, bars.

use std::f64::consts::PI;

use maud::{Markup, html};

/// Colours of series in their order, distinguishable by colour-blind readers [Okabe & Ito].
const COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#333333"];

/// Size of a plot and its margins in pixels: left, right, top, bottom.
const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 420.0;
const MARGIN: [f64; 4] = [64.0, 20.0, 40.0, 52.0];

/// Named line.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub label: String,
    /// Points in ascending x.
    pub points: Vec<(f64, f64)>,
}

/// Plot of lines over two axes.
#[derive(Debug, Clone, PartialEq)]
pub struct LinePlot {
    /// Title above the plot.
    pub title: String,
    /// Label below the horizontal axis, with the unit.
    pub x_label: String,
    /// Label beside the vertical axis, with the unit.
    pub y_label: String,
    /// Lines.
    pub series: Vec<Series>,
    /// Lines that are dashed, each in the colour of the series of its place: what the series is compared with. They have no
    /// legend.
    pub dashed: Vec<Series>,
}

/// Returns some five round numbers between `least` and `most`.
fn ticks(least: f64, most: f64) -> Vec<f64> {
    let span = (most - least).max(1e-12);
    let power = 10f64.powf((span / 5.0).log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| span / s <= 6.0).unwrap_or(10.0 * power);
    let first = (least / step - 1e-9).ceil() as i64;
    let last = (most / step + 1e-9).floor() as i64;
    (first..=last).map(|i| i as f64 * step).collect()
}

/// Formats the number of a tick without digits that the step does not have.
fn number(x: f64, step: f64) -> String {
    let decimals = (-step.log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{x:.decimals$}")
}

fn px(x: f64) -> String {
    format!("{x:.1}")
}

/// Returns the whole SVG file around `content`.
fn file(width: f64, height: f64, title: &str, content: &Markup) -> String {
    let svg = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {width} {height}")) width=(width) height=(height)
            font-family="sans-serif" font-size="13" fill="#222" {
            rect width=(width) height=(height) fill="#fff" {}
            text x=(px(width / 2.0)) y="24" text-anchor="middle" font-size="15" { (title) }
            (content)
        }
    };
    format!("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n{}\n", svg.into_string())
}

/// Frame of a plot: where data lie in the picture.
struct Frame {
    x: [f64; 2],
    y: [f64; 2],
}

impl Frame {
    fn place(&self, x: f64, y: f64) -> (f64, f64) {
        let [left, right, top, bottom] = MARGIN;
        let t = (x - self.x[0]) / (self.x[1] - self.x[0]);
        let u = (y - self.y[0]) / (self.y[1] - self.y[0]);
        (left + t * (WIDTH - left - right), HEIGHT - bottom - u * (HEIGHT - top - bottom))
    }

    fn axes(&self, x_label: &str, y_label: &str, y_ticks: &[f64]) -> Markup {
        let x_ticks = ticks(self.x[0], self.x[1]);
        let step = |t: &[f64]| if t.len() > 1 { t[1] - t[0] } else { 1.0 };
        let (low, high) = (self.place(self.x[0], self.y[0]), self.place(self.x[1], self.y[1]));
        html! {
            @for &x in &x_ticks {
                @let (px_x, _) = self.place(x, self.y[0]);
                line x1=(px(px_x)) x2=(px(px_x)) y1=(px(low.1)) y2=(px(high.1)) stroke="#e4e4e4" {}
                text x=(px(px_x)) y=(px(low.1 + 18.0)) text-anchor="middle" { (number(x, step(&x_ticks))) }
            }
            @for &y in y_ticks {
                @let (_, px_y) = self.place(self.x[0], y);
                line x1=(px(low.0)) x2=(px(high.0)) y1=(px(px_y)) y2=(px(px_y)) stroke="#e4e4e4" {}
                text x=(px(low.0 - 8.0)) y=(px(px_y + 4.0)) text-anchor="end" { (number(y, step(y_ticks))) }
            }
            line x1=(px(low.0)) x2=(px(high.0)) y1=(px(low.1)) y2=(px(low.1)) stroke="#222" {}
            line x1=(px(low.0)) x2=(px(low.0)) y1=(px(low.1)) y2=(px(high.1)) stroke="#222" {}
            text x=(px((low.0 + high.0) / 2.0)) y=(px(HEIGHT - 14.0)) text-anchor="middle" { (x_label) }
            text x="18" y=(px((low.1 + high.1) / 2.0)) text-anchor="middle"
                transform=(format!("rotate(-90 18 {:.1})", (low.1 + high.1) / 2.0)) { (y_label) }
        }
    }
}

fn legend(labels: impl Iterator<Item = String>) -> Markup {
    html! {
        @for (i, label) in labels.enumerate() {
            @let y = MARGIN[2] + 14.0 + 18.0 * i as f64;
            line x1=(px(WIDTH - 208.0)) x2=(px(WIDTH - 184.0)) y1=(px(y - 4.0)) y2=(px(y - 4.0))
                stroke=(COLOURS[i % COLOURS.len()]) stroke-width="2.5" {}
            text x=(px(WIDTH - 178.0)) y=(px(y)) stroke="#fff" stroke-width="3" paint-order="stroke" { (label) }
        }
    }
}

fn path(points: impl Iterator<Item = (f64, f64)>) -> String {
    points.enumerate().map(|(i, (x, y))| format!("{}{x:.1} {y:.1}", if i == 0 { "M" } else { "L" })).collect()
}

impl LinePlot {
    /// Returns the plot as an SVG file. The vertical axis starts at 0, or below if data do.
    pub fn svg(&self) -> String {
        let all = || self.series.iter().chain(&self.dashed);
        let points = || all().flat_map(|s| &s.points).filter(|p| p.0.is_finite() && p.1.is_finite());
        let range = |pick: fn(&(f64, f64)) -> f64| {
            points().map(pick).fold([f64::MAX, f64::MIN], |[low, high], v| [low.min(v), high.max(v)])
        };
        let widened = |[low, high]: [f64; 2]| if low < high { [low, high] } else { [low.min(0.0), high.max(1.0)] };
        let [low, high] = range(|p| p.1);
        let frame = Frame { x: widened(range(|p| p.0)), y: widened([low.min(0.0), 1.28 * high]) };
        let content = html! {
            (frame.axes(&self.x_label, &self.y_label, &ticks(frame.y[0], frame.y[1])))
            @for (lines, dashes) in [(&self.series, None), (&self.dashed, Some("6 4"))] {
                @for (i, series) in lines.iter().enumerate() {
                    @let line = series.points.iter().filter(|p| p.0.is_finite() && p.1.is_finite());
                    path d=(path(line.map(|p| frame.place(p.0, p.1)))) fill="none" stroke-width="2"
                        stroke=(COLOURS[i % COLOURS.len()]) stroke-dasharray=[dashes] {}
                }
            }
            (legend(self.series.iter().map(|s| s.label.clone())))
        };
        file(WIDTH, HEIGHT, &self.title, &content)
    }
}

/// Returns a plot in polar coordinates: `above` (BRDF) over the horizon, `below` (BTDF) under it, both as (signed angle
/// from the normal in degrees, value); series of the same index share a colour.
pub fn goniogram_svg(title: &str, unit: &str, above: &[Series], below: &[Series]) -> String {
    const SIZE: f64 = 640.0;
    const MIDDLE: (f64, f64) = (320.0, 335.0);
    const RADIUS: f64 = 250.0;
    let most = |series: &[Series]| series.iter().flat_map(|s| &s.points).map(|p| p.1).fold(1e-12, f64::max);
    let half = |series: &[Series], sign: f64| {
        let most = most(series);
        let rings = ticks(0.0, most);
        let step = if rings.len() > 1 { rings[1] - rings[0] } else { 1.0 };
        let place = |angle_deg: f64, value: f64| {
            let (sin, cos) = angle_deg.to_radians().sin_cos();
            let r = RADIUS * value / most;
            (MIDDLE.0 + r * sin, MIDDLE.1 - sign * r * cos)
        };
        html! {
            @for &ring in rings.iter().filter(|r| **r > 0.0) {
                @let arc = (0..=60).map(|i| place(-90.0 + 3.0 * f64::from(i), ring));
                path d=(path(arc)) fill="none" stroke="#dddddd" {}
                text x=(px(MIDDLE.0 + RADIUS * ring / most)) y=(px(MIDDLE.1 - sign * 8.0 + 4.0)) font-size="11"
                    text-anchor="middle" fill="#666" { (number(ring, step)) }
            }
            @for spoke in [-60.0, -30.0, 0.0, 30.0, 60.0] {
                @let end = place(spoke, most);
                line x1=(px(MIDDLE.0)) y1=(px(MIDDLE.1)) x2=(px(end.0)) y2=(px(end.1)) stroke="#eeeeee" {}
                @let label = place(spoke, 1.05 * most);
                text x=(px(label.0)) y=(px(label.1 + 4.0)) font-size="11" text-anchor="middle" fill="#666" {
                    (format!("{:.0}\u{b0}", f64::abs(spoke)))
                }
            }
            @for (i, s) in series.iter().enumerate() {
                path d=(path(s.points.iter().map(|p| place(p.0, p.1)))) fill="none" stroke-width="2"
                    stroke=(COLOURS[i % COLOURS.len()]) {}
            }
        }
    };
    let content = html! {
        (half(above, 1.0))
        (half(below, -1.0))
        line x1=(px(MIDDLE.0 - RADIUS)) x2=(px(MIDDLE.0 + RADIUS)) y1=(px(MIDDLE.1)) y2=(px(MIDDLE.1)) stroke="#222" {}
        text x="20" y="64" { "BRDF, " (unit) }
        text x="20" y=(px(SIZE - 24.0)) { "BTDF, " (unit) }
        text x=(px(SIZE - 20.0)) y=(px(SIZE - 24.0)) text-anchor="end" fill="#666" { "light from the left, forward to the right" }
        @for (i, s) in above.iter().enumerate() {
            @let y = 64.0 + 18.0 * i as f64;
            line x1="470" x2="494" y1=(px(y - 4.0)) y2=(px(y - 4.0)) stroke=(COLOURS[i % COLOURS.len()]) stroke-width="2.5" {}
            text x="500" y=(px(y)) { (s.label) }
        }
    };
    file(SIZE, SIZE, title, &content)
}

/// Returns a plot of bars over whole numbers with a logarithmic vertical axis from 1: one group per x, one bar of each
/// series.
pub fn counts_svg(title: &str, x_label: &str, y_label: &str, series: &[Series]) -> String {
    let most = series.iter().flat_map(|s| &s.points).map(|p| p.1).fold(10.0, f64::max);
    let last = series.iter().flat_map(|s| &s.points).map(|p| p.0).fold(0.0, f64::max);
    // A count of one still shows: the axis starts at a half.
    let frame = Frame { x: [-0.5, last + 0.5], y: [0.5f64.log10(), most.log10() + 0.1] };
    let width = 0.9 / series.len().max(1) as f64;
    let (low, high) = (frame.place(frame.x[0], frame.y[0]), frame.place(frame.x[1], frame.y[1]));
    let content = html! {
        (frame.axes(x_label, y_label, &[]))
        @for power in 0..=(most.log10() as i32) {
            @let (_, y) = frame.place(0.0, f64::from(power));
            line x1=(px(low.0)) x2=(px(high.0)) y1=(px(y)) y2=(px(y)) stroke="#e4e4e4" {}
            text x=(px(low.0 - 8.0)) y=(px(y + 4.0)) text-anchor="end" { (10f64.powi(power)) }
        }
        @for (i, s) in series.iter().enumerate() {
            @for &(x, y) in s.points.iter().filter(|p| p.1 >= 1.0) {
                @let from = frame.place(x - 0.45 + width * i as f64, y.log10());
                @let to = frame.place(x - 0.45 + width * (i + 1) as f64, frame.y[0]);
                rect x=(px(from.0)) y=(px(from.1)) width=(px((to.0 - from.0).max(0.6))) height=(px(to.1 - from.1))
                    fill=(COLOURS[i % COLOURS.len()]) {}
            }
        }
        (legend(series.iter().map(|s| s.label.clone())))
    };
    file(WIDTH, HEIGHT, title, &content)
}

/// Returns a plot of values over the hemisphere of directions as a disk: radius is the polar angle, brightness the
/// value.
pub fn disk_svg(title: &str, theta_edges_deg: usize, phi_count: usize, values: &[f64]) -> String {
    const SIZE: f64 = 420.0;
    const RADIUS: f64 = 170.0;
    let most = values.iter().copied().fold(1e-12, f64::max);
    let point = |ring: usize, phi: f64| {
        let r = RADIUS * ring as f64 / theta_edges_deg as f64;
        (SIZE / 2.0 + r * phi.cos(), 30.0 + SIZE / 2.0 - r * phi.sin())
    };
    let step = 2.0 * PI / phi_count as f64;
    let content = html! {
        @for ring in 0..theta_edges_deg {
            @for j in 0..phi_count {
                @let (a, b) = (j as f64 * step, (j + 1) as f64 * step);
                @let corners = [point(ring, a), point(ring + 1, a), point(ring + 1, b), point(ring, b)];
                @let shade = (255.0 * (values[ring * phi_count + j] / most).max(0.0).powf(1.0 / 2.2)).round() as u8;
                path d={ (path(corners.into_iter())) "Z" } fill=(format!("#{shade:02x}{shade:02x}{shade:02x}")) {}
            }
        }
        circle cx=(px(SIZE / 2.0)) cy=(px(30.0 + SIZE / 2.0)) r=(px(RADIUS)) fill="none" stroke="#222" {}
        text x=(px(SIZE / 2.0)) y=(px(SIZE + 22.0)) text-anchor="middle" { (format!("white: {most:.3} / sr")) }
    };
    file(SIZE, SIZE + 40.0, title, &content)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(label: &str, points: &[(f64, f64)]) -> Series {
        Series { label: label.into(), points: points.to_vec() }
    }

    #[test]
    fn ticks_are_round_few_and_inside() {
        assert!(ticks(0.0, 0.5).iter().zip([0.0, 0.1, 0.2, 0.3, 0.4, 0.5]).all(|(a, b)| (a - b).abs() < 1e-12));
        for (low, high) in [(0.0, 1.0), (400.0, 780.0), (-3.0, 2e6), (0.0, 1e-7)] {
            let ticks = ticks(low, high);
            assert!((2..=8).contains(&ticks.len()), "{ticks:?}");
            assert!(ticks.iter().all(|t| *t >= low - 1e-9 * high.abs() && *t <= high * (1.0 + 1e-9)));
        }
        assert_eq!(number(0.3, 0.1), "0.3");
        assert_eq!(number(400.0, 100.0), "400");
    }

    #[test]
    fn plots_are_files_of_their_own_with_names_escaped_and_no_nan() {
        let plot = LinePlot {
            title: "R & T".into(),
            x_label: "wavelength in nm".into(),
            y_label: "share".into(),
            series: vec![line("a <b>", &[(400.0, 0.1), (500.0, f64::NAN), (600.0, 0.3)]), line("empty", &[])],
            dashed: vec![line("measured", &[(400.0, 2.0)])],
        };
        let svg = plot.svg();
        assert!(svg.contains("stroke-dasharray") && svg.contains(">2.0<"), "{svg}");
        assert!(svg.starts_with("<?xml") && svg.contains("R &amp; T") && svg.contains("a &lt;b&gt;"));
        let s = [line("15", &[(-81.0, 0.1), (0.0, 0.2), (81.0, 0.9)])];
        for svg in [
            svg,
            goniogram_svg("g", "1/sr", &s, &s),
            counts_svg("b", "x", "y", &[line("c", &[(0.0, 3.0), (1.0, 0.0)])]),
            disk_svg("d", 2, 3, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]),
            LinePlot {
                title: String::new(),
                x_label: String::new(),
                y_label: String::new(),
                series: vec![],
                dashed: vec![],
            }
            .svg(),
        ] {
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            assert_eq!(svg.matches("<svg").count(), svg.matches("</svg>").count());
        }
    }
}
