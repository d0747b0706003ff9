// What is in a texel, and where. Twin: pattern.rs. `patterns` is the first of the words of pattern_words.

const PATTERN_WORDS: u32 = 11u;
const PATTERN_TURNS: u32 = 1u;
const PATTERN_MIRRORS: u32 = 2u;
const MAX_MERGED: u32 = 4u;
const DRAW_EMPTY: u32 = 0u;
const DRAW_ALTERNATIVE: u32 = 1u;
const DRAW_TURN: u32 = 3u;
const DRAW_MIRROR: u32 = 4u;
const DRAW_SCALE: u32 = 5u;
const DRAW_ALONG_U: u32 = 6u;
const DRAW_ALONG_V: u32 = 7u;

// `volumes` is the word of the first of its MAX_MERGED volumes, 0 where the texel is empty.
struct PatternVariant {
    x: vec2<f32>,
    y: vec2<f32>,
    offset: vec2<f32>,
    cell: vec2<i32>,
    upright: f32,
    alternative: u32,
    volumes: u32,
}

// Returns 0 where a texel of the pattern at `at` is empty by its map, or 1 and the number of its alternative.
fn pattern_cell_content(patterns: u32, at: u32, cell: vec2<i32>) -> u32 {
    let size = vec2<u32>(asset_word(at + 9u), asset_word(at + 10u));
    let place = vec2<u32>(cell);
    if any(place >= size) {
        return 0u;
    }
    let number = place.y * size.x + place.x;
    return (asset_word(patterns + asset_word(at + 8u) + number / 4u) >> (8u * (number % 4u))) & 255u;
}

// Returns what is in a texel of pattern `number`.
fn pattern_variant(patterns: u32, number: u32, cell: vec2<i32>) -> PatternVariant {
    let at = patterns + asset_word(patterns + 1u + number);
    let hashed = cell_hash(cell, asset_word(at));
    var variant: PatternVariant;
    if cell_share(hashed, DRAW_EMPTY) < shell_float(at + 1u) {
        return variant;
    }
    variant.alternative = pattern_among(hashed, DRAW_ALTERNATIVE, asset_word(at + 7u));
    if asset_word(at + 8u) > 0u {
        let content = pattern_cell_content(patterns, at, cell);
        if content == 0u {
            return variant;
        }
        variant.alternative = content - 1u;
    }
    let least = shell_float(at + 2u);
    let scale = least + (shell_float(at + 3u) - least) * cell_share(hashed, DRAW_SCALE);
    // From the middle to the content's sides; what is left of half a texel is free.
    let free = max(0.5 - scale * (0.5 - shell_float(at + 5u)), 0.0);
    let furthest = min(shell_float(at + 4u), free);
    let draws = vec2<f32>(cell_share(hashed, DRAW_ALONG_U), cell_share(hashed, DRAW_ALONG_V));
    let middle = 0.5 + furthest * (2.0 * draws - 1.0);
    let flags = asset_word(at + 6u);
    var cosine = 1.0;
    var sine = 0.0;
    if (flags & PATTERN_TURNS) != 0u {
        let quarters = pattern_among(hashed, DRAW_TURN, 4u);
        cosine = select(0.0, select(1.0, -1.0, quarters == 2u), quarters % 2u == 0u);
        sine = select(0.0, select(1.0, -1.0, quarters == 3u), quarters % 2u == 1u);
    }
    let is_mirrored = (flags & PATTERN_MIRRORS) != 0u && cell_share(hashed, DRAW_MIRROR) < 0.5;
    let inverse = 1.0 / scale;
    let mirrored = select(inverse, -inverse, is_mirrored);
    variant.x = vec2<f32>(cosine * mirrored, -sine * inverse);
    variant.y = vec2<f32>(sine * mirrored, cosine * inverse);
    variant.offset = 0.5 - vec2<f32>(dot(variant.x, middle), dot(variant.y, middle));
    variant.cell = cell;
    variant.upright = inverse;
    variant.volumes = at + PATTERN_WORDS + MAX_MERGED * variant.alternative;
    return variant;
}

// Returns one of so many, by chance.
fn pattern_among(hashed: u32, draw: u32, count: u32) -> u32 {
    return min(u32(cell_share(hashed, draw) * f32(count)), max(count, 1u) - 1u);
}

// Transforms a point of the texture into the volume's unit cube, or outside where there is no content.
fn pattern_point(variant: PatternVariant, texture: vec3<f32>) -> vec3<f32> {
    let local = vec3<f32>(texture.xy - vec2<f32>(variant.cell), texture.z);
    return pattern_direction(variant, local) + vec3<f32>(variant.offset, 0.0);
}

// Transforms a direction of the texture into the volume; not unit.
fn pattern_direction(variant: PatternVariant, direction: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(variant.x, direction.xy), dot(variant.y, direction.xy), variant.upright * direction.z);
}

// Transforms a ray of the texture into the volume, with the same t.
fn pattern_ray(variant: PatternVariant, ray: TextureRay) -> TextureRay {
    return TextureRay(pattern_point(variant, ray.point), pattern_direction(variant, ray.direction));
}
