//! Changes of a scene that a tracer takes over without a new upload.

use std::ops::Range;

/// A change of a scene since it was uploaded. Camera, lights, materials, ambient light and background need no such
/// notice: every frame reads them anew.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SceneChange {
    /// The edits of an asset, by its number.
    Edits(usize),
    /// What is shown of the bands of an asset, by its number.
    Shown(usize),
    /// The state of a leaf.
    Leaf {
        /// Number of the leaf.
        leaf: usize,
        /// The words of the leaf that changed.
        words: Range<usize>,
    },
    /// The environment that surrounds the scene.
    Environment,
    /// The factors of the instances and where the instances stand.
    Instances,
    /// The bricks of volumes that are loaded. Takes a new upload.
    Bricks,
    /// The places to which the wind has moved the skins and the instances that these stand in for. Cost: the words of
    /// the skins, the proxies and the instances are uploaded again, and with ray queries the whole acceleration
    /// structure is built anew.
    Skins,
}

/// The outcome of [`Tracer::update`](crate::Tracer::update).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[must_use]
pub enum Updated {
    /// The next sample shows the change.
    InPlace,
    /// The change needs more room than there is: the scene must be uploaded by a new tracer.
    NeedsUpload,
}
