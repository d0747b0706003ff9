//! Pictures at the edge of what numbers and buffers hold: no pixel that is not a number, no crash, a clear message
//! where a limit is reached. On the CPU and, where there is an adapter (see `gpu.rs`), on both tracers.

use crate::support::{backends, gpu_is_left_out, tracers};
use btf_runtime::testing::{sample_asset, sample_heights};
use btf_runtime::{Edit, Edits, Interpolation, ResidualKind};
use btf_viewer::{
    Ambient, BackendChoice, Camera, Control, FrameRequest, Geometry, Gpu, GpuTracer, Material, MeshChoice, MeshPart,
    PointLight, RenderMode, RenderParams, Rendered, Scene, SceneAsset, SceneObject, ShadeOptions, Tracer, Triangle,
    Vertex, plane, render, sphere,
};
use glam::{Mat4, Vec3};
use std::path::Path;
use std::sync::Arc;

fn sample(seed: u64, width: usize, height: usize) -> Arc<SceneAsset> {
    let kind = [ResidualKind::Root, ResidualKind::Log, ResidualKind::Additive][seed as usize % 3];
    let mut asset = sample_asset(seed, width, height, kind);
    asset.layers[0].heights = Some(sample_heights(seed, width * height));
    Arc::new(SceneAsset::new(format!("sample {seed}"), asset))
}

fn with_asset(part: MeshPart) -> SceneObject {
    SceneObject { part, material: Material { mirror: [0.2; 3], ..Material::from_asset(0, [3.0; 2]) } }
}

/// Scene of one part with an asset, ambient light and a mirror on top, so that every pass has something to do.
fn scene(part: MeshPart) -> Scene {
    let mut scene = Scene::from_objects(Path::new("part"), vec![with_asset(part)], vec![sample(3, 7, 5)]).unwrap();
    scene.ambient = Ambient { radiance: [0.5; 3], distance: 10.0 };
    scene
}

fn draw(scene: &Scene, backend: BackendChoice, size: [u32; 2], shade: ShadeOptions) -> Rendered {
    render(scene, &RenderParams { size, frames: 2, backend, shade, ..RenderParams::default() }, &Control::SILENT)
        .unwrap()
}

/// Numbers of a picture that no picture may hold.
fn faults(rendered: &Rendered) -> usize {
    rendered.picture.radiance.iter().flatten().filter(|x| !(x.is_finite() && **x >= 0.0)).count()
}

/// Draws in both modes and with both rules, and looks for numbers that are none.
fn assert_sound(what: &str, scene: &Scene) {
    for backend in backends(what) {
        for (mode, interpolation) in
            [(RenderMode::Direct, Interpolation::Fast), (RenderMode::Path, Interpolation::Exact)]
        {
            let mut shade = ShadeOptions { mode, depth: 3, ..ShadeOptions::default() };
            shade.decode.interpolation = interpolation;
            let rendered = draw(scene, backend, [24, 18], shade);
            assert_eq!(faults(&rendered), 0, "{what}, {backend:?}, {mode:?}");
        }
    }
}

#[test]
fn the_scan_finds_a_number_that_is_none() {
    let mut rendered = draw(&scene(plane()), BackendChoice::Cpu, [8, 8], ShadeOptions::default());
    assert_eq!(faults(&rendered), 0);
    rendered.picture.radiance[5][1] = f32::NAN;
    rendered.picture.radiance[6][2] = -1e-3;
    assert_eq!(faults(&rendered), 2);
}

#[test]
fn eyes_and_lights_at_89_point_9_degrees() {
    let mut scene = scene(plane());
    let (sin, cos) = 89.9f32.to_radians().sin_cos();
    scene.camera = Camera { eye: Vec3::new(3.0 * sin, 0.0, 3.0 * cos), target: Vec3::ZERO, up: Vec3::Z, fov_deg: 30.0 };
    scene.lights = [[-4.0 * sin, 0.1, 4.0 * cos], [0.0, 4.0 * sin, 4.0 * cos], [4.0 * sin, 0.0, -4.0 * cos]]
        .map(|position| PointLight { position: position.into(), intensity: [50.0; 3] })
        .to_vec();
    assert_sound("grazing", &scene);
}

#[test]
fn lights_on_the_surface_and_at_infinity() {
    let mut scene = scene(plane());
    scene.lights = [[0.0, 0.0, 0.0], [0.2, 0.1, 1e-7], [0.3, 0.0, -1e-7], [-1.0, -1.0, 0.0], [1e18, 1e18, 1e18]]
        .map(|position| PointLight { position: position.into(), intensity: [1.0; 3] })
        .to_vec();
    assert_sound("light on the surface", &scene);
}

#[test]
fn normals_that_turn_away_texture_without_area_and_triangles_without_one() {
    let mut away = sphere();
    away.vertices.iter_mut().for_each(|vertex| vertex.normal = vertex.normal.map(|x| -x));
    assert_sound("normals inwards", &scene(away));
    let mut across = sphere();
    across.vertices.iter_mut().for_each(|vertex| {
        vertex.normal = Vec3::from(vertex.normal).any_orthonormal_vector().to_array();
        vertex.tangent = [0.0, 0.0, 0.0, 1.0];
    });
    assert_sound("normals along the surface, no tangents", &scene(across));
    let mut flat = plane();
    flat.vertices.iter_mut().for_each(|vertex| (vertex.u, vertex.v) = (0.25, 0.75));
    assert_sound("texture without area", &scene(flat));
    let mut needles = plane();
    needles.triangles.extend([[0, 0, 1], [2, 2, 2]]);
    needles.transform(Mat4::from_scale(Vec3::new(1.0, 1e-6, 1.0)));
    assert_sound("needles", &scene(needles));
    let mut far = plane();
    far.vertices.iter_mut().for_each(|vertex| (vertex.u, vertex.v) = (1e30 * vertex.u, -1e30));
    assert_sound("texture coordinates without digits", &scene(far));
}

#[test]
fn vertices_that_are_no_numbers_and_nothing_at_all_are_refused_by_name() {
    let mut part = plane();
    part.vertices[1].normal[2] = f32::NAN;
    let refused = |part| Scene::from_objects(Path::new("bad.obj"), vec![with_asset(part)], vec![sample(1, 2, 2)]);
    let message = refused(part).unwrap_err().to_string();
    assert!(message.contains("bad.obj") && message.contains("not a finite number"), "{message}");
    let mut none = plane();
    none.triangles.clear();
    let message = refused(none).unwrap_err().to_string();
    assert!(message.contains("no triangle"), "{message}");
    let vertex = Vertex { position: [0.0; 3], u: 0.0, normal: [0.0, 0.0, 1.0], v: 0.0, tangent: [1.0, 0.0, 0.0, 1.0] };
    let beyond = Geometry::new(vec![vertex], vec![Triangle { vertices: [0, 0, 7], material: 0 }]);
    assert!(beyond.unwrap_err().contains("not there"));
}

#[test]
fn no_light_and_4096_lights() {
    let mut scene = scene(sphere());
    scene.lights.clear();
    assert_sound("no light", &scene);
    scene.place_lights(4096);
    assert_sound("4096 lights", &scene);
}

#[test]
fn an_asset_of_one_texel_and_64_assets_at_once() {
    let one = Scene::built_in(&MeshChoice::Sphere, vec![sample(4, 1, 1)], [5.0; 2]).unwrap();
    assert_sound("one texel", &one);
    let assets: Vec<_> = (0..64).map(|seed| sample(seed, 2, 3)).collect();
    let many = Scene::built_in(&MeshChoice::Plane, assets, [1.0; 2]).unwrap();
    assert_sound("64 assets", &many);
}

#[test]
fn relief_and_edits_at_the_ends_of_their_ranges() {
    // Noise a hundred times as high as it is, seen and lit along the surface, on a mesh with silhouettes.
    let mut scene = scene(sphere());
    scene.camera = Camera { eye: Vec3::new(0.0, 1.02, 1.4), target: Vec3::Y, up: Vec3::Y, fov_deg: 40.0 };
    let ends = [
        Edit { tint: [0.0, 16.0, 16.0], diffuse: 0.0, specular: 16.0, roughness: 0.1, tilt: [0.9, 0.9], fade: 0.0 },
        Edit { tint: [16.0; 3], diffuse: 16.0, specular: 0.0, roughness: 10.0, tilt: [-0.9, 0.9], fade: 16.0 },
    ];
    let texels = (0..scene.assets[0].file_form().unwrap().asset.texel_count()).map(|texel| (texel % 3) as u8).collect();
    Arc::make_mut(&mut scene.assets[0]).set_edits(Edits { list: ends.to_vec(), texels });
    for scale in [1e-4, 1.0, 100.0] {
        scene.displace(scale);
        assert_sound(&format!("relief times {scale}"), &scene);
    }
}

#[test]
fn pictures_of_one_pixel_and_in_bands() {
    let scene = scene(sphere());
    for backend in backends("pictures of one pixel") {
        let rendered = draw(&scene, backend, [1, 1], ShadeOptions::default());
        assert_eq!((rendered.picture.radiance.len(), faults(&rendered)), (1, 0));
    }
    if gpu_is_left_out("pictures in bands") {
        return;
    }
    let picture = |kind, limit: Option<u64>| {
        let mut gpu = Gpu::headless(None).unwrap();
        limit.into_iter().for_each(|limit| gpu.limit_bindings(limit));
        let mut tracer = Tracer::new(&gpu, &scene, kind)?;
        let request = FrameRequest { scene: &scene, size: [100, 80], options: ShadeOptions::default(), sample: 0 };
        tracer.sample(&request, None)?;
        Ok::<_, btf_viewer::ViewerError>((tracer.read_radiance()?, tracer.read_hits()?))
    };
    for kind in tracers("pictures in bands") {
        // Bands of 46 rows; vertices, triangles and nodes lie in pieces, too.
        let (whole, cut) = (picture(kind, None).unwrap(), picture(kind, Some(300_000)).unwrap());
        assert_eq!(whole.0.len(), 100 * 80);
        assert!(whole == cut, "{kind:?}");
        assert!(whole.0.iter().any(|pixel| *pixel != whole.0[0]));
    }
    // More pieces than can be bound.
    let message = picture(GpuTracer::Bvh, Some(20_000)).unwrap_err().to_string();
    assert!(message.contains("simplify the mesh"), "{message}");
}

#[test]
fn a_lost_device_is_an_error_and_no_crash() {
    if gpu_is_left_out("a_lost_device_is_an_error_and_no_crash") {
        return;
    }
    let gpu = Gpu::headless(None).unwrap();
    let scene = scene(plane());
    let mut tracer = Tracer::new(&gpu, &scene, GpuTracer::Bvh).unwrap();
    let shade = ShadeOptions::default();
    let request = FrameRequest { scene: &scene, size: [8, 8], options: shade, sample: 0 };
    tracer.sample(&request, None).unwrap();
    gpu.device.destroy();
    let result = tracer.sample(&FrameRequest { size: [16, 8], ..request }, None).and_then(|()| tracer.read_radiance());
    let message = result.unwrap_err().to_string();
    assert!(message.contains("--backend cpu"), "{message}");
}
