//! Parametric, bracketed, stochastic L-systems without context [Prusinkiewicz & Lindenmayer 1990, sections 1.6, 1.7,
//! 1.10].
//!
//! A word is a string of modules, each a symbol with its parameters. In a derivation step all modules are rewritten at
//! once, from left to right, by the production that fits them; a module without a fitting production stays. Productions
//! are one Rust function from a module to its successor: its `match` is the list of predecessors and conditions, and
//! random numbers from a seeded generator make it stochastic. Brackets are [`Command::Push`] and [`Command::Pop`]: the
//! turtle reads them, rewriting copies them.
//!
//! When it is wrong: productions see no neighbours (context-sensitive systems), and neither light nor other organs.

use crate::plants::turtle::Command;

/// Module of a word: a symbol of the species, or a command to the turtle.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Module<S> {
    /// Symbol that is rewritten, and ignored by the turtle.
    Symbol(S),
    /// Command that the turtle reads, and that is never rewritten.
    Draw(Command),
}

/// Returns the word after `steps` derivation steps from `axiom`. `produce` returns the successor of a symbol, or `None`
/// where no production fits.
///
/// Cost: the sum of the lengths of all words.
pub(crate) fn derive<S: Clone>(
    axiom: Vec<Module<S>>,
    steps: usize,
    mut produce: impl FnMut(&S) -> Option<Vec<Module<S>>>,
) -> Vec<Module<S>> {
    let mut word = axiom;
    for _ in 0..steps {
        let mut next = Vec::with_capacity(word.len());
        for module in word {
            let successor = match &module {
                Module::Symbol(symbol) => produce(symbol),
                Module::Draw(_) => None,
            };
            match successor {
                Some(successor) => next.extend(successor),
                None => next.push(module),
            }
        }
        word = next;
    }
    word
}

/// Returns the commands of a word, without its symbols.
pub(crate) fn commands<S>(word: Vec<Module<S>>) -> impl Iterator<Item = Command> {
    word.into_iter().filter_map(|module| match module {
        Module::Draw(command) => Some(command),
        Module::Symbol(_) => None,
    })
}

#[cfg(test)]
mod tests {
    use rand::{Rng, SeedableRng};
    use rand_xoshiro::Xoshiro256PlusPlus;

    use super::*;
    use crate::plants::plant::Part;
    use crate::plants::turtle::interpret;

    fn symbols(word: &[Module<char>]) -> String {
        let letter = |module: &Module<char>| match module {
            Module::Symbol(letter) => *letter,
            Module::Draw(Command::Push) => '[',
            Module::Draw(Command::Pop) => ']',
            Module::Draw(_) => '.',
        };
        word.iter().map(letter).collect()
    }

    fn word(text: &str) -> Vec<Module<char>> {
        text.chars()
            .map(|letter| match letter {
                '[' => Module::Draw(Command::Push),
                ']' => Module::Draw(Command::Pop),
                letter => Module::Symbol(letter),
            })
            .collect()
    }

    /// Lindenmayer's filament of algae [section 1.2]: a and b, right and left.
    #[test]
    fn the_filament_of_algae_grows_as_in_the_book() {
        let grow = |steps| {
            let filament = derive(word("b"), steps, |letter| match letter {
                'a' => Some(word("ab")),
                'b' => Some(word("a")),
                _ => None,
            });
            symbols(&filament)
        };
        assert_eq!([0, 1, 2, 3, 4].map(grow), ["b", "a", "ab", "aba", "abaab"]);
        // Fibonacci's numbers.
        assert_eq!((grow(15).len(), grow(16).len()), (987, 1597));
    }

    /// Section 1.10's parametric system: A(x, y) and B(x) with conditions on the parameters.
    #[test]
    fn parameters_and_conditions_derive_the_books_sequence() {
        #[derive(Debug, Clone, PartialEq)]
        enum Symbol {
            A(i32, i32),
            B(i32),
            C,
        }
        use Symbol::{A, B, C};
        let produce = |symbol: &Symbol| {
            let successor = match *symbol {
                A(x, y) if y <= 3 => vec![A(x * 2, x + y)],
                A(x, y) => vec![B(x), A(x / y, 0)],
                B(x) if x < 1 => vec![C],
                B(x) => vec![B(x - 1)],
                C => return None,
            };
            Some(successor.into_iter().map(Module::Symbol).collect())
        };
        let axiom: Vec<Module<Symbol>> = [B(2), A(4, 4)].map(Module::Symbol).into();
        let of = |symbols: &[Symbol]| symbols.iter().cloned().map(Module::Symbol).collect::<Vec<_>>();
        assert_eq!(derive(axiom.clone(), 1, produce), of(&[B(1), B(4), A(1, 0)]));
        assert_eq!(derive(axiom.clone(), 2, produce), of(&[B(0), B(3), A(2, 1)]));
        assert_eq!(derive(axiom.clone(), 3, produce), of(&[C, B(2), A(4, 3)]));
        assert_eq!(derive(axiom, 4, produce), of(&[C, B(1), A(8, 7)]));
    }

    /// Figure 1.24a's bush, F -> F[+F]F[-F]F, by counts and by the turtle's end points.
    #[test]
    fn a_bracketed_bush_is_drawn_as_in_the_book() {
        let bush = derive(word("F"), 3, |letter| match letter {
            'F' => Some(word("F[+F]F[-F]F")),
            _ => None,
        });
        let text = symbols(&bush);
        let count = |letter: char| text.chars().filter(|found| *found == letter).count();
        // 5^3 segments, and (5^3 - 1) / 4 pairs of branches.
        assert_eq!((count('F'), count('['), count('+'), count('-')), (125, 62, 31, 31));
        let commands = bush.into_iter().map(|module| match module {
            Module::Symbol('F') => Command::Stem { length_m: 1.0, radius_m: 0.1 },
            Module::Symbol('+') => Command::Turn(25.7f64.to_radians()),
            Module::Symbol(_) => Command::Turn(-25.7f64.to_radians()),
            Module::Draw(command) => command,
        });
        // A branch is an axis of its own.
        let branched = commands.flat_map(|command| match command {
            Command::Push => vec![command, Command::Axis { part: Part::Stem, radius_m: 0.1 }],
            _ => vec![command],
        });
        let start = Command::Axis { part: Part::Stem, radius_m: 0.1 };
        let plant = interpret(std::iter::once(start).chain(branched));
        let cones: usize = plant.axes.iter().map(|axis| axis.nodes.len() - 1).sum();
        assert_eq!((plant.axes.len(), cones), (63, 125));
        // The main stem: three to the power of three segments, straight up.
        let top = plant.axes[0].nodes.last().unwrap().position_m;
        assert!((top[1] - 27.0).abs() < 1e-9 && top[0].abs() < 1e-9 && top[2].abs() < 1e-9);
        // All in one plane: turns are about one axis.
        assert!(plant.axes.iter().flat_map(|axis| &axis.nodes).all(|node| node.position_m[2].abs() < 1e-9));
    }

    #[test]
    fn a_seed_gives_one_word() {
        let grow = |seed: u64| {
            let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
            let stochastic = derive(word("F"), 5, |letter| match letter {
                'F' if random.gen_bool(0.5) => Some(word("F[+F]F")),
                'F' => Some(word("F[-F]F")),
                _ => None,
            });
            symbols(&stochastic)
        };
        assert_eq!(grow(1), grow(1));
        assert_ne!(grow(1), grow(2));
    }
}
