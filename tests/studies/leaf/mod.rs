//! Studies of the optics of leaves.

pub mod abm_trade;
pub mod curves;
pub mod faces;
pub mod fits;
pub mod inversion;
pub mod live;
mod spectra_db;
pub mod table;
pub mod trade;
