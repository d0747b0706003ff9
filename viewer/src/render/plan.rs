//! `btf-view plan`: what a scene's pictures need of its assets, and assets that hold no more.
//!
//! The cameras' rays tell the finest level that an asset is asked for. Fewer components and lobes are then tried, for
//! all assets at once, until an asset's own pixels differ too much from those of the whole assets. What is left is
//! written, loaded and drawn again: the error that is told is that of the files.
//!
//! Where the assets may take only so many bytes in memory, each is tried with packed bases of several sizes as well, and
//! `plan_memory.rs` shares the bytes out among them by their pixels' errors.

use crate::cpu::pick::count_levels;
use crate::error::ViewerError;
use crate::options::RenderMode;
use crate::picture::psnr_db;
use crate::render::control::Control;
use crate::render::headless::{RenderParams, Session};
use crate::render::plan_memory::{Form, choose};
use crate::scene::asset::{FileForm, SceneAsset};
use crate::scene::scene::Scene;
use btf_capture::text_from_bytes;
use btf_runtime::{Asset, DecodeOptions, LobeRole, PackedGoal, ResidentFile, pack};
use serde::Serialize;
use std::sync::Arc;

/// An asset is given the finest level that at least this share of its pixels asks for.
const LEVEL_SHARE: f64 = 0.01;
/// Limits that are tried, from the largest down.
const LADDER: [u32; 16] = [0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 80, 96, 112];
/// PSNR of the packed bases that are tried, dB, beside the whole ones.
const PACKED_DB: [f32; 8] = [54.0, 48.0, 43.0, 39.0, 35.0, 31.0, 27.0, 23.0];
/// Rounds in which limits are raised again where together they cost more than each alone.
const MAX_ROUNDS: usize = 6;

/// The part of one asset that a scene needs.
#[derive(Debug, Clone, Serialize)]
pub struct PlannedAsset {
    /// The asset's name.
    pub name: String,
    /// Pixels in which it is seen, over all cameras.
    pub pixels: u64,
    /// Level that is kept as the finest one: 0 the asset's own.
    pub level: usize,
    /// Texels a row and rows, of the asset and of what is kept.
    pub texels: [[usize; 2]; 2],
    /// Residual components, of the asset and of what is kept.
    pub components: [u32; 2],
    /// Lobes of the texel that has most, of the asset and of what is kept.
    pub lobes: [u32; 2],
    /// Bytes of the file, of the asset and of what is kept.
    pub bytes: [usize; 2],
    /// Bytes in memory, of the asset and of what is kept.
    pub resident_bytes: [usize; 2],
    /// PSNR of the asset's pixels against those of the whole asset, 8-bit sRGB, dB; `null` where it is not seen.
    pub psnr_db: Option<f64>,
    /// The file.
    #[serde(skip)]
    pub packed: Vec<u8>,
}

/// A plan for all assets of a scene.
#[derive(Debug, Clone, Serialize)]
pub struct Plan {
    /// Plans of the assets, in the order of [`Scene::assets`].
    pub assets: Vec<PlannedAsset>,
    /// PSNR of whole pictures, 8-bit sRGB, dB.
    pub psnr_db: f64,
    /// Bytes of all files, before and after.
    pub bytes: [usize; 2],
    /// Bytes of all assets in memory, before and after.
    pub resident_bytes: [usize; 2],
}

/// Finds what `scene` needs of its assets, seen from each of `cameras` times `params.size` pixels, for pictures whose
/// assets' pixels are within `goal_db` of those with whole assets. With `memory_bytes` the plan's files are resident
/// forms that take at most so many bytes together, and the goal is only kept where these suffice.
///
/// Cost: up to 32 pictures of each camera, and packing, reading and expanding the assets; with `memory_bytes` 10
/// pictures and expansions more.
///
/// # Errors
/// As [`crate::render`]; [`ViewerError::Usage`] where `memory_bytes` are too few.
pub fn plan(
    scene: &Scene,
    params: &RenderParams,
    goal_db: f64,
    memory_bytes: Option<u64>,
    control: &Control,
) -> Result<Plan, ViewerError> {
    let forms = scene.assets.iter().map(|asset| asset.file_form()).collect::<Result<Vec<_>, _>>()?;
    let mut planner = Planner::new(scene, &forms, params, control)?;
    let mut seen: Vec<Vec<u64>> = Vec::new();
    for view in views(scene) {
        let of_view = count_levels(&view, params.size, &params.shade);
        if seen.is_empty() {
            seen = of_view;
        } else {
            seen.iter_mut().flatten().zip(of_view.into_iter().flatten()).for_each(|(sum, count)| *sum += count);
        }
    }
    // A traced path also meets what no eye sees: that is kept whole.
    let paths = params.shade.mode == RenderMode::Path;
    let mut needs: Vec<Need> =
        forms.iter().zip(&seen).map(|(asset, seen)| Need::of_levels(asset, seen, paths)).collect();
    planner.search(&mut needs, goal_db, Limit::Components)?;
    planner.search(&mut needs, goal_db, Limit::Lobes)?;
    let mut rounds = 0..MAX_ROUNDS;
    let kept = loop {
        let packed = needs
            .iter()
            .zip(&scene.assets)
            .zip(&forms)
            .map(|((need, asset), form)| need.pack(form, &asset.name))
            .collect::<Result<Vec<_>, _>>()?;
        let kept = planner.kept(packed)?;
        let mut raised = false;
        for ((need, error), asset) in needs.iter_mut().zip(&kept.errors).zip(&forms) {
            raised |= error.is_some_and(|error| error < goal_db) && need.raise(asset);
        }
        if !raised || rounds.next().is_none() {
            break kept;
        }
    };
    let kept = match memory_bytes {
        None => kept,
        Some(budget) => planner.within(budget, kept)?,
    };
    Ok(planner.tell(&needs, kept))
}

/// What is kept of all assets.
struct Kept {
    assets: Vec<Arc<SceneAsset>>,
    files: Vec<Vec<u8>>,
    /// PSNR of each asset's pixels.
    errors: Vec<Option<f64>>,
    /// PSNR of all pixels.
    psnr_db: f64,
}

/// The number that the search lowers.
#[derive(Debug, Clone, Copy)]
enum Limit {
    Components,
    Lobes,
}

impl Limit {
    fn of(self, need: &mut Need) -> &mut u32 {
        match self {
            Limit::Components => &mut need.components,
            Limit::Lobes => &mut need.lobes,
        }
    }

    fn of_decoder(self, options: &mut DecodeOptions) -> &mut u32 {
        match self {
            Limit::Components => &mut options.components,
            Limit::Lobes => &mut options.lobes,
        }
    }
}

/// The part of an asset that is kept.
#[derive(Debug, Clone, Copy)]
struct Need {
    pixels: u64,
    level: usize,
    components: u32,
    lobes: u32,
    /// What the asset has at that level.
    most: [u32; 2],
}

impl Need {
    fn of_levels(asset: &FileForm, seen: &[u64], paths: bool) -> Need {
        let pixels: u64 = seen.iter().sum();
        let level = seen.iter().position(|count| *count > 0 && *count as f64 >= LEVEL_SHARE * pixels as f64);
        // What nobody sees is kept at its coarsest.
        let level = level.unwrap_or(if paths { 0 } else { asset.whole.levels.len() });
        let most = most_of(&asset.level(level));
        Need { pixels, level, components: most[0], lobes: most[1], most }
    }

    /// Takes the next larger limits or, where there are none, the next finer level; returns `false` where all is kept.
    fn raise(&mut self, asset: &FileForm) -> bool {
        let next = |now: u32, most: u32| LADDER.into_iter().find(|rung| *rung > now).unwrap_or(most).min(most);
        let before = [self.components, self.lobes];
        [self.components, self.lobes] = [next(self.components, self.most[0]), next(self.lobes, self.most[1])];
        if before != [self.components, self.lobes] {
            return true;
        }
        let Some(finer) = self.level.checked_sub(1) else { return false };
        self.level = finer;
        self.most = most_of(&asset.level(finer));
        [self.components, self.lobes] = self.most;
        true
    }

    fn pack(&self, asset: &FileForm, name: &str) -> Result<Vec<u8>, ViewerError> {
        let kept = asset.level(self.level).trimmed(self.components as usize, self.lobes as usize);
        pack(&kept).map_err(|source| ViewerError::Asset { path: name.into(), source })
    }
}

/// Components and lobes of an asset.
fn most_of(asset: &Asset) -> [u32; 2] {
    [asset.most_components() as u32, asset.most_lobes() as u32]
}

/// Radiance of all views, one after the other.
type Radiance = Vec<[f32; 3]>;

struct Planner<'a> {
    scene: &'a Scene,
    forms: &'a [&'a FileForm],
    params: &'a RenderParams,
    control: &'a Control<'a>,
    session: Session,
    /// With whole assets.
    reference: Radiance,
    /// Which asset each pixel shows.
    shown: Vec<Option<usize>>,
}

/// Returns the scene from each of its cameras.
fn views(scene: &Scene) -> impl Iterator<Item = Scene> {
    scene.cameras().into_iter().map(|camera| Scene { camera, ..scene.clone() })
}

fn pictures(
    session: &mut Session,
    scene: &Scene,
    params: &RenderParams,
    control: &Control,
) -> Result<Radiance, ViewerError> {
    let mut radiance = Vec::new();
    for view in views(scene) {
        radiance.extend(session.render(&view, params, control)?.picture.radiance);
    }
    Ok(radiance)
}

impl<'a> Planner<'a> {
    fn new(
        scene: &'a Scene,
        forms: &'a [&'a FileForm],
        params: &'a RenderParams,
        control: &'a Control,
    ) -> Result<Planner<'a>, ViewerError> {
        let session = Session::new(scene, params, control)?;
        let mut planner = Planner { scene, forms, params, control, session, reference: Vec::new(), shown: Vec::new() };
        for view in views(scene) {
            let rendered = planner.session.render(&view, params, control)?;
            planner.reference.extend(rendered.picture.radiance);
            planner.shown.extend(rendered.hits.iter().map(|hit| {
                let triangle = scene.geometry.triangles().get(hit.primitive as usize)?;
                scene.materials[triangle.material as usize].asset()
            }));
        }
        Ok(planner)
    }

    /// Returns the error of each asset's pixels.
    fn errors(&self, radiance: &Radiance) -> Vec<Option<f64>> {
        let of = |asset: usize| {
            let pixels: Vec<usize> = (0..radiance.len()).filter(|pixel| self.shown[*pixel] == Some(asset)).collect();
            let pick = |from: &Radiance| pixels.iter().map(|pixel| from[*pixel]).collect::<Vec<_>>();
            (!pixels.is_empty()).then(|| psnr_db(&pick(radiance), &pick(&self.reference), self.scene.exposure_ev))
        };
        (0..self.scene.assets.len()).map(of).collect()
    }

    /// Lowers one limit of each asset as far as its pixels allow.
    fn search(&mut self, needs: &mut [Need], goal_db: f64, limit: Limit) -> Result<(), ViewerError> {
        // Lobes that only guide show in no picture, but rays are drawn by them and edits begin with them.
        let shows = |asset: &&FileForm| {
            matches!(limit, Limit::Components)
                || asset.asset.layers.iter().any(|layer| layer.lobe_role != LobeRole::Guide || layer.residual.is_none())
        };
        let mut open: Vec<bool> = self.forms.iter().map(shows).collect();
        for (need, open) in needs.iter_mut().zip(&mut open).filter(|(need, _)| need.pixels == 0) {
            if self.params.shade.mode == RenderMode::Direct {
                *limit.of(need) = 0;
            }
            *open = false;
        }
        let largest = needs.iter_mut().map(|need| *limit.of(need)).max().unwrap_or(0);
        for rung in LADDER.into_iter().rev().filter(|rung| *rung < largest) {
            if !open.contains(&true) {
                break;
            }
            let mut params = self.params.clone();
            *limit.of_decoder(&mut params.shade.decode) = rung;
            let radiance = pictures(&mut self.session, self.scene, &params, self.control)?;
            for ((need, open), error) in needs.iter_mut().zip(&mut open).zip(self.errors(&radiance)) {
                if *open && *limit.of(need) > rung {
                    *open = error.is_some_and(|error| error >= goal_db);
                    if *open {
                        *limit.of(need) = rung;
                    }
                }
            }
        }
        Ok(())
    }

    /// Draws the pictures with these assets in place of the whole ones.
    fn drawn(&self, assets: &[Arc<SceneAsset>]) -> Result<Radiance, ViewerError> {
        let scene = Scene { assets: assets.to_vec(), ..self.scene.clone() };
        pictures(&mut Session::new(&scene, self.params, self.control)?, &scene, self.params, self.control)
    }

    /// Loads and draws the assets of packed files.
    fn kept(&self, files: Vec<Vec<u8>>) -> Result<Kept, ViewerError> {
        let loaded = |(asset, bytes): (&Arc<SceneAsset>, &Vec<u8>)| {
            let loaded = SceneAsset::from_bytes(asset.name.clone(), bytes.clone());
            loaded.map(Arc::new).map_err(|source| ViewerError::Asset { path: asset.name.clone().into(), source })
        };
        let assets = self.scene.assets.iter().zip(&files).map(loaded).collect::<Result<Vec<_>, _>>()?;
        let radiance = self.drawn(&assets)?;
        let psnr_db = psnr_db(&radiance, &self.reference, self.scene.exposure_ev);
        Ok(Kept { assets, files, errors: self.errors(&radiance), psnr_db })
    }

    /// Packs what is kept in resident forms that take at most `budget` bytes together.
    fn within(&self, budget: u64, kept: Kept) -> Result<Kept, ViewerError> {
        let mut forms: Vec<Vec<Form>> = vec![Vec::new(); kept.assets.len()];
        let mut pixels = vec![0.0; kept.assets.len()];
        self.shown.iter().flatten().for_each(|asset| pixels[*asset] += 1.0);
        let mut add = |assets: &[Arc<SceneAsset>], errors: &[Option<f64>]| {
            for (((forms, asset), error), pixels) in forms.iter_mut().zip(assets).zip(errors).zip(&pixels) {
                let error = error.map_or(0.0, |db| pixels * 10f64.powf(-db / 10.0));
                forms.push(Form { bytes: 4 * asset.head().words().len() as u64, error });
            }
        };
        add(&kept.assets, &kept.errors);
        let at = |rung: usize, asset: &Arc<SceneAsset>| match rung.checked_sub(1) {
            None => asset.clone(),
            Some(packed) => Arc::new(asset.packed(PackedGoal::of_psnr(PACKED_DB[packed]))),
        };
        for rung in 1..=PACKED_DB.len() {
            let assets: Vec<Arc<SceneAsset>> = kept.assets.iter().map(|asset| at(rung, asset)).collect();
            add(&assets, &self.errors(&self.drawn(&assets)?));
        }
        let Some(chosen) = choose(&forms, budget) else {
            let least: u64 = forms.iter().flat_map(|forms| forms.iter().map(|form| form.bytes).min()).sum();
            return Err(ViewerError::Usage(format!(
                "the scene's assets take {} in memory at least; allow that with --memory-budget",
                text_from_bytes(least)
            )));
        };
        let file = |(asset, rung): (&Arc<SceneAsset>, usize)| {
            let FileForm { whole, .. } = asset.file_form()?;
            let packed = ResidentFile::with_words(whole.clone(), at(rung, asset).resident().clone()).pack();
            packed.map_err(|source| ViewerError::Asset { path: asset.name.clone().into(), source })
        };
        self.kept(kept.assets.iter().zip(chosen).map(file).collect::<Result<_, _>>()?)
    }

    fn tell(&self, needs: &[Need], kept: Kept) -> Plan {
        let Kept { assets: held, files, errors, psnr_db } = kept;
        let whole = self.scene.assets.iter().zip(self.forms).zip(needs);
        let assets: Vec<PlannedAsset> = whole
            .zip(held.iter().zip(files).zip(errors))
            .map(|(((asset, form), need), ((held, packed), error))| {
                let [components, lobes] = most_of(&form.asset);
                PlannedAsset {
                    name: asset.name.clone(),
                    pixels: need.pixels,
                    level: need.level,
                    texels: [asset, held].map(|it| [it.head().width() as usize, it.head().height() as usize]),
                    components: [components, need.components.min(need.most[0])],
                    lobes: [lobes, need.lobes.min(need.most[1])],
                    bytes: [pack(&form.asset).map_or(0, |bytes| bytes.len()), packed.len()],
                    resident_bytes: [asset, held].map(|it| 4 * it.head().words().len()),
                    psnr_db: error,
                    packed,
                }
            })
            .collect();
        let sum = |of: fn(&PlannedAsset) -> [usize; 2]| [0, 1].map(|i| assets.iter().map(|asset| of(asset)[i]).sum());
        let (bytes, resident_bytes) = (sum(|asset| asset.bytes), sum(|asset| asset.resident_bytes));
        Plan { bytes, resident_bytes, assets, psnr_db }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Camera;
    use crate::MeshChoice;
    use crate::gpu::backend::BackendChoice;
    use glam::Vec3;

    fn params() -> RenderParams {
        RenderParams { size: [48, 48], backend: BackendChoice::Cpu, ..RenderParams::default() }
    }

    fn planned(distance: f32, goal_db: f64) -> Plan {
        let asset = Arc::new(SceneAsset::built_in());
        let mut scene = Scene::built_in(&MeshChoice::Plane, vec![asset], [1.0; 2]).unwrap();
        scene.camera = Camera { eye: Vec3::Z * distance, target: Vec3::ZERO, up: Vec3::Y, fov_deg: 30.0 };
        plan(&scene, &params(), goal_db, None, &Control::SILENT).unwrap()
    }

    #[test]
    fn a_distant_camera_needs_coarser_texels_and_a_near_one_all_of_them() {
        // 64 texels on a plane 2 wide, which is 2.68 times as wide as the picture is at a fifth of its distance.
        let (near, far) = (planned(2.0, 30.0), planned(14.9, 30.0));
        assert_eq!(near.assets[0].level, 0);
        // A pixel is 14.9 * 2 tan 15 / 48 = 0.166 wide, 5.3 texels: between levels 2 and 3.
        assert_eq!((far.assets[0].level, far.assets[0].texels[1]), (2, [16, 16]));
        assert!(far.bytes[1] < near.bytes[1] && near.bytes[1] <= near.bytes[0], "{:?} {:?}", near.bytes, far.bytes);
        for plan in [near, far] {
            assert!(plan.assets[0].psnr_db.unwrap() >= 30.0, "{plan:?}");
            let kept = Asset::parse(&plan.assets[0].packed).unwrap();
            assert_eq!([kept.width, kept.height], plan.assets[0].texels[1]);
        }
    }

    #[test]
    fn a_higher_goal_keeps_more() {
        let (low, high) = (planned(3.0, 20.0), planned(3.0, 60.0));
        assert!(low.assets[0].components[1] < high.assets[0].components[1], "{low:?} {high:?}");
    }

    #[test]
    fn a_budget_of_memory_is_kept_and_spent_where_pixels_are() {
        let assets = vec![Arc::new(SceneAsset::built_in()), Arc::new(SceneAsset::built_in())];
        let mut scene = Scene::built_in(&MeshChoice::Plane, assets, [1.0; 2]).unwrap();
        // Most of the picture shows the first plane, its right rim the second one.
        scene.camera = Camera { eye: Vec3::new(-0.7, 0.0, 2.0), target: Vec3::X * -0.7, up: Vec3::Y, fov_deg: 50.0 };
        let params = RenderParams { size: [24, 24], ..params() };
        let planned = |bytes| plan(&scene, &params, 20.0, bytes, &Control::SILENT);
        let whole: usize = scene.assets.iter().map(|asset| 4 * asset.head().words().len()).sum();
        let budget = whole as u64 / 8;
        let tight = planned(Some(budget)).unwrap();
        assert!(tight.resident_bytes[0] == whole && tight.resident_bytes[1] as u64 <= budget);
        let [first, second] = [&tight.assets[0], &tight.assets[1]];
        assert!(first.pixels > 2 * second.pixels && second.pixels > 0, "{} {}", first.pixels, second.pixels);
        let [near, rim] = [first, second].map(|asset| asset.resident_bytes[1]);
        assert!(near >= rim, "{near} {rim}");
        // The files are what was drawn.
        let held = SceneAsset::from_bytes("held", first.packed.clone()).unwrap();
        assert!(held.file.is_none() && 4 * held.head().words().len() == near);
        assert!(planned(Some(1000)).err().is_some_and(|error| error.to_string().contains("--memory-budget")));
    }

    #[test]
    fn what_nobody_sees_is_kept_at_its_coarsest() {
        let (seen, unseen) = (Arc::new(SceneAsset::built_in()), Arc::new(SceneAsset::built_in()));
        let mut scene = Scene::built_in(&MeshChoice::Plane, vec![seen, unseen], [1.0; 2]).unwrap();
        // The second plane stands to the right of the first.
        scene.camera = Camera { eye: Vec3::new(-1.15, 0.0, 2.0), target: Vec3::X * -1.15, up: Vec3::Y, fov_deg: 30.0 };
        let plan = plan(&scene, &params(), 30.0, None, &Control::SILENT).unwrap();
        assert_eq!((plan.assets[1].pixels, plan.assets[1].texels[1], plan.assets[1].psnr_db), (0, [1, 1], None));
        assert_eq!(plan.assets[0].level, 0);
        // From a second camera it is seen.
        scene.more_cameras = vec![Camera { eye: Vec3::new(1.15, 0.0, 2.0), target: Vec3::X * 1.15, ..scene.camera }];
        assert_eq!(super::plan(&scene, &params(), 30.0, None, &Control::SILENT).unwrap().assets[1].level, 0);
    }
}
