//! Options that several subcommands share.

use super::failure::Failure;
use btf_fit::{Priors, Role, bytes_from_text, load_asset};
use btf_runtime::PackedGoal;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Options of every subcommand.
#[derive(Debug, Clone, Args)]
pub(super) struct Shared {
    /// Threads to compute on; all cores if not given. The result does not depend on it
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(super) threads: Option<u16>,
    /// Print nothing but errors and what --json asks for
    #[arg(long, global = true)]
    pub(super) quiet: bool,
}

/// Rule of interpolation between measured directions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Interpolation {
    /// Interpolate the residual, then add it to the lobes
    Fast,
    /// Decode the neighbours, interpolate those, follow the lobes between them
    Exact,
}

/// Options of decoding: numbers of components and lobes, and interpolation.
#[derive(Debug, Clone, Args)]
pub(super) struct Decoding {
    /// Use at most this many residual components
    #[arg(long, value_name = "N")]
    pub(super) components: Option<u32>,
    /// Use at most this many lobes per texel
    #[arg(long, value_name = "N")]
    pub(super) lobes: Option<u32>,
    /// Rule for directions that the asset has not measured
    #[arg(long, value_enum, default_value = "exact")]
    pub(super) interpolation: Interpolation,
    /// Leave the parallax of eyes beyond the measured views, also where the asset has heights
    #[arg(long)]
    pub(super) no_parallax: bool,
    /// Do not correct the interpolation between measured directions by the heights, also where the asset has them
    #[arg(long)]
    pub(super) no_relief: bool,
}

impl Decoding {
    pub(super) fn options(&self) -> btf_runtime::DecodeOptions {
        btf_runtime::DecodeOptions {
            components: self.components.unwrap_or(u32::MAX),
            lobes: self.lobes.unwrap_or(u32::MAX),
            interpolation: match self.interpolation {
                Interpolation::Fast => btf_runtime::Interpolation::Fast,
                Interpolation::Exact => btf_runtime::Interpolation::Exact,
            },
            heights: btf_runtime::HeightUse::unless(self.no_parallax, self.no_relief),
        }
    }
}

/// What is known of materials before a capture is seen.
#[derive(Debug, Clone, Args)]
pub(super) struct PriorsArg {
    /// Predict pairs without an image by what these assets have in common, in place of the priors that come with the
    /// program; fitted assets of similar materials predict best. `none`: by near directions alone
    #[arg(long, value_name = "ASSET.spmm", num_args = 1..)]
    priors: Vec<PathBuf>,
}

impl PriorsArg {
    /// Checks that the assets are there, also where nothing has to be predicted.
    pub(super) fn check(&self) -> Result<(), Failure> {
        for path in self.priors().files() {
            load_asset(path)?;
        }
        Ok(())
    }

    /// Returns the choice.
    pub(super) fn priors(&self) -> Priors {
        match &self.priors[..] {
            [] => Priors::BuiltIn,
            [none] if none.as_os_str() == "none" => Priors::Assets(Vec::new()),
            assets => Priors::Assets(assets.to_vec()),
        }
    }
}

/// How closely a resident form with packed bases keeps to the whole one.
#[derive(Debug, Clone, Args)]
pub(super) struct Packing {
    /// Pack the bases so that the whole resident form takes at most this size, such as 15MB
    #[arg(long, value_name = "SIZE", value_parser = bytes_from_text)]
    resident_bytes: Option<u64>,
    /// Pack the bases so that the residual at the measured pairs departs from the whole one's by this PSNR, dB
    #[arg(long, value_name = "DB", value_parser = parse_psnr, conflicts_with = "resident_bytes")]
    resident_psnr: Option<f32>,
}

impl Packing {
    /// Returns the goal; `None` where bases are not to be packed.
    pub(super) fn goal(&self) -> Option<PackedGoal> {
        let bytes = self.resident_bytes.map(PackedGoal::Bytes);
        bytes.or_else(|| self.resident_psnr.map(PackedGoal::of_psnr))
    }
}

fn parse_psnr(text: &str) -> Result<f32, String> {
    let db = text.parse().ok().filter(|db| (0.0..=200.0).contains(db));
    db.ok_or_else(|| "it is a number of dB from 0 to 200, as in 50".into())
}

/// [`Role`] on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum RoleName {
    /// The residual holds the whole value; one set of lobes for each cluster guides interpolation, sampling and editing
    Guide,
    /// Each texel has lobes of its own, and the residual is what they leave
    Base,
}

impl From<RoleName> for Role {
    fn from(name: RoleName) -> Role {
        match name {
            RoleName::Guide => Role::Guide,
            RoleName::Base => Role::Base,
        }
    }
}
