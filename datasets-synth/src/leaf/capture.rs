//! Writes the capture of a leaf.

use std::path::Path;

use crate::error::SynthError;
use crate::leaf::model::LeafModel;
use crate::leaf::params::LeafParams;
use crate::leaf::patch::Leaf;
use crate::leaf::plate_leaf::PlateLeaf;
use crate::leaf::tissue_leaf::{TABLE_RAYS, TissueLeaf};
use crate::optics::abm::scatter_table::Passage;
use crate::optics::colour::RgbBands;
use crate::optics::gloss::lobe::CookTorrance;
use crate::optics::gloss::params::{GlossCoupling, GlossParams};
use crate::optics::plates::body::PlateBody;
use crate::optics::plates::model::PlateModel;
use crate::surface::capture::{Progress, write_capture};

/// Generates the leaf of `params` and writes its capture to the folder `dir`, with its height map; see
/// [`write_capture`]. Equal parameters give equal files on any number of threads.
///
/// # Errors
/// [`SynthError::BadParameter`], and the errors of [`write_capture`].
pub fn write_leaf_capture(dir: impl AsRef<Path>, params: &LeafParams, progress: Progress) -> Result<(), SynthError> {
    params.check()?;
    let mut info = params.capture.info("leaf", params.provenance());
    info.side = params.capture_side();
    info.wavelengths_nm = params.wavelengths_nm.clone();
    if params.passage == Passage::Transmission {
        // The light stands behind the face that is seen.
        info.lights = info.lights.behind()?;
    }
    match (&params.model, params.model.tissue()) {
        (_, Some(tissue)) => write_capture(
            dir,
            info,
            || {
                let leaf = Leaf::new(params)?;
                let of = |bands| TissueLeaf::new(tissue, &leaf, bands, TABLE_RAYS, params.capture.seed);
                Ok(bands_of(params, RgbBands::Spectral31).into_iter().map(of).collect())
            },
            progress,
        ),
        (LeafModel::Plate(model), None) => write_capture(dir, info, || plate_leaves(*model, params), progress),
        (LeafModel::TwoSided(halves), None) => write_capture(
            dir,
            info,
            || {
                let body = |bands| Ok(PlateBody::two_sided(*halves, params.side, bands));
                body_leaves(body, params.bands, params.gloss.coupling, params)
            },
            progress,
        ),
        (_, None) => unreachable!("a model without a tissue is made of plates"),
    }
}

/// Returns what materials are made for: the three bands of each of a capture in bands, else `colours`.
fn bands_of(params: &LeafParams, colours: RgbBands) -> Vec<RgbBands> {
    match params.threes_of_bands() {
        threes if threes.is_empty() => vec![colours],
        threes => threes.into_iter().map(RgbBands::Three).collect(),
    }
}

/// Returns the materials of a plate model.
fn plate_leaves(model: PlateModel, params: &LeafParams) -> Result<Vec<PlateLeaf>, SynthError> {
    let colours = if model == PlateModel::Paper { RgbBands::ThreeWavelength } else { params.bands };
    // The printed body holds the surface's reflection already, and nothing couples it to the gloss.
    let coupling = if model == PlateModel::Paper { GlossCoupling::None } else { params.gloss.coupling };
    body_leaves(|bands| PlateBody::new(model, model.default_table(), bands), colours, coupling, params)
}

/// Returns the materials of a leaf whose body is `body` of bands, or of `colours`.
fn body_leaves(
    body: impl Fn(RgbBands) -> Result<PlateBody, SynthError>,
    colours: RgbBands,
    coupling: GlossCoupling,
    params: &LeafParams,
) -> Result<Vec<PlateLeaf>, SynthError> {
    let leaf = Leaf::new(params)?;
    let lobe = CookTorrance::from_params(&GlossParams { coupling, ..params.gloss });
    let of = |bands| {
        let Leaf { seen, tints, gloss, veins } = &leaf;
        Ok(PlateLeaf::new(seen.clone(), &params.contents, tints, gloss, veins.clone(), &body(bands)?, lobe.clone()))
    };
    bands_of(params, colours).into_iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::ops::ControlFlow;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use btf_capture::{Capture, Direction, DirectionSet, ImageFormat, Pixels};
    use btf_models::Species;

    use super::*;
    use crate::leaf::params::tests::small;
    use crate::optics::abm::path_lengths::Face;
    use crate::surface::capture_params::CaptureParams;

    fn go_on(_: usize, _: usize) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn all_pixels(dir: &Path) -> Vec<Pixels> {
        let capture = Capture::open(dir).unwrap();
        let lights = capture.info().lights.len();
        (0..capture.info().pair_count()).map(|pair| capture.read(pair / lights, pair % lights).unwrap()).collect()
    }

    #[test]
    fn a_leaf_capture_opens_and_says_what_it_is() {
        let parent = tempfile::tempdir().unwrap();
        let dir = parent.path().join("leaf");
        let counted = AtomicUsize::new(0);
        write_leaf_capture(&dir, &small(), &|done, total| {
            assert!(done <= total && total == 20);
            counted.fetch_max(done, Ordering::Relaxed);
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(counted.into_inner(), 20);
        let capture = Capture::open(&dir).unwrap();
        let info = capture.info();
        assert_eq!((info.width, info.height, info.views.len(), info.lights.len()), (48, 48, 4, 5));
        assert_eq!(info.size_mm, Some([20.0, 20.0]));
        assert!(info.provenance.contains("plate-n") && info.provenance.contains("seed 1"));
        assert_eq!(all_pixels(&dir).len(), 20);
    }

    #[test]
    fn the_files_are_the_same_on_one_thread_and_on_three() {
        let parent = tempfile::tempdir().unwrap();
        let write = |name: &str, threads: usize, seed: u64| {
            let dir = parent.path().join(name);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let params =
                LeafParams { capture: CaptureParams { seed, format: ImageFormat::Exr, ..small().capture }, ..small() };
            pool.install(|| write_leaf_capture(&dir, &params, &go_on)).unwrap();
            all_pixels(&dir)
        };
        let one = write("one", 1, 1);
        assert!(one == write("three", 3, 1), "threads matter");
        assert!(one != write("other", 1, 2), "the seed does not matter");
    }

    #[test]
    fn stopping_leaves_nothing_behind_and_a_full_folder_is_left_alone() {
        let parent = tempfile::tempdir().unwrap();
        let dir = parent.path().join("leaf");
        let stopped = write_leaf_capture(&dir, &small(), &|done, _| {
            if done >= 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert!(matches!(stopped, Err(SynthError::Stopped)));
        assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 0);
        fs::create_dir(&dir).unwrap();
        fs::write(dir.join("precious"), b"keep").unwrap();
        assert!(matches!(write_leaf_capture(&dir, &small(), &go_on), Err(SynthError::Capture(_))));
        assert_eq!(fs::read(dir.join("precious")).unwrap(), b"keep");
    }

    /// Light straight through the leaf, seen from either face: the same blade, in mirrored columns.
    #[test]
    fn the_two_transmission_captures_show_one_leaf_turned_over() {
        let parent = tempfile::tempdir().unwrap();
        let straight = DirectionSet::new(vec![Direction::new(0.0, 0.0)]).unwrap();
        let through = |side: Face| {
            let dir = parent.path().join(format!("{side:?}"));
            let (views, lights) = (straight.clone(), straight.clone());
            let species = LeafParams::of(Species::Tree);
            let passage = Passage::Transmission;
            let params = LeafParams {
                capture: CaptureParams { size: 48, views, lights, format: ImageFormat::Exr, ..species.capture.clone() },
                side,
                passage,
                ..species
            };
            write_leaf_capture(&dir, &params, &go_on).unwrap();
            let capture = Capture::open(&dir).unwrap();
            assert_eq!(capture.info().lights.directions()[0].theta_deg, 180.0);
            assert_eq!(capture.info().side, params.capture_side());
            let Pixels::Linear(image) = capture.read(0, 0).unwrap() else { panic!("EXR is linear") };
            image
        };
        let (face, back) = (through(Face::Adaxial), through(Face::Abaxial));
        let apart = |column_of: fn(usize) -> usize| {
            let sum: f32 = (0..48 * 48)
                .map(|texel| {
                    let (row, column) = (texel / 48, texel % 48);
                    (face[3 * texel + 1] - back[3 * (row * 48 + column_of(column)) + 1]).abs()
                })
                .sum();
            sum / face.iter().skip(1).step_by(3).sum::<f32>()
        };
        let (turned, planted) = (apart(|column| 47 - column), apart(|column| column));
        assert!(turned < 0.04 && planted > 2.5 * turned, "{turned} {planted}");
    }
}
