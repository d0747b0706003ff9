// Light that comes to a surface straight from lamps, from the sun and from what surrounds the scene. Twin:
// direct_light.rs.

// Set apart the numbers that are drawn from a light's seed.
const ENVIRONMENT_CHOICE: u32 = 0x68bc21ebu;
const LOBE_CHOICE: u32 = 0x02e5be93u;
const SIDE_CHOICE: u32 = 0x1b873593u;
const ROULETTE_CHANCE: u32 = 0x2c1b3c6du;

// Random numbers for the light at one point.
struct LightNumbers {
    ambient_at: vec2<f32>,
    sun_at: vec2<f32>,
    seed: u32,
}

// A point of a surface that light reaches from one side.
struct LitPoint {
    s: Surface,
    // The displaced surface there, and the point of it that is met; of scale 0 where there is none.
    relief: Relief,
    point: vec3<f32>,
    material: Material,
    // View-dependent half of the shading, for light on this side.
    viewed: ViewedBody,
    // Whether light comes from the back.
    light_back: bool,
    // Width of voxels for shadow rays.
    width: f32,
    numbers: LightNumbers,
}

// Light from one direction.
struct LightSample {
    // Unit direction to the light, texel frame.
    wi: vec3<f32>,
    // Irradiance at normal incidence over pi, over the density of the direction where that was drawn: decoded values
    // hold the cosine.
    incident: vec3<f32>,
    // Unit direction to the light, world.
    direction: vec3<f32>,
    // Distance up to which something may be in the way; 0 for none.
    distance: f32,
    // Whether the sample adds anything.
    is_lit: bool,
}

// Light that a point sends to the eye of what reaches it from one side, and what it took.
struct SideLight {
    radiance: vec3<f32>,
    rays: u32,
    evaluations: u32,
}

// A light and the factor on what it adds; 0 for none.
struct ChosenLight {
    index: u32,
    scale: f32,
}

// Returns the seed of the number by which a ray to one of the light's sources ends early.
fn roulette_seed(seed: u32, source: u32) -> u32 {
    return seed ^ (ROULETTE_CHANCE * (source + 1u));
}

// Draws the light of stratum `stratum` of `strata`, which divide among them what the lights add around the place: of some
// candidates spread over the stratum one, as likely as what it could add unshadowed over its probability as a candidate
// [Talbot 2005]. Where candidates are enough for all lights, the strata divide these in their order.
fn choose_light(s: Surface, light_back: bool, stratum: u32, strata: u32, seed: u32) -> ChosenLight {
    let part = 1.0 / f32(strata * LIGHT_CANDIDATES);
    let by_grid = frame.light_count > strata * LIGHT_CANDIDATES;
    var drawn = DrawnLight(0u, 0u, f32(frame.light_count));
    if by_grid {
        drawn.range = light_grid_range(light_grid_cell(s.position), f32(stratum * LIGHT_CANDIDATES) * part);
    }
    var total = 0.0;
    var kept = 0.0;
    var chosen = ChosenLight(0u, 0.0);
    for (var k = 0u; k < LIGHT_CANDIDATES; k++) {
        let number = stratum * LIGHT_CANDIDATES + k;
        let x = min((f32(number) + sampler_one(seed + 2u * number)) * part, BELOW_ONE);
        if by_grid {
            drawn = light_grid_draw(drawn.range, x);
        } else {
            drawn.index = u32(x * f32(frame.light_count));
        }
        let light = light_at(drawn.index);
        let to_light = light.position - s.position;
        let nearness = inverseSqrt(max(dot(to_light, to_light), MIN_LIGHT_DISTANCE2));
        let cosine = dot(s.normal, to_light) * nearness;
        let towards = select(cosine, -cosine, light_back);
        let could_add = max(most(light.intensity), 0.0) * max(towards, 0.0) * (nearness * nearness);
        total += could_add * drawn.weight;
        if sampler_one(seed + 2u * number + 1u) * total < could_add * drawn.weight {
            chosen.index = drawn.index;
            kept = could_add;
        }
    }
    if kept > 0.0 {
        chosen.scale = total * part / kept;
    }
    return chosen;
}

// Samples point light `i` of `asked`.
fn sample_point_light(lit: LitPoint, i: u32, asked: u32) -> LightSample {
    var sample = LightSample();
    var chosen = ChosenLight(i, 1.0);
    if with_drawn_lights && asked < frame.light_count {
        chosen = choose_light(lit.s, lit.light_back, i, asked, lit.numbers.seed);
        if chosen.scale <= 0.0 {
            return sample;
        }
    }
    let light = light_at(chosen.index);
    let to_light = light.position - lit.s.position;
    let distance2 = dot(to_light, to_light);
    if distance2 < MIN_LIGHT_DISTANCE2 {
        return sample;
    }
    sample.wi = local_from_world(lit.s, to_light * inverseSqrt(distance2));
    // The decoded value holds the cosine already.
    sample.incident = light.intensity * chosen.scale / (distance2 * TRACE_PI);
    let lifted = light.position - light_origin(lit);
    sample.distance = length(lifted);
    sample.direction = lifted / max(sample.distance, 1e-30);
    sample.is_lit = (sample.wi.z < 0.0) == lit.light_back;
    return sample;
}

// Samples the sun's disc.
fn sample_sun_light(lit: LitPoint) -> LightSample {
    let direction = sun_sample(lit.numbers.sun_at);
    let wi = local_from_world(lit.s, direction);
    return LightSample(wi, frame.sun_irradiance / TRACE_PI, direction, TRACE_FAR, (wi.z < 0.0) == lit.light_back);
}

// Returns the radiance that comes from everywhere alike, if anything does; a sky counts where it lights by its
// irradiance.
fn uniform_light(lit: LitPoint) -> vec3<f32> {
    let path = frame.mode == MODE_PATH;
    let surrounded = with_environment && frame.environment.x > 0u;
    if !path && surrounded && frame.sky == SKY_IRRADIANCE {
        return environment_irradiance(select(lit.s.normal, -lit.s.normal, lit.light_back)) / TRACE_PI;
    }
    if !path && !surrounded {
        return frame.ambient;
    }
    return vec3<f32>(0.0);
}

// Samples light of the radiance `uniform_radiance` from everywhere.
fn sample_uniform_light(lit: LitPoint, uniform_radiance: vec3<f32>) -> LightSample {
    // A leaf has two sides and takes them in turn.
    let turns = lit.viewed.kind == BODY_LEAF;
    let is_lit = !turns || (sampler_one(lit.numbers.seed ^ SIDE_CHOICE) < 0.5) == lit.light_back;
    var wi = sampler_cosine(lit.numbers.ambient_at);
    // The density of wi is its cosine over pi.
    let incident = uniform_radiance * select(1.0, 2.0, turns) / max(wi.z, 1e-6);
    wi.z = select(wi.z, -wi.z, lit.light_back);
    return LightSample(wi, incident, world_from_local(lit.s, wi), frame.occlusion_distance, is_lit);
}

// Samples the picture that surrounds the scene.
fn sample_environment_light(lit: LitPoint) -> LightSample {
    var sample = LightSample();
    let numbers = lit.numbers;
    let path = frame.mode == MODE_PATH;
    // Drawn from the picture or, where no path goes on to it, from the surface as often. A path meets the picture by
    // itself, but seldom where it is small and bright.
    var wi: vec3<f32>;
    if path || sampler_one(numbers.seed ^ ENVIRONMENT_CHOICE) < 0.5 {
        wi = local_from_world(lit.s, environment_sample(numbers.ambient_at));
    } else {
        let at = vec3<f32>(numbers.ambient_at, sampler_one(numbers.seed ^ LOBE_CHOICE));
        wi = body_sample(lit.viewed, at, lit.light_back);
    }
    if (wi.z < 0.0) != lit.light_back {
        return sample;
    }
    let direction = world_from_local(lit.s, wi);
    let density = body_density(lit.viewed, wi);
    // Balance heuristic [Veach 1995].
    var sum = environment_density(direction);
    if path {
        sum += side_share(lit.s, lit.material, lit.light_back) * density;
    } else {
        sum = 0.5 * (sum + density);
    }
    if sum <= 0.0 {
        return sample;
    }
    let incident = environment_radiance(direction) / (TRACE_PI * sum);
    return LightSample(wi, incident, direction, select(frame.occlusion_distance, TRACE_FAR, path), true);
}

// Samples the light that comes to a surface after one bounce, as if it were the same from everywhere on this side: nothing is in the
// way of it.
fn sample_bounced_light(lit: LitPoint) -> LightSample {
    let light = irradiance_volume_at(lit.s.position);
    var wi = sampler_cosine(lit.numbers.ambient_at);
    let irradiance = irradiance_of(light, select(lit.s.normal, -lit.s.normal, lit.light_back));
    // The density of wi is its cosine over pi.
    let incident = irradiance / max(wi.z, 1e-6);
    wi.z = select(wi.z, -wi.z, lit.light_back);
    return LightSample(wi, incident, world_from_local(lit.s, wi), 0.0, true);
}

// Returns the light that a point sends to the eye of what reaches it from one side: of point lights and the sun with
// their shadows, then of what surrounds the scene along one ray, then what is cached of one bounce. Shader compilers inline every
// call, so all of them share one shadow ray and one evaluation.
fn direct_light(lit: LitPoint) -> SideLight {
    var done = SideLight(vec3<f32>(0.0), 0u, 0u);
    var rows: LightRows;
    let origin = light_origin(lit);
    let uniform_radiance = uniform_light(lit);
    let lit_evenly = most(uniform_radiance) > 0.0;
    let by_normal = frame.mode != MODE_PATH && frame.sky == SKY_IRRADIANCE;
    let asked = min(frame.light_samples, frame.light_count);
    let sunny = select(0u, 1u, most(frame.sun_irradiance) > 0.0);
    let around = select(0u, 1u, lit_evenly || (with_environment && frame.environment.x > 0u && !by_normal));
    let traced = asked + sunny + around;
    for (var i = 0u; i < traced + select(0u, 1u, has_irradiance_volume()); i++) {
        var light: LightSample;
        if i < asked {
            light = sample_point_light(lit, i, asked);
        } else if i < asked + sunny {
            light = sample_sun_light(lit);
        } else if with_irradiance_volume && i >= traced {
            light = sample_bounced_light(lit);
        } else if lit_evenly {
            light = sample_uniform_light(lit, uniform_radiance);
        } else if with_environment {
            light = sample_environment_light(lit);
        }
        if !light.is_lit {
            continue;
        }
        done.rays += select(0u, 1u, light.distance > 0.0);
        let chance = sampler_one(roulette_seed(lit.numbers.seed, i));
        let passed = past_volumes(origin, light.direction, light.distance, lit.width, chance);
        if passed <= 0.0 {
            continue;
        }
        if with_displacement && lit.relief.scale > 0.0 && !lit.light_back
            && relief_shadowed(lit.relief, lit.point, light.wi, lit.viewed.bare) {
            continue;
        }
        done.evaluations += select(1u, 0u, lit.viewed.kind == BODY_PLAIN);
        done.radiance += passed * light.incident * body_light(lit.viewed, lit.material.asset, lit.s.wo, &rows, light.wi);
    }
    return done;
}

// Returns where rays to lights begin.
fn light_origin(lit: LitPoint) -> vec3<f32> {
    return select(lit.s.above, lit.s.below, lit.light_back);
}
