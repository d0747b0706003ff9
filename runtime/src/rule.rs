//! The rules of docs/reference/format.md that a file can break, and the warnings and information about files, by number.
//! docs/reference/findings.md lists them, and a test compares the two. A number is never reused for another rule.

use std::fmt::{self, Display};

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// Readers refuse the asset.
    Error,
    /// Readers take the asset, but something about it can be better.
    Warning,
    /// A property of the asset.
    Information,
}

impl Severity {
    /// Returns `error`, `warning` or `information`.
    pub fn name(self) -> &'static str {
        match self {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Information => "information",
        }
    }
}

/// A rule: its number, its sentence, and the remedy where it does not hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Rule {
    /// Format that the rule belongs to: `SPMM` for assets, `VTEX` for volumetric textures.
    pub format: &'static str,
    /// Number of the rule: 1000 to 4999 for errors, 5000 to 5999 for warnings, 6000 to 6999 for information.
    pub number: u16,
    /// Description of the fault, warning or information: a clause without a full stop.
    pub message: &'static str,
    /// Remedy as an instruction; empty for information.
    pub remedy: &'static str,
}

impl Rule {
    /// Returns the severity, which follows from the number.
    pub fn severity(&self) -> Severity {
        match self.number {
            0..5000 => Severity::Error,
            5000..6000 => Severity::Warning,
            _ => Severity::Information,
        }
    }

    /// Returns format and number, such as `SPMM1003`.
    pub fn id(&self) -> String {
        format!("{}{}", self.format, self.number)
    }
}

impl Display for Rule {
    /// Writes [`Rule::message`].
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.message)
    }
}

/// Remedy for damage in transit.
pub(crate) const COPY: &str = "copy the file again";
/// Remedy for a writer's mistake.
pub(crate) const WRITE: &str =
    "it was written by a faulty or newer program: fit the capture again, or update the program";
/// Remedy for a mistake in a resident form, which is made from a file form.
const CONVERT: &str = "it was written by a faulty or newer program: convert the asset again with btf-fit convert";
/// Remedy of information: none.
pub(crate) const NOTHING: &str = "";

macro_rules! rules {
    ($format:literal $($name:ident = $number:literal, $message:literal, $remedy:expr;)*) => {
        $(
            #[doc = $message]
            pub const $name: Rule =
                Rule { format: $format, number: $number, message: $message, remedy: $remedy };
        )*
        /// Every rule, in the order of the numbers.
        pub const ALL: &[Rule] = &[$($name),*];
    };
}
pub(crate) use rules;

rules! { "SPMM"
    // Header. After one of these, nothing more can be told.
    TOO_SHORT = 1001, "the file is too short for an asset", COPY;
    BAD_MAGIC = 1002, "this is not an SPMM asset", "make an asset with btf-fit fit";
    VERSION = 1003, "the format version is not known", "fit the capture again or update the program";
    HEADER_CHECKSUM = 1004, "the header or a table is damaged", COPY;
    HEADER_FIELD = 1005, "a header field is out of its range", WRITE;
    // Length, section table and tier table.
    LENGTH = 1101, "the file is cut off or has bytes appended", COPY;
    TIERS = 1102, "lengths must be multiples of the alignment and rise to the file's length", WRITE;
    SECTION_START = 1103, "it must start at the next multiple of the alignment after its predecessor", WRITE;
    SECTION_FLAGS = 1104, "its flags are neither 0 nor 1", WRITE;
    SECTION_LAYER = 1105, "its layer is not below the layer count", WRITE;
    SECTION_BEYOND = 1106, "it reaches beyond the file's length", WRITE;
    PADDING_BEFORE = 1107, "the padding before it is not zero", COPY;
    TIER_INSIDE = 1108, "a tier ends inside it", WRITE;
    SECTIONS_END = 1109, "sections must end at the file's length", WRITE;
    PADDING_AT_END = 1110, "it must be zero", COPY;
    // Which sections are there.
    SECTION_CHECKSUM = 1201, "a section is damaged", COPY;
    MISSING_SECTION = 1202, "a section is missing", WRITE;
    UNKNOWN_REQUIRED = 1203, "a section of an unknown kind is required", "update the program";
    TWICE = 1204, "it is there twice", WRITE;
    // Contents of any section.
    ENDS_EARLY = 2001, "it ends too early", WRITE;
    TOO_LONG = 2002, "it is longer than its content", WRITE;
    PADDING = 2003, "padding is not zero", WRITE;
    COUNT = 2004, "a count is out of range", WRITE;
    NUMBER = 2005, "a number is out of its range", WRITE;
    NOT_FINITE = 2006, "a number is not finite", WRITE;
    STEP = 2007, "a step is out of range", WRITE;
    NOT_UTF8 = 2008, "it is not UTF-8", WRITE;
    // Layers and direction sets.
    SIDE = 2101, "a side is neither 0 nor 1", WRITE;
    RESIDUAL_KIND = 2102, "residual_kind is not 0, 1 or 2", WRITE;
    EPSILON = 2103, "epsilon is not within 1e-6 to 1", WRITE;
    SAME_SIDES = 2104, "an earlier layer has the same sides", WRITE;
    SET_SHORT = 2111, "it is shorter than its header", WRITE;
    SET_LENGTH = 2112, "its length does not match its counts", WRITE;
    DIRECTION = 2113, "a direction is not a unit vector above the horizon", WRITE;
    DIRECTION_NAMED = 2114, "a triangle or an edge names a direction that is not there", WRITE;
    NO_AREA = 2115, "a triangle has no area", WRITE;
    GRID_SIDE = 2116, "the grid's side or a reserved word is out of range", WRITE;
    TRIANGLE = 2117, "a triangle is out of range or names a direction that is not there", WRITE;
    EDGE = 2118, "an edge is out of range or names a direction that is not there", WRITE;
    GRID_CELL = 2119, "a grid cell is empty or out of order", WRITE;
    GRID_ITEM = 2120, "a grid item names a triangle or edge that is not there", WRITE;
    // Texels and dictionaries.
    NO_CLUSTER = 2201, "a texel names a cluster that is not there", WRITE;
    NO_LOBE = 2202, "a texel names a lobe that its cluster does not have", WRITE;
    DICTIONARY_SIZE = 2203, "a dictionary has more than 256 lobes", WRITE;
    LOBE_RANGE = 2204, "a lobe's parameter is out of its range", WRITE;
    // Residuals.
    BASES_TOO_LARGE = 2301, "its bases would take more than 1 GiB when expanded", WRITE;
    RANK = 2302, "a rank is above 256 or a reserved word is not zero", WRITE;
    SHARED_COUNT = 2303, "it has more than 1024 bases, or not as many as its coefficients tell", WRITE;
    GROUP = 2304, "a count of predicted coefficients is out of its range", WRITE;
    GROUP_EFFORT = 2305, "predicted coefficients ask for more time or memory than their length allows", WRITE;
    EXPONENT = 2306, "an exponent is above 24", WRITE;
    // Heights, levels and edits.
    HEIGHT_STEP = 2401, "its step is 0", WRITE;
    RELIEF_ALONE = 2402, "its layer lacks heights, the root curve, or lobes as base that coefficients predict", WRITE;
    LEVEL_LAYERS = 2411, "another layer does not have the level", WRITE;
    LEVEL_COMPONENTS = 2412, "it has more components than its layer", WRITE;
    EDIT_COUNT = 2421, "it has not 1 to 255 edits", WRITE;
    NO_EDIT = 2422, "a texel names an edit that is not there", WRITE;
    EDITS_TOO_LARGE = 2423, "its edited lobes would take more than 64 MiB", "use fewer edits";
    SPECTRUM = 2431, "its bands are not 1 to 256 ascending wavelengths with weights of at most 1000", WRITE;
    LIGHT_GROUPS = 2432, "its lights are not there once for each group of channels", WRITE;
    // The resident form.
    PIECES = 3001, "its pieces do not follow each other", CONVERT;
    PIECE_LENGTH = 3002, "a piece is longer than 128 MiB or no whole number of words", CONVERT;
    WORDS_LENGTH = 3003, "its length does not match its words", CONVERT;
    WORDS_HEAD = 3004, "its size or its layers are not the header's", CONVERT;
    LEVEL_COUNT = 3005, "its number of levels is out of range", CONVERT;
    ONE_TIER = 3006, "a resident form has one tier", CONVERT;
    SPECTRUM_WORDS = 3007, "its spectrum is not where one may be, or out of its range", CONVERT;
    BLOCK_PLACE = 3101, "a layer's block is not where one may be", CONVERT;
    BLOCK_SIDES = 3102, "a layer's side is neither 0 nor 1, or an earlier layer has the same sides", CONVERT;
    BLOCK_ORDER = 3103, "a level has its layers in another order", CONVERT;
    BLOCK_SIZE = 3104, "a level has not half the size of the one before", CONVERT;
    BLOCK_PARAMETER = 3105, "a layer's parameter is out of its range", CONVERT;
    BLOCK_PAIRS = 3106, "a layer's pairs are not its lights times its views", CONVERT;
    PART_START = 3107, "a part does not begin at a multiple of 64 words", CONVERT;
    PART_BEYOND = 3108, "a part reaches beyond the words", CONVERT;
    SET_BEYOND = 3201, "a direction set is too long", CONVERT;
    GRID_CELLS = 3202, "a grid has not the cells that its triangles ask for", CONVERT;
    TABLE_BEYOND = 3301, "a table of dictionaries reaches beyond the words", CONVERT;
    DICTIONARY_PLACE = 3302, "a dictionary is not where one may be", CONVERT;
    DICTIONARY_CONTENT = 3303, "a dictionary has more than 256 lobes, or one out of its range", CONVERT;
    RECORD = 3304, "a texel names a cluster, an edit or references that are not there", CONVERT;
    CHANNEL_WORDS = 3401, "a pair has too few words for its bases, or too many", CONVERT;
    CODE_WORDS = 3402, "a texel's codes do not match the bases", CONVERT;
    BASIS_NOT_FINITE = 3403, "a basis is not finite", CONVERT;
    OTHER_BASES = 3404, "a level has other bases than the finest", CONVERT;
    PACKED_BASIS = 3405, "a packed basis is out of its range", CONVERT;
    PACKED_ROWS = 3406, "packed rows are not where they may be, or not as long as their numbers", CONVERT;
    EDITS_BEYOND = 3501, "its edits reach beyond the words", CONVERT;
    EDITS_COUNTED = 3502, "its edits are not 0 to 255", CONVERT;
    EDIT_RANGE = 3503, "an edit is out of its range", CONVERT;
    EDITED_DICTIONARY = 3504, "an edited dictionary has other lobes than the measured one", CONVERT;
    HEIGHT_RANGE = 3505, "its heights are out of range", CONVERT;
    RELIEF_RANGE = 3506, "its relief is out of range, or the layer cannot have any", CONVERT;
    // Warnings: legal, and worth a look.
    NO_SIZE = 5001, "no physical size is known",
        "give the capture's size in capture.toml and fit again, or the renderer a size of its own";
    TIER_AT_HAND = 5002, "this is a tier, not the whole asset", "fetch the whole file where more accuracy is wanted";
    UNKNOWN_SKIPPED = 5003, "a section of an unknown kind is skipped", "update the program, which may know it";
    SECTION_UNUSED = 5004, "nothing refers to a section", "write the asset again without it";
    CLUSTER_UNUSED = 5101, "clusters are used by no texel", "fit with fewer clusters";
    LOBE_UNUSED = 5102, "dictionary lobes are used by no texel", "fit with fewer lobes";
    TEXEL_BLACK = 5103, "texels have neither lobes nor a residual: they are black", "fit with more lobes";
    EDIT_UNUSED = 5104, "edits are used by no texel", "remove them in the editor of btf-view";
    DESCRIPTION = 5201, "the material's description is not understood",
        "write it as btf-fit does: a decoder does without, btf-fit info and expand do not";
    NO_ERROR_FIGURES = 5202, "the description has no error figures", "measure the asset with btf-fit compare";
    // Information.
    FORM = 6001, "form", NOTHING;
    TEXELS = 6002, "texels", NOTHING;
    LAYERS = 6003, "layers", NOTHING;
    LEVELS = 6004, "levels", NOTHING;
    TIERS_LISTED = 6005, "tiers", NOTHING;
    SEAMS = 6006, "seams", NOTHING;
}
