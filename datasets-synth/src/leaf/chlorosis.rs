//! Deficiencies as maps on the pigments: nitrogen and magnesium [Miao, Fig. 3].
//!
//! | parameter | symbol | unit | default | valid |
//! |---|---|---|---|---|
//! | severity | s | - | 0.7 | 0 to 1 |
//!
//! The maps multiply the pigment texture's V_a, V_c and V_b:
//! `V_a' = V_a (1 - a)`, `V_c' = V_c (1 - c)`, `V_b' = V_b (1 - n) / 10 + 1.5 n`, with `a`, `c` the loss of
//! chlorophyll and of carotenoids and `n` the dead share at a place. Chlorophyll goes first and most,
//! carotenoids stay: that is the yellow.
//!
//! - Nitrogen is moved from old tissue to young: the whole blade pales, veins too. In maize the tip
//!   yellows first and along the midrib, a V that opens to the tip and grows towards the base with `s`; what
//!   has been yellow longest browns. Broad leaves pale all over; that older leaves do so first is for the
//!   caller, who has the plant.
//! - Magnesium is moved out of the blade between the veins: veins and what is near them stay green. Stripes
//!   in maize, patches between secondaries in broad leaves, and reddish brown margins where it is severe.
//!
//! Brown comes with C_b > 0: V_b only says where ([`Deficiency::BROWN`] is a usual C_b).
//!
//! Differs from the paper: it shows photographs and pictures and gives no equation; these are ours.
//! When it is wrong: a patch stands for the whole blade (its top is the tip, its sides are the margins),
//! whatever its size; the course of a deficiency over weeks is one number here.

use btf_models::Deficiency;

use crate::error::SynthError;

/// Deficiency with its severity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chlorosis {
    /// Kind of the deficiency.
    pub deficiency: Deficiency,
    /// Severity, 0 (healthy) to 1.
    pub severity: f64,
}

/// Place on a leaf at which pigments are evaluated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LeafPlace {
    /// Position from the base to the tip, 0 to 1 over the patch.
    pub up: f32,
    /// Distance from the main vein as a share of the patch.
    pub across: f32,
    /// Nearness of the great veins: 1 on them, towards 0 in the middle between them.
    pub near_vein: f32,
    /// Slow noise about 0, root mean square near 0.3, which blurs borders.
    pub noise: f32,
    /// Whether the leaf is a grass.
    pub grass: bool,
}

impl Chlorosis {
    /// Checks the severity.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for a severity outside 0 to 1.
    pub fn check(&self) -> Result<(), SynthError> {
        if (0.0..=1.0).contains(&self.severity) {
            return Ok(());
        }
        let allowed = "a number from 0 to 1".to_string();
        Err(SynthError::BadParameter { name: "--severity", value: self.severity.to_string(), allowed })
    }

    /// Returns the factors `[V_a, V_c, V_b]` of a deficient leaf from those of the healthy one.
    pub(crate) fn pigments(&self, healthy: [f32; 3], place: &LeafPlace) -> [f32; 3] {
        let s = self.severity as f32;
        let [green_loss, yellow_loss, dead] = match (self.deficiency, place.grass) {
            (Deficiency::Nitrogen, true) => nitrogen_grass(s, place),
            (Deficiency::Nitrogen, false) => {
                // A little less over the veins' supply and with the noise, so that it is no flat tint.
                let loss = s * (0.86 + 0.10 * place.noise - 0.10 * place.near_vein);
                [loss, 0.55 * loss, 0.0]
            }
            (Deficiency::Magnesium, grass) => magnesium(s, place, grass),
        };
        let [a, c, b] = healthy;
        let (green_loss, yellow_loss) = (green_loss.clamp(0.0, 0.97), yellow_loss.clamp(0.0, 0.9));
        // Blended in with the severity, so that none leaves the leaf as it was.
        let brown = b + (0.1 * b * (1.0 - dead) + 1.5 * dead - b) * smooth(0.0, 0.05, s);
        [a * (1.0 - green_loss) * (1.0 - 0.5 * dead), c * (1.0 - yellow_loss), brown]
    }
}

/// Returns the loss of chlorophyll, the loss of carotenoids and the dead share of a grass without nitrogen: a V from
/// the tip.
fn nitrogen_grass(s: f32, place: &LeafPlace) -> [f32; 3] {
    /// Difference between how low the yellow reaches at the midrib and a whole patch's width beside it.
    const V_SLOPE: f32 = 1.15;
    // Height over the V's border, which the severity draws from beyond the tip to below the base.
    let border = 1.15 - 1.3 * s + V_SLOPE * place.across;
    let over = place.up - border + 0.13 * place.noise;
    let yellow = smooth(-0.10, 0.20, over) * smooth(0.0, 0.1, s);
    let dead = smooth(0.45, 0.80, over + 0.05 * place.noise) * smooth(0.4, 0.9, s);
    let paling = 0.35 * s;
    [paling + (0.94 - paling) * yellow, 0.15 * s + 0.30 * yellow, dead]
}

/// Returns the loss of chlorophyll, the loss of carotenoids and the dead share of a leaf without magnesium: between the
/// veins, and at the margins.
fn magnesium(s: f32, place: &LeafPlace, grass: bool) -> [f32; 3] {
    // The green along the veins narrows as it gets worse.
    let open = 1.0 - place.near_vein;
    let start = 0.55 - 0.50 * s + 0.30 * place.noise;
    let chlorosis = s.sqrt() * smooth(start, start + 0.60, open);
    let margin = smooth(0.38, 0.68, place.across + 0.10 * place.noise) * smooth(0.45, 0.95, s);
    let dead = margin * if grass { 0.5 } else { 0.9 } * smooth(0.25, 0.75, open + 0.3 * place.noise);
    [0.92 * chlorosis + 0.10 * s, 0.30 * chlorosis, dead]
}

/// Returns 0 below `from`, 1 above `to`, and a smooth step between.
fn smooth(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEALTHY: [f32; 3] = [1.0, 1.0, 1.0];

    fn place(up: f32, across: f32, near_vein: f32, grass: bool) -> LeafPlace {
        LeafPlace { up, across, near_vein, noise: 0.0, grass }
    }

    fn pigments(deficiency: Deficiency, severity: f64, place: LeafPlace) -> [f32; 3] {
        Chlorosis { deficiency, severity }.pigments(HEALTHY, &place)
    }

    #[test]
    fn no_severity_is_a_healthy_leaf_and_more_never_greens() {
        for deficiency in [Deficiency::Nitrogen, Deficiency::Magnesium] {
            for grass in [true, false] {
                for i in 0..60 {
                    let p = place((i % 5) as f32 * 0.25, (i / 5 % 4) as f32 * 0.2, (i / 20) as f32 * 0.5, grass);
                    assert_eq!(pigments(deficiency, 0.0, p), HEALTHY);
                    let mut last = 1.0;
                    for s in 1..=10 {
                        let [a, c, b] = pigments(deficiency, f64::from(s) * 0.1, p);
                        assert!(a <= last + 1e-5 && a >= 0.0, "{deficiency:?} {p:?} {s}");
                        assert!(c >= a - 1e-5, "yellow outlives green");
                        assert!((0.0..=2.0).contains(&b));
                        last = a;
                    }
                }
            }
        }
    }

    #[test]
    fn nitrogen_yellows_a_grass_from_the_tip_along_the_midrib() {
        let green = |up, across| pigments(Deficiency::Nitrogen, 0.6, place(up, across, 0.3, true))[0];
        assert!(green(0.95, 0.0) < 0.3 * green(0.05, 0.0), "tip against base");
        assert!(green(0.6, 0.0) < 0.6 * green(0.6, 0.5), "midrib against margin");
        // Dead at the tip only.
        let brown = |up| pigments(Deficiency::Nitrogen, 1.0, place(up, 0.0, 0.3, true))[2];
        assert!(brown(1.0) > 1.0 && brown(0.1) < 0.2);
        // A broad leaf pales alike at tip and base.
        let broad = |up| pigments(Deficiency::Nitrogen, 0.6, place(up, 0.2, 0.3, false))[0];
        assert!((broad(0.95) - broad(0.05)).abs() < 1e-6 && broad(0.5) < 0.6);
    }

    #[test]
    fn magnesium_leaves_the_veins_green_and_browns_the_margin() {
        for grass in [true, false] {
            let green = |near| pigments(Deficiency::Magnesium, 0.7, place(0.5, 0.2, near, grass))[0];
            assert!(green(1.0) > 0.85 && green(0.05) < 0.35, "{} {}", green(1.0), green(0.05));
            let brown = |across| pigments(Deficiency::Magnesium, 1.0, place(0.5, across, 0.1, grass))[2];
            assert!(brown(0.9) > 0.6 && brown(0.1) < 0.2);
        }
        // Planted difference: nitrogen spares no vein.
        let [on, off] = [1.0, 0.05].map(|near| pigments(Deficiency::Nitrogen, 0.7, place(0.5, 0.2, near, false))[0]);
        assert!(on < 1.3 * off);
    }

    #[test]
    fn a_severity_out_of_range_is_named() {
        for severity in [-0.1, 1.1, f64::NAN] {
            let error = Chlorosis { deficiency: Deficiency::Nitrogen, severity }.check().unwrap_err();
            assert!(error.to_string().contains("--severity"));
        }
    }
}
