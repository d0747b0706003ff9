//! Continuous jitter: noise on texture coordinates, and on length and direction of height vectors [Neyret 1996, section
//! 4.3].

use super::height_noise::Noise;
use super::thick_skin::{Skin, SkinVertex};
use glam::{Quat, Vec3};

/// Longest share of itself that a height vector loses or gains: it keeps a length.
const MAX_LENGTH: f32 = 0.95;
/// Furthest that a height vector is turned: jitter alone does not lay it down.
const MAX_ANGLE_DEG: f32 = 80.0;

/// Random differences of a skin from place to place. Vertices at one place stay one: all is a function of the position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jitter {
    /// The noise, over positions in world units.
    pub noise: Noise,
    /// Largest shift of u and v, texels.
    pub coordinates: f32,
    /// Largest share by which height vectors become longer or shorter, 0 to 0.95.
    pub length: f32,
    /// Largest angle by which height vectors lean aside, degrees, 0 to 80.
    pub angle_deg: f32,
}

impl Jitter {
    /// Checks the parameters.
    ///
    /// # Errors
    /// A sentence that names the quantity that is out of range.
    pub fn check(&self) -> Result<(), String> {
        self.noise.check()?;
        for (name, value, most) in [
            ("coordinates", self.coordinates, f32::MAX),
            ("length", self.length, MAX_LENGTH),
            ("angle", self.angle_deg, MAX_ANGLE_DEG),
        ] {
            if !(0.0..=most).contains(&value) {
                return Err(format!("the jitter of a skin's {name} is {value}, and must be 0 to {most}"));
            }
        }
        Ok(())
    }

    /// Jitters a skin. Cost: a few noises a vertex.
    ///
    /// # Errors
    /// As [`Jitter::check`].
    pub fn apply(&self, skin: &Skin) -> Result<Skin, String> {
        self.check()?;
        let [coordinates, height] =
            [0x517c_c1b7, 0x2722_0a95].map(|stream| Noise { seed: self.noise.seed ^ stream, ..self.noise });
        Ok(skin.with_vertices(|vertex| {
            let shift = coordinates.three_at(vertex.position) * self.coordinates;
            let [aside, across, length] = height.three_at(vertex.position).to_array();
            // A turn about an axis across the height vector.
            let (x, y) = vertex.height.normalize_or(Vec3::Z).any_orthonormal_pair();
            let turn =
                Quat::from_scaled_axis((x * aside + y * across).clamp_length_max(1.0) * self.angle_deg.to_radians());
            SkinVertex {
                height: turn * vertex.height * (1.0 + self.length * length),
                texture: vertex.texture + Vec3::new(shift.x, shift.y, 0.0),
                ..*vertex
            }
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::grid;
    use super::*;

    const JITTER: Jitter = Jitter {
        noise: Noise { wavelength: 1.7, period: [0; 3], seed: 1 },
        coordinates: 0.3,
        length: 0.4,
        angle_deg: 25.0,
    };

    #[test]
    fn jitter_keeps_its_bounds_and_positions() {
        let skin = grid(30, 30);
        let jittered = JITTER.apply(&skin).unwrap();
        let (mut lengths, mut angles) = (Vec::new(), Vec::new());
        for (before, after) in skin.vertices().iter().zip(jittered.vertices()) {
            assert_eq!(before.position, after.position);
            assert!((before.texture - after.texture).abs().max_element() <= 0.3 && after.texture.z == 0.0);
            lengths.push(after.height.length() / before.height.length());
            angles.push(after.height.angle_between(before.height).to_degrees());
        }
        let range = |values: &[f32]| values.iter().fold([f32::MAX, f32::MIN], |[a, b], x| [a.min(*x), b.max(*x)]);
        let [shortest, longest] = range(&lengths);
        assert!((0.6..0.9).contains(&shortest) && (1.1..=1.4).contains(&longest), "{shortest} {longest}");
        let [_, widest] = range(&angles);
        assert!(widest <= 25.01 && widest > 10.0, "{widest}");
        assert_eq!(jittered, JITTER.apply(&skin).unwrap());
    }

    #[test]
    fn nothing_changes_unasked_and_bad_ranges_are_named() {
        let none = Jitter { coordinates: 0.0, length: 0.0, angle_deg: 0.0, ..JITTER };
        assert_eq!(none.apply(&grid(3, 3)).unwrap(), grid(3, 3));
        for (jitter, name) in [
            (Jitter { length: 1.0, ..JITTER }, "length"),
            (Jitter { angle_deg: -1.0, ..JITTER }, "angle"),
            (Jitter { coordinates: f32::NAN, ..JITTER }, "coordinates"),
        ] {
            assert!(jitter.apply(&grid(1, 1)).unwrap_err().contains(name));
        }
    }
}
