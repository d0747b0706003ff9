// Volumetric textures: what a ray sees in them, and what of a light passes them. Twin: cpu_volumes.rs.

const VOLUME_CHOICE_NUMBERS: u32 = 5u;
const VOLUME_SCATTER_NUMBERS: u32 = 6u;
const VOLUME_LIGHT_NUMBERS: u32 = 7u;
// Density of directions that are drawn over the whole sphere, per steradian.
const SPHERE_DENSITY: f32 = 0.07957747;

// Whether rays may meet volumes. Where a scene has none, no_volumes.wgsl stands in for this file.
const WITH_VOLUMES: bool = true;

// What a ray sees in volumes.
struct SeenInVolumes {
    // Light from them.
    radiance: vec3<f32>,
    // Share of what is behind them that passes.
    through: f32,
    // One of the places that are seen, as likely as its share of the pixel.
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

// Share of light that passes the scene's meshes and volumes on the way from a surface.
fn past_volumes(origin: vec3<f32>, direction: vec3<f32>, distance: f32, width: f32) -> f32 {
    if distance <= 0.0 {
        return 1.0;
    }
    return exp(-volume_depth(origin, direction, distance, width));
}

// Where a ray is among volumes.
struct VolumeWay {
    stretches: Stretches,
    stretch: Stretch,
    level: VolumeLevel,
    walk: VoltexWalk,
}

// What the path's ray sees in the scene's volumes up to `t_max`. It and the rays from there to the light take their steps in the
// same lines, because compilers copy what is called into its place.
fn seen_in_volumes(path: Path, t_max: f32, pixel: vec2<u32>, depth: u32) -> SeenInVolumes {
    let sun_at = sampler_two(frame.sample, seed_of(pixel, depth, SUN_NUMBERS));
    let sky_at = sampler_two(frame.sample, seed_of(pixel, depth, AMBIENT_NUMBERS));
    let seed = sampler_hash(seed_of(pixel, depth, VOLUME_LIGHT_NUMBERS) + frame.sample);
    var seen: SeenInVolumes;
    var total = 0.0;
    var open: array<Passage, PASSAGE_SLOTS>;
    let around = frame.light_count + 1u;
    // The sun, then each light by itself along the whole ray, then what surrounds at the place that was drawn. There may be any
    // number of lights; the twin goes along the ray once.
    for (var source = 0u; source <= around; source++) {
        var light = VolumeSource(sun_sample(sun_at), TRACE_FAR, frame.sun_irradiance / TRACE_PI);
        var draws = 0u;
        // Places that hide a part of the pixel together: how much, their light without shadow, and the one at which is asked how
        // much passes, as likely as what it hides.
        var near = 0.0;
        var unshadowed = vec3<f32>(0.0);
        var drawn = seen.point;
        var drawn_light = light;
        // The latest place, which waits while that is asked; and whether there will be no other.
        var point = seen.point;
        var waits = false;
        var is_last = source == around;
        var through = 1.0;
        if is_last {
            drawn_light = volume_surroundings(sky_at);
            if most(drawn_light.incident) > 0.0 {
                let reflected = volume_reflected(drawn, drawn_light.towards, VOLUME_AROUND_ROUGHNESS);
                unshadowed = total * drawn_light.incident * reflected;
            }
        }
        var stretches = volume_stretches(path.origin, path.direction, t_max);
        var stretch: Stretch;
        var level: VolumeLevel;
        var walk: VoltexWalk;
        // While a ray to the light is followed: where the path's ray is, and the optical depth so far.
        var to_light = false;
        var kept: VolumeWay;
        var optical_depth = 0.0;
        loop {
            if waits && near <= VOLUME_SHADOW_STEP {
                waits = false;
                if source > 0u {
                    light = volume_point_light(source - 1u, path.origin + path.direction * point.t);
                }
                if most(light.incident) > 0.0 {
                    unshadowed += point.weight * light.incident * volume_reflected(point, light.towards, 0.0);
                }
                near += point.weight;
                if sampler_one(seed + draws + 1u) * near < point.weight {
                    drawn = point;
                    drawn_light = light;
                }
                // One place for everything that takes a ray of its own.
                if source == 0u {
                    total += point.weight;
                    if sampler_one(seed + draws + 2u) * total < point.weight {
                        seen.point = point;
                    }
                }
                draws += 2u;
                is_last = through <= 0.0;
            }
            if !to_light && (waits || is_last) {
                if most(unshadowed) > 0.0 {
                    seen.rays += 1u;
                    let towards = drawn_light.towards;
                    let origin = path.origin + path.direction * drawn.t + volume_shadow_offset(drawn, towards);
                    to_light = true;
                    optical_depth = 0.0;
                    kept = VolumeWay(stretches, stretch, level, walk);
                    stretches = volume_stretches_in_turn(origin, towards, drawn_light.distance);
                    walk.t_end = walk.t;
                } else if is_last {
                    break;
                } else {
                    near = 0.0;
                    continue;
                }
            }
            if walk.t < walk.t_end {
                let segment = voltex_walk_next(stretch.volume, &walk, level.finer);
                let parts = volume_parts_of(stretch.volume, segment.cell, level.shares, stretch.direction);
                let way = segment.t1 - segment.t0;
                if !to_light {
                    let opacity = 1.0 - exp(-parts.sigma * way);
                    if opacity > VOLUME_MIN_OPACITY {
                        let t = stretch.start + segment.t0 + voltex_seen_at(parts.sigma * way, way);
                        let weight = through * opacity;
                        point = VolumePoint(stretch.map, t, weight, stretch.volume, level, parts, stretch.direction);
                        waits = true;
                        through *= 1.0 - opacity;
                        if through < VOLUME_END {
                            through = 0.0;
                        }
                    }
                    continue;
                }
                optical_depth += parts.sigma * way;
                if optical_depth <= VOLUME_MAX_DEPTH {
                    continue;
                }
                optical_depth = VOLUME_BLACK;
            } else {
                stretch = volume_next(&stretches, &open, stretch);
                if stretch.volume != NO_VOLUME {
                    let t = select(0.5 * (stretch.t0 + stretch.t1), drawn.t, to_light);
                    let width = (path.travelled + t) * ray_width();
                    level = volume_level_of(stretch.volume, stretch.map, width, stretch.direction);
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
            let both_see = volume_shared(drawn, -dot(path.direction, drawn_light.towards));
            seen.radiance += unshadowed * exp(-(1.0 - both_see) * optical_depth);
            if is_last {
                break;
            }
            near = 0.0;
            unshadowed = vec3<f32>(0.0);
            to_light = false;
            stretches = kept.stretches;
            stretch = kept.stretch;
            level = kept.level;
            walk = kept.walk;
        }
        if source == 0u {
            seen.through = through;
        }
        if total <= 0.0 {
            break;
        }
    }
    return seen;
}

fn volume_point_light(number: u32, position: vec3<f32>) -> VolumeSource {
    let way = lights[number].position - position;
    let distance2 = dot(way, way);
    if distance2 <= MIN_LIGHT_DISTANCE2 {
        return VolumeSource(vec3<f32>(0.0), 0.0, vec3<f32>(0.0));
    }
    let distance = sqrt(distance2);
    return VolumeSource(way / distance, distance, lights[number].intensity / (distance2 * TRACE_PI));
}

// What surrounds the scene, from one direction.
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

// Pass: volumes before what the latest ray hit.
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
        arrive(t, &path, &pixel);
    }
    pixels[index] = pixel;
    paths[index] = path;
}

// Adds what the path's ray sees in volumes before `t_max`; false where it ends or scatters there.
fn pass_volumes(at: vec2<u32>, t_max: f32, path: ptr<function, Path>, pixel: ptr<function, Pixel>) -> bool {
    let depth = (*pixel).depth;
    let seen = seen_in_volumes(*path, t_max, at, depth);
    (*pixel).sum += vec4<f32>((*path).throughput * seen.radiance, 0.0);
    (*pixel).rays += seen.rays;
    if frame.mode != MODE_PATH {
        (*path).throughput *= seen.through;
        if seen.through <= 0.0 {
            (*path).primitive = NO_HIT;
        }
        return seen.through > 0.0;
    }
    let choice = sampler_two(frame.sample, seed_of(at, depth, VOLUME_CHOICE_NUMBERS));
    if choice.x < seen.through {
        return true;
    }
    (*path).primitive = NO_HIT;
    if seen.point.weight <= 0.0 {
        return false;
    }
    let next = sampler_sphere(sampler_two(frame.sample, seed_of(at, depth, VOLUME_SCATTER_NUMBERS)));
    let throughput = (*path).throughput * (4.0 * volume_reflected(seen.point, next, VOLUME_AROUND_ROUGHNESS));
    // Russian roulette, as at surfaces.
    let kept = clamp(most(throughput), MIN_KEPT, 1.0);
    if most(throughput) <= 0.0 || choice.y >= kept {
        return false;
    }
    (*path).primitive = IN_VOLUME;
    (*path).throughput = throughput / kept;
    (*path).instance |= SCATTERED;
    (*path).density = SPHERE_DENSITY;
    (*path).travelled += seen.point.t;
    (*path).origin += (*path).direction * seen.point.t + volume_shadow_offset(seen.point, next);
    (*path).direction = next;
    return false;
}
