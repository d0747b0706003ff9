//! Reads and writes scripts as files.

use std::path::{Path, PathBuf};

use crate::error::ModelError;
use crate::shapes::check::check;
use crate::shapes::script::Script;
use btf_capture::atomic::{parent_of, write_file_atomically};
use btf_capture::toml_text::{bounded_text, line_and_reason};

/// Ending of the names of scripts.
pub const SCRIPT_ENDING: &str = ".shapes.toml";

/// Largest script in bytes, room for more than a million shapes.
pub const MAX_SCRIPT_BYTES: u64 = 1 << 26;

impl Script {
    /// Reads a script and checks every number, name and count in it.
    ///
    /// # Errors
    /// [`ModelError::Shapes`] for a file that cannot be read, is larger than [`MAX_SCRIPT_BYTES`], is no TOML, has
    /// an unknown key, or a value of the wrong kind or out of its range.
    pub fn read(path: impl AsRef<Path>) -> Result<Script, ModelError> {
        let path = path.as_ref();
        let bad = |fault: String, remedy| ModelError::Shapes { path: path.into(), fault, remedy };
        let text = bounded_text(path, MAX_SCRIPT_BYTES, "a script of shapes")
            .map_err(|fault| bad(fault, "point to a script of shapes (.shapes.toml)"))?;
        Script::parse(&text).map_err(|fault| bad(fault, "correct it"))
    }

    /// Writes the script, whole or not at all. [`Script::read`] returns the same script again.
    ///
    /// # Errors
    /// [`ModelError::Shapes`] for a script that could not be read again; [`ModelError::File`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), ModelError> {
        Ok(write_file_atomically(path.as_ref(), self.to_text(path.as_ref())?.as_bytes())?)
    }

    /// Returns the text that [`Script::write`] would write to `path`.
    ///
    /// # Errors
    /// [`ModelError::Shapes`] for a script that could not be read again.
    pub fn to_text(&self, path: impl AsRef<Path>) -> Result<String, ModelError> {
        let path = path.as_ref();
        let bad = |fault: String| ModelError::Shapes { path: path.into(), fault, remedy: "change that value" };
        let text = self.to_toml().map_err(bad)?;
        if text.len() as u64 > MAX_SCRIPT_BYTES {
            return Err(bad(format!("would have {} bytes, and {MAX_SCRIPT_BYTES} are allowed", text.len())));
        }
        Ok(text)
    }

    /// Returns the path of a file that the script, read from `path`, names.
    pub fn beside(path: impl AsRef<Path>, file: impl AsRef<Path>) -> PathBuf {
        parent_of(path.as_ref()).join(file)
    }

    /// Parses the text of a script. The error is a verb phrase.
    pub(super) fn parse(text: &str) -> Result<Script, String> {
        let script: Script = toml::from_str(text).map_err(|error| {
            let (line, reason) = line_and_reason(text, &error);
            format!("is no script of shapes in line {line} ({reason})")
        })?;
        check(&script)?;
        Ok(script)
    }

    /// Returns the text of the file. The error is a verb phrase.
    pub(super) fn to_toml(&self) -> Result<String, String> {
        check(self)?;
        toml::to_string(self).map_err(|error| format!("cannot be written as TOML ({error})"))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::shapes::material::{Material, Projection, Tint};
    use crate::shapes::noise::Noise;
    use crate::shapes::script::{PaintMode, Space, Stroke};
    use crate::shapes::shape::{BlendElement, DensityData, NumberType, ParticleSystem, Shape, Trail, UpAxis};

    fn space() -> Space {
        Space { least_m: [-1.0; 3], most_m: [1.0, 2.0, 1.5], cyclic: [true, false] }
    }

    fn material(name: &str) -> Material {
        Material { name: name.into(), reflectance: Some([0.1, 0.2, 0.3]), ..Material::default() }
    }

    /// Returns a script with everything in it.
    fn full() -> Script {
        let noise = Noise { cells: [4, 5, 6], octaves: 3, gain: 0.4, seed: 9 };
        let colours = [[0.1, 0.2, 0.3], [1.0, 0.5, 0.0]];
        let projection = Projection { corner_m: [0.0; 3], right_m: [1.0, 0.0, 0.0], up_m: [0.0, 0.0, 2.0] };
        let tints = [
            None,
            Some(Tint::Picture { file: "a.png".into(), projection: Some(projection) }),
            Some(Tint::Picture { file: "b.jpg".into(), projection: None }),
            Some(Tint::Noise { noise: noise.clone(), colours }),
            Some(Tint::Stripes { period_m: [0.0, 0.1, 0.2], colours }),
            Some(Tint::Checker { box_m: [0.1, 0.2, 0.3], colours }),
        ];
        let mut materials: Vec<Material> = tints
            .into_iter()
            .enumerate()
            .map(|(i, tint)| Material { tint, transmittance: Some([0.5; 3]), ..material(&format!("m{i}")) })
            .collect();
        materials[0].specular = Some(0.04);
        materials[0].roughness = Some(0.3);
        materials.push(Material { name: "leaf".into(), from: Some("x-leaf.toml".into()), ..Material::default() });
        let sphere = Shape::Sphere { centre_m: [0.1, 0.2, 0.3], radius_m: 0.25 };
        let cube = Shape::Box { least_m: [0.0; 3], most_m: [0.1, 0.2, 0.3] };
        let ends_m = [[0.0; 3], [0.0, 0.1, 0.2]];
        let cylinder = Shape::Cylinder { ends_m, radius_m: 0.01 };
        let cone = Shape::Cone { ends_m, radii_m: [0.02, 0.0] };
        let solids = vec![sphere.clone(), cube.clone(), cylinder, cone];
        let place =
            |of: Shape| Shape::Placed { of: of.into(), scale: 2.0, turn_deg: [10.0, 0.0, -90.0], move_m: [1.0; 3] };
        let sheet = Shape::Sheet { rows_m: vec![vec![[0.0; 3], [1.0, 0.0, 0.0]], vec![[0.5, 0.0, 1.0]]] };
        let raw =
            DensityData::Raw { file: "v.raw".into(), cells: [3, 4, 5], number: NumberType::U16be, header_bytes: 7 };
        let density = |data| Shape::Density {
            data,
            least_m: [0.0; 3],
            most_m: [1.0; 3],
            range: [10.0, 200.0],
            area_per_m3: 30.0,
        };
        let elements = vec![
            BlendElement { points_m: vec![[0.0; 3]], weight_m2: 0.04 },
            BlendElement { points_m: vec![[0.0; 3], [1.0; 3]], weight_m2: 0.01 },
        ];
        let fur = Shape::Fur {
            on: place(sheet.clone()).into(),
            strands_per_m2: 1e4,
            length_m: 0.03,
            radius_m: 1e-4,
            lean_deg: 20.0,
            lean_towards: [0.0, 1.0, 0.0],
            bend_deg: 30.0,
            curl_turns: 1.5,
            curl_radius_m: 1e-3,
            jitter: 0.2,
            segments: 5,
            seed: 3,
        };
        let system = |trail| ParticleSystem {
            from: place(sheet.clone()),
            particles: 40,
            speed_m_per_s: 1.5,
            towards: Some([0.0, 0.2, 1.0]),
            spread_deg: 25.0,
            acceleration_m_per_s2: [0.5, 0.0, -9.0],
            drag_per_s: 0.3,
            life_s: 0.25,
            jitter: 0.1,
            trail,
            segments: 6,
            seed: 9,
        };
        let trails = [Trail::Strand { radii_m: [1e-3, 0.0] }, Trail::Blade { widths_m: [4e-3, 1e-3], fold_deg: 35.0 }];
        let [strands, blades] = trails.map(|trail| Shape::Particles(Box::new(system(trail))));
        let shapes = vec![
            Shape::Union { of: solids.clone() },
            Shape::Intersection { of: vec![Shape::Difference { of: solids.clone() }, cube.clone()] },
            Shape::Blend { elements, threshold: 1.5 },
            place(place(sphere.clone())),
            Shape::Limb { points_m: vec![[0.0; 3], [0.0, 0.0, 1.0]], radii_m: vec![0.1, 0.0] },
            sheet,
            Shape::Mesh { file: "tree.glb".into(), up: UpAxis::Z },
            fur,
            strands,
            blades,
            Shape::Hypertexture { of: sphere.clone().into(), rim_m: 0.1, amplitude_m: 0.05, noise, area_per_m3: 9.0 },
            density(raw),
            density(DensityData::Slices { folder: "slices".into() }),
        ];
        let mut strokes = vec![Stroke { material: Some("m0".into()), mode: PaintMode::Add, shapes: shapes.clone() }];
        strokes.push(Stroke { material: Some("leaf".into()), mode: PaintMode::Set, shapes });
        strokes.extend([PaintMode::Subtract, PaintMode::Normals].map(|mode| Stroke {
            material: None,
            mode,
            shapes: solids.clone(),
        }));
        Script { space: space(), materials, strokes }
    }

    #[test]
    fn a_written_script_is_read_back_exactly() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.shapes.toml");
        full().write(&path).unwrap();
        assert_eq!(Script::read(&path).unwrap(), full());
        // Planted difference: one bit of one number.
        let mut other = full();
        let Shape::Union { of } = &mut other.strokes[1].shapes[0] else { panic!() };
        let Shape::Sphere { radius_m, .. } = &mut of[0] else { panic!() };
        *radius_m = radius_m.next_up();
        other.write(&path).unwrap();
        assert_ne!(Script::read(&path).unwrap(), full());
    }

    /// Returns the first example of a text, without the prefix of its lines.
    fn example(text: &str, prefix: &str) -> Script {
        let lines = text.lines().skip_while(|line| !line.contains("```toml")).skip(1);
        let lines = lines.take_while(|line| !line.contains("```"));
        Script::parse(&lines.map(|line| line.trim_start_matches(prefix).to_string() + "\n").collect::<String>())
            .unwrap()
    }

    #[test]
    fn the_documented_examples_are_scripts() {
        let script = example(include_str!("mod.rs"), "//!");
        assert_eq!((script.materials.len(), script.strokes[0].shapes.len()), (2, 2));
        assert_eq!(script.strokes[0].shapes[1].parts()[1].kind(), "cylinder");
        let leaf = Script::beside("some/where/a.shapes.toml", script.materials[1].from.as_ref().unwrap());
        assert_eq!(leaf, PathBuf::from("some/where/petal-leaf.toml"));
        let script = example(include_str!("../../../docs/guide/shapes.md"), "");
        assert_eq!((script.materials.len(), script.strokes[1].shapes[0].kind()), (2, "fur"));
        let gallery = fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/results/voltex")).unwrap();
        let scripts = gallery.map(|entry| entry.unwrap().path());
        let scripts: Vec<_> = scripts.filter(|path| path.to_string_lossy().ends_with(SCRIPT_ENDING)).collect();
        assert!(scripts.len() > 9 && scripts.iter().all(|path| !Script::read(path).unwrap().strokes.is_empty()));
    }

    #[test]
    fn what_cannot_be_used_is_named_with_file_place_value_and_range() {
        const HEAD: &str =
            "[space]\nleast_m = [0,0,0]\nmost_m = [1,1,1]\n[[materials]]\nname = \"a\"\nreflectance = [0,0,0]\n";
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mine.shapes.toml");
        let shape = |shape: &str| format!("{HEAD}[[strokes]]\nmaterial = \"a\"\nshapes = [{{ {shape} }}]");
        let nested = |depth: usize| {
            let (open, close) = ("kind = \"union\", of = [{ ".repeat(depth), " }]".repeat(depth));
            shape(&format!("{open}kind = \"sphere\", centre_m = [0,0,0], radius_m = 1{close}"))
        };
        let cases: Vec<(String, &[&str])> = vec![
            ("".into(), &["line 1", "missing field `space`"]),
            ("[space]\nleast_m = [0,0,0]\nmost_m = [1,0,1]".into(), &["space without extent along y"]),
            ("[space]\nleast_m = [0,0,0]\nmost_m = [1,nan,1]".into(), &["`most_m` as NaN", "in [space]"]),
            (format!("{HEAD}colour = 3"), &["line 7", "unknown field `colour`", "`tint`"]),
            (HEAD.replace("most_m", "kind = 1\nmost_m"), &["line 3", "unknown field `kind`"]),
            (
                HEAD.replace("reflectance = [0,0,0]", "reflectance = [0,0,2]"),
                &["`reflectance` as 2", "0 to 1", "material \"a\""],
            ),
            (HEAD.replace("reflectance = [0,0,0]", ""), &["neither `reflectance` nor `from`"]),
            (format!("{HEAD}from = \"x.spmm\""), &["`reflectance` beside `from`"]),
            (format!("{HEAD}transmittance = [0.5,0.5,1.5]"), &["`transmittance` as 1.5"]),
            (format!("{HEAD}[[materials]]\nname = \"a\"\nfrom = \"b.toml\""), &["two materials", "\"a\""]),
            (format!("{HEAD}[[materials]]\nname = \"b\"\nfrom = \"b.png\""), &["b.png", ".spmm"]),
            (format!("{HEAD}[[strokes]]\nmaterial = \"b\"\nshapes = []"), &["`material` as \"b\"", "stroke 1"]),
            (format!("{HEAD}[[strokes]]\nshapes = []"), &["no `material` in stroke 1"]),
            (shape("kind = \"ball\", radius_m = 1"), &["line 9", "unknown variant `ball`", "sphere"]),
            (
                shape("kind = \"sphere\", centre_m = [0,0,0], radius_m = 1, colour = 1"),
                &["line 9", "unknown field `colour`"],
            ),
            (
                shape("kind = \"sphere\", centre_m = [0,0,0], radius_m = -1"),
                &["`radius_m` as -1", "of a sphere, shape 1 in stroke 1"],
            ),
            (shape("kind = \"sphere\", centre_m = [0,0], radius_m = 1"), &["line 9", "length 2"]),
            (shape("kind = \"box\", least_m = [0,0,0], most_m = [1,1,0]"), &["without extent along z"]),
            (
                shape("kind = \"cylinder\", ends_m = [[0,0,0],[0,0,0]], radius_m = 1"),
                &["distance between `ends_m` as 0"],
            ),
            (shape("kind = \"cone\", ends_m = [[0,0,0],[0,0,1]], radii_m = [0, 0]"), &["greatest of `radii_m` as 0"]),
            (shape("kind = \"limb\", points_m = [[0,0,0]], radii_m = [1]"), &["1 `points_m` and 1 `radii_m`"]),
            (shape("kind = \"sheet\", rows_m = [[[0,0,0],[1,0,0]],[[0,0,0],[1,0,0],[2,0,0]]]"), &["`rows_m`"]),
            (shape("kind = \"union\", of = []"), &["nothing in `of` of a union"]),
            (
                shape("kind = \"union\", of = [{ kind = \"mesh\", file = \"a.obj\" }]"),
                &["a mesh, which is no solid, in a union"],
            ),
            (shape("kind = \"blend\", elements = []"), &["no `elements`"]),
            (
                shape(
                    "kind = \"placed\", of = { kind = \"density\", data = { kind = \"slices\", folder = \"a\" }, least_m = [0,0,0], most_m = [1,1,1], range = [0,1], area_per_m3 = 1 }",
                ),
                &["a density in placed"],
            ),
            (
                shape(
                    "kind = \"density\", data = { kind = \"raw\", file = \"a\", cells = [4000000000,4000000000,4000000000], number = \"u8\" }, least_m = [0,0,0], most_m = [1,1,1], range = [0,1], area_per_m3 = 1",
                ),
                &["`cells` as [4000000000"],
            ),
            (
                shape(
                    "kind = \"particles\", from = { kind = \"cone\", ends_m = [[0,0,0],[0,0,1]], radii_m = [1,0] }, particles = 9, speed_m_per_s = 1, life_s = 1, trail = { kind = \"strand\", radii_m = [1,0] }",
                ),
                &["particles from a cone", "sheet"],
            ),
            (
                shape(
                    "kind = \"particles\", from = { kind = \"sphere\", centre_m = [0,0,0], radius_m = 1 }, particles = 9, speed_m_per_s = 1, life_s = 0, trail = { kind = \"blade\", widths_m = [1,0] }",
                ),
                &["`life_s` as 0"],
            ),
            (
                shape(
                    "kind = \"particles\", from = { kind = \"sphere\", centre_m = [0,0,0], radius_m = 1 }, particles = 9, speed_m_per_s = 1, life_s = 1, trail = { kind = \"blade\", widths_m = [0,0] }",
                ),
                &["`widths_m` of 0 alone"],
            ),
            (
                shape(
                    "kind = \"particles\", from = { kind = \"sphere\", centre_m = [0,0,0], radius_m = 1 }, particles = 9, speed_m_per_s = 1, life_s = 1, colour = 3, trail = { kind = \"blade\", widths_m = [1,0] }",
                ),
                &["unknown field `colour`"],
            ),
            (nested(MAX_DEPTH_REFUSED), &["shapes more than 16 deep"]),
            (nested(60), &[]),
            (
                format!("{HEAD}[[strokes]]\nmode = \"subtract\"\nshapes = [{{ kind = \"mesh\", file = \"a.obj\" }}]"),
                &["a mesh, which is no solid, in a stroke that subtracts"],
            ),
            ("\n[space\n".into(), &["line 2"]),
        ];
        for (text, parts) in cases {
            fs::write(&path, &text).unwrap();
            let message = Script::read(&path).expect_err(&text).to_string();
            assert!(message.contains("mine.shapes.toml ") && message.ends_with("; correct it"), "{message}");
            assert!(parts.iter().all(|part| message.contains(part)) && !message.contains('\n'), "{text}: {message}");
        }
        // As deep as it may be.
        fs::write(&path, nested(MAX_DEPTH_REFUSED - 1)).unwrap();
        Script::read(&path).unwrap();
        fs::write(&path, [0xFF, 0xFE]).unwrap();
        assert!(Script::read(&path).unwrap_err().to_string().contains("is no text"));
        assert!(Script::read(dir.path().join("none")).unwrap_err().to_string().contains("cannot be read"));
    }

    /// Number of unions around a sphere that is one too many.
    const MAX_DEPTH_REFUSED: usize = crate::shapes::MAX_NESTING;

    #[test]
    fn what_cannot_be_read_again_is_not_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.shapes.toml");
        let mut broken = full();
        broken.space.most_m[2] = f64::NAN;
        assert!(matches!(broken.write(&path), Err(ModelError::Shapes { .. })));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn every_prefix_is_a_script_or_refused_in_one_line() {
        let text = full().to_toml().unwrap();
        for end in (0..text.len()).filter(|&end| text.is_char_boundary(end)) {
            if let Err(fault) = Script::parse(&text[..end]) {
                assert!(!fault.contains('\n'), "{fault}");
            }
        }
    }
}
