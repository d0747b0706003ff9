//! The body of a leaf at one place: the shares of the light that entered which leave again on either side.
//! Twin: `leaf/body.wgsl`.

use crate::leaf::state::LeafMode;
use crate::leaf::theta::{rational_theta, three_piece_theta};
use crate::leaf::words::{BAND_WORDS, BANDS_AT, TABLE_AT, TABLE_ENTRIES, TABLE_HALF};

/// The colour of a leaf's body in linear sRGB, as shares of the light that entered. Components may be negative, because
/// pure colours lie outside the sRGB gamut; together the two shares are at most 1 in each channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeafBody {
    /// Share of the light that leaves on the side where it entered.
    pub reflectance: [f32; 3],
    /// Share of the light that leaves on the other side.
    pub transmittance: [f32; 3],
}

/// Returns the absorption of one layer in a band. `factors` are those of [`crate::LeafTexel::factors`] except for the
/// thickness.
fn absorption(words: &[u32], band: usize, factors: [f32; 4]) -> f32 {
    let at = BANDS_AT + band * BAND_WORDS;
    let per = |i: usize| f32::from_bits(words[at + i]);
    factors[0] * per(0) + factors[1] * per(1) + factors[2] * per(2) + per(3)
}

/// Returns reflectance and transmittance of a band's pile of layers at absorption `k`, interpolated in the band's
/// table.
fn tabulated(words: &[u32], band: usize, k: f32) -> [f32; 2] {
    let position = k / (k + TABLE_HALF) * (TABLE_ENTRIES - 1) as f32;
    let cell = (position as usize).min(TABLE_ENTRIES - 2);
    let t = position - cell as f32;
    let entry = |i: usize| {
        let word = words[TABLE_AT + band * TABLE_ENTRIES + i];
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

/// Returns reflectance and transmittance of a plate as printed [Miao, eq. 6].
pub(crate) fn printed_plate(theta: f32) -> [f32; 2] {
    let theta2 = theta * theta;
    [(0.031 + 0.240 * theta2) / (1.0 - 0.296 * theta2), 0.44 * theta / (1.0 - 0.001 * theta2)]
}

/// Returns the body at a place where the textures and the plant multiply the contents of the leaf by `factors`
/// ([`crate::LeafTexel::factors`]).
pub(crate) fn body(words: &[u32], factors: [f32; 4]) -> LeafBody {
    let [mode, bands] = [words[4], words[5]];
    let (mut reflectance, mut transmittance) = ([0.0; 3], [0.0; 3]);
    for band in 0..bands as usize {
        let at = BANDS_AT + band * BAND_WORDS;
        let k = absorption(words, band, factors);
        let [front, behind] = if mode == LeafMode::NLayers as u32 {
            tabulated(words, band, factors[3] * k)
        } else if mode == LeafMode::Rational as u32 {
            exact_plate(rational_theta(factors[3] * k), f32::from_bits(words[at + 7]))
        } else {
            let [front, behind] = printed_plate(three_piece_theta(k));
            [front, factors[3] * behind]
        };
        for channel in 0..3 {
            let share = f32::from_bits(words[at + 4 + channel]);
            reflectance[channel] += share * front;
            transmittance[channel] += share * behind;
        }
    }
    // The red of a pure yellow is more than a white has, and the printed thickness brightens.
    for channel in 0..3 {
        let scale = 1.0 / (reflectance[channel] + transmittance[channel]).max(1.0);
        reflectance[channel] *= scale;
        transmittance[channel] *= scale;
    }
    LeafBody { reflectance, transmittance }
}

/// Places the body between two faces. The result's `reflectance` is that of light on the seen face, its `transmittance`
/// that of light on the far one, both towards the seen face.
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
        let (r, t) = (body.reflectance[channel], body.transmittance[channel]);
        // Out by the seen and by the far face.
        let through = share.map(|share| t * share);
        let (seen, far) = (r + t - through[1], r + t - through[0]);
        let kept = 1.0 - hidden[1] * far;
        let scale = 1.0 / ((1.0 - hidden[0] * seen) * kept - hidden[0] * hidden[1] * through[0] * through[1]);
        towards_seen.reflectance[channel] = scale * (seen * kept + hidden[1] * through[0] * through[1]);
        towards_seen.transmittance[channel] = scale * through[0];
    }
    towards_seen
}
