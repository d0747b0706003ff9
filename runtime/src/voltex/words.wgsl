// The layout of a volume's words, counted from its first, whose number is `base`. Twin: voltex/words.rs, which has the
// contents.

const VOLTEX_LEVEL_COUNT_AT: u32 = 0u;
const VOLTEX_NODES_AT: u32 = 1u;
const VOLTEX_VOXELS_AT: u32 = 2u;
const VOLTEX_MATERIALS_AT: u32 = 3u;
const VOLTEX_LEVELS_AT: u32 = 4u;
const VOLTEX_FLAGS_AT: u32 = 5u;
const VOLTEX_EXTENT_AT: u32 = 6u;
const VOLTEX_SIDE_AT: u32 = 9u;
const VOLTEX_MATERIAL_WORDS: u32 = 4u;
const VOLTEX_CLUMPING_AT: u32 = 11u;
const VOLTEX_FACETS_AT: u32 = 17u;
const VOLTEX_LIGHT_CORRECTION_AT: u32 = 32u;
const VOLTEX_LEVEL_WORDS: u32 = 58u;
// Least squared length of a direction: what is shorter has none.
const VOLTEX_MIN_DIRECTION2: f32 = 1e-30;
// Largest logarithm of the factor on a level's light.
const VOLTEX_MAX_BRIGHTER: f32 = 1.5;

struct VoltexMaterial {
    // Share of the light that leaves on the side from which it came, linear sRGB.
    reflectance: vec3<f32>,
    // Share of the light that leaves on the other side.
    transmittance: vec3<f32>,
    // Reflectance of the smooth surface at normal incidence; 0 for no specular lobe.
    specular: f32,
    // Roughness of the smooth surface, GGX alpha.
    roughness: f32,
}

// Returns the binary logarithm of the number of the finest level's voxels a side.
fn voltex_level_count(base: u32) -> u32 {
    return asset_word(base + VOLTEX_LEVEL_COUNT_AT);
}

// Returns whether rays that leave at one end in x, and in y, come in at the other.
fn voltex_cyclic(base: u32) -> vec2<bool> {
    return ((vec2<u32>(asset_word(base + VOLTEX_FLAGS_AT)) >> vec2<u32>(0u, 1u)) & vec2<u32>(1u)) == vec2<u32>(1u);
}

// Returns the used part of the unit cube.
fn voltex_extent(base: u32) -> vec3<f32> {
    return voltex_three(base + VOLTEX_EXTENT_AT);
}

// Returns the side of the unit cube in metres.
fn voltex_side_m(base: u32) -> f32 {
    return asset_f32(base + VOLTEX_SIDE_AT);
}

fn voltex_node(base: u32, number: u32) -> VoltexNode {
    let at = base + asset_word(base + VOLTEX_NODES_AT) + number * VOLTEX_NODE_WORDS;
    let mask = vec2<u32>(asset_word(at), asset_word(at + 1u));
    return VoltexNode(mask, asset_word(at + 2u), asset_word(at + 3u));
}

// Returns the voxel with a number that is not VOLTEX_NO_VOXEL.
fn voltex_voxel(base: u32, number: u32) -> VoltexVoxel {
    return voltex_voxel_at(base + asset_word(base + VOLTEX_VOXELS_AT) + number * VOLTEX_VOXEL_WORDS);
}

// Returns the number of the voxel with the second sort of microflakes in the cell of another voxel, or VOLTEX_NO_VOXEL.
fn voltex_other(base: u32, number: u32) -> u32 {
    return asset_word(base + asset_word(base + VOLTEX_VOXELS_AT) + number * VOLTEX_VOXEL_WORDS + VOLTEX_OTHER_AT);
}

// Returns the optical depth per length of all microflakes of a cell along d, which need not be unit, before the level's
// clumping; 0 for VOLTEX_NO_VOXEL.
fn voltex_extinction_along(base: u32, number: u32, d: vec3<f32>) -> f32 {
    var sum = 0.0;
    for (var own = number; own != VOLTEX_NO_VOXEL; own = voltex_other(base, own)) {
        sum += sqrt(max(voltex_form(voltex_voxel(base, own).extinction, d, d), 0.0));
    }
    return sum;
}

fn voltex_material(base: u32, number: u32) -> VoltexMaterial {
    let at = base + asset_word(base + VOLTEX_MATERIALS_AT) + number * VOLTEX_MATERIAL_WORDS;
    let a = unpack2x16float(asset_word(at));
    let b = unpack2x16float(asset_word(at + 1u));
    let c = unpack2x16float(asset_word(at + 2u));
    let d = unpack2x16float(asset_word(at + 3u));
    return VoltexMaterial(vec3<f32>(a, b.x), vec3<f32>(b.y, c), d.x, d.y);
}

// Returns the word at which a level's shadows begin: offset, then shares.
fn voltex_shadow(base: u32, level: u32) -> u32 {
    return base + asset_word(base + VOLTEX_LEVELS_AT) + level * VOLTEX_LEVEL_WORDS;
}

// Returns the distance from the microflakes at which a ray to the light begins, voxels of the level.
fn voltex_shadow_offset(base: u32, level: u32) -> f32 {
    return asset_f32(voltex_shadow(base, level));
}

// Returns the factor on optical depths along d, of any length, for a level's clumping; a level beyond the coarsest has
// the coarsest's.
fn voltex_clumping_along(base: u32, level: u32, d: vec3<f32>) -> f32 {
    let at = voltex_shadow(base, min(level, voltex_level_count(base))) + VOLTEX_CLUMPING_AT;
    let matrix = VoltexMatrix(voltex_three(at), voltex_three(at + 3u));
    return exp(voltex_form(matrix, d, d) / max(dot(d, d), 1e-30));
}

// Returns the factor on the specular lobe of a level's microflakes for facets along `half_way`, of any length; a level
// beyond the coarsest has the coarsest's.
fn voltex_facets_along(base: u32, level: u32, half_way: vec3<f32>) -> f32 {
    let at = voltex_shadow(base, min(level, voltex_level_count(base))) + VOLTEX_FACETS_AT;
    let h = half_way * inverseSqrt(max(dot(half_way, half_way), VOLTEX_MIN_HALF2));
    let squares = h * h;
    let products = h.xxy * h.yzz;
    var form = dot(voltex_three(at), squares * squares) + dot(voltex_three(at + 3u), squares.xxy * squares.yzz);
    form += squares.x * dot(voltex_three(at + 6u), products);
    form += squares.y * dot(voltex_three(at + 9u), products);
    form += squares.z * dot(voltex_three(at + 12u), products);
    return exp(clamp(form, -VOLTEX_MAX_DENSER, VOLTEX_MAX_DENSER));
}

// Returns the factor on the light that a level's microflakes send from `light` to `eye`, vectors towards them of any
// length; a level beyond the coarsest has the coarsest's.
fn voltex_brighter_between(base: u32, level: u32, eye: vec3<f32>, light: vec3<f32>) -> f32 {
    let at = voltex_shadow(base, min(level, voltex_level_count(base))) + VOLTEX_LIGHT_CORRECTION_AT;
    let o = eye * inverseSqrt(max(dot(eye, eye), VOLTEX_MIN_DIRECTION2));
    let i = light * inverseSqrt(max(dot(light, light), VOLTEX_MIN_DIRECTION2));
    let s = dot(o.xy, i.xy);
    let heights = vec3<f32>(i.z, o.z, i.z * o.z);
    var sum = dot(voltex_three(at), vec3<f32>(1.0, s, s * s)) + dot(voltex_three(at + 3u), heights);
    sum += dot(voltex_three(at + 6u), heights * heights) + s * dot(voltex_three(at + 9u), heights);
    sum += dot(voltex_three(at + 12u), i.xxy * i.yzz) + dot(voltex_three(at + 15u), o.xxy * o.yzz);
    sum += dot(voltex_three(at + 18u), vec3<f32>(i.xy, i.x * i.x - i.y * i.y));
    sum += dot(voltex_three(at + 21u), vec3<f32>(o.xy, o.x * o.x - o.y * o.y));
    sum += heights.z * (asset_f32(at + 24u) * i.z + asset_f32(at + 25u) * o.z);
    return exp(clamp(sum, -VOLTEX_MAX_BRIGHTER, VOLTEX_MAX_BRIGHTER));
}

// Reads three numbers from a word on.
fn voltex_three(at: u32) -> vec3<f32> {
    return vec3<f32>(asset_f32(at), asset_f32(at + 1u), asset_f32(at + 2u));
}
