//! Tests of `compare.rs`.

use super::*;
use crate::gpu::speed::open_for_test;
use crate::sample_asset::{number, sample_asset_with};
use btf_capture::{CaptureWriter, Direction, DirectionSet, ImageFormat, Transfer};
use btf_capture::{LabConverter, delta_e00};
use btf_runtime::{Coefficients, LobeRole, Residual, ResidualKind, decode, pack};
use std::path::Path;

const WIDTH: usize = 41;
const HEIGHT: usize = 30;

fn sets() -> (DirectionSet, DirectionSet) {
    (DirectionSet::random(4, 3).unwrap(), DirectionSet::random(5, 4).unwrap())
}

/// Returns more texels than one tile of a cluster holds.
fn asset() -> Asset {
    let (views, lights) = sets();
    let asset = sample_asset_with(WIDTH, HEIGHT, &views, &lights, ResidualKind::Root);
    Asset::parse(&pack(&asset).unwrap()).unwrap()
}

/// Returns what the asset decodes to, disturbed.
fn capture(dir: &Path, format: ImageFormat, views: &DirectionSet, lights: &DirectionSet) -> Capture {
    let (asset, options) = (asset(), DecodeOptions::default());
    let resident = Resident::from_asset(&asset);
    let mut info = CaptureInfo::new("sample", WIDTH, HEIGHT, views.clone(), lights.clone(), format);
    info.scale = 1.25;
    if format == ImageFormat::Png {
        info.transfer = Transfer::Gamma(2.2);
    }
    let writer = CaptureWriter::create(dir, info).unwrap();
    for (v, wo) in views.units().into_iter().enumerate() {
        for (l, wi) in lights.units().into_iter().enumerate() {
            let image: Vec<f32> = (0..WIDTH * HEIGHT)
                .flat_map(|texel| {
                    let noise = 0.1 * number(texel * 100 + v * 10 + l).abs();
                    decode(&resident, 0, texel as u32, wi, wo, &options).map(|x| x + noise)
                })
                .collect();
            writer.write(v, l, &image).unwrap();
        }
    }
    writer.finish().unwrap();
    Capture::open(dir).unwrap()
}

/// Returns the linear samples `[pair][texel, channel]` of the capture, and its 8-bit values.
fn samples(capture: &Capture) -> (Vec<Vec<f32>>, Vec<Vec<u8>>) {
    let info = capture.info();
    let coding = info.in_format(ImageFormat::Png);
    let mut all = (Vec::new(), Vec::new());
    for pair in 0..info.pair_count() {
        let (view, light) = (pair / info.lights.len(), pair % info.lights.len());
        let (linear, codes) = match capture.read(view, light).unwrap() {
            Pixels::Encoded8(codes) => {
                let table = info.linear_from_encoded8(light);
                (codes.iter().map(|code| table[usize::from(*code)]).collect::<Vec<_>>(), codes)
            }
            Pixels::Linear(linear) => {
                let codes = linear.iter().map(|x| coding.encoded8_from_linear(light, *x)).collect();
                (linear, codes)
            }
        };
        all.0.push(linear);
        all.1.push(codes);
    }
    all
}

#[test]
fn the_figures_are_those_of_the_plain_definitions() {
    let folder = tempfile::tempdir().unwrap();
    let (views, lights) = sets();
    let (asset, options) = (asset(), DecodeOptions::default());
    let resident = Resident::from_asset(&asset);
    for format in [ImageFormat::Png, ImageFormat::Exr] {
        let capture = capture(&folder.path().join(format.extension()), format, &views, &lights);
        let info = capture.info().in_format(ImageFormat::Png);
        let (linear, codes) = samples(&capture);
        let lab = LabConverter::new(info.transfer);
        let (mut code_error, mut error, mut square, mut peak) = (0.0, 0.0, 0.0, 0.0f64);
        let (mut sum, mut decoded_sum) = (0.0, 0.0);
        let mut texel_error = vec![0.0; WIDTH * HEIGHT];
        let (mut colour, mut colours) = (0.0, 0);
        for pair in 0..20 {
            let (wi, wo) = (lights.units()[pair % 5], views.units()[pair / 5]);
            for texel in 0..WIDTH * HEIGHT {
                let decoded = decode(&resident, 0, texel as u32, wi, wo, &options);
                let at = texel * 3;
                let decoded_codes = decoded.map(|x| info.encoded8_from_linear(pair % 5, x));
                for c in 0..3 {
                    let x = f64::from(linear[pair][at + c]);
                    code_error += (f64::from(decoded_codes[c]) - f64::from(codes[pair][at + c])).powi(2);
                    let e = (f64::from(decoded[c]) - x).powi(2);
                    texel_error[texel] += e;
                    error += e;
                    square += x * x;
                    sum += x;
                    decoded_sum += f64::from(decoded[c]);
                    peak = peak.max(x);
                }
                let original = [codes[pair][at], codes[pair][at + 1], codes[pair][at + 2]];
                colour += delta_e00(lab.lab(original), lab.lab(decoded_codes));
                colours += 1;
            }
        }
        let count = (20 * WIDTH * HEIGHT * 3) as f64;
        let worst = texel_error.iter().copied().fold(0.0, f64::max) / 60.0;
        let found = measure(&capture, &asset, &resident, &MeasureParams::default(), &Monitor::default()).unwrap();
        let metrics = found.metrics();
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-5 * b.abs();
        assert!(near(metrics.psnr_db, 10.0 * (255.0 * 255.0 * count / code_error).log10()), "{metrics:?}");
        assert!(near(metrics.psnr_linear_db, 10.0 * (peak * peak * count / error).log10()), "{metrics:?}");
        assert!(near(metrics.rel_rmse, (error / square).sqrt()), "{metrics:?}");
        assert!(near(metrics.energy_ratio, decoded_sum / sum) && metrics.energy_ratio < 0.99, "{metrics:?}");
        assert!(near(metrics.worst_texel_rmse, worst.sqrt()), "{metrics:?}");
        assert!(near(metrics.delta_e00_mean.unwrap(), colour / f64::from(colours)), "{metrics:?}");
        // Planted difference: the figures of fewer components are others.
        let options = DecodeOptions { components: 0, ..DecodeOptions::default() };
        let fewer = MeasureParams { options, ..MeasureParams::default() };
        let fewer = measure(&capture, &asset, &resident, &fewer, &Monitor::default()).unwrap().metrics();
        assert!(!near(fewer.psnr_db, metrics.psnr_db) && !near(fewer.rel_rmse, metrics.rel_rmse));
        assert!(!near(fewer.delta_e00_mean.unwrap(), metrics.delta_e00_mean.unwrap()));
    }
}

#[test]
fn threads_and_memory_do_not_change_a_bit_of_the_result() {
    let folder = tempfile::tempdir().unwrap();
    let (views, lights) = sets();
    let asset = asset();
    let resident = Resident::from_asset(&asset);
    let capture = capture(&folder.path().join("png"), ImageFormat::Png, &views, &lights);
    let run = |threads: usize, memory_bytes: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let params = MeasureParams { memory_bytes, ..MeasureParams::default() };
        pool.install(|| measure(&capture, &asset, &resident, &params, &Monitor::default()).unwrap())
    };
    let one = run(1, 4_000_000_000);
    assert_eq!(one, run(3, 4_000_000_000));
    assert_eq!(one, run(2, 1));
}

#[test]
fn parts_add_up_to_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let (views, lights) = sets();
    let asset = asset();
    let resident = Resident::from_asset(&asset);
    let capture = capture(&folder.path().join("png"), ImageFormat::Png, &views, &lights);
    let whole = measure(&capture, &asset, &resident, &MeasureParams::default(), &Monitor::default()).unwrap();
    assert_eq!(whole.psnr_of_pairs(0..20), Some(whole.metrics().psnr_db));
    assert_eq!(whole.texel_code_error.iter().sum::<u64>(), whole.sums.code_error);
    let held_back = vec![3, 4, 11];
    let params = MeasureParams { pairs: Some(held_back.clone()), ..MeasureParams::default() };
    let part = measure(&capture, &asset, &resident, &params, &Monitor::default()).unwrap();
    assert_eq!(whole.psnr_of_pairs(held_back), Some(part.metrics().psnr_db));
    assert_ne!(part.metrics().psnr_db, whole.metrics().psnr_db);
    assert_eq!(part.psnr_of_pairs([5]), None);
    let by_view = whole.psnr_by_view();
    assert_eq!((by_view.len(), whole.psnr_by_light().len()), (4, 5));
    assert_eq!(by_view[2], whole.psnr_of_pairs(10..15));
    assert_eq!(whole.psnr_by_light()[1], whole.psnr_of_pairs([1, 6, 11, 16]));
}

#[test]
fn directions_that_were_not_measured_are_interpolated() {
    let folder = tempfile::tempdir().unwrap();
    let (views, _) = sets();
    let lights = DirectionSet::random(3, 50).unwrap();
    let asset = asset();
    let resident = Resident::from_asset(&asset);
    let capture = capture(&folder.path().join("exr"), ImageFormat::Exr, &views, &lights);
    let fast = MeasureParams { options: DecodeOptions::default(), ..MeasureParams::default() };
    let found = measure(&capture, &asset, &resident, &fast, &Monitor::default()).unwrap();
    assert!(found.interpolated);
    // The noise alone: its mean square is a third of 0.1 squared.
    let rmse = (found.sums.linear_error / found.sums.samples as f64).sqrt();
    assert!((rmse - 0.1 / 3f64.sqrt()).abs() < 0.003, "{rmse}");
}

#[test]
fn another_size_or_side_is_refused_in_one_sentence() {
    let (views, lights) = sets();
    let asset = asset();
    let info = CaptureInfo::new("small", 8, 8, views, lights, ImageFormat::Png);
    let read = |_: usize, _: usize| -> Result<Pixels, FitError> { panic!("nothing is read") };
    let resident = Resident::from_asset(&asset);
    let params = MeasureParams::default();
    let error = measure_images(&info, &read, &asset, &resident, &params, &Monitor::default()).unwrap_err();
    assert!(error.to_string().contains("8 x 8 texels and the asset 41 x 30"), "{error}");
    let back = CaptureInfo { side: btf_capture::Side::Back, ..info };
    let message = layer_for_capture(&back, &asset).unwrap_err().to_string();
    assert!(message.contains("side `back` of the capture small") && message.contains("holds `front`"), "{message}");
    let mut through = asset.clone();
    through.layers.push(through.layers[0].clone());
    through.layers[1].light_side = btf_runtime::SurfaceSide::Back;
    for (side, layer) in [(btf_capture::Side::Front, 0), (btf_capture::Side::TransmissionBack, 1)] {
        assert_eq!(layer_for_capture(&CaptureInfo { side, ..back.clone() }, &through).unwrap(), layer);
    }
}

#[test]
fn the_colour_stride_meets_every_light() {
    for (views, lights) in [(81, 81), (1, 81), (151, 151), (3, 1), (64, 64)] {
        let stride = colour_pair_stride(views, lights);
        let picked: Vec<usize> = (0..views * lights).step_by(stride).collect();
        assert!(picked.len() >= (views * lights).min(COLOUR_PAIRS) / 2, "{views} x {lights}: {}", picked.len());
        let met: std::collections::BTreeSet<usize> = picked.iter().map(|pair| pair % lights).collect();
        assert_eq!(met.len(), lights, "{views} x {lights}");
    }
}

/// Measures on `gpu`.
fn measure_on(
    gpu: Option<&FitGpu>,
    capture: &Capture,
    read: &(dyn Fn(usize, usize) -> Result<Pixels, FitError> + Sync),
    asset: &Asset,
    params: &MeasureParams,
) -> Comparison {
    let resident = Resident::from_asset(asset);
    let decoder = ImageDecoder::new(asset, &resident, 0, &params.options);
    let images = CaptureImages::new(capture.info(), read).unwrap();
    measure_decoder(&images, asset, &decoder, params, gpu, &Monitor::default()).unwrap()
}

#[test]
fn an_adapter_finds_the_errors_that_the_cpu_finds() {
    const NO_RESIDUAL: u32 = 99;
    let test = "an_adapter_finds_the_errors_that_the_cpu_finds";
    let Some(products) = open_for_test(test) else { return };
    let gpu = FitGpu::new(products, true, 4096);
    let folder = tempfile::tempdir().unwrap();
    let (views, lights) = sets();
    let capture = capture(&folder.path().join("png"), ImageFormat::Png, &views, &lights);
    let read = |view, light| Ok(capture.read(view, light)?);
    // Batches of seven pairs: more than the four that share what is read, and no multiple of them.
    let memory_bytes = (8 * 7 * 12 * WIDTH * HEIGHT) as u64;
    // Every curve and role, with lobes and without, with many bases, one and none.
    for (kind, role, components, lobes) in [
        (ResidualKind::Root, LobeRole::Base, u32::MAX, u32::MAX),
        (ResidualKind::Root, LobeRole::Guide, u32::MAX, u32::MAX),
        (ResidualKind::Root, LobeRole::Base, 2, 1),
        (ResidualKind::Log, LobeRole::Base, u32::MAX, u32::MAX),
        (ResidualKind::Additive, LobeRole::Base, 4, 0),
        (ResidualKind::Root, LobeRole::Base, 0, u32::MAX),
        (ResidualKind::Root, LobeRole::Base, NO_RESIDUAL, u32::MAX),
    ] {
        let mut asset = sample_asset_with(WIDTH, HEIGHT, &views, &lights, kind);
        asset.layers[0].lobe_role = role;
        if components == NO_RESIDUAL {
            asset.layers[0].residual = None;
        } else {
            repeat_bases(asset.layers[0].residual.as_mut().unwrap());
        }
        let asset = Asset::parse(&pack(&asset).unwrap()).unwrap();
        let options = DecodeOptions { components, lobes, ..DecodeOptions::default() };
        let params = MeasureParams { options, memory_bytes, colour_stride: Some(2), ..MeasureParams::default() };
        let measured = |gpu: Option<&FitGpu>, read: &(dyn Fn(usize, usize) -> Result<Pixels, FitError> + Sync)| {
            measure_on(gpu, &capture, read, &asset, &params)
        };
        let (cpu, on_gpu) = (measured(None, &read), measured(Some(&gpu), &read));
        assert!(are_alike(&cpu, &on_gpu), "{kind:?} {role:?} {components} {lobes}: {:?} {:?}", cpu.sums, on_gpu.sums);
        assert_ne!(cpu.sums.linear_error, on_gpu.sums.linear_error, "the adapter computed");
        // Planted difference: a brighter texel in one image of a later batch.
        let brighter = |view: usize, light: usize| {
            let mut pixels = capture.read(view, light)?;
            if let (Pixels::Encoded8(codes), (3, 2)) = (&mut pixels, (view, light)) {
                codes[3 * (WIDTH * 5 + 7)] ^= 0x80;
            }
            Ok(pixels)
        };
        assert!(!are_alike(&cpu, &measured(Some(&gpu), &brighter)));
    }
    assert!(gpu.in_words().unwrap().starts_with("the error was measured on "));
}

#[test]
fn an_adapter_finds_the_errors_between_measured_directions() {
    let Some(products) = open_for_test("an_adapter_finds_the_errors_between_measured_directions") else { return };
    let gpu = FitGpu::new(products, true, 4096);
    let folder = tempfile::tempdir().unwrap();
    let low = DirectionSet::new([60.0, 85.0, 89.0, 89.9].map(|theta| Direction::new(theta, 40.0)).to_vec()).unwrap();
    let capture = capture(&folder.path().join("low"), ImageFormat::Png, &low, &low);
    let asset = asset();
    let options = DecodeOptions { interpolation: Interpolation::Fast, ..DecodeOptions::default() };
    let memory_bytes = (8 * 7 * 12 * WIDTH * HEIGHT) as u64;
    let params = MeasureParams { options, memory_bytes, ..MeasureParams::default() };
    let read = |view, light| Ok(capture.read(view, light)?);
    let [cpu, on_gpu] = [None, Some(&gpu)].map(|gpu| measure_on(gpu, &capture, &read, &asset, &params));
    assert!(cpu.interpolated && are_alike(&cpu, &on_gpu), "{:?} {:?}", cpu.sums, on_gpu.sums);
    assert!(gpu.in_words().unwrap().starts_with("the error was measured on "), "{:?}", gpu.in_words());
}

/// Gives a residual twice as many components and one: the same ones again, weaker.
fn repeat_bases(residual: &mut Residual) {
    let count = residual.coefficients.len();
    for j in (0..count).chain([0]) {
        let plane = &residual.coefficients[j];
        let codes = plane.codes.iter().rev().copied().collect();
        residual.coefficients.push(Coefficients { step: 0.5 * plane.step, codes });
        residual.bases.push(residual.bases[1 + j].clone());
    }
}

/// Returns whether two comparisons tell the same but for rounding.
fn are_alike(a: &Comparison, b: &Comparison) -> bool {
    let near = |x: f64, y: f64, share: f64| (x - y).abs() <= share * x.abs().max(y.abs()) + 1e-9;
    let codes = |a: &[u64], b: &[u64]| a.iter().zip(b).all(|(x, y)| near(*x as f64, *y as f64, 2e-3));
    let linear = a.texel_linear_error.iter().zip(&b.texel_linear_error).all(|(x, y)| near(*x, *y, 1e-3));
    let (s, t) = (&a.sums, &b.sums);
    let sums = near(s.linear_square, t.linear_square, 1e-5)
        && near(s.linear_sum, t.linear_sum, 1e-5)
        && near(s.decoded_sum, t.decoded_sum, 1e-5)
        && near(s.delta_e00, t.delta_e00, 1e-3)
        && (s.linear_peak, s.colours, s.samples) == (t.linear_peak, t.colours, t.samples);
    codes(&a.texel_code_error, &b.texel_code_error) && codes(&a.pair_code_error, &b.pair_code_error) && linear && sums
}

#[test]
fn images_of_linear_values_are_measured_on_the_cpu() {
    let Some(products) = open_for_test("images_of_linear_values_are_measured_on_the_cpu") else { return };
    let gpu = FitGpu::new(products, true, 4096);
    let folder = tempfile::tempdir().unwrap();
    let (views, lights) = sets();
    let capture = capture(&folder.path().join("exr"), ImageFormat::Exr, &views, &lights);
    let (asset, params) = (asset(), MeasureParams::default());
    let read = |view, light| Ok(capture.read(view, light)?);
    let [cpu, on_gpu] = [None, Some(&gpu)].map(|gpu| measure_on(gpu, &capture, &read, &asset, &params));
    assert_eq!(cpu, on_gpu);
    assert!(gpu.in_words().is_none());
}
