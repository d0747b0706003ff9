//! Grain of a hide: pebbles between creases, finer cells on them, wrinkles, pores.

use crate::leather::params::LeatherParams;
use crate::surface::noise::{carried_by_texels, cell, gradient_noise};

/// Distance from a crease over which a pebble rises, over the size of a pebble.
const PEBBLE_REACH: f32 = 0.27;
/// Size of the finer cells over that of the pebbles, and their height over that of the pebbles.
const FINE_CELLS: [f32; 2] = [0.31, 0.22];
/// Displacement of pebbles in the plane by noise, over their size.
const PUSH: f32 = 0.42;
/// Size of the wrinkles in millimetres and their height at strength 1.
const WRINKLES_MM: [(f32, f32); 3] = [(0.48, 0.012), (0.27, 0.009), (0.17, 0.005)];
/// Distance between hair follicles, their radius and their depth in millimetres.
const FOLLICLE_SPACING_MM: f32 = 0.62;
const FOLLICLE_RADIUS_MM: f32 = 0.09;
const FOLLICLE_DEPTH_MM: f32 = 0.06;
/// Height of the slow waves of the hide over that of the pebbles, and their wavelength in pebbles.
const WAVES: [(f32, f32); 2] = [(0.35, 3.1), (0.5, 9.0)];

/// Grain of a leather at one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GrainPoint {
    /// Height in millimetres.
    pub height_mm: f32,
    /// Factor on the optical depth of the pigment.
    pub pigment: f32,
    /// Share of whole finish, 0 to 1.
    pub finish: f32,
}

/// Grain of one leather.
#[derive(Debug, Clone)]
pub(crate) struct Grain {
    size_mm: f32,
    relief_mm: f32,
    wrinkles: f32,
    pores: f32,
    antique: f32,
    texel_mm: f32,
    seed: u32,
}

impl Grain {
    pub fn new(params: &LeatherParams) -> Grain {
        let seed = params.capture.seed;
        Grain {
            size_mm: params.grain_mm as f32,
            relief_mm: params.relief_mm as f32,
            wrinkles: params.wrinkles as f32,
            pores: params.pores as f32,
            antique: params.antique as f32,
            texel_mm: params.capture.texel_mm(),
            seed: (seed ^ (seed >> 32)) as u32,
        }
    }

    /// Returns an upper bound of the distance of the surface from its mean in millimetres.
    pub fn bound_mm(&self) -> f32 {
        1.7 * self.relief_mm + 0.025 * self.wrinkles + FOLLICLE_DEPTH_MM
    }

    /// Returns the grain at a position in millimetres.
    pub fn at(&self, p: [f32; 2]) -> GrainPoint {
        // Pebbles are no regular cells: the place is pushed about before it is looked up, and
        // stretched along a direction that turns slowly.
        let size = self.size_mm;
        let noise =
            |scale: f32, stream: u32| gradient_noise(p[0] / scale, p[1] / scale, self.seed.wrapping_add(stream));
        let push = |scale: f32, stream: u32| PUSH * (noise(scale, stream) + 0.45 * noise(0.43 * scale, stream + 50));
        let place = [p[0] / size + push(1.6 * size, 1), p[1] / (1.18 * size) + push(1.6 * size, 2)];
        let pebble = cell(place[0], place[1], self.seed.wrapping_add(3));
        let rise = |border: f32, reach: f32| {
            let t = (border / reach).min(1.0);
            1.0 - (1.0 - t) * (1.0 - t)
        };
        // Creases vary in width along their way; some pebbles are joined.
        let reach = PEBBLE_REACH * (1.0 + 0.5 * noise(1.1 * size, 4));
        let dome = rise(pebble.border, reach) * (1.0 - 0.25 * (pebble.site / 0.7).min(1.0).powi(2));
        let own = 0.75 + 0.5 * pebble.unit;

        let fine_texels = FINE_CELLS[0] * size / self.texel_mm;
        let fine_place = place.map(|x| x / FINE_CELLS[0]);
        let fine = cell(fine_place[0], fine_place[1], self.seed.wrapping_add(5));
        let fine_dome = carried_by_texels(0.7 * fine_texels) * (rise(fine.border, 0.3) - 0.6);

        let wrinkles: f32 = WRINKLES_MM
            .iter()
            .zip(20..)
            .map(|(&(wavelength, height), stream)| {
                // Ridged: sharp valleys as in skin.
                let ridge = 0.45 - 1.6 * noise(wavelength, stream).abs();
                carried_by_texels(wavelength / self.texel_mm) * height * ridge
            })
            .sum();
        let waves: f32 =
            WAVES.iter().zip(30..).map(|(&(height, pebbles), stream)| height * noise(pebbles * size, stream)).sum();

        let follicle = cell(
            p[0] / FOLLICLE_SPACING_MM + 0.3 * noise(1.3, 40),
            p[1] / FOLLICLE_SPACING_MM + 0.3 * noise(1.3, 41),
            self.seed.wrapping_add(6),
        );
        let open =
            if follicle.unit < self.pores { carried_by_texels(3.0 * FOLLICLE_RADIUS_MM / self.texel_mm) } else { 0.0 };
        let pit = open * (-(follicle.site * FOLLICLE_SPACING_MM / FOLLICLE_RADIUS_MM).powi(2)).exp();

        let height_mm = self.relief_mm * (dome * own + FINE_CELLS[1] * fine_dome * dome + waves)
            + self.wrinkles * wrinkles
            - FOLLICLE_DEPTH_MM * pit;
        // Pigment gathers in creases and pores and is rubbed off the tops; finish breaks in creases.
        let crease = (1.0 - dome).max(pit).clamp(0.0, 1.0);
        let mottle = 0.16 * noise(2.3 * size, 45) + 0.12 * noise(0.5, 46) + 0.10 * (2.0 * pebble.unit - 1.0);
        GrainPoint {
            height_mm,
            pigment: (self.antique * (1.3 * crease * crease - 0.12 + mottle)).exp() * (1.0 + 0.2 * mottle),
            finish: (0.88 - 0.75 * crease * crease + 0.25 * noise(0.9 * size, 47)).clamp(0.0, 1.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(params: &LeatherParams) -> Vec<GrainPoint> {
        let grain = Grain::new(params);
        (0..40_000).map(|i| grain.at([(i % 200) as f32 * 0.08, (i / 200) as f32 * 0.08])).collect()
    }

    #[test]
    fn the_relief_stays_within_its_bound() {
        for relief_mm in [0.0, 0.16, 1.0] {
            let params = LeatherParams { relief_mm, wrinkles: 3.0, pores: 1.0, ..LeatherParams::default() };
            let points = points(&params);
            let mean = points.iter().map(|p| p.height_mm).sum::<f32>() / points.len() as f32;
            let worst = points.iter().map(|p| (p.height_mm - mean).abs()).fold(0.0, f32::max);
            assert!(worst < Grain::new(&params).bound_mm(), "{relief_mm}: {worst}");
            assert!(worst > 0.5 * relief_mm as f32, "there is a relief: {worst}");
        }
    }

    #[test]
    fn low_places_hold_more_pigment_and_less_finish_than_high_ones() {
        let mut points = points(&LeatherParams::default());
        points.sort_by(|a, b| a.height_mm.total_cmp(&b.height_mm));
        let mean = |points: &[GrainPoint], pick: fn(&GrainPoint) -> f32| {
            points.iter().map(pick).sum::<f32>() / points.len() as f32
        };
        let (low, high) = (&points[..8000], &points[32_000..]);
        assert!(mean(low, |p| p.pigment) > 1.3 * mean(high, |p| p.pigment));
        assert!(mean(low, |p| p.finish) < 0.8 * mean(high, |p| p.finish));
        assert!(points.iter().all(|p| p.pigment > 0.2 && p.pigment < 6.0 && (0.0..=1.0).contains(&p.finish)));
    }

    #[test]
    fn pores_and_wrinkles_can_be_left_out() {
        let smooth = LeatherParams { relief_mm: 0.0, wrinkles: 0.0, pores: 0.0, ..LeatherParams::default() };
        assert!(points(&smooth).iter().all(|p| p.height_mm == 0.0));
        assert!(points(&LeatherParams { pores: 1.0, ..smooth }).iter().any(|p| p.height_mm < -0.02));
    }
}
