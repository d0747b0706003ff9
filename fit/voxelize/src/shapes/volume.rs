//! Building of a volume from a painted canvas.

use btf_runtime::voltex::Volume;
use glam::Vec3;

use super::brush::Coat;
use super::canvas::Canvas;
use crate::build::build::{VoltexParams, fit_to_rays, volume_of};
use crate::build::gather::Gather;
use crate::build::lit::Lit;
use crate::build::sggx_correction::GlossyMicroflake;
use crate::error::VoxelizeError;
use crate::model::microflakes::luminance;
use crate::rays::occluder::Occluder;

impl Lit for Canvas {
    fn surface(&self, triangle: usize) -> ([f32; 2], Vec3) {
        let (colour, [a, b, c]) = (&self.coats[triangle].colour, self.triangles[triangle]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        ([luminance(colour.reflectance), luminance(colour.transmittance)], normal)
    }

    fn light(&self, triangle: usize, eye: Vec3, light: Vec3) -> f32 {
        self.coats[triangle].light(self.surface(triangle).1, eye, light)
    }

    fn glossy_microflakes(&self) -> Vec<GlossyMicroflake> {
        let microflake = |(triangle, coat): (&[Vec3; 3], &Coat)| GlossyMicroflake::of(triangle, 1.0, &coat.colour);
        self.triangles.iter().zip(&self.coats).filter_map(microflake).collect()
    }
}

/// Builds the volume of what has been painted at `params.resolution`. A canvas with fields is not fitted to rays: its
/// densities are given, and rays do not meet them.
///
/// # Errors
/// [`VoxelizeError::Model`] for a canvas on which nothing is.
pub fn build_painted(canvas: &Canvas, params: &VoltexParams) -> Result<Volume, VoxelizeError> {
    if canvas.voxels.is_empty() {
        return Err(VoxelizeError::Model(
            "no shape lies in the script's [space], so there is nothing to make a volume of".into(),
        ));
    }
    let mut volume = volume_of(&Gather::of(canvas.resolution(), canvas.voxels.clone()).levels());
    volume.side_m = canvas.side_m as f32;
    volume.extent = canvas.extent().as_vec3().to_array();
    volume.cyclic = canvas.cyclic();
    if !canvas.has_fields {
        fit_to_rays(&mut volume, &Occluder::new(&canvas.triangles), canvas, params);
    }
    Ok(volume)
}

#[cfg(test)]
mod tests {
    use btf_models::shapes::{Shape, Space};
    use btf_runtime::voltex::{NO_VOXEL, Voltex, VoltexRay, Walk};

    use super::*;
    use crate::build::refit::RefitParams;
    use crate::build::shadow::ShadowParams;
    use crate::shapes::{Brush, CLOSED, Facet, Solid, polygonise};

    /// Nearly.
    const UP: [f32; 3] = [1e-4, 2e-4, 1.0];

    #[test]
    fn a_painted_ball_hides_what_is_behind_it_and_nothing_else() {
        let space = Space { least_m: [0.0; 3], most_m: [2.0, 2.0, 1.5], cyclic: [false, true] };
        let mut canvas = Canvas::new(&space, 16);
        assert!(build_painted(&canvas, &VoltexParams::default()).unwrap_err().to_string().contains("no shape lies"));
        let ball = Solid::of(&Shape::Sphere { centre_m: [1.0, 1.0, 0.7], radius_m: 0.5 }).unwrap();
        let mut facets = Vec::new();
        polygonise(&ball, &canvas, &mut |corners_m| facets.push(corners_m));
        facets.iter().for_each(|&corners_m| canvas.facet(&Facet { corners_m, uvs: None }, CLOSED, &Brush::default()));
        let params = VoltexParams {
            resolution: 16,
            refit: RefitParams { views: 8, passes: 4, ..RefitParams::default() },
            shadow: ShadowParams { views: 1, turns: 1, pixels: 8 },
        };
        let volume = build_painted(&canvas, &params).unwrap();
        assert_eq!((volume.side_m, volume.extent, volume.cyclic), (2.0, [1.0, 1.0, 0.75], [false, true]));
        let voltex = Voltex::new(&volume);
        let through = |x: f32, y: f32| {
            let ray = VoltexRay { origin: [x, y, -1.0], direction: UP };
            let mut walk = Walk::new(ray, 0.0, 4.0, voltex.level_count());
            let mut depth = 0.0;
            while let Some(segment) = walk.next(&voltex, 0) {
                if segment.cell.voxel != NO_VOXEL {
                    depth += voltex.extinction_along(segment.cell.voxel, UP) * (segment.t1 - segment.t0);
                }
            }
            (-depth).exp()
        };
        assert!(
            through(0.51, 0.52) < 0.2 && through(0.6, 0.45) < 0.2,
            "{} {}",
            through(0.51, 0.52),
            through(0.6, 0.45)
        );
        assert!(through(0.2, 0.2) == 1.0);
    }
}
