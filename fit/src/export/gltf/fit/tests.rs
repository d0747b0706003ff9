//! Tests of `fit.rs`.

use super::*;
use crate::export::pairs::grid_of_pairs;
use btf_runtime::testing::direction_from_degrees;

fn found(texel: &GltfTexel, model: &Model) -> (GltfTexel, f64) {
    let pairs = Pairs::new(&grid_of_pairs());
    let mut scratch = Scratch::default();
    for [wi, wo] in &pairs.list.directions {
        let value = texel.reflected(model.sheen.as_ref(), *wi, *wo);
        (0..3).for_each(|c| scratch.target[c].push(value[c]));
    }
    let estimate = Search { pairs: &pairs, model, scratch: &mut scratch }.run();
    let samples = (3 * pairs.len()) as f64;
    (estimate.texel(model), (estimate.error / samples).sqrt())
}

fn texel() -> GltfTexel {
    let normal = [0.2, -0.15, (1.0f32 - 0.04 - 0.0225).sqrt()];
    GltfTexel { base_colour: [0.5, 0.3, 0.1], roughness: 0.45, normal, ..GltfTexel::PLAIN }
}

#[test]
fn the_search_evaluates_the_model_that_a_viewer_does() {
    let sheen = Some(Sheen::new(0.5));
    let model = Model { metal: false, specular: true, sheen };
    let made = GltfTexel { specular: 0.8, specular_colour: [3.0, 2.0, 1.0], sheen_colour: [0.1, 0.2, 0.3], ..texel() };
    for (model, made) in [
        (model.clone(), made),
        (Model { metal: true, ..model.clone() }, GltfTexel { metallic: 1.0, ..made }),
        (Model { specular: false, sheen: None, ..model.clone() }, texel()),
    ] {
        let pairs = Pairs::new(&grid_of_pairs());
        let mut scratch = Scratch::default();
        let mut weights = [0.0; UNKNOWNS];
        for c in 0..3 {
            weights[BASE + c] = made.base_colour[c];
            weights[F0 + c] = made.specular * DIELECTRIC_F0 * made.specular_colour[c];
            weights[SHEEN + c] = made.sheen_colour[c];
        }
        weights[F90] = made.specular;
        let tilt = [made.normal[0], made.normal[1]];
        let estimate = Estimate { tilt, roughness: made.roughness, weights, error: 0.0 };
        let mut search = Search { pairs: &pairs, model: &model, scratch: &mut scratch };
        search.fill_columns(&estimate);
        search.fill_atoms(&estimate);
        search.fill_values(&estimate);
        let mut differs = 0;
        for (pair, [wi, wo]) in pairs.list.directions.iter().enumerate() {
            let slow = made.reflected(model.sheen.as_ref(), *wi, *wo);
            let planted = GltfTexel { roughness: 0.5, ..made }.reflected(model.sheen.as_ref(), *wi, *wo);
            for c in 0..3 {
                let fast = scratch.values[c][pair];
                assert!((fast - slow[c]).abs() <= 1e-5 + 1e-4 * slow[c], "{fast} {slow:?}");
                differs += usize::from((fast - planted[c]).abs() > 1e-3);
            }
        }
        assert!(differs > 20, "the planted roughness must not agree: {differs}");
    }
}

#[test]
fn a_material_of_the_model_is_found_again() {
    let model = Model { metal: false, specular: true, sheen: None };
    let made = GltfTexel { specular: 1.0, specular_colour: [2.0, 2.0, 2.0], ..texel() };
    let (again, error) = found(&made, &model);
    assert!(error < 0.01, "{error} {again:?}");
    assert!((0..2).all(|i| (again.normal[i] - made.normal[i]).abs() < 0.05), "{again:?}");
    assert!((again.roughness - made.roughness).abs() < 0.08, "{again:?}");
    assert!((0..3).all(|c| (again.base_colour[c] - made.base_colour[c]).abs() < 0.05), "{again:?}");
    // Planted difference: without its gloss it is another material.
    assert!(found(&made, &Model { specular: false, ..model }).1 > 1.5 * error);
}

#[test]
fn parts_are_used_where_they_help_and_left_out_where_they_do_not() {
    let choose = |made: GltfTexel, sheen: Option<Sheen>, maps: Maps| {
        let pairs = Pairs::new(&grid_of_pairs());
        let error_of = |model: &Model| {
            let mut scratch = Scratch::default();
            for [wi, wo] in &pairs.list.directions {
                let value = made.reflected(sheen.as_ref(), *wi, *wo);
                (0..3).for_each(|c| scratch.target[c].push(value[c]));
            }
            // What no model explains.
            Ok(Search { pairs: &pairs, model, scratch: &mut scratch }.run().error + 2.0)
        };
        let (model, _) = choose_model(maps, error_of).unwrap();
        (model.metal, model.specular, model.sheen.is_some())
    };
    assert_eq!(choose(texel(), None, Maps::Auto), (false, false, false));
    assert_eq!(choose(texel(), None, Maps::All), (false, true, true));
    let metal = GltfTexel { metallic: 1.0, base_colour: [0.9, 0.7, 0.3], roughness: 0.75, ..texel() };
    assert_eq!(choose(metal, None, Maps::Auto), (true, false, false));
    let glossy = GltfTexel { specular_colour: [6.0; 3], ..texel() };
    assert_eq!(choose(glossy, None, Maps::Auto), (false, true, false));
    let velvet = GltfTexel { sheen_colour: [0.8, 0.2, 0.2], base_colour: [0.05; 3], ..texel() };
    assert!(choose(velvet, Some(Sheen::new(0.5)), Maps::Auto).2);
}

#[test]
fn what_comes_through_and_what_is_reflected_stay_what_they_were() {
    let list = PairList {
        directions: [10, 40, 70]
            .map(|theta| {
                let [x, y, z] = direction_from_degrees(theta.into(), 30.0);
                [[x, y, -z], [0.0, 0.0, 1.0]]
            })
            .to_vec(),
    };
    let through = [0.1, 0.3, 0.05];
    let values = through.map(|x| list.directions.iter().map(|[wi, _]| x * wi[2].abs()).collect());
    let mut texel = texel();
    let before = texel.base_colour;
    set_transmission(&mut texel, &list, &values);
    for c in 0..3 {
        assert!((texel.transmission * texel.transmission_colour[c] - through[c]).abs() < 1e-5, "{texel:?}");
        assert!(((1.0 - texel.transmission) * texel.base_colour[c] - before[c]).abs() < 1e-5, "{texel:?}");
    }
    assert!((texel.transmission - 0.3).abs() < 1e-5, "{texel:?}");
}
