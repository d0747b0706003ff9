// A node of the tree of voxels. Twin: voltex/node.rs, which has the layout.

const VOLTEX_NODE_WORDS: u32 = 4u;
const VOLTEX_NO_VOXEL: u32 = 0xffffffffu;

struct VoltexNode {
    // Bits of the 64 cells in Morton order: 1 for a cell that is not empty.
    mask: vec2<u32>,
    first_voxel: u32,
    first_child: u32,
}

fn voltex_has(node: VoltexNode, cell: u32) -> bool {
    return ((select(node.mask.y, node.mask.x, cell < 32u) >> (cell & 31u)) & 1u) == 1u;
}

fn voltex_has_coarse(node: VoltexNode, coarse: u32) -> bool {
    return ((select(node.mask.y, node.mask.x, coarse < 4u) >> (8u * (coarse & 3u))) & 255u) != 0u;
}

// Returns how many of the cells before `cell`, at most 63, are not empty.
fn voltex_rank(node: VoltexNode, cell: u32) -> u32 {
    let below = (1u << (cell & 31u)) - 1u;
    if cell < 32u {
        return countOneBits(node.mask.x & below);
    }
    return countOneBits(node.mask.x) + countOneBits(node.mask.y & below);
}

// Returns how many of the coarser cells before `coarse` are not empty; 8 for all.
fn voltex_coarse_rank(node: VoltexNode, coarse: u32) -> u32 {
    // Sets the lowest bit of each byte that is not 0.
    let pairs = node.mask | (node.mask >> vec2<u32>(1u));
    let fours = pairs | (pairs >> vec2<u32>(2u));
    let bytes = (fours | (fours >> vec2<u32>(4u))) & vec2<u32>(0x01010101u);
    // Shifts twice, because a shift by 32 does nothing.
    let half = 4u * min(vec2<u32>(coarse, max(coarse, 4u) - 4u), vec2<u32>(4u));
    let below = bytes & ~((vec2<u32>(0xffffffffu) << half) << half);
    return countOneBits(below.x) + countOneBits(below.y);
}

// Returns the number of layers of nodes.
fn voltex_node_depth(level_count: u32) -> u32 {
    return level_count / 2u + 1u;
}

// Returns the number of the cell with these coordinates, 0 to 3.
fn voltex_cell_number(q: vec3<u32>) -> u32 {
    // Spreads the two bits of a coordinate to every third.
    let spread = (q & vec3<u32>(1u)) | ((q & vec3<u32>(2u)) << vec3<u32>(2u));
    return spread.x | (spread.y << 1u) | (spread.z << 2u);
}
