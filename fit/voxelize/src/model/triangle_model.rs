//! Models as triangles with their materials.

use crate::error::VoxelizeError;
use crate::model::frame::Frame;
use crate::model::leaf_colour::MaterialFile;
use crate::model::light_table::LightTable;
use crate::model::microflakes::MicroflakeColour;
use btf_models::{DiffuseColour, ModelPart, read_model};
use glam::{Mat4, Vec3};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A model of triangles in metres.
#[derive(Debug, Clone, Default)]
pub struct TriangleModel {
    /// Corners; z points up.
    pub triangles: Vec<[Vec3; 3]>,
    /// Number of each triangle's material.
    pub materials: Vec<u32>,
    /// The materials.
    pub colours: Vec<MicroflakeColour>,
    /// Light of the materials that are leaves or assets by its directions; others, and all beyond the end, are as their
    /// colours say.
    pub tables: Vec<Option<Arc<LightTable>>>,
    /// Share of each material's area that counts: half where surfaces are closed, whose backs nobody sees.
    pub weights: Vec<f32>,
}

impl TriangleModel {
    /// Reads `.obj`, `.gltf` or `.glb` with all instances. Materials that point at a leaf or an asset have its
    /// hemispherical integrals for colours.
    ///
    /// # Errors
    /// As [`read_model`], and for leaves and assets that cannot be read.
    pub fn read(path: &Path) -> Result<TriangleModel, VoxelizeError> {
        let mut model = TriangleModel::default();
        // Leaves and assets that several parts show are integrated once.
        let mut known: HashMap<&PathBuf, Shown> = HashMap::new();
        let meshes = read_model(path)?;
        for mesh in &meshes {
            for part in &mesh.parts {
                if let Some(file) = part.shows.as_ref().filter(|file| !known.contains_key(file)) {
                    let shown = MaterialFile::read(file)?;
                    known.insert(file, (shown.colour(), Arc::new(shown.light_table())));
                }
                let material = model.add_material(part, part.shows.as_ref().and_then(|file| known.get(file)));
                for place in &mesh.places {
                    model.add_part(part, *place, material);
                }
            }
        }
        Ok(model)
    }

    fn add_material(&mut self, part: &ModelPart, shown: Option<&Shown>) -> u32 {
        let DiffuseColour { reflectance, transmittance } = part.colour;
        let plain = MicroflakeColour { reflectance, transmittance, ..MicroflakeColour::default() };
        self.colours.push(shown.map_or(plain, |(colour, _)| *colour));
        self.tables.push(shown.map(|(_, table)| table.clone()));
        self.weights.push(if is_closed(part) { 0.5 } else { 1.0 });
        self.colours.len() as u32 - 1
    }

    fn add_part(&mut self, part: &ModelPart, place: Mat4, material: u32) {
        let corners = |t: &[u32; 3]| t.map(|i| z_up(place.transform_point3(part.positions[i as usize].into())));
        self.triangles.extend(part.triangles.iter().map(corners));
        self.materials.resize(self.triangles.len(), material);
    }

    /// Returns the least and the greatest corner of the bounding box.
    pub fn bounds(&self) -> [Vec3; 2] {
        let start = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        self.triangles.iter().flatten().fold(start, |[lo, hi], p| [lo.min(*p), hi.max(*p)])
    }

    /// Returns the area of all triangles in squares of the corners' unit.
    pub fn area(&self) -> f64 {
        let area = |[a, b, c]: &[Vec3; 3]| {
            let [along, across] = [*b - *a, *c - *a].map(Vec3::as_dvec3);
            0.5 * along.cross(across).length()
        };
        self.triangles.iter().map(area).sum()
    }

    /// Returns the model in the unit cube.
    pub fn in_cube(&self, frame: &Frame) -> TriangleModel {
        let triangles = self.triangles.iter().map(|t| t.map(|p| frame.cube_from_m(p))).collect();
        TriangleModel {
            triangles,
            materials: self.materials.clone(),
            colours: self.colours.clone(),
            tables: self.tables.clone(),
            weights: self.weights.clone(),
        }
    }

    /// Returns the unit normal of a triangle; zero where the triangle has no area.
    pub fn normal(&self, triangle: usize) -> Vec3 {
        let [a, b, c] = self.triangles[triangle];
        (b - a).cross(c - a).normalize_or_zero()
    }
}

/// Colour and light of a leaf or an asset.
type Shown = (MicroflakeColour, Arc<LightTable>);

/// Converts from the files' axes, whose y points up, to the volume's, whose z does.
fn z_up(p: Vec3) -> Vec3 {
    Vec3::new(p.x, -p.z, p.y)
}

/// Tells whether nearly every edge has a triangle on both sides, so that the part encloses a volume.
pub(crate) fn is_closed(part: &ModelPart) -> bool {
    if part.double_sided {
        return false;
    }
    // Vertices that lie in one place are one, whatever their normals.
    let mut places: HashMap<[u32; 3], u32> = HashMap::new();
    let place: Vec<u32> = part
        .positions
        .iter()
        .map(|p| {
            let next = places.len() as u32;
            *places.entry(p.map(|x| (x + 0.0).to_bits())).or_insert(next)
        })
        .collect();
    let mut edges: HashMap<[u32; 2], i32> = HashMap::new();
    let mut count = 0;
    for t in &part.triangles {
        for i in 0..3 {
            let (a, b) = (place[t[i] as usize], place[t[(i + 1) % 3] as usize]);
            if a != b {
                *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
                count += 1;
            }
        }
    }
    let open: i32 = edges.values().map(|sum| sum.abs()).sum();
    f64::from(open) < OPEN_SHARE * f64::from(count)
}

/// Share of edges with one side up to which a part counts as closed: stems are open where leaves begin.
const OPEN_SHARE: f64 = 0.1;
