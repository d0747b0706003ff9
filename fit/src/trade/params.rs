//! Parameters of a trade.

use crate::error::FitError;
use crate::gpu::device::GpuChoice;
use crate::params::{FitParams, Role};
use btf_runtime::MAX_COMPONENTS;

/// Settings of a trade and how they are measured.
#[derive(Debug, Clone)]
pub struct TradeParams {
    /// Parameters of the fits. Their bytes, PSNR, lobes, role, components and share left out do not count.
    pub fit: FitParams,
    /// Numbers of lobes, as `--lobes` of a fit.
    pub lobes: Vec<usize>,
    /// Roles that lobes are tried in. Without lobes there is no role, and one sweep.
    pub roles: Vec<Role>,
    /// Limits of components, tried while encoding and while decoding, beside no limit.
    pub components: Vec<usize>,
    /// Steps per bit: 1 for a factor of two between steps.
    pub steps_per_bit: usize,
    /// Largest asset; `None`: 64 bytes a texel and 200 kB.
    pub most_bytes: Option<u64>,
    /// About how many pairs each point is measured on, 1 to 256.
    pub pairs: usize,
    /// Random evaluations per timed pass.
    pub evaluations: usize,
    /// Timed passes, of which the least time is taken.
    pub repeats: usize,
    /// Adapter to time on as well.
    pub gpu: GpuChoice,
}

impl Default for TradeParams {
    fn default() -> TradeParams {
        TradeParams {
            fit: FitParams::default(),
            lobes: vec![0, 2, 8],
            roles: vec![Role::Guide, Role::Base],
            components: vec![4, 16, 32],
            steps_per_bit: 1,
            most_bytes: None,
            pairs: 64,
            evaluations: 2048,
            repeats: 5,
            gpu: GpuChoice::Best,
        }
    }
}

impl TradeParams {
    /// Returns the parameters of a coarse grid: two numbers of lobes, one limit of components, fewer pairs.
    pub fn quick() -> TradeParams {
        TradeParams {
            lobes: vec![0, 2],
            components: vec![8],
            pairs: 32,
            evaluations: 1024,
            repeats: 3,
            ..TradeParams::default()
        }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// One sentence that names the option.
    pub fn check(&self) -> Result<(), FitError> {
        let refuse = |text: &str| Err(FitError::Params(text.to_string()));
        if self.lobes.is_empty() || self.lobes.iter().any(|lobes| *lobes > 32) {
            return refuse("--lobes must be numbers from 0 to 32, as in 0,1,2,4");
        }
        if self.roles.is_empty() {
            return refuse("--roles must be guide, base or both");
        }
        if self.components.iter().any(|components| *components > MAX_COMPONENTS) {
            return refuse(&format!("--components must be numbers from 0 to {MAX_COMPONENTS}, as in 4,8,16"));
        }
        if !(1..=256).contains(&self.pairs) {
            return refuse("--pairs must be 1 to 256");
        }
        if !(1..=8).contains(&self.steps_per_bit) {
            return refuse("--steps-per-bit must be 1 to 8");
        }
        self.fit.check().map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_out_of_range_is_named() {
        let refused = |params: TradeParams| params.check().unwrap_err().to_string();
        TradeParams::default().check().unwrap();
        TradeParams::quick().check().unwrap();
        assert!(refused(TradeParams { lobes: Vec::new(), ..TradeParams::default() }).contains("--lobes"));
        assert!(refused(TradeParams { lobes: vec![33], ..TradeParams::default() }).contains("--lobes"));
        assert!(
            refused(TradeParams { components: vec![MAX_COMPONENTS + 1], ..TradeParams::default() })
                .contains("--components")
        );
        assert!(refused(TradeParams { roles: Vec::new(), ..TradeParams::default() }).contains("--roles"));
        assert!(refused(TradeParams { pairs: 0, ..TradeParams::default() }).contains("--pairs"));
        assert!(refused(TradeParams { steps_per_bit: 0, ..TradeParams::default() }).contains("--steps-per-bit"));
    }
}
