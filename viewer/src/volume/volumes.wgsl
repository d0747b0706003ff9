// The volumetric textures of a scene: free instances and thick skins, and the stretches of a ray within them. Twin:
// volumes.rs. Where they lie among the words: words.rs. The includer defines trace_any_or_front.

// The patterns of a volume that stands on its own.
const NO_PATTERNS: u32 = 0xffffffffu;
// Volumes and skins that a ray is in at once.
const MAX_PASSAGES: u32 = 4u;
// Slots for them, and one for a ray to the light, which goes through them in turn.
const PASSAGE_SLOTS: u32 = 5u;
const NO_VOLUME: u32 = 0xffffffffu;
// Words of a proxy in the scene's table.
const PROXY_WORDS: u32 = 4u;

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
    // How wide the leaves are of the mesh that the volume stands in for, in the world; 0 where there is none.
    leaf_width: f32,
}

// A way through one volume or skin.
struct Passage {
    stretch: Stretch,
    // Of a skin; NO_PATTERNS where it is a volume that stands on its own.
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

// What a ray enters.
struct Entries {
    origin: vec3<f32>,
    t_max: f32,
    direction: vec3<f32>,
    // Looked for from here on.
    from_t: f32,
    // Meshes come first: any one of them hides everything.
    asks_meshes: bool,
    is_hidden: bool,
    // Whether the ray is one to a light.
    to_light: bool,
}

// A ray among volumes that may overlap. It enters no further one before it has left one of those that it is in at once.
struct Stretches {
    entries: Entries,
    // What is entered next, none where its primitive is NO_HIT.
    entry: Hit,
    is_entry_known: bool,
    // Its slots: the first, and how many.
    slot: u32,
    count: u32,
    // Where the next stretch of each begins, VOLTEX_FAR where the slot is free.
    begins: vec4<f32>,
    // From where to where the latest stretch goes on behind the mesh that its volume stands in for; none where that is
    // nowhere.
    behind: vec2<f32>,
}

// Returns the stretches of a ray between 0 and `t_max`, in the order in which they begin.
fn volume_stretches(origin: vec3<f32>, direction: vec3<f32>, t_max: f32) -> Stretches {
    let entries = Entries(origin, t_max, direction, -frame.volume_reach, false, false, false);
    return Stretches(entries, Hit(), false, 0u, MAX_PASSAGES, vec4<f32>(VOLTEX_FAR), vec2<f32>(0.0));
}

// Returns the stretches of a ray volume by volume, for sums that need no order; none where a mesh is in the way.
fn volume_stretches_in_turn(origin: vec3<f32>, direction: vec3<f32>, t_max: f32) -> Stretches {
    var stretches = volume_stretches(origin, direction, t_max);
    stretches.entries.asks_meshes = true;
    stretches.entries.to_light = true;
    stretches.slot = MAX_PASSAGES;
    stretches.count = 1u;
    return stretches;
}

// Cuts a stretch off at the mesh that its volume stands in for; what is behind that waits.
fn volume_beyond_mesh(stretches: ptr<function, Stretches>, given: Stretch) -> Stretch {
    let spheres = lod_transition_along(lod_transition, (*stretches).entries.origin, (*stretches).entries.direction);
    let parts = lod_transition_volume(spheres, given.leaf_width, given.t0, given.t1);
    (*stretches).behind = parts.zw;
    var own = given;
    own.t1 = parts.y;
    return own;
}

// Finds the next face that the ray enters by, none where its primitive is NO_HIT; or whether a mesh hides everything.
fn volume_find_entry(entries: ptr<function, Entries>) -> Hit {
    let origin = (*entries).origin;
    let direction = (*entries).direction;
    let t_max = (*entries).t_max;
    let meshes = (*entries).asks_meshes;
    let from_t = select((*entries).from_t, 0.0, meshes);
    var hit = Hit(t_max, NO_HIT, 0.0, 0.0, 0u);
    if from_t < t_max {
        lod_transition = lod_transition_to_light(lod_transition, (*entries).to_light);
        hit = trace_any_or_front(meshes, origin, direction, from_t, t_max);
    }
    if meshes {
        (*entries).asks_meshes = false;
        (*entries).is_hidden = hit.primitive != NO_HIT;
        return hit;
    }
    hit.t += from_t;
    // Beyond what this number and the origin's are rounded to.
    let size = max(abs(origin.x), max(abs(origin.y), abs(origin.z)));
    (*entries).from_t = hit.t + 2e-6 * (frame.volume_reach + size + abs(hit.t));
    return hit;
}

// Returns the passage into what was found; its stretch is nowhere where that is a skin, or is missed.
fn volume_enter(entries: Entries, hit: Hit) -> Passage {
    let at = frame.proxies_at + PROXY_WORDS * (hit.instance - frame.first_proxy);
    let start = max(hit.t, 0.0);
    var passage: Passage;
    passage.patterns = asset_word(at + 1u);
    let leaf_width = instances[hit.instance].leaf_width;
    passage.stretch.leaf_width = leaf_width;
    if passage.patterns != NO_PATTERNS {
        let link = triangle_at(hit.primitive).material;
        passage.walk = shell_enter(asset_word(at), entries.origin, entries.direction, link, start, entries.t_max);
        return passage;
    }
    let rows = instances[hit.instance].object_from_world;
    let own = object_from_world(hit.instance, vec4<f32>(entries.origin + entries.direction * start, 1.0));
    let along = object_from_world(hit.instance, vec4<f32>(entries.direction, 0.0));
    let planes = select(vec3<f32>(0.0), vec3<f32>(1.0), along > vec3<f32>(0.0));
    let across = along == vec3<f32>(0.0);
    let exits = select((planes - own) / select(along, vec3<f32>(1.0), across), vec3<f32>(VOLTEX_FAR), across);
    let end = min(start + min(exits.x, min(exits.y, exits.z)), entries.t_max);
    let map = VolumeMap(rows[0].xyz, rows[1].xyz, rows[2].xyz);
    passage.stretch = Stretch(own, asset_word(at), along, start, map, end, start, leaf_width);
    return passage;
}

// Goes on to the next stretch of a passage, if there is one.
fn volume_advance(entries: Entries, passage: ptr<function, Passage>) -> bool {
    if (*passage).patterns == NO_PATTERNS {
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
        let shell = (*passage).walk.shell;
        var cells = (*passage).cells;
        let is_new = cells.left == 0u;
        var t0 = 0.0;
        var t1 = 0.0;
        if is_new {
            var walk = (*passage).walk;
            let interval = shell_step(&walk);
            (*passage).walk = walk;
            if interval.tet == NO_LINK {
                return false;
            }
            (*passage).tet = interval.tet;
            t0 = interval.t0;
            t1 = interval.t1;
        }
        let map = shell_map(shell, (*passage).tet);
        if is_new {
            cells = cell_new(shell_ray(map, entries.origin, entries.direction, t0), t0, t1);
        }
        let span = cell_step(&cells);
        (*passage).cells = cells;
        if !(span.t1 > span.t0) {
            continue;
        }
        let variant = pattern_variant((*passage).patterns, shell_pattern(shell, (*passage).tet), span.cell);
        if variant.volumes == 0u {
            continue;
        }
        let ray = pattern_ray(variant, cells.ray);
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
        while (*passage).merged < MAX_MERGED && asset_word(variant.volumes + (*passage).merged) != NO_VOLUME {
            (*passage).merged += 1u;
        }
    }
    return false;
}

// Returns the widths about whose spheres a proxy begins and ends to be entered; 0 for no sphere.
fn volume_widths(instance: u32) -> vec2<f32> {
    let at = frame.proxies_at + PROXY_WORDS * (instance - frame.first_proxy);
    return vec2<f32>(bitcast<f32>(asset_word(at + 2u)), bitcast<f32>(asset_word(at + 3u)));
}

// Returns from where to where along the ray from `begin` on a proxy may be there to be entered: of a skin's shells one is, by the distance
// from the eye. What was entered before the ray began, at -begin, is entered by the shell of where it began, so shells do not hide each
// other.
fn volume_range(spheres: SpheresAlong, instance: u32, begin: f32) -> vec2<f32> {
    let widths = volume_widths(instance);
    let range = lod_transition_range_between(spheres, widths.x, widths.y, -begin);
    return vec2<f32>(select(range.x, 0.0, range.x <= -begin), select(range.y, 0.0, range.y <= -begin));
}

// Tells whether a proxy is there to be entered at `t`.
fn volume_is_there(spheres: SpheresAlong, instance: u32, begin: f32, t: f32) -> bool {
    let widths = volume_widths(instance);
    return lod_transition_is_between(spheres, widths.x, widths.y, max(t, -begin));
}

// Returns the number of the first component that is `value`, 4 for none.
fn volume_slot_of(begins: vec4<f32>, value: f32) -> u32 {
    let found = begins == vec4<f32>(value);
    return select(select(select(select(4u, 3u, found.w), 2u, found.z), 1u, found.y), 0u, found.x);
}

// Returns the stretch after `latest`; nowhere where its volume is NO_VOLUME, and empty where all of it is a mesh.
// Shader compilers inline every call, so each step is written once.
fn volume_next(
    stretches: ptr<function, Stretches>,
    open: ptr<function, array<Passage, PASSAGE_SLOTS>>,
    latest: Stretch,
) -> Stretch {
    let numbers = vec4<u32>(0u, 1u, 2u, 3u);
    var own = latest;
    let behind = (*stretches).behind;
    if with_lod_transition && behind.x < behind.y {
        (*stretches).behind = vec2<f32>(0.0);
        own.t0 = behind.x;
        own.t1 = behind.y;
        return own;
    }
    own.volume = NO_VOLUME;
    while own.volume == NO_VOLUME {
        var here = *stretches;
        if !here.is_entry_known {
            var entries = here.entries;
            here.entry = volume_find_entry(&entries);
            here.is_entry_known = !here.entries.asks_meshes;
            here.entries = entries;
            *stretches = here;
            if entries.is_hidden {
                break;
            }
            if !here.is_entry_known {
                continue;
            }
        }
        let least = min(min(here.begins.x, here.begins.y), min(here.begins.z, here.begins.w));
        let first_free = volume_slot_of(here.begins, VOLTEX_FAR);
        let may_enter = here.entry.primitive != NO_HIT && first_free < here.count;
        let enters = may_enter && here.entry.t <= least;
        var passage: Passage;
        var slot = min(first_free, here.count - 1u);
        var goes_on = false;
        if enters {
            passage = volume_enter(here.entries, here.entry);
            goes_on = passage.stretch.t1 > passage.stretch.t0;
            here.is_entry_known = false;
        } else if least == VOLTEX_FAR {
            break;
        } else {
            // The bound is known to the compiler where there is one slot, which then needs no memory.
            slot = min(volume_slot_of(here.begins, least), here.count - 1u);
            let others = select(here.begins, vec4<f32>(VOLTEX_FAR), numbers == vec4<u32>(slot));
            let next = min(
                min(min(others.x, others.y), min(others.z, others.w)),
                select(VOLTEX_FAR, here.entry.t, may_enter),
            );
            passage = (*open)[here.slot + slot];
            // The same for all of the ray's, so that memory need not hold it.
            passage.walk.origin = here.entries.origin;
            passage.walk.shear = shear_new(here.entries.direction);
            own = passage.stretch;
            // What begins within this stretch is taken in turn with it.
            let cut = max(next, own.t0 + frame.volume_slice);
            if here.count > 1u && cut < own.t1 {
                own.t1 = cut;
                passage.stretch.t0 = cut;
                goes_on = true;
            }
        }
        if !goes_on {
            goes_on = volume_advance(here.entries, &passage);
        }
        if goes_on {
            (*open)[here.slot + slot] = passage;
        }
        let begin = select(VOLTEX_FAR, passage.stretch.t0, goes_on);
        here.begins = select(here.begins, vec4<f32>(begin), numbers == vec4<u32>(slot));
        *stretches = here;
    }
    if with_lod_transition {
        own = volume_beyond_mesh(stretches, own);
    }
    return own;
}
