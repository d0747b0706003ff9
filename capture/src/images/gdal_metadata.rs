//! Wavelengths in the metadata that GDAL writes into TIFF files: XML of `<Item name="wavelength" sample="0">450</Item>`,
//! where samples count from 0.

use crate::images::bands::MAX_BANDS;
use crate::images::decoded::ImageFault;
use crate::images::wavelengths::in_nm;

/// Name of GDAL's own items, which are in micrometres.
const OF_GDAL: &str = "central_wavelength_um";

/// Returns the wavelengths in nanometres of samples 0 to `bands` less 1; `None` where one of them has none.
pub(crate) fn wavelengths_of(text: &str, bands: usize) -> Result<Option<Vec<f64>>, ImageFault> {
    if bands > MAX_BANDS {
        return Ok(None);
    }
    let of_name = |names: &[&str]| -> Vec<(Option<usize>, &str)> {
        let items = items(text).filter(|item| names.iter().any(|name| item.name.eq_ignore_ascii_case(name)));
        items.map(|item| (item.sample, item.value)).collect()
    };
    let units = of_name(&["wavelength_units", "wavelength_unit"]);
    for (name, unit) in [("wavelength", units.first().map_or("", |(_, unit)| *unit)), (OF_GDAL, "um")] {
        let mut found = vec![None; bands];
        for (sample, value) in of_name(&[name]) {
            if let Some(place) = sample.and_then(|sample| found.get_mut(sample)) {
                *place = value.parse::<f64>().ok();
            }
        }
        if let Some(values) = found.into_iter().collect::<Option<Vec<f64>>>() {
            return in_nm(&values, unit).map(Some);
        }
    }
    Ok(None)
}

struct Item<'a> {
    name: &'a str,
    sample: Option<usize>,
    value: &'a str,
}

/// Returns the items of the metadata; what is none is passed over.
fn items(text: &str) -> impl Iterator<Item = Item<'_>> {
    text.split("<Item").skip(1).filter_map(|rest| {
        let (attributes, rest) = rest.split_once('>')?;
        let value = rest.split_once("</Item")?.0.trim();
        let attribute = |name: &str| {
            let mut parts = attributes.split(name).skip(1);
            parts
                .find_map(|rest| rest.trim_start().strip_prefix('=')?.trim_start().strip_prefix('"')?.split('"').next())
        };
        let sample = attribute("sample").and_then(|sample| sample.parse().ok());
        Some(Item { name: attribute("name")?.trim(), sample, value })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"<GDALMetadata>
  <Item name="AREA">7</Item>
  <Item name="WAVELENGTH_UNITS">Nanometers</Item>
  <Item name="WAVELENGTH" sample="1">550.5</Item>
  <Item sample="0" name="wavelength" role="x"> 450 </Item>
</GDALMetadata>"#;

    #[test]
    fn items_in_nanometres_and_micrometres_are_found() {
        assert_eq!(wavelengths_of(TEXT, 2).unwrap(), Some(vec![450.0, 550.5]));
        let micrometres = TEXT.replace("Nanometers", "Micrometers").replace("550.5", "0.5505").replace("450", ".45");
        assert_eq!(wavelengths_of(&micrometres, 2).unwrap(), Some(vec![450.0, 550.5]));
        let of_gdal = r#"<Item name="CENTRAL_WAVELENGTH_UM" sample="0" domain="IMAGERY">0.865</Item>"#;
        assert_eq!(wavelengths_of(of_gdal, 1).unwrap(), Some(vec![865.0]));
    }

    #[test]
    fn what_is_incomplete_tells_nothing_and_an_unknown_unit_is_told() {
        for (text, bands) in [
            (TEXT.to_string(), 3),
            (TEXT.replace("550.5", "green"), 2),
            (TEXT.replace("sample=\"1\"", "sample=\"7\""), 2),
            (TEXT.replace("</Item>", ""), 2),
            (String::new(), 1),
            (TEXT.to_string(), usize::MAX),
        ] {
            assert_eq!(wavelengths_of(&text, bands).unwrap(), None, "{text}");
        }
        assert!(wavelengths_of(&TEXT.replace("Nanometers", "GHz"), 2).is_err());
        for length in (0..TEXT.len()).filter(|length| TEXT.is_char_boundary(*length)) {
            let _ = wavelengths_of(&TEXT[..length], 2);
        }
    }
}
