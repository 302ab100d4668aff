//! The geoid of the Earth Gravitational Model 1996 (NASA and NIMA, 1998), degree and order 360, from its coefficients in the crate
//! `egm96`.
//!
//! One height takes most of a millisecond, so the model is evaluated at nodes only. Between them it is bilinear, which is at most 4 cm
//! off; the model itself is good to about half a metre.

use crate::geoid::block_cache::BlockCache;
use crate::geoid::errors::refused;
use crate::geoid::node_grid::{NodeGrid, NodeValues, Nodes};
use ::egm96::egm96_compute_altitude_offset;
use sys::{Error, interrupt};

/// Nodes in a degree of longitude and of latitude.
const NODES_PER_DEGREE: u64 = 20;

/// The crate uses the machine's sines, which differ in the last digits. Rounded to this part of a metre, heights are the same everywhere.
const PARTS_OF_A_METRE: f64 = 1000.0;

/// The heights that have been asked for.
pub(super) struct Egm96(BlockCache<f64>);

impl Egm96 {
    /// Returns all nodes, none of them computed yet.
    ///
    /// # Errors
    /// None: the grid is sound.
    pub(super) fn nodes() -> Result<Nodes, Error> {
        let step = 1.0 / NODES_PER_DEGREE as f64;
        let count = [360 * NODES_PER_DEGREE, 180 * NODES_PER_DEGREE + 1];
        let grid = NodeGrid::new([-180.0, -90.0], [step; 2], count).map_err(|what| refused(&what))?;
        Ok((grid, Box::new(Egm96(BlockCache::new()))))
    }
}

impl NodeValues for Egm96 {
    fn value(&self, column: u64, row: u64) -> Result<Option<f64>, Error> {
        let number = row * 360 * NODES_PER_DEGREE + column;
        // Near the poles there are many nodes, and each takes most of a millisecond.
        interrupt::check()?;
        self.0.get(number, || Ok(height(column, row))).map(Some)
    }
}

/// Returns the height of the geoid at a node in metres.
fn height(column: u64, row: u64) -> f64 {
    let [longitude, latitude] = [column, row].map(|index| index as f64 / NODES_PER_DEGREE as f64);
    let exact = egm96_compute_altitude_offset(latitude - 90.0, longitude - 180.0);
    (exact * PARTS_OF_A_METRE).round() / PARTS_OF_A_METRE
}
