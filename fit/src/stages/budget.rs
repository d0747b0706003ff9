//! Search of the quantisers' step for a size: everything else follows from the step, so that one number is searched.

/// Evaluations that a search gets at most.
pub const SEARCH_ROUNDS: usize = 9;
/// Share below the limit within which a size ends the search.
const CLOSE: f64 = 0.005;
/// log2 of the finest and of the coarsest step relative to the greatest coefficient.
const FINEST: f64 = -24.0;
const COARSEST: f64 = 2.0;

/// Result of evaluating a step: its bytes and the thing itself.
pub struct Candidate<T> {
    /// Bytes.
    pub bytes: usize,
    /// Thing that was made.
    pub value: T,
}

/// Returns the finest step whose outcome has at most `limit` bytes, as far as a bracketed search over powers of two of
/// `greatest` (the size of the greatest coefficient) from `first` on finds it: sizes fall about inversely with the step. `Err` holds
/// the least size where even the coarsest step gives more.
pub fn within_bytes<T, E>(
    limit: usize,
    greatest: f64,
    first: f64,
    mut make: impl FnMut(f64) -> Result<Candidate<T>, E>,
) -> Result<Result<Candidate<T>, usize>, E> {
    let greatest = greatest.max(1e-12);
    // log2 of the finest step known to fit and of the coarsest known not to.
    // Each with log2 of its size over the limit.
    let mut fits: Option<(f64, f64)> = None;
    let mut exceeds: Option<(f64, f64)> = None;
    let mut best: Option<Candidate<T>> = None;
    let mut at = first.clamp(FINEST, COARSEST);
    let mut previous: Option<(f64, f64)> = None;
    for round in 0..SEARCH_ROUNDS {
        let candidate = make(greatest * at.exp2())?;
        let ratio = candidate.bytes as f64 / limit.max(1) as f64;
        if candidate.bytes <= limit {
            fits = fits.filter(|fits| fits.0 <= at).or(Some((at, ratio.log2())));
            let better = best.as_ref().is_none_or(|best| candidate.bytes >= best.bytes);
            if better {
                best = Some(candidate);
            }
            if ratio >= 1.0 - CLOSE || at <= FINEST {
                break;
            }
        } else {
            exceeds = exceeds.filter(|exceeds| exceeds.0 >= at).or(Some((at, ratio.log2())));
            if at >= COARSEST {
                if best.is_none() {
                    return Ok(Err(candidate.bytes));
                }
                break;
            }
        }
        let next = match (exceeds, fits) {
            // A little below the limit on the line between the two, so that the next one is likely to fit.
            (Some((low, above)), Some((high, below))) => {
                let along = (above + 0.5 * CLOSE) / (above - below).max(1e-12);
                low + (high - low) * along.clamp(0.05, 0.95)
            }
            // Never fits so far: the coarsest there is, before the rounds are over.
            (Some(_), None) if round + 2 >= SEARCH_ROUNDS => COARSEST,
            _ => {
                let slope = previous.map_or(1.0, |(x, y): (f64, f64)| (y - ratio.log2()) / (at - x));
                (at + ((ratio.log2() + 0.5 * CLOSE) / slope.clamp(0.2, 3.0)).clamp(-4.0, 4.0)).clamp(FINEST, COARSEST)
            }
        };
        previous = Some((at, ratio.log2()));
        if next == at {
            break;
        }
        at = next;
    }
    match best {
        Some(best) => Ok(Ok(best)),
        None => {
            let last = make(greatest * COARSEST.exp2())?;
            Ok(if last.bytes <= limit { Ok(last) } else { Err(last.bytes) })
        }
    }
}

/// Returns the mean squared error in the root domain at which `psnr_db` is `db`: the 8-bit code is about
/// `255 (1.055 g - 0.055)`, and rounding adds 1/12.
pub fn error_for_psnr(db: f64) -> f64 {
    let code_error = 255.0f64.powi(2) / 10f64.powf(db / 10.0);
    (code_error - 1.0 / 12.0).max(1e-3) / (255.0f64 * 1.055).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn search(limit: usize, size: impl Fn(f64) -> f64) -> Result<f64, usize> {
        let make = |step: f64| Ok::<_, ()>(Candidate { bytes: size(step) as usize, value: step });
        within_bytes(limit, 100.0, -5.0, make).unwrap().map(|found| found.value)
    }

    #[test]
    fn the_size_is_nearly_filled_whatever_the_curve() {
        for (name, size) in [
            ("inverse", Box::new(|step: f64| 1e3 + 5e6 / step) as Box<dyn Fn(f64) -> f64>),
            ("steep", Box::new(|step: f64| 500.0 + 9e6 / step.powf(1.7))),
            ("flat", Box::new(|step: f64| 700.0 + 2e5 / step.powf(0.5))),
        ] {
            for limit in [20_000, 100_000, 900_000] {
                let step = search(limit, &size).unwrap();
                let bytes = size(step) as usize;
                assert!(bytes <= limit && bytes as f64 > 0.97 * limit as f64, "{name} {limit}: {bytes}");
            }
        }
    }

    #[test]
    fn what_cannot_be_small_enough_tells_its_least_size() {
        assert_eq!(search(900, |step| 1e3 + 1e3 / step), Err(1002));
    }

    #[test]
    fn what_is_always_small_enough_gets_the_finest_step() {
        let step = search(1_000_000, |step| 3e3 + 10.0 * (100.0 / step).log2()).unwrap();
        assert!(step < 100.0 * 2f64.powf(-20.0), "{step}");
    }
}
