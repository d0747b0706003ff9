// A ray's way through a shell, from one tetrahedron to the next. Twin: walk.rs, which also says where the constants
// come from. The includer defines asset_word(index); `shell` is the first of the shell's words, laid out in
// skin/shell_words.rs.

const NO_LINK: u32 = 0xffffffffu;
const MIN_UPRIGHT: f32 = 1e-7;
const MIN_RAY: f32 = 1e-30;
const MAX_RAY: f32 = 1e30;
const SHELL_TETS: u32 = 0u;
const SHELL_POSITIONS_AT: u32 = 1u;
const SHELL_TEXTURES_AT: u32 = 2u;
const SHELL_TETS_AT: u32 = 3u;
const SHELL_BOUNDARY: u32 = 4u;
const SHELL_BOUNDARY_AT: u32 = 5u;
const TET_WORDS: u32 = 13u;
const TET_LINKS: u32 = 4u;
const TET_TEXTURES: u32 = 8u;
const TET_PATTERN: u32 = 12u;

// No interval where tet is NO_LINK.
struct ShellInterval {
    t0: f32,
    t1: f32,
    tet: u32,
}

struct ShellMap {
    position: vec3<f32>,
    texture: vec3<f32>,
    gradient_u: vec3<f32>,
    gradient_v: vec3<f32>,
    gradient_w: vec3<f32>,
}

struct TextureRay {
    point: vec3<f32>,
    direction: vec3<f32>,
}

// a, b and c are the corners of the face; edges run from a to b, from b to c and from c to a.
struct ShellWalk {
    origin: vec3<f32>,
    shell: u32,
    shear: Shear,
    a: vec3<f32>,
    link: u32,
    b: vec3<f32>,
    t: f32,
    c: vec3<f32>,
    t_max: f32,
    edges: vec3<f32>,
    left: u32,
    face: vec3<u32>,
    exit: u32,
}

// Reads a number of the shell.
fn shell_float(index: u32) -> f32 {
    return bitcast<f32>(asset_word(index));
}

// Reads three numbers of the shell.
fn shell_vector(index: u32) -> vec3<f32> {
    return vec3<f32>(shell_float(index), shell_float(index + 1u), shell_float(index + 2u));
}

// Reads a position, world units.
fn shell_position(shell: u32, number: u32) -> vec3<f32> {
    return shell_vector(shell + asset_word(shell + SHELL_POSITIONS_AT) + 3u * number);
}

// Reads texture coordinates (u, v, w), texels.
fn shell_texture(shell: u32, number: u32) -> vec3<f32> {
    return shell_vector(shell + asset_word(shell + SHELL_TEXTURES_AT) + 3u * number);
}

// Returns the first word of a tetrahedron.
fn shell_tet(shell: u32, tet: u32) -> u32 {
    return shell + asset_word(shell + SHELL_TETS_AT) + TET_WORDS * tet;
}

// Returns the number of the pattern that is mapped in a tetrahedron.
fn shell_pattern(shell: u32, tet: u32) -> u32 {
    return asset_word(shell_tet(shell, tet) + TET_PATTERN);
}

// Returns the face behind triangle `number` of the boundary: 4 x the tetrahedron + its face.
fn shell_boundary(shell: u32, number: u32) -> u32 {
    return asset_word(shell + asset_word(shell + SHELL_BOUNDARY_AT) + number);
}

// Returns the position numbers of a face, counter-clockwise from outside.
fn shell_face(shell: u32, link: u32) -> vec3<u32> {
    let tet = shell_tet(shell, link / 4u);
    var corners = vec3<u32>(1u, 2u, 3u);
    switch link % 4u {
        case 1u: { corners = vec3<u32>(0u, 3u, 2u); }
        case 2u: { corners = vec3<u32>(0u, 1u, 3u); }
        case 3u: { corners = vec3<u32>(0u, 2u, 1u); }
        default: {}
    }
    return vec3<u32>(asset_word(tet + corners.x), asset_word(tet + corners.y), asset_word(tet + corners.z));
}

// Starts the walk of a ray from t_min on that enters by the face of `link`, which may lie before t_min.
fn shell_enter(shell: u32, origin: vec3<f32>, direction: vec3<f32>, link: u32, t_min: f32, t_max: f32) -> ShellWalk {
    var walk = shell_facing(shell, origin, direction, link, t_max);
    if walk.edges.x + walk.edges.y + walk.edges.z < 0.0 {
        walk.face = walk.face.xzy;
        let b = walk.b;
        walk.b = walk.c;
        walk.c = b;
        walk.edges = -walk.edges.zyx;
    }
    walk.t = max(shell_crossing(walk, t_min), t_min);
    return walk;
}

// Starts the walk of a ray that is inside `tet` at t_min.
fn shell_start(shell: u32, origin: vec3<f32>, direction: vec3<f32>, tet: u32, t_min: f32, t_max: f32) -> ShellWalk {
    var best = 4u * tet;
    var deepest = -3e38;
    for (var face = 0u; face < 4u; face++) {
        let walk = shell_facing(shell, origin, direction, 4u * tet + face, t_max);
        let area = walk.edges.x + walk.edges.y + walk.edges.z;
        if shear_is_towards(walk.shear, area) {
            let shares = walk.edges / area;
            let depth = min(shares.x, min(shares.y, shares.z));
            if depth > deepest {
                deepest = depth;
                best = 4u * tet + face;
            }
        }
    }
    return shell_enter(shell, origin, direction, best, t_min, t_max);
}

// Returns a walk at the face of `link`, as that is seen.
fn shell_facing(shell: u32, origin: vec3<f32>, direction: vec3<f32>, link: u32, t_max: f32) -> ShellWalk {
    let size = max(abs(direction.x), max(abs(direction.y), abs(direction.z)));
    let is_ray = size > MIN_RAY && size < MAX_RAY;
    var walk: ShellWalk;
    walk.shell = shell;
    walk.origin = origin;
    walk.shear = shear_new(select(vec3<f32>(0.0, 0.0, 1.0), direction, is_ray));
    walk.link = select(NO_LINK, link, is_ray);
    walk.face = shell_face(shell, link);
    walk.t = t_max;
    walk.t_max = t_max;
    walk.left = asset_word(shell + SHELL_TETS);
    walk.exit = NO_LINK;
    walk.a = shell_sheared(walk, walk.face.x);
    walk.b = shell_sheared(walk, walk.face.y);
    walk.c = shell_sheared(walk, walk.face.z);
    walk.edges = vec3<f32>(shell_edge(walk.a, walk.b), shell_edge(walk.b, walk.c), shell_edge(walk.c, walk.a));
    return walk;
}

// Returns the map of a tetrahedron from the world to the texture.
fn shell_map(shell: u32, number: u32) -> ShellMap {
    let tet = shell_tet(shell, number);
    let p = shell_position(shell, asset_word(tet));
    let t = shell_texture(shell, asset_word(tet + TET_TEXTURES));
    let a = shell_position(shell, asset_word(tet + 1u)) - p;
    let b = shell_position(shell, asset_word(tet + 2u)) - p;
    let c = shell_position(shell, asset_word(tet + 3u)) - p;
    let bc = cross(b, c);
    let ca = cross(c, a);
    let ab = cross(a, b);
    let volume = dot(a, bc);
    let nothing = vec3<f32>(0.0);
    // a is along the height, which is short where the skin is thin: its product with the base loses nothing.
    if !(abs(volume) > MIN_UPRIGHT * length(a) * length(bc)) {
        return ShellMap(p, t, nothing, nothing, nothing);
    }
    let inverse = 1.0 / volume;
    let ta = shell_texture(shell, asset_word(tet + TET_TEXTURES + 1u)) - t;
    let tb = shell_texture(shell, asset_word(tet + TET_TEXTURES + 2u)) - t;
    let tc = shell_texture(shell, asset_word(tet + TET_TEXTURES + 3u)) - t;
    let x = bc * inverse;
    let y = ca * inverse;
    let z = ab * inverse;
    return ShellMap(
        p,
        t,
        x * ta.x + y * tb.x + z * tc.x,
        x * ta.y + y * tb.y + z * tc.y,
        x * ta.z + y * tb.z + z * tc.z,
    );
}

// Returns the texture coordinates of a position.
fn shell_point(map: ShellMap, position: vec3<f32>) -> vec3<f32> {
    return map.texture + shell_direction(map, position - map.position);
}

// Transforms a direction, or a difference of positions, into texels.
fn shell_direction(map: ShellMap, direction: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(map.gradient_u, direction), dot(map.gradient_v, direction), dot(map.gradient_w, direction));
}

// Transforms a ray from where its interval begins into the texture.
fn shell_ray(map: ShellMap, origin: vec3<f32>, direction: vec3<f32>, t0: f32) -> TextureRay {
    let from_position = (origin - map.position) + t0 * direction;
    return TextureRay(map.texture + shell_direction(map, from_position), shell_direction(map, direction));
}

// Returns the width in texels of a cone that is `width` world units wide about `direction`.
fn shell_width(map: ShellMap, direction: vec3<f32>, width: f32) -> f32 {
    let volume = abs(dot(map.gradient_u, cross(map.gradient_v, map.gradient_w)));
    let along = length(shell_direction(map, direction));
    if along > 0.0 {
        return width * sqrt(volume * length(direction) / along);
    }
    return 0.0;
}

// Returns the next interval that is longer than nothing.
fn shell_step(walk: ptr<function, ShellWalk>) -> ShellInterval {
    var at = *walk;
    var interval = ShellInterval(at.t, at.t, NO_LINK);
    while at.link != NO_LINK && at.left > 0u && at.t < at.t_max {
        at.left -= 1u;
        let number = at.link / 4u;
        let apex = at.link % 4u;
        let tet = shell_tet(at.shell, number);
        let positions =
            vec4<u32>(asset_word(tet), asset_word(tet + 1u), asset_word(tet + 2u), asset_word(tet + 3u));
        let position = select(select(positions.x, positions.y, apex == 1u), select(positions.z, positions.w, apex == 3u), apex > 1u);
        let corner = shell_sheared(at, position);
        // From the face's corners to the new one, and whether the ray passes on the far side.
        let edges = vec3<f32>(shell_edge(at.a, corner), shell_edge(at.b, corner), shell_edge(at.c, corner));
        let behind = vec3<bool>(
            shell_is_behind(edges.x, at.a, corner),
            shell_is_behind(edges.y, at.b, corner),
            shell_is_behind(edges.z, at.c, corner),
        );
        var dropped_position = at.face.z;
        switch shell_kept_edge(edges, behind) {
            case 0u: {
                at.face = vec3<u32>(at.face.xy, position);
                at.edges = vec3<f32>(at.edges.x, edges.y, -edges.x);
            }
            case 1u: {
                dropped_position = at.face.x;
                at.face = vec3<u32>(at.face.yz, position);
                at.edges = vec3<f32>(at.edges.y, edges.z, -edges.y);
                at.a = at.b;
                at.b = at.c;
            }
            default: {
                dropped_position = at.face.y;
                at.face = vec3<u32>(at.face.zx, position);
                at.edges = vec3<f32>(at.edges.z, edges.x, -edges.z);
                at.b = at.a;
                at.a = at.c;
            }
        }
        at.c = corner;
        var dropped = apex;
        for (var i = 4u; i > 0u; i--) {
            dropped = select(dropped, i - 1u, positions[i - 1u] == dropped_position);
        }
        at.exit = 4u * number + dropped;
        at.link = asset_word(tet + TET_LINKS + dropped);
        let t1 = clamp(shell_crossing(at, at.t), at.t, at.t_max);
        interval = ShellInterval(at.t, t1, number);
        at.t = t1;
        if interval.t1 > interval.t0 {
            break;
        }
    }
    if !(interval.t1 > interval.t0) {
        interval.tet = NO_LINK;
    }
    *walk = at;
    return interval;
}

// Returns a position relative to the origin of the ray, sheared along it.
fn shell_sheared(walk: ShellWalk, position: u32) -> vec3<f32> {
    return shear_apply(walk.shear, shell_position(walk.shell, position) - walk.origin);
}

// Returns the number of the corner from which the edge runs that the ray's face keeps; the one two further is dropped.
fn shell_kept_edge(edges: vec3<f32>, behind: vec3<bool>) -> u32 {
    if behind.x && !behind.y {
        return 0u;
    }
    if behind.y && !behind.z {
        return 1u;
    }
    if behind.z && !behind.x {
        return 2u;
    }
    // Impossible but for rounding: the one nearest to being on the other side is.
    let by_size = select(edges, -edges, behind.x);
    var least = select(2u, 1u, by_size.y <= by_size.z);
    least = select(least, 0u, by_size.x <= by_size.y && by_size.x <= by_size.z);
    return select(least, (least + 2u) % 3u, behind.x);
}

// Returns twice the signed area of the origin, p and q: on which side of their edge the ray passes.
fn shell_edge(p: vec3<f32>, q: vec3<f32>) -> f32 {
    return p.x * q.y - p.y * q.x;
}

// Returns whether an edge function is negative, or becomes so when all corners move by (e, e^2) for a positive e below
// any number.
fn shell_is_behind(edge: f32, p: vec3<f32>, q: vec3<f32>) -> bool {
    return edge < 0.0 || (edge == 0.0 && (q.y < p.y || (q.y == p.y && p.x < q.x)));
}

// Returns t at which the ray meets the walk's face; `otherwise` where that is seen on edge.
fn shell_crossing(walk: ShellWalk, otherwise: f32) -> f32 {
    let edges = walk.edges;
    let area = edges.x + edges.y + edges.z;
    if !(area > 0.0) {
        return otherwise;
    }
    let z = vec3<f32>(walk.a.z, walk.b.z, walk.c.z);
    let t = (edges.y * z.x + edges.z * z.y + edges.x * z.z) / area;
    return clamp(t, min(z.x, min(z.y, z.z)), max(z.x, max(z.y, z.z)));
}
