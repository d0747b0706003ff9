//! A patch of leather: its grids, and its shading at a point.

use rayon::prelude::*;

use crate::error::SynthError;
use crate::leather::finish::{Finish, FinishView};
use crate::leather::grain::Grain;
use crate::leather::params::LeatherParams;
use crate::surface::bounce::Bounce;
use crate::surface::height_field::HeightField;
use crate::surface::rig::{Hit, Material};
use crate::vector::dot;

/// A patch of pebbled leather.
#[derive(Debug, Clone)]
pub struct Leather {
    size: usize,
    face: HeightField,
    /// Per node: factor on the pigment; share of whole finish.
    coat: Vec<[f32; 2]>,
    finish: Finish,
    /// Optical depth of the pigment.
    depth: [f32; 3],
    bounce: Option<Bounce>,
}

/// View-dependent half of the shading at a point.
#[derive(Debug, Clone, Copy)]
pub struct LeatherPoint {
    finish: FinishView,
    /// Share of diffuse light that leaves towards the eye.
    diffuse: [f32; 3],
}

/// Constants of one image.
#[derive(Debug, Clone, Copy)]
pub struct LeatherPair {
    half: [f32; 3],
    fresnel: f32,
}

impl Leather {
    /// Generates the leather, deterministic by seed, on all threads of the current pool.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`].
    ///
    /// Cost: a few microseconds per grid node, of which there are four per texel and some in the margin, and the rays
    /// of the bounce.
    pub fn new(params: &LeatherParams) -> Result<Leather, SynthError> {
        params.check()?;
        let finish = Finish::new(&params.finish)?;
        let grain = Grain::new(params);
        let grid = params.capture.grid(grain.bound_mm());
        let (height_mm, coat) = (0..grid.len())
            .into_par_iter()
            .map(|node| {
                let point = grain.at(grid.position_mm(node % grid.side, node / grid.side));
                (point.height_mm, [point.pigment, point.finish])
            })
            .unzip();
        let mut leather = Leather {
            size: params.capture.size,
            face: HeightField::new(grid, params.capture.size_mm, height_mm),
            coat,
            depth: finish.depth_from_colour(params.colour),
            finish,
            bounce: None,
        };
        if params.bounce {
            let albedo = |position_mm| {
                let [pigment, whole] = grid.corners(grid.cells(position_mm)).sample_all(&leather.coat);
                leather.finish.mean_reflectance(whole, leather.depth.map(|depth| depth * pigment))
            };
            leather.bounce = Some(Bounce::new(&leather.face, albedo));
        }
        Ok(leather)
    }
}

impl Material for Leather {
    type Point = LeatherPoint;
    type Pair = LeatherPair;

    fn size(&self) -> usize {
        self.size
    }

    fn face(&self) -> &HeightField {
        &self.face
    }

    fn point(&self, place: [f32; 2], normal: [f32; 3], wo: [f32; 3]) -> LeatherPoint {
        let [pigment, whole] = self.face.grid.corners(place).sample_all(&self.coat);
        // Interpolated normals may turn from the eye at a silhouette, where the surface itself does not.
        let cos_o = dot(normal, wo).max(1e-3);
        let finish = self.finish.view(cos_o, whole, self.depth.map(|depth| depth * pigment));
        LeatherPoint { diffuse: self.finish.diffuse_reflectance(cos_o, &finish), finish }
    }

    fn pair(&self, wi: [f32; 3], wo: [f32; 3]) -> LeatherPair {
        let sum: [f32; 3] = std::array::from_fn(|k| wi[k] + wo[k]);
        let inverse_length = 1.0 / dot(sum, sum).sqrt();
        let half = sum.map(|c| c * inverse_length);
        LeatherPair { half, fresnel: self.finish.fresnel(dot(wo, half)) }
    }

    #[inline]
    fn shade(&self, pair: &LeatherPair, hit: &Hit<LeatherPoint>, cos_i: f32) -> [f32; 3] {
        self.finish.pi_brdf_cos(pair.fresnel, dot(hit.normal, pair.half), cos_i, &hit.point.finish)
    }

    fn bounce(&self) -> Option<&Bounce> {
        self.bounce.as_ref()
    }

    fn diffuse_reflectance(&self, hit: &Hit<LeatherPoint>) -> [f32; 3] {
        hit.point.diffuse
    }
}
