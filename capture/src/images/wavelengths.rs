//! Wavelengths of a file's bands: those that `capture.toml` tells, else those of the file itself.

use crate::colour::spectrum::PLAUSIBLE_NM;
use crate::images::decoded::ImageFault;

/// Value below which wavelengths without a unit are micrometres.
const MIN_PLAIN_NM: f64 = 100.0;

/// Parts of a nanometre that wavelengths in other units are rounded to, so that 0.5505 micrometres are 550.5 nm.
const PARTS_OF_A_NM: f64 = 1e6;

/// Returns the wavelengths in nanometres of a file's `bands`, in the file's order; `None` where neither `told_nm`, the
/// wavelengths of `capture.toml`, nor `of_file` has any.
pub(crate) fn of_bands(
    bands: usize,
    told_nm: &[f64],
    of_file: impl FnOnce() -> Result<Option<Vec<f64>>, ImageFault>,
) -> Result<Option<Vec<f64>>, ImageFault> {
    if !told_nm.is_empty() {
        if told_nm.len() != bands {
            return Err(ImageFault::Unfit(format!(
                "has {}, and `wavelengths_nm` in capture.toml has {} numbers; give one for each band in the file's order",
                counted(bands),
                told_nm.len()
            )));
        }
        return Ok(Some(told_nm.to_vec()));
    }
    let Some(found) = of_file()? else { return Ok(None) };
    if found.len() != bands {
        let reason = format!("has {} and names {} wavelengths; {}", counted(bands), found.len(), remedy());
        return Err(ImageFault::Unfit(reason));
    }
    match found.iter().find(|nm| !PLAUSIBLE_NM.contains(*nm)) {
        None => Ok(Some(found)),
        Some(nm) => {
            let (from, to) = (PLAUSIBLE_NM.start(), PLAUSIBLE_NM.end());
            let reason = format!("names a wavelength of {nm} nm; they go from {from} to {to} nm, {}", remedy());
            Err(ImageFault::Unfit(reason))
        }
    }
}

/// Returns the fault of a file that does not tell the wavelengths of its `bands`.
pub(crate) fn unknown(bands: usize) -> ImageFault {
    ImageFault::Unfit(format!("has {} of unknown wavelength; {}", counted(bands), remedy()))
}

/// Returns `values` of the unit that a file names in nanometres. Without a unit, values that are all below 100 are
/// micrometres.
pub(crate) fn in_nm(values: &[f64], unit: &str) -> Result<Vec<f64>, ImageFault> {
    let nm_a_unit = match unit.trim().to_lowercase().as_str() {
        "" | "unknown" if values.iter().all(|value| *value < MIN_PLAIN_NM) => 1000.0,
        "" | "unknown" | "nm" | "nanometer" | "nanometers" | "nanometre" | "nanometres" => 1.0,
        // Both signs for micro.
        "um" | "\u{b5}m" | "\u{3bc}m" | "micron" | "microns" | "micrometer" | "micrometers" | "micrometre"
        | "micrometres" => 1000.0,
        other => {
            let reason = format!("names its wavelengths in `{}`, not in nm or um; {}", other.escape_debug(), remedy());
            return Err(ImageFault::Unfit(reason));
        }
    };
    Ok(values.iter().map(|value| (value * nm_a_unit * PARTS_OF_A_NM).round() / PARTS_OF_A_NM).collect())
}

fn remedy() -> &'static str {
    "give `wavelengths_nm` in capture.toml, a number for each band in the file's order"
}

fn counted(bands: usize) -> String {
    format!("{bands} band{}", if bands == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(fault: ImageFault) -> String {
        match fault {
            ImageFault::Unfit(reason) => reason,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn units_become_nanometres() {
        for (values, unit, nm) in [
            ([0.45, 0.5505], "", [450.0, 550.5]),
            ([0.45, 0.5505], "Micrometers", [450.0, 550.5]),
            ([450.0, 550.5], "unknown", [450.0, 550.5]),
            ([450.0, 550.5], " Nanometers ", [450.0, 550.5]),
            // A planted difference: one value of micrometres does not make them all.
            ([0.45, 550.5], "", [0.45, 550.5]),
        ] {
            assert_eq!(in_nm(&values, unit).unwrap(), nm, "{unit}");
        }
        assert!(reason(in_nm(&[1.0], "Wavenumber").unwrap_err()).contains("`wavenumber`"));
    }

    #[test]
    fn what_capture_toml_tells_comes_first_and_numbers_must_agree() {
        let none = || Ok(None);
        assert_eq!(of_bands(2, &[700.0, 500.0], || panic!("not asked")).unwrap(), Some(vec![700.0, 500.0]));
        assert_eq!(of_bands(2, &[], || Ok(Some(vec![500.0, 600.0]))).unwrap(), Some(vec![500.0, 600.0]));
        assert_eq!(of_bands(2, &[], none).unwrap(), None);
        for (bands, told, file, part) in [
            (3, &[500.0, 600.0][..], None, "has 3 bands, and `wavelengths_nm` in capture.toml has 2 numbers"),
            (1, &[], Some(vec![500.0, 600.0]), "has 1 band and names 2 wavelengths"),
            (2, &[], Some(vec![500.0, 20.0]), "20 nm"),
            (1, &[], Some(vec![f64::NAN]), "NaN nm"),
        ] {
            let reason = reason(of_bands(bands, told, || Ok(file)).unwrap_err());
            assert!(reason.contains(part) && reason.contains("capture.toml"), "{reason}");
        }
        assert!(
            reason(unknown(5)).contains("has 5 bands of unknown wavelength; give `wavelengths_nm` in capture.toml")
        );
    }
}
