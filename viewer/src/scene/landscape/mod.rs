//! The three landscapes of [Neyret 1996, section 5], in metres, under the sky of a summer's day: a lawn, a grove and a forest,
//! which are thick skins with volumetric textures over bilinear patches.
//!
//! | landscape | patches | texels | stands for |
//! |---|---|---|---|
//! | lawn | 1,400 | one a patch | 22,400 blades, 700 flowers; height vectors jittered |
//! | grove | 1,024 | half of them empty | 512 trees of 2,154 branches and 6,336 leaves; size, turn, place and material jittered |
//! | forest | 1,404 | 12,500 | 25,000 of these trees, two to a texel; turn, coordinates and height jittered |
//!
//! `times` grows the land: so many times more patches, each with what a patch has. The volumes that come with the viewer are
//! made by `cargo xtask volumes`.

mod forest;
mod grove;
mod lawn;
mod stand_ins;
mod terrain;

use crate::error::ViewerError;
use crate::light::daylight::Daylight;
use crate::sampler::hash;
use crate::scene::camera::Camera;
use crate::scene::gltf_asset::own_bodies;
use crate::scene::material::{Material, Shown};
use crate::scene::mesh::MeshPart;
use crate::scene::mesh_file::load_meshes;
use crate::scene::scene::{DaylightParts, Outdoors, Scene, SceneMesh, SceneObject};
use crate::scene::volume::{AS_IT_IS, standing, tinted, usual_leaf_width_m};
use crate::volume::skin::{DiscreteJitter, Pattern, Shell, ShellParams, Skin, SkinPlace, Wind};
use crate::volume::volumes::{SceneSkin, Volumes};
use btf_runtime::voltex::{Voltex, Volume};
use glam::{Mat4, Quat, Vec3};
use stand_ins::plant_places;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use terrain::Terrain;

/// Branches and leaves of a tree: 2,154 and 6,336.
const TREE_SHAPES: u64 = 2154 + 6336;
/// Every texel in one of eight ways, so that repetition is not seen.
const TURNED: DiscreteJitter =
    DiscreteJitter { empty: 0.0, scale: [1.0; 2], displacement: 0.0, margin: 0.0, turns: true, mirrors: true };
/// Wind in which a tree would lean by 45 degrees: a storm leans it by some.
const TREE_LEANING_M_PER_S: f32 = 35.0;
/// How far twigs swing, texels.
const TREE_FLUTTER: f32 = 0.03;
/// How far the texture may lie from where it belongs, voxels: invisible in foliage.
const TOLERANCE_VOXELS: f32 = 3.0;
/// When and where the sun stands unless another day is asked for: a summer's afternoon in Berlin.
const DAY: [&str; 2] = ["2026-06-21T16:30+02:00", "52.52,13.40"];
/// Brightness of the pictures, stops.
const EXPOSURE_EV: f32 = 1.3;

/// Which landscape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Landscape {
    /// Grass and flowers on a hill.
    Lawn,
    /// Trees that stand apart on flat land.
    Grove,
    /// Mountains under forest.
    Forest,
}

/// What a landscape is asked for.
#[derive(Debug, Clone)]
pub struct LandscapeParams {
    /// So many times the published counts, 1 to 100, on so much more land.
    pub times: u32,
    /// Files in place of the volumes that come with the viewer; none, or as many as these: two for the lawn (without and with
    /// a flower), one for grove and forest.
    pub volumes: Vec<PathBuf>,
    /// The models of the plants, which are seen where leaves are wider than pixels; none, or two for the lawn (without and with
    /// a flower) and for the forest (its two trees), one for the grove. Their origins are in the middle of the volumes' floors, as
    /// `btf-synth plants` has them.
    pub meshes: Vec<PathBuf>,
    /// Mean speed of the wind that blows over it from the west, m/s, 0 to 60; none for a calm.
    pub wind_m_per_s: Option<f32>,
}

impl Default for LandscapeParams {
    /// The published counts, with the volumes that come with the viewer, in a calm.
    fn default() -> LandscapeParams {
        LandscapeParams { times: 1, volumes: Vec::new(), meshes: Vec::new(), wind_m_per_s: None }
    }
}

/// What there is in a landscape.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct LandscapeCounts {
    /// `lawn`, `grove` or `forest`.
    pub name: String,
    /// Bilinear patches of the land.
    pub patches: u64,
    /// Texels that are not empty.
    pub texels: u64,
    /// Blades of grass.
    pub blades: u64,
    /// Flowers.
    pub flowers: u64,
    /// Trees.
    pub trees: u64,
    /// Blades, petals, stems, branches and leaves that the volumes stand for, of the volumes that come with the viewer.
    pub primitives: u64,
    /// Tetrahedra of the thick skin.
    pub tets: u64,
    /// Volumes.
    pub volumes: u64,
    /// Voxels along a side of the finest one.
    pub resolution: u32,
    /// Bytes of the volumes' files together.
    pub volume_file_bytes: u64,
    /// Bytes of the volumes in memory together.
    pub volume_bytes: u64,
}

impl fmt::Display for LandscapeCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} patches, {} texels, ", self.name, self.patches, self.texels)?;
        if self.trees > 0 {
            write!(f, "{} trees", self.trees)?;
        } else {
            write!(f, "{} blades, {} flowers", self.blades, self.flowers)?;
        }
        write!(
            f,
            ", which are {} shapes; {} volumes of {}^3 in {:.1} MB, files of {:.1} kB; {} tetrahedra",
            self.primitives,
            self.volumes,
            self.resolution,
            self.volume_bytes as f64 * 1e-6,
            self.volume_file_bytes as f64 * 1e-3,
            self.tets
        )
    }
}

/// A plant of which there may be a model.
struct Plant {
    /// The first volume that it is in.
    volume: u32,
    /// How large it is there.
    scale: f32,
    /// Where it stands, from the middle of the volume's floor, metres.
    foot_m: Vec3,
    /// Factors on its colours in this volume and in the next ones.
    tints: &'static [[f32; 3]],
}

/// A landscape before it is a scene.
struct Planted {
    terrain: Terrain,
    skin: Skin,
    patterns: Vec<Pattern>,
    soil: [f32; 3],
    /// Far, middle and close.
    cameras: [Camera; 3],
    /// A wind of any speed over what grows there.
    wind: Wind,
    counts: LandscapeCounts,
}

impl Landscape {
    /// Its name as a user writes it.
    pub fn name(self) -> &'static str {
        match self {
            Landscape::Lawn => "lawn",
            Landscape::Grove => "grove",
            Landscape::Forest => "forest",
        }
    }

    fn built_in(self) -> &'static [&'static [u8]] {
        match self {
            Landscape::Lawn => &lawn::VOLUMES,
            Landscape::Grove => &grove::VOLUMES,
            Landscape::Forest => &forest::VOLUMES,
        }
    }

    /// The scene with three cameras, far, middle and close, under the sun and the sky; and what is in it.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] for another number of times or of volumes, and for volumes that the landscape cannot use;
    /// [`ViewerError::Read`] and [`ViewerError::Volume`] for their files.
    pub fn scene(self, params: &LandscapeParams) -> Result<(Scene, LandscapeCounts), ViewerError> {
        if !(1..=100).contains(&params.times) {
            return Err(ViewerError::Usage(format!("--times is 1 to 100, not {}", params.times)));
        }
        let (volumes, volume_file_bytes) = self.volumes(params)?;
        let side_m = volumes[0].side_m();
        let resolution = 1u32 << volumes.iter().map(|volume| volume.level_count()).max().unwrap_or(0);
        let made = |reason: String| ViewerError::scene(self.name(), reason);
        let planted = match self {
            Landscape::Lawn => lawn::planted(params.times, side_m),
            Landscape::Grove => grove::planted(params.times, side_m),
            Landscape::Forest => forest::planted(params.times, side_m),
        };
        let Planted { terrain, skin, patterns, soil, cameras, wind, counts } = planted.map_err(made)?;
        debug_assert_eq!(counts.patches, u64::from(terrain.count()));
        let shell_params = ShellParams { tolerance: TOLERANCE_VOXELS / resolution as f32, ..ShellParams::default() };
        let shell = Shell::new(&skin, &shell_params).map_err(made)?;
        let counts = LandscapeCounts {
            name: self.name().into(),
            tets: shell.tets().len() as u64,
            volumes: volumes.len() as u64,
            resolution,
            volume_file_bytes,
            volume_bytes: volumes.iter().map(|volume| 4 * volume.words().len() as u64).sum(),
            ..counts
        };
        let ground = SceneObject { part: terrain.ground(soil), material: Material::plain(soil) };
        let mut meshes = vec![SceneMesh { objects: vec![ground], places: vec![Mat4::IDENTITY] }];
        let mut shown = Shown::default();
        let (leaf_width, stand_ins) =
            self.add_plants(&params.meshes, &volumes, (&shell, &patterns), &mut meshes, &mut shown)?;
        let mut scene = Scene::from_meshes(Path::new(self.name()), meshes, shown)?;
        if leaf_width > 0.0 {
            let of_mesh = |mesh, _| if mesh == 0 { 0.0 } else { leaf_width };
            Arc::make_mut(&mut scene.geometry).set_leaf_widths(of_mesh);
        }
        let skin = SceneSkin { rest: skin, shell, patterns, leaf_width };
        let mut volumes = Volumes::new(volumes, &[], vec![skin]).map_err(made)?;
        // Behind the ground.
        volumes.set_stand_ins(1, stand_ins);
        scene.volumes = Some(Arc::new(volumes));
        if let Some(speed_m_per_s) = params.wind_m_per_s {
            let wind = Wind { speed_m_per_s, ..wind };
            wind.check().map_err(ViewerError::Usage)?;
            scene.wind = Some(wind);
            scene.blow(0.0)?;
        }
        let daylight = Daylight::new(DAY[0], DAY[1])?;
        let light = daylight.sun_and_sky()?;
        scene.stand_outdoors(Outdoors { daylight, parts: DaylightParts::Both }, light);
        let [far, middle, close] = cameras;
        (scene.camera, scene.more_cameras) = (far, vec![middle, close]);
        scene.exposure_ev = EXPOSURE_EV;
        Ok((scene, counts))
    }

    /// What there is a model of, in the order of the models.
    fn plants(self) -> &'static [Plant] {
        const TEXEL: Plant = Plant { volume: 0, scale: 1.0, foot_m: Vec3::ZERO, tints: &[AS_IT_IS] };
        match self {
            Landscape::Lawn => &[TEXEL, Plant { volume: 1, ..TEXEL }],
            Landscape::Grove => &[Plant { tints: &grove::TINTS, ..TEXEL }],
            Landscape::Forest => &forest::PLANTS,
        }
    }

    /// Adds the plants' models wherever the skin has their volumes; returns how wide their leaves are where they are widest, 0
    /// without models, and where each stands.
    fn add_plants(
        self,
        files: &[PathBuf],
        volumes: &[Arc<Voltex>],
        (shell, patterns): (&Shell, &[Pattern]),
        meshes: &mut Vec<SceneMesh>,
        shown: &mut Shown,
    ) -> Result<(f32, Vec<SkinPlace>), ViewerError> {
        let plants = self.plants();
        if !files.is_empty() && files.len() != plants.len() {
            return Err(ViewerError::Usage(format!(
                "the {} has {} models of plants and {} are given; write --mesh FILE as often, or not at all",
                self.name(),
                plants.len(),
                files.len()
            )));
        }
        let (mut widest, mut stand_ins) = (0f32, Vec::new());
        for (file, Plant { volume, scale, foot_m, tints }) in files.iter().zip(plants) {
            let voltex = &volumes[*volume as usize];
            let own = load_meshes(file)?;
            let bodies = shown.append(own_bodies(file)?);
            widest = widest.max(usual_leaf_width_m(voltex, &own) * scale);
            let volume_from_model = standing(voltex, Vec3::ZERO, 0.0, 1.0).inverse()
                * Mat4::from_scale_rotation_translation(Vec3::splat(*scale), Quat::IDENTITY, *foot_m);
            let places = plant_places(shell, patterns, volume_from_model.transform_point3(Vec3::ZERO));
            // A volume in several tints is as many volumes.
            for (tinted, tint) in (*volume..).zip(*tints) {
                let here =
                    || places.iter().filter(|(own, _)| *own == tinted).map(|(_, place)| place.with(volume_from_model));
                for mut mesh in own.clone() {
                    let parts: Vec<SkinPlace> =
                        here().flat_map(|plant| mesh.places.iter().map(move |part| plant.with(*part))).collect();
                    mesh.places = parts.iter().map(|part| part.world_from_object(shell)).collect();
                    stand_ins.extend(parts);
                    let body = |part: &MeshPart| bodies.get(&part.group).copied();
                    let material = |part: &MeshPart| Material::of_part(part, body(part), [1.0; 2]).tinted(*tint);
                    meshes.push(SceneMesh::of_file(mesh, material));
                }
            }
        }
        Ok((widest, stand_ins))
    }

    /// The volumes, and the bytes of their files.
    fn volumes(self, params: &LandscapeParams) -> Result<(Vec<Arc<Voltex>>, u64), ViewerError> {
        let files = params.volumes.as_slice();
        let wanted = self.built_in().len();
        if !files.is_empty() && files.len() != wanted {
            return Err(ViewerError::Usage(format!(
                "the {} has {wanted} volumes and {} are given; write --volume FILE.voltex as often, or not at all",
                self.name(),
                files.len()
            )));
        }
        let packed: Vec<(PathBuf, std::borrow::Cow<'static, [u8]>)> = if files.is_empty() {
            self.built_in().iter().map(|bytes| (self.name().into(), (*bytes).into())).collect()
        } else {
            let read = |path: &PathBuf| match std::fs::read(path) {
                Ok(bytes) => Ok((path.clone(), bytes.into())),
                Err(source) => Err(ViewerError::Read { path: path.clone(), source }),
            };
            files.iter().map(read).collect::<Result<_, _>>()?
        };
        let mut volumes = Vec::new();
        for (path, bytes) in &packed {
            let volume = Volume::parse(bytes).map_err(|source| ViewerError::Volume { path: path.clone(), source })?;
            let [x, y, _] = volume.extent;
            if self != Landscape::Grove && (volume.cyclic != [true; 2] || x < 1.0 || y < 1.0) {
                return Err(ViewerError::Usage(format!(
                    "{}: the {}'s volumes go on into each other; build one of a script whose space is cyclic along x and y \
                     and as long along both as it is high at least",
                    path.display(),
                    self.name()
                )));
            }
            match self {
                Landscape::Grove => {
                    volumes.extend(grove::TINTS.map(|tint| Arc::new(Voltex::new(&tinted(&volume, tint)))));
                }
                _ => volumes.push(Arc::new(Voltex::new(&volume))),
            }
        }
        Ok((volumes, packed.iter().map(|(_, bytes)| bytes.len() as u64).sum()))
    }
}

/// Of two patches that are neighbours from west to east one, by chance: exactly half where columns are even.
fn half_of_pairs([column, row]: [u32; 2], seed: u32) -> bool {
    let drawn = hash(hash(hash(seed) ^ (column / 2)) ^ row) >> 16 & 1;
    column & 1 == drawn
}

fn look(eye: Vec3, target: Vec3, fov_deg: f32) -> Camera {
    Camera { eye, target, up: Vec3::Y, fov_deg }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::picture::CpuPicture;
    use crate::geometry::bvh::AnyHit;
    use crate::geometry::geometry::Geometry;
    use crate::options::ShadeOptions;
    use clap::ValueEnum;
    use glam::Vec4;

    fn built_in(landscape: Landscape, times: u32) -> (Scene, LandscapeCounts) {
        landscape
            .scene(&LandscapeParams { times, volumes: Vec::new(), meshes: Vec::new(), wind_m_per_s: None })
            .unwrap()
    }

    #[test]
    fn counts_are_the_published_ones_and_ten_times_them() {
        for times in [1, 10] {
            let counts = |landscape| built_in(landscape, times.try_into().unwrap()).1;
            let lawn = counts(Landscape::Lawn);
            assert_eq!([lawn.patches, lawn.blades, lawn.flowers], [1_400, 22_400, 700].map(|count| count * times));
            let grove = counts(Landscape::Grove);
            assert_eq!([grove.patches, grove.texels, grove.trees], [1_024, 512, 512].map(|count| count * times));
            assert_eq!(grove.primitives, grove.trees * 8_490);
            let forest = counts(Landscape::Forest);
            assert_eq!([forest.patches, forest.texels, forest.trees], [1_404, 12_500, 25_000].map(|n| n * times));
            assert!(forest.volume_bytes < 16_000_000, "{}", forest.volume_bytes);
        }
    }

    #[test]
    fn of_two_neighbours_one_is_chosen() {
        let chosen = |row| (0..40).filter(|column| half_of_pairs([*column, row], 7)).collect::<Vec<u32>>();
        assert!((0..35).all(|row| chosen(row).len() == 20));
        assert_ne!(chosen(0), chosen(1));
    }

    #[test]
    fn every_camera_shows_a_picture_without_nan_that_is_not_flat() {
        for landscape in Landscape::value_variants() {
            let (mut scene, _) = built_in(*landscape, 1);
            for number in 0..3 {
                if number > 0 {
                    scene.camera = scene.more_cameras[number - 1];
                }
                assert_eq!(scene.camera.fault(), None);
                let with = radiance(&scene);
                assert!(with.iter().flatten().all(|x| x.is_finite() && *x >= 0.0), "{landscape:?} {number}");
                let mean = luminance(&with).iter().sum::<f32>() / with.len() as f32;
                let variance = luminance(&with).iter().map(|x| (x - mean).powi(2)).sum::<f32>() / with.len() as f32;
                assert!(mean > 0.01 && variance.sqrt() > 0.1 * mean, "{landscape:?} {number}: {mean} {variance}");
                // Bare land is another picture: the volumes are seen.
                let bare = radiance(&Scene { volumes: None, ..scene.clone() });
                let changed = with.iter().zip(&bare).filter(|(a, b)| a != b).count();
                assert!(changed > with.len() / 8, "{landscape:?} {number}: {changed}");
            }
        }
    }

    #[test]
    fn models_stand_where_the_wind_has_their_volumes() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("flag.obj");
        std::fs::write(&file, "v 0 0 0\nv 0.5 0 0\nv 0 5 0\nf 1 2 3\n").unwrap();
        let params = LandscapeParams { times: 1, volumes: vec![], meshes: vec![file], wind_m_per_s: Some(30.0) };
        let (mut scene, _) = Landscape::Grove.scene(&params).unwrap();
        let before = scene.geometry.clone();
        scene.blow(3.0).unwrap();
        let volumes = scene.volumes.as_ref().unwrap();
        let SceneSkin { shell, patterns, .. } = &volumes.skins()[0];
        let volume_from_model = standing(volumes.volume(0), Vec3::ZERO, 0.0, 1.0).inverse();
        // How far a point of the models is from where the skin has it, in volumes, at most.
        let off = |geometry: &Geometry, at: Vec3| {
            let (mut count, mut worst) = (0, 0f32);
            for plant in geometry.instances().iter().filter(|instance| instance.leaf_width > 0.0).step_by(16) {
                let world = Vec3::from(plant.world_from_object.map(|row| Vec4::from(row).dot(at.extend(1.0))));
                let Some(tet) = shell.locate(world) else { continue };
                let texture = shell.map(tet).point(world);
                let cell = [texture.x, texture.y].map(|x| x.floor() as i32);
                let Some(variant) = patterns[shell.tets()[tet as usize].pattern as usize].variant(cell) else {
                    continue;
                };
                let there = volume_from_model.transform_point3(at);
                (count, worst) = (count + 1, worst.max((variant.point(texture) - there).length()));
            }
            assert!(count > 20, "{count}");
            worst
        };
        // At the foot, at half the way to the crown, and there.
        let heights = [0.001, 0.35, 0.7].map(|share| share * volumes.volume(0).side_m() * Vec3::Y);
        let [foot, middle, crown] = heights.map(|at| off(&scene.geometry, at));
        assert!(foot < 0.01 && middle < 0.1 && crown < 0.03, "{foot} {middle} {crown}");
        // Planted: where they stood a moment before.
        assert!(off(&before, heights[2]) > 0.2);
        // And they are hit there.
        let plant = scene.geometry.instances().iter().find(|instance| instance.leaf_width > 0.0).unwrap();
        let at = Vec3::new(0.02, 4.0, 0.0).extend(1.0);
        let world = Vec3::from(plant.world_from_object.map(|row| Vec4::from(row).dot(at)));
        let [x, y] = [0, 1].map(|axis| Vec3::from(plant.world_from_object.map(|row| row[axis])));
        let normal = x.cross(y).normalize();
        let hit = scene.geometry.trace(world + normal, -normal, 2.0, AnyHit::No);
        assert!((hit.t - 1.0).abs() < 1e-3, "{hit:?}");
    }

    #[test]
    fn says_which_volumes_and_numbers_it_needs() {
        let asked = |landscape: Landscape, times, volumes: &[&str]| {
            let volumes = volumes.iter().map(PathBuf::from).collect();
            landscape.scene(&LandscapeParams { times, volumes, meshes: Vec::new(), wind_m_per_s: None }).unwrap_err()
        };
        assert_eq!(asked(Landscape::Grove, 0, &[]).exit_code(), 2);
        assert!(asked(Landscape::Lawn, 1, &["one.voltex"]).to_string().contains("2 volumes"));
        assert!(asked(Landscape::Grove, 1, &["none.voltex"]).to_string().contains("none.voltex"));
        let tree = concat!(env!("CARGO_MANIFEST_DIR"), "/src/scene/builtin/tree.voltex");
        assert!(asked(Landscape::Forest, 1, &[tree]).to_string().contains("cyclic"));
    }

    fn radiance(scene: &Scene) -> Vec<[f32; 3]> {
        let mut picture = CpuPicture::new([24, 16]);
        picture.add_sample(scene, &ShadeOptions::default(), &|| true);
        picture.radiance()
    }

    fn luminance(radiance: &[[f32; 3]]) -> Vec<f32> {
        radiance.iter().map(|[r, g, b]| 0.2126 * r + 0.7152 * g + 0.0722 * b).collect()
    }
}
