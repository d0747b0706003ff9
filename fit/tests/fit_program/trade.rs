//! `btf-fit trade` as a user runs it.

use crate::support::{btf_fit, bumpy_capture as capture, refusal};

#[test]
fn a_trade_has_its_table_page_and_plots_and_the_asset_of_a_row_is_what_fit_makes() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    capture(here, "capture", 14, 7);
    let arguments = [
        "trade",
        "capture",
        "--quick",
        "--clusters",
        "2",
        "--lobes",
        "0,2",
        "-o",
        "out",
        "--json",
        "-",
        "--seed",
        "3",
        "--gpu",
        "none",
    ];
    let output = btf_fit(&arguments, here);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let points = json["points"].as_array().unwrap();
    assert!(points.len() >= 16, "{} points", points.len());
    let mut names: Vec<_> =
        std::fs::read_dir(here.join("out")).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["bytes-psnr.svg", "ns-between.svg", "ns-psnr.svg", "trade.csv", "trade.html"]);
    assert_eq!(json["gpu"], "not measured: --gpu none");
    let table = std::fs::read_to_string(here.join("out/trade.csv")).unwrap();
    assert_eq!(table.lines().count(), points.len() + 1);
    let page = std::fs::read_to_string(here.join("out/trade.html")).unwrap();
    assert!(page.contains("</html>") && !page.contains("http"));

    let number = |point: &serde_json::Value, key: &str| point[key].as_f64().unwrap_or(f64::INFINITY);
    for point in points {
        assert!(number(point, "cpu_ns") > 0.0 && point["gpu_ns"].is_null(), "{point}");
        assert!(number(point, "psnr_db") > 5.0 && number(point, "bytes") > 500.0, "{point}");
    }
    for (key, is) in [("interpolation", "exact"), ("precision", "single"), ("limit", "decode"), ("role", "base")] {
        assert!(points.iter().any(|point| point[key] == is), "{key} {is}");
    }
    // Lobes alone: the first tier of either role, smaller than anything with a residual on them.
    for role in ["guide", "base"] {
        let of_role = |p: &&serde_json::Value| p["lobes"] == 2 && p["role"] == role;
        let alone: Vec<_> = points.iter().filter(of_role).filter(|p| p["limit"] == "lobes").collect();
        assert_eq!(alone.len(), 1, "{role}");
        assert!(alone[0]["bits"].is_null() && alone[0]["components"] == 0);
        let with = points.iter().filter(of_role).filter(|p| p["limit"] != "lobes");
        assert!(with.map(|p| number(p, "bytes")).all(|bytes| bytes > number(alone[0], "bytes")), "{role}");
    }
    // Finer steps: more bytes, a better picture. Prefixes: fewer bytes than the whole.
    let whole: Vec<_> = points
        .iter()
        .filter(|p| p["limit"] == "none" && p["lobes"] == 0 && p["interpolation"] == "fast" && p["precision"] == "half")
        .collect();
    assert!(whole.len() >= 2, "{} steps", whole.len());
    assert!(number(whole[0], "bytes") < number(whole[whole.len() - 1], "bytes"));
    assert!(number(whole[0], "psnr_db") < number(whole[whole.len() - 1], "psnr_db"));
    // The two rules agree at measured directions and not between them; single precision takes more memory.
    let twin = |key: &str, is: &str| {
        points
            .iter()
            .find(|p| {
                ["lobes", "role", "bits", "limit", "components", "interpolation", "precision"]
                    .iter()
                    .all(|k| if *k == key { p[*k] == is } else { p[*k] == whole[0][*k] })
            })
            .unwrap()
    };
    let exact = twin("interpolation", "exact");
    assert_eq!(exact["psnr_db"], whole[0]["psnr_db"]);
    assert_ne!(exact["psnr_between_db"], whole[0]["psnr_between_db"]);
    assert!(number(twin("precision", "single"), "resident_bytes") > number(whole[0], "resident_bytes"));
    // All pairs were measured for the front, and some points are not on it.
    let front: Vec<_> = points.iter().filter(|p| p["front_bytes_psnr"] == true).collect();
    assert!(!front.is_empty() && front.len() < points.len());
    assert!(
        json["summary"]
            .as_array()
            .unwrap()
            .iter()
            .all(|i| !points[i.as_u64().unwrap() as usize]["all_pairs"].is_null())
    );

    // `fit --bytes` and `fit --psnr` reach the row of that size and of that PSNR: one code makes all three. Without
    // lobes the sizes differ by the description and by what is between two steps alone.
    let row = whole[whole.len() / 2];
    let fit = |goal: &str| {
        let arguments =
            ["fit", "capture", "-o", "a.spmm", "--clusters=2", "--lobes=0", "--seed=3", goal, "--json", "-"];
        let output = btf_fit(&arguments, here);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    let all_psnr = |point: &serde_json::Value| point["all_pairs"]["psnr_db"].as_f64();
    let fitted = fit(&format!("--bytes={}", number(row, "bytes") as u64 + 4096));
    let psnr = all_psnr(row).unwrap_or(number(row, "psnr_db") - 0.2);
    assert!(number(&fitted, "psnr_db") > psnr - 0.1, "{fitted} against {row}");
    let fitted = fit(&format!("--psnr={:.2}", psnr - 0.2));
    assert!(number(&fitted, "bytes") < 1.1 * number(row, "bytes"), "{fitted} against {row}");

    // Figures but times do not depend on threads.
    let again = btf_fit(&[&arguments[..], &["--threads", "1"]].concat(), here);
    let again: serde_json::Value = serde_json::from_slice(&again.stdout).unwrap();
    let again = again["points"].as_array().unwrap();
    assert_eq!(again.len(), points.len());
    for (a, b) in again.iter().zip(points) {
        for key in ["bytes", "psnr_db", "psnr_linear_db", "psnr_between_db", "components", "front_bytes_psnr"] {
            assert_eq!(a[key], b[key], "{key}");
        }
    }
}

#[test]
fn a_reference_is_what_interpolation_is_measured_on() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    capture(here, "capture", 8, 7);
    capture(here, "other", 5, 8);
    let output = btf_fit(
        &[
            "trade",
            "capture",
            "--quick",
            "--clusters=2",
            "--lobes=0",
            "--gpu=none",
            "--reference",
            "other",
            "--components=0",
            "--csv",
            "t.csv",
            "--json",
            "-",
        ],
        here,
    );
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(json["between"].as_str().unwrap().contains("25 pairs of the capture other"), "{}", json["between"]);
    let points = json["points"].as_array().unwrap();
    assert!(!points.is_empty() && points.iter().all(|point| point["psnr_between_db"].is_f64()));
    assert!(here.join("t.csv").is_file());
}

#[test]
fn bad_input_is_one_sentence_and_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    capture(here, "capture", 4, 7);
    std::fs::write(here.join("bad.json"), "{}").unwrap();
    let before = std::fs::read_dir(here).unwrap().count();
    for (arguments, code, word) in [
        (vec!["trade", "nowhere"], 1, "nowhere"),
        (vec!["trade", "capture", "--lobes", "40"], 2, "--lobes"),
        (vec!["trade", "capture", "--components", "129"], 2, "--components"),
        (vec!["trade", "capture", "--pairs", "0"], 2, "--pairs"),
        (vec!["trade", "capture", "--csv", "-"], 2, "standard output"),
        (vec!["trade", "capture", "--csv", "a", "--html", "./a"], 2, "two outputs"),
        (vec!["trade", "capture", "--gpu", "no such adapter", "-o", "out"], 1, "no such adapter"),
        (vec!["trade", "capture", "-o", "bad.json"], 1, "bad.json"),
        (vec!["trade", "capture", "-o", "capture/out"], 1, "lies in the input"),
        (vec!["trade", "capture", "--html", "capture/a.html"], 1, "lies in the input"),
        (vec!["trade", "capture", "--reference", "bad.json"], 1, "bad.json"),
    ] {
        let (found, text) = refusal(&btf_fit(&arguments, here));
        assert!(found == code && text.contains(word), "{arguments:?}: {found} {text}");
    }
    assert_eq!(btf_fit(&["trade", "capture", "--lobes", "many"], here).status.code(), Some(2));
    assert_eq!(btf_fit(&["trade", "capture", "--roles", "leader"], here).status.code(), Some(2));
    assert_eq!(std::fs::read_dir(here).unwrap().count(), before, "something was left behind");
    assert!(!here.join("capture/out").exists());
}
