//! The three shapes that a thumbnail shows a material on, each a height over the picture's plane with a texture
//! coordinate, seen from straight above (orthographic).

/// Side of a shape's picture, in units of the texture's repetition: what the flat sheet shows of it.
const SHOWN: f32 = 1.0;

/// A shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// A ball.
    Ball,
    /// A roll that lies across the picture.
    Roll,
    /// A sheet with folds.
    Folds,
}

impl Shape {
    /// The shapes, from left to right.
    pub const ALL: [Shape; 3] = [Shape::Ball, Shape::Roll, Shape::Folds];

    /// Returns the point of the shape at `[x, y]` of the picture, each -1 to 1, y up; `None` beside it.
    pub fn point(self, [x, y]: [f32; 2]) -> Option<ShapePoint> {
        match self {
            Shape::Ball => {
                const RADIUS: f32 = 0.94;
                let (x, y) = (x / RADIUS, y / RADIUS);
                let z = (1.0 - x * x - y * y).sqrt();
                // Longitude and latitude; arcs are as long as on the flat sheet.
                let uv = [x.atan2(z), y.asin()];
                let tangent = unit([z, 0.0, -x])?;
                (z > 1e-3).then(|| ShapePoint::new([x, y, z], tangent, uv))
            }
            Shape::Roll => {
                const RADIUS: f32 = 0.8;
                let y = y / RADIUS;
                let z = (1.0 - y * y).sqrt();
                (z > 1e-3).then(|| ShapePoint::new([0.0, y, z], [1.0, 0.0, 0.0], [x, y.asin() * RADIUS]))
            }
            Shape::Folds => {
                // Height = A sin(k s) along the diagonal s, whose slope is A k cos(k s).
                const FOLDS: f32 = 5.5;
                const SLOPE: f32 = 0.75;
                let s = (x + 0.6 * y) / 1.36f32.sqrt();
                let slope = SLOPE * (FOLDS * s).cos();
                let along = [slope / 1.36f32.sqrt(), 0.6 * slope / 1.36f32.sqrt()];
                let normal = unit([-along[0], -along[1], 1.0])?;
                let tangent = unit([1.0, 0.0, along[0]])?;
                Some(ShapePoint::new(normal, tangent, [x, y]))
            }
        }
    }
}

/// A point of a shape: its frame and its texture coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShapePoint {
    /// Tangent, bitangent and normal, orthonormal.
    pub frame: [[f32; 3]; 3],
    /// Texture coordinate, one repetition a unit.
    pub uv: [f32; 2],
}

impl ShapePoint {
    fn new(normal: [f32; 3], tangent: [f32; 3], arc: [f32; 2]) -> ShapePoint {
        let [t, n] = [tangent, normal];
        let bitangent = [n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]];
        ShapePoint { frame: [tangent, bitangent, normal], uv: arc.map(|arc| 0.5 * SHOWN * (arc + 1.0)) }
    }

    /// Returns `direction` in the point's frame.
    pub fn local(&self, direction: [f32; 3]) -> [f32; 3] {
        self.frame.map(|axis| axis[0] * direction[0] + axis[1] * direction[1] + axis[2] * direction[2])
    }
}

fn unit(v: [f32; 3]) -> Option<[f32; 3]> {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    (length > 1e-9).then(|| v.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_orthonormal_and_fit_the_shape_and_its_texture() {
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        for shape in Shape::ALL {
            let mut inside = 0;
            for (x, y) in (-9..=9).flat_map(|x| (-9..=9).map(move |y| (x as f32 / 10.0, y as f32 / 10.0))) {
                let Some(point) = shape.point([x, y]) else { continue };
                inside += 1;
                for (i, a) in point.frame.iter().enumerate() {
                    for (j, b) in point.frame.iter().enumerate() {
                        let wanted = if i == j { 1.0 } else { 0.0 };
                        assert!((dot(*a, *b) - wanted).abs() < 1e-4, "{shape:?} {x} {y} {:?}", point.frame);
                    }
                }
                assert!(point.frame[2][2] > 0.0, "seen from above");
                // To the right of the picture the texture runs to the right.
                let right = shape.point([x + 1e-3, y]);
                assert!(right.is_none_or(|right| right.uv[0] > point.uv[0]), "{shape:?} {x} {y}");
            }
            assert!(inside > 200, "{shape:?} {inside}");
        }
        assert!(Shape::Ball.point([0.9, 0.9]).is_none() && Shape::Roll.point([0.0, 0.9]).is_none());
    }
}
