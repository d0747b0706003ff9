// A list of rays through volumetric textures, answered by their optical depths: what an engine binds to try a volume, and an
// example of how the functions are called.

// One ray, in texture space: the unit cube, of which voltex_extent is used.
struct Ray {
    // Where t is 0.
    origin: vec3<f32>,
    // Of the voxels, 0 the finest; the coarsest there is if it is larger.
    level: u32,
    // Way per t, of any length but 0.
    direction: vec3<f32>,
    // First word of the volume in `volume_words`.
    volume: u32,
    // Between which t the ray is followed.
    t0: f32,
    t1: f32,
    pad: vec2<u32>,
}

struct Depth {
    // exp(-depth) of the light comes through.
    depth: f32,
    // Where the first voxel with microflakes begins; t1 if there is none.
    first_t: f32,
    // Its number; VOLTEX_NO_VOXEL if there is none.
    first_voxel: u32,
    // Cells that the ray went through.
    steps: u32,
}

// Which rays a dispatch answers: `count` of them from number `first` on. One dispatch has at most 65535 workgroups, 4194240
// rays.
struct Range {
    first: u32,
    count: u32,
    pad: vec2<u32>,
}

@group(0) @binding(0) var<storage, read> volume_words: array<u32>;
@group(0) @binding(1) var<storage, read> rays: array<Ray>;
@group(0) @binding(2) var<uniform> range: Range;
@group(0) @binding(3) var<storage, read_write> depths: array<Depth>;

// The one function that the library asks for.
fn asset_word(index: u32) -> u32 {
    return volume_words[index];
}

// Optical depth along a ray: its cells by voltex_walk_next, each with the extinction of its microflakes.
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
