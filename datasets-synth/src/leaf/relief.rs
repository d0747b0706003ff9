//! The upper face's relief and its pigment, gloss and thickness textures, from the veins.
//!
//! Veins are sunk into the upper face, the blade bulges between them, the finest structure are
//! bumps of the epidermis. Structure finer than the texels can carry is faded out here, so that a
//! capture does not alias; what it would have done to the gloss is the roughness' part.

use crate::leaf::venation::{VeinSite, Venation};
use crate::surface::noise::{carried_by_texels, gradient_noise};

/// Depth of the groove over the main vein in millimetres.
const MAIN_GROOVE_MM: f32 = 0.20;
/// Depth of the groove over a secondary vein at its start.
const SECONDARY_GROOVE_MM: f32 = 0.11;
/// Depth of the groove over a tertiary vein.
const TERTIARY_GROOVE_MM: f32 = 0.028;
/// Depth of the groove over the finest veins.
const QUATERNARY_GROOVE_MM: f32 = 0.008;
/// Half-width of the grooves over tertiary and over the finest veins.
const FINE_HALF_WIDTHS_MM: [f32; 2] = [0.075, 0.045];
/// Height of the blade between secondary veins over the blade beside them.
const BULGE_MM: f32 = 0.20;
/// Distance from a vein over which the blade rises.
const BULGE_REACH_MM: f32 = 1.1;
/// Height of the blade inside a tertiary area over its border.
const AREOLE_BULGE_MM: f32 = 0.05;
/// Distance from a tertiary vein over which it rises.
const AREOLE_REACH_MM: f32 = 0.35;
/// Wavelength and amplitude of the slow waves of the blade.
const WAVES_MM: [(f32, f32); 2] = [(9.0, 0.12), (3.6, 0.035)];
/// Wavelength and amplitude of the epidermis' bumps.
const BUMPS_MM: [(f32, f32); 3] = [(0.55, 0.010), (0.34, 0.006), (0.22, 0.0035)];

/// Greatest distance of the relief from its mean in millimetres, a safe bound for margins.
pub(crate) const RELIEF_BOUND_MM: f32 = 0.6;

/// Scales of a leaf's contents and gloss at one point: the appearance textures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TextureSample {
    /// Factor on chlorophyll, V_a.
    pub chlorophyll: f32,
    /// Factor on carotenoids, V_c.
    pub carotenoid: f32,
    /// Factor on brown pigment, V_b.
    pub brown: f32,
    /// Strength of the gloss, V_g, 0 to 1.
    pub gloss: f32,
    /// Factor on the absorption for thickness, V_t.
    pub thickness: f32,
}

/// Relief and tissue of one leaf.
#[derive(Debug, Clone)]
pub(crate) struct Relief {
    venation: Venation,
    texel_mm: f32,
    seed: u32,
}

impl Relief {
    /// The relief over `venation` for texels of `texel_mm`.
    pub fn new(venation: Venation, texel_mm: f32, seed: u64) -> Relief {
        Relief { venation, texel_mm, seed: (seed ^ (seed >> 29)) as u32 }
    }

    /// Height in millimetres and tissue at a position.
    pub fn at(&self, position_mm: [f32; 2]) -> (f32, TextureSample) {
        let site = self.venation.site(position_mm);
        (self.height_mm(position_mm, site), self.tissue(position_mm, site))
    }

    fn height_mm(&self, p: [f32; 2], site: VeinSite) -> f32 {
        let taper = site.secondary_half_width / 0.17;
        let nearest = (site.main - site.main_half_width).min(site.secondary).max(0.0);
        let rise = |distance: f32, reach: f32| 1.0 - (-(distance / reach).powi(2)).exp();
        let mut height = -MAIN_GROOVE_MM * (-(site.main / (1.3 * site.main_half_width)).powi(2)).exp();
        height -= SECONDARY_GROOVE_MM * taper * self.line(site.secondary, 1.4 * site.secondary_half_width);
        height += BULGE_MM * rise(nearest, BULGE_REACH_MM);
        // On the veins themselves there is no network.
        let blade = rise(nearest, 0.3);
        height += blade * AREOLE_BULGE_MM * rise(site.tertiary, AREOLE_REACH_MM);
        height -= blade * TERTIARY_GROOVE_MM * self.line(site.tertiary, FINE_HALF_WIDTHS_MM[0]);
        height -= blade * QUATERNARY_GROOVE_MM * self.line(site.quaternary, FINE_HALF_WIDTHS_MM[1]);
        for (i, (wavelength, amplitude)) in WAVES_MM.into_iter().chain(BUMPS_MM).enumerate() {
            height += amplitude * self.wave(p, wavelength, 100 + i as u32);
        }
        height
    }

    fn tissue(&self, p: [f32; 2], site: VeinSite) -> TextureSample {
        let main = self.band(site.main, site.main_half_width);
        let secondary = self.band(site.secondary, site.secondary_half_width);
        let tertiary = 0.8 * self.line(site.tertiary, FINE_HALF_WIDTHS_MM[0]);
        let quaternary = 0.6 * self.line(site.quaternary, FINE_HALF_WIDTHS_MM[1]);
        // Towards the value on each order of vein, the finest first.
        let towards = |blade: f32, targets: [f32; 4]| {
            [quaternary, tertiary, secondary, main].iter().zip(targets).fold(blade, |v, (m, t)| v + (t - v) * m)
        };
        let mottle =
            1.0 + 0.16 * self.wave(p, 2.6, 200) + 0.10 * self.wave(p, 0.8, 201) + 0.10 * self.wave(p, 0.3, 202);
        let fleck = 1.0 + 0.8 * self.wave(p, 1.6, 203).max(0.0);
        TextureSample {
            chlorophyll: towards(mottle, [0.82, 0.62, 0.38, 0.26]).max(0.0),
            carotenoid: towards(1.0 + 0.1 * self.wave(p, 2.6, 204), [1.0, 1.05, 1.2, 1.3]),
            brown: towards(fleck, [1.0, 1.1, 1.6, 2.0]),
            gloss: towards(
                0.70 + 0.15 * self.wave(p, 4.0, 205) + 0.10 * self.wave(p, 0.6, 206),
                [0.70, 0.72, 0.85, 0.95],
            )
            .clamp(0.0, 1.0),
            thickness: towards(1.0 + 0.05 * self.wave(p, 5.0, 207), [1.02, 1.06, 1.25, 1.5]),
        }
    }

    /// A bell across a fine line, 1 in its middle; a line thinner than a texel is widened and
    /// weakened alike.
    fn line(&self, distance: f32, half_width: f32) -> f32 {
        let wide = half_width.max(0.7 * self.texel_mm);
        half_width / wide * (-(distance / wide).powi(2)).exp()
    }

    /// 1 inside a vein, 0 outside, with an edge of a third of its width but never below a texel.
    fn band(&self, distance: f32, half_width: f32) -> f32 {
        let edge = (0.6 * half_width).max(self.texel_mm);
        let t = ((half_width + 0.5 * edge - distance) / edge).clamp(0.0, 1.0);
        (half_width / edge * 2.0).min(1.0) * t * t * (3.0 - 2.0 * t)
    }

    /// Noise of one wavelength, faded out where texels cannot carry it.
    fn wave(&self, p: [f32; 2], wavelength_mm: f32, stream: u32) -> f32 {
        let t = carried_by_texels(wavelength_mm / self.texel_mm);
        if t == 0.0 {
            return 0.0;
        }
        t * gradient_noise(p[0] / wavelength_mm, p[1] / wavelength_mm, self.seed.wrapping_mul(31).wrapping_add(stream))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn relief(texel_mm: f32) -> Relief {
        Relief::new(Venation::new(20.0, 3.0, 1), texel_mm, 1)
    }

    fn positions() -> impl Iterator<Item = [f32; 2]> {
        (0..10_000).map(|i| [(i % 100) as f32 * 0.2, (i / 100) as f32 * 0.2])
    }

    #[test]
    fn the_relief_stays_within_its_bound() {
        let relief = relief(20.0 / 256.0);
        let heights: Vec<f32> = positions().map(|p| relief.at(p).0).collect();
        let mean = heights.iter().sum::<f32>() / heights.len() as f32;
        let worst = heights.iter().map(|h| (h - mean).abs()).fold(0.0, f32::max);
        assert!(worst < RELIEF_BOUND_MM && worst > 0.1, "{worst}");
    }

    #[test]
    fn veins_are_lower_paler_glossier_and_thicker_than_the_blade() {
        let relief = relief(20.0 / 256.0);
        let mean = |on_vein: bool| {
            let chosen: Vec<(f32, TextureSample)> = positions()
                .filter(|&p| (relief.venation.site(p).main < 0.1) == on_vein)
                .map(|p| relief.at(p))
                .collect();
            assert!(chosen.len() > 20);
            let mean =
                |pick: fn(&(f32, TextureSample)) -> f32| chosen.iter().map(pick).sum::<f32>() / chosen.len() as f32;
            [mean(|c| c.0), mean(|c| c.1.chlorophyll), mean(|c| c.1.gloss), mean(|c| c.1.thickness)]
        };
        let (vein, blade) = (mean(true), mean(false));
        assert!(vein[0] < blade[0] - 0.1 && vein[1] < 0.4 * blade[1]);
        assert!(vein[2] > blade[2] && vein[3] > 1.3 * blade[3]);
    }

    #[test]
    fn coarse_texels_carry_no_fine_bumps() {
        // What is left between neighbours after a second difference, at two texel sizes.
        let rough = |texel: f32| {
            let relief = relief(texel);
            let bump = |p: [f32; 2]| BUMPS_MM.map(|(w, a)| a * relief.wave(p, w, 102)).iter().sum::<f32>();
            positions().map(|p| bump(p).abs()).sum::<f32>()
        };
        assert!(rough(0.4) == 0.0 && rough(0.05) > 0.0);
    }
}
