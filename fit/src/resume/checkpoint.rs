//! Finished stages of a fit (`--resume`), each in a file of its own beside the asset, so that a run that was killed can
//! be taken up again. A fit is deterministic, so taking a stage's result from its file and computing it anew end in the
//! same bytes.
//!
//! A file appears whole or not at all, and is taken only if its key (program, captures, parameters) and its checksum
//! are right; whatever else lies there is ignored with one remark and computed anew.

use crate::error::FitError;
use crate::monitor::Monitor;
use crate::params::{FitParams, ValidFitParams};
use crate::resume::stored::{Input, Stored};
use blake3::{Hash, Hasher};
use btf_capture::{AtomicFile, Capture};
use std::fs::{self, File, TryLockError};
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

/// First bytes of a stage's file; the digit is the version of its layout.
const MAGIC: [u8; 8] = *b"BTFSTEP1";
/// Bytes of a key, and of a checksum.
const HASH_BYTES: u64 = 32;
/// Ends of the file names of a stage and of a decoded capture.
const STAGE_END: &str = ".stage";
const TEXELS_END: &str = ".texels";
/// Name of the file that the running fit locks. The lock goes with the process, however that ends.
const LOCK_NAME: &str = "lock";
/// Name of the file that says which program, captures and parameters the stages belong to.
const IDENTITY_NAME: &str = "identity.stage";
/// Bytes of the buffer for a stage's file.
const BUFFER_BYTES: usize = 1 << 20;

/// Folder of the finished stages of one fit. Without a folder nothing is kept and nothing is found.
pub struct Checkpoint<'a> {
    folder: Option<PathBuf>,
    key: Hash,
    monitor: &'a Monitor,
    _lock: Option<File>,
}

/// Everything that the results of a fit's stages depend on, hashed.
struct Identity {
    program: Hash,
    captures: Hash,
    params: Hash,
}

impl Identity {
    fn new(captures: &[Capture], params: &ValidFitParams) -> Result<Identity, FitError> {
        let mut program = Hasher::new();
        program.update(env!("CARGO_PKG_VERSION").as_bytes());
        // Another build may round otherwise.
        if let Ok(file) = std::env::current_exe().and_then(File::open) {
            // What cannot be read stays out; the version is in.
            let _ = program.update_reader(file);
        }
        let mut stamped = Hasher::new();
        for capture in captures {
            let stamps = capture.stamps()?;
            stamped.update(&(stamps.len() as u64).to_le_bytes());
            for stamp in stamps {
                stamped.update(&(stamp.name.len() as u64).to_le_bytes());
                stamped.update(stamp.name.as_bytes());
                stamped.update(&stamp.bytes.to_le_bytes());
                stamped.update(&stamp.modified_ns.to_le_bytes());
            }
        }
        // Where files lie decides on nothing, nor whether a role was asked for that is the usual one.
        let role = Some(params.role());
        let asked = FitParams { role, cache_directory: PathBuf::new(), resume: None, ..params.asked().clone() };
        let mut params_hash = Hasher::new();
        params_hash.update(format!("{asked:?}").as_bytes());
        for path in params.priors().files() {
            let bytes = fs::read(path).map_err(|source| FitError::File {
                path: path.clone(),
                action: "reading the priors",
                source,
                remedy: "give --priors the names of fitted assets",
            })?;
            params_hash.update(&bytes);
        }
        let params = params_hash.finalize();
        Ok(Identity { program: program.finalize(), captures: stamped.finalize(), params })
    }

    fn parts(&self) -> [[u8; 32]; 3] {
        [self.program, self.captures, self.params].map(|hash| *hash.as_bytes())
    }

    fn key(&self) -> Hash {
        blake3::hash(&self.parts().concat())
    }
}

impl<'a> Checkpoint<'a> {
    /// Opens the folder `params.resume()` for a fit of `captures`, and makes it if need be; without one, keeps nothing.
    /// Stages of another program, capture or parameters are removed, with a remark.
    ///
    /// # Errors
    /// If the folder cannot be made or another run works in it, or a capture's files are gone.
    pub fn open(
        captures: &[Capture],
        params: &ValidFitParams,
        monitor: &'a Monitor,
    ) -> Result<Checkpoint<'a>, FitError> {
        let Some(folder) = params.resume() else {
            return Ok(Checkpoint { folder: None, key: blake3::hash(&[]), monitor, _lock: None });
        };
        let identity = Identity::new(captures, params)?;
        let failed = |source| FitError::File {
            path: folder.to_path_buf(),
            action: "making the folder for finished stages",
            source,
            remedy: "check that you may write there, or leave --resume out",
        };
        fs::create_dir_all(folder).map_err(failed)?;
        let lock = File::options().create(true).append(true).open(folder.join(LOCK_NAME)).map_err(failed)?;
        if let Err(TryLockError::WouldBlock) = lock.try_lock() {
            return Err(FitError::InUse { folder: folder.to_path_buf() });
        }
        let checkpoint =
            Checkpoint { folder: Some(folder.to_path_buf()), key: identity.key(), monitor, _lock: Some(lock) };
        checkpoint.keep_only(folder, &identity);
        Ok(checkpoint)
    }

    /// Removes what other fits, and runs that were killed while they wrote, left in `folder`.
    fn keep_only(&self, folder: &Path, identity: &Identity) {
        let found = read_stage::<[[u8; 32]; 3]>(&folder.join(IDENTITY_NAME), &blake3::hash(&MAGIC));
        let own = identity.parts();
        let reason = match found {
            Ok(found) if found == own => None,
            Ok(found) if found[1] != own[1] => Some("are of another capture, or it was changed"),
            Ok(found) if found[2] != own[2] => Some("are of other options"),
            Ok(_) => Some("are of another version of the program"),
            Err(_) => Some("do not say of what they are"),
        };
        let names = names_in(folder);
        for name in names.iter().filter(|name| name.starts_with('.')) {
            // A file that a killed run was writing.
            let _ = fs::remove_file(folder.join(name));
        }
        let Some(reason) = reason else { return };
        let old: Vec<&String> = names.iter().filter(|name| is_stage(name) && *name != IDENTITY_NAME).collect();
        if !old.is_empty() {
            self.monitor.remark(&format!(
                "{}: the finished stages there {reason}; they are not used and everything is computed anew",
                folder.display()
            ));
        }
        for name in old {
            let _ = fs::remove_file(folder.join(name));
        }
        let written = write_stage(&folder.join(IDENTITY_NAME), &blake3::hash(&MAGIC), &own);
        self.tell(&folder.join(IDENTITY_NAME), written);
    }

    fn tell(&self, path: &Path, written: io::Result<()>) {
        if let Err(error) = written {
            self.monitor.remark(&format!(
                "{}: the finished stage could not be kept ({error}); the fit goes on without",
                path.display()
            ));
        }
    }

    /// Returns the stages of the whole fit.
    pub fn whole(&self) -> Stages<'_> {
        Stages { checkpoint: self, prefix: "whole".to_string(), key: self.key }
    }

    /// Returns the stages of one layer. Results also depend on `sample`, the texels that the memory plan gives to the
    /// sample of shared bases.
    pub fn layer(&self, number: usize, sample: usize) -> Stages<'_> {
        let mut hasher = Hasher::new();
        hasher.update(self.key.as_bytes());
        hasher.update(&(number as u64).to_le_bytes());
        hasher.update(&(sample as u64).to_le_bytes());
        Stages { checkpoint: self, prefix: format!("layer{number}"), key: hasher.finalize() }
    }
}

/// Removes the finished stages in `folder` after the asset was written: their files, and the folder if it holds no
/// others. What cannot be removed stays; a later run sees by its key whether it can be used.
pub fn remove_finished_stages(folder: &Path) {
    for name in in_order_of_removal(names_in(folder)) {
        let _ = fs::remove_file(folder.join(name));
    }
    let _ = fs::remove_dir(folder);
}

/// Returns `names` in the order in which they are removed: stages first, then the file that says what they belong to,
/// so that a run that is killed in between leaves no stage of unknown origin.
fn in_order_of_removal(mut names: Vec<String>) -> Vec<String> {
    names.retain(|name| is_stage(name) || name == LOCK_NAME);
    names.sort_by_key(|name| (name == LOCK_NAME, name == IDENTITY_NAME));
    names
}

fn names_in(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter_map(|entry| entry.file_name().into_string().ok())
        .filter(|name| is_stage(name) || name == LOCK_NAME || (name.starts_with('.') && name.contains(STAGE_END)))
        .collect();
    names.sort();
    names
}

fn is_stage(name: &str) -> bool {
    !name.starts_with('.') && (name.ends_with(STAGE_END) || name.ends_with(TEXELS_END))
}

/// Kept stages of a layer or of the whole fit.
pub struct Stages<'a> {
    checkpoint: &'a Checkpoint<'a>,
    prefix: String,
    key: Hash,
}

impl Stages<'_> {
    /// Returns the monitor that progress goes to.
    pub fn monitor(&self) -> &Monitor {
        self.checkpoint.monitor
    }

    /// Returns the kept result of stage `name`; else runs `work` as that stage and keeps its result.
    pub fn run<T: Stored>(&self, name: &str, work: impl FnOnce() -> Result<T, FitError>) -> Result<T, FitError> {
        self.load_or(name, || self.monitor().stage(name, work))
    }

    /// Returns the kept result `name`; else runs `work`, without making it a stage, and keeps its result.
    pub fn load_or<T: Stored>(&self, name: &str, work: impl FnOnce() -> Result<T, FitError>) -> Result<T, FitError> {
        if let Some(found) = self.load(name) {
            self.monitor().skip(name);
            return Ok(found);
        }
        let made = work()?;
        self.keep(name, &made);
        Ok(made)
    }

    /// Returns the kept result `name`. A file that cannot be used is named in a remark.
    pub fn load<T: Stored>(&self, name: &str) -> Option<T> {
        let path = self.path(name, STAGE_END)?;
        match read_stage(&path, &self.key) {
            Ok(found) => Some(found),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(_) => {
                self.ignore(&path);
                None
            }
        }
    }

    /// Makes the remark that the file `path` is not used.
    pub fn ignore(&self, path: &Path) {
        self.monitor().remark(&format!(
            "{} is cut, damaged or of another fit; it is not used and the stage is computed anew",
            path.display()
        ));
    }

    /// Keeps a result. A failure is a remark, not an error, because the fit can go on.
    pub fn keep(&self, name: &str, value: &impl Stored) {
        if let Some(path) = self.path(name, STAGE_END) {
            let written = write_stage(&path, &self.key, value);
            self.checkpoint.tell(&path, written);
        }
    }

    /// Returns the path at which a decoded capture that does not fit into memory is kept; `None` if nothing is kept.
    pub fn texels_path(&self) -> Option<PathBuf> {
        self.path("read", TEXELS_END)
    }

    fn path(&self, name: &str, end: &str) -> Option<PathBuf> {
        self.checkpoint.folder.as_ref().map(|folder| folder.join(format!("{}-{name}{end}", self.prefix)))
    }
}

/// Reader or writer that hashes what passes through.
struct Hashed<T> {
    inner: T,
    hasher: Hasher,
}

impl<T: Write> Write for Hashed<T> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.inner.write(bytes)?;
        self.hasher.update(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<T: Read> Read for Hashed<T> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(bytes)?;
        self.hasher.update(&bytes[..count]);
        Ok(count)
    }
}

/// Writes a stage's file: magic, key, value, and a checksum of all three.
fn write_stage(path: &Path, key: &Hash, value: &impl Stored) -> io::Result<()> {
    let file = AtomicFile::create(path).map_err(io::Error::other)?;
    let mut to = BufWriter::with_capacity(BUFFER_BYTES, Hashed { inner: file, hasher: Hasher::new() });
    to.write_all(&MAGIC)?;
    to.write_all(key.as_bytes())?;
    value.put(&mut to)?;
    let Hashed { inner: mut file, hasher } = to.into_inner().map_err(|error| error.into_error())?;
    file.write_all(hasher.finalize().as_bytes())?;
    file.commit().map_err(io::Error::other)
}

fn read_stage<T: Stored>(path: &Path, key: &Hash) -> io::Result<T> {
    let file = File::open(path)?;
    let invalid = || io::Error::from(io::ErrorKind::InvalidData);
    let length = file.metadata()?.len();
    let left = length.checked_sub(MAGIC.len() as u64 + 2 * HASH_BYTES).ok_or_else(invalid)?;
    let mut file = file;
    // Only what the checksum is of: the buffer must not swallow the checksum.
    let body = Hashed { inner: (&mut file).take(length - HASH_BYTES), hasher: Hasher::new() };
    let mut from = BufReader::with_capacity(BUFFER_BYTES, body);
    let mut head = [0; MAGIC.len() + HASH_BYTES as usize];
    from.read_exact(&mut head)?;
    if head[..MAGIC.len()] != MAGIC || head[MAGIC.len()..] != *key.as_bytes() {
        return Err(invalid());
    }
    let mut input = Input { from: &mut from, left };
    let value = T::take(&mut input)?;
    if input.left != 0 {
        return Err(invalid());
    }
    let hash = from.into_inner().hasher.finalize();
    let mut stored = [0; HASH_BYTES as usize];
    file.read_exact(&mut stored)?;
    // A constant-time comparison is not needed, but it is what the type has.
    if hash == stored { Ok(value) } else { Err(invalid()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_says_of_what_the_stages_are_goes_after_them() {
        let names = ["identity.stage", "layer0-cluster.stage", "lock", "notes.txt", "whole-encode.stage"];
        let order = in_order_of_removal(names.map(String::from).to_vec());
        assert_eq!(order, ["layer0-cluster.stage", "whole-encode.stage", "identity.stage", "lock"]);
    }

    #[test]
    fn a_stage_is_taken_back_and_each_kind_of_damage_is_seen() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.stage");
        let (key, other) = (blake3::hash(b"this fit"), blake3::hash(b"another"));
        let value = vec![1.5f32; 1000];
        write_stage(&path, &key, &value).unwrap();
        assert_eq!(read_stage::<Vec<f32>>(&path, &key).unwrap(), value);
        assert!(read_stage::<Vec<f32>>(&path, &other).is_err(), "another key");
        let bytes = fs::read(&path).unwrap();
        for cut in [0, 7, 39, 40, 71, 72, 80, 100, bytes.len() - 1] {
            fs::write(&path, &bytes[..cut]).unwrap();
            assert!(read_stage::<Vec<f32>>(&path, &key).is_err(), "cut to {cut} bytes");
        }
        for at in [0, 8, 41, 60, 2000, bytes.len() - 1] {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1;
            fs::write(&path, &flipped).unwrap();
            assert!(read_stage::<Vec<f32>>(&path, &key).is_err(), "byte {at} flipped");
        }
        fs::write(&path, [&bytes[..], &[0]].concat()).unwrap();
        assert!(read_stage::<Vec<f32>>(&path, &key).is_err(), "a byte appended");
        // Of another type: the lengths do not agree.
        fs::write(&path, &bytes).unwrap();
        assert!(read_stage::<Vec<f64>>(&path, &key).is_err());
    }

    #[test]
    fn a_folder_in_use_is_refused_and_free_again_after() {
        let folder = tempfile::tempdir().unwrap();
        let params = FitParams { resume: Some(folder.path().join("a.spmm.resume")), ..FitParams::default() };
        let params = params.check().unwrap();
        let monitor = Monitor::default();
        let first = Checkpoint::open(&[], &params, &monitor).unwrap();
        let refused = Checkpoint::open(&[], &params, &monitor).err().unwrap().to_string();
        assert!(refused.contains("another run"), "{refused}");
        drop(first);
        assert!(Checkpoint::open(&[], &params, &monitor).is_ok());
    }

    #[test]
    fn removing_the_stages_leaves_what_is_somebody_elses() {
        let folder = tempfile::tempdir().unwrap();
        let own = folder.path().join("a.spmm.resume");
        let params = FitParams { resume: Some(own.clone()), ..FitParams::default() }.check().unwrap();
        let monitor = Monitor::default();
        for other in [true, false] {
            let checkpoint = Checkpoint::open(&[], &params, &monitor).unwrap();
            checkpoint.whole().keep("encode", &vec![1u8, 2]);
            assert_eq!(checkpoint.whole().load::<Vec<u8>>("encode"), Some(vec![1, 2]));
            drop(checkpoint);
            let precious = own.join("notes.txt");
            if other {
                fs::write(&precious, "precious").unwrap();
            }
            remove_finished_stages(&own);
            assert_eq!(precious.exists(), other);
            let _ = fs::remove_file(precious);
        }
        assert!(!own.exists());
    }
}
