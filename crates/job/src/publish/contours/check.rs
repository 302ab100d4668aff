//! The levels of contour lines, and whether the contour lines that the user wants can be written, before the job begins.

use crate::plan::job_plan::Plan;
use contours::{CLOSEST, LevelError, Levels};
use lattice::Lattice;
use rust_decimal::Decimal;
use sys::{Error, Result};
use tiles::contour_options::{BadInterval, ContourHeight, ContourLevels, MOST_LEVELS};

/// The levels of a terrain: their heights in source units, and as the lattice sees them.
pub(crate) struct TerrainLevels {
    pub(crate) heights: Vec<ContourHeight>,
    pub(crate) levels: Levels,
}

impl TerrainLevels {
    /// Returns the levels of a terrain between two heights of the lattice.
    ///
    /// # Errors
    /// [`Error::Config`] if they are too many or too close, or have too many digits.
    pub(crate) fn of(options: &ContourLevels, lattice: &Lattice, heights: [i32; 2]) -> Result<TerrainLevels> {
        let refused = |what: String| Error::Config(format!("[output.contours] {}{what}", name_of(options)));
        let exact =
            |z: i32| Decimal::from_str_exact(&lattice.world_text(2, z)).map_err(|e| Error::Broken(e.to_string()));
        let [low, high] = heights;
        let found = options.heights(exact(low)?, exact(high)?).map_err(|bad| match bad {
            BadInterval::TooMany { levels, better } => refused(format!(
                " makes about {levels:.0} levels over the heights of the terrain, {} to {}, more than {MOST_LEVELS}: give a greater \
                 interval, such as {better:?}",
                lattice.world_text(2, low),
                lattice.world_text(2, high)
            )),
            BadInterval::TooManyDigits => refused(" has too many digits for heights: round it".into()),
        })?;
        let exact: Vec<Decimal> = found.iter().map(|height| height.exact).collect();
        let levels = Levels::new(lattice, &exact).map_err(|error| match error {
            LevelError::TooManyDigits(level) => refused(format!(" has a level of too many digits, {level}: round it")),
            LevelError::TooClose(below, above) => refused(format!(
                " has levels that are too close to each other, {below} and {above}: heights are whole multiples of {} here, and levels \
                 are to be at least a {CLOSEST}nd part of that apart",
                lattice.resolution_z
            )),
        })?;
        Ok(TerrainLevels { heights: found, levels })
    }
}

fn name_of(options: &ContourLevels) -> String {
    match options {
        ContourLevels::Interval { interval, .. } => format!("interval = {:?}", interval.number()),
        ContourLevels::Levels(_) => "levels".into(),
    }
}

/// Checks that `[output.contours]` asks for lines that can be written, as far as a sample of the points tells.
///
/// # Errors
/// [`Error::Config`] if it does not.
pub(crate) fn check_contours(plan: &Plan) -> Result<()> {
    match (&plan.options.output.contours, plan.heights) {
        (Some(options), Some(heights)) => {
            TerrainLevels::of(&options.levels, &plan.lattice, [heights.low, heights.high]).map(|_| ())
        }
        _ => Ok(()),
    }
}
