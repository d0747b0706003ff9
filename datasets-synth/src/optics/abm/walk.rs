//! The random walk through a [`Stack`]: reflection or refraction by Fresnel's coefficient at every
//! interface, directions spread as the interface says, absorption by free path in the mesophyll
//! [Baranoski 1997, sec. 3].
//!
//! There are three ways to walk a stack:
//!
//! - [`walk`] with [`Absorption::Sampled`]: the paper's, every ray ends absorbed or escaped;
//! - [`walk`] with [`Absorption::None`]: every ray escapes and reports the length of its path through the mesophyll,
//!   from which any absorption follows (see `path_lengths`);
//! - [`walk_splitting`]: both outcomes at every interface, weighted by Fresnel's coefficient, thinned by
//!   Russian roulette, as the paper's section 5 proposes.

use rand::{Rng, RngCore};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::optics::abm::stack::{Crossing, Interface, Medium, Spread, Stack};
use crate::optics::fresnel::interface_optics;

/// Number of interfaces after which a ray is given up: a guard against indices that trap light.
const MAX_INTERACTIONS: u32 = 10_000;

/// Weight below which branches are thinned by Russian roulette; survivors get this weight.
const ROULETTE_WEIGHT: f64 = 0.05;

/// Largest number of branches that wait at a time; the roulette keeps them far below.
const MAX_BRANCHES: usize = 64;

/// Absorption of the mesophyll.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Absorption {
    /// No absorption.
    None,
    /// Absorption where the free path of a ray, drawn for every crossing, is shorter than the crossing. The number is
    /// the optical depth of a straight crossing.
    Sampled(f64),
}

/// End of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum End {
    /// Escape above or below in `direction` (unit; z > 0 is above).
    Escaped {
        /// Unit direction of travel.
        direction: [f64; 3],
        /// Length of the path through the mesophyll in thicknesses.
        path: f64,
    },
    /// Absorption, or more interfaces than any path should meet.
    Absorbed,
}

/// End of a ray, with the number of interfaces that it met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Walked {
    /// End of the ray.
    pub end: End,
    /// Number of interfaces that the ray met, the first included.
    pub interactions: u32,
}

/// Returns a random number in (0, 1], so that its logarithm is finite.
#[inline]
fn positive_unit(random: &mut Xoshiro256PlusPlus) -> f64 {
    ((random.next_u64() >> 11) + 1) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// Spreads the unit direction `ray` (z not 0) by `spread`, on its side of the plane.
#[inline]
fn spread_ray(ray: [f64; 3], spread: Spread, crossing: Crossing, random: &mut Xoshiro256PlusPlus) -> [f64; 3] {
    let Spread::Cosine(inverse) = spread else { return ray };
    // An orthonormal frame about the ray [Duff 2017].
    let [x, y, z] = ray;
    let sign = 1f64.copysign(z);
    let a = -1.0 / (sign + z);
    let b = x * y * a;
    let u = [1.0 + sign * x * x * a, sign * b, -sign * x];
    let v = [b, sign + y * y * a, -y];
    loop {
        let xi = positive_unit(random);
        let cos = if inverse.0 == 0.5 { xi.sqrt() } else { xi.powf(inverse.0) };
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (cos_b, sin_b) = unit_circle(random);
        let (p, q) = (sin * cos_b, sin * sin_b);
        let turned = [p * u[0] + q * v[0] + cos * x, p * u[1] + q * v[1] + cos * y, p * u[2] + q * v[2] + cos * z];
        if turned[2] * z > 0.0 {
            return turned;
        }
        match crossing {
            Crossing::Resample => {}
            // A direction in the plane itself has no side; it is drawn again.
            Crossing::Mirror if turned[2] != 0.0 => return [turned[0], turned[1], -turned[2]],
            Crossing::Mirror => {}
            Crossing::Keep => return ray,
        }
    }
}

/// Returns the cosine and sine of a uniformly distributed angle.
#[inline]
fn unit_circle(random: &mut Xoshiro256PlusPlus) -> (f64, f64) {
    // Marsaglia's rejection: cheaper than a sine and a cosine.
    loop {
        let bits = random.next_u64();
        let p = (bits >> 32) as u32 as i32 as f64 * (1.0 / 2_147_483_648.0);
        let q = bits as u32 as i32 as f64 * (1.0 / 2_147_483_648.0);
        let squared = p * p + q * q;
        if squared > 0.0 && squared <= 1.0 {
            // Doubling the angle of (p, q) needs no root.
            return ((p * p - q * q) / squared, 2.0 * p * q / squared);
        }
    }
}

/// Returns the four properties of an interface for a ray from one side: index on the side of the ray, index behind,
/// spread of the reflected and of the refracted ray.
#[inline]
fn seen_from(interface: &Interface, down: bool) -> (f64, f64, Spread, Spread) {
    let i = interface;
    if down {
        (i.index_above, i.index_below, i.reflected_above, i.refracted_below)
    } else {
        (i.index_below, i.index_above, i.reflected_below, i.refracted_above)
    }
}

/// Returns the unit direction on the other side of an interface: tangential part by Snell's law.
#[inline]
fn refracted(ray: [f64; 3], ratio: f64, cos_t: f64) -> [f64; 3] {
    [ray[0] * ratio, ray[1] * ratio, cos_t.copysign(ray[2])]
}

/// Returns the share of the mesophyll's thickness that a medium has.
#[inline]
fn share(medium: Medium, upper: f64) -> f64 {
    match medium {
        Medium::Clear => 0.0,
        Medium::Mesophyll => 1.0,
        Medium::UpperPart => upper,
        Medium::LowerPart => 1.0 - upper,
    }
}

fn draws_parts(stack: &Stack) -> bool {
    stack.media.contains(&Medium::UpperPart)
}

/// Follows one ray from outside to its end. `direction` is its unit direction of travel (z < 0 meets the adaxial face).
pub fn walk(stack: &Stack, direction: [f64; 3], absorption: Absorption, random: &mut Xoshiro256PlusPlus) -> Walked {
    let count = stack.interfaces.len();
    let upper = if draws_parts(stack) { random.r#gen::<f64>() } else { 0.0 };
    let mut ray = direction;
    let mut at = if ray[2] < 0.0 { 0 } else { count - 1 };
    let mut path = 0.0;
    for interactions in 1..=MAX_INTERACTIONS {
        let (from, to, reflect, refract) = seen_from(&stack.interfaces[at], ray[2] < 0.0);
        let (fresnel, cos_t) = interface_optics(from, to, ray[2].abs());
        // `<` and not `<=`: a coefficient of exactly 0 never reflects.
        if random.r#gen::<f64>() < fresnel {
            ray = spread_ray([ray[0], ray[1], -ray[2]], reflect, stack.crossing, random);
        } else {
            ray = spread_ray(refracted(ray, from / to, cos_t), refract, stack.crossing, random);
        }
        let down = ray[2] < 0.0;
        if (at == 0 && !down) || (at + 1 == count && down) {
            return Walked { end: End::Escaped { direction: ray, path }, interactions };
        }
        // Cross the medium between this interface and the next.
        let medium = stack.media[if down { at } else { at - 1 }];
        if medium != Medium::Clear {
            let crossed = share(medium, upper) * stack.path.crossings(ray[2].abs());
            path += crossed;
            if let Absorption::Sampled(depth) = absorption
                && -positive_unit(random).ln() < depth * crossed
            {
                return Walked { end: End::Absorbed, interactions };
            }
        }
        at = if down { at + 1 } else { at - 1 };
    }
    Walked { end: End::Absorbed, interactions: MAX_INTERACTIONS }
}

/// Follows both outcomes at every interface, of weights F and 1 - F; branches lighter than a twentieth end by Russian
/// roulette. `escape` gets each escaped branch: weight, direction of travel, path, as in [`End::Escaped`]. Weights
/// times `exp(-depth path)` add up to the same means as single rays give. Returns the number of interfaces met.
pub fn walk_splitting(
    stack: &Stack,
    direction: [f64; 3],
    random: &mut Xoshiro256PlusPlus,
    escape: &mut impl FnMut(f64, [f64; 3], f64),
) -> u32 {
    #[derive(Clone, Copy)]
    struct Branch {
        ray: [f64; 3],
        at: usize,
        weight: f64,
        path: f64,
    }
    let count = stack.interfaces.len();
    let upper = if draws_parts(stack) { random.r#gen::<f64>() } else { 0.0 };
    let start = Branch { ray: direction, at: if direction[2] < 0.0 { 0 } else { count - 1 }, weight: 1.0, path: 0.0 };
    let mut waiting = vec![start];
    let mut interactions = 0;
    while let Some(branch) = waiting.pop() {
        if interactions == MAX_INTERACTIONS {
            break;
        }
        interactions += 1;
        let (from, to, reflect, refract) = seen_from(&stack.interfaces[branch.at], branch.ray[2] < 0.0);
        let (fresnel, cos_t) = interface_optics(from, to, branch.ray[2].abs());
        let [x, y, z] = branch.ray;
        let outcomes =
            [(fresnel, [x, y, -z], reflect), (1.0 - fresnel, refracted(branch.ray, from / to, cos_t), refract)];
        for (part, ideal, spread) in outcomes {
            let mut weight = branch.weight * part;
            if weight < ROULETTE_WEIGHT || waiting.len() >= MAX_BRANCHES {
                // Survives with probability weight / w, and then counts w: the mean is kept.
                let kept = weight.max(ROULETTE_WEIGHT);
                if random.r#gen::<f64>() * kept >= weight {
                    continue;
                }
                weight = kept;
            }
            let ray = spread_ray(ideal, spread, stack.crossing, random);
            let down = ray[2] < 0.0;
            if (branch.at == 0 && !down) || (branch.at + 1 == count && down) {
                escape(weight, ray, branch.path);
                continue;
            }
            let medium = stack.media[if down { branch.at } else { branch.at - 1 }];
            let crossed = match medium {
                Medium::Clear => 0.0,
                _ => share(medium, upper) * stack.path.crossings(ray[2].abs()),
            };
            let at = if down { branch.at + 1 } else { branch.at - 1 };
            waiting.push(Branch { ray, at, weight, path: branch.path + crossed });
        }
    }
    interactions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::abm::abm_b::AbmB;
    use crate::optics::abm::abm_u::AbmU;
    use crate::optics::abm::abm97::Abm97;
    use crate::optics::abm::path_lengths::{Beam, Face, Parallel, block_random};
    use crate::optics::abm::stack::PathRule;
    use crate::optics::abm::tissue::Tissue;
    use crate::optics::units::Nanometres;

    fn down(theta_deg: f64) -> [f64; 3] {
        Parallel::onto(Face::Adaxial, theta_deg).direction(&mut block_random(0, 0))
    }

    /// Returns a stack of one interface.
    fn one(interface: Interface, crossing: Crossing) -> Stack {
        Stack::new(vec![interface], vec![], PathRule::Slant, crossing)
    }

    #[test]
    fn without_absorption_every_ray_leaves_exactly() {
        let green = Nanometres(550.0);
        let mut random = block_random(3, 0);
        for stack in [Abm97::default().stack(green), AbmB::default().stack(green), AbmU::default().stack(green)] {
            for face in [Face::Adaxial, Face::Abaxial] {
                for theta in [0.0, 45.0, 89.9, 90.0] {
                    let start = Parallel::onto(face, theta).direction(&mut random);
                    let escaped = (0..20_000)
                        .filter(|_| match walk(&stack, start, Absorption::None, &mut random).end {
                            End::Escaped { direction, path } => {
                                let length = direction.iter().map(|c| c * c).sum::<f64>();
                                assert!((length - 1.0).abs() < 1e-9 && path.is_finite() && direction[2] != 0.0);
                                true
                            }
                            End::Absorbed => false,
                        })
                        .count();
                    assert_eq!(escaped, 20_000, "R + T = 1 as a count");
                }
            }
        }
    }

    #[test]
    fn everything_is_absorbed_that_enters_an_opaque_mesophyll_and_nothing_else() {
        let stack = Abm97::default().stack(Nanometres(550.0));
        let mut random = block_random(4, 0);
        let rays = 200_000;
        let reflected = (0..rays)
            .filter(|_| {
                let end = walk(&stack, down(8.0), Absorption::Sampled(f64::INFINITY), &mut random).end;
                matches!(end, End::Escaped { direction, .. } if direction[2] > 0.0)
            })
            .count();
        let (fresnel, _) = interface_optics(1.0, 1.6, down(8.0)[2].abs());
        assert!((fresnel - 0.0533).abs() < 1e-4);
        assert!((reflected as f64 / rays as f64 - fresnel).abs() < 1e-3, "{reflected}");
    }

    #[test]
    fn equal_indices_let_everything_pass_and_total_reflection_nothing() {
        let mut random = block_random(5, 0);
        let clear = one(Interface::plain(1.33, 1.33), Crossing::Resample);
        let dense = one(Interface::plain(1.6, 1.0), Crossing::Resample);
        for theta in [0.0, 30.0, 60.0, 89.9] {
            for _ in 0..200 {
                let walked = walk(&clear, down(theta), Absorption::None, &mut random);
                let End::Escaped { direction, .. } = walked.end else { panic!("lost") };
                let start = down(theta);
                assert!((0..3).all(|k| (direction[k] - start[k]).abs() < 1e-12) && walked.interactions == 1);
            }
        }
        // Critical angle of 1.6 to 1: 38.7 degrees.
        for (theta, all) in [(38.0, false), (39.0, true)] {
            let reflected = (0..2000)
                .filter(|_| match walk(&dense, down(theta), Absorption::None, &mut random).end {
                    End::Escaped { direction, .. } => direction[2] > 0.0,
                    End::Absorbed => false,
                })
                .count();
            assert_eq!(reflected == 2000, all, "{theta}: {reflected}");
        }
        assert_eq!(interface_optics(1.6, 1.0, 0.1), (1.0, 0.0));
        assert_eq!(interface_optics(1.0, 1.0, 1e-100).0, 0.0);
        assert!((interface_optics(1.0, 1.5, 1e-12).0 - 1.0).abs() < 1e-10);
    }

    #[test]
    fn refraction_obeys_snell_and_keeps_unit_length() {
        for theta in [0.0, 8.0, 45.0, 89.9] {
            for (from, to) in [(1.0, 1.6), (1.41, 1.0), (1.6, 1.42)] {
                let start = down(theta);
                let (f, cos_t) = interface_optics(from, to, start[2].abs());
                if f == 1.0 {
                    continue;
                }
                let out = refracted(start, from / to, cos_t);
                assert!((out.iter().map(|c| c * c).sum::<f64>() - 1.0).abs() < 1e-12);
                let sines = (start[0].hypot(start[1]) * from, out[0].hypot(out[1]) * to);
                assert!((sines.0 - sines.1).abs() < 1e-12 && out[2] < 0.0, "goes on to the other side");
            }
        }
    }

    #[test]
    fn the_lobes_have_their_mean_cosines_about_the_ray() {
        let mut random = block_random(6, 0);
        let straight = [0.0, 0.0, -1.0];
        for exponent in [0.0, 1.0, 5.0, 20.0, 1e6] {
            let count = 100_000;
            let mean = (0..count)
                .map(|_| -spread_ray(straight, Spread::exponent(exponent), Crossing::Resample, &mut random)[2])
                .sum::<f64>()
                / f64::from(count);
            // E[cos] of density (e + 1)/(2 pi) cos^e.
            let expected = (exponent + 1.0) / (exponent + 2.0);
            assert!((mean - expected).abs() < 4e-3, "{exponent}: {mean} {expected}");
        }
        // Turned: about a slanted ray, as long as nothing crosses.
        let ray = down(40.0);
        let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|k| a[k] * b[k]).sum::<f64>();
        let mean = (0..50_000)
            .map(|_| dot(ray, spread_ray(ray, Spread::exponent(100.0), Crossing::Resample, &mut random)))
            .sum::<f64>()
            / 50_000.0;
        assert!((mean - 101.0 / 102.0).abs() < 1e-3, "{mean}");
    }

    #[test]
    fn no_rule_lets_a_lobe_cross_and_each_treats_it_in_its_own_way() {
        let mut random = block_random(7, 0);
        let ray = down(80.0);
        let mut means = Vec::new();
        for crossing in [Crossing::Resample, Crossing::Mirror, Crossing::Keep] {
            let mut sum = 0.0;
            for _ in 0..50_000 {
                let spread = spread_ray(ray, Spread::diffuse(), crossing, &mut random);
                assert!(spread[2] < 0.0);
                sum -= spread[2] / 50_000.0;
            }
            means.push(sum);
        }
        assert!(means[0] > means[1] + 0.01 && means[1] > means[2] + 0.01, "{means:?}");
    }

    #[test]
    fn nothing_is_absorbed_in_no_thickness_and_units_are_never_zero() {
        let stack = Abm97::default().stack(Nanometres(550.0));
        let mut random = block_random(8, 0);
        for _ in 0..20_000 {
            let walked = walk(&stack, down(8.0), Absorption::Sampled(0.0), &mut random);
            assert!(matches!(walked.end, End::Escaped { .. }));
            let xi = positive_unit(&mut random);
            assert!(xi > 0.0 && xi <= 1.0 && xi.ln().is_finite());
        }
    }

    #[test]
    fn light_that_is_trapped_ends() {
        // Two interfaces that reflect everything inside, an entry that lets light in.
        let gate = Interface { index_above: 1.0, index_below: 1.0, ..Interface::plain(1.0, 1.0) };
        let mirror = Interface { reflected_above: Spread::None, ..Interface::plain(1e9, 1.0) };
        let stack = Stack::new(vec![gate, mirror], vec![Medium::Clear], PathRule::Slant, Crossing::Resample);
        let mut random = block_random(9, 0);
        let walked = walk(&stack, down(45.0), Absorption::None, &mut random);
        assert!(walked.interactions <= MAX_INTERACTIONS);
        // Slanted light between two total reflections never leaves: the cap ends it.
        let inside = Stack::new(
            vec![Interface { index_above: 1.0, index_below: 1e-9, ..mirror }, mirror],
            vec![Medium::Clear],
            PathRule::Slant,
            Crossing::Resample,
        );
        let walked = walk(&inside, down(45.0), Absorption::None, &mut random);
        assert!(walked.interactions <= MAX_INTERACTIONS);
    }
}
