// Computes the optical depths of a list of rays through volumetric textures: a complete module to try a volume, and an
// example of how the functions are called.

// A ray in texture space: the unit cube, of which voltex_extent is used.
struct Ray {
    // Point at t = 0.
    origin: vec3<f32>,
    // Level of the voxels, 0 the finest; a level beyond the coarsest gives the coarsest.
    level: u32,
    // Distance in texture space per unit of t; any length but 0.
    direction: vec3<f32>,
    // First word of the volume in `volume_words`.
    volume: u32,
    // Part of the ray that is followed, in t.
    t0: f32,
    t1: f32,
    pad: vec2<u32>,
}

struct Depth {
    // Optical depth: the share exp(-depth) of the light comes through.
    depth: f32,
    // Beginning of the first voxel with microflakes; t1 if there is none.
    first_t: f32,
    // Number of that voxel; VOLTEX_NO_VOXEL if there is none.
    first_voxel: u32,
    // Number of cells that the ray went through.
    steps: u32,
}

// The rays that a dispatch answers: `count` of them from number `first` on. One dispatch has at most 65535 workgroups,
// 4194240 rays.
struct Range {
    first: u32,
    count: u32,
    pad: vec2<u32>,
}

@group(0) @binding(0) var<storage, read> volume_words: array<u32>;
@group(0) @binding(1) var<storage, read> rays: array<Ray>;
@group(0) @binding(2) var<uniform> range: Range;
@group(0) @binding(3) var<storage, read_write> depths: array<Depth>;

// The one function that an includer of the library defines.
fn asset_word(index: u32) -> u32 {
    return volume_words[index];
}

// Computes the optical depth along a ray: traverses its cells by voltex_walk_next and sums the extinction of their
// microflakes.
@compute @workgroup_size(64)
fn depth_main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < range.count {
        let ray = rays[range.first + id.x];
        let clumping = voltex_clumping_along(ray.volume, ray.level, ray.direction);
        var walk = voltex_walk_new(ray.volume, ray.origin, ray.direction, ray.t0, ray.t1);
        var answer = Depth(0.0, ray.t1, VOLTEX_NO_VOXEL, 0u);
        while walk.t < walk.t_end {
            let segment = voltex_walk_next(ray.volume, &walk, ray.level);
            if segment.cell.voxel != VOLTEX_NO_VOXEL {
                let sigma = voltex_extinction_along(ray.volume, segment.cell.voxel, ray.direction);
                answer.depth += clumping * sigma * (segment.t1 - segment.t0);
                if answer.first_voxel == VOLTEX_NO_VOXEL {
                    answer.first_t = segment.t0;
                    answer.first_voxel = segment.cell.voxel;
                }
            }
            answer.steps++;
        }
        depths[range.first + id.x] = answer;
    }
}
