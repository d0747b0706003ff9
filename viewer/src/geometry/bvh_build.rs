//! Builds hierarchies: two children per node, split by the surface-area heuristic over bins [Wald 2007].

use crate::geometry::bvh_node::{Bounds, BvhNode};
use glam::Vec3;

/// Bins per axis of the split search.
const BINS: usize = 16;

/// An item that a hierarchy is built over.
pub(crate) struct Item {
    bounds: Bounds,
    centre: Vec3,
    /// Number of the item before sorting.
    pub index: u32,
}

impl Item {
    /// Returns item number `index` with its bounds.
    pub(crate) fn new(index: usize, bounds: Bounds) -> Item {
        Item { bounds, centre: (bounds.lo + bounds.hi) * 0.5, index: index as u32 }
    }
}

/// The limits of splitting.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BuildParams {
    /// Items up to which a node is not split.
    pub least_items: usize,
    /// Items that a leaf may keep where no split pays.
    pub most_items: usize,
    /// Depth from which nodes are halved by count, which bounds the depth: by as many levels more as the binary
    /// logarithm of the number of items.
    pub halving_depth: usize,
}

/// Sorts `items` (not empty) into leaf order and builds the hierarchy over them. Nodes and items are numbered from
/// `first_node` and `first_item`; the root is the first node.
///
/// Deterministic. Cost: O(n log n), about 1 us per item.
pub(crate) fn build(items: &mut [Item], params: BuildParams, first_node: usize, first_item: usize) -> Vec<BvhNode> {
    let empty: BvhNode = bytemuck::Zeroable::zeroed();
    let mut nodes = vec![empty];
    // Split every open node until all are leaves: (node, its items, depth).
    let mut open = vec![(0usize, 0..items.len(), 0usize)];
    while let Some((node, range, depth)) = open.pop() {
        let bounds = items[range.clone()].iter().fold(Bounds::EMPTY, |all, item| all.add(item.bounds));
        let middle = split(&mut items[range.clone()], params, bounds, depth).map(|left| range.start + left);
        let mut made = BvhNode {
            lo: bounds.lo.to_array(),
            first: (first_item + range.start) as u32,
            hi: bounds.hi.to_array(),
            count: range.len() as u32,
        };
        if let Some(middle) = middle {
            let left = nodes.len();
            made.first = (first_node + left) as u32;
            made.count = 0;
            nodes.extend([empty; 2]);
            open.push((left + 1, middle..range.end, depth + 1));
            open.push((left, range.start..middle, depth + 1));
        }
        nodes[node] = made;
    }
    nodes
}

/// Sorts the slice for a split and returns the number of items that go to the left; `None` for a leaf.
fn split(items: &mut [Item], params: BuildParams, bounds: Bounds, depth: usize) -> Option<usize> {
    if items.len() <= params.least_items {
        return None;
    }
    let centres = items.iter().fold(Bounds::EMPTY, |all, item| all.add_point(item.centre));
    let extent = centres.hi - centres.lo;
    let mut best: Option<(f32, usize, usize)> = None;
    if depth < params.halving_depth {
        for axis in 0..3 {
            if extent[axis] <= 0.0 {
                continue;
            }
            let mut bins = [(Bounds::EMPTY, 0usize); BINS];
            for item in items.iter() {
                let bin = &mut bins[bin_of(item.centre[axis], centres.lo[axis], extent[axis])];
                *bin = (bin.0.add(item.bounds), bin.1 + 1);
            }
            let mut right = [(0.0f32, 0usize); BINS];
            let mut all = (Bounds::EMPTY, 0);
            for bin in (1..BINS).rev() {
                all = (all.0.add(bins[bin].0), all.1 + bins[bin].1);
                right[bin] = (all.0.half_area(), all.1);
            }
            let mut left = (Bounds::EMPTY, 0);
            for bin in 1..BINS {
                left = (left.0.add(bins[bin - 1].0), left.1 + bins[bin - 1].1);
                if left.1 == 0 || right[bin].1 == 0 {
                    continue;
                }
                let cost = left.0.half_area() * left.1 as f32 + right[bin].0 * right[bin].1 as f32;
                if best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, axis, bin));
                }
            }
        }
    }
    if let Some((cost, axis, bin)) = best
        && (cost < bounds.half_area() * items.len() as f32 || items.len() > params.most_items)
    {
        // Partition in place; the order within a side is that of the input, which keeps the build deterministic.
        let key = |item: &Item| bin_of(item.centre[axis], centres.lo[axis], extent[axis]) >= bin;
        items.sort_by_key(key);
        return Some(items.partition_point(|item| !key(item)));
    }
    if items.len() <= params.most_items && depth < params.halving_depth {
        return None;
    }
    // No useful plane (all centres in one place, or too deep): halve along the longest axis.
    let axis = extent.max_position();
    items.sort_by(|a, b| a.centre[axis].total_cmp(&b.centre[axis]));
    Some(items.len() / 2)
}

fn bin_of(centre: f32, lo: f32, extent: f32) -> usize {
    (((centre - lo) / extent * BINS as f32) as usize).min(BINS - 1)
}
