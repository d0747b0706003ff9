//! What is drawn: geometry, materials, packed assets, lights, camera, exposure; and the built-in scenes.

use crate::camera::Camera;
use crate::daylight::{Daylight, SKY_SIZE, SunAndSky};
use crate::environment::Environment;
use crate::error::ViewerError;
use crate::geometry::{Geometry, Mesh, Placement, Triangle};
use crate::gltf_asset::own_bodies;
use crate::mesh::{self, MeshPart};
use crate::mesh_file::{FileMesh, load_meshes};
use crate::models;
use crate::plant_variation::vary_plants;
use crate::scene_leaf::SceneLeaf;
use crate::sun::Sun;
use btf_capture::SharedBytes;
use btf_runtime::{Asset, Edits, FormatError, HeightField, Resident, ResidentFile, with_levels};
use glam::{Mat4, Vec3};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// Linear grey behind everything.
pub const BACKGROUND: [f32; 3] = [0.18; 3];
/// Field of view of the built-in scenes, degrees.
const FIELD_OF_VIEW_DEG: f32 = 30.0;
/// From the object to the first light: upper left, in front. In camera axes (right, up, towards the eye).
const KEY_LIGHT: Vec3 = Vec3::new(-0.65, 0.75, 0.9);
/// Radius of the ring of lights in the Cornell box, half of whose width is 1: the half width of the original's luminaire.
const LUMINAIRE_RADIUS: f32 = 0.22;
/// Distance of the lights from the object's centre, in radii of its bounding sphere.
const LIGHT_DISTANCE_RADII: f32 = 4.0;
/// Brightness of the built-in lights together: a white Lambertian surface that faces all of them at the object's
/// centre has this linear value. More than one, because real materials are seldom white.
const KEY_BRIGHTNESS: f32 = 1.6;

/// Width and height of an asset that does not tell its own, millimetres.
pub const UNKNOWN_SIZE_MM: f32 = 100.0;

/// A packed asset, ready to be decoded.
#[derive(Debug, Clone)]
pub struct SceneAsset {
    /// File stem, for messages and the panel.
    pub name: String,
    /// Its file, if it was read from one.
    pub path: Option<PathBuf>,
    /// Physical width and height in millimetres, where the asset tells them.
    pub size_mm: Option<[f32; 2]>,
    /// The asset in its file form; `None` where only the resident form is at hand.
    pub file: Option<FileForm>,
    /// The asset with its levels in resident form; the bases of one that came in file form are zeros.
    head: Resident,
    /// With its bases, once somebody has asked for them.
    expanded: OnceLock<Resident>,
    most_lobes: u32,
}

/// An asset in its file form: what editing and planning go by.
#[derive(Debug, Clone)]
pub struct FileForm {
    /// As the file has it.
    pub asset: Asset,
    /// The same with coarser levels, made here where the file has none.
    pub whole: Asset,
}

impl FileForm {
    /// The asset at a level, 0 the finest; the coarsest beyond them all. Cost: a copy.
    pub fn level(&self, level: usize) -> Asset {
        if level == 0 { self.asset.clone() } else { self.whole.level(level) }
    }
}

/// Work of the runtime on all threads.
fn parallel(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

impl SceneAsset {
    /// Reads and checks an asset in either form; maps a resident one.
    ///
    /// # Errors
    /// [`ViewerError::Read`] or [`ViewerError::Asset`], both naming the file.
    pub fn load(path: &Path) -> Result<SceneAsset, ViewerError> {
        let bad = |source| ViewerError::Asset { path: path.into(), source };
        // What cannot be opened is told in our own words.
        std::fs::File::open(path).map_err(|source| ViewerError::Read { path: path.into(), source })?;
        let bytes = SharedBytes::map(path)?;
        let name = path.file_stem().map_or_else(|| "asset".into(), |stem| stem.to_string_lossy().into_owned());
        let made = match bytes {
            Some(bytes) if ResidentFile::is_one(bytes.as_ref()) => {
                SceneAsset::of_resident(name, ResidentFile::open(Arc::new(bytes), &parallel).map_err(bad)?)
            }
            bytes => {
                let bytes = bytes.as_ref().map_or(&[][..], AsRef::as_ref);
                SceneAsset::new(name, Asset::parse_on(bytes, &parallel).map_err(bad)?)
            }
        };
        Ok(SceneAsset { path: Some(path.into()), ..made })
    }

    /// Checks an asset in either form that lies in memory.
    ///
    /// # Errors
    /// What is wrong with the bytes.
    pub fn from_bytes(name: impl Into<String>, bytes: Vec<u8>) -> Result<SceneAsset, FormatError> {
        if ResidentFile::is_one(&bytes) {
            return Ok(SceneAsset::of_resident(name.into(), ResidentFile::open(Arc::new(bytes), &parallel)?));
        }
        Ok(SceneAsset::new(name, Asset::parse_on(&bytes, &parallel)?))
    }

    fn of_resident(name: String, file: ResidentFile) -> SceneAsset {
        let (head, size_mm) = (file.resident, file.size_mm);
        let most_lobes = head.most_lobes();
        SceneAsset { name, path: None, size_mm, file: None, head, expanded: OnceLock::new(), most_lobes }
    }

    /// The file form, for what needs it.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] where only the resident form is at hand.
    pub fn file_form(&self) -> Result<&FileForm, ViewerError> {
        self.file.as_ref().ok_or_else(|| {
            ViewerError::Usage(format!(
                "{} is in its resident form, which can be shown but neither changed nor trimmed; open the asset that it \
                 was converted from",
                self.name
            ))
        })
    }

    /// A small asset that comes with the viewer: 64 x 64 texels of woven cloth, 4 components. It was made by
    /// `btf-synth cloth C --size 64 --size-mm 4` and `btf-fit fit C -o weave.spmm --bytes 48kB`.
    pub fn built_in() -> SceneAsset {
        let asset = Asset::parse(include_bytes!("models/weave.spmm"));
        #[allow(clippy::expect_used, reason = "a test parses the same bytes")]
        SceneAsset::new("weave", asset.expect("the built-in asset is whole"))
    }

    /// An asset that is already in memory, whose levels are made.
    pub fn new(name: impl Into<String>, asset: Asset) -> SceneAsset {
        let whole = with_levels(&asset, &parallel);
        let head = Resident::without_bases(&whole);
        let (size_mm, most_lobes) = (asset.size_mm, head.most_lobes());
        SceneAsset {
            name: name.into(),
            path: None,
            size_mm,
            file: Some(FileForm { asset, whole }),
            head,
            expanded: OnceLock::new(),
            most_lobes,
        }
    }

    /// The asset with its levels in resident form, but for the bases: those of one that came in file form are zeros.
    pub fn head(&self) -> &Resident {
        &self.head
    }

    /// The asset with its levels in resident form, as decoders on the CPU take it. Cost: the first time, for one that came in
    /// file form, its bases are expanded on all threads.
    pub fn resident(&self) -> &Resident {
        let Some(file) = &self.file else { return &self.head };
        self.expanded.get().unwrap_or_else(|| {
            // Made before the cell is locked: a thread that waits for others may take up work that asks for this as well.
            let made = Resident::from_asset_on(&file.whole, &parallel);
            self.expanded.get_or_init(|| made)
        })
    }

    /// Whether [`SceneAsset::resident`] has its bases at hand.
    pub fn is_expanded(&self) -> bool {
        self.file.is_none() || self.expanded.get().is_some()
    }

    /// Puts `edits` in place of those at hand, where the file form is at hand.
    pub fn set_edits(&mut self, edits: Edits) {
        let Some(file) = &mut self.file else { return };
        self.head.set_edits(&edits, &file.whole.layers);
        self.expanded.get_mut().into_iter().for_each(|resident| resident.set_edits(&edits, &file.whole.layers));
        file.whole.edits = edits.clone();
        file.asset.edits = edits;
    }

    /// Residual components of the layer that has most.
    pub fn most_components(&self) -> u32 {
        self.head.most_components()
    }

    /// Whether its front has heights.
    pub fn has_heights(&self) -> bool {
        let heights = |layer| HeightField::of_resident(&self.head, layer).is_some();
        self.head.layer_for_sides(0, false, false).is_some_and(heights)
    }

    /// Lobes of the texel that has most.
    pub fn most_lobes(&self) -> u32 {
        self.most_lobes
    }

    /// How often the asset's picture fits into a millimetre, along u and v; [`UNKNOWN_SIZE_MM`] where it does not tell.
    pub fn tiles_per_mm(&self) -> [f32; 2] {
        self.size_mm.unwrap_or([UNKNOWN_SIZE_MM; 2]).map(|size| 1.0 / size)
    }
}

/// What a scene's materials show, by number.
#[derive(Debug, Clone, Default)]
pub struct Shown {
    /// Packed assets.
    pub assets: Vec<Arc<SceneAsset>>,
    /// Leaves.
    pub leaves: Vec<SceneLeaf>,
}

impl From<Vec<Arc<SceneAsset>>> for Shown {
    fn from(assets: Vec<Arc<SceneAsset>>) -> Shown {
        Shown { assets, leaves: Vec::new() }
    }
}

impl Shown {
    /// All of it in order: assets, then leaves.
    pub(crate) fn bodies(&self) -> Vec<Body> {
        (0..self.assets.len()).map(Body::Asset).chain((0..self.leaves.len()).map(Body::Leaf)).collect()
    }

    /// How often the picture of a body fits into a millimetre, along u and v.
    pub(crate) fn tiles_per_mm(&self, body: Body) -> [f32; 2] {
        match body {
            Body::Plain(_) => [1.0; 2],
            Body::Asset(asset) => self.assets[asset].tiles_per_mm(),
            Body::Leaf(leaf) => [1.0 / self.leaves[leaf].description.size_mm as f32; 2],
        }
    }

    /// Adds what a file's own materials show, whose numbers in `bodies` are then those of this.
    pub(crate) fn append(&mut self, own: OwnBodies) -> BTreeMap<usize, Body> {
        let (assets, leaves) = (self.assets.len(), self.leaves.len());
        self.assets.extend(own.shown.assets);
        self.leaves.extend(own.shown.leaves);
        let moved = |body| match body {
            Body::Plain(_) => body,
            Body::Asset(asset) => Body::Asset(asset + assets),
            Body::Leaf(leaf) => Body::Leaf(leaf + leaves),
        };
        own.bodies.into_iter().map(|(group, body)| (group, moved(body))).collect()
    }
}

/// What a file's own materials show.
#[derive(Debug, Clone, Default)]
pub struct OwnBodies {
    /// What there is.
    pub shown: Shown,
    /// By number of the material, which is a part's group.
    pub bodies: BTreeMap<usize, Body>,
}

/// What reflects and transmits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Body {
    /// A plain diffuse surface: linear sRGB reflectance, 0 to 1.
    Plain([f32; 3]),
    /// Index into [`Scene::assets`].
    Asset(usize),
    /// Index into [`Scene::leaves`].
    Leaf(usize),
}

/// What a triangle is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// What reflects and transmits.
    pub body: Body,
    /// Reflectance of a perfect mirror on top, RGB, 0 to 1; 0 for none. It adds to what lies below.
    pub mirror: [f32; 3],
    /// Factors on the texture coordinates: how often the asset is repeated.
    pub uv_scale: [f32; 2],
    /// What the asset's heights are multiplied by where they displace the surface: 1 as they are, 0 for none. The mesh is
    /// where the highest point lies.
    pub displacement: f32,
}

impl Material {
    /// A material without a mirror.
    pub fn new(body: Body, uv_scale: [f32; 2]) -> Material {
        Material { body, mirror: [0.0; 3], uv_scale, displacement: 0.0 }
    }

    /// A material that shows asset number `asset`.
    pub fn from_asset(asset: usize, uv_scale: [f32; 2]) -> Material {
        Material::new(Body::Asset(asset), uv_scale)
    }

    /// A plain diffuse material.
    pub fn plain(diffuse: [f32; 3]) -> Material {
        Material::new(Body::Plain(diffuse), [1.0; 2])
    }

    /// Number of the asset that it shows.
    pub fn asset(&self) -> Option<usize> {
        match self.body {
            Body::Asset(asset) => Some(asset),
            _ => None,
        }
    }
}

/// A light without size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointLight {
    /// Position, world space.
    pub position: Vec3,
    /// Linear RGB intensity; irradiance at distance d and normal incidence is intensity / d^2.
    pub intensity: [f32; 3],
}

/// A distance that no ray within a scene reaches.
const BEYOND_EVERYTHING: f32 = 1e30;

/// Where a scene's own lights are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightRig {
    /// On the half sphere around the scene that faces the camera, the first at the upper left.
    Around,
    /// In a ring under the ceiling of the Cornell box.
    Ceiling,
}

/// Light from everywhere that nothing near keeps off: ambient occlusion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ambient {
    /// Linear RGB radiance from every direction; 0 for no ambient light. A white Lambertian surface that nothing occludes
    /// has this value.
    pub radiance: [f32; 3],
    /// What lies farther away does not occlude, world units, above 0.
    pub distance: f32,
}

impl Ambient {
    /// No ambient light.
    pub const NONE: Ambient = Ambient { radiance: [0.0; 3], distance: 1.0 };
}

/// Radiance of the ambient light where nothing else is asked for.
pub const AMBIENT_RADIANCE: f32 = 0.4;
/// Occlusion distance where nothing else is asked for, in radii of the scene's bounding sphere.
const OCCLUSION_RADII: f32 = 0.5;

/// Which light of the day shines: the paper's three pictures [Miao, Fig. 4].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DaylightParts {
    /// Sun and sky.
    #[default]
    Both,
    /// The sun alone.
    Sun,
    /// The sky alone.
    Sky,
}

/// The day that a scene stands under.
#[derive(Debug, Clone, PartialEq)]
pub struct Outdoors {
    /// When, where, and through which air.
    pub daylight: Daylight,
    /// Which of its light shines.
    pub parts: DaylightParts,
}

/// Everything that a tracer needs.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Triangles and their hierarchy.
    pub geometry: Arc<Geometry>,
    /// Materials; triangles name them by number.
    pub materials: Vec<Material>,
    /// Assets; materials name them by number.
    pub assets: Vec<Arc<SceneAsset>>,
    /// Leaves; materials name them by number.
    pub leaves: Vec<SceneLeaf>,
    /// Point lights.
    pub lights: Vec<PointLight>,
    /// The sun.
    pub sun: Option<Sun>,
    /// The day that sun and environment are of, where they are.
    pub outdoors: Option<Outdoors>,
    /// Where [`Scene::place_lights`] puts them.
    pub light_rig: LightRig,
    /// Ambient light, one stratified ray per pixel and sample.
    pub ambient: Ambient,
    /// A picture of light from all around, which then is background and, within the ambient light's distance, stands for
    /// that.
    pub environment: Option<Arc<Environment>>,
    /// Camera.
    pub camera: Camera,
    /// Further cameras that the scene description names.
    pub more_cameras: Vec<Camera>,
    /// Exposure in stops: the picture is multiplied by `2^exposure_ev` before the sRGB curve.
    pub exposure_ev: f32,
    /// Linear colour where a ray hits nothing.
    pub background: [f32; 3],
}

/// Which mesh carries the assets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MeshChoice {
    /// One sphere per asset, side by side.
    Sphere,
    /// One plane per asset, side by side.
    Plane,
    /// The Cornell box with two spheres, seen so that it fills a square picture: the first asset on the spheres, the next
    /// ones on floor, back wall and the other walls, and again from the first where there are fewer.
    Cornell,
    /// A cloth draped over a round table. This and what follows is in metres and shows assets at their physical size.
    Cloth,
    /// A shoe: the first asset on the upper, the next ones on toe cap and sole.
    Shoe,
    /// A pair of boots: the first asset on the leather, the next one on the soles.
    Boots,
    /// A pullover.
    Pullover,
    /// An OBJ or glTF file.
    File(PathBuf),
}

impl MeshChoice {
    /// The meaning of `--mesh`: a built-in name, or else a path.
    pub fn from_argument(argument: &str) -> MeshChoice {
        match argument {
            "sphere" => MeshChoice::Sphere,
            "plane" => MeshChoice::Plane,
            "cornell" => MeshChoice::Cornell,
            "cloth" => MeshChoice::Cloth,
            "shoe" => MeshChoice::Shoe,
            "boots" => MeshChoice::Boots,
            "pullover" => MeshChoice::Pullover,
            path => MeshChoice::File(path.into()),
        }
    }
}

/// A part of a mesh together with its material.
pub struct SceneObject {
    /// Geometry, in its mesh's space.
    pub part: MeshPart,
    /// Its material.
    pub material: Material,
}

/// Objects that stand together, and where in the world they do.
pub struct SceneMesh {
    /// The objects.
    pub objects: Vec<SceneObject>,
    /// Affine and invertible.
    pub places: Vec<Mat4>,
}

impl SceneMesh {
    /// The parts of a file's mesh with the materials that `material` gives them.
    pub(crate) fn of_file(mesh: FileMesh, mut material: impl FnMut(&MeshPart) -> Material) -> SceneMesh {
        let object = |part: MeshPart| SceneObject { material: material(&part), part };
        SceneMesh { objects: mesh.parts.into_iter().map(object).collect(), places: mesh.places }
    }
}

impl Scene {
    /// Joins objects, which are in world space, into a scene with the default camera, one light and the default background.
    ///
    /// # Errors
    /// [`ViewerError::Mesh`] naming `origin` if a part that carries an asset has no texture coordinates, or if no
    /// triangle is left.
    pub fn from_objects(
        origin: &Path,
        objects: Vec<SceneObject>,
        shown: impl Into<Shown>,
    ) -> Result<Scene, ViewerError> {
        Scene::from_meshes(origin, vec![SceneMesh { objects, places: vec![Mat4::IDENTITY] }], shown)
    }

    /// The same with meshes that may stand in many places, each of which costs memory once.
    ///
    /// # Errors
    /// As [`Scene::from_objects`].
    pub fn from_meshes(origin: &Path, meshes: Vec<SceneMesh>, shown: impl Into<Shown>) -> Result<Scene, ViewerError> {
        let shown = shown.into();
        let mut materials = Vec::new();
        let (mut joined, mut placements) = (Vec::new(), Vec::new());
        for SceneMesh { objects, places } in meshes {
            let place = |world_from_object| Placement { mesh: joined.len(), world_from_object };
            placements.extend(places.into_iter().map(place));
            joined.push(joined_mesh(origin, objects, &shown, &mut materials)?);
        }
        let geometry = Geometry::placed(joined, &placements).map_err(|reason| ViewerError::mesh(origin, reason))?;
        let mut geometry = Arc::new(geometry);
        vary_plants(&mut geometry, &materials, &shown.leaves);
        let (centre, radius) = geometry.bounding_sphere();
        let camera = Camera::framing(centre, radius, Vec3::new(0.0, 0.25, 1.0), FIELD_OF_VIEW_DEG);
        let mut scene = Scene {
            geometry,
            materials,
            assets: shown.assets,
            leaves: shown.leaves,
            lights: Vec::new(),
            sun: None,
            outdoors: None,
            light_rig: LightRig::Around,
            ambient: Ambient::NONE,
            environment: None,
            camera,
            more_cameras: Vec::new(),
            exposure_ev: 0.0,
            background: BACKGROUND,
        };
        scene.place_lights(1);
        Ok(scene)
    }

    /// One of the built-in scenes, or a mesh file: in a file with one asset or leaf every part with texture coordinates gets
    /// it, or, where materials of the file point at some themselves, the parts that have these; with several, material number i
    /// of the file gets number i, leaves after assets. The rest stays plain in its own colour. Without any, materials get what
    /// a glTF file itself points at.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] without anything to show; [`ViewerError::Mesh`] for files.
    pub fn built_in(mesh: &MeshChoice, shown: impl Into<Shown>, uv_scale: [f32; 2]) -> Result<Scene, ViewerError> {
        let shown = shown.into();
        let bodies = shown.bodies();
        if let MeshChoice::File(path) = mesh {
            return Scene::of_file(path, shown, uv_scale);
        }
        if bodies.is_empty() {
            return Err(nothing_to_show());
        }
        let count = bodies.len();
        let row = |part: fn() -> MeshPart| -> Vec<SceneObject> {
            let object = |(number, body): (usize, &Body)| {
                let mut part = part();
                let x = 2.3 * (number as f32 - (count - 1) as f32 * 0.5);
                part.transform(Mat4::from_translation(Vec3::X * x));
                SceneObject { part, material: Material::new(*body, uv_scale) }
            };
            bodies.iter().enumerate().map(object).collect()
        };
        // Part of group g carries number g, in turn.
        let model = |parts: Vec<MeshPart>, scale: &dyn Fn(Body) -> [f32; 2]| -> Vec<SceneObject> {
            let object = |part: MeshPart| {
                let body = bodies[part.group % count];
                SceneObject { part, material: Material::new(body, scale(body)) }
            };
            parts.into_iter().map(object).collect()
        };
        match mesh {
            MeshChoice::Sphere => Scene::from_objects(Path::new("sphere"), row(mesh::sphere), shown),
            MeshChoice::Plane => {
                let mut scene = Scene::from_objects(Path::new("plane"), row(mesh::plane), shown)?;
                let (centre, radius) = scene.geometry.bounding_sphere();
                scene.camera = Camera::framing(centre, radius, Vec3::new(0.0, -0.55, 1.0), FIELD_OF_VIEW_DEG);
                scene.place_lights(1);
                Ok(scene)
            }
            MeshChoice::Cornell => {
                let mut scene =
                    Scene::from_objects(Path::new("cornell"), model(models::cornell(), &|_| uv_scale), shown)?;
                // The nearer edges of the walls lie just outside the picture.
                scene.camera = Camera { eye: Vec3::new(0.0, 0.0, 3.2), target: Vec3::ZERO, up: Vec3::Y, fov_deg: 48.0 };
                scene.light_rig = LightRig::Ceiling;
                scene.place_lights(1);
                Ok(scene)
            }
            _ => {
                let (name, parts, towards) = match mesh {
                    MeshChoice::Cloth => ("cloth", models::cloth(), Vec3::new(0.0, 0.55, 1.0)),
                    MeshChoice::Shoe => ("shoe", models::shoe(), Vec3::new(0.45, 0.5, 1.0)),
                    MeshChoice::Boots => ("boots", models::boots(), Vec3::new(0.6, 0.3, 1.0)),
                    _ => ("pullover", models::pullover(), Vec3::new(0.2, 0.15, 1.0)),
                };
                let physical = |body: Body| shown.tiles_per_mm(body).map(|tiles| tiles * 1000.0 * models::TILE_M);
                let scale = |body: Body| [0, 1].map(|i| physical(body)[i] * uv_scale[i]);
                let objects = model(parts, &scale);
                let mut scene = Scene::from_objects(Path::new(name), objects, shown)?;
                let (centre, radius) = scene.geometry.bounding_sphere();
                scene.camera = Camera::framing(centre, radius, towards, FIELD_OF_VIEW_DEG);
                scene.place_lights(1);
                Ok(scene)
            }
        }
    }

    /// A mesh file; see [`Scene::built_in`].
    fn of_file(path: &Path, mut shown: Shown, uv_scale: [f32; 2]) -> Result<Scene, ViewerError> {
        let given = shown.bodies();
        let own = own_bodies(path)?;
        let bodies: BTreeMap<usize, Body> = match given.as_slice() {
            [] => shown.append(own),
            [one] => own.bodies.keys().map(|group| (*group, *one)).collect(),
            _ => given.iter().copied().enumerate().collect(),
        };
        if given.is_empty() && bodies.is_empty() {
            return Err(nothing_to_show());
        }
        let body_of = |part: &MeshPart| match given.as_slice() {
            [one] if bodies.is_empty() => Some(*one),
            _ => bodies.get(&part.group).copied(),
        };
        let material = |part: &MeshPart| match body_of(part) {
            Some(body) if part.has_uv => Material::new(body, uv_scale),
            _ => Material::plain(part.diffuse),
        };
        let meshes: Vec<SceneMesh> =
            load_meshes(path)?.into_iter().map(|mesh| SceneMesh::of_file(mesh, material)).collect();
        let plain = |object: &SceneObject| matches!(object.material.body, Body::Plain(_));
        if meshes.iter().flat_map(|mesh| &mesh.objects).all(plain) {
            return Err(ViewerError::mesh(
                path,
                "no part has texture coordinates, unwrap the mesh before it can carry a material",
            ));
        }
        Scene::from_meshes(path, meshes, shown)
    }

    /// Surrounds the scene by a picture of light, which nothing but the scene itself keeps off; takes its lamps and the sun away.
    pub fn surround(&mut self, environment: Environment) {
        (self.environment, self.sun, self.outdoors) = (Some(Arc::new(environment)), None, None);
        self.ambient = Ambient { radiance: [0.0; 3], distance: BEYOND_EVERYTHING };
        self.lights.clear();
    }

    /// Stands the scene under the sun and the clear sky of a day, as far as `parts` says; takes its lamps away. `light` is
    /// what [`Daylight::sun_and_sky`] gives.
    pub fn stand_outdoors(&mut self, outdoors: Outdoors, light: SunAndSky) {
        // As large as a sky, so that one can take its place in a tracer.
        let [width, height] = SKY_SIZE;
        let black = || Environment::new(width, height, &vec![0.0; width * height * 3]);
        self.surround(if outdoors.parts == DaylightParts::Sun { black() } else { light.environment });
        self.sun = light.sun.filter(|_| outdoors.parts != DaylightParts::Sky);
        self.outdoors = Some(outdoors);
    }

    /// `count` lights where the scene has them; their intensities add up to the same brightness whatever the count.
    pub fn place_lights(&mut self, count: usize) {
        match self.light_rig {
            LightRig::Around => self.place_lights_around(count),
            LightRig::Ceiling => self.place_lights_under_ceiling(count),
        }
    }

    fn place_lights_around(&mut self, count: usize) {
        let (centre, radius) = self.geometry.bounding_sphere();
        let forward = (self.camera.eye - centre).normalize_or(Vec3::Z);
        let right = self.camera.up.cross(forward).normalize_or(Vec3::X);
        let up = forward.cross(right);
        let distance = LIGHT_DISTANCE_RADII * radius;
        self.lights = (0..count)
            .map(|index| {
                let local = if index == 0 { KEY_LIGHT.normalize() } else { spiral_direction(index, count) };
                let direction = right * local.x + up * local.y + forward * local.z;
                PointLight {
                    position: centre + direction * distance,
                    intensity: [intensity_for(distance, KEY_BRIGHTNESS / count as f32); 3],
                }
            })
            .collect();
    }

    /// Residual components of the asset that has most.
    pub fn most_components(&self) -> u32 {
        self.assets.iter().map(|asset| asset.most_components()).max().unwrap_or(0)
    }

    /// Lobes of the texel that has most.
    pub fn most_lobes(&self) -> u32 {
        self.assets.iter().map(|asset| asset.most_lobes()).max().unwrap_or(0)
    }

    /// Displaces every surface that carries an asset with heights by these, times `scale`; 0 for none.
    pub fn displace(&mut self, scale: f32) {
        for material in &mut self.materials {
            let displaced = material.asset().is_some_and(|asset| self.assets[asset].has_heights());
            material.displacement = if displaced { scale } else { 0.0 };
        }
    }

    /// The ambient light that the scene's size suggests.
    pub fn usual_ambient(&self) -> Ambient {
        Ambient { radiance: [AMBIENT_RADIANCE; 3], distance: OCCLUSION_RADII * self.geometry.bounding_sphere().1 }
    }

    fn place_lights_under_ceiling(&mut self, count: usize) {
        self.lights = (0..count)
            .map(|index| {
                let angle = std::f32::consts::TAU * index as f32 / count as f32;
                let reach = if count == 1 { 0.0 } else { LUMINAIRE_RADIUS };
                PointLight {
                    position: Vec3::new(reach * angle.cos(), 0.6, 0.25 + reach * angle.sin()),
                    intensity: [intensity_for(1.2, 1.0 / count as f32); 3],
                }
            })
            .collect();
    }
}

fn nothing_to_show() -> ViewerError {
    ViewerError::Usage(
        "no asset was named: make one from a capture folder with `btf-fit fit CAPTURE -o ASSET.spmm`, \
         then run `btf-view ASSET.spmm`"
            .into(),
    )
}

/// Joins the objects of a mesh; new materials are added to `materials`.
fn joined_mesh(
    origin: &Path,
    objects: Vec<SceneObject>,
    shown: &Shown,
    materials: &mut Vec<Material>,
) -> Result<Mesh, ViewerError> {
    let mut mesh = Mesh::default();
    for SceneObject { part, material } in objects {
        let plain = matches!(material.body, Body::Plain(_));
        if !plain && !shown.bodies().contains(&material.body) {
            return Err(ViewerError::mesh(
                origin,
                format!("the part '{}' names an asset or a leaf that is not there", part.name),
            ));
        }
        if !plain && !part.has_uv {
            return Err(ViewerError::mesh(
                origin,
                format!(
                    "the part '{}' has no texture coordinates, unwrap it before it can carry a material",
                    part.name
                ),
            ));
        }
        let number = materials.iter().position(|known| *known == material).unwrap_or_else(|| {
            materials.push(material);
            materials.len() - 1
        });
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(part.vertices);
        mesh.triangles.extend(part.triangles.iter().map(|triangle| Triangle {
            vertices: triangle.map(|index| index.saturating_add(first)),
            material: number as u32,
        }));
    }
    Ok(mesh)
}

/// Intensity with which a white Lambertian surface at `distance`, lit at normal incidence, has `brightness`.
pub fn intensity_for(distance: f32, brightness: f32) -> f32 {
    std::f32::consts::PI * distance * distance * brightness
}

/// Direction `index` of `count` on a golden-angle spiral over the half sphere z > 0.
fn spiral_direction(index: usize, count: usize) -> Vec3 {
    const GOLDEN_ANGLE: f32 = 2.399_963;
    // From just above the horizon to near the axis.
    let z = 0.15 + 0.8 * (index as f32 + 0.5) / count as f32;
    let r = (1.0 - z * z).sqrt();
    let (sin, cos) = (GOLDEN_ANGLE * index as f32 + 2.2).sin_cos();
    Vec3::new(r * cos, r * sin, z)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(part: MeshPart) -> SceneObject {
        SceneObject { part, material: Material::plain([0.5; 3]) }
    }

    #[test]
    fn a_scene_without_assets_says_how_to_make_one() {
        let error = Scene::built_in(&MeshChoice::Sphere, Vec::new(), [1.0; 2]).unwrap_err();
        assert!(error.to_string().contains("btf-fit fit"));
        assert_eq!(error.exit_code(), 2);
    }

    #[test]
    fn an_asset_needs_texture_coordinates_and_must_exist() {
        let mut part = mesh::plane();
        let object = SceneObject { part: part.clone(), material: Material::from_asset(0, [1.0; 2]) };
        assert!(Scene::from_objects(Path::new("x.obj"), vec![object], Vec::new()).is_err());
        part.has_uv = false;
        assert!(Scene::from_objects(Path::new("x.obj"), vec![plain(part)], Vec::new()).is_ok());
    }

    #[test]
    fn lights_keep_their_sum_and_the_first_comes_from_the_upper_left() {
        let mut scene = Scene::from_objects(Path::new("plane"), vec![plain(mesh::plane())], Vec::new()).unwrap();
        let one = scene.lights[0];
        assert!(one.position.x < 0.0 && one.position.y > 0.0 && one.position.z > 0.0);
        scene.place_lights(17);
        let sum: f32 = scene.lights.iter().map(|light| light.intensity[0]).sum();
        assert_eq!(scene.lights[0].position, one.position);
        assert!((sum / one.intensity[0] - 1.0).abs() < 1e-5);
    }

    #[test]
    fn a_file_that_is_not_an_asset_is_named() {
        let dir = tempfile::tempdir().unwrap();
        for bytes in [&b""[..], b"not an asset at all"] {
            let path = dir.path().join("bad.spmm");
            std::fs::write(&path, bytes).unwrap();
            let message = SceneAsset::load(&path).unwrap_err().to_string();
            assert!(message.contains("bad.spmm: "), "{message}");
        }
        assert!(matches!(SceneAsset::load(&dir.path().join("no.spmm")), Err(ViewerError::Read { .. })));
    }
}
