//! Claims: which worker fits which material, for any number of workers on one file system.
//!
//! A claim is a folder that is written under another name and renamed to `claims/NAME`. Renaming a folder onto one that
//! holds something fails on every system, so one worker alone succeeds; and a claim is whole from its first moment. The
//! worker touches its claims while it works. A claim that was not touched for a while is stale: it is renamed away, which
//! again only one worker can do, and looked at once more, because it might have been taken over in between. A worker
//! whose claim is gone gives its work up. In the worst case two workers fit one material at once; they write the same
//! bytes.

use crate::error::FitError;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

/// File in a claim that tells who holds it, and whose time of change tells when that worker was last alive.
const HOLDER: &str = "holder.json";

/// Holder of a claim.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Holder {
    /// Worker: host, process and a random number.
    pub worker: String,
    /// Number of workers that have tried before and were not heard of again.
    pub lost_before: u32,
}

/// The folder of the claims, as one worker sees it.
#[derive(Debug)]
pub struct Claims {
    folder: PathBuf,
    worker: String,
    stale_after: Duration,
    /// Number of the next temporary name.
    next: AtomicU64,
}

/// A claim that this worker holds. Dropped, it is given back.
#[derive(Debug)]
pub struct Claim<'a> {
    claims: &'a Claims,
    folder: PathBuf,
    /// Workers that were lost with this material before.
    pub lost_before: u32,
}

/// Outcome of asking for a material.
#[derive(Debug)]
pub enum Asked<'a> {
    /// It is this worker's now.
    Held(Claim<'a>),
    /// Another worker has it.
    Taken,
}

impl Claims {
    /// Opens the folder of the claims, and makes it where it is missing. `stale_after` is the time without a sign of life
    /// after which a claim is taken over.
    ///
    /// # Errors
    /// [`FitError::File`] if the folder cannot be made.
    pub fn open(folder: PathBuf, worker: String, stale_after: Duration) -> Result<Claims, FitError> {
        fs::create_dir_all(&folder).map_err(|source| failed(&folder, "making the folder of claims", source))?;
        Ok(Claims { folder, worker, stale_after, next: AtomicU64::new(0) })
    }

    /// Returns the name of this worker.
    pub fn worker(&self) -> &str {
        &self.worker
    }

    /// Asks for the material `name`.
    ///
    /// # Errors
    /// [`FitError::File`] if the file system does not take a claim.
    pub fn ask(&self, name: &str) -> Result<Asked<'_>, FitError> {
        let folder = self.folder.join(name);
        let mut lost_before = 0;
        // Looked at first: most claims that exist are fresh, and a look is cheaper than a try.
        if let Some(holder) = self.stale(&folder)? {
            if !self.take_over(&folder, &holder)? {
                return Ok(Asked::Taken);
            }
            lost_before = holder.map_or(1, |holder| holder.lost_before + 1);
        } else if folder.exists() {
            return Ok(Asked::Taken);
        }
        let holder = Holder { worker: self.worker.clone(), lost_before };
        let temporary = self.temporary();
        let made = fs::create_dir(&temporary).and_then(|()| {
            fs::write(temporary.join(HOLDER), serde_json::to_vec(&holder).unwrap_or_default())?;
            fs::rename(&temporary, &folder)
        });
        match made {
            Ok(()) => Ok(Asked::Held(Claim { claims: self, folder, lost_before })),
            Err(error) => {
                let _ = fs::remove_dir_all(&temporary);
                let taken = folder.join(HOLDER).exists();
                if taken { Ok(Asked::Taken) } else { Err(failed(&folder, "claiming a material", error)) }
            }
        }
    }

    /// Returns who holds `name` and for how long nothing was heard of it; `None` where nobody does.
    pub fn holder(&self, name: &str) -> Option<(Holder, Duration)> {
        let folder = self.folder.join(name);
        let (holder, age) = (read_holder(&folder)?, self.age(&folder).ok()??);
        Some((holder, age))
    }

    /// Removes what workers that were killed left of unfinished claims, where it is stale.
    pub fn sweep(&self) {
        for entry in fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let temporary = entry.file_name().to_string_lossy().starts_with('.');
            let old = matches!(self.age(&path), Ok(Some(age)) if age > self.stale_after);
            if temporary && (old || !path.join(HOLDER).exists() && self.folder_age(&path) > self.stale_after) {
                let _ = fs::remove_dir_all(path);
            }
        }
    }

    /// Returns the holder, where it can be read, of a claim that is stale; `None` where there is no claim or a fresh one.
    fn stale(&self, folder: &Path) -> Result<Option<Option<Holder>>, FitError> {
        let age = self.age(folder).map_err(|source| failed(folder, "reading a claim", source))?;
        Ok(age.filter(|age| *age > self.stale_after).map(|_| read_holder(folder)))
    }

    /// Removes the stale claim of `holder`. Returns whether this worker was the one that did.
    fn take_over(&self, folder: &Path, holder: &Option<Holder>) -> Result<bool, FitError> {
        let aside = self.temporary();
        if fs::rename(folder, &aside).is_err() {
            return Ok(false);
        }
        // Between the look and the renaming another worker may have taken it over: then it is put back.
        let fresh = matches!(self.age(&aside), Ok(Some(age)) if age <= self.stale_after);
        if (fresh || read_holder(&aside) != *holder) && fs::rename(&aside, folder).is_ok() {
            return Ok(false);
        }
        let _ = fs::remove_dir_all(&aside);
        Ok(!fresh)
    }

    /// Returns the time since a claim was touched, by the clock of the file system; `None` where there is none.
    fn age(&self, folder: &Path) -> io::Result<Option<Duration>> {
        match fs::metadata(folder.join(HOLDER)).and_then(|meta| meta.modified()) {
            Ok(touched) => Ok(Some(self.now()?.duration_since(touched).unwrap_or_default())),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    fn folder_age(&self, folder: &Path) -> Duration {
        let touched = fs::metadata(folder).and_then(|meta| meta.modified());
        match (touched, self.now()) {
            (Ok(touched), Ok(now)) => now.duration_since(touched).unwrap_or_default(),
            _ => Duration::ZERO,
        }
    }

    /// Returns the time by the clock of the file system, which all workers share, whatever their own clocks say.
    fn now(&self) -> io::Result<SystemTime> {
        let path = self.temporary();
        let file = File::create(&path)?;
        let now = file.metadata().and_then(|meta| meta.modified());
        drop(file);
        fs::remove_file(&path)?;
        now
    }

    /// Returns a name in the folder of the claims that no other worker has.
    fn temporary(&self) -> PathBuf {
        self.folder.join(format!(".{}-{}", self.worker, self.next.fetch_add(1, Ordering::Relaxed)))
    }
}

impl Claim<'_> {
    /// Tells that this worker is alive. Returns whether the claim is still its own.
    pub fn touch(&self) -> bool {
        let touched = File::options().append(true).open(self.folder.join(HOLDER)).and_then(|file| {
            // The file system's own time, not this machine's: rewriting a byte would do it too, but not as safely.
            file.set_times(fs::FileTimes::new().set_modified(self.claims.now()?))
        });
        touched.is_ok() && self.is_held()
    }

    /// Returns whether the claim is still this worker's.
    pub fn is_held(&self) -> bool {
        read_holder(&self.folder).is_some_and(|holder| holder.worker == self.claims.worker)
    }
}

impl Drop for Claim<'_> {
    fn drop(&mut self) {
        if self.is_held() {
            // First under another name: a claim is whole or it is not there.
            let aside = self.claims.temporary();
            if fs::rename(&self.folder, &aside).is_ok() {
                let _ = fs::remove_dir_all(aside);
            }
        }
    }
}

/// Returns a name for this worker that no other has: host, process, random number.
pub fn worker_name() -> String {
    let host = gethostname::gethostname().to_string_lossy().replace(|c: char| !c.is_alphanumeric(), "-");
    format!("{host}-{}-{:08x}", std::process::id(), rand::random::<u32>())
}

fn read_holder(folder: &Path) -> Option<Holder> {
    serde_json::from_slice(&fs::read(folder.join(HOLDER)).ok()?).ok()
}

fn failed(path: &Path, action: &'static str, source: io::Error) -> FitError {
    FitError::File {
        path: path.into(),
        action,
        source,
        remedy: "make the folder of the assets writable, or free space there",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread::sleep;

    fn claims(folder: &Path, worker: &str, stale_ms: u64) -> Claims {
        Claims::open(folder.join("claims"), worker.into(), Duration::from_millis(stale_ms)).unwrap()
    }

    fn held(asked: Asked) -> bool {
        matches!(asked, Asked::Held(_))
    }

    #[test]
    fn of_many_workers_one_gets_a_claim_and_a_dropped_one_is_free_again() {
        let folder = tempfile::tempdir().unwrap();
        let workers: Vec<Claims> = (0..16).map(|n| claims(folder.path(), &format!("w{n}"), 60_000)).collect();
        for _ in 0..20 {
            let won: Vec<bool> = std::thread::scope(|scope| {
                let asking = workers.iter().map(|worker| scope.spawn(|| worker.ask("wool").unwrap()));
                // All are kept until all have asked.
                let asked: Vec<_> =
                    asking.collect::<Vec<_>>().into_iter().map(|thread| thread.join().unwrap()).collect();
                asked.into_iter().map(held).collect()
            });
            assert_eq!(won.iter().filter(|won| **won).count(), 1, "{won:?}");
        }
        assert_eq!(fs::read_dir(folder.path().join("claims")).unwrap().count(), 0);
    }

    #[test]
    fn a_stale_claim_is_taken_over_once_and_its_old_holder_learns_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let (first, second, third) =
            (claims(folder.path(), "a", 150), claims(folder.path(), "b", 150), claims(folder.path(), "c", 150));
        let Asked::Held(lost) = first.ask("wool").unwrap() else { panic!("free") };
        assert_eq!(lost.lost_before, 0);
        assert!(!held(second.ask("wool").unwrap()), "a fresh claim is respected");
        // Signs of life keep it fresh.
        for _ in 0..4 {
            sleep(Duration::from_millis(60));
            assert!(lost.touch());
        }
        assert!(!held(second.ask("wool").unwrap()));
        sleep(Duration::from_millis(300));
        let Asked::Held(own) = second.ask("wool").unwrap() else { panic!("stale") };
        assert_eq!(own.lost_before, 1);
        assert!(!held(third.ask("wool").unwrap()));
        assert!(!lost.touch() && !lost.is_held() && own.touch());
        assert_eq!(third.holder("wool").unwrap().0.worker, "b");
        // What the old holder gives back is not the new one's.
        drop(lost);
        assert!(own.is_held());
        drop(own);
        assert!(third.holder("wool").is_none());
    }

    #[test]
    fn what_a_killed_worker_left_half_claimed_is_swept() {
        let folder = tempfile::tempdir().unwrap();
        let worker = claims(folder.path(), "a", 50);
        fs::create_dir(folder.path().join("claims/.gone-1")).unwrap();
        let Asked::Held(own) = worker.ask("wool").unwrap() else { panic!("free") };
        sleep(Duration::from_millis(120));
        worker.sweep();
        let left: Vec<_> =
            fs::read_dir(folder.path().join("claims")).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(left, ["wool"]);
        drop(own);
    }
}
