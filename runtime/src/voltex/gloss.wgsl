// The specular lobe of a voxel's microflakes: light that their smooth surfaces reflect to the eye. Twin:
// voltex/gloss.rs, which has the equations.

const VOLTEX_MIN_ROUGHNESS: f32 = 0.1;
const VOLTEX_MIN_REFRACTED: f32 = 1e-4;
const VOLTEX_MIN_HALF2: f32 = 1e-10;
const VOLTEX_MIN_NORMAL2: f32 = 1e-20;
const VOLTEX_MIDDLE_WEIGHT: f32 = 0.5;
const VOLTEX_MAX_DENSER: f32 = 4.0;

// Returns the specular lobe for light from `l`, seen from `v`, unit vectors away from the microflakes: the sum over
// their smooth surfaces of `pi a F D G / 4`.
fn voltex_gloss(extinction: VoltexMatrix, specular: f32, roughness: f32, v: vec3<f32>, l: vec3<f32>) -> f32 {
    let trace = extinction.diagonal.x + extinction.diagonal.y + extinction.diagonal.z;
    let half_way = v + l;
    let half2 = dot(half_way, half_way);
    if trace <= 0.0 || half2 < VOLTEX_MIN_HALF2 {
        return 0.0;
    }
    let alpha = max(roughness, VOLTEX_MIN_ROUGHNESS);
    let alpha2 = alpha * alpha;
    let tilted = voltex_scale(extinction, (1.0 - alpha2) / trace);
    var facets = tilted;
    facets.diagonal += alpha2;
    let adjugate = voltex_adjugate(facets);
    let determinant = facets.diagonal.x * adjugate.diagonal.x + dot(facets.beside.xy, adjugate.beside.xy);
    let towards = voltex_times(adjugate, half_way);
    let spread = dot(half_way, towards) / half2;
    let density = sqrt(trace) * pow(max(determinant, 0.0), 1.5) / max(spread * spread, 1e-30);
    // The normals of the microflakes with facets along h: their mean, and one standard deviation aside.
    let normal = voltex_times(tilted, towards) / sqrt(max(determinant * spread * half2, 1e-30));
    let difference = v - l;
    let aside = difference - dot(difference, normal) / max(dot(normal, normal), VOLTEX_MIN_NORMAL2) * normal;
    let across = voltex_times(tilted, aside);
    let variance = dot(aside, across) - voltex_form(adjugate, across, across) / determinant;
    let tilt = sqrt(max(variance, 0.0)) / max(dot(aside, aside), VOLTEX_MIN_NORMAL2) * aside;
    let outer = voltex_facets_seen(normal + tilt, alpha2, v, l) + voltex_facets_seen(normal - tilt, alpha2, v, l);
    let shares = mix(0.5 * outer, voltex_facets_seen(normal, alpha2, v, l), VOLTEX_MIDDLE_WEIGHT);
    // The refractive index that has this reflectance at normal incidence.
    let root = sqrt(specular);
    let fresnel = voltex_fresnel((1.0 + root) / max(1.0 - root, VOLTEX_MIN_REFRACTED), dot(half_way, v) / sqrt(half2));
    return 0.25 * fresnel * density * shares;
}

// Returns the share of a microflake's facets that others do not hide from `v` nor from `l`; 0 where they are on
// different sides of it. The normal may have any length.
fn voltex_facets_seen(normal: vec3<f32>, alpha2: f32, v: vec3<f32>, l: vec3<f32>) -> f32 {
    let cosines = vec2(dot(normal, v), dot(normal, l)) / sqrt(max(dot(normal, normal), VOLTEX_MIN_NORMAL2));
    if cosines.x * cosines.y <= 0.0 {
        return 0.0;
    }
    let c = abs(cosines);
    let seen = 2.0 * c / (c + sqrt(alpha2 + (1.0 - alpha2) * c * c));
    return seen.x * seen.y;
}

// Returns the reflectance of unpolarised light from air into an index, at an angle with a cosine [Cook & Torrance
// 1982].
fn voltex_fresnel(index: f32, cosine: f32) -> f32 {
    let c = clamp(cosine, 0.0, 1.0);
    let g = sqrt(max(index * index + c * c - 1.0, 0.0));
    let ratio = (g - c) / max(g + c, 1e-9);
    let other = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
    return 0.5 * ratio * ratio * (1.0 + other * other);
}
