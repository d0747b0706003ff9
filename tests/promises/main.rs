//! Promises that hold across packages, one module each.

mod bent_skins;
mod beyond_the_measured_directions;
mod budget;
mod bytes_are_repeatable;
mod designed_leaf;
mod expand_and_measure;
mod exports;
mod fitted_on_gpu;
mod high_dynamic_range;
mod incomplete_captures;
mod leaf_colour;
mod leaf_layers;
mod live_canopy;
mod live_leaf;
mod lod_transition;
mod measured_photographs;
mod mitsuba_peers;
mod python_module;
mod recovery;
mod volumetric_texture;
