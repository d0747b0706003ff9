// One sample of one pixel. Twin: cpu.rs, the same functions in the same order.
// The includer defines trace_closest and trace_occluded.

struct Hit {
    t: f32,
    primitive: u32,
    u: f32,
    v: f32,
}

const NO_HIT: u32 = 0xffffffffu;
const TRACE_FAR: f32 = 1e30;
const TRACE_PI: f32 = 3.14159265;
// Cosine to which an eye below the shading horizon is lifted; interpolated normals turn away at silhouettes.
const LEAST_EYE_COS: f32 = 1e-3;
// A light nearer than this (squared) to the surface is left out.
const LEAST_LIGHT_DISTANCE2: f32 = 1e-12;

fn camera_direction(pixel: vec2<u32>) -> vec3<f32> {
    let x = 2.0 * (f32(pixel.x) + 0.5 + frame.jitter.x) / f32(frame.width) - 1.0;
    let y = 1.0 - 2.0 * (f32(pixel.y) + 0.5 + frame.jitter.y) / f32(frame.height);
    return normalize(frame.forward + frame.right * x + frame.up * y);
}

fn normalize_or(v: vec3<f32>, other: vec3<f32>) -> vec3<f32> {
    let length2 = dot(v, v);
    if length2 > 1e-20 {
        return v * inverseSqrt(length2);
    }
    return other;
}

// A vector perpendicular to the unit n.
fn perpendicular(n: vec3<f32>) -> vec3<f32> {
    if abs(n.x) < 0.9 {
        return normalize(vec3<f32>(0.0, -n.z, n.y));
    }
    return normalize(vec3<f32>(n.z, 0.0, -n.x));
}

// Moves a point off a surface by some units in the last place [Waechter and Binder 2019].
fn offset_along(p: vec3<f32>, n: vec3<f32>) -> vec3<f32> {
    let steps = vec3<i32>(n * 256.0);
    let moved = bitcast<vec3<f32>>(bitcast<vec3<i32>>(p) + select(steps, -steps, p < vec3<f32>(0.0)));
    return select(moved, p + n / 65536.0, abs(p) < vec3<f32>(1.0 / 32.0));
}

// Lifts a point of a flat triangle onto the curved surface that its normals mean, which keeps the shadow's edge on a
// curved object smooth [Hanika 2021]. `side` is 1 or -1, the side of the light.
fn lift(p: vec3<f32>, weights: vec3<f32>, corners: array<Vertex, 3>, side: f32) -> vec3<f32> {
    var at = vec3<f32>(0.0);
    for (var i = 0u; i < 3u; i++) {
        let normal = corners[i].normal * side;
        at += weights[i] * (p - normal * min(dot(p - corners[i].position, normal), 0.0));
    }
    return at;
}

fn shade_pixel(pixel: vec2<u32>) {
    var rays = 1u;
    var evaluations = 0u;
    var radiance = frame.background;
    let direction = camera_direction(pixel);
    let hit = trace_closest(frame.eye, direction);
    if hit.primitive != NO_HIT {
        radiance = vec3<f32>(0.0);
        let triangle = triangles[hit.primitive];
        let corners = array<Vertex, 3>(
            vertices[triangle.vertices.x],
            vertices[triangle.vertices.y],
            vertices[triangle.vertices.z],
        );
        let a = corners[0];
        let b = corners[1];
        let c = corners[2];
        let weights = vec3<f32>(1.0 - hit.u - hit.v, hit.u, hit.v);
        let p = a.position * weights.x + b.position * weights.y + c.position * weights.z;
        let uv = vec2<f32>(
            a.u * weights.x + b.u * weights.y + c.u * weights.z,
            a.v * weights.x + b.v * weights.y + c.v * weights.z,
        );

        // The flat normal, on the side of the shading normal; the frame of the texel.
        var flat = normalize_or(cross(b.position - a.position, c.position - a.position), vec3<f32>(0.0, 0.0, 1.0));
        let normal = normalize_or(a.normal * weights.x + b.normal * weights.y + c.normal * weights.z, flat);
        if dot(flat, normal) < 0.0 {
            flat = -flat;
        }
        let slanted = a.tangent.xyz * weights.x + b.tangent.xyz * weights.y + c.tangent.xyz * weights.z;
        let tangent = normalize_or(slanted - normal * dot(normal, slanted), perpendicular(normal));
        let bitangent = cross(normal, tangent) * a.tangent.w;

        let wo_world = -direction;
        let view_back = dot(flat, wo_world) < 0.0;
        var wo = vec3<f32>(dot(tangent, wo_world), dot(bitangent, wo_world), dot(normal, wo_world));
        wo.z = select(max(wo.z, LEAST_EYE_COS), min(wo.z, -LEAST_EYE_COS), view_back);
        wo = normalize(wo);

        let material = materials[triangle.material];
        var texel = 0u;
        var layers = 0u;
        if material.asset != NO_ASSET {
            texel = btf_texel(material.asset, uv * material.uv_scale);
            layers = asset_word(material.asset + ASSET_LAYER_COUNT);
        }
        let options = BtfOptions(frame.components, frame.lobes, frame.interpolation, frame.parallax);

        for (var i = 0u; i < frame.light_count; i++) {
            let light = lights[i];
            let to_light = light.position - p;
            let distance2 = dot(to_light, to_light);
            if distance2 < LEAST_LIGHT_DISTANCE2 {
                continue;
            }
            let wi_world = to_light * inverseSqrt(distance2);
            let wi = vec3<f32>(dot(tangent, wi_world), dot(bitangent, wi_world), dot(normal, wi_world));
            let light_back = wi.z < 0.0;
            var layer = 0u;
            if material.asset != NO_ASSET {
                layer = btf_layer_for_sides(material.asset, select(0u, 1u, light_back), select(0u, 1u, view_back));
                if layer >= layers {
                    continue;
                }
            } else if light_back != view_back {
                continue;
            }
            let side = select(1.0, -1.0, light_back);
            let origin = offset_along(lift(p, weights, corners, side), flat * side);
            let to_light_lifted = light.position - origin;
            let distance = length(to_light_lifted);
            rays += 1u;
            if distance > 0.0 && trace_occluded(origin, to_light_lifted / distance, distance) {
                continue;
            }
            var reflected = material.diffuse * abs(wi.z);
            if material.asset != NO_ASSET {
                reflected = btf_decode(material.asset, layer, texel, wi, wo, options);
                evaluations += 1u;
            }
            // The decoded value holds the cosine already.
            radiance += light.intensity * reflected / (distance2 * TRACE_PI);
        }
    }
    let index = pixel.y * frame.width + pixel.x;
    var sum = vec4<f32>(radiance, 1.0);
    if frame.sample > 0u {
        sum += accumulation[index];
    }
    accumulation[index] = sum;
    pixel_hits[index] = PixelHit(hit.primitive, rays, evaluations, 0u);
}
