//! PROSPECT's tables of leaf material: refractive index and specific absorptions of the constituents, 400 to 2500 nm
//! [Feret 2008; Feret 2017].
//!
//! Each is a file of its own, `prospect_5.csv` and `prospect_d.csv`, whose heading names its source, and is part of the
//! program.

use std::sync::LazyLock;

/// Wavelength of a leaf table's first row in nanometres; the rows are 1 nm apart.
pub(crate) const LEAF_FIRST_NM: f64 = 400.0;

/// Wavelength of a leaf table's last row in nanometres.
pub(crate) const LEAF_LAST_NM: f64 = 2500.0;

/// Number of columns of a table: the wavelength, the index and six absorptions.
const COLUMNS: usize = 8;

/// Table of PROSPECT-5 [Feret 2008].
pub(crate) static PROSPECT_5: LazyLock<LeafTable> = LazyLock::new(|| LeafTable::parse(include_str!("prospect_5.csv")));

/// Table of PROSPECT-D [Feret 2017].
pub(crate) static PROSPECT_D: LazyLock<LeafTable> = LazyLock::new(|| LeafTable::parse(include_str!("prospect_d.csv")));

/// Refractive index and specific absorptions of leaf tissue, a row per nanometre.
pub(crate) struct LeafTable {
    /// Refractive index.
    pub(crate) index: Vec<f64>,
    /// Specific absorption of chlorophyll a + b in cm2/ug.
    pub(crate) chlorophyll: Vec<f64>,
    /// Specific absorption of carotenoids in cm2/ug.
    pub(crate) carotenoid: Vec<f64>,
    /// Specific absorption of anthocyanins in cm2/ug.
    pub(crate) anthocyanin: Vec<f64>,
    /// Specific absorption of brown pigment, per arbitrary unit.
    pub(crate) brown: Vec<f64>,
    /// Specific absorption of water in 1/cm.
    pub(crate) water: Vec<f64>,
    /// Specific absorption of dry matter in cm2/g.
    pub(crate) dry_matter: Vec<f64>,
}

impl LeafTable {
    /// Reads a table: comment lines, a heading, rows of [`COLUMNS`] numbers.
    ///
    /// # Panics
    /// If it is no table, which a test would show: the text is part of the program.
    fn parse(text: &str) -> LeafTable {
        let mut columns: [Vec<f64>; COLUMNS] = Default::default();
        for line in text.lines().filter(|line| !line.starts_with('#')).skip(1) {
            let mut fields = line.split(',');
            for column in &mut columns {
                let field = fields.next().and_then(|field| field.parse().ok());
                column.push(field.expect("eight numbers in each row of a leaf table"));
            }
        }
        let [_, index, chlorophyll, carotenoid, anthocyanin, brown, water, dry_matter] = columns;
        LeafTable { index, chlorophyll, carotenoid, anthocyanin, brown, water, dry_matter }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_has_a_row_for_every_nanometre() {
        for (table, text) in
            [(&PROSPECT_5, include_str!("prospect_5.csv")), (&PROSPECT_D, include_str!("prospect_d.csv"))]
        {
            let table: &LeafTable = table;
            let rows = (LEAF_LAST_NM - LEAF_FIRST_NM) as usize + 1;
            let columns = [&table.chlorophyll, &table.carotenoid, &table.anthocyanin, &table.brown, &table.water];
            assert!(columns.iter().all(|column| column.len() == rows) && table.dry_matter.len() == rows);
            assert!(table.index.len() == rows && table.index.iter().all(|index| (1.2..1.6).contains(index)));
            assert!(columns.iter().all(|column| column.iter().all(|absorption| *absorption >= 0.0)));
            let numbers = text.lines().filter(|line| !line.starts_with('#')).skip(1);
            for (row, line) in numbers.enumerate() {
                assert!(line.starts_with(&format!("{},", 400 + row)), "{line}");
                assert_eq!(line.split(',').count(), COLUMNS, "{line}");
            }
        }
    }
}
