//! The worker of a library: takes one material after the other that is not yet fitted, fits it, and writes its asset and
//! its record. Any number of workers share a plan.

use crate::error::FitError;
use crate::inspect::describe::family_name;
use crate::library::claim::{Asked, Claim, Claims, worker_name};
use crate::library::likeness::likeness;
use crate::library::plan::{LibraryPlan, PlannedMaterial};
use crate::library::record::{
    FittedMaterial, LibraryFolders, MaterialRecord, MaterialState, Outcome, read_record, record_key, state_of,
    write_record,
};
use crate::library::thumbnail::thumbnail;
use crate::monitor::Monitor;
use crate::params::FitParams;
use crate::peak_memory::peak_memory_bytes;
use crate::pipeline::fitted::{Fitted, fit_and_measure};
use crate::report::base64::base64;
use crate::resume::checkpoint::remove_finished_stages;
use btf_capture::{Capture, write_file_atomically};
use cpu_time::ProcessTime;
use glob::Pattern;
use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Workers that may be lost with a material before it counts as failed.
const MAX_LOST: u32 = 5;
/// Signs of life of a worker in the time after which its claim is stale.
const TOUCHES: u32 = 8;
/// Samples of a capture from which on finished stages are kept for a worker that takes over: below, a fit takes less time than
/// keeping them would be worth.
const MIN_RESUMED_SAMPLES: usize = 100_000_000;
/// Longest time between two looks at what other workers have left.
const MAX_WAIT: Duration = Duration::from_secs(10);

/// What a worker is asked for.
#[derive(Debug, Clone)]
pub struct RunParams {
    /// Share of the plan that the worker begins with, as `(number, count)` with numbers from 1.
    pub shard: (usize, usize),
    /// Globs over names; only these materials. Empty: all.
    pub only: Vec<Pattern>,
    /// Globs over names; these materials are fitted again though they are done.
    pub again: Vec<Pattern>,
    /// Whether to fit again what has failed.
    pub retry: bool,
    /// Whether to wait until other workers have finished, too, and to take over what they leave.
    pub wait: bool,
    /// Time without a sign of life after which this worker counts as lost.
    pub stale_after: Duration,
    /// Most memory of a fit, bytes, where the plan names none; `None`: that of a fit.
    pub memory_bytes: Option<u64>,
}

impl Default for RunParams {
    fn default() -> RunParams {
        RunParams {
            shard: (1, 1),
            only: Vec::new(),
            again: Vec::new(),
            retry: false,
            wait: false,
            stale_after: Duration::from_secs(300),
            memory_bytes: None,
        }
    }
}

/// What a worker has done. The names are the keys of `library run --json`.
#[derive(Debug, Default, Clone, PartialEq, serde::Serialize)]
pub struct RunOutcome {
    /// Materials that this worker fitted.
    pub fitted: usize,
    /// Materials that were done before or that others finished.
    pub done_before: usize,
    /// Materials that other workers are at.
    pub with_others: usize,
    /// Materials that failed before and were not tried again.
    pub failed_before: usize,
    /// Materials that failed with this worker, with the reason.
    pub failed: BTreeMap<String, String>,
    /// Seconds of fits, with pictures and features.
    pub fitting_s: f64,
    /// Seconds of everything.
    pub seconds: f64,
}

/// News of a worker.
#[derive(Debug)]
pub enum RunNews<'a> {
    /// A fit begins.
    Begun(&'a str),
    /// A fit is written.
    Fitted(&'a str, &'a FittedMaterial),
    /// A fit has failed.
    Failed(&'a str, &'a str),
}

/// Whether a claim was held until its material was done with.
#[derive(PartialEq)]
enum Held {
    ToTheEnd,
    Lost,
}

/// Fits the materials of the plan at `path` that are not yet done. A failure stops its material alone.
///
/// # Errors
/// A plan that cannot be read, a folder of assets that cannot be made, [`FitError::Interrupted`]; what has been fitted
/// stays, and the material at hand is given back.
pub fn run_library(
    path: &Path,
    params: &RunParams,
    monitor: &Monitor,
    news: &(dyn Fn(RunNews) + Sync),
) -> Result<RunOutcome, FitError> {
    let start = Instant::now();
    let plan = LibraryPlan::read(path)?;
    let folders = LibraryFolders::of_plan(&plan, path);
    folders.make()?;
    let claims = Claims::open(folders.claims(), worker_name(), params.stale_after)?;
    claims.sweep();
    let started_s = claims.clock_s();
    let worker = Worker { plan: &plan, folders: &folders, claims: &claims, params, monitor, news, started_s };
    let mut outcome = RunOutcome::default();
    let mut open = worker.order();
    loop {
        open = worker.pass(&open, &mut outcome)?;
        if open.is_empty() || !params.wait {
            break;
        }
        let until = Instant::now() + (params.stale_after / TOUCHES).min(MAX_WAIT);
        while Instant::now() < until {
            monitor.check()?;
            std::thread::sleep(Duration::from_millis(100));
        }
    }
    outcome.with_others = open.len();
    outcome.seconds = start.elapsed().as_secs_f64();
    Ok(outcome)
}

struct Worker<'a> {
    plan: &'a LibraryPlan,
    folders: &'a LibraryFolders,
    claims: &'a Claims,
    params: &'a RunParams,
    monitor: &'a Monitor,
    news: &'a (dyn Fn(RunNews) + Sync),
    /// When the worker started, seconds since 1970 by the clock of the file system.
    started_s: f64,
}

impl Worker<'_> {
    /// Returns the numbers of the materials in the order in which this worker asks for them: by priority, and among equal
    /// ones those of its own share first.
    fn order(&self) -> Vec<usize> {
        let (shard, count) = self.params.shard;
        let asked = |material: &PlannedMaterial| {
            self.params.only.is_empty() || self.params.only.iter().any(|glob| glob.matches(&material.name))
        };
        let materials = &self.plan.materials;
        let mut order: Vec<usize> = (0..materials.len()).filter(|number| asked(&materials[*number])).collect();
        let priority = |number: usize| self.plan.options_of(&materials[number]).priority.unwrap_or(0);
        let count = count.max(1);
        let turn = |number: usize| (number % count + count - (shard.max(1) - 1) % count) % count;
        order.sort_by_key(|number| (Reverse(priority(*number)), turn(*number), *number));
        order
    }

    /// Goes once through the materials `open`. Returns those that other workers are at.
    fn pass(&self, open: &[usize], outcome: &mut RunOutcome) -> Result<Vec<usize>, FitError> {
        let mut with_others = Vec::new();
        for number in open {
            self.monitor.check()?;
            let material = &self.plan.materials[*number];
            let key = record_key(material, &self.plan.options_of(material));
            let state = self.state(material, &key);
            if let MaterialState::Done(record) | MaterialState::Failed(record) = &state {
                self.claims.clear(&material.name, record.written_s);
            }
            match state {
                MaterialState::Done(_) => outcome.done_before += 1,
                MaterialState::Failed(_) => outcome.failed_before += 1,
                MaterialState::Open => match self.claims.ask(&material.name) {
                    Ok(Asked::Taken) => with_others.push(*number),
                    Ok(Asked::Held(claim)) => {
                        if self.fit_claimed(material, &key, &claim, outcome)? == Held::Lost {
                            with_others.push(*number);
                        }
                    }
                    // Such as a full disk: others may be smaller, or it may be freed.
                    Err(fault) => self.fail(&material.name, &fault.to_string(), outcome),
                },
            }
        }
        Ok(with_others)
    }

    /// Returns what has become of a material. One that is to be fitted again is open until a record is newer than this worker.
    fn state(&self, material: &PlannedMaterial, key: &str) -> MaterialState {
        let again = self.params.again.iter().any(|glob| glob.matches(&material.name));
        let current = |record: &MaterialRecord| record.key == key && !(again && record.written_s < self.started_s);
        let record = read_record(self.folders, &material.name).filter(current);
        match state_of(self.folders, &material.name, record) {
            MaterialState::Failed(record) if self.params.retry && record.written_s < self.started_s => {
                MaterialState::Open
            }
            other => other,
        }
    }

    /// Notes that a material has failed.
    fn fail(&self, name: &str, reason: &str, outcome: &mut RunOutcome) {
        (self.news)(RunNews::Failed(name, reason));
        outcome.failed.insert(name.into(), reason.into());
    }

    /// Fits a claimed material and writes what becomes of it.
    fn fit_claimed(
        &self,
        material: &PlannedMaterial,
        key: &str,
        claim: &Claim,
        outcome: &mut RunOutcome,
    ) -> Result<Held, FitError> {
        let name = material.name.as_str();
        // Another worker may have finished it between the look and the claim.
        match self.state(material, key) {
            MaterialState::Open => {}
            MaterialState::Done(_) => {
                outcome.done_before += 1;
                return Ok(Held::ToTheEnd);
            }
            MaterialState::Failed(_) => {
                outcome.failed_before += 1;
                return Ok(Held::ToTheEnd);
            }
        }
        (self.news)(RunNews::Begun(name));
        let (start, processor) = (Instant::now(), ProcessTime::now());
        let result = match claim.lost_before {
            0..MAX_LOST => self.fit_heard(material, claim),
            lost => Err(FitError::Library(format!(
                "{lost} workers were lost while they fitted it, killed or out of memory; fit it alone with `btf-fit fit`, or give less `memory`"
            ))),
        };
        let (seconds, processor_s) = (start.elapsed().as_secs_f64(), processor.elapsed().as_secs_f64());
        outcome.fitting_s += seconds;
        // Interrupted by its user: the material is given back.
        self.monitor.check()?;
        if !claim.is_held() {
            // Another worker has taken over, and writes the record.
            return Ok(Held::Lost);
        }
        let outcome_of = match result {
            Ok(fitted) => Outcome::Fitted(Box::new(fitted)),
            Err(fault) => Outcome::Failed(fault.to_string()),
        };
        let record = MaterialRecord {
            key: key.into(),
            worker: self.claims.worker().into(),
            written_s: self.claims.clock_s(),
            seconds,
            processor_s,
            outcome: outcome_of,
        };
        let written = write_record(self.folders, name, &record);
        let reason = match (&record.outcome, written) {
            (Outcome::Fitted(fitted), Ok(())) => {
                outcome.fitted += 1;
                (self.news)(RunNews::Fitted(name, fitted));
                return Ok(Held::ToTheEnd);
            }
            (Outcome::Fitted(_), Err(fault)) => fault.to_string(),
            (Outcome::Failed(reason), _) => reason.clone(),
        };
        self.fail(name, &reason, outcome);
        Ok(Held::ToTheEnd)
    }

    /// Fits a material and keeps the remarks that are made on the way.
    fn fit_heard(&self, material: &PlannedMaterial, claim: &Claim) -> Result<FittedMaterial, FitError> {
        let remarks = Arc::new(Mutex::new(Vec::new()));
        let heard = Arc::clone(&remarks);
        let monitor = self.monitor.of_one().on_remark(move |sentence| {
            if let Ok(mut heard) = heard.lock() {
                heard.push(sentence.to_string());
            }
        });
        let mut fitted = self.alive(claim, &monitor, || self.fit(material, claim, &monitor))?;
        if let Ok(remarks) = remarks.lock() {
            fitted.remarks.splice(..0, remarks.iter().cloned());
        }
        Ok(fitted)
    }

    /// Runs `work` while a second thread tells that this worker is alive, and cancels `monitor` where the claim is lost.
    fn alive<T>(
        &self,
        claim: &Claim,
        monitor: &Monitor,
        work: impl FnOnce() -> Result<T, FitError>,
    ) -> Result<T, FitError> {
        let over = AtomicBool::new(false);
        let every = self.params.stale_after / TOUCHES;
        std::thread::scope(|scope| {
            let beating = scope.spawn(|| {
                loop {
                    std::thread::park_timeout(every);
                    if over.load(Ordering::Acquire) {
                        break;
                    }
                    if !claim.touch() && !claim.is_held() {
                        monitor.cancel();
                        break;
                    }
                }
            });
            // A fault of ours in one material must not end the others.
            let result = catch_unwind(AssertUnwindSafe(work));
            over.store(true, Ordering::Release);
            beating.thread().unpark();
            result.unwrap_or_else(|_| {
                Err(FitError::Library("the program has a fault that this material brings out; please report it".into()))
            })
        })
    }

    /// Fits a material and writes its asset.
    fn fit(&self, material: &PlannedMaterial, claim: &Claim, monitor: &Monitor) -> Result<FittedMaterial, FitError> {
        let paths = self.folders.captures(material);
        let captures = paths.iter().map(Capture::open).collect::<Result<Vec<_>, _>>()?;
        let asset = self.folders.asset(&material.name);
        let options = self.plan.options_of(material);
        let mut params = options.params(&self.folders.assets);
        if let (None, Some(bytes)) = (&options.memory, self.params.memory_bytes) {
            params.memory_bytes = bytes;
        }
        params.suit(&captures, options.clusters, options.lobes);
        let samples: usize = captures.iter().map(|c| 3 * c.info().pair_count() * c.info().texel_count()).sum();
        let kept: Option<PathBuf> =
            (samples >= MIN_RESUMED_SAMPLES).then(|| self.folders.assets.join(format!("{}.resume", material.name)));
        params.resume = kept.clone();
        let fitted = match fit_and_measure(&captures, &params.check()?, monitor) {
            // The worker that was taken for lost still works: without what it keeps, both can.
            Err(FitError::InUse { .. }) => {
                let alone = FitParams { resume: None, ..params.clone() };
                fit_and_measure(&captures, &alone.check()?, monitor)?
            }
            other => other?,
        };
        let mut described = describe(&fitted, monitor)?;
        if let Some(asked) = params.psnr_db.filter(|asked| fitted.metrics.psnr_db < *asked) {
            let reached = fitted.metrics.psnr_db;
            described.remarks.push(format!("{reached:.2} dB were reached, psnr asks for {asked}; give more clusters"));
        }
        if !claim.is_held() {
            return Err(FitError::Interrupted);
        }
        self.monitor.check()?;
        write_file_atomically(&asset, &fitted.bytes)?;
        if let Some(folder) = kept {
            remove_finished_stages(&folder);
        }
        Ok(described)
    }
}

/// Returns what a catalogue shows of an asset.
fn describe(fitted: &Fitted, monitor: &Monitor) -> Result<FittedMaterial, FitError> {
    let mut families = BTreeMap::new();
    for family in
        fitted.asset.layers.iter().flat_map(|layer| &layer.dictionary).flatten().map(|entry| entry.lobe.family)
    {
        *families.entry(family_name(family).to_string()).or_insert(0) += 1;
    }
    let first = &fitted.asset.layers[0];
    Ok(FittedMaterial {
        blake3: blake3::hash(&fitted.bytes).to_hex().to_string(),
        bytes: fitted.bytes.len() as u64,
        size: [fitted.asset.width, fitted.asset.height],
        directions: [first.views.len(), first.lights.len()],
        layers: fitted.asset.layers.len(),
        metrics: fitted.metrics,
        remarks: Vec::new(),
        families,
        likeness: likeness(&fitted.resident),
        thumbnail: base64(&thumbnail(&fitted.resident)?),
        stages: monitor.stages().into_iter().map(|stage| (stage.name, stage.seconds)).collect(),
        peak_memory_bytes: peak_memory_bytes(),
    })
}
