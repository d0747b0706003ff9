//! Pareto fronts: the points that nothing else beats in two measures at once.

/// A point's cost and gain. Neither may be NaN for the point to be on a front.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CostAndGain {
    /// Cost, as bytes or nanoseconds: less is better.
    pub cost: f64,
    /// Gain in decibels, which may be infinite: more is better.
    pub gain: f64,
}

/// Tells for each point whether it is on the front: no other point costs at most as much and gives at least as much,
/// and is better in one of the two [Pareto 1906]. Equal points are on the front together. Cost: a sort.
pub fn pareto_front(points: &[CostAndGain]) -> Vec<bool> {
    let mut order: Vec<usize> =
        (0..points.len()).filter(|i| !points[*i].cost.is_nan() && !points[*i].gain.is_nan()).collect();
    order.sort_by(|a, b| {
        let (a, b) = (&points[*a], &points[*b]);
        a.cost.total_cmp(&b.cost).then(b.gain.total_cmp(&a.gain))
    });
    let mut front = vec![false; points.len()];
    let mut best: Option<CostAndGain> = None;
    for i in order {
        if best.is_none_or(|best| points[i].gain > best.gain) {
            best = Some(points[i]);
        }
        front[i] = best == Some(points[i]);
    }
    front
}

/// Returns at most `most` of `items`, evenly spread, the first and the last among them.
pub(crate) fn spread<T: Copy>(items: &[T], most: usize) -> Vec<T> {
    let count = items.len().min(most);
    (0..count).map(|i| items[i * (items.len() - 1) / count.saturating_sub(1).max(1)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(cost: f64, gain: f64) -> CostAndGain {
        CostAndGain { cost, gain }
    }

    #[test]
    fn a_planted_dominated_point_is_not_on_the_front() {
        let mut points = vec![point(3.0, 33.0), point(1.0, 30.0), point(2.0, 32.0)];
        assert_eq!(pareto_front(&points), [true, true, true]);
        points.push(point(2.5, 31.9));
        assert_eq!(pareto_front(&points), [true, true, true, false]);
        // Beaten in one measure alone, on either side.
        points.extend([point(2.0, 31.0), point(2.1, 32.0)]);
        assert_eq!(pareto_front(&points), [true, true, true, false, false, false]);
    }

    #[test]
    fn the_front_is_what_comparing_all_with_all_gives() {
        let points: Vec<_> = (0..200).map(|i| point(f64::from(i * 7919 % 31), f64::from(i * 104_729 % 37))).collect();
        let beaten = |a: &CostAndGain| {
            points.iter().any(|b| b.cost <= a.cost && b.gain >= a.gain && (b.cost < a.cost || b.gain > a.gain))
        };
        let slow: Vec<bool> = points.iter().map(|a| !beaten(a)).collect();
        assert_eq!(pareto_front(&points), slow);
        assert!(slow.contains(&true) && slow.contains(&false));
    }

    #[test]
    fn points_without_a_figure_are_never_on_it_and_equal_ones_stand_together() {
        let nan = f64::NAN;
        let points = [point(nan, 30.0), point(1.0, nan), point(1.0, f64::INFINITY), point(1.0, f64::INFINITY)];
        assert_eq!(pareto_front(&points), [false, false, true, true]);
        assert_eq!(pareto_front(&[]), Vec::<bool>::new());
    }

    #[test]
    fn a_spread_keeps_both_ends() {
        assert_eq!(spread(&[1, 2, 3, 4, 5, 6, 7], 3), [1, 4, 7]);
        assert_eq!(spread(&[1, 2], 3), [1, 2]);
        assert_eq!(spread(&[1, 2], 1), [1]);
        assert!(spread::<u8>(&[], 3).is_empty());
    }
}
