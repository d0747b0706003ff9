//! The volumetric textures of a scene as words for a GPU: those of each volume, of each skin's shell and patterns, and
//! a table that says where they begin. Twin: `volumes.wgsl`, which reads the table.

use crate::volume::volumes::{Proxy, Volumes};
use std::borrow::Cow;

/// The patterns of a volume that stands on its own. Twin: `NO_PATTERNS` in `volumes.wgsl`.
pub(crate) const NO_PATTERNS: u32 = u32::MAX;
/// Words of a proxy in the table. Twin: `PROXY_WORDS` in `volumes.wgsl`.
pub(crate) const PROXY_WORDS: usize = 4;

impl Volumes {
    /// Counts the arrays of words: one of each volume, one of each shell and one more of each skin, and the table.
    pub(crate) fn array_count(&self) -> usize {
        self.shell_array(self.skins().len()) + 1
    }

    /// Returns the arrays, the table last and still empty.
    ///
    /// # Errors
    /// A sentence if a shell's are more than a word can number.
    pub(crate) fn arrays(&self) -> Result<Vec<Cow<'_, [u32]>>, String> {
        let mut arrays: Vec<Cow<[u32]>> =
            (0..self.volume_count()).map(|volume| Cow::from(self.volume(volume).words())).collect();
        for skin in self.skins() {
            for level in &skin.levels {
                arrays.push(level.shell.words()?.into());
            }
            arrays.push(crate::volume::skin::pattern_words(&skin.patterns).into());
        }
        arrays.push(vec![0; self.volume_count() + PROXY_WORDS * self.proxies().instances().len()].into());
        Ok(arrays)
    }

    /// Returns the number of the array of a skin's finest shell; those of coarser ones follow, then that of its patterns.
    pub(crate) fn shell_array(&self, skin: usize) -> usize {
        let of_skins = self.skins()[..skin].iter().map(|skin| skin.levels.len() + 1).sum::<usize>();
        self.volume_count() + of_skins
    }

    /// Returns the table, where the arrays begin at the words `bases`: that of each volume; then of each proxy the content, a volume or a
    /// shell, the patterns, [`NO_PATTERNS`] where it is a volume, and the widths about whose spheres a shell begins and ends to be entered.
    pub(crate) fn table(&self, bases: &[u32]) -> Vec<u32> {
        let mut words = bases[..self.volume_count()].to_vec();
        for instance in 0..self.proxies().instances().len() {
            let of_proxy: [u32; PROXY_WORDS] = match self.proxy(instance) {
                Proxy::Box(volume) => [bases[volume], NO_PATTERNS, 0, 0],
                Proxy::Skin { skin, level } => {
                    let [shell, patterns] =
                        [level, self.skins()[skin].levels.len()].map(|i| self.shell_array(skin) + i);
                    let [from_width, to_width] = self.skins()[skin].widths(level).map(f32::to_bits);
                    [bases[shell], bases[patterns], from_width, to_width]
                }
            };
            words.extend(of_proxy);
        }
        words
    }
}
