//! Tests of `paint.rs`.

use std::f64::consts::PI;

use btf_models::shapes::{DensityData, Noise, NumberType, ParticleSystem, Space, Tint, Trail};

use super::*;

const GREY: [f64; 3] = [0.2, 0.3, 0.4];

fn script(cyclic: bool, strokes: Vec<(PaintMode, Shape)>) -> Script {
    let material = |name: &str, reflectance| Material {
        name: name.into(),
        reflectance: Some(reflectance),
        transmittance: Some([0.1; 3]),
        ..Material::default()
    };
    let stroke = |(mode, shape)| Stroke { material: Some("grey".into()), mode, shapes: vec![shape] };
    Script {
        space: Space { least_m: [0.0, 0.0, -0.5], most_m: [1.0, 0.75, 0.5], cyclic: [cyclic; 2] },
        materials: vec![material("grey", GREY), material("white", [0.9; 3])],
        strokes: strokes.into_iter().map(stroke).collect(),
    }
}

fn painted(script: &Script, resolution: u32) -> Canvas {
    let coats: Vec<Coat> = script.materials.iter().map(|material| colour_of(material).into()).collect();
    paint(script, resolution, &Paints { script: Path::new("a.shapes.toml"), coats: &coats }).unwrap()
}

fn one(shape: Shape, resolution: u32) -> Canvas {
    painted(&script(false, vec![(PaintMode::Add, shape)]), resolution)
}

fn total(canvas: &Canvas) -> MicroflakeSums {
    let mut sum = MicroflakeSums::default();
    canvas.voxels.values().for_each(|voxel| sum.add(&voxel.all()));
    sum
}

fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found / expected - 1.0).abs() < tolerance, "{found} {expected}");
}

fn leaf(at: [f64; 3]) -> Shape {
    let place = |x: f64, y: f64, z: f64| [x + at[0], y + at[1], z + at[2]];
    let row = |y: f64, fold: f64| vec![place(-0.1, y, fold), place(0.0, y, 0.0), place(0.1, y, fold)];
    Shape::Sheet {
        rows_m: vec![vec![place(0.0, -0.2, 0.0)], row(-0.1, 0.05), row(0.1, 0.05), vec![place(0.0, 0.2, 0.0)]],
    }
}

fn leaf_area() -> f64 {
    // Two halves, each a rectangle and two triangles on a slope.
    let (slope, half) = (0.1f64.hypot(0.05), |a: [f64; 3], b: [f64; 3]| 0.5 * DVec3::from(a).cross(b.into()).length());
    2.0 * (0.2 * slope + 2.0 * half([0.0, 0.1, 0.0], [0.1, 0.1, 0.05]))
}

#[test]
fn a_sheet_has_its_area_wherever_it_lies() {
    for at in [[0.5, 0.4, 0.0], [0.4371, 0.3713, 0.1177]] {
        for resolution in [4, 16, 128] {
            let canvas = one(leaf(at), resolution);
            near(canvas.area_m2(), leaf_area(), 1e-5);
            let colour = total(&canvas);
            near(f64::from(colour.reflected[1] / colour.area), 0.3, 1e-5);
        }
    }
}

#[test]
fn what_leaves_a_cyclic_space_comes_in_at_the_other_side() {
    for resolution in [8, 64] {
        let inside = painted(&script(true, vec![(PaintMode::Add, leaf([0.5, 0.375, 0.1]))]), resolution);
        let across = painted(&script(true, vec![(PaintMode::Add, leaf([1.0, 0.75, 0.1]))]), resolution);
        near(across.area_m2(), leaf_area(), 1e-5);
        // Half a period farther on: the same voxels, moved.
        let half = [resolution / 2, resolution * 3 / 8];
        for (cell, sums) in &inside.voxels {
            let moved = [(cell[0] + half[0]) % resolution, (cell[1] + half[1]) % (resolution * 3 / 4), cell[2]];
            near(f64::from(across.voxels[&moved].all().area), f64::from(sums.all().area), 1e-3);
        }
        // Planted difference: in a space that is not cyclic a quarter is left.
        let cut = painted(&script(false, vec![(PaintMode::Add, leaf([1.0, 0.75, 0.1]))]), resolution);
        near(cut.area_m2(), leaf_area() / 4.0, 1e-4);
    }
    let round = Shape::Limb { points_m: vec![[0.9, 0.7, 0.0], [1.3, 0.9, 0.1]], radii_m: vec![0.01, 0.01] };
    let [alone, cyclic] =
        [false, true].map(|cyclic| painted(&script(cyclic, vec![(PaintMode::Add, round.clone())]), 32));
    near(cyclic.area_m2(), CLOSED * PI * (0.02 * (0.21f64).sqrt() + 0.0002), 1e-4);
    assert!(alone.area_m2() < 0.5 * cyclic.area_m2());
}

#[test]
fn what_covers_a_cyclic_space_again_and_again_is_refused() {
    let ball = Shape::Sphere { centre_m: [0.0; 3], radius_m: 1e6 };
    let sheet = Shape::Sheet { rows_m: vec![vec![[0.0; 3], [1e5, 0.0, 0.0]], vec![[0.0, 1.0, 0.0]]] };
    let limb = Shape::Limb { points_m: vec![[0.0; 3], [0.1, 0.0, 0.0]], radii_m: vec![1e5, 0.1] };
    for shape in [ball, sheet, limb] {
        let script = script(true, vec![(PaintMode::Add, shape.clone())]);
        let coats: Vec<Coat> = script.materials.iter().map(|material| colour_of(material).into()).collect();
        let paints = Paints { script: Path::new("a.shapes.toml"), coats: &coats };
        let message = paint(&script, 16, &paints).unwrap_err().to_string();
        assert!(message.contains(&format!("has a {} that covers", shape.kind())), "{message}");
    }
}

#[test]
fn limbs_have_the_area_of_cones_thick_or_thin() {
    let (points_m, radii_m) = (vec![[0.3, 0.3, -0.3], [0.5, 0.4, 0.1], [0.4, 0.5, 0.4]], vec![0.05, 0.03, 0.01]);
    let side = |a: usize| {
        let length = DVec3::from(points_m[a]).distance(points_m[a + 1].into());
        PI * (radii_m[a] + radii_m[a + 1]) * length.hypot(radii_m[a] - radii_m[a + 1])
    };
    let exact = side(0) + side(1) + PI * (0.05f64.powi(2) + 0.01f64.powi(2));
    let limb = Shape::Limb { points_m: points_m.clone(), radii_m: radii_m.clone() };
    let (thin, thick) = (one(limb.clone(), 4), one(limb, 128));
    for canvas in [&thin, &thick] {
        near(canvas.area_m2(), CLOSED * exact, 1e-4);
    }
    // What they project, seen from afar, is nearly the same.
    let (thin, thick) = (total(&thin), total(&thick));
    (0..13).for_each(|k| near(f64::from(thin.projected[k]), f64::from(thick.projected[k]), 0.01));
}

#[test]
fn a_ball_projects_its_disc_in_every_direction() {
    let canvas = one(Shape::Sphere { centre_m: [0.5, 0.4, 0.0], radius_m: 0.3 }, 64);
    let sum = total(&canvas);
    sum.projected.iter().for_each(|projected| near(f64::from(*projected), PI * 0.09, 2e-3));
    (0..3).for_each(|k| near(f64::from(sum.moment[k]), 2.0 * PI * 0.09 / 3.0, 5e-3));
    // A ray through the middle meets its triangles.
    assert!(canvas.triangles.len() > 1000);
    let occluder = crate::rays::occluder::Occluder::new(&canvas.triangles);
    let ray = |x: f32| occluder.occluded(glam::Vec3::new(x, 0.4, -1.0), glam::Vec3::Z, 4.0);
    assert!(ray(0.5) && ray(0.79) && !ray(0.81));
}

#[test]
fn modes_add_take_away_and_turn() {
    let ball = |radius_m| Shape::Sphere { centre_m: [0.5, 0.4, 0.0], radius_m };
    let slab = Shape::Box { least_m: [0.0, 0.0, 0.0], most_m: [1.0, 0.75, 0.5] };
    let area = |more: Option<(PaintMode, Shape)>| {
        let strokes = [(PaintMode::Add, ball(0.3))].into_iter().chain(more).collect();
        painted(&script(false, strokes), 32)
    };
    let whole = 4.0 * PI * 0.09 * CLOSED;
    near(area(None).area_m2(), whole, 5e-3);
    near(area(Some((PaintMode::Add, ball(0.1)))).area_m2(), whole * 10.0 / 9.0, 5e-3);
    // The upper half goes.
    let left = area(Some((PaintMode::Subtract, slab.clone())));
    near(left.area_m2(), 0.5 * whole, 0.01);
    assert!(left.voxels.keys().all(|cell| cell[2] < 16) && left.triangles.iter().all(|t| t[0].z < 0.51));
    // A ball of half the size that is set in place of another that it holds.
    let set = painted(&script(false, vec![(PaintMode::Add, ball(0.1)), (PaintMode::Set, ball(0.3))]), 32);
    near(set.area_m2(), whole, 0.01);
    // Normals: the ball's area, all upwards where a sheet passes.
    let row = |y: f64| vec![[0.0, y, 0.011], [1.0, y, 0.011]];
    let sheet = Shape::Sheet { rows_m: vec![row(0.0), row(0.75)] };
    let turned = area(Some((PaintMode::Normals, sheet)));
    near(turned.area_m2(), whole, 5e-3);
    let in_plane = |canvas: &Canvas, k: usize| {
        canvas.voxels.iter().filter(|(cell, _)| cell[2] == 16).map(|(_, sums)| sums.all().moment[k]).sum::<f32>()
    };
    assert!(in_plane(&turned, 0) == 0.0 && in_plane(&turned, 2) > 0.0 && in_plane(&area(None), 0) > 0.0);
}

#[test]
fn fur_has_so_many_strands_of_their_area_on_equal_ground() {
    let fur = |on: Shape, strands_per_m2: f64, lean_deg: f64| Shape::Fur {
        on: on.into(),
        strands_per_m2,
        length_m: 0.05,
        radius_m: 0.001,
        lean_deg,
        lean_towards: [1.0, 0.0, 0.0],
        bend_deg: 0.0,
        curl_turns: 0.0,
        curl_radius_m: 0.0,
        jitter: 0.0,
        segments: 4,
        seed: 5,
    };
    let row = |y: f64| vec![[0.1, y, 0.0], [0.9, y, 0.0]];
    let meadow = Shape::Sheet { rows_m: vec![row(0.1), row(0.6)] };
    let canvas = one(fur(meadow.clone(), 5000.0, 0.0), 16);
    // 2000 cones.
    near(canvas.area_m2(), CLOSED * 2000.0 * PI * 0.001 * 0.05, 1e-3);
    let sum = total(&canvas);
    assert!(sum.moment[2] < 1e-3 * sum.area && (sum.projected[0] / sum.area - 2.0 / PI as f32).abs() < 1e-3);
    // Every quarter of the ground has its share.
    let west = canvas.voxels.iter().filter(|(cell, _)| cell[0] < 8).map(|(_, sums)| sums.all().area).sum::<f32>();
    assert!((west / sum.area - 0.5).abs() < 0.02, "{}", west / sum.area);
    // They lean as they are told to.
    let leaning = total(&one(fur(meadow.clone(), 5000.0, 60.0), 16));
    near(f64::from(leaning.moment[2] / leaning.area), 0.5 * 0.75, 1e-3);
    let ball = total(&one(fur(Shape::Sphere { centre_m: [0.5, 0.4, 0.0], radius_m: 0.2 }, 5000.0, 0.0), 16));
    near(f64::from(ball.area), CLOSED * 2513.0 * PI * 0.001 * 0.05, 2e-3);
    assert_eq!(one(fur(meadow.clone(), 5000.0, 20.0), 16).voxels, one(fur(meadow.clone(), 5000.0, 20.0), 16).voxels);
    let dense = script(false, vec![(PaintMode::Add, fur(meadow, 1e7, 0.0))]);
    let coats: Vec<Coat> = dense.materials.iter().map(|material| colour_of(material).into()).collect();
    let paints = Paints { script: Path::new("a.shapes.toml"), coats: &coats };
    let message = paint(&dense, 16, &paints).unwrap_err().to_string();
    assert!(message.contains("a.shapes.toml has fur of 16000000 cylinders") && message.contains("lower"), "{message}");
}

#[test]
fn particles_have_paths_of_their_length_and_width() {
    let system = |particles: u64, trail: Trail| ParticleSystem {
        from: Shape::Sheet {
            rows_m: vec![vec![[0.4, 0.3, -0.4], [0.6, 0.3, -0.4]], vec![[0.4, 0.5, -0.4], [0.6, 0.5, -0.4]]],
        },
        particles,
        speed_m_per_s: 3.0,
        towards: None,
        spread_deg: 0.0,
        acceleration_m_per_s2: [0.0, 0.0, -9.81],
        drag_per_s: 0.0,
        life_s: 0.3,
        jitter: 0.0,
        trail,
        segments: 24,
        seed: 3,
    };
    let particles = |system: ParticleSystem| Shape::Particles(Box::new(system));
    // Up, and no longer than to the top of the way.
    let height = 3.0 * 0.3 - 0.5 * 9.81 * 0.09;
    let strands = system(50, Trail::Strand { radii_m: [0.002; 2] });
    let canvas = one(particles(strands.clone()), 32);
    near(canvas.area_m2(), CLOSED * 50.0 * 2.0 * PI * 0.002 * height, 1e-3);
    let highest = canvas.voxels.keys().map(|cell| cell[2]).max().unwrap();
    assert_eq!(highest, ((0.1 + height) * 32.0) as u32);
    // A blade's V, narrowing to nothing.
    let blade = |fold_deg| system(50, Trail::Blade { widths_m: [0.01, 0.0], fold_deg });
    let folded = one(particles(blade(40.0)), 32);
    let mean_width = |widths: &dyn Fn(f64) -> f64| -> f64 {
        // Over the way, of which equal times have less and less.
        let at = |t: f64| 3.0 * t - 0.5 * 9.81 * t * t;
        (0..2400).map(|i| f64::from(i) / 2400.0).map(|s| widths(s) * (at(0.3 * (s + 1.0 / 2400.0)) - at(0.3 * s))).sum()
    };
    near(folded.area_m2(), 50.0 * mean_width(&|s| 0.01 * (1.0 - s)), 2e-3);
    let projected = |canvas: &Canvas, axis: usize| f64::from(total(canvas).projected[axis] / total(canvas).area);
    // Upright, so from above there is only what the V's narrowing rises.
    assert!(projected(&folded, 2) < 0.03, "{}", projected(&folded, 2));
    // Thrown aside it is an arc: higher than where it ends, and in the plane of its throw.
    let mut arc = system(1, Trail::Strand { radii_m: [0.002; 2] });
    (arc.from, arc.towards, arc.life_s) =
        (Shape::Sphere { centre_m: [0.2, 0.4, -0.4], radius_m: 1e-4 }, Some([1.0, 0.0, 2.0]), 0.5);
    let canvas = one(particles(arc.clone()), 64);
    let cells: Vec<[u32; 3]> = canvas.voxels.keys().copied().collect();
    let top = cells.iter().max_by_key(|cell| cell[2]).unwrap();
    let last = cells.iter().max_by_key(|cell| cell[0]).unwrap();
    let apex = 2.0 / 5f64.sqrt() * 3.0;
    near(f64::from(top[2]) + 0.5, (0.1 + apex * apex / (2.0 * 9.81)) * 64.0, 0.02);
    near(f64::from(last[0]) + 0.5, (0.2 + 3.0 / 5f64.sqrt() * 0.5) * 64.0, 0.02);
    assert!(last[2] < top[2] && cells.iter().all(|cell| cell[1].abs_diff(25) < 2));
    // Spread evenly over a half sphere: half of them leave within 60 degrees of its axis.
    let mut burst = system(20_000, Trail::Strand { radii_m: [0.001; 2] });
    (burst.from, burst.towards) = (Shape::Sphere { centre_m: [0.5, 0.4, 0.0], radius_m: 1e-4 }, Some([0.0, 0.0, 1.0]));
    (burst.spread_deg, burst.acceleration_m_per_s2, burst.life_s, burst.segments) = (90.0, [0.0; 3], 0.1, 1);
    let sum = total(&one(particles(burst), 16));
    // The mean square of the cosines of directions over a half sphere is a third, so that across them the moments are equal.
    near(f64::from(sum.moment[2] / sum.area), 1.0 / 3.0, 0.01);
    assert_eq!(one(particles(arc.clone()), 16).voxels, one(particles(arc), 16).voxels);
    let many = script(false, vec![(PaintMode::Add, particles(ParticleSystem { particles: 1 << 20, ..strands }))]);
    let coats: Vec<Coat> = many.materials.iter().map(|material| colour_of(material).into()).collect();
    let paints = Paints { script: Path::new("a.shapes.toml"), coats: &coats };
    let message = paint(&many, 16, &paints).unwrap_err().to_string();
    assert!(message.contains("a.shapes.toml has particles whose paths have 25165824 pieces"), "{message}");
}

#[test]
fn hypertexture_has_the_area_of_its_density_and_its_gradient() {
    let soft = |amplitude_m: f64, area_per_m3: f64| Shape::Hypertexture {
        of: Shape::Sphere { centre_m: [0.5, 0.4, 0.0], radius_m: 0.25 }.into(),
        rim_m: 0.1,
        amplitude_m,
        noise: Noise { cells: [8, 6, 8], octaves: 2, gain: 0.5, seed: 1 },
        area_per_m3,
    };
    // The mean over the rim of balls' volumes, and of their surfaces.
    let (volume, surface) = (4.0 / 3.0 * PI * (0.25f64.powi(3) + 0.25 * 0.01 / 4.0), 4.0 * PI * (0.0625 + 0.01 / 12.0));
    near(one(soft(0.0, 1000.0), 32).area_m2(), 1000.0 * volume, 2e-3);
    near(one(soft(0.0, 3.0), 32).area_m2(), 3.0 * volume, 2e-3);
    // Of much area the surface's part has normals, which a ball has everywhere: the sum is isotropic all the same.
    let sum = total(&one(soft(0.0, 1000.0), 32));
    sum.projected.iter().for_each(|projected| near(f64::from(*projected), f64::from(0.5 * sum.area), 2e-3));
    let below = one(soft(0.0, 20.0), 32);
    let (cell, voxel) = below.voxels.iter().find(|(cell, _)| cell[0] == 16 && cell[1] == 12).unwrap();
    let MicroflakeSums { moment, .. } = voxel.all();
    assert!(moment[2] > 2.0 * moment[0], "{cell:?} {voxel:?}");
    // Noise moves the rim and keeps the sum, roughly; and it is there.
    let noisy = one(soft(0.05, 1000.0), 32);
    near(noisy.area_m2(), 1000.0 * volume, 0.1);
    assert!(noisy.voxels != one(soft(0.0, 1000.0), 32).voxels);
    assert!(surface > 0.0);
}

#[test]
fn a_scanned_volume_is_read_from_numbers_and_slices_alike() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.shapes.toml");
    // A ramp along z: 0, 50, 100, 150, 200 of 200.
    let bytes: Vec<u8> = (0..5u8).flat_map(|z| vec![50 * z; 12]).collect();
    std::fs::write(folder.path().join("ramp.raw"), [&[7u8; 3][..], &bytes].concat()).unwrap();
    let slices = folder.path().join("slices");
    std::fs::create_dir(&slices).unwrap();
    for z in 0..5u8 {
        image::GrayImage::from_pixel(4, 3, image::Luma([50 * z])).save(slices.join(format!("{z}.png"))).unwrap();
    }
    let shape = |data| Shape::Density {
        data,
        least_m: [0.1, 0.1, -0.4],
        most_m: [0.9, 0.7, 0.4],
        range: [0.0, 200.0],
        area_per_m3: 100.0,
    };
    let raw =
        |header_bytes, number| DensityData::Raw { file: "ramp.raw".into(), cells: [4, 3, 5], number, header_bytes };
    let read = |data| {
        let script = script(false, vec![(PaintMode::Add, shape(data))]);
        let coats: Vec<Coat> = script.materials.iter().map(|material| colour_of(material).into()).collect();
        paint(&script, 32, &Paints { script: &path, coats: &coats })
    };
    let canvas = read(raw(3, NumberType::U8)).unwrap();
    assert_eq!(canvas.voxels, read(DensityData::Slices { folder: "slices".into() }).unwrap().voxels);
    // The mean of the ramp is one half.
    near(canvas.area_m2(), 100.0 * 0.5 * 0.8 * 0.6 * 0.8, 2e-3);
    // Between the outermost middles it rises by 1.5625 per metre, so that much area looks up.
    let voxel = canvas.voxels[&[16, 12, 16]].all();
    let upwards = f64::from(voxel.moment[2] - voxel.moment[0]) * 32f64.powi(3);
    near(upwards, 1.5625, 1e-3);
    for (data, part) in [
        (raw(4, NumberType::U8), "has 63 bytes, not 4 and then 60"),
        (raw(3, NumberType::F32le), "not 3 and then 240"),
        (DensityData::Slices { folder: "nothing".into() }, "nothing"),
    ] {
        let message = read(data).unwrap_err().to_string();
        assert!(message.contains(part) && !message.contains('\n'), "{message}");
    }
    std::fs::write(slices.join("9.png"), b"none").unwrap();
    let message = read(DensityData::Slices { folder: "slices".into() }).unwrap_err().to_string();
    assert!(message.contains("9.png is no picture"), "{message}");
}

#[test]
fn tints_colour_microflakes_where_they_lie() {
    let mut script =
        script(false, vec![(PaintMode::Add, Shape::Box { least_m: [0.1, 0.1, -0.3], most_m: [0.9, 0.6, 0.3] })]);
    script.materials[0].tint =
        Some(Tint::Checker { box_m: [0.5, 2.0, 2.0], colours: [[1.0, 0.0, 0.5], [0.0, 1.0, 0.5]] });
    let canvas = painted(&script, 32);
    for (cell, sums) in &canvas.voxels {
        let west = cell[0] < 16;
        let sums = sums.all();
        let share = |k: usize| f64::from(sums.reflected[k] / sums.area);
        // z is negative in half of them, which takes turns, too.
        let first = west == (cell[2] >= 16);
        near(share(2), 0.5 * GREY[2], 1e-4);
        assert!((share(0) - if first { GREY[0] } else { 0.0 }).abs() < 1e-4, "{cell:?}");
        assert!((share(1) - if first { 0.0 } else { GREY[1] }).abs() < 1e-4);
    }
}
