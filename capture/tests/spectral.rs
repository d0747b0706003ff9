//! Captures in spectral bands: written, read back as bands, as colours and as weighted sums.

use btf_capture::{Capture, CaptureError, CaptureInfo, CaptureWriter, DirectionSet, ImageFormat, Pixels, Transfer};

const NM: [f64; 5] = [450.0, 550.5, 650.0, 850.0, 1050.0];

fn info() -> CaptureInfo {
    let set = DirectionSet::random(2, 1).unwrap();
    let info = CaptureInfo::new("leaf", 4, 3, set.clone(), set, ImageFormat::Exr);
    CaptureInfo { wavelengths_nm: NM.to_vec(), ..info }
}

/// Value of a band at a texel of an image, exact in half precision.
fn value(image: usize, texel: usize, band: usize) -> f32 {
    (image * 64 + texel * 5 + band) as f32 / 256.0
}

fn image(number: usize) -> Vec<f32> {
    (0..12).flat_map(|texel| (0..NM.len()).map(move |band| value(number, texel, band))).collect()
}

fn linear(capture: &Capture, view: usize, light: usize) -> Vec<f32> {
    match capture.read(view, light).unwrap() {
        Pixels::Linear(values) => values,
        other => panic!("{other:?}"),
    }
}

#[test]
fn bands_are_written_and_come_back_as_bands_as_sums_and_as_colours() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("leaf");
    let writer = CaptureWriter::create(&path, info()).unwrap();
    (0..4).for_each(|pair| writer.write(pair / 2, pair % 2, &image(pair)).unwrap());
    writer.finish().unwrap();
    let memory = Capture::from_linear(info(), (0..4).flat_map(image).collect()).unwrap();
    for capture in [Capture::open(&path).unwrap(), memory] {
        assert_eq!((&capture.info().wavelengths_nm[..], capture.info().channels()), (&NM[..], 5));
        assert_eq!(capture.read_bands(1, 0).unwrap(), image(2));
        // The plateau, the rise from red to infrared, and band 1 alone.
        let mut weights = [[0.0f32; 3]; 5];
        (weights[3][0], weights[4][0]) = (0.5, 0.5);
        (weights[2][1], weights[3][1]) = (-1.0, 1.0);
        weights[1][2] = 1.0;
        let through = capture.through(&weights).unwrap();
        assert_eq!((through.info().channels(), through.info().wavelengths_nm.len()), (3, 0));
        for (texel, sums) in linear(&through, 0, 1).as_chunks::<3>().0.iter().enumerate() {
            let band = |band: usize| value(1, texel, band);
            assert_eq!(*sums, [0.5 * (band(3) + band(4)), band(3) - band(2), band(1)], "{texel}");
        }
        // A rise that falls is clamped, as colours out of the gamut are.
        weights[2][1] = -9.0;
        assert!(linear(&capture.through(&weights).unwrap(), 0, 1).iter().any(|x| *x == -0.1));
        // Colours under D65 are as before, and another capture to who resumes.
        assert_eq!(linear(&capture, 0, 0).len(), 36);
        assert_ne!(capture.stamps().unwrap(), through.stamps().unwrap());
        assert!(through.read_bands(0, 0).unwrap_err().to_string().contains("no bands"));
    }
}

#[test]
fn what_is_no_capture_in_bands_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |info: CaptureInfo| CaptureWriter::create(folder.path().join("x"), info).unwrap_err().to_string();
    let png = CaptureInfo { format: ImageFormat::Png, transfer: Transfer::Srgb, ..info() };
    assert!(refused(png).contains("bands are written as EXR"));
    for nm in [vec![550.0, 450.0], vec![550.0, 550.0], vec![50.0], vec![f64::NAN], vec![550.0; 300]] {
        assert!(refused(CaptureInfo { wavelengths_nm: nm, ..info() }).contains("ascending wavelengths"));
    }
    let writer = CaptureWriter::create(folder.path().join("y"), info()).unwrap();
    assert!(writer.write(0, 0, &[0.0; 36]).unwrap_err().to_string().contains("texels of 5 channels"));
    let grey = CaptureInfo { wavelengths_nm: Vec::new(), ..info() };
    let grey = Capture::from_linear(grey, vec![0.5; 4 * 36]).unwrap();
    assert!(matches!(grey.through(&[]).unwrap_err(), CaptureError::NotSpectral { .. }));
    let twice = CaptureInfo { wavelengths_nm: vec![500.0; 5], ..info() };
    assert!(Capture::from_linear(twice, vec![0.5; 240]).unwrap_err().to_string().contains("do not ascend"));
}

#[test]
fn an_image_of_other_wavelengths_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let [path, other] = ["leaf", "other"].map(|name| folder.path().join(name));
    for (path, nm) in [(&path, NM), (&other, [450.0, 550.0, 650.0, 850.0, 1050.0])] {
        let writer = CaptureWriter::create(path, CaptureInfo { wavelengths_nm: nm.to_vec(), ..info() }).unwrap();
        (0..4).for_each(|pair| writer.write(pair / 2, pair % 2, &image(pair)).unwrap());
        writer.finish().unwrap();
    }
    let named = |root: &std::path::Path| {
        let view =
            std::fs::read_dir(root).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_dir()).max();
        std::fs::read_dir(view.unwrap()).unwrap().map(|entry| entry.unwrap().path()).max().unwrap()
    };
    std::fs::copy(named(&other), named(&path)).unwrap();
    let capture = Capture::open(&path).unwrap().through(&[[1.0; 3]; 5]).unwrap();
    let errors: Vec<String> =
        (0..4).filter_map(|pair| Some(capture.read(pair / 2, pair % 2).err()?.to_string())).collect();
    assert!(errors.len() == 1 && errors[0].contains("not those of the capture's first image"), "{errors:?}");
}
