//! The asset of prepared layers whose residuals are quantised with one step.

use crate::pipeline::prepare_layer::PreparedLayer;
use crate::stages::encode::Coding;
use btf_runtime::{Asset, Layer};

/// An asset with its predicted error.
pub struct Assembled {
    /// The asset without its description.
    pub asset: Asset,
    /// Predicted sum of squared errors over all samples of all layers, in the residual's curve.
    pub error: f64,
    /// Number of bytes of each group of predicted coefficients, `[layer][group]`.
    pub group_bytes: Vec<Vec<usize>>,
}

/// Quantises the residuals of all `layers` with `step` and at most `most_components` components; `[width, height]` is
/// the grid of texels.
pub fn assemble(
    layers: &[PreparedLayer],
    step: f64,
    [width, height]: [usize; 2],
    most_components: usize,
    coding: Coding,
) -> Assembled {
    let (mut error, mut group_bytes) = (0.0, Vec::new());
    let layers = layers
        .iter()
        .map(|prepared| {
            let encoded = prepared.model.encode(step, most_components, coding);
            group_bytes.push(encoded.group_bytes);
            error += encoded.error;
            let mut layer = Layer { residual: Some(encoded.residual), ..prepared.layer.clone() };
            if let Some(weights) = &prepared.lobe_weights {
                let samples = 3 * width * height * layer.views.len() * layer.lights.len();
                weights.put_into(&mut layer, encoded.error / samples.max(1) as f64);
            }
            layer
        })
        .collect();
    Assembled {
        asset: Asset {
            width,
            height,
            size_mm: None,
            seamless: [false; 2],
            spectrum: None,
            material: String::new(),
            layers,
            levels: Vec::new(),
            edits: Default::default(),
        },
        error,
        group_bytes,
    }
}

/// Returns the size of the greatest coefficient that any layer can have: a row of root mean square length.
pub fn greatest_coefficient(layers: &[PreparedLayer]) -> f64 {
    let length = |prepared: &PreparedLayer| {
        let coordinates = &prepared.model.coordinates;
        (coordinates.squares / coordinates.scores.nrows() as f64).sqrt()
    };
    layers.iter().map(length).fold(0.0, f64::max)
}
