//! A binary tree over point lights: each node is a range of them that lie close together, and a few nodes stand for all
//! lights as seen from a place, a light cut [Walter 2005].

use crate::geometry::bvh_node::Bounds;
use glam::{DVec3, Vec3};
use std::collections::BinaryHeap;

/// Least mean squared distance by which is divided: a light may stand in the place itself.
const MIN_DISTANCE2: f64 = 1e-30;

/// A point light as far as it is drawn by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TreeLight {
    /// Position, world space.
    pub position: Vec3,
    /// The greatest component of its intensity, 0 or more.
    pub power: f32,
}

/// A node: lights that stand one after the other in the tree's order.
#[derive(Debug, Clone, Copy)]
struct LightRange {
    first: u32,
    end: u32,
    /// Number of the first of its two children, which follow one another; 0 for a single light.
    children: u32,
    power: f64,
    /// Mean position by power.
    centre: DVec3,
    /// Mean squared distance from `centre` by power.
    spread: f64,
}

/// A node of a cut.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CutRange {
    /// The first of the node's lights, as a place in the tree's order.
    pub first: u32,
    /// Power over the mean squared distance, 0 or more.
    pub importance: f64,
}

/// The tree.
#[derive(Debug, Clone)]
pub(crate) struct LightTree {
    /// Numbers of the lights, neighbours beside each other.
    pub order: Vec<u32>,
    nodes: Vec<LightRange>,
}

impl LightTree {
    /// Builds the tree over `lights`: halves of equal numbers, along the longest side of the box around a node's lights.
    /// Deterministic. Cost: about 0.3 us per light.
    pub(crate) fn new(lights: &[TreeLight]) -> LightTree {
        let mut order: Vec<u32> = (0..lights.len() as u32).collect();
        let mut nodes = Vec::with_capacity(2 * lights.len());
        if !lights.is_empty() {
            nodes.push(LightRange::new(lights, &order, 0));
        }
        let mut next = 0;
        while let Some(node) = nodes.get(next).copied() {
            let own = &mut order[node.first as usize..node.end as usize];
            if own.len() > 1 {
                let places = own.iter().map(|light| lights[*light as usize].position);
                let Bounds { lo, hi } = places.fold(Bounds::EMPTY, Bounds::add_point);
                let axis = (hi - lo).max_position();
                let along = |light: &u32| lights[*light as usize].position[axis];
                let half = own.len() / 2;
                own.select_nth_unstable_by(half, |a, b| along(a).total_cmp(&along(b)).then(a.cmp(b)));
                nodes[next].children = nodes.len() as u32;
                let (low, high) = own.split_at(half);
                nodes.push(LightRange::new(lights, low, node.first));
                nodes.push(LightRange::new(lights, high, node.first + half as u32));
            }
            next += 1;
        }
        LightTree { order, nodes }
    }

    /// Returns `most` ranges, or as many as there are lights, that hold every light once, in their order, for places of the
    /// mean position `place` and the mean squared distance `spread` from it: again and again the range is halved whose
    /// lights differ most in what they add. Cost: about 60 ns per range.
    pub(crate) fn cut(&self, place: Vec3, spread: f64, most: usize) -> Vec<CutRange> {
        let place = place.as_dvec3();
        let mut singles = Vec::with_capacity(most);
        let mut waiting = BinaryHeap::with_capacity(most);
        let take = |node: u32, singles: &mut Vec<u32>, waiting: &mut BinaryHeap<(u64, u32)>| {
            let range = &self.nodes[node as usize];
            match range.children {
                0 => singles.push(node),
                // Numbers that are not negative are in the order of their bits.
                _ => waiting.push((range.unevenness(place, spread).to_bits(), node)),
            }
        };
        if !self.nodes.is_empty() {
            take(0, &mut singles, &mut waiting);
        }
        while singles.len() + waiting.len() < most
            && let Some((_, node)) = waiting.pop()
        {
            let children = self.nodes[node as usize].children;
            take(children, &mut singles, &mut waiting);
            take(children + 1, &mut singles, &mut waiting);
        }
        singles.extend(waiting.into_iter().map(|(_, node)| node));
        let range = |node: u32| {
            let range = &self.nodes[node as usize];
            CutRange { first: range.first, importance: range.importance(place, spread) }
        };
        let mut cut: Vec<CutRange> = singles.into_iter().map(range).collect();
        cut.sort_unstable_by_key(|range| range.first);
        cut
    }
}

impl LightRange {
    /// Makes the node of the lights `own`, which begin at `first` in the tree's order.
    fn new(lights: &[TreeLight], own: &[u32], first: u32) -> LightRange {
        let own = || own.iter().map(|light| lights[*light as usize]);
        let count = own().len();
        let power: f64 = own().map(|light| f64::from(light.power)).sum();
        // Lights without power lie somewhere, too.
        let weight = |light: &TreeLight| if power > 0.0 { f64::from(light.power) / power } else { 1.0 / count as f64 };
        let centre = own().map(|light| weight(&light) * light.position.as_dvec3()).sum::<DVec3>();
        let spread =
            own().map(|light| weight(&light) * light.position.as_dvec3().distance_squared(centre)).sum::<f64>();
        let spread = if count > 1 { spread } else { 0.0 };
        LightRange { first, end: first + count as u32, children: 0, power, centre, spread }
    }

    /// Returns the mean squared distance of the lights from places around `place`.
    fn distance2(&self, place: DVec3, spread: f64) -> f64 {
        (self.centre.distance_squared(place) + self.spread + spread).max(MIN_DISTANCE2)
    }

    /// Returns about what the lights add at places around `place`, at normal incidence.
    fn importance(&self, place: DVec3, spread: f64) -> f64 {
        self.power / self.distance2(place, spread)
    }

    /// Returns how far the lights are from adding the same each, as a variance, 0 or more.
    fn unevenness(&self, place: DVec3, spread: f64) -> f64 {
        let distance2 = self.distance2(place, spread);
        let importance = self.power / distance2;
        importance * importance * self.spread / distance2
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler;

    /// Lights of uneven power in a cube, a few of them in one place.
    fn lights(count: u32) -> Vec<TreeLight> {
        let light = |number: u32| {
            let [x, y, z, power] = [0, 1, 2, 3].map(|axis| sampler::one(4 * number + axis));
            let position = if number % 10 == 3 { Vec3::splat(0.5) } else { Vec3::new(x, y, z) };
            TreeLight { position, power: power * power }
        };
        (0..count).map(light).collect()
    }

    #[test]
    fn a_cut_holds_every_light_once_and_is_finer_where_lights_are_near() {
        for count in [0, 1, 2, 3, 31, 1000] {
            let lights = lights(count);
            let tree = LightTree::new(&lights);
            let mut sorted = tree.order.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..count));
            let place = Vec3::new(0.1, 0.2, 0.3);
            let cut = tree.cut(place, 1e-3, 31);
            assert_eq!(cut.len(), 31.min(count as usize));
            assert!(cut.windows(2).all(|pair| pair[0].first < pair[1].first), "{count}");
            // Every range ends where the next one begins, so that none is left out.
            let is_node = |first: u32, end: u32| tree.nodes.iter().any(|node| (node.first, node.end) == (first, end));
            let ends = cut.iter().map(|range| range.first).skip(1).chain([count]);
            assert!(cut.iter().zip(ends).all(|(range, end)| is_node(range.first, end)), "{count}");
        }
        let lights = lights(1000);
        let tree = LightTree::new(&lights);
        // Lights of the range that a light is of, in the mean over the lights near the origin, and over the others.
        let cut = tree.cut(Vec3::ZERO, 1e-3, 31);
        let ends = cut.iter().map(|range| range.first).skip(1).chain([1000]);
        let (mut sums, mut counts) = ([0, 0], [0, 0]);
        for (range, end) in cut.iter().zip(ends) {
            for place in range.first..end {
                let near = lights[tree.order[place as usize] as usize].position.length() < 0.5;
                sums[usize::from(near)] += end - range.first;
                counts[usize::from(near)] += 1;
            }
        }
        let [far, near] = [0, 1].map(|which| f64::from(sums[which]) / f64::from(counts[which]));
        assert!(near < 0.5 * far, "{near} {far}");
    }
}
