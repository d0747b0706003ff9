// The specular lobe of a voxel's microflakes: light that their smooth surfaces reflect to the eye. Twin:
// voltex/gloss.rs, which has the equations.

const VOLTEX_MIN_ROUGHNESS: f32 = 0.1;
const VOLTEX_MIN_REFRACTED: f32 = 1e-4;
const VOLTEX_MIN_HALF2: f32 = 1e-10;
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
    let microflakes = voltex_scale(extinction, 1.0 / trace);
    var facets = voltex_scale(microflakes, 1.0 - alpha * alpha);
    facets.diagonal += alpha * alpha;
    let adjugate = voltex_adjugate(facets);
    let determinant = facets.diagonal.x * adjugate.diagonal.x + dot(facets.beside.xy, adjugate.beside.xy);
    let spread = voltex_form(adjugate, half_way, half_way) / half2;
    let density = sqrt(trace) * pow(max(determinant, 0.0), 1.5) / max(spread * spread, 1e-30);
    // The refractive index that has this reflectance at normal incidence.
    let root = sqrt(specular);
    let fresnel = voltex_fresnel((1.0 + root) / max(1.0 - root, VOLTEX_MIN_REFRACTED), dot(half_way, v) / sqrt(half2));
    return 0.25 * fresnel * density * voltex_facets_seen(microflakes, facets, v) * voltex_facets_seen(microflakes, facets, l);
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

// Returns the share of the facets towards `d` that other facets do not hide.
fn voltex_facets_seen(microflakes: VoltexMatrix, facets: VoltexMatrix, d: vec3<f32>) -> f32 {
    let own = sqrt(max(voltex_form(microflakes, d, d), 0.0));
    return 2.0 * own / max(own + sqrt(max(voltex_form(facets, d, d), 0.0)), VOLTEX_MIN_ROOT);
}
