//! The body of a leaf at one place: the shares of the light that entered which leave again on either side.
//! Twin: `leaf/body.wgsl`.

use crate::leaf::state::LeafMode;
use crate::leaf::theta::{rational_theta, three_piece_theta};
use crate::leaf::words::{BAND_WORDS, BANDS_AT, HALVES_AT, LOWER_TABLE_AT, TABLE_AT, TABLE_ENTRIES, TABLE_HALF};

/// Least share of the light between two piles that is not thrown back and forth.
pub const MIN_BETWEEN: f32 = 1e-6;

/// The colour of a leaf's body in linear sRGB, as shares of the light that entered. Components may be negative, because
/// pure colours lie outside the sRGB gamut; together either reflectance and the transmittance are at most 1 in each channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeafBody {
    /// Share of the light on the face, the front or the seen one, that leaves by it again.
    pub reflectance: [f32; 3],
    /// Share of the light on the other face that leaves by that again.
    pub far_reflectance: [f32; 3],
    /// Share of the light that leaves on the other side, the same from either.
    pub transmittance: [f32; 3],
}

impl LeafBody {
    /// Returns the body as it is seen from the other face.
    pub fn swapped(self) -> LeafBody {
        LeafBody { reflectance: self.far_reflectance, far_reflectance: self.reflectance, ..self }
    }
}

/// Returns the absorption of one layer in a band by pigments, and by all else. `factors` are those of
/// [`crate::LeafTexel::factors`] except for the thickness.
pub(crate) fn absorption(words: &[u32], band: usize, factors: [f32; 4]) -> [f32; 2] {
    let at = BANDS_AT + band * BAND_WORDS;
    let per = |i: usize| f32::from_bits(words[at + i]);
    [factors[0] * per(0) + factors[1] * per(1) + factors[2] * per(2), per(3)]
}

/// Returns reflectance and transmittance of a pile of layers at absorption `k`, interpolated in the table whose first word is
/// number `at`.
fn tabulated(words: &[u32], at: usize, k: f32) -> [f32; 2] {
    let position = k / (k + TABLE_HALF) * (TABLE_ENTRIES - 1) as f32;
    let cell = (position as usize).min(TABLE_ENTRIES - 2);
    let t = position - cell as f32;
    let entry = |i: usize| {
        let word = words[at + i];
        [(word & 0xffff) as f32 / 65535.0, (word >> 16) as f32 / 65535.0]
    };
    let (low, high) = (entry(cell), entry(cell + 1));
    [0, 1].map(|i| low[i] * (1.0 - t) + high[i] * t)
}

/// Returns reflectance and transmittance of one plate whose interface transmits `exit` from inside [Miao, eq. 3 and 4,
/// over the light that enters].
fn exact_plate(theta: f32, exit: f32) -> [f32; 2] {
    let back = theta * (1.0 - exit);
    let behind = theta * exit / (1.0 - back * back);
    [back * behind, behind]
}

/// Returns the reflectance of the upper face, of the lower one, and the transmittance of an upper and a lower pile, each given
/// by its own reflectance and transmittance, as shares of the light that passes the surface, whose transmittance is `entry`.
fn two_piles(upper: [f32; 2], lower: [f32; 2], entry: f32) -> [f32; 3] {
    let between = 1.0 / (1.0 - upper[0] * lower[0]).max(MIN_BETWEEN);
    let front = upper[0] + upper[1] * upper[1] * lower[0] * between;
    let back = lower[0] + lower[1] * lower[1] * upper[0] * between;
    // Less than one layer may reflect less than its own surface.
    let entered = |reflected: f32| ((reflected - (1.0 - entry)) / entry).max(0.0);
    [entered(front), entered(back), upper[1] * lower[1] * between / entry]
}

/// Returns reflectance and transmittance of a plate as printed [Miao, eq. 6].
pub(crate) fn printed_plate(theta: f32) -> [f32; 2] {
    let theta2 = theta * theta;
    [(0.031 + 0.240 * theta2) / (1.0 - 0.296 * theta2), 0.44 * theta / (1.0 - 0.001 * theta2)]
}

/// Returns the body at a place where the textures and the plant multiply the contents of the leaf by `factors`
/// ([`crate::LeafTexel::factors`]).
pub(crate) fn body(words: &[u32], factors: [f32; 4]) -> LeafBody {
    let [mode, bands] = [words[4], words[5]];
    let mut body = LeafBody { reflectance: [0.0; 3], far_reflectance: [0.0; 3], transmittance: [0.0; 3] };
    for band in 0..bands as usize {
        let at = BANDS_AT + band * BAND_WORDS;
        let table = TABLE_AT + band * TABLE_ENTRIES;
        let [pigments, rest] = absorption(words, band, factors);
        let k = pigments + rest;
        let alike = |[front, behind]: [f32; 2]| [front, front, behind];
        let [front, back, behind] = if mode == LeafMode::NLayers as u32 {
            alike(tabulated(words, table, factors[3] * k))
        } else if mode == LeafMode::TwoSided as u32 {
            let held = |i: usize| f32::from_bits(words[HALVES_AT + i]);
            let [upper, lower] = [0, 2].map(|i| factors[3] * (held(i) * pigments + held(i + 1) * rest));
            two_piles(
                tabulated(words, table, upper),
                tabulated(words, LOWER_TABLE_AT + band * TABLE_ENTRIES, lower),
                f32::from_bits(words[at + 7]),
            )
        } else if mode == LeafMode::Rational as u32 {
            alike(exact_plate(rational_theta(factors[3] * k), f32::from_bits(words[at + 7])))
        } else {
            let [front, behind] = printed_plate(three_piece_theta(k));
            alike([front, factors[3] * behind])
        };
        for channel in 0..3 {
            let share = f32::from_bits(words[at + 4 + channel]);
            body.reflectance[channel] += share * front;
            body.far_reflectance[channel] += share * back;
            body.transmittance[channel] += share * behind;
        }
    }
    // The red of a pure yellow is more than a white has, and the printed thickness brightens.
    for channel in 0..3 {
        let reflected = body.reflectance[channel].max(body.far_reflectance[channel]);
        let scale = 1.0 / (reflected + body.transmittance[channel]).max(1.0);
        body.reflectance[channel] *= scale;
        body.far_reflectance[channel] *= scale;
        body.transmittance[channel] *= scale;
    }
    body
}

/// Places the body between two faces. `body` and the result are as seen from one face: `reflectance` is that of light on the seen
/// face, `transmittance` that of light on the far one, both towards the seen face; `far_reflectance` stays as it is.
///
/// `lets_out` are the mean shares that the gloss of the seen and of the far face transmits from inside: light that
/// finds one way harder takes the other, so that transmission is reciprocal. `hidden` are the shares of the light
/// leaving a face with a tilted normal that go below the face's own horizon, where they enter again. Without absorption
/// no light is lost to either.
pub(crate) fn between_faces(body: LeafBody, lets_out: [f32; 2], hidden: [f32; 2]) -> LeafBody {
    let mean = 0.5 * (lets_out[0] + lets_out[1]);
    let share = lets_out.map(|lets_out| lets_out / mean);
    let mut towards_seen = body;
    for channel in 0..3 {
        let [r, far_r, t] = [body.reflectance[channel], body.far_reflectance[channel], body.transmittance[channel]];
        // Out by the seen and by the far face.
        let through = share.map(|share| t * share);
        let (seen, far) = (r + t - through[1], far_r + t - through[0]);
        let kept = 1.0 - hidden[1] * far;
        let scale = 1.0 / ((1.0 - hidden[0] * seen) * kept - hidden[0] * hidden[1] * through[0] * through[1]);
        towards_seen.reflectance[channel] = scale * (seen * kept + hidden[1] * through[0] * through[1]);
        towards_seen.transmittance[channel] = scale * through[0];
    }
    towards_seen
}
