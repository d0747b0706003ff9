//! OpenEXR images: linear RGB, half or float.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::image::read::read;
use exr::meta::MetaData;
use exr::prelude::{
    Encoding, Image, Layer, LayerAttributes, ReadChannels, ReadLayers, SpecificChannels, Vec2, WritableImage,
};
use half::f16;

use crate::images::{DecodedImage, ImageFault, Samples, check_size};

/// Largest value that half precision holds; larger ones are written as this.
pub(crate) const MAX_HALF: f32 = 65504.0;

/// Decodes channels R, G and B of the first layer that has them; any sample type, any lossless
/// compression that the format knows.
pub(crate) fn decode(bytes: &[u8], expected: Option<(usize, usize)>) -> Result<DecodedImage, ImageFault> {
    // The header is looked at first, because the reader allocates by it.
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(ImageFault::damaged)?;
    let has = |header: &exr::meta::header::Header, name: &str| {
        header.channels.list.iter().any(|channel| channel.name.eq(name))
    };
    let header = meta
        .headers
        .iter()
        .find(|header| ["R", "G", "B"].iter().all(|name| has(header, name)))
        .ok_or_else(|| ImageFault::damaged("it has no layer with channels R, G and B"))?;
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
    Ok(DecodedImage { width, height, samples: Samples::F32(values) })
}

/// Encodes linear `values`, `[texel, channel]`, as half-precision RGB without compression: five
/// times faster to read than the compressed kinds, and noise hardly compresses. Values beyond
/// half's range are written as its largest.
pub(crate) fn encode(values: &[f32], width: usize, height: usize) -> Result<Vec<u8>, String> {
    // Not `min`, which would turn a NaN into the largest value.
    let half = |value: f32| f16::from_f32(if value > MAX_HALF { MAX_HALF } else { value });
    let channels = SpecificChannels::rgb(|position: Vec2<usize>| {
        let at = (position.y() * width + position.x()) * 3;
        (half(values[at]), half(values[at + 1]), half(values[at + 2]))
    });
    let layer = Layer::new((width, height), LayerAttributes::default(), Encoding::UNCOMPRESSED, channels);
    let mut bytes = Cursor::new(Vec::with_capacity(width * height * 6 + 4096));
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
mod tests {
    use super::*;

    fn decoded(bytes: &[u8]) -> Vec<f32> {
        match decode(bytes, None).unwrap().samples {
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
    fn every_prefix_is_refused_and_no_flipped_byte_panics() {
        let bytes = encode(&[0.5; 6 * 5 * 3], 6, 5).unwrap();
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length], None).is_err(), "prefix of {length}");
        }
        for position in 0..bytes.len() {
            for mask in [0x01, 0x80, 0xFF] {
                let mut damaged = bytes.clone();
                damaged[position] ^= mask;
                // Uncompressed pixels have no checksum, so some flips pass: none may panic.
                let _ = decode(&damaged, None);
            }
        }
    }
}
