//! Coarser levels of an asset (a mip chain).

pub(crate) mod mip;
