//! Solids as functions that are negative inside: signed distances, CSG of them, implicit blends.
//!
//! A function that no ball's radius changes by more than that radius tells whether a ball is inside, outside or neither
//! [Neyret 1996, section 3.1]. Minimum and maximum of distances are such functions, but no distances any more: of a
//! difference they may be far too near zero. [`Solid::range`] bounds the values in a ball part by part, so a ball that
//! is called inside or outside is, and one that is neither is split.

use btf_models::shapes::{BlendElement, Shape};
use glam::{DMat3, DVec3};

/// A solid.
#[derive(Debug, Clone)]
pub enum Solid {
    /// All places within a radius of a point.
    Sphere {
        /// Centre.
        centre: DVec3,
        /// Radius.
        radius: f64,
    },
    /// A box along the axes.
    Box {
        /// Middle.
        middle: DVec3,
        /// Half of the sides.
        half: DVec3,
    },
    /// A cone with flat ends.
    Cone {
        /// Middle of the first end.
        foot: DVec3,
        /// Unit vector to the other end.
        along: DVec3,
        /// Distance of the ends.
        height: f64,
        /// Radius at both ends.
        radii: [f64; 2],
    },
    /// All places in any of the solids.
    Union(Vec<Solid>),
    /// All places in all of the solids.
    Intersection(Vec<Solid>),
    /// All places in the first solid and in none of the others.
    Difference(Vec<Solid>),
    /// All places around a skeleton.
    Blend {
        /// Points, segments or triangles with their radii.
        elements: Vec<(Vec<DVec3>, f64)>,
        /// The least of the radii.
        least_radius: f64,
    },
    /// A solid in another place: a point's place in the solid is `turn^T (p - moved) / scale`.
    Placed {
        /// Solid that is placed.
        of: Box<Solid>,
        /// Place of the solid.
        place: Placement,
    },
}

/// Scaling, rotation and translation.
#[derive(Debug, Clone, Copy)]
pub struct Placement {
    scale: f64,
    turn: DMat3,
    moved: DVec3,
}

impl Placement {
    /// Placement that moves nothing.
    pub const NONE: Placement = Placement { scale: 1.0, turn: DMat3::IDENTITY, moved: DVec3::ZERO };

    /// Returns the placement that scales, turns about x, then y, then z, and moves.
    pub fn new(scale: f64, turn_deg: [f64; 3], move_m: [f64; 3]) -> Placement {
        let [x, y, z] = turn_deg.map(f64::to_radians);
        let turn = DMat3::from_rotation_z(z) * DMat3::from_rotation_y(y) * DMat3::from_rotation_x(x);
        Placement { scale, turn, moved: move_m.into() }
    }

    /// Returns this placement after `first`.
    pub fn after(&self, first: &Placement) -> Placement {
        Placement { scale: self.scale * first.scale, turn: self.turn * first.turn, moved: self.apply(first.moved) }
    }

    /// Returns the factor of lengths.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// Returns the place of a point of the placed thing.
    pub fn apply(&self, place: DVec3) -> DVec3 {
        self.turn * (place * self.scale) + self.moved
    }

    fn undo(&self, place: DVec3) -> DVec3 {
        self.turn.transpose() * (place - self.moved) / self.scale
    }
}

impl Solid {
    /// Returns the solid of a shape; `None` for a shape that is not solid ([`Shape::is_solid`]).
    pub fn of(shape: &Shape) -> Option<Solid> {
        let all = |shapes: &[Shape]| shapes.iter().map(Solid::of).collect::<Option<Vec<Solid>>>();
        let cone = |ends_m: &[[f64; 3]; 2], radii: [f64; 2]| {
            let [foot, top] = ends_m.map(DVec3::from);
            let height = foot.distance(top);
            Solid::Cone { foot, along: (top - foot) / height, height, radii }
        };
        Some(match shape {
            Shape::Sphere { centre_m, radius_m } => Solid::Sphere { centre: (*centre_m).into(), radius: *radius_m },
            Shape::Box { least_m, most_m } => {
                let [least, most] = [*least_m, *most_m].map(DVec3::from);
                Solid::Box { middle: 0.5 * (least + most), half: 0.5 * (most - least) }
            }
            Shape::Cylinder { ends_m, radius_m } => cone(ends_m, [*radius_m; 2]),
            Shape::Cone { ends_m, radii_m } => cone(ends_m, *radii_m),
            Shape::Union { of } => Solid::Union(all(of)?),
            Shape::Intersection { of } => Solid::Intersection(all(of)?),
            Shape::Difference { of } => Solid::Difference(all(of)?),
            Shape::Blend { elements, threshold } => {
                let element = |element: &BlendElement| {
                    let points = element.points_m.iter().map(|&point| point.into()).collect::<Vec<DVec3>>();
                    (points, (element.weight_m2 / threshold).sqrt())
                };
                let elements: Vec<_> = elements.iter().map(element).collect();
                let least_radius = elements.iter().map(|(_, radius)| *radius).fold(f64::INFINITY, f64::min);
                Solid::Blend { elements, least_radius }
            }
            Shape::Placed { of, scale, turn_deg, move_m } => {
                Solid::Placed { of: Solid::of(of)?.into(), place: Placement::new(*scale, *turn_deg, *move_m) }
            }
            _ => return None,
        })
    }

    /// Returns the solid's function: negative inside, 0 on the surface; near the surface the distance in metres,
    /// nowhere more than that.
    pub fn value(&self, p: DVec3) -> f64 {
        let values = |of: &[Solid]| of.iter().map(|solid| solid.value(p)).collect::<Vec<f64>>();
        match self {
            Solid::Sphere { centre, radius } => p.distance(*centre) - radius,
            Solid::Box { middle, half } => {
                let q = (p - middle).abs() - half;
                q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
            }
            Solid::Cone { foot, along, height, radii } => {
                let t = (p - foot).dot(*along);
                let r = (p - foot - t * along).length();
                cone_distance([r, t], *height, *radii)
            }
            Solid::Union(of) => values(of).into_iter().fold(f64::INFINITY, f64::min),
            Solid::Intersection(of) => values(of).into_iter().fold(f64::NEG_INFINITY, f64::max),
            Solid::Difference(of) => {
                let values = values(of);
                values[1..].iter().fold(values[0], |value, other| value.max(-other))
            }
            Solid::Blend { elements, least_radius } => {
                let potential = elements.iter().map(|(points, radius)| (radius / distance(points, p)).powi(2));
                least_radius * (potential.sum::<f64>().sqrt().recip() - 1.0)
            }
            Solid::Placed { of, place } => place.scale * of.value(place.undo(p)),
        }
    }

    /// Returns the least and the greatest value that the function may have in a ball.
    pub fn range(&self, centre: DVec3, radius: f64) -> [f64; 2] {
        let ranges = |of: &[Solid]| of.iter().map(|solid| solid.range(centre, radius)).collect::<Vec<_>>();
        let both = |ranges: Vec<[f64; 2]>, pick: fn(f64, f64) -> f64| {
            ranges.into_iter().reduce(|a, b| [pick(a[0], b[0]), pick(a[1], b[1])]).unwrap_or([f64::INFINITY; 2])
        };
        match self {
            Solid::Union(of) => both(ranges(of), f64::min),
            Solid::Intersection(of) => both(ranges(of), f64::max),
            Solid::Difference(of) => {
                let mut ranges = ranges(of);
                ranges[1..].iter_mut().for_each(|range| *range = [-range[1], -range[0]]);
                both(ranges, f64::max)
            }
            Solid::Blend { elements, least_radius } => {
                // Every element as near, and as far, as it can be.
                let bound = |reach: f64| {
                    let at = |points: &[DVec3]| (distance(points, centre) + reach).max(0.0);
                    let potential = elements.iter().map(|(points, radius)| (radius / at(points)).powi(2)).sum::<f64>();
                    least_radius * (potential.sqrt().recip() - 1.0)
                };
                [bound(-radius), bound(radius)]
            }
            Solid::Placed { of, place } => {
                of.range(place.undo(centre), radius / place.scale).map(|value| value * place.scale)
            }
            _ => {
                let value = self.value(centre);
                [value - radius, value + radius]
            }
        }
    }

    /// Returns the corners of a box around all places where the value is at most `level_m`, which is not negative.
    pub fn bounds(&self, level_m: f64) -> [DVec3; 2] {
        let all = |of: &[Solid]| of.iter().map(|solid| solid.bounds(level_m)).collect::<Vec<_>>();
        match self {
            Solid::Sphere { centre, radius } => [centre - (radius + level_m), centre + (radius + level_m)],
            Solid::Box { middle, half } => [middle - half - level_m, middle + half + level_m],
            Solid::Cone { foot, along, height, radii } => {
                // A disc across a unit vector reaches so far along each axis.
                let reach = (DVec3::ONE - along * along).max(DVec3::ZERO).map(f64::sqrt);
                let [a, b] = [(*foot, radii[0]), (foot + along * *height, radii[1])];
                let least = (a.0 - reach * a.1).min(b.0 - reach * b.1);
                let most = (a.0 + reach * a.1).max(b.0 + reach * b.1);
                [least - level_m, most + level_m]
            }
            Solid::Union(of) => all(of)
                .into_iter()
                .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |hull, one| [hull[0].min(one[0]), hull[1].max(one[1])]),
            Solid::Intersection(of) => all(of)
                .into_iter()
                .fold([DVec3::NEG_INFINITY, DVec3::INFINITY], |hull, one| [hull[0].max(one[0]), hull[1].min(one[1])]),
            Solid::Difference(of) => of[0].bounds(level_m),
            Solid::Blend { elements, least_radius } => {
                // Some element has at least its share of the potential that the level has.
                let share = (elements.len() as f64).sqrt() * (1.0 + level_m / least_radius);
                let mut hull = [DVec3::INFINITY, DVec3::NEG_INFINITY];
                for (points, radius) in elements {
                    for &point in points {
                        hull = [hull[0].min(point - share * radius), hull[1].max(point + share * radius)];
                    }
                }
                hull
            }
            Solid::Placed { of, place } => {
                let [least, most] = of.bounds(level_m / place.scale);
                let (middle, half) = (place.apply(0.5 * (least + most)), 0.5 * (most - least) * place.scale);
                let turn = place.turn;
                let reach = turn.x_axis.abs() * half.x + turn.y_axis.abs() * half.y + turn.z_axis.abs() * half.z;
                [middle - reach, middle + reach]
            }
        }
    }
}

/// Returns the signed distance, at `[from the axis, along it]`, to a cone from radius `radii[0]` at 0 to `radii[1]` at
/// `height`: the distance to a trapezium.
fn cone_distance([r, t]: [f64; 2], height: f64, radii: [f64; 2]) -> f64 {
    // To the flat ends.
    let radius = if t < 0.5 * height { radii[0] } else { radii[1] };
    let end = [(r - radius).max(0.0), (t - 0.5 * height).abs() - 0.5 * height];
    // To the slanted side.
    let (side, from) = ([radii[1] - radii[0], height], [r - radii[0], t]);
    let share = ((from[0] * side[0] + from[1] * side[1]) / (side[0] * side[0] + side[1] * side[1])).clamp(0.0, 1.0);
    let slant = [from[0] - share * side[0], from[1] - share * side[1]];
    let inside = end[1] < 0.0 && r < radii[0] + (radii[1] - radii[0]) * t / height;
    let nearest = (end[0] * end[0] + end[1] * end[1]).min(slant[0] * slant[0] + slant[1] * slant[1]).sqrt();
    if inside { -nearest } else { nearest }
}

/// Returns the distance of a point to a point, segment or triangle.
fn distance(points: &[DVec3], p: DVec3) -> f64 {
    match *points {
        [a] => p.distance(a),
        [a, b] => to_segment(a, b, p),
        [a, b, c] => {
            let normal = (b - a).cross(c - a);
            let within = |a: DVec3, b: DVec3| normal.cross(b - a).dot(p - a) >= 0.0;
            if normal != DVec3::ZERO && within(a, b) && within(b, c) && within(c, a) {
                return (p - a).dot(normal.normalize()).abs();
            }
            to_segment(a, b, p).min(to_segment(b, c, p)).min(to_segment(c, a, p))
        }
        _ => f64::INFINITY,
    }
}

fn to_segment(a: DVec3, b: DVec3, p: DVec3) -> f64 {
    let along = b - a;
    let share = if along == DVec3::ZERO { 0.0 } else { ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0) };
    p.distance(a + along * share)
}
