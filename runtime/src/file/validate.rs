//! Examines a file and reports each broken rule, everything that is legal but doubtful, and the properties of the
//! asset.

use crate::asset::asset::{Asset, Layer, SurfaceSide};
use crate::asset::dictionary::mark_used_lobes;
use crate::container::directory::{Directory, SectionEntry, examine_directory_of};
use crate::container::fault::Faults;
use crate::container::file_format::FileFormat;
use crate::container::finding::Finding;
use crate::container::finding::about_container;
use crate::file::format::{Form, Head, SectionKind, Spmm};
use crate::file::parse::examine_asset;
use crate::file::resident_file::{ResidentFile, examine_resident};
use crate::resident::resident::ResidentBytes;
use crate::rule::{self, Rule, Severity};
use crate::threads::Threads;

/// The findings of [`validate`] or [`crate::voltex::validate`].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report {
    /// Errors in the order in which a reader meets them, then warnings, then information.
    pub findings: Vec<Finding>,
    /// Description of the material or the volume, if there are no errors.
    pub material: Option<String>,
    /// Sides of light and eye of each layer, if there are no errors; empty for a volumetric texture.
    pub sides: Vec<[SurfaceSide; 2]>,
}

impl Report {
    /// Returns whether readers take the file: no finding is an error.
    pub fn is_valid(&self) -> bool {
        self.count(Severity::Error) == 0
    }

    /// Returns the number of findings of one severity.
    pub fn count(&self, severity: Severity) -> usize {
        self.findings.iter().filter(|finding| finding.severity() == severity).count()
    }
}

/// Examines a file in either form, or a tier of one, and continues after a fault as far as more can be found: every
/// damaged section and every section with a broken rule is named, up to 256. The report has an error if and only if
/// [`crate::open`] refuses the file, and its first error is the one that `open` gives.
///
/// `bytes` are not copied. Cost: that of [`crate::Asset::parse`] or [`ResidentFile::open`]. Never panics.
pub fn validate(bytes: ResidentBytes, threads: Threads) -> Report {
    let all: &[u8] = (*bytes).as_ref();
    let mut faults = Faults::default();
    let directory = examine_directory_of::<Spmm>(all, threads, &mut faults);
    let mut told = Report::default();
    let sections = directory.as_ref().map_or(Vec::new(), |directory| directory.at_hand(all.len()).collect());
    if let Some(directory) = &directory {
        told.say(rule::FORM, form_of(directory, all.len()));
        about_head(directory, &mut told);
        told.findings.extend(about_container::<Spmm>(directory, all.len()));
        match directory.head.form {
            Form::Resident => {
                let file = examine_resident(bytes.clone(), directory, threads, &mut faults);
                if let Some(file) = file.filter(|_| faults.is_empty()) {
                    about_resident(&file, &mut told);
                }
            }
            Form::File => {
                let asset = examine_asset(all, directory, threads, &mut faults);
                if let Some(asset) = asset.filter(|_| faults.is_empty()) {
                    about_asset(&asset, directory, &mut told);
                }
            }
        }
    }
    told.settled::<Spmm>(&faults, &sections)
}

impl Report {
    /// Returns the final report: the errors alone if there are any, else all findings in order of severity.
    pub(crate) fn settled<F: FileFormat>(mut self, faults: &Faults, sections: &[&SectionEntry]) -> Report {
        if !faults.is_empty() {
            let errors = faults.found().iter().filter_map(|fault| Finding::of_fault::<F>(fault, sections));
            return Report { findings: errors.collect(), ..Report::default() };
        }
        self.findings.sort_by_key(|finding| finding.severity());
        self
    }

    pub(crate) fn say(&mut self, rule: Rule, detail: String) {
        self.findings.push(Finding::new(rule, detail));
    }

    /// Adds the finding that `count` of `of` things of a layer are affected, unless `count` is 0.
    fn count_of_layer(&mut self, rule: Rule, layer: usize, [count, of]: [usize; 2]) {
        if count > 0 {
            let detail = format!("{count} of {of} in layer {layer}");
            self.findings.push(Finding { layer: Some(layer as u32), ..Finding::new(rule, detail) });
        }
    }
}

fn form_of(directory: &Directory<Head>, bytes: usize) -> String {
    let form = match directory.head.form {
        Form::File => "file",
        Form::Resident => "resident",
    };
    let version = directory.head.version;
    format!("{form} form of version {version}, {bytes} bytes in {} sections", directory.sections.len())
}

/// Adds the findings about the header.
fn about_head(directory: &Directory<Head>, told: &mut Report) {
    let head = directory.head;
    let size = match head.size_mm {
        Some([width, height]) => format!(", {width} x {height} mm"),
        None => {
            told.say(rule::NO_SIZE, "width_mm and height_mm are 0".into());
            String::new()
        }
    };
    told.say(rule::TEXELS, format!("{} x {}{size}", head.width, head.height));
    let seams = match head.seamless {
        [true, true] => "none",
        [true, false] => "between the top and the bottom edge",
        [false, true] => "between the left and the right edge",
        [false, false] => "between all edges",
    };
    told.say(rule::SEAMS, format!("{seams}, where the material is repeated"));
}

fn about_layers(sides: &[[SurfaceSide; 2]], told: &mut Report) {
    let name = |side: SurfaceSide| match side {
        SurfaceSide::Front => "front",
        SurfaceSide::Back => "back",
    };
    let list: Vec<String> =
        sides.iter().map(|[light, view]| format!("light {}, eye {}", name(*light), name(*view))).collect();
    told.say(rule::LAYERS, format!("{}: {}", sides.len(), list.join("; ")));
}

fn about_resident(file: &ResidentFile, told: &mut Report) {
    let resident = &file.resident;
    let mut sides = vec![[SurfaceSide::Front; 2]; resident.layers() as usize];
    for [light, view] in SurfaceSide::ALL.into_iter().flat_map(|light| SurfaceSide::ALL.map(|view| [light, view])) {
        if let Some(layer) = resident.layer_for_sides(0, light, view) {
            sides[layer as usize] = [light, view];
        }
    }
    about_layers(&sides, told);
    told.say(rule::LEVELS, resident.levels().to_string());
    told.sides = sides;
    told.material = Some(file.material.clone());
}

fn about_asset(asset: &Asset, directory: &Directory<Head>, told: &mut Report) {
    let sides: Vec<_> = asset.layers.iter().map(|layer| [layer.light_side, layer.view_side]).collect();
    about_layers(&sides, told);
    told.say(rule::LEVELS, (1 + asset.levels.len()).to_string());
    // In a tier, what refers to a section may be missing.
    if directory.is_whole() {
        let is_unread = |entry: &&SectionEntry| !is_read(asset, [entry.kind, entry.layer, entry.index]);
        told.findings.extend(directory.sections.iter().filter(is_unread).map(SectionEntry::unused_in::<Spmm>));
    }
    for (number, layer) in asset.layers.iter().enumerate() {
        about_layer(asset, number, layer, told);
    }
    let edits = &asset.edits;
    let unused = (1..=edits.list.len()).filter(|edit| !edits.texels.iter().any(|of| usize::from(*of) == *edit)).count();
    if unused > 0 {
        told.say(rule::EDIT_UNUSED, format!("{unused} of {}", edits.list.len()));
    }
    told.sides = sides;
    told.material = Some(asset.material.clone());
}

/// Returns whether a section of a whole file is read, or is of an unknown kind.
fn is_read(asset: &Asset, [kind, layer, index]: [u32; 3]) -> bool {
    use SectionKind::*;
    let of_layer = &asset.layers[layer as usize];
    let bases = of_layer.residual.as_ref().map_or(0, |residual| residual.bases.len() as u32);
    let groups = of_layer.residual.as_ref().map_or(0, |residual| residual.groups.len() as u32);
    match SectionKind::from_number(kind) {
        None => true,
        Some(Material | Edits) => layer == 0 && index == 0,
        Some(Spectrum) => layer == 0 && index == 0 && asset.spectrum.is_some(),
        Some(Layer | TexelClusters | TexelLobeCounts | Dictionary | LobeRefs | Height | Relief | LobeWeights) => {
            index == 0
        }
        Some(Directions) => index < 2,
        Some(Factors | SharedBases | FactorCodes) => index == 0 && bases > 0,
        Some(SharedBasesPart) => index < 2 && groups > 0,
        Some(PredictedCoefficients) => index > 0 && index <= groups,
        Some(Basis) => index < bases,
        Some(Coefficients) => index > 0 && index < bases,
        Some(Level) => index > 0 && index as usize <= asset.levels.len(),
        Some(Words) => false,
    }
}

/// Adds the findings about clusters and lobes that no texel of any level uses, and about texels without lobes and
/// residual.
fn about_layer(asset: &Asset, number: usize, layer: &Layer, told: &mut Report) {
    let mut used_clusters = vec![false; layer.dictionary.len()];
    let mut used_lobes: Vec<Vec<bool>> = layer.dictionary.iter().map(|lobes| vec![false; lobes.len()]).collect();
    let coarser = asset.levels.iter().map(|level| &level.layers[number]);
    let of_levels = coarser.map(|texels| (&texels.clusters, &texels.lobe_counts, &texels.lobe_refs));
    let finest = (&layer.texel_clusters, &layer.texel_lobe_counts, &layer.lobe_refs);
    for (clusters, counts, refs) in std::iter::once(finest).chain(of_levels) {
        clusters.iter().for_each(|cluster| used_clusters[usize::from(*cluster)] = true);
        mark_used_lobes(&mut used_lobes, clusters, counts, refs);
    }
    let unused = |used: &[bool]| used.iter().filter(|used| !**used).count();
    told.count_of_layer(rule::CLUSTER_UNUSED, number, [unused(&used_clusters), used_clusters.len()]);
    // The lobes of a cluster that nothing uses are told with it.
    let of_used = || used_lobes.iter().zip(&used_clusters).filter(|(_, used)| **used).map(|(lobes, _)| lobes);
    let lobes = [of_used().map(|lobes| unused(lobes)).sum(), of_used().map(Vec::len).sum()];
    told.count_of_layer(rule::LOBE_UNUSED, number, lobes);
    if layer.residual.is_none() {
        let black = layer.texel_lobe_counts.iter().filter(|count| **count == 0).count();
        told.count_of_layer(rule::TEXEL_BLACK, number, [black, layer.texel_lobe_counts.len()]);
    }
}
