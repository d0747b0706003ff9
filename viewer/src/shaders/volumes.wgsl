// The volumetric textures of a scene: free instances and thick skins, and the stretches of a ray within them. Twin:
// volumes.rs. Where they lie among the words: volume_words.rs. The includer defines trace_proxies.

// Overlapping volumes are taken in turn in slices of this share of the reach.
const VOLUME_SLICE: f32 = 0.015625;
// Volumes and skins that a ray is in at once. It enters no further one before it has left one of them, which the CPU does: what
// overlaps five times is met in a slightly other order, and nothing is left out.
const MOST_PASSAGES: u32 = 4u;
const NO_VOLUME: u32 = 0xffffffffu;
// Instance of an entry that is still to be found.
const ENTRY_UNKNOWN: u32 = 0xffffffffu;

// Directions of a volume from those of the world, by rows.
struct VolumeMap {
    x: vec3<f32>,
    y: vec3<f32>,
    z: vec3<f32>,
}

// A part of a ray within one volume.
struct Stretch {
    origin: vec3<f32>,
    // First word of the volume, NO_VOLUME where there is no more.
    volume: u32,
    direction: vec3<f32>,
    t0: f32,
    map: VolumeMap,
    t1: f32,
    // Where the volume's ray has its origin, along the world's ray.
    start: f32,
}

// A way through one volume or skin.
struct Passage {
    stretch: Stretch,
    // Of a skin; NO_ASSET where it is a volume that stands on its own.
    patterns: u32,
    tet: u32,
    walk: ShellWalk,
    cells: CellWalk,
    // The volumes of the latest texel, how many of them are still to be told, and from where to where.
    volumes: u32,
    merged: u32,
    t0: f32,
    t1: f32,
}

struct Stretches {
    origin: vec3<f32>,
    t_max: f32,
    direction: vec3<f32>,
    // Entries are looked for from here on.
    from_t: f32,
    // The face that is entered next, none where its primitive is NO_HIT.
    entry: Hit,
    count: u32,
    open: array<Passage, MOST_PASSAGES>,
}

// The stretches of a ray between 0 and `t_max`, in the order in which they begin.
fn volume_stretches(stretches: ptr<function, Stretches>, origin: vec3<f32>, direction: vec3<f32>, t_max: f32) {
    (*stretches).origin = origin;
    (*stretches).direction = direction;
    (*stretches).t_max = t_max;
    (*stretches).from_t = -frame.volume_reach;
    (*stretches).count = 0u;
    (*stretches).entry.instance = ENTRY_UNKNOWN;
}

// Finds the next face that the ray enters by.
fn volume_find_entry(stretches: ptr<function, Stretches>) {
    let origin = (*stretches).origin;
    let direction = (*stretches).direction;
    let t_max = (*stretches).t_max;
    var from_t = (*stretches).from_t;
    (*stretches).entry = Hit(t_max, NO_HIT, 0.0, 0.0, 0u);
    while from_t < t_max {
        var hit = trace_proxies(origin + direction * from_t, direction, t_max - from_t);
        if hit.primitive == NO_HIT {
            from_t = t_max;
            break;
        }
        hit.t += from_t;
        // Beyond what this number and the origin's are rounded to.
        let size = max(abs(origin.x), max(abs(origin.y), abs(origin.z)));
        from_t = hit.t + 2e-6 * (frame.volume_reach + size + abs(hit.t));
        let corner = triangle_at(hit.primitive).vertices;
        let a = vertex_position(corner.x);
        let outwards = cross(vertex_position(corner.y) - a, vertex_position(corner.z) - a);
        if dot(outwards, object_from_world(hit.instance, vec4<f32>(direction, 0.0))) < 0.0 {
            (*stretches).entry = hit;
            break;
        }
    }
    (*stretches).from_t = from_t;
}

// The passage into what was found; its stretch is nowhere where that is a skin, or is missed.
fn volume_enter(origin: vec3<f32>, direction: vec3<f32>, t_max: f32, hit: Hit) -> Passage {
    let at = frame.proxies_at + 2u * (hit.instance - frame.first_proxy);
    let start = max(hit.t, 0.0);
    var passage: Passage;
    passage.patterns = asset_word(at + 1u);
    if passage.patterns != NO_ASSET {
        let link = triangle_at(hit.primitive).material;
        passage.walk = shell_enter(asset_word(at), origin, direction, link, start, t_max);
        return passage;
    }
    let rows = instances[hit.instance].object_from_world;
    let own = object_from_world(hit.instance, vec4<f32>(origin + direction * start, 1.0));
    let along = object_from_world(hit.instance, vec4<f32>(direction, 0.0));
    let planes = select(vec3<f32>(0.0), vec3<f32>(1.0), along > vec3<f32>(0.0));
    let across = along == vec3<f32>(0.0);
    let exits = select((planes - own) / select(along, vec3<f32>(1.0), across), vec3<f32>(VOLTEX_FAR), across);
    let end = min(start + min(exits.x, min(exits.y, exits.z)), t_max);
    let map = VolumeMap(rows[0].xyz, rows[1].xyz, rows[2].xyz);
    passage.stretch = Stretch(own, asset_word(at), along, start, map, end, start);
    return passage;
}

// Goes on to the next stretch of a passage, if there is one.
fn volume_advance(passage: ptr<function, Passage>, origin: vec3<f32>, direction: vec3<f32>) -> bool {
    if (*passage).patterns == NO_ASSET {
        return false;
    }
    loop {
        if (*passage).merged > 0u {
            (*passage).merged -= 1u;
            let number = asset_word((*passage).volumes + (*passage).merged);
            (*passage).stretch.volume = asset_word(frame.volumes_at + number);
            (*passage).stretch.t0 = (*passage).t0;
            (*passage).stretch.t1 = (*passage).t1;
            return true;
        }
        var cells = (*passage).cells;
        let span = cell_step(&cells);
        (*passage).cells = cells;
        let shell = (*passage).walk.shell;
        if span.t1 > span.t0 {
            let pattern = shell_pattern(shell, (*passage).tet);
            let variant = pattern_variant((*passage).patterns, pattern, span.cell);
            if variant.volumes == 0u {
                continue;
            }
            let ray = pattern_ray(variant, cells.ray);
            let map = shell_map(shell, (*passage).tet);
            (*passage).stretch.origin = ray.point;
            (*passage).stretch.direction = ray.direction;
            (*passage).stretch.start = cells.t0;
            (*passage).stretch.map = VolumeMap(
                variant.x.x * map.gradient_u + variant.x.y * map.gradient_v,
                variant.y.x * map.gradient_u + variant.y.y * map.gradient_v,
                variant.upright * map.gradient_w,
            );
            (*passage).volumes = variant.volumes;
            (*passage).t0 = span.t0;
            (*passage).t1 = span.t1;
            var merged = 0u;
            while merged < MOST_MERGED && asset_word(variant.volumes + merged) != NO_VOLUME {
                merged += 1u;
            }
            (*passage).merged = merged;
            continue;
        }
        var walk = (*passage).walk;
        let interval = shell_step(&walk);
        (*passage).walk = walk;
        if interval.tet == NO_LINK {
            return false;
        }
        (*passage).tet = interval.tet;
        let ray = shell_ray(shell_map(shell, interval.tet), origin, direction, interval.t0);
        (*passage).cells = cell_new(ray, interval.t0, interval.t1);
    }
    return false;
}

// The next stretch. Each step is written once, because compilers copy what is called into its place.
fn volume_next(stretches: ptr<function, Stretches>) -> Stretch {
    var own: Stretch;
    own.volume = NO_VOLUME;
    while own.volume == NO_VOLUME {
        if (*stretches).entry.instance == ENTRY_UNKNOWN {
            volume_find_entry(stretches);
        }
        let count = (*stretches).count;
        var first = 0u;
        for (var i = 1u; i < count; i++) {
            if (*stretches).open[i].stretch.t0 < (*stretches).open[first].stretch.t0 {
                first = i;
            }
        }
        let entry = (*stretches).entry;
        let is_open = entry.primitive != NO_HIT && count < MOST_PASSAGES;
        let enters = is_open && (count == 0u || entry.t <= (*stretches).open[first].stretch.t0);
        var passage: Passage;
        var goes_on = false;
        if enters {
            passage = volume_enter((*stretches).origin, (*stretches).direction, (*stretches).t_max, entry);
            goes_on = passage.stretch.t1 > passage.stretch.t0;
            (*stretches).entry.instance = ENTRY_UNKNOWN;
        } else if count == 0u {
            break;
        } else {
            var next = select(VOLTEX_FAR, entry.t, is_open);
            for (var i = 0u; i < count; i++) {
                if i != first {
                    next = min(next, (*stretches).open[i].stretch.t0);
                }
            }
            passage = (*stretches).open[first];
            (*stretches).open[first] = (*stretches).open[count - 1u];
            (*stretches).count = count - 1u;
            own = passage.stretch;
            // What begins within this stretch is taken in turn with it.
            let cut = max(next, own.t0 + VOLUME_SLICE * frame.volume_reach);
            if cut < own.t1 {
                own.t1 = cut;
                passage.stretch.t0 = cut;
                goes_on = true;
            }
        }
        if !goes_on {
            goes_on = volume_advance(&passage, (*stretches).origin, (*stretches).direction);
        }
        if goes_on {
            (*stretches).open[(*stretches).count] = passage;
            (*stretches).count += 1u;
        }
    }
    return own;
}
