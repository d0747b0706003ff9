//! What a volume hides on a bent skin is what its triangles hide when they are bent with it: sheared, twisted, combed.

use btf_tests::bent_skins::{BENDS, LeavesInCube};
use glam::Vec3;

/// Pixels along each side of a picture.
const PIXELS: usize = 32;
/// What bending may add to the error of what is hidden.
const MORE: f64 = 0.01;

#[test]
fn bent_volumes_hide_what_bent_triangles_hide() {
    let leaves = LeavesInCube::built();
    let errors = BENDS.map(|(name, bend)| (name, leaves.transmittance_error(bend, bend, PIXELS)));
    let flat = errors[0].1;
    assert!(flat < 0.08, "{flat}");
    for (name, error) in errors {
        assert!(error <= flat + MORE, "{name}: {error}, flat {flat}");
    }
    // Planted: combed the other way.
    let combed_back = leaves.transmittance_error(
        BENDS[3].1,
        |at| {
            let [base, height] = BENDS[3].1(at);
            [base, Vec3::new(-height.x, height.y, height.z)]
        },
        PIXELS,
    );
    assert!(combed_back > flat + 2.0 * MORE, "{combed_back}");
}
