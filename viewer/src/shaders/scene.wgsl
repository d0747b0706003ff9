// What the tracers read and write, but for the assets, vertices, triangles and nodes, which pieces.rs declares. The
// structs' twins: trace.rs, geometry.rs; compared by a test.

struct Frame {
    eye: vec3<f32>,
    // Of the whole picture, pixels.
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
    // Radiance from everywhere within occlusion_distance; 0 for none.
    ambient: vec3<f32>,
    occlusion_distance: f32,
    jitter: vec2<f32>,
    components: u32,
    lobes: u32,
    heights: u32,
    // The band of rows that is drawn.
    first_row: u32,
    rows: u32,
    mode: u32,
    light_samples: u32,
    // Word of the arena where the environment's table begins.
    environment_at: u32,
    // Columns and rows of the environment's picture; 0 for none.
    environment: vec2<u32>,
    // Width of a pixel at distance 1.
    pixel_width: f32,
    // 1 takes an asset's level by what a pixel sees of the surface.
    levels: u32,
    // Node where the hierarchy over the instances begins.
    root: u32,
    // How a sky lights surfaces.
    sky: u32,
    // Unit vector to the middle of the sun's disc.
    sun_direction: vec3<f32>,
    // 1 less the cosine of the disc's angular radius.
    sun_part: f32,
    // At normal incidence; 0 for no sun.
    sun_irradiance: vec3<f32>,
    // Node where the hierarchy over the volumes' proxies begins.
    volume_root: u32,
    // Words of the arena: where each volume begins; content and patterns of each proxy.
    volumes_at: u32,
    proxies_at: u32,
    // The first instance that is a proxy.
    first_proxy: u32,
    // How far before its origin a ray may have entered the volume that it is in.
    volume_reach: f32,
    // Length of the slices in which overlapping volumes are taken.
    volume_slice: f32,
    // How wide leaves of meshes are at most that volumes stand in for, in the world; 0 where there are none.
    widest_leaf: f32,
    // 1 draws one of the texels around a place.
    filtered: u32,
    // The quad of the lights' words where the irradiance volume begins; 0 for none.
    irradiance_at: u32,
    // What a unit of air takes away; 0 for none.
    air: vec3<f32>,
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

// A mesh in the world.
struct Instance {
    // Rows of the map from the world into the mesh's space, and back.
    object_from_world: array<vec4<f32>, 3>,
    world_from_object: array<vec4<f32>, 3>,
    // What multiplies the contents of its leaves: chlorophyll, carotenoids, brown pigment, thickness.
    factors: vec4<f32>,
    // Node where the mesh's hierarchy begins.
    root: u32,
    first_triangle: u32,
    // 0 where the mesh's space is the world; else -1 where it is mirrored, 1 where it is not.
    handedness: f32,
    // How wide its leaves are in the world; 0 where no volume stands in for it.
    leaf_width: f32,
}

struct Material {
    // What a plain one reflects; the tint of an asset or of a leaf without its gloss.
    diffuse: vec3<f32>,
    // Word of the arena where the asset begins, or NO_ASSET.
    asset: u32,
    // What a plain one lets through.
    transmitted: vec3<f32>,
    // Word of the arena where the leaf begins, or NO_ASSET.
    leaf: u32,
    // Reflectance of the perfect mirror on top; 0 for none.
    mirror: vec3<f32>,
    // What the asset's heights are multiplied by as relief; 0 for none.
    displacement: f32,
    uv_scale: vec2<f32>,
    // Factors on what a plain one reflects where the noise is 1, bytes from 0 to 2 in steps of 1/127; 0 for no noise.
    noise: u32,
    pad0: u32,
}

struct Light {
    position: vec3<f32>,
    pad0: u32,
    intensity: vec3<f32>,
    pad1: u32,
}

// The path of a pixel's sample: its latest ray and what that hit.
struct Path {
    origin: vec3<f32>,
    // Triangle that the latest ray hit; MISSED where it hit none and volumes are still to be seen; IN_VOLUME where the
    // path scattered before it and goes on from there; NO_HIT where it ended.
    primitive: u32,
    direction: vec3<f32>,
    // Barycentric weights of the triangle's second and third corner.
    u: f32,
    // What radiance along the latest ray counts for in the pixel.
    throughput: vec3<f32>,
    v: f32,
    // Of what the latest ray hit; SCATTERED is set once the path left a surface in another way than by a mirror.
    instance: u32,
    // With which density it was drawn, per steradian; 0 from eye and mirrors.
    density: f32,
    // Length of all its rays.
    travelled: f32,
    // Way of the latest ray below the surface that it hit to the relief there, texels.
    sunk: f32,
}

struct Pixel {
    // Sum of the samples' linear radiance; w counts them.
    sum: vec4<f32>,
    // What the last sample did: the triangle that the eye sees or NO_HIT, rays, decodes, rays of its path.
    primitive: u32,
    rays: u32,
    evaluations: u32,
    depth: u32,
}

const NO_ASSET: u32 = 0xffffffffu;
const MISSED: u32 = 0xfffffffdu;
const IN_VOLUME: u32 = 0xfffffffeu;
const SCATTERED: u32 = 0x80000000u;
const MAX_MATERIALS: u32 = 1024u;

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(3) var<uniform> materials: array<Material, MAX_MATERIALS>;
// The lights; then the grid that draws them, where there are more than a sample has candidates for; then the irradiance volume.
@group(0) @binding(4) var<storage, read> light_words: array<vec4<f32>>;
// Those of the band.
@group(0) @binding(6) var<storage, read_write> pixels: array<Pixel>;
@group(0) @binding(7) var<storage, read_write> paths: array<Path>;
@group(1) @binding(1) var<storage, read> instances: array<Instance>;

// Returns a point light.
fn light_at(index: u32) -> Light {
    return Light(light_words[2u * index].xyz, 0u, light_words[2u * index + 1u].xyz, 0u);
}
