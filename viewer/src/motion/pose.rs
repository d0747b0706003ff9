//! Where the camera, and all that a wind moves, was at another moment.

use crate::geometry::geometry::Geometry;
use crate::scene::camera::Camera;
use crate::scene::scene::Scene;
use crate::volume::skin::Shell;
use crate::volume::volumes::{SkinTet, Volumes};
use glam::{DMat3, DVec3, DVec4, Vec3};

/// Positions and texture coordinates of a skin's shell.
struct ShellPoints {
    positions: Vec<Vec3>,
    textures: Vec<Vec3>,
}

/// The camera and the places of what moves, without anything that stands still.
pub(crate) struct Pose {
    pub camera: Camera,
    /// Of each skin, shell by shell; empty where no wind blows.
    skins: Vec<Vec<ShellPoints>>,
    /// Rows of the map from each instance's space to the world; empty where all instances stand still.
    instances: Vec<[[f32; 4]; 3]>,
}

impl Pose {
    /// Returns the pose of a scene as it is. Cost: a copy of the points of its skins' shells and of the maps of its
    /// instances, if a wind moves them.
    pub(crate) fn of(scene: &Scene) -> Pose {
        let blown = scene.volumes.as_ref().filter(|_| scene.wind.is_some());
        let points =
            |shell: &Shell| ShellPoints { positions: shell.positions().to_vec(), textures: shell.textures().to_vec() };
        let skins = blown.iter().flat_map(|volumes| volumes.skins());
        let skins = skins.map(|skin| skin.levels.iter().map(|level| points(&level.shell)).collect()).collect();
        let has_moving_instances = blown.is_some_and(|volumes| volumes.has_stand_ins());
        let instances = scene.geometry.instances().iter().filter(|_| has_moving_instances);
        Pose { camera: scene.camera, skins, instances: instances.map(|instance| instance.world_from_object).collect() }
    }

    /// Returns where a point of an instance was, given where `geometry` has it.
    pub(crate) fn of_instance(&self, geometry: &Geometry, instance: usize, point: DVec3) -> DVec3 {
        let now = &geometry.instances()[instance];
        let Some(before) = self.instances.get(instance).filter(|before| **before != now.world_from_object) else {
            return point;
        };
        let (linear, shift) = linear_and_shift(&now.world_from_object);
        let (linear_before, shift_before) = linear_and_shift(before);
        or_else(shift_before + linear_before * (linear.inverse() * (point - shift)), point)
    }

    /// Returns where a point of a skin was, given where `volumes` have it: the point of the same tetrahedron with the same
    /// texture coordinates.
    pub(crate) fn of_skin(&self, volumes: &Volumes, within: SkinTet, point: DVec3) -> DVec3 {
        let SkinTet { skin, level, tet } = within;
        let Some(before) = self.skins.get(skin).map(|shells| &shells[level]) else { return point };
        let shell = &volumes.skins()[skin].levels[level].shell;
        let tet = &shell.tets()[tet as usize];
        let corners = |points: &[Vec3], of: &[u32; 4]| of.map(|i| points[i as usize].as_dvec3());
        let mut weights = barycentric(corners(shell.positions(), &tet.positions), point);
        let textures = corners(shell.textures(), &tet.textures);
        let textures_before = corners(&before.textures, &tet.textures);
        // Flutter moves the texture within the tetrahedron.
        if textures != textures_before {
            weights = barycentric(textures_before, mix(textures, weights));
        }
        or_else(mix(corners(&before.positions, &tet.positions), weights), point)
    }
}

/// Returns a point, or `otherwise` where a flat tetrahedron or map leaves none.
fn or_else(point: DVec3, otherwise: DVec3) -> DVec3 {
    if point.is_finite() { point } else { otherwise }
}

/// Returns the weights of a tetrahedron's corners of which a point is the mean; not finite for one without a volume.
fn barycentric([a, b, c, d]: [DVec3; 4], point: DVec3) -> DVec4 {
    let of_others = DMat3::from_cols(b - a, c - a, d - a).inverse() * (point - a);
    DVec4::new(1.0 - of_others.element_sum(), of_others.x, of_others.y, of_others.z)
}

/// Returns the weighted sum of four points.
fn mix(points: [DVec3; 4], weights: DVec4) -> DVec3 {
    points.into_iter().zip(weights.to_array()).map(|(point, weight)| weight * point).sum()
}

/// Returns the two parts of an affine map that is given by its rows.
fn linear_and_shift(rows: &[[f32; 4]; 3]) -> (DMat3, DVec3) {
    let [x, y, z] = rows.map(|row| DVec4::from_array(row.map(f64::from)));
    (DMat3::from_cols(x.truncate(), y.truncate(), z.truncate()).transpose(), DVec3::new(x.w, y.w, z.w))
}
