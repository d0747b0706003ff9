//! The mean and the bases of a layer as textures: for each view a tile over the hemisphere of the lights
//! ([`super::light_map`]), all tiles side by side.

use crate::export::ktx2::filtered::light_map::LightMap;
use crate::numeric::principal_directions::transposed_product;
use block_compression::{BC7Settings, CompressionVariant, decode, encode};
use half::f16;
use nalgebra::DMatrix;
use ndarray::{Array1, Array2, ArrayView1, ArrayView2};
use rayon::prelude::*;

/// The 8-bit value that stands for 0, and the largest distance from it.
const ZERO: f32 = 128.0;
const MOST: f32 = 127.0;
/// Part of the mean square of the bases that their normal equations are eased by, so that they have a solution.
const RIDGE: f64 = 1e-10;

/// A rounded basis.
pub struct Column {
    /// Blocks of BC7.
    pub blocks: Vec<u8>,
    /// Value of a step of the 8-bit values.
    pub scale: f32,
    /// Sum of the squares at the measured pairs.
    pub square: f64,
    /// What it decodes to at the measured pairs.
    pub values: Array1<f32>,
}

/// A layer's mean and bases.
pub struct Bases<'a> {
    map: &'a LightMap,
    /// Number of views and lights.
    shape: [usize; 2],
    tiles: [usize; 2],
    /// What the mean's texture decodes to at the measured pairs.
    pub mean: Array1<f32>,
    /// Halves of the mean's texture, RGBA, row by row.
    pub mean_texels: Vec<[u16; 4]>,
    /// The bases.
    pub columns: Vec<Column>,
}

impl<'a> Bases<'a> {
    /// Rounds the mean at the measured pairs, `[view, light, channel]`, to halves; there are no bases yet. `tiles` are the
    /// tiles in a row, and the rows of tiles.
    pub fn new(map: &'a LightMap, shape: [usize; 2], tiles: [usize; 2], mean: &[f32]) -> Bases<'a> {
        let mut bases =
            Bases { map, shape, tiles, mean: Array1::zeros(0), mean_texels: Vec::new(), columns: Vec::new() };
        let texels = bases.texels(ArrayView1::from(mean));
        bases.mean_texels =
            texels.iter().map(|rgb| [rgb[0], rgb[1], rgb[2], 0.0].map(|x| f16::from_f32(x).to_bits())).collect();
        let rounded: Vec<[f32; 3]> =
            bases.mean_texels.iter().map(|texel| [0, 1, 2].map(|c| f16::from_bits(texel[c]).to_f32())).collect();
        bases.mean = bases.at_pairs(&rounded);
        bases
    }

    /// Adds at most `count` bases: the orthonormal directions in the columns of `found`, whose coefficients have the mean squares
    /// `variances`, and again what rounding left of them where this has more energy than the weakest.
    pub fn extend(&mut self, found: ArrayView2<f32>, variances: &[f64], count: usize) {
        let first: Vec<Column> = (0..found.ncols()).into_par_iter().map(|k| self.column(found.column(k))).collect();
        let left: Vec<Array1<f32>> =
            first.par_iter().enumerate().map(|(k, column)| &found.column(k) - &column.values).collect();
        let energy = |values: &Array1<f32>| values.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
        let mut order: Vec<(f64, usize, bool)> = (0..first.len())
            .flat_map(|k| [(variances[k], k, false), (variances[k] * energy(&left[k]), k, true)])
            .collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        order.truncate(count);
        let repeats: Vec<Column> = order
            .par_iter()
            .filter(|(energy, _, is_repeat)| *is_repeat && *energy > 0.0)
            .map(|(_, k, _)| self.column((&left[*k] / (energy(&left[*k]).sqrt() as f32)).view()))
            .collect();
        let kept: Vec<bool> =
            (0..first.len()).map(|k| order.iter().any(|(_, other, is_repeat)| !is_repeat && *other == k)).collect();
        self.columns.extend(first.into_iter().zip(kept).filter(|(_, kept)| *kept).map(|(column, _)| column));
        self.columns.extend(repeats);
    }

    /// Returns the matrix that values less the mean are multiplied by, `[sample, basis]`: the coefficients of least squared error.
    pub fn solver(&self) -> Array2<f32> {
        let bases = self.matrix();
        let n = bases.ncols();
        let gram = transposed_product(bases.view(), bases.view());
        let mut gram = DMatrix::from_fn(n, n, |i, j| 0.5 * (f64::from(gram[[i, j]]) + f64::from(gram[[j, i]])));
        let ease = RIDGE * gram.trace().max(1e-12) / n.max(1) as f64;
        (0..n).for_each(|i| gram[(i, i)] += ease);
        let inverse = gram.cholesky().map_or_else(|| DMatrix::identity(n, n), |found| found.inverse());
        bases.dot(&Array2::from_shape_fn((n, n), |(i, j)| inverse[(i, j)] as f32))
    }

    /// Returns what the bases decode to, `[sample, basis]`.
    pub fn matrix(&self) -> Array2<f32> {
        let mut out = Array2::zeros((self.mean.len(), self.columns.len()));
        for (mut to, column) in out.columns_mut().into_iter().zip(&self.columns) {
            to.assign(&column.values);
        }
        out
    }

    /// Rounds values at the measured pairs to BC7.
    fn column(&self, values: ArrayView1<f32>) -> Column {
        let texels = self.texels(values);
        let largest = texels.as_flattened().iter().fold(0.0f32, |most, x| most.max(x.abs()));
        let scale = (largest / MOST).max(f32::MIN_POSITIVE);
        let code = |x: f32| (x / scale + ZERO).round().clamp(0.0, 255.0) as u8;
        let bytes: Vec<u8> = texels.iter().flat_map(|rgb| [code(rgb[0]), code(rgb[1]), code(rgb[2]), 255]).collect();
        let [width, height] = self.tiles.map(|tiles| (tiles * self.map.side()) as u32);
        let variant = CompressionVariant::BC7(BC7Settings::opaque_basic());
        let mut blocks = vec![0; variant.blocks_byte_size(width, height)];
        encode::compress_rgba8(variant, &bytes, &mut blocks, width, height, 4 * width);
        let mut decoded = vec![0; bytes.len()];
        decode::decompress_blocks_as_rgba8(variant, width, height, &blocks, &mut decoded);
        let decoded: Vec<[f32; 3]> =
            decoded.chunks_exact(4).map(|rgba| [0, 1, 2].map(|c| scale * (f32::from(rgba[c]) - ZERO))).collect();
        let values = self.at_pairs(&decoded);
        let square = values.iter().map(|x| f64::from(*x).powi(2)).sum();
        Column { blocks, scale, square, values }
    }

    /// Returns the texels of all tiles, row by row, of values at the measured pairs.
    fn texels(&self, values: ArrayView1<f32>) -> Vec<[f32; 3]> {
        let ([views, lights], side) = (self.shape, self.map.side());
        let width = self.tiles[0] * side;
        let mut texels = vec![[0.0; 3]; width * self.tiles[1] * side];
        for view in 0..views {
            let at_lights = Array2::from_shape_fn((lights, 3), |(light, c)| values[(view * lights + light) * 3 + c]);
            let nodes = self.map.nodes(at_lights.view());
            let first = view / self.tiles[0] * side * width + view % self.tiles[0] * side;
            for (node, rgb) in nodes.rows().into_iter().enumerate() {
                texels[first + node / side * width + node % side] = [rgb[0], rgb[1], rgb[2]];
            }
        }
        texels
    }

    /// Returns the values at the measured pairs of the texels of all tiles.
    fn at_pairs(&self, texels: &[[f32; 3]]) -> Array1<f32> {
        let ([views, lights], side) = (self.shape, self.map.side());
        let width = self.tiles[0] * side;
        let mut values = Array1::zeros(views * lights * 3);
        for view in 0..views {
            let first = view / self.tiles[0] * side * width + view % self.tiles[0] * side;
            let nodes = Array2::from_shape_fn((side * side, 3), |(node, c)| {
                texels[first + node / side * width + node % side][c]
            });
            for (i, x) in self.map.at_lights(nodes.view()).iter().enumerate() {
                values[view * lights * 3 + i] = *x;
            }
        }
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::principal_directions::orthonormalize;
    use btf_capture::DirectionSet;
    use btf_runtime::Sphere;
    use rand::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn rounded_bases_are_near_what_they_round_and_repeats_bring_them_nearer() {
        let lights = Sphere::new(&DirectionSet::random(12, 3).unwrap().units()).unwrap();
        let map = LightMap::new(&lights);
        let shape = [5, 12];
        let mut random = Xoshiro256PlusPlus::seed_from_u64(1);
        let mean: Vec<f32> = (0..180).map(|_| random.gen_range(0.0..30.0)).collect();
        let mut bases = Bases::new(&map, shape, [3, 2], &mean);
        let error = bases.mean.iter().zip(&mean).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(error < 0.1, "halves, and values up to 30: {error}");
        // Grey: a block of colours that go every way is not what materials have.
        let grey = Array2::from_shape_simple_fn((60, 4), || random.gen_range(-1.0..1.0f32));
        let found = orthonormalize(&Array2::from_shape_fn((180, 4), |(sample, k)| grey[[sample / 3, k]]));
        // The first is so strong that what its rounding left is more than the fourth.
        bases.extend(found.view(), &[1e6, 10.0, 9.0, 1e-3], 4);
        assert_eq!(bases.columns.len(), 4);
        let error = |values: &Array1<f32>, k: usize| (&found.column(k) - values).mapv(|x| x * x).sum().sqrt();
        let errors = [0, 1, 2].map(|k| error(&bases.columns[k].values, k));
        assert!(errors.iter().all(|error| *error < 0.1), "{errors:?}");
        assert!(error(&bases.columns[1].values, 2) > 1.0, "planted: another one");
        let solver = bases.solver();
        let coefficients = found.column(0).dot(&solver);
        let rebuilt = bases.matrix().dot(&coefficients);
        assert!(error(&rebuilt, 0) < 0.3 * error(&bases.columns[0].values, 0), "{}", error(&rebuilt, 0));
    }
}
