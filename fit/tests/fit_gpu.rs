//! What `btf-fit` does with a GPU.

#[path = "fit_program/support.rs"]
mod support;

use support::{btf_fit, bumpy_capture, skip};

/// A missing adapter is a failure, unless `BTF_SKIP_GPU=1` is set.
#[test]
fn an_adapter_gives_times_of_every_setting_in_half_precision() {
    if std::env::var_os("BTF_SKIP_GPU").is_some_and(|value| value == "1") {
        return skip("an_adapter_gives_times_of_every_setting_in_half_precision (BTF_SKIP_GPU=1)");
    }
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    bumpy_capture(here, "capture", 4, 7);
    let arguments = ["trade", "capture", "--quick", "--clusters=2", "--lobes=1", "-o", "out", "--json", "-"];
    let output = btf_fit(&arguments, here);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let points = json["points"].as_array().unwrap();
    for point in points {
        assert_eq!(point["gpu_ns"].as_f64().is_some_and(|ns| ns > 0.0), point["precision"] == "half", "{point}");
    }
    let kind = if json["gpu_is_software"] == true { ",software," } else { ",gpu," };
    let table = std::fs::read_to_string(here.join("out/trade.csv")).unwrap();
    let timed = points.iter().filter(|point| point["precision"] == "half").count();
    assert_eq!(table.matches(kind).count(), timed);
    assert!(here.join("out/gpu-psnr.svg").is_file());
}
