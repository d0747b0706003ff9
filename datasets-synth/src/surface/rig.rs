//! Virtual camera and lamp: what each texel of the reference plane shows of a material.
//!
//! The reference plane is the mean height. For a view, the ray through each of four points in a texel is marched over
//! the heights to the first surface point, which gives parallax and masking. For a light, the ray from each node
//! towards it is marched for occluders, which gives shadows with the penumbra of a lamp of half a degree radius. A
//! texel is the mean over its points of `pi f_r cos_i` times visibility, and where the material has it, of the light
//! that comes by way of the surface itself ([`Bounce`]).

use rayon::prelude::*;

use crate::surface::bounce::{Bounce, BouncedLight};
use crate::surface::height_field::{HeightField, LightVisibility};
use crate::vector::dot;

/// Number of points per texel and axis.
pub(crate) const SUPERSAMPLES: usize = 2;

/// Surface that the rig can photograph: its height field and its shading at a point. What depends on the view alone is
/// computed once per view ([`Material::point`]), what depends on the two directions alone once per image
/// ([`Material::pair`]).
pub trait Material: Sync {
    /// View-dependent part of the shading at one point.
    type Point: Copy + Send + Sync;
    /// Constants of one image.
    type Pair: Sync;

    /// Returns the side of the images in texels.
    fn size(&self) -> usize;

    /// Returns the height field of the face that the eye sees.
    fn face(&self) -> &HeightField;

    /// Returns the visibility of the light `wi` from the face that it falls on, by default the visible one. A material
    /// that transmits light uses its other face, which must lie on the same grid.
    fn visibility(&self, wi: [f32; 3]) -> LightVisibility {
        LightVisibility::new(self.face(), wi)
    }

    /// Returns the view-dependent half of the shading at `place` (in cells of the face's grid).
    fn point(&self, place: [f32; 2], normal: [f32; 3], wo: [f32; 3]) -> Self::Point;

    /// Returns the constants of the image under the light `wi` in the view `wo`.
    fn pair(&self, wi: [f32; 3], wo: [f32; 3]) -> Self::Pair;

    /// Returns the cosine of incidence of the light `wi` at a point, by default against the normal of the visible face.
    /// A point where it is not positive is unlit.
    #[inline]
    fn cos_i(&self, hit: &Hit<Self::Point>, wi: [f32; 3]) -> f32 {
        dot(hit.normal, wi)
    }

    /// Returns `pi * BSDF * cos_i` of the fully lit point, linear sRGB; `cos_i` is positive.
    fn shade(&self, pair: &Self::Pair, hit: &Hit<Self::Point>, cos_i: f32) -> [f32; 3];

    /// Returns the transport of light from the surface to itself, by default none.
    fn bounce(&self) -> Option<&Bounce> {
        None
    }

    /// Returns the share of diffuse light at a point that leaves towards the eye, linear sRGB, which bounced light is
    /// multiplied by.
    fn diffuse_reflectance(&self, _hit: &Hit<Self::Point>) -> [f32; 3] {
        [0.0; 3]
    }
}

/// Surface point that one point of a texel sees in one view.
#[derive(Debug, Clone, Copy)]
pub struct Hit<P> {
    /// Place on the face's grid in cells.
    pub place: [f32; 2],
    /// Unit normal of the seen face.
    pub normal: [f32; 3],
    /// View-dependent part of the shading.
    pub point: P,
}

/// View-dependent part of a whole image.
#[derive(Debug, Clone)]
pub struct ViewHits<P> {
    wo: [f32; 3],
    /// Hits `[texel, point]`.
    hits: Vec<Hit<P>>,
}

/// Light with its visibility from the material.
#[derive(Debug, Clone)]
pub struct Illumination {
    wi: [f32; 3],
    visibility: LightVisibility,
    bounced: Option<BouncedLight>,
}

impl<P: Copy + Send + Sync> ViewHits<P> {
    /// Marches the rays of the view `wo` (unit, towards the eye, in front of the face), in
    /// parallel over rows.
    pub fn new<M: Material<Point = P>>(material: &M, wo: [f32; 3]) -> ViewHits<P> {
        let (face, size) = (material.face(), material.size());
        let texel_mm = face.size_mm() / size as f32;
        let point_mm = texel_mm / SUPERSAMPLES as f32;
        let hits = (0..size)
            .into_par_iter()
            .flat_map_iter(|row| {
                (0..size * SUPERSAMPLES * SUPERSAMPLES).map(move |i| {
                    let (column, point) = (i / (SUPERSAMPLES * SUPERSAMPLES), i % (SUPERSAMPLES * SUPERSAMPLES));
                    let (px, py) = (point % SUPERSAMPLES, point / SUPERSAMPLES);
                    let x = column as f32 * texel_mm + (px as f32 + 0.5) * point_mm;
                    // Row 0 is at the top, where y is largest.
                    let y = face.size_mm() - (row as f32 * texel_mm + (py as f32 + 0.5) * point_mm);
                    let place = face.march_down(face.grid.cells([x, y]), wo);
                    let normal = face.normal_at(place);
                    Hit { place, normal, point: material.point(place, normal, wo) }
                })
            })
            .collect();
        ViewHits { wo, hits }
    }
}

impl Illumination {
    /// Marches the shadows of the light `wi` (unit), on the calling thread.
    pub fn new<M: Material>(material: &M, wi: [f32; 3]) -> Illumination {
        let visibility = material.visibility(wi);
        let bounced = material.bounce().map(|bounce| bounce.gather(material.face(), &visibility, wi));
        Illumination { wi, visibility, bounced }
    }

    /// Returns the size in bytes of one light for this material.
    pub(crate) fn bytes<M: Material>(material: &M) -> usize {
        LightVisibility::bytes(material.face()) + material.bounce().map_or(0, Bounce::bytes_per_light)
    }
}

/// Renders one image of reflectance x cosine, linear sRGB, `[texel, channel]`.
pub fn render<M: Material>(material: &M, view: &ViewHits<M::Point>, light: &Illumination) -> Vec<f32> {
    const POINTS: usize = SUPERSAMPLES * SUPERSAMPLES;
    let wi = light.wi;
    let grid = material.face().grid;
    let pair = material.pair(wi, view.wo);
    let mut image = Vec::with_capacity(view.hits.len() / POINTS * 3);
    for points in view.hits.chunks_exact(POINTS) {
        let mut texel = [0f32; 3];
        for hit in points {
            if let Some(bounced) = &light.bounced {
                let (arriving, reflectance) = (bounced.at(hit.place), material.diffuse_reflectance(hit));
                for channel in 0..3 {
                    texel[channel] += arriving[channel] * reflectance[channel];
                }
            }
            let cos_i = material.cos_i(hit, wi);
            if cos_i <= 0.0 {
                continue;
            }
            let visible = grid.corners(hit.place).sample_share(&light.visibility.share);
            if visible <= 0.0 {
                continue;
            }
            let shaded = material.shade(&pair, hit, cos_i);
            for channel in 0..3 {
                texel[channel] += visible * shaded[channel];
            }
        }
        image.extend(texel.map(|c| c * (1.0 / POINTS as f32)));
    }
    image
}

#[cfg(test)]
mod tests {
    use btf_capture::Direction;

    use super::*;
    use crate::leaf::plate_leaf::{PlateLeaf, tests as plate_leaf};
    use crate::optics::abm::path_lengths::Face;
    use crate::optics::abm::scatter_table::Passage;

    fn leaf() -> PlateLeaf {
        plate_leaf::grown(Face::Adaxial, Passage::Reflection)
    }

    fn shaped(height: impl Fn([f32; 2]) -> f32, gloss: f32) -> PlateLeaf {
        plate_leaf::shaped(height, gloss, Passage::Reflection)
    }

    fn image(leaf: &PlateLeaf, wi: Direction, wo: Direction) -> Vec<f32> {
        render(leaf, &ViewHits::new(leaf, wo.unit()), &Illumination::new(leaf, wi.unit()))
    }

    #[test]
    fn a_flat_diffuse_leaf_is_its_body_colour_times_the_cosine() {
        let flat = shaped(|_| 0.0, 0.0);
        for (light, view) in [(0.0, 0.0), (60.0, 30.0), (75.0, 75.0)] {
            let image = image(&flat, Direction::new(light, 40.0), Direction::new(view, 200.0));
            let cos = light.to_radians().cos() as f32;
            for texel in image.chunks_exact(3) {
                assert!((texel[0] - 0.5 * cos).abs() < 1e-5 && (texel[2] - 0.3 * cos).abs() < 1e-5, "{texel:?}");
            }
        }
    }

    #[test]
    fn a_flat_glossy_leaf_is_brightest_in_the_mirror_direction_and_obeys_reciprocity() {
        let flat = shaped(|_| 0.0, 1.0);
        let first = |wi: Direction, wo: Direction| image(&flat, wi, wo)[0];
        let light = Direction::new(45.0, 0.0);
        let mirror = first(light, Direction::new(45.0, 180.0));
        assert!(mirror > 1.2 * first(light, Direction::new(0.0, 0.0)));
        let (a, b) = (Direction::new(20.0, 10.0), Direction::new(70.0, 150.0));
        let forward = first(a, b) / a.unit()[2];
        let backward = first(b, a) / b.unit()[2];
        assert!((forward - backward).abs() < 1e-4 * forward, "{forward} {backward}");
    }

    #[test]
    fn a_tilted_plane_has_the_cosine_of_its_own_normal() {
        let tilted = shaped(|p| 0.2 * (p[0] - 10.0), 0.0);
        let light = Direction::new(30.0, 0.0);
        let image = image(&tilted, light, Direction::new(0.0, 0.0));
        let scale = 1.0 / (1.0f32 + 0.04).sqrt();
        let expected = 0.5 * (-0.2 * scale * light.unit()[0] + scale * light.unit()[2]);
        // Texels away from the grid's edge, where the plane goes on.
        let middle = (32 * 64 + 32) * 3;
        assert!((image[middle] - expected).abs() < 1e-3, "{} {expected}", image[middle]);
    }

    #[test]
    fn a_hit_lies_on_the_surface_and_nothing_stands_before_it() {
        let leaf = leaf();
        for (theta, phi) in [(30.0, 20.0), (75.0, 200.0), (85.0, 300.0)] {
            let wo = Direction::new(theta, phi).unit();
            for i in 0..100 {
                let start = leaf.face().grid.cells([(i % 10) as f32 * 2.0 + 0.3, (i / 10) as f32 * 2.0 + 0.3]);
                let place = leaf.face().march_down(start, wo);
                // Height of the ray over that place.
                let along = ((place[0] - start[0]) * wo[0] + (place[1] - start[1]) * wo[1]) * leaf.face().grid.cell_mm;
                let z = along * wo[2] / (wo[0] * wo[0] + wo[1] * wo[1]);
                let surface =
                    leaf.face().height_mm(place.map(|x| x * leaf.face().grid.cell_mm - leaf.face().grid.margin_mm));
                assert!((z - surface).abs() < 5e-3, "{theta}: ray {z} surface {surface}");
            }
        }
    }

    #[test]
    fn images_are_finite_and_a_light_below_the_local_horizon_gives_black() {
        let leaf = leaf();
        for (light, view) in [(0.0, 0.0), (75.0, 75.0), (88.0, 88.0)] {
            let image = image(&leaf, Direction::new(light, 10.0), Direction::new(view, 190.0));
            assert!(image.iter().all(|v| v.is_finite() && *v >= -0.1));
        }
        let steep = shaped(|p| 2.0 * p[0], 0.0);
        let image = image(&steep, Direction::new(80.0, 0.0), Direction::new(0.0, 0.0));
        assert_eq!(image[(32 * 64 + 32) * 3], 0.0);
    }
}
