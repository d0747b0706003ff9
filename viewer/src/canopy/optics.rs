//! Reflectance and transmittance of leaves, other organs and soil in bands, read from tables.

use crate::error::ViewerError;
use btf_capture::delimited::{fields, lines, separator_of};
use btf_capture::toml_text::bounded_text;
use btf_runtime::FaceGloss;
use std::path::Path;

/// Largest table that is read, in bytes.
const MAX_BYTES: u64 = 1 << 22;
/// Bands at most.
pub const MAX_CANOPY_BANDS: usize = 256;

/// Reflectances and transmittances in bands.
#[derive(Debug, Clone, PartialEq)]
pub struct CanopyOptics {
    /// Wavelengths of the bands in nanometres, ascending.
    pub wavelengths_nm: Vec<f64>,
    /// Of light on a leaf's upper face, then on its lower: reflectance and transmittance of each band, 0 to 1; with a gloss, of
    /// the light that it lets in.
    pub leaf: [[Vec<f64>; 2]; 2],
    /// Gloss of both faces of leaves, if any.
    pub gloss: Option<FaceGloss>,
    /// Reflectance of stems and other organs, which transmit nothing.
    pub other: Vec<f64>,
    /// Reflectance of the soil.
    pub soil: Vec<f64>,
}

/// A table of curves over wavelength.
#[derive(Debug, Clone, PartialEq)]
pub struct SpectraTable {
    name: String,
    wavelengths_nm: Vec<f64>,
    /// Heading, in lower case, and values.
    columns: Vec<(String, Vec<f64>)>,
}

impl SpectraTable {
    /// Reads a table (CSV, also with semicolons or tabs): wavelengths in nanometres in its first column, ascending, and
    /// shares of light, 0 to 1, in the others. The first line names the columns.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] for what is no such table.
    pub fn read(path: &Path) -> Result<SpectraTable, ViewerError> {
        let bad = |reason: String| ViewerError::Usage(format!("{}: {reason}", path.display()));
        let text = bounded_text(path, MAX_BYTES, "a table").map_err(|fault| bad(format!("it {fault}")))?;
        let text = text.trim_start_matches('\u{FEFF}');
        let mut rows = lines(text);
        let Some((_, heading)) = rows.next() else { return Err(bad("it is empty".into())) };
        let separator = separator_of(heading);
        let headings = fields(heading, separator).map_err(|fault| bad(fault.into()))?;
        let mut table = SpectraTable {
            name: path.display().to_string(),
            wavelengths_nm: Vec::new(),
            columns: headings.iter().skip(1).map(|heading| (heading.trim().to_lowercase(), Vec::new())).collect(),
        };
        if table.columns.is_empty() {
            return Err(bad("its first line names no column behind that of wavelengths".into()));
        }
        for (number, line) in rows {
            let cells = fields(line, separator).map_err(|fault| bad(format!("line {number}: {fault}")))?;
            let numbers: Option<Vec<f64>> = cells.iter().map(|cell| cell.trim().parse().ok()).collect();
            let Some(numbers) = numbers.filter(|numbers| numbers.len() == 1 + table.columns.len()) else {
                return Err(bad(format!("line {number} has not a number for each column")));
            };
            if table.wavelengths_nm.last().is_some_and(|last| numbers[0] <= *last) || numbers[0] <= 0.0 {
                return Err(bad(format!("line {number}: wavelengths must ascend, in nm")));
            }
            if let Some(share) = numbers[1..].iter().find(|share| !(0.0..=1.0).contains(*share)) {
                return Err(bad(format!("line {number}: {share} is no share of light; give 0 to 1")));
            }
            table.wavelengths_nm.push(numbers[0]);
            table.columns.iter_mut().zip(&numbers[1..]).for_each(|((_, values), share)| values.push(*share));
        }
        if table.wavelengths_nm.is_empty() {
            return Err(bad("it has no rows of numbers".into()));
        }
        Ok(table)
    }

    /// Returns a table of one column with the same share at all wavelengths.
    pub fn constant(share: f64) -> SpectraTable {
        SpectraTable {
            name: share.to_string(),
            wavelengths_nm: vec![1.0, 1e6],
            columns: vec![(String::new(), vec![share; 2])],
        }
    }

    /// Returns the wavelengths in nanometres.
    pub fn wavelengths_nm(&self) -> &[f64] {
        &self.wavelengths_nm
    }

    /// Returns the column that is named by all of `words`, or by their first letters, at `wavelengths_nm`; linear between rows.
    fn column(&self, words: &[&str], wavelengths_nm: &[f64]) -> Result<Option<Vec<f64>>, ViewerError> {
        let named = |heading: &str| {
            let of: Vec<&str> = heading.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
            words.iter().all(|word| of.iter().any(|one| one == word || (one.len() == 1 && word.starts_with(*one))))
        };
        let Some((_, values)) = self.columns.iter().find(|(heading, _)| named(heading)) else { return Ok(None) };
        self.at(values, wavelengths_nm).map(Some)
    }

    fn at(&self, values: &[f64], wavelengths_nm: &[f64]) -> Result<Vec<f64>, ViewerError> {
        let nm = &self.wavelengths_nm;
        let (first, last) = (nm[0], nm[nm.len() - 1]);
        let of = |wanted: &f64| {
            if !(first..=last).contains(wanted) {
                return Err(ViewerError::Usage(format!(
                    "{} covers {first} to {last} nm, and {wanted} nm is asked for; choose others with --bands-nm",
                    self.name
                )));
            }
            let above = nm.partition_point(|known| known < wanted);
            if nm[above] == *wanted {
                return Ok(values[above]);
            }
            let share = (wanted - nm[above - 1]) / (nm[above] - nm[above - 1]);
            Ok(values[above - 1] + share * (values[above] - values[above - 1]))
        };
        wavelengths_nm.iter().map(of).collect()
    }
}

impl CanopyOptics {
    /// Puts the optics together at `wavelengths_nm`, ascending: of a leaf's table, as `btf-synth spectrum --csv` writes it for
    /// one face or both; of a table whose first column is the soil's reflectance; and of one for other organs, which
    /// else have that of the leaf's upper face.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] for tables without the columns, or that do not cover the wavelengths, for a leaf that makes light,
    /// and for no bands or more than [`MAX_CANOPY_BANDS`].
    pub fn new(
        wavelengths_nm: &[f64],
        leaf: &SpectraTable,
        soil: &SpectraTable,
        other: Option<&SpectraTable>,
    ) -> Result<CanopyOptics, ViewerError> {
        let count = wavelengths_nm.len();
        if count == 0 || count > MAX_CANOPY_BANDS {
            return Err(ViewerError::Usage(format!(
                "{count} bands are asked for; choose 1 to {MAX_CANOPY_BANDS} with --bands-nm"
            )));
        }
        let face = |face: &str| -> Result<Option<[Vec<f64>; 2]>, ViewerError> {
            let r = leaf.column(&[face, "reflectance"], wavelengths_nm)?;
            let t = leaf.column(&[face, "transmittance"], wavelengths_nm)?;
            Ok(r.zip(t).map(|(r, t)| [r, t]))
        };
        let plain =
            leaf.column(&["reflectance"], wavelengths_nm)?.zip(leaf.column(&["transmittance"], wavelengths_nm)?);
        let Some(upper) = face("adaxial")?.or(plain.map(|(r, t)| [r, t])) else {
            return Err(ViewerError::Usage(format!(
                "{} has no columns `reflectance` and `transmittance`; `btf-synth spectrum --csv` writes such a table",
                leaf.name
            )));
        };
        let lower = face("abaxial")?.unwrap_or_else(|| upper.clone());
        for [r, t] in [&upper, &lower] {
            if let Some(band) = (0..count).find(|band| r[*band] + t[*band] > 1.0) {
                let nm = wavelengths_nm[band];
                return Err(ViewerError::Usage(format!("{}: at {nm} nm the leaf makes light", leaf.name)));
            }
        }
        let first = |table: &SpectraTable| table.at(&table.columns[0].1, wavelengths_nm);
        Ok(CanopyOptics {
            wavelengths_nm: wavelengths_nm.to_vec(),
            other: other.map_or_else(|| Ok(upper[0].clone()), first)?,
            leaf: [upper, lower],
            gloss: None,
            soil: first(soil)?,
        })
    }

    /// Returns these optics with leaves whose faces have `gloss`. It takes its share of the leaf's reflectance, which is that of
    /// light along the normal, and the body has the rest.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] for a leaf that reflects less in a band than the gloss alone.
    pub fn with_gloss(mut self, gloss: FaceGloss) -> Result<CanopyOptics, ViewerError> {
        let share = f64::from(gloss.albedo(1.0));
        for [r, t] in &mut self.leaf {
            if let Some(band) = (0..r.len()).find(|band| r[*band] < share) {
                return Err(ViewerError::Usage(format!(
                    "at {} nm the leaf reflects {:.4}, less than the gloss alone does, {share:.4}; give --gloss a smaller index",
                    self.wavelengths_nm[band], r[band]
                )));
            }
            r.iter_mut().for_each(|r| *r = (*r - share) / (1.0 - share));
            t.iter_mut().for_each(|t| *t /= 1.0 - share);
        }
        self.gloss = Some(gloss);
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Result<SpectraTable, ViewerError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("leaf.csv");
        std::fs::write(&path, text).unwrap();
        SpectraTable::read(&path)
    }

    #[test]
    fn faces_are_found_by_their_names_and_bands_lie_between_rows() {
        let both = "nm,adaxial reflectance,adaxial transmittance,abaxial reflectance,abaxial transmittance\n\
                    500,0.1,0.2,0.3,0.4\n600,0.2,0.4,0.3,0.6\n";
        let soil = table("nm;R\n400;0.1\n800;0.5\n").unwrap();
        let optics = CanopyOptics::new(&[550.0, 600.0], &table(both).unwrap(), &soil, None).unwrap();
        let near = |told: &[f64], wanted: [f64; 2]| {
            told.iter()
                .zip(wanted)
                .for_each(|(told, wanted)| assert!((told - wanted).abs() < 1e-12, "{told} {wanted}"));
        };
        near(&optics.leaf[0][0], [0.15, 0.2]);
        near(&optics.leaf[0][1], [0.3, 0.4]);
        near(&optics.leaf[1][1], [0.5, 0.6]);
        near(&optics.soil, [0.25, 0.3]);
        near(&optics.other, [0.15, 0.2]);
        let short =
            CanopyOptics::new(&[550.0], &table("nm,R,T\n500,0.1,0.2\n600,0.3,0.2\n").unwrap(), &soil, None).unwrap();
        assert_eq!(short.leaf[0], short.leaf[1]);
    }

    #[test]
    fn bad_tables_are_refused_with_a_sentence() {
        for (text, part) in [
            ("", "is empty"),
            ("nm\n500\n", "names no column"),
            ("nm,R,T\n500,0.1\n", "line 2 has not"),
            ("nm,R,T\n500,0.1,x\n", "line 2 has not"),
            ("nm,R,T\n500,0.1,0.2\n500,0.1,0.2\n", "must ascend"),
            ("nm,R,T\n500,0.1,1.2\n", "1.2 is no share"),
            ("nm,R,T\n", "no rows"),
        ] {
            let told = table(text).unwrap_err().to_string();
            assert!(told.contains(part) && told.contains("leaf.csv"), "{told}");
        }
        let soil = table("nm,R\n400,0.1\n800,0.5\n").unwrap();
        for (text, nm, part) in [
            ("nm,R\n400,0.1\n800,0.1\n", 500.0, "no columns"),
            ("nm,R,T\n400,0.6,0.6\n800,0.1,0.1\n", 410.0, "makes light"),
            ("nm,R,T\n500,0.1,0.2\n600,0.1,0.1\n", 700.0, "covers 500 to 600 nm"),
        ] {
            let told = CanopyOptics::new(&[nm], &table(text).unwrap(), &soil, None).unwrap_err().to_string();
            assert!(told.contains(part), "{told}");
        }
    }
}
