//! Which regions that came back are ground, by their borders: an embankment goes on smoothly into the ground around it, and a roof or a bridge
//! falls off to it on most sides, even if it meets the ground on one.

use crate::cells::{Cells, Place, SIDE, split};
use crate::terrain::{NEIGHBOUR, Terrain};

/// Neighbours are one region if the surface between them is no steeper than this.
const STEEPEST: f32 = 1.5;
/// The border goes on into the ground where it is no steeper than this ...
const SMOOTH: f32 = 0.5;
/// ... and falls off where it is steeper than this, downwards, and no steeper on the other side: an edge, and not a single high point.
const STEP: f32 = 1.0;
/// How much a neighbour counts, straight on and across a corner.
const STRAIGHT: u8 = 10;
const ACROSS: u8 = 7;

/// Which regions are ground.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RegionRule {
    /// A region is ground if so much of what goes on or falls off goes on: a numerator and a denominator.
    pub(crate) goes_on: [u64; 2],
    /// Whether the border also falls off where the next cell, which is not kept, does.
    pub(crate) looks_beyond: bool,
}

/// A region may be as large as the cloud: after so many of its cells there is a check.
const CELLS_BETWEEN_CHECKS: usize = 1 << 14;

/// The border of a region at one of its cells.
#[derive(Clone, Copy, Debug, Default)]
struct Border {
    /// The neighbours that are in the region too, a bit for each.
    inside: u8,
    /// How much of the border goes on into the ground.
    smooth: u8,
    /// How much falls off.
    falls: u8,
}

/// Returns the cells that are `kept` without the regions of those that are `doubtful`, and kept too, that are no ground. Their borders may go on into
/// the `sure` ones. Calls `check` for each block.
///
/// # Errors
/// Those of `check`.
pub(crate) fn ground_regions<E>(
    kept: &Cells<bool>,
    (sure, doubtful): (&Cells<bool>, &Cells<bool>),
    terrain: &Terrain,
    rule: RegionRule,
    check: &dyn Fn() -> Result<(), E>,
) -> Result<Cells<bool>, E> {
    let mut unseen = doubtful.clone();
    let borders = borders(sure, doubtful, terrain, rule);
    let mut kept = kept.clone();
    for &place in doubtful.places() {
        check()?;
        for number in 0..SIDE * SIDE {
            let cell = [place[0] * SIDE + number % SIDE, place[1] * SIDE + number / SIDE];
            if unseen.at(cell) {
                let (region, is_ground) = region_from(cell, &borders, &mut unseen, rule, check)?;
                if !is_ground {
                    region.iter().for_each(|cell| set(&mut kept, *cell, false));
                }
            }
        }
    }
    Ok(kept)
}

fn set(cells: &mut Cells<bool>, cell: Place, value: bool) {
    let (block, number) = split(cell);
    cells.block_mut(block)[number] = value;
}

/// Returns the cells of the region of `cell`, and tells whether it is ground. They are no longer `unseen` then. Calls `check` now and then.
///
/// # Errors
/// Those of `check`.
fn region_from<E>(
    cell: Place,
    borders: &Cells<Border>,
    unseen: &mut Cells<bool>,
    RegionRule { goes_on: [part, whole], .. }: RegionRule,
    check: &dyn Fn() -> Result<(), E>,
) -> Result<(Vec<Place>, bool), E> {
    let (mut region, mut smooth, mut falls) = (vec![cell], 0u64, 0u64);
    set(unseen, cell, false);
    let mut next = 0;
    while let Some(&cell) = region.get(next) {
        next += 1;
        if next % CELLS_BETWEEN_CHECKS == 0 {
            check()?;
        }
        let border = borders.at(cell);
        smooth += u64::from(border.smooth);
        falls += u64::from(border.falls);
        for (side, [right, up]) in NEIGHBOUR.iter().enumerate() {
            let neighbour = [cell[0] + right, cell[1] + up];
            if border.inside >> side & 1 == 1 && unseen.at(neighbour) {
                set(unseen, neighbour, false);
                region.push(neighbour);
            }
        }
    }
    Ok((region, whole * smooth >= part * (smooth + falls)))
}

/// Returns the borders of the regions of the `doubtful` cells, among the `sure` ones.
fn borders(sure: &Cells<bool>, doubtful: &Cells<bool>, terrain: &Terrain, rule: RegionRule) -> Cells<Border> {
    let Terrain { surface, covered, width, .. } = *terrain;
    doubtful.map(Border::default(), 1, |doubtful| {
        let (surface, covered) = (surface.window(doubtful.place, 2), covered.window(doubtful.place, 2));
        let sure = sure.window(doubtful.place, 1);
        doubtful.each(|column, row| {
            let mut border = Border::default();
            if !doubtful.at(column, row) {
                return border;
            }
            for (side, [right, up]) in NEIGHBOUR.iter().enumerate() {
                let [there, above] = [column + right, row + up];
                let (length, counts) = match *right == 0 || *up == 0 {
                    true => (width, STRAIGHT),
                    false => (width * std::f32::consts::SQRT_2, ACROSS),
                };
                let here = surface.at(column, row);
                let fall = (here - surface.at(there, above)) / length;
                let rise = (surface.at(column - right, row - up) - here) / length;
                let is_edge = || fall > STEP && rise.abs() <= STEP;
                let is_edge_beyond = || {
                    let beyond = [there + right, above + up];
                    let next = (surface.at(there, above) - surface.at(beyond[0], beyond[1])) / length;
                    let is_rim = !sure.at(there, above) && covered.at(beyond[0], beyond[1]);
                    rule.looks_beyond && is_rim && fall.abs() <= STEP && next > STEP
                };
                if doubtful.at(there, above) {
                    border.inside |= u8::from(fall.abs() <= STEEPEST) << side;
                } else if sure.at(there, above) && fall.abs() <= SMOOTH {
                    border.smooth += counts;
                } else if covered.at(there, above) && (is_edge() || is_edge_beyond()) {
                    border.falls += counts;
                }
            }
            border
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::cell_of;
    use crate::morphology::EMPTY;

    const RULE: RegionRule = RegionRule { goes_on: [9, 20], looks_beyond: false };

    /// Returns how many of the cells higher than a metre remain of a surface of 64 by 64 metres, and how many they were.
    fn left_of(height: impl Fn(f32, f32) -> f32 + Sync) -> [usize; 2] {
        let block = || (0..(SIDE * SIDE) as usize).map(|number| cell_of([0, 0], number));
        let surface = Cells::of(EMPTY, vec![[0, 0]], |_| block().map(|[x, y]| height(x as f32, y as f32)).collect());
        let covered = surface.each(false, |_| true);
        let (before, cut) = (surface.each(false, |height| height < 1.0), surface.each(0.0, |_| 8.0));
        let terrain = Terrain { surface: &surface, covered: &covered, cut: &cut, width: 1.0 };
        let kept =
            ground_regions(&covered, (&before, &surface.each(false, |height| height >= 1.0)), &terrain, RULE, &|| {
                Ok::<_, ()>(())
            })
            .unwrap();
        assert!(block().all(|cell| kept.at(cell) || !before.at(cell)), "ground is lost");
        let high = |cells: &Cells<bool>| block().filter(|cell| cells.at(*cell) && !before.at(*cell)).count();
        [high(&kept), high(&covered)]
    }

    #[test]
    fn embankments_stay() {
        let [left, all] = left_of(|x, _| (6.0 - 0.4 * (x - 32.0).abs()).clamp(0.0, 4.0));
        assert_eq!(left, all);
    }

    #[test]
    fn roofs_and_bridges_go() {
        let roof = |x: f32, y: f32| if (20.0..40.0).contains(&x) && (20.0..40.0).contains(&y) { 5.0 } else { 0.0 };
        // It begins at the level of the ground and rises.
        let bridge = |x: f32, y: f32| if (30.0..36.0).contains(&y) { 0.3 * (x - 3.0).clamp(0.0, 20.0) } else { 0.0 };
        assert_eq!((left_of(roof)[0], left_of(bridge)[0]), (0, 0));
        assert!(left_of(roof)[1] == 400 && left_of(bridge)[1] > 300);
    }

    /// One that meets the ground uphill goes, and a hill beside it stays.
    #[test]
    fn each_region_counts_alone() {
        let [left, all] = left_of(|x, y| match (x, y) {
            (5.0..15.0, 20.0..40.0) => 5.0,
            _ => (6.0 - 0.4 * (x - 42.0).abs()).clamp(0.0, 4.0),
        });
        assert_eq!(left + 200, all);
    }
}
