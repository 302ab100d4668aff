//! Whether it is known what to add to heights, before the job begins: a grid of another country is found before the night, not after it.

use crate::geometry::Bounds;
use crate::job::plan::job_plan::Plan;
use crate::job::publish::placement::Ground;
use crate::output::geoid::Geoid;
use crate::output::tiles3d::globe::NotPlaced;
use crate::{Error, Result};

/// The number of places along each side of the area that are tried. A grid may lack heights at sea, so one place is enough.
const PLACES: i64 = 9;

/// Checks that `[output] height_offset` names something that can be read, and that has a height somewhere in the area of the job.
///
/// # Errors
/// [`Error::Config`] if it does not; [`Error::Io`] if a grid cannot be read.
pub fn check_height_offset(plan: &Plan) -> Result<()> {
    let Some(offset) = &plan.options.output.height_offset else { return Ok(()) };
    let geoid = Geoid::open(Some(offset))?;
    if offset.grid().is_none() {
        return Ok(());
    }
    // That the terrain is not placed at all is a warning, when it is written.
    let Ok((ground, _)) = Ground::new(&plan.crs, &plan.frame, geoid) else { return Ok(()) };
    first_height(&ground, plan.extent)
}

/// Looks for a place within `area` that has a height, and returns the error of the place in the middle if there is none.
fn first_height(ground: &Ground, area: Bounds<2>) -> Result<()> {
    let along = |axis: usize, n: i64| {
        let (low, high) = (i64::from(area.min[axis]), i64::from(area.max[axis]));
        (low + (high - low) * n / (PLACES - 1)) as i32
    };
    let mut first: Option<Error> = None;
    for i in 0..PLACES * PLACES {
        // From the middle on.
        let i = (i + PLACES * PLACES / 2) % (PLACES * PLACES);
        match ground.height_offset([along(0, i % PLACES), along(1, i / PLACES)]) {
            Ok(_) => return Ok(()),
            Err(NotPlaced::System(_)) => {}
            Err(NotPlaced::Height(error)) => first = first.or(Some(error)),
        }
    }
    first.map_or(Ok(()), Err)
}
