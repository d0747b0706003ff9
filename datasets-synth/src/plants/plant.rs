//! A plant as organs: the result of interpreting a word, from which meshes and scripts are made.

use crate::plants::blade::Blade;
use crate::plants::vec3::Vec3;

/// Kind of an organ, which is its material.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// Blades.
    Leaf,
    /// Green stems, sheaths, petioles, husks.
    Stem,
    /// Male flower of maize.
    Tassel,
    /// Pods of soybean.
    Pod,
    /// White petals of a daisy.
    Petal,
    /// Yellow middle of a daisy.
    Disc,
    /// Trunk, branches and twigs.
    Bark,
    /// Soil.
    Ground,
}

impl Part {
    /// Returns the name of the material.
    pub fn name(self) -> &'static str {
        match self {
            Part::Leaf => "leaf",
            Part::Stem => "stem",
            Part::Tassel => "tassel",
            Part::Pod => "pod",
            Part::Petal => "petal",
            Part::Disc => "disc",
            Part::Bark => "bark",
            Part::Ground => "ground",
        }
    }
}

/// Node of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Node {
    /// Centre in metres.
    pub position_m: Vec3,
    /// Radius in metres.
    pub radius_m: f64,
}

/// Long organ of round section: nodes in the direction of growth, with a cone between each two.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Axis {
    pub part: Part,
    pub nodes: Vec<Node>,
}

/// Plant in metres, y up, its foot at the origin.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Plant {
    pub axes: Vec<Axis>,
    pub blades: Vec<Blade>,
    pub petals: Vec<Blade>,
}

impl Plant {
    /// Returns the area of one face of all blades in square metres.
    pub fn leaf_area_m2(&self) -> f64 {
        self.blades.iter().map(Blade::area_m2).sum()
    }

    /// Returns the number of flowers, by their middles.
    pub fn flowers(&self) -> usize {
        self.axes.iter().filter(|axis| axis.part == Part::Disc).count()
    }

    /// Returns the number of organs: axes, blades and petals.
    pub fn organs(&self) -> usize {
        self.axes.len() + self.blades.len() + self.petals.len()
    }
}
