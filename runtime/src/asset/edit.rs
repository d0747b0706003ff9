//! Edits: changes of a material's lobes and colour after the measurement, for all of it, a cluster or a painted region.
//! They are kept beside the measured data, which stay as they are.
//!
//! With the lobes' sum S, the edited lobes' sum S' and the measured value X, all in the residual's curve g,
//!
//! ```text
//! X' = tint x g^-1(g(S') + keep (g(X) - g(S))),   keep = exp(-fade x distance)
//! ```
//!
//! A small edit therefore keeps the measured detail that the lobes do not represent. The detail fades with larger
//! edits, because the finer structure of a surface that was rougher is not known.

use crate::asset::dictionary::DictionaryLobe;
use crate::asset::lobe::{Lobe, LobeFamily, RESIDENT_WORDS};

/// Largest number of edits of an asset.
pub const MAX_EDITS: usize = 255;
/// Number of numbers of an edit in the file.
pub const EDIT_NUMBERS: usize = 9;
/// Largest number of words that a layer's edited dictionaries may take in the resident form (64 MiB): some kilobytes
/// must not make a reader allocate without bound.
pub const MAX_EDIT_WORDS: usize = 1 << 24;
/// Words of an edit in the resident form: tint, keep, offset of the table of dictionaries, zeros.
pub const EDIT_WORDS: usize = 8;

/// A change of the measured material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edit {
    /// Factors on the decoded value, linear RGB, 0 to 16.
    pub tint: [f32; 3],
    /// Factor on the weights of the diffuse lobes (Lambertian, Oren-Nayar, windowed cosine), 0 to 16.
    pub diffuse: f32,
    /// Factor on the weights of all other lobes, 0 to 16.
    pub specular: f32,
    /// Factor on the lobes' roughness, 0.1 to 10: slopes are multiplied by it, exponents by the inverse of its square.
    pub roughness: f32,
    /// Offset added to x and y of the lobes' normals, -0.9 to 0.9.
    pub tilt: [f32; 2],
    /// Rate at which the residual fades with [`Edit::distance`], 0 (never) to 16.
    pub fade: f32,
}

impl Default for Edit {
    /// Returns the edit that changes nothing. `fade` is 1, so that a lobe twice as rough keeps half of the residual.
    fn default() -> Edit {
        Edit { tint: [1.0; 3], diffuse: 1.0, specular: 1.0, roughness: 1.0, tilt: [0.0; 2], fade: 1.0 }
    }
}

impl Edit {
    /// Returns the distance of the edited lobes from the measured ones: the sum of the absolute logarithms of the
    /// factors on their weights and roughness, plus the length of the tilt. The tint does not count, because it is
    /// exact.
    pub fn distance(&self) -> f32 {
        let [x, y] = self.tilt;
        let factors = [self.diffuse, self.specular, self.roughness];
        // A factor of 0 is as far as one of e^8.
        factors.iter().map(|factor| factor.max(3.4e-4).ln().abs()).sum::<f32>() + (x * x + y * y).sqrt()
    }

    /// Returns the share of the residual that stays, 0 to 1.
    pub fn keep(&self) -> f32 {
        (-self.fade * self.distance()).exp()
    }

    /// Applies the edit to a lobe of a dictionary.
    pub fn lobe(&self, entry: &DictionaryLobe) -> DictionaryLobe {
        if self.distance() == 0.0 {
            // Halves may lie a rounding beyond their range, into which it would be brought.
            return *entry;
        }
        let (mut lobe, mut weight_scale) = (entry.lobe, entry.weight_scale);
        let (slope, exponent) = (self.roughness, 1.0 / (self.roughness * self.roughness));
        let p = &mut lobe.params;
        let mut normal = 1.0;
        match lobe.family {
            LobeFamily::Lambertian => {}
            LobeFamily::OrenNayar | LobeFamily::CookTorrance | LobeFamily::Ggx => p[0] *= slope,
            LobeFamily::Ward => (p[0], p[1]) = (p[0] * slope, p[1] * slope),
            LobeFamily::BlinnPhong | LobeFamily::WindowedCosine => p[0] *= exponent,
            LobeFamily::AshikhminShirley => (p[0], p[1]) = (p[0] * exponent, p[1] * exponent),
            LobeFamily::Lafortune => {
                // The only glossy family without a factor of its own that keeps its energy.
                let (least, most) = lobe.family.ranges()[3];
                let wider = (p[3] * exponent).clamp(least, most);
                normal = (wider + 1.0) / (p[3] + 1.0);
                p[3] = wider;
            }
        }
        let diffuse =
            matches!(lobe.family, LobeFamily::Lambertian | LobeFamily::OrenNayar | LobeFamily::WindowedCosine);
        weight_scale *= normal * if diffuse { self.diffuse } else { self.specular };
        lobe.normal_xy = [0, 1].map(|i| lobe.normal_xy[i] + self.tilt[i]);
        DictionaryLobe { lobe: Lobe::clamped(lobe), weight_scale }
    }

    /// Returns the numbers of the file, in order.
    pub(crate) fn numbers(&self) -> [f32; EDIT_NUMBERS] {
        let ([r, g, b], [x, y]) = (self.tint, self.tilt);
        [r, g, b, self.diffuse, self.specular, self.roughness, x, y, self.fade]
    }

    /// Makes an edit of the numbers of the file; `None` where one is out of its range.
    pub(crate) fn from_numbers(n: [f32; EDIT_NUMBERS]) -> Option<Edit> {
        let edit = Edit {
            tint: [n[0], n[1], n[2]],
            diffuse: n[3],
            specular: n[4],
            roughness: n[5],
            tilt: [n[6], n[7]],
            fade: n[8],
        };
        edit.in_range().then_some(edit)
    }

    /// Returns whether every number is in its range.
    pub fn in_range(&self) -> bool {
        let factors = self.tint.iter().chain([&self.diffuse, &self.specular, &self.fade]);
        factors.into_iter().all(|x| (0.0..=16.0).contains(x))
            && (0.1..=10.0).contains(&self.roughness)
            && self.tilt.iter().all(|x| (-0.9..=0.9).contains(x))
    }
}

/// The edits of an asset, and the texels that they apply to.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Edits {
    /// Edits of the asset, at most [`MAX_EDITS`].
    pub list: Vec<Edit>,
    /// Number of each finest texel's edit, counted from 1; 0 for none. Empty without edits.
    pub texels: Vec<u8>,
}

impl Edits {
    /// Returns whether the edited copies of a layer's `dictionaries` keep within [`MAX_EDIT_WORDS`].
    pub(crate) fn fit(&self, dictionaries: &[Vec<DictionaryLobe>]) -> bool {
        let lobes: usize = dictionaries.iter().map(Vec::len).sum();
        self.list.len() * (EDIT_WORDS + 1 + dictionaries.len() + lobes * RESIDENT_WORDS) <= MAX_EDIT_WORDS
    }

    /// Returns the edits for a coarser grid of `size` texels: each texel has the edit of the texel of the `finest` grid
    /// at its middle.
    pub fn coarser(&self, finest: [usize; 2], size: [usize; 2]) -> Edits {
        let middle = |index: usize, axis: usize| (2 * index + 1) * finest[axis] / (2 * size[axis]);
        let texels = (0..if self.list.is_empty() { 0 } else { size[0] * size[1] })
            .map(|texel| middle(texel / size[0], 1) * finest[0] + middle(texel % size[0], 0))
            .map(|texel| self.texels.get(texel).copied().unwrap_or(0))
            // A number that no edit has is none.
            .map(|edit| if usize::from(edit) <= self.list.len() { edit } else { 0 });
        Edits { list: self.list.clone(), texels: texels.collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::asset::{Asset, LobeRole};
    use crate::asset::residual::ResidualKind;
    use crate::decode::decode::decode;
    use crate::decode::options::{DecodeOptions, Interpolation};
    use crate::error::FormatError;
    use crate::levels::levels::with_levels;
    use crate::pack;
    use crate::resident::resident::Resident;
    use crate::testing::{Random, sample_asset};
    use crate::threads::serial;

    fn edited(mut asset: Asset, list: Vec<Edit>, texels: impl Fn(usize) -> u8) -> Asset {
        asset.edits = Edits { list, texels: (0..asset.texel_count()).map(texels).collect() };
        asset
    }

    /// Returns the largest relative difference of `a` from `times` x `b` over random directions, for the texels and
    /// lights that `asked` accepts.
    fn difference(
        a: &Asset,
        b: &Asset,
        times: [f32; 3],
        options: &DecodeOptions,
        asked: impl Fn(usize, [f32; 3]) -> bool,
    ) -> f32 {
        let (ra, rb) = (Resident::from_asset(a), Resident::from_asset(b));
        let mut random = Random::new(5);
        let mut worst = 0.0f32;
        for _ in 0..2000 {
            let (texel, wi, wo) = (random.below(a.texel_count()), random.direction(), random.direction());
            if asked(texel, wi) {
                let [x, y] = [&ra, &rb].map(|resident| decode(resident, 0, texel as u32, wi, wo, options));
                (0..3).for_each(|c| worst = worst.max((x[c] - times[c] * y[c]).abs() / (0.02 + times[c] * y[c])));
            }
        }
        worst
    }

    fn kinds_and_roles() -> impl Iterator<Item = Asset> {
        let kinds = [ResidualKind::Additive, ResidualKind::Log, ResidualKind::Root];
        kinds.into_iter().flat_map(|kind| {
            [LobeRole::Base, LobeRole::Guide, LobeRole::OldBase].map(|role| {
                let mut asset = sample_asset(70, 6, 5, kind);
                asset.layers[0].lobe_role = role;
                asset
            })
        })
    }

    #[test]
    fn an_edit_that_changes_nothing_shows_nothing_and_a_tint_is_exact() {
        for asset in kinds_and_roles() {
            for interpolation in [Interpolation::Fast, Interpolation::Exact] {
                let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
                let none = edited(asset.clone(), vec![Edit::default()], |_| 1);
                let worst = difference(&none, &asset, [1.0; 3], &options, |_, _| true);
                assert!(worst < 2e-3, "{worst}");
                let tint = [0.5, 2.0, 0.0];
                let tinted =
                    edited(asset.clone(), vec![Edit { tint, ..Edit::default() }], |texel| u8::from(texel < 10));
                let worst = difference(&tinted, &asset, tint, &options, |texel, _| texel < 10);
                assert!(worst < 2e-3, "{worst}");
                assert_eq!(difference(&tinted, &asset, [1.0; 3], &options, |texel, _| texel >= 10), 0.0);
                // Planted difference: the tint is not none.
                assert!(difference(&tinted, &asset, [1.0; 3], &options, |texel, _| texel < 10) > 0.01);
            }
        }
    }

    #[test]
    fn what_fades_leaves_the_edited_lobes() {
        for asset in kinds_and_roles() {
            let edit = Edit { roughness: 2.0, specular: 0.5, tilt: [0.1, -0.2], fade: 16.0, ..Edit::default() };
            let faded = edited(asset.clone(), vec![edit], |_| 1);
            // The same lobes in a dictionary, and no residual.
            let mut alone = asset.clone();
            alone.layers[0].residual = None;
            for entry in alone.layers[0].dictionary.iter_mut().flatten() {
                *entry = edit.lobe(entry);
            }
            // A base falls beyond the measured lights, which lobes without a residual do not know.
            let falls = asset.layers[0].lobe_role == LobeRole::Base;
            let lights = asset.layers[0].lights.clone();
            let asked = |_: usize, wi| !falls || lights.locate(wi).beyond >= 1.0;
            let worst = difference(&faded, &alone, [1.0; 3], &DecodeOptions::default(), asked);
            assert!(worst < 2e-3, "{worst}");
            let kept = edited(asset, vec![Edit { fade: 0.0, ..edit }], |_| 1);
            assert!(difference(&kept, &alone, [1.0; 3], &DecodeOptions::default(), asked) > 0.05);
        }
    }

    #[test]
    fn roughness_widens_every_family_and_keeps_it_readable() {
        let rougher = Edit { roughness: 2.0, ..Edit::default() };
        for family in LobeFamily::ALL {
            let params = match family {
                LobeFamily::Lambertian => [0.0; 4],
                LobeFamily::OrenNayar => [0.3, 0.0, 0.0, 0.0],
                LobeFamily::BlinnPhong => [80.0, 0.0, 0.0, 0.0],
                LobeFamily::Ward => [0.2, 0.1, 0.0, 0.0],
                LobeFamily::CookTorrance | LobeFamily::Ggx => [0.2, 0.5, 0.0, 0.0],
                LobeFamily::Lafortune => [-0.7, -0.7, 0.7, 40.0],
                LobeFamily::AshikhminShirley => [80.0, 40.0, 0.5, 0.0],
                LobeFamily::WindowedCosine => [20.0, 0.1, 0.2, 0.0],
            };
            let lobe = Lobe { family, normal_xy: [0.0; 2], tangent_rad: 0.0, params };
            let entry = DictionaryLobe { lobe, weight_scale: 1.0 };
            // The value 30 degrees off the mirror direction over that at it.
            let spread = |entry: &DictionaryLobe| {
                let setup = entry.lobe.setup();
                setup.eval([0.0, 0.5, 0.75f32.sqrt()], [0.0, 0.0, 1.0]) / setup.eval([0.0, 0.0, 1.0], [0.0, 0.0, 1.0])
            };
            let wider = rougher.lobe(&entry);
            match family {
                // It widens about the eye, not the light.
                LobeFamily::WindowedCosine => assert_eq!(wider.lobe.params[0], 5.0),
                LobeFamily::Lambertian => assert_eq!(wider, entry),
                LobeFamily::OrenNayar => assert_eq!(wider.lobe.params[0], 0.6),
                _ => assert!(spread(&wider) > 1.5 * spread(&entry), "{family:?}"),
            }
            for roughness in [0.1, 10.0] {
                let extreme = Edit { roughness, tilt: [0.9, 0.9], ..Edit::default() }.lobe(&entry);
                let words = extreme.lobe.to_words(extreme.weight_scale);
                assert!(Lobe::from_words(words).is_some(), "{family:?} {roughness}");
            }
        }
    }

    #[test]
    fn edits_come_back_from_a_file_and_bad_ones_are_refused() {
        let list = vec![Edit::default(), Edit { tint: [0.2, 0.5, 3.0], roughness: 0.4, ..Edit::default() }];
        let asset = edited(sample_asset(3, 9, 7, ResidualKind::Root), list, |texel| (texel % 3) as u8);
        let bytes = pack(&asset).unwrap();
        assert_eq!(Asset::parse(&bytes).unwrap(), asset);
        let refused = |change: fn(&mut Edits)| {
            let mut asset = asset.clone();
            change(&mut asset.edits);
            matches!(pack(&asset), Err(FormatError::Pack { .. }))
        };
        assert!(refused(|edits| edits.texels[4] = 3));
        assert!(refused(|edits| edits.texels.truncate(62)));
        assert!(refused(|edits| edits.list[1].tint[2] = f32::NAN));
        assert!(refused(|edits| edits.list[1].roughness = 0.0));
        assert!(refused(|edits| edits.list = vec![Edit::default(); 256]));
        assert!(!refused(|edits| edits.texels[4] = 2));
    }

    #[test]
    fn edits_are_set_and_taken_back_at_all_levels() {
        let asset = sample_asset(8, 8, 8, ResidualKind::Root);
        let asset = with_levels(&asset, &serial);
        let plain = Resident::from_asset(&asset);
        let list = vec![Edit { tint: [0.0; 3], ..Edit::default() }];
        let edits = Edits { list, texels: (0..64).map(|texel| u8::from(texel % 8 >= 4)).collect() };
        let mut resident = plain.clone();
        resident.set_edits(&edits, &asset.layers);
        for layer in 0..resident.levels() {
            let [width, height] = resident.size(layer);
            for texel in 0..width * height {
                let of = |resident: &Resident| {
                    decode(resident, layer, texel, [0.1, 0.2, 0.9], [0.0, 0.3, 0.9], &DecodeOptions::default())
                };
                let black = 2 * (texel % width) + 1 >= width;
                assert_eq!(of(&resident), if black { [0.0; 3] } else { of(&plain) }, "{layer} {texel}");
            }
        }
        // Everything that differs lies within the ranges that are told.
        let ranges = resident.edited_ranges();
        for (at, (a, b)) in plain.words().iter().zip(resident.words()).enumerate() {
            assert!(a == b || ranges.iter().any(|range| range.contains(&at)), "word {at}");
        }
        resident.set_edits(&Edits::default(), &asset.layers);
        assert_eq!(resident.words()[8..], plain.words()[8..]);
    }
}
