// The texels that a straight stretch of a ray meets in texture space. Twin: cell.rs.

const MAX_CELLS: u32 = 4096u;
const MAX_COORDINATE: f32 = 16777216.0;

// No span where t1 is not beyond t0.
struct CellSpan {
    t0: f32,
    t1: f32,
    cell: vec2<i32>,
}

struct CellWalk {
    ray: TextureRay,
    t0: f32,
    at: f32,
    end: f32,
    left: u32,
    cell: vec2<i32>,
    last: vec2<i32>,
}

// Returns the walk over the texels of `ray` between t0, where its point is, and t1.
fn cell_new(ray: TextureRay, t0: f32, t1: f32) -> CellWalk {
    let whole = max(t1 - t0, 0.0);
    var at = 0.0;
    var end = whole;
    // Keep what is between floor and lid; a division is only made by what leads across them.
    let w = ray.point.z;
    let along = ray.direction.z;
    let w_end = w + end * along;
    let is_outside = (w < 0.0 && w_end < 0.0) || (w > 1.0 && w_end > 1.0);
    if !is_outside {
        if w < 0.0 {
            at = clamp(-w / along, 0.0, whole);
        } else if w > 1.0 {
            at = clamp((1.0 - w) / along, 0.0, whole);
        }
        if w_end < 0.0 {
            end = clamp(-w / along, 0.0, whole);
        } else if w_end > 1.0 {
            end = clamp((1.0 - w) / along, 0.0, whole);
        }
    }
    let is_full = at < end && !is_outside;
    let first = cell_of(ray.point + at * ray.direction);
    let last = cell_of(ray.point + end * ray.direction);
    return CellWalk(ray, t0, at, end, select(0u, MAX_CELLS, is_full), first, last);
}

// Returns the next span that is longer than nothing.
fn cell_step(walk: ptr<function, CellWalk>) -> CellSpan {
    var span = CellSpan(0.0, 0.0, vec2<i32>(0));
    while (*walk).left > 0u {
        (*walk).left -= 1u;
        let here = *walk;
        if all(here.cell == here.last) || here.left == 0u {
            (*walk).left = 0u;
            (*walk).at = here.end;
        } else {
            let along_u = cell_crossing(here.end, here.cell.x, here.last.x, here.ray.point.x, here.ray.direction.x);
            let along_v = cell_crossing(here.end, here.cell.y, here.last.y, here.ray.point.y, here.ray.direction.y);
            // The border that comes first, of the axes that have not arrived.
            if here.cell.x == here.last.x || (here.cell.y != here.last.y && along_v < along_u) {
                (*walk).at = clamp(along_v, here.at, here.end);
                (*walk).cell.y += select(-1, 1, here.last.y > here.cell.y);
            } else {
                (*walk).at = clamp(along_u, here.at, here.end);
                (*walk).cell.x += select(-1, 1, here.last.x > here.cell.x);
            }
        }
        if (*walk).at > here.at {
            span = CellSpan(here.t0 + here.at, here.t0 + (*walk).at, here.cell);
            break;
        }
    }
    return span;
}

// Returns where a ray leaves the texel along an axis on which it has not arrived.
fn cell_crossing(end: f32, cell: i32, last: i32, point: f32, direction: f32) -> f32 {
    if cell == last {
        return end;
    }
    return (f32(cell + select(0, 1, last > cell)) - point) / direction;
}

// Returns the texel around a point of the texture.
fn cell_of(texture: vec3<f32>) -> vec2<i32> {
    return vec2<i32>(clamp(floor(texture.xy), vec2<f32>(-MAX_COORDINATE), vec2<f32>(MAX_COORDINATE)));
}

// Hashes a texel: everything that is drawn for it comes from this number alone.
fn cell_hash(cell: vec2<i32>, seed: u32) -> u32 {
    return sampler_hash(bitcast<u32>(cell.x) ^ sampler_hash(bitcast<u32>(cell.y) ^ sampler_hash(seed)));
}

// Returns the share in [0, 1) that a texel has drawn.
fn cell_share(hashed: u32, draw: u32) -> f32 {
    return sampler_one(hashed ^ ((draw << 24u) | draw));
}
