// Volumetric textures: the light that a ray meets in them, and what of a light passes them. Twin: volumes.rs.

const VOLUME_CHOICE_NUMBERS: u32 = 5u;
const VOLUME_SCATTER_NUMBERS: u32 = 6u;
const VOLUME_LIGHT_NUMBERS: u32 = 7u;
// Density of directions that are drawn over the whole sphere, per steradian.
const SPHERE_DENSITY: f32 = 0.07957747;
// Directions of what surrounds the scene from which one is drawn, and steps from one to the next, in turns.
const SKY_CANDIDATES: u32 = 4u;
const SKY_STEP_X: f32 = 0.25;
const SKY_STEP_Y: f32 = 0.618034;
// Sets apart the number by which the axes of light after one bounce are turned.
const BOUNCE_TURN: u32 = 0x7feb352du;

// Whether rays may meet volumes. Where a scene has none, no_volumes.wgsl stands in for this file.
const WITH_VOLUMES: bool = true;

// What a ray meets in volumes.
struct VolumeRadiance {
    // Light from them.
    radiance: vec3<f32>,
    // Share of what is behind them that passes.
    transmittance: f32,
    // One of the places that are met, as likely as its share of the pixel.
    point: VolumePoint,
    rays: u32,
}

// Light from one direction as a volume meets it.
struct VolumeSource {
    towards: vec3<f32>,
    distance: f32,
    // Irradiance over pi; 0 for none.
    incident: vec3<f32>,
}

// Returns three directions at right angles, turned at random by numbers in [0, 1).
fn turned_axes(at: vec2<f32>, turn: f32) -> array<vec3<f32>, 3> {
    let first = sampler_sphere(at);
    let own = 2.0 * TRACE_PI * at.y;
    let level = vec3<f32>(-sin(own), cos(own), 0.0);
    let upright = cross(first, level);
    let angle = 2.0 * TRACE_PI * turn;
    return array<vec3<f32>, 3>(
        first,
        cos(angle) * level + sin(angle) * upright,
        cos(angle) * upright - sin(angle) * level,
    );
}

// Returns the light that a place reflects and transmits of what comes after one bounce: from six directions, to and fro along three
// axes, each for a sixth of the sphere.
fn reflected_bounce(point: VolumePoint, light: CachedLight, given: array<vec3<f32>, 3>) -> vec3<f32> {
    var axes = given;
    var sum = vec3<f32>(0.0);
    for (var i = 0u; i < 6u; i++) {
        let towards = select(axes[i / 2u], -axes[i / 2u], (i & 1u) == 1u);
        sum += radiance_from(light, towards) * volume_reflected(point, towards, VOLUME_AROUND_ROUGHNESS);
    }
    // 4 pi of the sphere, over pi.
    return sum * (4.0 / 6.0);
}

// Returns the share of light that passes the scene's meshes and volumes on the way from a surface, in the mean over `chance`.
fn past_volumes(origin: vec3<f32>, direction: vec3<f32>, distance: f32, width: f32, chance: f32) -> f32 {
    if distance <= 0.0 {
        return 1.0;
    }
    return volume_passed(volume_depth(origin, direction, distance, width, volume_most_depth(1.0, chance)), 1.0);
}

// Where a ray is among volumes.
struct VolumeWay {
    stretches: Stretches,
    stretch: Stretch,
    level: u32,
    // Of the level, along the ray.
    clumping: f32,
    walk: VoltexWalk,
}

// The places along a path's ray that hide a part of the pixel together, under one light.
struct NearPoints {
    // 0 is the sun, then each light, then what surrounds the scene.
    source: u32,
    seed: u32,
    draws: u32,
    // Share of the pixel that they hide.
    weight: f32,
    // Their light without shadow.
    unshadowed: vec3<f32>,
    // The one at which is asked how much light passes, as likely as what it adds without shadow, and the light there.
    drawn: VolumePoint,
    light: VolumeSource,
    // Of the whole ray: the share of the pixel that is hidden, and one place, as likely as its share.
    total: f32,
    chosen: VolumePoint,
    // What the air before all places hides of them.
    hazed: vec3<f32>,
}

// Returns the light that the path's ray meets in the scene's volumes up to `t_max`.
fn trace_volumes(path: Path, t_max: f32, pixel: vec2<u32>, depth: u32) -> VolumeRadiance {
    let sun_at = sampler_two(frame.sample, seed_of(pixel, depth, SUN_NUMBERS));
    let sky_at = sampler_two(frame.sample, seed_of(pixel, depth, AMBIENT_NUMBERS));
    let sun = VolumeSource(sun_sample(sun_at), TRACE_FAR, frame.sun_irradiance / TRACE_PI);
    var met: VolumeRadiance;
    var near: NearPoints;
    near.seed = sampler_hash(seed_of(pixel, depth, VOLUME_LIGHT_NUMBERS) + frame.sample);
    var open: array<Passage, PASSAGE_SLOTS>;
    let around = frame.light_count + 1u;
    // The sun, then each light by itself along the whole ray, then what surrounds the scene at the place that was
    // drawn. There may be any number of lights; the twin goes along the ray once.
    for (var source = 0u; source <= around; source++) {
        near.source = source;
        near.draws = 0u;
        near.weight = 0.0;
        near.unshadowed = vec3<f32>(0.0);
        near.drawn = near.chosen;
        near.light = sun;
        if source == around {
            near.unshadowed = near.total * air_passed(path, near.drawn.t) * volume_draw_surroundings(&near, sky_at);
        }
        let transmittance = volume_march(path, t_max, sun, &near, &open, &met);
        if source == 0u {
            met.transmittance = transmittance;
        }
        if near.total <= 0.0 {
            break;
        }
    }
    met.point = near.chosen;
    if has_irradiance_volume() && near.total > 0.0 {
        let light = irradiance_volume_at(path.origin + path.direction * near.chosen.t);
        let axes = turned_axes(sky_at, sampler_one(near.seed ^ BOUNCE_TURN));
        met.radiance += near.total * air_passed(path, near.chosen.t) * reflected_bounce(near.chosen, light, axes);
    }
    if most(near.hazed) > 0.0 {
        met.radiance += near.hazed * air_radiance(path.direction);
    }
    return met;
}

// Marches along the path's ray under one light and adds what it meets; returns the transmittance. Shader compilers
// inline every call: the path's ray and the rays from there to the light therefore share one loop. Do not add a second
// call site.
fn volume_march(
    path: Path,
    t_max: f32,
    sun: VolumeSource,
    near: ptr<function, NearPoints>,
    open: ptr<function, array<Passage, PASSAGE_SLOTS>>,
    met: ptr<function, VolumeRadiance>,
) -> f32 {
    // The latest place, which waits while light is asked for; and whether there will be no other.
    var point = (*near).chosen;
    var waits = false;
    var is_last = (*near).source == frame.light_count + 1u;
    var through = 1.0;
    var stretches = volume_stretches(path.origin, path.direction, t_max);
    var stretch: Stretch;
    var level = 0u;
    var clumping = 1.0;
    var walk: VoltexWalk;
    // While a ray to the light is followed: where the path's ray is, the optical depth so far, what that counts, and where the ray ends.
    var to_light = false;
    var kept: VolumeWay;
    var optical_depth = 0.0;
    var factor = 0.0;
    var most_depth = 0.0;
    loop {
        if waits && (*near).weight <= VOLUME_SHADOW_STEP {
            waits = false;
            volume_gather(path, point, sun, near);
            is_last = through <= 0.0;
        }
        if !to_light && (waits || is_last) {
            if most((*near).unshadowed) > 0.0 {
                (*met).rays += 1u;
                let towards = (*near).light.towards;
                let origin = path.origin + path.direction * (*near).drawn.t + volume_shadow_offset((*near).drawn, towards);
                to_light = true;
                optical_depth = 0.0;
                factor = 1.0 - volume_shared((*near).drawn, -dot(path.direction, towards));
                most_depth = volume_most_depth(factor, sampler_one(roulette_seed((*near).seed + (*near).draws, (*near).source)));
                kept = VolumeWay(stretches, stretch, level, clumping, walk);
                stretches = volume_stretches_in_turn(origin, towards, (*near).light.distance);
                walk.t_end = walk.t;
            } else if is_last {
                break;
            } else {
                (*near).weight = 0.0;
                continue;
            }
        }
        if walk.t < walk.t_end {
            let segment = voltex_walk_next(stretch.volume, &walk, level);
            let met = volume_level_met(level, segment.cell);
            let along = volume_clumping_met(stretch.volume, level, clumping, met, stretch.direction);
            let sigma = along * voltex_extinction_along(stretch.volume, segment.cell.voxel, stretch.direction);
            let way = segment.t1 - segment.t0;
            if !to_light {
                let opacity = 1.0 - exp(-sigma * way);
                if opacity > VOLUME_MIN_OPACITY {
                    let t = stretch.start + segment.t0 + voltex_seen_at(sigma * way, way);
                    let weight = through * opacity;
                    point = VolumePoint(stretch.map, t, weight, stretch.volume, met, VolumeCell(segment.cell.voxel, sigma), stretch.direction);
                    waits = true;
                    through *= 1.0 - opacity;
                    if through < VOLUME_END {
                        through = 0.0;
                    }
                }
                continue;
            }
            optical_depth += sigma * way;
            if optical_depth <= most_depth {
                continue;
            }
            optical_depth = VOLUME_BLACK;
        } else {
            stretch = volume_next(&stretches, open, stretch);
            if stretch.volume != NO_VOLUME {
                let t = select(0.5 * (stretch.t0 + stretch.t1), (*near).drawn.t, to_light);
                let width = (path.travelled + t) * voxel_width();
                level = volume_level_of(stretch.volume, stretch.map, width);
                clumping = voltex_clumping_along(stretch.volume, level, stretch.direction);
                walk = volume_walk_of(stretch);
                continue;
            }
            if !to_light {
                is_last = true;
                continue;
            }
            optical_depth = select(optical_depth, VOLUME_BLACK, stretches.entries.is_hidden);
        }
        // The ray to the light has ended.
        (*met).radiance += volume_shadowed_light(near, optical_depth, factor);
        if is_last {
            break;
        }
        to_light = false;
        stretches = kept.stretches;
        stretch = kept.stretch;
        level = kept.level;
        clumping = kept.clumping;
        walk = kept.walk;
    }
    return through;
}

// Adds a place to those that hide a part of the pixel together.
fn volume_gather(path: Path, point: VolumePoint, sun: VolumeSource, near: ptr<function, NearPoints>) {
    var light = sun;
    if (*near).source > 0u {
        light = volume_point_light((*near).source - 1u, path.origin + path.direction * point.t);
    }
    let passed = air_passed(path, point.t);
    if most(light.incident) > 0.0 {
        let own = passed * point.weight * light.incident * volume_reflected(point, light.towards, 0.0);
        (*near).unshadowed += own;
        if sampler_one((*near).seed + (*near).draws + 1u) * dot((*near).unshadowed, vec3<f32>(1.0)) < dot(own, vec3<f32>(1.0)) {
            (*near).drawn = point;
            (*near).light = light;
        }
    }
    (*near).weight += point.weight;
    // One place for everything that takes a ray of its own.
    if (*near).source == 0u {
        (*near).total += point.weight;
        (*near).hazed += point.weight * (1.0 - passed);
        if sampler_one((*near).seed + (*near).draws + 2u) * (*near).total < point.weight {
            (*near).chosen = point;
        }
    }
    (*near).draws += 2u;
}

// Returns the light of the places that were gathered, through what one of them is shadowed by, and forgets the places.
fn volume_shadowed_light(near: ptr<function, NearPoints>, optical_depth: f32, factor: f32) -> vec3<f32> {
    let radiance = (*near).unshadowed * volume_passed(optical_depth, factor);
    (*near).weight = 0.0;
    (*near).unshadowed = vec3<f32>(0.0);
    return radiance;
}

// Returns a point light as a place meets it.
fn volume_point_light(number: u32, position: vec3<f32>) -> VolumeSource {
    let light = light_at(number);
    let way = light.position - position;
    let distance2 = dot(way, way);
    if distance2 <= MIN_LIGHT_DISTANCE2 {
        return VolumeSource(vec3<f32>(0.0), 0.0, vec3<f32>(0.0));
    }
    let distance = sqrt(distance2);
    return VolumeSource(way / distance, distance, light.intensity / (distance2 * TRACE_PI));
}

// Returns the light of what surrounds the scene, from the direction that the numbers `at` draw.
fn volume_surroundings(at: vec2<f32>) -> VolumeSource {
    let path = frame.mode == MODE_PATH;
    let distance = select(frame.occlusion_distance, TRACE_FAR, path);
    var source = VolumeSource(vec3<f32>(0.0), distance, vec3<f32>(0.0));
    if frame.environment.x > 0u {
        source.towards = environment_sample(at);
        let density = environment_density(source.towards) + select(0.0, SPHERE_DENSITY, path);
        if density > 0.0 {
            source.incident = environment_radiance(source.towards) / (TRACE_PI * density);
        }
    } else if !path {
        source.towards = sampler_sphere(at);
        source.incident = frame.ambient / (TRACE_PI * SPHERE_DENSITY);
    }
    return source;
}

// Draws the light of a direction of what surrounds the scene: of some candidates one, as likely as what it adds without shadow. Returns
// the light that the drawn place reflects and transmits of it.
fn volume_draw_surroundings(near: ptr<function, NearPoints>, at: vec2<f32>) -> vec3<f32> {
    var sum = 0.0;
    var kept = vec3<f32>(0.0);
    for (var k = 0u; k < SKY_CANDIDATES; k++) {
        let light = volume_surroundings(fract(at + f32(k) * vec2<f32>(SKY_STEP_X, SKY_STEP_Y)));
        if most(light.incident) > 0.0 {
            let reflected = light.incident * volume_reflected((*near).drawn, light.towards, VOLUME_AROUND_ROUGHNESS);
            let weight = dot(reflected, vec3<f32>(1.0));
            sum += weight;
            // Places draw numbers above the seed.
            if sampler_one((*near).seed - k) * sum < weight {
                kept = reflected / weight;
                (*near).light = light;
            }
        }
    }
    return kept * (sum / f32(SKY_CANDIDATES));
}

// Adds what the latest ray meets in volumes before what it hit.
fn volume_pass(at: vec2<u32>) {
    let index = at.y * frame.width + at.x;
    var path = paths[index];
    var pixel = pixels[index];
    if path.primitive == NO_HIT {
        return;
    }
    var t = TRACE_FAR;
    if path.primitive == MISSED {
        path.primitive = NO_HIT;
    } else {
        let hit = Hit(0.0, path.primitive, path.u, path.v, path.instance & ~SCATTERED);
        t = dot(surface_at(hit, path.direction).position - path.origin, path.direction);
    }
    if pass_volumes(whole_picture(at), t, &path, &pixel) {
        end_ray(t, &path, &pixel);
    }
    pixels[index] = pixel;
    paths[index] = path;
}

// Adds the light that the path's ray meets in volumes before `t_max`; returns false where the path ends or scatters
// there.
fn pass_volumes(at: vec2<u32>, t_max: f32, path: ptr<function, Path>, pixel: ptr<function, Pixel>) -> bool {
    let depth = (*pixel).depth;
    let met = trace_volumes(*path, t_max, at, depth);
    (*pixel).sum += vec4<f32>((*path).throughput * met.radiance, 0.0);
    (*pixel).rays += met.rays;
    if frame.mode != MODE_PATH {
        (*path).throughput *= met.transmittance;
        if met.transmittance <= 0.0 {
            (*path).primitive = NO_HIT;
        }
        return met.transmittance > 0.0;
    }
    let choice = sampler_two(frame.sample, seed_of(at, depth, VOLUME_CHOICE_NUMBERS));
    if choice.x < met.transmittance {
        return true;
    }
    (*path).primitive = NO_HIT;
    if met.point.weight <= 0.0 {
        return false;
    }
    let next = sampler_sphere(sampler_two(frame.sample, seed_of(at, depth, VOLUME_SCATTER_NUMBERS)));
    let passed = air_passed(*path, met.point.t);
    let scattered = (*path).throughput * passed * (4.0 * volume_reflected(met.point, next, VOLUME_AROUND_ROUGHNESS));
    let throughput = roulette(scattered, choice.y);
    if most(throughput) <= 0.0 {
        return false;
    }
    (*path).primitive = IN_VOLUME;
    (*path).throughput = throughput;
    (*path).instance |= SCATTERED;
    (*path).density = SPHERE_DENSITY;
    (*path).travelled += met.point.t;
    (*path).origin += (*path).direction * met.point.t + volume_shadow_offset(met.point, next);
    (*path).direction = next;
    return false;
}
