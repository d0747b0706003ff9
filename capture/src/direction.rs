//! Directions of light and view, and the ordered sets of them that a capture is sampled at.

use std::fmt;
use std::path::Path;

use crate::error::CaptureError;

/// Largest number of directions in one set, a bound on what a name or a file may ask for.
pub const MAX_DIRECTIONS: usize = 100_000;

/// Largest polar angle that [`DirectionSet::random`] draws, in degrees: beyond it a texel of a
/// reference plane is foreshortened more than eleven times.
const RANDOM_MAX_THETA_DEG: f64 = 85.0;

/// Bonn's 81 directions (UBO2003, ATRIUM): polar angle in degrees and number of azimuths, the
/// first azimuth at 0. Source: file names of the published archives [Sattler 2003].
const BONN81_RINGS: [(f64, usize); 6] = [(0.0, 1), (15.0, 6), (30.0, 12), (45.0, 18), (60.0, 20), (75.0, 24)];

/// Bonn's Dome-1 sampling of 151 directions (UBO2014): polar angle, number of azimuths, first
/// azimuth, all angles in degrees. Source: the sampling tables of the UBO2014 files
/// [Weinmann 2014].
const DOME151_RINGS: [(f64, usize, f64); 10] = [
    (0.0, 1, 0.0),
    (11.0, 6, 15.0),
    (23.5, 12, 0.0),
    (30.0, 12, 15.0),
    (37.5, 12, 0.0),
    (45.0, 18, 0.0),
    (52.5, 18, 7.5),
    (60.0, 24, 0.0),
    (67.5, 24, 7.5),
    (75.0, 24, 0.0),
];

/// A direction away from the surface in the texel's tangent frame: x along image columns (to the
/// right), y up the image, z along the macroscopic normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Direction {
    /// Polar angle from the normal in degrees, 0 to 180; above 90 the direction is behind the
    /// surface (transmission captures).
    pub theta_deg: f64,
    /// Azimuth in degrees, counter-clockwise from +x as seen from the front, in [0, 360).
    pub phi_deg: f64,
}

impl Direction {
    /// Returns the direction of polar angle `theta_deg` and azimuth `phi_deg`. The azimuth is brought into [0, 360),
    /// and is 0 at the pole, so that equal directions compare equal.
    pub fn new(theta_deg: f64, phi_deg: f64) -> Direction {
        let phi_deg = if theta_deg == 0.0 || theta_deg == 180.0 { 0.0 } else { phi_deg.rem_euclid(360.0) };
        // rem_euclid of a tiny negative angle rounds up to 360 itself; adding 0.0 turns -0 into 0.
        let phi_deg = if phi_deg >= 360.0 { 0.0 } else { phi_deg };
        Direction { theta_deg: theta_deg + 0.0, phi_deg: phi_deg + 0.0 }
    }

    /// Returns the direction of a vector that is not 0, of whatever length.
    pub fn of_vector([x, y, z]: [f64; 3]) -> Direction {
        Direction::new(x.hypot(y).atan2(z).to_degrees(), y.atan2(x).to_degrees())
    }

    /// Returns the unit vector `(sin t cos p, sin t sin p, cos t)`.
    pub fn unit(self) -> [f32; 3] {
        self.unit_f64().map(|c| c as f32)
    }

    /// Returns [`Direction::unit`] in double precision.
    pub fn unit_f64(self) -> [f64; 3] {
        let (sin_theta, cos_theta) = self.theta_deg.to_radians().sin_cos();
        let (sin_phi, cos_phi) = self.phi_deg.to_radians().sin_cos();
        [sin_theta * cos_phi, sin_theta * sin_phi, cos_theta]
    }

    /// Returns the angle to `other` in degrees, 0 to 180.
    pub fn angle_deg(self, other: Direction) -> f64 {
        let (a, b) = (self.unit_f64(), other.unit_f64());
        a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>().clamp(-1.0, 1.0).acos().to_degrees()
    }

    /// Returns the bits of both angles: equal for equal directions, and fit for a map's key.
    pub(crate) fn bits(self) -> [u64; 2] {
        [self.theta_deg.to_bits(), self.phi_deg.to_bits()]
    }

    fn is_valid(self) -> bool {
        (0.0..=180.0).contains(&self.theta_deg) && (0.0..360.0).contains(&self.phi_deg)
    }
}

/// Formats an angle as file names have it: three digits before the point, as many after it as the angle needs (`075`,
/// `023.5`).
pub(crate) fn angle_name(angle_deg: f64) -> String {
    let shortest = format!("{angle_deg}");
    let whole = shortest.find('.').unwrap_or(shortest.len());
    format!("{}{shortest}", "0".repeat(3usize.saturating_sub(whole)))
}

impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "theta {} phi {}", self.theta_deg, self.phi_deg)
    }
}

/// An ordered set of distinct directions, always sorted by polar angle, then azimuth, which is Bonn's order. An index
/// into a set therefore means the same before and after a capture was written.
#[derive(Debug, Clone, PartialEq)]
pub struct DirectionSet {
    directions: Vec<Direction>,
}

impl DirectionSet {
    /// Returns the set of `directions`, sorted.
    ///
    /// # Errors
    /// [`CaptureError::BadDirections`] for an empty set, more than [`MAX_DIRECTIONS`], an angle
    /// that is not finite or out of range, or a direction that comes twice.
    pub fn new(directions: Vec<Direction>) -> Result<DirectionSet, CaptureError> {
        let bad = |reason: String| Err(CaptureError::BadDirections { reason });
        if directions.is_empty() {
            return bad("it is empty; give at least one direction".into());
        }
        if directions.len() > MAX_DIRECTIONS {
            return bad(format!("it has {} directions; at most {MAX_DIRECTIONS} are allowed", directions.len()));
        }
        let mut directions: Vec<_> = directions.iter().map(|d| Direction::new(d.theta_deg, d.phi_deg)).collect();
        if let Some(d) = directions.iter().find(|d| !d.is_valid()) {
            return bad(format!("{d} is no direction; theta goes from 0 to 180 degrees, phi from 0 to 360"));
        }
        directions.sort_by(|a, b| a.theta_deg.total_cmp(&b.theta_deg).then(a.phi_deg.total_cmp(&b.phi_deg)));
        if let Some(pair) = directions.windows(2).find(|pair| pair[0] == pair[1]) {
            return bad(format!("{} comes twice; remove one of them", pair[0]));
        }
        Ok(DirectionSet { directions })
    }

    /// Returns the set `rounds` times over, one round after the other in the same order.
    pub(crate) fn repeated(&self, rounds: usize) -> DirectionSet {
        DirectionSet { directions: self.directions.repeat(rounds) }
    }

    /// Returns how often the set holds the same directions, one round after the other; 1 but for captures in groups of channels
    /// ([`crate::Capture::in_groups`]).
    pub fn rounds(&self) -> usize {
        let first = self.directions.iter().skip(1).position(|direction| *direction == self.directions[0]);
        first.map_or(1, |at| self.directions.len() / (at + 1))
    }

    /// Returns Bonn's 81 directions (UBO2003): rings at 0, 15, ... 75 degrees.
    pub fn bonn81() -> DirectionSet {
        DirectionSet::from_rings(BONN81_RINGS.iter().map(|&(theta, count)| (theta, count, 0.0)))
    }

    /// Returns Bonn's Dome-1 sampling of 151 directions (UBO2014).
    pub fn dome151() -> DirectionSet {
        DirectionSet::from_rings(DOME151_RINGS.iter().copied())
    }

    /// Returns `count` directions drawn evenly over the solid angle within 85 degrees of the normal, at angles of whole
    /// hundredths of a degree. Equal seeds give equal sets.
    ///
    /// # Errors
    /// [`CaptureError::BadDirections`] if `count` is 0 or above [`MAX_DIRECTIONS`].
    pub fn random(count: usize, seed: u64) -> Result<DirectionSet, CaptureError> {
        if count > MAX_DIRECTIONS {
            let reason = format!("random:{count} asks for too many; at most {MAX_DIRECTIONS} are allowed");
            return Err(CaptureError::BadDirections { reason });
        }
        let mut state = seed;
        let min_cos = RANDOM_MAX_THETA_DEG.to_radians().cos();
        let mut seen = std::collections::HashSet::new();
        let mut directions = Vec::with_capacity(count);
        while directions.len() < count {
            let cos_theta = 1.0 - (1.0 - min_cos) * next_unit(&mut state);
            // Whole hundredths of a degree, so that a file name holds the angle exactly.
            let theta = (cos_theta.acos().to_degrees() * 100.0).round();
            let phi = (next_unit(&mut state) * 36_000.0).floor();
            let direction = Direction::new(theta / 100.0, phi / 100.0);
            if seen.insert((direction.theta_deg.to_bits(), direction.phi_deg.to_bits())) {
                directions.push(direction);
            }
        }
        DirectionSet::new(directions)
    }

    /// Returns the directions on the other side of the surface, at `180 - theta`: the lights of a transmission capture
    /// from those of a reflection capture, and back.
    ///
    /// # Errors
    /// [`CaptureError::BadDirections`] if two directions differ by less than a millionth of a degree, to which angles
    /// are rounded here so that 180 - 12.34 is 167.66 in the name of a file.
    pub fn behind(&self) -> Result<DirectionSet, CaptureError> {
        let mirrored = |d: &Direction| Direction::new(((180.0 - d.theta_deg) * 1e6).round() / 1e6, d.phi_deg);
        DirectionSet::new(self.directions.iter().map(mirrored).collect())
    }

    /// Reads a text file with one direction a line, `theta phi` in degrees, separated by blanks
    /// or a comma; `#` starts a comment.
    ///
    /// # Errors
    /// [`CaptureError::Read`] if the file cannot be read, [`CaptureError::BadDirections`] naming
    /// the file and line of what is wrong.
    pub fn from_file(path: impl AsRef<Path>) -> Result<DirectionSet, CaptureError> {
        let path = path.as_ref();
        let text = std::fs::read_to_string(path).map_err(|source| CaptureError::read(path, source))?;
        let mut directions = Vec::new();
        for (number, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or("").trim();
            if line.is_empty() {
                continue;
            }
            let angles: Option<Vec<f64>> = line
                .split(|c: char| c.is_whitespace() || c == ',')
                .filter(|word| !word.is_empty())
                .map(|word| word.parse().ok())
                .collect();
            match angles.as_deref() {
                Some(&[theta, phi]) if theta.is_finite() && phi.is_finite() => {
                    directions.push(Direction::new(theta, phi))
                }
                _ => {
                    let reason = format!(
                        "line {} of {} is `{line}`; write two numbers, theta and phi in degrees",
                        number + 1,
                        path.display()
                    );
                    return Err(CaptureError::BadDirections { reason });
                }
            }
        }
        DirectionSet::new(directions).map_err(|error| match error {
            CaptureError::BadDirections { reason } => {
                CaptureError::BadDirections { reason: format!("in {}, {reason}", path.display()) }
            }
            other => other,
        })
    }

    /// Returns the set that a command-line word names: `bonn81`, `dome151`, `random:N` (seed 1), `random:N:SEED`, or
    /// the path of a file for [`DirectionSet::from_file`].
    ///
    /// # Errors
    /// Errors are those of the constructor that the name stands for.
    pub fn by_name(name: &str) -> Result<DirectionSet, CaptureError> {
        match name {
            "bonn81" => return Ok(DirectionSet::bonn81()),
            "dome151" => return Ok(DirectionSet::dome151()),
            _ => {}
        }
        let Some(numbers) = name.strip_prefix("random:") else { return DirectionSet::from_file(name) };
        let (count, seed) = numbers.split_once(':').unwrap_or((numbers, "1"));
        match (count.parse(), seed.parse()) {
            (Ok(count), Ok(seed)) => DirectionSet::random(count, seed),
            _ => Err(CaptureError::BadDirections {
                reason: format!("`{name}` is not understood; write random:N or random:N:SEED with whole numbers"),
            }),
        }
    }

    /// Returns the directions, in order.
    pub fn directions(&self) -> &[Direction] {
        &self.directions
    }

    /// Returns the number of directions, at least 1.
    #[allow(clippy::len_without_is_empty, reason = "a direction set is never empty")]
    pub fn len(&self) -> usize {
        self.directions.len()
    }

    /// Returns the unit vectors, in order.
    pub fn units(&self) -> Vec<[f32; 3]> {
        self.directions.iter().map(|d| d.unit()).collect()
    }

    fn from_rings(rings: impl Iterator<Item = (f64, usize, f64)>) -> DirectionSet {
        let directions = rings
            .flat_map(|(theta, count, offset)| {
                (0..count).map(move |i| Direction::new(theta, offset + i as f64 * (360.0 / count as f64)))
            })
            .collect();
        DirectionSet { directions }
    }
}

/// Returns the next number in [0, 1) of the SplitMix64 sequence [Steele 2014].
fn next_unit(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bonn_has_81_and_the_dome_151_directions_in_sorted_order() {
        for (set, count) in [(DirectionSet::bonn81(), 81), (DirectionSet::dome151(), 151)] {
            assert_eq!(set.len(), count);
            assert_eq!(DirectionSet::new(set.directions().to_vec()).unwrap(), set, "rings are sorted");
        }
        assert_eq!(DirectionSet::bonn81().directions()[1], Direction::new(15.0, 0.0));
        assert_eq!(DirectionSet::bonn81().directions()[80], Direction::new(75.0, 345.0));
    }

    #[test]
    fn azimuth_turns_counter_clockwise_from_the_image_columns() {
        let [x, y, z] = Direction::new(90.0, 90.0).unit_f64();
        assert!(x.abs() < 1e-15 && (y - 1.0).abs() < 1e-15 && z.abs() < 1e-15);
        for d in DirectionSet::dome151().units() {
            assert!((d.iter().map(|c| c * c).sum::<f32>() - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn the_same_direction_written_in_two_ways_compares_equal() {
        assert_eq!(Direction::new(0.0, 77.0), Direction::new(0.0, 0.0));
        assert_eq!(Direction::new(30.0, 360.0), Direction::new(30.0, 0.0));
        assert_eq!(Direction::new(30.0, -1e-18), Direction::new(30.0, 0.0));
    }

    #[test]
    fn angles_in_names_have_three_digits_and_keep_their_fraction() {
        for (angle, name) in [(0.0, "000"), (7.5, "007.5"), (75.0, "075"), (345.25, "345.25"), (0.01, "000.01")] {
            assert_eq!(angle_name(angle), name);
            assert_eq!(name.parse::<f64>().unwrap(), angle);
        }
    }

    #[test]
    fn random_sets_repeat_by_seed_and_differ_between_seeds() {
        let a = DirectionSet::random(50, 3).unwrap();
        assert_eq!(a, DirectionSet::random(50, 3).unwrap());
        assert_ne!(a, DirectionSet::random(50, 4).unwrap());
        assert_eq!(a, DirectionSet::by_name("random:50:3").unwrap());
        assert!(DirectionSet::random(0, 1).is_err());
        assert!(DirectionSet::random(MAX_DIRECTIONS + 1, 1).is_err());
    }

    #[test]
    fn behind_and_behind_again_is_the_same_set() {
        for set in [DirectionSet::bonn81(), DirectionSet::dome151(), DirectionSet::random(60, 2).unwrap()] {
            let behind = set.behind().unwrap();
            assert_ne!(behind, set);
            assert_eq!(behind.behind().unwrap(), set);
            assert_eq!(behind.directions()[set.len() - 1].theta_deg, 180.0 - set.directions()[0].theta_deg);
            let mirrored = behind.units().into_iter().all(|[x, y, z]| {
                set.units().iter().any(|u| (u[0] - x).abs() + (u[1] - y).abs() + (u[2] + z).abs() < 1e-6)
            });
            assert!(mirrored);
        }
    }

    #[test]
    fn reads_a_file_of_directions_and_names_the_line_of_a_bad_one() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("set.txt");
        std::fs::write(&path, "# theta phi\n30 90\n0, 0\n").unwrap();
        let set = DirectionSet::by_name(path.to_str().unwrap()).unwrap();
        assert_eq!(set.directions(), [Direction::new(0.0, 0.0), Direction::new(30.0, 90.0)]);
        for (text, part) in
            [("0 0\n1 2 3\n", "line 2"), ("0 0\n0 40", "twice"), ("", "empty"), ("190 0", "no direction")]
        {
            std::fs::write(&path, text).unwrap();
            let message = DirectionSet::from_file(&path).unwrap_err().to_string();
            assert!(message.contains(part) && message.contains("set.txt"), "{message}");
        }
        assert!(DirectionSet::by_name("no-such-file").unwrap_err().to_string().contains("no-such-file"));
        assert!(DirectionSet::by_name("random:x").is_err());
    }
}
