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
/// Least age of what is swept away: a claim is half made for much less.
const MIN_SWEPT: Duration = Duration::from_secs(60);

/// Holder of a claim.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Holder {
    /// Worker: host, process and a random number.
    pub worker: String,
    /// Number of workers that have tried before and were not heard of again.
    pub lost_before: u32,
    /// Seconds without a sign of life after which this holder counts as lost, as it was started.
    pub stale_after_s: f64,
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
    /// The material is this worker's now.
    Held(Claim<'a>),
    /// Another worker has the material.
    Taken,
}

impl Claims {
    /// Opens the folder of the claims, and makes it where it is missing. `stale_after` is the time without a sign of life
    /// after which this worker's claims may be taken over.
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

    /// Returns the time by the clock of the file system, seconds since 1970.
    pub fn clock_s(&self) -> f64 {
        let now = self.now().unwrap_or_else(|_| SystemTime::now());
        now.duration_since(SystemTime::UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
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
        let stale_after_s = self.stale_after.as_secs_f64();
        let holder = Holder { worker: self.worker.clone(), lost_before, stale_after_s };
        let temporary = self.temporary();
        let made = fs::create_dir(&temporary).and_then(|()| {
            fs::write(temporary.join(HOLDER), serde_json::to_vec(&holder).unwrap_or_default())?;
            fs::rename(&temporary, &folder)
        });
        match made {
            Ok(()) => Ok(Asked::Held(Claim { claims: self, folder, lost_before })),
            Err(error) => {
                let _ = fs::remove_dir_all(&temporary);
                // Another worker may have given it back again by now; it is asked for once more in another round.
                let others = [io::ErrorKind::DirectoryNotEmpty, io::ErrorKind::AlreadyExists];
                let taken = others.contains(&error.kind()) || folder.join(HOLDER).exists();
                if taken { Ok(Asked::Taken) } else { Err(failed(&folder, "claiming a material", error)) }
            }
        }
    }

    /// Removes the claim of a material that is done with since `done_s` (as [`Claims::clock_s`] tells it) where it is stale: its
    /// holder was lost between its last file and giving the claim back. One that was made later is another try's, which
    /// counts those that were lost.
    pub fn clear(&self, name: &str, done_s: f64) {
        let folder = self.folder.join(name);
        let touched = fs::metadata(folder.join(HOLDER)).and_then(|meta| meta.modified()).ok();
        let touched_s = touched.and_then(|time| Some(time.duration_since(SystemTime::UNIX_EPOCH).ok()?.as_secs_f64()));
        let Some(touched_s) = touched_s else { return };
        if let Ok(Some(holder)) = self.stale(&folder)
            && touched_s <= done_s + self.patience(&holder).as_secs_f64()
        {
            // What cannot be removed does no harm, and is met again by the next worker.
            let _ = self.take_over(&folder, &holder);
        }
    }

    /// Removes what workers that were killed left of unfinished claims, where it is stale.
    pub fn sweep(&self) {
        for entry in fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let temporary = entry.file_name().to_string_lossy().starts_with('.');
            if temporary && self.age_of(&path).is_ok_and(|age| age > self.stale_after.max(MIN_SWEPT)) {
                // A file is what a look at the clock left.
                let _ = fs::remove_file(&path).or_else(|_| fs::remove_dir_all(&path));
            }
        }
    }

    /// Returns the holder, where it can be read, of a claim that is stale; `None` where there is no claim or a fresh one.
    fn stale(&self, folder: &Path) -> Result<Option<Option<Holder>>, FitError> {
        let age = self.age(folder).map_err(|source| failed(folder, "reading a claim", source))?;
        let holder = read_holder(folder);
        Ok(age.filter(|age| *age > self.patience(&holder)).map(|_| holder))
    }

    /// Removes the stale claim of `holder`. Returns whether this worker was the one that did.
    fn take_over(&self, folder: &Path, holder: &Option<Holder>) -> Result<bool, FitError> {
        let aside = self.temporary();
        if fs::rename(folder, &aside).is_err() {
            return Ok(false);
        }
        // Between the look and the renaming another worker may have taken it over: then it is put back.
        let fresh = matches!(self.age(&aside), Ok(Some(age)) if age <= self.patience(holder));
        if (fresh || read_holder(&aside) != *holder) && fs::rename(&aside, folder).is_ok() {
            return Ok(false);
        }
        let _ = fs::remove_dir_all(&aside);
        Ok(!fresh)
    }

    /// Returns how long a holder may be silent: as long as it said itself.
    fn patience(&self, holder: &Option<Holder>) -> Duration {
        let said = holder.as_ref().and_then(|holder| Duration::try_from_secs_f64(holder.stale_after_s).ok());
        said.unwrap_or(self.stale_after)
    }

    /// Returns the time since a claim was touched, by the clock of the file system; `None` where there is none.
    fn age(&self, folder: &Path) -> io::Result<Option<Duration>> {
        match self.age_of(&folder.join(HOLDER)) {
            Ok(age) => Ok(Some(age)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Returns the time since a file or a folder was changed.
    fn age_of(&self, path: &Path) -> io::Result<Duration> {
        let changed = fs::metadata(path)?.modified()?;
        Ok(self.now()?.duration_since(changed).unwrap_or_default())
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
    /// Tells that this worker is alive, unless the claim is another's by now. Returns whether it is still its own.
    pub fn touch(&self) -> bool {
        if !self.is_held() {
            return false;
        }
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

/// Returns who holds `name` in the folder of claims, and for about how long nothing was heard of it, by this machine's clock;
/// `None` where nobody does. Writes nothing.
pub fn holder_of(claims: &Path, name: &str) -> Option<(Holder, Duration)> {
    let folder = claims.join(name);
    let touched = fs::metadata(folder.join(HOLDER)).and_then(|meta| meta.modified()).ok()?;
    Some((read_holder(&folder)?, SystemTime::now().duration_since(touched).unwrap_or_default()))
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
            (claims(folder.path(), "a", 600), claims(folder.path(), "b", 600), claims(folder.path(), "c", 600));
        let Asked::Held(lost) = first.ask("wool").unwrap() else { panic!("free") };
        assert_eq!(lost.lost_before, 0);
        assert!(!held(second.ask("wool").unwrap()), "a fresh claim is respected");
        // Signs of life keep it fresh.
        for _ in 0..4 {
            sleep(Duration::from_millis(240));
            assert!(lost.touch());
        }
        assert!(!held(second.ask("wool").unwrap()));
        sleep(Duration::from_millis(900));
        let Asked::Held(own) = second.ask("wool").unwrap() else { panic!("stale") };
        assert_eq!(own.lost_before, 1);
        assert!(!held(third.ask("wool").unwrap()));
        assert!(!lost.touch() && !lost.is_held() && own.touch());
        assert_eq!(holder_of(&third.folder, "wool").unwrap().0.worker, "b");
        // What the old holder gives back is not the new one's.
        drop(lost);
        assert!(own.is_held());
        drop(own);
        assert!(holder_of(&third.folder, "wool").is_none());
    }

    #[test]
    fn a_stale_claim_of_what_is_done_is_cleared_and_a_fresh_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let (first, second) = (claims(folder.path(), "a", 600), claims(folder.path(), "b", 600));
        let Asked::Held(own) = first.ask("wool").unwrap() else { panic!("free") };
        let now_s = second.clock_s();
        second.clear("wool", now_s);
        second.clear("silk", now_s);
        assert!(own.is_held());
        sleep(Duration::from_millis(900));
        // A claim that was made long after what is done is another try's.
        second.clear("wool", now_s - 3600.0);
        assert!(own.is_held());
        second.clear("wool", now_s);
        assert!(!own.is_held());
        assert_eq!(fs::read_dir(folder.path().join("claims")).unwrap().count(), 0);
    }

    #[test]
    fn what_a_killed_worker_left_half_claimed_is_swept() {
        let folder = tempfile::tempdir().unwrap();
        let worker = claims(folder.path(), "a", 50);
        let [made, clock, new] = [".gone-1", ".gone-2", ".new"].map(|name| folder.path().join("claims").join(name));
        fs::create_dir(&made).unwrap();
        File::create(&clock).unwrap();
        let long_ago = fs::FileTimes::new().set_modified(SystemTime::now() - 2 * MIN_SWEPT);
        for path in [&made, &clock] {
            File::open(path).unwrap().set_times(long_ago).unwrap();
        }
        fs::create_dir(&new).unwrap();
        let Asked::Held(own) = worker.ask("wool").unwrap() else { panic!("free") };
        worker.sweep();
        assert!(new.exists() && !made.exists() && !clock.exists());
        fs::remove_dir(new).unwrap();
        let left: Vec<_> =
            fs::read_dir(folder.path().join("claims")).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(left, ["wool"]);
        drop(own);
    }
}
