//! Decodes an asset back into a capture folder, so that anyone can measure the error with their own
//! script, or render a table of any directions.

use crate::error::FitError;
use crate::image_decoder::{ImageDecoder, Spot};
use crate::material::Material;
use crate::monitor::Monitor;
use btf_capture::{CaptureInfo, CaptureWriter, Direction, DirectionSet, ImageFormat, Side};
use btf_runtime::{Asset, DecodeOptions, Resident};
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Texels decoded at a time.
const BLOCK_TEXELS: usize = 4096;

/// What [`expand`] should write.
#[derive(Debug, Clone, Default)]
pub struct ExpandParams {
    /// Layer of the asset.
    pub layer: usize,
    /// Components, lobes and, for directions that the asset has not measured, the interpolation rule.
    pub options: DecodeOptions,
    /// Directions of view and light; `None` for the asset's own. For a layer with light and eye on
    /// different sides the lights are put behind the surface (180 degrees minus theta) if all of them
    /// stand in front.
    pub directions: Option<DirectionSet>,
    /// Format of the images; `None` for exr where the capture was exr, else png.
    pub format: Option<ImageFormat>,
}

/// What [`expand`] would write: the capture's conventions as the asset tells them (transfer curve,
/// cosine, scale, side, size), with the directions and the format that `params` ask for.
///
/// # Errors
/// If there is no such layer, or the asset's description names a convention that is not known.
pub fn expand_info(asset: &Asset, params: &ExpandParams) -> Result<CaptureInfo, FitError> {
    if params.layer >= asset.layers.len() {
        return Err(FitError::Params(format!(
            "the asset has no layer {}, its last one is {}; give --layer 0 to {}",
            params.layer,
            asset.layers.len() - 1,
            asset.layers.len() - 1
        )));
    }
    let mut info = Material::from_asset(asset)?.capture_info(asset, params.layer)?;
    info.provenance = match info.provenance.as_str() {
        "" => "decoded by btf-fit expand".to_string(),
        origin => format!("decoded by btf-fit expand; the original: {origin}"),
    };
    if let Some(set) = &params.directions {
        info.views = set.clone();
        info.lights = if is_transmission(info.side) { behind(set)? } else { set.clone() };
    }
    // A JPEG would add its own error to the decoded values.
    let own = if info.format == ImageFormat::Exr { ImageFormat::Exr } else { ImageFormat::Png };
    Ok(info.in_format(params.format.unwrap_or(own)))
}

/// Decodes layer `params.layer` into the capture folder `dir`, which must be empty or absent.
///
/// The 8-bit values of measured directions are those that `psnr_db` is computed from. `resident` must
/// be `asset`'s. Parallel over images; memory: about 20 bytes per texel and thread.
///
/// # Errors
/// As [`expand_info`], or where the folder cannot be written; then nothing is left of it.
pub fn expand(
    asset: &Asset,
    resident: &Resident,
    dir: &Path,
    params: &ExpandParams,
    monitor: &Monitor,
) -> Result<CaptureInfo, FitError> {
    let info = expand_info(asset, params)?;
    let layer = &asset.layers[params.layer];
    let decoder = ImageDecoder::new(asset, resident, params.layer, &params.options);
    // In a layer's frame z is positive on the side that the layer has the light on; a direction on the
    // other side decodes to black.
    let light_z = if is_transmission(info.side) { -1.0 } else { 1.0 };
    let views: Vec<Spot> = info.views.units().into_iter().map(|unit| Spot::find(&layer.views, unit)).collect();
    let lights: Vec<Spot> =
        info.lights.units().into_iter().map(|[x, y, z]| Spot::find(&layer.lights, [x, y, light_z * z])).collect();

    let writer = CaptureWriter::create(dir, info.clone())?;
    let (texels, pairs) = (info.texel_count(), info.pair_count());
    let done = AtomicUsize::new(0);
    (0..pairs).into_par_iter().try_for_each(|pair| -> Result<(), FitError> {
        monitor.report("expand", done.fetch_add(1, Ordering::Relaxed), pairs)?;
        let (view, light) = (pair / lights.len(), pair % lights.len());
        let plan = decoder.plan(views[view], lights[light]);
        let mut image = vec![0.0; texels * 3];
        for (number, out) in image.chunks_mut(BLOCK_TEXELS * 3).enumerate() {
            let first = number * BLOCK_TEXELS;
            decoder.decode(&decoder.block(first..first + out.len() / 3), &plan, out);
        }
        Ok(writer.write(view, light, &image)?)
    })?;
    monitor.check()?;
    writer.finish()?;
    monitor.report("expand", pairs, pairs)?;
    Ok(info)
}

fn is_transmission(side: Side) -> bool {
    matches!(side, Side::TransmissionBack | Side::TransmissionFront)
}

/// The directions behind the surface: those of `set`, mirrored if all of them stand in front.
fn behind(set: &DirectionSet) -> Result<DirectionSet, FitError> {
    if set.directions().iter().any(|direction| direction.theta_deg > 90.0) {
        return Ok(set.clone());
    }
    // Whole millionths of a degree, so that 180 - 12.34 stays 167.66 in the file's name.
    let mirrored = |d: &Direction| Direction::new(((180.0 - d.theta_deg) * 1e6).round() / 1e6, d.phi_deg);
    Ok(DirectionSet::new(set.directions().iter().map(mirrored).collect())?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::{MeasureParams, measure};
    use crate::material::{CaptureRecord, FitRecord, MaterialLayer};
    use crate::sample_asset::{number, sample_asset};
    use btf_capture::{Capture, Pixels};
    use btf_runtime::{Interpolation, decode, pack};

    fn parsed(asset: &Asset) -> Asset {
        Asset::parse(&pack(asset).unwrap()).unwrap()
    }

    fn codes(capture: &Capture) -> Vec<Vec<u8>> {
        let info = capture.info();
        (0..info.pair_count())
            .map(|pair| match capture.read(pair / info.lights.len(), pair % info.lights.len()).unwrap() {
                Pixels::Encoded8(codes) => codes,
                Pixels::Linear(_) => panic!("a png has 8 bits"),
            })
            .collect()
    }

    #[test]
    fn an_expanded_folder_gives_psnr_db_to_any_script_that_compares_files() {
        let folder = tempfile::tempdir().unwrap();
        let record = CaptureRecord {
            transfer: "gamma:2.2".into(),
            scale: 1.5,
            cosine: "excluded".into(),
            provenance: "a test".into(),
            ..CaptureRecord::default()
        };
        let layers = vec![MaterialLayer { capture: record, views: 7, lights: 9 }];
        let material = Material { layers, fit: Some(FitRecord::default()), ..Material::default() };
        let asset = parsed(&Asset { material: material.to_json(), ..sample_asset() });
        let resident = Resident::from_asset(&asset);
        let (params, monitor) = (ExpandParams::default(), Monitor::default());

        // An original that differs from the decoded asset by noise.
        let info = expand_info(&asset, &params).unwrap();
        let original_dir = folder.path().join("original");
        let writer = CaptureWriter::create(&original_dir, info.clone()).unwrap();
        for pair in 0..info.pair_count() {
            let noise: Vec<f32> = (0..info.texel_count() * 3).map(|i| 0.3 + 0.3 * number(i * 1000 + pair)).collect();
            writer.write(pair / 9, pair % 9, &noise).unwrap();
        }
        writer.finish().unwrap();

        let expanded_dir = folder.path().join("expanded");
        let written = expand(&asset, &resident, &expanded_dir, &params, &monitor).unwrap();
        assert_eq!(written.transfer.to_string(), "gamma:2.2");
        let (original, expanded) = (Capture::open(&original_dir).unwrap(), Capture::open(&expanded_dir).unwrap());
        assert_eq!(expanded.info().lights, original.info().lights);
        let by_files: f64 = codes(&original)
            .concat()
            .iter()
            .zip(codes(&expanded).concat())
            .map(|(x, y)| (f64::from(*x) - f64::from(y)).powi(2))
            .sum();
        let samples = (info.pair_count() * info.texel_count() * 3) as f64;
        let psnr = 10.0 * (255.0 * 255.0 * samples / by_files).log10();
        let measured = measure(&original, &asset, &resident, &MeasureParams::default(), &monitor).unwrap();
        assert!(!measured.interpolated);
        assert!((measured.metrics().psnr_db - psnr).abs() < 1e-9, "{} {psnr}", measured.metrics().psnr_db);

        // Planted difference: another number of components writes other files.
        let fewer = ExpandParams { options: DecodeOptions { components: 1, ..DecodeOptions::default() }, ..params };
        let fewer_dir = folder.path().join("fewer");
        expand(&asset, &resident, &fewer_dir, &fewer, &monitor).unwrap();
        assert_ne!(codes(&Capture::open(&fewer_dir).unwrap()), codes(&expanded));
    }

    #[test]
    fn other_directions_hold_what_the_runtime_decodes_there() {
        let folder = tempfile::tempdir().unwrap();
        let asset = parsed(&sample_asset());
        let resident = Resident::from_asset(&asset);
        let set = DirectionSet::random(4, 77).unwrap();
        for interpolation in [Interpolation::Fast, Interpolation::Exact] {
            let options = DecodeOptions { interpolation, ..DecodeOptions::default() };
            let params =
                ExpandParams { options, directions: Some(set.clone()), format: Some(ImageFormat::Exr), layer: 0 };
            let dir = folder.path().join(format!("{interpolation:?}"));
            expand(&asset, &resident, &dir, &params, &Monitor::default()).unwrap();
            let capture = Capture::open(&dir).unwrap();
            let units = set.units();
            for pair in 0..16 {
                let Pixels::Linear(values) = capture.read(pair / 4, pair % 4).unwrap() else { panic!("not linear") };
                for texel in 0..asset.texel_count() {
                    let slow = decode(&resident, 0, texel as u32, units[pair % 4], units[pair / 4], &options);
                    for c in 0..3 {
                        let got = values[texel * 3 + c];
                        // Half precision in the file.
                        assert!((got - slow[c]).abs() <= 1e-4 + 1e-3 * slow[c], "{got} {slow:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_transmission_layer_comes_back_with_its_lights_behind_the_surface() {
        let folder = tempfile::tempdir().unwrap();
        let mut through = sample_asset();
        through.layers[0].light_side = btf_runtime::SurfaceSide::Back;
        let asset = parsed(&through);
        let resident = Resident::from_asset(&asset);
        let front = parsed(&sample_asset());
        for (name, directions) in [("own", None), ("named", Some(DirectionSet::random(3, 5).unwrap()))] {
            let (dir, params) = (folder.path().join(name), ExpandParams { directions, ..ExpandParams::default() });
            let info = expand(&asset, &resident, &dir, &params, &Monitor::default()).unwrap();
            assert!(info.lights.directions().iter().all(|d| d.theta_deg > 90.0));
            let capture = Capture::open(&dir).unwrap();
            assert_eq!(capture.info().side, Side::TransmissionBack);
            assert!(codes(&capture).concat().iter().any(|code| *code > 0), "a light behind is on the layer's side");
            if name == "own" {
                // The same numbers as the front layer that it was made from, lights in mirrored order.
                let front_dir = folder.path().join("front");
                expand(
                    &front,
                    &Resident::from_asset(&front),
                    &front_dir,
                    &ExpandParams::default(),
                    &Monitor::default(),
                )
                .unwrap();
                let (through, front) = (codes(&capture), codes(&Capture::open(&front_dir).unwrap()));
                let mirrored: Vec<_> = (0..63).map(|pair| front[pair / 9 * 9 + 8 - pair % 9].clone()).collect();
                assert_eq!(through, mirrored);
            }
        }
    }

    #[test]
    fn a_layer_that_is_not_there_and_a_folder_that_is_not_empty_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("mine"), b"x").unwrap();
        let asset = parsed(&sample_asset());
        let resident = Resident::from_asset(&asset);
        let run = |layer| {
            let params = ExpandParams { layer, ..ExpandParams::default() };
            expand(&asset, &resident, folder.path(), &params, &Monitor::default()).unwrap_err().to_string()
        };
        assert!(run(1).contains("no layer 1"));
        assert!(run(0).contains("not an empty folder"));
        assert!(folder.path().join("mine").exists());
    }

    #[test]
    fn a_cancelled_expansion_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let asset = parsed(&sample_asset());
        let monitor = Monitor::default();
        monitor.cancel();
        let dir = folder.path().join("out");
        let result = expand(&asset, &Resident::from_asset(&asset), &dir, &ExpandParams::default(), &monitor);
        assert!(matches!(result, Err(FitError::Interrupted)));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
