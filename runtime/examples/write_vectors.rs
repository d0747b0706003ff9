//! Writes the vectors of version 1, `tests/vectors/v1`: `cargo run -p btf-runtime --example write_vectors`. It refuses
//! to overwrite a vector, because they are frozen.

#[path = "../tests/vectors/line.rs"]
mod line;

use btf_runtime::testing::{Random, sample_asset, sample_heights};
use btf_runtime::{
    Edit, Edits, Interpolation, Layer, Levels, LobeRole, Query, ResidualKind, SurfaceSide, open, pack, serial,
    with_levels,
};
use line::{Line, decoded, folder};
use std::sync::Arc;

fn main() {
    for (name, bytes) in assets() {
        let file = open(Arc::new(bytes.clone()), Levels::AtHand, &serial).unwrap();
        let mut random = Random::new(bytes.len() as u64);
        let mut text = String::new();
        for i in 0..60 {
            let (mut wi, wo) = (random.direction(), random.direction());
            if file.resident.layers() == 2 && i % 2 == 0 {
                wi[2] = -wi[2];
            }
            let mut line = Line {
                interpolation: [Interpolation::Fast, Interpolation::Exact][i % 2],
                level: random.below(file.resident.levels() as usize) as u32,
                query: Query { uv: [random.within(-1.0, 2.0), random.within(-1.0, 2.0)], wi, wo },
                value: [0.0; 3],
            };
            line.value = decoded(&file, &line);
            let told = line.text();
            assert_eq!(Line::parse(told.trim_end()).value, line.value, "numbers come back as they were");
            text += &told;
        }
        for (extension, bytes) in [("spmm", &bytes), ("values", &text.into_bytes())] {
            let path = folder().join(format!("{name}.{extension}"));
            assert!(!path.exists(), "{} is frozen", path.display());
            std::fs::write(path, bytes).unwrap();
        }
    }
}

/// Returns the assets of version 1: each residual kind and role, with and without levels, heights and edits, one and
/// two layers.
fn assets() -> Vec<(&'static str, Vec<u8>)> {
    let plain = |seed, kind| sample_asset(seed, 9, 7, kind);
    let mut guide = plain(101, ResidualKind::Root);
    guide.layers[0].lobe_role = LobeRole::Guide;
    guide.layers[0].heights = Some(sample_heights(5, 63));
    let mut edited = plain(102, ResidualKind::Log);
    edited.edits = Edits {
        list: vec![
            Edit { tint: [0.5, 1.0, 2.0], roughness: 2.0, ..Edit::default() },
            Edit { diffuse: 0.25, specular: 3.0, tilt: [0.2, -0.1], fade: 0.5, ..Edit::default() },
        ],
        texels: (0..63).map(|texel| (texel % 3) as u8).collect(),
    };
    let mut sides = plain(103, ResidualKind::Additive);
    let through =
        Layer { light_side: SurfaceSide::Back, residual: None, ..plain(104, ResidualKind::Root).layers.remove(0) };
    sides.layers.push(through);
    sides.size_mm = None;
    let leveled = with_levels(&guide, &serial);
    let resident = open(Arc::new(pack(&with_levels(&edited, &serial)).unwrap()), Levels::AtHand, &serial).unwrap();
    vec![
        ("additive-two-layers", pack(&sides).unwrap()),
        ("log-edited", pack(&edited).unwrap()),
        ("root-guide-heights-levels", pack(&leveled).unwrap()),
        ("log-edited-levels.resident", resident.pack().unwrap()),
    ]
}
