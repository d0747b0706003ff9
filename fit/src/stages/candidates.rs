//! Candidate lobes of a dictionary: every family at a few parameters about every normal.

use btf_runtime::{Lobe, LobeFamily};

/// Tilts of the candidate normals in degrees with the number of azimuths: 31 normals.
const NORMAL_RINGS: [(f32, usize); 4] = [(0.0, 1), (12.0, 6), (25.0, 12), (40.0, 12)];
/// Tilts of the window axes of the view-windowed cosine: 19 axes.
const WINDOW_RINGS: [(f32, usize); 3] = [(0.0, 1), (35.0, 6), (65.0, 12)];
/// Normals of the windowed cosine: 13.
const WINDOW_NORMAL_RINGS: [(f32, usize); 3] = [(0.0, 1), (20.0, 6), (40.0, 6)];
/// Window width: half value at about 40 degrees.
const WINDOW_K: f32 = 3.0;

fn directions_xy(rings: &[(f32, usize)]) -> Vec<[f32; 2]> {
    rings
        .iter()
        .flat_map(|&(tilt_deg, count)| {
            (0..count).map(move |i| {
                let azimuth = std::f32::consts::TAU * i as f32 / count as f32;
                let sin = tilt_deg.to_radians().sin();
                [sin * azimuth.cos(), sin * azimuth.sin()]
            })
        })
        .collect()
}

/// Candidates at most: room for [`candidate_lobes`], of which there are 867.
pub const MAX_CANDIDATES: usize = 900;

/// Returns all candidates; the first is the Lambertian lobe about the macroscopic normal.
pub fn candidate_lobes() -> Vec<Lobe> {
    let parameters: [(LobeFamily, &[[f32; 4]]); 8] = [
        (LobeFamily::Lambertian, &[[0.0; 4]]),
        (LobeFamily::OrenNayar, &[[0.7, 0.0, 0.0, 0.0]]),
        (LobeFamily::BlinnPhong, &[[4.0, 0.0, 0.0, 0.0], [20.0, 0.0, 0.0, 0.0], [100.0, 0.0, 0.0, 0.0]]),
        (
            LobeFamily::Ward,
            &[[0.12, 0.12, 0.0, 0.0], [0.3, 0.3, 0.0, 0.0], [0.15, 0.5, 0.0, 0.0], [0.5, 0.15, 0.0, 0.0]],
        ),
        (LobeFamily::CookTorrance, &[[0.07, 0.05, 0.0, 0.0], [0.15, 0.05, 0.0, 0.0], [0.35, 0.05, 0.0, 0.0]]),
        (LobeFamily::Lafortune, &[[-0.9, -0.9, 0.9, 5.0], [-0.9, -0.9, 0.9, 30.0], [0.8, 0.8, 0.8, 4.0]]),
        (LobeFamily::AshikhminShirley, &[[30.0, 30.0, 0.05, 0.0], [10.0, 150.0, 0.05, 0.0]]),
        (LobeFamily::Ggx, &[[0.1, 0.05, 0.0, 0.0], [0.25, 0.05, 0.0, 0.0], [0.5, 0.05, 0.0, 0.0]]),
    ];
    let mut lobes = Vec::new();
    for normal_xy in directions_xy(&NORMAL_RINGS) {
        for (family, rows) in parameters {
            lobes.extend(rows.iter().map(|params| Lobe { family, normal_xy, tangent_rad: 0.0, params: *params }));
        }
    }
    for normal_xy in directions_xy(&WINDOW_NORMAL_RINGS) {
        for [x, y] in directions_xy(&WINDOW_RINGS) {
            let params = [WINDOW_K, x, y, 0.0];
            lobes.push(Lobe { family: LobeFamily::WindowedCosine, normal_xy, tangent_rad: 0.0, params });
        }
    }
    lobes.iter().map(Lobe::rounded).collect()
}

/// Places of a lobe's free parameters in an unconstrained vector.
pub struct Freedom {
    /// Index into `params`, and true where the parameter varies by ratio (roughness, exponent).
    slots: Vec<(usize, bool)>,
    tangent: bool,
}

impl Freedom {
    /// Returns the parameters of `family` that a refinement moves, beside the normal.
    pub fn of(family: LobeFamily) -> Freedom {
        let (slots, tangent): (&[(usize, bool)], bool) = match family {
            LobeFamily::Lambertian => (&[], false),
            LobeFamily::OrenNayar => (&[(0, false)], false),
            LobeFamily::BlinnPhong => (&[(0, true)], false),
            LobeFamily::Ward => (&[(0, true), (1, true)], true),
            LobeFamily::CookTorrance | LobeFamily::Ggx => (&[(0, true), (1, false)], false),
            LobeFamily::Lafortune => (&[(0, false), (1, false), (2, false), (3, true)], true),
            LobeFamily::AshikhminShirley => (&[(0, true), (1, true), (2, false)], true),
            LobeFamily::WindowedCosine => (&[(0, true), (1, false), (2, false)], false),
        };
        Freedom { slots: slots.to_vec(), tangent }
    }

    /// Returns the free numbers of a lobe: normal x and y, the parameters, the tangent.
    pub fn vector(&self, lobe: &Lobe) -> Vec<f64> {
        let mut vector = vec![f64::from(lobe.normal_xy[0]), f64::from(lobe.normal_xy[1])];
        vector.extend(self.slots.iter().map(|&(slot, ratio)| {
            let value = f64::from(lobe.params[slot]);
            if ratio { value.max(1e-3).ln() } else { value }
        }));
        if self.tangent {
            vector.push(f64::from(lobe.tangent_rad));
        }
        vector
    }

    /// Returns a lobe like `like` with the free numbers `vector`, brought into its ranges.
    pub fn lobe(&self, like: &Lobe, vector: &[f64]) -> Lobe {
        let mut lobe = *like;
        lobe.normal_xy = [vector[0] as f32, vector[1] as f32];
        for (&(slot, ratio), value) in self.slots.iter().zip(&vector[2..]) {
            lobe.params[slot] = if ratio { value.clamp(-20.0, 20.0).exp() as f32 } else { *value as f32 };
        }
        if self.tangent {
            lobe.tangent_rad = vector[2 + self.slots.len()].rem_euclid(std::f64::consts::TAU) as f32;
        }
        lobe.clamped()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_family_is_offered_and_survives_its_own_vector() {
        let lobes = candidate_lobes();
        assert!(lobes.len() <= MAX_CANDIDATES && lobes.len() + 50 > MAX_CANDIDATES, "{}", lobes.len());
        for family in LobeFamily::ALL {
            assert!(lobes.iter().any(|lobe| lobe.family == family), "{family:?}");
        }
        for lobe in lobes {
            let freedom = Freedom::of(lobe.family);
            let back = freedom.lobe(&lobe, &freedom.vector(&lobe));
            assert!((0..4).all(|i| (back.params[i] - lobe.params[i]).abs() <= 1e-3 * lobe.params[i].abs().max(1.0)));
        }
    }
}
