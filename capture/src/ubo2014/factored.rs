//! Reads the three factorised kinds of files: DFMF, FMF and PVF. Each image is a product of a matrix over texels and
//! one over directions, computed for several lights of a view at a time.

use ndarray::ArrayView2;
use ndarray::linalg::general_mat_mul;

use super::colour_model::ToRgb;
use super::header::{Cursor, Header};
use super::matrix::{Matrix, Scalar, push_numbers};

/// Numbers of the matrix over texels that are processed at a time.
const TILE_NUMBERS: usize = 1 << 18;

/// Product of a matrix over texels and the transpose of one over directions.
///
/// Either matrix may run over the channels as well, which then change faster than texels or directions.
#[derive(Debug)]
struct Product {
    over_texels: Matrix,
    over_directions: Matrix,
    /// Number of components, the columns of both matrices that are used.
    components: usize,
    place: Place,
    /// Mean that is added to the rows of the matrix that runs over the channels.
    mean: Option<Matrix>,
}

/// Place of the channels in a product.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    /// Product of this one channel.
    Channel(usize),
    /// Channels in the rows over directions.
    InDirections,
    /// Channels in the rows over texels.
    InTexels,
}

/// Products of a file.
#[derive(Debug)]
pub(super) struct Factored {
    /// One product for each view in PVF; products of all views in the others.
    products: Vec<Product>,
    by_view: bool,
    /// Number of lights in the file.
    lights: usize,
    channels: usize,
    texels: usize,
    to_rgb: ToRgb,
    /// Largest number of components of a product.
    pub(super) components: usize,
}

/// Returns where the channels of a factorisation lie, from the rows of its left and right matrix; `channels` run beside
/// those of the left.
fn place_of(rows: [usize; 2], texels: usize, directions: usize, channels: usize) -> Result<Place, String> {
    let [left, right] = rows;
    if Some(left) == directions.checked_mul(channels) && right == texels {
        Ok(Place::InDirections)
    } else if Some(left) == texels.checked_mul(channels) && right == directions {
        Ok(Place::InTexels)
    } else {
        Err(format!(
            "its matrices have {left} and {right} rows, which do not fit {texels} texels, {directions} directions \
             and {channels} channels"
        ))
    }
}

fn check_components(count: usize) -> Result<usize, String> {
    if count == 0 { Err("it has a factorisation without components".into()) } else { Ok(count) }
}

impl Factored {
    /// Reads DFMF: a factorisation for each channel. Also returns the number of the colour model.
    pub(super) fn read_dfmf(cursor: &mut Cursor, header: &Header) -> Result<(Factored, i32), String> {
        const WHAT: &str = "its colour model";
        cursor.u32(WHAT)?;
        let number = cursor.i32(WHAT)?;
        let (mean, matrix) = (cursor.f32s::<3>(WHAT)?, cursor.f32s::<9>(WHAT)?);
        let to_rgb = ToRgb::of_model(header, number, mean, matrix)?;
        let mut products = Vec::new();
        for channel in 0..header.channels.len() {
            let what = format!("the matrices of its channel {channel}");
            let scalar = Scalar::read(cursor)?;
            let components = check_components(cursor.count(&what)?)?;
            let rows = [cursor.count(&what)?, cursor.count(&what)?];
            let place = place_of(rows, header.texel_count(), header.pair_count(), 1)?;
            cursor.take_many(components, scalar.bytes(), &what)?;
            let left = Matrix::skip(cursor, rows[0], components, scalar, &what)?;
            let right = Matrix::skip(cursor, rows[1], components, scalar, &what)?;
            let (over_texels, over_directions) =
                if place == Place::InDirections { (right, left) } else { (left, right) };
            let place = Place::Channel(channel);
            products.push(Product { over_texels, over_directions, components, place, mean: None });
        }
        Ok((Factored::new(products, false, header, to_rgb), number))
    }

    /// Reads FMF: one factorisation.
    pub(super) fn read_fmf(cursor: &mut Cursor, header: &Header, to_rgb: ToRgb) -> Result<Factored, String> {
        const WHAT: &str = "its matrices";
        let asked = cursor.count(WHAT)?;
        let scalar = Scalar::read(cursor)?;
        let stored = check_components(cursor.count(WHAT)?)?;
        let rows = [cursor.count(WHAT)?, cursor.count(WHAT)?];
        let place = place_of(rows, header.texel_count(), header.pair_count(), header.channels.len())?;
        cursor.take_many(stored, scalar.bytes(), WHAT)?;
        let left = Matrix::skip(cursor, rows[0], stored, scalar, WHAT)?;
        let right = Matrix::skip(cursor, rows[1], stored, scalar, WHAT)?;
        let (over_texels, over_directions) = if place == Place::InDirections { (right, left) } else { (left, right) };
        let components = check_components(asked.min(stored))?;
        let product = Product { over_texels, over_directions, components, place, mean: None };
        Ok(Factored::new(vec![product], false, header, to_rgb))
    }

    /// Reads PVF: a factorisation and a mean for each of `slots` views.
    pub(super) fn read_pvf(
        cursor: &mut Cursor,
        header: &Header,
        slots: usize,
        to_rgb: ToRgb,
    ) -> Result<Factored, String> {
        let views = header.views.in_file.len();
        if slots != views {
            return Err(format!("it has {slots} factorisations for {views} views"));
        }
        let mut products = Vec::new();
        for slot in 0..slots {
            let what = format!("the factorisation of its view {slot}");
            let scalar = Scalar::read(cursor)?;
            let components = check_components(cursor.count(&what)?)?;
            let (weights, dimension) = (cursor.count(&what)?, cursor.count(&what)?);
            let lights = header.lights.in_file.len();
            let place = place_of([dimension, weights], header.texel_count(), lights, header.channels.len())?;
            cursor.take_many(components, scalar.bytes(), &what)?;
            let mean = Some(Matrix::skip(cursor, dimension, 1, scalar, &what)?);
            let left = Matrix::skip(cursor, dimension, components, scalar, &what)?;
            let right = Matrix::skip(cursor, weights, components, scalar, &what)?;
            let (over_texels, over_directions) =
                if place == Place::InDirections { (right, left) } else { (left, right) };
            products.push(Product { over_texels, over_directions, components, place, mean });
        }
        Ok(Factored::new(products, true, header, to_rgb))
    }

    fn new(products: Vec<Product>, by_view: bool, header: &Header, to_rgb: ToRgb) -> Factored {
        Factored {
            by_view,
            lights: header.lights.in_file.len(),
            channels: header.channels.len(),
            texels: header.texel_count(),
            to_rgb,
            components: products.iter().map(|product| product.components).max().unwrap_or(0),
            products,
        }
    }

    /// Returns linear sRGB, `[light, texel, channel]`, of the view `view` of the file under its lights `lights`.
    ///
    /// Cost: channels x components multiplications per sample, at the rate of a matrix product.
    pub(super) fn images(&self, bytes: &[u8], view: usize, lights: &[usize]) -> Vec<f32> {
        let products = if self.by_view { &self.products[view..=view] } else { &self.products[..] };
        // A view's own product counts its directions from 0.
        let first_direction = if self.by_view { 0 } else { view * self.lights };
        let over_directions: Vec<DirectionRows> =
            products.iter().map(|product| self.direction_rows(bytes, product, first_direction, lights)).collect();
        let widest = products.iter().map(|product| self.texel_rows(product, 1) * product.components).max();
        let tile = (TILE_NUMBERS / widest.unwrap_or(1).max(lights.len() * self.channels)).max(1);

        let mut images = vec![0f32; lights.len() * self.texels * 3];
        let (mut rows, mut result) = (Vec::new(), Vec::new());
        // `[texel, light, channel]` of a tile.
        let mut samples = Vec::new();
        for first in (0..self.texels).step_by(tile) {
            let count = tile.min(self.texels - first);
            samples.clear();
            samples.resize(count * lights.len() * self.channels, 0f32);
            for (product, directions) in products.iter().zip(&over_directions) {
                let texel_rows = self.texel_rows(product, count);
                rows.clear();
                let (matrix, used) = (&product.over_texels, product.components);
                if used == matrix.columns {
                    matrix.push_rows(bytes, self.texel_rows(product, first), texel_rows, &mut rows);
                } else {
                    let start = self.texel_rows(product, first);
                    (start..start + texel_rows).for_each(|row| matrix.push_row(bytes, row, used, &mut rows));
                }
                result.clear();
                result.resize(texel_rows * directions.count, 0f32);
                multiply(&rows, &directions.rows, &mut result, texel_rows, directions.count, used);
                self.add(bytes, product, directions, first, &result, &mut samples);
            }
            for (i, sample) in samples.chunks_exact_mut(self.channels).enumerate() {
                let (texel, light) = (first + i / lights.len(), i % lights.len());
                let at = (light * self.texels + texel) * 3;
                images[at..at + 3].copy_from_slice(&self.to_rgb.rgb(sample));
            }
        }
        images
    }

    /// Returns the number of rows of the matrix over texels that `texels` texels take.
    fn texel_rows(&self, product: &Product, texels: usize) -> usize {
        if product.place == Place::InTexels { texels * self.channels } else { texels }
    }

    fn direction_rows(&self, bytes: &[u8], product: &Product, first: usize, lights: &[usize]) -> DirectionRows {
        let channels = if product.place == Place::InDirections { self.channels } else { 1 };
        let mut found = DirectionRows { count: lights.len() * channels, rows: Vec::new(), mean: Vec::new() };
        for &light in lights {
            for channel in 0..channels {
                let row = (first + light) * channels + channel;
                product.over_directions.push_row(bytes, row, product.components, &mut found.rows);
                if let (Some(mean), Place::InDirections) = (&product.mean, product.place) {
                    mean.push_rows(bytes, row, 1, &mut found.mean);
                }
            }
        }
        found
    }

    /// Adds `result`, `[texel row, direction row]` of a tile, to its places in `samples`.
    fn add(
        &self,
        bytes: &[u8],
        product: &Product,
        directions: &DirectionRows,
        first: usize,
        result: &[f32],
        samples: &mut [f32],
    ) {
        let channels = self.channels;
        match product.place {
            Place::InDirections => {
                samples.copy_from_slice(result);
                if !directions.mean.is_empty() {
                    for row in samples.chunks_exact_mut(directions.mean.len()) {
                        row.iter_mut().zip(&directions.mean).for_each(|(sample, mean)| *sample += mean);
                    }
                }
            }
            Place::Channel(channel) => {
                samples.iter_mut().skip(channel).step_by(channels).zip(result).for_each(|(to, from)| *to = *from);
            }
            Place::InTexels => {
                let mut means = Vec::new();
                if let Some(mean) = &product.mean {
                    mean.push_rows(bytes, first * channels, result.len() / directions.count, &mut means);
                }
                for (row, values) in result.chunks_exact(directions.count).enumerate() {
                    let (texel, channel) = (row / channels, row % channels);
                    let mean = means.get(row).copied().unwrap_or(0.0);
                    for (light, value) in values.iter().enumerate() {
                        samples[(texel * directions.count + light) * channels + channel] = value + mean;
                    }
                }
            }
        }
    }
}

/// Rows of the matrix over directions in single precision.
struct DirectionRows {
    count: usize,
    /// Values `[row, component]`.
    rows: Vec<f32>,
    /// Mean of each row, or none.
    mean: Vec<f32>,
}

/// Computes `result[i, j] = sum over k of a[i, k] b[j, k]`.
fn multiply(a: &[f32], b: &[f32], result: &mut [f32], rows: usize, columns: usize, inner: usize) {
    let shaped = |values, count| ArrayView2::from_shape((count, inner), values).expect("as many numbers as shaped");
    let mut result = ndarray::ArrayViewMut2::from_shape((rows, columns), result).expect("as many numbers as shaped");
    general_mat_mul(1.0, &shaped(a, rows), &shaped(b, columns).t(), 0.0, &mut result);
}

/// Returns the height map of an extended FMF header: width, height and values, row by row.
pub(super) fn read_height_map(cursor: &mut Cursor) -> Result<Option<(usize, usize, Vec<f32>)>, String> {
    const WHAT: &str = "its height map";
    let (width, height) = (cursor.count(WHAT)?, cursor.count(WHAT)?);
    if width == 0 || height == 0 {
        return Ok(None);
    }
    let count = width.checked_mul(height).ok_or("its height map has more values than can be counted")?;
    let mut values = Vec::new();
    push_numbers(cursor.take_many(count, 2, WHAT)?, Scalar::Half, &mut values);
    Ok(Some((width, height, values)))
}
