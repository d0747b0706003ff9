//! Everything that is measured of a canopy, with standard errors.

use super::cell::{CanopyCell, Organ};
use super::light::{BATCHES, Counted, Source, Tally, trace, view_direction};
use super::optics::CanopyOptics;
use super::structure::{CanopyStructure, structure};
use crate::error::ViewerError;
use crate::render::control::Control;
use serde::Serialize;

/// Photons at most: places above the cell come from a sequence of 32 bits.
pub const MAX_PHOTONS: u32 = 1 << 30;
/// Numbers that all batches hold at most: 1 GiB.
const MAX_NUMBERS: usize = 1 << 27;
/// Angle from the zenith in degrees up to which suns and eyes may stand.
const MAX_ZENITH_DEG: f64 = 89.0;

/// What is measured.
#[derive(Debug, Clone, PartialEq)]
pub struct CanopyParams {
    /// Photons for each sun, rounded up to whole batches, and rays for each direction of gaps.
    pub photons: u32,
    /// Angles of suns from the zenith in degrees, 0 to 89.
    pub sun_zeniths_deg: Vec<f64>,
    /// Angle of the suns from north (-z) over east (+x) in degrees.
    pub sun_azimuth_deg: f64,
    /// Whether a sky of the same radiance everywhere is measured, too.
    pub sky: bool,
    /// Angles of eyes from the zenith in degrees, -89 to 89, positive on the sun's side.
    pub view_zeniths_deg: Vec<f64>,
    /// Angles in degrees by which the plane of the eyes is turned from the sun's.
    pub view_azimuths_deg: Vec<f64>,
    /// Layers of equal height.
    pub layers: usize,
    /// Whether each leaf's light is told.
    pub leaves: bool,
    /// Seed of everything random.
    pub seed: u32,
}

impl Default for CanopyParams {
    fn default() -> CanopyParams {
        CanopyParams {
            photons: 100_000,
            sun_zeniths_deg: vec![30.0],
            sun_azimuth_deg: 180.0,
            sky: false,
            view_zeniths_deg: (-15..=15).map(|i| f64::from(i) * 5.0).collect(),
            view_azimuths_deg: vec![0.0],
            layers: 10,
            leaves: false,
            seed: 1,
        }
    }
}

/// A number for each band, with its standard error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// Mean.
    pub value: Vec<f64>,
    /// Standard error of the mean, from the scatter of 32 parts of the photons.
    pub standard_error: Vec<f64>,
}

/// Light that leaves of a layer absorb.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LayerLight {
    /// Lower end above the soil in metres.
    pub from_m: f64,
    /// Upper end above the soil in metres.
    pub to_m: f64,
    /// Leaf area in the layer over that of the soil.
    pub leaf_area_index: f64,
    /// Share of the light that comes onto the canopy.
    pub absorbed: Figures,
}

/// Reflectance towards an eye.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ViewLight {
    /// Angle from the zenith in degrees, positive on the sun's side.
    pub zenith_deg: f64,
    /// Angle in degrees by which the plane of the eye is turned from the sun's.
    pub azimuth_deg: f64,
    /// Radiance over that of a white diffuser under the same light; of a sky the hemispherical-directional factor.
    pub reflectance_factor: Figures,
}

/// Light that one leaf absorbs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LeafLight {
    /// Number of the plant in the file's order.
    pub plant: usize,
    /// Number of the leaf among all.
    pub leaf: usize,
    /// Mean height above the soil in metres.
    pub height_m: f64,
    /// Area of one face in square metres.
    pub area_m2: f64,
    /// Mean inclination from the horizontal by area in degrees.
    pub inclination_deg: f64,
    /// Light that a unit of its area absorbs over what comes onto a unit of soil above the canopy, for each band.
    pub absorbed: Vec<f64>,
}

/// Where the light of one sun, or of the sky, goes: shares of what comes onto the canopy.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CanopyLight {
    /// Angle of the sun from the zenith in degrees; none for the sky.
    pub sun_zenith_deg: Option<f64>,
    /// Share that leaves upwards: directional-hemispherical reflectance, of the sky the bihemispherical.
    pub reflectance: Figures,
    /// Share that leaves absorb.
    pub absorbed_by_leaves: Figures,
    /// Share that other organs absorb.
    pub absorbed_by_other: Figures,
    /// Share that the soil absorbs.
    pub absorbed_by_soil: Figures,
    /// Share of photons that were not followed to their end.
    pub lost: Figures,
    /// Layers from the soil up.
    pub layers: Vec<LayerLight>,
    /// Eyes.
    pub views: Vec<ViewLight>,
    /// Leaves, where asked for.
    #[serde(skip)]
    pub leaves: Vec<LeafLight>,
}

/// What was measured of a canopy.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CanopyMeasurement {
    /// Wavelengths of the bands in nanometres.
    pub wavelengths_nm: Vec<f64>,
    /// Photons for each sun.
    pub photons: u32,
    /// Area, angles, gaps.
    pub structure: CanopyStructure,
    /// The suns in their order, then the sky.
    pub light: Vec<CanopyLight>,
}

/// Measures a canopy. Leaves, but for a gloss that they may have, other organs and soil are diffuse; triangles are flat.
///
/// # Errors
/// [`ViewerError::Usage`] for parameters out of range and for more numbers than 1 GiB, [`ViewerError::Interrupted`] if
/// `control` ends it.
///
/// Cost: about `photons x surfaces that a photon meets x (eyes + 1)` rays a sun.
pub fn measure_canopy(
    cell: &CanopyCell,
    optics: &CanopyOptics,
    params: &CanopyParams,
    control: &Control<'_>,
) -> Result<CanopyMeasurement, ViewerError> {
    check(cell, optics, params)?;
    let photons = params.photons.next_multiple_of(BATCHES as u32);
    let structure = structure(cell, photons, params.seed);
    let azimuth_rad = params.sun_azimuth_deg.to_radians() as f32;
    let eyes: Vec<[f64; 2]> = params
        .view_azimuths_deg
        .iter()
        .flat_map(|azimuth_deg| params.view_zeniths_deg.iter().map(|zenith_deg| [*zenith_deg, *azimuth_deg]))
        .collect();
    let counted = Counted {
        cell,
        optics,
        layers: params.layers,
        leaves: params.leaves,
        views: eyes.iter().map(|[zenith, azimuth]| view_direction(azimuth_rad, *zenith, *azimuth)).collect(),
    };
    let sun =
        |zenith_deg: &f64| (Some(*zenith_deg), Source::Sun { zenith_rad: zenith_deg.to_radians() as f32, azimuth_rad });
    let sources = params.sun_zeniths_deg.iter().map(sun).chain(params.sky.then_some((None, Source::Sky)));
    let areas = layer_areas(cell, params.layers);
    let count = params.sun_zeniths_deg.len() + usize::from(params.sky);
    let mut light = Vec::new();
    for (number, (sun_zenith_deg, source)) in sources.enumerate() {
        let seed = params.seed.wrapping_add(number as u32);
        let tallies = trace(&counted, source, photons, seed, control).ok_or(ViewerError::Interrupted)?;
        light.push(light_of(&counted, &tallies, sun_zenith_deg, &eyes, &areas));
        (control.progress)((number + 1) as f32 / count as f32);
    }
    Ok(CanopyMeasurement { wavelengths_nm: optics.wavelengths_nm.clone(), photons, structure, light })
}

fn check(cell: &CanopyCell, optics: &CanopyOptics, params: &CanopyParams) -> Result<(), ViewerError> {
    let refuse = |sentence: String| Err(ViewerError::Usage(sentence));
    if params.sun_zeniths_deg.is_empty() && !params.sky {
        return refuse("there is no light; give suns or a sky".into());
    }
    if let Some(zenith) = params.sun_zeniths_deg.iter().find(|zenith| !(0.0..=MAX_ZENITH_DEG).contains(*zenith)) {
        return refuse(format!("a sun at {zenith} degrees from the zenith; 0 to {MAX_ZENITH_DEG} are allowed"));
    }
    if let Some(zenith) =
        params.view_zeniths_deg.iter().find(|zenith| !(-MAX_ZENITH_DEG..=MAX_ZENITH_DEG).contains(*zenith))
    {
        return refuse(format!(
            "an eye at {zenith} degrees from the zenith; -{MAX_ZENITH_DEG} to {MAX_ZENITH_DEG} are allowed"
        ));
    }
    if ![params.sun_azimuth_deg].iter().chain(&params.view_azimuths_deg).all(|azimuth| azimuth.is_finite()) {
        return refuse("an azimuth is not finite".into());
    }
    if params.photons == 0 || params.photons > MAX_PHOTONS || params.layers == 0 || params.layers > 1000 {
        return refuse(format!("1 to {MAX_PHOTONS} photons and 1 to 1000 layers are allowed"));
    }
    let eyes = params.view_zeniths_deg.len().saturating_mul(params.view_azimuths_deg.len());
    let leaves = if params.leaves { cell.leaves() } else { 0 };
    let numbers = (eyes + leaves + params.layers + 4) * optics.wavelengths_nm.len() * BATCHES;
    if numbers > MAX_NUMBERS {
        return refuse(format!(
            "{eyes} eyes and {leaves} leaves in so many bands need more than 1 GiB; take fewer bands with --bands-nm"
        ));
    }
    Ok(())
}

/// Returns the leaf area index of each layer.
fn layer_areas(cell: &CanopyCell, layers: usize) -> Vec<f64> {
    let mut areas = vec![0.0; layers];
    for triangle in cell.triangles().filter(|triangle| triangle.organ == Organ::Leaf) {
        areas[cell.layer_of(triangle.middle.y, layers)] += triangle.area_m2 / cell.ground_m2();
    }
    areas
}

fn light_of(
    counted: &Counted,
    tallies: &[Tally],
    sun_zenith_deg: Option<f64>,
    eyes: &[[f64; 2]],
    areas: &[f64],
) -> CanopyLight {
    let bands = counted.optics.wavelengths_nm.len();
    // Figures of the number `row` of a tally's rows of bands.
    let figures = |part: fn(&Tally) -> &Vec<f64>, row: usize| {
        figures(bands, |band| tallies.iter().map(|tally| part(tally)[row * bands + band]).collect())
    };
    let layer_m = counted.cell.height_m() / areas.len() as f64;
    let all_layers = |tally: &Tally, band: usize| tally.layers.iter().skip(band).step_by(bands).sum::<f64>();
    CanopyLight {
        sun_zenith_deg,
        reflectance: figures(|tally| &tally.reflected, 0),
        absorbed_by_soil: figures(|tally| &tally.soil, 0),
        absorbed_by_other: figures(|tally| &tally.other, 0),
        absorbed_by_leaves: self::figures(bands, |band| tallies.iter().map(|tally| all_layers(tally, band)).collect()),
        lost: figures(|tally| &tally.lost, 0),
        layers: (0..areas.len())
            .map(|layer| LayerLight {
                from_m: layer as f64 * layer_m,
                to_m: (layer + 1) as f64 * layer_m,
                leaf_area_index: areas[layer],
                absorbed: figures(|tally| &tally.layers, layer),
            })
            .collect(),
        views: (0..eyes.len())
            .map(|eye| ViewLight {
                zenith_deg: eyes[eye][0],
                azimuth_deg: eyes[eye][1],
                reflectance_factor: figures(|tally| &tally.views, eye),
            })
            .collect(),
        leaves: if counted.leaves { leaves_of(counted, tallies) } else { Vec::new() },
    }
}

/// Returns the means over the batches, and their standard errors.
fn figures(bands: usize, of_band: impl Fn(usize) -> Vec<f64>) -> Figures {
    let of = |band: usize| {
        let parts = of_band(band);
        let count = parts.len() as f64;
        let mean = parts.iter().sum::<f64>() / count;
        let squares: f64 = parts.iter().map(|part| (part - mean).powi(2)).sum();
        (mean, (squares / (count * (count - 1.0))).sqrt())
    };
    let (value, standard_error) = (0..bands).map(of).unzip();
    Figures { value, standard_error }
}

fn leaves_of(counted: &Counted, tallies: &[Tally]) -> Vec<LeafLight> {
    let (cell, bands) = (counted.cell, counted.optics.wavelengths_nm.len());
    let mut leaves: Vec<LeafLight> = (0..cell.leaves())
        .map(|leaf| LeafLight {
            plant: cell.plant_of_leaf(leaf as u32),
            leaf,
            height_m: 0.0,
            area_m2: 0.0,
            inclination_deg: 0.0,
            absorbed: vec![0.0; bands],
        })
        .collect();
    for triangle in cell.triangles().filter(|triangle| triangle.organ == Organ::Leaf) {
        let leaf = &mut leaves[triangle.leaf as usize];
        leaf.area_m2 += triangle.area_m2;
        leaf.height_m += triangle.area_m2 * f64::from(triangle.middle.y);
        leaf.inclination_deg += triangle.area_m2 * triangle.inclination_deg();
    }
    for (leaf, light) in leaves.iter_mut().enumerate() {
        let area_m2 = light.area_m2.max(f64::MIN_POSITIVE);
        light.height_m /= area_m2;
        light.inclination_deg /= area_m2;
        for (band, absorbed) in light.absorbed.iter_mut().enumerate() {
            let sum: f64 = tallies.iter().map(|tally| tally.leaves[leaf * bands + band]).sum();
            *absorbed = sum / tallies.len() as f64 * cell.ground_m2() / area_m2;
        }
    }
    leaves
}

#[cfg(test)]
mod tests {
    use super::*;
    use btf_runtime::FaceGloss;

    /// A cell of 0.5 m x 0.5 m and 1 m.
    fn strewn(leaf_area_index: f64, side_m: f32, seed: u64) -> CanopyCell {
        CanopyCell::strewn(leaf_area_index, side_m, [0.5, 1.0, 0.5], seed).unwrap()
    }

    /// A red and an infrared band.
    fn optics() -> CanopyOptics {
        CanopyOptics {
            gloss: None,
            wavelengths_nm: vec![670.0, 800.0],
            leaf: [[vec![0.10, 0.45], vec![0.08, 0.48]], [vec![0.10, 0.45], vec![0.08, 0.48]]],
            other: vec![0.1, 0.4],
            soil: vec![0.15, 0.30],
        }
    }

    fn params() -> CanopyParams {
        CanopyParams { photons: 50_000, sky: true, view_zeniths_deg: vec![-60.0, 0.0, 45.0], ..CanopyParams::default() }
    }

    /// Reflectances of a turbid medium with the leaf area index 3 and the sun at 30 degrees, by an independent Monte Carlo,
    /// `tests/peers/turbid_medium.py`, for each band directional-hemispherical, bihemispherical and towards the eyes of [`params`].
    const TURBID: [[f64; 5]; 2] =
        [[0.04023, 0.04547, 0.03348, 0.04058, 0.04770], [0.44107, 0.48989, 0.44158, 0.40773, 0.47005]];
    /// Directional-hemispherical reflectance of the same by SAIL: `prosail.run_sail` 2.0.5, `factor='DHR'`, with
    /// `lidfa=-0.35, lidfb=-0.15, typelidf=1, hspot=0.01`.
    const SAIL: [f64; 2] = [0.0399, 0.43825];

    /// Returns the same reflectances of a cell.
    fn reflectances(cell: &CanopyCell, params: &CanopyParams) -> [Vec<f64>; 2] {
        let told = measure_canopy(cell, &optics(), params, &Control::SILENT).unwrap();
        let [sun, sky] = &told.light[..] else { panic!("{} lights", told.light.len()) };
        [0, 1].map(|band| {
            let of_views = sun.views.iter().map(|view| view.reflectance_factor.value[band]);
            [sun.reflectance.value[band], sky.reflectance.value[band]].into_iter().chain(of_views).collect()
        })
    }

    /// One level leaf that covers a cell of 1 m x 1 m, over black soil.
    fn sheet() -> CanopyCell {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("sheet.obj");
        std::fs::write(dir.path().join("sheet.mtl"), "newmtl leaf\nKd 0.5 0.5 0.5\n").unwrap();
        let text = "mtllib sheet.mtl\nusemtl leaf\nv -0.5 0.5 -0.5\nv -0.5 0.5 0.5\nv 0.5 0.5 0.5\nv 0.5 0.5 -0.5\nf 1 2 3 4\n";
        std::fs::write(&path, text).unwrap();
        CanopyCell::load(&path, &["leaf".to_owned()], [1.0, 1.0]).unwrap()
    }

    #[test]
    fn a_glossy_leaf_reflects_as_gloss_over_body_and_a_white_canopy_gives_back_all_light() {
        let gloss = FaceGloss::new(1.45, 0.35);
        let black = CanopyOptics { soil: vec![0.0; 2], ..optics() };
        let glossy = black.clone().with_gloss(gloss.clone()).unwrap();
        let params = CanopyParams { photons: 60_000, sun_zeniths_deg: vec![60.0], ..params() };
        let params = CanopyParams { sky: false, view_zeniths_deg: vec![-75.0, -50.0, 0.0, 45.0], ..params };
        let of = |optics: &CanopyOptics| measure_canopy(&sheet(), optics, &params, &Control::SILENT).unwrap();
        let (told, dull) = (of(&glossy), of(&black));
        let direction = |zenith_deg: f64| {
            let (sin, cos) = (zenith_deg.to_radians() as f32).sin_cos();
            [sin, 0.0, cos]
        };
        let albedo = |cosine: f64| f64::from(gloss.albedo(cosine as f32));
        let (sun, normal) = (0.5, [0.0, 0.0, 1.0]);
        for band in 0..2 {
            // The measured reflectance is that along the normal.
            let body = (optics().leaf[0][0][band] - albedo(1.0)) / (1.0 - albedo(1.0));
            let near = |figures: &Figures, wanted: f64| {
                let allowed = 4.0 * figures.standard_error[band] + 1e-3 * wanted;
                assert!((figures.value[band] - wanted).abs() < allowed, "{figures:?} {wanted}");
            };
            let light = &told.light[0];
            near(&light.reflectance, albedo(sun) + (1.0 - albedo(sun)) * body);
            let through = optics().leaf[0][1][band] / (1.0 - albedo(1.0));
            near(&light.absorbed_by_leaves, (1.0 - albedo(sun)) * (1.0 - body - through));
            near(&light.absorbed_by_soil, (1.0 - albedo(sun)) * through);
            for view in &light.views {
                let (wi, wo) = (direction(60.0), direction(view.zenith_deg));
                let cosine = view.zenith_deg.to_radians().cos();
                let coupling = (1.0 - albedo(sun)) * (1.0 - albedo(cosine)) / (1.0 - f64::from(gloss.mean_albedo()));
                let mirrored = f64::from(gloss.value(normal, wo, wi)) / cosine;
                near(&view.reflectance_factor, body * coupling + mirrored);
            }
            // Planted difference: without the gloss an eye opposite the sun sees less.
            let [with, without] = [&told, &dull].map(|told| told.light[0].views[1].reflectance_factor.value[band]);
            assert!(with > 1.2 * without, "{with} {without}");
        }
        let white = CanopyOptics { leaf: [[vec![0.5; 2], vec![0.5; 2]], [vec![0.4; 2], vec![0.6; 2]]], ..optics() };
        let told = measure_canopy(
            &strewn(2.0, 0.02, 2),
            &white.with_gloss(gloss.clone()).unwrap(),
            &CanopyParams { photons: 20_000, view_zeniths_deg: Vec::new(), ..params.clone() },
            &Control::SILENT,
        );
        let light = &told.unwrap().light[0];
        for band in 0..2 {
            assert!(light.absorbed_by_leaves.value[band].abs() < 1e-6, "{light:?}");
            let all = [&light.reflectance, &light.absorbed_by_soil, &light.lost].map(|figures| figures.value[band]);
            let error = light.reflectance.standard_error[band].hypot(light.absorbed_by_soil.standard_error[band]);
            assert!((all.iter().sum::<f64>() - 1.0).abs() < 4.0 * error + 1e-3, "{all:?} {error}");
        }
        // A leaf that reflects less than its gloss is refused.
        let dark = CanopyOptics { leaf: [[vec![0.01; 2], vec![0.0; 2]], [vec![0.01; 2], vec![0.0; 2]]], ..optics() };
        let told = dark.with_gloss(gloss).unwrap_err().to_string();
        assert!(told.contains("670 nm") && told.contains("smaller index"), "{told}");
    }

    #[test]
    fn small_leaves_at_random_reflect_like_a_turbid_medium_and_sail() {
        let told = reflectances(&strewn(3.0, 0.01, 1), &params());
        for band in 0..2 {
            assert_eq!(told[band].len(), TURBID[band].len());
            for (value, wanted) in told[band].iter().zip(TURBID[band]) {
                assert!((value / wanted - 1.0).abs() < 0.02, "{told:?}");
            }
            assert!((told[band][0] / SAIL[band] - 1.0).abs() < 0.02, "{told:?}");
        }
        // Planted difference: a twelfth fewer leaves.
        let fewer = CanopyParams { view_zeniths_deg: vec![], ..params() };
        let told = reflectances(&strewn(2.75, 0.01, 1), &fewer);
        assert!(told.iter().zip(TURBID).any(|(told, wanted)| (told[0] / wanted[0] - 1.0).abs() > 0.02), "{told:?}");
    }

    #[test]
    fn light_goes_somewhere_and_leaves_add_up_to_layers() {
        let cell = strewn(2.0, 0.04, 3);
        let params = CanopyParams { photons: 20_000, leaves: true, layers: 5, view_zeniths_deg: vec![], ..params() };
        let told = measure_canopy(&cell, &optics(), &params, &Control::SILENT).unwrap();
        assert!((told.structure.leaf_area_index - 2.0).abs() < 0.01, "{}", told.structure.leaf_area_index);
        assert!((told.structure.mean_inclination_deg - 57.3).abs() < 3.0);
        for light in &told.light {
            for band in 0..2 {
                let parts = [&light.reflectance, &light.absorbed_by_leaves, &light.absorbed_by_soil, &light.lost];
                let sum: f64 = parts.iter().map(|part| part.value[band]).sum();
                // Photons that are continued by chance keep the mean only.
                assert!((sum - 1.0).abs() < 0.005, "{sum}");
                let of_leaves: f64 = light.leaves.iter().map(|leaf| leaf.absorbed[band] * leaf.area_m2).sum();
                let of_layers: f64 = light.layers.iter().map(|layer| layer.absorbed.value[band]).sum();
                assert!((of_leaves / cell.ground_m2() / of_layers - 1.0).abs() < 1e-9);
                assert_eq!(light.absorbed_by_other.value[band], 0.0);
            }
        }
        assert_eq!(told.light[0].leaves.len(), cell.leaves());
        assert_eq!(cell.leaves(), (2.0f64 * 0.25 / 0.0016).round() as usize);
    }

    #[test]
    fn gaps_of_random_leaves_follow_beers_law() {
        let told = structure(&strewn(2.0, 0.01, 4), 40_000, 7);
        for gap in &told.gaps[..5] {
            assert!((gap.projection - 0.5).abs() < 0.01, "{gap:?}");
            assert!((gap.clumping.unwrap() - 1.0).abs() < 0.03, "{gap:?}");
        }
    }

    #[test]
    fn what_cannot_be_measured_is_refused() {
        let cell = strewn(1.0, 0.1, 5);
        for (params, part) in [
            (CanopyParams { sun_zeniths_deg: vec![], ..CanopyParams::default() }, "no light"),
            (CanopyParams { sun_zeniths_deg: vec![95.0], ..CanopyParams::default() }, "95 degrees"),
            (CanopyParams { view_zeniths_deg: vec![f64::NAN], ..CanopyParams::default() }, "NaN degrees"),
            (CanopyParams { photons: 0, ..CanopyParams::default() }, "photons"),
        ] {
            let told = measure_canopy(&cell, &optics(), &params, &Control::SILENT).unwrap_err().to_string();
            assert!(told.contains(part), "{told}");
        }
        let stop = Control { cancelled: &|| true, ..Control::SILENT };
        let told = measure_canopy(&cell, &optics(), &CanopyParams::default(), &stop);
        assert!(matches!(told, Err(ViewerError::Interrupted)));
    }
}
