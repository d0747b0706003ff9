//! A vein as a line of short pieces, and many fine veins in bins.

/// Side of a bin of [`FineVeins`] in millimetres, and the largest distance at which veins are found.
pub(crate) const FINE_REACH_MM: f32 = 1.0;

/// Middle and width of a vein along its length. Positions are in millimetres.
#[derive(Debug, Clone)]
pub(crate) struct Vein {
    pub points: Vec<[f32; 2]>,
    pub half_widths: Vec<f32>,
    /// Lower left and upper right corner of the vein.
    bounds: [[f32; 2]; 2],
}

/// Point of a vein that is nearest to another point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Nearest {
    pub distance: f32,
    pub half_width: f32,
    /// Unit vector along the vein.
    pub direction: [f32; 2],
}

impl Vein {
    pub fn new(points: Vec<[f32; 2]>, half_widths: Vec<f32>) -> Vein {
        let fold = |pick: fn(f32, f32) -> f32, start: f32| {
            points.iter().fold([start; 2], |corner, p| [pick(corner[0], p[0]), pick(corner[1], p[1])])
        };
        let bounds = [fold(f32::min, f32::MAX), fold(f32::max, f32::MIN)];
        Vein { points, half_widths, bounds }
    }

    /// Returns the nearest point of the vein if it is nearer than `limit`.
    pub fn nearest(&self, p: [f32; 2], limit: f32) -> Option<Nearest> {
        let outside = (0..2).any(|k| p[k] < self.bounds[0][k] - limit || p[k] > self.bounds[1][k] + limit);
        if outside {
            return None;
        }
        let mut best = (limit * limit, 0.0, None);
        for (pair, widths) in self.points.windows(2).zip(self.half_widths.windows(2)) {
            let (squared, t) = to_piece(p, pair[0], pair[1]);
            if squared < best.0 {
                best = (squared, widths[0] * (1.0 - t) + widths[1] * t, Some([pair[0], pair[1]]));
            }
        }
        let [a, b] = best.2?;
        Some(Nearest { distance: best.0.sqrt(), half_width: best.1, direction: unit([b[0] - a[0], b[1] - a[1]]) })
    }

    /// Returns the point at a length from the start of the vein, at most its end.
    pub fn point_at(&self, length_mm: f32) -> [f32; 2] {
        let mut left = length_mm.max(0.0);
        for pair in self.points.windows(2) {
            let along = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
            let length = (along[0] * along[0] + along[1] * along[1]).sqrt();
            if left <= length {
                let t = left / length;
                return [pair[0][0] + t * along[0], pair[0][1] + t * along[1]];
            }
            left -= length;
        }
        self.points[self.points.len() - 1]
    }
}

/// Thin veins of one order, in bins so that the nearest is found quickly.
#[derive(Debug, Clone)]
pub(crate) struct FineVeins {
    pieces: Vec<[[f32; 2]; 2]>,
    /// Indices of pieces, by bin.
    bins: Vec<Vec<u32>>,
    side: usize,
    first_mm: f32,
}

impl FineVeins {
    /// Sorts the pieces of `lines` that touch the square from `first_mm` to `last_mm` on both axes into bins.
    pub fn new(lines: &[Vec<[f32; 2]>], first_mm: f32, last_mm: f32) -> FineVeins {
        let side = ((last_mm - first_mm) / FINE_REACH_MM).ceil() as usize + 2;
        let first_mm = first_mm - FINE_REACH_MM;
        let bin = |x: f32| ((x - first_mm) / FINE_REACH_MM).floor();
        let mut veins = FineVeins { pieces: Vec::new(), bins: vec![Vec::new(); side * side], side, first_mm };
        for pair in lines.iter().flat_map(|line| line.windows(2)) {
            let low = [0, 1].map(|k| bin(pair[0][k].min(pair[1][k])));
            let high = [0, 1].map(|k| bin(pair[0][k].max(pair[1][k])));
            if (0..2).any(|k| high[k] < 0.0 || low[k] >= side as f32) {
                continue;
            }
            let range = |k: usize| low[k].max(0.0) as usize..=(high[k] as usize).min(side - 1);
            for row in range(1) {
                for column in range(0) {
                    veins.bins[row * side + column].push(veins.pieces.len() as u32);
                }
            }
            veins.pieces.push([pair[0], pair[1]]);
        }
        veins
    }

    /// Returns the distance to the nearest vein, at most [`FINE_REACH_MM`].
    pub fn distance(&self, p: [f32; 2]) -> f32 {
        let place = p.map(|x| ((x - self.first_mm) / FINE_REACH_MM).floor());
        if place.iter().any(|x| *x < 0.0 || *x >= self.side as f32) {
            return FINE_REACH_MM;
        }
        let [column, row] = place.map(|x| x as usize);
        let around = |x: usize| x.saturating_sub(1)..=(x + 1).min(self.side - 1);
        let mut best = FINE_REACH_MM * FINE_REACH_MM;
        for row in around(row) {
            for column in around(column) {
                for &piece in &self.bins[row * self.side + column] {
                    let [a, b] = self.pieces[piece as usize];
                    best = best.min(to_piece(p, a, b).0);
                }
            }
        }
        best.sqrt()
    }
}

/// Returns the squared distance from `p` to the piece from `a` to `b`, and the position of the nearest point on it, 0
/// to 1.
fn to_piece(p: [f32; 2], a: [f32; 2], b: [f32; 2]) -> (f32, f32) {
    let along = [b[0] - a[0], b[1] - a[1]];
    let to = [p[0] - a[0], p[1] - a[1]];
    let length_squared = along[0] * along[0] + along[1] * along[1];
    let t = ((to[0] * along[0] + to[1] * along[1]) / length_squared.max(1e-12)).clamp(0.0, 1.0);
    let off = [to[0] - t * along[0], to[1] - t * along[1]];
    (off[0] * off[0] + off[1] * off[1], t)
}

/// Returns `v` with length 1; upwards where it has none.
pub(crate) fn unit(v: [f32; 2]) -> [f32; 2] {
    let length = (v[0] * v[0] + v[1] * v[1]).sqrt();
    if length > 1e-12 { [v[0] / length, v[1] / length] } else { [0.0, 1.0] }
}

/// Returns the cosine and sine of twice the angle of a direction, which are equal for a vector and its opposite and can
/// be averaged.
pub(crate) fn double_angle(direction: [f32; 2]) -> [f32; 2] {
    let [x, y] = direction;
    [x * x - y * y, 2.0 * x * y]
}

/// Returns the direction, y not negative, of a double angle of any length; upwards where it has none.
pub(crate) fn direction_of(double: [f32; 2]) -> [f32; 2] {
    let [cos, sin] = double;
    if cos * cos + sin * sin < 1e-12 {
        return [0.0, 1.0];
    }
    let angle = 0.5 * sin.atan2(cos);
    let (y, x) = angle.sin_cos();
    if y < 0.0 { [-x, -y] } else { [x, y] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zigzag() -> Vec<[f32; 2]> {
        (0..40).map(|i| [0.4 * i as f32, 5.0 + if i % 2 == 0 { 0.3 } else { -0.3 } + 0.1 * i as f32]).collect()
    }

    #[test]
    fn bins_find_what_the_plain_search_finds() {
        let lines = [zigzag(), zigzag().iter().map(|p| [p[1], p[0]]).collect()];
        let veins = FineVeins::new(&lines, -1.0, 12.0);
        for i in 0..900 {
            let p = [(i % 30) as f32 * 0.43 - 1.0, (i / 30) as f32 * 0.43 - 1.0];
            let plain = lines
                .iter()
                .flat_map(|line| line.windows(2))
                .map(|pair| to_piece(p, pair[0], pair[1]).0.sqrt())
                .fold(FINE_REACH_MM, f32::min);
            assert!((veins.distance(p) - plain).abs() < 1e-6, "{p:?}");
        }
        assert_eq!(veins.distance([-50.0, 1e9]), FINE_REACH_MM);
    }

    #[test]
    fn a_length_along_a_vein_is_a_length() {
        let vein = Vein::new(vec![[0.0, 0.0], [3.0, 4.0], [3.0, 10.0]], vec![0.2, 0.1, 0.1]);
        for (length, expected) in [(0.0, [0.0, 0.0]), (2.5, [1.5, 2.0]), (7.0, [3.0, 6.0]), (99.0, [3.0, 10.0])] {
            assert_eq!(vein.point_at(length), expected);
        }
        let nearest = vein.nearest([2.0, 7.0], 5.0).unwrap();
        assert_eq!((nearest.distance, nearest.direction), (1.0, [0.0, 1.0]));
        assert_eq!(vein.nearest([2.0, 7.0], 0.5), None);
    }

    #[test]
    fn directions_survive_the_double_angle_up_to_their_sign() {
        for i in 0..36 {
            let (y, x) = (i as f32 * 10.0).to_radians().sin_cos();
            let back = direction_of(double_angle([x, y]));
            assert!(back[1] >= 0.0 && ((back[0] * x + back[1] * y).abs() - 1.0).abs() < 1e-5);
        }
        assert_eq!(direction_of([0.0, 0.0]), [0.0, 1.0]);
    }
}
