//! Aerial perspective: what the air between the eye and a place takes away and adds. Air that is the same everywhere adds,
//! over a way so long that nothing passes, the radiance of the sky at the horizon, and over a shorter one the share of it
//! that it takes away [Koschmieder 1924]. Twin: `air.wgsl`.
//!
//! Wrong where: the eye is so high, or looks so far up or down, that the air is much thinner at the other end of the way (its
//! scale height is a kilometre); and in the shadow of mountains, whose air would be darker.

use crate::cpu::path::Path;
use crate::cpu::shader::Shader;
use glam::Vec3;

/// Height over the horizon of the row of the sky's picture that is next to it: half a row of 128, as the sine of an angle.
const HORIZON_SINE: f32 = 0.012_271_5;

/// The constant that the shader has too.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[("HORIZON_SINE", HORIZON_SINE)];

impl Shader<'_> {
    /// Returns the share of light that passes the air of `t` along a path's ray. All passes where there is no air, and on
    /// the ways between surfaces, which are short.
    pub(crate) fn air_passed(&self, path: &Path, t: f32) -> Vec3 {
        if path.scattered || self.scene.air == [0.0; 3] { Vec3::ONE } else { (-Vec3::from(self.scene.air) * t).exp() }
    }

    /// Returns the radiance that the air would have along a ray without an end.
    pub(crate) fn air_radiance(&self, direction: Vec3) -> Vec3 {
        let level = direction.with_y(0.0).normalize_or(Vec3::NEG_Z);
        let cosine = (1.0 - HORIZON_SINE * HORIZON_SINE).sqrt();
        self.scene.environment.as_ref().map_or(Vec3::ZERO, |sky| sky.radiance((level * cosine).with_y(HORIZON_SINE)))
    }
}

#[cfg(test)]
mod tests {
    use crate::cpu::picture::CpuPicture;
    use crate::light::environment::Environment;
    use crate::options::{RenderMode, ShadeOptions};
    use crate::scene::camera::Camera;
    use crate::scene::material::{Material, Shown};
    use crate::scene::mesh::plane;
    use crate::scene::scene::{Scene, SceneMesh, SceneObject};
    use glam::{Mat4, Vec3};
    use std::path::Path;

    /// What the eye sees of a black plane `distance` before it, in a sky of one colour.
    fn black_from(distance: f32, air: [f32; 3], mode: RenderMode) -> [f32; 3] {
        let object = SceneObject { part: plane(), material: Material::plain([0.0; 3]) };
        let mesh = SceneMesh { objects: vec![object], places: vec![Mat4::IDENTITY] };
        let mut scene = Scene::from_meshes(Path::new("plane"), vec![mesh], Shown::default()).unwrap();
        scene.surround(Environment::new(8, 4, &[0.2, 0.4, 0.8].repeat(32)));
        scene.air = air;
        let eye = Vec3::new(0.0, 0.0, distance);
        scene.camera = Camera { eye, target: Vec3::ZERO, up: Vec3::Y, fov_deg: 0.1 };
        let mut picture = CpuPicture::new([1, 1]);
        picture.add_sample(&scene, &ShadeOptions { mode, ..ShadeOptions::default() }, &|| true);
        picture.radiance()[0]
    }

    #[test]
    fn black_far_away_is_the_horizon_and_near_by_a_share_of_it() {
        for mode in [RenderMode::Direct, RenderMode::Path] {
            assert_eq!(black_from(100.0, [0.0; 3], mode), [0.0; 3]);
            let extinction = [0.01, 0.02, 0.03];
            for distance in [50.0f32, 100.0, 2000.0] {
                let seen = black_from(distance, extinction, mode);
                for c in 0..3 {
                    let wanted = [0.2, 0.4, 0.8][c] * (1.0 - (-extinction[c] * distance).exp());
                    assert!((seen[c] / wanted - 1.0).abs() < 1e-3, "{seen:?} {wanted}");
                }
            }
        }
    }
}
