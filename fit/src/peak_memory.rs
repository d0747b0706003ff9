//! Peak memory of the running program, as the operating system counts it.

/// Returns the peak resident memory of this process so far in bytes, mapped pages included. `None` where the system
/// does not tell.
pub fn peak_memory_bytes() -> Option<u64> {
    peak_from_system()
}

#[cfg(target_os = "linux")]
fn peak_from_system() -> Option<u64> {
    high_water_mark(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// Returns `VmHWM` (KiB) of the text of `/proc/PID/status` in bytes.
#[cfg(any(target_os = "linux", test))]
fn high_water_mark(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(target_os = "macos")]
#[allow(unsafe_code, reason = "getrusage has no safe form; it fills a struct that we own")]
fn peak_from_system() -> Option<u64> {
    let mut usage = std::mem::MaybeUninit::<libc::rusage>::zeroed();
    // SAFETY: the pointer is valid for writes of a whole rusage, which is plain data and zeroed.
    let usage = unsafe {
        if libc::getrusage(libc::RUSAGE_SELF, usage.as_mut_ptr()) != 0 {
            return None;
        }
        usage.assume_init()
    };
    // Bytes on macOS; other systems count KiB.
    u64::try_from(usage.ru_maxrss).ok()
}

#[cfg(not(any(target_os = "linux", target_os = "macos")))]
fn peak_from_system() -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_high_water_mark_is_read_in_bytes() {
        assert_eq!(high_water_mark("Name:\tx\nVmPeak:\t  99 kB\nVmHWM:\t   2048 kB\n"), Some(2048 * 1024));
        assert_eq!(high_water_mark("VmPeak:\t  99 kB\n"), None);
        assert_eq!(high_water_mark("VmHWM:\t  many kB\n"), None);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_peak_grows_with_what_is_held() {
        let before = peak_memory_bytes().unwrap();
        let held = vec![1u8; 1 << 27];
        assert!(held.iter().step_by(4096).all(|byte| *byte == 1));
        let after = peak_memory_bytes().unwrap();
        // A page or two may have been counted before; the peak never falls.
        assert!(after >= before && after >= 1 << 27, "{before} {after}");
    }
}
