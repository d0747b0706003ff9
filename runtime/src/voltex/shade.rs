//! Light that the flakes of a voxel send to the eye, in closed form. Twin: `shaders/voltex_shade.wgsl`.

use super::matrix::Sym3;
use super::volume::{HOTSPOT_DEG, LevelShadow};

/// Least root of a product that is divided by.
pub const LEAST_ROOT: f32 = 1e-30;
/// Optical depth below which [`seen_at`] is a series.
pub const SERIES_DEPTH: f32 = 1.0;

/// For light from `l`, seen from `v` (unit vectors away from the flakes): sums over the flakes of `a |n.v| |n.l|` where both
/// are on one side of the flake, and where they are on two.
///
/// Exact for one flake and for flakes in all directions: for normals of which `n.v` and `n.l` are Gaussian the mean of
/// `|n.v| |n.l|` is `2/pi (sqrt(ab - c^2) + c asin(c / sqrt(ab)))`; the sum of `(n.v)(n.l)` is always exact.
/// Twin: `voltex_shade`.
pub fn shade(moment: &Sym3, v: [f32; 3], l: [f32; 3]) -> [f32; 2] {
    let (a, b, c) = (moment.form(v, v), moment.form(l, l), moment.form(v, l));
    let root = (a * b).max(0.0).sqrt();
    let r = (c / root.max(LEAST_ROOT)).clamp(-1.0, 1.0);
    let both = std::f32::consts::FRAC_2_PI * (root * ((1.0 - r) * (1.0 + r)).sqrt() + c * r.asin());
    [(0.5 * (both + c)).max(0.0), (0.5 * (both - c)).max(0.0)]
}

/// Way from where a ray enters a cell to the middle of what it sees there: of an extinction over a length, whose product is
/// `depth`: `length (1 / depth - 1 / (exp(depth) - 1))`, as a series where that is a small difference. Twin: `voltex_seen_at`.
pub fn seen_at(depth: f32, length: f32) -> f32 {
    if depth >= SERIES_DEPTH {
        return length * (1.0 / depth - 1.0 / depth.exp_m1());
    }
    let d2 = depth * depth;
    length * (0.5 - depth / 12.0 * (1.0 - d2 / 60.0 * (1.0 - d2 / 42.0 * (1.0 - d2 / 40.0))))
}

impl LevelShadow {
    /// The share c at the angle between light and eye with this cosine, linear between [`HOTSPOT_DEG`].
    /// Twin: `voltex_shared_at`.
    pub fn shared_at(&self, cos: f32) -> f32 {
        let degrees = cos.clamp(-1.0, 1.0).acos().to_degrees();
        let last = HOTSPOT_DEG.len() - 2;
        let i = (0..=last).rev().find(|i| degrees >= HOTSPOT_DEG[*i]).unwrap_or(0);
        let part = (degrees - HOTSPOT_DEG[i]) / (HOTSPOT_DEG[i + 1] - HOTSPOT_DEG[i]);
        self.shared[i] + (self.shared[i + 1] - self.shared[i]) * part.clamp(0.0, 1.0)
    }
}
