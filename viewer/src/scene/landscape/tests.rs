use super::planted::{Plant, densest};
use super::*;
use crate::cpu::picture::CpuPicture;
use crate::geometry::bvh::AnyHit;
use crate::geometry::geometry::Geometry;
use crate::options::ShadeOptions;
use crate::scene::volume::standing;
use btf_runtime::voltex::{NO_VOXEL, Voltex, Volume as BtfVolume};
use clap::ValueEnum;
use glam::{Vec2, Vec3, Vec4};

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

#[test]
fn a_forest_takes_volumes_and_models_of_two_kinds_of_trees_or_of_one() {
    let flora = |volumes, models| Landscape::Forest.flora(volumes, models);
    for (volumes, models, kinds) in [(0, 0, 2), (2, 0, 2), (0, 4, 2), (2, 4, 2), (1, 0, 1), (0, 2, 1), (1, 2, 1)] {
        let found = flora(volumes, models).unwrap();
        assert_eq!((found.built_in.len(), found.plants.len()), (kinds, 2 * kinds), "{volumes} {models}");
        // Either way the skin's three alternatives are there, and every plant is in some of them.
        assert_eq!(found.tints.iter().map(|tints| tints.len()).sum::<usize>(), 3);
        assert!(found.plants.iter().all(|plant| plant.volume as usize + plant.tints.len() <= 3));
    }
    for (volumes, models) in [(3, 0), (2, 2), (1, 4), (0, 1)] {
        let message = flora(volumes, models).map(|_| ()).unwrap_err().to_string();
        assert!(message.contains("2 volumes and 4 models") && message.contains("1 volume and 2 models"), "{message}");
        assert!(message.contains(&format!("{volumes} volume")) && message.contains("not at all"), "{message}");
    }
}

#[test]
fn the_trees_of_a_forest_stand_where_its_volumes_have_them() {
    for Flora { built_in, tints, plants, .. } in &forest::FLORAS {
        for Plant { volume, scale, foot_m, .. } in *plants {
            let first = |file: usize| tints[..file].iter().map(|tints| tints.len()).sum::<usize>();
            let file = (0..built_in.len()).rfind(|file| first(*file) <= *volume as usize).unwrap();
            let voltex = Voltex::new(&BtfVolume::parse(built_in[file]).unwrap());
            let volume_from_world = standing(&voltex, Vec3::ZERO, 0.0, 1.0).inverse();
            let voxels = (1u32 << voltex.level_count()) as f32;
            // Shares of the trunk's lower part that the volume has something in.
            let filled = |foot_m: Vec3| {
                let heights_m = (1..=20).map(|i| 0.09 * scale * i as f32);
                let cells = heights_m.map(|height_m| {
                    let at = volume_from_world.transform_point3(foot_m + Vec3::Y * height_m);
                    voltex.cell((at * voxels).to_array().map(|x| x as u32), 0).voxel != NO_VOXEL
                });
                cells.filter(|filled| *filled).count()
            };
            assert_eq!(filled(*foot_m), 20, "{foot_m}");
            // Planted: mirrored, it stands beside the tree.
            assert!(filled(*foot_m * Vec3::new(-1.0, 1.0, 1.0)) < 10, "{foot_m}");
        }
    }
}

#[test]
fn broad_leaved_trees_are_in_valleys_and_spruces_on_heights_with_a_zone_of_both() {
    let Planted { terrain, patterns, .. } = forest::planted(1, 6.0).unwrap();
    let cells = patterns[0].cells.clone().unwrap();
    let heights_m = |alternative: u8| {
        let texels = cells.content.iter().enumerate().filter(|(_, content)| **content == 1 + alternative);
        let at = texels.map(|(number, _)| {
            let texel = [number as u32 % cells.size[0], number as u32 / cells.size[0]].map(|x| x as f32);
            let share = (Vec2::from(texel) + 0.5) / Vec2::from(cells.size.map(|x| x as f32));
            (terrain.height_m)((share - 0.5) * terrain.size_m)
        });
        let mut heights_m: Vec<f32> = at.collect();
        heights_m.sort_by(f32::total_cmp);
        heights_m
    };
    let [valleys, steep, heights] = [forest::IN_VALLEYS, forest::ON_STEEP_PLACES, forest::ON_HEIGHTS].map(heights_m);
    assert!([&valleys, &steep, &heights].into_iter().all(|species| species.len() > 250));
    // Spruces among the trees of a zone, by its heights in shares of the peaks'.
    let spruces = |zone: std::ops::Range<f32>| {
        let peak_m = 22.0 * 6.0;
        let count = |of: &[f32]| of.iter().filter(|height_m| zone.contains(&(*height_m / peak_m))).count() as f32;
        count(&heights) / (count(&heights) + count(&valleys))
    };
    let [below, between, above] = [spruces(0.0..0.1), spruces(0.25..0.35), spruces(0.5..2.0)];
    assert!(below < 0.15 && (0.3..0.7).contains(&between) && above > 0.75, "{below} {between} {above}");
}

fn radiance(scene: &Scene) -> Vec<[f32; 3]> {
    let mut picture = CpuPicture::new([24, 16]);
    picture.add_sample(scene, &ShadeOptions::default(), &|| true);
    picture.radiance()
}

fn luminance(radiance: &[[f32; 3]]) -> Vec<f32> {
    radiance.iter().map(|[r, g, b]| 0.2126 * r + 0.7152 * g + 0.0722 * b).collect()
}
