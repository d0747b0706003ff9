//! Tables of measured spectra, as laboratories keep them.
//!
//! Two layouts, told apart by the heading. **Columns**: the first column holds wavelengths in nanometres, each other one a
//! share of light of a leaf; its name holds `reflectance` or `transmittance` (or `R`, `T`, `refl`, `trans`, `rho`, `tau`)
//! as its first or last word and the leaf's name in the rest. **Rows**: three or more columns are named by wavelengths
//! (`450`, `X450`, `450nm`), and each row is a share of light of a leaf, named by a column `name`, `sample`, `id` or
//! `leaf`, and by a column `quantity`, `measurement` or `type`; without that, rows are reflectance. Commas, semicolons or
//! tabs separate values; with the latter two a comma may be the decimal point. Cells that are empty, no number, or below
//! -1 (`-9.999`) were not measured.

use std::collections::BTreeMap;
use std::path::Path;

use btf_capture::delimited::{fields, lines, separator_of};
use btf_capture::files;

use crate::error::SynthError;
use crate::inversion::spectra::{LeafSpectra, SHARE_NAMES};

/// Largest table that is read, in bytes: 10,000 leaves at 2,101 wavelengths.
const MAX_BYTES: u64 = 512 << 20;
/// Columns that are named by wavelengths from which on leaves are rows.
const MIN_WAVELENGTH_COLUMNS: usize = 3;
/// Wavelengths in nanometres that the heading of a column may mean.
const HEADING_NM: [f64; 2] = [200.0, 3000.0];
/// Value below which a cell says that nothing was measured.
const LEAST_MEASURED: f64 = -1.0;
/// Words that name the shares of light.
const WORDS: [&[&str]; 2] =
    [&["reflectance", "refl", "r", "rho", "reflectivity"], &["transmittance", "trans", "tran", "t", "tau"]];

/// Spectra of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadSpectra {
    /// Leaves in the order of the table.
    pub leaves: Vec<LeafSpectra>,
    /// Number of cells that hold no measurement.
    pub gaps: usize,
}

/// Reads a table of spectra. `scale` multiplies every value: 0.01 for percent.
///
/// # Errors
/// [`SynthError::BadSpectra`] with what is wrong: no table, no wavelengths, no leaf, a share named twice, values that are
/// no shares of light.
pub fn read_spectra(path: impl AsRef<Path>, scale: f64) -> Result<ReadSpectra, SynthError> {
    let path = path.as_ref();
    let bad = |reason: String| SynthError::BadSpectra { path: path.display().to_string(), reason };
    let text = read_text(path).map_err(bad)?;
    let stem = path.file_stem().map_or_else(|| "leaf".to_owned(), |stem| stem.to_string_lossy().into_owned());
    read_table(&text, &stem, scale).map_err(bad)
}

fn read_text(path: &Path) -> Result<String, String> {
    let is_large = path.metadata().is_ok_and(|metadata| metadata.len() > MAX_BYTES);
    if is_large {
        return Err(format!("it is larger than {} MB; split it", MAX_BYTES >> 20));
    }
    let bytes = files::read(path).map_err(|error| format!("it cannot be read ({error})"))?;
    let text = String::from_utf8(bytes).map_err(|_| "it is not UTF-8 text; save it as CSV".to_owned())?;
    Ok(text.strip_prefix('\u{FEFF}').map_or(text.clone(), str::to_owned))
}

/// Shares of light of a leaf by wavelength, as the table has them.
type Measured = [Vec<(f64, f64)>; 2];

/// Leaves of a table in its order.
#[derive(Default)]
struct Leaves {
    order: Vec<String>,
    by_name: BTreeMap<String, Measured>,
    gaps: usize,
}

impl Leaves {
    /// Returns the values of a leaf's share, which must be new.
    fn share(&mut self, name: &str, side: usize) -> Result<&mut Vec<(f64, f64)>, String> {
        if !self.by_name.contains_key(name) {
            self.order.push(name.to_owned());
        }
        let values = &mut self.by_name.entry(name.to_owned()).or_default()[side];
        match values.is_empty() {
            true => Ok(values),
            false => {
                Err(format!("it has the {} of `{name}` twice; give each leaf a name of its own", SHARE_NAMES[side]))
            }
        }
    }
}

fn read_table(text: &str, stem: &str, scale: f64) -> Result<ReadSpectra, String> {
    let mut rows = lines(text);
    let (_, heading) = rows.next().ok_or("it is empty")?;
    let separator = separator_of(heading);
    let split = |number: usize, line: &str| fields(line, separator).map_err(|fault| format!("line {number}: {fault}"));
    let names = split(1, heading)?;
    let cell = |text: &str| number(text, separator).map(|value| scale * value);
    let columns_nm: Vec<Option<f64>> = names.iter().map(|name| wavelength_of(name)).collect();
    let mut leaves = Leaves::default();
    let rows = rows.map(|(number, line)| Ok((number, split(number, line)?)));
    if columns_nm.iter().flatten().count() >= MIN_WAVELENGTH_COLUMNS {
        read_rows(&names, &columns_nm, rows, stem, &cell, &mut leaves)?;
    } else {
        read_columns(&names, rows, stem, separator, &cell, &mut leaves)?;
    }
    let gaps = leaves.gaps;
    let leaves = leaves.order.iter().map(|name| spectra_of(name, &leaves.by_name[name]));
    let leaves = leaves.collect::<Result<Vec<LeafSpectra>, String>>()?;
    if leaves.is_empty() {
        return Err("it has no leaf: a column or a row for each share of light is expected".to_owned());
    }
    Ok(ReadSpectra { leaves, gaps })
}

/// Numbered rows of a table.
type Row = Result<(usize, Vec<String>), String>;

fn read_columns(
    names: &[String],
    rows: impl Iterator<Item = Row>,
    stem: &str,
    separator: char,
    cell: &dyn Fn(&str) -> Option<f64>,
    leaves: &mut Leaves,
) -> Result<(), String> {
    let shares: Vec<(String, usize)> = names[1..].iter().map(|name| share_of(name, stem)).collect();
    if shares.is_empty() {
        return Err("it has one column; wavelengths and shares of light are expected".to_owned());
    }
    let mut columns: Vec<Vec<(f64, f64)>> = vec![Vec::new(); shares.len()];
    for row in rows {
        let (line, fields) = row?;
        let nm = fields.first().and_then(|text| number(text, separator));
        let nm = nm.ok_or_else(|| {
            let found = fields.first().map_or("", String::as_str);
            format!("line {line} starts with `{found}`; wavelengths in nanometres are expected in the first column")
        })?;
        for (column, values) in columns.iter_mut().enumerate() {
            match fields.get(column + 1).and_then(|text| cell(text)).filter(|value| *value > LEAST_MEASURED) {
                Some(value) => values.push((nm, value)),
                None => leaves.gaps += 1,
            }
        }
    }
    for ((name, side), values) in shares.iter().zip(columns) {
        *leaves.share(name, *side)? = values;
    }
    Ok(())
}

fn read_rows(
    names: &[String],
    columns_nm: &[Option<f64>],
    rows: impl Iterator<Item = Row>,
    stem: &str,
    cell: &dyn Fn(&str) -> Option<f64>,
    leaves: &mut Leaves,
) -> Result<(), String> {
    let find = |words: &[&str]| {
        names
            .iter()
            .zip(columns_nm)
            .position(|(name, nm)| nm.is_none() && words.contains(&name.to_lowercase().as_str()))
    };
    let name_at = find(&["name", "sample", "id", "leaf", "sample_id", "sample_name"]);
    let quantity_at = find(&["quantity", "measurement", "type"]);
    for row in rows {
        let (line, fields) = row?;
        let field = |at: Option<usize>| at.and_then(|at| fields.get(at)).map(String::as_str);
        let name = field(name_at).map_or_else(|| format!("{stem}-{line}"), str::to_owned);
        let side = match field(quantity_at) {
            None => 0,
            Some(word) => side_of(word).ok_or_else(|| {
                format!("line {line} has `{word}` for its quantity; reflectance or transmittance is expected")
            })?,
        };
        let mut values = Vec::new();
        for (text, nm) in fields.iter().zip(columns_nm) {
            let Some(nm) = nm else { continue };
            match cell(text).filter(|value| *value > LEAST_MEASURED) {
                Some(value) => values.push((*nm, value)),
                None => leaves.gaps += 1,
            }
        }
        *leaves.share(&name, side)? = values;
    }
    Ok(())
}

/// Returns the spectra of a leaf over the wavelengths of both shares.
fn spectra_of(name: &str, measured: &Measured) -> Result<LeafSpectra, String> {
    let mut wavelengths_nm: Vec<f64> = measured.iter().flatten().map(|(nm, _)| *nm).collect();
    wavelengths_nm.sort_by(f64::total_cmp);
    wavelengths_nm.dedup();
    let mut shares = [0, 1].map(|_| vec![f64::NAN; wavelengths_nm.len()]);
    for (shares, measured) in shares.iter_mut().zip(measured) {
        for (nm, value) in measured {
            if let Ok(at) = wavelengths_nm.binary_search_by(|x| x.total_cmp(nm)) {
                shares[at] = *value;
            }
        }
    }
    LeafSpectra::new(name, &wavelengths_nm, &shares[0], &shares[1])
}

/// Returns the number in a cell.
fn number(text: &str, separator: char) -> Option<f64> {
    let parsed = match separator {
        ',' => text.parse(),
        _ => text.replace(',', ".").parse(),
    };
    parsed.ok().filter(|value: &f64| value.is_finite())
}

/// Returns the wavelength that names a column.
fn wavelength_of(name: &str) -> Option<f64> {
    let name = name.trim_end_matches("nm").trim_end_matches(['_', ' ']);
    let digits = name.trim_start_matches(|c: char| c.is_alphabetic() || c == '_');
    // `X450` and `wl_450`, but no sample that ends in digits.
    let prefix = name.len() - digits.len();
    let value = digits.parse().ok().filter(|nm| (HEADING_NM[0]..=HEADING_NM[1]).contains(nm));
    value.filter(|_| {
        prefix == 0 || ["x", "wl", "wl_", "w", "nm", "nm_"].contains(&name[..prefix].to_lowercase().as_str())
    })
}

fn side_of(word: &str) -> Option<usize> {
    let word = word.to_lowercase();
    (0..2).find(|side| WORDS[*side].contains(&word.as_str()))
}

/// Returns the leaf and the share of light that the heading of a column names.
fn share_of(heading: &str, stem: &str) -> (String, usize) {
    let is_word = |c: char| c.is_alphanumeric();
    let first = &heading[..heading.find(|c| !is_word(c)).unwrap_or(heading.len())];
    let last = &heading
        [heading.rfind(|c| !is_word(c)).map_or(0, |at| at + heading[at..].chars().next().map_or(1, char::len_utf8))..];
    let (side, rest) = match (side_of(last), side_of(first)) {
        (Some(side), _) => (side, &heading[..heading.len() - last.len()]),
        (None, Some(side)) => (side, &heading[first.len()..]),
        (None, None) => (0, heading),
    };
    let name = rest.trim_matches(|c: char| !is_word(c));
    (if name.is_empty() { stem.to_owned() } else { name.to_owned() }, side)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> ReadSpectra {
        read_table(text, "file", 1.0).unwrap()
    }

    #[test]
    fn columns_hold_a_share_of_a_leaf_each() {
        let text = "# by hand\nwavelength_nm,oak reflectance,oak_T,ash\n400,0.05,0.01,0.06\n450,,0.02,-9.999\n500,NA,0.03,0.08\n";
        let ReadSpectra { leaves, gaps } = read(text);
        assert_eq!(gaps, 3);
        let [oak, ash] = &leaves[..] else { panic!("{leaves:?}") };
        assert_eq!((oak.name.as_str(), ash.name.as_str()), ("oak", "ash"));
        assert_eq!(oak.wavelengths_nm, [400.0, 450.0, 500.0]);
        assert!(oak.shares[0][0] == 0.05 && oak.shares[0][1].is_nan() && oak.shares[1] == [0.01, 0.02, 0.03]);
        assert_eq!((ash.wavelengths_nm.as_slice(), ash.shares[0].as_slice()), (&[400.0, 500.0][..], &[0.06, 0.08][..]));
    }

    #[test]
    fn both_faces_of_a_leaf_are_two_leaves_and_a_bare_quantity_is_the_files() {
        let faces = read("wl;R(adaxial);T(adaxial);R(abaxial)\n400;0,05;0,01;0,09\n");
        assert_eq!(faces.leaves.iter().map(|leaf| leaf.name.as_str()).collect::<Vec<_>>(), ["adaxial", "abaxial"]);
        assert_eq!(faces.leaves[0].shares[1], [0.01]);
        let bare = read("nm\treflectance\ttransmittance\n400\t0.05\t0.01\n");
        assert_eq!((bare.leaves.len(), bare.leaves[0].name.as_str()), (1, "file"));
    }

    #[test]
    fn rows_are_leaves_where_columns_are_wavelengths() {
        let text =
            "sample,species,quantity,X400,X450,500nm\na,oak,R,0.1,0.2,0.3\na,oak,T,0.01,,0.03\nb,ash,R,0.4,0.5,0.6\n";
        let ReadSpectra { leaves, gaps } = read(text);
        assert_eq!((leaves.len(), gaps), (2, 1));
        assert_eq!(leaves[1].shares[0], [0.4, 0.5, 0.6]);
        assert!(leaves[0].shares[1][1].is_nan());
        // Without a column for it, rows are reflectance, named by their lines.
        assert_eq!(read("400,450,500\n0.1,0.2,0.3\n").leaves[0].name, "file-2");
    }

    #[test]
    fn percent_is_scaled_or_told() {
        let text = "nm,r\n400,5\n450,40\n";
        assert!(read_table(text, "f", 1.0).unwrap_err().contains("divide percent by 100"));
        assert_eq!(read_table(text, "f", 0.01).unwrap().leaves[0].shares[0], [0.05, 0.4]);
    }

    #[test]
    fn what_is_no_table_of_spectra_is_told_in_a_clause() {
        for (text, clause) in [
            ("", "empty"),
            ("wavelength\n400\n", "one column"),
            ("nm,R\nfour hundred,0.1\n", "line 2 starts with `four hundred`"),
            ("nm,oak R,oak_R\n400,0.1,0.1\n", "`oak` twice"),
            ("nm,R\n300,0.1\n", "no value between 400 and 2500"),
            ("nm,\"R\n400,0.1\n", "quote"),
            ("id,type,400,450,500\na,absorptance,0.1,0.1,0.1\n", "`absorptance`"),
            ("nm,R\n", "no value"),
        ] {
            let fault = read_table(text, "file", 1.0).unwrap_err();
            assert!(fault.contains(clause), "{text:?}: {fault}");
        }
        let missing = read_spectra("nowhere/at-all.csv", 1.0).unwrap_err().to_string();
        assert!(missing.contains("nowhere/at-all.csv") && missing.contains("cannot be read"), "{missing}");
    }
}
