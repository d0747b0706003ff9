//! Compares the shaders' answers for volumetric textures with `btf_runtime::voltex`: cells along rays, optical depths
//! and light on the software driver; optical depths in every language that it runs.

use crate::support::gpu::{Program, open};
use crate::support::tools::{self, Tool};
use btf_runtime::testing::{RAY_KINDS, Random, random_volume, sample_ray, sphere_direction, take_children};
use btf_runtime::voltex::{Cell, NO_VOXEL, Segment, Voltex, VoltexRay, Voxel, Walk, gloss, seen_at, shade};
use btf_runtime::{voltex_wgsl, wgsl_library};
use btf_shaders::{DEPTHS_NAME, Depth, Language, Ray, depths_text, translate};
use bytemuck::{Pod, Zeroable};

const ENTRY: &str = "
struct Range { first: u32, count: u32, pad: vec2<u32> }
struct Ray { origin: vec3<f32>, level: u32, direction: vec3<f32>, volume: u32, t0: f32, t1: f32, pad: vec2<u32> }
struct Step { t0: f32, t1: f32, size: u32, voxel: u32, parent: u32 }
struct Way { count: u32, depth: f32, steps: array<Step, 256> }
struct Light { v: vec3<f32>, voxel: u32, l: vec3<f32>, base: u32, depth: f32, length: f32, level: u32, pad: u32 }
@group(0) @binding(0) var<storage, read> words: array<u32>;
@group(0) @binding(2) var<uniform> range: Range;

fn asset_word(index: u32) -> u32 {
    return words[index];
}
";

const WALK_ENTRY: &str = "
@group(0) @binding(1) var<storage, read> rays: array<Ray>;
@group(0) @binding(3) var<storage, read_write> ways: array<Way>;

@compute @workgroup_size(64)
fn walk_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= range.count {
        return;
    }
    let ray = rays[id.x];
    var walk = voltex_walk_new(ray.volume, ray.origin, ray.direction, ray.t0, ray.t1);
    var count = 0u;
    var depth = 0.0;
    let clumping = voltex_clumping_along(ray.volume, ray.level, ray.direction);
    while walk.t < walk.t_end && count < 256u {
        let s = voltex_walk_next(ray.volume, &walk, ray.level);
        ways[id.x].steps[count] = Step(s.t0, s.t1, s.cell.size, s.cell.voxel, s.cell.parent);
        if s.cell.voxel != VOLTEX_NO_VOXEL {
            depth += clumping * voltex_extinction_along(ray.volume, s.cell.voxel, ray.direction) * (s.t1 - s.t0);
        }
        count++;
    }
    ways[id.x].count = count;
    ways[id.x].depth = depth;
}
";

const SHADE_ENTRY: &str = "
@group(0) @binding(1) var<storage, read> lights: array<Light>;
@group(0) @binding(3) var<storage, read_write> answers: array<array<f32, 24>>;

@compute @workgroup_size(64)
fn shade_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= range.count {
        return;
    }
    let q = lights[id.x];
    let voxel = voltex_voxel(q.base, q.voxel);
    let both = voltex_shade(voxel.moment, q.v, q.l);
    let material = voltex_material(q.base, voxel.material);
    let extent = voltex_extent(q.base);
    answers[id.x] = array<f32, 24>(
        both.x, both.y, voltex_form(voxel.extinction, q.v, q.v), voltex_seen_at(q.depth, q.length),
        voltex_shared_at(q.base, q.level, dot(q.v, q.l)), voltex_shadow_offset(q.base, q.level),
        material.reflectance.x, material.reflectance.y, material.reflectance.z,
        material.transmittance.x, material.transmittance.y, material.transmittance.z, material.specular, material.roughness,
        extent.x, extent.y, extent.z, voltex_side_m(q.base),
        dot(vec2<f32>(1.0, 2.0), select(vec2<f32>(0.0), vec2<f32>(1.0), voltex_cyclic(q.base))),
        f32(voltex_level_count(q.base)),
        voltex_gloss(voxel.extinction, material.specular, material.roughness, q.v, q.l),
        voltex_extinction_along(q.base, q.voxel, q.v), voltex_facets_along(q.base, q.level, q.v + q.l),
        voltex_brighter_between(q.base, q.level, 3.0 * q.v, q.l),
    );
}
";

/// Returns the library with one of the entry points.
fn text(entry: &str) -> String {
    [&wgsl_library(), &voltex_wgsl(), ENTRY, entry].map(|part| part as &str).join("\n")
}

/// Returns volumes with 1 to 64 voxels a side, sparse and dense, whole and in part, one behind the other, each with the number of its
/// first word.
fn volumes(random: &mut Random) -> (Vec<u32>, Vec<(u32, Voltex)>) {
    let (mut words, mut volumes) = (vec![7; 3], Vec::new());
    for level_count in 0..=6 {
        for (share, taken) in [(0.0, 0.0), (0.2, 0.0), (0.7, 0.0), (0.7, 0.3)] {
            let mut volume = random_volume(random, level_count, share);
            take_children(random, &mut volume, taken);
            volumes.push((words.len() as u32, Voltex::new(&volume)));
            words.extend(volumes.last().map(|(_, voltex)| voltex.words()).unwrap());
        }
    }
    (words, volumes)
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Step {
    t0: f32,
    t1: f32,
    size: u32,
    voxel: u32,
    parent: u32,
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Way {
    count: u32,
    depth: f32,
    steps: [Step; 256],
}

const RAYS: usize = 6400;
/// Difference allowed for the ends of segments, in units in the last place of the largest number that they are computed
/// from.
const ULPS: f32 = 4.0;
/// One ray in this many may go through an edge in another order.
const REORDERED: usize = 100;
/// Relative tolerance of optical depths: roots and sums.
const DEPTH: f32 = 1e-5;

/// The result of comparing a shader's traversal with Rust's.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Compared {
    Same,
    /// Equal except for segments that are shorter than t resolves: where planes meet, rounding decides which is first.
    Reordered,
    Other,
}

/// Returns Rust's traversal of a ray: segments, optical depth, and the tolerance of the depth besides [`DEPTH`].
fn followed(voltex: &Voltex, ray: &Ray) -> (Vec<Segment>, f32, f32) {
    let mut walk =
        Walk::new(VoltexRay { origin: ray.origin, direction: ray.direction }, ray.t0, ray.t1, voltex.level_count());
    let (mut segments, mut depth, mut slack) = (Vec::new(), 0.0, 0.0);
    let clumping = voltex.clumping_along(ray.level, ray.direction);
    let length2: f32 = ray.direction.iter().map(|x| x * x).sum();
    while let Some(segment) = walk.next(voltex, ray.level) {
        if segment.cell.voxel != NO_VOXEL {
            for (_, Voxel { extinction, .. }) in voltex.microflakes(segment.cell.voxel) {
                let (form, t) = (extinction.form(ray.direction, ray.direction), clumping * (segment.t1 - segment.t0));
                depth += form.max(0.0).sqrt() * t;
                // Microflakes that are seen from the edge are a small difference.
                let error = ULPS * f32::EPSILON * length2 * extinction.trace();
                slack += ((form + error).max(0.0).sqrt() - (form - error).max(0.0).sqrt()) * t;
            }
        }
        segments.push(segment);
    }
    (segments, depth, slack)
}

fn compare(voltex: &Voltex, ray: &Ray, way: &Way) -> Compared {
    let (expected, depth, slack) = followed(voltex, ray);
    let found: Vec<Segment> = way.steps[..(way.count as usize).min(256)]
        .iter()
        .map(|s| Segment { t0: s.t0, t1: s.t1, cell: Cell { size: s.size, voxel: s.voxel, parent: s.parent } })
        .collect();
    // A plane's t is a difference to the origin over a component of the direction.
    let far = ray.origin.iter().fold(1.0f32, |far, x| far.max(x.abs()));
    let steep = |t: f32| {
        let near = |axis: &usize| {
            let place = (ray.origin[*axis] + ray.direction[*axis] * t) * (1 << voltex.level_count()) as f32;
            (place - place.round()).abs() < 1e-2
        };
        let through = (0..3).filter(|axis| ray.direction[*axis] != 0.0).filter(near);
        through.map(|axis| ray.direction[axis].abs()).fold(f32::INFINITY, f32::min)
    };
    let tolerance = |t: f32| ULPS * f32::EPSILON * (far / steep(t) + t.abs());
    let alike = |a: &[Segment], b: &[Segment]| {
        let same = |(a, b): (&Segment, &Segment)| {
            let near = |x: f32, y: f32| (x - y).abs() <= tolerance(x);
            a.cell == b.cell && near(a.t0, b.t0) && near(a.t1, b.t1)
        };
        a.len() == b.len() && a.iter().zip(b).all(same)
    };
    if (way.depth - depth).abs() > DEPTH * depth + slack {
        return Compared::Other;
    }
    if alike(&expected, &found) {
        return Compared::Same;
    }
    let long = |segments: &[Segment]| -> Vec<Segment> {
        segments.iter().filter(|s| s.t1 - s.t0 > 2.0 * tolerance(s.t1)).copied().collect()
    };
    if alike(&long(&expected), &long(&found)) { Compared::Reordered } else { Compared::Other }
}

/// Returns rays of all kinds, each with the volume that it goes through; one in 50 has odd numbers.
fn rays<'a>(random: &mut Random, volumes: &'a [(u32, Voltex)]) -> (Vec<&'a Voltex>, Vec<Ray>) {
    let odd = [0.0, -0.0, 0.5, 1.0, -1e6, 1e-30, f32::NAN, f32::INFINITY, -f32::INFINITY];
    (0..RAYS)
        .map(|round| {
            let (volume, voltex) = &volumes[random.below(volumes.len())];
            let mut ray = sample_ray(random, voltex.level_count(), round % RAY_KINDS);
            if round % 50 == 49 {
                ray.origin[random.below(3)] = odd[random.below(odd.len())];
                ray.direction[random.below(3)] = odd[random.below(odd.len())];
            }
            let level = random.below(voltex.level_count() as usize + 2) as u32;
            // One in four ends within the volume.
            let t1 = if random.below(4) == 0 { random.within(0.0, 4.0) } else { 1e15 };
            let VoltexRay { origin, direction } = ray;
            (voltex, Ray { origin, level, direction, volume: *volume, t0: 0.0, t1, pad: [0; 2] })
        })
        .unzip()
}

#[test]
fn rays_meet_the_same_cells_in_shaders_and_in_rust() {
    let Some(gpu) = open("rays_meet_the_same_cells_in_shaders_and_in_rust") else { return };
    let mut random = Random::new(13);
    let (words, volumes) = volumes(&mut random);
    let (owners, rays) = rays(&mut random, &volumes);
    let compared = |text: &str| -> Vec<Compared> {
        let ways: Vec<Way> = gpu.answers(&Program::Wgsl(text), "walk_main", &words, &rays);
        owners.iter().zip(&rays).zip(&ways).map(|((voltex, ray), way)| compare(voltex, ray, way)).collect()
    };
    let text = text(WALK_ENTRY);
    let count = |compared: &[Compared], kind: Compared| compared.iter().filter(|found| **found == kind).count();
    let found = compared(&text);
    let reordered = count(&found, Compared::Reordered);
    println!("{reordered} of {RAYS} rays go through edges in another order");
    let other: Vec<_> = (0..RAYS).filter(|i| found[*i] == Compared::Other).collect();
    assert!(other.is_empty(), "{} differ, first {:?} kind {}", other.len(), rays[other[0]], other[0] % RAY_KINDS);
    assert!(reordered <= RAYS / REORDERED, "{reordered}");
    // Planted: zeros that go down, a cell's rank by one, a byte of the mask left out, extinction with one scale, and
    // clumping of long vectors.
    for (right, wrong) in [
        ("let ahead = (*walk).inverse >", "let ahead = (*walk).direction >"),
        ("countOneBits(node.mask.x & below)", "countOneBits(node.mask.x & (2u * below))"),
        ("0x01010101u", "0x01010001u"),
        ("at + 1u), scale * scale", "at + 1u), scale"),
        ("select(1u, 0u, voltex_has_coarse", "select(0u, 0u, voltex_has_coarse"),
        ("d, d) / max(dot(d, d), 1e-30)", "d, d) / max(dot(d, d), 9.0)"),
    ] {
        assert_eq!(text.matches(right).count(), 1, "{right}");
        let differing = RAYS - count(&compared(&text.replace(right, wrong)), Compared::Same);
        assert!(differing > RAYS / 20, "{wrong}: {differing}");
    }
}

#[test]
fn depths_are_the_same_in_every_language() {
    let test = "depths_are_the_same_in_every_language";
    if tools::are_left_out(test, &[Tool::Glslang]) {
        return;
    }
    let Some(gpu) = open(test) else { return };
    let mut random = Random::new(15);
    let (words, volumes) = volumes(&mut random);
    let (owners, rays) = rays(&mut random, &volumes);
    let differing = |program: &Program, entry: &str| -> usize {
        let depths: Vec<Depth> = gpu.answers(program, entry, &words, &rays);
        let differs = |((voltex, ray), found): ((&&Voltex, &Ray), &Depth)| {
            let (segments, depth, slack) = followed(voltex, ray);
            let first = segments.iter().find(|segment| segment.cell.voxel != NO_VOXEL);
            let first = first.map_or((ray.t1, NO_VOXEL), |first| (first.t0, first.cell.voxel));
            (found.depth - depth).abs() > DEPTH * depth + slack
                || found.first_voxel != first.1
                || (found.first_t - first.0).abs() > DEPTH * first.0.abs()
                || found.steps as usize != segments.len()
        };
        owners.iter().zip(&rays).zip(&depths).filter(|pair| differs(*pair)).count()
    };
    let text = depths_text();
    let planted = text.replace("select(1u, 0u, voltex_has_coarse", "select(0u, 0u, voltex_has_coarse");
    for (text, fits) in [(&text, true), (&planted, false)] {
        for file in translate(DEPTHS_NAME, text).unwrap() {
            let (_, entry) = &file.entry_points[0];
            let spirv = match file.language {
                // Nothing here runs it.
                Language::Msl => continue,
                Language::Wgsl => None,
                Language::SpirV => Some(tools::words_from_bytes(&file.bytes)),
                Language::GlslEs310 | Language::Glsl460 => Some(tools::spirv_from_glsl(&file.bytes).unwrap()),
                Language::Hlsl => Some(tools::spirv_from_hlsl(&file.bytes, entry).unwrap()),
            };
            let found = differing(&spirv.as_deref().map_or(Program::Wgsl(text), Program::SpirV), entry);
            println!("{}: {found} of {RAYS} differ", file.name);
            assert_eq!(found <= RAYS / REORDERED, fits, "{}: {found}", file.name);
        }
    }
}

#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Light {
    v: [f32; 3],
    voxel: u32,
    l: [f32; 3],
    base: u32,
    depth: f32,
    length: f32,
    level: u32,
    pad: u32,
}

/// Tolerance of shaded light, relative to the area that reflects or the length that is visible.
const SHADED: f32 = 1e-5;
/// Relative tolerance of the specular lobe: nearly flat ellipsoids are small differences.
const GLOSS: f32 = 5e-3;

/// Returns Rust's results, each with the difference allowed to the shader's.
fn expected(voltex: &Voltex, q: &Light) -> [(f32, f32); 24] {
    let voxel = voltex.voxel(q.voxel);
    let cos = (0..3).map(|i| q.v[i] * q.l[i]).sum::<f32>();
    let area = SHADED * voxel.moment.trace();
    let [reflected, transmitted] = shade(&voxel.moment, q.v, q.l);
    let shadow = voltex.shadow(q.level);
    let material = voltex.material(voxel.material);
    let ([a, b, c], [d, e, f]) = (material.reflectance, material.transmittance);
    let [x, y, z] = voltex.extent();
    let [cyclic_x, cyclic_y] = voltex.cyclic().map(|cyclic| f32::from(u8::from(cyclic)));
    let shine = gloss(&voxel.extinction, material.specular, material.roughness, q.v, q.l);
    let along = voltex.extinction_along(q.voxel, q.v);
    let half: [f32; 3] = std::array::from_fn(|i| q.v[i] + q.l[i]);
    let half2 = half.iter().map(|x| x * x).sum::<f32>();
    let denser = voltex.facets_along(q.level, half);
    let brighter = voltex.brighter_between(q.level, q.v.map(|x| 3.0 * x), q.l);
    let exact = |x: f32| (x, 0.0);
    [
        (reflected, area),
        (transmitted, area),
        (voxel.extinction.form(q.v, q.v), SHADED * voxel.extinction.trace()),
        (seen_at(q.depth, q.length), SHADED * q.length),
        (shadow.shared_at(cos), SHADED),
        exact(shadow.offset),
        exact(a),
        exact(b),
        exact(c),
        exact(d),
        exact(e),
        exact(f),
        exact(material.specular),
        exact(material.roughness),
        exact(x),
        exact(y),
        exact(z),
        exact(voltex.side_m()),
        exact(cyclic_x + 2.0 * cyclic_y),
        exact(voltex.level_count() as f32),
        (shine, GLOSS * shine + 1e-6 * voxel.extinction.trace().sqrt()),
        (along, SHADED * along + 2e-3 * voxel.extinction.trace().sqrt()),
        // A direction half way between two that are nearly opposite is a small difference.
        (denser, 1e-4 * denser / half2.sqrt().clamp(1e-4, 1.0)),
        (brighter, SHADED * brighter),
    ]
}

#[test]
fn microflakes_shine_alike_in_shaders_and_in_rust() {
    let Some(gpu) = open("microflakes_shine_alike_in_shaders_and_in_rust") else { return };
    let mut random = Random::new(14);
    let (words, volumes) = volumes(&mut random);
    let (owners, queries): (Vec<&Voltex>, Vec<Light>) = (0..RAYS)
        .map(|round| {
            let (base, voltex) = &volumes[random.below(volumes.len())];
            let v = sphere_direction(&mut random);
            // As the eye sees, against it, near it, anywhere.
            let l = match round % 8 {
                0 => v,
                1 => v.map(|x| -x),
                2 => v.map(|x| x * (1.0 - 1e-6)),
                _ => sphere_direction(&mut random),
            };
            let query = Light {
                v,
                voxel: random.below(voltex.voxel_count()) as u32,
                l,
                base: *base,
                depth: 10f32.powf(random.within(-6.0, 3.0)),
                length: random.within(0.0, 2.0),
                level: random.below(voltex.level_count() as usize + 1) as u32,
                pad: 0,
            };
            (voltex, query)
        })
        .unzip();
    // Of each number in how many answers it differs; and the first that does.
    let differing = |text: &str| -> ([usize; 24], Option<String>) {
        let answers: Vec<[f32; 24]> = gpu.answers(&Program::Wgsl(text), "shade_main", &words, &queries);
        let (mut sums, mut first) = ([0; 24], None);
        for ((voltex, query), answer) in owners.iter().zip(&queries).zip(&answers) {
            for (i, (value, tolerance)) in expected(voltex, query).into_iter().enumerate() {
                if answer[i].is_nan() || (answer[i] - value).abs() > tolerance {
                    first.get_or_insert_with(|| format!("number {i}: {} instead of {value}, {query:?}", answer[i]));
                    sums[i] += 1;
                }
            }
        }
        (sums, first)
    };
    let text = text(SHADE_ENTRY);
    assert_eq!(differing(&text), ([0; 24], None));
    // Planted, each with a number in which it shows.
    for (right, wrong, number) in [
        ("0.5 * (both - c)", "0.49 * (both - c)", 1),
        ("(1.0 - r) * (1.0 + r)", "(1.0 - r) * (1.001 + r)", 0),
        ("m.beside.yzz * v.zzy", "m.beside.yzz * v.zyz", 2),
        ("1.0 - d2 / 60.0", "1.0 + d2 / 60.0", 3),
        ("(40.0, 70.0", "(45.0, 70.0", 4),
        ("level * VOLTEX_LEVEL_WORDS", "level * VOLTEX_MATERIAL_WORDS", 5),
        ("vec3<f32>(b.y, c)", "vec3<f32>(b.y, c.yx)", 10),
        ("b.yxx * b.zzy - b * d.zyx", "b.yxx * b.zzy + b * d.zyx", 20),
        ("2.0 * c / (c + sqrt", "1.98 * c / (c + sqrt", 20),
        ("normal - tilt", "normal - 0.9 * tilt", 20),
        ("h.xxy * h.yzz", "h.xxy * h.zyz", 22),
        ("voltex_three(at + 9u), products", "voltex_three(at + 10u), products", 22),
        ("o.xxy * o.yzz", "o.xxy * o.zyz", 23),
        ("asset_f32(at + 25u) * o.z", "asset_f32(at + 25u) * i.z", 23),
        ("own = voltex_other(base, own)", "own = VOLTEX_NO_VOXEL", 21),
        ("vec2<u32>(0u, 1u)) & vec2<u32>(1u)", "vec2<u32>(1u, 0u)) & vec2<u32>(1u)", 18),
    ] {
        assert_eq!(text.matches(right).count(), 1, "{right}");
        assert!(differing(&text.replace(right, wrong)).0[number] > RAYS / 100, "{wrong}");
    }
}
