//! TIFF images: bands or colours of 8 and 16 bits, half, single or double precision; texel by texel or plane by plane, in
//! strips or tiles, or with a page for each band; plain or compressed by PackBits, LZW or deflate.
//!
//! The crate tiff reads such files, too, and is used for the tests. Its version 0.11 fails at some strips of LZW and at
//! tiles of planes that reach over the edge, and leaves out what follows R, G and B.

use crate::images::bands::{BandReading, WeighedBands};
use crate::images::decoded::{
    DecodedImage, ImageFault, Samples, check_samples, check_size, little_endian, three_channels,
};
use crate::images::tiff_chunk::{Compression, Predictor, Rows, unpacked};
use crate::images::tiff_directory::{Page, pages, tag};
use crate::images::{gdal_metadata, wavelengths};

/// Largest side of a tile in texels.
const MAX_TILE_SIDE: u64 = 1 << 16;

/// Photometric interpretations that are read: grey from white to black and from black to white, and RGB.
const WHITE_IS_ZERO: u64 = 0;
const BLACK_IS_ZERO: u64 = 1;
const RGB: u64 = 2;

/// Sample formats that are read.
const WHOLE: u64 = 1;
const FLOAT: u64 = 3;

/// Planar configuration of samples that are stored plane by plane.
const PLANAR: u64 = 2;

/// Order of bits in a byte, from the lowest, that is not read.
const LOWEST_BIT_FIRST: u64 = 2;

/// Bits of a page's kind that say that it is a smaller version or a mask of another.
const REDUCED_OR_MASK: u64 = 0b101;

/// What all pages of an image have in common.
#[derive(Debug, PartialEq)]
struct Layout {
    width: usize,
    height: usize,
    samples: usize,
    bits: u64,
    /// [`WHOLE`], [`FLOAT`] or another one.
    format: u64,
}

impl Layout {
    fn of(page: &Page) -> Result<Layout, ImageFault> {
        let number = |tag| page.number(tag).map_err(ImageFault::damaged);
        let must = |tag| Ok(number(tag)?.ok_or_else(|| ImageFault::damaged(format!("it has no tag {tag}")))? as usize);
        let equal = |tag, or| {
            let numbers = page.numbers(tag).map_err(ImageFault::damaged)?;
            if numbers.windows(2).any(|pair| pair[0] != pair[1]) {
                return Err(ImageFault::Unfit("has samples of several types; write all as one type".into()));
            }
            Ok(numbers.first().copied().unwrap_or(or))
        };
        Ok(Layout {
            width: must(tag::WIDTH)?,
            height: must(tag::LENGTH)?,
            samples: number(tag::SAMPLES_PER_PIXEL)?.unwrap_or(1) as usize,
            bits: equal(tag::BITS_PER_SAMPLE, 1)?,
            format: equal(tag::SAMPLE_FORMAT, WHOLE)?,
        })
    }

    /// Checks that samples are of a type that is read.
    fn check(&self) -> Result<(), ImageFault> {
        if matches!((self.format, self.bits), (WHOLE, 8 | 16) | (FLOAT, 16 | 32 | 64)) {
            return Ok(());
        }
        let kind = match self.format {
            WHOLE => "whole numbers",
            2 => "whole numbers with a sign",
            FLOAT => "floats",
            _ => "another type",
        };
        Err(ImageFault::Unfit(format!(
            "has samples of {} bits ({kind}); write whole numbers without a sign of 8 or 16 bits, or floats",
            self.bits
        )))
    }

    /// Returns the number of samples of a page.
    fn page_samples(&self) -> Result<usize, ImageFault> {
        check_samples((self.width * self.height).checked_mul(self.samples))
    }
}

/// How a page is stored.
struct Storage {
    compression: Compression,
    predictor: Predictor,
    is_planar: bool,
    /// Whether numbers go from white to black.
    is_inverted: bool,
    /// Texels of a row and rows of a tile; `None` for strips.
    tile: Option<[usize; 2]>,
    rows_a_strip: usize,
    /// Place and size in bytes of each strip or tile.
    chunks: Vec<(usize, usize)>,
}

impl Storage {
    /// Returns how a page of an image of `pages` pages is stored, in a file of `file_bytes` bytes. Its strips or tiles
    /// lie within the file, which may hold the samples that the image claims.
    fn of(page: &Page, layout: &Layout, pages: usize, file_bytes: usize) -> Result<Storage, ImageFault> {
        let number = |tag| page.number(tag).map_err(ImageFault::damaged);
        let unfit = |reason: String| Err(ImageFault::Unfit(reason));
        let photometric = match number(tag::PHOTOMETRIC)? {
            Some(found @ (RGB | BLACK_IS_ZERO)) => found,
            Some(WHITE_IS_ZERO) if layout.format == WHOLE => WHITE_IS_ZERO,
            _ => return unfit("has colours that are neither RGB nor grey from black; write it so".into()),
        };
        let compression = number(tag::COMPRESSION)?.unwrap_or(1);
        let Some(compression) = Compression::of(compression) else {
            return unfit(format!("has compression {compression}; write it with deflate, LZW or none"));
        };
        let predictor = match Predictor::of(number(tag::PREDICTOR)?.unwrap_or(1)) {
            Some(Predictor::FloatingPoint) if layout.format != FLOAT => None,
            found => found,
        };
        let Some(predictor) = predictor else { return unfit("has an unknown predictor; write it without one".into()) };
        if number(tag::FILL_ORDER)? == Some(LOWEST_BIT_FIRST) {
            return unfit("has the lowest bits first; write it with the highest first".into());
        }
        let lists = |strips, tiles| {
            let found = page.numbers(strips)?;
            if found.is_empty() { page.numbers(tiles) } else { Ok(found) }
        };
        let offsets = lists(tag::STRIP_OFFSETS, tag::TILE_OFFSETS).map_err(ImageFault::damaged)?;
        let counts = lists(tag::STRIP_BYTE_COUNTS, tag::TILE_BYTE_COUNTS).map_err(ImageFault::damaged)?;
        if counts.contains(&0) {
            return unfit("leaves strips or tiles out; write them all".into());
        }
        let within = |(at, count): (&u64, &u64)| {
            at.checked_add(*count).filter(|end| *end <= file_bytes as u64).map(|_| (*at as usize, *count as usize))
        };
        let chunks: Option<Vec<_>> = offsets.iter().zip(&counts).map(within).collect();
        let tile = match [number(tag::TILE_WIDTH)?, number(tag::TILE_LENGTH)?] {
            [None, None] => None,
            sides => {
                let allowed = |side: Option<u64>| side.filter(|side| (1..=MAX_TILE_SIDE).contains(side));
                let sides = allowed(sides[0]).zip(allowed(sides[1]));
                let (width, height) = sides.ok_or_else(|| ImageFault::damaged("its tiles are no tiles"))?;
                Some([width as usize, height as usize])
            }
        };
        let rows_a_strip = number(tag::ROWS_PER_STRIP)?.map_or(layout.height, |rows| rows as usize);
        let storage = Storage {
            compression,
            predictor,
            is_planar: number(tag::PLANAR_CONFIGURATION)? == Some(PLANAR),
            is_inverted: photometric == WHITE_IS_ZERO,
            tile,
            rows_a_strip: rows_a_strip.clamp(1, layout.height),
            chunks: chunks.unwrap_or_default(),
        };
        let claimed = check_samples(layout.page_samples()?.checked_mul(pages))?;
        if claimed > file_bytes.saturating_mul(compression.max_inflation()) / (layout.bits / 8) as usize {
            return Err(ImageFault::damaged(format!("it claims {claimed} samples in {file_bytes} bytes")));
        }
        let [across, down] = storage.grid(layout);
        let wanted = across * down * if storage.is_planar { layout.samples } else { 1 };
        if storage.chunks.len() != wanted || counts.len() != wanted {
            return Err(ImageFault::damaged("its strips lie outside of the file, or some are missing"));
        }
        Ok(storage)
    }

    /// Returns the texels of a row and the rows of a strip or tile.
    fn sides(&self, layout: &Layout) -> [usize; 2] {
        self.tile.unwrap_or([layout.width, self.rows_a_strip])
    }

    /// Returns how many strips or tiles a plane has along its rows and columns.
    fn grid(&self, layout: &Layout) -> [usize; 2] {
        let [width, height] = self.sides(layout);
        [layout.width.div_ceil(width), layout.height.div_ceil(height)]
    }
}

/// An image whose pages are checked and not decoded yet.
struct Image<'a> {
    bytes: &'a [u8],
    is_big_endian: bool,
    layout: Layout,
    /// Either one page, or pages of one sample.
    pages: Vec<&'a Page<'a>>,
    /// Number that stands where nothing was measured.
    ignored: Option<f64>,
}

/// A part of a row of the image that a strip or tile holds.
struct Line<'a> {
    /// Index of its first texel in the image.
    at: usize,
    texels: usize,
    /// Index of its first sample among those of a texel.
    first: usize,
    /// Samples that it has of a texel.
    count: usize,
    /// Whether its numbers go from white to black.
    is_inverted: bool,
    /// Bytes of the numbers, which may be more than those of the texels.
    bytes: &'a [u8],
}

impl Image<'_> {
    /// Unpacks the strips or tiles of all pages one after the other and gives each of their lines to `take`.
    fn read(&self, mut take: impl FnMut(Line)) -> Result<(), ImageFault> {
        let Layout { width, height, samples, bits, .. } = self.layout;
        for (place, page) in self.pages.iter().enumerate() {
            let page = Storage::of(page, &self.layout, self.pages.len(), self.bytes.len())?;
            let ([chunk_width, chunk_height], [across, down]) = (page.sides(&self.layout), page.grid(&self.layout));
            let count = if page.is_planar { 1 } else { samples };
            let rows = Rows { width: chunk_width, count, size: (bits / 8) as usize, is_big_endian: self.is_big_endian };
            for (index, (at, length)) in page.chunks.iter().enumerate() {
                let (left, top) = (index % across * chunk_width, index / across % down * chunk_height);
                // What lies beyond the image's lower edge need not be there.
                let lines = chunk_height.min(height - top);
                let packed = &self.bytes[*at..][..*length];
                let bytes = unpacked(packed, page.compression, page.predictor, rows, lines)
                    .ok_or_else(|| ImageFault::damaged(format!("its strip or tile {index} is cut or damaged")))?;
                for (line, bytes) in bytes.chunks_exact(rows.bytes()).enumerate() {
                    take(Line {
                        at: (top + line) * width + left,
                        texels: chunk_width.min(width - left),
                        first: place + index / (across * down),
                        count,
                        is_inverted: page.is_inverted,
                        bytes,
                    });
                }
            }
        }
        Ok(())
    }

    /// Returns number `at` of a line.
    fn number<const N: usize>(&self, line: &Line, at: usize) -> [u8; N] {
        little_endian(line.bytes, at, self.is_big_endian)
    }

    /// Returns a float of a line as it is, and in single precision.
    fn float(&self, line: &Line, at: usize) -> (f64, f32) {
        match self.layout.bits {
            16 => {
                let number = half::f16::from_le_bytes(self.number(line, at));
                (number.to_f64(), number.to_f32())
            }
            32 => {
                let number = f32::from_le_bytes(self.number(line, at));
                (f64::from(number), number)
            }
            _ => {
                let number = f64::from_le_bytes(self.number(line, at));
                (number, number as f32)
            }
        }
    }

    /// Returns the image as bands of wavelengths in nanometres in the file's order, weighed.
    fn bands(&self, bands: WeighedBands) -> Result<DecodedImage, ImageFault> {
        let Layout { width, height, bits, format, .. } = self.layout;
        let mut values = vec![0f32; width * height * bands.channels];
        self.read(|line| {
            let texels = &mut values[line.at * bands.channels..][..line.texels * bands.channels];
            for sample in 0..line.count {
                let shares = (0..line.texels).map(|texel| {
                    let at = texel * line.count + sample;
                    let (number, share) = match (format, bits) {
                        (WHOLE, 8) => (f64::from(line.bytes[at]), f32::from(line.bytes[at]) / f32::from(u8::MAX)),
                        (WHOLE, _) => {
                            let number = u16::from_le_bytes(self.number(&line, at));
                            (f64::from(number), f32::from(number) / f32::from(u16::MAX))
                        }
                        _ => self.float(&line, at),
                    };
                    match line.is_inverted {
                        _ if self.is_ignored(number, share) => 0.0,
                        true => 1.0 - share,
                        false => share,
                    }
                });
                bands.add(line.first + sample, shares, texels);
            }
        })?;
        let (channels, wavelengths_nm) = (bands.channels, bands.wavelengths_nm);
        Ok(DecodedImage { width, height, channels, wavelengths_nm, samples: Samples::Computed(values) })
    }

    /// Returns whether a number, which is `single` in single precision, stands where nothing was measured.
    fn is_ignored(&self, number: f64, single: f32) -> bool {
        let Some(ignored) = self.ignored else { return false };
        // In single precision, the text of a tag and the number of a file are seldom the same double.
        let is_single = self.layout.format == FLOAT && single == ignored as f32;
        number == ignored || is_single || (number.is_nan() && ignored.is_nan())
    }

    /// Returns the image as colours, grey three times and without alpha.
    fn colours(&self) -> Result<DecodedImage, ImageFault> {
        let Layout { width, height, samples: count, bits, format } = self.layout;
        let samples = match (format, bits) {
            (WHOLE, 8) => {
                let of = |line: &Line, at: usize| if line.is_inverted { !line.bytes[at] } else { line.bytes[at] };
                Samples::U8(three_channels(self.gathered(of)?, count))
            }
            (WHOLE, _) => {
                let of = |line: &Line, at: usize| {
                    let number = u16::from_le_bytes(self.number(line, at));
                    if line.is_inverted { !number } else { number }
                };
                Samples::U16(three_channels(self.gathered(of)?, count))
            }
            _ => Samples::F32(three_channels(self.gathered(|line: &Line, at| self.float(line, at).1)?, count)),
        };
        Ok(DecodedImage::rgb(width, height, samples))
    }

    /// Returns the samples texel by texel. `of` reads a number of a line.
    fn gathered<T: Copy + Default>(&self, of: impl Fn(&Line, usize) -> T) -> Result<Vec<T>, ImageFault> {
        let Layout { width, height, samples: count, .. } = self.layout;
        let mut gathered = vec![T::default(); width * height * count];
        self.read(|line| {
            let texels = gathered[line.at * count..].chunks_exact_mut(count).take(line.texels);
            for (texel, samples) in texels.enumerate() {
                for sample in 0..line.count {
                    samples[line.first + sample] = of(&line, texel * line.count + sample);
                }
            }
        })?;
        Ok(gathered)
    }
}

/// Decodes an image. It has bands where their wavelengths are told, by `capture.toml` or by the file. Else three samples
/// a texel are RGB, and so are four where the file says RGB or alpha; one is grey.
pub(crate) fn decode(
    bytes: &[u8],
    expected: Option<(usize, usize)>,
    reading: BandReading,
) -> Result<DecodedImage, ImageFault> {
    let pages = pages(bytes).map_err(ImageFault::damaged)?;
    let first = &pages[0];
    let layout = Layout::of(first)?;
    check_size(layout.width, layout.height, expected)?;
    if is_reduced_or_mask(first) {
        let reason = "has a smaller image or a mask as its first page; write the image itself first";
        return Err(ImageFault::Unfit(reason.into()));
    }
    let used = used_pages(&pages, &layout);
    let count = layout.samples.saturating_mul(used.len());
    let of_file = || match first.text(tag::GDAL_METADATA) {
        Some(text) => gdal_metadata::wavelengths_of(&text, count),
        None => Ok(None),
    };
    let bands = match wavelengths::of_bands(count, reading.told_nm, of_file)? {
        Some(nm) => Some(reading.weighing.of(&nm)?),
        None if used.len() == 1 && is_coloured(first, &layout)? => None,
        None => return Err(wavelengths::unknown(count)),
    };
    layout.check()?;
    // All are checked before values are allocated, and read again, because their lists may be long.
    used.iter().try_for_each(|page| Storage::of(page, &layout, used.len(), bytes.len()).map(drop))?;
    let image = Image {
        bytes,
        is_big_endian: first.is_big_endian,
        pages: used,
        ignored: first.text(tag::GDAL_NODATA).and_then(|text| text.trim().parse().ok()),
        layout,
    };
    match bands {
        Some(bands) => image.bands(bands),
        None => image.colours(),
    }
}

/// Returns the pages that hold the image: the first, and where it has one sample a texel all that are like it.
fn used_pages<'a>(pages: &'a [Page<'a>], layout: &Layout) -> Vec<&'a Page<'a>> {
    let is_like = |page: &Page| !is_reduced_or_mask(page) && Layout::of(page).is_ok_and(|other| other == *layout);
    let more = pages[1..].iter().filter(|page| layout.samples == 1 && is_like(page));
    pages[..1].iter().chain(more).collect()
}

fn is_reduced_or_mask(page: &Page) -> bool {
    page.number(tag::NEW_SUBFILE_TYPE).ok().flatten().is_some_and(|kind| kind & REDUCED_OR_MASK != 0)
}

/// Returns whether the samples of a page are grey or RGB without wavelengths, with or without alpha.
fn is_coloured(page: &Page, layout: &Layout) -> Result<bool, ImageFault> {
    // Associated and unassociated.
    let extra = page.numbers(tag::EXTRA_SAMPLES).map_err(ImageFault::damaged)?;
    let has_alpha = extra.iter().any(|kind| matches!(kind, 1 | 2));
    let is_rgb = page.number(tag::PHOTOMETRIC).map_err(ImageFault::damaged)? == Some(RGB);
    Ok(match layout.samples {
        1 | 3 => true,
        2 => has_alpha,
        4 => has_alpha || is_rgb,
        _ => false,
    })
}

#[cfg(test)]
#[path = "../../tests/support/tiff_writer.rs"]
mod tiff_writer;

#[cfg(test)]
mod tests {
    use super::tiff_writer::{Page as Written, Style};
    use super::*;
    use crate::images::bands::Weighing;
    use crate::images::tiff_directory::MAX_NUMBERS;
    use std::io::Cursor;
    use tiff::encoder::colortype::ColorType;
    use tiff::encoder::{Compression as Packed, DeflateLevel, Predictor as Predicted, TiffEncoder};
    use tiff::tags::{PhotometricInterpretation, SampleFormat};

    const NM: [f64; 5] = [650.0, 450.0, 550.0, 1050.0, 850.0];
    const TOLD: BandReading = BandReading { weighing: &Weighing::Bands, told_nm: &NM };
    const UNTOLD: BandReading = BandReading { told_nm: &[], ..TOLD };
    const SIZE: Option<(usize, usize)> = Some((5, 3));
    const STYLES: [Style; 4] = [
        Style { is_big_endian: false, is_wide: false },
        Style { is_big_endian: true, is_wide: false },
        Style { is_big_endian: false, is_wide: true },
        Style { is_big_endian: true, is_wide: true },
    ];

    /// Returns values `[texel, sample]` below 256 of the 5 x 3 texels.
    fn values(samples: usize) -> Vec<f64> {
        (0..15 * samples).map(|i| ((i * 11) % 251) as f64).collect()
    }

    fn computed(image: DecodedImage) -> Vec<f32> {
        match image.samples {
            Samples::Computed(values) => values,
            other => panic!("{other:?}"),
        }
    }

    /// Returns `values` as shares of `one` in the order of ascending wavelengths.
    fn in_order(values: &[f64], one: f64) -> Vec<f32> {
        values.chunks_exact(5).flat_map(|texel| [1, 2, 0, 4, 3].map(|band| (texel[band] / one) as f32)).collect()
    }

    fn unfit(result: Result<DecodedImage, ImageFault>) -> String {
        match result {
            Err(ImageFault::Unfit(reason)) => reason,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn all_types_and_layouts_of_bands_are_read() {
        let values = values(5);
        for style in STYLES {
            for (bits, format, one) in [(8, 1, 255.0), (16, 1, 65535.0), (16, 3, 1.0), (32, 3, 1.0), (64, 3, 1.0)] {
                for is_planar in [false, true] {
                    for tile in [None, Some((16, 16)), Some((2, 2))] {
                        for photometric in [1, 2] {
                            let page = Written { bits, format, is_planar, tile, photometric, ..Written::of(5) };
                            let bytes = style.file(&[(&page, &values)]);
                            let image = decode(&bytes, SIZE, TOLD).unwrap();
                            assert_eq!(image.wavelengths_nm, [450.0, 550.0, 650.0, 850.0, 1050.0]);
                            let found = computed(image);
                            let worst = found.iter().zip(in_order(&values, one)).map(|(a, b)| (a - b).abs());
                            assert!(worst.fold(0.0, f32::max) <= 1e-6, "{style:?} {page:?}");
                            // Planted: the layout told wrong.
                            let mut wrong = values.clone();
                            wrong.swap(7, 8);
                            assert_ne!(found, in_order(&wrong, one));
                        }
                    }
                }
            }
        }
    }

    /// Samples of five bands for the encoder.
    struct Bands<T>(std::marker::PhantomData<T>);

    impl ColorType for Bands<u16> {
        type Inner = u16;
        const TIFF_VALUE: PhotometricInterpretation = PhotometricInterpretation::BlackIsZero;
        const BITS_PER_SAMPLE: &'static [u16] = &[16; 5];
        const SAMPLE_FORMAT: &'static [SampleFormat] = &[SampleFormat::Uint; 5];

        fn horizontal_predict(row: &[u16], result: &mut Vec<u16>) {
            result.extend_from_slice(&row[..5]);
            result.extend(row.iter().zip(&row[5..]).map(|(before, this)| this.wrapping_sub(*before)));
        }
    }

    impl ColorType for Bands<f32> {
        type Inner = f32;
        const TIFF_VALUE: PhotometricInterpretation = PhotometricInterpretation::BlackIsZero;
        const BITS_PER_SAMPLE: &'static [u16] = &[32; 5];
        const SAMPLE_FORMAT: &'static [SampleFormat] = &[SampleFormat::IEEEFP; 5];

        fn horizontal_predict(_: &[f32], _: &mut Vec<f32>) {}
    }

    fn encoded<T, C>(compression: Packed, predictor: Predicted, samples: &[T]) -> Vec<u8>
    where
        C: ColorType<Inner = T>,
        T: tiff::encoder::TiffValue,
        [T]: tiff::encoder::TiffValue,
    {
        let mut bytes = Cursor::new(Vec::new());
        let encoder = TiffEncoder::new(&mut bytes).unwrap().with_compression(compression);
        let mut encoder = encoder.with_predictor(predictor);
        let mut image = encoder.new_image::<C>(5, 3).unwrap();
        image.rows_per_strip(1).unwrap();
        image.write_data(samples).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn compressed_bands_are_read() {
        let values = values(5);
        let whole: Vec<u16> = values.iter().map(|value| *value as u16 * 256).collect();
        let floats: Vec<f32> = values.iter().map(|value| *value as f32 * 0.25).collect();
        let deflate = Packed::Deflate(DeflateLevel::default());
        for compression in [Packed::Uncompressed, deflate, Packed::Lzw, Packed::Packbits] {
            for predictor in [Predicted::None, Predicted::Horizontal] {
                let bytes = encoded::<u16, Bands<u16>>(compression, predictor, &whole);
                assert_eq!(computed(decode(&bytes, SIZE, TOLD).unwrap()), in_order(&values, 65535.0 / 256.0));
            }
            let bytes = encoded::<f32, Bands<f32>>(compression, Predicted::None, &floats);
            assert_eq!(computed(decode(&bytes, SIZE, TOLD).unwrap()), in_order(&values, 4.0));
        }
    }

    #[test]
    fn pages_of_one_sample_are_bands_and_smaller_pages_are_passed_over() {
        let values = values(5);
        let band = |band: usize| values[band..].iter().step_by(5).copied().collect::<Vec<f64>>();
        let bands: Vec<Vec<f64>> = (0..5).map(band).collect();
        let page = Written::of(1);
        let mask = Written { kind: 4, ..page.clone() };
        let small = Written { width: 2, height: 2, ..page.clone() };
        for style in STYLES {
            let mut pages: Vec<(&Written, &[f64])> = bands.iter().map(|band| (&page, &band[..])).collect();
            pages.insert(1, (&small, &[1.0, 2.0, 3.0, 4.0]));
            pages.insert(3, (&mask, &bands[0]));
            let bytes = style.file(&pages);
            assert_eq!(computed(decode(&bytes, SIZE, TOLD).unwrap()), in_order(&values, 65535.0));
            assert!(unfit(decode(&bytes, SIZE, UNTOLD)).contains("has 5 bands of unknown wavelength"));
            // One page beside a smaller one is grey.
            let image = decode(&style.file(&pages[..2]), SIZE, UNTOLD).unwrap();
            assert!(matches!(&image.samples, Samples::U16(grey) if grey[3..6] == [55; 3]), "{image:?}");
        }
        let first = Written { kind: 1, ..page };
        assert!(unfit(decode(&STYLES[0].file(&[(&first, &bands[0])]), SIZE, UNTOLD)).contains("first page"));
    }

    #[test]
    fn without_wavelengths_one_three_and_four_samples_are_colours() {
        let style = STYLES[0];
        for is_planar in [false, true] {
            let page = |samples, photometric, extra: &[u16]| Written {
                bits: 8,
                photometric,
                is_planar,
                extra_samples: extra.to_vec(),
                ..Written::of(samples)
            };
            let first = |page: &Written| {
                let image = decode(&style.file(&[(page, &values(page.samples))]), SIZE, UNTOLD).unwrap();
                assert!(image.wavelengths_nm.is_empty() && image.channels == 3);
                match image.samples {
                    Samples::U8(values) => [values[0], values[1], values[2], values[3]],
                    other => panic!("{other:?}"),
                }
            };
            assert_eq!(first(&page(1, 1, &[])), [0, 0, 0, 11]);
            assert_eq!(first(&page(1, 0, &[])), [255, 255, 255, 244]);
            assert_eq!(first(&page(2, 1, &[2])), [0, 0, 0, 22]);
            assert_eq!(first(&page(3, 2, &[])), [0, 11, 22, 33]);
            assert_eq!(first(&page(3, 1, &[0, 0])), [0, 11, 22, 33]);
            assert_eq!(first(&page(4, 2, &[2])), [0, 11, 22, 44]);
            assert_eq!(first(&page(4, 2, &[])), [0, 11, 22, 44]);
            for (samples, photometric, extra) in [(2, 1, &[0][..]), (4, 1, &[0, 0, 0]), (5, 2, &[0, 0]), (5, 1, &[])] {
                let page = page(samples, photometric, extra);
                let reason = unfit(decode(&style.file(&[(&page, &values(samples))]), SIZE, UNTOLD));
                assert!(
                    reason.contains(&format!("has {samples} bands")) && reason.contains("capture.toml"),
                    "{reason}"
                );
            }
            let float = Written { bits: 32, format: 3, ..page(3, 2, &[]) };
            let image = decode(&style.file(&[(&float, &values(3))]), SIZE, UNTOLD).unwrap();
            assert!(matches!(&image.samples, Samples::F32(rgb) if rgb[..4] == [0.0, 11.0, 22.0, 33.0]), "{image:?}");
        }
        // Three samples are bands where wavelengths are told.
        let bytes = style.file(&[(&Written { photometric: 2, ..Written::of(3) }, &values(3))]);
        let told = BandReading { told_nm: &[650.0, 550.0, 450.0], ..TOLD };
        assert_eq!(decode(&bytes, SIZE, told).unwrap().channels, 3);
        assert!(unfit(decode(&bytes, SIZE, TOLD)).contains("has 3 bands, and `wavelengths_nm`"));
    }

    #[test]
    fn wavelengths_and_ignored_values_of_gdal_count() {
        let items = [0.65, 0.45, 0.55, 1.05, 0.85].iter().enumerate();
        let items = items.map(|(i, um)| format!("<Item name=\"wavelength\" sample=\"{i}\" role=\"\">{um}</Item>"));
        let metadata = format!("<GDALMetadata>{}</GDALMetadata>", items.collect::<String>());
        let mut wanted = in_order(&values(5), 65535.0);
        let page = Written { metadata: Some(metadata), nodata: Some("11 ".into()), ..Written::of(5) };
        // The second band of the first texel has the number 11, and is the first by wavelength.
        assert_eq!(values(5)[1], 11.0);
        values(5).iter().enumerate().filter(|(_, value)| **value == 11.0).for_each(|(at, _)| {
            wanted[at / 5 * 5 + [2, 0, 1, 4, 3][at % 5]] = 0.0;
        });
        for style in STYLES {
            let image = decode(&style.file(&[(&page, &values(5))]), SIZE, UNTOLD).unwrap();
            assert_eq!(image.wavelengths_nm, [450.0, 550.0, 650.0, 850.0, 1050.0]);
            assert_eq!(computed(image), wanted);
        }
        // What capture.toml tells goes before.
        let told = BandReading { told_nm: &[500.0, 510.0, 520.0, 530.0, 540.0], ..TOLD };
        let image = decode(&STYLES[0].file(&[(&page, &values(5))]), SIZE, told).unwrap();
        assert_eq!(image.wavelengths_nm[0], 500.0);
    }

    #[test]
    fn other_kinds_are_told_with_their_remedy() {
        let page = Written::of(5);
        for (page, part) in [
            (Written { format: 2, ..page.clone() }, "with a sign"),
            (Written { bits: 32, ..page.clone() }, "32 bits"),
            (Written { photometric: 5, ..page.clone() }, "neither RGB nor grey"),
            (Written { photometric: 0, bits: 32, format: 3, ..page.clone() }, "neither RGB nor grey"),
        ] {
            let bytes = STYLES[0].file(&[(&page, &values(5))]);
            assert!(unfit(decode(&bytes, SIZE, TOLD)).contains(part), "{part}");
        }
        let bytes = STYLES[0].file(&[(&page, &values(5))]);
        let wrong = decode(&bytes, Some((3, 5)), TOLD).unwrap_err();
        assert_eq!(wrong, ImageFault::WrongSize { width: 5, height: 3 });
        // The first tag of the compression is its number 259, of one 16-bit number.
        let at = bytes.windows(4).position(|found| found == [3, 1, 3, 0]).unwrap();
        let mut jpeg = bytes.clone();
        jpeg[at + 8] = 7;
        assert!(unfit(decode(&jpeg, SIZE, TOLD)).contains("compression 7"));
    }

    #[test]
    fn sizes_that_the_file_cannot_hold_are_refused_before_anything_is_allocated() {
        let bytes = STYLES[0].file(&[(&Written::of(5), &values(5))]);
        // Width and height are the second and third tag.
        let with = |tag: u8, value: u32| {
            let at = bytes.windows(4).position(|found| found == [tag, 1, 4, 0]).unwrap();
            let mut claimed = bytes.clone();
            claimed[at + 8..][..4].copy_from_slice(&value.to_le_bytes());
            decode(&claimed, None, TOLD).unwrap_err()
        };
        for (tag, value, part) in [
            (0, u32::MAX, "texels are allowed"),
            (0, 0, "texels are allowed"),
            (1, 1 << 22, "samples in 364 bytes"),
            (0, 4000, "samples in 364 bytes"),
        ] {
            match with(tag, value) {
                ImageFault::Damaged(reason) => assert!(reason.contains(part), "{reason}"),
                other => panic!("{other:?}"),
            }
        }
        // Of strips, as many as are read, and one more.
        for (height, is_read) in [(2 * MAX_NUMBERS, true), (2 * MAX_NUMBERS + 1, false)] {
            let page = Written { width: 1, height, bits: 8, ..Written::of(1) };
            let bytes = STYLES[0].file(&[(&page, &vec![7.0; height])]);
            let image = decode(&bytes, None, UNTOLD);
            assert_eq!(image.is_ok(), is_read, "{height}: {:?}", image.err());
        }
    }

    #[test]
    fn every_prefix_is_refused_and_no_flipped_byte_panics() {
        let values = values(5);
        let whole: Vec<u16> = values.iter().map(|value| *value as u16).collect();
        let tiles = Written { tile: Some((4, 4)), is_planar: true, ..Written::of(5) };
        let grey = Written::of(1);
        for bytes in [
            STYLES[0].file(&[(&Written::of(5), &values)]),
            STYLES[3].file(&[(&tiles, &values)]),
            STYLES[1].file(&[(&grey, &values[..15]); 5]),
            encoded::<u16, Bands<u16>>(Packed::Deflate(DeflateLevel::default()), Predicted::Horizontal, &whole),
            encoded::<u16, Bands<u16>>(Packed::Lzw, Predicted::None, &whole),
        ] {
            assert!(decode(&bytes, None, TOLD).is_ok());
            for length in 0..bytes.len() {
                assert!(decode(&bytes[..length], None, TOLD).is_err(), "prefix of {length} of {}", bytes.len());
            }
            for position in 0..bytes.len() {
                for mask in [0x01, 0x80, 0xFF] {
                    let mut damaged = bytes.clone();
                    damaged[position] ^= mask;
                    // Samples have no checksum, so some flips pass: none may panic.
                    let _ = decode(&damaged, None, TOLD);
                    let _ = decode(&damaged, None, UNTOLD);
                }
            }
        }
    }
}
