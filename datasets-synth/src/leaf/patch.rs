//! Patch of a leaf: the grids that rendering reads.

use crate::error::SynthError;
use crate::leaf::face::{Seen, Tint};
use crate::leaf::params::LeafParams;
use crate::leaf::relief::TextureSample;
use crate::leaf::textures::AppearanceTextures;
use crate::optics::abm::path_lengths::Face;
use crate::surface::height_field::HeightField;

/// Patch of a leaf without its optics: the displacement of both faces and the appearance textures, on one grid, in the
/// frame of the visible face. Lengths are in millimetres, the origin is the lower left corner of the patch, x points to
/// the right, y up, z out of the face.
#[derive(Debug, Clone)]
pub(crate) struct Leaf {
    pub seen: Seen,
    /// Factors on the contents, per node.
    pub tints: Vec<Tint>,
    /// Strength of the specular lobe of the visible and of the far face, 0 to 1, per node.
    pub gloss: Vec<[f32; 2]>,
    /// Cosine and sine of twice the angle of the veins in the plane, per node.
    pub veins: Vec<[f32; 2]>,
}

impl Leaf {
    /// Generates the leaf, deterministic by seed, on all threads of the current pool.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`].
    pub fn new(params: &LeafParams) -> Result<Leaf, SynthError> {
        params.check()?;
        let textures = match params.side {
            Face::Adaxial => AppearanceTextures::new(params)?,
            Face::Abaxial => AppearanceTextures::new(params)?.turned_over(),
        };
        let (grid, samples) = (textures.grid, &textures.samples);
        let field = |face: usize| {
            HeightField::new(
                grid,
                params.capture.size_mm,
                samples.iter().map(|sample| sample.height_mm[face]).collect(),
            )
        };
        let tint = |sample: &TextureSample| {
            let [chlorophyll, carotenoid, brown] = sample.pigment;
            Tint { chlorophyll, carotenoid, brown, thickness: sample.thickness }
        };
        Ok(Leaf {
            seen: Seen {
                side: params.side,
                passage: params.passage,
                size: params.capture.size,
                face: field(0),
                far: field(1),
            },
            tints: samples.iter().map(tint).collect(),
            gloss: samples.iter().map(|sample| sample.gloss).collect(),
            veins: samples.iter().map(|sample| sample.double_direction).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::params::tests::small;
    use crate::surface::capture_params::CaptureParams;

    #[test]
    fn the_same_seed_gives_the_same_leaf_on_any_number_of_threads() {
        let grow = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let capture = CaptureParams { seed, ..small().capture };
                Leaf::new(&LeafParams { capture, ..small() }).unwrap()
            })
        };
        let (one, three, other) = (grow(1, 1), grow(3, 1), grow(1, 2));
        let heights = |leaf: &Leaf| leaf.seen.face.height_map_mm(48);
        assert_eq!(heights(&one), heights(&three));
        assert_eq!((&one.tints, &one.gloss), (&three.tints, &three.gloss));
        assert_ne!(one.seen.face.height_map_mm(48), heights(&other));
    }

    #[test]
    fn the_back_is_the_face_turned_over() {
        let face = Leaf::new(&small()).unwrap();
        let back = Leaf::new(&LeafParams { side: Face::Abaxial, ..small() }).unwrap();
        for i in 0..200 {
            let p = [(i % 20) as f32 + 0.4, (i / 20) as f32 * 1.9 + 0.3];
            let turned = [20.0 - p[0], p[1]];
            // What the face's far side shows at a place is what the back shows at the mirrored one.
            assert!((face.seen.far.height_mm(p) - back.seen.face.height_mm(turned)).abs() < 2e-3, "{p:?}");
            assert!((face.seen.face.height_mm(p) - back.seen.far.height_mm(turned)).abs() < 2e-3, "{p:?}");
        }
    }
}
