//! Pairs of a capture whose lights are there several times, one round after the other: once for each group of channels of a
//! capture in bands, else once.

use crate::resume::stored::stored_structs;
use btf_capture::DirectionSet;

/// Rounds of the lights of a capture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rounds {
    /// Lights of a round.
    pub lights: usize,
    /// Number of rounds.
    pub count: usize,
}

stored_structs! {
    Rounds { lights, count }
}

impl Rounds {
    /// Returns the rounds of a set of lights.
    pub fn of(lights: &DirectionSet) -> Rounds {
        let count = lights.rounds();
        Rounds { lights: lights.len() / count, count }
    }

    /// Returns the number of a pair in round `round`, for its number `view * lights + light` with the lights of one round.
    pub fn place(self, pair: usize, round: usize) -> usize {
        pair / self.lights * self.lights * self.count + round * self.lights + pair % self.lights
    }

    /// Returns the number of a pair with the lights of one round, if it is in the first round.
    pub fn in_first(self, pair: usize) -> Option<usize> {
        let (view, light) = (pair / (self.lights * self.count), pair % (self.lights * self.count));
        (light < self.lights).then_some(view * self.lights + light)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_of_the_first_round_have_a_place_in_every_round() {
        let rounds = Rounds { lights: 5, count: 3 };
        assert_eq!([0, 1, 2].map(|round| rounds.place(7, round)), [17, 22, 27]);
        assert_eq!([17, 22, 27].map(|pair| rounds.in_first(pair)), [Some(7), None, None]);
        assert_eq!(Rounds::of(&DirectionSet::bonn81()), Rounds { lights: 81, count: 1 });
        let once = Rounds { lights: 81, count: 1 };
        assert_eq!((once.place(100, 0), once.in_first(100)), (100, Some(100)));
    }
}
