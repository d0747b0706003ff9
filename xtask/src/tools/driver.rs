//! The software Vulkan driver with ray queries that the GPU tests run on.
//!
//! Mesa's lavapipe has ray queries from version 25 on. Debian 12 carries that version in its backports;
//! as root on Debian it is installed, elsewhere the user is told what to install.

use super::apt::{self, is_root_on_debian};
use crate::failure::Failure;
use crate::shell::{answer_of, os_release};
use std::path::PathBuf;
use std::process::Command;

/// First Mesa whose lavapipe answers ray queries.
const MIN_MESA: u32 = 25;
const ICD_FOLDERS: [&str; 3] = ["/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d"];
/// Environment variables with which lavapipe compiles a shader in a quarter of the time: four lanes and no optimiser. Pictures take
/// longer, which for those of tests is less than what compiling takes. The tests of the decoder's shaders set them by themselves, too.
pub const QUICK_COMPILER: [(&str, &str); 2] = [("LP_NATIVE_VECTOR_WIDTH", "128"), ("GALLIVM_PERF", "nopt")];
const BACKPORTS_FILE: &str = "/etc/apt/sources.list.d/btf-backports.sources";

/// Finds or installs the driver. Returns one line that names the driver.
pub fn ensure() -> Result<String, Failure> {
    if let Some(found) = present() {
        return Ok(found);
    }
    if is_root_on_debian() {
        install(os_release("VERSION_CODENAME").as_deref().unwrap_or("bookworm"))?;
        return present()
            .ok_or_else(|| Failure::new(format!("the driver was installed but does not answer; {}", advice())));
    }
    Err(Failure::new(advice()))
}

/// Returns the path of lavapipe's manifest, to which a test run points the Vulkan loader.
pub fn software_manifest() -> Option<PathBuf> {
    ICD_FOLDERS
        .iter()
        .filter_map(|folder| std::fs::read_dir(folder).ok())
        .flat_map(|entries| entries.filter_map(|entry| entry.ok().map(|entry| entry.path())))
        .find(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("lvp_icd")))
}

fn present() -> Option<String> {
    if software_manifest().is_some() {
        match answer_of(Command::new("dpkg-query").args(["-W", "-f", "${Version}", "mesa-vulkan-drivers"])) {
            Some(version) if major(&version).is_some_and(|major| major >= MIN_MESA) && has_loader() => {
                return Some(format!("software driver: lavapipe of Mesa {version}"));
            }
            // Too old: another adapter may still answer.
            Some(_) => {}
            // Not Debian: take lavapipe at its word, the tests name an adapter without ray queries.
            None => return Some("software driver: lavapipe".to_string()),
        }
    }
    let info = answer_of(&mut Command::new("vulkaninfo"))?;
    info.contains("VK_KHR_ray_query").then(|| "a Vulkan adapter with ray queries answers".to_string())
}

/// Returns whether the Vulkan loader is installed, which the driver's package does not bring along.
fn has_loader() -> bool {
    answer_of(Command::new("dpkg-query").args(["-W", "-f", "${Status}", "libvulkan1"]))
        .is_some_and(|s| s.contains("ok installed"))
}

/// Returns the major version: 25 of `25.0.7-2~bpo12+1` or `1:25.0.7`.
fn major(version: &str) -> Option<u32> {
    version.rsplit(':').next()?.split('.').next()?.parse().ok()
}

fn advice() -> String {
    format!(
        "the GPU tests need a Vulkan adapter with ray queries: install Mesa's software driver, version {MIN_MESA} or newer \
         (Debian 12: libvulkan1, and mesa-vulkan-drivers from bookworm-backports; Debian 13, Ubuntu 25.04 and newer, Fedora: \
         mesa-vulkan-drivers), or set BTF_SKIP_GPU=1 to leave these tests out"
    )
}

fn install(codename: &str) -> Result<(), Failure> {
    let backports = codename == "bookworm";
    if backports && !backports_listed(codename) {
        let source = apt::source_of_suite(&apt::present_sources(), codename, &format!("{codename}-backports")).ok_or_else(|| {
            Failure::new("no Debian archive was found in the package sources: add bookworm-backports by hand and run `cargo xtask setup` again")
        })?;
        println!("adding {BACKPORTS_FILE}");
        std::fs::write(BACKPORTS_FILE, source)
            .map_err(|error| Failure::new(format!("{BACKPORTS_FILE} cannot be written: {error}")))?;
    }
    if backports {
        apt::refresh()?;
    }
    apt::install(&["libvulkan1"])?;
    let release = format!("{codename}-backports");
    match backports {
        true => apt::install(&["-t", &release, "mesa-vulkan-drivers"]),
        false => apt::install(&["mesa-vulkan-drivers"]),
    }
}

fn backports_listed(codename: &str) -> bool {
    let suite = format!("{codename}-backports");
    let lists = |line: &str| !line.trim_start().starts_with('#') && line.split_whitespace().any(|word| word == suite);
    apt::present_sources().iter().any(|text| text.lines().any(lists))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_read() {
        assert_eq!(major("25.0.7-2~bpo12+1"), Some(25));
        assert_eq!(major("1:22.3.6-1+deb12u1"), Some(22));
    }
}
