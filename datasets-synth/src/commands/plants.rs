//! `btf-synth plants`: L-system plants and grass as a glTF file or a script of shapes.

use std::path::PathBuf;
use std::time::Instant;

use btf_synth::{
    CANOPY_VARIATION, CanopySize, Existing, Form, Ground, Habit, LeafDescription, PlantsParams, Species, TextureImages,
    write_plants,
};
use clap::{Args, ValueEnum};
use serde_json::json;

use super::arguments::whole_number;
use super::failure::Failure;
use super::leaf_file::LeafFileArgs;
use super::leaf_look::SpeciesName;
use super::run_args::RunArgs;

#[derive(Args)]
#[command(after_help = "Examples:
  btf-synth plants maize.glb
  btf-synth plants field.glb --rows 20 --columns 60 --ground
  btf-synth plants canopy.glb --triangles 8.6e6 --json -
  btf-synth plants young.glb --species soybean --stage 0.4 --plants 100
  btf-synth plants beech.glb --species tree --branches 2154 --leaves 6336
  btf-synth plants spruce.glb --species spruce --branches 2154 --leaves 6336
  btf-synth plants lawn.glb --species grass --plants 1400
  btf-synth plants patch.shapes.toml --form shapes --species grass
  btf-synth plants pale.glb --leaf leaf.toml")]
pub struct PlantsArgs {
    /// File to write, .glb or, with --form shapes, .shapes.toml; NAME-leaf.toml and the folder NAME-textures appear beside it
    out: PathBuf,
    #[command(flatten)]
    run: RunArgs,
    /// Species
    #[arg(long, value_enum, default_value_t = SpeciesName::Maize)]
    species: SpeciesName,
    /// What to write: triangles as .glb, or cones and sheets as .shapes.toml
    #[arg(long, value_enum, default_value_t = FormName::Mesh)]
    form: FormName,
    /// Growth from emerged (0) to flowering, or to the full-grown tree (1)
    #[arg(long, default_value_t = 1.0)]
    stage: f64,
    /// Mean leaf angle in degrees (5 to 85): maize from the stalk, grass from the vertical, others below the horizontal
    /// [default: maize 35, soybean 30, tree 35, grass 20, spruce 35]
    #[arg(long, value_name = "DEG")]
    leaf_angle_deg: Option<f64>,
    /// Maize: how its blades stand [default: spreading]
    #[arg(long, value_enum, conflicts_with_all = ["leaf_angle_deg", "bend"])]
    habit: Option<HabitName>,
    /// Maize: how far blades bend (0 to 1.5), 1 as spreading blades do [default: 1]
    #[arg(long, value_name = "SHARE")]
    bend: Option<f64>,
    /// Number of plants, in a field as square as rows allow [default: 1]
    #[arg(long, value_parser = whole_number, conflicts_with_all = ["rows", "columns", "triangles"])]
    plants: Option<u64>,
    /// Number of rows
    #[arg(long, value_parser = whole_number, requires = "columns")]
    rows: Option<u64>,
    /// Number of plants in a row
    #[arg(long, value_parser = whole_number, requires = "rows")]
    columns: Option<u64>,
    /// As many plants as bring the instanced triangles to this number, such as 8.6e6
    #[arg(long, value_parser = whole_number, conflicts_with = "rows", value_name = "N")]
    triangles: Option<u64>,
    /// Distance between rows in mm [default: maize 750, soybean 500, tree 4000, grass 40, spruce 2000]
    #[arg(long, value_name = "MM")]
    row_spacing_mm: Option<f64>,
    /// Distance between plants in a row in mm [default: maize 180, soybean 80, tree 4000, grass 40, spruce 2000]
    #[arg(long, value_name = "MM")]
    spacing_mm: Option<f64>,
    /// Different plants; the others are instances of them
    #[arg(long, default_value_t = 8)]
    variants: usize,
    /// Triangles of a blade (4 to 4000) [default: maize 200, soybean 40, tree 8, grass 14, spruce 8]
    #[arg(long, value_name = "N")]
    detail: Option<usize>,
    /// Branches of a full-grown tree, its trunk among them [default: 2000]
    #[arg(long)]
    branches: Option<usize>,
    /// Leaves of a full-grown tree, or shoots with needles of a spruce [default: 6000]
    #[arg(long)]
    leaves: Option<usize>,
    /// Blades of a patch of grass [default: 16]
    #[arg(long)]
    blades: Option<usize>,
    /// Share of patches of grass that have a flower (0 to 1) [default: 0.5]
    #[arg(long, value_name = "SHARE")]
    flowers: Option<f64>,
    /// Put soil under the plants
    #[arg(long)]
    ground: bool,
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    leaf: LeafFileArgs,
    /// Replace files of these names
    #[arg(long)]
    force: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum HabitName {
    /// Blades that arch over: mean inclination 37 degrees
    Spreading,
    /// 48 degrees
    Intermediate,
    /// Blades that stand up, as modern hybrids have them: 57 degrees
    Upright,
}

#[derive(Clone, Copy, ValueEnum)]
enum FormName {
    /// Binary glTF: meshes and instances
    Mesh,
    /// A script of shapes for a volumetric texture
    Shapes,
}

/// Grows the plants and writes the files.
pub fn run(args: &PlantsArgs) -> Result<(), Failure> {
    let species = Species::from(args.species);
    if species != Species::Maize && (args.habit.is_some() || args.bend.is_some()) {
        return Err(Failure::Usage(
            "--habit and --bend are those of maize; other species take --leaf-angle-deg".into(),
        ));
    }
    let mut preset = PlantsParams::of(species);
    if let Some(habit) = args.habit {
        let habit = match habit {
            HabitName::Spreading => Habit::Spreading,
            HabitName::Intermediate => Habit::Intermediate,
            HabitName::Upright => Habit::Upright,
        };
        (preset.leaf_angle_deg, preset.bend) = habit.blades();
    }
    let count = |number: u64| usize::try_from(number).unwrap_or(usize::MAX);
    let params = PlantsParams {
        stage: args.stage,
        leaf_angle_deg: args.leaf_angle_deg.unwrap_or(preset.leaf_angle_deg),
        bend: args.bend.unwrap_or(preset.bend),
        detail: args.detail.unwrap_or(preset.detail),
        variants: args.variants,
        size: match (args.plants, args.rows, args.columns, args.triangles) {
            (_, _, _, Some(triangles)) => CanopySize::Triangles(triangles),
            (_, Some(rows), Some(columns), _) => CanopySize::Rows(count(rows), count(columns)),
            (plants, ..) => CanopySize::Plants(plants.map_or(1, count)),
        },
        row_spacing_mm: args.row_spacing_mm.unwrap_or(preset.row_spacing_mm),
        spacing_mm: args.spacing_mm.unwrap_or(preset.spacing_mm),
        branches: args.branches.unwrap_or(preset.branches),
        leaves: args.leaves.unwrap_or(preset.leaves),
        blades: args.blades.unwrap_or(preset.blades),
        flowers: args.flowers.unwrap_or(preset.flowers),
        form: match args.form {
            FormName::Mesh => Form::Mesh,
            FormName::Shapes => Form::Shapes,
        },
        ground: if args.ground { Ground::Soil } else { Ground::None },
        seed: args.seed,
        ..preset
    };
    let described = args.leaf.read()?;
    let textures = described.as_ref().and_then(|leaf| args.leaf.textures(leaf));
    let images = textures.map_or(Ok(TextureImages::default()), TextureImages::read);
    let images = images.map_err(|error| Failure::Failed(error.to_string()))?;
    let leaf = described
        .unwrap_or_else(|| LeafDescription { variation: CANOPY_VARIATION, ..LeafDescription::of(Some(species), None) });
    let existing = if args.force { Existing::Replace } else { Existing::Refuse };
    let started = Instant::now();
    let report = args
        .run
        .work("plants", "steps", 3, |progress| write_plants(&args.out, &params, &leaf, images, existing, progress))?;
    let seconds = started.elapsed().as_secs_f64();
    let result = json!({
        "path": args.out.display().to_string(),
        "leaf": report.leaf.display().to_string(),
        "textures": report.textures.display().to_string(),
        "species": species.name(),
        "stage": params.stage,
        "leaf_angle_deg": params.leaf_angle_deg,
        "bend": params.bend,
        "plants": report.plants,
        "variants": report.variants,
        "triangles_unique": report.triangles_unique,
        "triangles_instanced": report.triangles_instanced,
        "shapes": report.shapes,
        "leaves": report.leaves,
        "flowers": report.flowers,
        "leaf_area_m2": report.leaf_area_m2,
        "leaf_area_index": report.leaf_area_index,
        "drawn_leaf_area_m2": report.drawn_leaf_area_m2,
        "drawn_leaf_area_index": report.drawn_leaf_area_index,
        "bytes": report.bytes,
        "seed": params.seed,
        "seconds": seconds,
    });
    let drawn = match params.form {
        Form::Mesh => format!("{} triangles ({} in the file)", report.triangles_instanced, report.triangles_unique),
        Form::Shapes => format!("{} shapes", report.shapes),
    };
    let line = format!(
        "{}: {} plants of {} variants, {drawn}, leaf area index {:.2}",
        args.out.display(),
        report.plants,
        report.variants,
        report.leaf_area_index
    );
    args.run.report(&result, &line)
}
