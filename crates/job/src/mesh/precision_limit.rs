//! Whether glTF can hold the triangles of the mesh: its coordinates have 24 binary digits.

use crate::{Error, Result};
use delaunay::geometry::{Bounds, Site, bounds_of};
use tiles::frame::Frame;

/// The longest extent in x, y and in z that a triangle may have, in lattice steps.
#[derive(Clone, Copy, Debug)]
pub struct PrecisionLimit {
    horizontal: i64,
    vertical: i64,
    /// Metres in a step of x and y, and of z.
    metres: [f64; 2],
}

impl PrecisionLimit {
    /// Returns the limit for the frame of a job.
    pub fn of(frame: &Frame) -> PrecisionLimit {
        let (longest, metres) = (frame.longest_triangle(), frame.resolution_metres());
        PrecisionLimit {
            horizontal: (longest[0] / metres[0]) as i64,
            vertical: (longest[1] / metres[1]) as i64,
            metres,
        }
    }

    /// Tells whether no triangle of these `sites` can be too long.
    pub fn holds_all(&self, sites: &[Site]) -> bool {
        bounds_of(sites).is_none_or(|bounds| (0..2).all(|axis| bounds.extent(axis) <= self.horizontal))
    }

    /// Checks the triangle abc.
    ///
    /// # Errors
    /// [`Error::TooFine`] if it is too long in x or y.
    #[inline]
    pub fn check(&self, [a, b, c]: [Site; 3]) -> Result<()> {
        let extent = |axis: usize| {
            let (a, b, c) = (a[axis] as i64, b[axis] as i64, c[axis] as i64);
            a.max(b).max(c) - a.min(b).min(c)
        };
        let longest = extent(0).max(extent(1));
        if longest <= self.horizontal { Ok(()) } else { Err(self.too_long(longest)) }
    }

    #[cold]
    fn too_long(&self, steps: i64) -> Error {
        let [length, limit] = [steps, self.horizontal].map(|steps| steps as f64 * self.metres[0]);
        Error::TooFine {
            vertical: false,
            what: format!(
                "the mesh has a triangle {length:.0} m long, and at this resolution glTF holds {limit:.0} m exactly"
            ),
        }
    }

    /// Checks the heights of a mesh with these `bounds`.
    ///
    /// # Errors
    /// [`Error::TooFine`] if a mesh cannot hold all heights.
    pub fn check_heights(&self, bounds: Bounds<3>) -> Result<()> {
        let steps = bounds.extent(2);
        if steps <= self.vertical {
            return Ok(());
        }
        let [span, limit] = [steps, self.vertical].map(|steps| steps as f64 * self.metres[1]);
        Err(Error::TooFine {
            vertical: true,
            what: format!("heights span {span:.0} m, and with their step glTF holds {limit:.0} m exactly"),
        })
    }
}
