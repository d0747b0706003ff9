//! Body of a leaf: diffuse reflection on the side of the light and diffuse transmission on the other.
//!
//! | parameter | symbol | unit | valid |
//! |---|---|---|---|
//! | reflectance of the lit side | rho | - | 0 to 1 |
//! | transmittance | tau | - | 0 to 1, rho + tau at most 1 |
//!
//! `f_r = rho / pi` where light and eye stand on the same side of the leaf, `f_t = tau / pi` where they do not; either
//! is lit by `|n.wi|` [Miao, eq. 8].
//!
//! Differs from the paper in: the thickness texture of the paper multiplies `f_t`, which makes thick places brighter;
//! here thickness belongs to the absorption that rho and tau were computed with.
//!
//! When it is wrong: real leaves transmit a little more straight on than to the side, and a leaf whose faces differ has
//! another rho on each (tau is the same from both sides).

/// Returns `pi * f * |n.wi|` of a body of reflectance `reflectance` and transmittance `transmittance`, for the cosines
/// `cos_i` of the light and `cos_o` of the eye against one normal. The sign of a cosine says the side, so light from
/// behind is negative. Returns 0 where either is edge-on.
#[inline]
pub fn two_sided_diffuse(reflectance: f32, transmittance: f32, cos_i: f32, cos_o: f32) -> f32 {
    let sides = cos_i * cos_o;
    if sides > 0.0 {
        reflectance * cos_i.abs()
    } else if sides < 0.0 {
        transmittance * cos_i.abs()
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sides_of_light_and_eye_choose_reflection_or_transmission() {
        for (cos_i, cos_o, expected) in [
            (0.5, 0.7, 0.5 * 0.3),
            (-0.5, -0.7, 0.5 * 0.3),
            (0.5, -0.7, 0.5 * 0.2),
            (-0.5, 0.7, 0.5 * 0.2),
            (0.0, 0.7, 0.0),
            (0.5, 0.0, 0.0),
        ] {
            assert_eq!(two_sided_diffuse(0.3, 0.2, cos_i, cos_o), expected, "{cos_i} {cos_o}");
        }
    }

    #[test]
    fn both_sides_together_return_what_is_not_absorbed() {
        // Mean of pi f cos_o / pi over the sphere around the leaf, cosine-weighted, is rho + tau.
        let steps = 1000;
        let total: f32 = (0..steps)
            .flat_map(|i| {
                let cos_o = (1.0 - (i as f32 + 0.5) / steps as f32).sqrt();
                [cos_o, -cos_o]
            })
            .map(|cos_o| two_sided_diffuse(0.3, 0.6, 1.0, cos_o))
            .sum();
        assert!((total / steps as f32 - 0.9).abs() < 1e-4);
    }
}
