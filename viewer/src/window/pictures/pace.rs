//! How much of a picture is drawn at once on a page. A browser's graphics process does one thing after the other: while it
//! draws for long, nothing on any page moves. A picture is therefore drawn in bands that take little time each; and one that a
//! slow adapter does not draw in time comes coarsely first, so that the camera is followed.

use super::stand_in::shrunk;

/// Time that bands which are drawn together may take, milliseconds.
const BAND_MS: f64 = 25.0;
/// Time that the first, coarse sample of a picture may take, milliseconds.
const COARSE_MS: f64 = 40.0;
/// Time of a picture that is drawn at once, milliseconds.
const AT_ONCE_MS: f64 = 60.0;
/// Pixels of a picture while it is not known how long they take.
const FIRST_PIXELS: u32 = 64 * 64;
/// Weight of the newest time.
const WEIGHT: f64 = 0.4;
/// Bands of a picture that is not drawn at once.
const BANDS: u64 = 64;

/// Times of a tracer's pixels, and whether the picture at hand is the coarse one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pace {
    /// `None` before the first time.
    ms_per_pixel: Option<f64>,
    is_coarse: bool,
    /// The area of the picture at hand and its size, which does not change before the next picture.
    settled: Option<[[u32; 2]; 2]>,
}

impl Default for Pace {
    fn default() -> Pace {
        Pace { ms_per_pixel: None, is_coarse: true, settled: None }
    }
}

impl Pace {
    /// Notes that the picture begins anew: coarsely, where it must.
    pub fn restart(&mut self) {
        (self.is_coarse, self.settled) = (true, None);
    }

    /// Notes that a sample is complete; returns `true` if the next one is of a finer picture.
    pub fn refine(&mut self, view: [u32; 2]) -> bool {
        let was_coarse = self.size(view) != view;
        (self.is_coarse, self.settled) = (false, None);
        was_coarse
    }

    /// Notes how long some pixels took.
    pub fn note(&mut self, pixels: u64, ms: f64) {
        let new = ms / pixels.max(1) as f64;
        self.ms_per_pixel = Some(self.ms_per_pixel.map_or(new, |old| old + WEIGHT * (new - old)));
    }

    /// Returns the size of the picture to draw for an area of `view` pixels.
    pub fn size(&mut self, view: [u32; 2]) -> [u32; 2] {
        if let Some([of, size]) = self.settled
            && of == view
        {
            return size;
        }
        let size = self.next_size(view);
        self.settled = Some([view, size]);
        size
    }

    fn next_size(&self, view: [u32; 2]) -> [u32; 2] {
        match self.ms_per_pixel {
            _ if !self.is_coarse => view,
            None => shrunk(view, FIRST_PIXELS),
            Some(ms) if ms * pixels(view) as f64 <= AT_ONCE_MS => view,
            // Few sizes, so that buffers are seldom made anew.
            Some(ms) => shrunk(view, ((COARSE_MS / ms) as u32).clamp(FIRST_PIXELS, u32::MAX / 2).next_power_of_two()),
        }
    }

    /// Returns the pixels of a band of a picture of this size at most. Pictures keep their bands; how many are drawn together
    /// follows the times.
    pub fn band_pixels(&self, size: [u32; 2]) -> u64 {
        match self.ms_per_pixel {
            Some(ms) if ms * pixels(size) as f64 > AT_ONCE_MS => pixels(size).div_ceil(BANDS),
            _ => pixels(size),
        }
    }

    /// Returns the pixels to draw together.
    pub fn pixels_at_once(&self) -> u64 {
        self.ms_per_pixel.map_or(FIRST_PIXELS.into(), |ms| (BAND_MS / ms) as u64)
    }
}

fn pixels(size: [u32; 2]) -> u64 {
    u64::from(size[0]) * u64::from(size[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    const VIEW: [u32; 2] = [1000, 600];

    #[test]
    fn a_fast_adapter_draws_everything_at_once_as_soon_as_that_is_known() {
        let mut pace = Pace::default();
        assert!(pixels(pace.size(VIEW)) <= u64::from(FIRST_PIXELS));
        pace.note(4096, 0.3);
        assert!(pace.refine(VIEW) && pace.size(VIEW) == VIEW && !pace.refine(VIEW));
        pace.restart();
        assert_eq!((pace.size(VIEW), pace.band_pixels(VIEW)), (VIEW, 600_000));
    }

    #[test]
    fn a_slow_adapter_begins_coarsely_and_goes_on_in_bands() {
        let mut pace = Pace::default();
        assert!(pixels(pace.size(VIEW)) <= u64::from(FIRST_PIXELS));
        pace.note(4096, 40.0);
        // Only the next picture is of another size.
        assert!(pixels(pace.size(VIEW)) <= u64::from(FIRST_PIXELS));
        pace.restart();
        let coarse = pace.size(VIEW);
        assert!(pixels(coarse) < 10_000 && pixels(coarse) > 2000, "{coarse:?}");
        assert_eq!(pace.band_pixels(coarse), pixels(coarse));
        assert!(pace.refine(VIEW) && pace.size(VIEW) == VIEW && !pace.refine(VIEW));
        let bands = pixels(VIEW).div_ceil(pace.band_pixels(VIEW));
        assert_eq!(bands, BANDS);
        assert!((1000..10_000).contains(&pace.pixels_at_once()));
        pace.restart();
        assert_eq!(pace.size(VIEW), coarse);
    }
}
