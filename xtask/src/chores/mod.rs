//! The chores, one file each: help, options, and the programs that the chore starts.

pub mod bench;
pub mod blender;
pub mod book;
pub mod c;
pub mod check;
pub mod cost;
pub mod demo;
pub mod fuzz;
pub mod gpu_report;
pub mod header;
pub mod priors;
pub mod python;
pub mod setup;
pub mod shaders;
pub mod volumes;
pub mod web;
