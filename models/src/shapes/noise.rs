//! Gradient noise, which tints and hypertextures are made of.

use serde::{Deserialize, Serialize};

/// Gradient noise with the period of the script's space [Perlin 1985, 2002]: a sum of octaves, each of twice the
/// frequency and `gain` times the height of the previous one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// Lattice cells of the first octave along the space's x, y and z, 1 to 256 each.
    pub cells: [u32; 3],
    /// Number of octaves, 1 to 8.
    #[serde(default = "one_octave")]
    pub octaves: u32,
    /// Height of an octave over that of the one before, 0 to 1.
    #[serde(default = "half")]
    pub gain: f64,
    /// Seed of the gradients.
    #[serde(default = "first_seed")]
    pub seed: u64,
}

fn one_octave() -> u32 {
    1
}

fn half() -> f64 {
    0.5
}

fn first_seed() -> u64 {
    1
}
