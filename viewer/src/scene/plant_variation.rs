//! How the plants of a scene differ: factors on what the leaves of each placed mesh hold.

use crate::geometry::geometry::Geometry;
use crate::sampler::{hash, two};
use crate::scene::leaf::SceneLeaf;
use crate::scene::material::{Body, Material};
use btf_models::PlantVariation;
use std::f64::consts::TAU;
use std::sync::Arc;

/// Factors on chlorophyll, carotenoids, brown pigment and thickness of plant number `plant`: log-normal with mean 1 and
/// the coefficients of variation that are asked for, drawn from the seed and the number alone. What does not vary has
/// exactly 1.
pub fn plant_factors(variation: &PlantVariation, plant: usize) -> [f32; 4] {
    let PlantVariation { chlorophyll, carotenoid, brown, thickness, seed } = *variation;
    // Normal numbers come in pairs [Box and Muller 1958], so two streams do.
    let of_pair = |pair: u32, variations: [f64; 2]| {
        let stream = hash(hash(seed as u32) ^ hash(!(seed >> 32) as u32) ^ pair);
        let [x, y] = two(plant as u32, stream).map(f64::from);
        let radius = (-2.0 * (1.0 - x).ln()).sqrt();
        let normal = [radius * (TAU * y).cos(), radius * (TAU * y).sin()];
        [0, 1].map(|i| log_normal(variations[i], normal[i]))
    };
    let ([chlorophyll, carotenoid], [brown, thickness]) =
        (of_pair(0, [chlorophyll, carotenoid]), of_pair(1, [brown, thickness]));
    [chlorophyll, carotenoid, brown, thickness]
}

/// Returns the log-normal number of mean 1 and coefficient of variation `variation` that belongs to a standard normal
/// one.
fn log_normal(variation: f64, normal: f64) -> f32 {
    let variance = (variation * variation).ln_1p();
    (variance.sqrt() * normal - 0.5 * variance).exp() as f32
}

/// Gives every instance of a geometry the factors of its plant, by its number among the placements and the variation of
/// the first leaf that its mesh carries. What stands in the world alone is as its leaves are described: nothing varies
/// within a plant. Cost: a pass over the triangles and the instances; a copy of the geometry where somebody else holds
/// it, too.
pub(crate) fn vary_plants(geometry: &mut Arc<Geometry>, materials: &[Material], leaves: &[SceneLeaf]) {
    if leaves.is_empty() || geometry.instances().len() < 2 {
        return;
    }
    let variation_of_mesh: Vec<PlantVariation> = geometry
        .mesh_triangles()
        .map(|triangles| {
            let leaf = triangles.iter().find_map(|triangle| match materials[triangle.material as usize].body {
                Body::Leaf(leaf) => leaves.get(leaf),
                _ => None,
            });
            leaf.map_or_else(PlantVariation::default, |leaf| leaf.description.variation)
        })
        .collect();
    Arc::make_mut(geometry).set_factors(|mesh, placement| plant_factors(&variation_of_mesh[mesh], placement));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::material::Shown;
    use crate::scene::mesh;
    use crate::scene::scene::{Scene, SceneMesh, SceneObject};
    use btf_models::{DiffuseColour, LeafDescription};
    use btf_runtime::{LeafTexel, LeafTexture};
    use glam::{Mat4, Vec3};
    use std::path::Path;

    const VARIED: PlantVariation =
        PlantVariation { chlorophyll: 0.12, carotenoid: 0.3, brown: 1.0, thickness: 0.06, seed: 7 };

    /// Mean and coefficient of variation of each factor over so many plants.
    fn spread(variation: &PlantVariation, plants: usize) -> [[f64; 2]; 4] {
        std::array::from_fn(|quantity| {
            let factors: Vec<f64> =
                (0..plants).map(|plant| f64::from(plant_factors(variation, plant)[quantity])).collect();
            let mean = factors.iter().sum::<f64>() / plants as f64;
            let variance = factors.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / plants as f64;
            [mean, variance.sqrt() / mean]
        })
    }

    #[test]
    fn factors_have_mean_1_and_the_variation_that_is_asked_for() {
        let found = spread(&VARIED, 1 << 14);
        for ([mean, variation], asked) in found.into_iter().zip([0.12, 0.3, 1.0, 0.06]) {
            assert!((mean - 1.0).abs() < 0.01, "{found:?}");
            assert!((variation / asked - 1.0).abs() < 0.03, "{found:?}");
        }
        // Planted: a tenth more variation is told apart.
        let more = spread(&PlantVariation { chlorophyll: 0.132, ..VARIED }, 1 << 14);
        assert!((more[0][1] / 0.12 - 1.0).abs() > 0.03);
    }

    #[test]
    fn quantities_vary_independently() {
        let plants = 1 << 12;
        for (a, b) in [(0, 1), (0, 2), (1, 3), (2, 3)] {
            let product: f64 = (0..plants)
                .map(|plant| {
                    let logs = plant_factors(&PlantVariation { brown: 0.3, thickness: 0.3, ..VARIED }, plant);
                    f64::from(logs[a] - 1.0) * f64::from(logs[b] - 1.0)
                })
                .sum();
            assert!((product / plants as f64).abs() < 0.005, "{a} {b}: {}", product / plants as f64);
        }
    }

    #[test]
    fn factors_come_from_seed_and_number_alone_and_nothing_varies_unasked() {
        for plant in [0, 1, 77, 1 << 20] {
            assert_eq!(plant_factors(&VARIED, plant), plant_factors(&VARIED, plant));
            assert_eq!(plant_factors(&PlantVariation::default(), plant), [1.0; 4]);
            // Each quantity stays by itself.
            let one = plant_factors(&PlantVariation { brown: 0.5, ..PlantVariation::default() }, plant);
            assert!(one[2] != 1.0 && [0, 1, 3].iter().all(|i| one[*i] == 1.0), "{one:?}");
        }
        assert_ne!(plant_factors(&VARIED, 1), plant_factors(&VARIED, 2));
        for seed in [8, 7 + (1 << 32)] {
            assert_ne!(plant_factors(&PlantVariation { seed, ..VARIED }, 1), plant_factors(&VARIED, 1));
        }
    }

    #[test]
    fn each_placed_plant_has_its_own_factors_and_one_alone_has_none() {
        let description = LeafDescription { variation: VARIED, ..LeafDescription::default() };
        let leaf = SceneLeaf::new("leaf", description, &LeafTexture::uniform(LeafTexel::default())).unwrap();
        let shown = || Shown { assets: Vec::new(), leaves: vec![leaf.clone()] };
        let standing = |body, places: &[f32]| SceneMesh {
            objects: vec![SceneObject { part: mesh::plane(), material: Material::new(body, [1.0; 2]) }],
            places: places.iter().map(|x| Mat4::from_translation(Vec3::X * *x)).collect(),
        };
        let meshes =
            vec![standing(Body::Plain(DiffuseColour::opaque([0.5; 3])), &[9.0]), standing(Body::Leaf(0), &[0.0, 3.0])];
        let scene = Scene::from_meshes(Path::new("plants"), meshes, shown()).unwrap();
        let mut factors: Vec<[f32; 4]> = scene.geometry.instances().iter().map(|instance| instance.factors).collect();
        // Along x: the two plants, then what carries no leaf.
        assert_eq!(factors.pop(), Some([1.0; 4]));
        assert_eq!(factors, [1, 2].map(|placement| plant_factors(&VARIED, placement)));
        let alone = Scene::from_meshes(Path::new("plant"), vec![standing(Body::Leaf(0), &[0.0])], shown()).unwrap();
        assert_eq!(alone.geometry.instances()[0].factors, [1.0; 4]);
    }
}
