//! The rules of docs/reference/voltex.md that a file can break, and the warnings and information about files, by number. Rules
//! that all files share keep their numbers. A number is never reused for another rule.

use crate::rule::{self as shared, COPY, NOTHING, Rule, rules};

/// Remedy for a writer's mistake.
const WRITE: &str =
    "it was written by a faulty or newer program: build it again with btf-fit voltex, or update the program";

rules! { "VTEX"
    // Materials.
    MATERIAL_RANGE = 2101, "a material's share or roughness is not within 0 to 1", WRITE;
    // Levels.
    SHADOW_RANGE = 2201, "a shadow's offset is not within 0 to 1024 voxels, or a share not within -16 to 1", WRITE;
    NO_CHILD = 2202, "a voxel of the level before has no child", WRITE;
    VOXEL_RANGE = 2203, "a voxel's density, axis or correlation is out of its range", WRITE;
    NO_MATERIAL = 2204, "a voxel names a material that is not there", WRITE;
    CLUMPING_RANGE = 2205, "a level's clumping is not within -4 to 4", WRITE;
    FACETS_RANGE = 2206, "a level's facets are not within -64 to 64", WRITE;
    BRICK_COUNT = 2207, "it has not as many voxels as its level says", WRITE;
    LIGHT_CORRECTION_RANGE = 2208, "a level's correction of light is not within -64 to 64", WRITE;
    // Warnings.
    MATERIAL_UNUSED = 5101, "materials are used by no voxel", "build it again without them";
    MATERIAL_GAINS = 5102, "materials send more light away than falls on them", "lower their reflectance or transmittance";
    // Information.
    VOXELS = 6101, "voxels", NOTHING;
    MATERIALS = 6102, "materials", NOTHING;
    SIZE = 6103, "size", NOTHING;
}

/// Rules that all files share.
const SHARED: [Rule; 29] = [
    shared::TOO_SHORT,
    shared::BAD_MAGIC,
    shared::VERSION,
    shared::HEADER_CHECKSUM,
    shared::HEADER_FIELD,
    shared::LENGTH,
    shared::TIERS,
    shared::SECTION_START,
    shared::SECTION_FLAGS,
    shared::SECTION_LAYER,
    shared::SECTION_BEYOND,
    shared::PADDING_BEFORE,
    shared::TIER_INSIDE,
    shared::SECTIONS_END,
    shared::PADDING_AT_END,
    shared::SECTION_CHECKSUM,
    shared::MISSING_SECTION,
    shared::UNKNOWN_REQUIRED,
    shared::TWICE,
    shared::ENDS_EARLY,
    shared::TOO_LONG,
    shared::NOT_FINITE,
    shared::NOT_UTF8,
    shared::TIER_AT_HAND,
    shared::UNKNOWN_SKIPPED,
    shared::SECTION_UNUSED,
    shared::DESCRIPTION,
    shared::FORM,
    shared::TIERS_LISTED,
];

/// Returns every rule, in the order of the numbers.
pub fn all() -> Vec<Rule> {
    let mut all: Vec<Rule> = SHARED.into_iter().map(of_voltex).chain(ALL.iter().copied()).collect();
    all.sort_by_key(|rule| rule.number);
    all
}

/// Returns a rule in the words of this format.
pub(crate) fn of_voltex(rule: Rule) -> Rule {
    let (message, remedy) = match rule {
        shared::TOO_SHORT => ("the file is too short for a volumetric texture", COPY),
        shared::BAD_MAGIC => ("this is not a volumetric texture", "make one with btf-fit voltex"),
        shared::VERSION => (rule.message, "build it again with btf-fit voltex or update the program"),
        shared::TIER_AT_HAND => {
            ("this is a tier, not the whole volume", "fetch the whole file where finer voxels are wanted")
        }
        shared::SECTION_UNUSED => (rule.message, "write it again without the section"),
        shared::DESCRIPTION => ("the description is not JSON", "write it as btf-fit does: a decoder does without"),
        _ if rule.remedy == shared::WRITE => (rule.message, WRITE),
        _ => (rule.message, rule.remedy),
    };
    Rule { format: "VTEX", message, remedy, ..rule }
}
