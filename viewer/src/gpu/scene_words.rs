//! The words that shaders read of a scene: assets, then leaves, then what volumes need, then the environment, one array
//! each.

use crate::error::ViewerError;
use crate::gpu::arena::{Arena, ArenaAsset, room_for_edits};
use crate::gpu::device::Gpu;
use crate::gpu::expand::LayerBases;
use crate::gpu::pieces::Pieces;
use crate::scene::asset::SceneAsset;
use crate::scene::scene::Scene;
use crate::volume::skin::ShellLevel;
use std::ops::Range;

/// The arrays of a scene in the arena, and their numbers.
pub(crate) struct SceneWords {
    arena: Arena,
    /// Number of the first leaf.
    leaves: usize,
    /// Number of the first array of the volumes; the last of them is their table.
    volumes: usize,
    /// Number of the environment, which may be absent.
    environment: usize,
}

impl SceneWords {
    /// Uploads the words of `scene`.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the adapter binds fewer words, or a shell has more than a word can number.
    pub(crate) fn new(gpu: &Gpu, scene: &Scene) -> Result<SceneWords, ViewerError> {
        let bases: Vec<Option<Vec<LayerBases>>> =
            scene.assets.iter().map(|asset| bases_to_expand(gpu, asset)).collect();
        let mut arrays: Vec<ArenaAsset> = scene
            .assets
            .iter()
            .zip(&bases)
            .map(|(asset, bases)| match bases {
                Some(bases) => ArenaAsset { words: asset.head().words(), bases },
                None => ArenaAsset::whole(asset.resident().words()),
            })
            .collect();
        arrays.extend(scene.leaves.iter().map(|leaf| ArenaAsset::whole(leaf.leaf.words())));
        let of_volumes = scene.volumes.as_ref().map(|volumes| volumes.arrays()).transpose();
        let of_volumes = of_volumes.map_err(|reason| gpu.error(reason))?;
        arrays.extend(of_volumes.iter().flatten().map(|words| ArenaAsset::whole(words)));
        let environment = scene.environment.iter().map(|environment| bytemuck::cast_slice(environment.table()));
        arrays.extend(environment.map(ArenaAsset::whole));
        let arena = Arena::new(gpu, &arrays, room_for_edits)?;
        let leaves = scene.assets.len();
        let volumes = leaves + scene.leaves.len();
        let environment = volumes + scene.volumes.as_ref().map_or(0, |volumes| volumes.array_count());
        let words = SceneWords { arena, leaves, volumes, environment };
        if let Some(volumes) = &scene.volumes {
            let table = volumes.table(&words.arena.bases[words.volumes..]);
            words.arena.write(words.environment - 1, &table, 0..table.len());
        }
        Ok(words)
    }

    /// Returns the buffers.
    pub(crate) fn pieces(&self) -> &Pieces {
        &self.arena.pieces
    }

    /// Returns the first word of an asset.
    pub(crate) fn asset_at(&self, asset: usize) -> u32 {
        self.arena.bases[asset]
    }

    /// Returns the first word of a leaf.
    pub(crate) fn leaf_at(&self, leaf: usize) -> u32 {
        self.arena.bases[self.leaves + leaf]
    }

    /// Returns the first word of the table of the volumes; 0 without volumes.
    pub(crate) fn volumes_at(&self) -> u32 {
        if self.environment > self.volumes { self.arena.bases[self.environment - 1] } else { 0 }
    }

    /// Returns the first word of the environment; 0 without one.
    pub(crate) fn environment_at(&self) -> u32 {
        self.arena.bases.get(self.environment).copied().unwrap_or(0)
    }

    /// Writes the edits of an asset; `false` if they need more room than there is.
    pub(crate) fn write_edits(&self, scene: &Scene, asset: usize) -> bool {
        let head = scene.assets[asset].head();
        head.edited_ranges().into_iter().all(|range| self.arena.write(asset, head.words(), range))
    }

    /// Writes what is shown of the bands of an asset.
    pub(crate) fn write_shown(&self, scene: &Scene, asset: usize) -> bool {
        let head = scene.assets[asset].head();
        self.arena.write(asset, head.words(), head.shown_range())
    }

    /// Writes a `range` of the words of a leaf.
    pub(crate) fn write_leaf(&self, scene: &Scene, leaf: usize, range: Range<usize>) -> bool {
        self.arena.write(self.leaves + leaf, scene.leaves[leaf].leaf.words(), range)
    }

    /// Writes the environment, if the scene has one; `false` if it needs more room than there is.
    pub(crate) fn write_environment(&self, scene: &Scene) -> bool {
        let Some(environment) = &scene.environment else { return true };
        let words = bytemuck::cast_slice(environment.table());
        self.environment < self.arena.bases.len() && self.arena.write(self.environment, words, 0..words.len())
    }

    /// Writes where the shells of the skins have moved.
    pub(crate) fn write_skins(&self, scene: &Scene) {
        let Some(volumes) = &scene.volumes else { return };
        for (number, skin) in volumes.skins().iter().enumerate() {
            for (level, ShellLevel { shell, .. }) in skin.levels.iter().enumerate() {
                let moving = shell.moving_words();
                let mut words = vec![0; moving.end];
                shell.write_moving(&mut words);
                self.arena.write(self.volumes + volumes.shell_array(number) + level, &words, moving);
            }
        }
    }
}

/// Returns the bases that `gpu` is to expand itself; `None` where the CPU does, or has.
fn bases_to_expand(gpu: &Gpu, asset: &SceneAsset) -> Option<Vec<LayerBases>> {
    let file = asset.file.as_ref().filter(|_| gpu.expands_bases() && !asset.is_expanded())?;
    LayerBases::of_asset(gpu, asset.head(), &file.whole)
}
