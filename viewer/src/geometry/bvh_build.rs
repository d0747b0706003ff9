//! Builds hierarchies of eight children a node, by the crate obvhs: neighbours are merged [Meister 2018], parts moved to where
//! they fit better [Meister 2018b], and two children made eight [Ylitie 2017].

use crate::geometry::bvh_node::{Bounds, BvhNode, CHILDREN, Child};
use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::ploc::PlocBuilder;

/// Largest share of a box's side by which it is moved while the hierarchy is built.
const UNEVENNESS: f32 = 1e-3;
/// Boxes that are tried elsewhere in a hierarchy, as far as that is between these shares of them: more would cost more time than
/// they save.
const MOVED: f32 = 1e5;
const MOVED_SHARE: [f32; 2] = [0.05, 1.0];

/// Builds a hierarchy over boxes (at least one), of which leaves hold `per_leaf` at most, 1 to 3. Returns its nodes, and the
/// numbers of the boxes in the order of the leaves. Nodes and boxes are numbered from `first_node` and `first_primitive`; the root
/// is the first node, and children stand behind their parents. The nodes' boxes are to be [fitted](fit).
///
/// Deterministic. Cost: about 1 us per box, 2 us where there are fewer than 100,000.
pub(crate) fn build(
    boxes: &[Bounds],
    per_leaf: u32,
    first_node: usize,
    first_primitive: usize,
) -> (Vec<BvhNode>, Vec<u32>) {
    // Of boxes in one place, or in a row at equal distances, each would be merged with all before it, and the hierarchy as deep as
    // there are boxes. So that no two distances are equal, boxes are a little off while it is built.
    let uneven: Vec<Aabb> = boxes.iter().enumerate().map(|(number, own)| moved(own, number as u32)).collect();
    let [least, most] = MOVED_SHARE;
    let params = BvhBuildParams::medium_build();
    // Step by step, as obvhs has one function for it that asks the time, which a browser has no clock for.
    let mut pairs = PlocBuilder::with_capacity(uneven.len()).build(
        params.ploc_search_distance,
        &uneven,
        (0..uneven.len() as u32).collect(),
        params.sort_precision,
        params.search_depth_threshold,
    );
    ReinsertionOptimizer::default().run(&mut pairs, (MOVED / boxes.len() as f32).clamp(least, most), None);
    let built = bvh2_to_cwbvh(&pairs, per_leaf, true, false);
    let node = |node: &obvhs::cwbvh::node::CwBvhNode| BvhNode {
        lo: [0.0; 3],
        exponents: [0, 0, 0, node.imask],
        first_child: node.child_base_idx + first_node as u32,
        first_primitive: node.primitive_base_idx + first_primitive as u32,
        slots: node.child_meta,
        planes: [[0; CHILDREN]; 6],
    };
    (built.nodes.iter().map(node).collect(), built.primitive_indices)
}

/// Returns a box moved by a share of its sides that depends on its number.
fn moved(own: &Bounds, number: u32) -> Aabb {
    let [lo, hi] = [own.lo, own.hi].map(Vec3A::from);
    // Fractions of the golden ratio's multiples, and its powers', are spread evenly and differ from neighbour to neighbour.
    let spread = [0x9e37_79b9, 0x6187_2cd5, 0x3c6e_f372u32].map(|step| {
        let mixed = number.wrapping_mul(step);
        (mixed ^ mixed >> 15).wrapping_mul(0x2c1b_3c6d) as f32 / u32::MAX as f32
    });
    let away = (hi - lo) * Vec3A::from(spread) * UNEVENNESS;
    Aabb::new(lo + away, hi + away)
}

/// Gives the nodes from number `first_node` on their boxes, from those of their primitives. Returns the box of each node. Cost: a
/// pass over the nodes.
pub(crate) fn fit(nodes: &mut [BvhNode], first_node: usize, of_primitive: impl Fn(u32) -> Bounds) -> Vec<Bounds> {
    let mut all = vec![Bounds::EMPTY; nodes.len()];
    // Children stand behind their parents.
    for (number, node) in nodes.iter_mut().enumerate().rev() {
        let boxes: [Bounds; CHILDREN] = std::array::from_fn(|slot| match node.child(slot) {
            Some(Child::Node(child)) => all[child as usize - first_node],
            Some(Child::Leaf(first, count)) => {
                (first..first + count).map(&of_primitive).fold(Bounds::EMPTY, Bounds::add)
            }
            None => Bounds::EMPTY,
        });
        node.set_boxes(boxes);
        all[number] = boxes.into_iter().fold(Bounds::EMPTY, Bounds::add);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Checks that every box is in one leaf, and returns how deep the hierarchy is.
    fn depth_of(boxes: &[Bounds], per_leaf: u32) -> usize {
        let (nodes, order) = build(boxes, per_leaf, 7, 11);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..boxes.len() as u32));
        let mut seen = vec![0; boxes.len()];
        let mut open = vec![(7u32, 0)];
        let mut deepest = 0;
        while let Some((number, depth)) = open.pop() {
            deepest = deepest.max(depth);
            let node = nodes[number as usize - 7];
            for child in (0..CHILDREN).filter_map(|slot| node.child(slot)) {
                match child {
                    Child::Node(child) => {
                        assert!(child > number);
                        open.push((child, depth + 1));
                    }
                    Child::Leaf(first, count) => {
                        assert!((1..=per_leaf).contains(&count));
                        (first..first + count).for_each(|primitive| seen[primitive as usize - 11] += 1);
                    }
                }
            }
        }
        assert!(seen.iter().all(|count| *count == 1));
        deepest
    }

    #[test]
    fn hierarchies_are_flat_even_where_boxes_are_all_alike() {
        let unit = |at: Vec3| Bounds { lo: at, hi: at + Vec3::ONE };
        let pile = vec![unit(Vec3::ZERO); 20_000];
        let row: Vec<Bounds> = (0..20_000).map(|x| unit(Vec3::X * x as f32 * 1.5)).collect();
        let flat: Vec<Bounds> = row.iter().map(|own| Bounds { hi: own.hi.with_y(0.0), ..*own }).collect();
        let grid: Vec<Bounds> = (0..20_000).map(|i| unit(Vec3::new((i % 141) as f32, 0.0, (i / 141) as f32))).collect();
        for boxes in [pile, row, flat, grid] {
            for per_leaf in [1, 3] {
                let depth = depth_of(&boxes, per_leaf);
                assert!(depth < 16, "{depth}");
            }
        }
        // Each twice as large as the last: no hierarchy of them is flat.
        let nested: Vec<Bounds> = (0..60).map(|i| Bounds { lo: Vec3::ZERO, hi: Vec3::splat(2f32.powi(i)) }).collect();
        assert!(depth_of(&nested, 3) < 30);
        (1..20).for_each(|count| assert!(depth_of(&vec![unit(Vec3::ZERO); count], 3) < 4));
    }
}
