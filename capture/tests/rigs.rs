//! Captures of rigs of one's own, with the examples of docs/guide/captures.md: exposures, poses, calibration images, masks.

use btf_capture::{Capture, CaptureError, ImageFormat, Pixels, Transfer};
use image::{Rgb, RgbImage};
use std::path::Path;

const WIDTH: u32 = 6;
const HEIGHT: u32 = 4;

/// Returns the fenced blocks of `language` in the guide that hold `word`.
fn example(language: &str, word: &str) -> String {
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/guide/captures.md");
    let text = std::fs::read_to_string(guide).unwrap();
    let fence = format!("```{language}\n");
    let block = text.split(&fence).skip(1).map(|rest| rest.split("```").next().unwrap()).find(|b| b.contains(word));
    block.unwrap_or_else(|| panic!("the guide has no {language} with {word}")).to_string()
}

/// Writes a picture whose linear values are `value(column, row)`, with the sRGB curve, cut at 1.
fn write(path: &Path, value: impl Fn(u32, u32) -> [f32; 3]) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let code = |x: f32| (255.0 * Transfer::Srgb.encoded_from_linear(x.clamp(0.0, 1.0))).round() as u8;
    RgbImage::from_fn(WIDTH, HEIGHT, |column, row| Rgb(value(column, row).map(code))).save(path).unwrap();
}

fn linear(capture: &Capture, view: usize, light: usize) -> Vec<f32> {
    match capture.read(view, light).unwrap() {
        Pixels::Linear(values) => values,
        other => panic!("not linear: {other:?}"),
    }
}

fn refused(folder: &Path) -> String {
    Capture::open(folder).unwrap_err().to_string()
}

#[test]
fn exposures_of_a_pair_become_one_linear_image() {
    let folder = tempfile::tempdir().unwrap();
    let list = example("csv", "exposure");
    std::fs::write(folder.path().join("list.csv"), &list).unwrap();
    // 1 to 24: the long exposure saturates from 10 on.
    let light = |column: u32, row: u32| [(1 + column + WIDTH * row) as f32, 2.0, 5.0];
    for (name, exposure) in [("short", 0.01), ("long", 0.1), ("other", 0.1), ("third", 0.1)] {
        let path = folder.path().join("hdr").join(format!("{name}.png"));
        write(&path, |column, row| light(column, row).map(|x| x * exposure));
    }
    let capture = Capture::open(folder.path()).unwrap();
    let info = capture.info();
    assert_eq!((info.pair_count(), info.format, info.transfer), (3, ImageFormat::Exr, Transfer::Linear));
    let merged = linear(&capture, 0, 0);
    for (texel, rgb) in merged.chunks_exact(3).enumerate() {
        let wanted = light(texel as u32 % WIDTH, texel as u32 / WIDTH);
        assert!(rgb.iter().zip(wanted).all(|(x, y)| (x - y).abs() < 0.04 * y), "{rgb:?} {wanted:?}");
    }
    // Planted: one exposure alone is cut at 10.
    assert!(linear(&capture, 0, 1).iter().all(|x| *x < 10.1));

    for (wrong, words) in [("0.01", "-1"), ("0.01", "0.1"), ("0.01", "x")].map(|(a, b)| (list.replacen(a, b, 1), b)) {
        std::fs::write(folder.path().join("list.csv"), wrong).unwrap();
        let sentence = refused(folder.path());
        let told = if words == "0.1" { "short.png" } else { "exposure" };
        assert!(sentence.contains(told), "{sentence}");
    }
}

#[test]
fn a_pose_counts_as_its_place_and_what_is_no_pose_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let list = folder.path().join("poses.csv");
    let text = example("csv", "track/");
    (1..=2).for_each(|i| write(&folder.path().join(format!("track/000{i}.png")), |_, _| [0.2; 3]));
    std::fs::write(&list, &text).unwrap();
    let capture = Capture::open(folder.path()).unwrap();
    let angles: Vec<[f64; 2]> =
        capture.info().lights.directions().iter().map(|light| [light.theta_deg, light.phi_deg]).collect();
    // atan2 of the distance from the normal and the height, and of y and x.
    assert_eq!(angles, [[2.561, 26.565], [36.657, 352.648]]);
    // A row that is shorter than the others, one that is turned round, and what is no number.
    for (from, to) in [("0,   -0.8, 0.6,", "0, -0.8, 0,"), ("0,   0.6, 0.8, ", "0, -0.6, -0.8,"), ("310", "far")] {
        let wrong = text.replace(from, to);
        assert_ne!(wrong, text);
        std::fs::write(&list, wrong).unwrap();
        let sentence = refused(folder.path());
        let told = if to == "far" { "`l14` is `far`" } else { "`l11` to `l34` are no pose" };
        assert!(sentence.contains(told) && sentence.contains("line 3") && !sentence.contains('\n'), "{sentence}");
    }
    // A direction by two kinds of columns.
    std::fs::write(&list, text.replace("phi_v,", "phi_v, x_l, y_l, z_l,")).unwrap();
    assert!(Capture::open(&list).unwrap_err().to_string().contains("both `x_l` and `l11`"));
    // The camera's pose, upright; without a column the file is no list.
    let upright = "1,0,0,0, 0,1,0,0, 0,0,1,700";
    let names = "v11,v12,v13,v14,v21,v22,v23,v24,v31,v32,v33,v34";
    std::fs::write(&list, format!("file,{names},theta_l,phi_l\ntrack/0001.png,{upright},30,90\n")).unwrap();
    let capture = Capture::open(folder.path()).unwrap();
    assert_eq!((capture.info().views.directions()[0].theta_deg, capture.info().lights.len()), (0.0, 1));
    std::fs::write(&list, format!("file,{},theta_l,phi_l\n", names.replace(",v34", ""))).unwrap();
    assert!(Capture::open(&list).unwrap_err().to_string().contains("no column `v34`"));
}

#[test]
fn poses_of_a_flash_count_as_the_nearest_lights() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("flashes.csv"), example("csv", "flash/")).unwrap();
    let manifest = folder.path().join("capture.toml");
    let toml = example("toml", "views = ");
    std::fs::write(&manifest, &toml).unwrap();
    for number in 1..=4 {
        write(&folder.path().join(format!("flash/000{number}.png")), |_, _| [0.1 * number as f32; 3]);
    }
    let capture = Capture::open(folder.path()).unwrap();
    let snapped = capture.snapped().unwrap();
    assert!(snapped.left_out == 0 && (1.0..12.0).contains(&snapped.largest_deg), "{snapped:?}");
    let angles: Vec<f64> = capture.info().lights.directions().iter().map(|light| light.theta_deg).collect();
    assert_eq!((capture.info().views.len(), angles), (1, vec![0.0, 30.0, 45.0, 45.0]));

    // Two flashes at one light: the nearer stays. A missing pair of two views.
    let list = example("csv", "flash/");
    let nearer = list.replace("310,   -40,   420", "0,     0,     500");
    std::fs::write(folder.path().join("flashes.csv"), nearer).unwrap();
    let capture = Capture::open(folder.path()).unwrap();
    assert_eq!((capture.snapped().unwrap().left_out, capture.info().lights.len()), (1, 3));
    assert!(capture.path_of(0, 0).ends_with("0002.png"), "{}", capture.path_of(0, 0));
    // Two poses are no two exposures of one: the farther one is left out, whatever its exposure.
    let exposed: String = list
        .replace("310,   -40,   420", "0,     0,     500")
        .lines()
        .enumerate()
        .map(|(i, line)| format!("{line}, {}\n", if i == 0 { "exposure".into() } else { i.to_string() }))
        .collect();
    std::fs::write(folder.path().join("flashes.csv"), exposed).unwrap();
    let capture = Capture::open(folder.path()).unwrap();
    assert_eq!(capture.snapped().unwrap().left_out, 1);
    let light = linear(&capture, 0, 0)[0];
    assert!((light - 0.2 / 2.0).abs() < 0.003, "{light}");
    // Poses that share no view and no light make no grid.
    (0..300).for_each(|i| write(&folder.path().join(format!("flash/{i}.png")), |_, _| [0.5; 3]));
    std::fs::write(&manifest, "incomplete = true").unwrap();
    let distinct: String = (0..300).map(|i| format!("flash/{i}.png, {0}, 0, {0}, 0\n", 0.2 * f64::from(i))).collect();
    std::fs::write(folder.path().join("flashes.csv"), format!("file, theta_v, phi_v, theta_l, phi_l\n{distinct}"))
        .unwrap();
    assert!(refused(folder.path()).contains("views = \"bonn81\""));
    std::fs::write(&manifest, &toml).unwrap();

    std::fs::write(folder.path().join("flashes.csv"), list.replace("3,   0,   600", "300, 0,   400")).unwrap();
    std::fs::write(&manifest, toml.replace("[[0, 0]]", "[[0, 0], [30, 0]]")).unwrap();
    let capture = Capture::open(folder.path()).unwrap();
    assert_eq!((capture.info().pair_count(), capture.info().missing.len()), (8, 4));
    std::fs::write(&manifest, "views = [[0, 0], [30, 0]]").unwrap();
    assert!(refused(folder.path()).contains("incomplete = true"));
    for (text, told) in
        [("lights = \"moon\"", "lights must be"), ("views = [[0, 0], [0, 0]]", "twice"), ("views = 3", "views")]
    {
        std::fs::write(&manifest, text).unwrap();
        assert!(refused(folder.path()).contains(told), "{}", refused(folder.path()));
    }
    std::fs::write(&manifest, &toml).unwrap();
    std::fs::write(folder.path().join("flashes.csv"), list.replace("20,    10,    500", "0, 0, 0")).unwrap();
    assert!(refused(folder.path()).contains("no direction"));
}

#[test]
fn photographs_aslant_are_rectified_by_the_maps_of_the_list() {
    let folder = tempfile::tempdir().unwrap();
    let (list, toml) = (example("csv", "h11"), example("toml", "rectified"));
    let manifest = folder.path().join("capture.toml");
    std::fs::write(folder.path().join("list.csv"), &list).unwrap();
    std::fs::write(&manifest, &toml).unwrap();
    // A sample of 32 x 32 texels that fades along both sides, photographed as the list's maps have it.
    let sample = |x: f64, y: f64| [0.1 + 0.02 * x, 0.1 + 0.015 * y, 0.3].map(|v| v.clamp(0.0, 1.0) as f32);
    for line in list.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        let h: Vec<f64> = fields[5..14].iter().map(|field| field.parse().unwrap()).collect();
        let picture = RgbImage::from_fn(160, 120, |u, v| {
            // The place whose map is nearest to the pixel's middle, by Newton's steps on the map's two lines.
            let (u, v) = (f64::from(u) + 0.5, f64::from(v) + 0.5);
            let rows = [0, 1].map(|i| {
                let t = [u, v][i];
                [h[3 * i] - t * h[6], h[3 * i + 1] - t * h[7], t * h[8] - h[3 * i + 2]]
            });
            let area = rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0];
            let x = (rows[0][2] * rows[1][1] - rows[0][1] * rows[1][2]) / area;
            let y = (rows[0][0] * rows[1][2] - rows[0][2] * rows[1][0]) / area;
            let code = |x: f32| (255.0 * Transfer::Srgb.encoded_from_linear(x)).round() as u8;
            Rgb(sample(x, y).map(code))
        });
        let path = folder.path().join(fields[0]);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        picture.save(path).unwrap();
    }
    let capture = Capture::open(folder.path()).unwrap();
    assert_eq!((capture.info().width, capture.info().height, capture.info().pair_count()), (32, 32, 2));
    for light in 0..2 {
        for (texel, rgb) in linear(&capture, 0, light).chunks_exact(3).enumerate() {
            let wanted = sample((texel % 32) as f64 + 0.5, (texel / 32) as f64 + 0.5);
            assert!(rgb.iter().zip(wanted).all(|(x, y)| (x - y).abs() < 0.015), "{texel}: {rgb:?} {wanted:?}");
        }
    }
    std::fs::write(&manifest, "").unwrap();
    assert!(refused(folder.path()).contains("rectified = [columns, rows]"));
    for text in ["rectified = [0, 4]", "rectified = [4]"] {
        std::fs::write(&manifest, text).unwrap();
        assert!(refused(folder.path()).contains("two whole numbers"));
    }
    std::fs::write(&manifest, "rectified = [320, 32]").unwrap();
    assert!(refused(folder.path()).contains("leads out of the picture"));
}

#[test]
fn black_level_flat_field_mask_and_rows_are_applied() {
    let folder = tempfile::tempdir().unwrap();
    let name = "00000 tl000 pl000 tv000 pv000.png";
    let manifest = folder.path().join("capture.toml");
    let toml = example("toml", "flat = ");
    std::fs::write(&manifest, &toml).unwrap();
    let fall_off = |column: u32| 1.0 - 0.1 * column as f32;
    let reflectance = |column: u32, row: u32| 0.1 + 0.1 * row as f32 + 0.05 * column as f32;
    let seen = |column, row| [0.02 + 0.8 * fall_off(column) * reflectance(column, row); 3];
    write(&folder.path().join(name), seen);
    let calibration = folder.path().join("calibration");
    write(&calibration.join("black.png"), |_, _| [0.02; 3]);
    write(&calibration.join("flat.png"), |column, _| [0.02 + 0.8 * fall_off(column); 3]);
    write(&calibration.join("mask.png"), |column, row| [if (column, row) == (2, 1) { 0.0 } else { 1.0 }; 3]);
    let capture = Capture::open(folder.path()).unwrap();
    let values = linear(&capture, 0, 0);
    for (texel, rgb) in values.chunks_exact(3).enumerate() {
        // The files' first row is the lowest, so the last one here.
        let (column, row) = (texel as u32 % WIDTH, HEIGHT - 1 - texel as u32 / WIDTH);
        let wanted = 0.8 * reflectance(column, row);
        let near = (rgb[0] - wanted).abs() < 0.03 * wanted + 0.004;
        // The masked texel shows a neighbour.
        assert_eq!(near, (column, row) != (2, 1), "{column} {row}: {rgb:?} {wanted}");
    }

    let refuse = |text: &str, told: &str| {
        std::fs::write(&manifest, text).unwrap();
        let sentence = refused(folder.path());
        assert!(sentence.contains(told), "{sentence}");
    };
    refuse("rows = \"left\"", "\"down\" or \"up\"");
    refuse("flat = \"nothing.png\"", "nothing.png");
    refuse("flat = \"../flat.png\"", "flat");
    refuse("saturation = 0", "saturation");
    refuse("flat = \"calibration/black.png\"\nblack = \"calibration/flat.png\"", "the flat field is dark");
    write(&calibration.join("mask.png"), |_, _| [0.0; 3]);
    refuse("mask = \"calibration/mask.png\"", "leaves no texel");
    RgbImage::new(2, 2).save(calibration.join("mask.png")).unwrap();
    std::fs::write(&manifest, "mask = \"calibration/mask.png\"").unwrap();
    assert!(matches!(Capture::open(folder.path()).unwrap_err(), CaptureError::WrongSize { .. }));
    // Without corrections 8-bit values stay.
    std::fs::write(&manifest, "rows = \"up\"").unwrap();
    let plain = Capture::open(folder.path()).unwrap();
    let Pixels::Encoded8(codes) = plain.read(0, 0).unwrap() else { panic!("8 bits") };
    let lowest = image::open(folder.path().join(name)).unwrap().to_rgb8();
    assert_eq!(codes[..3 * WIDTH as usize], lowest.into_raw()[(HEIGHT - 1) as usize * 3 * WIDTH as usize..]);
}
