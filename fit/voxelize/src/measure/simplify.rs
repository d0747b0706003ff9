//! Stochastic simplification: a part of a model's leaves stands for all. The others are dropped at random, and what is
//! left is made larger [Cook 2007].

use crate::model::triangle_model::TriangleModel;
use glam::Vec3;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use std::collections::HashMap;

/// Returns at most `triangles` triangles of `model`. Leaves are dropped as a whole and the others enlarged about their
/// middles, so that the area stays; triangles of closed parts, as stems are, are dropped each by themselves. Both keep
/// the same share.
///
/// Deterministic.
pub fn simplify(model: &TriangleModel, triangles: usize) -> TriangleModel {
    let mut elements = elements_of(model);
    elements.shuffle(&mut rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(1));
    let mut room = triangles;
    let kept: Vec<Vec<usize>> = elements
        .into_iter()
        .filter(|element| {
            let fits = element.len() <= room;
            room -= if fits { element.len() } else { 0 };
            fits
        })
        .collect();
    let area = |element: &[usize]| -> f64 { element.iter().map(|t| f64::from(area(&model.triangles[*t]))).sum() };
    let all: Vec<usize> = (0..model.triangles.len()).collect();
    let left: f64 = kept.iter().map(|element| area(element)).sum();
    let factor = (area(&all) / left.max(1e-30)).sqrt() as f32;
    let mut simplified = TriangleModel { triangles: Vec::new(), materials: Vec::new(), ..model.clone() };
    for element in kept {
        let corners = || element.iter().flat_map(|t| model.triangles[*t]);
        let middle = corners().sum::<Vec3>() / (3 * element.len()) as f32;
        for t in &element {
            simplified.triangles.push(model.triangles[*t].map(|p| middle + (p - middle) * factor));
            simplified.materials.push(model.materials[*t]);
        }
    }
    simplified
}

fn area([a, b, c]: &[Vec3; 3]) -> f32 {
    0.5 * (*b - *a).cross(*c - *a).length()
}

/// Returns the triangles of open parts grouped by shared corners, and all others alone.
fn elements_of(model: &TriangleModel) -> Vec<Vec<usize>> {
    let mut first_at: HashMap<(u32, [u32; 3]), usize> = HashMap::new();
    let mut parents: Vec<usize> = (0..model.triangles.len()).collect();
    fn root(parents: &mut [usize], mut i: usize) -> usize {
        while parents[i] != i {
            parents[i] = parents[parents[i]];
            i = parents[i];
        }
        i
    }
    for (t, corners) in model.triangles.iter().enumerate() {
        let material = model.materials[t];
        if model.weights[material as usize] < 1.0 {
            continue;
        }
        for p in corners {
            let place = (material, p.to_array().map(|x| (x + 0.0).to_bits()));
            let other = *first_at.entry(place).or_insert(t);
            let (a, b) = (root(&mut parents, t), root(&mut parents, other));
            parents[a.max(b)] = a.min(b);
        }
    }
    let mut elements: Vec<Vec<usize>> = vec![Vec::new(); parents.len()];
    (0..parents.len()).for_each(|t| elements[root(&mut parents, t)].push(t));
    elements.retain(|element| !element.is_empty());
    elements
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::microflakes::MicroflakeColour;

    /// Returns the leaves of two triangles, and a closed part's triangles.
    fn model(leaves: usize) -> TriangleModel {
        let mut model = TriangleModel {
            colours: vec![MicroflakeColour::default(); 2],
            weights: vec![1.0, 0.5],
            ..TriangleModel::default()
        };
        for i in 0..leaves {
            let at = Vec3::new(i as f32, 0.0, 0.0);
            let [a, b, c, d] = [Vec3::ZERO, Vec3::X * 0.1, Vec3::Y * 0.1, Vec3::new(0.1, 0.1, 0.0)].map(|p| at + p);
            model.triangles.extend([[a, b, c], [b, d, c]]);
            model.materials.extend([0, 0]);
        }
        model.triangles.push([Vec3::ZERO, Vec3::Z, Vec3::X]);
        model.materials.push(1);
        model
    }

    fn area_of(model: &TriangleModel) -> f32 {
        model.triangles.iter().map(area).sum()
    }

    #[test]
    fn leaves_go_whole_and_the_area_stays() {
        let model = model(50);
        assert_eq!(elements_of(&model).len(), 51);
        let fewer = simplify(&model, 21);
        assert!((20..=21).contains(&fewer.triangles.len()), "{}", fewer.triangles.len());
        assert!((area_of(&fewer) / area_of(&model) - 1.0).abs() < 1e-4);
        assert_eq!(fewer.materials.iter().filter(|material| **material == 0).count() % 2, 0);
        assert_eq!(simplify(&model, 21).triangles, fewer.triangles);
        // All of them fit: the same triangles in another order.
        let all = simplify(&model, 101);
        assert_eq!((all.triangles.len(), all.materials.len()), (101, 101));
        assert!(simplify(&model, 0).triangles.is_empty());
    }
}
