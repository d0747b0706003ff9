//! Coarser levels of an asset (a mip chain).

mod bases;
mod cluster;
mod fitter;
mod footprint;
pub(crate) mod levels;
mod own_cluster;
#[cfg(test)]
mod tests;
