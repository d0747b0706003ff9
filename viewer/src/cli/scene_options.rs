//! The options about lights, camera and exposure, and the scene that follows them.

use super::parse::{Transition, parse_positive, parse_seconds, parse_size, parse_transition};
use super::render_arguments::RenderArguments;
use btf_capture::{Illuminant, Observer, shown_weights};
use btf_viewer::{Ambient, Daylight, DaylightParts, Environment, Outdoors, Scene, ViewerError};
use std::path::PathBuf;
use std::sync::Arc;

/// How a scene is lit, and the picture or window that shows it.
#[derive(clap::Args)]
pub(super) struct PictureArguments {
    /// Number of point lights, of the same brightness together [default: 1, or the scene's own]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(super) lights: Option<u32>,
    /// Light from all around, an equirectangular .exr or .hdr picture; --lights then adds lamps
    #[arg(long, value_name = "FILE")]
    pub(super) environment: Option<PathBuf>,
    /// Sun and clear sky of this moment, as in 2026-06-21T12:00+02:00; --lights then adds lamps
    #[arg(long, value_name = "DATE-TIME", requires = "place", conflicts_with = "environment")]
    pub(super) daylight: Option<String>,
    /// Where: latitude and longitude in degrees, north and east positive, as in 52.5,13.4
    #[arg(long, value_name = "LAT,LON", requires = "daylight", allow_hyphen_values = true)]
    pub(super) place: Option<String>,
    /// Turbidity of the air, 1 (none but the air itself) to 10 (haze) [default: 3]
    #[arg(long, value_name = "T", requires = "daylight")]
    pub(super) turbidity: Option<f64>,
    /// Sun and sky, or one of them
    #[arg(long, value_enum, default_value_t = DaylightParts::Both, requires = "daylight")]
    pub(super) daylight_parts: DaylightParts,
    /// Ambient light with progressive occlusion: one stratified ray per pixel and frame
    #[arg(long)]
    pub(super) ao: bool,
    /// Radiance of the ambient light, where a white surface has 1 [default: 0.4, or the scene's own]; turns --ao on
    #[arg(long, value_name = "R", value_parser = parse_positive)]
    pub(super) ambient: Option<f32>,
    /// What lies farther away does not occlude, scene units [default: half the scene's radius]; turns --ao on
    #[arg(long, value_name = "D", value_parser = parse_positive)]
    pub(super) ao_distance: Option<f32>,
    /// Light under which assets in spectral bands are seen: D65, A, E or a table (CSV) of nm and power [default: D65]
    #[arg(long, value_name = "NAME|FILE")]
    pub(super) illuminant: Option<String>,
    /// Eye or camera that sees assets in spectral bands: 1931, or a table (CSV) of nm and three sensitivities
    /// [default: 1931]
    #[arg(long, value_name = "NAME|FILE")]
    pub(super) observer: Option<String>,
    /// Renders band by band into the .exr of --out, a channel for each band; lights and plain surfaces are grey
    #[arg(long, requires = "headless", conflicts_with_all = ["illuminant", "observer", "turntable", "sequence"])]
    pub(super) bands: bool,
    /// Exposure in stops [default: 0, or the scene's own]
    #[arg(long, value_name = "EV", allow_hyphen_values = true)]
    pub(super) exposure: Option<f32>,
    /// Renders a picture instead of opening a window
    #[arg(long, requires = "out")]
    pub(super) headless: bool,
    /// The picture: .png in 8-bit sRGB, or .exr in linear radiance, without the exposure
    #[arg(long, value_name = "FILE", requires = "headless")]
    pub(super) out: Option<PathBuf>,
    /// Size of the picture or window in pixels
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(super) size: Option<[u32; 2]>,
    /// Renders N pictures around the scene, FILE_000.png and so on
    #[arg(long, value_name = "N", requires = "headless", group = "several",
          value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(super) turntable: Option<u32>,
    /// The moment at which a scene with a wind is seen, seconds [default: 0]
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds, allow_hyphen_values = true)]
    pub(super) time: Option<f64>,
    /// Renders N pictures of the wind, one after the other, FILE_000.png and so on
    #[arg(long, value_name = "N", requires = "headless", conflicts_with = "turntable", group = "several",
          value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(super) sequence: Option<u32>,
    /// Pictures of a sequence in a second [default: 25]
    #[arg(long, value_name = "N", requires = "sequence", value_parser = parse_positive)]
    pub(super) fps: Option<f32>,
    /// Milliseconds that a frame may take: components, lobes and lights are saved until it does
    #[arg(long, value_name = "N", value_parser = parse_positive)]
    pub(super) target_ms: Option<f32>,
    /// Frames to average: each adds a sample per pixel, the first through its middle
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) frames: u32,
    /// Width in pixels of leaves at which meshes pass into the volumes that stand in for them, or auto: where that costs least
    /// time for the same noise, as measured at first [default: 1]
    #[arg(long, value_name = "PIXELS|auto", value_parser = parse_transition)]
    pub(super) lod_transition: Option<Transition>,
    /// Filters noise out of the picture, which needs two frames at least
    #[arg(long, requires = "headless", conflicts_with = "bands")]
    pub(super) denoise: bool,
    /// Writes the motion to the picture before and the depth beside each picture of a sequence or turntable, FILE_000-motion.exr
    /// and so on: channels motion.X and motion.Y in pixels, to the right and downwards, and Z
    #[arg(long, requires_all = ["headless", "several"], conflicts_with = "bands")]
    pub(super) motion: bool,
    /// Writes the figures as JSON; - is stdout
    #[arg(long, value_name = "FILE", requires = "headless")]
    pub(super) json: Option<PathBuf>,
    #[command(flatten)]
    pub(super) render: RenderArguments,
}

/// Makes one of the scene's cameras, counted from 1, the one in use.
///
/// # Errors
/// [`ViewerError::Usage`] where the scene has fewer.
pub(super) fn choose_camera(scene: &mut Scene, number: u32) -> Result<(), ViewerError> {
    if number > 1 {
        scene.camera = *scene.more_cameras.get(number as usize - 2).ok_or_else(|| {
            ViewerError::Usage(format!("--camera {number}: the scene has {}", scene.more_cameras.len() + 1))
        })?;
    }
    Ok(())
}

/// Shows the scene's assets in bands as the options ask for.
///
/// # Errors
/// [`ViewerError::Usage`] where no asset has bands; the errors of tables.
pub(super) fn see_scene(scene: &mut Scene, arguments: &PictureArguments) -> Result<(), ViewerError> {
    if arguments.illuminant.is_none() && arguments.observer.is_none() {
        return Ok(());
    }
    let illuminant = Illuminant::by_name(arguments.illuminant.as_deref().unwrap_or("D65"))?;
    let observer = Observer::by_name(arguments.observer.as_deref().unwrap_or("1931"))?;
    if scene.assets.iter().all(|asset| asset.spectrum().is_none()) {
        return Err(ViewerError::Usage(
            "--illuminant and --observer are for assets in spectral bands, of which the scene has none; fit a capture in \
             bands, such as that of `btf-synth leaf LEAF --bands 31`"
                .into(),
        ));
    }
    for asset in &mut scene.assets {
        Arc::make_mut(asset).show_bands(|nm| shown_weights(nm, &illuminant, &observer));
    }
    Ok(())
}

/// Gives the scene the lights and the exposure that the command line asks for.
///
/// # Errors
/// The errors of [`Environment::load`], [`Daylight::new`] and [`Daylight::sun_and_sky`].
pub(super) fn light_scene(scene: &mut Scene, arguments: &PictureArguments) -> Result<(), ViewerError> {
    if let Some(path) = &arguments.environment {
        scene.surround(Environment::load(path, 1.0)?);
    }
    if let (Some(date_time), Some(place)) = (&arguments.daylight, &arguments.place) {
        let mut daylight = Daylight::new(date_time, place)?;
        daylight.turbidity = arguments.turbidity.unwrap_or(daylight.turbidity);
        let light = daylight.sun_and_sky()?;
        scene.stand_outdoors(Outdoors { daylight, parts: arguments.daylight_parts }, light);
    }
    if let Some(count) = arguments.lights {
        scene.place_lights(count as usize);
    }
    if arguments.ao || arguments.ambient.is_some() || arguments.ao_distance.is_some() {
        let usual = scene.usual_ambient();
        if scene.ambient == Ambient::NONE {
            scene.ambient = usual;
        }
        if let Some(radiance) = arguments.ambient {
            scene.ambient.radiance = [radiance; 3];
        }
        scene.ambient.distance = arguments.ao_distance.unwrap_or(scene.ambient.distance);
    }
    scene.exposure_ev = arguments.exposure.unwrap_or(scene.exposure_ev);
    Ok(())
}
