// Entry point that walks a list of rays through a shell and its texels: for comparison with the CPU.

struct WalkQuery {
    origin: vec3<f32>,
    link: u32,
    direction: vec3<f32>,
    t_min: f32,
    t_max: f32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

struct WalkSum {
    volume: vec3<f32>,
    length: f32,
    texels: f32,
    chosen: f32,
    intervals: u32,
    spans: u32,
    width: f32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

// First words of shell and patterns, and queries.
struct WalkPlace {
    shell: u32,
    patterns: u32,
    count: u32,
    pad0: u32,
}

@group(0) @binding(8) var<uniform> walk_place: WalkPlace;
@group(0) @binding(9) var<storage, read> walk_queries: array<WalkQuery>;
@group(0) @binding(10) var<storage, read_write> walk_sums: array<WalkSum>;

// Walks one ray.
@compute @workgroup_size(64)
fn walk_main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = id.y * groups.x * 64u + id.x;
    if index >= walk_place.count {
        return;
    }
    let query = walk_queries[index];
    let shell = walk_place.shell;
    var sum = WalkSum(vec3<f32>(0.0), 0.0, 0.0, 0.0, 0u, 0u, 0.0, 0u, 0u, 0u);
    var walk = shell_enter(shell, query.origin, query.direction, query.link, query.t_min, query.t_max);
    loop {
        let interval = shell_step(&walk);
        if interval.tet == NO_LINK {
            break;
        }
        sum.intervals += 1u;
        sum.length += interval.t1 - interval.t0;
        let map = shell_map(shell, interval.tet);
        let ray = shell_ray(map, query.origin, query.direction, interval.t0);
        sum.texels += length(ray.direction) * (interval.t1 - interval.t0);
        sum.width += shell_width(map, query.direction, 1.0) * (interval.t1 - interval.t0);
        let pattern = shell_pattern(shell, interval.tet);
        var cells = cell_new(ray, interval.t0, interval.t1);
        loop {
            let span = cell_step(&cells);
            if !(span.t1 > span.t0) {
                break;
            }
            let variant = pattern_variant(walk_place.patterns, pattern, span.cell);
            if variant.volumes == 0u {
                continue;
            }
            sum.spans += 1u;
            let along = span.t1 - span.t0;
            let content = pattern_ray(variant, ray);
            let middle = 0.5 * (span.t0 + span.t1) - interval.t0;
            sum.volume += along * (content.point + middle * content.direction);
            sum.chosen += along * f32(1u + asset_word(variant.volumes));
        }
    }
    walk_sums[index] = sum;
}
