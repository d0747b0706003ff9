// The irradiance volume: a grid over the scene that holds the light which arrives after one bounce, as spherical harmonics of
// the first order. Twin: irradiance_volume.rs, which says how the quads of numbers lie.

// Quads of numbers before those of the cells, and of a cell.
const IRRADIANCE_VOLUME_HEAD: u32 = 3u;
const IRRADIANCE_VOLUME_QUADS: u32 = 3u;
// What a surface sees of a cell's vector in its irradiance over pi.
const IRRADIANCE_SLOPE: f32 = 0.6666667;

// Whether the scene has one.
override with_irradiance_volume: bool = true;

// The light at a place: of each channel a vector b and the mean a; a + b.w comes from the direction w.
struct CachedLight {
    red: vec4<f32>,
    green: vec4<f32>,
    blue: vec4<f32>,
}

// Returns whether there is a volume.
fn has_irradiance_volume() -> bool {
    return with_irradiance_volume && frame.irradiance_at > 0u;
}

// Returns the light at a place, trilinear between the middles of cells; beyond them that of the nearest.
fn irradiance_volume_at(position: vec3<f32>) -> CachedLight {
    let low = light_words[frame.irradiance_at];
    let per_unit = light_words[frame.irradiance_at + 1u];
    let count = vec3<f32>(low.w, per_unit.w, light_words[frame.irradiance_at + 2u].w);
    let at = clamp((position - low.xyz) * per_unit.xyz - 0.5, vec3<f32>(0.0), count - 1.0);
    let first = floor(at);
    let part = at - first;
    let next = min(first + 1.0, count - 1.0);
    let cells = vec3<u32>(count);
    var sum = CachedLight(vec4<f32>(0.0), vec4<f32>(0.0), vec4<f32>(0.0));
    for (var corner = 0u; corner < 8u; corner++) {
        let upper = ((vec3<u32>(corner) >> vec3<u32>(0u, 1u, 2u)) & vec3<u32>(1u)) == vec3<u32>(1u);
        let place = vec3<u32>(select(first, next, upper));
        let weights = select(1.0 - part, part, upper);
        let weight = weights.x * weights.y * weights.z;
        let cell = (place.z * cells.y + place.y) * cells.x + place.x;
        let quad = frame.irradiance_at + IRRADIANCE_VOLUME_HEAD + IRRADIANCE_VOLUME_QUADS * cell;
        sum.red += weight * light_words[quad];
        sum.green += weight * light_words[quad + 1u];
        sum.blue += weight * light_words[quad + 2u];
    }
    return sum;
}

// Returns about what comes from the direction `towards`, of the light of a place.
fn radiance_from(light: CachedLight, towards: vec3<f32>) -> vec3<f32> {
    let d = vec4<f32>(towards, 1.0);
    return max(vec3<f32>(dot(light.red, d), dot(light.green, d), dot(light.blue, d)), vec3<f32>(0.0));
}

// Returns the irradiance over pi of a surface of this normal, of the light of a place.
fn irradiance_of(light: CachedLight, normal: vec3<f32>) -> vec3<f32> {
    let d = vec4<f32>(IRRADIANCE_SLOPE * normal, 1.0);
    return max(vec3<f32>(dot(light.red, d), dot(light.green, d), dot(light.blue, d)), vec3<f32>(0.0));
}
