//! Deterministic two-dimensional noise: smooth gradient noise and cells with their borders.

/// Lengths of a wave in texels: a shorter one than the first is left out, a longer one than the second is whole.
const FADE_TEXELS: [f32; 2] = [2.5, 4.0];

/// Returns the share of a wave of length `texels` that an image should show, 0 to 1; shorter waves would only alias.
pub(crate) fn carried_by_texels(texels: f32) -> f32 {
    ((texels - FADE_TEXELS[0]) / (FADE_TEXELS[1] - FADE_TEXELS[0])).clamp(0.0, 1.0)
}

/// Mixes a lattice point and a seed to 32 well-scattered bits (finaliser of MurmurHash3, applied between the inputs).
fn hash(x: i32, y: i32, seed: u32) -> u32 {
    let mix = |mut h: u32| {
        h ^= h >> 16;
        h = h.wrapping_mul(0x85EB_CA6B);
        h ^= h >> 13;
        h = h.wrapping_mul(0xC2B2_AE35);
        h ^ (h >> 16)
    };
    mix(mix(mix(seed.wrapping_add(0x9E37_79B9)) ^ x as u32).wrapping_add(0x7F4A_7C15) ^ (y as u32).rotate_left(16))
}

/// Returns the upper half of the bits as a number in [0, 1), and the lower half as another.
fn two_units(bits: u32) -> [f32; 2] {
    [(bits >> 16) as f32 / 65536.0, (bits & 0xFFFF) as f32 / 65536.0]
}

/// Returns gradient noise [Perlin 2002] of lattice step 1, about -1 to 1 with mean 0 and a root mean square near 0.3;
/// twice differentiable.
pub(crate) fn gradient_noise(x: f32, y: f32, seed: u32) -> f32 {
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = (x - x0, y - y0);
    let (ix, iy) = (x0 as i32, y0 as i32);
    let corner = |dx: i32, dy: i32| {
        let angle = two_units(hash(ix + dx, iy + dy, seed))[0] * std::f32::consts::TAU;
        let (sin, cos) = angle.sin_cos();
        cos * (fx - dx as f32) + sin * (fy - dy as f32)
    };
    let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let (u, v) = (fade(fx), fade(fy));
    let bottom = corner(0, 0) * (1.0 - u) + corner(1, 0) * u;
    let top = corner(0, 1) * (1.0 - u) + corner(1, 1) * u;
    1.4 * (bottom * (1.0 - v) + top * v)
}

/// Returns a random number in [0, 1) for a lattice point.
pub(crate) fn lattice_unit(x: i32, y: i32, seed: u32) -> f32 {
    two_units(hash(x, y, seed))[0]
}

/// Place of a point in its cell of a Voronoi diagram.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cell {
    /// Distance to the nearest border of the cell.
    pub border: f32,
    /// Distance to the site of the cell.
    pub site: f32,
    /// Random number in [0, 1) of the cell.
    pub unit: f32,
}

/// Returns the distance from a point to the nearest border between Voronoi cells of one jittered site per unit square
/// [Worley 1996; exact border distance by the bisectors].
pub(crate) fn cell_border_distance(x: f32, y: f32, seed: u32) -> f32 {
    cell(x, y, seed).border
}

/// Returns the cell that a point lies in, among cells of one jittered site per unit square [Worley 1996; exact border
/// distance by the bisectors].
pub(crate) fn cell(x: f32, y: f32, seed: u32) -> Cell {
    /// Largest distance of a site from the middle of its square; less than half keeps cells of like size.
    const JITTER: f32 = 0.8;
    let (ix, iy) = (x.floor() as i32, y.floor() as i32);
    let site = |dx: i32, dy: i32| {
        let unit = two_units(hash(ix + dx, iy + dy, seed));
        let offset = |u: f32| 0.5 + JITTER * (u - 0.5);
        [(ix + dx) as f32 + offset(unit[0]) - x, (iy + dy) as f32 + offset(unit[1]) - y]
    };
    // The nearest site stands at most two squares away, and so does each neighbour of its cell.
    let mut nearest = [f32::MAX; 2];
    let mut square = [0; 2];
    let mut nearest_squared = f32::MAX;
    let mut sites = [[0f32; 2]; 25];
    for dy in -2..=2 {
        for dx in -2..=2 {
            let s = site(dx, dy);
            sites[((dy + 2) * 5 + dx + 2) as usize] = s;
            let squared = s[0] * s[0] + s[1] * s[1];
            if squared < nearest_squared {
                nearest_squared = squared;
                nearest = s;
                square = [ix + dx, iy + dy];
            }
        }
    }
    let mut border = f32::MAX;
    for s in sites {
        let difference = [s[0] - nearest[0], s[1] - nearest[1]];
        let length = (difference[0] * difference[0] + difference[1] * difference[1]).sqrt();
        if length > 1e-6 {
            let middle = [(s[0] + nearest[0]) * 0.5, (s[1] + nearest[1]) * 0.5];
            border = border.min((middle[0] * difference[0] + middle[1] * difference[1]) / length);
        }
    }
    Cell {
        border: border.max(0.0),
        site: nearest_squared.sqrt(),
        unit: lattice_unit(square[0], square[1], seed.wrapping_add(0x51)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradient_noise_is_bounded_centred_smooth_and_seeded() {
        let (mut sum, mut squares, mut steepest) = (0.0, 0.0, 0f32);
        let count = 20_000;
        for i in 0..count {
            let (x, y) = (i as f32 * 0.137 - 900.0, i as f32 * 0.071 + 3.0);
            let value = gradient_noise(x, y, 5);
            assert!(value.abs() <= 1.0, "{value}");
            sum += value;
            squares += value * value;
            steepest = steepest.max((gradient_noise(x + 1e-2, y, 5) - value).abs());
        }
        assert!((sum / count as f32).abs() < 0.02);
        assert!((0.1..0.5).contains(&(squares / count as f32).sqrt()));
        assert!(steepest < 0.04, "no jump: {steepest}");
        assert_ne!(gradient_noise(0.3, 0.4, 1), gradient_noise(0.3, 0.4, 2));
        assert_eq!(gradient_noise(0.3, 0.4, 1), gradient_noise(0.3, 0.4, 1));
    }

    #[test]
    fn border_distance_is_continuous_and_zero_somewhere_in_every_neighbourhood() {
        let mut smallest = f32::MAX;
        for i in 0..3000 {
            let x = i as f32 * 1e-3;
            let (a, b) = (cell_border_distance(x, 0.37, 9), cell_border_distance(x + 1e-3, 0.37, 9));
            assert!((a - b).abs() < 1.1e-3, "a distance changes no faster than the place");
            assert!((0.0..1.2).contains(&a));
            smallest = smallest.min(a);
        }
        assert!(smallest < 0.01);
    }
}
