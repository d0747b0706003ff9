//! One voxel: the flakes in it. Twin: `shaders/voltex_voxel.wgsl`.

use super::matrix::Sym3;
use crate::quantize::{half_at, word_from_halves};

/// Words of a voxel in the resident form.
pub const VOXEL_WORDS: usize = 8;
/// N has the eigenvectors of S and this power of its eigenvalues: of those tried the best against true flakes.
const MOMENT_POWER: f32 = 0.75;
/// Directions over which S's projected area is averaged, and their weights: the 26-point rule of degree 7 [Lebedev 1976],
/// opposite points taken together.
pub(crate) const DIRECTIONS: [([f32; 3], f32); 13] = {
    const E: f32 = std::f32::consts::FRAC_1_SQRT_2;
    const C: f32 = 0.577_350_26;
    const WA: f32 = 2.0 / 21.0;
    const WE: f32 = 8.0 / 105.0;
    const WC: f32 = 9.0 / 140.0;
    [
        ([1.0, 0.0, 0.0], WA),
        ([0.0, 1.0, 0.0], WA),
        ([0.0, 0.0, 1.0], WA),
        ([E, E, 0.0], WE),
        ([E, -E, 0.0], WE),
        ([E, 0.0, E], WE),
        ([E, 0.0, -E], WE),
        ([0.0, E, E], WE),
        ([0.0, E, -E], WE),
        ([C, C, C], WC),
        ([C, C, -C], WC),
        ([C, -C, C], WC),
        ([C, -C, -C], WC),
    ]
};

/// The flakes of a voxel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Voxel {
    /// `sqrt(d' S d)` is the optical depth along d, a vector of texture space.
    pub extinction: Sym3,
    /// Sum over the flakes of `a n n'`, in proportion to `extinction`.
    pub moment: Sym3,
    /// Number of the material.
    pub material: u32,
}

impl Voxel {
    /// A voxel whose moment is derived from its extinction.
    pub fn new(extinction: Sym3, material: u32) -> Voxel {
        Voxel { extinction, moment: moment_of(&extinction), material }
    }

    /// The same flakes, `factor` times as many.
    pub fn scaled(&self, factor: f32) -> Voxel {
        Voxel { extinction: self.extinction.scale(factor * factor), moment: self.moment.scale(factor), ..*self }
    }

    /// The voxel at a word. Twin: `voltex_voxel`.
    pub fn at(words: &[u32], at: usize) -> Voxel {
        let scale = f32::from_bits(words[at]);
        let halves = |first: usize| Sym3(std::array::from_fn(|i| half_at(words[at + first + i / 2], i as u32 % 2)));
        Voxel { extinction: halves(1).scale(scale * scale), moment: halves(4).scale(scale), material: words[at + 7] }
    }

    /// As words.
    pub fn words(&self) -> [u32; VOXEL_WORDS] {
        let most = self.extinction.0[..3].iter().fold(0.0f32, |most, x| most.max(*x));
        let scale = most.sqrt().max(1e-12);
        let (s, n) = (self.extinction.scale(1.0 / (scale * scale)), self.moment.scale(1.0 / scale));
        let pair = |m: &Sym3, i: usize| word_from_halves(m.0[2 * i], m.0[2 * i + 1]);
        [scale.to_bits(), pair(&s, 0), pair(&s, 1), pair(&s, 2), pair(&n, 0), pair(&n, 1), pair(&n, 2), self.material]
    }
}

/// The moment of flakes with the extinction matrix `s`: of their area, which is twice what they project on average.
pub fn moment_of(s: &Sym3) -> Sym3 {
    let area: f32 = 2.0 * DIRECTIONS.iter().map(|(d, weight)| weight * s.form(*d, *d).max(0.0).sqrt()).sum::<f32>();
    let powered = s.mapped(|x| x.max(0.0).powf(MOMENT_POWER));
    powered.scale(area / powered.trace().max(1e-30))
}
