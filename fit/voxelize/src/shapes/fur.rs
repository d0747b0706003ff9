//! Fur: strands on a surface [Kajiya & Kay 1989].

use btf_models::shapes::Shape;
use glam::DVec3;
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

use super::brush::Brush;
use super::canvas::Canvas;
use super::frustum::Frustum;
use super::ground::{Sites, area_m2};

/// Cylinders of a fur at most.
pub const MAX_CYLINDERS: u64 = 1 << 20;

/// Parameters of strands; see [`Shape::Fur`].
#[derive(Debug, Clone, Copy)]
pub struct Fur {
    strands_per_m2: f64,
    length_m: f64,
    radius_m: f64,
    lean_rad: f64,
    lean_towards: DVec3,
    bend_rad: f64,
    curl_turns: f64,
    curl_radius_m: f64,
    jitter: f64,
    segments: u32,
    seed: u64,
}

impl Fur {
    /// Returns the fur of a shape; `None` for a shape that is not fur.
    pub fn of(shape: &Shape) -> Option<Fur> {
        let Shape::Fur {
            on: _,
            strands_per_m2,
            length_m,
            radius_m,
            lean_deg,
            lean_towards,
            bend_deg,
            curl_turns,
            curl_radius_m,
            jitter,
            segments,
            seed,
        } = *shape
        else {
            return None;
        };
        Some(Fur {
            strands_per_m2,
            length_m,
            radius_m,
            lean_rad: lean_deg.to_radians(),
            lean_towards: lean_towards.into(),
            bend_rad: bend_deg.to_radians(),
            curl_turns,
            curl_radius_m,
            jitter,
            segments,
            seed,
        })
    }

    /// Returns the greatest distance in metres from a strand's root to any point of the strand.
    pub fn reach_m(&self) -> f64 {
        self.length_m * (1.0 + self.jitter) + self.curl_radius_m
    }

    /// Returns the number of strands on ground of an area.
    pub fn strands(&self, area_m2: f64) -> u64 {
        (self.strands_per_m2 * area_m2).round() as u64
    }

    /// Returns the number of cylinders of so many strands.
    pub fn cylinders(&self, strands: u64) -> u64 {
        strands.saturating_mul(u64::from(self.segments))
    }

    /// Paints strands that grow on triangles: the same number on equal areas, anywhere in them.
    pub fn paint(&self, ground: &[[DVec3; 3]], canvas: &mut Canvas, brush: &Brush) {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(self.seed);
        let mut sites = Sites::new(ground, self.strands(area_m2(ground)));
        while let Some((root, normal)) = sites.draw(&mut random) {
            self.strand(root, normal, &mut random).iter().for_each(|piece| piece.paint(canvas, brush));
        }
    }

    /// Returns the pieces of a strand from root to tip.
    fn strand(&self, root: DVec3, normal: DVec3, random: &mut Xoshiro256PlusPlus) -> Vec<Frustum> {
        let mut vary = |value: f64| value * (1.0 + self.jitter * random.gen_range(-1.0..1.0));
        let [length_m, lean, bend] = [self.length_m, self.lean_rad, self.bend_rad].map(&mut vary);
        let phase = TAU * random.gen_range(0.0..1.0);
        // Of what leans, the part along the ground tells where to.
        let away = (self.lean_towards - normal * self.lean_towards.dot(normal)).normalize_or_zero();
        let away = if away == DVec3::ZERO { normal.any_orthonormal_vector() } else { away };
        let side = normal.cross(away);
        let heading = |s: f64| {
            let (sin, cos) = (lean + bend * s).sin_cos();
            normal * cos + away * sin
        };
        let count = f64::from(self.segments);
        let mut course = root;
        let mut nodes = vec![root];
        for i in 0..self.segments {
            let s = (f64::from(i) + 1.0) / count;
            course += heading(s - 0.5 / count) * (length_m / count);
            // The curl widens from none at the root.
            let (sin, cos) = (phase + TAU * self.curl_turns * s).sin_cos();
            let up = heading(s).cross(side);
            nodes.push(course + (side * cos + up * sin) * (self.curl_radius_m * s));
        }
        let radius = |i: usize| self.radius_m * (1.0 - i as f64 / count);
        let pieces = nodes.windows(2).enumerate();
        pieces.map(|(i, pair)| Frustum { ends_m: [pair[0], pair[1]], radii_m: [radius(i), radius(i + 1)] }).collect()
    }
}
