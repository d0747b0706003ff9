//! Random numbers and directions, the same on every machine.

/// A small generator of random numbers (splitmix64): the same seed gives the same numbers everywhere.
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    /// Begins a stream of numbers from `seed`.
    pub fn new(seed: u64) -> Random {
        Random(seed)
    }

    /// Returns the next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Returns a number uniform in `least..most`.
    pub fn within(&mut self, least: f32, most: f32) -> f32 {
        least + (most - least) * ((self.bits() >> 40) as f32 / (1u64 << 24) as f32)
    }

    /// Returns a number uniform below `count`, which must be at least 1.
    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }

    /// Returns a unit direction, uniform on the upper hemisphere.
    pub fn direction(&mut self) -> [f32; 3] {
        direction_from_cos(self.within(0.0, 1.0), self.within(0.0, 360.0))
    }
}

/// Returns a unit direction, uniform on the sphere.
pub fn sphere_direction(random: &mut Random) -> [f32; 3] {
    direction_from_cos(random.within(-1.0, 1.0), random.within(0.0, 360.0))
}

pub(super) fn direction_from_cos(cos: f32, phi_deg: f32) -> [f32; 3] {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (sin_phi, cos_phi) = phi_deg.to_radians().sin_cos();
    [sin * cos_phi, sin * sin_phi, cos]
}

/// Returns the unit direction of polar angle and azimuth in degrees.
pub fn direction_from_degrees(theta_deg: f64, phi_deg: f64) -> [f32; 3] {
    let (sin, cos) = theta_deg.to_radians().sin_cos();
    let (sin_phi, cos_phi) = phi_deg.to_radians().sin_cos();
    [(sin * cos_phi) as f32, (sin * sin_phi) as f32, cos as f32]
}

/// Returns the pole and the directions of rings of `(polar angle in degrees, count)`.
pub fn ring_directions(rings: &[(f64, usize)]) -> Vec<[f32; 3]> {
    let ring = |&(theta_deg, count): &(f64, usize)| {
        (0..count).map(move |i| direction_from_degrees(theta_deg, 360.0 * i as f64 / count as f64))
    };
    std::iter::once([0.0, 0.0, 1.0]).chain(rings.iter().flat_map(ring)).collect()
}
