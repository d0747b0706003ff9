//! Fit of a cluster's dictionary of rotated lobes: stagewise Lasso over the candidates for every representative texel,
//! a non-linear search about the strongest atoms (Nelder-Mead on normalised correlation), then damped Gauss-Newton
//! steps on all parameters and normals together.

use crate::stages::candidates::Freedom;
use crate::stages::lasso::{LassoParams, LassoProblem, non_negative_weights, stagewise_lasso};
use argmin::core::{CostFunction, Executor};
use argmin::solver::neldermead::NelderMead;
use btf_runtime::Lobe;
use nalgebra::{DMatrix, DVector};
use ndarray::{Array2, ArrayView1, s};
use std::ops::ControlFlow;

/// Stagewise step, and end of the path, relative to the strongest correlation.
const STEP: f64 = 0.02;
const MIN_PENALTY: f64 = 0.03;
/// Atoms at which the path of a representative ends.
const MAX_ACTIVE: usize = 12;
/// Atoms that the search of a single lobe refines.
const SEARCHED_ATOMS: usize = 8;
/// Iterations of the search of a single lobe.
const SEARCH_ITERATIONS: u64 = 25;
/// Value of a lobe below which it counts as 0: products of numbers near the end of single precision's range take many
/// times as long, and a narrow lobe is that small almost everywhere.
pub const NEGLIGIBLE: f32 = 1e-20;
/// Gauss-Newton steps.
const GAUSS_NEWTON_STEPS: usize = 6;

/// The direction pairs that a dictionary is fitted on.
pub struct Pairs {
    /// Direction to the light, per pair.
    pub wi: Vec<[f32; 3]>,
    /// Direction to the eye, per pair.
    pub wo: Vec<[f32; 3]>,
}

impl Pairs {
    /// Returns a lobe's value at each pair; negligible values are 0.
    pub fn table(&self, lobe: &Lobe) -> Vec<f32> {
        let setup = lobe.setup();
        let value = |(wi, wo): (&[f32; 3], &[f32; 3])| setup.eval(*wi, *wo);
        self.wi.iter().zip(&self.wo).map(value).map(|x| if x < NEGLIGIBLE { 0.0 } else { x }).collect()
    }
}

/// Functions that a cluster's dictionary must reproduce.
pub struct Target {
    /// Root of each pair's weight (tone weight; 0 for held-back pairs).
    pub root_weights: Vec<f32>,
    /// Representatives' functions, `[pair, 3 * representative + channel]`, linear.
    pub functions: Array2<f32>,
}

/// A dictionary and what it achieves on the representatives.
pub struct Dictionary {
    /// Lobes as the file form rounds them.
    pub lobes: Vec<Lobe>,
    /// Weighted energy of the representatives.
    pub energy: f64,
    /// Weighted squared error with the lobes that the Lasso chose.
    pub error_selected: f64,
    /// Weighted squared error after refinement.
    pub error_refined: f64,
}

/// Builds a dictionary of `size` lobes.
///
/// `tables` are the candidates' values `[pair, candidate]`. Cost for Bonn's pairs, 860 candidates and 32
/// lobes: about a second.
pub fn build_dictionary(
    target: &Target,
    pairs: &Pairs,
    candidates: &[Lobe],
    tables: &Array2<f32>,
    size: usize,
) -> Dictionary {
    let mut functions = target.functions.clone();
    for (mut row, weight) in functions.rows_mut().into_iter().zip(&target.root_weights) {
        row *= *weight;
    }
    let chosen = select(target, &functions, candidates, tables, size);
    let mut state =
        Refinement::new(chosen.iter().map(|&i| candidates[i]).collect(), pairs, &target.root_weights, &functions);
    let energy = functions.iter().map(|x| f64::from(*x).powi(2)).sum();
    let error_selected = state.error;
    state.search_strongest();
    state.gauss_newton();
    Dictionary {
        lobes: state.lobes.iter().map(Lobe::rounded).collect(),
        energy,
        error_selected,
        error_refined: state.error,
    }
}

/// Returns the candidates with the greatest share in the representatives' Lasso paths.
fn select(
    target: &Target,
    functions: &Array2<f32>,
    candidates: &[Lobe],
    tables: &Array2<f32>,
    size: usize,
) -> Vec<usize> {
    let n = candidates.len();
    let mut weighted = tables.clone();
    for (mut row, weight) in weighted.rows_mut().into_iter().zip(&target.root_weights) {
        row *= *weight;
    }
    let raw = weighted.t().dot(&weighted);
    let norms: Vec<f64> = (0..n).map(|i| f64::from(raw[[i, i]]).max(0.0).sqrt()).collect();
    let strongest = norms.iter().fold(0.0f64, |top, x| top.max(*x));
    // A lobe that is 0 at almost every pair (under the horizon of all of them) is no candidate.
    let inverse: Vec<f64> = norms.iter().map(|norm| if *norm > 1e-4 * strongest { 1.0 / norm } else { 0.0 }).collect();
    let mut gram = vec![0.0f64; n * n];
    for i in 0..n {
        for j in 0..n {
            gram[i * n + j] = f64::from(raw[[i, j]]) * inverse[i] * inverse[j];
        }
    }
    let products = weighted.t().dot(functions);
    let representatives = functions.ncols() / 3;
    let mut importance = vec![0.0f64; n];
    let mut correlation_sum = vec![0.0f64; n];
    for r in 0..representatives {
        let grey: Vec<f64> = (0..n)
            .map(|i| (0..3).map(|c| f64::from(products[[i, 3 * r + c]])).sum::<f64>() / 3.0 * inverse[i])
            .collect();
        let top = grey.iter().fold(0.0f64, |top, x| top.max(*x));
        correlation_sum.iter_mut().zip(&grey).for_each(|(sum, x)| *sum += x.max(0.0));
        if top <= 0.0 {
            continue;
        }
        let problem = LassoProblem { gram: &gram, correlation: &grey, non_negative: true };
        let params = LassoParams { epsilon: STEP * top, least_penalty: MIN_PENALTY * top, most_steps: 600 };
        let beta = stagewise_lasso(&problem, &params, |point| {
            if point.active > MAX_ACTIVE { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        importance.iter_mut().zip(&beta).for_each(|(sum, x)| *sum += x);
    }
    let mut order: Vec<usize> = (0..n).filter(|&i| inverse[i] > 0.0).collect();
    order.sort_by(|&a, &b| {
        let key = |i: usize| (importance[i], correlation_sum[i]);
        key(b).0.total_cmp(&key(a).0).then(key(b).1.total_cmp(&key(a).1)).then(a.cmp(&b))
    });
    // Lambertian about the macroscopic normal is always there: the one lobe that every texel can use.
    let mut chosen = vec![0];
    for candidate in order {
        if chosen.len() >= size {
            break;
        }
        // Beyond the Lasso's own choice, leave out near twins.
        let twin = importance[candidate] <= 0.0 && chosen.iter().any(|&other| gram[candidate * n + other] > 0.995);
        if !chosen.contains(&candidate) && !twin {
            chosen.push(candidate);
        }
    }
    chosen
}

/// State of the refinement: lobes, their weighted tables, the representatives' weights, and the residual.
struct Refinement<'a> {
    lobes: Vec<Lobe>,
    pairs: &'a Pairs,
    root_weights: &'a [f32],
    functions: &'a Array2<f32>,
    /// Weighted tables, `[pair, lobe]`.
    tables: Array2<f32>,
    /// Weights, `[lobe, column]`; a column is a representative and a channel.
    weights: Array2<f32>,
    /// Residual, `[pair, column]`.
    residual: Array2<f32>,
    error: f64,
}

impl<'a> Refinement<'a> {
    fn new(lobes: Vec<Lobe>, pairs: &'a Pairs, root_weights: &'a [f32], functions: &'a Array2<f32>) -> Refinement<'a> {
        let mut state = Refinement {
            tables: Array2::zeros((root_weights.len(), lobes.len())),
            weights: Array2::zeros((lobes.len(), functions.ncols())),
            residual: functions.clone(),
            lobes,
            pairs,
            root_weights,
            functions,
            error: 0.0,
        };
        for i in 0..state.lobes.len() {
            let lobe = state.lobes[i];
            state.set_table(i, &lobe);
        }
        state.solve();
        state
    }

    fn weighted_table(&self, lobe: &Lobe) -> Vec<f32> {
        self.pairs.table(lobe).iter().zip(self.root_weights).map(|(x, w)| x * w).collect()
    }

    fn set_table(&mut self, index: usize, lobe: &Lobe) {
        let table = self.weighted_table(lobe);
        self.tables.column_mut(index).assign(&ArrayView1::from(&table));
        self.lobes[index] = *lobe;
    }

    /// Solves for the non-negative weights of all representatives, and computes the residual.
    fn solve(&mut self) {
        let n = self.lobes.len();
        let gram: Vec<f64> = self.tables.t().dot(&self.tables).iter().map(|x| f64::from(*x)).collect();
        let products = self.tables.t().dot(self.functions);
        let all: Vec<usize> = (0..n).collect();
        for column in 0..self.functions.ncols() {
            let correlation: Vec<f64> = products.column(column).iter().map(|x| f64::from(*x)).collect();
            let weights = non_negative_weights(&gram, n, &correlation, &all);
            self.weights.column_mut(column).iter_mut().zip(weights).for_each(|(w, x)| *w = x as f32);
        }
        self.residual = self.functions - &self.tables.dot(&self.weights);
        self.error = self.residual.iter().map(|x| f64::from(*x).powi(2)).sum();
    }

    /// Moves each of the strongest lobes, the others fixed, to the parameters and normal of largest normalised
    /// correlation with what the others leave.
    fn search_strongest(&mut self) {
        let mut order: Vec<usize> = (0..self.lobes.len()).collect();
        let strength: Vec<f64> = (0..self.lobes.len())
            .map(|i| {
                let table: f64 = self.tables.column(i).iter().map(|x| f64::from(*x).powi(2)).sum();
                table * self.weights.row(i).iter().map(|x| f64::from(*x).powi(2)).sum::<f64>()
            })
            .collect();
        order.sort_by(|&a, &b| strength[b].total_cmp(&strength[a]).then(a.cmp(&b)));
        for index in order.into_iter().take(SEARCHED_ATOMS) {
            if strength[index] <= 0.0 {
                continue;
            }
            let lobe = self.lobes[index];
            let freedom = Freedom::of(lobe.family);
            let own = self.tables.column(index).to_owned().insert_axis(ndarray::Axis(1));
            let alone = &self.residual + &own.dot(&self.weights.slice(s![index..index + 1, ..]));
            let start = freedom.vector(&lobe);
            let search = LobeSearch { like: lobe, freedom: &freedom, state: self, alone: &alone };
            let before = search.correlation(&start);
            let mut simplex = vec![start.clone()];
            simplex.extend((0..start.len()).map(|i| {
                let mut corner = start.clone();
                corner[i] += if i < 2 { 0.08 } else { 0.25 };
                corner
            }));
            let Ok(solver) = NelderMead::new(simplex).with_sd_tolerance(1e-6) else { continue };
            let run = Executor::new(search, solver).configure(|state| state.max_iters(SEARCH_ITERATIONS)).run();
            let Ok(found) = run else { continue };
            let state = found.state();
            let (Some(best), cost) = (state.best_param.clone(), state.best_cost) else { continue };
            if -cost > before {
                let lobe = freedom.lobe(&lobe, &best);
                self.set_table(index, &lobe);
                // The weights of this lobe alone follow in closed form; the full solve comes after all.
                let table = self.tables.column(index);
                let norm = table.dot(&table).max(1e-20);
                let weights: Vec<f32> =
                    (0..alone.ncols()).map(|c| (table.dot(&alone.column(c)) / norm).max(0.0)).collect();
                self.weights.row_mut(index).assign(&ArrayView1::from(&weights));
                let own = self.tables.column(index).to_owned().insert_axis(ndarray::Axis(1));
                self.residual = alone - own.dot(&self.weights.slice(s![index..index + 1, ..]));
            }
        }
        self.solve();
    }

    /// Runs damped Gauss-Newton steps on all free numbers of all lobes. The normal matrix is `(J'J) o (W W')`: its cost
    /// does not depend on the number of representatives.
    fn gauss_newton(&mut self) {
        let mut damping = 1e-2;
        for _ in 0..GAUSS_NEWTON_STEPS {
            let freedoms: Vec<Freedom> = self.lobes.iter().map(|lobe| Freedom::of(lobe.family)).collect();
            let vectors: Vec<Vec<f64>> =
                self.lobes.iter().zip(&freedoms).map(|(lobe, freedom)| freedom.vector(lobe)).collect();
            let owners: Vec<(usize, usize)> = vectors
                .iter()
                .enumerate()
                .flat_map(|(lobe, vector)| (0..vector.len()).map(move |slot| (lobe, slot)))
                .collect();
            let mut jacobian = Array2::<f32>::zeros((self.root_weights.len(), owners.len()));
            const H: f64 = 2e-3;
            for (column, &(lobe, slot)) in owners.iter().enumerate() {
                let at = |offset: f64| {
                    let mut vector = vectors[lobe].clone();
                    vector[slot] += offset;
                    self.weighted_table(&freedoms[lobe].lobe(&self.lobes[lobe], &vector))
                };
                let (up, down) = (at(H), at(-H));
                let slope = 1.0 / (2.0 * H) as f32;
                jacobian
                    .column_mut(column)
                    .iter_mut()
                    .zip(up.iter().zip(&down))
                    .for_each(|(j, (u, d))| *j = (u - d) * slope);
            }
            let products = jacobian.t().dot(&jacobian);
            let overlap = self.weights.dot(&self.weights.t());
            let pulled = jacobian.t().dot(&self.residual);
            let n = owners.len();
            let gradient = DVector::from_fn(n, |i, _| {
                let weights = self.weights.row(owners[i].0);
                f64::from(pulled.row(i).dot(&weights))
            });
            let normal = DMatrix::from_fn(n, n, |i, j| {
                f64::from(products[[i, j]]) * f64::from(overlap[[owners[i].0, owners[j].0]])
            });
            let mean_diagonal = normal.diagonal().sum() / n.max(1) as f64;
            let mut accepted = false;
            for _ in 0..3 {
                let mut damped = normal.clone();
                for i in 0..n {
                    damped[(i, i)] += damping * (normal[(i, i)] + 1e-3 * mean_diagonal) + 1e-12;
                }
                let Some(cholesky) = damped.cholesky() else {
                    damping *= 10.0;
                    continue;
                };
                let step = cholesky.solve(&gradient);
                let kept =
                    (self.lobes.clone(), self.tables.clone(), self.weights.clone(), self.residual.clone(), self.error);
                let mut at = 0;
                for i in 0..vectors.len() {
                    let moved: Vec<f64> =
                        vectors[i].iter().enumerate().map(|(slot, x)| x + step[at + slot].clamp(-0.3, 0.3)).collect();
                    at += vectors[i].len();
                    let lobe = freedoms[i].lobe(&self.lobes[i], &moved);
                    self.set_table(i, &lobe);
                }
                self.solve();
                if self.error < kept.4 {
                    damping = (damping * 0.3).max(1e-6);
                    accepted = true;
                    break;
                }
                (self.lobes, self.tables, self.weights, self.residual, self.error) = kept;
                damping *= 10.0;
            }
            if !accepted {
                break;
            }
        }
    }
}

/// Search over one lobe's own parameters, the forward step of the refinement.
struct LobeSearch<'a, 'b> {
    like: Lobe,
    freedom: &'a Freedom,
    state: &'a Refinement<'b>,
    alone: &'a Array2<f32>,
}

impl LobeSearch<'_, '_> {
    /// Returns the squared length of the projection of the residual onto the lobe.
    fn correlation(&self, vector: &[f64]) -> f64 {
        let table = self.state.weighted_table(&self.freedom.lobe(&self.like, vector));
        let table = ArrayView1::from(&table);
        let norm = f64::from(table.dot(&table));
        if norm <= 0.0 {
            return 0.0;
        }
        table.dot(self.alone).iter().map(|x| f64::from(x.max(0.0)).powi(2)).sum::<f64>() / norm
    }
}

impl CostFunction for LobeSearch<'_, '_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, vector: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        Ok(-self.correlation(vector))
    }
}
