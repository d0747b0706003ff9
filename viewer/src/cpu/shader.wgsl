// One sample of every pixel: what its rays meet, and what they see there. Twin: shader.rs.
// The includer defines trace_mesh and trace_occluded.

const TRACE_FAR: f32 = 1e30;
const TRACE_PI: f32 = 3.14159265;
// A light nearer than this (squared) to the surface is left out.
const MIN_LIGHT_DISTANCE2: f32 = 1e-12;
const MODE_PATH: u32 = 1u;
const SKY_IRRADIANCE: u32 = 1u;
// Sets apart the number that a level is drawn with from the others of a light's seed.
const LEVEL_CHOICE: u32 = 0x967a889bu;
// Shells that a ray may pass.
const SHELL_TRIES: u32 = 8u;
// Rays along a pixel's side, for more of which voxels do not grow narrower.
const MAX_RAYS_ACROSS: f32 = 4.0;
const FILTER_NEAREST: u32 = 0u;
const FILTER_LINEAR: u32 = 2u;
// Texels that a place between them is interpolated from.
const TEXEL_TAPS: u32 = 4u;

// Decodes everything anew for every light: what the decoder's halves are measured by.
override whole_decoder: bool = false;
// What the scene has: what it has not need not be compiled.
override with_assets: bool = true;
override with_leaves: bool = true;
override with_displacement: bool = true;
override with_environment: bool = true;
override with_drawn_lights: bool = true;
// How assets are decoded.
override with_exact_rule: bool = true;
override most_heights: u32 = 2u;
override with_edits: bool = true;
override with_packed_bases: bool = true;
override with_uneven_rows: bool = true;
override with_kept_rows: bool = true;

// Returns the direction of a ray from the eye through a pixel.
fn camera_direction(pixel: vec2<u32>) -> vec3<f32> {
    let x = 2.0 * (f32(pixel.x) + 0.5 + frame.jitter.x) / f32(frame.width) - 1.0;
    let y = 1.0 - 2.0 * (f32(pixel.y) + 0.5 + frame.jitter.y) / f32(frame.height);
    return normalize(frame.forward + frame.right * x + frame.up * y);
}

// Returns the greatest component.
fn most(v: vec3<f32>) -> f32 {
    return max(v.x, max(v.y, v.z));
}

// Returns how far a pixel's rays are apart at distance 1 of the eye, of which it has had so many.
fn ray_width() -> f32 {
    return frame.pixel_width / sqrt(f32(frame.sample + 1u));
}

// Returns the width of voxels at distance 1 of the eye: that of rays, within bounds.
fn voxel_width() -> f32 {
    return max(ray_width(), frame.pixel_width / MAX_RAYS_ACROSS);
}

// Returns the numbers by which one of the texels around a vertex is taken, `travelled` from the eye: the nearest where
// texels are as small as pixels or smaller, any of the four from two pixels a texel on. The first sample of a picture
// takes the nearest, but for traced paths.
fn texel_numbers(s: Surface, travelled: f32, pixel: vec2<u32>, depth: u32) -> vec2<f32> {
    let material = materials[s.material];
    let drawn = frame.sample > 0u || frame.mode == MODE_PATH;
    if !with_assets || material.asset == NO_ASSET || frame.filtered == FILTER_NEAREST || !drawn {
        return vec2<f32>(0.5);
    }
    let texels = texels_across(s, material, btf_size(material.asset, 0u), travelled * frame.pixel_width);
    let part = clamp(-log2(texels), 0.0, 1.0);
    return 0.5 + part * (sampler_two(frame.sample, seed_of(pixel, depth, TEXEL_NUMBERS)) - 0.5);
}

// One of the texels whose light is summed at a vertex.
struct TexelTap {
    // The numbers that take it.
    at: vec2<f32>,
    weight: f32,
}

// Returns how many texels are summed at the vertex at `depth`.
fn texel_taps(material: Material, depth: u32) -> u32 {
    let linear = frame.filtered == FILTER_LINEAR && depth == 1u;
    return select(1u, TEXEL_TAPS, linear && with_assets && material.asset != NO_ASSET);
}

// Returns texel number `tap` of the four of a level that are summed at a vertex on an asset.
fn texel_tap(s: Surface, level: u32, tap: u32) -> TexelTap {
    let material = materials[s.material];
    let size = vec2<f32>(btf_size(material.asset, level * btf_layers(material.asset)));
    let uv = s.uv * material.uv_scale;
    let upper = vec2<f32>(f32(tap & 1u), f32(tap >> 1u));
    // Place between the middles of two texels.
    let place = fract(fract(vec2<f32>(uv.x, 1.0 - uv.y)) * size + 0.5);
    let weights = mix(1.0 - place, place, upper);
    return TexelTap(upper, weights.x * weights.y);
}

// What a ray meets, displacement included.
struct DisplacedHit {
    hit: Hit,
    // Way below the surface to the displaced one, texels.
    sunk: f32,
}

// Returns what a ray meets, displacement included.
fn trace_closest(origin: vec3<f32>, direction: vec3<f32>) -> DisplacedHit {
    var start = origin;
    var gone = 0.0;
    // Length of the way through the shell just before.
    var through = 0.0;
    for (var i = 0u; i < SHELL_TRIES; i++) {
        var hit = trace_mesh(start, direction);
        if !with_displacement || hit.primitive == NO_HIT || materials[triangle_at(hit.primitive).material].displacement <= 0.0 {
            hit.t += gone;
            return DisplacedHit(hit, 0.0);
        }
        let s = surface_at(hit, direction);
        let relief = relief_new(hit, s, materials[s.material]);
        // What was entered between the hills is left through its lid.
        let leaving = s.view_back && hit.t < through;
        if relief.scale <= 0.0 || (s.view_back && !leaving) {
            hit.t += gone;
            return DisplacedHit(hit, 0.0);
        }
        gone += hit.t;
        if leaving {
            start = s.above;
            through = 0.0;
            continue;
        }
        let way = relief_enter(relief, -s.wo);
        if way >= 0.0 {
            hit.t = gone;
            return DisplacedHit(hit, way);
        }
        through = -way / relief.texels_per_unit;
        start = s.position + direction * through;
        gone += through;
    }
    return DisplacedHit(Hit(TRACE_FAR, NO_HIT, 0.0, 0.0, 0u), 0.0);
}

// Returns the surface that a path's latest ray hit. Where it is displaced, the relief is put into `relief` and the
// point that is met into `point`.
fn surface_of(path: Path, relief: ptr<function, Relief>, point: ptr<function, vec3<f32>>) -> Surface {
    let hit = Hit(0.0, path.primitive, path.u, path.v, path.instance & ~SCATTERED);
    var s = surface_at(hit, path.direction);
    if with_displacement && !s.view_back && materials[s.material].displacement > 0.0 {
        *relief = relief_new(hit, s, materials[s.material]);
        if (*relief).scale > 0.0 {
            *point = relief_point(*relief, -s.wo, path.sunk);
            s.uv = relief_uv(*relief, materials[s.material], *point, s.wo);
        }
    }
    return s;
}

// Returns the level of the material's asset, leaf or noise whose texels are about as large as what a ray stands for on the
// surface, `travelled` from the eye: first all that a pixel sees, and less with every further ray of the pixel.
fn level_of(s: Surface, material: Material, travelled: f32, seed: u32) -> u32 {
    if frame.levels == 0u || (material.asset == NO_ASSET && material.leaf == NO_ASSET && material.noise == 0u) {
        return 0u;
    }
    var size = vec2<u32>(0u);
    var levels = 1u;
    if with_leaves && material.leaf != NO_ASSET {
        size = leaf_size(material.leaf);
        levels = leaf_levels(material.leaf);
    } else if material.noise > 0u {
        size = vec2<u32>(1u << NOISE_OCTAVES);
        levels = NOISE_OCTAVES + 1u;
    } else if with_assets {
        size = btf_size(material.asset, 0u);
        levels = btf_levels(material.asset);
    }
    let texels = texels_across(s, material, size, travelled * ray_width());
    var part = 0.5;
    if frame.sample > 0u {
        part = sampler_one(seed ^ LEVEL_CHOICE);
    }
    let level = floor(log2(texels) + part);
    return min(u32(max(level, 0.0)), levels - 1u);
}

// Returns the view-dependent half of the leaf that a material shows at a point; nothing that is read where it shows
// none.
fn viewed_leaf(s: Surface, material: Material, instance: u32, level: u32) -> ViewedLeaf {
    var leaf: ViewedLeaf;
    if with_leaves && material.leaf != NO_ASSET {
        leaf = leaf_new(material.leaf, s.uv * material.uv_scale, level, instances[instance & ~SCATTERED].factors, s.wo);
    }
    return leaf;
}

// Returns how many of the finest texels, `size` a picture, lie along a square of the area that a ray of `width` covers on
// the surface; 1e-6 to 1e6.
fn texels_across(s: Surface, material: Material, size: vec2<u32>, width: f32) -> f32 {
    let tiles = vec2<f32>(size) * abs(material.uv_scale);
    return clamp(width * inverseSqrt(abs(s.wo.z)) * s.texture_per_unit * sqrt(tiles.x * tiles.y), 1e-6, 1e6);
}
