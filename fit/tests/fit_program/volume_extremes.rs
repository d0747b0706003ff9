//! Volumes of models at the edge: open, inside out, cut by themselves, without area, of very many triangles. Each
//! becomes a finite volume that hides what its model hides, or a sentence that names the file.

use crate::support::{btf_fit, refusal};
use btf_runtime::testing::Random;
use btf_runtime::voltex::{NO_VOXEL, Voltex, VoltexRay, Volume, Walk};
use btf_voxelize::{
    Frame, HALF_SIDE, MicroflakeColour, Occluder, Projection, RefitParams, ShadowParams, TriangleModel, VoltexParams,
    build_voltex, spread_directions,
};
use glam::Vec3;
use std::f32::consts::PI;
use std::fs;

const PARAMS: VoltexParams = VoltexParams {
    resolution: 16,
    refit: RefitParams { views: 12, passes: 2, rays: 3 },
    shadow: ShadowParams { views: 2, turns: 1, pixels: 12 },
};

fn model(triangles: Vec<[Vec3; 3]>) -> TriangleModel {
    TriangleModel {
        materials: vec![0; triangles.len()],
        triangles,
        colours: vec![MicroflakeColour {
            reflectance: [0.4; 3],
            transmittance: [0.1; 3],
            ..MicroflakeColour::default()
        }],
        weights: vec![1.0],
        ..TriangleModel::default()
    }
}

/// A ball of `2 * rows^2` quads, counter-clockwise from outside.
fn ball(rows: usize, centre: Vec3) -> Vec<[Vec3; 3]> {
    let at = |i: usize, j: usize| {
        let [down, around] = [i, j].map(|x| PI * x as f32 / rows as f32);
        centre + Vec3::new(down.sin() * around.cos(), down.sin() * around.sin(), down.cos())
    };
    let quads = (0..rows).flat_map(|i| (0..2 * rows).map(move |j| [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]));
    quads
        .flat_map(|quad| {
            let [a, b, c, d] = quad.map(|(i, j)| at(i, j));
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

/// What the volume hides at its finest level, and what the model does, over views of which none was fitted.
fn hidden(volume: &Volume, model: &TriangleModel) -> [f32; 2] {
    let cube = model.in_cube(&Frame::around(model.bounds()).unwrap());
    let (occluder, voltex) = (Occluder::new(&cube.triangles), Voltex::new(volume));
    let mut sums = [0.0; 2];
    for direction in spread_directions(5, 2.1) {
        let view = Projection::new(direction);
        for i in 0..60 * 60 {
            let at = |k: usize| ((k as f32 + 0.5) / 30.0 - 1.0) * HALF_SIDE;
            let origin = view.origin(at(i % 60), at(i / 60));
            let ray = VoltexRay { origin: origin.into(), direction: direction.into() };
            let mut walk = Walk::new(ray, 0.0, 4.0, voltex.level_count());
            let mut depth = 0.0;
            while let Some(segment) = walk.next(&voltex, 0) {
                if segment.cell.voxel != NO_VOXEL {
                    depth +=
                        voltex.voxel(segment.cell.voxel).extinction_along(direction.into()) * (segment.t1 - segment.t0);
                }
            }
            sums[0] += 1.0 - (-depth).exp();
            sums[1] += f32::from(u8::from(occluder.occluded(origin, direction, 4.0)));
        }
    }
    sums
}

/// Builds, sees that all numbers are finite and that the file is whole, and tells the share of its model that it hides.
fn built(what: &str, model: &TriangleModel) -> (Volume, f32) {
    let volume = build_voltex(model, &PARAMS).unwrap();
    let voltex = Voltex::new(&volume);
    for (level, number) in
        (0..=voltex.level_count()).flat_map(|l| voltex.numbers_at(l).into_iter().map(move |n| (l, n)))
    {
        let voxel = voltex.voxel(number);
        let numbers = [voxel.extinction.0, voxel.moment.0].concat();
        assert!(numbers.iter().all(|x| x.is_finite()), "{what}, level {level}: {voxel:?}");
    }
    for level in &volume.levels {
        assert!(level.shadow.offset.is_finite() && level.shadow.shared.iter().all(|c| c.is_finite()), "{what}");
    }
    assert_eq!(Volume::parse(&volume.pack().unwrap()).unwrap().levels.len(), volume.levels.len());
    let [found, expected] = hidden(&volume, model);
    (volume, found / expected)
}

#[test]
fn open_inside_out_and_self_intersecting_models_hide_what_they_hide() {
    let whole = ball(12, Vec3::ZERO);
    let inside_out: Vec<_> = whole.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    let mut random = Random::new(3);
    let open: Vec<_> = whole.iter().copied().filter(|_| random.within(0.0, 1.0) < 0.6).collect();
    let through = [whole.clone(), ball(12, Vec3::new(0.7, 0.1, 0.3))].concat();
    // Seven blades at one edge: no side is in or out.
    let blade = |k: usize| [Vec3::ZERO, Vec3::Z, Vec3::new((k as f32).cos(), (k as f32).sin(), 0.5)];
    let star: Vec<_> = (0..7).map(blade).collect();
    for (what, triangles) in [
        ("whole", whole.clone()),
        ("inside out", inside_out),
        ("open", open.clone()),
        ("self-intersecting", through),
        ("star", star),
        ("one triangle", whole[40..41].to_vec()),
    ] {
        let (_, ratio) = built(what, &model(triangles));
        assert!((ratio - 1.0).abs() < 0.05, "{what}: {ratio}");
    }
    // Planted: the volume of the whole ball is told from that of the open one.
    let (volume, _) = built("whole", &model(whole));
    let [found, expected] = hidden(&volume, &model(open));
    assert!(found / expected > 1.1, "{found} {expected}");
}

#[test]
fn triangles_without_area_change_nothing() {
    let whole = ball(8, Vec3::ZERO);
    let (a, b) = (Vec3::splat(0.1), Vec3::new(0.4, 0.2, 0.3));
    let mut more = whole.clone();
    more.extend([[a; 3], [a, b, a], [a, b, 0.5 * (a + b)], [a, a + Vec3::X * 1e-30, a + Vec3::Y * 1e-30]]);
    let [with, without] = [more, whole.clone()].map(|triangles| build_voltex(&model(triangles), &PARAMS).unwrap());
    let [with, without] = [&with, &without].map(|volume| hidden(volume, &model(whole.clone()))[0]);
    assert!((with / without - 1.0).abs() < 1e-3, "{with} {without}");
    // Planted: one with an area does.
    let fin = [whole.clone(), vec![[Vec3::ZERO, Vec3::new(1.0, 1.0, 1.0), Vec3::new(1.0, -1.0, 1.0)]]].concat();
    let fin = hidden(&build_voltex(&model(fin), &PARAMS).unwrap(), &model(whole))[0];
    assert!((fin / without - 1.0).abs() > 1e-2, "{fin} {without}");
}

#[test]
fn every_scale_gives_the_same_volume() {
    let sizes = [1e-30, 1e-3, 1e8].map(|size: f32| {
        let scaled = ball(6, Vec3::ZERO).iter().map(|corners| corners.map(|p| p * size)).collect();
        let volume = build_voltex(&model(scaled), &PARAMS).unwrap();
        assert!((volume.side_m / (2.002 * size) - 1.0).abs() < 1e-5);
        (volume.levels[0].voxels.len(), hidden(&volume, &model(ball(6, Vec3::ZERO)))[0])
    });
    assert!(sizes.iter().all(|(_, found)| (found / sizes[1].1 - 1.0).abs() < 0.01), "{sizes:?}");
}

/// docs/results/voltex.md has time and memory of 10 million.
#[test]
fn many_triangles_are_few_voxels() {
    let mut random = Random::new(9);
    let mut vector = |reach: f32| Vec3::from([0; 3].map(|_| random.within(-reach, reach)));
    let leaf = |_| {
        let at = vector(1.0);
        [at, at + vector(0.01), at + vector(0.01)]
    };
    let crowd = model((0..300_000).map(leaf).collect());
    let few = VoltexParams { refit: RefitParams { views: 3, passes: 1, rays: 2 }, ..PARAMS };
    let volume = build_voltex(&crowd, &few).unwrap();
    assert_eq!(volume.levels[4].voxels.len(), 1);
    assert!(volume.levels[0].voxels.len() <= 16 * 16 * 16 && volume.pack().unwrap().len() < 50_000);
    let [found, expected] = hidden(&volume, &crowd);
    assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
}

#[test]
fn models_of_which_no_volume_can_be_made_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let triangle = "f 1 2 3\n";
    let glb = [b"glTF".as_slice(), &[2, 0, 0, 0], &[200, 0, 0, 0]].concat();
    for (name, content, parts) in [
        ("empty.obj", "", ["has no triangles", "export"]),
        ("vertices.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", ["has no triangles", "export"]),
        ("place.obj", "v 5 5 5\nv 5 5 5\nv 5 5 5\n", ["no extent", "nothing to make a volume of"]),
        ("line.obj", "v 0.1 0.2 0.3\nv 0.2 0.4 0.6\nv 0.3 0.6 0.9\n", ["cover", "give them an area"]),
        ("far.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1e6 0 0\nf 4 4 4\n", ["cover", "take away what lies far off"]),
        ("huge.obj", "v 0 0 0\nv 1e20 0 0\nv 0 1e20 0\n", ["m large", "scale it to metres"]),
        ("larger.obj", "v -3e38 0 0\nv 3e38 0 0\nv 0 1e20 0\n", ["m large", "scale it to metres"]),
        ("nan.obj", "v nan 0 0\nv 1 0 0\nv 0 1 0\n", ["not a finite number", "export it again"]),
        ("beyond.obj", "v 0 0 0\nv 1 0 0\n", ["cannot be read", "export it again"]),
        ("cut.obj", "v 0 0 0\nv 1 0 0\nv 0 1 ", ["cannot be read", "export it again"]),
        ("cut.glb", std::str::from_utf8(&glb[..11]).unwrap_or("glTF"), ["cannot be read", "export it again"]),
        ("none.shapes.toml", "[space]\nleast_m = [0, 0, 0]\nmost_m = [1, 1, 1]\n", ["no shape lies", "[space]"]),
    ] {
        let faces = if name.ends_with(".obj") && !content.is_empty() && name != "vertices.obj" { triangle } else { "" };
        let content = if name == "cut.obj" { content.to_string() } else { format!("{content}{faces}") };
        fs::write(folder.path().join(name), content).unwrap();
        let (code, message) = refusal(&btf_fit(&["voltex", name, "-o", "out.voltex"], folder.path()));
        assert!(code == 1 && message.contains(name), "{name}: {message}");
        assert!(parts.iter().all(|part| message.contains(part)), "{name}: {message}");
        assert!(!folder.path().join("out.voltex").exists());
    }
    // Planted: what has an area is built.
    fs::write(folder.path().join("good.obj"), format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{triangle}")).unwrap();
    let line = ["voltex", "good.obj", "-o", "out.voltex", "--resolution", "4"];
    assert!(btf_fit(&line, folder.path()).status.success() && folder.path().join("out.voltex").exists());
}

#[test]
fn a_cut_off_volume_is_refused_by_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::write(here.join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert!(btf_fit(&["voltex", "a.obj", "-o", "a.voltex", "--resolution", "8"], here).status.success());
    let whole = fs::read(here.join("a.voltex")).unwrap();
    assert!(btf_fit(&["validate", "a.voltex"], here).status.success());
    for length in [0, 3, 79, 100, whole.len() - 1] {
        fs::write(here.join("cut.voltex"), &whole[..length]).unwrap();
        for line in [&["info", "cut.voltex"][..], &["validate", "cut.voltex"], &["compare", "a.obj", "cut.voltex"]] {
            let output = btf_fit(line, here);
            let message = String::from_utf8_lossy(&output.stderr);
            let sound =
                output.status.code() == Some(1) && message.contains("cut.voltex") && !message.contains("panicked");
            assert!(sound, "{line:?} of {length} bytes: {message}");
        }
    }
}
