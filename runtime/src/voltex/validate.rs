//! Examines a volumetric texture's file and reports each broken rule, everything that is legal but doubtful, and the
//! properties of the volume.

use super::bricks::{BRICK_LEVEL, MAX_WHOLE_LEVEL, brick_index, bricks_of};
use super::file::{VOLTEX_VERSION, VoltexFormat, VoltexSection, examine_volume};
use super::rule;
use super::volume::{MicroflakeMaterial, Volume, VolumeLevel};
use crate::container::directory::{Directory, SectionEntry, examine_directory_of};
use crate::container::fault::Faults;
use crate::container::finding::about_container;
use crate::file::validate::Report;
use crate::rule::FORM;
use crate::threads::Threads;
use std::collections::BTreeSet;

/// Tolerance of the rule that a material sends away at most the light that falls on it: the rounding of half precision.
const GAIN_TOLERANCE: f32 = 2e-3;

/// Examines a file, or a tier of one, and continues after a fault as far as more can be found, like
/// [`crate::validate`]. The report has an error if and only if [`Volume::parse`] refuses the file, and its first error
/// is the one that `parse` gives.
///
/// Cost: that of [`Volume::parse`]. Never panics.
pub fn validate(bytes: &[u8], threads: Threads) -> Report {
    let mut faults = Faults::default();
    let directory = examine_directory_of::<VoltexFormat>(bytes, threads, &mut faults);
    let mut told = Report::default();
    let sections = directory.as_ref().map_or(Vec::new(), |directory| directory.at_hand(bytes.len()).collect());
    if let Some(directory) = &directory {
        let volume = examine_volume(bytes, directory, threads, &mut faults);
        if let Some(volume) = volume.filter(|_| faults.is_empty()) {
            let form = format!(
                "volumetric texture of version {VOLTEX_VERSION}, {} bytes in {} sections",
                bytes.len(),
                directory.sections.len()
            );
            told.say(rule::of_voltex(FORM), form);
            told.findings.extend(about_container::<VoltexFormat>(directory, bytes.len()));
            about_volume(&volume, directory, &mut told);
            told.material = Some(volume.description);
        }
    }
    told.settled::<VoltexFormat>(&faults, &sections)
}

/// Returns the indices of the sections of all bricks.
fn brick_sections(volume: &Volume) -> BTreeSet<u32> {
    let count = volume.levels.len() as u32;
    let level = (count as usize).checked_sub(1 + BRICK_LEVEL as usize);
    let bricks = level.map_or(Vec::new(), |level| bricks_of(&volume.levels[level].voxels));
    let levels = MAX_WHOLE_LEVEL + 1..count;
    levels.flat_map(|level| bricks.iter().map(move |brick| brick_index(level, *brick))).collect()
}

fn about_volume(volume: &Volume, directory: &Directory<super::VoltexHead>, told: &mut Report) {
    let [x, y, z] = volume.extent;
    told.say(rule::SIZE, format!("{} m a side, of which {x} x {y} x {z} are used", volume.side_m));
    let counts: Vec<String> = volume.levels.iter().map(|level| level.voxels.len().to_string()).collect();
    told.say(rule::VOXELS, format!("{} in {} levels, the finest first", counts.join(", "), counts.len()));
    let count = volume.materials.len();
    told.say(rule::MATERIALS, count.to_string());
    // In a tier, finer levels may refer to what nothing at hand does.
    if directory.is_whole() {
        let bricks = brick_sections(volume);
        let is_unread = |entry: &&SectionEntry| match VoltexSection::from_number(entry.kind) {
            None => false,
            Some(VoltexSection::Description | VoltexSection::Materials) => entry.index > 0,
            Some(VoltexSection::Level) => entry.index >= directory.head.levels,
            Some(VoltexSection::Brick) => !bricks.contains(&entry.index),
        };
        told.findings.extend(directory.sections.iter().filter(is_unread).map(SectionEntry::unused_in::<VoltexFormat>));
        let mut used = vec![false; count];
        volume.levels.iter().flat_map(VolumeLevel::microflakes).for_each(|voxel| used[voxel.material as usize] = true);
        let unused = used.iter().filter(|used| !**used).count();
        if unused > 0 {
            told.say(rule::MATERIAL_UNUSED, format!("{unused} of {count}"));
        }
    }
    let gains = |material: &&MicroflakeMaterial| {
        (0..3).any(|c| material.reflectance[c] + material.transmittance[c] > 1.0 + GAIN_TOLERANCE)
    };
    let gaining = volume.materials.iter().filter(gains).count();
    if gaining > 0 {
        told.say(rule::MATERIAL_GAINS, format!("{gaining} of {count}"));
    }
}
