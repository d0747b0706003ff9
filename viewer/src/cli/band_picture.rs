//! Renders a scene in spectral bands, three at a time as if they were colours, into one EXR file.

use super::progress::with_progress;
use super::report::write_json;
use super::scene_options::PictureArguments;
use btf_capture::write_bands_exr;
use btf_viewer::{Body, RenderParams, Scene, Sequence, ViewerError, luminance, render_sequence};
use serde_json::json;
use std::path::Path;
use std::sync::Arc;

/// Renders the bands of the scene's assets, which must be the same, and writes the picture and its figures. Every light is
/// taken as having the same power at all wavelengths, and every plain surface as grey.
///
/// # Errors
/// [`ViewerError::Usage`] for assets without bands or with different ones, for leaves and volumes, which have colours, and
/// for a picture that is no EXR file; those of rendering and writing.
pub(super) fn write_bands(
    arguments: &PictureArguments,
    scene: &mut Scene,
    params: &RenderParams,
    out: &Path,
) -> Result<(), ViewerError> {
    let wavelengths_nm = common_bands(scene)?;
    if !out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr")) {
        return Err(ViewerError::Usage("--bands writes an EXR file; give --out a name that ends in .exr".into()));
    }
    make_grey(scene);
    let (count, [width, height]) = (wavelengths_nm.len(), params.size.map(|side| side as usize));
    let mut values = vec![0f32; width * height * count];
    let mut frame_ms = 0.0;
    for first in (0..count).step_by(3) {
        let weight = |band: usize, channel: usize| f32::from(u8::from(band == (first + channel).min(count - 1)));
        for asset in &mut scene.assets {
            Arc::make_mut(asset).show_bands(|nm| (0..nm.len()).map(|b| [0, 1, 2].map(|c| weight(b, c))).collect());
        }
        let scene: &Scene = scene;
        with_progress(arguments.render.quiet, |control| {
            render_sequence(scene, params, &Sequence::turntable(1), control, &mut |_, rendered| {
                frame_ms += rendered.report.frame_ms;
                for (texel, rgb) in rendered.picture.radiance.iter().enumerate() {
                    let bands = &mut values[texel * count..(texel + 1) * count];
                    bands[first..(first + 3).min(count)].iter_mut().zip(rgb).for_each(|(band, x)| *band = *x);
                }
                Ok(())
            })
        })?;
    }
    write_bands_exr(out, &values, &wavelengths_nm, [width, height])?;
    match arguments.json.as_deref() {
        path @ Some(_) => write_json(
            path,
            &json!({ "width": width, "height": height, "wavelengths_nm": wavelengths_nm, "frame_ms": frame_ms }),
        ),
        None if arguments.render.quiet => Ok(()),
        None => {
            let (from, to) = (wavelengths_nm[0], wavelengths_nm[count - 1]);
            println!("{}: {width}x{height}, {count} bands from {from} to {to} nm", out.display());
            Ok(())
        }
    }
}

/// Returns the wavelengths of the assets of a scene that has nothing else.
fn common_bands(scene: &Scene) -> Result<Vec<f64>, ViewerError> {
    let refuse = |what: &str| Err(ViewerError::Usage(format!("--bands: {what}")));
    let mut found: Option<Vec<f32>> = None;
    for asset in &scene.assets {
        let Some(spectrum) = asset.spectrum() else {
            return refuse(&format!("{} has colours and no bands; fit a capture in bands", asset.name));
        };
        if found.as_ref().is_some_and(|known| *known != spectrum.wavelengths_nm) {
            return refuse(&format!("{} has other bands than the scene's first asset", asset.name));
        }
        found = Some(spectrum.wavelengths_nm);
    }
    if !scene.leaves.is_empty() || scene.volumes.is_some() {
        return refuse("the scene has leaves or volumes, which have colours; leave them out");
    }
    match found {
        Some(nm) => Ok(nm.into_iter().map(f64::from).collect()),
        None => refuse("the scene has no asset"),
    }
}

/// Makes every light as bright in all channels as it is to the eye, and plain surfaces and tints grey likewise.
fn make_grey(scene: &mut Scene) {
    let grey = |rgb: &mut [f32; 3]| *rgb = [luminance(rgb.map(f64::from)) as f32; 3];
    scene.lights.iter_mut().for_each(|light| grey(&mut light.intensity));
    scene.sun.iter_mut().for_each(|sun| grey(&mut sun.irradiance));
    scene.environment = scene.environment.as_ref().map(|sky| Arc::new(sky.grey()));
    grey(&mut scene.ambient.radiance);
    grey(&mut scene.background);
    for material in &mut scene.materials {
        grey(&mut material.tint);
        grey(&mut material.mirror);
        if let Body::Plain(colour) = &mut material.body {
            grey(&mut colour.reflectance);
            grey(&mut colour.transmittance);
        }
    }
}
