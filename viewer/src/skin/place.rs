//! A place in a skin that moves with it.

use super::shell::Shell;
use glam::{Mat3, Mat4, Vec3};

/// Where a skin has something: it goes where a tetrahedron goes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SkinPlace {
    tet: usize,
    texture_from_object: Mat4,
}

impl SkinPlace {
    /// Something whose texture coordinates are known, in tetrahedron number `tet`.
    pub(crate) fn new(tet: usize, texture_from_object: Mat4) -> SkinPlace {
        SkinPlace { tet, texture_from_object }
    }

    /// What stands so in it.
    pub(crate) fn with(self, object_from_part: Mat4) -> SkinPlace {
        SkinPlace { texture_from_object: self.texture_from_object * object_from_part, ..self }
    }

    /// Where the shell has it now: the affine map that is right in the tetrahedron. Not finite where the texture is flat there.
    pub(crate) fn world_from_object(&self, shell: &Shell) -> Mat4 {
        let tet = &shell.tets()[self.tet];
        let edges = |[a, b, c, d]: [Vec3; 4]| Mat3::from_cols(b - a, c - a, d - a);
        let positions = tet.positions.map(|i| shell.positions()[i as usize]);
        let textures = tet.textures.map(|i| shell.textures()[i as usize]);
        let linear = edges(positions) * edges(textures).inverse();
        Mat4::from_translation(positions[0])
            * Mat4::from_mat3(linear)
            * Mat4::from_translation(-textures[0])
            * self.texture_from_object
    }
}
