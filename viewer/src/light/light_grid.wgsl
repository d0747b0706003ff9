// Draws point lights by about what each adds at a place: a grid over the scene has for each of its cells ranges of
// neighbouring lights with their shares. Twin: light_grid.rs, which says how the pairs of numbers lie; the lights are in
// the order of the grid already.

// Pairs of numbers before those of the lights.
const LIGHT_GRID_HEAD: u32 = 6u;
// Lights that are looked at for each that is drawn.
const LIGHT_CANDIDATES: u32 = 8u;
// Greatest number that lights are drawn by.
const BELOW_ONE: f32 = 0.99999994;

// A light that was drawn.
struct DrawnLight {
    // The range that it is of, which greater numbers need not look before.
    range: u32,
    // Number of the light.
    index: u32,
    // 1 over its probability.
    weight: f32,
}

// Reads a pair of the grid's numbers, which stand behind the lights.
fn light_grid_pair(index: u32) -> vec2<f32> {
    let both = light_words[2u * frame.light_count + index / 2u];
    return select(both.xy, both.zw, (index & 1u) == 1u);
}

// Returns the first pair of the cell in which `position` lies, or of the nearest one.
fn light_grid_cell(position: vec3<f32>) -> u32 {
    let lo_xy = light_grid_pair(0u);
    let lo_z = light_grid_pair(1u);
    let per_unit = vec3<f32>(light_grid_pair(2u), light_grid_pair(3u).x);
    let count = vec3<f32>(light_grid_pair(4u), light_grid_pair(5u).x);
    let cells = vec3<u32>(count);
    let at = vec3<u32>(clamp((position - vec3<f32>(lo_xy, lo_z.x)) * per_unit, vec3<f32>(0.0), count - 1.0));
    let cell = (at.z * cells.y + at.y) * cells.x + at.x;
    return LIGHT_GRID_HEAD + frame.light_count + 1u + cell * (u32(lo_z.y) + 1u);
}

// Returns the range of a cell that a number in [0, 1) draws from.
fn light_grid_range(cell: u32, x: f32) -> u32 {
    return light_grid_step(cell, u32(light_grid_pair(1u).y), x);
}

// Returns which of `count` pairs from `first` on begins the step that holds `x`.
fn light_grid_step(first: u32, count: u32, x: f32) -> u32 {
    var low = first;
    var left = count;
    while left > 1u {
        let half = left / 2u;
        low += select(0u, half, light_grid_pair(low + half).x <= x);
        left -= half;
    }
    return low;
}

// Draws a light by a number in [0, 1), of the range `begin` or one behind it; neighbouring numbers draw neighbouring
// lights.
fn light_grid_draw(begin: u32, x: f32) -> DrawnLight {
    var range = begin;
    while light_grid_pair(range + 1u).x <= x {
        range++;
    }
    let own = light_grid_pair(range);
    let next = light_grid_pair(range + 1u);
    let first = LIGHT_GRID_HEAD + u32(own.y);
    let end = LIGHT_GRID_HEAD + u32(next.y);
    let before = light_grid_pair(first).x;
    let power_per_share = (light_grid_pair(end).x - before) / (next.x - own.x);
    let at = light_grid_step(first, end - first, before + (x - own.x) * power_per_share);
    let power = light_grid_pair(at + 1u).x - light_grid_pair(at).x;
    return DrawnLight(range, at - LIGHT_GRID_HEAD, power_per_share / power);
}
