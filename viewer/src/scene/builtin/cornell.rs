//! The Cornell box with two spheres, every surface for an asset, seen so that it fills the picture.

use crate::scene::mesh::{self, MeshPart};
use glam::{Mat4, Vec3};

/// Parts: left and right sphere, group 0; floor, back wall and the others, groups 1, 2 and 3. The box is 2 wide.
pub(crate) fn cornell() -> Vec<MeshPart> {
    let wall = |name: &str, group, corner: [f32; 3], u: Vec3, v: Vec3| MeshPart {
        group,
        ..mesh::quad(name, corner.into(), u * 2.0, v * 2.0)
    };
    let ball = |name: &str, radius: f32, centre: Vec3| {
        let mut ball = MeshPart { name: name.into(), ..mesh::sphere() };
        ball.transform(Mat4::from_translation(centre) * Mat4::from_scale(Vec3::splat(radius)));
        ball
    };
    vec![
        ball("left sphere", 0.42, Vec3::new(-0.46, -0.58, -0.3)),
        ball("right sphere", 0.36, Vec3::new(0.45, -0.64, 0.25)),
        wall("floor", 1, [-1.0, -1.0, 1.0], Vec3::X, Vec3::NEG_Z),
        wall("back wall", 2, [-1.0, -1.0, -1.0], Vec3::X, Vec3::Y),
        wall("left wall", 3, [-1.0, -1.0, 1.0], Vec3::NEG_Z, Vec3::Y),
        wall("right wall", 3, [1.0, -1.0, -1.0], Vec3::Z, Vec3::Y),
        wall("ceiling", 3, [-1.0, 1.0, -1.0], Vec3::X, Vec3::Z),
    ]
}
