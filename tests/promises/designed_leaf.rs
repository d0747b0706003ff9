//! A leaf that is designed live is one that btf-synth photographs: what a slider turned goes through a file into a
//! capture.

use btf_capture::{Capture, Direction, DirectionSet, ImageFormat, Pixels};
use btf_models::{LeafDescription, LeafPreset, Species, TextureImages};
use btf_runtime::{LeafMode, ViewedLeaf};
use btf_synth::{AppearanceTextures, CaptureParams, LeafParams, write_leaf_capture};
use btf_viewer::SceneLeaf;
use std::ops::ControlFlow;
use std::path::Path;

const SIZE: usize = 24;

fn directions(angles_deg: [[f64; 2]; 3]) -> DirectionSet {
    DirectionSet::new(angles_deg.map(|[theta, phi]| Direction::new(theta, phi)).to_vec()).unwrap()
}

/// A capture of the leaf that a file describes, as `btf-synth leaf --leaf` makes it.
fn photographed(folder: &Path, file: &Path) -> Capture {
    let leaf = LeafDescription::read(file).unwrap();
    let images = TextureImages::read(leaf.textures_beside(file).unwrap()).unwrap();
    let params = LeafParams::described(&leaf, images);
    let (views, lights) = (
        directions([[0.0, 0.0], [30.0, 70.0], [40.0, 200.0]]),
        directions([[10.0, 30.0], [35.0, 160.0], [45.0, 290.0]]),
    );
    let params = LeafParams {
        capture: CaptureParams { size: SIZE, views, lights, format: ImageFormat::Exr, ..params.capture },
        ..params
    };
    write_leaf_capture(folder, &params, &|_, _| ControlFlow::Continue(())).unwrap();
    Capture::open(folder).unwrap()
}

/// Largest difference of the mean colours of a leaf as it is drawn live and of a capture's images, over the brightest
/// channel of each.
fn largest_difference(leaf: &SceneLeaf, capture: &Capture) -> f32 {
    let info = capture.info();
    let mut largest = 0f32;
    for (view, wo) in info.views.units().into_iter().enumerate() {
        for (light, wi) in info.lights.units().into_iter().enumerate() {
            let Pixels::Linear(pixels) = capture.read(view, light).unwrap() else { panic!("an EXR is linear") };
            let mean = |values: &mut dyn Iterator<Item = [f32; 3]>| {
                let sum = values.fold([0f32; 3], |sum, x| [0, 1, 2].map(|c| sum[c] + x[c]));
                sum.map(|x| x / (SIZE * SIZE) as f32)
            };
            let taken = mean(&mut pixels.chunks_exact(3).map(|x| [x[0], x[1], x[2]]));
            let live = mean(&mut (0..SIZE * SIZE).map(|texel| {
                let uv = [texel % SIZE, texel / SIZE].map(|x| (x as f32 + 0.5) / SIZE as f32);
                ViewedLeaf::new(leaf.leaf.words(), uv, 0, [1.0; 4], wo).light(wi)
            }));
            let brightest = taken.into_iter().fold(0f32, f32::max);
            largest = (0..3).map(|c| (taken[c] - live[c]).abs() / brightest).fold(largest, f32::max);
        }
    }
    largest
}

#[test]
fn a_leaf_designed_live_becomes_a_capture_of_that_leaf() {
    let dir = tempfile::tempdir().unwrap();
    let place = |name: &str| dir.path().join(name);
    std::fs::create_dir(place("grown")).unwrap();
    std::fs::create_dir(place("designed")).unwrap();
    let grown =
        LeafDescription { textures: Some("textures".into()), ..LeafDescription::of(Some(Species::Soybean), None) };
    let params = LeafParams::described(&grown, TextureImages::default());
    let params = LeafParams { capture: CaptureParams { size: SIZE, ..params.capture }, ..params };
    AppearanceTextures::new(&params).unwrap().export(place("grown/textures")).unwrap();
    grown.write(place("grown/leaf.toml")).unwrap();

    // What the panel does: a state by name, a slider, another place to save.
    let mut leaf = SceneLeaf::load(&place("grown/leaf.toml")).unwrap();
    let mut designed = leaf.description.clone();
    designed.contents = LeafPreset::Senescent.contents();
    designed.contents.anthocyanin_ug_per_cm2 = 3.0;
    leaf.describe(designed, LeafMode::NLayers).unwrap();
    leaf.save(&place("designed/leaf.toml")).unwrap();

    let capture = photographed(&place("capture"), &place("designed/leaf.toml"));
    let apart = largest_difference(&leaf, &capture);
    assert!(apart < 0.01, "{apart}");
    // Planted: a little less of one pigment than was saved.
    let mut other = leaf.description.clone();
    other.contents.anthocyanin_ug_per_cm2 = 1.0;
    leaf.describe(other, LeafMode::NLayers).unwrap();
    let planted = largest_difference(&leaf, &capture);
    assert!(planted > 0.05, "{planted}");
}
