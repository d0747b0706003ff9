//! Texel functions of fitted assets, as the priors use them: the principal functions of each cluster, turned about the
//! normal, mirrored, and with light and eye exchanged, at the direction pairs of any capture.

use crate::error::FitError;
use crate::input::residual_curve::Curve;
use crate::inspect::load::resident_in_parallel;
use crate::measure::image_decoder::{ImageDecoder, Spot};
use crate::numeric::principal_directions::{Rows, principal_directions, sorted_eigen};
use btf_runtime::{Asset, DecodeOptions, Sphere};
use ndarray::{Array2, ArrayView2, Axis, s};
use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Texels of a cluster that its functions are found from, at most.
const CLUSTER_TEXELS: usize = 64;
/// Principal functions of a cluster.
const CLUSTER_FUNCTIONS: usize = 32;
/// Turns about the normal. A material may lie in any direction.
const TURNS: usize = 12;
/// Functions that stand for all turned ones of a cluster, at most.
const SPREAD_FUNCTIONS: usize = 160;
/// Functions of all clusters of all priors together, at most: 134 MB for Bonn's pairs.
pub const MAX_FUNCTIONS: usize = 5120;
/// Samples of all clusters of a prior, at most: 160 MB, for a moment twice.
const MAX_SAMPLES: usize = 40_000_000;
/// Least cosine by which an exchanged function is scaled.
const MIN_COSINE: f32 = 0.1;

/// The principal functions of the clusters of an asset's layer.
#[derive(Debug, Clone)]
pub struct PriorFunctions {
    views: Sphere,
    lights: Sphere,
    /// Power of the curve, by which the light's cosine is in a function.
    power: f32,
    /// Functions of each cluster, `[function, view x light]`, in the residual's curve; the mean over pairs of their squares'
    /// sum is 1.
    clusters: Vec<Array2<f32>>,
}

impl PriorFunctions {
    /// Finds the functions of layer `number` of `asset` in the curve of a fit: those of its colours, also where it has bands.
    ///
    /// # Errors
    /// Directions of which no triangles can be made.
    ///
    /// Cost: the decoding of the whole layer, and for each cluster one eigendecomposition of 192 x 192.
    pub fn of_layer(asset: &Asset, number: usize, curve: &Curve) -> Result<PriorFunctions, FitError> {
        let layer = &asset.layers[number];
        let once = |sphere: &Sphere| {
            Sphere::new(&(0..sphere.distinct() as u32).map(|id| sphere.direction(id)).collect::<Vec<_>>())
        };
        let (views, lights) = (layer.views.clone(), once(&layer.lights)?);
        let most = (MAX_SAMPLES / 3 / (views.len() * lights.len() * layer.dictionary.len()).max(1)).max(4);
        let clusters: Vec<Vec<usize>> = (0..layer.dictionary.len())
            .map(|cluster| {
                let members: Vec<usize> = (0..layer.texel_clusters.len())
                    .filter(|texel| usize::from(layer.texel_clusters[*texel]) == cluster)
                    .collect();
                let count = members.len().min(CLUSTER_TEXELS.min(most));
                (0..count).map(|i| members[i * members.len() / count]).collect()
            })
            .filter(|members: &Vec<usize>| !members.is_empty())
            .collect();
        let resident = resident_in_parallel(asset);
        let decoder = ImageDecoder::new(asset, &resident, number, &DecodeOptions::default());
        let pairs = views.len() * lights.len();
        let chosen: Vec<usize> = clusters.concat();
        let nothing = curve.encode(0.0);
        // [pair][texel, channel]
        let columns: Vec<Vec<f32>> = (0..pairs)
            .into_par_iter()
            .map(|pair| {
                let plan = decoder.plan(Spot::Measured(pair / lights.len()), Spot::Measured(pair % lights.len()));
                let mut image = vec![0.0; 3 * layer.texel_clusters.len()];
                decoder.decode_image(&plan, &mut image);
                let sample = |texel: &usize| image[3 * texel..3 * texel + 3].to_vec();
                chosen.iter().flat_map(sample).map(|x| curve.encode(x) - nothing).collect()
            })
            .collect();
        let rows = Array2::from_shape_fn((3 * chosen.len(), pairs), |(row, pair)| columns[pair][row]);
        drop(columns);
        let mut first = 0;
        let clusters = clusters.iter().map(|members| {
            let own = rows.slice(s![first..first + 3 * members.len(), ..]);
            first += 3 * members.len();
            principal_functions(own)
        });
        Ok(PriorFunctions {
            clusters: clusters.filter(|functions| functions.nrows() > 0).collect(),
            power: curve.power(),
            views,
            lights,
        })
    }

    /// Returns for each cluster functions at the pairs of `views` and `lights` that stand for its own, turned, mirrored and
    /// exchanged: `[function, view x light]`. The sum of their products between two pairs is the pairs' covariance.
    ///
    /// `all_clusters` are those of all priors together. Cost: four products of `24 x 32` rows and 160 columns over all
    /// pairs for each cluster.
    pub fn spread(&self, views: &Sphere, lights: &Sphere, all_clusters: usize) -> Vec<Array2<f32>> {
        let variants = Variants::new(self, views, lights);
        let most = SPREAD_FUNCTIONS.min(MAX_FUNCTIONS / all_clusters.max(1)).max(1);
        self.clusters.par_iter().map(|functions| condensed(&variants.of(functions), most)).collect()
    }

    /// Returns the number of clusters.
    pub fn clusters(&self) -> usize {
        self.clusters.len()
    }
}

/// Where each function of a prior is read for turned, mirrored and exchanged directions.
struct Variants {
    shape: [usize; 2],
    /// By view and by light of the prior, and whether light and eye are exchanged.
    variants: Vec<(Interpolation, Interpolation, bool)>,
    /// What the cosines of view and of light make of an exchanged function: a sample is a reflectance times the light's cosine.
    by_view: Vec<f32>,
    by_light: Vec<f32>,
}

impl Variants {
    fn new(prior: &PriorFunctions, views: &Sphere, lights: &Sphere) -> Variants {
        let variants = (0..2 * TURNS).map(|number| {
            let (turn, exchanged) = (number / 2, number % 2 == 1);
            // Every other turn is mirrored: mirrored ones at all turns would say little more.
            let turned = |wanted: &Sphere, own: &Sphere| Interpolation::new(wanted, own, turn, turn % 2 == 1);
            let (by_view, by_light) = if exchanged { (lights, views) } else { (views, lights) };
            (turned(by_view, &prior.views), turned(by_light, &prior.lights), exchanged)
        });
        let cosines = |sphere: &Sphere, power: f32| -> Vec<f32> {
            (0..sphere.len() as u32).map(|id| sphere.direction(id)[2].max(MIN_COSINE).powf(power)).collect()
        };
        Variants {
            shape: [prior.views.len(), prior.lights.len()],
            variants: variants.collect(),
            by_view: cosines(views, -prior.power),
            by_light: cosines(lights, prior.power),
        }
    }

    /// Returns all variants of `functions`, scaled to keep their energy together.
    fn of(&self, functions: &Array2<f32>) -> Array2<f32> {
        let scale = 1.0 / (self.variants.len() as f32).sqrt();
        let numbers: Vec<(usize, usize)> = (0..functions.nrows())
            .flat_map(|row| (0..self.variants.len()).map(move |variant| (row, variant)))
            .collect();
        let rows: Vec<Vec<f32>> = numbers
            .into_par_iter()
            .map(|(row, variant)| {
                let (by_view, by_light, exchanged) = &self.variants[variant];
                let row = functions.row(row);
                // The shape is the functions' own.
                let own = row.to_shape(self.shape).map(|own| own.into_owned()).unwrap_or_default();
                let found = by_view.apply(by_light.apply(own.t()).t());
                let lights = self.by_light.len();
                match exchanged {
                    false => found.iter().map(|x| scale * x).collect(),
                    true => {
                        let pairs = found.t();
                        let cosines = |pair: usize| self.by_view[pair / lights] * self.by_light[pair % lights];
                        pairs.iter().enumerate().map(|(pair, x)| scale * cosines(pair) * x).collect()
                    }
                }
            })
            .collect();
        let pairs = rows.first().map_or(0, Vec::len);
        Array2::from_shape_vec((rows.len(), pairs), rows.concat()).unwrap_or_else(|_| Array2::zeros((0, pairs)))
    }
}

/// Returns at most `count` functions `[function, pair]` whose products sum to nearly the same as those of `rows`.
pub fn condensed(rows: &Array2<f32>, count: usize) -> Array2<f32> {
    if rows.nrows() <= count {
        return rows.clone();
    }
    let make = |range: std::ops::Range<usize>| Ok::<_, std::convert::Infallible>(rows.slice(s![range, ..]).to_owned());
    let all = Rows { count: rows.nrows(), samples: rows.ncols(), make: &make, gpu: None };
    let Ok(basis) = principal_directions(&all, count, &mut Xoshiro256PlusPlus::seed_from_u64(1));
    // The moments along the basis, as a square: their root turns it into functions.
    let scores = rows.dot(&basis);
    let (values, vectors) = sorted_eigen(&scores.t().dot(&scores).mapv(f64::from));
    let root = Array2::from_shape_fn(vectors.dim(), |(i, j)| (vectors[[i, j]] * values[j].max(0.0).sqrt()) as f32);
    basis.dot(&root).reversed_axes().as_standard_layout().into_owned()
}

/// Returns the principal functions of `rows`, `[sample, pair]`, largest first, scaled so that the mean over pairs of their
/// squares' sum is that of rows of mean square 1.
fn principal_functions(rows: ArrayView2<f32>) -> Array2<f32> {
    let (count, pairs) = rows.dim();
    let gram = rows.dot(&rows.t());
    let energy: f64 = gram.diag().iter().map(|x| f64::from(*x)).sum();
    if energy <= 0.0 {
        return Array2::zeros((0, pairs));
    }
    let (_, vectors) = sorted_eigen(&gram.mapv(f64::from));
    let turn = Array2::from_shape_fn((count.min(CLUSTER_FUNCTIONS), count), |(i, j)| vectors[[j, i]] as f32);
    turn.dot(&rows) * ((pairs as f64 / energy).sqrt() as f32)
}

/// Interpolation from the directions of one set to turned directions of another.
struct Interpolation {
    /// Numbers and weights of the three neighbours of each direction.
    neighbours: Vec<[(usize, f32); 3]>,
}

impl Interpolation {
    /// Finds the neighbours in `own` of the directions of `wanted`, turned by `turn` of [`TURNS`] and mirrored.
    fn new(wanted: &Sphere, own: &Sphere, turn: usize, mirrored: bool) -> Interpolation {
        let (sine, cosine) = (TAU * turn as f32 / TURNS as f32).sin_cos();
        let neighbours = (0..wanted.len() as u32).map(|id| {
            let [x, y, z] = wanted.direction(id);
            let y = if mirrored { -y } else { y };
            let place = own.locate([cosine * x - sine * y, sine * x + cosine * y, z]);
            [0, 1, 2].map(|i| (place.ids[i] as usize, place.weights[i]))
        });
        Interpolation { neighbours: neighbours.collect() }
    }

    /// Interpolates along the first axis of `values`.
    fn apply(&self, values: ArrayView2<f32>) -> Array2<f32> {
        let mut out = Array2::zeros((self.neighbours.len(), values.ncols()));
        for (mut row, neighbours) in out.axis_iter_mut(Axis(0)).zip(&self.neighbours) {
            for (id, weight) in neighbours {
                row.scaled_add(*weight, &values.row(*id));
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::sample_asset_with;
    use btf_capture::DirectionSet;
    use btf_runtime::ResidualKind;

    #[test]
    fn functions_keep_the_energy_of_what_they_stand_for_and_are_those_of_the_texels() {
        let set = DirectionSet::bonn81();
        let asset = sample_asset_with(5, 4, &set, &set, ResidualKind::Root);
        let functions = PriorFunctions::of_layer(&asset, 0, &Curve::new(ResidualKind::Root, 0.003)).unwrap();
        for own in &functions.clusters {
            let energy: f64 = own.iter().map(|x| f64::from(x * x)).sum::<f64>() / own.ncols() as f64;
            assert!((0.9..=1.0001).contains(&energy), "{energy}");
        }
        let variants = Variants::new(&functions, &functions.views, &functions.lights);
        let spread = functions.spread(&functions.views, &functions.lights, functions.clusters());
        assert_eq!(spread.len(), functions.clusters.len());
        for (own, condensed) in functions.clusters.iter().zip(&spread) {
            let all = variants.of(own);
            assert_eq!(all.nrows(), own.nrows() * 2 * TURNS);
            // The first variant is the function itself, the second has light and eye exchanged.
            let scale = (2.0 * TURNS as f32).sqrt();
            for (pair, x) in all.row(0).iter().enumerate() {
                let exchanged = pair % 81 * 81 + pair / 81;
                assert!((x * scale - own[[0, pair]]).abs() < 1e-4 * (1.0 + x.abs()), "{pair}");
                let cosine = |id: usize| functions.views.direction(id as u32)[2].max(MIN_COSINE).powf(1.0 / 2.4);
                let wanted = x * cosine(pair / 81) / cosine(pair % 81);
                assert!((all[[1, exchanged]] - wanted).abs() < 1e-4 * (1.0 + wanted.abs()), "{pair}");
            }
            let energy = |rows: &Array2<f32>| rows.iter().map(|x| f64::from(x * x)).sum::<f64>();
            assert!(condensed.nrows() <= SPREAD_FUNCTIONS);
            assert!((0.97..1.0001).contains(&(energy(condensed) / energy(&all))));
            let between = |rows: &Array2<f32>| rows.column(40).dot(&rows.column(700));
            assert!((between(condensed) - between(&all)).abs() < 0.02, "{} {}", between(condensed), between(&all));
        }
    }

    #[test]
    fn any_directions_get_their_values() {
        let set = DirectionSet::bonn81();
        let asset = sample_asset_with(5, 4, &set, &set, ResidualKind::Root);
        let functions = PriorFunctions::of_layer(&asset, 0, &Curve::new(ResidualKind::Root, 0.003)).unwrap();
        let sphere = |count, seed| Sphere::new(&DirectionSet::random(count, seed).unwrap().units()).unwrap();
        let spread = functions.spread(&sphere(1, 5), &sphere(9, 6), functions.clusters());
        assert!(spread.iter().all(|rows| rows.ncols() == 9 && rows.iter().all(|x| x.is_finite())));
    }
}
