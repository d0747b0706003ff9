//! Contents of a leaf texel by texel, from the diffuse colours of its captures, or their bands, as textures that a leaf file
//! takes.
//!
//! Three colours of one side, six of both, tell chlorophyll, carotenoids and brown pigment; everything else is held. Bands
//! tell the whole leaf's other contents, too. The body of `plate-n` is asked for what it shows, with exact derivatives. First
//! the whole leaf is fitted; each texel is then looked for near that leaf, within [`TEXEL_SPREAD`] of it, because carotenoids
//! and brown pigment are alike in blue. A standard error near that spread says that a texel's colour added nothing.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use btf_capture::Capture;
use btf_models::{LEAF_QUANTITIES, LeafContents, TextureGrid, TextureKind};
use rayon::prelude::*;

use crate::error::SynthError;
use crate::inversion::body_shares::{BodyShares, Sought};
use crate::inversion::diffuse_colour::{DiffuseColour, MAX_PAIRS, diffuse_colour, median};
use crate::inversion::forward::Values;
use crate::inversion::plates::{PLATE_UNKNOWNS, contents_of, values_of};
use crate::optics::specific_absorption::LEAF_TABLE_NM;
use crate::surface::capture::Progress;

/// Contents that colours tell, chlorophyll, carotenoids and brown pigment, as indices of [`LEAF_QUANTITIES`].
pub const COLOURS_TELL: [usize; 3] = [0, 1, 3];
/// Standard deviations of the whole leaf about the plain one: ug/cm2, ug/cm2, arbitrary units.
const LEAF_SPREAD: [f64; 3] = [40.0, 8.0, 0.2];
/// Standard deviation of a texel's contents about those of the whole leaf, relative to them, and at least.
const TEXEL_SPREAD: f64 = 0.7;
const MIN_TEXEL_SPREAD: [f64; 3] = [5.0, 2.0, 0.3];
/// Greatest factor that textures hold.
const MAX_FACTOR: f64 = 8.0;
/// Texels between two looks for whether to stop.
const TEXELS_AT_ONCE: usize = 1024;

/// Contents of a leaf and how they vary over it.
#[derive(Debug, Clone)]
pub struct LeafMaps {
    /// Contents of the whole leaf: the medians over its texels, more where a texel holds over eight times as much, within
    /// what leaf files take; and what was held.
    pub contents: LeafContents,
    /// Standard errors of chlorophyll, carotenoids and brown pigment of a texel, the medians over the leaf.
    pub standard_errors: [f64; 3],
    /// Factors on chlorophyll, carotenoids and brown pigment of [`LeafMaps::contents`].
    pub pigment: TextureGrid,
    /// Standard errors of those factors.
    pub pigment_errors: TextureGrid,
    /// Width and height of the leaf in millimetres, where a capture says it.
    pub size_mm: Option<[f32; 2]>,
    /// Contents of the whole leaf that bands told beside those, as indices of [`LEAF_QUANTITIES`], with their standard errors.
    pub beside: Vec<(usize, f64)>,
    /// Bands that the contents were found from; 0 for colours.
    pub bands: usize,
    /// Root mean square difference of the colours, linear sRGB, or of the bands.
    pub rmse: f64,
}

/// Finds the contents of a leaf from captures of it: light and eye on one side, on two sides, or one of each. `known`
/// has what is not told, among it the quantities `held`, indices of [`LEAF_QUANTITIES`], also where bands would tell them.
/// Captures of the back are turned over, so that textures are the front's.
///
/// Where all captures have the same bands, those within the table of plates tell the contents: those of the whole leaf all
/// that are not held, those of a texel what textures vary. Else colours do. Everything in the pictures is taken for leaf.
/// `progress` gets parts of the work: images, then blocks of texels.
///
/// Cost: 48 images a capture, then some 0.1 ms a texel, and in bands as much for every three of them, in parallel on the
/// current pool.
///
/// # Errors
/// Those of reading; [`SynthError::BadParameter`] for captures of different sizes, more than one of a kind, or none;
/// [`SynthError::Stopped`] if `progress` asks for it.
pub fn invert_captures(
    captures: &[Capture],
    known: &LeafContents,
    held: &[usize],
    progress: Progress,
) -> Result<LeafMaps, SynthError> {
    let Some(first) = captures.first() else { return Err(bad("missing", "a capture of a leaf")) };
    let width = first.info().width;
    let texel_count = first.info().texel_count();
    let bands = common_bands(captures);
    let total = captures.len() * MAX_PAIRS + texel_count.div_ceil(TEXELS_AT_ONCE);
    let colours = colours_of(captures, bands.as_deref(), &|done| progress(done, total))?;
    let body = match &bands {
        Some(bands) => BodyShares::bands(&bands.iter().map(|at| first.info().wavelengths_nm[*at]).collect::<Vec<_>>()),
        None => BodyShares::colours(),
    };
    let told_beside = |i: usize| bands.is_some() && i < PLATE_UNKNOWNS && !held.contains(&i);
    let medians = colours.each_ref().map(|colour| colour.as_ref().map(DiffuseColour::medians));
    let of_leaf = |which: usize| medians.each_ref().map(|medians| medians.as_ref().map(|of| &of[which][..]));
    let mut sought = Sought {
        free: std::array::from_fn(|i| COLOURS_TELL.contains(&i) || told_beside(i)),
        about: values_of(known),
        spread: std::array::from_fn(|i| body.unknowns().get(i).map_or(1.0, |unknown| unknown.spread)),
    };
    COLOURS_TELL.iter().zip(LEAF_SPREAD).for_each(|(i, spread)| sought.spread[*i] = spread);
    let whole = body.fitted(&of_leaf(0), &of_leaf(1), &sought);
    let errors = body.standard_errors(&whole, &sought.free);
    let beside = (0..PLATE_UNKNOWNS).filter(|i| sought.free[*i] && !COLOURS_TELL.contains(i)).map(|i| (i, errors[i]));
    let beside = beside.collect();

    sought = Sought { free: std::array::from_fn(|i| COLOURS_TELL.contains(&i)), about: whole.values, ..sought };
    for (i, least) in COLOURS_TELL.into_iter().zip(MIN_TEXEL_SPREAD) {
        sought.spread[i] = (TEXEL_SPREAD * whole.values[i]).max(least);
    }
    let done = AtomicUsize::new(captures.len() * MAX_PAIRS);
    let texels: Vec<Texel> = (0..texel_count)
        .into_par_iter()
        .map(|texel| {
            if texel % TEXELS_AT_ONCE == 0 && progress(1 + done.fetch_add(1, Ordering::Relaxed), total).is_break() {
                return Err(SynthError::Stopped);
            }
            let seen = colours.each_ref().map(|colour| colour.as_ref().map(|colour| colour.value(texel)));
            let errors = colours.each_ref().map(|colour| colour.as_ref().map(|colour| colour.error(texel)));
            let found = body.fitted(&seen, &errors, &sought);
            let errors = body.standard_errors(&found, &sought.free);
            let squares = body.squares(&seen, &found.values);
            Ok(Texel { values: found.values, errors: COLOURS_TELL.map(|i| errors[i]), squares })
        })
        .collect::<Result<_, SynthError>>()?;
    let samples = colours.iter().flatten().count() * body.channels() * texel_count;
    let squares: f64 = texels.iter().map(|texel| texel.squares).sum();
    let rmse = (squares / samples.max(1) as f64).sqrt();
    let bands = bands.map_or(0, |bands| bands.len());
    Ok(LeafMaps { beside, bands, rmse, ..maps(&texels, width, &whole.values, first.info().size_mm) })
}

fn bad(value: &str, allowed: &str) -> SynthError {
    SynthError::BadParameter { name: "--capture", value: value.to_owned(), allowed: allowed.to_owned() }
}

/// Returns the bands within the table of plates, if all captures have the same and these are more than three.
fn common_bands(captures: &[Capture]) -> Option<Vec<usize>> {
    let nm = &captures.first()?.info().wavelengths_nm;
    let within = |at: &usize| (LEAF_TABLE_NM[0]..=LEAF_TABLE_NM[1]).contains(&nm[*at]);
    let bands: Vec<usize> = (0..nm.len()).filter(within).collect();
    let same = captures.iter().all(|capture| capture.info().wavelengths_nm == *nm);
    (same && bands.len() > 3).then_some(bands)
}

/// Returns the diffuse colour of each side that there is a capture of, in the frame of the front.
fn colours_of(
    captures: &[Capture],
    bands: Option<&[usize]>,
    progress: &(dyn Fn(usize) -> ControlFlow<()> + Sync),
) -> Result<[Option<DiffuseColour>; 2], SynthError> {
    let size = [captures[0].info().width, captures[0].info().height];
    let mut colours: [Option<DiffuseColour>; 2] = [None, None];
    for (number, capture) in captures.iter().enumerate() {
        let info = capture.info();
        if [info.width, info.height] != size {
            return Err(bad(&info.name, &format!("captures of {} x {} texels, as the first one", size[0], size[1])));
        }
        let side = usize::from(info.side.is_transmission());
        if colours[side].is_some() {
            return Err(bad(&info.name, "one capture with light and eye on one side, one with light from behind"));
        }
        let onwards = |done: usize, _: usize| progress(number * MAX_PAIRS + done);
        let colour = diffuse_colour(capture, bands, &onwards)?;
        colours[side] = Some(if info.side.is_turned_over() { colour.turned_over(size[0]) } else { colour });
    }
    Ok(colours)
}

/// Result of a texel.
struct Texel {
    values: Values,
    /// Standard errors of the contents that are told.
    errors: [f64; 3],
    /// Sum of squared differences of the colours.
    squares: f64,
}

fn maps(texels: &[Texel], width: usize, leaf: &Values, size_mm: Option<[f32; 2]>) -> LeafMaps {
    let middle = |of: &dyn Fn(&Texel) -> f64| {
        let mut values: Vec<f32> = texels.iter().map(|texel| of(texel) as f32).collect();
        f64::from(median(&mut values))
    };
    let mut contents = *leaf;
    for i in COLOURS_TELL {
        let greatest = texels.iter().map(|texel| texel.values[i]).fold(0.0, f64::max);
        contents[i] = middle(&|texel| texel.values[i]).max(greatest / MAX_FACTOR);
    }
    for (value, quantity) in contents.iter_mut().zip(&LEAF_QUANTITIES[..PLATE_UNKNOWNS]) {
        *value = value.clamp(quantity.range[0], quantity.range[1]);
    }
    // What is nowhere has no factor.
    let factor =
        |i: usize, value: f64| if contents[COLOURS_TELL[i]] > 0.0 { value / contents[COLOURS_TELL[i]] } else { 1.0 };
    let grid = |of: &dyn Fn(&Texel, usize) -> f64| {
        let values: Vec<f32> =
            texels.iter().flat_map(|texel| [0, 1, 2].map(|i| of(texel, i).min(MAX_FACTOR) as f32)).collect();
        // White is the greatest factor, so that 16 bits are used.
        let most = values.iter().copied().fold(1.0f32, f32::max);
        TextureGrid { kind: TextureKind::Pigment, width, range: [0.0, f64::from(most)], values }
    };
    LeafMaps {
        contents: contents_of(&contents),
        standard_errors: std::array::from_fn(|i| middle(&|texel| texel.errors[i])),
        pigment: grid(&|texel, i| factor(i, texel.values[COLOURS_TELL[i]])),
        pigment_errors: grid(&|texel, i| {
            if contents[COLOURS_TELL[i]] > 0.0 { factor(i, texel.errors[i]) } else { 0.0 }
        }),
        size_mm,
        beside: Vec::new(),
        bands: 0,
        rmse: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::capture::write_leaf_capture;
    use crate::leaf::params::LeafParams;
    use crate::optics::abm::scatter_table::Passage;
    use crate::surface::capture_params::CaptureParams;
    use btf_capture::{CaptureInfo, DirectionSet, ImageFormat, Side};
    use btf_models::TextureImages;

    fn go_on(_: usize, _: usize) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// Makes a capture of given colours of a 4 x 2 leaf, Lambertian; of given bands where there are wavelengths.
    fn lambertian(side: Side, wavelengths_nm: &[f64], colour: impl Fn(usize) -> Vec<f32>) -> Capture {
        let set = DirectionSet::random(6, 2).unwrap();
        let lights = if side.is_transmission() { set.behind().unwrap() } else { set.clone() };
        let mut info = CaptureInfo::new("leaf", 4, 2, set, lights.clone(), ImageFormat::Exr);
        info.side = side;
        info.wavelengths_nm = wavelengths_nm.to_vec();
        let mut images = Vec::new();
        for _ in 0..6 {
            for wi in lights.units() {
                let lit = std::iter::repeat(wi[2].abs());
                images.extend((0..8).flat_map(&colour).zip(lit.clone()).map(|(x, cosine)| x * cosine));
            }
        }
        Capture::from_linear(info, images).unwrap()
    }

    #[test]
    fn backs_are_turned_over_and_spots_of_brown_are_kept() {
        let body = BodyShares::colours();
        let of = |brown: f64, side: usize| {
            let leaf = LeafContents { brown, ..LeafContents::default() };
            let told = body.at(&values_of(&leaf));
            told[side].iter().map(|(value, _)| *value as f32).collect()
        };
        // A spot in the upper left corner of the face, upper right of the back.
        let brown = |texel: usize, corner: usize| if texel == corner { 0.5 } else { 0.0 };
        let front = lambertian(Side::Front, &[], |texel| of(brown(texel, 0), 0));
        let through = lambertian(Side::TransmissionFront, &[], |texel| of(brown(texel, 3), 1));
        let back = lambertian(Side::Back, &[], |texel| of(brown(texel, 3), 0));
        for captures in [vec![front.clone()], vec![front.clone(), through], vec![back]] {
            let maps = invert_captures(&captures, &LeafContents::default(), &[], &go_on).unwrap();
            let spot = |texel: usize| f64::from(maps.pigment.values[3 * texel + 2]) * maps.contents.brown;
            // Three colours share a spot out between brown pigment and carotenoids, so that it is told to be there.
            assert!(spot(0) > 0.1 && spot(0) < 0.6, "{}: {}", captures.len(), spot(0));
            assert!((1..8).all(|texel| spot(texel) < 0.25 * spot(0)), "{:?}", maps.pigment.values);
            assert!(maps.rmse < 0.01);
        }
        let stop = |_: usize, _: usize| ControlFlow::Break(());
        assert!(matches!(invert_captures(&[front], &LeafContents::default(), &[], &stop), Err(SynthError::Stopped)));
    }

    #[test]
    fn bands_tell_what_colours_do_not() {
        let nm: Vec<f64> = (0..=40).map(|i| 400.0 + 50.0 * f64::from(i)).collect();
        let body = BodyShares::bands(&nm);
        let leaf = LeafContents {
            anthocyanin_ug_per_cm2: 4.0,
            water_cm: 0.02,
            dry_matter_g_per_cm2: 0.008,
            structure: 1.9,
            ..LeafContents::default()
        };
        // Texel 5 has half the chlorophyll.
        let of = |texel: usize, side: usize| {
            let mut leaf = leaf;
            leaf.chlorophyll_ug_per_cm2 *= if texel == 5 { 0.5 } else { 1.0 };
            body.at(&values_of(&leaf))[side].iter().map(|(value, _)| *value as f32).collect()
        };
        let front = lambertian(Side::Front, &nm, |texel| of(texel, 0));
        let through = lambertian(Side::TransmissionBack, &nm, |texel| of(texel, 1));
        let plain = LeafContents::default();
        let maps = invert_captures(&[front.clone(), through.clone()], &plain, &[], &go_on).unwrap();
        assert_eq!((maps.bands, maps.beside.len()), (41, 4));
        let found = values_of(&maps.contents);
        for (i, error) in &maps.beside {
            let (truth, spread) = (values_of(&leaf)[*i], body.unknowns()[*i].spread);
            assert!((found[*i] - truth).abs() < 0.3 * spread && *error < 0.5 * spread, "{i}: {found:?} {error}");
        }
        let chlorophyll =
            |texel: usize| f64::from(maps.pigment.values[3 * texel]) * maps.contents.chlorophyll_ug_per_cm2;
        assert!((chlorophyll(5) / chlorophyll(0) - 0.5).abs() < 0.05, "{} {}", chlorophyll(5), chlorophyll(0));
        assert!(maps.rmse < 2e-3, "{}", maps.rmse);
        // What is held stays, and the others follow: water takes no place of dry matter's.
        let held = invert_captures(std::slice::from_ref(&front), &plain, &[4], &go_on).unwrap();
        assert_eq!((held.contents.water_cm, held.beside.len()), (plain.water_cm, 3));
        assert!(held.rmse > 3.0 * maps.rmse, "{} {}", held.rmse, maps.rmse);
        // With a capture of other bands, or of colours, beside it colours tell.
        let other = lambertian(Side::TransmissionBack, &nm[1..], |texel| of(texel, 1).split_off(1));
        assert_eq!(invert_captures(&[front, other], &plain, &[], &go_on).unwrap().bands, 0);
    }

    #[test]
    fn a_photographed_leafs_pigments_are_found_where_they_are() {
        let parent = tempfile::tempdir().unwrap();
        let contents =
            LeafContents { chlorophyll_ug_per_cm2: 28.0, carotenoid_ug_per_cm2: 6.0, ..LeafContents::default() };
        // The left half has half the chlorophyll.
        let size = 32;
        let halves: Vec<f32> =
            (0..size * size).flat_map(|i| [if i % size < size / 2 { 0.5 } else { 1.0 }, 1.0, 1.0]).collect();
        let grid = TextureGrid { kind: TextureKind::Pigment, width: size, range: [0.0, 2.0], values: halves };
        let flat = |kind: TextureKind, value: f32| TextureGrid {
            kind,
            width: 4,
            range: kind.default_range(),
            values: vec![value; 16 * kind.channels()],
        };
        let textures = parent.path().join("textures");
        let grids = [
            grid,
            flat(TextureKind::Thickness, 1.0),
            flat(TextureKind::Height, 0.0),
            flat(TextureKind::HeightAbaxial, 0.0),
        ];
        btf_models::write_textures(&textures, [0.0, 0.0, 20.0, 20.0], 20.0, "", &grids).unwrap();
        let set = DirectionSet::random(8, 5).unwrap();
        let mut params = LeafParams { contents, ..LeafParams::default() };
        params.look.images = TextureImages::read(&textures).unwrap();
        params.capture = CaptureParams {
            size,
            views: set.clone(),
            lights: set,
            format: ImageFormat::Exr,
            ..CaptureParams::new(20.0)
        };
        let make = |passage: Passage, name: &str| {
            let dir = parent.path().join(name);
            write_leaf_capture(&dir, &LeafParams { passage, ..params.clone() }, &go_on).unwrap();
            Capture::open(&dir).unwrap()
        };
        let (front, through) = (make(Passage::Reflection, "front"), make(Passage::Transmission, "through"));
        for captures in [vec![front.clone()], vec![front.clone(), through]] {
            let maps = invert_captures(&captures, &LeafContents::default(), &[], &go_on).unwrap();
            let chlorophyll = |x: usize| {
                let factor = f64::from(maps.pigment.values[3 * (16 * size + x)]);
                factor * maps.contents.chlorophyll_ug_per_cm2
            };
            let (left, right) = (chlorophyll(6), chlorophyll(25));
            assert!(
                (right - 28.0).abs() < 5.0 && (left - 14.0).abs() < 3.0,
                "{} captures: {left} {right}",
                captures.len()
            );
            assert!(maps.rmse < 0.01, "{}", maps.rmse);
            assert!(maps.standard_errors[0] > 0.1 && maps.standard_errors[0] < 8.0, "{:?}", maps.standard_errors);
            assert_eq!(maps.size_mm, Some([20.0, 20.0]));
        }
        // Two captures of one kind, or none, are refused.
        let twice =
            invert_captures(&[front.clone(), front], &LeafContents::default(), &[], &go_on).unwrap_err().to_string();
        assert!(twice.contains("light from behind"), "{twice}");
        assert!(invert_captures(&[], &LeafContents::default(), &[], &go_on).is_err());
    }
}
