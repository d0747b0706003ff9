//! Leaf as a stack of plane interfaces, through which the random walk of the algorithmic models goes.
//!
//! The stack stands with its adaxial face up: z points out of it, interface 0 is the topmost. Between
//! interface i and i + 1 lies medium i, clear or mesophyll. Every interface has its own pair of indices
//! (in the 1997 model neighbouring interfaces disagree on the medium between them, see `abm97`) and
//! says for each of its four outcomes how the ray's direction is spread.

/// Spread of the direction of a ray about the ideal one: an exponentiated cosine, density `(e + 1) / (2 pi) cos^e`
/// about the ray [Baranoski 1997, eq. 5; eq. 6 is `e` = 1].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spread {
    /// No spread: mirror reflection, Snell's refraction.
    None,
    /// Spread with an exponent of at least 0; holds `1 / (exponent + 1)`.
    Cosine(InverseExponent),
}

/// Number `1 / (exponent + 1)`, which drawing from the lobe needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InverseExponent(pub(crate) f64);

impl Spread {
    /// Returns the lobe of this exponent: the oblateness of cells, 1 for a diffuse (cosine) lobe.
    pub fn exponent(exponent: f64) -> Spread {
        Spread::Cosine(InverseExponent(1.0 / (exponent + 1.0)))
    }

    /// Returns the cosine lobe, `acos(sqrt(xi))` [Baranoski 1997, eq. 6].
    pub fn diffuse() -> Spread {
        Spread::exponent(1.0)
    }
}

/// Plane between two media.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interface {
    /// Refractive index above.
    pub index_above: f64,
    /// Refractive index below.
    pub index_below: f64,
    /// Spread of a ray that came from above and is reflected.
    pub reflected_above: Spread,
    /// Spread of a ray that came from above and is transmitted below.
    pub refracted_below: Spread,
    /// Spread of a ray that came from below and is reflected.
    pub reflected_below: Spread,
    /// Spread of a ray that came from below and is transmitted above.
    pub refracted_above: Spread,
}

impl Interface {
    /// Returns an interface without spread.
    pub fn plain(index_above: f64, index_below: f64) -> Interface {
        Interface {
            index_above,
            index_below,
            reflected_above: Spread::None,
            refracted_below: Spread::None,
            reflected_below: Spread::None,
            refracted_above: Spread::None,
        }
    }
}

/// Medium between two interfaces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Medium {
    /// Medium that does not absorb.
    Clear,
    /// Whole pigmented tissue.
    Mesophyll,
    /// Upper part of the pigmented tissue: a share that is drawn for every ray, evenly from 0 to 1.
    UpperPart,
    /// Lower part of the pigmented tissue: the rest.
    LowerPart,
}

/// Treatment of a spread ray that would cross the interface which it has just left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Crossing {
    /// Draw again until the ray stays on its side, as the later code of the authors does.
    #[default]
    Resample,
    /// Mirror the ray at the interface.
    Mirror,
    /// Leave the ray unspread.
    Keep,
}

/// Length of a crossing at angle theta in units of the layer's thickness.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PathRule {
    /// Rule `1 / cos theta`: Beer's law on the slant ray [Baranoski 1997, eq. 7-8].
    #[default]
    Slant,
    /// Rule `1 / cos(cos theta)`: the later form of the authors, meant for the sieve and detour effects of pigments in
    /// grains: at most 1.85 thicknesses, and least for oblique rays.
    Sieve,
}

impl PathRule {
    /// Returns the length of a crossing in thicknesses at a cosine in (0, 1].
    #[inline]
    pub(crate) fn crossings(self, cosine: f64) -> f64 {
        match self {
            PathRule::Slant => 1.0 / cosine,
            PathRule::Sieve => 1.0 / cosine.cos(),
        }
    }
}

/// Stack of interfaces with the media between them, and the rules of the walk.
#[derive(Debug, Clone, PartialEq)]
pub struct Stack {
    /// Interfaces from the adaxial face down; at least one.
    pub interfaces: Vec<Interface>,
    /// Media between the interfaces; one fewer.
    pub media: Vec<Medium>,
    /// Length of a crossing.
    pub path: PathRule,
    /// Rule for spread rays that cross.
    pub crossing: Crossing,
}

impl Stack {
    /// Returns a stack.
    ///
    /// # Panics
    /// If the numbers of interfaces and media do not fit, which is a mistake in a model's file.
    pub(crate) fn new(interfaces: Vec<Interface>, media: Vec<Medium>, path: PathRule, crossing: Crossing) -> Stack {
        assert_eq!(interfaces.len(), media.len() + 1, "one medium between two interfaces");
        Stack { interfaces, media, path, crossing }
    }
}
