//! Resident forms with packed bases: `btf-fit convert` and `compare` with `--resident-bytes` and `--resident-psnr`.

use crate::support::{btf_fit, bumpy_capture, refusal};
use serde_json::Value;

#[test]
fn packed_bases_keep_a_size_and_what_they_lose_is_measured() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    bumpy_capture(here, "capture", 14, 7);
    let json_of = |arguments: &[&str]| -> Value {
        let output = btf_fit(&[arguments, &["--json", "-"]].concat(), here);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    json_of(&["fit", "capture", "-o", "a.spmm", "--clusters=2", "--lobes=2"]);
    let number = |json: &Value, key: &str| json[key].as_f64().unwrap();
    let whole = number(&json_of(&["convert", "a.spmm", "-o", "whole.spmm"]), "bytes");

    let half = format!("--resident-bytes={}", whole / 2.0);
    let packed = number(&json_of(&["convert", "a.spmm", "-o", "packed.spmm", &half]), "bytes");
    // The file has a header beside the words.
    assert!(packed < whole / 2.0 + 2000.0 && packed > whole / 8.0, "{packed} of {whole}");
    let info = btf_fit(&["info", "packed.spmm"], here);
    assert!(String::from_utf8_lossy(&info.stdout).contains("bases packed"), "{info:?}");
    assert!(btf_fit(&["validate", "packed.spmm"], here).status.success());

    // A higher PSNR takes more bytes and loses less; planted difference: 25 dB are seen.
    let exact = number(&json_of(&["compare", "capture", "a.spmm"]), "psnr_db");
    let of_psnr = |db: &str| json_of(&["compare", "capture", "a.spmm", "--resident-psnr", db]);
    let [fine, coarse] = ["75", "25"].map(of_psnr);
    assert!((number(&fine, "psnr_db") - exact).abs() < 0.1, "{fine} {exact}");
    assert!(number(&coarse, "psnr_db") < exact - 1.0, "{coarse} {exact}");
    assert!(number(&coarse, "resident_bytes") < number(&fine, "resident_bytes"), "{coarse} {fine}");

    for (arguments, words) in [
        (&["convert", "a.spmm", "-o", "b.spmm", "--to", "plain", &half][..], "only the resident form has packed bases"),
        (&["convert", "a.spmm", "-o", "b.spmm", "--resident-bytes=2kB"], "takes"),
    ] {
        let (code, message) = refusal(&btf_fit(arguments, here));
        assert!(code != 0 && message.contains(words), "{arguments:?}: {message}");
        assert!(!here.join("b.spmm").exists());
    }
}
