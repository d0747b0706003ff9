// One sample of one pixel, in passes: the ray from the eye, the light at what it hits, then ray and light again for each
// mirror, or each step of a path, on the way. Twin: cpu.rs, which follows a whole path where this goes pass by pass.
// The includer defines trace_closest and trace_occluded.

const TRACE_FAR: f32 = 1e30;
const TRACE_PI: f32 = 3.14159265;
// A light nearer than this (squared) to the surface is left out.
const MIN_LIGHT_DISTANCE2: f32 = 1e-12;
// Least chance of a path to go on.
const MIN_KEPT: f32 = 0.05;
const MODE_PATH: u32 = 1u;
const SKY_IRRADIANCE: u32 = 1u;
// What random numbers are for.
const AMBIENT_NUMBERS: u32 = 0u;
const SCATTER_NUMBERS: u32 = 1u;
const CHOICE_NUMBERS: u32 = 2u;
const LIGHT_NUMBERS: u32 = 3u;
const SUN_NUMBERS: u32 = 4u;
const ENVIRONMENT_CHOICE: u32 = 0x68bc21ebu;
const LOBE_CHOICE: u32 = 0x02e5be93u;
// Shells that a ray may pass.
const SHELL_TRIES: u32 = 8u;
const LEVEL_CHOICE: u32 = 0x967a889bu;
const SIDE_CHOICE: u32 = 0x1b873593u;
// Lights that are looked at for each that is drawn.
const LIGHT_CANDIDATES: u32 = 8u;
// Rays whose radiance counts for less than this in the pixel are not followed.
const MIN_THROUGHPUT: f32 = 1e-3;

// Decode everything anew for every light: what the decoder's halves are measured by.
override whole_decoder: bool = false;
// What the scene has: what it has not need not be compiled.
override with_assets: bool = true;
override with_leaves: bool = true;

fn camera_direction(pixel: vec2<u32>) -> vec3<f32> {
    let x = 2.0 * (f32(pixel.x) + 0.5 + frame.jitter.x) / f32(frame.width) - 1.0;
    let y = 1.0 - 2.0 * (f32(pixel.y) + 0.5 + frame.jitter.y) / f32(frame.height);
    return normalize(frame.forward + frame.right * x + frame.up * y);
}

fn most(v: vec3<f32>) -> f32 {
    return max(v.x, max(v.y, v.z));
}

// Light of one side of the surface: point lights with their shadows, then the ambient light along one ray.
struct SideLight {
    radiance: vec3<f32>,
    rays: u32,
    evaluations: u32,
}

// A light and how many lights' share it stands for; 0 for none.
struct ChosenLight {
    index: u32,
    scale: f32,
}

// What comes from beyond everything, along a ray that left a surface or the eye.
fn beyond(direction: vec3<f32>, scattered: bool) -> vec3<f32> {
    var sun = vec3<f32>(0.0);
    // What scattered has met it already.
    if !scattered && most(frame.sun_irradiance) > 0.0 {
        sun = sun_radiance(direction);
    }
    if frame.environment.x > 0u {
        return environment_radiance(direction) + sun;
    }
    return select(frame.background, frame.ambient, scattered) + sun;
}

// How often a path goes on from the body, in proportion to the mirror's reflectance.
fn body_share(material: Material) -> f32 {
    return select(1.0, most(material.diffuse) + most(material.transmitted), is_plain(material));
}

fn is_plain(material: Material) -> bool {
    return material.asset == NO_ASSET && material.leaf == NO_ASSET;
}

// Of the directions that a plain surface sends a path in, the share that leaves on the other side.
fn share_through(material: Material) -> f32 {
    return most(material.transmitted) / max(most(material.diffuse) + most(material.transmitted), 1e-6);
}

// Share of a path's directions that leave on a side in another way than by the mirror.
fn side_share(s: Surface, material: Material, back: bool) -> f32 {
    let body = body_share(material);
    let share = body / max(most(material.mirror) + body, 1e-6);
    if with_assets && material.asset != NO_ASSET {
        let other = btf_layer_for_sides(material.asset, 0u, select(1u, 0u, back), select(0u, 1u, s.view_back));
        return share * select(1.0, 0.5, other != NO_LAYER);
    }
    if is_plain(material) {
        let through = share_through(material);
        return share * select(1.0 - through, through, back != s.view_back);
    }
    // A leaf's density is over both sides.
    return share;
}

// Draws the light of stratum `stratum` of `strata`, which divide the lights in their order among them: of some candidates
// spread over the stratum one, as likely as what it could add unshadowed [Talbot 2005].
fn choose_light(s: Surface, light_back: bool, stratum: u32, strata: u32, seed: u32) -> ChosenLight {
    let cell = f32(frame.light_count) / f32(strata * LIGHT_CANDIDATES);
    var total = 0.0;
    var kept = 0.0;
    var chosen = ChosenLight(0u, 0.0);
    for (var k = 0u; k < LIGHT_CANDIDATES; k++) {
        let number = stratum * LIGHT_CANDIDATES + k;
        let at = (f32(number) + sampler_one(seed + 2u * number)) * cell;
        let index = min(u32(at), frame.light_count - 1u);
        let to_light = lights[index].position - s.position;
        let distance2 = dot(to_light, to_light);
        let cosine = dot(s.normal, to_light) * inverseSqrt(max(distance2, MIN_LIGHT_DISTANCE2));
        let could_add = most(lights[index].intensity) * max(select(cosine, -cosine, light_back), 0.0)
            / max(distance2, MIN_LIGHT_DISTANCE2);
        total += could_add;
        if sampler_one(seed + 2u * number + 1u) * total < could_add {
            chosen.index = index;
            kept = could_add;
        }
    }
    if kept > 0.0 {
        chosen.scale = total * cell / kept;
    }
    return chosen;
}

// Level of the material's asset or leaf whose texels are about as large as what a pixel sees of the surface, `travelled` from the
// eye.
fn level_of(s: Surface, material: Material, travelled: f32, seed: u32) -> u32 {
    if frame.levels == 0u || (material.asset == NO_ASSET && material.leaf == NO_ASSET) {
        return 0u;
    }
    var size = vec2<u32>(0u);
    var levels = 1u;
    if with_leaves && material.leaf != NO_ASSET {
        size = leaf_size(material.leaf);
        levels = leaf_levels(material.leaf);
    } else if with_assets {
        size = btf_size(material.asset, 0u);
        levels = btf_levels(material.asset);
    }
    // Side of a square of the area that the pixel sees.
    let width = travelled * frame.pixel_width * inverseSqrt(abs(s.wo.z));
    let tiles = vec2<f32>(size) * abs(material.uv_scale);
    let texels = width * s.texture_per_unit * sqrt(tiles.x * tiles.y);
    var part = 0.5;
    if frame.sample > 0u {
        part = sampler_one(seed ^ LEVEL_CHOICE);
    }
    let level = floor(log2(clamp(texels, 1e-6, 1e6)) + part);
    return min(u32(max(level, 0.0)), levels - 1u);
}

// The leaf that a material shows at a point; nothing that is read where it shows none.
fn viewed_leaf_at(s: Surface, material: Material, instance: u32, level: u32) -> ViewedLeaf {
    var leaf: ViewedLeaf;
    if with_leaves && material.leaf != NO_ASSET {
        leaf = leaf_new(material.leaf, s.uv * material.uv_scale, level, instances[instance & ~SCATTERED].factors, s.wo);
    }
    return leaf;
}

// What a ray meets, relief included.
struct Seen {
    hit: Hit,
    // Way below the surface to the relief, texels.
    sunk: f32,
}

fn trace_seen(origin: vec3<f32>, direction: vec3<f32>) -> Seen {
    var start = origin;
    var gone = 0.0;
    // Length of the way through the shell just before.
    var through = 0.0;
    for (var i = 0u; i < SHELL_TRIES; i++) {
        var hit = trace_closest(start, direction);
        if !with_assets || hit.primitive == NO_HIT || materials[triangle_at(hit.primitive).material].displacement <= 0.0 {
            hit.t += gone;
            return Seen(hit, 0.0);
        }
        let s = surface_at(hit, direction);
        let relief = relief_new(hit, s, materials[s.material]);
        // What was entered between the hills is left through its lid.
        let leaving = s.view_back && hit.t < through;
        if relief.scale <= 0.0 || (s.view_back && !leaving) {
            hit.t += gone;
            return Seen(hit, 0.0);
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
            return Seen(hit, way);
        }
        through = -way / relief.texels_per_unit;
        start = s.position + direction * through;
        gone += through;
    }
    return Seen(Hit(TRACE_FAR, NO_HIT, 0.0, 0.0, 0u), 0.0);
}

// The surface that a path's latest ray hit; with relief, that is put into `relief` and what is met into `point`.
fn surface_of(path: Path, relief: ptr<function, Relief>, point: ptr<function, vec3<f32>>) -> Surface {
    let hit = Hit(0.0, path.primitive, path.u, path.v, path.instance & ~SCATTERED);
    var s = surface_at(hit, path.direction);
    if with_assets && !s.view_back && materials[s.material].displacement > 0.0 {
        *relief = relief_new(hit, s, materials[s.material]);
        if (*relief).scale > 0.0 {
            *point = relief_point(*relief, -s.wo, path.sunk);
            s.uv = relief_uv(*relief, materials[s.material], *point, s.wo);
        }
    }
    return s;
}

// Random numbers for the light at one point.
struct LightNumbers {
    ambient_at: vec2<f32>,
    sun_at: vec2<f32>,
    seed: u32,
}

fn light_from_side(
    s: Surface,
    relief: Relief,
    point: vec3<f32>,
    material: Material,
    viewed: ViewedBody,
    light_back: bool,
    width: f32,
    numbers: LightNumbers,
) -> SideLight {
    var done = SideLight(vec3<f32>(0.0), 0u, 0u);
    let seed = numbers.seed;
    var rows: LightRows;
    let origin = select(s.above, s.below, light_back);
    let path = frame.mode == MODE_PATH;
    let surrounded = frame.environment.x > 0u;
    let by_normal = !path && surrounded && frame.sky == SKY_IRRADIANCE;
    // What comes from everywhere alike, if anything does.
    var uniform_light = vec3<f32>(0.0);
    if by_normal {
        uniform_light = environment_irradiance(select(s.normal, -s.normal, light_back)) / TRACE_PI;
    } else if !path && !surrounded {
        uniform_light = frame.ambient;
    }
    let lit_evenly = most(uniform_light) > 0.0;
    let drawn = frame.light_samples < frame.light_count;
    let asked = min(frame.light_samples, frame.light_count);
    let sunny = select(0u, 1u, most(frame.sun_irradiance) > 0.0);
    let around = select(0u, 1u, lit_evenly || (surrounded && !by_normal));
    for (var i = 0u; i < asked + sunny + around; i++) {
        var wi = vec3<f32>(0.0);
        var incident = vec3<f32>(0.0);
        var direction = vec3<f32>(0.0);
        var distance = 0.0;
        if i < asked {
            var chosen = ChosenLight(i, 1.0);
            if drawn {
                chosen = choose_light(s, light_back, i, asked, seed);
                if chosen.scale <= 0.0 {
                    continue;
                }
            }
            let light = lights[chosen.index];
            let to_light = light.position - s.position;
            let distance2 = dot(to_light, to_light);
            if distance2 < MIN_LIGHT_DISTANCE2 {
                continue;
            }
            wi = local_from_world(s, to_light * inverseSqrt(distance2));
            if (wi.z < 0.0) != light_back {
                continue;
            }
            // The decoded value holds the cosine already.
            incident = light.intensity * chosen.scale / (distance2 * TRACE_PI);
            let lifted = light.position - origin;
            distance = length(lifted);
            direction = lifted / max(distance, 1e-30);
        } else if i < asked + sunny {
            direction = sun_sample(numbers.sun_at);
            wi = local_from_world(s, direction);
            if (wi.z < 0.0) != light_back {
                continue;
            }
            incident = frame.sun_irradiance / TRACE_PI;
            distance = TRACE_FAR;
        } else if lit_evenly {
            // A leaf has two sides and takes them in turn.
            let turns = viewed.kind == BODY_LEAF;
            if turns && (sampler_one(seed ^ SIDE_CHOICE) < 0.5) != light_back {
                continue;
            }
            wi = sampler_cosine(numbers.ambient_at);
            // The density of wi is its cosine over pi.
            incident = uniform_light * select(1.0, 2.0, turns) / max(wi.z, 1e-6);
            wi.z = select(wi.z, -wi.z, light_back);
            direction = world_from_local(s, wi);
            distance = frame.occlusion_distance;
        } else {
            // Drawn from the picture or, where no path goes on to it, from the surface as often. A path meets the picture by
            // itself, but seldom where it is small and bright.
            if path || sampler_one(seed ^ ENVIRONMENT_CHOICE) < 0.5 {
                wi = local_from_world(s, environment_sample(numbers.ambient_at));
            } else {
                wi = body_sample(viewed, vec3<f32>(numbers.ambient_at, sampler_one(seed ^ LOBE_CHOICE)), light_back);
            }
            if (wi.z < 0.0) != light_back {
                continue;
            }
            direction = world_from_local(s, wi);
            let density = body_density(viewed, wi);
            // Balance heuristic [Veach 1995].
            var sum = environment_density(direction);
            if path {
                sum += side_share(s, material, light_back) * density;
            } else {
                sum = 0.5 * (sum + density);
            }
            if sum <= 0.0 {
                continue;
            }
            incident = environment_radiance(direction) / (TRACE_PI * sum);
            distance = frame.occlusion_distance;
            if path {
                distance = TRACE_FAR;
            }
        }
        done.rays += 1u;
        let passed = past_volumes(origin, direction, distance, width);
        if passed <= 0.0 {
            continue;
        }
        if with_assets && relief.scale > 0.0 && !light_back && relief_shadowed(relief, point, wi, viewed.bare) {
            continue;
        }
        done.evaluations += select(1u, 0u, viewed.kind == BODY_PLAIN);
        done.radiance += passed * incident * body_light(viewed, material.asset, s.wo, &rows, wi);
    }
    return done;
}

// The mirror direction about the shading normal, kept above the triangle.
fn mirror_direction(s: Surface, direction: vec3<f32>) -> vec3<f32> {
    let side = select(1.0, -1.0, s.view_back);
    let mirrored = reflect(direction, s.normal);
    let above = dot(mirrored, s.flat) * side;
    return normalize(mirrored + s.flat * (side * max(MIN_EYE_COS - above, 0.0)));
}

// Seed of the pixel's random numbers at a depth of its path, for one purpose.
fn seed_of(pixel: vec2<u32>, depth: u32, purpose: u32) -> u32 {
    return sampler_hash(pixel.x + sampler_hash(pixel.y + sampler_hash(depth + (purpose << 16u))));
}

// How a path goes on from a surface.
struct Scattered {
    direction: vec3<f32>,
    // It leaves on the back.
    back: bool,
    // Reflected over density; 0 ends the path.
    weight: vec3<f32>,
    // Per steradian; 0 from a mirror.
    density: f32,
}

fn scatter(
    s: Surface,
    material: Material,
    leaf: ViewedLeaf,
    direction: vec3<f32>,
    at: vec2<f32>,
    choice: f32,
) -> Scattered {
    let nothing = Scattered(direction, s.view_back, vec3<f32>(0.0), 0.0);
    let glossy = most(material.mirror);
    let body = body_share(material);
    if glossy + body <= 0.0 {
        return nothing;
    }
    let mirror_share = glossy / (glossy + body);
    if choice < mirror_share {
        return Scattered(mirror_direction(s, direction), s.view_back, material.mirror / mirror_share, 0.0);
    }
    var rest = (choice - mirror_share) / (1.0 - mirror_share);
    var back = s.view_back;
    if is_plain(material) && rest < share_through(material) {
        back = !back;
    }
    if with_assets && material.asset != NO_ASSET {
        let eye_side = select(0u, 1u, s.view_back);
        if btf_layer_for_sides(material.asset, 0u, 1u - eye_side, eye_side) != NO_LAYER {
            // Either side of the surface is as likely, where light comes from both.
            let both = btf_layer_for_sides(material.asset, 0u, eye_side, eye_side) != NO_LAYER;
            if !both || rest < 0.5 {
                back = !back;
            }
            rest = select(rest, fract(2.0 * rest), both);
        }
    }
    let viewed = viewed_body(s, material, leaf, 0u, back);
    if viewed.kind == BODY_NONE {
        return nothing;
    }
    let wi = body_sample(viewed, vec3<f32>(at, rest), back);
    if viewed.kind == BODY_LEAF {
        back = wi.z < 0.0;
    }
    let density = side_share(s, material, back) * body_density(viewed, wi);
    if density <= 0.0 || (wi.z < 0.0) != back {
        return nothing;
    }
    var rows: LightRows;
    let weight = body_light(viewed, material.asset, s.wo, &rows, wi) / (TRACE_PI * density);
    return Scattered(world_from_local(s, wi), back, weight, density);
}

// Pass: the ray from the eye.
fn camera_pass(at: vec2<u32>) {
    let index = at.y * frame.width + at.x;
    let direction = camera_direction(whole_picture(at));
    var sum = vec4<f32>(0.0, 0.0, 0.0, 1.0);
    if frame.sample > 0u {
        sum += pixels[index].sum;
    }
    let pixel = Pixel(sum, NO_HIT, 0u, 0u, 0u);
    go_on(at, pixel, Path(frame.eye, NO_HIT, direction, 0.0, vec3<f32>(1.0), 0.0, 0u, 0.0, 0.0, 0.0));
}

// Pass: light at what the latest ray hit.
fn light_pass(at: vec2<u32>) {
    let index = at.y * frame.width + at.x;
    let path = paths[index];
    if path.primitive >= IN_VOLUME {
        return;
    }
    var relief: Relief;
    var point = vec3<f32>(0.0);
    let s = surface_of(path, &relief, &point);
    var pixel = pixels[index];
    let numbers = LightNumbers(
        sampler_two(frame.sample, seed_of(whole_picture(at), pixel.depth, AMBIENT_NUMBERS)),
        sampler_two(frame.sample, seed_of(whole_picture(at), pixel.depth, SUN_NUMBERS)),
        sampler_hash(seed_of(whole_picture(at), pixel.depth, LIGHT_NUMBERS) + frame.sample),
    );
    let material = materials[s.material];
    let level = level_of(s, material, path.travelled, numbers.seed);
    let leaf = viewed_leaf_at(s, material, path.instance, level);
    let width = path.travelled * ray_width();
    for (var side = 0u; side < 2u; side++) {
        let viewed = viewed_body(s, material, leaf, level, side == 1u);
        if viewed.kind == BODY_NONE {
            continue;
        }
        let light = light_from_side(s, relief, point, material, viewed, side == 1u, width, numbers);
        pixel.sum += vec4<f32>(path.throughput * light.radiance, 0.0);
        pixel.rays += light.rays;
        pixel.evaluations += light.evaluations;
    }
    pixels[index] = pixel;
}

// Pass: the next ray from a mirror, where the latest one hit one.
fn mirror_pass(at: vec2<u32>) {
    let index = at.y * frame.width + at.x;
    var path = paths[index];
    if path.primitive == NO_HIT {
        return;
    }
    path.throughput *= materials[triangle_at(path.primitive).material].mirror;
    if most(path.throughput) < MIN_THROUGHPUT {
        paths[index].primitive = NO_HIT;
        return;
    }
    var relief: Relief;
    var point = vec3<f32>(0.0);
    let s = surface_of(path, &relief, &point);
    path.direction = mirror_direction(s, path.direction);
    path.origin = select(s.above, s.below, s.view_back);
    go_on(at, pixels[index], path);
}

// Pass: the next ray of a traced path.
fn scatter_pass(at: vec2<u32>) {
    let index = at.y * frame.width + at.x;
    var path = paths[index];
    if path.primitive == NO_HIT {
        return;
    }
    if path.primitive == IN_VOLUME {
        go_on(at, pixels[index], path);
        return;
    }
    var relief: Relief;
    var point = vec3<f32>(0.0);
    let s = surface_of(path, &relief, &point);
    let depth = pixels[index].depth;
    let scatter_at = sampler_two(frame.sample, seed_of(whole_picture(at), depth, SCATTER_NUMBERS));
    let choice = sampler_two(frame.sample, seed_of(whole_picture(at), depth, CHOICE_NUMBERS));
    let material = materials[s.material];
    let leaf = viewed_leaf_at(s, material, path.instance, 0u);
    let next = scatter(s, material, leaf, path.direction, scatter_at, choice.x);
    path.throughput *= next.weight;
    // Russian roulette: dim paths end, the others carry their share on.
    let kept = clamp(most(path.throughput), MIN_KEPT, 1.0);
    if most(path.throughput) <= 0.0 || choice.y >= kept {
        paths[index].primitive = NO_HIT;
        return;
    }
    path.throughput /= kept;
    path.instance |= select(0u, SCATTERED, next.density > 0.0);
    path.density = next.density;
    path.direction = next.direction;
    path.origin = select(s.above, s.below, next.back);
    go_on(at, pixels[index], path);
}

// How wide voxels should be at distance 1 of the eye: as far as a pixel's rays are apart, of which it has had so many.
fn ray_width() -> f32 {
    return frame.pixel_width / min(sqrt(f32(frame.sample + 1u)), MAX_RAYS_ACROSS);
}

fn whole_picture(at: vec2<u32>) -> vec2<u32> {
    return vec2<u32>(at.x, at.y + frame.first_row);
}

// Traces the path's ray and adds what comes along it from beyond everything; where there are volumes, their pass does that.
fn go_on(at: vec2<u32>, before: Pixel, given: Path) {
    let index = at.y * frame.width + at.x;
    var path = given;
    var pixel = before;
    let met = trace_seen(path.origin, path.direction);
    let hit = met.hit;
    path.sunk = met.sunk;
    path.primitive = hit.primitive;
    path.u = hit.u;
    path.v = hit.v;
    path.instance = (path.instance & SCATTERED) | hit.instance;
    pixel.rays += 1u;
    pixel.depth += 1u;
    if pixel.depth == 1u {
        pixel.primitive = hit.primitive;
    }
    if !WITH_VOLUMES {
        arrive(hit.t, &path, &pixel);
    } else if hit.primitive == NO_HIT {
        path.primitive = MISSED;
    }
    pixels[index] = pixel;
    paths[index] = path;
}

// Takes the path to the end of its ray and adds what comes from beyond everything.
fn arrive(t: f32, path: ptr<function, Path>, pixel: ptr<function, Pixel>) {
    (*path).travelled += t;
    if (*path).primitive == NO_HIT {
        var seen = beyond((*path).direction, ((*path).instance & SCATTERED) != 0u);
        if frame.environment.x > 0u && (*path).density > 0.0 {
            // The rest was drawn from the picture.
            seen *= (*path).density / ((*path).density + environment_density((*path).direction));
        }
        (*pixel).sum += vec4<f32>((*path).throughput * seen, 0.0);
    }
}
