//! `btf-fit library`: many captures, workers that are killed, and a catalogue.

use crate::support::{btf_fit, bumpy_capture_of, refusal, skip};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Makes a library of `count` captures and a plan of them.
fn library(folder: &Path, count: usize, plan_options: &[&str]) {
    let captures = folder.join("captures");
    fs::create_dir_all(captures.join("more")).unwrap();
    for number in 0..count {
        let place = if number % 2 == 0 { "" } else { "more/" };
        bumpy_capture_of(&captures, &format!("{place}m{number:03}"), [6, 5], 4, number as u64 + 1);
    }
    let arguments = [&["library", "plan", "captures", "-o", "library.toml", "--bytes", "8kB"], plan_options].concat();
    let output = btf_fit(&arguments, folder);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

fn assets(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    // Workers make the folder when they have started.
    let names = fs::read_dir(folder.join("assets")).into_iter().flatten().map(|entry| entry.unwrap().path());
    let assets = names.filter(|path| path.extension().is_some_and(|extension| extension == "spmm"));
    assets.map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(&path).unwrap())).collect()
}

fn worker(folder: &Path, shard: &str) -> Child {
    Command::new(env!("CARGO_BIN_EXE_btf-fit"))
        .args(["library", "run", "library.toml", "--shard", shard, "--stale-after", "1", "--threads", "1", "--quiet"])
        .current_dir(folder)
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("btf-fit starts")
}

fn json(folder: &Path, name: &str) -> serde_json::Value {
    serde_json::from_slice(&fs::read(folder.join(name)).unwrap()).unwrap()
}

#[test]
fn workers_that_are_killed_lose_nothing_and_fit_nothing_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    let [calm, wild] = ["calm", "wild"].map(|name| folder.path().join(name));
    for folder in [&calm, &wild] {
        fs::create_dir(folder).unwrap();
        library(folder, 24, &[]);
    }
    let output = btf_fit(&["library", "run", "library.toml", "--json", "run.json", "--quiet"], &calm);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let told = json(&calm, "run.json");
    assert_eq!((told["fitted"].as_u64(), told["done_before"].as_u64()), (Some(24), Some(0)));
    // What is done is done.
    let again = btf_fit(&["library", "run", "library.toml", "--json", "-", "--quiet"], &calm);
    let again: serde_json::Value = serde_json::from_slice(&again.stdout).unwrap();
    assert_eq!((again["fitted"].as_u64(), again["done_before"].as_u64()), (Some(0), Some(24)));

    // Three workers, of which one is killed every now and then, after times of a fixed sequence.
    let mut workers: Vec<Child> = ["1/3", "2/3", "3/3"].map(|shard| worker(&wild, shard)).into();
    let (start, mut kills) = (Instant::now(), 0);
    while assets(&wild).len() < 24 || workers.iter_mut().any(|worker| worker.try_wait().unwrap().is_none()) {
        assert!(start.elapsed() < Duration::from_secs(240), "{} assets", assets(&wild).len());
        let number = kills % 3;
        std::thread::sleep(Duration::from_millis(150 + 90 * (kills as u64 * 7 % 5)));
        if kills < 12 {
            workers[number].kill().unwrap();
            workers[number].wait().unwrap();
            kills += 1;
        }
        if workers[number].try_wait().unwrap().is_some() && assets(&wild).len() < 24 {
            workers[number] = worker(&wild, ["1/3", "2/3", "3/3"][number]);
        }
    }
    assert!(kills > 5, "{kills}");
    // A worker that waits takes over what the last ones left.
    let last = btf_fit(&["library", "run", "library.toml", "--stale-after", "1", "--wait", "--quiet"], &wild);
    assert!(last.status.success(), "{}", String::from_utf8_lossy(&last.stderr));
    assert_eq!(assets(&wild), assets(&calm), "the same bytes as of an undisturbed run");
    // A worker may have been killed between its record and giving the claim back; the next one clears that away.
    std::thread::sleep(Duration::from_secs(3));
    let next = btf_fit(&["library", "run", "library.toml", "--quiet"], &wild);
    assert!(next.status.success(), "{}", String::from_utf8_lossy(&next.stderr));
    let left: Vec<_> =
        fs::read_dir(wild.join("assets/claims")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| name.to_string_lossy().starts_with('.')), "no claim is left: {left:?}");
}

#[test]
fn a_capture_that_cannot_be_fitted_stops_itself_alone_and_the_catalogue_tells_why() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    library(folder, 6, &["--rule", "m00[01]: psnr=30 priority=3"]);
    let victim =
        fs::read_dir(folder.join("captures/m004")).unwrap().flatten().find(|e| e.path().is_dir()).unwrap().path();
    let image = fs::read_dir(victim).unwrap().flatten().next().unwrap().path();
    fs::write(&image, b"no image").unwrap();

    let (code, told) = {
        let output = btf_fit(&["library", "run", "library.toml", "--quiet"], folder);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code(), text)
    };
    assert_eq!(code, Some(1));
    assert!(told.contains("m004 failed: ") && told.contains("1 material failed (m004)"), "{told}");
    assert_eq!(assets(folder).len(), 5);

    let output = btf_fit(&["library", "collect", "library.toml"], folder);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stdout).contains("5 fitted, 1 failed"));
    let figures = json(folder, "library.json");
    let material = |name: &str| {
        let all = figures["materials"].as_array().unwrap();
        all.iter().find(|material| material["name"] == name).unwrap().clone()
    };
    assert_eq!(material("m004")["status"], "failed");
    assert!(material("m004")["reason"].as_str().unwrap().contains(&*image.file_name().unwrap().to_string_lossy()));
    assert!(material("m000")["fitted"]["metrics"]["psnr_db"].as_f64().unwrap() >= 30.0);
    let page = fs::read_to_string(folder.join("library.html")).unwrap();
    assert!(page.contains("data:image/jpeg;base64") && !page.contains("http://") && !page.contains("https://"));
    let csv = fs::read_to_string(folder.join("library.csv")).unwrap();
    let columns = csv.lines().next().unwrap().split(',').count();
    assert_eq!(csv.lines().count(), 7);
    assert!(csv.lines().filter(|line| !line.contains('"')).all(|line| line.split(',').count() == columns), "{csv}");

    // A damaged asset is noticed, and fitted anew where that is asked for.
    let path = folder.join("assets/m001.spmm");
    let good = fs::read(&path).unwrap();
    let mut bad = good.clone();
    bad[good.len() / 2] ^= 1;
    fs::write(&path, &bad).unwrap();
    let output = btf_fit(&["library", "collect", "library.toml"], folder);
    assert!(String::from_utf8_lossy(&output.stderr).contains("m001 is damaged"));
    let output = btf_fit(&["library", "run", "library.toml", "--again", "m001", "--quiet"], folder);
    assert!(output.status.success(), "what has failed is not tried again");
    assert_eq!(fs::read(&path).unwrap(), good);
}

/// A file system of its own, in a name space of its own, is full after some of the materials; later it is made larger.
#[test]
fn a_full_disk_stops_what_has_no_room_and_later_that_is_fitted_too() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    library(folder, 6, &[]);
    let output = btf_fit(&["library", "run", "library.toml", "--quiet"], folder);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let calm = assets(folder);
    fs::rename(folder.join("assets"), folder.join("calm")).unwrap();
    fs::create_dir(folder.join("assets")).unwrap();

    // An asset takes two pages, and a record as many.
    let script = "mount -t tmpfs -o size=72k none assets || exit 77
        \"$0\" library run library.toml --quiet --threads 1 2> told; echo $? >> told
        cp -r assets full
        mount -o remount,size=9m assets
        \"$0\" library run library.toml --retry --quiet --threads 1; code=$?
        cp -r assets roomy
        exit $code";
    let ended = Command::new("unshare")
        .args(["--user", "--map-root-user", "--mount", "sh", "-c", script, env!("CARGO_BIN_EXE_btf-fit")])
        .current_dir(folder)
        .status();
    let ended = match ended {
        Ok(ended) if ended.success() || folder.join("full").exists() => ended,
        // No `unshare` here, or name spaces are not for everyone.
        _ => return skip("a_full_disk_stops_what_has_no_room_and_later_that_is_fitted_too (no file system to fill)"),
    };
    let told = fs::read_to_string(folder.join("told")).unwrap();
    assert!(told.contains("free space on that disk") && told.ends_with("\n1\n"), "{told}");
    let of = |name: &str| {
        let names = fs::read_dir(folder.join(name)).unwrap().map(|entry| entry.unwrap().path());
        let files = names.filter(|path| path.is_file());
        files
            .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(path).unwrap()))
            .collect::<BTreeMap<_, _>>()
    };
    let full = of("full");
    assert!((1..6).contains(&full.len()) && full.iter().all(|(name, bytes)| calm[name] == *bytes), "{:?}", full.keys());
    assert_eq!(told.matches(" failed: ").count(), 6 - full.len(), "{told}");
    assert!(ended.success());
    assert_eq!(of("roomy"), calm);
}

#[test]
fn what_is_left_is_told_in_hours_and_bytes_and_what_is_done_corrects_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    library(folder, 5, &["--rule", "m004: psnr=30"]);
    fs::create_dir(folder.join("captures/empty")).unwrap();
    fs::write(folder.join("captures/empty/capture.toml"), "name = \"nothing\"\n").unwrap();
    let estimate = || {
        let options = ["--update", "--estimate", "--workers", "2", "--worker-threads", "3", "--json", "-"];
        let output = btf_fit(&[&["library", "plan", "captures", "-o", "library.toml"][..], &options].concat(), folder);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(String::from_utf8_lossy(&output.stderr).contains("empty is left out"));
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    let number = |estimate: &serde_json::Value, key: &str| estimate[key].as_f64().unwrap();
    let before = estimate();
    assert_eq!((number(&before, "open"), number(&before, "done"), number(&before, "corrected_by")), (5.0, 0.0, 0.0));
    assert!(before["unknown"]["empty"].is_string());
    let hours: f64 = before["materials"].as_array().unwrap().iter().map(|one| number(one, "core_hours")).sum();
    assert!(hours > 0.0 && (number(&before, "core_hours") / hours - 1.0).abs() < 1e-9);
    assert!(number(&before, "hours") <= hours && 6.0 * number(&before, "hours") >= hours * (1.0 - 1e-9));
    // Four of 8 kB, and one whose size nobody knows.
    let [least, most] = [0, 1].map(|end| before["asset_bytes_range"][end].as_f64().unwrap());
    let bytes = number(&before, "asset_bytes");
    assert!(least < bytes && bytes < most && bytes > 32_000.0, "{least} {bytes} {most}");
    assert!(number(&before, "memory_bytes") > 1e6);

    let output = btf_fit(&["library", "run", "library.toml", "--only", "m00[0-3]", "--quiet"], folder);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let after = estimate();
    assert_eq!((number(&after, "open"), number(&after, "done"), number(&after, "corrected_by")), (1.0, 4.0, 4.0));
    let factor = number(&after, "correction");
    assert!(factor > 0.0 && factor.is_finite());
    let last = |estimate: &serde_json::Value| {
        let all = estimate["materials"].as_array().unwrap();
        number(all.iter().find(|one| one["name"] == "m004").unwrap(), "core_hours")
    };
    // The speed of the processor is measured anew each time.
    let speeds = number(&after, "product_gflops") / number(&before, "product_gflops");
    assert!((last(&after) / last(&before) * speeds / factor - 1.0).abs() < 0.2, "{factor} {speeds}");

    let plain = btf_fit(&["library", "plan", "captures", "-o", "library.toml", "--update", "--estimate"], folder);
    let told = String::from_utf8_lossy(&plain.stdout).into_owned();
    assert!(told.contains("1 materials (4 done)") && told.contains("as 4 fits of this library were"), "{told}");
    let (_, told) = refusal(&btf_fit(
        &["library", "plan", "captures", "-o", "library.toml", "--update", "--estimate", "--cost", "library.toml"],
        folder,
    ));
    assert!(told.contains("btf-fit bench cost"), "{told}");
}

#[test]
fn plans_grow_and_odd_ones_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    library(folder, 2, &["--slurm", "job.sh", "--commands", "commands.txt", "--workers", "3"]);
    assert_eq!(fs::read_to_string(folder.join("commands.txt")).unwrap().lines().count(), 3);
    assert!(fs::read_to_string(folder.join("job.sh")).unwrap().contains("#SBATCH --array=1-3"));
    bumpy_capture_of(&folder.join("captures"), "new", [6, 5], 4, 9);
    let refused = |arguments: &[&str]| refusal(&btf_fit(arguments, folder));
    let (code, told) = refused(&["library", "plan", "captures", "-o", "library.toml"]);
    assert!(code == 1 && told.contains("--update"), "{told}");
    let output = btf_fit(&["library", "plan", "captures", "-o", "library.toml", "--update"], folder);
    assert!(String::from_utf8_lossy(&output.stdout).contains("3 materials, 1 of them new"));
    let plan = fs::read_to_string(folder.join("library.toml")).unwrap();
    assert!(plan.contains("bytes = \"8kB\"") && plan.contains("captures/more/m001"), "{plan}");
    let (_, told) = refused(&["library", "plan", "captures", "-o", "other.toml", "--match", "nothing*"]);
    assert!(told.contains("no captures that match"), "{told}");
    let (_, told) = refused(&["library", "run", "gone.toml"]);
    assert!(told.contains("gone.toml"), "{told}");
    fs::write(folder.join("bad.toml"), "version = 1\nassets = \"a\"\nmaterial = 3\n").unwrap();
    let (_, told) = refused(&["library", "collect", "bad.toml"]);
    assert!(told.contains("bad.toml line 3"), "{told}");
}
