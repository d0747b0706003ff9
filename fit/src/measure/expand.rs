//! Decoding of an asset back into a capture folder, so that anyone can measure the error with an own script, or render
//! a table of any directions.

use crate::error::FitError;
use crate::input::layer_frame::turn_channels;
use crate::measure::image_decoder::{ImageDecoder, Spot};
use crate::monitor::Monitor;
use crate::provenance::Material;
use btf_capture::{CaptureInfo, CaptureWriter, DirectionSet, ImageFormat};
use btf_runtime::{Asset, DecodeOptions, Resident, Spectrum, Sphere, SurfaceSide, ViewedTexel};
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Parameters of [`expand`].
#[derive(Debug, Clone, Default)]
pub struct ExpandParams {
    /// Layer of the asset.
    pub layer: usize,
    /// Components and lobes to decode and, for directions that the asset has not measured, the interpolation rule.
    pub options: DecodeOptions,
    /// Directions of view and light, all in front of the face that is seen; `None` for the asset's own.
    /// For a layer with light and eye on different sides the lights are put behind the surface (180
    /// degrees minus theta).
    pub directions: Option<DirectionSet>,
    /// Format of the images; `None` for exr where the capture was exr, else png.
    pub format: Option<ImageFormat>,
    /// Whether an asset with a spectrum gives colours in exr files, too, in place of its bands.
    pub colours: bool,
}

/// Returns the capture that [`expand`] would write: the conventions as the asset tells them (transfer curve, cosine,
/// scale, side, size), with the directions and the format that `params` ask for.
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
        info.lights = if info.side.is_transmission() { set.behind()? } else { set.clone() };
    }
    // A JPEG would add its own error to the decoded values.
    let own = if info.format == ImageFormat::Exr { ImageFormat::Exr } else { ImageFormat::Png };
    let mut info = info.in_format(params.format.unwrap_or(own));
    if let Some(spectrum) = &asset.spectrum
        && !params.colours
        && info.format == ImageFormat::Exr
    {
        info.wavelengths_nm = spectrum.wavelengths_nm.iter().map(|nm| f64::from(*nm)).collect();
    }
    Ok(info)
}

/// Decodes layer `params.layer` into the capture folder `dir`, which must be empty or absent. A layer of the back is
/// written in the turned-over frame that a camera sees ([`btf_capture::Side`]).
///
/// The 8-bit values of measured directions are those that `psnr_db` is computed from, but for texels that were edited,
/// which are shown as edited. `resident` must be `asset`'s. Parallel over images; memory: about 20 bytes per texel and
/// thread, and one per texel and component.
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
    let spectrum = asset.spectrum.as_ref().filter(|_| !info.wavelengths_nm.is_empty());
    let mut decoder = ImageDecoder::new(asset, resident, params.layer, &params.options);
    if let Some(spectrum) = spectrum {
        decoder = decoder.showing(&spectrum.weights);
    }
    // The writer refuses directions on another side of the surface than the layer's.
    let writer = CaptureWriter::create(dir, info.clone())?;
    let views = Spot::of_set(&layer.views, &info.views, info.side);
    let lights = Spot::of_set(&layer.lights, &info.lights, info.side);
    let (texels, pairs) = (info.texel_count(), info.pair_count());
    let done = AtomicUsize::new(0);
    (0..pairs).into_par_iter().try_for_each(|pair| -> Result<(), FitError> {
        monitor.report("expand", done.fetch_add(1, Ordering::Relaxed), pairs)?;
        let (view, light) = (pair / lights.len(), pair % lights.len());
        let mut image = vec![0.0; texels * decoder.values()];
        decoder.decode_image(&decoder.plan(views[view], lights[light]), &mut image);
        show_edits(asset, resident, params, [views[view], lights[light]], spectrum, &mut image);
        turn_channels(&mut image, info.channels(), info.width, info.side);
        Ok(writer.write(view, light, &image)?)
    })?;
    monitor.check()?;
    writer.finish()?;
    monitor.report("expand", pairs, pairs)?;
    Ok(info)
}

/// Decodes texels that were edited once more, with their edits, as bands of `spectrum` where there is one.
fn show_edits(
    asset: &Asset,
    resident: &Resident,
    params: &ExpandParams,
    [view, light]: [Spot; 2],
    spectrum: Option<&Spectrum>,
    image: &mut [f32],
) {
    let layer = &asset.layers[params.layer];
    let unit = |spot: Spot, sphere: &Sphere, side: SurfaceSide| {
        let [x, y, z] = match spot {
            Spot::Measured(number) => sphere.direction(number as u32),
            Spot::Other(unit) => unit,
        };
        // The layer's directions are on its own side.
        [x, y, if side == SurfaceSide::Back { -z } else { z }]
    };
    let (wo, wi) = (unit(view, &layer.views, layer.view_side), unit(light, &layer.lights, layer.light_side));
    for (texel, _) in asset.edits.texels.iter().enumerate().filter(|(_, edit)| **edit > 0) {
        let viewed = ViewedTexel::new(resident, params.layer as u32, texel as u32, wo, &params.options);
        match spectrum {
            None => image[3 * texel..3 * texel + 3].copy_from_slice(&viewed.light_alone(wi)),
            Some(spectrum) => {
                let bands = image[texel * spectrum.weights.len()..].iter_mut();
                let told = spectrum.bands(viewed.channels_alone(wi).unwrap_or_default());
                bands.zip(told).for_each(|(band, x)| *band = x);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::layer_frame::sides_of_capture;
    use crate::measure::compare::{MeasureParams, measure, measure_images};
    use crate::provenance::{CaptureRecord, FitRecord, MaterialLayer};
    use crate::sample_asset::{number, sample_asset};
    use btf_capture::{Capture, Pixels, Side};
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
            let params = ExpandParams {
                options,
                directions: Some(set.clone()),
                format: Some(ImageFormat::Exr),
                ..ExpandParams::default()
            };
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

    /// Returns the sample asset with its one layer on `side`.
    fn on_side(side: Side) -> Asset {
        let mut asset = sample_asset();
        (asset.layers[0].light_side, asset.layers[0].view_side) = sides_of_capture(side);
        parsed(&asset)
    }

    #[test]
    fn a_layer_of_any_side_is_written_as_a_camera_sees_it() {
        let folder = tempfile::tempdir().unwrap();
        let monitor = Monitor::default();
        for side in Side::ALL {
            let asset = on_side(side);
            let resident = Resident::from_asset(&asset);
            for (name, directions) in [("own", None), ("named", Some(DirectionSet::random(3, 5).unwrap()))] {
                let dir = folder.path().join(format!("{side}-{name}"));
                let params = ExpandParams { directions, ..ExpandParams::default() };
                expand(&asset, &resident, &dir, &params, &monitor).unwrap();
                let capture = Capture::open(&dir).unwrap();
                let info = capture.info();
                assert_eq!(info.side, side);
                // Every texel by the runtime's decoder in the front's frame, the sample turned by hand.
                let (views, lights) = (info.views.units(), info.lights.units());
                let turn = |[x, y, z]: [f32; 3]| if side.is_turned_over() { [-x, y, -z] } else { [x, y, z] };
                let (mut lit, mut off) = (0, 0);
                for (pair, codes) in codes(&capture).iter().enumerate() {
                    let (view, light) = (pair / lights.len(), pair % lights.len());
                    for (at, code) in codes.chunks_exact(3).enumerate() {
                        let (column, row) = (at % 5, at / 5);
                        let front_column = if side.is_turned_over() { 4 - column } else { column };
                        let expected = |texel: usize| {
                            let (wi, wo) = (turn(lights[light]), turn(views[view]));
                            decode(&resident, 0, texel as u32, wi, wo, &params.options)
                                .map(|x| info.encoded8_from_linear(light, x))
                        };
                        let far = |a: [u8; 3]| (0..3).any(|c| a[c].abs_diff(code[c]) > 1);
                        assert!(!far(expected(row * 5 + front_column)), "{side} {name}, column {column}");
                        lit += usize::from(code[0] > 0);
                        // Planted difference: the columns the other way round.
                        off += usize::from(far(expected(row * 5 + 4 - front_column)));
                    }
                }
                assert!(lit > 0 && off > 0, "{side} {name}");
                if name == "own" {
                    let found = measure(&capture, &asset, &resident, &MeasureParams::default(), &monitor).unwrap();
                    assert!(!found.interpolated && found.metrics().psnr_db.is_infinite(), "{side}");
                }
            }
        }
    }

    #[test]
    fn errors_are_shown_where_the_capture_has_them() {
        let folder = tempfile::tempdir().unwrap();
        let monitor = Monitor::default();
        for side in Side::ALL {
            let asset = on_side(side);
            let resident = Resident::from_asset(&asset);
            let dir = folder.path().join(side.to_string());
            let info = expand(&asset, &resident, &dir, &ExpandParams::default(), &monitor).unwrap();
            let capture = Capture::open(&dir).unwrap();
            // One texel of one image of the capture spoilt: column 1 of row 2.
            let read = |view: usize, light: usize| -> Result<Pixels, FitError> {
                let mut pixels = capture.read(view, light)?;
                if let (Pixels::Encoded8(codes), 2, 3) = (&mut pixels, view, light) {
                    codes[(2 * 5 + 1) * 3] ^= 0x80;
                }
                Ok(pixels)
            };
            let found = measure_images(&info, &read, &asset, &resident, &MeasureParams::default(), &monitor).unwrap();
            let wrong = |errors: &[u64]| (0..errors.len()).filter(|at| errors[*at] > 0).collect::<Vec<_>>();
            assert_eq!(wrong(&found.texel_code_error), [11], "{side}");
            assert_eq!(wrong(&found.pair_code_error), [2 * 9 + 3], "{side}");
            // Everywhere else only what 8 bits leave.
            assert!(found.texel_linear_error[11] > 20.0 * found.texel_linear_error[13], "{side}");
        }
    }

    #[test]
    fn directions_on_the_wrong_side_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let asset = on_side(Side::TransmissionFront);
        let behind = DirectionSet::random(3, 5).unwrap().behind().unwrap();
        let params = ExpandParams { directions: Some(behind), ..ExpandParams::default() };
        let dir = folder.path().join("out");
        let error = expand(&asset, &Resident::from_asset(&asset), &dir, &params, &Monitor::default()).unwrap_err();
        assert!(error.to_string().contains("views stand below 90 degrees"), "{error}");
        assert!(!dir.exists());
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
