//! Rays that walk through thick skins on the GPU meet what they meet on the CPU.

use crate::support::gpu;
use btf_runtime::testing::Random;
use btf_viewer::testing::{WalkQuery, WalkSum, cpu_walk, gpu_walk};
use btf_viewer::{DiscreteJitter, Jitter, Noise, Pattern, Shell, ShellParams, Skin, SkinVertex, Wind};
use glam::Vec3;

/// Texels along each side of the skin.
const SIDE: u32 = 12;

/// A jittered hill whose patches have two patterns in turn.
fn skin() -> Skin {
    let vertex = |x: u32, y: u32| {
        let [x, y] = [x, y].map(|x| x as f32);
        let position = Vec3::new(x, y, 0.6 * (0.8 * x).sin() * (0.7 * y).cos());
        SkinVertex::new(position, Vec3::Z, [0.5 + 1.3 * x, 0.9 * y])
    };
    let noise = Noise { wavelength: 2.3, period: [0; 3], seed: 5 };
    let jitter = Jitter { noise, coordinates: 0.2, length: 0.3, angle_deg: 20.0 };
    let straight = Skin::from_grid(SIDE, SIDE, vertex, |x, y| (x + y) % 2).unwrap();
    jitter.apply(&straight).unwrap()
}

fn patterns() -> Vec<Pattern> {
    let jitter =
        DiscreteJitter { empty: 0.3, scale: [0.5, 0.8], displacement: 0.3, margin: 0.1, turns: true, mirrors: true };
    let isolated = Pattern {
        alternatives: vec![[2, 9, u32::MAX, u32::MAX], [3, u32::MAX, u32::MAX, u32::MAX]],
        ..Pattern::isolated(0, jitter, 77)
    };
    vec![Pattern::cyclic(1), isolated]
}

/// Rays from points around the skin towards each triangle of its boundary that faces them.
fn queries(shell: &Shell, count: usize) -> Vec<WalkQuery> {
    let mut random = Random::new(1);
    let mut all = Vec::new();
    while all.len() < count {
        let boundary = random.below(shell.boundary().len());
        let [a, b, c] = shell.boundary_triangle(boundary);
        let [u, v] = [random.within(0.0, 1.0), random.within(0.0, 1.0)];
        let at = a + (b - a) * (u * (1.0 - v)) + (c - a) * (u * v);
        let from = Vec3::from([(); 3].map(|()| random.within(-20.0, 20.0)));
        let direction = (at - from) * random.within(0.2, 2.0);
        if (b - a).cross(c - a).dot(direction) < 0.0 {
            all.push(WalkQuery {
                origin: from.to_array(),
                link: shell.boundary()[boundary],
                direction: direction.to_array(),
                t_min: 0.0,
                t_max: random.within(1.0, 40.0),
                pad0: 0,
                pad1: 0,
                pad2: 0,
            });
        }
    }
    all
}

/// Numbers that differ by more than what another order of rounding makes of lengths of some tens, texels included.
fn differences(expected: &[WalkSum], found: &[WalkSum]) -> usize {
    assert_eq!(expected.len(), found.len());
    let numbers =
        |sum: &WalkSum| [sum.volume[0], sum.volume[1], sum.volume[2], sum.length, sum.texels, sum.chosen, sum.width];
    let differs = |a: &WalkSum, b: &WalkSum| {
        let is_close = |(a, b): (f32, f32)| (a - b).abs() <= 1e-3 + 1e-3 * a.abs();
        // Also where one is not a number.
        !numbers(a).into_iter().zip(numbers(b)).all(is_close)
    };
    expected.iter().zip(found).filter(|(a, b)| differs(a, b)).count()
}

#[test]
fn gpu_walks_100_000_rays_through_a_skin_like_the_cpu() {
    let Some(gpu) = gpu("gpu_walks_100_000_rays_through_a_skin_like_the_cpu") else { return };
    let (skin, patterns) = (skin(), patterns());
    let params = ShellParams { tolerance: 0.02, ..ShellParams::default() };
    let mut shell = Shell::new(&skin, &params).unwrap();
    let mut sums = Vec::new();
    for time_s in [None, Some(2.5)] {
        if let Some(time_s) = time_s {
            let wind = Wind { speed_m_per_s: 8.0, gust_wavelength_m: 5.0, flutter: 0.1, ..Wind::default() };
            shell.refresh(&wind.displace(&skin, time_s).unwrap()).unwrap();
        }
        let queries = queries(&shell, 50_000);
        let expected: Vec<WalkSum> = queries.iter().map(|query| cpu_walk(&shell, &patterns, query)).collect();
        let found = gpu_walk(&gpu, &shell, &patterns, &queries).unwrap();
        // A ray that grazes a side may lie on either side of it.
        let wrong = differences(&expected, &found);
        assert!(wrong <= queries.len() / 2000, "{wrong} of {}", queries.len());
        let total = |get: &dyn Fn(&WalkSum) -> f64| expected.iter().map(get).sum::<f64>() / expected.len() as f64;
        assert!(total(&|sum| f64::from(sum.intervals)) > 5.0 && total(&|sum| f64::from(sum.spans)) > 2.0);
        assert!(total(&|sum| f64::from(sum.length)) > 0.05);
        sums.push((queries, expected));
    }
    // Planted: another seed, a swapped link and a moved position are each told apart.
    let (queries, expected) = &sums[1];
    let mut other = patterns.clone();
    other[1].seed += 1;
    assert!(differences(expected, &gpu_walk(&gpu, &shell, &other, queries).unwrap()) > queries.len() / 10);
    let still = Shell::new(&skin, &params).unwrap();
    assert!(differences(expected, &gpu_walk(&gpu, &still, &patterns, queries).unwrap()) > queries.len() / 10);
}
