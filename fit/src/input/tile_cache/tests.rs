//! Tests of `tile_cache.rs`.

use super::*;
use crate::params::FitParams;
use crate::resume::checkpoint::Checkpoint;
use btf_capture::{CaptureInfo, CaptureWriter, DirectionSet, ImageFormat};
use std::sync::{Arc, Mutex};

fn capture(path: &Path) -> Capture {
    let set = DirectionSet::random(4, 1).unwrap();
    // More than one block.
    let info = CaptureInfo::new("noise", 40, 33, set.clone(), set, ImageFormat::Png);
    let writer = CaptureWriter::create(path, info).unwrap();
    for pair in 0..16 {
        let image: Vec<f32> = (0..40 * 33 * 3).map(|i| ((i * 7919 + pair * 104_729) % 256) as f32 / 255.0).collect();
        writer.write(pair / 4, pair % 4, &image).unwrap();
    }
    writer.finish().unwrap();
    Capture::open(path).unwrap()
}

fn samples(cache: &TileCache) -> Vec<f32> {
    let mut all = Vec::new();
    let mut row = vec![0.0; cache.pair_count() * 3];
    for tile in 0..cache.tile_count() {
        let tile = cache.read(tile).unwrap();
        for index in 0..tile.texels.len() {
            tile.texel_linear(index, &mut row);
            all.extend_from_slice(&row);
        }
    }
    all
}

#[test]
fn a_decoded_capture_in_a_file_is_kept_taken_again_and_refused_when_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let capture = capture(&folder.path().join("capture"));
    let resume = folder.path().join("a.spmm.resume");
    let params = FitParams { resume: Some(resume.clone()), ..FitParams::default() };
    let remarks = Arc::new(Mutex::new(Vec::<String>::new()));
    let run = || {
        let heard = Arc::clone(&remarks);
        let monitor = Monitor::default().on_remark(move |text| heard.lock().unwrap().push(text.to_string()));
        let checkpoint = Checkpoint::open(std::slice::from_ref(&capture), &params.check().unwrap(), &monitor).unwrap();
        let stages = checkpoint.layer(0, 1);
        let cache = TileCache::new(&capture, 1000, folder.path(), f32::INFINITY, Some(&stages), &monitor).unwrap();
        (samples(&cache), monitor.skipped(), monitor.stages().len())
    };
    let (first, skipped, stages) = run();
    assert_eq!((skipped.len(), stages), (0, 1));
    let (again, skipped, stages) = run();
    assert_eq!((again == first, skipped, stages), (true, vec!["read".to_string()], 0));
    assert!(remarks.lock().unwrap().is_empty());
    let file = std::fs::read_dir(&resume).unwrap().map(|entry| entry.unwrap().path());
    let file = file.into_iter().find(|path| path.extension().is_some_and(|end| end == "texels")).unwrap();
    let whole = std::fs::read(&file).unwrap();
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 4;
    for damaged in [&flipped[..], &whole[..whole.len() - 1], &[]] {
        std::fs::write(&file, damaged).unwrap();
        let (again, skipped, _) = run();
        assert_eq!((again == first, skipped.len()), (true, 0));
        assert_eq!(std::mem::take(&mut *remarks.lock().unwrap()).len(), 1);
    }
    std::fs::remove_file(&file).unwrap();
    assert!(run().0 == first);
}
