//! The description inside an asset: what the material is, which captures it came from, how it was
//! fitted and how large its error is. JSON; no times, paths or thread counts, so that the same input
//! gives the same bytes.

use crate::error::FitError;
use crate::input::layer_frame::{capture_directions, side_of_layer};
use crate::metrics::Metrics;
use crate::params::{ErrorMeasure, FitParams, KMeansEngine};
use btf_capture::{CaptureInfo, Cosine, ImageFormat, Side, Transfer};
use btf_runtime::Asset;
use serde::{Deserialize, Serialize};

/// Description that an asset holds of itself. Every key may be absent, because another program may have written it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Material {
    /// Short name of the material, for people.
    pub name: String,
    /// One entry per layer, in the asset's order.
    pub layers: Vec<MaterialLayer>,
    /// Options of the fit and what the fit chose.
    pub fit: Option<FitRecord>,
    /// Error of the whole asset against its captures, all layers, as decoded from the file.
    pub error: Option<Metrics>,
}

/// Origin of a layer.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct MaterialLayer {
    /// Conventions of the capture.
    pub capture: CaptureRecord,
    /// Number of view directions.
    pub views: usize,
    /// Number of light directions.
    pub lights: usize,
}

/// The conventions of a capture's files, in the words of `capture.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct CaptureRecord {
    /// Name of the capture.
    pub name: String,
    /// Transfer curve: `srgb`, `linear` or `gamma:2.2`.
    pub transfer: String,
    /// Factor from linear file values to reflectance.
    pub scale: f32,
    /// Cosine of the light in the values: `included` or `excluded`.
    pub cosine: String,
    /// Side: `front`, `back`, `transmission-back` or `transmission-front`.
    pub side: String,
    /// Format of the images: `png`, `jpg` or `exr`.
    pub format: String,
    /// Provenance of the capture in words.
    pub provenance: String,
    /// Pairs that had no image and were predicted; absent for none.
    #[serde(skip_serializing_if = "is_none")]
    pub missing: usize,
}

fn is_none(count: &usize) -> bool {
    *count == 0
}

impl Default for CaptureRecord {
    /// Returns the conventions of a capture without `capture.toml`.
    fn default() -> CaptureRecord {
        CaptureRecord {
            name: String::new(),
            transfer: Transfer::Srgb.to_string(),
            scale: 1.0,
            cosine: Cosine::Included.to_string(),
            side: Side::Front.to_string(),
            format: ImageFormat::Png.to_string(),
            provenance: String::new(),
            missing: 0,
        }
    }
}

/// Options of a fit, and what the fit chose by itself.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct FitRecord {
    /// Clusters, as asked for.
    pub clusters: usize,
    /// Most lobes of a texel or, as guide, of a cluster, as asked for.
    pub lobes: usize,
    /// Residual components, as chosen.
    pub components: usize,
    /// Error that was minimised: `gamma`, `linear` or `log`.
    pub error: String,
    /// Which k-means ran: `product` or `linfa`.
    pub kmeans: String,
    /// Seed of every random choice.
    pub seed: u64,
    /// Share of the direction pairs held back; absent for none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub leave_out: Option<f64>,
    /// Size given by `--bytes`; absent for none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bytes: Option<u64>,
    /// PSNR given by `--psnr` in dB; absent for none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub psnr_db: Option<f64>,
}

impl FitRecord {
    /// Returns the record of a fit with `params` that ended with `components` residual components.
    pub fn new(params: &FitParams, components: usize) -> FitRecord {
        FitRecord {
            clusters: params.clusters,
            lobes: params.lobes,
            components,
            error: match params.error.unwrap_or(ErrorMeasure::Gamma) {
                ErrorMeasure::Gamma => "gamma",
                ErrorMeasure::Linear => "linear",
                ErrorMeasure::Log => "log",
            }
            .into(),
            kmeans: match params.kmeans {
                KMeansEngine::Product => "product",
                KMeansEngine::Linfa => "linfa",
                KMeansEngine::Levels => "levels",
            }
            .into(),
            seed: params.seed,
            leave_out: (params.leave_out > 0.0).then_some(params.leave_out),
            bytes: params.bytes,
            psnr_db: params.psnr_db,
        }
    }
}

/// Bytes of a name and of a provenance that are kept at most: the room for the description is reserved before its
/// figures are known.
const MAX_NAME: usize = 100;
const MAX_PROVENANCE: usize = 300;

/// Returns `text` in one line, cut at `most` bytes.
fn shortened(text: &str, most: usize) -> String {
    let line: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let end = (0..=most.min(line.len())).rev().find(|end| line.is_char_boundary(*end)).unwrap_or(0);
    line[..end].to_string()
}

impl Material {
    /// Returns the description of a fit of `captures`, one per layer, without the error figures.
    pub fn new(captures: &[&CaptureInfo], fit: FitRecord) -> Material {
        Material {
            name: captures.first().map(|info| shortened(&info.name, MAX_NAME)).unwrap_or_default(),
            layers: captures
                .iter()
                .map(|info| MaterialLayer {
                    capture: CaptureRecord::of(info),
                    views: info.views.len(),
                    lights: info.lights.len(),
                })
                .collect(),
            fit: Some(fit),
            error: None,
        }
    }

    /// Reads the description of `asset`.
    ///
    /// # Errors
    /// If it is not JSON or a known key has a value of another type. Absent and unknown keys are fine.
    pub fn from_asset(asset: &Asset) -> Result<Material, FitError> {
        Material::from_text(&asset.material)
    }

    /// Reads a description from its JSON text.
    ///
    /// # Errors
    /// As [`Material::from_asset`].
    pub fn from_text(text: &str) -> Result<Material, FitError> {
        serde_json::from_str(text).map_err(|error| {
            FitError::Params(format!(
                "the asset's material description is not understood ({error}); it was written by a faulty program"
            ))
        })
    }

    /// Returns the JSON that an asset holds. Equal descriptions give equal texts.
    pub fn to_json(&self) -> String {
        // Plain data of numbers and strings: serialising cannot fail.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Returns the capture that layer `number` of `asset` was fitted from, as far as the asset tells: directions as the
    /// file names had them, in the frame of the face that is seen, and conventions from this description or, where it
    /// has none, those of a capture without `capture.toml`.
    ///
    /// # Errors
    /// If a convention is a word that is not known.
    pub fn capture_info(&self, asset: &Asset, number: usize) -> Result<CaptureInfo, FitError> {
        let layer = &asset.layers[number];
        let record = self.layers.get(number).map_or_else(
            || CaptureRecord { side: side_of_layer(layer).to_string(), ..CaptureRecord::default() },
            |layer| layer.capture.clone(),
        );
        // What a decoder goes by; the record is for people.
        let side = side_of_layer(layer);
        let name = if record.name.is_empty() { self.name.clone() } else { record.name };
        let (views, lights) = capture_directions(layer, side)?;
        let format: ImageFormat = record.format.parse()?;
        Ok(CaptureInfo {
            transfer: record.transfer.parse()?,
            cosine: record.cosine.parse()?,
            scale: record.scale,
            side,
            size_mm: asset.size_mm,
            provenance: record.provenance,
            ..CaptureInfo::new(name, asset.width, asset.height, views, lights, format)
        })
    }
}

impl CaptureRecord {
    /// Returns the conventions of a capture.
    pub fn of(info: &CaptureInfo) -> CaptureRecord {
        CaptureRecord {
            name: shortened(&info.name, MAX_NAME),
            transfer: info.transfer.to_string(),
            scale: info.scale,
            cosine: info.cosine.to_string(),
            side: info.side.to_string(),
            format: info.format.to_string(),
            provenance: shortened(&info.provenance, MAX_PROVENANCE),
            missing: info.missing.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample_asset::sample_asset;
    use btf_capture::DirectionSet;
    use btf_runtime::SurfaceSide;

    fn info() -> CaptureInfo {
        let set = DirectionSet::bonn81();
        CaptureInfo {
            transfer: Transfer::Gamma(2.2),
            scale: 0.1,
            size_mm: Some([20.0, 12.5]),
            provenance: "a test".into(),
            ..CaptureInfo::new("cloth", 4, 4, set.clone(), set, ImageFormat::Png)
        }
    }

    #[test]
    fn the_number_of_predicted_pairs_is_told_where_there_are_any() {
        let told = |missing: Vec<usize>| {
            serde_json::to_string(&CaptureRecord::of(&CaptureInfo { missing, ..info() })).unwrap()
        };
        assert!(told(vec![3, 8]).contains(r#""missing":2"#));
        assert!(!told(Vec::new()).contains("missing"));
        // Assets of before say nothing of it.
        assert_eq!(serde_json::from_str::<CaptureRecord>("{}").unwrap().missing, 0);
    }

    #[test]
    fn a_description_is_read_back_whole_and_holds_no_path_time_or_thread_count() {
        let params = FitParams { cache_directory: "/somewhere/secret".into(), ..FitParams::default() };
        let material = Material::new(&[&info()], FitRecord::new(&params, 5));
        let text = material.to_json();
        assert!(!text.contains("secret") && !text.contains("memory") && !text.contains("thread"), "{text}");
        let asset = Asset { material: text, ..sample_asset() };
        assert_eq!(Material::from_asset(&asset).unwrap(), material);
        assert_eq!(material.layers[0].capture.transfer, "gamma:2.2");
    }

    #[test]
    fn a_foreign_description_is_read_as_far_as_it_goes_and_nonsense_is_refused() {
        let read = |text: &str| Material::from_asset(&Asset { material: text.into(), ..sample_asset() });
        let foreign = read(r#"{"name":"x","artist":"y"}"#).unwrap();
        assert_eq!((foreign.name.as_str(), foreign.layers.len()), ("x", 0));
        let message = read(r#"{"name":7}"#).unwrap_err().to_string();
        assert!(message.contains("material description"), "{message}");
    }

    #[test]
    fn a_long_provenance_does_not_outgrow_the_reserve() {
        let long = CaptureInfo { name: "\"é".repeat(500), provenance: "\n\"é€".repeat(500), ..info() };
        let params = FitParams { bytes: Some(u64::MAX), leave_out: 0.123_456_789, ..FitParams::default() };
        let error = Metrics {
            psnr_db: 34.123_456_789,
            psnr_linear_db: 34.123_456_789,
            rel_rmse: 1.234_567_89e-5,
            worst_texel_rmse: 1.234_567_89e-5,
            energy_ratio: 0.987_654_321,
            delta_e00_mean: Some(1.234_567_89e-5),
            tone_curve: None,
        };
        let material = Material::new(&[&long, &long, &long, &long], FitRecord::new(&params, 64));
        let before = material.to_json().len();
        let text = Material { error: Some(error.rounded()), ..material }.to_json();
        assert!(text.len() < before + crate::pipeline::description::FIGURES_RESERVE - 32, "{} {before}", text.len());
        assert!(text.len() < 4096, "{}", text.len());
        assert!(text.contains("\\\"é"), "the text is cut between letters: {text}");
    }

    #[test]
    fn the_capture_of_a_layer_has_its_conventions_and_directions() {
        let asset = sample_asset();
        let material = Material { layers: vec![MaterialLayer::default()], ..Material::default() };
        let found = material.capture_info(&asset, 0).unwrap();
        assert_eq!((found.width, found.height), (asset.width, asset.height));
        assert_eq!(found.views.len(), asset.layers[0].views.len());
        let mut through = asset.clone();
        through.layers[0].light_side = SurfaceSide::Back;
        let found = Material::default().capture_info(&through, 0).unwrap();
        assert_eq!(found.side, Side::TransmissionBack);
        assert!(found.lights.directions().iter().all(|d| d.theta_deg > 90.0));
        assert!(found.views.directions().iter().all(|d| d.theta_deg < 90.0));
    }
}
