//! OpenEXR images: linear RGB, half or float, or a reflectance spectrum with one channel per wavelength.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::image::read::read;
use exr::image::{FlatSamples, IntoSample};
use exr::meta::MetaData;
use exr::meta::header::Header;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, Image, Layer, LayerAttributes, ReadChannels, ReadLayers, SpecificChannels, Vec2,
    WritableImage,
};
use half::f16;

use crate::colour::spectrum::wavelength_nm;
use crate::images::bands::Weighing;
use crate::images::decoded::{DecodedImage, ImageFault, Samples, check_samples, check_size};

/// Largest value that half precision holds; larger values are written as this one.
pub(crate) const MAX_HALF: f32 = 65504.0;

/// Decodes channels R, G and B of the first layer that has them, with any sample type and any lossless compression of
/// the format. Where no layer has them, the first layer whose channels are named by wavelengths in nanometres is read
/// as a spectrum of reflectances.
pub(crate) fn decode(
    bytes: &[u8],
    expected: Option<(usize, usize)>,
    weighing: &Weighing,
) -> Result<DecodedImage, ImageFault> {
    // The header is looked at first, because the reader allocates by it.
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(ImageFault::damaged)?;
    let has = |header: &Header, name: &str| header.channels.list.iter().any(|channel| channel.name.eq(name));
    let Some(header) = meta.headers.iter().find(|header| ["R", "G", "B"].iter().all(|name| has(header, name))) else {
        return decode_spectrum(bytes, &meta, expected, weighing);
    };
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    check_size(width, height, expected)?;
    // A damaged file may still trip an assertion inside the decoder: that is an error of the
    // file, too.
    let decoded = catch_unwind(AssertUnwindSafe(|| {
        read()
            .no_deep_data()
            .largest_resolution_level()
            .rgb_channels(
                move |size, _| {
                    // Only the layer whose size was checked is stored.
                    let texels = if (size.width(), size.height()) == (width, height) { width * height } else { 0 };
                    vec![0f32; texels * 3]
                },
                move |values: &mut Vec<f32>, position, (r, g, b): (f32, f32, f32)| {
                    let at = (position.y() * width + position.x()) * 3;
                    if let Some(texel) = values.get_mut(at..at + 3) {
                        texel.copy_from_slice(&[r, g, b]);
                    }
                },
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
    }))
    .map_err(|_| ImageFault::damaged("its contents contradict each other"))?
    .map_err(ImageFault::damaged)?;
    let values = decoded.layer_data.channel_data.pixels;
    if values.len() != width * height * 3 {
        return Err(ImageFault::damaged("its layers contradict each other"));
    }
    Ok(DecodedImage::rgb(width, height, Samples::F32(values)))
}

/// Returns the wavelengths in nanometres that the channels of a layer are named by, in the order of the channels, each
/// with the index of its channel. Other channels are left out.
fn wavelengths_of(header: &Header) -> Vec<(usize, f64)> {
    let names = header.channels.list.iter().enumerate();
    names.filter_map(|(i, channel)| Some((i, wavelength_nm(&channel.name.to_string())?))).collect()
}

fn decode_spectrum(
    bytes: &[u8],
    meta: &MetaData,
    expected: Option<(usize, usize)>,
    weighing: &Weighing,
) -> Result<DecodedImage, ImageFault> {
    let is_spectrum = |header: &&Header| !wavelengths_of(header).is_empty();
    let layer = meta.headers.iter().position(|header| is_spectrum(&header)).ok_or_else(|| {
        ImageFault::damaged("it has no layer with channels R, G and B or channels named by wavelengths in nanometres")
    })?;
    let header = &meta.headers[layer];
    let (width, height) = (header.layer_size.width(), header.layer_size.height());
    check_size(width, height, expected)?;
    let channels = wavelengths_of(header);
    let bands = weighing.of(&channels.iter().map(|&(_, nm)| nm).collect::<Vec<_>>())?;
    // The decoder unpacks every channel of every layer.
    let samples: usize = meta.headers.iter().map(|header| header.channels.list.len() * header.layer_size.area()).sum();
    check_samples(Some(samples))?;
    let decoded = catch_unwind(AssertUnwindSafe(|| {
        read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
    }))
    .map_err(|_| ImageFault::damaged("its contents contradict each other"))?
    .map_err(ImageFault::damaged)?;
    let contradiction = || ImageFault::damaged("its layers contradict each other");
    let read = &decoded.layer_data.get(layer).ok_or_else(contradiction)?.channel_data.list;
    let mut values = vec![0f32; width * height * bands.channels];
    for (band, &(channel, _)) in channels.iter().enumerate() {
        let samples = &read.get(channel).ok_or_else(contradiction)?.sample_data;
        if samples.len() != width * height {
            return Err(ImageFault::damaged("its wavelengths have different numbers of samples"));
        }
        match samples {
            FlatSamples::F16(samples) => bands.add(band, samples.iter().map(|value| value.to_f32()), &mut values),
            FlatSamples::F32(samples) => bands.add(band, samples.iter().copied(), &mut values),
            FlatSamples::U32(_) => return Err(ImageFault::damaged("its wavelengths hold whole numbers")),
        }
    }
    let (channels, wavelengths_nm) = (bands.channels, bands.wavelengths_nm);
    Ok(DecodedImage { width, height, channels, wavelengths_nm, samples: Samples::Computed(values) })
}

/// Encodes linear `values`, `[texel, channel]`, as half-precision RGB without compression, which reads five times
/// faster than compressed files; noise hardly compresses anyway. Values beyond the range of half are written as its
/// largest.
pub(crate) fn encode(values: &[f32], width: usize, height: usize) -> Result<Vec<u8>, String> {
    // Not `min`, which would turn a NaN into the largest value.
    encode_as(values, width, height, |value| f16::from_f32(if value > MAX_HALF { MAX_HALF } else { value }))
}

/// Encodes linear `values`, `[texel, channel]`, as single-precision RGB without compression.
pub(crate) fn encode_single(values: &[f32], width: usize, height: usize) -> Result<Vec<u8>, String> {
    encode_as(values, width, height, |value| value)
}

/// Encodes linear `values`, `[texel, channel]`, as RGB of another type without compression.
fn encode_as<T: IntoSample>(
    values: &[f32],
    width: usize,
    height: usize,
    sample: impl Fn(f32) -> T + Sync,
) -> Result<Vec<u8>, String> {
    let channels = SpecificChannels::rgb(|position: Vec2<usize>| {
        let at = (position.y() * width + position.x()) * 3;
        (sample(values[at]), sample(values[at + 1]), sample(values[at + 2]))
    });
    let layer = Layer::new((width, height), LayerAttributes::default(), Encoding::UNCOMPRESSED, channels);
    let mut bytes = Cursor::new(Vec::with_capacity(width * height * 3 * size_of::<T>() + 4096));
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes.into_inner())
}

/// Encodes linear `values`, `[texel, band]`, in half precision without compression, one channel for each of
/// `wavelengths_nm`, named by it. Values beyond the range of half are written as its largest.
pub(crate) fn encode_bands(
    values: &[f32],
    wavelengths_nm: &[f64],
    width: usize,
    height: usize,
) -> Result<Vec<u8>, String> {
    let half = |value: &f32| f16::from_f32(if *value > MAX_HALF { MAX_HALF } else { *value });
    let channel = |(band, nm): (usize, &f64)| {
        let samples = values[band..].iter().step_by(wavelengths_nm.len()).map(half).collect();
        AnyChannel::new(nm.to_string().as_str(), FlatSamples::F16(samples))
    };
    let channels = AnyChannels::sort(wavelengths_nm.iter().enumerate().map(channel).collect());
    encode_any(channels, Encoding::UNCOMPRESSED, [width, height])
}

/// Encodes `values`, `[texel, channel]`, in single precision with ZIP compression, one channel for each of `names`.
pub(crate) fn encode_channels(values: &[f32], names: &[&str], width: usize, height: usize) -> Result<Vec<u8>, String> {
    let channel = |(number, name): (usize, &&str)| {
        let samples = values[number..].iter().step_by(names.len()).copied().collect();
        AnyChannel::new(*name, FlatSamples::F32(samples))
    };
    let channels = AnyChannels::sort(names.iter().enumerate().map(channel).collect());
    encode_any(channels, Encoding::SMALL_LOSSLESS, [width, height])
}

/// Encodes channels.
fn encode_any(
    channels: AnyChannels<FlatSamples>,
    encoding: Encoding,
    [width, height]: [usize; 2],
) -> Result<Vec<u8>, String> {
    let layer = Layer::new((width, height), LayerAttributes::default(), encoding, channels);
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes.into_inner())
}

/// Encodes one channel, Y, in single precision without compression.
pub(crate) fn encode_map(values: &[f32], width: usize, height: usize) -> Result<Vec<u8>, String> {
    let channels = SpecificChannels::build()
        .with_channel("Y")
        .with_pixel_fn(|position: Vec2<usize>| (values[position.y() * width + position.x()],));
    let layer = Layer::new((width, height), LayerAttributes::default(), Encoding::UNCOMPRESSED, channels);
    let mut bytes = Cursor::new(Vec::with_capacity(width * height * 4 + 4096));
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    fn decoded(bytes: &[u8]) -> Vec<f32> {
        match decode(bytes, None, &Weighing::Colour).unwrap().samples {
            Samples::F32(values) => values,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn values_come_back_within_half_precision_and_negatives_are_kept() {
        let values: Vec<f32> = (0..5 * 4 * 3).map(|i| i as f32 * 0.031 - 0.09).collect();
        let back = decoded(&encode(&values, 5, 4).unwrap());
        for (a, b) in values.iter().zip(&back) {
            assert!((a - b).abs() <= a.abs() / 2048.0 + 1e-7, "{a} {b}");
        }
        assert!(back[0] < 0.0);
        assert_eq!(decoded(&encode(&[1e9, 0.0, 0.0], 1, 1).unwrap())[0], MAX_HALF);
    }

    #[test]
    fn other_compressions_and_sample_types_are_read() {
        use exr::prelude::{Compression, LineOrder};
        for compression in [Compression::RLE, Compression::ZIP1, Compression::ZIP16, Compression::PIZ] {
            let channels = SpecificChannels::rgb(|p: Vec2<usize>| (p.x() as f32, p.y() as f32, 0.25f32));
            let encoding = Encoding { compression, line_order: LineOrder::Increasing, ..Encoding::FAST_LOSSLESS };
            let layer = Layer::new((40, 33), LayerAttributes::default(), encoding, channels);
            let mut bytes = Cursor::new(Vec::new());
            Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
            let back = decoded(&bytes.into_inner());
            assert_eq!(back[(7 * 40 + 5) * 3..][..3], [5.0, 7.0, 0.25], "{compression}");
        }
    }

    #[test]
    fn a_map_keeps_single_precision() {
        use exr::prelude::ReadSpecificChannel;
        let values: Vec<f32> = (0..7 * 4).map(|i| i as f32 * 0.123_456_7 - 1.5).collect();
        let bytes = encode_map(&values, 7, 4).unwrap();
        let back = read()
            .no_deep_data()
            .largest_resolution_level()
            .specific_channels()
            .required("Y")
            .collect_pixels(
                |_, _| vec![0f32; 28],
                |values: &mut Vec<f32>, position, (y,): (f32,)| values[position.y() * 7 + position.x()] = y,
            )
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
            .unwrap();
        assert_eq!(back.layer_data.channel_data.pixels, values);
    }

    #[test]
    fn named_channels_keep_their_names_and_single_precision() {
        let values: Vec<f32> = (0..9 * 20 * 2).map(|i| i as f32 * 0.123_456_7 - 1.5).collect();
        // A file sorts its channels by their names.
        let bytes = encode_channels(&values, &["motion.X", "Z"], 9, 20).unwrap();
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(Cursor::new(bytes))
            .unwrap();
        let channels = &image.layer_data.channel_data.list;
        assert_eq!(channels.len(), 2);
        for (channel, (name, number)) in channels.iter().zip([("Z", 1), ("motion.X", 0)]) {
            assert!(channel.name.eq(name), "{}", channel.name);
            let FlatSamples::F32(samples) = &channel.sample_data else { panic!("{name} is not in single precision") };
            assert!(samples.iter().eq(values[number..].iter().step_by(2)), "{name}");
        }
    }

    /// Returns an image of 4 x 3 texels with one channel for each name, of `value(texel, channel)`.
    pub(crate) fn spectral(names: &[&str], value: impl Fn(usize, usize) -> f32) -> Vec<u8> {
        let channel = |(i, name): (usize, &&str)| {
            let values: Vec<f32> = (0..12).map(|texel| value(texel, i)).collect();
            // Both sample types occur in one file.
            let half = || FlatSamples::F16(values.iter().map(|&value| f16::from_f32(value)).collect());
            AnyChannel::new(*name, if i % 2 == 0 { half() } else { FlatSamples::F32(values) })
        };
        let channels = AnyChannels::sort(names.iter().enumerate().map(channel).collect());
        let layer = Layer::new((4, 3), LayerAttributes::default(), Encoding::FAST_LOSSLESS, channels);
        let mut bytes = Cursor::new(Vec::new());
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    fn computed(bytes: &[u8]) -> Vec<f32> {
        match decode(bytes, Some((4, 3)), &Weighing::Colour).unwrap().samples {
            Samples::Computed(values) => values,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn channels_named_by_wavelengths_become_linear_srgb_with_white_at_one() {
        let names = ["400", "450nm", "500", "550.0", "600", "650", "1000"];
        let grey = computed(&spectral(&names, |texel, _| texel as f32 * 0.25));
        for (i, value) in grey.iter().enumerate() {
            // Above 1 nothing is clamped.
            assert!((value - (i / 3) as f32 * 0.25).abs() < 1e-3, "{i}: {value}");
        }
        // Only 600 and 650 nm reflect: red.
        let red = computed(&spectral(&names, |_, channel| f32::from(u8::from((4..6).contains(&channel)))));
        assert!(red[0] > 0.8 && red[1] < 0.3 && red[2] < 0.1, "{:?}", &red[..3]);
        // A channel that is no wavelength does not count.
        let masked = computed(&spectral(&["400", "700", "mask"], |_, channel| [0.5, 0.5, 9.0][channel]));
        assert!(masked.iter().all(|value| (value - 0.5).abs() < 1e-3));
    }

    #[test]
    fn spectra_that_contradict_themselves_are_refused() {
        for names in [["400", "400nm", "500"], ["X", "Y", "Z"]] {
            match decode(&spectral(&names, |_, _| 0.5), None, &Weighing::Colour) {
                Err(ImageFault::Damaged(reason)) => assert!(reason.contains("wavelength"), "{reason}"),
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn every_prefix_is_refused_and_no_flipped_byte_panics() {
        for bytes in [encode(&[0.5; 6 * 5 * 3], 6, 5).unwrap(), spectral(&["450", "550", "650"], |_, _| 0.5)] {
            for length in 0..bytes.len() {
                assert!(decode(&bytes[..length], None, &Weighing::Colour).is_err(), "prefix of {length}");
            }
            for position in 0..bytes.len() {
                for mask in [0x01, 0x80, 0xFF] {
                    let mut damaged = bytes.clone();
                    damaged[position] ^= mask;
                    // Uncompressed pixels have no checksum, so some flips pass: none may panic.
                    let _ = decode(&damaged, None, &Weighing::Colour);
                }
            }
        }
    }
}
