//! Pairs of directions at which a material of another model is fitted to an asset and measured against it, and the layers of
//! an asset that such a material shows.

use crate::error::FitError;
use crate::input::pair_stride::stride_over_pairs;
use crate::metrics::psnr_db_from_codes;
use crate::monitor::Monitor;
use btf_capture::Transfer;
use btf_runtime::{DecodeOptions, LightRows, Resident, SurfaceSide, ViewedTexel};
use rayon::prelude::*;

/// Pairs at which a texel's error is measured.
const MEASURED_PAIRS: usize = 96;

/// Returns the layer that is lit and seen from the front.
///
/// # Errors
/// [`FitError::Params`] where there is none.
pub fn front_layer(resident: &Resident) -> Result<u32, FitError> {
    resident.layer_for_sides(0, SurfaceSide::Front, SurfaceSide::Front).ok_or_else(|| {
        FitError::Params(
            "no layer is lit and seen from the front, which a material of another model needs; fit a capture of the front as well"
                .into(),
        )
    })
}

/// Returns the layer of transmission, seen from the front or else from the back.
pub fn transmission_layer(resident: &Resident) -> Option<u32> {
    let layer = |light, view| resident.layer_for_sides(0, light, view);
    layer(SurfaceSide::Back, SurfaceSide::Front).or_else(|| layer(SurfaceSide::Front, SurfaceSide::Back))
}

/// Pairs of a layer's measured directions, those of one view together.
#[derive(Clone)]
pub struct PairList {
    /// Unit vectors to light and eye, as the decoder takes them.
    pub directions: Vec<[[f32; 3]; 2]>,
}

impl PairList {
    /// Returns all measured pairs of `layer`, dealt into lists of about `count`, each over all views and lights alike.
    pub fn split(resident: &Resident, layer: u32, count: usize) -> Vec<PairList> {
        let (views, lights) = (resident.views(layer), resident.lights(layer));
        let behind = |of: [f32; 3], back: bool| [of[0], of[1], if back { -of[2] } else { of[2] }];
        let sides = |light: bool, view: bool| resident.layer_for_sides(0, light.into(), view.into()) == Some(layer);
        let light_back = sides(true, true) || sides(true, false);
        let view_back = sides(true, true) || sides(false, true);
        let all = views.len() * lights.len();
        let stride = if all > count { stride_over_pairs(all / count, lights.len()) } else { 1 };
        let list = |first: usize| PairList {
            directions: (first..all)
                .step_by(stride)
                .map(|pair| {
                    let (view, light) = (views[pair / lights.len()], lights[pair % lights.len()]);
                    [behind(light, light_back), behind(view, view_back)]
                })
                .collect(),
        };
        (0..stride).map(list).filter(|list| !list.directions.is_empty()).collect()
    }

    /// Writes what `texel` of `layer` decodes to at each pair into `out`: per channel `pi * BRDF * cosine`.
    pub fn decode(&self, resident: &Resident, layer: u32, texel: usize, out: &mut [Vec<f32>; 3]) {
        out.iter_mut().for_each(Vec::clear);
        let options = DecodeOptions::default();
        for of_view in self.directions.chunk_by(|a, b| a[1] == b[1]) {
            let viewed = ViewedTexel::new(resident, layer, texel as u32, of_view[0][1], &options);
            let mut rows = LightRows::default();
            for [wi, _] in of_view {
                let value = viewed.light(&mut rows, *wi);
                (0..3).for_each(|c| out[c].push(value[c]));
            }
        }
    }
}

/// Measures the PSNR of a material against `layer` in dB: 8-bit sRGB values of all texels, each at some of the measured pairs,
/// so that all pairs count alike; peak 255. `material_of` returns what the material of a texel reflects (`pi * BRDF *
/// cosine`) for unit vectors to light and eye.
///
/// # Errors
/// Ctrl-C.
pub fn psnr_db_at_pairs<M: Fn([f32; 3], [f32; 3]) -> [f32; 3]>(
    resident: &Resident,
    layer: u32,
    [width, height]: [usize; 2],
    monitor: &Monitor,
    material_of: impl Fn(usize) -> M + Sync,
) -> Result<f64, FitError> {
    let lists = PairList::split(resident, layer, MEASURED_PAIRS);
    let texels = width * height;
    let code = |x: f32| (255.0 * Transfer::Srgb.encoded_from_linear(x.min(1.0)) + 0.5) as i64;
    let errors = (0..texels).into_par_iter().map_init(<[Vec<f32>; 3]>::default, |values, texel| {
        if texel % width == 0 {
            monitor.report("measure", texel, texels)?;
        }
        let list = &lists[(texel + texel / width) % lists.len()];
        let material = material_of(texel);
        list.decode(resident, layer, texel, values);
        let mut sum = 0u64;
        for (pair, [wi, wo]) in list.directions.iter().enumerate() {
            let shown = material(*wi, *wo);
            (0..3).for_each(|c| sum += (code(shown[c]) - code(values[c][pair])).pow(2) as u64);
        }
        Ok([sum, 3 * list.directions.len() as u64])
    });
    let errors = errors.collect::<Result<Vec<[u64; 2]>, FitError>>()?;
    let [error, samples] = [0, 1].map(|i| errors.iter().map(|of_texel| of_texel[i]).sum());
    Ok(psnr_db_from_codes(error, samples))
}

/// Returns a grid of directions as a capture has.
#[cfg(test)]
pub fn grid_of_pairs() -> PairList {
    use btf_runtime::testing::direction_from_degrees;
    let mut directions = Vec::new();
    for view in [[0, 0], [30, 0], [30, 120], [30, 240], [60, 60], [60, 180], [60, 300], [75, 20]] {
        for theta in [0, 15, 30, 45, 60, 75] {
            for phi in (0..360).step_by(45) {
                let at = |d: [i32; 2]| direction_from_degrees(d[0].into(), d[1].into());
                directions.push([at([theta, phi]), at(view)]);
            }
        }
    }
    PairList { directions }
}
