use super::volume::tests::folder_with_volume;
use super::*;
use crate::scene::asset::SceneAsset;
use crate::volume::volumes::Volumes;
use glam::Vec3;

fn load(text: &str) -> Result<Scene, ViewerError> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.toml");
    std::fs::write(&path, text).unwrap();
    load_scene(&path, Vec::new())
}

const GREY: &str = "[[material]]\nname = \"grey\"\ndiffuse = [0.5, 0.5, 0.5]\n";
const DAY: &str = "[daylight]\ndate_time = \"2026-06-21T12:00+02:00\"\nplace = \"52.5,13.4\"\n";

#[test]
fn a_physical_material_has_its_size_on_any_mesh() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.toml");
    let asset = btf_runtime::testing::sample_asset(1, 4, 2, btf_runtime::ResidualKind::Root);
    let mut asset = SceneAsset::new("sample", asset);
    asset.size_mm = Some([20.0, 10.0]);
    let assets = vec![Arc::new(asset)];
    let text = |unit: &str| {
        format!(
            "{unit}[[material]]\nname = \"m\"\nasset = 0\nphysical = true\n\
             [[object]]\nmesh = \"plane\"\nmaterial = \"m\"\nscale = [3, 3, 3]\n"
        )
    };
    std::fs::write(&path, text("unit_mm = 10\n")).unwrap();
    let scene = load_scene(&path, assets.clone()).unwrap();
    // A plane of 60 x 60 mm.
    let vertices = scene.geometry.vertices();
    let most = |of: fn(&crate::Vertex) -> f32| vertices.iter().map(of).fold(0f32, f32::max);
    assert!((most(|v| v.u) - 3.0).abs() < 1e-5 && (most(|v| v.v) - 6.0).abs() < 1e-5);
    std::fs::write(&path, text("")).unwrap();
    assert!(load_scene(&path, assets).unwrap_err().to_string().contains("unit_mm"));
}

#[test]
fn reads_objects_lights_and_camera() {
    let scene = load(&format!(
        "exposure_ev = 1.0\n[camera]\neye = [0, 0, 9]\ntarget = [0, 0, 0]\n{GREY}\
         [[object]]\nmesh = \"plane\"\nmaterial = \"grey\"\ntranslate = [0, 2, 0]\nrotate_deg = [0, 90, 0]\n\
         [[light]]\nposition = [1, 2, 3]\nintensity = [4, 5, 6]\n"
    ))
    .unwrap();
    assert_eq!((scene.lights.len(), scene.exposure_ev, scene.camera.eye.z), (1, 1.0, 9.0));
    // Turned by 90 degrees about y, +z becomes +x.
    assert!(scene.geometry.vertices()[0].normal[0] > 0.999);
    assert!((scene.geometry.bounding_sphere().0.y - 2.0).abs() < 1e-6);
}

#[test]
fn a_wind_moves_skins_with_time_and_is_checked() {
    let dir = folder_with_volume();
    let path = dir.path().join("s.toml");
    let skin = "[[object]]\nmesh = \"plane\"\n[[skin]]\npatches = [4, 3]\nheight = 0.5\nvolumes = [\"v.voltex\"]\n";
    let loaded = |text: &str| {
        std::fs::write(&path, text).unwrap();
        load_scene(&path, Vec::new())
    };
    let mut scene =
        loaded(&format!("{skin}[wind]\nspeed = 8.0\ndirection = [0, 0, 1]\ngust_wavelength = 3\n")).unwrap();
    let wind = scene.wind.unwrap();
    assert_eq!((wind.speed_m_per_s, wind.direction, wind.gust_wavelength_m), (8.0, Vec3::Z, 3.0));
    assert_eq!(wind.leaning_speed_m_per_s, Wind::default().leaning_speed_m_per_s);
    let south = |scene: &Scene| {
        scene.volumes.as_ref().unwrap().skins()[0].shell().positions().iter().map(|at| at.z).sum::<f32>()
    };
    let at_rest = south(&loaded(skin).unwrap());
    let first = south(&scene);
    scene.blow(0.2).unwrap();
    assert!(first > at_rest + 1.0 && south(&scene) != first);
    scene.blow(0.0).unwrap();
    assert_eq!(south(&scene), first);
    for (bad, reason) in [
        (format!("{skin}[wind]\nspeed = 80\n"), "the wind's speed is 80"),
        (format!("{skin}[wind]\ndirection = [0, 0, 0]\n"), "must blow somewhere"),
        (format!("{skin}[wind]\nlean = 3\n"), "unknown field `lean`"),
        ("[[object]]\nmesh = \"plane\"\n[wind]\n".to_string(), "add a [[skin]]"),
    ] {
        let message = loaded(&bad).unwrap_err().to_string();
        assert!(message.contains(reason) && message.contains("s.toml: ") && !message.contains('\n'), "{message}");
    }
    // Written for another folder, the skin finds its volume.
    let merged = skin.replace("[\"v.voltex\"]", "[[\"v.voltex\", \"v.voltex\"], \"v.voltex\"]");
    loaded(&merged).unwrap();
    let out = dir.path().join("out");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("s.toml"), scene_with_assets(&path, &[], &[], &out).unwrap()).unwrap();
    assert!(load_scene(&out.join("s.toml"), Vec::new()).is_ok());
}

#[test]
fn tints_of_a_skin_are_alternatives_with_other_colours() {
    let dir = folder_with_volume();
    let path = dir.path().join("s.toml");
    let loaded = |tints: &str| {
        let skin =
            format!("patches = [4, 3]\nheight = 0.5\nvolumes = [\"v.voltex\", [\"v.voltex\", \"w.voltex\"]]\n{tints}");
        std::fs::copy(dir.path().join("v.voltex"), dir.path().join("w.voltex")).unwrap();
        std::fs::write(&path, format!("[[object]]\nmesh = \"plane\"\n[[skin]]\n{skin}")).unwrap();
        load_scene(&path, Vec::new())
    };
    let volumes = |tints| loaded(tints).unwrap().volumes.unwrap();
    let [plain, tinted] = ["", "tints = [[1, 1, 1], [0.5, 0.25, 0]]\n"].map(volumes);
    assert_eq!([plain.volume_count(), tinted.volume_count()], [2, 4]);
    let numbers = |volumes: &Volumes| {
        volumes.skins()[0].patterns[0].alternatives.iter().map(|merged| [merged[0], merged[1]]).collect::<Vec<_>>()
    };
    let none = crate::volume::skin::NO_VOLUME;
    assert_eq!(numbers(&plain), [[0, none], [0, 1]]);
    assert_eq!(numbers(&tinted), [[0, none], [1, none], [0, 2], [1, 3]]);
    let [own, other] = [0, 1].map(|number| tinted.volume(number).material(0));
    for (channel, factor) in [0.5, 0.25, 0.0].into_iter().enumerate() {
        assert!((other.reflectance[channel] - factor * own.reflectance[channel]).abs() < 1e-3);
        assert!((other.transmittance[channel] - factor * own.transmittance[channel]).abs() < 1e-3);
    }
    assert_eq!(own, plain.volume(0).material(0));
    for bad in ["tints = []\n", "tints = [[1, -1, 1]]\n", "tints = [[1, nan, 1]]\n"] {
        let message = loaded(bad).unwrap_err().to_string();
        assert!(message.contains("tints are factors") && message.contains("s.toml"), "{message}");
    }
}

#[test]
fn wrong_scenes_are_refused_with_a_sentence_that_names_the_file() {
    let object = "[[object]]\nmesh = \"plane\"\n";
    let bad = [
        String::new(),
        "camera = 3".into(),
        format!("{object}colour = 1\n"),
        format!("{object}material = \"leaf\"\n"),
        format!("{GREY}{GREY}{object}"),
        format!("[[material]]\nname = \"a\"\n{object}"),
        format!("[[material]]\nname = \"a\"\nasset = 0\n{object}"),
        format!("{GREY}transmitted = [0.6, 0.2, 0.2]\n{object}"),
        format!("[[material]]\nname = \"a\"\nmirror = [1, 1, 1]\ntransmitted = [0.1, 0.1, 0.1]\n{object}"),
        format!("{GREY}noise = [2.1, 1, 1]\n{object}"),
        format!("{GREY}noise = [1, -0.1, 1]\n{object}"),
        format!("[[material]]\nname = \"a\"\nmirror = [1, 1, 1]\nnoise = [1, 1, 1]\n{object}"),
        format!("[[material]]\nname = \"a\"\ndiffuse = [0.6, 0.6, 0.6]\nnoise = [1, 1, 1.8]\n{object}"),
        format!("unit_mm = 0\n{object}{DAY}air = true\n"),
        format!("{object}scale = [1, 0, 1]\n"),
        format!("{object}parts = {{ lace = \"grey\" }}\n"),
        format!("{object}[camera]\neye = [0, 0, 0]\ntarget = [0, 0, 0]\n"),
        format!("{object}[[light]]\nposition = [nan, 0, 0]\nintensity = [1, 1, 1]\n"),
    ];
    for text in bad {
        let message = load(&text).unwrap_err().to_string();
        assert!(message.contains("scene.toml: ") && !message.contains('\n'), "{message}");
    }
}

#[test]
fn air_is_that_of_the_day_and_ground_is_uneven_where_a_scene_asks_for_it() {
    let object = "[[object]]\nmesh = \"plane\"\nmaterial = \"grey\"\n";
    let [without, in_m, in_km] = [
        format!("{GREY}{object}{DAY}"),
        format!("{GREY}noise = [1.5, 1, 0]\n{object}{DAY}air = true\n"),
        format!("unit_mm = 1e6\n{GREY}{object}{DAY}air = true\n"),
    ]
    .map(|text| load(&text).unwrap());
    assert_eq!((without.air, without.materials[0].noise), ([0.0; 3], None));
    assert_eq!(in_m.materials[0].noise, Some([1.5, 1.0, 0.0]));
    for c in 0..3 {
        assert!(in_m.air[c] > 1e-5 && (in_km.air[c] / in_m.air[c] - 1000.0).abs() < 0.1, "{:?}", in_m.air);
    }
}

#[test]
fn a_scene_is_written_again_with_other_assets_from_another_folder() {
    let dir = tempfile::tempdir().unwrap();
    let text = "[[camera]]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n[[camera]]\neye = [0, 5, 5]\ntarget = [0, 0, 0]\n\
                [[material]]\nname = \"a\"\nasset = \"a.spmm\"\n[[material]]\nname = \"b\"\nasset = 0\n\
                [[object]]\nmesh = \"sphere\"\nmaterial = \"a\"\n[[object]]\nmesh = \"m.obj\"\nmaterial = \"b\"\n";
    let path = dir.path().join("s.toml");
    std::fs::write(&path, text).unwrap();
    std::fs::write(dir.path().join("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
        .unwrap();
    std::fs::write(dir.path().join("a.spmm"), include_bytes!("../builtin/weave.spmm")).unwrap();
    let scene = load_scene(&path, vec![Arc::new(SceneAsset::built_in())]).unwrap();
    assert_eq!((scene.assets.len(), scene.more_cameras.len()), (2, 1));
    let out = dir.path().join("out");
    std::fs::create_dir(&out).unwrap();
    let files = ["x.spmm", "y.spmm"].map(String::from);
    for file in &files {
        std::fs::copy(dir.path().join("a.spmm"), out.join(file)).unwrap();
    }
    let again = scene_with_assets(&path, &scene.assets, &files, &out).unwrap();
    assert!(again.contains("asset = \"y.spmm\"") && again.contains("asset = \"x.spmm\""), "{again}");
    std::fs::write(out.join("scene.toml"), again).unwrap();
    let loaded = load_scene(&out.join("scene.toml"), Vec::new()).unwrap();
    assert_eq!(loaded.geometry.triangles().len(), scene.geometry.triangles().len());
    assert_eq!((loaded.assets.len(), loaded.camera), (2, scene.camera));
}

#[test]
fn a_sun_lights_from_its_direction_and_takes_the_usual_lamp_away() {
    let plane = format!("{GREY}[[object]]\nmesh = \"plane\"\nmaterial = \"grey\"\n");
    let scene = load(&format!("{plane}[sun]\ndirection = [0, 3, 4]\nirradiance = [1, 2, 3]\n")).unwrap();
    let sun = scene.sun.unwrap();
    assert_eq!((sun.direction, sun.irradiance), (Vec3::new(0.0, 0.6, 0.8), [1.0, 2.0, 3.0]));
    assert_eq!(sun.angular_diameter_deg, crate::light::sun::SUN_DIAMETER_DEG);
    assert!(scene.lights.is_empty());
    for (bad, reason) in [
        ("[sun]\ndirection = [0, 0, 0]\nirradiance = [1, 1, 1]\n", "without length"),
        ("[sun]\ndirection = [0, 1, 0]\nirradiance = [1, -1, 1]\n", "irradiance of at least 0"),
        ("[sun]\ndirection = [0, 1, 0]\nirradiance = [1, 1, 1]\nangular_diameter_deg = 91\n", "0 to 90"),
        (
            "[sun]\ndirection = [0, 1, 0]\nirradiance = [1, 1, 1]\n[daylight]\ndate_time = \"2026-06-21T12:00+02:00\"\n\
             place = \"52.5,13.4\"\n",
            "leave one",
        ),
    ] {
        let message = load(&format!("{plane}{bad}")).unwrap_err().to_string();
        assert!(message.contains(reason), "{message}");
    }
}
