// Traversal of a volume by a ray, cell by cell. Twin: voltex/walk.rs.
//
//     var walk = voltex_walk_new(base, origin, direction, t0, t1);
//     while walk.t < walk.t_end {
//         let segment = voltex_walk_next(base, &walk, level);
//     }

const VOLTEX_MIN_DIRECTION: f32 = 1e-20;
// Larger than any t; the twin has infinity.
const VOLTEX_FAR: f32 = 3e38;

// The part of a ray within one cell.
struct VoltexSegment {
    t0: f32,
    t1: f32,
    cell: VoltexCell,
}

// The state of a traversal.
struct VoltexWalk {
    origin: vec3<f32>,
    direction: vec3<f32>,
    inverse: vec3<f32>,
    t: f32,
    t_end: f32,
    // Coordinates of the current finest voxel.
    q: vec3<i32>,
    resolution: i32,
}

// Begins a traversal along a ray in texture space between `t0` and `t1`, cut to the unit cube. It has no cells if a
// number of the ray is not finite. The direction need not be unit, so that t can be the same as in the world.
fn voltex_walk_new(base: u32, origin: vec3<f32>, direction: vec3<f32>, t0: f32, t1: f32) -> VoltexWalk {
    let least = select(vec3<f32>(VOLTEX_MIN_DIRECTION), vec3<f32>(-VOLTEX_MIN_DIRECTION), direction < vec3<f32>(0.0));
    let inverse = 1.0 / select(direction, least, abs(direction) < vec3<f32>(VOLTEX_MIN_DIRECTION));
    // Tests the bits, because compilers may assume that all numbers are finite.
    let infinity = vec3<u32>(0x7f800000u);
    let exponents = max(bitcast<vec3<u32>>(origin) & infinity, bitcast<vec3<u32>>(direction) & infinity);
    let finite = all(exponents < infinity);
    let a = -origin * inverse;
    let b = (1.0 - origin) * inverse;
    let low = min(a, b);
    let high = max(a, b);
    let start = max(max(t0, low.x), max(low.y, low.z));
    let end = min(min(t1, high.x), min(high.y, high.z));
    let resolution = i32(1u << voltex_level_count(base));
    var walk = VoltexWalk(origin, direction, inverse, start, select(start, end, finite), vec3<i32>(0), resolution);
    walk.q = voltex_walk_voxel_along(walk, start, vec3<i32>(0), vec3<i32>(resolution - 1));
    return walk;
}

// Returns the finest voxel at t, clamped to `least` and `most`.
fn voltex_walk_voxel_along(walk: VoltexWalk, t: f32, least: vec3<i32>, most: vec3<i32>) -> vec3<i32> {
    let place = floor((walk.origin + walk.direction * t) * f32(walk.resolution));
    return vec3<i32>(clamp(place, vec3<f32>(least), vec3<f32>(most)));
}

// Returns the next cell at `level`, of a traversal whose `t` is less than its `t_end`. Each step moves one coordinate
// on and none back, however t rounds: there are at most three times the voxels a side.
fn voltex_walk_next(base: u32, walk: ptr<function, VoltexWalk>, level: u32) -> VoltexSegment {
    let cell = voltex_cell(base, vec3<u32>((*walk).q), min(level, voltex_level_count(base)));
    let low = ((*walk).q >> vec3<u32>(cell.size)) << vec3<u32>(cell.size);
    let last = low + vec3<i32>((1 << cell.size) - 1);
    let ahead = (*walk).inverse > vec3<f32>(0.0);
    let planes = vec3<f32>(select(low, last + vec3<i32>(1), ahead)) / f32((*walk).resolution);
    let exits = (planes - (*walk).origin) * (*walk).inverse;
    var exit = VOLTEX_FAR;
    var through = vec3<bool>(true, false, false);
    if exits.x < exit {
        exit = exits.x;
    }
    if exits.y < exit {
        exit = exits.y;
        through = vec3<bool>(false, true, false);
    }
    if exits.z < exit {
        exit = exits.z;
        through = vec3<bool>(false, false, true);
    }
    let t0 = (*walk).t;
    let t_end = (*walk).t_end;
    (*walk).t = max(exit, t0);
    let within = voltex_walk_voxel_along(*walk, (*walk).t, select(low, (*walk).q, ahead), select((*walk).q, last, ahead));
    let q = select(within, select(low - vec3<i32>(1), last + vec3<i32>(1), ahead), through);
    (*walk).q = q;
    if any(q < vec3<i32>(0)) || any(q >= vec3<i32>((*walk).resolution)) {
        (*walk).t = t_end;
    }
    return VoltexSegment(t0, clamp(exit, t0, t_end), cell);
}
