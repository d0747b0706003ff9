//! Tests files of version 1 with the values that they decode to. They are frozen: every later version must read them
//! and give these values.
//!
//! `runtime/examples/write_vectors.rs` has made `tests/vectors/v1`, which is never written again.

#[path = "vectors/line.rs"]
mod line;

use btf_runtime::{Asset, Levels, ResidentFile, open, pack, serial};
use line::{Line, decoded, folder};
use std::sync::Arc;

/// Largest relative difference between machines: a value's share, and what is left of a sharp lobe's cosine in single
/// precision.
const RELATIVE: f32 = 1e-4;
const ABSOLUTE: f32 = 1e-5;

fn close(a: [f32; 3], b: [f32; 3]) -> bool {
    (0..3).all(|c| (a[c] - b[c]).abs() <= ABSOLUTE + RELATIVE * a[c].abs())
}

#[test]
fn every_vector_of_version_1_is_read_and_decodes_to_its_values() {
    let mut files = 0;
    for entry in std::fs::read_dir(folder()).expect("tests/vectors/v1 is there") {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "spmm") {
            continue;
        }
        let name = path.display();
        let bytes = std::fs::read(&path).unwrap();
        let file =
            open(Arc::new(bytes.clone()), Levels::AtHand, &serial).unwrap_or_else(|error| panic!("{name}: {error}"));
        let text = std::fs::read_to_string(path.with_extension("values")).unwrap();
        let lines: Vec<Line> = text.lines().map(Line::parse).collect();
        let mut foreign = 0;
        for (i, line) in lines.iter().enumerate() {
            let got = decoded(&file, line);
            assert!(close(line.value, got), "{name}: {}got {got:?}", line.text());
            // Planted difference: the next line's value.
            foreign += usize::from(!close(lines[(i + 1) % lines.len()].value, got));
        }
        assert!(lines.len() == 60 && foreign > 40, "{name}: {} {foreign}", lines.len());
        // What was read is written as it was.
        let again = if ResidentFile::is_one(&bytes) { file.pack() } else { pack(&Asset::parse(&bytes).unwrap()) };
        assert!(again.unwrap() == bytes, "{name}: written again it has other bytes");
        files += 1;
    }
    assert_eq!(files, 4);
}
