//! Superposed layers: several skins over one mesh [Neyret 1996, section 4.1].

use super::thick_skin::{Skin, SkinVertex};
use glam::Vec3;

/// A layer of a skin, as a part of its height vectors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayerSpan {
    /// Begin of the layer: 0 at the surface, 1 on top of the height vectors, or anywhere else.
    pub from: f32,
    /// End of the layer; differs from the begin.
    pub to: f32,
    /// Number of the pattern that is mapped there.
    pub pattern: u32,
}

impl LayerSpan {
    /// Layers one on the other: each with its thickness, in height vectors, and its pattern.
    pub fn on_top(thicknesses: &[(f32, u32)]) -> Vec<LayerSpan> {
        let mut top = 0.0;
        let mut next = |(thickness, pattern): &(f32, u32)| {
            let from = top;
            top += thickness;
            LayerSpan { from, to: top, pattern: *pattern }
        };
        thicknesses.iter().map(&mut next).collect()
    }
}

impl Skin {
    /// Returns a skin for each layer over the same faces: along the same height vectors, with u and v as they are at
    /// that height, w from 0 to 1. Layers may touch, overlap or leave room.
    ///
    /// # Errors
    /// A sentence if a layer has no thickness or a number of it is not finite.
    pub fn layers(&self, spans: &[LayerSpan]) -> Result<Vec<Skin>, String> {
        let of_span = |(number, span): (usize, &LayerSpan)| {
            let thickness = span.to - span.from;
            if !(thickness.is_finite() && span.from.is_finite() && thickness != 0.0) {
                return Err(format!(
                    "layer {number} runs from {} to {}, and must have a thickness",
                    span.from, span.to
                ));
            }
            let lean = |rise: Vec3, share: f32| Vec3::new(rise.x * share, rise.y * share, 0.0);
            let skin = self.with_vertices(|vertex| SkinVertex {
                position: vertex.position + span.from * vertex.height,
                height: thickness * vertex.height,
                texture: vertex.texture.with_z(0.0) + lean(vertex.rise, span.from),
                rise: Vec3::Z + lean(vertex.rise, thickness),
            });
            Ok(skin.with_pattern(span.pattern))
        };
        spans.iter().enumerate().map(of_span).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::twisted;
    use super::*;

    #[test]
    fn layers_stand_on_each_other_and_end_where_the_height_vectors_do() {
        let skin = twisted(3);
        let layers = skin.layers(&LayerSpan::on_top(&[(0.25, 7), (0.75, 4)])).unwrap();
        assert_eq!([0, 1].map(|i: usize| layers[i].faces()[0].pattern), [7, 4]);
        for ((low, high), whole) in layers[0].vertices().iter().zip(layers[1].vertices()).zip(skin.vertices()) {
            assert!((low.position + low.height - high.position).length() < 1e-6);
            assert!((high.position + high.height - whole.position - whole.height).length() < 1e-6);
            assert_eq!((low.texture, high.rise), (whole.texture, Vec3::Z));
        }
        let floating = skin.layers(&[LayerSpan { from: 1.5, to: 1.0, pattern: 0 }]).unwrap();
        assert_eq!(floating[0].vertices()[2].height, -0.5 * skin.vertices()[2].height);
        for bad in [(0.0, 0.0), (f32::NAN, 1.0), (0.0, f32::INFINITY)] {
            assert!(skin.layers(&[LayerSpan { from: bad.0, to: bad.1, pattern: 0 }]).is_err());
        }
    }
}
