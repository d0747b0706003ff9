use super::planted::densest;
use super::*;
use crate::cpu::picture::CpuPicture;
use crate::geometry::bvh::AnyHit;
use crate::geometry::geometry::Geometry;
use crate::options::ShadeOptions;
use crate::scene::volume::standing;
use clap::ValueEnum;
use glam::Vec4;

fn built_in(landscape: Landscape, times: u32) -> (Scene, LandscapeCounts) {
    landscape.scene(&LandscapeParams { times, volumes: Vec::new(), meshes: Vec::new(), wind_m_per_s: None }).unwrap()
}

#[test]
fn counts_are_the_published_ones_and_ten_times_them() {
    for times in [1, 10] {
        let counts = |landscape| built_in(landscape, times.try_into().unwrap()).1;
        let lawn = counts(Landscape::Lawn);
        assert_eq!([lawn.patches, lawn.blades, lawn.flowers], [1_400, 22_400, 700].map(|count| count * times));
        let grove = counts(Landscape::Grove);
        assert_eq!([grove.patches, grove.texels, grove.trees], [1_024, 512, 512].map(|count| count * times));
        assert_eq!(grove.primitives, grove.trees * 8_490);
        let forest = counts(Landscape::Forest);
        assert_eq!([forest.patches, forest.texels, forest.trees], [1_404, 12_500, 25_000].map(|n| n * times));
        assert!(forest.volume_bytes < 16_000_000, "{}", forest.volume_bytes);
    }
}

#[test]
fn what_grows_is_where_it_is_densest_and_as_much_as_asked_for() {
    assert_eq!(densest(2, &[0.5, 0.7, 0.5, f32::MIN]), [true, true, false, false]);
    assert_eq!(densest(5, &[0.5, 0.1]), [true, true]);
    assert_eq!(densest(0, &[0.5]), [false]);
}

#[test]
fn every_camera_shows_a_picture_without_nan_that_is_not_flat() {
    for landscape in Landscape::value_variants() {
        let (mut scene, _) = built_in(*landscape, 1);
        for number in 0..3 {
            if number > 0 {
                scene.camera = scene.more_cameras[number - 1];
            }
            assert_eq!(scene.camera.fault(), None);
            let with = radiance(&scene);
            assert!(with.iter().flatten().all(|x| x.is_finite() && *x >= 0.0), "{landscape:?} {number}");
            let mean = luminance(&with).iter().sum::<f32>() / with.len() as f32;
            let variance = luminance(&with).iter().map(|x| (x - mean).powi(2)).sum::<f32>() / with.len() as f32;
            assert!(mean > 0.01 && variance.sqrt() > 0.1 * mean, "{landscape:?} {number}: {mean} {variance}");
            // Bare land is another picture: the volumes are seen.
            let bare = radiance(&Scene { volumes: None, ..scene.clone() });
            let changed = with.iter().zip(&bare).filter(|(a, b)| a != b).count();
            assert!(changed > with.len() / 8, "{landscape:?} {number}: {changed}");
        }
    }
}

#[test]
fn models_stand_where_the_wind_has_their_volumes() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("flag.obj");
    std::fs::write(&file, "v 0 0 0\nv 0.5 0 0\nv 0 5 0\nf 1 2 3\n").unwrap();
    let params = LandscapeParams { times: 1, volumes: vec![], meshes: vec![file], wind_m_per_s: Some(30.0) };
    let (mut scene, _) = Landscape::Grove.scene(&params).unwrap();
    let before = scene.geometry.clone();
    scene.blow(3.0).unwrap();
    let volumes = scene.volumes.as_ref().unwrap();
    let skin = &volumes.skins()[0];
    let (shell, patterns) = (skin.shell(), &skin.patterns);
    let volume_from_model = standing(volumes.volume(0), Vec3::ZERO, 0.0, 1.0).inverse();
    // How far a point of the models is from where the skin has it, in volumes, at most.
    let off = |geometry: &Geometry, at: Vec3| {
        let (mut count, mut worst) = (0, 0f32);
        for plant in geometry.instances().iter().filter(|instance| instance.leaf_width > 0.0).step_by(16) {
            let world = Vec3::from(plant.world_from_object.map(|row| Vec4::from(row).dot(at.extend(1.0))));
            let Some(tet) = shell.locate(world) else { continue };
            let texture = shell.map(tet).point(world);
            let cell = [texture.x, texture.y].map(|x| x.floor() as i32);
            let Some(variant) = patterns[shell.tets()[tet as usize].pattern as usize].variant(cell) else {
                continue;
            };
            let there = volume_from_model.transform_point3(at);
            (count, worst) = (count + 1, worst.max((variant.point(texture) - there).length()));
        }
        assert!(count > 20, "{count}");
        worst
    };
    // At the foot, at half the way to the crown, and there.
    let heights = [0.001, 0.35, 0.7].map(|share| share * volumes.volume(0).side_m() * Vec3::Y);
    let [foot, middle, crown] = heights.map(|at| off(&scene.geometry, at));
    assert!(foot < 0.01 && middle < 0.1 && crown < 0.03, "{foot} {middle} {crown}");
    // Planted: where they stood a moment before.
    assert!(off(&before, heights[2]) > 0.2);
    // And they are hit there.
    let plant = scene.geometry.instances().iter().find(|instance| instance.leaf_width > 0.0).unwrap();
    let at = Vec3::new(0.02, 4.0, 0.0).extend(1.0);
    let world = Vec3::from(plant.world_from_object.map(|row| Vec4::from(row).dot(at)));
    let [x, y] = [0, 1].map(|axis| Vec3::from(plant.world_from_object.map(|row| row[axis])));
    let normal = x.cross(y).normalize();
    let hit = scene.geometry.trace(world + normal, -normal, 2.0, AnyHit::No);
    assert!((hit.t - 1.0).abs() < 1e-3, "{hit:?}");
}

#[test]
fn says_which_volumes_and_numbers_it_needs() {
    let asked = |landscape: Landscape, times, volumes: &[&str]| {
        let volumes = volumes.iter().map(PathBuf::from).collect();
        landscape.scene(&LandscapeParams { times, volumes, meshes: Vec::new(), wind_m_per_s: None }).unwrap_err()
    };
    assert_eq!(asked(Landscape::Grove, 0, &[]).exit_code(), 2);
    assert!(asked(Landscape::Lawn, 1, &["one.voltex"]).to_string().contains("2 volumes"));
    assert!(asked(Landscape::Grove, 1, &["none.voltex"]).to_string().contains("none.voltex"));
    let tree = concat!(env!("CARGO_MANIFEST_DIR"), "/src/scene/builtin/tree.voltex");
    assert!(asked(Landscape::Forest, 1, &[tree]).to_string().contains("cyclic"));
}

fn radiance(scene: &Scene) -> Vec<[f32; 3]> {
    let mut picture = CpuPicture::new([24, 16]);
    picture.add_sample(scene, &ShadeOptions::default(), &|| true);
    picture.radiance()
}

fn luminance(radiance: &[[f32; 3]]) -> Vec<f32> {
    radiance.iter().map(|[r, g, b]| 0.2126 * r + 0.7152 * g + 0.0722 * b).collect()
}
