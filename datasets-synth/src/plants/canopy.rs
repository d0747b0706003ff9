//! Canopies: some different plants, and the places of their instances.

use std::f64::consts::TAU;

use rand::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

use btf_models::Species;

use crate::error::SynthError;
use crate::plants::mesh::{Mesh, meshes};
use crate::plants::params::{CanopySize, Ground, MAX_PLANTS, MAX_UNIQUE_TRIANGLES, PlantsParams};
use crate::plants::plant::{Part, Plant};
use crate::plants::{grass, maize, soybean, spruce, tree};

/// Distance of plants from their regular places, as a share of the spacing.
const SCATTER: f64 = 0.12;

/// Relative variation of the sizes of instances: each is `1 - SIZES` to `1 + SIZES` times its variant.
const SIZES: f64 = 0.07;

/// One of the different plants of a canopy.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Variant {
    pub plant: Plant,
    pub meshes: Vec<(Part, Mesh)>,
}

impl Variant {
    fn of(plant: Plant, detail: usize) -> Variant {
        Variant { meshes: meshes(&plant, detail), plant }
    }

    pub fn triangle_count(&self) -> usize {
        self.meshes.iter().map(|(_, mesh)| mesh.triangle_count()).sum()
    }
}

/// Place of a plant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Instance {
    pub variant: usize,
    /// Position on the ground in metres.
    pub x_m: f64,
    pub z_m: f64,
    /// Rotation about the vertical in radians.
    pub yaw_rad: f64,
    pub scale: f64,
}

/// Plants with their places.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Canopy {
    pub variants: Vec<Variant>,
    /// Instances, row by row.
    pub instances: Vec<Instance>,
    /// Soil, if it was asked for.
    pub ground: Option<Mesh>,
    /// Area of the ground of one plant in square metres.
    pub area_per_plant_m2: f64,
    /// Extent of the grounds of all plants together along x and z in metres.
    pub field_m: [f64; 2],
    /// Whether the field continues beyond its border. A single plant does not, unless it is a patch of lawn.
    pub is_field: bool,
}

/// Returns one plant of the species; equal numbers give equal plants.
pub(crate) fn plant(params: &PlantsParams, number: usize) -> Plant {
    let mut random = generator(params.seed, 1 + number as u64);
    match params.species {
        Species::Maize => maize::grow(params, &mut random),
        Species::Soybean => soybean::grow(params, &mut random),
        Species::Tree => tree::grow(params, &mut random),
        Species::Grass => grass::grow(params, number, &mut random),
        Species::Spruce => spruce::grow(params, &mut random),
    }
}

fn generator(seed: u64, stream: u64) -> Xoshiro256PlusPlus {
    crate::optics::abm::path_lengths::block_random(seed, stream)
}

impl Canopy {
    /// Generates the plants and places them. Equal parameters give equal canopies on any number of threads.
    ///
    /// # Errors
    /// [`SynthError::BadParameter`] for a parameter out of range, or more triangles or plants than a file should hold.
    ///
    /// Cost: a millisecond per maize plant, some tens per tree, of each variant.
    pub fn new(params: &PlantsParams) -> Result<Canopy, SynthError> {
        params.check()?;
        let first = plant(params, 0);
        // Before anything of that size is made.
        let count = match params.size {
            CanopySize::Plants(plants) => params.variants.min(plants),
            CanopySize::Rows(rows, columns) => params.variants.min(rows * columns),
            CanopySize::Triangles(_) => params.variants,
        };
        let blades = first.blades.len().saturating_mul(params.detail).saturating_mul(count);
        if blades > MAX_UNIQUE_TRIANGLES {
            let allowed =
                format!("fewer, or a smaller --detail: blades may have {MAX_UNIQUE_TRIANGLES} different triangles");
            let value = format!("{count} of {} blades with {} triangles each", first.blades.len(), params.detail);
            return Err(SynthError::BadParameter { name: "--variants", value, allowed });
        }
        let one = Variant::of(first, params.detail);
        let wanted = match params.size {
            CanopySize::Plants(plants) => plants,
            CanopySize::Rows(rows, columns) => rows * columns,
            CanopySize::Triangles(triangles) => triangles.div_ceil(one.triangle_count() as u64) as usize,
        };
        let count = count.min(wanted);
        let others = (1..count).into_par_iter().map(|number| Variant::of(plant(params, number), params.detail));
        let others: Vec<Variant> = others.collect();
        let mut variants: Vec<Variant> = std::iter::once(one).chain(others).collect();
        let choices = choose(params, &variants, wanted)?;
        // Every variant comes once before any comes twice; of triangles, fewer plants than variants may do.
        variants.truncate(choices.len());
        let rows = match params.size {
            CanopySize::Rows(rows, _) => rows,
            // As square as it gets.
            _ => ((choices.len() as f64 * params.spacing_mm / params.row_spacing_mm).sqrt().round() as usize).max(1),
        };
        let columns = choices.len().div_ceil(rows);
        let spacing_m = [params.spacing_mm / 1000.0, params.row_spacing_mm / 1000.0];
        let instances = set_out(params, &choices, columns, spacing_m);
        let field_m = [0, 1].map(|k| [columns, choices.len().div_ceil(columns)][k] as f64 * spacing_m[k]);
        let ground = (params.ground == Ground::Soil).then(|| {
            let half = field_m.map(|side_m| 0.5 * side_m + 0.5);
            Mesh::ground(half.map(|x| -x), half)
        });
        let is_field = instances.len() > 1 || params.species == Species::Grass;
        Ok(Canopy { variants, instances, ground, area_per_plant_m2: spacing_m[0] * spacing_m[1], field_m, is_field })
    }

    /// Returns the number of triangles that are drawn.
    pub fn instanced_triangles(&self) -> u64 {
        let ground = self.ground.as_ref().map_or(0, Mesh::triangle_count) as u64;
        ground + self.instances.iter().map(|one| self.variants[one.variant].triangle_count() as u64).sum::<u64>()
    }

    /// Returns the number of triangles that the file holds.
    pub fn unique_triangles(&self) -> u64 {
        let ground = self.ground.as_ref().map_or(0, Mesh::triangle_count);
        (ground + self.variants.iter().map(Variant::triangle_count).sum::<usize>()) as u64
    }

    /// Returns the number of blades of all plants.
    pub fn leaves(&self) -> u64 {
        self.instances.iter().map(|one| self.variants[one.variant].plant.blades.len() as u64).sum()
    }

    /// Returns the number of flowers of all plants.
    pub fn flowers(&self) -> u64 {
        self.instances.iter().map(|one| self.variants[one.variant].plant.flowers() as u64).sum()
    }

    /// Returns the area of one face of all blades in square metres, over their outlines.
    pub fn leaf_area_m2(&self) -> f64 {
        self.area_m2(|variant| variant.plant.leaf_area_m2())
    }

    /// Returns the area of one face of all blades in square metres, of the triangles that are drawn.
    pub fn drawn_leaf_area_m2(&self) -> f64 {
        let of_leaves = |(_, mesh): &(Part, Mesh)| mesh.area_m2();
        self.area_m2(|variant| variant.meshes.iter().filter(|(part, _)| *part == Part::Leaf).map(of_leaves).sum())
    }

    /// Sums an area of every variant over its plants.
    fn area_m2(&self, of_variant: impl Fn(&Variant) -> f64) -> f64 {
        let areas_m2: Vec<f64> = self.variants.iter().map(of_variant).collect();
        self.instances.iter().map(|one| areas_m2[one.variant] * one.scale.powi(2)).sum()
    }
}

/// Returns the variant of every plant: `wanted` plants, or as many as give the requested number of triangles.
fn choose(params: &PlantsParams, variants: &[Variant], wanted: usize) -> Result<Vec<usize>, SynthError> {
    let mut random = generator(params.seed, 0);
    let mut draw = |number: usize| match params.species {
        // By turns, so that the share of flowers is kept.
        Species::Grass => number % variants.len(),
        _ if number < variants.len() => number,
        _ => random.gen_range(0..variants.len()),
    };
    let CanopySize::Triangles(triangles) = params.size else { return Ok((0..wanted).map(draw).collect()) };
    let (mut choices, mut sum) = (Vec::new(), 0);
    while sum < triangles {
        if choices.len() == MAX_PLANTS {
            let allowed = format!("fewer, or a larger --detail: {MAX_PLANTS} plants are allowed");
            return Err(SynthError::BadParameter { name: "--triangles", value: triangles.to_string(), allowed });
        }
        let variant = draw(choices.len());
        sum += variants[variant].triangle_count() as u64;
        choices.push(variant);
    }
    Ok(choices)
}

/// Returns the places of plants around the origin: rows along x, one behind the other along z.
fn set_out(params: &PlantsParams, choices: &[usize], columns: usize, spacing_m: [f64; 2]) -> Vec<Instance> {
    if let [variant] = choices {
        return vec![Instance { variant: *variant, x_m: 0.0, z_m: 0.0, yaw_rad: 0.0, scale: 1.0 }];
    }
    let rows = choices.len().div_ceil(columns);
    let mut random = generator(params.seed, u64::MAX);
    let middle = |k: usize, count: usize| k as f64 - 0.5 * (count - 1) as f64;
    if params.species == Species::Grass {
        // Patches lie edge to edge, turned by what keeps their edges.
        let turns = if spacing_m[0] == spacing_m[1] { 4 } else { 2 };
        let place = |(i, &variant): (usize, &usize)| {
            let [x_m, z_m] = [middle(i % columns, columns) * spacing_m[0], middle(i / columns, rows) * spacing_m[1]];
            let yaw_rad = TAU * f64::from(random.gen_range(0..turns)) / f64::from(turns);
            Instance { variant, x_m, z_m, yaw_rad, scale: 1.0 }
        };
        return choices.iter().enumerate().map(place).collect();
    }
    let place = |(i, &variant): (usize, &usize)| {
        let mut scatter = || random.gen_range(-SCATTER..SCATTER);
        let x_m = spacing_m[0] * (middle(i % columns, columns) + scatter());
        // Rows are drilled straight; across them plants scatter as they do along.
        let z_m = spacing_m[1] * middle(i / columns, rows) + spacing_m[0].min(spacing_m[1]) * scatter();
        let yaw_rad = random.gen_range(0.0..TAU);
        Instance { variant, x_m, z_m, yaw_rad, scale: 1.0 + random.gen_range(-SIZES..SIZES) }
    };
    choices.iter().enumerate().map(place).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::plants::blade::Blade;
    use crate::plants::params::Habit;
    use crate::plants::vec3::{Vec3, length, sub};
    use crate::vector::{cross, dot};

    fn of(species: Species) -> PlantsParams {
        PlantsParams { branches: 150, leaves: 500, ..PlantsParams::of(species) }
    }

    fn corners(mesh: &Mesh, triangle: &[u32]) -> [Vec3; 3] {
        std::array::from_fn(|k| mesh.positions[triangle[k] as usize].map(f64::from))
    }

    fn all_meshes() -> Vec<(Species, Part, Mesh)> {
        let mut all = Vec::new();
        for species in Species::ALL {
            for (stage, detail) in [(1.0, of(species).detail), (0.35, 4), (0.7, 700), (0.0, 30)] {
                let params = PlantsParams { stage, detail, ..of(species) };
                let parts = Variant::of(plant(&params, 0), detail).meshes;
                all.extend(parts.into_iter().map(|(part, mesh)| (species, part, mesh)));
            }
        }
        assert!(all.len() > 20);
        all
    }

    #[test]
    fn triangles_are_whole_and_normals_unit_and_on_the_side_of_the_winding() {
        for (species, part, mesh) in all_meshes() {
            let name = format!("{species:?} {part:?}");
            let count = mesh.positions.len();
            assert!(mesh.normals.len() == count && mesh.tangents.len() == count && mesh.uvs.len() == count);
            for i in 0..count {
                let (n, t) = (mesh.normals[i].map(f64::from), mesh.tangents[i].map(f64::from));
                let tangent = [t[0], t[1], t[2]];
                assert!((length(n) - 1.0).abs() < 1e-5 && (length(tangent) - 1.0).abs() < 1e-5, "{name}");
                assert!(dot(n, tangent).abs() < 1e-5 && t[3] == 1.0, "{name}");
                assert!(
                    mesh.uvs[i][0] >= 0.0 && mesh.uvs[i][0] <= 1.0 && mesh.uvs[i][1].is_finite(),
                    "{name} {:?} {n:?} {t:?}",
                    mesh.uvs[i]
                );
            }
            let mut against = 0;
            for triangle in mesh.indices.chunks_exact(3) {
                let [a, b, c] = corners(&mesh, triangle);
                let face = cross(sub(b, a), sub(c, a));
                let longest = length(sub(b, a)).max(length(sub(c, a))).max(length(sub(c, b)));
                assert!(length(face) > 1e-5 * longest * longest, "{name}: {a:?} {b:?} {c:?}");
                let normals = triangle.iter().map(|&index| dot(mesh.normals[index as usize].map(f64::from), face));
                against += usize::from(normals.sum::<f64>() <= 0.0);
            }
            // Where a margin's waves are steeper than a coarse row of triangles can follow.
            assert!(against * 200 <= mesh.triangle_count(), "{name}: {against} of {}", mesh.triangle_count());
        }
    }

    #[test]
    fn texture_coordinates_grow_towards_the_tip() {
        for species in Species::ALL {
            let params = of(species);
            let blade = plant(&params, 0).blades[2];
            let mesh = &meshes(&Plant { blades: vec![blade], ..Plant::default() }, params.detail)[0].1;
            let along = |uv: &[f32; 2]| f64::from(1.0 - uv[1]);
            let most = mesh.uvs.iter().map(along).fold(0.0, f64::max);
            let expected = match species {
                Species::Maize => blade.shape.length_m / maize::BLADE_WIDTH_M,
                Species::Grass => blade.shape.length_m / grass::BLADE_WIDTH_M,
                _ => 1.0,
            };
            assert!((most - expected).abs() < 1e-5);
            // The vertex of the greatest coordinate is the farthest along the midrib: its tip.
            let tip = mesh.uvs.iter().position(|uv| along(uv) == most).unwrap();
            let end = blade.point(0.5, 1.0).position_m;
            assert!(length(sub(mesh.positions[tip].map(f64::from), end)) < 1e-6);
        }
    }

    #[test]
    fn a_plant_comes_from_its_seed_and_number_alone() {
        for species in Species::ALL {
            let params = of(species);
            let other_seed = PlantsParams { seed: 2, ..params.clone() };
            assert_eq!(plant(&params, 3), plant(&params, 3));
            assert!(plant(&params, 3) != plant(&params, 4) && plant(&params, 3) != plant(&other_seed, 3));
        }
        let canopy = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let params = PlantsParams { size: CanopySize::Plants(30), variants: 5, ..of(Species::Soybean) };
            pool.install(|| Canopy::new(&params).unwrap())
        };
        assert!(canopy(1) == canopy(3));
    }

    /// Returns the height, number of blades and leaf area.
    fn counts(species: Species, stage: f64) -> (f64, usize, f64) {
        let plant = plant(&PlantsParams { stage, ..of(species) }, 0);
        let parts = meshes(&plant, 40);
        let places = parts.iter().flat_map(|(_, mesh)| &mesh.positions);
        let height_m = places.map(|p| f64::from(p[1])).fold(0.0, f64::max);
        (height_m, plant.blades.len(), plant.leaf_area_m2())
    }

    #[test]
    fn plants_grow_with_the_stage_to_their_usual_size() {
        for (species, height_m, blades, area_m2) in [
            (Species::Maize, 2.0..2.8, 12..17, 0.4..0.8),
            (Species::Soybean, 0.7..1.1, 45..160, 0.12..0.4),
            (Species::Tree, 1.0..1.6, 500..501, 1.0..2.5),
            (Species::Spruce, 0.9..1.3, 500..501, 0.8..1.0),
        ] {
            let grown = counts(species, 1.0);
            assert!(
                height_m.contains(&grown.0) && blades.contains(&grown.1) && area_m2.contains(&grown.2),
                "{grown:?}"
            );
            let (young, seedling) = (counts(species, 0.45), counts(species, 0.1));
            assert!(young.0 < 0.75 * grown.0 && young.2 < 0.75 * grown.2, "{species:?} {young:?} {grown:?}");
            assert!(seedling.1 < young.1 && seedling.2 < 0.3 * young.2, "{species:?} {seedling:?} {young:?}");
        }
        // Maize at 0.4 of its time has shown ten leaves.
        assert!((9..=11).contains(&counts(Species::Maize, 0.4).1));
        // The tassel is there at flowering and not before.
        let has_tassel = |stage| {
            let plant = plant(&PlantsParams { stage, ..of(Species::Maize) }, 0);
            plant.axes.iter().any(|axis| axis.part == Part::Tassel)
        };
        assert!(has_tassel(1.0) && !has_tassel(0.7));
    }

    #[test]
    fn the_leaf_angle_is_what_is_asked_for() {
        /// Returns the direction of the midrib at the base and the normal, from the first triangles of a blade's mesh.
        fn at_base(blade: &Blade) -> (Vec3, Vec3) {
            let mesh = &meshes(&Plant { blades: vec![*blade], ..Plant::default() }, 3000)[0].1;
            let midrib: Vec<usize> = (0..mesh.uvs.len()).filter(|&i| mesh.uvs[i][0] == 0.5).collect();
            let place = |i: usize| mesh.positions[midrib[i]].map(f64::from);
            let ahead = sub(place(1), place(0));
            (ahead.map(|x| x / length(ahead)), mesh.normals[midrib[0]].map(f64::from))
        }
        for species in Species::ALL {
            let mean = |leaf_angle_deg: f64| {
                let params = PlantsParams { leaf_angle_deg, ..of(species) };
                let blades: Vec<Blade> = (0..4).flat_map(|number| plant(&params, number).blades).collect();
                let angles = blades.iter().step_by(blades.len().div_ceil(200)).map(|blade| {
                    let (ahead, normal) = at_base(blade);
                    match species {
                        Species::Maize | Species::Grass => ahead[1].acos().to_degrees(),
                        _ => normal[1].abs().min(1.0).acos().to_degrees(),
                    }
                });
                let angles: Vec<f64> = angles.collect();
                angles.iter().sum::<f64>() / angles.len() as f64
            };
            for asked in [20.0, 50.0] {
                let found = mean(asked);
                assert!((found - asked).abs() < 5.0, "{species:?}: {found} of {asked}");
            }
        }
    }

    #[test]
    fn maize_stands_as_steep_as_its_habit_says() {
        /// Returns the mean inclination of the triangles of blades by area, in degrees.
        fn mean_inclination(habit: Habit) -> f64 {
            let (leaf_angle_deg, bend) = habit.blades();
            let params = PlantsParams { leaf_angle_deg, bend, ..of(Species::Maize) };
            let (mut sum, mut area) = (0.0, 0.0);
            for number in 0..8 {
                let blades = Plant { blades: plant(&params, number).blades, ..Plant::default() };
                for (_, mesh) in meshes(&blades, params.detail) {
                    let place = |i: u32| mesh.positions[i as usize].map(f64::from);
                    for corners in mesh.indices.chunks(3) {
                        let [a, b, c] = [0, 1, 2].map(|i| place(corners[i]));
                        let normal = cross(sub(b, a), sub(c, a));
                        let doubled = length(normal);
                        if doubled > 0.0 {
                            sum += doubled * (normal[1].abs() / doubled).min(1.0).acos().to_degrees();
                            area += doubled;
                        }
                    }
                }
            }
            sum / area
        }
        for (habit, told) in [(Habit::Spreading, 37.0), (Habit::Intermediate, 48.0), (Habit::Upright, 57.0)] {
            let found = mean_inclination(habit);
            assert!((found - told).abs() < 1.0, "{habit:?}: {found}");
        }
    }

    #[test]
    fn a_canopy_has_what_is_asked_for() {
        let rows =
            PlantsParams { size: CanopySize::Rows(3, 7), variants: 4, ground: Ground::Soil, ..of(Species::Maize) };
        let canopy = Canopy::new(&rows).unwrap();
        assert_eq!((canopy.instances.len(), canopy.variants.len()), (21, 4));
        let used: HashSet<usize> = canopy.instances.iter().map(|one| one.variant).collect();
        assert_eq!(used.len(), 4);
        let width = |place: fn(&Instance) -> f64| {
            let places: Vec<f64> = canopy.instances.iter().map(place).collect();
            places.iter().fold(f64::MIN, |a, b| a.max(*b)) - places.iter().fold(f64::MAX, |a, b| a.min(*b))
        };
        assert!((width(|one| one.x_m) - 6.0 * 0.18).abs() < 0.06 && (width(|one| one.z_m) - 2.0 * 0.75).abs() < 0.06);

        let wanted = PlantsParams { size: CanopySize::Triangles(300_000), ..of(Species::Maize) };
        let canopy = Canopy::new(&wanted).unwrap();
        let (drawn, one) = (canopy.instanced_triangles(), canopy.variants[0].triangle_count() as u64);
        assert!((300_000..300_000 + 2 * one).contains(&drawn) && canopy.unique_triangles() < 10 * one);
        // So few triangles that not all variants are needed: no mesh without an instance.
        let few = Canopy::new(&PlantsParams { size: CanopySize::Triangles(7000), ..of(Species::Maize) }).unwrap();
        assert!(few.variants.len() <= few.instances.len());
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let good = of(Species::Tree);
        good.check().unwrap();
        for (params, name) in [
            (PlantsParams { stage: 1.1, ..good.clone() }, "--stage is 1.1"),
            (PlantsParams { leaf_angle_deg: f64::NAN, ..good.clone() }, "--leaf-angle-deg"),
            (PlantsParams { bend: -0.1, ..good.clone() }, "--bend"),
            (PlantsParams { detail: 3, ..good.clone() }, "--detail is 3"),
            (PlantsParams { variants: 0, ..good.clone() }, "--variants is 0"),
            (PlantsParams { spacing_mm: 0.0, ..good.clone() }, "--spacing-mm is 0"),
            (PlantsParams { branches: 0, ..good.clone() }, "--branches is 0"),
            (PlantsParams { size: CanopySize::Rows(10_000, 10_000), ..good.clone() }, "--rows times --columns"),
            (PlantsParams { leaves: 1_000_000, detail: 4000, variants: 1, ..good }, "--variants is"),
        ] {
            let error = Canopy::new(&params).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
    }
}
