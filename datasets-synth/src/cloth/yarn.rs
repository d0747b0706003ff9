//! Yarns in space: cylinders of elliptic section that pass over and under each other, plied,
//! twisted and uneven.

use crate::cloth::params::ClothParams;
use crate::cloth::weave::Weave;
use crate::surface::noise::{carried_by_texels, gradient_noise, lattice_unit};

/// Width of a yarn over the distance to the next one.
const COVER: f32 = 0.97;
/// Depth of the groove between plies over half a yarn's thickness.
const PLY_GROOVE: f32 = 0.42;
/// Angle of the fibres in a plied yarn over that of its plies. They are spun the other way, so that they come to lie
/// nearly along the yarn.
const PLIED_FIBRE_ANGLE: f32 = -0.35;
/// Length and width of the bundles of fibres that show as streaks, in millimetres.
const STREAK_MM: [f32; 2] = [0.55, 0.10];
/// Height of a streak over half a yarn's thickness.
const STREAK_HEIGHT: f32 = 0.10;
/// Wavelength of the fuzz in millimetres.
const FUZZ_MM: f32 = 0.16;
/// Relative loss of width of a yarn where it passes from one side of the cloth to the other, squeezed between the
/// crossing ones.
const SQUEEZE: f32 = 0.28;
/// Root mean square of the gradient noise.
const NOISE_RMS: f32 = 0.3;

/// Point of a cloth seen from above.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct YarnPoint {
    /// Height in millimetres, 0 in the middle of the cloth.
    pub height_mm: f32,
    /// Direction of the fibres seen from above, projected: its length is that of the projection of the unit tangent on
    /// a level yarn.
    pub direction: [f32; 2],
    /// 1 for warp, 0 for weft.
    pub warp: f32,
    /// Factor on the dye's optical depth.
    pub dye: f32,
    /// 1 on a yarn, 0 in a hole between yarns.
    pub cover: f32,
}

/// Yarns of a cloth.
#[derive(Debug, Clone)]
pub(crate) struct Yarns {
    weave: Weave,
    /// Distance between warp yarns and between weft yarns.
    spacing_mm: [f32; 2],
    half_thickness_mm: f32,
    twist_tan: f32,
    fibre_angle_rad: f32,
    plies: u32,
    fuzz_mm: f32,
    irregularity: f32,
    texel_mm: f32,
    seed: u32,
}

/// Set of parallel yarns: those along y or those along x.
#[derive(Clone, Copy)]
enum Set {
    Warp = 0,
    Weft = 1,
}

impl Yarns {
    pub fn new(params: &ClothParams) -> Yarns {
        let spacing_mm = [(10.0 / params.warp_per_cm) as f32, (10.0 / params.weft_per_cm) as f32];
        let twist = params.twist_deg.to_radians() as f32;
        let seed = params.capture.seed;
        Yarns {
            weave: params.weave,
            spacing_mm,
            half_thickness_mm: 0.25 * (spacing_mm[0] + spacing_mm[1]) * COVER * params.flatness as f32,
            twist_tan: twist.tan(),
            fibre_angle_rad: if params.plies > 1 { PLIED_FIBRE_ANGLE * twist } else { twist },
            plies: params.plies,
            fuzz_mm: params.fuzz_um as f32 * 1e-3,
            irregularity: params.irregularity as f32,
            texel_mm: params.capture.texel_mm(),
            seed: (seed ^ (seed >> 32)) as u32,
        }
    }

    /// Returns an upper bound of the distance of the surface from its mean in millimetres.
    pub fn bound_mm(&self) -> f32 {
        2.6 * self.half_thickness_mm + 3.0 * self.fuzz_mm
    }

    /// Returns the uppermost point of the cloth at a position in millimetres.
    pub fn at(&self, p: [f32; 2]) -> YarnPoint {
        let hole =
            YarnPoint { height_mm: -self.half_thickness_mm, direction: [0.0, 1.0], warp: 0.5, dye: 1.0, cover: 0.0 };
        let mut top = hole;
        for set in [Set::Warp, Set::Weft] {
            let nearest = (p[set as usize] / self.spacing_mm[set as usize]).round() as i32;
            // Yarns wander by less than half their distance, so the next ones suffice.
            for number in nearest - 1..=nearest + 1 {
                if let Some(point) = self.yarn_point(set, number, p).filter(|point| point.height_mm > top.height_mm) {
                    top = point;
                }
            }
        }
        top
    }

    /// Returns the top of one yarn at a position; `None` where the yarn is not there.
    fn yarn_point(&self, set: Set, number: i32, p: [f32; 2]) -> Option<YarnPoint> {
        let (across_axis, along_axis) = (set as usize, 1 - set as usize);
        let (spacing, crossing) = (self.spacing_mm[across_axis], self.spacing_mm[along_axis]);
        let along = p[along_axis];
        let stream = self.seed.wrapping_mul(31).wrapping_add(1000 * (1 + set as u32));
        // Slow noise along this yarn, a row of its own.
        let row = number as f32 * 17.31 + 0.37;
        let slow = |periods: f32, k: u32| gradient_noise(along / (periods * crossing), row, stream.wrapping_add(k));
        let centre = number as f32 * spacing + self.irregularity * 0.35 * spacing * slow(6.0, 1);
        let slub = 1.0 + self.irregularity * (0.30 * slow(5.0, 2) + 0.20 * slow(1.3, 3));
        // The middle of the yarn, from crossing to crossing.
        let position = along / crossing;
        let (before, t) = (position.floor(), position - position.floor());
        let level = |other: i32| {
            let warp_on_top = match set {
                Set::Warp => self.weave.warp_on_top(number, other),
                Set::Weft => !self.weave.warp_on_top(other, number),
            };
            if warp_on_top { 1.0f32 } else { -1.0 }
        };
        let (from, to) = (level(before as i32), level(before as i32 + 1));
        let bent = 0.5 - 0.5 * (std::f32::consts::PI * t).cos();
        let lift = from + (to - from) * bent;
        // Fibres and plies wind about the yarn as it was spun, before it was woven.
        let nominal = 0.5 * spacing * COVER;
        let half_width = nominal * slub * (1.0 - SQUEEZE * (1.0 - lift * lift));
        let q = (p[across_axis] - centre) / half_width;
        if q.abs() >= 1.0 {
            return None;
        }
        let around = q.asin();
        // A float bulges a little where nothing holds it down.
        let float = if from > 0.0 && to > 0.0 { 0.12 * (std::f32::consts::PI * t).sin() } else { 0.0 };
        let middle = self.half_thickness_mm * (lift + float);

        let grooves = self.ply_groove(number, along, around, nominal);
        let streak = self.streak(number, along, around * nominal, stream);
        let fuzz = self.fuzz_mm / NOISE_RMS
            * carried_by_texels(FUZZ_MM / self.texel_mm)
            * gradient_noise(p[0] / FUZZ_MM, p[1] / FUZZ_MM, stream.wrapping_add(9));
        let profile = around.cos() * slub.sqrt() * (1.0 - PLY_GROOVE * grooves) + STREAK_HEIGHT * streak;
        // Seen from above, fibres near the edge of the yarn turn away from the eye.
        let (sin, cos) = self.fibre_angle_rad.sin_cos();
        let mut direction = [0.0; 2];
        direction[across_axis] = sin * around.cos();
        direction[along_axis] = cos;
        let yarn_dye = 2.0 * lattice_unit(number, set as i32, self.seed.wrapping_add(77)) - 1.0;
        let dye = self.irregularity * (0.45 * yarn_dye + 0.5 * slow(2.5, 4)) + 0.6 * streak + 0.45 * grooves;
        Some(YarnPoint {
            height_mm: middle + self.half_thickness_mm * profile + fuzz,
            direction,
            warp: 1.0 - set as u32 as f32,
            dye: dye.exp(),
            cover: 1.0,
        })
    }

    /// Returns the depth of the groove between two plies, which winds around the yarn: 0 on a ply, 1 at the bottom.
    fn ply_groove(&self, number: i32, along: f32, around: f32, half_width: f32) -> f32 {
        if self.plies < 2 {
            return 0.0;
        }
        let start = std::f32::consts::TAU * lattice_unit(number, 3, self.seed.wrapping_add(78));
        let turn = around + self.twist_tan * along / half_width + start;
        let on_ply = (0.5 * self.plies as f32 * turn).cos().abs();
        (1.0 - on_ply).powi(2)
    }

    /// Returns the noise of streaks of fibre bundles, about -1 to 1, long along the fibres.
    fn streak(&self, number: i32, along: f32, around_mm: f32, stream: u32) -> f32 {
        let (sin, cos) = self.fibre_angle_rad.sin_cos();
        let (x, y) = (along * cos + around_mm * sin, around_mm * cos - along * sin);
        let shift = number as f32 * 7.77;
        let wave = |scale: f32, k: u32| {
            carried_by_texels(STREAK_MM[1] * scale / self.texel_mm)
                * gradient_noise(
                    x / (STREAK_MM[0] * scale) + shift,
                    y / (STREAK_MM[1] * scale) + shift,
                    stream.wrapping_add(k),
                )
        };
        0.9 * wave(1.0, 5) + 0.6 * wave(1.9, 6) + 0.5 * wave(0.5, 7)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn even(weave: Weave) -> Yarns {
        Yarns::new(&ClothParams { weave, plies: 1, fuzz_um: 0.0, irregularity: 0.0, ..ClothParams::default() })
    }

    #[test]
    fn the_yarn_that_the_weave_puts_on_top_is_seen_at_every_crossing() {
        for weave in [Weave::Plain, Weave::Twill, Weave::Satin] {
            let yarns = even(weave);
            for warp in 0..10 {
                for weft in 0..10 {
                    let p = [warp as f32 * yarns.spacing_mm[0], weft as f32 * yarns.spacing_mm[1]];
                    let expected = if weave.warp_on_top(warp, weft) { 1.0 } else { 0.0 };
                    assert_eq!(yarns.at(p).warp, expected, "{weave} {warp} {weft}");
                }
            }
        }
    }

    #[test]
    fn fibres_run_along_their_yarn_but_for_the_twist() {
        let yarns = even(Weave::Plain);
        let warp = yarns.at([0.0, 0.0]);
        let angle = (warp.direction[0] / warp.direction[1]).atan().to_degrees();
        assert!(warp.warp == 1.0 && (angle - 32.0).abs() < 1e-3, "{angle}");
        let weft = yarns.at([yarns.spacing_mm[0], 0.0]);
        assert!(weft.warp == 0.0 && weft.direction[0] > weft.direction[1]);
    }

    #[test]
    fn the_relief_stays_within_its_bound_and_has_few_holes() {
        for irregularity in [0.0, 1.0] {
            let params = ClothParams { irregularity, fuzz_um: 30.0, ..ClothParams::default() };
            let yarns = Yarns::new(&params);
            let points: Vec<YarnPoint> =
                (0..40_000).map(|i| yarns.at([(i % 200) as f32 * 0.05, (i / 200) as f32 * 0.05])).collect();
            let mean = points.iter().map(|p| p.height_mm).sum::<f32>() / points.len() as f32;
            let worst = points.iter().map(|p| (p.height_mm - mean).abs()).fold(0.0, f32::max);
            assert!(worst < yarns.bound_mm(), "{worst} {}", yarns.bound_mm());
            let holes = points.iter().filter(|p| p.cover == 0.0).count();
            assert!(holes < points.len() / 20, "{holes}");
            assert!(points.iter().all(|p| p.dye > 0.2 && p.dye < 5.0));
        }
    }

    #[test]
    fn plies_leave_grooves_that_wind_around_the_yarn() {
        let yarns = Yarns::new(&ClothParams { irregularity: 0.0, ..ClothParams::default() });
        let half_width = 0.5 * yarns.spacing_mm[0] * COVER;
        let deepest = |along: f32| {
            let groove = |i: i32| yarns.ply_groove(0, along, i as f32 * 0.01, half_width);
            (-150..150).max_by(|a, b| groove(*a).total_cmp(&groove(*b))).unwrap() as f32 * 0.01
        };
        let step = 0.05 * half_width;
        let moved = (deepest(step) - deepest(0.0)) / 0.05;
        assert!((moved + yarns.twist_tan).abs() < 0.25 || moved.abs() > 20.0, "{moved}");
    }
}
