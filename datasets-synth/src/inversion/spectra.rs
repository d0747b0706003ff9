//! Measured spectra of a leaf.

use crate::optics::specific_absorption::LEAF_TABLE_NM;

/// Shares of the incident light of a leaf: reflectance and transmittance of the upper face, then of the lower one.
pub const SHARES: usize = 4;

/// Reflectance and transmittance of one leaf, of its upper face, its lower one or both.
#[derive(Debug, Clone, PartialEq)]
pub struct LeafSpectra {
    /// Name of the leaf.
    pub name: String,
    /// Wavelengths in nanometres, ascending.
    pub wavelengths_nm: Vec<f64>,
    /// Shares of the incident light that are reflected and transmitted by the adaxial face, then by the abaxial one, one
    /// for each wavelength. NaN where nothing was measured.
    pub shares: [Vec<f64>; SHARES],
}

/// Names of the shares of light.
pub(crate) const SHARE_NAMES: [&str; SHARES] =
    ["reflectance", "transmittance", "abaxial reflectance", "abaxial transmittance"];

impl LeafSpectra {
    /// Returns the spectra of a leaf whose upper face was lit, of which reflectance, transmittance or both were measured.
    /// What is missing may be empty or NaN.
    ///
    /// # Errors
    /// Those of [`LeafSpectra::of_faces`].
    pub fn new(
        name: &str,
        wavelengths_nm: &[f64],
        reflectance: &[f64],
        transmittance: &[f64],
    ) -> Result<LeafSpectra, String> {
        LeafSpectra::of_faces(name, wavelengths_nm, [reflectance, transmittance, &[], &[]])
    }

    /// Returns the spectra of a leaf, in the order of [`LeafSpectra::shares`]. What is missing may be empty or NaN.
    ///
    /// # Errors
    /// What is wrong, as a clause: another number of shares than of wavelengths, wavelengths that do not ascend, shares
    /// that are none of light, nothing measured within [`LEAF_TABLE_NM`].
    pub fn of_faces(name: &str, wavelengths_nm: &[f64], shares: [&[f64]; SHARES]) -> Result<LeafSpectra, String> {
        let count = wavelengths_nm.len();
        if wavelengths_nm.windows(2).any(|pair| pair[0].partial_cmp(&pair[1]) != Some(std::cmp::Ordering::Less)) {
            return Err(format!("the wavelengths of {name} do not ascend; sort them, each once"));
        }
        let mut shares = shares.map(<[f64]>::to_vec);
        for (shares, what) in shares.iter_mut().zip(SHARE_NAMES) {
            if shares.is_empty() {
                *shares = vec![f64::NAN; count];
            }
            if shares.len() != count {
                return Err(format!("{name} has {count} wavelengths and {} values of {what}", shares.len()));
            }
            if let Some(at) = shares.iter().position(|share| share.is_infinite() || share.abs() > MAX_SHARE) {
                let (share, nm) = (shares[at], wavelengths_nm[at]);
                let remedy = if share < 0.0 { "give NaN where nothing was measured" } else { "divide percent by 100" };
                return Err(format!(
                    "the {what} of {name} is {share} at {nm} nm, which is no share of light; {remedy}"
                ));
            }
        }
        let spectra = LeafSpectra { name: name.to_owned(), wavelengths_nm: wavelengths_nm.to_vec(), shares };
        match spectra.measured() {
            0 => Err(format!(
                "{name} has no value between {} and {} nm, where contents absorb",
                LEAF_TABLE_NM[0], LEAF_TABLE_NM[1]
            )),
            _ => Ok(spectra),
        }
    }

    /// Returns whether anything was measured of a share of light.
    pub(crate) fn has(&self, share: usize) -> bool {
        self.shares[share].iter().any(|share| share.is_finite())
    }

    /// Returns whether anything was measured of the adaxial and of the abaxial face.
    pub fn faces(&self) -> [bool; 2] {
        [self.has(0) || self.has(1), self.has(2) || self.has(3)]
    }

    /// Returns how many shares were measured within [`LEAF_TABLE_NM`].
    pub(crate) fn measured(&self) -> usize {
        let within = |nm: &f64| (LEAF_TABLE_NM[0]..=LEAF_TABLE_NM[1]).contains(nm);
        let count = |shares: &Vec<f64>| {
            self.wavelengths_nm.iter().zip(shares).filter(|(nm, share)| within(nm) && share.is_finite()).count()
        };
        self.shares.iter().map(count).sum()
    }
}

/// Largest share of light that an instrument may show, by its errors.
const MAX_SHARE: f64 = 2.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_kept_and_what_is_no_spectrum_is_named() {
        let nm = [350.0, 450.0, 550.0];
        let leaf = LeafSpectra::new("oak", &nm, &[0.1, f64::NAN, 0.2], &[]).unwrap();
        assert_eq!(leaf.measured(), 1);
        assert!(leaf.shares[1].iter().all(|share| share.is_nan()));
        let fault = |nm: &[f64], r: &[f64], t: &[f64]| LeafSpectra::new("oak", nm, r, t).unwrap_err();
        assert!(fault(&[450.0, 450.0], &[0.1, 0.1], &[]).contains("do not ascend"));
        assert!(fault(&[450.0, f64::NAN], &[0.1, 0.1], &[]).contains("do not ascend"));
        assert!(fault(&nm, &[0.1], &[]).contains("3 wavelengths and 1 values of reflectance"));
        assert!(fault(&nm, &[], &[0.1, 12.0, 0.1]).contains("transmittance of oak is 12 at 450 nm"));
        assert!(fault(&nm, &[0.1, f64::NAN, f64::NAN], &[]).contains("no value between 400 and 2500"));
    }
}
