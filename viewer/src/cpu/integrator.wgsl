// Follows the path of a pixel's sample in passes over all pixels: the ray from the eye, the light at what it hits, then
// ray and light again for each mirror, or each step of a path, on the way. Twin: integrator.rs, which follows a whole
// path.

// Paths whose radiance counts for less than this in the pixel end at a mirror.
const MIN_THROUGHPUT: f32 = 1e-3;

// Returns the radiance that comes along a path's latest ray from beyond everything.
fn miss_radiance(path: Path) -> vec3<f32> {
    let scattered = (path.instance & SCATTERED) != 0u;
    var sun = vec3<f32>(0.0);
    // What scattered has met it already.
    if !scattered && most(frame.sun_irradiance) > 0.0 {
        sun = sun_radiance(path.direction);
    }
    if !with_environment || frame.environment.x == 0u {
        return select(frame.background, frame.ambient, scattered) + sun;
    }
    let radiance = environment_radiance(path.direction) + sun;
    if path.density > 0.0 {
        // The rest was drawn from the picture.
        return radiance * (path.density / (path.density + environment_density(path.direction)));
    }
    return radiance;
}

// Traces the ray from the eye.
fn camera_pass(at: vec2<u32>) {
    let index = at.y * frame.width + at.x;
    let direction = camera_direction(whole_picture(at));
    var sum = vec4<f32>(0.0, 0.0, 0.0, 1.0);
    if frame.sample > 0u {
        sum += pixels[index].sum;
    }
    let pixel = Pixel(sum, NO_HIT, 0u, 0u, 0u);
    advance_path(at, pixel, Path(frame.eye, NO_HIT, direction, 0.0, vec3<f32>(1.0), 0.0, 0u, 0.0, 0.0, 0.0));
}

// Adds the light at what the latest ray hit.
fn light_pass(at: vec2<u32>) {
    let index = at.y * frame.width + at.x;
    let path = paths[index];
    if path.primitive >= IN_VOLUME {
        return;
    }
    var relief: Relief;
    var point = vec3<f32>(0.0);
    var s = surface_of(path, &relief, &point);
    var pixel = pixels[index];
    let numbers = LightNumbers(
        sampler_two(frame.sample, seed_of(whole_picture(at), pixel.depth, AMBIENT_NUMBERS)),
        sampler_two(frame.sample, seed_of(whole_picture(at), pixel.depth, SUN_NUMBERS)),
        sampler_hash(seed_of(whole_picture(at), pixel.depth, LIGHT_NUMBERS) + frame.sample),
    );
    let material = materials[s.material];
    let level = level_of(s, material, path.travelled, numbers.seed);
    let leaf = viewed_leaf(s, material, path.instance, level);
    let width = path.travelled * voxel_width();
    let taps = texel_taps(material, pixel.depth);
    var tap = TexelTap(texel_numbers(s, path.travelled, whole_picture(at), pixel.depth), 1.0);
    for (var number = 0u; number < taps; number++) {
        if taps > 1u {
            tap = texel_tap(s, level, number);
        }
        s.texel_at = tap.at;
        for (var side = 0u; side < 2u; side++) {
            let viewed = viewed_body(s, material, leaf, level, side == 1u);
            if viewed.kind == BODY_NONE {
                continue;
            }
            let light = direct_light(LitPoint(s, relief, point, material, viewed, side == 1u, width, numbers));
            pixel.sum += vec4<f32>(tap.weight * path.throughput * light.radiance, 0.0);
            pixel.rays += light.rays;
            pixel.evaluations += light.evaluations;
        }
    }
    pixels[index] = pixel;
}

// Traces the next ray from a mirror, where the latest one hit one.
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
    advance_path(at, pixels[index], path);
}

// Traces the next ray of a traced path.
fn scatter_pass(at: vec2<u32>) {
    let index = at.y * frame.width + at.x;
    var path = paths[index];
    if path.primitive == NO_HIT {
        return;
    }
    if path.primitive == IN_VOLUME {
        advance_path(at, pixels[index], path);
        return;
    }
    var relief: Relief;
    var point = vec3<f32>(0.0);
    var s = surface_of(path, &relief, &point);
    let depth = pixels[index].depth;
    s.texel_at = texel_numbers(s, path.travelled, whole_picture(at), depth);
    let scatter_at = sampler_two(frame.sample, seed_of(whole_picture(at), depth, SCATTER_NUMBERS));
    let choice = sampler_two(frame.sample, seed_of(whole_picture(at), depth, CHOICE_NUMBERS));
    let material = materials[s.material];
    let leaf = viewed_leaf(s, material, path.instance, 0u);
    let next = scatter(s, material, leaf, path.direction, scatter_at, choice.x);
    path.throughput = roulette(path.throughput * next.weight, choice.y);
    if most(path.throughput) <= 0.0 {
        paths[index].primitive = NO_HIT;
        return;
    }
    path.instance |= select(0u, SCATTERED, next.density > 0.0);
    path.density = next.density;
    path.direction = next.direction;
    path.origin = select(s.above, s.below, next.back);
    advance_path(at, pixels[index], path);
}

// Returns the pixel of the whole picture that a pixel of the band is.
fn whole_picture(at: vec2<u32>) -> vec2<u32> {
    return vec2<u32>(at.x, at.y + frame.first_row);
}

// Traces the path's ray and adds what comes along it from beyond everything; where there are volumes, their pass does
// that.
fn advance_path(at: vec2<u32>, before: Pixel, given: Path) {
    let index = at.y * frame.width + at.x;
    var path = given;
    var pixel = before;
    let met = trace_closest(path.origin, path.direction);
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
        end_ray(hit.t, &path, &pixel);
    } else if hit.primitive == NO_HIT {
        path.primitive = MISSED;
    }
    pixels[index] = pixel;
    paths[index] = path;
}

// Takes the path to the end of its ray and adds what comes from the air before it, or from beyond everything.
fn end_ray(t: f32, path: ptr<function, Path>, pixel: ptr<function, Pixel>) {
    (*path).travelled += t;
    if (*path).primitive == NO_HIT {
        (*pixel).sum += vec4<f32>((*path).throughput * miss_radiance(*path), 0.0);
        return;
    }
    let passed = air_passed(*path, t);
    if most(1.0 - passed) > 0.0 {
        (*pixel).sum += vec4<f32>((*path).throughput * (1.0 - passed) * air_radiance((*path).direction), 0.0);
        (*path).throughput *= passed;
    }
}
