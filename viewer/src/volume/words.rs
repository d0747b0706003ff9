//! The volumetric textures of a scene as words for a GPU: those of each volume, of each skin's shell and patterns, and
//! a table that says where they begin. Twin: `volumes.wgsl`, which reads the table.

use crate::volume::volumes::{Proxy, Volumes};
use std::borrow::Cow;

/// The patterns of a volume that stands on its own. Twin: `NO_PATTERNS` in `volumes.wgsl`.
pub(crate) const NO_PATTERNS: u32 = u32::MAX;

impl Volumes {
    /// Counts the arrays of words: one of each volume, two of each skin, and the table.
    pub(crate) fn array_count(&self) -> usize {
        self.volume_count() + 2 * self.skins().len() + 1
    }

    /// Returns the arrays, the table last and still empty.
    ///
    /// # Errors
    /// A sentence if a shell's are more than a word can number.
    pub(crate) fn arrays(&self) -> Result<Vec<Cow<'_, [u32]>>, String> {
        let mut arrays: Vec<Cow<[u32]>> =
            (0..self.volume_count()).map(|volume| Cow::from(self.volume(volume).words())).collect();
        for skin in self.skins() {
            arrays.push(skin.shell.words()?.into());
            arrays.push(crate::volume::skin::pattern_words(&skin.patterns).into());
        }
        arrays.push(vec![0; self.volume_count() + 2 * self.proxies().instances().len()].into());
        Ok(arrays)
    }

    /// Returns the number of the array of a skin's shell; that of its patterns follows.
    pub(crate) fn shell_array(&self, skin: usize) -> usize {
        self.volume_count() + 2 * skin
    }

    /// Returns the table, where the arrays begin at the words `bases`: that of each volume; then of each proxy the
    /// content, a volume or a shell, and the patterns, [`NO_PATTERNS`] where it is a volume.
    pub(crate) fn table(&self, bases: &[u32]) -> Vec<u32> {
        let mut words = bases[..self.volume_count()].to_vec();
        for instance in 0..self.proxies().instances().len() {
            words.extend(match self.proxy(instance) {
                Proxy::Box(volume) => [bases[volume], NO_PATTERNS],
                Proxy::Skin(skin) => [0, 1].map(|array| bases[self.shell_array(skin) + array]),
            });
        }
        words
    }
}
