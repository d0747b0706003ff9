//! The options of every command that renders: backend, decoder, light, threads.

use super::parse::parse_positive;
use btf_capture::{bytes_from_text, text_from_bytes};
use btf_runtime::{DecodeOptions, HeightUse, Interpolation, PackedGoal};
use btf_viewer::{BackendChoice, Filter, GpuTracer, RenderMode, SceneAsset, ShadeOptions, SkyLight, ViewerError};
use clap::ValueEnum;
use std::sync::Arc;

/// Options of every command that renders.
#[derive(clap::Args)]
pub(super) struct RenderArguments {
    /// What traces rays and decodes
    #[arg(long, value_enum, default_value_t = BackendName::Auto)]
    pub(super) backend: BackendName,
    /// Part of the name of the adapter to use, where there are several
    #[arg(long, value_name = "NAME")]
    pub(super) adapter: Option<String>,
    /// Residual components at most [default: all]
    #[arg(long, value_name = "N")]
    pub(super) components: Option<u32>,
    /// Lobes per texel at most [default: all]
    #[arg(long, value_name = "N")]
    pub(super) lobes: Option<u32>,
    /// How the residual is carried between measured directions
    #[arg(long, value_enum, default_value_t = InterpolationName::Fast)]
    pub(super) interpolation: InterpolationName,
    /// Leave the parallax of eyes beyond the measured views, also where an asset has heights
    #[arg(long)]
    pub(super) no_parallax: bool,
    /// Do not correct the interpolation between measured directions by an asset's heights
    #[arg(long)]
    pub(super) no_relief: bool,
    /// Which light is followed: straight from lamps and surroundings, or on any way
    #[arg(long, value_enum, default_value_t = RenderMode::Direct)]
    pub(super) mode: RenderMode,
    /// Point lights of which a frame asks at most; of more it draws those that matter
    #[arg(long, value_name = "N", default_value_t = ShadeOptions::default().light_samples,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(btf_viewer::MAX_LIGHT_SAMPLES)))]
    pub(super) light_samples: u32,
    /// Rays of a path at most: 1 shows no mirror images
    #[arg(long, value_name = "N", default_value_t = ShadeOptions::default().depth,
          value_parser = clap::value_parser!(u32).range(1..=i64::from(btf_viewer::MAX_DEPTH)))]
    pub(super) depth: u32,
    /// Always the finest texels, however small they are in the picture
    #[arg(long)]
    pub(super) no_levels: bool,
    /// Which of an asset's texels are shaded: the nearest, or one of the four around, in the mean their interpolation
    #[arg(long, value_enum, default_value_t = Filter::default())]
    pub(super) filter: Filter,
    /// How a sky lights surfaces: by rays to its parts, or by the irradiance of the normal times how much is open
    #[arg(long, value_enum, default_value_t = SkyLight::Rays)]
    pub(super) sky: SkyLight,
    /// Adds light after one bounce from a grid with so many cells along the scene's longest side, in place of --mode path
    #[arg(long, value_name = "CELLS",
          value_parser = clap::value_parser!(u32).range(1..=i64::from(btf_viewer::MAX_IRRADIANCE_CELLS)))]
    pub(super) irradiance_volume: Option<u32>,
    /// Hold each asset with packed bases in at most this size of memory, such as 15MB
    #[arg(long, value_name = "SIZE", value_parser = bytes_from_text)]
    pub(super) resident_bytes: Option<u64>,
    /// Hold each asset with packed bases, whose residual departs from the whole asset's by this PSNR, dB
    #[arg(long, value_name = "DB", value_parser = parse_positive, conflicts_with = "resident_bytes")]
    pub(super) resident_psnr: Option<f32>,
    /// Megabytes that volumes take in memory at most: bricks of volumes of more than 128 voxels a side are loaded as fine
    /// as the picture shows them, or coarser
    #[arg(long, value_name = "MB", default_value_t = btf_viewer::USUAL_VOLUME_BUDGET_MB)]
    pub(super) volume_budget: u32,
    /// Threads of the CPU decoder [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(super) threads: Option<u32>,
    /// Prints nothing but errors
    #[arg(long)]
    pub(super) quiet: bool,
}

impl RenderArguments {
    pub(super) fn shade(&self) -> ShadeOptions {
        let decode = DecodeOptions {
            components: self.components.unwrap_or(u32::MAX),
            lobes: self.lobes.unwrap_or(u32::MAX),
            interpolation: match self.interpolation {
                InterpolationName::Fast => Interpolation::Fast,
                InterpolationName::Exact => Interpolation::Exact,
            },
            heights: HeightUse::unless(self.no_parallax, self.no_relief),
        };
        ShadeOptions {
            decode,
            mode: self.mode,
            light_samples: self.light_samples,
            depth: self.depth,
            levels: !self.no_levels,
            filter: self.filter,
            sky: self.sky,
            irradiance_cells: self.irradiance_volume.unwrap_or(0),
        }
    }

    /// Returns how assets are to be packed, if they are.
    pub(super) fn packing(&self) -> Option<PackedGoal> {
        let bytes = self.resident_bytes.map(PackedGoal::Bytes);
        bytes.or_else(|| self.resident_psnr.map(PackedGoal::of_psnr))
    }

    /// Packs assets, where the options ask for it.
    ///
    /// # Errors
    /// [`ViewerError::Usage`] for an asset that takes more bytes than it may.
    pub(super) fn pack(&self, assets: &mut [Arc<SceneAsset>]) -> Result<(), ViewerError> {
        let Some(goal) = self.packing() else { return Ok(()) };
        for asset in assets {
            *asset = Arc::new(asset.packed(goal));
            let bytes = 4 * asset.head().words().len() as u64;
            if self.resident_bytes.is_some_and(|most| bytes > most) {
                return Err(ViewerError::Usage(format!(
                    "{} takes {} in memory at least, its mip levels included; allow that with --resident-bytes",
                    asset.name,
                    text_from_bytes(bytes)
                )));
            }
        }
        Ok(())
    }

    pub(super) fn backend(&self) -> BackendChoice {
        match self.backend {
            BackendName::Auto => BackendChoice::Auto,
            BackendName::RayQuery => BackendChoice::Gpu(GpuTracer::RayQuery),
            BackendName::Bvh => BackendChoice::Gpu(GpuTracer::Bvh),
            BackendName::Cpu => BackendChoice::Cpu,
        }
    }
}

#[derive(Clone, Copy, ValueEnum)]
pub(super) enum BackendName {
    Auto,
    RayQuery,
    Bvh,
    Cpu,
}

#[derive(Clone, Copy, ValueEnum)]
pub(super) enum InterpolationName {
    Fast,
    Exact,
}
