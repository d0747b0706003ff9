//! The triangles that fur grows on and particles leave.

use glam::DVec3;
use rand::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;

/// Draws as many places from equal areas of triangles, anywhere in them.
pub struct Sites<'a> {
    triangles: std::slice::Iter<'a, [DVec3; 3]>,
    /// The triangle that the last place lies in, and the area of all up to it.
    triangle: Option<&'a [DVec3; 3]>,
    end_m2: f64,
    whole_m2: f64,
    places: u64,
    drawn: u64,
}

impl<'a> Sites<'a> {
    /// Returns so many places on triangles.
    pub fn new(triangles: &'a [[DVec3; 3]], places: u64) -> Sites<'a> {
        let whole_m2 = area_m2(triangles);
        Sites { triangles: triangles.iter(), triangle: None, end_m2: 0.0, whole_m2, places, drawn: 0 }
    }

    /// Draws the next place: returns it and the unit normal there.
    pub fn draw(&mut self, random: &mut Xoshiro256PlusPlus) -> Option<(DVec3, DVec3)> {
        if self.drawn == self.places {
            return None;
        }
        let at = self.whole_m2 * (self.drawn as f64 + random.gen_range(0.0..1.0)) / self.places as f64;
        self.drawn += 1;
        while at >= self.end_m2 {
            let Some(next) = self.triangles.next() else { break };
            self.end_m2 += area(next);
            self.triangle = Some(next);
        }
        let [a, b, c] = self.triangle?;
        let [u, v]: [f64; 2] = [0, 1].map(|_| random.gen_range(0.0..1.0));
        // Folded from the parallelogram into the triangle.
        let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
        Some((a + (b - a) * u + (c - a) * v, (b - a).cross(c - a).normalize_or_zero()))
    }
}

/// Returns the area of triangles in square metres.
pub fn area_m2(triangles: &[[DVec3; 3]]) -> f64 {
    triangles.iter().map(area).sum()
}

fn area([a, b, c]: &[DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}
