//! A map of heights as decoders read it: interpolated between texels, and seen along the horizon. Twin:
//! `asset/height_field.wgsl`.

use crate::asset::relief::AZIMUTHS;

/// Greatest distance at which a horizon is looked for, texels.
const REACH: f32 = 40.0;
/// Steps of the search near by and further off, and the distance between the two, texels.
const STEPS: [f32; 2] = [0.75, 1.5];
const NEAR: f32 = 8.0;

/// A displacement map as decoders read it.
#[derive(Debug, Clone, Copy)]
pub struct HeightField<'a> {
    /// Code of each texel, padded to whole words.
    pub(crate) codes: &'a [i8],
    /// Columns and rows.
    pub(crate) size: [usize; 2],
    /// Texel widths per code.
    pub(crate) step: f32,
    /// Least and greatest height in texel widths.
    pub(crate) range: [f32; 2],
}

impl HeightField<'_> {
    /// Returns columns and rows.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Returns the least and the greatest height in texel widths.
    pub fn range(&self) -> [f32; 2] {
        self.range
    }

    /// Returns the height of each texel, row by row from the top, in texel widths.
    pub fn heights(&self) -> Vec<f32> {
        (0..self.size[0] * self.size[1]).map(|texel| self.of_texel(texel)).collect()
    }

    #[inline(always)]
    fn of_texel(&self, texel: usize) -> f32 {
        self.step * f32::from(self.codes[texel])
    }

    /// Interpolates bilinearly between two columns and two rows, `part` of the way from the first to the next.
    #[inline(always)]
    fn between(&self, [c, r]: [usize; 2], [next_c, next_r]: [usize; 2], part: [f32; 2]) -> f32 {
        let [upper, lower] = [r * self.size[0], next_r * self.size[0]];
        let (upper_left, lower_left) = (self.of_texel(upper + c), self.of_texel(lower + c));
        let upper = upper_left + (self.of_texel(upper + next_c) - upper_left) * part[0];
        let lower = lower_left + (self.of_texel(lower + next_c) - lower_left) * part[0];
        upper + (lower - upper) * part[1]
    }

    /// Interpolates bilinearly; the edges continue outside. Texel centres are at whole numbers.
    #[inline(always)]
    pub fn at(&self, place: [f32; 2]) -> f32 {
        let [most_c, most_r] = [self.size[0] - 1, self.size[1] - 1];
        let column = place[0].clamp(0.0, most_c as f32);
        let row = place[1].clamp(0.0, most_r as f32);
        // Converted by way of a signed number, which processors do in one step.
        let (c, r) = (column as i32 as usize, row as i32 as usize);
        self.between(
            [c, r],
            [(c + 1).min(most_c), (r + 1).min(most_r)],
            [column - c as i32 as f32, row - r as i32 as f32],
        )
    }

    /// Interpolates bilinearly; the map repeats. Texel centres are at whole numbers.
    pub fn at_wrapped(&self, place: [f32; 2]) -> f32 {
        let floor = place.map(f32::floor);
        let [c, r] =
            [0, 1].map(|i| (floor[i] - self.size[i] as f32 * (floor[i] / self.size[i] as f32).floor()) as usize);
        let (c, r) = (c.min(self.size[0] - 1), r.min(self.size[1] - 1));
        let (next_c, next_r) = ((c + 1) % self.size[0], (r + 1) % self.size[1]);
        self.between([c, r], [next_c, next_r], [place[0] - floor[0], place[1] - floor[1]])
    }

    /// Returns the tangents of the horizon's elevation at `place`, every 45 degrees counter-clockwise from +x, at least 0.
    /// [`crate::lit_share`] tells of a light what of it they leave.
    ///
    /// Cost: up to 35 heights for each azimuth.
    pub fn horizons(&self, place: [f32; 2]) -> [f32; AZIMUTHS] {
        let (height, most) = (self.at(place), self.range[1]);
        std::array::from_fn(|azimuth| {
            let (sin, cos) = (azimuth as f32 * std::f32::consts::TAU / AZIMUTHS as f32).sin_cos();
            let (mut tangent, mut distance) = (0.0f32, 1.0f32);
            while distance <= REACH && most - height >= tangent * distance {
                let there = [place[0] + distance * cos, place[1] - distance * sin];
                if (0..2).any(|axis| there[axis] < 0.0 || there[axis] > (self.size[axis] - 1) as f32) {
                    break;
                }
                tangent = tangent.max((self.at(there) - height) / distance);
                distance += if distance < NEAR { STEPS[0] } else { STEPS[1] };
            }
            tangent
        })
    }
}
