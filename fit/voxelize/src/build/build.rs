//! Building of a volume from a model of triangles.

use crate::build::extinction::extinction_of;
use crate::build::gather::{Gather, VoxelSums};
use crate::build::light_correction::LightTruth;
use crate::build::lit::{Lit, coloured_light};
use crate::build::palette::Palette;
use crate::build::refit::{RefitParams, refit};
use crate::build::sggx_correction::{GlossTruth, GlossyMicroflake};
use crate::build::shadow::{ShadowParams, fit_shadow};
use crate::error::VoxelizeError;
use crate::model::frame::Frame;
use crate::model::microflakes::{CellMicroflakes, MicroflakeSums, luminance};
use crate::model::triangle_model::TriangleModel;
use crate::rays::occluder::Occluder;
use btf_runtime::voltex::{Voltex, Volume, VolumeLevel, Voxel, order};
use glam::Vec3;

/// Parameters of building a volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoltexParams {
    /// Voxels a side of the finest level, a power of two from 1 to 4096.
    pub resolution: u32,
    /// Parameters of refitting the extinction.
    pub refit: RefitParams,
    /// Parameters of fitting the shadows.
    pub shadow: ShadowParams,
}

impl Default for VoltexParams {
    fn default() -> VoltexParams {
        VoltexParams { resolution: 64, refit: RefitParams::default(), shadow: ShadowParams::default() }
    }
}

impl Lit for TriangleModel {
    fn surface(&self, triangle: usize) -> ([f32; 2], Vec3) {
        let colour = &self.colours[self.materials[triangle] as usize];
        ([luminance(colour.reflectance), luminance(colour.transmittance)], self.normal(triangle))
    }

    fn light(&self, triangle: usize, eye: Vec3, light: Vec3) -> f32 {
        let (material, normal) = (self.materials[triangle] as usize, self.normal(triangle));
        match self.tables.get(material) {
            Some(Some(table)) => table.light(normal, eye, light),
            _ => coloured_light(&self.colours[material], normal, eye, light),
        }
    }

    fn glossy_microflakes(&self) -> Vec<GlossyMicroflake> {
        let microflake = |(triangle, material): (&[Vec3; 3], &u32)| {
            GlossyMicroflake::of(triangle, self.weights[*material as usize], &self.colours[*material as usize])
        };
        self.triangles.iter().zip(&self.materials).filter_map(microflake).collect()
    }
}

/// Share of the square of the cube's side that a model's triangles must cover at least: ten times what rounding makes
/// of a line.
const MIN_AREA: f64 = 1e-6;

/// Builds a volume of triangles.
///
/// # Errors
/// [`VoxelizeError::Model`] for a model without extent or area, and for one that is too large.
pub fn build_voltex(model: &TriangleModel, params: &VoltexParams) -> Result<Volume, VoxelizeError> {
    build_with(model, params, BuildRule::default())
}

/// Rule by which voxels are made of microflakes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BuildRule {
    /// Makes the voxel of microflakes in a cell of a volume, with the number of their material.
    pub voxel: fn(&MicroflakeSums, f32, u32) -> Voxel,
    /// Whether microflakes of two sorts stay apart.
    pub sorted: bool,
}

impl Default for BuildRule {
    fn default() -> BuildRule {
        let voxel = |sums: &MicroflakeSums, volume, material| Voxel::new(extinction_of(sums, volume), material);
        BuildRule { voxel, sorted: true }
    }
}

/// Builds a volume of triangles by `rule`; [`build_voltex`] has the usual one.
pub(crate) fn build_with(
    model: &TriangleModel,
    params: &VoltexParams,
    rule: BuildRule,
) -> Result<Volume, VoxelizeError> {
    let frame = Frame::around(model.bounds())?;
    let cube = model.in_cube(&frame);
    let area = cube.area();
    if area < MIN_AREA {
        return Err(VoxelizeError::Model(format!(
            "the model's triangles cover {area:.1e} of the square of its extent, so that a volume would show nothing: give \
             them an area, and take away what lies far off"
        )));
    }
    let mut gather = Gather::new(params.resolution);
    for (triangle, material) in cube.triangles.iter().zip(&cube.materials) {
        let material = *material as usize;
        gather.add_triangle(*triangle, &cube.colours[material], cube.weights[material]);
    }
    let mut volume = volume_with(&gather.levels(), rule);
    volume.side_m = frame.side_m;
    fit_to_rays(&mut volume, &Occluder::new(&cube.triangles), &cube, params);
    Ok(volume)
}

/// Returns the volume of levels of microflakes, finest first, as if microflakes lay anywhere in their voxels. The
/// volume fills the cube.
pub(crate) fn volume_of(levels: &[VoxelSums]) -> Volume {
    volume_with(levels, BuildRule::default())
}

fn volume_with(levels: &[VoxelSums], rule: BuildRule) -> Volume {
    let mut palette = Palette::default();
    let finest = (1u32 << (levels.len() - 1)) as f32;
    let levels = levels
        .iter()
        .enumerate()
        .map(|(level, cells)| {
            let side = (1u32 << level) as f32 / finest;
            let mut voxel = |sums: &MicroflakeSums| (rule.voxel)(sums, side * side * side, palette.number(sums));
            let mut cells: Vec<(&[u32; 3], &CellMicroflakes)> = cells.iter().collect();
            cells.sort_by_key(|(at, _)| order(**at));
            let mut own = VolumeLevel::default();
            for (at, cell) in cells {
                let (first, second) = if rule.sorted { cell.sorts() } else { (cell.all(), None) };
                own.others.extend(second.map(|sums| (own.voxels.len() as u32, voxel(&sums))));
                own.voxels.push((*at, voxel(&first)));
            }
            own
        })
        .collect();
    Volume { side_m: 1.0, extent: [1.0; 3], levels, materials: palette.materials(), ..Volume::default() }
}

/// Fits SGGX correction, extinction, shadows and correction of light of every level to the triangles that the volume
/// was made of and to rays past them.
pub(crate) fn fit_to_rays(volume: &mut Volume, occluder: &Occluder, lit: &impl Lit, params: &VoltexParams) {
    let mut voltex = Voltex::new(volume);
    let gloss = GlossTruth::new(&lit.glossy_microflakes());
    let light = LightTruth::new(occluder, lit, &params.shadow);
    for level in 0..=voltex.level_count() {
        let facets = gloss.fit(&voltex, level);
        voltex.set_facets(level, &facets);
        refit(&mut voltex, level, occluder, &params.refit);
        let shadow = fit_shadow(&voltex, level, occluder, lit, &params.shadow);
        voltex.set_shadow(level, &shadow);
        let light_correction = light.fit(&voltex, level);
        let numbers = voltex.numbers_at(level);
        let own = &mut volume.levels[level as usize];
        own.facets = facets;
        own.shadow = shadow;
        own.light_correction = light_correction;
        own.clumping = voltex.clumping(level);
        own.voxels.iter_mut().zip(&numbers).for_each(|((_, voxel), number)| *voxel = voltex.voxel(*number));
        let second = |(i, number): (usize, &u32)| Some((i as u32, voltex.microflakes(*number).nth(1)?.1));
        own.others = numbers.iter().enumerate().filter_map(second).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::build::lit::model_light;
    use crate::measure::ablations::Ablation;
    use crate::model::microflakes::MicroflakeColour;
    use crate::rays::march::{March, Reflection};
    use crate::rays::projection::{HALF_SIDE, Projection, spread_directions};
    use btf_runtime::testing::Random;
    use btf_runtime::voltex::{LightCorrection, NO_VOXEL, VoltexRay, Walk};

    /// Returns the square leaves about a ball's middle.
    fn bush(leaves: usize, size: f32) -> TriangleModel {
        let mut random = Random::new(5);
        let mut vector = |reach: f32| Vec3::from([0; 3].map(|_| random.within(-reach, reach)));
        let mut model = TriangleModel::default();
        for _ in 0..leaves {
            let (at, x) = (vector(0.4), vector(1.0).normalize());
            let y = x.cross(vector(1.0)).normalize();
            let [a, b, c, d] = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(u, v): (f32, f32)| at + (x * u + y * v) * 0.5 * size);
            model.triangles.extend([[a, b, c], [a, c, d]]);
        }
        model.materials = vec![0; model.triangles.len()];
        model.colours =
            vec![MicroflakeColour { reflectance: [0.3; 3], transmittance: [0.2; 3], ..MicroflakeColour::default() }];
        model.weights = vec![1.0];
        model
    }

    /// Returns what the model hides and what the volume does, in views of which none was fitted.
    fn hidden(volume: &Volume, occluder: &Occluder, level: u32) -> Vec<[f32; 2]> {
        let voltex = Voltex::new(volume);
        let of_view = |direction: Vec3| {
            let view = Projection::new(direction);
            let (mut model, mut hidden) = (0.0, 0.0);
            for i in 0..60 * 60 {
                let at = |k: usize| (k as f32 + 0.5) / 60.0 * 2.0 * HALF_SIDE - HALF_SIDE;
                let origin = view.origin(at(i % 60), at(i / 60));
                model += f32::from(u8::from(occluder.occluded(origin, direction, 4.0)));
                let d = direction.to_array();
                let ray = VoltexRay { origin: origin.to_array(), direction: d };
                let mut walk = Walk::new(ray, 0.0, 4.0, voltex.level_count());
                let mut depth = 0.0;
                while let Some(segment) = walk.next(&voltex, level) {
                    if segment.cell.voxel != NO_VOXEL {
                        let sigma = voltex.clumping_along(level, d) * voltex.extinction_along(segment.cell.voxel, d);
                        depth += sigma * (segment.t1 - segment.t0);
                    }
                }
                hidden += 1.0 - (-depth).exp();
            }
            [model, hidden]
        };
        spread_directions(5, 2.1).into_iter().map(of_view).collect()
    }

    /// Of what the model hides, what the volume hides, in all of them.
    fn opacity_ratio(volume: &Volume, occluder: &Occluder, level: u32) -> f32 {
        let sum = |k: usize| hidden(volume, occluder, level).iter().map(|of_view| of_view[k]).sum::<f32>();
        sum(1) / sum(0)
    }

    #[test]
    fn a_fitted_volume_hides_what_its_model_hides() {
        let model = bush(150, 0.16);
        let params = VoltexParams {
            resolution: 16,
            refit: RefitParams { views: 12, passes: 2, rays: 3 },
            shadow: ShadowParams { views: 2, turns: 1, pixels: 12 },
        };
        let frame = Frame::around(model.bounds()).unwrap();
        let triangles: Vec<_> = model.triangles.iter().map(|t| t.map(|p| frame.cube_from_m(p))).collect();
        let occluder = Occluder::new(&triangles);
        let fitted = build_voltex(&model, &params).unwrap();
        let raw = VoltexParams { refit: RefitParams { views: 0, ..params.refit }, ..params };
        let raw = build_voltex(&model, &raw).unwrap();
        for level in 0..=4 {
            let ratio = opacity_ratio(&fitted, &occluder, level);
            assert!((ratio - 1.0).abs() < 0.03, "level {level}: {ratio}");
        }
        // Planted: what was not fitted is told apart.
        assert!((opacity_ratio(&raw, &occluder, 3) - 1.0).abs() > 0.03, "{}", opacity_ratio(&raw, &occluder, 3));
        // The same bytes from the same model.
        assert_eq!(build_voltex(&model, &params).unwrap(), fitted);
        // Eye and light in one direction see the same gaps.
        assert!(fitted.levels[0].shadow.shared[0] > 0.8, "{:?}", fitted.levels[0].shadow);
        assert!(fitted.pack().is_ok());
    }

    #[test]
    fn a_fitted_volume_is_as_bright_as_its_model_from_each_side_under_each_light() {
        // Leaves in layers: shadows from above are others than from the side.
        let mut model = bush(150, 0.16);
        model.triangles.iter_mut().flatten().for_each(|corner| corner.z *= 0.3);
        let params = VoltexParams {
            resolution: 8,
            refit: RefitParams { views: 12, passes: 2, rays: 3 },
            shadow: ShadowParams { views: 12, turns: 1, pixels: 12 },
        };
        let cube = model.in_cube(&Frame::around(model.bounds()).unwrap());
        let occluder = Occluder::new(&cube.triangles);
        let fitted = build_voltex(&model, &params).unwrap();
        let mut without = fitted.clone();
        without.levels.iter_mut().for_each(|level| level.light_correction = LightCorrection::default());
        let lights = spread_directions(5, 0.2);
        // Root mean square of what a level is too bright or too dark by, over eyes and lights of which none was fitted.
        let error = |volume: &Volume, level: u32| -> f64 {
            let voltex = Voltex::new(volume);
            let march = March::new(&voltex, level, Reflection::ClosedForm);
            let (mut squares, mut all) = (0.0, 0.0);
            for eye in spread_directions(7, 2.9) {
                let view = Projection::new(-eye);
                let mut sums = [[0f32; 5]; 2];
                for i in 0..60 * 60 {
                    let at = |k: usize| (k as f32 + 0.5) / 60.0 * 2.0 * HALF_SIDE - HALF_SIDE;
                    let origin = view.origin(at(i % 60), at(i / 60));
                    march.ray(origin, -eye, &lights, &mut sums[0]);
                    for (sum, light) in sums[1].iter_mut().zip(&lights) {
                        *sum += model_light(&occluder, &cube, origin, -eye, *light);
                    }
                }
                for (found, truth) in sums[0].iter().zip(sums[1]) {
                    squares += f64::from(found - truth).powi(2);
                    all += f64::from(truth).powi(2);
                }
            }
            (squares / all).sqrt()
        };
        for level in 0..=3 {
            let [with, without] = [&fitted, &without].map(|volume| error(volume, level));
            println!("level {level}: {with} instead of {without}");
            // Planted difference: no correction.
            assert!(with < 0.15 && with < 0.75 * without, "level {level}: {with} {without}");
        }
    }

    #[test]
    fn leaves_in_rows_hide_each_other_along_the_rows() {
        // 4 x 4 rows along x, in every one 40 leaves, each of them smaller than a voxel and right behind the one
        // before.
        let mut model = bush(640, 0.03);
        for (i, triangle) in model.triangles.iter_mut().enumerate() {
            let (row, place) = (i / 2 / 40, i / 2 % 40);
            let at = Vec3::new(place as f32 / 39.0, (row / 4) as f32 / 4.0 + 0.1, (row % 4) as f32 / 4.0 + 0.1);
            let middle = (triangle[0] + triangle[if i % 2 == 0 { 2 } else { 1 }]) * 0.5;
            triangle.iter_mut().for_each(|p| *p += at - middle);
        }
        let params = VoltexParams {
            resolution: 16,
            refit: RefitParams { views: 24, passes: 2, rays: 3 },
            shadow: ShadowParams { views: 1, turns: 1, pixels: 4 },
        };
        let occluder = Occluder::new(&model.in_cube(&Frame::around(model.bounds()).unwrap()).triangles);
        let fitted = build_voltex(&model, &params).unwrap();
        let (even, _) = Ablation::EvenClumping.apply(&model, &fitted).unwrap();
        for level in 0..3 {
            let worst = |volume| {
                let ratios = hidden(volume, &occluder, level).into_iter().map(|[model, hidden]| hidden / model);
                ratios.fold(0.0f32, |worst, ratio| worst.max((ratio - 1.0).abs()))
            };
            let c = fitted.levels[level as usize].clumping.0;
            println!("{level}: {c:?}, {} instead of {}", worst(&fitted), worst(&even));
            assert!(c[0] < c[1] - 0.2 && c[0] < c[2] - 0.2, "{c:?}");
            // Planted difference: clumping that is the same in all directions.
            assert!(worst(&fitted) < 0.6 * worst(&even), "level {level}");
        }
    }

    #[test]
    fn a_model_without_extent_is_refused() {
        let mut model = bush(1, 0.1);
        model.triangles.clear();
        model.materials.clear();
        assert!(build_voltex(&model, &VoltexParams::default()).unwrap_err().to_string().contains("no extent"));
    }
}
