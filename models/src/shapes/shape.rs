//! Shapes that can be drawn: solids, surfaces, fields, fur and particles.
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
//! | `particles` | surface of paths | `from` a surface or solid; see [`ParticleSystem`] |
//! | `hypertexture` | field | a solid with a soft rim that noise moves [Perlin & Hoffert 1989] |
//! | `density` | field | a scanned volume |

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::shapes::noise::Noise;
use crate::shapes::point::Point;

/// Largest depth of shapes within shapes.
pub const MAX_NESTING: usize = 16;

/// Shape that a stroke draws; see the table of the module. Lengths are in metres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Shape {
    /// All points within `radius_m` of the centre.
    Sphere {
        /// Centre of the sphere.
        centre_m: Point,
        /// Radius.
        radius_m: f64,
    },
    /// A box along the axes.
    Box {
        /// Corner of the least coordinates.
        least_m: Point,
        /// Corner of the greatest coordinates.
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
        /// Radii at both ends.
        radii_m: [f64; 2],
    },
    /// Points in any of these solids.
    Union {
        /// Solids that are combined.
        of: Vec<Shape>,
    },
    /// Points in all of these solids.
    Intersection {
        /// Solids that are combined.
        of: Vec<Shape>,
    },
    /// Points in the first of these solids and in none of the others.
    Difference {
        /// Solids that are combined.
        of: Vec<Shape>,
    },
    /// An implicit surface around a skeleton: points where `sum weight_m2 / d^2 >= threshold`, d being the distance to
    /// an element [Neyret 1996, section 3.1]. An element alone is a tube of radius `sqrt(weight_m2 / threshold)`.
    Blend {
        /// Elements of the skeleton.
        elements: Vec<BlendElement>,
        /// Potential on the surface.
        #[serde(default = "one")]
        threshold: f64,
    },
    /// A shape in another place.
    Placed {
        /// Shape that is placed: a solid, a sheet, a limb or a mesh.
        of: Box<Shape>,
        /// Scale factor about the origin of `of`.
        #[serde(default = "one")]
        scale: f64,
        /// Rotations about x, then y, then z in degrees, counterclockwise seen against the axis.
        #[serde(default)]
        turn_deg: [f64; 3],
        /// Translation after scale and rotation.
        #[serde(default)]
        move_m: Point,
    },
    /// A branch or stem: cones from point to point, with a disc at each end and no faces between.
    Limb {
        /// Points of the axis, at least two.
        points_m: Vec<Point>,
        /// Radius at each point.
        radii_m: Vec<f64>,
    },
    /// A blade, petal or any thin sheet with two equal faces: quads between rows of points. A row of one point is the
    /// tip of a fan. The quads are counterclockwise as seen with the rows upwards and their points to the right.
    /// Texture coordinates run from 0 to 1, u along rows, v from the first row to the last.
    Sheet {
        /// Rows with equal numbers of points, or of one point.
        rows_m: Vec<Vec<Point>>,
    },
    /// The surface of a mesh.
    Mesh {
        /// Path of a .glb, .gltf or .obj file, relative to the script.
        file: PathBuf,
        /// Axis of the mesh that is up; y in glTF.
        #[serde(default)]
        up: UpAxis,
    },
    /// Strands of hair or grass on a surface: cylinders from segment to segment [Kajiya & Kay 1989].
    Fur {
        /// Ground of the fur: a sheet, a mesh, a sphere, a box, or one of these placed.
        on: Box<Shape>,
        /// Number of strands on a square metre of the ground.
        strands_per_m2: f64,
        /// Length of a strand.
        length_m: f64,
        /// Radius of a strand at its root; the radius falls to 0 at the tip.
        radius_m: f64,
        /// Angle between the root of a strand and the normal of its ground, in degrees.
        #[serde(default)]
        lean_deg: f64,
        /// Direction that strands lean to, of any length.
        #[serde(default = "along_x")]
        lean_towards: Point,
        /// Angle by which the tip of a strand turns further down than its root, in degrees.
        #[serde(default)]
        bend_deg: f64,
        /// Number of turns of the strand about its own course, from root to tip.
        #[serde(default)]
        curl_turns: f64,
        /// Radius of those turns at the tip; the radius grows from 0 at the root.
        #[serde(default)]
        curl_radius_m: f64,
        /// Relative variation of lengths and angles of strands, 0 to 1.
        #[serde(default)]
        jitter: f64,
        /// Number of cylinders of a strand, 1 to 64.
        #[serde(default = "eight")]
        segments: u32,
        /// Seed of roots and jitter.
        #[serde(default = "first_seed")]
        seed: u64,
    },
    /// Paths of particles that leave a surface [Reeves & Blau 1985].
    Particles(Box<ParticleSystem>),
    /// A solid with a soft rim. The density is `1/2 - (d + amplitude_m noise) / rim_m`, clamped to 0 and 1, where d is
    /// the signed distance, negative inside.
    Hypertexture {
        /// Solid that gets the rim.
        of: Box<Shape>,
        /// Width of the rim.
        rim_m: f64,
        /// Largest distance by which noise moves the rim.
        amplitude_m: f64,
        /// Noise that is evaluated.
        noise: Noise,
        /// Area of microflakes in a cubic metre of density 1, with one face of each counted.
        area_per_m3: f64,
    },
    /// A scanned volume of density that fills a box.
    Density {
        /// Values of the volume.
        data: DensityData,
        /// Corner of the least coordinates.
        least_m: Point,
        /// Corner of the greatest coordinates.
        most_m: Point,
        /// Values of the file that mean density 0 and 1; values beyond are clamped.
        range: [f64; 2],
        /// Area of microflakes in a cubic metre of density 1, with one face of each counted.
        area_per_m3: f64,
    },
}

/// Particles that leave a surface together, whose paths are drawn as round strands or as blades. Thrown upwards, with a V as their
/// section, they are the grass of Reeves and Blau.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParticleSystem {
    /// Emitter: a sheet, a mesh, a sphere, a box, or one of these placed. A point is a small sphere.
    pub from: Shape,
    /// Number of particles, as many from equal areas of the emitter.
    pub particles: u64,
    /// Speed with which a particle leaves, metres a second.
    pub speed_m_per_s: f64,
    /// Direction in which particles leave, of any length; without it the normal of the emitter.
    #[serde(default)]
    pub towards: Option<Point>,
    /// Largest angle between that direction and a particle's own, degrees, 0 to 180; directions are spread evenly over the sphere's
    /// cap.
    #[serde(default)]
    pub spread_deg: f64,
    /// Acceleration, metres a second squared; without it the earth's.
    #[serde(default = "gravity")]
    pub acceleration_m_per_s2: Point,
    /// Drag of the air, which is at rest: a particle's deceleration over its speed, 1/s.
    #[serde(default)]
    pub drag_per_s: f64,
    /// Time for which a particle lives, seconds.
    pub life_s: f64,
    /// Relative variation of speeds and lives, 0 to 1.
    #[serde(default)]
    pub jitter: f64,
    /// What is drawn along the path.
    pub trail: Trail,
    /// Pieces of a path, 1 to 64.
    #[serde(default = "eight")]
    pub segments: u32,
    /// Seed of places, directions and jitter.
    #[serde(default = "first_seed")]
    pub seed: u64,
}

/// What is drawn along the path of a particle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Trail {
    /// Cones from piece to piece.
    Strand {
        /// Radii where the path begins and where it ends, of which one may be 0.
        radii_m: [f64; 2],
    },
    /// A sheet with two equal faces, folded along the path.
    Blade {
        /// Widths where the path begins and where it ends, measured across both halves, of which one may be 0.
        widths_m: [f64; 2],
        /// Angle by which each half rises from the flat, degrees, 0 to 89: its section is a V.
        #[serde(default)]
        fold_deg: f64,
    },
}

/// Element of a blend's skeleton.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlendElement {
    /// One point, the ends of a segment, or the corners of a triangle.
    pub points_m: Vec<Point>,
    /// Weight of the element: the square of its radius when it is alone and the threshold is 1.
    pub weight_m2: f64,
}

/// Axis of a mesh that is up.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// The y axis, as in glTF: (x, y, z) of the script is (x, -z, y) of the mesh.
    #[default]
    Y,
    /// The z axis, as in the script.
    Z,
}

/// Source of the values of a scanned volume.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum DensityData {
    /// A file of values, x fastest, then y, then z.
    Raw {
        /// The file, relative to the script.
        file: PathBuf,
        /// Numbers of values along x, y and z.
        cells: [u32; 3],
        /// Type of a value.
        number: NumberType,
        /// Bytes before the first number.
        #[serde(default)]
        header_bytes: u64,
    },
    /// A folder of images of one size, one for each z from the least on, in the order of their names, with their upper
    /// edges at the greatest y. Values are those stored: 0 to 255, or to 65535 with 16 bits.
    Slices {
        /// Path of the folder, relative to the script.
        folder: PathBuf,
    },
}

/// Storage type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NumberType {
    /// One unsigned byte.
    U8,
    /// Unsigned 16 bits, little endian.
    U16le,
    /// Unsigned 16 bits, big endian.
    U16be,
    /// Single precision, little endian.
    F32le,
    /// Single precision, big endian.
    F32be,
}

impl NumberType {
    /// Returns the size of a number in bytes.
    pub fn bytes(self) -> usize {
        match self {
            NumberType::U8 => 1,
            NumberType::U16le | NumberType::U16be => 2,
            NumberType::F32le | NumberType::F32be => 4,
        }
    }

    /// Decodes a number from its bytes; returns 0 where there are too few.
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
    /// Returns the name of the shape's kind in the file.
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
            Shape::Particles(_) => "particles",
            Shape::Hypertexture { .. } => "hypertexture",
            Shape::Density { .. } => "density",
        }
    }

    /// Returns whether the shape has an inside that a signed distance can tell from its outside.
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

    /// Returns the shapes that the shape is made of.
    pub fn parts(&self) -> &[Shape] {
        match self {
            Shape::Union { of } | Shape::Intersection { of } | Shape::Difference { of } => of,
            Shape::Placed { of, .. } | Shape::Hypertexture { of, .. } => std::slice::from_ref(of),
            Shape::Fur { on, .. } => std::slice::from_ref(on),
            Shape::Particles(system) => std::slice::from_ref(&system.from),
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

fn gravity() -> Point {
    [0.0, 0.0, -9.81]
}
