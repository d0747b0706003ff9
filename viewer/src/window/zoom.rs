//! The wheel: it brings the eye nearer to what is under the mouse, and never through it.

use crate::cpu::pick::pick_surface;
use crate::scene::camera::Camera;
use crate::scene::scene::Scene;

/// Least distance of the eye from a target in mid-air, in the scene's radii.
const NEAREST_TARGET_RADII: f32 = 1e-3;

/// Multiplies the distance of the eye from what is seen at `pixel`, pixels from the top left corner of a picture of this
/// size, by `factor`; that stays under the mouse. Where no surface is seen there the eye moves along the viewing
/// direction: to the surface in the picture's middle, or to the target where that is nearer. The way is one along which
/// the eye sees its end, so that it never leads through a surface; [`SurfacePoint::nearest`] is where it ends.
///
/// [`SurfacePoint::nearest`]: crate::cpu::pick::SurfacePoint::nearest
pub(super) fn zoom(scene: &mut Scene, size: [u32; 2], pixel: [f32; 2], factor: f32) {
    let Camera { eye, target, .. } = scene.camera;
    let in_the_middle = || {
        let seen = pick_surface(scene, size, size.map(|side| 0.5 * side as f32));
        seen.filter(|seen| eye.distance(seen.position) < eye.distance(target))
    };
    let (point, nearest) = match pick_surface(scene, size, pixel).or_else(in_the_middle) {
        Some(seen) => (seen.position, seen.nearest),
        None => (target, NEAREST_TARGET_RADII * scene.geometry.bounding_sphere().1),
    };
    scene.camera.zoom_about(point, factor, nearest);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::shader::FAR;
    use crate::geometry::bvh::{AnyHit, NO_HIT};
    use crate::geometry::lod_transition::LodTransition;
    use crate::scene::asset::SceneAsset;
    use crate::scene::scene::MeshChoice;
    use glam::Vec3;
    use std::sync::Arc;

    const SIZE: [u32; 2] = [160, 120];
    /// What a click of a mouse wheel multiplies the distance by, about.
    const CLICK: f32 = 0.86;

    fn shoe() -> Scene {
        Scene::built_in(&MeshChoice::Shoe, vec![Arc::new(SceneAsset::built_in())], [1.0; 2]).unwrap()
    }

    /// Tells whether a straight way leads through a surface.
    fn leads_through(scene: &Scene, from: Vec3, to: Vec3) -> bool {
        let way = to - from;
        let hit = scene.geometry.trace_with_lod(from, way.normalize(), FAR, AnyHit::No, &LodTransition::MESHES);
        hit.primitive != NO_HIT && hit.t < way.length()
    }

    #[test]
    fn a_hundred_clicks_lead_to_the_shoe_and_never_into_it() {
        let shoe = shoe();
        let mut seen = 0;
        // In the middle, off it, at the silhouette and beside the shoe.
        for pixel in [[80.0, 60.0], [60.0, 70.5], [100.0, 66.0], [3.0, 3.0], [157.0, 60.0]] {
            let mut scene = shoe.clone();
            let Some(start) = pick_surface(&scene, SIZE, pixel) else {
                for _ in 0..100 {
                    let before = scene.camera.eye;
                    zoom(&mut scene, SIZE, pixel, CLICK);
                    assert!(!leads_through(&scene, before, scene.camera.eye), "{pixel:?}");
                }
                assert_eq!(scene.camera.fault(), None);
                continue;
            };
            seen += 1;
            for click in 1..=100 {
                let before = scene.camera.eye;
                zoom(&mut scene, SIZE, pixel, CLICK);
                let eye = scene.camera.eye;
                assert!(before == eye || !leads_through(&scene, before, eye), "{pixel:?}, click {click}");
                let now = pick_surface(&scene, SIZE, pixel).unwrap();
                let off = now.position.distance(start.position) / now.position.distance(eye);
                assert!(off < 0.02, "{pixel:?}, click {click}: off by {off} of the distance");
            }
            let distance = scene.camera.eye.distance(start.position);
            assert!((0.99..1.1).contains(&(distance / start.nearest)), "{pixel:?}: {distance} of {}", start.nearest);
            // A few texels, which are tenths of a millimetre.
            assert!((0.05e-3..2e-3).contains(&distance), "{distance} m");
        }
        assert!(seen >= 2, "{seen} of the places show the shoe");
    }

    #[test]
    fn going_to_the_target_as_before_would_lead_into_the_shoe() {
        let mut scene = shoe();
        let before = scene.camera.eye;
        let mut passed = 0;
        for _ in 0..12 {
            let eye = scene.camera.eye;
            let target = scene.camera.target;
            scene.camera.zoom_about(target, 0.7, 0.0);
            passed += usize::from(leads_through(&scene, eye, scene.camera.eye));
        }
        assert!(passed > 0 && leads_through(&scene, before, scene.camera.eye));
    }
}
