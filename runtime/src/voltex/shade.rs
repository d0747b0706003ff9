//! Light that the flakes of a voxel send to the eye, in closed form. Twin: `shaders/voltex_shade.wgsl`.

use super::matrix::Sym3;
use super::volume::{HOTSPOT_DEG, LevelShadow};

/// For light from `l`, seen from `v` (unit vectors away from the flakes): sums over the flakes of `a |n.v| |n.l|` where both
/// are on one side of the flake, and where they are on two.
///
/// Exact for one flake and for flakes in all directions: for normals of which `n.v` and `n.l` are Gaussian the mean of
/// `|n.v| |n.l|` is `2/pi (sqrt(ab - c^2) + c asin(c / sqrt(ab)))`; the sum of `(n.v)(n.l)` is always exact.
/// Twin: `voltex_shade`.
pub fn shade(moment: &Sym3, v: [f32; 3], l: [f32; 3]) -> [f32; 2] {
    let (a, b, c) = (moment.form(v, v), moment.form(l, l), moment.form(v, l));
    let root = (a * b).max(0.0).sqrt();
    let r = (c / root.max(1e-30)).clamp(-1.0, 1.0);
    let both = std::f32::consts::FRAC_2_PI * (root * (1.0 - r * r).sqrt() + c * r.asin());
    [(0.5 * (both + c)).max(0.0), (0.5 * (both - c)).max(0.0)]
}

/// Way from where a ray enters a cell to the middle of what it sees there: of an extinction over a length, whose product is
/// `depth`. Twin: `voltex_seen_at`.
pub fn seen_at(depth: f32, length: f32) -> f32 {
    if depth < 1e-3 { 0.5 * length } else { length * (1.0 / depth - 1.0 / depth.exp_m1()) }
}

impl LevelShadow {
    /// The share c at the angle between light and eye with this cosine, linear between [`HOTSPOT_DEG`].
    /// Twin: `voltex_shared`.
    pub fn shared_at(&self, cos: f32) -> f32 {
        let degrees = cos.clamp(-1.0, 1.0).acos().to_degrees();
        let last = HOTSPOT_DEG.len() - 2;
        let i = (0..=last).rev().find(|i| degrees >= HOTSPOT_DEG[*i]).unwrap_or(0);
        let part = (degrees - HOTSPOT_DEG[i]) / (HOTSPOT_DEG[i + 1] - HOTSPOT_DEG[i]);
        self.shared[i] + (self.shared[i + 1] - self.shared[i]) * part.clamp(0.0, 1.0)
    }
}
