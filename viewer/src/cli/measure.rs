//! `btf-view measure`: a canopy by numbers.

use super::progress::with_progress;
use super::report::write_json;
use btf_models::{LeafDescription, LeafGloss, field_m};
use btf_runtime::FaceGloss;
use btf_viewer::{
    CanopyCell, CanopyLight, CanopyMeasurement, CanopyOptics, CanopyParams, Figures, LeafLight, MAX_CANOPY_BANDS,
    SpectraTable, ViewerError, canopy_svg, measure_canopy,
};
use std::fmt::Write;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(super) struct MeasureArguments {
    /// Plants, as `btf-synth plants` writes them: .glb, .gltf or .obj in metres, y up, soil at y = 0
    pub(super) canopy: PathBuf,
    /// Table (CSV) of a leaf's reflectance and transmittance, as `btf-synth spectrum --csv` writes it, of one face or both
    #[arg(long, value_name = "FILE")]
    pub(super) leaf: PathBuf,
    /// Gloss of both faces of leaves: a leaf.toml, or index and roughness, as in 1.42,0.3 [default: none; all is diffuse]
    #[arg(long, value_name = "FILE|INDEX,ROUGHNESS")]
    pub(super) gloss: Option<String>,
    /// Table (CSV) of the soil's reflectance over nm, or one number, 0 to 1
    #[arg(long, value_name = "FILE|R")]
    pub(super) soil: String,
    /// Table (CSV) of the reflectance of stems and all that is no leaf, or one number [default: that of the leaf's upper face]
    #[arg(long, value_name = "FILE|R")]
    pub(super) other: Option<String>,
    /// Names of the materials that are leaves
    #[arg(long, value_name = "NAMES", value_delimiter = ',', default_value = "leaf")]
    pub(super) leaf_parts: Vec<String>,
    /// Lengths in metres along x and z with which the plants repeat without end [default: the field that the file names]
    #[arg(long, value_name = "X,Z", value_parser = parse_cell)]
    pub(super) cell: Option<[f64; 2]>,
    /// Bands in nm [default: those of the leaf's table]
    #[arg(long, value_name = "NM", value_delimiter = ',')]
    pub(super) bands_nm: Vec<f64>,
    /// Angles of the sun from the zenith in degrees
    #[arg(long, value_name = "DEG", value_delimiter = ',', default_value = "30")]
    pub(super) sun_deg: Vec<f64>,
    /// Direction of the sun in degrees from north (-z) over east (+x); rows run from west to east
    #[arg(long, value_name = "DEG", default_value_t = 180.0, allow_hyphen_values = true)]
    pub(super) sun_azimuth_deg: f64,
    /// Measure under a white sky, too
    #[arg(long)]
    pub(super) sky: bool,
    /// Angles of eyes from the zenith in the plane of the sun, positive on its side: a list, or FROM:TO:STEP
    #[arg(long, value_name = "DEG", value_parser = parse_angles, default_value = "-75:75:5", allow_hyphen_values = true)]
    pub(super) view_deg: Angles,
    /// Angles by which the plane of the eyes is turned from the sun's
    #[arg(long, value_name = "DEG", value_delimiter = ',', default_value = "0", allow_hyphen_values = true)]
    pub(super) view_azimuth_deg: Vec<f64>,
    /// Layers of equal height
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(super) layers: u32,
    /// Photons for each sun, such as 1e6
    #[arg(long, value_name = "N", default_value = "1e5", value_parser = parse_photons)]
    pub(super) photons: u32,
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u32,
    /// Writes a table (CSV) of the light that each leaf absorbs
    #[arg(long, value_name = "FILE")]
    pub(super) leaves: Option<PathBuf>,
    /// Draws the reflectance over the eyes' angle as SVG
    #[arg(long, value_name = "FILE")]
    pub(super) plot: Option<PathBuf>,
    /// Writes the figures as JSON; - is stdout
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
    /// Print neither progress nor figures
    #[arg(long)]
    pub(super) quiet: bool,
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(super) threads: Option<u32>,
}

/// Angles in degrees.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Angles(Vec<f64>);

fn parse_angles(text: &str) -> Result<Angles, String> {
    let refuse =
        || "angles are a list, as in -30,0,30, or FROM:TO:STEP with at most 1000 of them, as in -75:75:5".to_owned();
    let numbers = |separator: char| -> Option<Vec<f64>> {
        text.split(separator).map(|part| part.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect()
    };
    if !text.contains(':') {
        return numbers(',').map(Angles).ok_or_else(refuse);
    }
    match numbers(':').as_deref() {
        Some([from, to, step]) if *step > 0.0 && to >= from && (to - from) / step < 1000.0 => {
            let count = ((to - from) / step + 1e-9) as usize;
            Ok(Angles((0..=count).map(|i| from + step * i as f64).collect()))
        }
        _ => Err(refuse()),
    }
}

fn parse_cell(text: &str) -> Result<[f64; 2], String> {
    let sides = text.split_once(',').and_then(|(x, z)| Some([x.trim().parse().ok()?, z.trim().parse().ok()?]));
    sides
        .filter(|sides: &[f64; 2]| sides.iter().all(|side| side.is_finite() && *side > 0.0))
        .ok_or_else(|| "a cell is two lengths in metres, as in 0.75,0.18".into())
}

fn parse_photons(text: &str) -> Result<u32, String> {
    let most = f64::from(btf_viewer::MAX_PHOTONS);
    text.parse::<f64>()
        .ok()
        .filter(|count| (1.0..=most).contains(count))
        .map(|count| count as u32)
        .ok_or_else(|| format!("it is a number from 1 to {most}, as in 1e6"))
}

/// Reads the gloss of a leaf's description, whose two roughnesses become one, or takes index and roughness.
fn gloss_of(text: &str) -> Result<FaceGloss, ViewerError> {
    let numbers = text
        .split_once(',')
        .and_then(|(index, roughness)| Some([index.trim().parse().ok()?, roughness.trim().parse().ok()?]));
    let [index, roughness] = match numbers {
        Some(numbers) => numbers,
        None => {
            let LeafGloss { index, gamma_along, gamma_across } = LeafDescription::read(text)?.gloss;
            // The slope variance is the mean of both.
            [index, (0.5 * (gamma_along * gamma_along + gamma_across * gamma_across)).sqrt()]
        }
    };
    if !((1.01..=3.0).contains(&index) && (0.05..=1.0).contains(&roughness)) {
        return Err(ViewerError::Usage(format!(
            "a gloss of index {index} and roughness {roughness}; 1.01 to 3 and 0.05 to 1 are allowed, as in --gloss 1.42,0.3"
        )));
    }
    Ok(FaceGloss::new(index as f32, roughness as f32))
}

/// Reads a table, or takes a number for all wavelengths.
fn table(text: &str) -> Result<SpectraTable, ViewerError> {
    match text.parse::<f64>() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(SpectraTable::constant(share)),
        Ok(share) => Err(ViewerError::Usage(format!("{share} is no share of light; give 0 to 1 or a table"))),
        Err(_) => SpectraTable::read(Path::new(text)),
    }
}

/// Runs the command.
///
/// # Errors
/// [`ViewerError::Usage`] for options that do not fit each other or the file; those of reading and writing files.
pub(super) fn run(arguments: &MeasureArguments) -> Result<(), ViewerError> {
    let size_m = match arguments.cell {
        Some(size_m) => size_m,
        None => field_m(&arguments.canopy)?.ok_or_else(|| {
            let path = arguments.canopy.display();
            ViewerError::Usage(format!("{path} does not say with which lengths it repeats; give --cell X,Z in metres"))
        })?,
    };
    if LeafDescription::is_one(&arguments.leaf) {
        let path = arguments.leaf.display();
        return Err(ViewerError::Usage(format!(
            "{path} describes a leaf; `btf-synth spectrum --leaf {path} --both-sides --csv leaf.csv` writes its table for --leaf, and --gloss {path} \
             gives it its gloss"
        )));
    }
    let leaf = SpectraTable::read(&arguments.leaf)?;
    let soil = table(&arguments.soil)?;
    let other = arguments.other.as_deref().map(table).transpose()?;
    let bands_nm = bands_of(arguments, &leaf)?;
    let mut optics = CanopyOptics::new(&bands_nm, &leaf, &soil, other.as_ref())?;
    if let Some(gloss) = &arguments.gloss {
        optics = optics.with_gloss(gloss_of(gloss)?)?;
    }
    let cell = CanopyCell::load(&arguments.canopy, &arguments.leaf_parts, size_m)?;
    let params = CanopyParams {
        photons: arguments.photons,
        sun_zeniths_deg: arguments.sun_deg.clone(),
        sun_azimuth_deg: arguments.sun_azimuth_deg,
        sky: arguments.sky,
        view_zeniths_deg: arguments.view_deg.0.clone(),
        view_azimuths_deg: arguments.view_azimuth_deg.clone(),
        layers: arguments.layers as usize,
        leaves: arguments.leaves.is_some(),
        seed: arguments.seed,
    };
    let told = with_progress(arguments.quiet, |control| measure_canopy(&cell, &optics, &params, control))?;
    if let Some(path) = &arguments.leaves {
        btf_capture::atomic::write_file_atomically(path, leaves_csv(&told).as_bytes())?;
    }
    if let Some(path) = &arguments.plot {
        let svg = canopy_svg(&told).map_err(|reason| ViewerError::Encode { path: path.clone(), reason })?;
        btf_capture::atomic::write_file_atomically(path, svg.as_bytes())?;
    }
    write_json(arguments.json.as_deref(), &told)?;
    if !(arguments.quiet || arguments.json.as_deref().is_some_and(|path| path.as_os_str() == "-")) {
        print!("{}", summary(&told));
    }
    Ok(())
}

/// Returns the bands that are asked for, ascending, or those of the leaf's table.
fn bands_of(arguments: &MeasureArguments, leaf: &SpectraTable) -> Result<Vec<f64>, ViewerError> {
    if arguments.bands_nm.is_empty() {
        let count = leaf.wavelengths_nm().len();
        if count > MAX_CANOPY_BANDS {
            return Err(ViewerError::Usage(format!(
                "{} has {count} wavelengths; choose at most {MAX_CANOPY_BANDS} with --bands-nm, such as 550,670,800",
                arguments.leaf.display()
            )));
        }
        return Ok(leaf.wavelengths_nm().to_vec());
    }
    let mut bands_nm = arguments.bands_nm.clone();
    bands_nm.sort_by(f64::total_cmp);
    bands_nm.dedup();
    match bands_nm.iter().all(|nm| nm.is_finite() && *nm > 0.0) {
        true => Ok(bands_nm),
        false => Err(ViewerError::Usage("--bands-nm takes wavelengths in nm".into())),
    }
}

/// Returns what is printed.
fn summary(told: &CanopyMeasurement) -> String {
    let structure = &told.structure;
    let mut text = format!(
        "leaf area index {:.3} ({} leaves of {} plants on {:.3} m2), other organs {:.3}, height {:.3} m\n\
         mean inclination {:.1} degrees; shares by 10 degrees {}\n",
        structure.leaf_area_index,
        structure.leaves,
        structure.plants,
        structure.ground_m2,
        structure.other_area_index,
        structure.height_m,
        structure.mean_inclination_deg,
        structure.inclination_shares.map(|share| format!("{share:.3}")).join(" ")
    );
    // A String takes everything.
    for gap in &structure.gaps {
        let clumping = gap.clumping.map_or("-".to_owned(), |clumping| format!("{clumping:.3}"));
        let _ = writeln!(
            text,
            "gaps at {:>2} degrees {:.4} +- {:.4}, projection {:.3}, clumping {clumping}",
            gap.zenith_deg, gap.gap_fraction, gap.standard_error, gap.projection
        );
    }
    for light in &told.light {
        let from = light.sun_zenith_deg.map_or("white sky".to_owned(), |deg| format!("sun at {deg} degrees"));
        let _ =
            writeln!(text, "{from}\n{:>8} {:>18} {:>18} {:>18} {:>18}", "nm", "reflected", "leaves", "other", "soil");
        for (band, nm) in told.wavelengths_nm.iter().enumerate() {
            let cell = |figures: &Figures| format!("{:.4} +- {:.4}", figures.value[band], figures.standard_error[band]);
            let CanopyLight { reflectance, absorbed_by_leaves, absorbed_by_other, absorbed_by_soil, .. } = light;
            let cells = [reflectance, absorbed_by_leaves, absorbed_by_other, absorbed_by_soil].map(cell);
            let _ = writeln!(text, "{nm:>8} {:>18} {:>18} {:>18} {:>18}", cells[0], cells[1], cells[2], cells[3]);
        }
    }
    text
}

/// Returns the table of leaves: a row for each leaf, and columns for each light and band.
fn leaves_csv(told: &CanopyMeasurement) -> String {
    let mut text = "plant,leaf,height_m,area_m2,inclination_deg".to_owned();
    for light in &told.light {
        let from = light.sun_zenith_deg.map_or("sky".to_owned(), |deg| format!("sun {deg} deg"));
        told.wavelengths_nm.iter().for_each(|nm| {
            let _ = write!(text, ",absorbed {from} {nm} nm");
        });
    }
    text.push('\n');
    let leaves = told.light.first().map_or(0, |light| light.leaves.len());
    for leaf in 0..leaves {
        let LeafLight { plant, leaf: number, height_m, area_m2, inclination_deg, .. } = &told.light[0].leaves[leaf];
        let _ = write!(text, "{plant},{number},{height_m:.5},{area_m2:.6e},{inclination_deg:.2}");
        for absorbed in told.light.iter().flat_map(|light| &light.leaves[leaf].absorbed) {
            let _ = write!(text, ",{absorbed:.5}");
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_cells_and_photons_are_checked() {
        assert_eq!(parse_angles("-30,0,30"), Ok(Angles(vec![-30.0, 0.0, 30.0])));
        assert_eq!(parse_angles("-10:10:5"), Ok(Angles(vec![-10.0, -5.0, 0.0, 5.0, 10.0])));
        assert!(["", "a", "0:10", "0:10:0", "10:0:1", "0:1e9:1", "nan"].iter().all(|text| parse_angles(text).is_err()));
        assert_eq!(parse_cell("0.75, 0.18"), Ok([0.75, 0.18]));
        assert!(["1", "0,1", "-1,2", "1,x", "inf,1"].iter().all(|text| parse_cell(text).is_err()));
        assert_eq!(parse_photons("1e6"), Ok(1_000_000));
        assert!(["0", "-5", "1e12", "x"].iter().all(|text| parse_photons(text).is_err()));
    }
}
