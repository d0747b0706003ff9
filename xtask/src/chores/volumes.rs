//! `cargo xtask volumes`: the volumetric textures that come with the viewer, grown by btf-synth and built by btf-fit.

use crate::arguments::asks_for_help;
use crate::failure::Failure;
use crate::shell::{cargo, root, run_checked};
use std::path::Path;

const HELP: &str = "\
Writes the volumes of `btf-view scene`, viewer/src/scene/builtin/*.voltex.

Usage: cargo xtask volumes [--resolution N | --models]

With --resolution, finer or coarser ones are written into target/volumes instead, for `btf-view scene --volume`. With
--models, the plants themselves are written there, as .glb, for `btf-view scene --mesh` and `btf-view bench gpu --plants`.

Examples:
  cargo xtask volumes --resolution 256 && btf-view scene grove --volume target/volumes/tree.voltex
  cargo xtask volumes --models && btf-view scene grove --mesh target/volumes/tree.glb";

/// Folder in which scripts and volumes are made, relative to the repository's root.
const FOLDER: &str = "target/volumes";
/// Folder of the volumes that come with the viewer.
const MODELS: &str = "viewer/src/scene/builtin";
/// Plants that are grown: name, and options of btf-synth.
const GROWN: [(&str, &str); 6] = [
    ("lawn", "--species grass --flowers 0"),
    ("lawn_flower", "--species grass --flowers 1 --seed 2"),
    ("tree", "--species tree --branches 2154 --leaves 6336"),
    ("tree2", "--species tree --branches 2154 --leaves 6336 --seed 7"),
    ("spruce", "--species spruce --branches 2154 --leaves 6336"),
    ("spruce2", "--species spruce --branches 2154 --leaves 6336 --seed 7"),
];
/// Volumes that are built: name, voxels along each side, and number of view directions of the fit.
const BUILT: [(&str, u32, u32); 5] =
    [("lawn", 128, 24), ("lawn_flower", 128, 24), ("tree", 64, 12), ("forest", 64, 12), ("forest_spruce", 64, 12)];
/// Space of the volume with one tree, which stands in the middle.
const TREE_SPACE: &str = "least_m = [-3.0, -3.0, 0.0]\nmost_m = [3.0, 3.0, 6.0]\ncyclic = [false, false]";
/// Space of a volume with two trees of the forest: one period.
const FOREST_SPACE: &str = "least_m = [0.0, 0.0, 0.0]\nmost_m = [6.0, 6.0, 6.0]\ncyclic = [true, true]";
/// A plant in the space of a volume: its name, its size over the one it is grown in, and its foot.
type Placed = (&'static str, f64, [f64; 3]);
/// Volumes of the forest and their trees, as the viewer's `landscape/forest.rs` has them: so large that next to nothing
/// of them goes on opposite, since texels are turned, and on no line of symmetry, so that turns move them.
const FORESTS: [(&str, [Placed; 2]); 2] = [
    ("forest", [("tree", 0.9, [1.85, 2.5, 0.0]), ("tree2", 0.85, [4.45, 4.3, 0.0])]),
    ("forest_spruce", [("spruce", 1.65, [1.4, 2.45, 0.0]), ("spruce2", 1.5, [4.75, 4.15, 0.0])]),
];

/// Runs the chore.
pub fn run(arguments: &[String]) -> Result<(), Failure> {
    if asks_for_help(arguments) {
        println!("{HELP}");
        return Ok(());
    }
    let resolution = match arguments {
        [] => None,
        [option] if option == "--models" => return grow("glb", &[]),
        [option, number] if option == "--resolution" => Some(
            number
                .parse::<u32>()
                .map_err(|_| Failure::usage(format!("--resolution takes a number, it was given '{number}'")))?,
        ),
        _ => return Err(Failure::usage(format!("`volumes` takes --resolution N or --models\n\n{HELP}"))),
    };
    grow("shapes.toml", &["--form", "shapes"])?;
    let folder = root().join(FOLDER);
    for (name, trees) in FORESTS {
        let [one, other] = trees.map(|(tree, ..)| read(&folder, tree));
        write(&folder, name, &forest_of([&one?, &other?], trees)?)?;
    }
    write(&folder, "tree", &in_space(&read(&folder, "tree")?, TREE_SPACE)?)?;
    for (name, usual, views) in BUILT {
        let [script, volume] = ["shapes.toml", "voltex"].map(|ending| format!("{FOLDER}/{name}.{ending}"));
        let voxels = resolution.unwrap_or(usual).to_string();
        let mut fit = cargo(&["run", "--release", "--quiet", "-p", "btf-fit", "--", "voltex", &script, "-o", &volume]);
        run_checked(fit.args(["--resolution", &voxels, "--views", &views.to_string()]))?;
        if resolution.is_none() {
            let model = root().join(MODELS).join(format!("{name}.voltex"));
            std::fs::copy(root().join(&volume), &model)
                .map_err(|error| Failure::new(format!("{} cannot be written: {error}", model.display())))?;
        }
    }
    Ok(())
}

/// Grows the plants into files with an ending.
fn grow(ending: &str, form: &[&str]) -> Result<(), Failure> {
    let folder = root().join(FOLDER);
    std::fs::create_dir_all(&folder)
        .map_err(|error| Failure::new(format!("{} cannot be made: {error}", folder.display())))?;
    for (name, options) in GROWN {
        let file = format!("{FOLDER}/{name}.{ending}");
        let mut synth = cargo(&["run", "--release", "--quiet", "-p", "btf-synth", "--", "plants", &file]);
        run_checked(synth.args(form).arg("--force").args(options.split(' ')))?;
    }
    Ok(())
}

fn read(folder: &Path, name: &str) -> Result<String, Failure> {
    let path = folder.join(format!("{name}.shapes.toml"));
    std::fs::read_to_string(&path).map_err(|error| Failure::new(format!("{} cannot be read: {error}", path.display())))
}

fn write(folder: &Path, name: &str, text: &str) -> Result<(), Failure> {
    let path = folder.join(format!("{name}.shapes.toml"));
    std::fs::write(&path, text).map_err(|error| Failure::new(format!("{} cannot be written: {error}", path.display())))
}

/// Splits a script into its materials and its strokes.
fn parts_of(script: &str) -> Result<[&str; 2], Failure> {
    let at = |head: &str| script.find(head).ok_or_else(|| Failure::new(format!("a plant's script has no {head}")));
    let (materials, strokes) = (at("[[materials]]")?, at("[[strokes]]")?);
    Ok([&script[materials..strokes], &script[strokes..]])
}

/// Returns a script with its space replaced.
fn in_space(script: &str, space: &str) -> Result<String, Failure> {
    let [materials, strokes] = parts_of(script)?;
    Ok(format!("[space]\n{space}\n\n{materials}{strokes}"))
}

/// Returns a script with both trees in one space. Both have the materials of the first.
fn forest_of(trees: [&str; 2], placed: [Placed; 2]) -> Result<String, Failure> {
    let mut forest = format!("[space]\n{FOREST_SPACE}\n\n{}", parts_of(trees[0])?[0]);
    for (script, (_, scale, foot)) in trees.iter().zip(placed) {
        let placed = format!(
            "[[strokes.shapes]]\nkind = \"placed\"\nscale = {scale:?}\nmove_m = {foot:?}\n[strokes.shapes.of]\n"
        );
        forest.push_str(&parts_of(script)?[1].replace("[[strokes.shapes]]\n", &placed));
    }
    Ok(forest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_forest_has_the_shapes_of_both_trees_each_in_its_place() {
        let tree =
            "[space]\na = 1\n\n[[materials]]\nname = \"leaf\"\n\n[[strokes]]\n[[strokes.shapes]]\nkind = \"limb\"\n";
        for ((_, placed), foot) in FORESTS.into_iter().zip(["[4.45, 4.3, 0.0]", "[4.75, 4.15, 0.0]"]) {
            let forest = forest_of([tree, tree], placed).unwrap_or_default();
            assert_eq!([forest.matches("[[materials]]").count(), forest.matches("kind = \"limb\"").count()], [1, 2]);
            let moved = format!("move_m = {foot}\n[strokes.shapes.of]");
            assert!(forest.starts_with("[space]\nleast_m") && forest.contains(&moved));
            assert!(forest_of([tree, "nothing"], placed).is_err());
        }
    }
}
