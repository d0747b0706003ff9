//! What is drawn: geometry, materials, packed assets, lights, camera, exposure; and the built-in scenes.

use crate::error::ViewerError;
use crate::geometry::bvh_node::Bounds;
use crate::geometry::geometry::{Geometry, Mesh, Placement, Triangle};
use crate::light::daylight::{Daylight, SKY_SIZE, SunAndSky};
use crate::light::environment::Environment;
use crate::light::irradiance_volume::IrradianceCells;
use crate::light::light_grid::{LIGHT_CANDIDATES, LightGrid};
use crate::light::light_tree::TreeLight;
use crate::light::sun::Sun;
use crate::scene::asset::SceneAsset;
use crate::scene::builtin;
use crate::scene::camera::Camera;
use crate::scene::gltf_asset::{groups_with_own_bodies, own_bodies};
use crate::scene::leaf::SceneLeaf;
use crate::scene::material::{Body, Material, NOISE_OCTAVES, Shown};
use crate::scene::mesh::{self, MeshPart};
use crate::scene::mesh_file::{FileMesh, load_meshes};
use crate::scene::plant_variation::vary_plants;
use crate::volume::skin::Wind;
use crate::volume::volumes::Volumes;
use glam::{Mat4, Vec3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Linear grey behind everything.
pub const BACKGROUND: [f32; 3] = [0.18; 3];
/// Field of view of the built-in scenes, degrees.
const FIELD_OF_VIEW_DEG: f32 = 30.0;
/// From the object to the first light: upper left, in front. In camera axes (right, up, towards the eye).
const KEY_LIGHT: Vec3 = Vec3::new(-0.65, 0.75, 0.9);
/// Radius of the ring of lights in the Cornell box, half of whose width is 1: the half width of the original's
/// luminaire.
const LUMINAIRE_RADIUS: f32 = 0.22;
/// Distance of the lights from the object's centre, in radii of its bounding sphere.
const LIGHT_DISTANCE_RADII: f32 = 4.0;
/// Brightness of the built-in lights together: a white Lambertian surface that faces all of them at the object's
/// centre has this linear value. More than one, because real materials are seldom white.
const KEY_BRIGHTNESS: f32 = 1.6;

/// A light without size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointLight {
    /// Position, world space.
    pub position: Vec3,
    /// Linear RGB intensity; irradiance at distance d and normal incidence is intensity / d^2.
    pub intensity: [f32; 3],
}

impl PointLight {
    /// Returns what the light is drawn by; one that is off, or of which a number is not finite, has no power.
    pub(crate) fn as_drawn(&self) -> TreeLight {
        let power = Vec3::from(self.intensity).max_element();
        if !(self.position.is_finite() && power.is_finite()) {
            return TreeLight { position: Vec3::ZERO, power: 0.0 };
        }
        TreeLight { position: self.position, power: power.max(0.0) }
    }
}

/// Lengths of the volumetric textures that a scene is long at most for an irradiance volume over all of it.
const MAX_LAND: f32 = 2.0;

/// A distance that no ray within a scene reaches.
const BEYOND_EVERYTHING: f32 = 1e30;

/// Arrangement of the lights that a scene places by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightRig {
    /// On the half sphere around the scene that faces the camera, the first at the upper left.
    Around,
    /// Lamps in a ring under the ceiling of the Cornell box.
    Ceiling,
}

/// Light from everywhere that nothing near keeps off: ambient occlusion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ambient {
    /// Linear RGB radiance from every direction; 0 for no ambient light. A white Lambertian surface that nothing
    /// occludes has this value.
    pub radiance: [f32; 3],
    /// Largest distance of an occluder, world units, above 0.
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
    /// Volumetric textures among the triangles.
    pub volumes: Option<Arc<Volumes>>,
    /// Wind over the skins of the volumes.
    pub wind: Option<Wind>,
    /// The moment at which it is seen, seconds; [`Scene::blow`] changes it.
    pub time_s: f64,
    /// Point lights.
    pub lights: Vec<PointLight>,
    /// The sun.
    pub sun: Option<Sun>,
    /// The day that sun and environment are of, where they are.
    pub outdoors: Option<Outdoors>,
    /// Arrangement by which [`Scene::place_lights`] places lights.
    pub light_rig: LightRig,
    /// Ambient light, one stratified ray per pixel and sample.
    pub ambient: Ambient,
    /// A picture of light from all around, which then is background and, within the ambient light's distance, stands
    /// for that.
    pub environment: Option<Arc<Environment>>,
    /// Metres of a unit, where what is far is seen through the air of the day (aerial perspective); without it, all air is
    /// left out.
    pub air_unit_m: Option<f32>,
    /// Extinction of the air, RGB, a unit; 0 for none. [`Scene::stand_outdoors`] changes it.
    pub air: [f32; 3],
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
    /// The blade of a leaf, which shows the first asset once, from edge to edge.
    Leaf,
    /// The Cornell box with two spheres, seen so that it fills a square picture: the first asset on the spheres, the
    /// next ones on floor, back wall and the other walls, and again from the first where there are fewer.
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
    /// Returns the meaning of `--mesh`: a built-in name, or else a path.
    pub fn from_argument(argument: &str) -> MeshChoice {
        match argument {
            "sphere" => MeshChoice::Sphere,
            "plane" => MeshChoice::Plane,
            "leaf" => MeshChoice::Leaf,
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
    /// Material of the part.
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
    /// Makes a mesh of the parts of a file's mesh, with the materials that `material` gives them.
    pub(crate) fn of_file(mesh: FileMesh, mut material: impl FnMut(&MeshPart) -> Material) -> SceneMesh {
        let object = |part: MeshPart| SceneObject { material: material(&part), part };
        SceneMesh { objects: mesh.parts.into_iter().map(object).collect(), places: mesh.places }
    }
}

impl Scene {
    /// Returns width and height in texels of what a material shows, at its finest level; `None` where it is
    /// of one colour.
    pub(crate) fn texels_of(&self, material: &Material) -> Option<[f32; 2]> {
        let size = match material.body {
            Body::Plain(_) => material.noise.map(|_| [1 << NOISE_OCTAVES; 2])?,
            Body::Asset(asset) => self.assets[asset].head().size(0),
            Body::Leaf(leaf) => self.leaves[leaf].leaf.size(),
        };
        Some(size.map(|side| side as f32))
    }

    /// Joins objects, which are in world space, into a scene with the default camera, one light and the default
    /// background.
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

    /// Makes a scene of meshes that may stand in many places, each of which costs memory once.
    ///
    /// # Errors
    /// The errors of [`Scene::from_objects`].
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
            volumes: None,
            wind: None,
            time_s: 0.0,
            lights: Vec::new(),
            sun: None,
            outdoors: None,
            air_unit_m: None,
            air: [0.0; 3],
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

    /// Tells whether something depends on the distance from the eye: volumes that stand in for meshes where their leaves are small, or
    /// shells of skins.
    pub(crate) fn hands_over(&self) -> bool {
        let proxies = self.volumes.iter().map(|volumes| volumes.proxies());
        proxies.chain([&*self.geometry]).any(|geometry| geometry.widest_leaf() > 0.0)
            || self.volumes.iter().any(|volumes| volumes.has_levels())
    }

    /// Makes one of the built-in scenes, or a mesh file: in a file with one asset or leaf every part with texture
    /// coordinates gets it, or, where materials of the file point at some themselves, the parts that have these; with
    /// several, material number i of the file gets number i, leaves after assets. The rest stays plain in its own
    /// colour. Without any, materials get what a glTF file itself points at.
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
            MeshChoice::Leaf => {
                let objects = model(builtin::leaf_blade(), &|_| uv_scale);
                let mut scene = Scene::from_objects(Path::new("leaf"), objects, shown)?;
                let (centre, radius) = scene.geometry.bounding_sphere();
                scene.camera = Camera::framing(centre, radius, Vec3::new(0.15, -0.35, 1.0), FIELD_OF_VIEW_DEG);
                scene.place_lights(1);
                Ok(scene)
            }
            MeshChoice::Cornell => {
                let mut scene =
                    Scene::from_objects(Path::new("cornell"), model(builtin::cornell(), &|_| uv_scale), shown)?;
                // The nearer edges of the walls lie just outside the picture.
                scene.camera = Camera { eye: Vec3::new(0.0, 0.0, 3.2), target: Vec3::ZERO, up: Vec3::Y, fov_deg: 48.0 };
                scene.light_rig = LightRig::Ceiling;
                scene.place_lights(1);
                Ok(scene)
            }
            _ => {
                let (name, parts, towards) = match mesh {
                    MeshChoice::Cloth => ("cloth", builtin::cloth(), Vec3::new(0.0, 0.55, 1.0)),
                    MeshChoice::Shoe => ("shoe", builtin::shoe(), Vec3::new(0.45, 0.5, 1.0)),
                    MeshChoice::Boots => ("boots", builtin::boots(), Vec3::new(0.6, 0.3, 1.0)),
                    _ => ("pullover", builtin::pullover(), Vec3::new(0.2, 0.15, 1.0)),
                };
                let physical = |body: Body| shown.tiles_per_mm(body).map(|tiles| tiles * 1000.0 * builtin::TILE_M);
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

    /// Makes the scene of a mesh file; see [`Scene::built_in`].
    fn of_file(path: &Path, mut shown: Shown, uv_scale: [f32; 2]) -> Result<Scene, ViewerError> {
        let given = shown.bodies();
        let bodies: BTreeMap<usize, Body> = match given.as_slice() {
            [] => shown.append(own_bodies(path)?),
            [one] => groups_with_own_bodies(path)?.into_iter().map(|group| (group, *one)).collect(),
            _ => given.iter().copied().enumerate().collect(),
        };
        if given.is_empty() && bodies.is_empty() {
            return Err(nothing_to_show());
        }
        let body_of = |part: &MeshPart| match given.as_slice() {
            [one] if bodies.is_empty() => Some(*one),
            _ => bodies.get(&part.group).copied(),
        };
        let material = |part: &MeshPart| Material::of_part(part, body_of(part), uv_scale);
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

    /// Surrounds the scene by a picture of light, which nothing but the scene itself keeps off; takes its lamps and the
    /// sun away.
    pub fn surround(&mut self, environment: Environment) {
        (self.environment, self.sun, self.outdoors) = (Some(Arc::new(environment)), None, None);
        self.air = [0.0; 3];
        self.ambient = Ambient { radiance: [0.0; 3], distance: BEYOND_EVERYTHING };
        self.lights.clear();
    }

    /// Stands the scene under the sun and the clear sky of a day, as far as `parts` says; takes its lamps away. `light`
    /// is what [`Daylight::sun_and_sky`] gives.
    pub fn stand_outdoors(&mut self, outdoors: Outdoors, light: SunAndSky) {
        // As large as a sky, so that one can take its place in a tracer.
        let [width, height] = SKY_SIZE;
        let black = || Environment::new(width, height, &vec![0.0; width * height * 3]);
        self.surround(if outdoors.parts == DaylightParts::Sun { black() } else { light.environment });
        // What the air adds comes from the sky.
        if let (Some(unit_m), true) = (self.air_unit_m, outdoors.parts != DaylightParts::Sun) {
            self.air = light.air_extinction_per_m.map(|per_m| per_m * unit_m);
        }
        self.sun = light.sun.filter(|_| outdoors.parts != DaylightParts::Sky);
        self.outdoors = Some(outdoors);
    }

    /// Shows the scene at another moment: its wind moves the skins of its volumes and the models that these stand in
    /// for. Without a wind nothing moves.
    ///
    /// # Errors
    /// The errors of [`Wind::displace`].
    pub fn blow(&mut self, time_s: f64) -> Result<(), ViewerError> {
        if let (Some(wind), Some(volumes)) = (&self.wind, &mut self.volumes) {
            let volumes = Arc::make_mut(volumes);
            volumes.advance_wind(wind, time_s).map_err(ViewerError::Usage)?;
            if volumes.has_stand_ins() {
                Arc::make_mut(&mut self.geometry).move_instances(|placement| volumes.stand_in_place(placement));
            }
        }
        self.time_s = time_s;
        Ok(())
    }

    /// Returns all cameras, the one in use first.
    pub fn cameras(&self) -> Vec<Camera> {
        std::iter::once(self.camera).chain(self.more_cameras.iter().copied()).collect()
    }

    /// Tells whether volumes stand in for meshes that are small in the picture.
    pub fn has_transitions(&self) -> bool {
        self.volumes.is_some() && self.geometry.widest_leaf() > 0.0
    }

    /// Multiplies the distances up to which meshes are seen as such for which volumes stand in. Without any it does nothing.
    pub fn scale_transitions(&mut self, factor: f32) {
        let Some(volumes) = &mut self.volumes else { return };
        Arc::make_mut(volumes).scale_leaf_widths(factor);
        Arc::make_mut(&mut self.geometry).scale_leaf_widths(factor);
    }

    /// Puts `count` lights where the scene has them; their intensities add up to the same brightness whatever the
    /// count.
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

    /// Returns what draws the point lights, where there are more than candidates for `light_samples` of them: the grid that
    /// is `kept` where that is of these lights, or a new one, which is kept. Cost: that of [`LightGrid::new`] once lights have
    /// changed.
    pub(crate) fn light_grid(&self, light_samples: u32, kept: &mut Option<Arc<LightGrid>>) -> Option<Arc<LightGrid>> {
        if self.lights.len() <= light_samples as usize * LIGHT_CANDIDATES {
            return None;
        }
        let lights: Vec<TreeLight> = self.lights.iter().map(|light| light.as_drawn()).collect();
        if !kept.as_ref().is_some_and(|grid| grid.is_of(&lights)) {
            *kept = Some(Arc::new(LightGrid::new(lights, self.geometry.bounds())));
        }
        kept.clone()
    }

    /// Returns the cells of an irradiance volume, `along` on the longest side: over everything, or over the volumetric textures
    /// alone where land goes on far beyond them.
    pub(crate) fn irradiance_cells(&self, along: u32) -> IrradianceCells {
        let all = self.geometry.bounds();
        let length = |bounds: &Bounds| (bounds.hi - bounds.lo).max_element();
        let lit = self.volumes.as_ref().map_or(all, |volumes| {
            let volumes = volumes.proxies().bounds();
            let both = all.add(volumes);
            if length(&both) > MAX_LAND * length(&volumes) { volumes } else { both }
        });
        IrradianceCells::over(lit, along)
    }

    /// Returns the residual components of the asset that has most.
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

    /// Returns the ambient light that the scene's size suggests.
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
        if !shown.has(material.body) {
            return Err(ViewerError::mesh(
                origin,
                format!("the part '{}' names an asset or a leaf that is not there", part.name),
            ));
        }
        if !matches!(material.body, Body::Plain(_)) && !part.has_uv {
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

/// Returns the intensity with which a white Lambertian surface at `distance`, lit at normal incidence, has
/// `brightness`.
pub fn intensity_for(distance: f32, brightness: f32) -> f32 {
    std::f32::consts::PI * distance * distance * brightness
}

/// Returns direction `index` of `count` on a golden-angle spiral over the half sphere z > 0.
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
