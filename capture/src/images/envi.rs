//! ENVI images: a header in text, and beside it a file of nothing but numbers, band by band, row by row or texel by
//! texel.
//!
//! The header starts with the line `ENVI` and goes on with `key = value`, where braces hold a value together over
//! several lines and `;` starts a comment line.

use std::collections::HashMap;

use crate::images::bands::BandReading;
use crate::images::decoded::{DecodedImage, ImageFault, Samples, check_samples, check_size, little_endian};
use crate::images::wavelengths;

/// Largest header that is read, in bytes: some lines for each of 256 bands, and a history.
pub(crate) const MAX_HEADER_BYTES: u64 = 1 << 20;

/// Extensions of the file of numbers beside `NAME.hdr`; it may also be `NAME` alone.
pub(crate) const DATA_EXTENSIONS: [&str; 6] = ["img", "dat", "raw", "bsq", "bil", "bip"];

/// First line of a header.
const FIRST_LINE: &[u8] = b"ENVI";

/// Order of the numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Interleave {
    /// Band by band.
    Bsq,
    /// Row by row, and in each band by band.
    Bil,
    /// Texel by texel.
    Bip,
}

/// Type of the numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Number {
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Number {
    fn of(data_type: usize) -> Option<Number> {
        Some(match data_type {
            1 => Number::U8,
            2 => Number::I16,
            3 => Number::I32,
            4 => Number::F32,
            5 => Number::F64,
            12 => Number::U16,
            13 => Number::U32,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Number::U8 => 1,
            Number::I16 | Number::U16 => 2,
            Number::I32 | Number::U32 | Number::F32 => 4,
            Number::F64 => 8,
        }
    }
}

/// What a header says.
#[derive(Debug, PartialEq)]
pub(crate) struct Header {
    width: usize,
    height: usize,
    bands: usize,
    /// Bytes before the first number.
    offset: usize,
    number: Number,
    interleave: Interleave,
    is_big_endian: bool,
    /// Wavelengths of the bands, in `unit`.
    wavelengths: Option<Vec<f64>>,
    /// Unit of the wavelengths; empty where the header names none.
    unit: String,
    /// Number that stands for a reflectance of 1.
    scale: f64,
    /// Number that stands where nothing was measured.
    ignored: Option<f64>,
}

/// Returns whether `bytes` start like a header.
pub(crate) fn is_header(bytes: &[u8]) -> bool {
    bytes.strip_prefix(FIRST_LINE).is_some_and(|rest| rest.first().is_none_or(|byte| byte.is_ascii_whitespace()))
}

impl Header {
    /// Reads a header and checks its size against the largest allowed.
    pub(crate) fn read(bytes: &[u8]) -> Result<Header, ImageFault> {
        if !is_header(bytes) {
            return Err(ImageFault::damaged("its first line is not `ENVI`"));
        }
        // Descriptions may be of any code page; keys and numbers are ASCII.
        let text = String::from_utf8_lossy(&bytes[FIRST_LINE.len()..]);
        let values = values_of(&text).map_err(ImageFault::damaged)?;
        let header = Header::of(&values)?;
        check_size(header.width, header.height, None)?;
        check_samples(header.width.checked_mul(header.height).and_then(|texels| texels.checked_mul(header.bands)))?;
        Ok(header)
    }

    fn of(values: &HashMap<String, String>) -> Result<Header, ImageFault> {
        let lacks = |key: &str| ImageFault::damaged(format!("its header has no `{key}`"));
        let bad =
            |key: &str, value: &str| ImageFault::damaged(format!("its header has `{key} = {}`", value.escape_debug()));
        let found = |key: &str| values.get(key).map(String::as_str).filter(|value| !value.is_empty());
        let whole = |key: &str| {
            let parse = |value: &str| value.parse::<u32>().map(|number| number as usize).map_err(|_| bad(key, value));
            found(key).map(parse).transpose()
        };
        let real = |key: &str| {
            let parse = |value: &str| value.parse::<f64>().map_err(|_| bad(key, value));
            found(key).map(parse).transpose()
        };
        let must = |key: &str| whole(key)?.ok_or_else(|| lacks(key));
        let data_type = must("data type")?;
        let number = Number::of(data_type).ok_or_else(|| {
            ImageFault::Unfit(format!(
                "has numbers of ENVI's data type {data_type}; write type 1, 2, 3, 4, 5, 12 or 13 (whole numbers up to 32 \
                 bits, or floats)"
            ))
        })?;
        let interleave = found("interleave").ok_or_else(|| lacks("interleave"))?;
        let interleave = match interleave.to_ascii_lowercase().as_str() {
            "bsq" => Interleave::Bsq,
            "bil" => Interleave::Bil,
            "bip" => Interleave::Bip,
            _ => return Err(bad("interleave", interleave)),
        };
        let is_big_endian = match whole("byte order")? {
            Some(0) => false,
            Some(1) => true,
            Some(other) => return Err(bad("byte order", &other.to_string())),
            // A guess would make noise of every number.
            None if number.bytes() > 1 => return Err(lacks("byte order")),
            None => false,
        };
        let scale = real("reflectance scale factor")?.unwrap_or(1.0);
        if !(scale > 0.0 && scale.is_finite()) {
            return Err(bad("reflectance scale factor", &scale.to_string()));
        }
        let list = |value: &str| {
            let words = value.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
            words.map(|word| word.parse::<f64>().map_err(|_| bad("wavelength", word))).collect::<Result<Vec<f64>, _>>()
        };
        Ok(Header {
            width: must("samples")?,
            height: must("lines")?,
            bands: must("bands")?,
            offset: whole("header offset")?.unwrap_or(0),
            number,
            interleave,
            is_big_endian,
            wavelengths: found("wavelength").map(list).transpose()?,
            unit: found("wavelength units").unwrap_or_default().into(),
            scale,
            ignored: real("data ignore value")?,
        })
    }

    /// Returns the size in bytes of the file of numbers that belongs to the header.
    pub(crate) fn data_bytes(&self) -> u64 {
        let samples = self.width * self.height * self.bands;
        self.offset as u64 + samples as u64 * self.number.bytes() as u64
    }

    /// Returns the index of the number of a texel in a band.
    fn place(&self, texel: usize, band: usize) -> usize {
        match self.interleave {
            Interleave::Bsq => band * self.width * self.height + texel,
            Interleave::Bil => (texel / self.width * self.bands + band) * self.width + texel % self.width,
            Interleave::Bip => texel * self.bands + band,
        }
    }
}

/// Returns the values of a header's keys without braces, keys in lower case with one blank between their words.
fn values_of(text: &str) -> Result<HashMap<String, String>, String> {
    let mut values = HashMap::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line.trim().is_empty() || line.trim_start().starts_with(';') {
            continue;
        }
        let shown = || line.trim().chars().take(40).collect::<String>().escape_debug().to_string();
        let (key, value) = line.split_once('=').ok_or_else(|| format!("its header has the line `{}`", shown()))?;
        let key = key.split_whitespace().collect::<Vec<_>>().join(" ").to_lowercase();
        let mut value = value.trim().to_string();
        if let Some(inner) = value.strip_prefix('{') {
            let mut inner = inner.to_string();
            while !inner.contains('}') {
                let line =
                    lines.next().ok_or_else(|| format!("the braces of `{}` in its header do not end", shown()))?;
                inner.push('\n');
                inner.push_str(line);
            }
            value = inner.split('}').next().unwrap_or_default().trim().to_string();
        }
        if values.insert(key, value).is_some() {
            return Err(format!("its header has `{}` twice", shown()));
        }
    }
    Ok(values)
}

/// Decodes the numbers `data` of a header. Numbers that are not measured are 0, and a scale factor divides the others.
pub(crate) fn decode(
    header: &Header,
    data: &[u8],
    expected: Option<(usize, usize)>,
    reading: BandReading,
) -> Result<DecodedImage, ImageFault> {
    let (width, height) = (header.width, header.height);
    check_size(width, height, expected)?;
    let of_file = || match &header.wavelengths {
        Some(values) => wavelengths::in_nm(values, &header.unit).map(Some),
        None => Ok(None),
    };
    let nm = wavelengths::of_bands(header.bands, reading.told_nm, of_file)?;
    let bands = reading.weighing.of(&nm.ok_or_else(|| wavelengths::unknown(header.bands))?)?;
    if data.len() as u64 != header.data_bytes() {
        let (found, asked) = (data.len(), header.data_bytes());
        return Err(ImageFault::damaged(format!("its data have {found} bytes, and its header asks for {asked}")));
    }
    let mut values = vec![0f32; width * height * bands.channels];
    let numbers = &data[header.offset..];
    for band in 0..header.bands {
        let mut add = |value: &dyn Fn(usize) -> f64| {
            let samples = (0..width * height).map(|texel| {
                let number = value(header.place(texel, band));
                if is_ignored(header, number) { 0.0 } else { (number / header.scale) as f32 }
            });
            bands.add(band, samples, &mut values);
        };
        let big = header.is_big_endian;
        match header.number {
            Number::U8 => add(&|at| f64::from(numbers[at])),
            Number::I16 => add(&|at| f64::from(i16::from_le_bytes(little_endian(numbers, at, big)))),
            Number::U16 => add(&|at| f64::from(u16::from_le_bytes(little_endian(numbers, at, big)))),
            Number::I32 => add(&|at| f64::from(i32::from_le_bytes(little_endian(numbers, at, big)))),
            Number::U32 => add(&|at| f64::from(u32::from_le_bytes(little_endian(numbers, at, big)))),
            Number::F32 => add(&|at| f64::from(f32::from_le_bytes(little_endian(numbers, at, big)))),
            Number::F64 => add(&|at| f64::from_le_bytes(little_endian(numbers, at, big))),
        }
    }
    let (channels, wavelengths_nm) = (bands.channels, bands.wavelengths_nm);
    Ok(DecodedImage { width, height, channels, wavelengths_nm, samples: Samples::Computed(values) })
}

/// Returns whether a number stands where nothing was measured.
fn is_ignored(header: &Header, number: f64) -> bool {
    let Some(ignored) = header.ignored else { return false };
    // In single precision, the text of a header and the number of a file are seldom the same double.
    let is_single = header.number == Number::F32 && number as f32 == ignored as f32;
    number == ignored || is_single || (number.is_nan() && ignored.is_nan())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::images::bands::Weighing;

    const WIDTH: usize = 3;
    const HEIGHT: usize = 2;
    const BANDS: BandReading = BandReading { weighing: &Weighing::Bands, told_nm: &[] };

    /// Value of a texel in a band, whole and below 256.
    fn value(texel: usize, band: usize) -> u8 {
        (texel * 7 + band * 50 + 1) as u8
    }

    /// Returns the values in the order of an interleave.
    fn ordered(interleave: &str) -> Vec<u8> {
        let texels = || 0..WIDTH * HEIGHT;
        match interleave {
            "bsq" => (0..4).flat_map(|band| texels().map(move |texel| value(texel, band))).collect(),
            "bip" => texels().flat_map(|texel| (0..4).map(move |band| value(texel, band))).collect(),
            _ => (0..HEIGHT)
                .flat_map(|row| (0..4).flat_map(move |band| (0..WIDTH).map(move |x| value(row * WIDTH + x, band))))
                .collect(),
        }
    }

    fn header(data_type: u8, interleave: &str, byte_order: u8, rest: &str) -> String {
        format!(
            "ENVI\r\ndescription = {{\n  a leaf = {{ }}\n; a comment\nsamples = {WIDTH}\nlines   = {HEIGHT}\nbands = 4\n{rest}\
             data type = {data_type}\nInterleave = {interleave}\nbyte  order = {byte_order}\n"
        )
    }

    const NM: &str = "wavelength units = Nanometers\nwavelength = {450, 550,\n 650.5, 850}\n";

    fn bands_of(header: &str, data: &[u8]) -> Result<Vec<f32>, ImageFault> {
        let image = decode(&Header::read(header.as_bytes())?, data, Some((WIDTH, HEIGHT)), BANDS)?;
        assert_eq!(image.wavelengths_nm, [450.0, 550.0, 650.5, 850.0]);
        match image.samples {
            Samples::Computed(values) => Ok(values),
            other => panic!("{other:?}"),
        }
    }

    fn expected(divisor: f32) -> Vec<f32> {
        (0..WIDTH * HEIGHT).flat_map(|texel| (0..4).map(move |band| f32::from(value(texel, band)) / divisor)).collect()
    }

    fn bytes_of(data_type: u8, is_big_endian: bool, values: &[u8]) -> Vec<u8> {
        let bytes = |value: u8| match data_type {
            1 => vec![value],
            2 => i16::from(value).to_le_bytes().to_vec(),
            3 => i32::from(value).to_le_bytes().to_vec(),
            4 => f32::from(value).to_le_bytes().to_vec(),
            5 => f64::from(value).to_le_bytes().to_vec(),
            12 => u16::from(value).to_le_bytes().to_vec(),
            _ => u32::from(value).to_le_bytes().to_vec(),
        };
        let turned = |mut bytes: Vec<u8>| {
            if is_big_endian {
                bytes.reverse();
            }
            bytes
        };
        values.iter().flat_map(|value| turned(bytes(*value))).collect()
    }

    #[test]
    fn all_orders_and_types_of_numbers_are_read() {
        for data_type in [1, 2, 3, 4, 5, 12, 13] {
            for interleave in ["bsq", "bil", "bip"] {
                for byte_order in [0, 1] {
                    let data = bytes_of(data_type, byte_order == 1, &ordered(interleave));
                    let text = header(data_type, interleave, byte_order, NM);
                    assert_eq!(bands_of(&text, &data).unwrap(), expected(1.0), "{data_type} {interleave} {byte_order}");
                    // Planted differences: another order of the bands, another order of the bytes.
                    let other = if interleave == "bsq" { "bip" } else { "bsq" };
                    assert_ne!(bands_of(&header(data_type, other, byte_order, NM), &data).unwrap(), expected(1.0));
                    let turned = bands_of(&header(data_type, interleave, 1 - byte_order, NM), &data).unwrap();
                    assert!(data_type == 1 || turned != expected(1.0));
                }
            }
        }
    }

    #[test]
    fn offset_scale_factor_ignored_values_and_units_count() {
        let mut data = vec![9; 5];
        data.extend(ordered("bip"));
        let rest = "header offset = 5\nreflectance scale factor = 100\ndata ignore value = 1\n\
                    wavelength = {0.45, 0.55, 0.6505, 0.85}\n";
        let mut wanted = expected(100.0);
        wanted[0] = 0.0;
        assert_eq!(bands_of(&header(1, "bip", 0, rest), &data).unwrap(), wanted);
        // The same with another number ignored, and as floats of which one is no number.
        let other = bands_of(&header(1, "bip", 0, &rest.replace("value = 1", "value = 2")), &data).unwrap();
        assert_eq!(other, expected(100.0));
        for ignored in ["-9999.9", "nan"] {
            let mut floats = bytes_of(4, false, &ordered("bip"));
            floats[..4].copy_from_slice(&ignored.parse::<f32>().unwrap().to_le_bytes());
            let rest = format!("data ignore value = {ignored}\n{NM}");
            assert_eq!(bands_of(&header(4, "bip", 0, &rest), &floats).unwrap()[..2], [0.0, expected(1.0)[1]]);
        }
    }

    #[test]
    fn wavelengths_of_capture_toml_serve_where_the_header_has_none() {
        let data = ordered("bip");
        let found = Header::read(header(1, "bip", 0, "").as_bytes()).unwrap();
        let told = BandReading { told_nm: &[850.0, 650.0, 550.0, 450.0], ..BANDS };
        let image = decode(&found, &data, None, told).unwrap();
        assert_eq!((&image.wavelengths_nm[..], image.channels), (&[450.0, 550.0, 650.0, 850.0][..], 4));
        let Samples::Computed(values) = image.samples else { panic!("bands are computed") };
        // The last band of the file has the shortest wavelength.
        assert_eq!(values[..4], [3, 2, 1, 0].map(|band| f32::from(value(0, band))));
        for (reading, part) in
            [(BANDS, "of unknown wavelength"), (BandReading { told_nm: &[450.0], ..BANDS }, "1 numbers")]
        {
            match decode(&found, &data, None, reading) {
                Err(ImageFault::Unfit(reason)) => assert!(reason.contains(part), "{reason}"),
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn headers_that_cannot_be_are_refused() {
        let good = header(2, "bil", 0, NM);
        for (from, to) in [
            ("samples = 3", "samples = 0"),
            ("samples = 3", "samples = 4294967295"),
            ("samples = 3", "samples = -3"),
            ("samples = 3", "sample = 3"),
            ("bands = 4", "bands = 0"),
            ("bands = 4", "bands = 100000000"),
            ("bands = 4", "bands = 4\nbands = 4"),
            ("data type = 2", "data type = 6"),
            ("= bil", "= bli"),
            ("byte  order = 0", "byte  order = 2"),
            ("byte  order = 0", ""),
            ("850}", "850"),
            ("650.5", "x"),
            ("650.5,", ""),
            ("650.5", "550"),
            ("Nanometers", "GHz"),
            ("samples", "reflectance scale factor = 0\nsamples"),
            ("samples", "reflectance scale factor = inf\nsamples"),
            ("samples", "data ignore value = none\nsamples"),
            ("samples", "header offset = 1\nsamples"),
            ("ENVI", "ENVIX"),
            ("ENVI", "#?RADIANCE"),
        ] {
            assert!(good.contains(from), "{from}");
            let data = vec![0; WIDTH * HEIGHT * 4 * 2];
            assert!(bands_of(&good, &data).is_ok());
            assert!(bands_of(&good.replacen(from, to, 1), &data).is_err(), "{from} as {to}");
        }
    }

    #[test]
    fn every_prefix_is_refused_and_no_flipped_byte_panics() {
        let (text, data) = (header(4, "bsq", 0, NM), bytes_of(4, false, &ordered("bsq")));
        for length in 0..data.len() {
            assert!(bands_of(&text, &data[..length]).is_err(), "prefix of {length}");
        }
        // The last line ends in a digit that must be there, and a line break that need not.
        for length in 0..text.len() - 1 {
            let read = Header::read(&text.as_bytes()[..length]);
            assert!(read.and_then(|header| decode(&header, &data, None, BANDS)).is_err(), "prefix of {length}");
        }
        for position in 0..text.len() {
            for mask in [0x01, 0x04, 0x10, 0x80, 0xFF] {
                let mut damaged = text.clone().into_bytes();
                damaged[position] ^= mask;
                let _ = Header::read(&damaged).and_then(|header| decode(&header, &data, None, BANDS));
            }
        }
    }
}
