//! Particle systems: the paths of what leaves a surface, as strands or blades [Reeves & Blau 1985].

use btf_models::shapes::{ParticleSystem, Trail};
use glam::DVec3;
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::TAU;

use super::brush::Brush;
use super::canvas::Canvas;
use super::frustum::Frustum;
use super::ground::Sites;
use super::surface::sheet_facets;

/// Pieces of all paths of a system at most.
pub const MAX_PIECES: u64 = 1 << 20;
/// Product of drag and time below which a series takes the place of what would cancel.
const LITTLE_DRAG: f64 = 1e-3;

/// The way of one particle.
#[derive(Debug, Clone, Copy)]
struct Flight {
    from: DVec3,
    velocity: DVec3,
    acceleration: DVec3,
    drag_per_s: f64,
    life_s: f64,
}

impl Flight {
    /// Returns where the particle is after a time: the exact way under a constant acceleration and a drag that grows with the speed.
    fn at(&self, time_s: f64) -> DVec3 {
        let braked = self.drag_per_s * time_s;
        // (1 - exp(-x)) / x and (x - 1 + exp(-x)) / x^2.
        let (first, second) = if braked < LITTLE_DRAG {
            (1.0 - braked / 2.0 + braked * braked / 6.0, 0.5 - braked / 6.0 + braked * braked / 24.0)
        } else {
            let first = -(-braked).exp_m1() / braked;
            (first, (1.0 - first) / braked)
        };
        self.from + self.velocity * (time_s * first) + self.acceleration * (time_s * time_s * second)
    }

    /// Returns so many points and one of the path, at equal times.
    fn path(&self, pieces: u32) -> Vec<DVec3> {
        (0..=pieces).map(|i| self.at(self.life_s * f64::from(i) / f64::from(pieces))).collect()
    }
}

/// Returns the greatest distance in metres from where a particle leaves to any point that is drawn of it.
pub fn reach_m(system: &ParticleSystem) -> f64 {
    let (speed, life) = (system.speed_m_per_s * (1.0 + system.jitter), system.life_s * (1.0 + system.jitter));
    let width = match system.trail {
        Trail::Strand { radii_m: ends } | Trail::Blade { widths_m: ends, .. } => ends[0].max(ends[1]),
    };
    speed * life + 0.5 * DVec3::from(system.acceleration_m_per_s2).length() * life * life + width
}

/// Returns the number of pieces of all paths.
pub fn pieces(system: &ParticleSystem) -> u64 {
    system.particles.saturating_mul(u64::from(system.segments))
}

/// Paints the paths of particles that leave triangles.
pub fn paint_particles(system: &ParticleSystem, ground: &[[DVec3; 3]], canvas: &mut Canvas, brush: &Brush) {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(system.seed);
    let mut sites = Sites::new(ground, system.particles);
    while let Some((from, normal)) = sites.draw(&mut random) {
        let path = flight(system, from, normal, &mut random).path(system.segments);
        match system.trail {
            Trail::Strand { radii_m } => paint_strand(&path, radii_m, canvas, brush),
            Trail::Blade { widths_m, fold_deg } => paint_blade(system, &path, widths_m, fold_deg, canvas, brush),
        }
    }
}

/// Draws the flight of a particle.
fn flight(system: &ParticleSystem, from: DVec3, normal: DVec3, random: &mut Xoshiro256PlusPlus) -> Flight {
    let mut vary = |value: f64| value * (1.0 + system.jitter * random.gen_range(-1.0..1.0));
    let (speed, life_s) = (vary(system.speed_m_per_s), vary(system.life_s));
    let axis = system.towards.map_or(normal, |towards| DVec3::from(towards).normalize_or(normal));
    // Evenly over the cap about the axis.
    let cos = 1.0 - random.gen_range(0.0..1.0) * (1.0 - system.spread_deg.to_radians().cos());
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let (across, around) = axis.any_orthonormal_pair();
    let (turn_sin, turn_cos) = random.gen_range(0.0..TAU).sin_cos();
    let direction = axis * cos + (across * turn_cos + around * turn_sin) * sin;
    Flight {
        from,
        velocity: direction * speed,
        acceleration: system.acceleration_m_per_s2.into(),
        drag_per_s: system.drag_per_s,
        life_s,
    }
}

/// Returns a width that changes evenly from piece to piece.
fn along([first, last]: [f64; 2], i: usize, count: usize) -> f64 {
    first + (last - first) * i as f64 / count as f64
}

fn paint_strand(path: &[DVec3], radii_m: [f64; 2], canvas: &mut Canvas, brush: &Brush) {
    let count = path.len() - 1;
    for (i, pair) in path.windows(2).enumerate() {
        let radii_m = [i, i + 1].map(|i| along(radii_m, i, count));
        Frustum { ends_m: [pair[0], pair[1]], radii_m }.paint(canvas, brush);
    }
}

/// Paints a sheet along a path, whose upper face looks away from where the particle is pulled.
fn paint_blade(
    system: &ParticleSystem,
    path: &[DVec3],
    widths_m: [f64; 2],
    fold_deg: f64,
    canvas: &mut Canvas,
    brush: &Brush,
) {
    let count = path.len() - 1;
    let pull = DVec3::from(system.acceleration_m_per_s2);
    let way = (path[count] - path[0]).normalize_or(DVec3::Z);
    // The path lies in a plane, across which the blade is wide.
    let side = (path[count] - path[0]).cross(pull).normalize_or(way.any_orthonormal_vector());
    let (sin, cos) = fold_deg.to_radians().sin_cos();
    let row = |i: usize| {
        let half = 0.5 * along(widths_m, i, count);
        let tangent = (path[(i + 1).min(count)] - path[i.saturating_sub(1)]).normalize_or(way);
        let normal = tangent.cross(side);
        let normal = if normal.dot(pull) > 0.0 { -normal } else { normal };
        let rim = |sign: f64| (path[i] + side * (sign * half * cos) + normal * (half * sin)).to_array();
        if half > 0.0 { vec![rim(-1.0), path[i].to_array(), rim(1.0)] } else { vec![path[i].to_array()] }
    };
    let rows: Vec<_> = (0..=count).map(row).collect();
    // Two rows of one point have nothing between them.
    if rows.iter().any(|row| row.len() > 1) {
        sheet_facets(&rows).iter().for_each(|facet| canvas.facet(facet, 1.0, brush));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flight(drag_per_s: f64) -> Flight {
        Flight {
            from: DVec3::new(1.0, 2.0, 3.0),
            velocity: DVec3::new(2.0, 0.0, 5.0),
            acceleration: DVec3::new(0.0, 0.0, -9.81),
            drag_per_s,
            life_s: 1.0,
        }
    }

    #[test]
    fn a_particle_without_drag_flies_along_a_parabola() {
        let free = flight(0.0);
        let top = free.at(5.0 / 9.81);
        assert!((top.z - 3.0 - 25.0 / (2.0 * 9.81)).abs() < 1e-12 && (top.x - 1.0 - 10.0 / 9.81).abs() < 1e-12);
        let path = free.path(4);
        assert_eq!((path.len(), path[0]), (5, free.from));
        // Second differences of a parabola are equal.
        let bends: Vec<DVec3> = path.windows(3).map(|p| p[2] - 2.0 * p[1] + p[0]).collect();
        assert!(bends.windows(2).all(|pair| pair[0].distance(pair[1]) < 1e-12));
    }

    #[test]
    fn drag_is_the_same_as_many_small_steps() {
        for drag_per_s in [1e-4, 9e-4, 0.3, 4.0, 60.0] {
            let braked = flight(drag_per_s);
            let (mut at, mut velocity) = (braked.from, braked.velocity);
            let steps = 200_000;
            let step_s = 1.0 / f64::from(steps);
            for _ in 0..steps {
                let middle = velocity + 0.5 * step_s * (braked.acceleration - drag_per_s * velocity);
                at += step_s * middle;
                velocity += step_s * (braked.acceleration - drag_per_s * middle);
            }
            let found = braked.at(1.0);
            assert!(found.distance(at) < 1e-6, "{drag_per_s}: {found} {at}");
            // Planted: without the drag it is elsewhere.
            assert!(flight(0.0).at(1.0).distance(at) > 1e-5);
        }
    }
}
