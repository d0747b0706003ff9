// Light of volumetric textures along a ray: one filtered ray, each path at one of the two levels
// nearest to what a pixel sees. Twin: light.rs.

// Transmittance below which a ray ends.
const VOLUME_END: f32 = 0.003921569;
// Share of light that counts as none: a ray to a light ends there at the latest.
const VOLUME_MIN_PASSED: f32 = 4e-4;
// Share of light below which a ray to a light goes on by chance, as likely as what is left of the share, and then counts that share.
const VOLUME_ROULETTE: f32 = 0.3;
// What hides less of a pixel is left out: it may be there or not by rounding.
const VOLUME_MIN_OPACITY: f32 = 1e-5;
// Optical depth of what is darker: the twin's infinity.
const VOLUME_BLACK: f32 = 1e4;
// Share of a pixel that must be hidden before light is asked for anew.
const VOLUME_SHADOW_STEP: f32 = 0.5;
// Least roughness of microflakes in light from all around.
const VOLUME_AROUND_ROUGHNESS: f32 = 0.7;

// What a ray sees at one place of a volume.
struct VolumePoint {
    map: VolumeMap,
    // Along the ray.
    t: f32,
    // Share of the pixel that it is; 0 for none.
    weight: f32,
    volume: u32,
    level: u32,
    cell: VolumeCell,
    view: vec3<f32>,
}

// A segment's cell: its voxel's number, and its extinction along the ray.
struct VolumeCell {
    number: u32,
    sigma: f32,
}

// Transforms a direction of the world into the volume.
fn volume_times(map: VolumeMap, direction: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(map.x, direction), dot(map.y, direction), dot(map.z, direction));
}

// Returns the determinant of a map.
fn volume_determinant(map: VolumeMap) -> f32 {
    return dot(map.x, cross(map.y, map.z));
}

// Returns the length in the volume of what is one long in the world, in the mean of all directions.
fn volume_scale(map: VolumeMap) -> f32 {
    return pow(max(abs(volume_determinant(map)), 1e-37), 1.0 / 3.0);
}

// Returns the level of which a path sees voxels where they are to be about `width` wide in the world: of the two between
// which that lies one, as likely as it is near.
fn volume_level_of(volume: u32, map: VolumeMap, width: f32) -> u32 {
    let most = voltex_level_count(volume);
    let voxels = width * volume_scale(map) * f32(1u << most);
    let level = clamp(log2(clamp(voxels, 1e-9, 1e9)), 0.0, f32(most));
    return min(u32(level + lod_transition.level_share), most);
}

// Returns the level at which a cell is met: `level`, or a coarser one where the volume's brick is not loaded so fine.
fn volume_level_met(level: u32, cell: VoltexCell) -> u32 {
    return select(cell.size, level, cell.voxel == VOLTEX_NO_VOXEL);
}

// Returns the factor on optical depths along d for the clumping of the level `met`; `clumping` is that of `level`.
fn volume_clumping_met(volume: u32, level: u32, clumping: f32, met: u32, d: vec3<f32>) -> f32 {
    if met == level {
        return clumping;
    }
    return voltex_clumping_along(volume, met, d);
}

// Returns the light that the point reflects and transmits of what comes from `light` (a unit vector towards it) with
// irradiance pi, without shadow. The specular lobe counts as if the roughness were at least `least_roughness`.
fn volume_reflected(point: VolumePoint, light: vec3<f32>, least_roughness: f32) -> vec3<f32> {
    let l = volume_times(point.map, light) / volume_scale(point.map);
    var sum = vec3<f32>(0.0);
    for (var own = point.cell.number; own != VOLTEX_NO_VOXEL; own = voltex_other(point.volume, own)) {
        let voxel = voltex_voxel(point.volume, own);
        let material = voltex_material(point.volume, voxel.material);
        let sides = voltex_shade(voxel.moment, -point.view, l);
        sum += material.reflectance * sides.x + material.transmittance * sides.y;
        // A map without volume leaves nothing of a direction.
        if material.specular > 0.0 && dot(l, l) > 0.0 {
            // In proportion to the eye's vector, as the sums above.
            let far = length(point.view);
            let roughness = max(material.roughness, least_roughness);
            let eye = -point.view / far;
            let lamp = normalize(l);
            let denser = voltex_facets_along(point.volume, point.level, eye + lamp);
            sum += far * denser * voltex_gloss(voxel.extinction, material.specular, roughness, eye, lamp);
        }
    }
    // The clumping, by which all of them count for less or more, is in both.
    let clumping = voltex_clumping_along(point.volume, point.level, point.view);
    let brighter = voltex_brighter_between(point.volume, point.level, -point.view, l);
    return sum * (clumping * brighter / max(point.cell.sigma, 1e-30));
}

// Returns where a ray to a light begins, relative to the point, in the world.
fn volume_shadow_offset(point: VolumePoint, light: vec3<f32>) -> vec3<f32> {
    let l = volume_times(point.map, light);
    let most = voltex_level_count(point.volume);
    let offset = voltex_shadow_offset(point.volume, point.level) * (f32(1u << point.level) / f32(1u << most));
    let towards = volume_normal_towards(point.volume, point.cell.number, l);
    let size = max(abs(towards.x), max(abs(towards.y), abs(towards.z)));
    let determinant = volume_determinant(point.map);
    if size < 1e-30 || abs(determinant) < 1e-30 {
        return vec3<f32>(0.0);
    }
    let way = normalize(towards / size) * offset;
    let map = point.map;
    let columns = way.x * cross(map.y, map.z) + way.y * cross(map.z, map.x) + way.z * cross(map.x, map.y);
    return columns / determinant;
}

// Returns the sum of the microflakes' normals on the side of the light, as long as their area towards it.
fn volume_normal_towards(volume: u32, number: u32, l: vec3<f32>) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var own = number; own != VOLTEX_NO_VOXEL; own = voltex_other(volume, own)) {
        sum += voltex_times(voltex_voxel(volume, own).moment, l);
    }
    return sum;
}

// Returns the share c by which eye and light see the same gaps, where the angle between them has this cosine.
fn volume_shared(point: VolumePoint, cosine: f32) -> f32 {
    return voltex_shared_at(point.volume, point.level, cosine);
}

// Returns the ray of a stretch, t counted from its own start.
fn volume_walk_of(stretch: Stretch) -> VoltexWalk {
    let t0 = stretch.t0 - stretch.start;
    return voltex_walk_new(stretch.volume, stretch.origin, stretch.direction, t0, stretch.t1 - stretch.start);
}

// Returns the optical depth along a ray to a light, through voxels `width` wide, of meshes too; VOLUME_BLACK where it is more than
// `most`.
fn volume_depth(origin: vec3<f32>, direction: vec3<f32>, t_max: f32, width: f32, most: f32) -> f32 {
    var sum = 0.0;
    var open: array<Passage, PASSAGE_SLOTS>;
    var stretches = volume_stretches_in_turn(origin, direction, t_max);
    var stretch: Stretch;
    loop {
        stretch = volume_next(&stretches, &open, stretch);
        if stretch.volume == NO_VOLUME {
            return select(sum, VOLUME_BLACK, stretches.entries.is_hidden);
        }
        let level = volume_level_of(stretch.volume, stretch.map, width);
        let clumping = voltex_clumping_along(stretch.volume, level, stretch.direction);
        var walk = volume_walk_of(stretch);
        while walk.t < walk.t_end {
            let segment = voltex_walk_next(stretch.volume, &walk, level);
            let met = volume_level_met(level, segment.cell);
            let along = volume_clumping_met(stretch.volume, level, clumping, met, stretch.direction);
            let sigma = along * voltex_extinction_along(stretch.volume, segment.cell.voxel, stretch.direction);
            sum += sigma * (segment.t1 - segment.t0);
            if sum > most {
                return VOLUME_BLACK;
            }
        }
    }
    return VOLUME_BLACK;
}

// Returns the optical depth beyond which a ray to a light ends, where depths count `factor`.
fn volume_most_depth(factor: f32, chance: f32) -> f32 {
    return -log(max(VOLUME_ROULETTE * chance, VOLUME_MIN_PASSED)) / max(factor, 1e-6);
}

// Returns the share of a light that passes so great a depth, where depths count `factor`; in the mean over the chance that said how
// far the ray goes.
fn volume_passed(depth: f32, factor: f32) -> f32 {
    return select(0.0, max(exp(-factor * depth), VOLUME_ROULETTE), depth < VOLUME_BLACK);
}
