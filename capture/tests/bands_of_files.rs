//! Captures whose images are TIFF and ENVI files of other programs: bands and colours come back, and what is missing is
//! told.

#[path = "support/tiff_writer.rs"]
mod tiff_writer;

use btf_capture::{Capture, CaptureInfo, DirectionSet, ImageFormat, Pixels, Transfer};
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use tiff_writer::{Page, Style};

/// Wavelengths in the order of the files, and in ascending order with their places.
const NM: [f64; 5] = [650.0, 450.0, 550.5, 1050.0, 850.0];
const ASCENDING: [f64; 5] = [450.0, 550.5, 650.0, 850.0, 1050.0];
const PLACES: [usize; 5] = [1, 2, 0, 4, 3];
const TEXELS: usize = 15;
const TOLD: &str = "wavelengths_nm = [650, 450, 550.5, 1050, 850]";

/// Names of the images of a view and two lights.
const NAMES: [&str; 2] = ["tv000_pv000_tl000_pl000", "tv000_pv000_tl030_pl090"];

/// Whole number of a band, in the file's order, at a texel of an image.
fn number(image: usize, texel: usize, band: usize) -> u8 {
    (image * 90 + texel * 6 + band) as u8
}

/// Numbers `[texel, band]` of an image, in the file's order.
fn numbers(image: usize, bands: usize) -> Vec<f64> {
    (0..TEXELS * bands).map(|i| f64::from(number(image, i / bands, i % bands))).collect()
}

/// Bands `[texel, band]` of an image by ascending wavelength, as shares of `one`.
fn bands(image: usize, one: f32) -> Vec<f32> {
    (0..TEXELS).flat_map(|texel| PLACES.map(|band| f32::from(number(image, texel, band)) / one)).collect()
}

/// Writes files into a folder of their own.
fn folder(files: &[(&str, &[u8])]) -> (TempDir, PathBuf) {
    let parent = tempfile::tempdir().unwrap();
    let path = parent.path().join("leaf");
    std::fs::create_dir(&path).unwrap();
    files.iter().for_each(|(name, bytes)| std::fs::write(path.join(name), bytes).unwrap());
    (parent, path)
}

/// Writes the images of [`NAMES`] and a `capture.toml` into a folder of their own.
fn images(extension: &str, image: impl Fn(usize) -> Vec<u8>, toml: &str) -> (TempDir, PathBuf) {
    let (parent, path) = folder(&[("capture.toml", toml.as_bytes())]);
    for (number, name) in NAMES.iter().enumerate() {
        std::fs::write(path.join(format!("{name}.{extension}")), image(number)).unwrap();
    }
    (parent, path)
}

/// Zips a folder.
fn zipped(path: &Path) -> PathBuf {
    let zip = path.with_extension("zip");
    let mut writer = zip::ZipWriter::new(std::fs::File::create(&zip).unwrap());
    for entry in std::fs::read_dir(path).unwrap() {
        let entry = entry.unwrap();
        let options = zip::write::SimpleFileOptions::default();
        writer.start_file(format!("deep/{}", entry.file_name().to_str().unwrap()), options).unwrap();
        writer.write_all(&std::fs::read(entry.path()).unwrap()).unwrap();
    }
    writer.finish().unwrap();
    zip
}

fn linear(capture: &Capture, light: usize) -> Vec<f32> {
    match capture.read(0, light).unwrap() {
        Pixels::Linear(values) => values,
        other => panic!("{other:?}"),
    }
}

/// Largest difference, above 1 relative to what is wanted.
fn worst(found: &[f32], wanted: &[f32]) -> f32 {
    assert_eq!(found.len(), wanted.len());
    found.iter().zip(wanted).map(|(a, b)| (a - b).abs() / b.abs().max(1.0)).fold(0.0, f32::max)
}

/// Checks that a capture of two images has the bands of [`bands`], and the same colours and sums as such a capture in
/// memory.
#[track_caller]
fn assert_bands(path: &Path, one: f32) {
    let capture = Capture::open(path).unwrap();
    let info = capture.info().clone();
    assert_eq!((&info.wavelengths_nm[..], info.channels()), (&ASCENDING[..], 5));
    assert_eq!((info.width, info.height, info.format, info.transfer), (5, 3, ImageFormat::Exr, Transfer::Linear));
    let memory = Capture::from_linear(info, [bands(0, one), bands(1, one)].concat()).unwrap();
    let weights: Vec<[f32; 3]> = (0..5).map(|band| [band as f32, 1.0, -0.001]).collect();
    for light in 0..2 {
        assert!(worst(&capture.read_bands(0, light).unwrap(), &bands(light, one)) < 1e-6);
        // Planted: the other image.
        assert!(worst(&capture.read_bands(0, light).unwrap(), &bands(1 - light, one)) > 0.001);
        assert!(worst(&linear(&capture, light), &linear(&memory, light)) < 1e-5);
        let [through, wanted] = [&capture, &memory].map(|capture| capture.through(&weights).unwrap());
        assert!(worst(&linear(&through, light), &linear(&wanted, light)) < 1e-5);
    }
}

/// Returns the message of whatever refuses a capture of two images: opening it or reading one of them.
fn refusal(path: &Path) -> String {
    let message = match Capture::open(path) {
        Err(error) => error.to_string(),
        Ok(capture) => (0..2).find_map(|light| capture.read(0, light).err()).expect("one is refused").to_string(),
    };
    assert!(!message.contains('\n') && !message.ends_with('.'), "one sentence: {message}");
    message
}

#[track_caller]
fn assert_says(message: &str, parts: &[&str]) {
    parts.iter().for_each(|part| assert!(message.contains(part), "`{part}` is not in: {message}"));
}

fn tiff(page: &Page) -> impl Fn(usize) -> Vec<u8> {
    let page = page.clone();
    move |image| Style::default().file(&[(&page, &numbers(image, page.samples))])
}

#[test]
fn tiff_images_of_bands_are_read_from_folders_zips_and_lists() {
    for (bits, format, one) in [(8, 1, 255.0), (16, 1, 65535.0), (32, 3, 1.0)] {
        for (is_planar, tile) in [(false, None), (true, None), (false, Some((16, 16))), (true, Some((16, 16)))] {
            let page = Page { bits, format, is_planar, tile, ..Page::of(5) };
            let (_parent, path) = images("tif", tiff(&page), TOLD);
            assert_bands(&path, one);
            assert_bands(&zipped(&path), one);
        }
    }
    let list = "file,theta_v,phi_v,theta_l,phi_l\na.TIFF,0,0,0,0\nb.TIFF,0,0,30,90\n";
    let [a, b] = [0, 1].map(tiff(&Page { bits: 32, format: 3, ..Page::of(5) }));
    let files = [("a.TIFF", &a[..]), ("b.TIFF", &b), ("list.csv", list.as_bytes()), ("capture.toml", TOLD.as_bytes())];
    assert_bands(&folder(&files).1.join("list.csv"), 1.0);
}

#[test]
fn tiff_files_that_name_their_wavelengths_need_no_key() {
    let items = NM.iter().enumerate();
    let items = items.map(|(i, nm)| format!("<Item name=\"WAVELENGTH\" sample=\"{i}\">{}</Item>", nm / 1000.0));
    let unit = "<Item name=\"WAVELENGTH_UNITS\">Micrometers</Item>";
    let metadata = Some(format!("<GDALMetadata>{unit}{}</GDALMetadata>", items.collect::<String>()));
    let page = Page { metadata, ..Page::of(5) };
    assert_bands(&images("tif", tiff(&page), "").1, 65535.0);
    // A page for each band, as microscopes write them.
    let page = Page::of(1);
    let stack = |image: usize| {
        let all = numbers(image, 5);
        let bands: Vec<Vec<f64>> = (0..5).map(|band| all[band..].iter().step_by(5).copied().collect()).collect();
        Style::default().file(&bands.iter().map(|band| (&page, &band[..])).collect::<Vec<_>>())
    };
    assert_bands(&images("tif", stack, TOLD).1, 65535.0);
}

#[test]
fn tiff_images_without_wavelengths_are_colours_as_png_is() {
    let page = Page { bits: 8, photometric: 2, ..Page::of(3) };
    let (_parent, path) = images("tif", tiff(&page), "");
    let capture = Capture::open(&path).unwrap();
    let info = capture.info();
    assert_eq!((info.format, info.transfer, info.channels()), (ImageFormat::Png, Transfer::Srgb, 3));
    let wanted = |image| numbers(image, 3).iter().map(|value| *value as u8).collect();
    assert_eq!(capture.read(0, 1).unwrap(), Pixels::Encoded8(wanted(1)));
    assert!(capture.read_bands(0, 1).unwrap_err().to_string().contains("no bands"));
    std::fs::write(path.join("capture.toml"), "transfer = \"linear\"").unwrap();
    assert_eq!(Capture::open(&path).unwrap().info().transfer, Transfer::Linear);
    // 16 bits with a curve, four samples of which one is alpha.
    let page = Page { photometric: 2, extra_samples: vec![2], ..Page::of(4) };
    let (_parent, path) = images("tif", tiff(&page), "transfer = \"linear\"");
    let capture = Capture::open(&path).unwrap();
    let [red, green, blue] = [0, 1, 2].map(|band| f32::from(number(1, 0, band)) / 65535.0);
    assert_eq!(linear(&capture, 1)[..3], [red, green, blue]);
    // Floats are linear, whatever capture.toml says.
    let page = Page { bits: 32, format: 3, photometric: 2, ..Page::of(3) };
    let (_parent, path) = images("tif", tiff(&page), "scale = 0.5");
    let capture = Capture::open(&path).unwrap();
    assert_eq!((capture.info().format, capture.info().transfer), (ImageFormat::Exr, Transfer::Linear));
    assert_eq!(linear(&capture, 1)[..3], [45.0, 45.5, 46.0]);
    std::fs::write(path.join("capture.toml"), "transfer = \"srgb\"").unwrap();
    assert_says(&refusal(&path), &["capture.toml line 1", "its images are linear"]);
}

#[test]
fn black_level_flat_field_and_mask_may_be_tiff_files() {
    let page = Page { bits: 32, format: 3, ..Page::of(5) };
    let grey = Page { bits: 8, ..Page::of(1) };
    let even = |value: f64| Style::default().file(&[(&page, &[value; 5 * TEXELS])]);
    let mut mask = [255.0; TEXELS];
    mask[0] = 0.0;
    let toml = format!("black = \"black.tif\"\nflat = \"flat.tif\"\nmask = \"mask.tif\"\n{TOLD}");
    let (_parent, path) = images("tif", tiff(&page), &toml);
    std::fs::write(path.join("black.tif"), even(10.0)).unwrap();
    std::fs::write(path.join("flat.tif"), even(210.0)).unwrap();
    std::fs::write(path.join("mask.tif"), Style::default().file(&[(&grey, &mask)])).unwrap();
    let corrected = Capture::open(&path).unwrap();
    let (_plain, path) = images("tif", tiff(&page), TOLD);
    let plain = Capture::open(&path).unwrap();
    // Colours are of weights that sum to 1, so that an even black level is as even in them.
    let mut wanted: Vec<f32> = linear(&plain, 1).iter().map(|value| (value - 10.0) / 200.0).collect();
    wanted.copy_within(3..6, 0);
    assert!(worst(&linear(&corrected, 1), &wanted) < 1e-4);
    assert!(corrected.read_bands(0, 1).unwrap_err().to_string().contains("corrected by black level"));
}

fn envi_header(data_type: u8, interleave: &str, byte_order: u8, more: &str) -> Vec<u8> {
    format!(
        "ENVI\nsamples = 5\nlines = 3\nbands = 5\nheader offset = 0\ndata type = {data_type}\n\
         interleave = {interleave}\nbyte order = {byte_order}\n{more}"
    )
    .into_bytes()
}

/// Numbers of an image in an interleave, as 16-bit whole numbers or single floats.
fn envi_data(image: usize, is_float: bool, interleave: &str, is_big_endian: bool) -> Vec<u8> {
    let (across, down) = (5, 3);
    let order: Vec<(usize, usize)> = match interleave {
        "bsq" => (0..5).flat_map(|band| (0..TEXELS).map(move |texel| (texel, band))).collect(),
        "bip" => (0..TEXELS).flat_map(|texel| (0..5).map(move |band| (texel, band))).collect(),
        _ => (0..down)
            .flat_map(|row| (0..5).flat_map(move |band| (0..across).map(move |x| (row * across + x, band))))
            .collect(),
    };
    let bytes = |(texel, band): (usize, usize)| {
        let number = number(image, texel, band);
        let mut bytes =
            if is_float { f32::from(number).to_le_bytes().to_vec() } else { u16::from(number).to_le_bytes().to_vec() };
        if is_big_endian {
            bytes.reverse();
        }
        bytes
    };
    order.into_iter().flat_map(bytes).collect()
}

const WAVELENGTHS: &str = "wavelength = {\n 0.65, 0.45, 0.5505,\n 1.05, 0.85 }\n";

/// Writes the ENVI images of [`NAMES`] with files of numbers of an extension.
fn envi_images(header: &[u8], extension: &str, data: impl Fn(usize) -> Vec<u8>, toml: &str) -> (TempDir, PathBuf) {
    let (parent, path) = images("hdr", |_| header.to_vec(), toml);
    for (number, name) in NAMES.iter().enumerate() {
        std::fs::write(path.join(format!("{name}{extension}")), data(number)).unwrap();
    }
    (parent, path)
}

#[test]
fn envi_images_are_read_in_every_order_from_folders_and_zips() {
    for (is_float, data_type) in [(false, 12), (false, 2), (true, 4)] {
        for (interleave, extension) in [("bsq", ".bsq"), ("bil", ".IMG"), ("bip", "")] {
            for byte_order in [0, 1] {
                let header = envi_header(data_type, interleave, byte_order, WAVELENGTHS);
                let data = |image| envi_data(image, is_float, interleave, byte_order == 1);
                let (_parent, path) = envi_images(&header, extension, data, "");
                assert_bands(&path, 1.0);
                assert_bands(&zipped(&path), 1.0);
            }
        }
    }
}

#[test]
fn envi_images_take_wavelengths_and_scale_of_capture_toml_and_a_scale_factor() {
    let data = |image| envi_data(image, false, "bil", false);
    assert_bands(&envi_images(&envi_header(12, "bil", 0, ""), ".dat", data, TOLD).1, 1.0);
    let factor = format!("{WAVELENGTHS}reflectance scale factor = 200\n");
    assert_bands(&envi_images(&envi_header(12, "bil", 0, &factor), ".raw", data, "").1, 200.0);
    let (_parent, path) = envi_images(&envi_header(12, "bil", 0, WAVELENGTHS), ".raw", data, "scale = 0.005");
    let capture = Capture::open(&path).unwrap();
    assert!(worst(&capture.read_bands(0, 1).unwrap(), &bands(1, 200.0)) < 1e-6);
    // By a list, under the name that other programs give the header: that of the data and `.hdr`.
    let header = envi_header(12, "bil", 0, WAVELENGTHS);
    let list = "file,theta_v,phi_v,theta_l,phi_l\na.img.hdr,0,0,0,0\nb.img.hdr,0,0,30,90\n";
    let (a, b) = (data(0), data(1));
    let files =
        [("a.img.hdr", &header[..]), ("a.img", &a), ("b.img.hdr", &header), ("b.img", &b), ("l.csv", list.as_bytes())];
    assert_bands(&folder(&files).1, 1.0);
}

#[test]
fn bands_of_unknown_wavelengths_are_told_with_the_remedy() {
    let unknown = ["has 5 bands of unknown wavelength", "give `wavelengths_nm` in capture.toml", NAMES[0]];
    let page = Page::of(5);
    assert_says(&refusal(&images("tif", tiff(&page), "").1), &unknown);
    let data = |image| envi_data(image, false, "bil", false);
    let envi = |more: &str, toml: &str| envi_images(&envi_header(12, "bil", 0, more), ".img", data, toml);
    assert_says(&refusal(&envi("", "").1), &unknown);
    let four = "wavelengths_nm = [450, 550, 650, 750]";
    let differs = ["has 5 bands, and `wavelengths_nm` in capture.toml has 4 numbers", NAMES[0]];
    assert_says(&refusal(&images("tif", tiff(&page), four).1), &differs);
    assert_says(&refusal(&envi(WAVELENGTHS, four).1), &differs);
    assert_says(&refusal(&envi("wavelength = {450}\n", "").1), &["has 5 bands and names 1 wavelengths"]);
    // Files that name their channels take no other wavelengths than their own.
    let set = DirectionSet::random(2, 1).unwrap();
    let info = CaptureInfo::new("leaf", 5, 3, set.clone(), set, ImageFormat::Exr);
    for (info, toml, parts) in [
        (info.clone(), TOLD, &["has no bands", "5 other numbers", "remove that key"][..]),
        (info.in_format(ImageFormat::Png), TOLD, &["has no bands", "remove that key"]),
        (CaptureInfo { wavelengths_nm: ASCENDING.to_vec(), ..info.clone() }, four, &["5 bands", "4 other numbers"]),
        (CaptureInfo { wavelengths_nm: ASCENDING.to_vec(), ..info }, TOLD, &[]),
    ] {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("leaf");
        let writer = btf_capture::CaptureWriter::create(&path, info.clone()).unwrap();
        (0..4).for_each(|pair| writer.write(pair / 2, pair % 2, &vec![0.5; TEXELS * info.channels()]).unwrap());
        writer.finish().unwrap();
        std::fs::write(path.join("capture.toml"), toml).unwrap();
        match parts {
            [] => assert_eq!(Capture::open(&path).unwrap().info().wavelengths_nm, ASCENDING),
            parts => assert_says(&refusal(&path), parts),
        }
    }
}

#[test]
fn what_is_wrong_beside_an_envi_header_is_told() {
    let data = |image| envi_data(image, false, "bil", false);
    let header = envi_header(12, "bil", 0, WAVELENGTHS);
    let (_parent, path) = envi_images(&header, ".img", data, "");
    let numbers = path.join(format!("{}.img", NAMES[1]));
    let second = path.join(format!("{}.hdr", NAMES[1]));
    for (bytes, part) in [(&data(1)[1..], "149 bytes"), (&[data(1), vec![0]].concat()[..], "151 bytes")] {
        std::fs::write(&numbers, bytes).unwrap();
        assert_says(&refusal(&path), &[NAMES[1], part, "its header asks for 150"]);
    }
    std::fs::write(&numbers, data(1)).unwrap();
    assert_bands(&path, 1.0);
    std::fs::write(path.join(format!("{}.bil", NAMES[1])), data(1)).unwrap();
    assert_says(&refusal(&path), &["has two files of numbers", ".bil", ".img", "remove one"]);
    std::fs::remove_file(path.join(format!("{}.bil", NAMES[1]))).unwrap();
    std::fs::remove_file(&numbers).unwrap();
    assert_says(&refusal(&path), &[NAMES[1], "has no file of numbers", ".img", ".bip"]);
    std::fs::write(&numbers, data(1)).unwrap();
    // A Radiance picture among them, and the other way round.
    let radiance =
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 3 +X 5\n".iter().copied().chain([128; 60]).collect::<Vec<u8>>();
    std::fs::write(&second, &radiance).unwrap();
    assert_says(&refusal(&path), &[NAMES[1], "its first line is not `ENVI`"]);
    std::fs::write(&second, &header).unwrap();
    std::fs::write(path.join(format!("{}.hdr", NAMES[0])), &radiance).unwrap();
    assert_says(&refusal(&path), &[NAMES[1], "Radiance"]);
    // Both are Radiance pictures, whatever lies beside them.
    std::fs::write(&second, &radiance).unwrap();
    assert!(linear(&Capture::open(&path).unwrap(), 1).iter().all(|value| *value == 0.5));
    // Another size, told by the header.
    std::fs::write(path.join(format!("{}.hdr", NAMES[0])), &header).unwrap();
    let turned =
        String::from_utf8(header).unwrap().replace("samples = 5", "samples = 3").replace("lines = 3", "lines = 5");
    std::fs::write(&second, turned).unwrap();
    assert_says(&refusal(&path), &[NAMES[1], "is 3 x 5", "5 x 3"]);
}

#[test]
fn tiff_images_of_one_capture_are_of_one_kind() {
    let of = |page: &Page| tiff(page)(1);
    let (_parent, path) = images("tif", tiff(&Page { bits: 8, photometric: 2, ..Page::of(3) }), "");
    let second = path.join(format!("{}.tif", NAMES[1]));
    let float = Page { bits: 32, format: 3, photometric: 2, ..Page::of(3) };
    std::fs::write(&second, of(&float)).unwrap();
    assert_says(&refusal(&path), &[NAMES[1], "has linear values", "convert it"]);
    // 16 bits beside 8 are as good as in PNG.
    std::fs::write(&second, of(&Page { photometric: 2, ..Page::of(3) })).unwrap();
    assert_eq!(linear(&Capture::open(&path).unwrap(), 1).len(), 3 * TEXELS);
    let (_parent, path) = images("tif", tiff(&float), "");
    std::fs::write(path.join(format!("{}.tif", NAMES[1])), of(&Page { bits: 8, photometric: 2, ..Page::of(3) }))
        .unwrap();
    assert_says(&refusal(&path), &[NAMES[1], "whole numbers with a curve"]);
    // Colours among bands are no bands.
    let items: String =
        NM.iter().enumerate().map(|(i, nm)| format!("<Item name=\"wavelength\" sample=\"{i}\">{nm}</Item>")).collect();
    let (_parent, path) = images("tif", tiff(&Page { metadata: Some(items), ..Page::of(5) }), "");
    std::fs::write(path.join(format!("{}.tif", NAMES[1])), of(&float)).unwrap();
    let capture = Capture::open(&path).unwrap();
    assert!(capture.read_bands(0, 0).is_ok());
    assert_says(&capture.read_bands(0, 1).unwrap_err().to_string(), &[NAMES[1], "wavelengths are not those"]);
}
