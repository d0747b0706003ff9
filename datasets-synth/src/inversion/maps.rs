//! Contents of a leaf texel by texel, from the diffuse colours of its captures, as textures that a leaf file takes.
//!
//! Three colours of one side, six of both, tell chlorophyll, carotenoids and brown pigment; everything else is held. The
//! body of `plate-n` is asked for its colour under D65, with exact derivatives. First the colour of the whole leaf is
//! fitted; each texel is then looked for near that leaf, within [`TEXEL_SPREAD`] of it, because carotenoids and brown
//! pigment are alike in blue. A standard error near that spread says that a texel's colour added nothing.

use std::sync::atomic::{AtomicUsize, Ordering};

use btf_capture::Capture;
use btf_models::{LEAF_QUANTITIES, LeafContents, TextureGrid, TextureKind};
use rayon::prelude::*;

use crate::error::SynthError;
use crate::inversion::diffuse_colour::{DiffuseColour, MAX_PAIRS, diffuse_colour, median};
use crate::inversion::forward::{MAX_UNKNOWNS, Unknown, Values};
use crate::inversion::least_squares::{Minimum, Normal, minimum};
use crate::inversion::plates::{PLATE_UNKNOWNS, PlateBand, contents_of, plate_unknowns, values_of};
use crate::optics::colour::{RgbBands, RgbFromSpectrum};
use crate::surface::capture::Progress;

/// Contents that colours tell, chlorophyll, carotenoids and brown pigment, as indices of [`LEAF_QUANTITIES`].
pub const COLOURS_TELL: [usize; 3] = [0, 1, 3];
/// Standard deviations of the whole leaf about the plain one: ug/cm2, ug/cm2, arbitrary units.
const LEAF_SPREAD: [f64; 3] = [40.0, 8.0, 0.2];
/// Standard deviation of a texel's contents about those of the whole leaf, relative to them, and at least.
const TEXEL_SPREAD: f64 = 0.7;
const MIN_TEXEL_SPREAD: [f64; 3] = [5.0, 2.0, 0.3];
/// Standard error of the model's colours: what the coupling with the gloss and the margin of the paper's cone leave open.
const MODEL_ERROR: f64 = 5e-3;
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
    /// Root mean square difference of the colours, linear sRGB.
    pub rmse: f64,
}

/// Finds the contents of a leaf from captures of it: light and eye on one side, on two sides, or one of each. `known`
/// holds what colours do not tell. Captures of the back are turned over, so that textures are the front's.
///
/// Everything in the pictures is taken for leaf. `progress` gets parts of the work: images, then blocks of texels.
///
/// Cost: 48 images a capture, then some 0.1 ms a texel, in parallel on the current pool.
///
/// # Errors
/// Those of reading; [`SynthError::BadParameter`] for captures of different sizes, more than one of a kind, or none;
/// [`SynthError::Stopped`] if `progress` asks for it.
pub fn invert_captures(captures: &[Capture], known: &LeafContents, progress: Progress) -> Result<LeafMaps, SynthError> {
    let bad = |value: &str, allowed: &str| SynthError::BadParameter {
        name: "--capture",
        value: value.to_owned(),
        allowed: allowed.to_owned(),
    };
    let Some(first) = captures.first() else { return Err(bad("missing", "a capture of a leaf")) };
    let size = [first.info().width, first.info().height];
    let mut colours: [Option<DiffuseColour>; 2] = [None, None];
    let blocks = (size[0] * size[1]).div_ceil(TEXELS_AT_ONCE);
    let total = captures.len() * MAX_PAIRS + blocks;
    for (number, capture) in captures.iter().enumerate() {
        let info = capture.info();
        if [info.width, info.height] != size {
            return Err(bad(&info.name, &format!("captures of {} x {} texels, as the first one", size[0], size[1])));
        }
        let side = usize::from(info.side.is_transmission());
        if colours[side].is_some() {
            return Err(bad(&info.name, "one capture with light and eye on one side, one with light from behind"));
        }
        let onwards = |done: usize, _: usize| progress(number * MAX_PAIRS + done, total);
        let mut colour = diffuse_colour(capture, &onwards)?;
        if info.side.is_turned_over() {
            colour.rgb.chunks_exact_mut(size[0]).for_each(<[_]>::reverse);
            colour.errors.chunks_exact_mut(size[0]).for_each(<[_]>::reverse);
        }
        colours[side] = Some(colour);
    }
    let body = BodyColour::new();
    let mean = |of: &dyn Fn(&DiffuseColour) -> &Vec<[f32; 3]>| {
        colours.each_ref().map(|colour| {
            colour.as_ref().map(|colour| {
                let all = of(colour);
                [0, 1, 2].map(|channel| {
                    let mut values: Vec<f32> = all.iter().map(|x| x[channel]).collect();
                    f64::from(median(&mut values))
                })
            })
        })
    };
    let plain = values_of(known);
    let whole = body.fitted(&mean(&|colour| &colour.rgb), &mean(&|colour| &colour.errors), &plain, &LEAF_SPREAD);
    let spread: [f64; 3] =
        std::array::from_fn(|i| (TEXEL_SPREAD * whole.values[COLOURS_TELL[i]]).max(MIN_TEXEL_SPREAD[i]));
    let done = AtomicUsize::new(captures.len() * MAX_PAIRS);
    let texels: Vec<Texel> = (0..size[0] * size[1])
        .into_par_iter()
        .map(|texel| {
            if texel % TEXELS_AT_ONCE == 0 && progress(1 + done.fetch_add(1, Ordering::Relaxed), total).is_break() {
                return Err(SynthError::Stopped);
            }
            let of = |all: &dyn Fn(&DiffuseColour) -> [f32; 3]| {
                colours.each_ref().map(|colour| colour.as_ref().map(|colour| all(colour).map(f64::from)))
            };
            let (rgb, errors) = (of(&|colour| colour.rgb[texel]), of(&|colour| colour.errors[texel]));
            let found = body.fitted(&rgb, &errors, &whole.values, &spread);
            Ok(Texel {
                values: found.values,
                errors: body.standard_errors(&found),
                squares: body.squares(&rgb, &found.values),
            })
        })
        .collect::<Result<_, SynthError>>()?;
    let shares = colours.iter().flatten().count();
    Ok(maps(&texels, size[0], shares, &plain, first.info().size_mm))
}

/// Result of a texel.
struct Texel {
    values: Values,
    /// Standard errors of the contents that are told.
    errors: [f64; 3],
    /// Sum of squared differences of the colours.
    squares: f64,
}

fn maps(texels: &[Texel], width: usize, shares: usize, plain: &Values, size_mm: Option<[f32; 2]>) -> LeafMaps {
    let middle = |of: &dyn Fn(&Texel) -> f64| {
        let mut values: Vec<f32> = texels.iter().map(|texel| of(texel) as f32).collect();
        f64::from(median(&mut values))
    };
    let mut contents = *plain;
    for i in COLOURS_TELL {
        let greatest = texels.iter().map(|texel| texel.values[i]).fold(0.0, f64::max);
        let [least, most] = LEAF_QUANTITIES[i].range;
        contents[i] = middle(&|texel| texel.values[i]).max(greatest / MAX_FACTOR).clamp(least, most);
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
    let squares: f64 = texels.iter().map(|texel| texel.squares).sum();
    LeafMaps {
        contents: contents_of(&contents),
        standard_errors: std::array::from_fn(|i| middle(&|texel| texel.errors[i])),
        pigment: grid(&|texel, i| factor(i, texel.values[COLOURS_TELL[i]])),
        pigment_errors: grid(&|texel, i| {
            if contents[COLOURS_TELL[i]] > 0.0 { factor(i, texel.errors[i]) } else { 0.0 }
        }),
        size_mm,
        rmse: (squares / (3 * shares * texels.len()).max(1) as f64).sqrt(),
    }
}

/// Colours of a side, as far as there is a capture of it: light and eye on one side, on two sides.
type Colours = [Option<[f64; 3]>; 2];

/// Body of `plate-n` that is asked for its colour.
struct BodyColour {
    unknowns: [Unknown; PLATE_UNKNOWNS],
    /// Pile and weights in linear red, green and blue, of each wavelength.
    bands: Vec<(PlateBand, [f64; 3])>,
}

impl BodyColour {
    fn new() -> BodyColour {
        let convert = RgbFromSpectrum::new(RgbBands::Spectral31);
        let bands = convert.wavelengths_nm().iter().zip(convert.weights());
        let band = |(nm, weights): (&f64, &[f64; 3])| (PlateBand::entered(*nm), *weights);
        BodyColour { unknowns: plate_unknowns(), bands: bands.map(band).collect() }
    }

    /// Returns the contents that are likeliest for `colours` with their standard `errors`, if contents vary about
    /// `about` by `spread`.
    fn fitted(&self, colours: &Colours, errors: &Colours, about: &Values, spread: &[f64; 3]) -> Minimum {
        let free = std::array::from_fn(|i| COLOURS_TELL.contains(&i));
        let spans = self.unknowns.map(|unknown| unknown.span());
        minimum(&self.unknowns, &free, *about, |values| {
            let mut normal = Normal::new(PLATE_UNKNOWNS);
            let told = self.colours(values);
            for side in 0..2 {
                let (Some(colour), Some(errors)) = (&colours[side], &errors[side]) else { continue };
                for channel in 0..3 {
                    let error = errors[channel].hypot(MODEL_ERROR);
                    let (value, by) = &told[side][channel];
                    let mut scaled = [0.0; MAX_UNKNOWNS];
                    for i in COLOURS_TELL {
                        scaled[i] = by[i] * spans[i] / error;
                    }
                    normal.add((value - colour[channel]) / error, &scaled);
                }
            }
            for (i, spread) in COLOURS_TELL.into_iter().zip(spread) {
                let mut by = [0.0; MAX_UNKNOWNS];
                by[i] = spans[i] / spread;
                normal.add((values[i] - about[i]) / spread, &by);
            }
            normal.mirrored()
        })
    }

    /// Returns the standard errors of what colours tell where [`BodyColour::fitted`] has ended.
    fn standard_errors(&self, found: &Minimum) -> [f64; 3] {
        let covariance = found.covariance(&std::array::from_fn(|i| COLOURS_TELL.contains(&i)));
        COLOURS_TELL.map(|i| covariance[(i, i)].sqrt() * self.unknowns[i].span())
    }

    /// Returns the colours `[side][channel]` with their derivatives by the unknowns that are told.
    fn colours(&self, values: &Values) -> [[(f64, Values); 3]; 2] {
        let mut colours = [[(0.0, [0.0; MAX_UNKNOWNS]); 3]; 2];
        for (band, weights) in &self.bands {
            let here = band.at(values);
            for side in 0..2 {
                for channel in 0..3 {
                    let (value, by) = &mut colours[side][channel];
                    *value += weights[channel] * here.shares[side];
                    for i in COLOURS_TELL {
                        by[i] += weights[channel] * here.by[side][i];
                    }
                }
            }
        }
        colours
    }

    /// Returns the sum of squared differences between `colours` and those of `values`.
    fn squares(&self, colours: &Colours, values: &Values) -> f64 {
        let told = self.colours(values);
        let sides = colours.iter().zip(&told).filter_map(|(colour, told)| Some((colour.as_ref()?, told)));
        sides.flat_map(|(colour, told)| colour.iter().zip(told).map(|(x, (y, _))| (x - y).powi(2))).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::capture::write_leaf_capture;
    use crate::leaf::params::LeafParams;
    use crate::optics::abm::scatter_table::Passage;
    use crate::optics::plates::body::PlateBody;
    use crate::optics::plates::model::PlateModel;
    use crate::optics::specific_absorption::SpecificAbsorption;
    use crate::surface::capture_params::CaptureParams;
    use btf_capture::{CaptureInfo, DirectionSet, ImageFormat, Side};
    use btf_models::TextureImages;
    use std::ops::ControlFlow;

    fn go_on(_: usize, _: usize) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    #[test]
    fn the_body_has_the_colour_of_the_capture_and_its_derivatives() {
        let body = BodyColour::new();
        let leaf = LeafContents { brown: 0.1, ..LeafContents::default() };
        let colours = body.colours(&values_of(&leaf));
        let plates = PlateBody::new(PlateModel::N, SpecificAbsorption::ProspectD, RgbBands::Spectral31).unwrap();
        let rgb = plates.rgb(&leaf, 1.0);
        for (side, rgb) in [rgb.reflectance, rgb.transmittance].into_iter().enumerate() {
            for channel in 0..3 {
                assert!((colours[side][channel].0 - f64::from(rgb[channel])).abs() < 1e-6);
                for i in COLOURS_TELL {
                    let step = 1e-3 * LEAF_SPREAD[COLOURS_TELL.iter().position(|told| *told == i).unwrap()];
                    let moved = |by: f64| {
                        let mut values = values_of(&leaf);
                        values[i] += by;
                        body.colours(&values)[side][channel].0
                    };
                    let rise = (moved(step) - moved(-step)) / (2.0 * step);
                    let by = colours[side][channel].1[i];
                    assert!((rise - by).abs() < 1e-3 * rise.abs() + 1e-9, "{side} {channel} {i}: {rise} {by}");
                    // Planted difference: the other side's slope is another.
                    assert!(i != 0 || (colours[1 - side][channel].1[i] - rise).abs() > 1e-3 * rise.abs());
                }
            }
        }
    }

    /// Makes a capture of given colours of a 4 x 2 leaf, Lambertian.
    fn lambertian(side: Side, colour: impl Fn(usize) -> [f32; 3]) -> Capture {
        let set = DirectionSet::random(6, 2).unwrap();
        let lights = if side.is_transmission() { set.behind().unwrap() } else { set.clone() };
        let mut info = CaptureInfo::new("leaf", 4, 2, set, lights.clone(), ImageFormat::Exr);
        info.side = side;
        let mut images = Vec::new();
        for _ in 0..6 {
            for wi in lights.units() {
                images.extend((0..8).flat_map(|texel| colour(texel).map(|x| x * wi[2].abs())));
            }
        }
        Capture::from_linear(info, images).unwrap()
    }

    #[test]
    fn backs_are_turned_over_and_spots_of_brown_are_kept() {
        let body = BodyColour::new();
        let of = |brown: f64, side: usize| {
            let leaf = LeafContents { brown, ..LeafContents::default() };
            body.colours(&values_of(&leaf))[side].map(|(value, _)| value as f32)
        };
        // A spot in the upper left corner of the face, upper right of the back.
        let brown = |texel: usize, corner: usize| if texel == corner { 0.5 } else { 0.0 };
        let front = lambertian(Side::Front, |texel| of(brown(texel, 0), 0));
        let through = lambertian(Side::TransmissionFront, |texel| of(brown(texel, 3), 1));
        let back = lambertian(Side::Back, |texel| of(brown(texel, 3), 0));
        for captures in [vec![front.clone()], vec![front.clone(), through], vec![back]] {
            let maps = invert_captures(&captures, &LeafContents::default(), &go_on).unwrap();
            let spot = |texel: usize| f64::from(maps.pigment.values[3 * texel + 2]) * maps.contents.brown;
            // Three colours share a spot out between brown pigment and carotenoids, so that it is told to be there.
            assert!(spot(0) > 0.1 && spot(0) < 0.6, "{}: {}", captures.len(), spot(0));
            assert!((1..8).all(|texel| spot(texel) < 0.25 * spot(0)), "{:?}", maps.pigment.values);
            assert!(maps.rmse < 0.01);
        }
        let stop = |_: usize, _: usize| ControlFlow::Break(());
        assert!(matches!(invert_captures(&[front], &LeafContents::default(), &stop), Err(SynthError::Stopped)));
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
            let maps = invert_captures(&captures, &LeafContents::default(), &go_on).unwrap();
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
        let twice = invert_captures(&[front.clone(), front], &LeafContents::default(), &go_on).unwrap_err().to_string();
        assert!(twice.contains("light from behind"), "{twice}");
        assert!(invert_captures(&[], &LeafContents::default(), &go_on).is_err());
    }
}
