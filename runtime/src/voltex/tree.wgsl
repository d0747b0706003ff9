// Lookup in the tree of voxels. Twin: voltex/tree.rs, which has the layout.

// The cell around a point: at the level asked for or, where that is empty, at the coarsest level at which the cell is
// empty; where that is not loaded, at the finest level that is.
struct VoltexCell {
    // Binary logarithm of the cell's side in finest voxels.
    size: u32,
    // Number of the cell's voxel, or VOLTEX_NO_VOXEL.
    voxel: u32,
    // Number of the voxel of the cell twice as large around it, or VOLTEX_NO_VOXEL.
    parent: u32,
}

// Returns the cell at `level`, at most the coarsest, around the finest voxel `q`.
fn voltex_cell(base: u32, q: vec3<u32>, level: u32) -> VoltexCell {
    let last = level / 2u;
    var parent = VOLTEX_NO_VOXEL;
    var node = voltex_node(base, 0u);
    for (var j = voltex_node_depth(voltex_level_count(base)) - 1u; j > last; j--) {
        let cell = voltex_cell_number((q >> vec3<u32>(2u * j)) & vec3<u32>(3u));
        if !voltex_has(node, cell) {
            let size = 2u * j + select(1u, 0u, voltex_has_coarse(node, cell >> 3u));
            return VoltexCell(size, VOLTEX_NO_VOXEL, VOLTEX_NO_VOXEL);
        }
        let rank = voltex_rank(node, cell);
        parent = node.first_voxel + voltex_coarse_rank(node, 8u) + rank;
        let child = voltex_node(base, node.first_child + rank);
        if child.first_voxel == VOLTEX_NO_VOXEL {
            return VoltexCell(2u * j, parent, node.first_voxel + voltex_coarse_rank(node, cell >> 3u));
        }
        node = child;
    }
    let cell = voltex_cell_number((q >> vec3<u32>(2u * last)) & vec3<u32>(3u));
    var above = VOLTEX_NO_VOXEL;
    if voltex_has_coarse(node, cell >> 3u) {
        above = node.first_voxel + voltex_coarse_rank(node, cell >> 3u);
    }
    if (level & 1u) == 1u {
        return VoltexCell(level, above, parent);
    }
    if voltex_has(node, cell) {
        let own = node.first_voxel + voltex_coarse_rank(node, 8u) + voltex_rank(node, cell);
        return VoltexCell(level, own, above);
    }
    return VoltexCell(level + select(0u, 1u, above == VOLTEX_NO_VOXEL), VOLTEX_NO_VOXEL, above);
}
