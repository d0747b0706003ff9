//! Fields of density: hypertexture and scanned volumes [Neyret 1996, section 3.2].
//!
//! A density d stands for `area_per_m3 d` of microflakes in a cubic metre. Where it changes, microflakes lie across its
//! gradient: between densities 0 and 1 its level surfaces have the area `|grad d|` per volume [Federer 1959, the coarea
//! formula], so that much of the area, if there is as much, has the gradient's normal. The rest looks everywhere.
//!
//! When it is wrong: a field is no surface that a ray meets, so nothing is added to the canvas' triangles.

use btf_models::shapes::{DensityData, NumberType, Script};
use glam::{DVec3, IVec3};
use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::brush::Brush;
use super::canvas::Canvas;
use super::noise::NoiseField;
use super::solid::Solid;
use super::unusable;
use crate::error::VoxelizeError;
use crate::model::microflakes::{MicroflakeColour, MicroflakeSums};

/// Samples along a voxel, at least and at most.
const SAMPLES: [f64; 2] = [4.0, 16.0];

/// Numbers of a scanned volume that are read at most; `btf_models::shapes` allows no more either.
const MAX_NUMBERS: u64 = 1 << 30;

/// A density and its gradient per metre.
pub trait Field {
    /// Returns the density and its gradient per metre at a place in metres.
    fn at(&self, place_m: DVec3) -> (f64, DVec3);
    /// Tells whether the density is 0 in a ball; a field that cannot tell says no.
    fn is_empty(&self, centre_m: DVec3, radius_m: f64) -> bool;
    /// Returns the corners of a box outside which the density is 0.
    fn bounds(&self) -> [DVec3; 2];
    /// Returns the length over which the density changes, where it is known.
    fn detail_m(&self) -> Option<f64>;
}

/// Paints a field.
///
/// Cost: 64 values for each voxel that is not empty, up to 4096 where the field is finer than voxels.
pub fn paint_field(field: &impl Field, area_per_m3: f64, canvas: &mut Canvas, brush: &Brush) {
    canvas.has_fields = true;
    let [mut least, mut most] = field.bounds().map(|corner| canvas.grid_from_m(corner));
    let size = canvas.size();
    for k in 0..3 {
        if k == 2 || !canvas.cyclic()[k] {
            (least[k], most[k]) = (least[k].max(0.0), most[k].min(size[k]));
        }
    }
    if !least.cmplt(most).all() {
        return;
    }
    let from = least.floor().as_ivec3();
    let block = ((most.ceil().as_ivec3() - from).max_element() as u32).next_power_of_two() as i32;
    let samples = field.detail_m().map_or(SAMPLES[0], |detail_m| canvas.voxel_m() / detail_m);
    let samples = samples.ceil().clamp(SAMPLES[0], SAMPLES[1]) as i32;
    let painter = Painter { field, least, most, samples, area_per_m3, brush };
    painter.block(from, block, canvas);
}

struct Painter<'a, F: Field> {
    field: &'a F,
    /// Corners of the box that is painted, in voxels.
    least: DVec3,
    most: DVec3,
    /// Samples along a voxel.
    samples: i32,
    area_per_m3: f64,
    brush: &'a Brush,
}

impl<F: Field> Painter<'_, F> {
    fn block(&self, from: IVec3, size: i32, canvas: &mut Canvas) {
        if !from.as_dvec3().cmplt(self.most).all() {
            return;
        }
        let half = 0.5 * f64::from(size);
        let middle_m = canvas.m_from_grid(from.as_dvec3() + half);
        if self.field.is_empty(middle_m, half * 3f64.sqrt() * canvas.voxel_m()) {
            return;
        }
        if size == 1 {
            self.voxel(from, canvas);
            return;
        }
        for i in 0..8 {
            self.block(from + IVec3::new(i & 1, i >> 1 & 1, i >> 2) * (size / 2), size / 2, canvas);
        }
    }

    fn voxel(&self, from: IVec3, canvas: &mut Canvas) {
        let n = self.samples;
        let size = canvas.size();
        // The part of the voxel where the field is, so that its box has its volume.
        let (least, most) = (from.as_dvec3().max(self.least), (from.as_dvec3() + 1.0).min(self.most));
        // Of a sample, so that areas come in units of the unit cube's face.
        let volume = (most - least).element_product() / f64::from(n.pow(3)) * canvas.voxel_m().powi(3);
        let volume = volume / (canvas.side_m * canvas.side_m);
        let mut last: Option<([i32; 3], MicroflakeSums)> = None;
        for i in 0..n.pow(3) {
            let at = IVec3::new(i % n, i / n % n, i / (n * n)).as_dvec3();
            let place = least + (most - least) * (at + 0.5) / f64::from(n);
            let place_m = canvas.m_from_grid(place);
            let (density, gradient) = self.field.at(place_m);
            if density <= 0.0 {
                continue;
            }
            let mut wrapped = place;
            for k in 0..2 {
                if canvas.cyclic()[k] {
                    wrapped[k] = place[k].rem_euclid(size[k]);
                }
            }
            if wrapped.cmplt(DVec3::ZERO).any() || wrapped.cmpgt(size).any() {
                continue;
            }
            let area = self.area_per_m3 * density * volume;
            let steep = gradient.length();
            let oriented = area.min(steep * volume);
            let colour = self.brush.colour(place_m, None);
            let mut microflakes = isotropic_microflakes((area - oriented) as f32, &colour);
            if oriented > 0.0 {
                microflakes.add(&MicroflakeSums::microflake(oriented as f32, (gradient / steep).as_vec3(), &colour));
            }
            let cell = wrapped.floor().as_ivec3().to_array();
            match &mut last {
                Some((there, sums)) if *there == cell => sums.add(&microflakes),
                _ => {
                    if let Some((there, sums)) = last.replace((cell, microflakes)) {
                        canvas.add(there, &sums);
                    }
                }
            }
        }
        if let Some((cell, sums)) = last {
            canvas.add(cell, &sums);
        }
    }
}

/// Returns the summed moments of microflakes of total `area` whose normals are uniformly distributed over the sphere.
pub fn isotropic_microflakes(area: f32, colour: &MicroflakeColour) -> MicroflakeSums {
    let third = area / 3.0;
    MicroflakeSums::new(area, [0.5 * area; 13], [third, third, third, 0.0, 0.0, 0.0], colour)
}

/// A solid whose rim is displaced by noise [Perlin & Hoffert 1989].
pub struct Hypertexture {
    /// The solid.
    pub solid: Solid,
    /// Width of the rim in metres.
    pub rim_m: f64,
    /// Displacement in metres by noise of height 1.
    pub amplitude_m: f64,
    /// The noise.
    pub noise: NoiseField,
}

impl Field for Hypertexture {
    fn at(&self, place_m: DVec3) -> (f64, DVec3) {
        let (height, slope) = self.noise.at(place_m);
        let density = 0.5 - (self.solid.value(place_m) + self.amplitude_m * height) / self.rim_m;
        if density <= 0.0 || density >= 1.0 {
            return (density.clamp(0.0, 1.0), DVec3::ZERO);
        }
        // Central differences, over a length that distances of solids are smooth on.
        let step_m = 1e-4 * self.rim_m;
        let out = DVec3::from(std::array::from_fn(|k| {
            let mut step = DVec3::ZERO;
            step[k] = step_m;
            (self.solid.value(place_m + step) - self.solid.value(place_m - step)) / (2.0 * step_m)
        }));
        (density, -(out + self.amplitude_m * slope) / self.rim_m)
    }

    fn is_empty(&self, centre_m: DVec3, radius_m: f64) -> bool {
        self.solid.range(centre_m, radius_m)[0] > self.reach_m()
    }

    fn bounds(&self) -> [DVec3; 2] {
        self.solid.bounds(self.reach_m())
    }

    fn detail_m(&self) -> Option<f64> {
        None
    }
}

impl Hypertexture {
    /// Returns the value of the solid's function, in metres, above which the density is 0.
    fn reach_m(&self) -> f64 {
        0.5 * self.rim_m + self.amplitude_m * self.noise.bound()
    }
}

/// A scanned volume, linear between the middles of its cells.
pub struct Scan {
    cells: [usize; 3],
    number: NumberType,
    bytes: Vec<u8>,
    range: [f64; 2],
    least: DVec3,
    size: DVec3,
}

impl Scan {
    /// Reads a volume that fills the box between two corners; `script` is the path that its files stand beside.
    ///
    /// # Errors
    /// For files that cannot be read, are too short, or pictures of different sizes.
    pub fn read(
        data: &DensityData,
        script: &Path,
        corners_m: [DVec3; 2],
        range: [f64; 2],
    ) -> Result<Scan, VoxelizeError> {
        let (cells, number, bytes) = match data {
            DensityData::Raw { file, cells, number, header_bytes } => {
                let bytes = read_numbers(&Script::beside(script, file), *cells, *number, *header_bytes)?;
                (cells.map(|cells| cells as usize), *number, bytes)
            }
            DensityData::Slices { folder } => read_slices(&Script::beside(script, folder))?,
        };
        Ok(Scan { cells, number, bytes, range, least: corners_m[0], size: corners_m[1] - corners_m[0] })
    }

    fn number(&self, at: [i64; 3]) -> f64 {
        let [i, j, k]: [usize; 3] = std::array::from_fn(|axis| at[axis].clamp(0, self.cells[axis] as i64 - 1) as usize);
        let place = (k * self.cells[1] + j) * self.cells[0] + i;
        let number = f64::from(self.number.number(&self.bytes[place * self.number.bytes()..]));
        let share = (number - self.range[0]) / (self.range[1] - self.range[0]);
        if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) }
    }
}

impl Field for Scan {
    fn at(&self, place_m: DVec3) -> (f64, DVec3) {
        let share = (place_m - self.least) / self.size;
        if share.cmplt(DVec3::ZERO).any() || share.cmpgt(DVec3::ONE).any() {
            return (0.0, DVec3::ZERO);
        }
        let cells = DVec3::from(self.cells.map(|cells| cells as f64));
        let at = share * cells - 0.5;
        let (corner, offset) = (at.floor(), at - at.floor());
        let (mut density, mut gradient) = (0.0, DVec3::ZERO);
        for i in 0..8i64 {
            let step = [i & 1, i >> 1 & 1, i >> 2];
            let number = self.number(std::array::from_fn(|k| corner[k] as i64 + step[k]));
            let weight = |k: usize| if step[k] == 1 { offset[k] } else { 1.0 - offset[k] };
            let sign = |k: usize| if step[k] == 1 { 1.0 } else { -1.0 };
            let [x, y, z] = [0, 1, 2].map(weight);
            density += number * x * y * z;
            gradient += number * DVec3::new(sign(0) * y * z, x * sign(1) * z, x * y * sign(2));
        }
        (density, gradient * cells / self.size)
    }

    fn is_empty(&self, _: DVec3, _: f64) -> bool {
        false
    }

    fn bounds(&self) -> [DVec3; 2] {
        [self.least, self.least + self.size]
    }

    fn detail_m(&self) -> Option<f64> {
        Some((self.size / DVec3::from(self.cells.map(|cells| cells as f64))).min_element())
    }
}

fn read_numbers(path: &Path, cells: [u32; 3], number: NumberType, header_bytes: u64) -> Result<Vec<u8>, VoxelizeError> {
    const REMEDY: &str = "correct `cells`, `number` and `header_bytes`, or get the file from its source again";
    let failed = |action| move |source| VoxelizeError::File { path: path.into(), action, source, remedy: REMEDY };
    let count = cells.iter().map(|&cells| u64::from(cells)).product::<u64>();
    if count > MAX_NUMBERS {
        let fault = format!("would have {count} numbers, and {MAX_NUMBERS} are read");
        return Err(unusable(path, fault, "make a smaller volume of it"));
    }
    let wanted = count * number.bytes() as u64;
    let mut file = File::open(path).map_err(failed("opening"))?;
    let there = file.metadata().map_err(failed("reading"))?.len();
    if there.saturating_sub(header_bytes) < wanted {
        let fault = format!("has {there} bytes, not {header_bytes} and then {wanted}");
        return Err(unusable(path, fault, REMEDY));
    }
    file.seek(SeekFrom::Start(header_bytes)).map_err(failed("reading"))?;
    let mut bytes = Vec::new();
    file.take(wanted).read_to_end(&mut bytes).map_err(failed("reading"))?;
    if bytes.len() as u64 != wanted {
        return Err(unusable(path, "became shorter while it was read".into(), REMEDY));
    }
    Ok(bytes)
}

/// Reads the pictures of a folder in the order of their names, rows turned so that y counts upwards.
fn read_slices(folder: &Path) -> Result<([usize; 3], NumberType, Vec<u8>), VoxelizeError> {
    const REMEDY: &str = "name a folder that holds nothing but PNG or JPEG pictures of one size";
    let failed = |source| VoxelizeError::File { path: folder.into(), action: "listing", source, remedy: REMEDY };
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        paths.push(entry.map_err(failed)?.path());
    }
    paths.sort();
    let (mut size, mut number, mut bytes) = ([0; 2], NumberType::U8, Vec::new());
    for (slice, path) in paths.iter().enumerate() {
        let picture = image::open(path).map_err(|error| unusable(path, format!("is no picture ({error})"), REMEDY))?;
        let found = [picture.width() as usize, picture.height() as usize];
        let deep = picture.color().bytes_per_pixel() > picture.color().channel_count();
        let kind = if deep { NumberType::U16le } else { NumberType::U8 };
        if slice == 0 {
            (size, number) = (found, kind);
        }
        if found != size || kind != number {
            return Err(unusable(path, "has another size or depth than the slices before it".into(), REMEDY));
        }
        if (size[0] * size[1]) as u64 * paths.len() as u64 > MAX_NUMBERS || size.contains(&0) {
            return Err(unusable(folder, format!("has more than {MAX_NUMBERS} texels, or none"), REMEDY));
        }
        match number {
            NumberType::U8 => {
                picture.to_luma8().chunks_exact(size[0]).rev().for_each(|row| bytes.extend_from_slice(row))
            }
            _ => {
                let picture = picture.to_luma16();
                let rows = picture.chunks_exact(size[0]).rev();
                bytes.extend(rows.flatten().flat_map(|number| number.to_le_bytes()));
            }
        }
    }
    if paths.is_empty() {
        return Err(unusable(folder, "has no slices".into(), REMEDY));
    }
    Ok(([size[0], size[1], paths.len()], number, bytes))
}
