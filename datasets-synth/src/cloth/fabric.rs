//! A patch of cloth: its grids, and its shading at a point.

use rayon::prelude::*;

use crate::cloth::fibre::{Fibre, FibreDirection, FibrePair, FibreView};
use crate::cloth::params::ClothParams;
use crate::cloth::yarn::Yarns;
use crate::error::SynthError;
use crate::surface::bounce::Bounce;
use crate::surface::height_field::HeightField;
use crate::surface::rig::{Hit, Material};
use crate::vector::dot;

/// A patch of woven cloth. Holes between yarns are black: nothing lies behind the cloth.
#[derive(Debug, Clone)]
pub struct Cloth {
    size: usize,
    face: HeightField,
    /// Per node: fibre direction seen from above, x and y; 1 for warp and 0 for weft; factor on the dye; cover.
    yarns: Vec<[f32; 5]>,
    fibre: Fibre,
    /// Optical depth of the dye of weft and warp.
    dye_depth: [[f32; 3]; 2],
    bounce: Option<Bounce>,
}

/// View-dependent half of the shading at a point.
#[derive(Debug, Clone, Copy)]
pub struct ClothPoint {
    tangent: [f32; 3],
    cover: f32,
    fibre: FibreView,
    /// Share of diffuse light that leaves towards the eye.
    diffuse: [f32; 3],
}

/// Constants of one image.
#[derive(Debug, Clone, Copy)]
pub struct ClothPair {
    wi: [f32; 3],
    fibre: FibrePair,
}

impl Cloth {
    /// Weaves the cloth. Deterministic by seed, on all threads of the current pool.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`].
    ///
    /// Cost: a microsecond per grid node, of which there are four per texel and some in the margin,
    /// and the bounce's rays.
    pub fn new(params: &ClothParams) -> Result<Cloth, SynthError> {
        params.check()?;
        let fibre = Fibre::new(&params.fibre)?;
        let yarns = Yarns::new(params);
        let grid = params.capture.grid(yarns.bound_mm());
        let (height_mm, nodes) = (0..grid.len())
            .into_par_iter()
            .map(|node| {
                let point = yarns.at(grid.position_mm(node % grid.side, node / grid.side));
                (point.height_mm, [point.direction[0], point.direction[1], point.warp, point.dye, point.cover])
            })
            .unzip();
        let mut cloth = Cloth {
            size: params.capture.size,
            face: HeightField::new(grid, params.capture.size_mm, height_mm),
            yarns: nodes,
            dye_depth: [params.weft_colour, params.warp_colour].map(|colour| fibre.depth_from_albedo(colour)),
            fibre,
            bounce: None,
        };
        if params.bounce {
            let albedo = |position_mm| {
                let [_, _, warp, dye, cover] = grid.corners(grid.cells(position_mm)).sample_all(&cloth.yarns);
                cloth.depth(warp, dye).map(|depth| cover * cloth.fibre.mean_reflectance(f64::from(depth)) as f32)
            };
            cloth.bounce = Some(Bounce::new(&cloth.face, albedo));
        }
        Ok(cloth)
    }

    /// Returns the optical depth of the dye, interpolated between that of the weft (`warp` 0) and that of the warp (1),
    /// times `dye`.
    fn depth(&self, warp: f32, dye: f32) -> [f32; 3] {
        let [of_weft, of_warp] = self.dye_depth;
        std::array::from_fn(|k| dye * (of_weft[k] + (of_warp[k] - of_weft[k]) * warp))
    }
}

impl Material for Cloth {
    type Point = ClothPoint;
    type Pair = ClothPair;

    fn size(&self) -> usize {
        self.size
    }

    fn face(&self) -> &HeightField {
        &self.face
    }

    fn point(&self, place: [f32; 2], normal: [f32; 3], wo: [f32; 3]) -> ClothPoint {
        let [x, y, warp, dye, cover] = self.face.grid.corners(place).sample_all(&self.yarns);
        // The surface's vector over that direction, so that it is perpendicular to the normal.
        let rise = -(normal[0] * x + normal[1] * y) / normal[2];
        let length = (x * x + y * y + rise * rise).sqrt().max(1e-6);
        let tangent = [x / length, y / length, rise / length];
        // Interpolated normals may turn from the eye at a silhouette, where the surface itself does not.
        let cos_o = dot(normal, wo).max(1e-3);
        let out = FibreDirection::new(wo, tangent, cos_o);
        let fibre = self.fibre.view(out, self.depth(warp, dye));
        let diffuse = self.fibre.diffuse_reflectance(&fibre).map(|c| c * cover);
        ClothPoint { tangent, cover, fibre, diffuse }
    }

    fn pair(&self, wi: [f32; 3], wo: [f32; 3]) -> ClothPair {
        ClothPair { wi, fibre: FibrePair::new(&self.fibre, wi, wo) }
    }

    #[inline]
    fn shade(&self, pair: &ClothPair, hit: &Hit<ClothPoint>, cos_i: f32) -> [f32; 3] {
        let point = &hit.point;
        let incoming = FibreDirection::new(pair.wi, point.tangent, cos_i);
        self.fibre.pi_brdf_cos(&pair.fibre, &point.fibre, incoming).map(|c| c * point.cover)
    }

    fn bounce(&self) -> Option<&Bounce> {
        self.bounce.as_ref()
    }

    fn diffuse_reflectance(&self, hit: &Hit<ClothPoint>) -> [f32; 3] {
        hit.point.diffuse
    }
}
