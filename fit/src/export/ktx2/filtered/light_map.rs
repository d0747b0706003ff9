//! Maps of the lights' hemisphere onto a square of texels that a sampler filters, in place of the measured lights.

use btf_runtime::Sphere;
use nalgebra::DMatrix;
use ndarray::{Array2, ArrayView2};

/// Nodes a measured light at least: fewer could not take the measured values.
const NODES_A_LIGHT: f64 = 1.5;
/// Side of a block of compressed texels: maps are whole blocks, so that no block belongs to two.
const BLOCK: usize = 4;
/// Directions between the measured ones that the nodes are fitted to.
const BETWEEN: usize = 4096;
/// Weight of the measured directions in all, over that of the directions between them.
const MEASURED_WEIGHT: f64 = 900.0;
/// Weight of small nodes over that of the directions between: decides where no direction does.
const RIDGE: f64 = 1e-4;

/// A square of `side` x `side` nodes over the hemisphere of the lights, equal in area [Shirley 1997], as far down as the
/// lowest measured light. Its values between the nodes are bilinear.
pub struct LightMap {
    side: usize,
    radius: f32,
    /// Value of each node for values of the lights, `[node, light]`.
    nodes: Array2<f32>,
    /// Value at each light for values of the nodes, `[light, node]`.
    read: Array2<f32>,
}

impl LightMap {
    /// Fits the nodes: the map takes the measured values at the measured lights, as well as it can, and follows linear
    /// interpolation over the triangles of `lights` between them.
    pub fn new(lights: &Sphere) -> LightMap {
        let side = (NODES_A_LIGHT * lights.len() as f64).sqrt().ceil() as usize;
        let side = side.next_multiple_of(BLOCK);
        let radius = (1.0 - lights.least_cosine()).max(1e-3).sqrt();
        let measured: Vec<[f32; 3]> = (0..lights.len() as u32).map(|id| lights.direction(id)).collect();
        let nodes = side * side;
        let mut gram = DMatrix::<f64>::identity(nodes, nodes) * RIDGE;
        let mut target = DMatrix::<f64>::zeros(nodes, lights.len());
        let share = lights.len() as f64 / BETWEEN as f64;
        for direction in spiral(BETWEEN) {
            let place = lights.locate(direction);
            let wanted: Vec<(usize, f64)> =
                place.ids.iter().zip(place.weights).map(|(id, weight)| (*id as usize, weight.into())).collect();
            add(&mut gram, &mut target, share, &corners(square(direction, radius), side), &wanted);
        }
        for (id, direction) in measured.iter().enumerate() {
            add(&mut gram, &mut target, MEASURED_WEIGHT, &corners(square(*direction, radius), side), &[(id, 1.0)]);
        }
        // The ridge makes the matrix positive definite.
        let solved = gram.cholesky().map_or_else(|| DMatrix::zeros(nodes, lights.len()), |found| found.solve(&target));
        let mut read = Array2::zeros((lights.len(), nodes));
        for (id, direction) in measured.iter().enumerate() {
            for (node, weight) in corners(square(*direction, radius), side) {
                read[[id, node]] += weight as f32;
            }
        }
        let nodes = Array2::from_shape_fn((nodes, lights.len()), |(node, light)| solved[(node, light)] as f32);
        LightMap { side, radius, nodes, read }
    }

    /// Returns the nodes a side.
    pub fn side(&self) -> usize {
        self.side
    }

    /// Returns the radius of the lowest light in the equal-area disk, whose circle is the square's border.
    pub fn radius(&self) -> f32 {
        self.radius
    }

    /// Returns the nodes' values, `[node, channel]`, of values at the lights, `[light, channel]`.
    pub fn nodes(&self, values: ArrayView2<f32>) -> Array2<f32> {
        self.nodes.dot(&values)
    }

    /// Returns the values at the lights, `[light, channel]`, of the nodes' values, `[node, channel]`.
    pub fn at_lights(&self, nodes: ArrayView2<f32>) -> Array2<f32> {
        self.read.dot(&nodes)
    }
}

/// Adds a direction, whose value is that of `corners`, to normal equations; it should be that of the lights `wanted`.
fn add(
    gram: &mut DMatrix<f64>,
    target: &mut DMatrix<f64>,
    weight: f64,
    corners: &[(usize, f64); 4],
    wanted: &[(usize, f64)],
) {
    for (row, a) in corners {
        for (column, b) in corners {
            gram[(*row, *column)] += weight * a * b;
        }
        for (light, b) in wanted {
            target[(*row, *light)] += weight * a * b;
        }
    }
}

/// Returns the place of a direction in the square, 0 to 1 along both sides. Directions below the lowest light are at the
/// border.
pub fn square([x, y, z]: [f32; 3], radius: f32) -> [f64; 2] {
    let [x, y] = [x, y].map(|t| f64::from(t) / f64::from(radius) / (1.0 + f64::from(z.max(0.0))).sqrt());
    let r = x.hypot(y).min(1.0);
    let turn = x.abs().min(y.abs()).atan2(x.abs().max(y.abs())) * 4.0 / std::f64::consts::PI;
    let [u, v] = if x.abs() >= y.abs() { [r, r * turn] } else { [r * turn, r] };
    [0.5 + 0.5 * u.copysign(x), 0.5 + 0.5 * v.copysign(y)]
}

/// Returns the four nodes about a place and their bilinear weights.
fn corners(place: [f64; 2], side: usize) -> [(usize, f64); 4] {
    let [x, y] = place.map(|t| t * (side - 1) as f64);
    let [column, row] = [x, y].map(|t| (t as usize).min(side - 2));
    let (p, q) = (x - column as f64, y - row as f64);
    let at = row * side + column;
    [(at, (1.0 - p) * (1.0 - q)), (at + 1, p * (1.0 - q)), (at + side, (1.0 - p) * q), (at + side + 1, p * q)]
}

/// Returns directions that are spread evenly over the hemisphere.
fn spiral(count: usize) -> impl Iterator<Item = [f32; 3]> {
    (0..count).map(move |i| {
        let z = (i as f64 + 0.5) / count as f64;
        let (sin, cos) = (i as f64 * 2.399_963_229_728_653).sin_cos();
        let r = (1.0 - z * z).sqrt();
        [r * cos, r * sin, z].map(|x| x as f32)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_capture::DirectionSet;

    fn bonn() -> Sphere {
        let units: Vec<[f32; 3]> = DirectionSet::bonn81().units();
        Sphere::new(&units).unwrap()
    }

    #[test]
    fn measured_values_are_kept_and_those_between_follow_the_triangles() {
        let lights = bonn();
        let map = LightMap::new(&lights);
        assert_eq!((map.side(), lights.len()), (12, 81));
        // A smooth function and one that differs from light to light.
        let values = Array2::from_shape_fn((81, 2), |(light, channel)| {
            let [x, y, z] = lights.direction(light as u32);
            if channel == 0 { 0.3 + 0.2 * x - 0.1 * y + 0.4 * z } else { (light * 37 % 11) as f32 / 11.0 }
        });
        let nodes = map.nodes(values.view());
        let error = (&map.at_lights(nodes.view()) - &values).mapv(f32::abs);
        assert!(error.iter().all(|e| *e < 0.01), "{}", error.fold(0.0, |most: f32, e| most.max(*e)));
        let (mut smooth, mut count) = (0.0f64, 0);
        for direction in spiral(500).filter(|d| lights.locate(*d).beyond >= 1.0) {
            let read: f64 = corners(square(direction, map.radius()), 12)
                .iter()
                .map(|(node, weight)| weight * f64::from(nodes[[*node, 0]]))
                .sum();
            let place = lights.locate(direction);
            let wanted: f32 =
                place.ids.iter().zip(place.weights).map(|(id, weight)| weight * values[[*id as usize, 0]]).sum();
            smooth += (read - f64::from(wanted)).powi(2);
            count += 1;
        }
        assert!(count > 300 && (smooth / f64::from(count)).sqrt() < 0.01, "{}", (smooth / f64::from(count)).sqrt());
        // Planted: nodes in another order.
        let turned = Array2::from_shape_fn(nodes.dim(), |(node, c)| nodes[[143 - node, c]]);
        assert!((&map.at_lights(turned.view()) - &values).iter().any(|e| e.abs() > 0.3));
    }

    #[test]
    fn the_square_is_reached_at_its_corners_and_its_middle() {
        let r = |degrees: f64| [degrees.to_radians().sin() as f32, 0.0, degrees.to_radians().cos() as f32];
        assert_eq!(square([0.0, 0.0, 1.0], 0.8), [0.5, 0.5]);
        assert!((square(r(90.0), 1.0)[0] - 1.0).abs() < 1e-6);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let corner = square([-half, half, 0.0], 1.0);
        assert!((corner[0] - 0.0).abs() < 1e-6 && (corner[1] - 1.0).abs() < 1e-6, "{corner:?}");
        // Below the lowest light.
        assert_eq!(square(r(89.0), 0.5)[0], 1.0);
    }
}
