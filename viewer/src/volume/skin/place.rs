//! A place in a skin that moves with it.

use super::shell::Shell;
use glam::{Mat3, Mat4, Vec3};

/// A point of the texture, and the tetrahedron that it is in.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TetPoint {
    pub tet: usize,
    pub texture: Vec3,
}

/// The place in a skin of something that stands upright in the texture: it follows its foot and a point above that.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SkinPlace {
    foot: TetPoint,
    above: TetPoint,
    texture_from_object: Mat4,
}

impl SkinPlace {
    /// Returns the place of something whose texture coordinates are known; `above` differs from `foot` in w alone.
    pub(crate) fn new(foot: TetPoint, above: TetPoint, texture_from_object: Mat4) -> SkinPlace {
        SkinPlace { foot, above, texture_from_object }
    }

    /// Returns the place of a part that stands in the object as `object_from_part` says.
    pub(crate) fn with(self, object_from_part: Mat4) -> SkinPlace {
        SkinPlace { texture_from_object: self.texture_from_object * object_from_part, ..self }
    }

    /// Returns where the shell has the object now: an affine map, right at the foot and at the point above, since
    /// tetrahedra one above the other lean differently. Not finite where the texture is flat.
    pub(crate) fn world_from_object(&self, shell: &Shell) -> Mat4 {
        let (foot, mut linear) = in_world(shell, &self.foot);
        let (above, _) = in_world(shell, &self.above);
        linear.z_axis = (above - foot) / (self.above.texture.z - self.foot.texture.z);
        Mat4::from_translation(foot)
            * Mat4::from_mat3(linear)
            * Mat4::from_translation(-self.foot.texture)
            * self.texture_from_object
    }
}

/// Returns where a point of the texture is, and how the world changes with the texture there.
fn in_world(shell: &Shell, point: &TetPoint) -> (Vec3, Mat3) {
    let tet = &shell.tets()[point.tet];
    let edges = |[a, b, c, d]: [Vec3; 4]| Mat3::from_cols(b - a, c - a, d - a);
    let positions = tet.positions.map(|i| shell.positions()[i as usize]);
    let textures = tet.textures.map(|i| shell.textures()[i as usize]);
    let linear = edges(positions) * edges(textures).inverse();
    (positions[0] + linear * (point.texture - textures[0]), linear)
}
