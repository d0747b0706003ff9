//! Displacement of both faces, and pigment, specular strength and thickness of the tissue, from the veins.
//!
//! Veins are sunk into the upper face and stand out of the lower one, the blade bulges between them, and the finest
//! structure is the bumps of the epidermis. The blade is one sheet: its waves and bulges are equal on both faces with
//! opposite sign, and pigments and thickness belong to the place, not to the face. Structure that is finer than the
//! texels can carry is faded out here, so that a capture does not alias; its effect on the highlight is left to the
//! roughness.

use crate::leaf::chlorosis::{Chlorosis, LeafPlace};
use crate::leaf::species::Traits;
use crate::leaf::venation::site::VeinSite;
use crate::leaf::venation::traits::VenationTraits;
use crate::leaf::venation::vein::double_angle;
use crate::leaf::venation::veins::Venation;
use crate::surface::noise::{carried_by_texels, gradient_noise};

/// Upper bound of the distance of the surface from its mean in millimetres, for margins.
pub(crate) const RELIEF_BOUND_MM: f32 = 0.6;

/// Distance in millimetres from a great vein over which tissue without magnesium stays green, pinnate and parallel.
const GREEN_REACH_MM: [f32; 2] = [1.5, 0.30];

/// Green in the structure texture of a tertiary and of a finest vein; that of a secondary is 1.
const FINE_STRUCTURE: [f32; 2] = [0.5, 0.25];

/// Values of all appearance textures at one point of a leaf.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TextureSample {
    /// Shares of main vein, lesser veins and mesophyll; together 1.
    pub structure: [f32; 3],
    /// Factors on chlorophyll, carotenoids and brown pigment: V_a, V_c, V_b.
    pub pigment: [f32; 3],
    /// Strength of the specular lobe, V_g, 0 to 1, adaxial and abaxial.
    pub gloss: [f32; 2],
    /// Factor on the absorption for thickness, V_t.
    pub thickness: f32,
    /// Height of the adaxial and of the abaxial face, each along its own normal.
    pub height_mm: [f32; 2],
    /// Cosine and sine of twice the angle of the veins' direction.
    pub double_direction: [f32; 2],
}

/// Shares of a point that veins of each order take.
#[derive(Debug, Clone, Copy)]
pub(crate) struct VeinMasks {
    pub main: f32,
    pub secondary: f32,
    pub tertiary: f32,
    pub quaternary: f32,
    /// Nearness of the great veins, for deficiencies.
    pub near: f32,
}

/// Displacement and tissue of one leaf.
#[derive(Debug, Clone)]
pub(crate) struct Relief {
    venation: Venation,
    traits: Traits,
    chlorosis: Option<Chlorosis>,
    size_mm: f32,
    texel_mm: f32,
    seed: u32,
}

impl Relief {
    /// Returns the displacement and tissue over `venation`, for a patch of `size_mm` with texels of `texel_mm`.
    pub fn new(
        venation: Venation,
        traits: Traits,
        chlorosis: Option<Chlorosis>,
        size_mm: f32,
        texel_mm: f32,
        seed: u64,
    ) -> Relief {
        Relief { venation, traits, chlorosis, size_mm, texel_mm, seed: (seed ^ (seed >> 29)) as u32 }
    }

    /// Returns the values of all textures at a position, seen from the adaxial side.
    pub fn at(&self, position_mm: [f32; 2]) -> TextureSample {
        let site = self.venation.site(position_mm);
        let masks = self.masks(site);
        TextureSample {
            structure: structure(masks),
            height_mm: self.heights_mm(position_mm, site),
            double_direction: double_angle(site.direction),
            ..self.tissue(position_mm, masks, site.across)
        }
    }

    /// Returns pigment, specular strength and thickness at a position whose veins are given; displacement and structure
    /// are those of a bare blade. `across_mm` is the distance from the main vein.
    pub fn tissue(&self, p: [f32; 2], masks: VeinMasks, across_mm: f32) -> TextureSample {
        let t = &self.traits.tissue;
        // Towards the value on each order of vein, the finest first.
        let shares = [masks.quaternary, masks.tertiary, masks.secondary, masks.main];
        let towards = |blade: f32, targets: [f32; 4]| {
            shares.iter().zip(targets).fold(blade, |v, (m, target)| v + (target - v) * m)
        };
        let uneven = 0.16 * self.wave(p, 2.6, 200) + 0.10 * self.wave(p, 0.8, 201) + 0.10 * self.wave(p, 0.3, 202);
        let fleck = 1.0 + 0.8 * self.wave(p, 1.6, 203).max(0.0);
        let healthy = [
            towards(1.0 + t.mottle * uneven, t.chlorophyll).max(0.0),
            towards(1.0 + 0.1 * self.wave(p, 2.6, 204), t.carotenoid),
            towards(fleck, t.brown),
        ];
        let sheen = 1.0 + (0.15 * self.wave(p, 4.0, 205) + 0.10 * self.wave(p, 0.6, 206)) / 0.70;
        let gloss = towards(t.blade_gloss * sheen, t.gloss).clamp(0.0, 1.0);
        TextureSample {
            structure: [0.0, 0.0, 1.0],
            pigment: match &self.chlorosis {
                None => healthy,
                Some(chlorosis) => chlorosis.pigments(healthy, &self.place(p, masks, across_mm)),
            },
            gloss: [gloss, gloss * t.abaxial_gloss],
            thickness: towards(1.0 + 0.05 * self.wave(p, 5.0, 207), t.thickness),
            height_mm: [0.0; 2],
            double_direction: double_angle([0.0, 1.0]),
        }
    }

    /// Returns the heights of both faces where the veins are known as shares only: `main` and `secondary` after a
    /// slight blur, `near` after one as wide as the bulge of the blade.
    pub fn heights_from_masks_mm(&self, p: [f32; 2], masks: VeinMasks) -> [f32; 2] {
        let r = &self.traits.relief;
        let sheet = r.bulge_mm * (1.0 - masks.near) + self.waves_mm(p);
        let veins = |depth: [f32; 4]| depth[0] * masks.main + depth[1] * masks.secondary * (1.0 - masks.main);
        [
            sheet - veins(r.groove_mm) + self.bumps_mm(p, 102, 1.0),
            veins(r.ridge_mm) - sheet + self.bumps_mm(p, 112, r.abaxial_bumps),
        ]
    }

    /// Returns the distance to the right of the main vein.
    pub fn across_mm(&self, p: [f32; 2]) -> f32 {
        self.venation.site(p).across
    }

    /// Returns the distance over which the blade bulges between veins.
    pub fn bulge_reach_mm(&self) -> f32 {
        self.traits.relief.bulge_reach_mm
    }

    fn place(&self, p: [f32; 2], masks: VeinMasks, across_mm: f32) -> LeafPlace {
        let noise = self.wave(p, self.size_mm / 6.0, 210) + 0.5 * self.wave(p, self.size_mm / 18.0, 211);
        LeafPlace {
            up: p[1] / self.size_mm,
            across: across_mm.abs() / self.size_mm,
            near_vein: masks.near,
            noise,
            grass: matches!(self.traits.venation, VenationTraits::Parallel(_)),
        }
    }

    fn masks(&self, site: VeinSite) -> VeinMasks {
        let strength = self.traits.tissue.fine_strength;
        let widths = self.traits.relief.fine_half_widths_mm;
        let great = (site.main - site.main_half_width).min(site.secondary - site.secondary_half_width).max(0.0);
        let reach = match self.traits.venation {
            VenationTraits::Pinnate(_) => GREEN_REACH_MM[0],
            VenationTraits::Parallel(_) => GREEN_REACH_MM[1],
        };
        let tertiary = strength[0] * self.line(site.tertiary, widths[0]);
        VeinMasks {
            main: self.band(site.main, site.main_half_width),
            secondary: self.band(site.secondary, site.secondary_half_width),
            tertiary,
            quaternary: strength[1] * self.line(site.quaternary, widths[1]),
            near: (-(great / reach).powi(2)).exp().max(0.5 * tertiary),
        }
    }

    /// Returns the heights of the adaxial and of the abaxial face.
    fn heights_mm(&self, p: [f32; 2], site: VeinSite) -> [f32; 2] {
        let r = &self.traits.relief;
        let taper = site.secondary_half_width / self.traits.venation.secondary_half_width_mm();
        let nearest = rounded_min(site.main - site.main_half_width, site.secondary, r.axil_mm).max(0.0);
        let rise = |distance: f32, reach: f32| 1.0 - (-(distance / reach).powi(2)).exp();
        // How much of a groove or ridge of each order is here; on the veins themselves there is no network.
        let blade = rise(nearest, 0.3);
        let main = (-(site.main / (r.groove_widths[0] * site.main_half_width)).powi(2)).exp();
        let secondary = taper * self.line(site.secondary, r.groove_widths[1] * site.secondary_half_width);
        let tertiary = blade * self.line(site.tertiary, r.fine_half_widths_mm[0]);
        let quaternary = blade * self.line(site.quaternary, r.fine_half_widths_mm[1]);
        let veins =
            |depth: [f32; 4]| depth[0] * main + depth[1] * secondary + depth[2] * tertiary + depth[3] * quaternary;
        let bulge = r.bulge_mm * rise(nearest, r.bulge_reach_mm);
        let areole = blade * r.areole_bulge_mm * rise(site.tertiary, r.areole_reach_mm);
        let sheet = bulge + areole + self.waves_mm(p);
        [
            sheet - veins(r.groove_mm) + self.bumps_mm(p, 102, 1.0),
            veins(r.ridge_mm) - sheet + self.bumps_mm(p, 112, r.abaxial_bumps),
        ]
    }

    /// Returns the height of the slow waves of the whole sheet.
    fn waves_mm(&self, p: [f32; 2]) -> f32 {
        let waves = self.traits.relief.waves_mm.iter().enumerate();
        waves.map(|(i, (wavelength, amplitude))| amplitude * self.wave(p, *wavelength, 100 + i as u32)).sum()
    }

    /// Returns the height of the bumps of the epidermis of one face.
    fn bumps_mm(&self, p: [f32; 2], stream: u32, gain: f32) -> f32 {
        let bumps = self.traits.relief.bumps_mm.iter().enumerate();
        bumps.map(|(i, (wavelength, amplitude))| gain * amplitude * self.wave(p, *wavelength, stream + i as u32)).sum()
    }

    /// Returns a bell curve across a fine line, 1 in its middle. A line thinner than a texel is widened and weakened
    /// alike.
    fn line(&self, distance: f32, half_width: f32) -> f32 {
        let wide = half_width.max(0.7 * self.texel_mm);
        half_width / wide * (-(distance / wide).powi(2)).exp()
    }

    /// Returns 1 inside a vein and 0 outside, with an edge of a third of its width but never below a texel.
    fn band(&self, distance: f32, half_width: f32) -> f32 {
        let edge = (0.6 * half_width).max(self.texel_mm);
        let t = ((half_width + 0.5 * edge - distance) / edge).clamp(0.0, 1.0);
        (half_width / edge * 2.0).min(1.0) * t * t * (3.0 - 2.0 * t)
    }

    /// Returns noise of one wavelength, faded out where texels cannot carry it.
    fn wave(&self, p: [f32; 2], wavelength_mm: f32, stream: u32) -> f32 {
        let t = carried_by_texels(wavelength_mm / self.texel_mm);
        if t == 0.0 {
            return 0.0;
        }
        let (x, y) = (p[0] / wavelength_mm, p[1] / (wavelength_mm * self.traits.relief.stretch));
        t * gradient_noise(x, y, self.seed.wrapping_mul(31).wrapping_add(stream))
    }
}

/// Returns the smaller of two numbers, with a smooth transition where they differ by less than `width`.
fn rounded_min(a: f32, b: f32, width: f32) -> f32 {
    let h = (width - (a - b).abs()).max(0.0);
    if h > 0.0 { a.min(b) - h * h / (4.0 * width) } else { a.min(b) }
}

/// Returns the colour of the structure texture: the three of the paper, with lesser veins as a part of green.
fn structure(masks: VeinMasks) -> [f32; 3] {
    let fine = (FINE_STRUCTURE[0] * masks.tertiary).max(FINE_STRUCTURE[1] * masks.quaternary);
    let lesser = masks.secondary.max(fine);
    let green = (1.0 - masks.main) * lesser;
    [masks.main, green, 1.0 - masks.main - green]
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_models::Species;

    const KINDS: [Option<Species>; 4] = [None, Some(Species::Maize), Some(Species::Soybean), Some(Species::Tree)];

    fn relief(species: Option<Species>, texel_mm: f32) -> Relief {
        let traits = Traits::of(species);
        Relief::new(Venation::new(&traits.venation, 20.0, 3.0, 1), traits, None, 20.0, texel_mm, 1)
    }

    fn positions() -> impl Iterator<Item = [f32; 2]> {
        (0..10_000).map(|i| [(i % 100) as f32 * 0.2, (i / 100) as f32 * 0.2])
    }

    #[test]
    fn the_relief_stays_within_its_bound() {
        for species in KINDS {
            let relief = relief(species, 20.0 / 256.0);
            for face in 0..2 {
                let heights: Vec<f32> = positions().map(|p| relief.at(p).height_mm[face]).collect();
                let mean = heights.iter().sum::<f32>() / heights.len() as f32;
                let worst = heights.iter().map(|h| (h - mean).abs()).fold(0.0, f32::max);
                assert!(worst < RELIEF_BOUND_MM && worst > 0.1, "{species:?} {face}: {worst}");
            }
        }
    }

    #[test]
    fn veins_are_lower_paler_glossier_and_thicker_than_the_blade_and_stand_out_below() {
        for species in KINDS {
            let relief = relief(species, 20.0 / 256.0);
            let mean = |on_vein: bool| {
                let chosen: Vec<TextureSample> = positions()
                    .filter(|&p| (relief.venation.site(p).main < 0.1) == on_vein)
                    .map(|p| relief.at(p))
                    .collect();
                assert!(chosen.len() > 20);
                let mean = |pick: fn(&TextureSample) -> f32| chosen.iter().map(pick).sum::<f32>() / chosen.len() as f32;
                [
                    mean(|s| s.height_mm[0]),
                    mean(|s| s.pigment[0]),
                    mean(|s| s.gloss[0]),
                    mean(|s| s.thickness),
                    mean(|s| s.height_mm[1]),
                    mean(|s| s.structure[0]),
                ]
            };
            let (vein, blade) = (mean(true), mean(false));
            assert!(vein[0] < blade[0] - 0.1 && vein[1] < 0.5 * blade[1], "{species:?}: {vein:?} {blade:?}");
            assert!(vein[2] > blade[2] && vein[3] > 1.2 * blade[3]);
            assert!(vein[4] > blade[4] + 0.2, "stands out on the abaxial face");
            assert!(vein[5] > 0.8 && blade[5] < 0.2);
        }
    }

    #[test]
    fn coarse_texels_carry_no_fine_bumps() {
        let rough = |texel: f32| {
            let relief = relief(None, texel);
            positions().map(|p| relief.bumps_mm(p, 102, 1.0).abs()).sum::<f32>()
        };
        assert!(rough(0.4) == 0.0 && rough(0.05) > 0.0);
    }

    #[test]
    fn the_structure_texture_adds_up_and_tells_the_orders_apart() {
        let relief = relief(Some(Species::Tree), 20.0 / 256.0);
        let mut greens = [0usize; 2];
        for p in positions() {
            let [r, g, b] = relief.at(p).structure;
            assert!((r + g + b - 1.0).abs() < 1e-5 && r.min(g).min(b) >= -1e-6);
            greens[0] += usize::from(g > 0.9);
            greens[1] += usize::from((0.25..0.6).contains(&g));
        }
        assert!(greens.iter().all(|&n| n > 100), "{greens:?}");
    }
}
