//! Prints the error of the share of light that passes a bent skin, docs/results/voltex.md, "Bent skins":
//! `cargo run --release -p btf-tests --example bent_skins [-- PIXELS]`.

use btf_tests::bent_skins::{BENDS, LeavesInCube};

fn main() -> Result<(), std::num::ParseIntError> {
    let pixels = std::env::args().nth(1).map_or(Ok(48), |argument| argument.parse())?;
    let leaves = LeavesInCube::built();
    let rows = BENDS.map(|(name, bend)| format!("{name} {:.4}", leaves.transmittance_error(bend, bend, pixels)));
    println!("{}", rows.join(", "));
    Ok(())
}
