//! Tables of measured spectra, as laboratories keep them.
//!
//! Two layouts. **Columns**: the first column holds wavelengths in nanometres, each other one a share of light of a leaf;
//! its name holds `reflectance` or `transmittance` (or `R`, `T`, `refl`, `trans`, `rho`, `tau`) as its first or last word
//! and the leaf's name in the rest; the word `adaxial` or `abaxial` beside it names the face that was lit. Columns of standard
//! deviations are passed over. **Rows**: three or more columns are named
//! by wavelengths (`450`, `X450`, `450nm`), and each row is a share of light of a leaf, named by a column `name`, `sample`,
//! `id` or `leaf`, by a column `quantity`, `measurement` or `type`, without which rows are reflectance, and by a column
//! `face`, `side` or `surface` with the words for it. A table whose first
//! column is called `wavelength`, `wl`, `nm` or `lambda` has columns. Commas, semicolons or tabs separate values; with the
//! latter two a comma may be the decimal point. Cells that are empty, no number, or below -1 (`-9.999`) were not measured.

use std::collections::BTreeMap;
use std::path::Path;

use btf_capture::delimited::{fields, lines, separator_of};
use btf_capture::toml_text::bounded_text;

use crate::error::SynthError;
use crate::inversion::forward::place_of;
use crate::inversion::spectra::{LeafSpectra, SHARE_NAMES, SHARES};
use crate::optics::abm::path_lengths::Face;

/// Largest table that is read, in bytes: 10,000 leaves at 2,101 wavelengths.
const MAX_BYTES: u64 = 512 << 20;
/// Columns that are named by wavelengths from which on leaves are rows.
const MIN_WAVELENGTH_COLUMNS: usize = 3;
/// Wavelengths in nanometres that the heading of a column may mean.
const HEADING_NM: [f64; 2] = [200.0, 3000.0];
/// Value below which a cell says that nothing was measured, before it is scaled.
const MIN_MEASURED: f64 = -1.0;
/// Words that name the shares of light.
const WORDS: [&[&str]; 2] =
    [&["reflectance", "refl", "r", "rho", "reflectivity"], &["transmittance", "trans", "tran", "t", "tau"]];
/// Words that name the faces.
const FACE_WORDS: [&str; 2] = ["adaxial", "abaxial"];
/// Words that name how values differ, which are no shares of light.
const DEVIATIONS: [&str; 7] = ["sd", "std", "stdev", "se", "sem", "deviation", "error"];
/// Beginnings of the name of a column of wavelengths.
const WAVELENGTHS: [&str; 4] = ["wavelength", "wl", "nm", "lambda"];

/// Spectra of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadSpectra {
    /// Leaves in the order of the table, all over its wavelengths.
    pub leaves: Vec<LeafSpectra>,
    /// Number of cells that hold no measurement.
    pub gaps: usize,
    /// Names of the leaves without any measurement, which are left out.
    pub left_out: Vec<String>,
}

/// Reads a table of spectra. `scale` multiplies every value: 0.01 for percent. `face` is the one that was lit where the table
/// names none.
///
/// # Errors
/// [`SynthError::BadSpectra`] with what is wrong: no table, no wavelengths, no leaf, a share or a wavelength given twice,
/// rows that do not fit the heading, values that are no shares of light.
pub fn read_spectra(path: impl AsRef<Path>, scale: f64, face: Face) -> Result<ReadSpectra, SynthError> {
    let path = path.as_ref();
    let bad = |reason: String| SynthError::BadSpectra { path: path.display().to_string(), reason };
    let text = bounded_text(path, MAX_BYTES, "a table of spectra")
        .map_err(|fault| bad(format!("it {fault}; give a CSV table in UTF-8")))?;
    let stem = path.file_stem().map_or_else(|| "leaf".to_owned(), |stem| stem.to_string_lossy().into_owned());
    read_table(text.trim_start_matches('\u{FEFF}'), &stem, scale, face).map_err(bad)
}

/// Table that is split into cells.
struct Table {
    names: Vec<String>,
    /// Number of each row's line, and its cells, as many as there are names.
    rows: Vec<(usize, Vec<String>)>,
    separator: char,
    scale: f64,
    /// Face that was lit where nothing names one.
    face: Face,
}

impl Table {
    fn split(text: &str, scale: f64, face: Face) -> Result<Table, String> {
        let mut lines = lines(text);
        let (number, heading) = lines.next().ok_or("it is empty")?;
        let separator = separator_of(heading);
        let split =
            |number: usize, line: &str| fields(line, separator).map_err(|fault| format!("line {number}: {fault}"));
        let names = split(number, heading)?;
        let mut rows = Vec::new();
        for (number, line) in lines {
            let mut cells = split(number, line)?;
            while cells.len() > names.len() && cells.last().is_some_and(String::is_empty) {
                cells.pop();
            }
            if cells.len() > names.len() {
                return Err(format!(
                    "line {number} has {} values where the heading names {}; name every column, and separate by \
                     semicolons where commas are decimal",
                    cells.len(),
                    names.len()
                ));
            }
            cells.resize(names.len(), String::new());
            rows.push((number, cells));
        }
        Ok(Table { names, rows, separator, scale, face })
    }

    /// Returns the number in a cell.
    fn number(&self, text: &str) -> Option<f64> {
        let parsed = match self.separator {
            ',' => text.parse(),
            _ => text.replace(',', ".").parse(),
        };
        parsed.ok().filter(|value: &f64| value.is_finite())
    }

    /// Returns the share of light in a cell; NaN where nothing was measured.
    fn share(&self, text: &str) -> f64 {
        let value = self.number(text).filter(|value| *value > MIN_MEASURED);
        value.map_or(f64::NAN, |value| self.scale * value)
    }
}

/// Shares of light of a leaf, each over all wavelengths of the table, as far as there are.
type Measured = [Option<Vec<f64>>; SHARES];

/// Leaves of a table in its order.
#[derive(Default)]
struct Leaves {
    order: Vec<String>,
    by_name: BTreeMap<String, Measured>,
}

impl Leaves {
    fn put(&mut self, name: &str, share: usize, values: Vec<f64>) -> Result<(), String> {
        if !self.by_name.contains_key(name) {
            self.order.push(name.to_owned());
        }
        match self.by_name.entry(name.to_owned()).or_default()[share].replace(values) {
            None => Ok(()),
            Some(_) => {
                Err(format!("it has the {} of `{name}` twice; give each leaf a name of its own", SHARE_NAMES[share]))
            }
        }
    }
}

fn read_table(text: &str, stem: &str, scale: f64, face: Face) -> Result<ReadSpectra, String> {
    let table = Table::split(text, scale, face)?;
    let columns_nm: Vec<Option<f64>> = table.names.iter().map(|name| wavelength_of(name)).collect();
    let first = table.names.first().map_or_else(String::new, |name| name.to_lowercase());
    let are_rows = columns_nm.iter().flatten().count() >= MIN_WAVELENGTH_COLUMNS
        && !WAVELENGTHS.iter().any(|word| first.starts_with(word));
    let mut leaves = Leaves::default();
    let nm = match are_rows {
        true => read_rows(&table, &columns_nm, stem, &mut leaves)?,
        false => read_columns(&table, stem, &mut leaves)?,
    };
    let mut read = ReadSpectra { leaves: Vec::new(), gaps: 0, left_out: Vec::new() };
    let mut order: Vec<usize> = (0..nm.len()).collect();
    order.sort_by(|a, b| nm[*a].total_cmp(&nm[*b]));
    if let Some(pair) = order.windows(2).find(|pair| nm[pair[0]] == nm[pair[1]]) {
        return Err(format!("it has {} nm twice; average what detectors overlap", nm[pair[0]]));
    }
    let sorted = |values: &Vec<f64>| order.iter().map(|i| values[*i]).collect::<Vec<f64>>();
    for name in &leaves.order {
        let shares = leaves.by_name[name].each_ref().map(|shares| shares.as_ref().map(sorted).unwrap_or_default());
        read.gaps += shares.iter().flatten().filter(|share| share.is_nan()).count();
        if shares.iter().flatten().all(|share| share.is_nan()) {
            read.left_out.push(name.clone());
        } else {
            read.leaves.push(LeafSpectra::of_faces(name, &sorted(&nm), shares.each_ref().map(Vec::as_slice))?);
        }
    }
    match (read.leaves.is_empty(), read.left_out.is_empty()) {
        (true, true) => Err("it has no leaf: a column or a row for each share of light is expected".to_owned()),
        (true, false) => Err(format!("nothing was measured of {}", read.left_out.join(", "))),
        _ => Ok(read),
    }
}

/// Reads leaves from columns. Returns the wavelengths.
fn read_columns(table: &Table, stem: &str, leaves: &mut Leaves) -> Result<Vec<f64>, String> {
    if table.names.len() < 2 {
        return Err("it has one column; wavelengths and shares of light are expected".to_owned());
    }
    let wavelength = |(line, cells): &(usize, Vec<String>)| {
        table.number(&cells[0]).ok_or_else(|| {
            let found = &cells[0];
            format!("line {line} starts with `{found}`; wavelengths in nanometres are expected in the first column")
        })
    };
    let nm = table.rows.iter().map(wavelength).collect::<Result<Vec<f64>, String>>()?;
    for (column, heading) in table.names.iter().enumerate().skip(1) {
        if let Some((name, share)) = share_of(heading, stem, table.face) {
            leaves.put(&name, share, table.rows.iter().map(|(_, cells)| table.share(&cells[column])).collect())?;
        }
    }
    Ok(nm)
}

/// Reads leaves from rows. Returns the wavelengths.
fn read_rows(table: &Table, columns_nm: &[Option<f64>], stem: &str, leaves: &mut Leaves) -> Result<Vec<f64>, String> {
    let find = |words: &[&str]| {
        let named = |(name, nm): (&String, &Option<f64>)| nm.is_none() && words.contains(&name.to_lowercase().as_str());
        table.names.iter().zip(columns_nm).position(named)
    };
    let name_at = find(&["name", "sample", "id", "leaf", "sample_id", "sample_name"]);
    let quantity_at = find(&["quantity", "measurement", "type"]);
    let face_at = find(&["face", "side", "surface"]);
    for (line, cells) in &table.rows {
        let side = match quantity_at.map(|at| cells[at].as_str()) {
            None => 0,
            Some(word) => side_of(word).ok_or_else(|| {
                format!("line {line} has `{word}` for its quantity; reflectance or transmittance is expected")
            })?,
        };
        let name = match name_at.map(|at| cells[at].as_str()) {
            Some(name) if !name.is_empty() => name.to_owned(),
            // One leaf, unless rows are told apart by nothing but their place.
            None if quantity_at.is_some() => stem.to_owned(),
            _ => format!("{stem}-{line}"),
        };
        let face = match face_at.map(|at| cells[at].as_str()).filter(|word| !word.is_empty()) {
            None => place_of(table.face),
            Some(word) => face_of(word)
                .ok_or_else(|| format!("line {line} has `{word}` for its face; adaxial or abaxial is expected"))?,
        };
        let shares = cells.iter().zip(columns_nm).filter(|(_, nm)| nm.is_some());
        leaves.put(&name, 2 * face + side, shares.map(|(text, _)| table.share(text)).collect())?;
    }
    Ok(columns_nm.iter().flatten().copied().collect())
}

/// Returns the wavelength that names a column: `450`, `X450`, `wl_450`, `450nm`, but no sample that ends in digits.
fn wavelength_of(name: &str) -> Option<f64> {
    let name = name.trim_end_matches("nm").trim_end_matches(['_', ' ']);
    let digits = name.trim_start_matches(|c: char| c.is_alphabetic() || c == '_');
    let prefix = name[..name.len() - digits.len()].to_lowercase();
    let value = digits.parse().ok().filter(|nm| (HEADING_NM[0]..=HEADING_NM[1]).contains(nm));
    value.filter(|_| ["", "x", "wl", "wl_", "w", "nm", "nm_"].contains(&prefix.as_str()))
}

fn side_of(word: &str) -> Option<usize> {
    let word = word.to_lowercase();
    (0..2).find(|side| WORDS[*side].contains(&word.as_str()))
}

fn face_of(word: &str) -> Option<usize> {
    let word = word.to_lowercase();
    FACE_WORDS.iter().position(|face| word == *face)
}

/// Returns the leaf and the share of light that the heading of a column names; `None` for deviations.
fn share_of(heading: &str, stem: &str, face: Face) -> Option<(String, usize)> {
    let mut words = heading.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    if words.next_back().is_some_and(|last| DEVIATIONS.contains(&last.to_lowercase().as_str())) {
        return None;
    }
    let (face, heading) = match without_word(heading, Reach::Beside, face_of) {
        Some((place, rest)) => (place, rest),
        None => (place_of(face), heading.to_owned()),
    };
    let (side, rest) = without_word(&heading, Reach::Ends, side_of).unwrap_or((0, heading));
    let name = rest.trim_matches(|c: char| !c.is_alphanumeric());
    Some((if name.is_empty() { stem.to_owned() } else { name.to_owned() }, 2 * face + side))
}

/// How far into a heading a word is looked for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Reach {
    /// First and last word of the heading.
    Ends,
    /// The words beside the first and the last, too.
    Beside,
}

/// Looks for a word with a meaning, as far into a heading as `reach` says. Returns the meaning and the heading
/// without it.
fn without_word(heading: &str, reach: Reach, meaning: fn(&str) -> Option<usize>) -> Option<(usize, String)> {
    let mut words = Vec::new();
    let mut start = None;
    for (at, c) in heading.char_indices().chain([(heading.len(), ' ')]) {
        match (c.is_alphanumeric(), start) {
            (true, None) => start = Some(at),
            (false, Some(from)) => {
                words.push(from..at);
                start = None;
            }
            _ => {}
        }
    }
    let count = words.len();
    let beside = [count.checked_sub(2), Some(1)].map(|place| place.filter(|_| reach == Reach::Beside));
    // A heading of one word has it as its first.
    let places = [count.checked_sub(1), Some(0)].into_iter().chain(beside);
    let found = |place: usize| Some((words.get(place)?.clone(), meaning(heading.get(words.get(place)?.clone())?)?));
    let (word, meant) = places.flatten().find_map(found)?;
    Some((meant, format!("{}{}", &heading[..word.start], &heading[word.end..])))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> ReadSpectra {
        read_table(text, "file", 1.0, Face::Adaxial).unwrap()
    }

    #[test]
    fn columns_hold_a_share_of_a_leaf_each() {
        let text = "# by hand\nwavelength_nm,oak reflectance,oak_T,ash\n400,0.05,0.01,0.06\n450,,0.02,-9.999\n500,NA,0.03,0.08\n";
        let ReadSpectra { leaves, gaps, .. } = read(text);
        assert_eq!(gaps, 3);
        let [oak, ash] = &leaves[..] else { panic!("{leaves:?}") };
        assert_eq!((oak.name.as_str(), ash.name.as_str()), ("oak", "ash"));
        assert_eq!(oak.wavelengths_nm, [400.0, 450.0, 500.0]);
        assert!(oak.shares[0][0] == 0.05 && oak.shares[0][1].is_nan() && oak.shares[1] == [0.01, 0.02, 0.03]);
        assert!(ash.wavelengths_nm == oak.wavelengths_nm && ash.shares[0][1].is_nan() && ash.shares[0][2] == 0.08);
    }

    #[test]
    fn both_faces_are_one_leaf_and_a_bare_quantity_is_the_files() {
        let faces = read("wl;R(adaxial);T(adaxial);R(abaxial)\n400;0,05;0,01;0,09\n");
        let [leaf] = &faces.leaves[..] else { panic!("{faces:?}") };
        assert_eq!((leaf.name.as_str(), leaf.faces()), ("file", [true, true]));
        assert_eq!([0, 1, 2].map(|share| leaf.shares[share][0]), [0.05, 0.01, 0.09]);
        assert!(leaf.shares[3][0].is_nan());
        // Where a table names no face, the caller does.
        let back = read_table("nm,oak R,adaxial ash R\n400,0.1,0.2\n", "file", 1.0, Face::Abaxial).unwrap();
        assert_eq!([0, 1].map(|leaf| back.leaves[leaf].faces()), [[false, true], [true, false]]);
        let rows = read("id,face,X400,X450,X500\na,adaxial,0.1,0.1,0.1\na,abaxial,0.2,0.2,0.2\n");
        assert_eq!((rows.leaves.len(), rows.leaves[0].shares[2][0]), (1, 0.2));
        let bare = read("nm\treflectance\ttransmittance\n400\t0.05\t0.01\n");
        assert_eq!((bare.leaves.len(), bare.leaves[0].name.as_str()), (1, "file"));
    }

    #[test]
    fn rows_are_leaves_where_columns_are_wavelengths() {
        let text =
            "sample,species,quantity,X400,X450,500nm\na,oak,R,0.1,0.2,0.3\na,oak,T,0.01,,0.03\nb,ash,R,0.4,0.5,0.6\n";
        let ReadSpectra { leaves, gaps, .. } = read(text);
        assert_eq!((leaves.len(), gaps), (2, 1));
        assert_eq!(leaves[1].shares[0], [0.4, 0.5, 0.6]);
        assert!(leaves[0].shares[1][1].is_nan());
        // Without a column for it, rows are reflectance, named by their lines.
        assert_eq!(read("400,450,500\n0.1,0.2,0.3\n").leaves[0].name, "file-2");
    }

    #[test]
    fn headings_of_many_hands_name_leaves_and_shares() {
        for (heading, leaf, side) in [
            ("oak (T)", "oak", 1),
            ("oak [R]", "oak", 0),
            ("oak T (%)", "oak", 1),
            ("Transmittance of oak", "of oak", 1),
            ("R", "file", 0),
            ("\u{e9}rable_R", "\u{e9}rable", 0),
            ("0401", "0401", 0),
            ("", "file", 0),
            ("oak abaxial T", "oak", 3),
            ("Abaxial oak (R)", "oak", 2),
            ("T adaxial oak", "oak", 1),
            ("oak_R_abaxial", "oak", 2),
        ] {
            assert_eq!(share_of(heading, "file", Face::Adaxial), Some((leaf.to_owned(), side)), "{heading}");
        }
        assert_eq!(share_of("oak reflectance SD", "file", Face::Adaxial), None);
        // Leaves whose names are numbers, beside a column that says that it holds wavelengths.
        let numbered = read("wavelength,0401,0402,0403\n400,0.1,0.2,0.3\n");
        assert_eq!(numbered.leaves.iter().map(|leaf| leaf.name.as_str()).collect::<Vec<_>>(), ["0401", "0402", "0403"]);
        // A leaf that was never measured is left out and told; wavelengths may fall.
        let empty = read("nm,a,b\n450,0.1,\n400,0.2,NA\n");
        assert_eq!((empty.left_out, &empty.leaves[0].shares[0][..]), (vec!["b".to_owned()], &[0.2, 0.1][..]));
    }

    #[test]
    fn percent_is_scaled_or_told() {
        let text = "nm,r\n400,5\n450,40\n";
        assert!(read_table(text, "f", 1.0, Face::Adaxial).unwrap_err().contains("divide percent by 100"));
        assert_eq!(read_table(text, "f", 0.01, Face::Adaxial).unwrap().leaves[0].shares[0], [0.05, 0.4]);
        // What was not measured stays so.
        let gappy = read_table("nm,r\n400,-9.999\n450,40\n", "f", 0.01, Face::Adaxial).unwrap();
        assert!(gappy.gaps == 1 && gappy.leaves[0].shares[0][0].is_nan());
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
            ("id,side,400,450,500\na,left,0.1,0.1,0.1\n", "`left` for its face"),
            ("id,type,400,450,500\na,absorptance,0.1,0.1,0.1\n", "`absorptance`"),
            ("nm,R\n", "nothing was measured of file"),
            ("nm,R\n400,0,05\n", "line 2 has 3 values where the heading names 2"),
            ("nm,R\n700,0.1\n700,0.2\n", "700 nm twice"),
            ("400,450,500\na,0.1,0.2,0.3\n", "line 2 has 4 values"),
        ] {
            let fault = read_table(text, "file", 1.0, Face::Adaxial).unwrap_err();
            assert!(fault.contains(clause), "{text:?}: {fault}");
        }
        let missing = read_spectra("nowhere/at-all.csv", 1.0, Face::Adaxial).unwrap_err().to_string();
        assert!(missing.contains("nowhere/at-all.csv") && missing.contains("cannot be read"), "{missing}");
    }
}
