//! Canopies by numbers: what a scientist asks of a stand of plants, from photons that are traced through its triangles.
//! Leaves and soil are diffuse; the stand repeats without end.

pub(crate) mod cell;
pub(crate) mod light;
pub(crate) mod measure;
pub(crate) mod optics;
pub(crate) mod plot;
pub(crate) mod structure;
