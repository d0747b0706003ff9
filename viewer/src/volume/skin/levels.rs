//! Shells of one skin from fine to coarse. A texel that lies a little beside its place is not seen so where that is less than a pixel,
//! and a shell that may be so far off has fewer tetrahedra: 192, 48 or 6 of a texel of a lawn.

use super::refine::{ShellParams, cuts};
use super::shell::{MAX_TETS, Shell};
use super::thick_skin::Skin;

/// Factor on the tolerance from one level to the next.
const COARSER: f32 = 3.0;
/// Share of the tetrahedra that a level has at most of those of the one before it: else it is not worth its memory.
const FEWER: f32 = 0.6;
/// Width of what stands for a deviation of a shell in the transition between levels, in deviations: where it is a pixel wide, half of the
/// paths have the next level.
const WIDTH_DEVIATIONS: f32 = 2.0;

/// A shell for some range of distances.
#[derive(Debug, Clone)]
pub struct ShellLevel {
    /// The tetrahedra.
    pub shell: Shell,
    /// Width in the world that is about a pixel where the level begins to be taken; 0 for the finest, which is taken from the eye on.
    pub from_width: f32,
}

impl ShellLevel {
    /// Returns the shells of `skin`, finest first; that is what `params` ask for, whose budget is that of one shell. Cost: a few
    /// measurements of every box for each tolerance, and the shells, of which each has 0.6 of the tetrahedra of the one before at most.
    ///
    /// # Errors
    /// As [`Shell::new`].
    pub fn all(skin: &Skin, params: &ShellParams) -> Result<Vec<ShellLevel>, String> {
        let finest = Shell::new(skin, params)?;
        let texel_width = finest.texel_width();
        let parts = |sides: u32, layers: u32| (sides * sides * layers) as f32;
        let mut latest = parts(finest.report().sides, finest.report().layers);
        let most_tets = params.most_tets.min(MAX_TETS);
        let mut levels = vec![ShellLevel { shell: finest, from_width: 0.0 }];
        let mut tolerance = params.tolerance;
        // Faces and heights that are whole are the coarsest.
        while latest > 1.0 {
            tolerance *= COARSER;
            let found = cuts(skin, &ShellParams { tolerance, most_tets });
            let own = parts(found.sides, found.layers);
            if own > FEWER * latest {
                continue;
            }
            latest = own;
            let from_width = WIDTH_DEVIATIONS * found.deviation * texel_width;
            if levels.iter().all(|level| level.from_width < from_width) {
                levels.push(ShellLevel { shell: Shell::of_cuts(skin, found)?, from_width });
            }
        }
        Ok(levels)
    }
}
