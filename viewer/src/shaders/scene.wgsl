// What the tracers read and write. The structs' twins: trace.rs, geometry.rs; compared by a test.

struct Frame {
    eye: vec3<f32>,
    width: u32,
    forward: vec3<f32>,
    height: u32,
    right: vec3<f32>,
    light_count: u32,
    up: vec3<f32>,
    // 0 starts the accumulation anew.
    sample: u32,
    background: vec3<f32>,
    interpolation: u32,
    jitter: vec2<f32>,
    components: u32,
    lobes: u32,
    parallax: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

struct Vertex {
    position: vec3<f32>,
    u: f32,
    normal: vec3<f32>,
    v: f32,
    tangent: vec4<f32>,
}

struct Triangle {
    vertices: vec3<u32>,
    material: u32,
}

struct Material {
    diffuse: vec3<f32>,
    // Word of the arena where the asset begins, or NO_ASSET.
    asset: u32,
    uv_scale: vec2<f32>,
    pad: vec2<u32>,
}

struct Light {
    position: vec3<f32>,
    pad0: u32,
    intensity: vec3<f32>,
    pad1: u32,
}

// What the last sample of a pixel did.
struct PixelHit {
    primitive: u32,
    rays: u32,
    evaluations: u32,
    pad: u32,
}

const NO_ASSET: u32 = 0xffffffffu;
// Word of an asset that holds its number of layers (resident.rs in btf-runtime).
const ASSET_LAYER_COUNT: u32 = 2u;

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(2) var<storage, read> triangles: array<Triangle>;
@group(0) @binding(3) var<storage, read> materials: array<Material>;
@group(0) @binding(4) var<storage, read> lights: array<Light>;
@group(0) @binding(5) var<storage, read> assets: array<u32>;
// Sum of the samples' linear radiance; w counts them.
@group(0) @binding(6) var<storage, read_write> accumulation: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> pixel_hits: array<PixelHit>;

fn asset_word(index: u32) -> u32 {
    return assets[index];
}
