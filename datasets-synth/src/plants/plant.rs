//! A plant as organs: what an interpretation of its word gives, and meshes or other pictures are made of.

use crate::plants::blade::Blade;
use crate::plants::vec3::Vec3;

/// What an organ is: its material.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// Blades.
    Leaf,
    /// Green stems, sheaths, petioles, husks.
    Stem,
    /// A maize plant's male flower.
    Tassel,
    /// A soybean's pods.
    Pod,
    /// A daisy's white petals.
    Petal,
    /// And its yellow middle.
    Disc,
    /// Trunk, branches and twigs.
    Bark,
    /// Soil.
    Ground,
}

impl Part {
    /// Returns the material's name.
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

/// A place on an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Node {
    /// Centre in metres.
    pub position_m: Vec3,
    /// Radius in metres.
    pub radius_m: f64,
}

/// Something round and long: nodes in the direction of growth, between each two a cone.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Axis {
    pub part: Part,
    pub nodes: Vec<Node>,
}

/// A plant: metres, y up, its foot at the origin.
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

    /// Flowers: their middles are counted.
    pub fn flowers(&self) -> usize {
        self.axes.iter().filter(|axis| axis.part == Part::Disc).count()
    }

    /// Axes, blades and petals.
    pub fn organs(&self) -> usize {
        self.axes.len() + self.blades.len() + self.petals.len()
    }
}
