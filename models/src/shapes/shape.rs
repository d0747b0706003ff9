//! What can be drawn: solids, surfaces, fields and fur.
//!
//! | kind | is | keys |
//! |---|---|---|
//! | `sphere` | solid | `centre_m`, `radius_m` |
//! | `box` | solid | `least_m`, `most_m`; turned by `placed` |
//! | `cylinder` | solid | `ends_m`, `radius_m` |
//! | `cone` | solid | `ends_m`, `radii_m` at both ends, of which one may be 0 |
//! | `union`, `intersection`, `difference` | solid | `of`: solids; a difference is the first without the others |
//! | `blend` | solid | `elements`, `threshold`: where `sum weight_m2 / distance^2` is at least the threshold |
//! | `placed` | as `of` | `of`, scaled, then turned about x, y and z, then moved |
//! | `limb` | closed surface | `points_m`, `radii_m`: cones from point to point, discs at both ends |
//! | `sheet` | surface of two faces | `rows_m`: rows of as many points each, or of one; quads and triangles between them |
//! | `mesh` | surface | `file` (.glb, .gltf, .obj), `up` |
//! | `fur` | surface of strands | `on` a surface or solid; see [`Shape::Fur`] |
//! | `hypertexture` | field | a solid with a soft rim that noise moves [Perlin & Hoffert 1989] |
//! | `density` | field | a scanned volume |

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::shapes::noise::Noise;
use crate::shapes::point::Point;

/// How deep shapes may lie in shapes.
pub const MAX_NESTING: usize = 16;

/// Something that a stroke draws; see the module's table. Lengths in metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Shape {
    /// All points within `radius_m` of the centre.
    Sphere {
        /// Centre.
        centre_m: Point,
        /// Radius.
        radius_m: f64,
    },
    /// A box along the axes.
    Box {
        /// Corner of the least coordinates.
        least_m: Point,
        /// Corner of the greatest.
        most_m: Point,
    },
    /// A cylinder with flat ends.
    Cylinder {
        /// Centres of both ends.
        ends_m: [Point; 2],
        /// Radius.
        radius_m: f64,
    },
    /// A cone, cut where its second radius is not 0, with flat ends.
    Cone {
        /// Centres of both ends.
        ends_m: [Point; 2],
        /// Radii there.
        radii_m: [f64; 2],
    },
    /// What lies in any of these solids.
    Union {
        /// The solids.
        of: Vec<Shape>,
    },
    /// What lies in all of these solids.
    Intersection {
        /// The solids.
        of: Vec<Shape>,
    },
    /// What lies in the first of these solids and in none of the others.
    Difference {
        /// The solids.
        of: Vec<Shape>,
    },
    /// An implicit surface around a skeleton: points where `sum weight_m2 / d^2 >= threshold`, d being the distance to
    /// an element [Neyret 1996, section 3.1]. An element alone is a tube of radius `sqrt(weight_m2 / threshold)`.
    Blend {
        /// The skeleton.
        elements: Vec<BlendElement>,
        /// Potential on the surface.
        #[serde(default = "one")]
        threshold: f64,
    },
    /// A shape in another place.
    Placed {
        /// What is placed: a solid, a sheet, a limb or a mesh.
        of: Box<Shape>,
        /// Size over that of `of`, about its origin.
        #[serde(default = "one")]
        scale: f64,
        /// Turns about x, then y, then z, counterclockwise seen against the axis.
        #[serde(default)]
        turn_deg: [f64; 3],
        /// Then moved by.
        #[serde(default)]
        move_m: Point,
    },
    /// A branch or stem: cones from point to point, with a disc at each end and no faces between.
    Limb {
        /// Its axis, two points and more.
        points_m: Vec<Point>,
        /// Radius at each.
        radii_m: Vec<f64>,
    },
    /// A blade, petal or any thin sheet, whose faces look alike: quads between rows of points. A row of one point is
    /// the tip of a fan. Counterclockwise as seen with the rows upwards and their points to the right. Texture
    /// coordinates run from 0 to 1, u along rows, v from the first to the last.
    Sheet {
        /// Rows of as many points each, or of one.
        rows_m: Vec<Vec<Point>>,
    },
    /// The surface of a mesh.
    Mesh {
        /// A .glb, .gltf or .obj file, relative to the script.
        file: PathBuf,
        /// Which of its axes is up; glTF's is y.
        #[serde(default)]
        up: UpAxis,
    },
    /// Strands of hair or grass on a surface: cylinders from segment to segment [Kajiya & Kay 1989].
    Fur {
        /// The ground: a sheet, a mesh, a sphere, a box, or one of these placed.
        on: Box<Shape>,
        /// Strands on a square metre of it.
        strands_per_m2: f64,
        /// Length of a strand.
        length_m: f64,
        /// Radius at its root; it thins to none at its tip.
        radius_m: f64,
        /// Angle between a strand's root and the normal of its ground.
        #[serde(default)]
        lean_deg: f64,
        /// Where strands lean to; needs no length.
        #[serde(default = "along_x")]
        lean_towards: Point,
        /// How far a strand's tip turns further down than its root.
        #[serde(default)]
        bend_deg: f64,
        /// Turns of the strand about its own course, from root to tip.
        #[serde(default)]
        curl_turns: f64,
        /// Radius of those turns at the tip; it grows from none at the root.
        #[serde(default)]
        curl_radius_m: f64,
        /// How far lengths and angles of strands go apart, 0 to 1.
        #[serde(default)]
        jitter: f64,
        /// Cylinders of a strand, 1 to 64.
        #[serde(default = "eight")]
        segments: u32,
        /// Seed of roots and jitter.
        #[serde(default = "first_seed")]
        seed: u64,
    },
    /// A solid with a soft rim: its density is `1/2 - (d + amplitude_m noise) / rim_m`, held to 0 and 1, d being the
    /// signed distance, negative inside.
    Hypertexture {
        /// The solid.
        of: Box<Shape>,
        /// Width of the rim.
        rim_m: f64,
        /// How far noise moves it.
        amplitude_m: f64,
        /// The noise.
        noise: Noise,
        /// Area of microflakes in a cubic metre of density 1, one face of each counted.
        area_per_m3: f64,
    },
    /// A scanned volume of density that fills a box.
    Density {
        /// Its numbers.
        data: DensityData,
        /// Corner of the least coordinates.
        least_m: Point,
        /// Corner of the greatest.
        most_m: Point,
        /// Numbers of the file that are density 0 and 1; beyond these it is held to them.
        range: [f64; 2],
        /// Area of microflakes in a cubic metre of density 1, one face of each counted.
        area_per_m3: f64,
    },
}

/// A part of a blend's skeleton.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlendElement {
    /// One point, the ends of a segment, or the corners of a triangle.
    pub points_m: Vec<Point>,
    /// Its weight: the square of the radius that it has alone at threshold 1.
    pub weight_m2: f64,
}

/// The axis of a mesh that is up.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// y, as in glTF: the script's (x, y, z) is the mesh's (x, -z, y).
    #[default]
    Y,
    /// z, as in the script.
    Z,
}

/// Where the numbers of a scanned volume are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum DensityData {
    /// A file of numbers, x fastest, then y, then z.
    Raw {
        /// The file, relative to the script.
        file: PathBuf,
        /// Numbers along x, y and z.
        cells: [u32; 3],
        /// What a number is.
        number: NumberType,
        /// Bytes before the first number.
        #[serde(default)]
        header_bytes: u64,
    },
    /// A folder of pictures of one size, from the least z on in the order of their names, their upper edges at the
    /// greatest y. Numbers are those stored: 0 to 255, or to 65535 with 16 bits.
    Slices {
        /// The folder, relative to the script.
        folder: PathBuf,
    },
}

/// How a number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NumberType {
    /// One byte.
    U8,
    /// Two bytes, the low one first.
    U16le,
    /// Two bytes, the high one first.
    U16be,
    /// Single precision, the low byte first.
    F32le,
    /// Single precision, the high byte first.
    F32be,
}

impl NumberType {
    /// Returns the bytes of a number.
    pub fn bytes(self) -> usize {
        match self {
            NumberType::U8 => 1,
            NumberType::U16le | NumberType::U16be => 2,
            NumberType::F32le | NumberType::F32be => 4,
        }
    }

    /// Returns the number in its bytes; 0 where there are too few.
    pub fn number(self, bytes: &[u8]) -> f32 {
        match (self, bytes) {
            (NumberType::U8, &[byte, ..]) => f32::from(byte),
            (NumberType::U16le, &[a, b, ..]) => f32::from(u16::from_le_bytes([a, b])),
            (NumberType::U16be, &[a, b, ..]) => f32::from(u16::from_be_bytes([a, b])),
            (NumberType::F32le, &[a, b, c, d, ..]) => f32::from_le_bytes([a, b, c, d]),
            (NumberType::F32be, &[a, b, c, d, ..]) => f32::from_be_bytes([a, b, c, d]),
            _ => 0.0,
        }
    }
}

impl Shape {
    /// Returns the name of its kind in the file.
    pub fn kind(&self) -> &'static str {
        match self {
            Shape::Sphere { .. } => "sphere",
            Shape::Box { .. } => "box",
            Shape::Cylinder { .. } => "cylinder",
            Shape::Cone { .. } => "cone",
            Shape::Union { .. } => "union",
            Shape::Intersection { .. } => "intersection",
            Shape::Difference { .. } => "difference",
            Shape::Blend { .. } => "blend",
            Shape::Placed { .. } => "placed",
            Shape::Limb { .. } => "limb",
            Shape::Sheet { .. } => "sheet",
            Shape::Mesh { .. } => "mesh",
            Shape::Fur { .. } => "fur",
            Shape::Hypertexture { .. } => "hypertexture",
            Shape::Density { .. } => "density",
        }
    }

    /// Returns whether it has an inside that can be told from its outside by a distance.
    pub fn is_solid(&self) -> bool {
        match self {
            Shape::Sphere { .. }
            | Shape::Box { .. }
            | Shape::Cylinder { .. }
            | Shape::Cone { .. }
            | Shape::Union { .. }
            | Shape::Intersection { .. }
            | Shape::Difference { .. }
            | Shape::Blend { .. } => true,
            Shape::Placed { of, .. } => of.is_solid(),
            _ => false,
        }
    }

    /// Returns the shapes that it is made of.
    pub fn parts(&self) -> &[Shape] {
        match self {
            Shape::Union { of } | Shape::Intersection { of } | Shape::Difference { of } => of,
            Shape::Placed { of, .. } | Shape::Hypertexture { of, .. } => std::slice::from_ref(of),
            Shape::Fur { on, .. } => std::slice::from_ref(on),
            _ => &[],
        }
    }
}

fn one() -> f64 {
    1.0
}

fn eight() -> u32 {
    8
}

fn first_seed() -> u64 {
    1
}

fn along_x() -> Point {
    [1.0, 0.0, 0.0]
}
