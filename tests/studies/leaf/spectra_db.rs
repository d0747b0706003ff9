//! Sets of measured leaves as github.com/ashiklom/spectra_db keeps them (`data/angers`, `data/lopex`): `metadata.csvy` with the
//! chemistry by `observation_id`, and `spectra/ID.csvy` with a column for each share of light.

use std::collections::BTreeMap;
use std::error::Error;
use std::fs;
use std::path::Path;

use btf_capture::delimited::{fields, lines};
use btf_synth::LeafSpectra;

/// Reads the numbers of a set's metadata, by leaf and column.
pub fn chemistry(path: &Path) -> Result<BTreeMap<String, BTreeMap<String, f64>>, Box<dyn Error>> {
    let text = fs::read_to_string(path)?;
    let mut rows = lines(&text).map(|(_, line)| fields(line, ','));
    let names = rows.next().ok_or("the metadata are empty")??;
    let mut chemistry = BTreeMap::new();
    for row in rows {
        let row = row?;
        let of = |name: &str| names.iter().position(|known| known == name).and_then(|at| row.get(at));
        let id = of("observation_id").ok_or("a leaf has no observation_id")?.clone();
        let numbers = names.iter().zip(&row).filter_map(|(name, cell)| Some((name.clone(), cell.parse().ok()?)));
        chemistry.insert(id, numbers.collect());
    }
    Ok(chemistry)
}

/// Reads the leaves of a file: reflectance and transmittance by turns.
pub fn leaves_of(path: &Path) -> Result<Vec<LeafSpectra>, Box<dyn Error>> {
    let text = fs::read_to_string(path)?;
    let types = text.lines().skip_while(|line| !line.starts_with("#spectra_types")).skip(1);
    let types: Vec<&str> = types.map_while(|line| line.strip_prefix("#- ")).collect();
    let rows = lines(&text).skip(1).map(|(_, line)| fields(line, ','));
    let rows = rows.collect::<Result<Vec<Vec<String>>, _>>()?;
    let column =
        |at: usize| rows.iter().map(|row| row.get(at).and_then(|x| x.parse().ok()).unwrap_or(f64::NAN)).collect();
    let nm: Vec<f64> = column(0);
    let mut leaves = Vec::new();
    for (at, pair) in types.chunks(2).enumerate() {
        if pair == ["R", "T"] {
            let (r, t): (Vec<f64>, Vec<f64>) = (column(2 * at + 1), column(2 * at + 2));
            leaves.push(LeafSpectra::new("leaf", &nm, &r, &t)?);
        }
    }
    Ok(leaves)
}
