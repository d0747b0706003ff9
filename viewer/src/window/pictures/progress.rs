//! How far a picture is, and how fast its samples are.

use super::side::Took;
use crate::gpu::results::timer::PassTimes;
use crate::options::ShadeOptions;
use crate::render::governor::Governor;

/// Weight of the newest frame in the shown frame time.
const FRAME_TIME_WEIGHT: f64 = 0.2;

/// Progress of a picture, and the time of its samples.
pub(crate) struct Progress {
    /// Samples per pixel that the picture has.
    pub samples: u32,
    /// Time of a frame, smoothed, milliseconds.
    pub frame_ms: Option<f64>,
    /// The newest frame by kind of pass.
    pub passes: Option<PassTimes>,
    /// What keeps a frame within the user's budget, where there is one.
    pub governor: Option<Governor>,
    /// The panel's settings within the budget, of the picture at hand.
    pub governed: ShadeOptions,
    /// Why the renderer stopped, if it did.
    pub problem: Option<String>,
}

impl Progress {
    /// Makes the progress of a picture without samples.
    pub(crate) fn new(shade: ShadeOptions, governor: Option<Governor>) -> Progress {
        Progress { samples: 0, frame_ms: None, passes: None, governor, governed: shade, problem: None }
    }

    /// Forgets times and problems of a renderer that is not in use any more.
    pub(crate) fn forget_renderer(&mut self) {
        (self.frame_ms, self.passes, self.problem) = (None, None, None);
    }

    /// Settles with which settings the next samples are computed. Settings change with the picture only, so that its
    /// samples are alike.
    pub(crate) fn settle(&mut self, shade: &ShadeOptions, lights: u32) {
        if self.samples == 0 {
            self.governor.iter_mut().for_each(|governor| governor.set_lights(lights));
            self.governed = self.governor.as_ref().map_or(*shade, |it| it.settings(shade));
        }
    }

    /// Counts a sample that was added.
    pub(crate) fn count(&mut self, took: Took) {
        let Took { ms, passes } = took;
        self.passes = passes;
        self.governor.iter_mut().for_each(|governor| governor.observe(ms));
        let old = self.frame_ms.unwrap_or(ms);
        self.frame_ms = Some(old + FRAME_TIME_WEIGHT * (ms - old));
        self.samples += 1;
    }
}
