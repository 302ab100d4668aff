//! Which cells lie on the ground, by their lowest points.
//!
//! It begins as the morphological filter of Pingel, Clarke and McBride 2013, "An improved simple morphological filter for the terrain
//! classification of airborne LIDAR data": openings by larger and larger discs cut off what is narrower than they are and steeper than the ground.
//! What they cut off where the ground goes on smoothly comes back, cell by cell, but not regions that fall off on most sides. So does what lies near
//! the surface of the others. At last each cell is compared with the plane of the ground around it.
//!
//! Each pass looks at no more than what the one before has left: within a bounded distance, along a region that came back, or in the pyramid that fills
//! gaps. So the result depends on the lowest points alone.
//! It is computed in single precision, by additions, multiplications, divisions, square roots and comparisons in a fixed order, which have the same
//! bits on every machine.

use crate::cells::Cells;
use crate::fill::filled;
use crate::morphology::{EMPTY, NEIGHBOURS, dilation, erosion, only_where};
use crate::pits::without_pits;
use crate::plane::{from_middle, with_surroundings};
use crate::regions::{RegionRule, ground_regions};
use crate::sizes::GroundSizes;
use crate::slope::slopes;
use crate::terrain::{NEIGHBOUR, Terrain};

/// Discs have their middles and their cells no farther than this from points, in metres.
const EXTENSION: f64 = 4.0;
/// Up to this radius in metres discs grow by a metre, up to the next by two, and then by a tenth.
const BY_ONE: i32 = 6;
const BY_TWO: i32 = 20;
/// Cells that wide discs cut off come back first, from the ground around: an embankment is wide and steep, and meets the ground at its ends.
const ALONG: Growth = Growth { radius: 8.0, rounds: 30, agreeing: 2, bend: 0.75, steepest: 1.5, is_covered: false };
/// Then those that others have cut off, if the ground goes on smoothly on more sides.
const AROUND: Growth = Growth { radius: 3.0, rounds: 10, agreeing: 3, bend: 0.5, steepest: 1.0, is_covered: true };
/// Regions that came back are ground if nine twentieths of their border go on.
const IN_GROWTH: RegionRule = RegionRule { goes_on: [9, 20], looks_beyond: false };
/// Halls may be so many times as wide as the largest building: they have edges all around, and less than a fifth of their border goes on.
const HALL: f64 = 2.5;
const IN_HALLS: RegionRule = RegionRule { goes_on: [1, 5], looks_beyond: true };
/// So many times cells come back that lie near the surface of the others.
const JOINS: usize = 3;
/// How much farther they may lie from it on a slope of one, in widths of a cell.
const JOIN_BY_SLOPE: f32 = 0.85;
/// Where the surface falls by more than so many metres in a cell, what it falls by beyond adds to the tolerance so many times.
const CLIFF: f32 = 3.0;
const BY_CLIFF: f32 = 3.0;
/// So many times each cell is compared with the plane of the ground around it.
const REFINEMENTS: usize = 2;

/// What is known of all cells.
pub(crate) struct GroundCells {
    /// The heights of the ground, everywhere.
    pub(crate) surface: Cells<f32>,
    /// The lowest points of the cells that are ground.
    pub(crate) lowest: Cells<f32>,
}

/// The lowest points of the cells.
#[derive(Clone, Copy)]
pub(crate) struct LowestCells<'a> {
    /// Their heights in metres.
    pub(crate) heights: &'a Cells<f32>,
    /// Where in its cell each is: 256ths of the width.
    pub(crate) spots: &'a Cells<[u8; 2]>,
    /// The width of a cell in metres.
    pub(crate) width: f64,
}

/// Returns the ground of a cloud whose cells have these lowest points. Calls `check` between passes.
///
/// # Errors
/// Those of `check`.
pub(crate) fn find_ground<E>(
    LowestCells { heights, spots, width }: LowestCells,
    sizes: GroundSizes,
    check: &dyn Fn() -> Result<(), E>,
) -> Result<GroundCells, E> {
    let lowest = &without_pits(heights, width);
    let kept = kept_cells(lowest, width, sizes, check)?;
    let (width, tolerance) = (width as f32, sizes.tolerance.0 as f32);
    let mut ground = joined(lowest, only_where(lowest, &kept), width, tolerance);
    for _ in 0..REFINEMENTS {
        check()?;
        ground = refined(lowest, spots, &ground, width, tolerance);
    }
    check()?;
    Ok(GroundCells { surface: filled(&ground), lowest: ground })
}

/// Returns the cells that openings do not cut off, and those that come back since the ground goes on through them.
///
/// # Errors
/// Those of `check`.
fn kept_cells<E>(
    lowest: &Cells<f32>,
    width: f64,
    sizes: GroundSizes,
    check: &dyn Fn() -> Result<(), E>,
) -> Result<Cells<bool>, E> {
    let within = |radius: f64| erosion(lowest, radius).each(false, |least| least != EMPTY);
    let (covered, reached) = (within(NEIGHBOURS), within(EXTENSION / width));
    let surface = filled(lowest);
    let mut opened = only_where(&surface, &reached);
    let largest = sizes.largest_building.0 / 2.0;
    let discs = Discs { covered: &covered, reached: &reached, width, slope: sizes.slope.0 };
    let cut = discs.cut_off(&mut opened, radii(largest), check)?;
    let uncut = covered.with(&cut, false, |is_covered, radius| is_covered && radius == 0.0);
    let terrain = Terrain { surface: &surface, covered: &covered, cut: &cut, width: width as f32 };
    let mut kept = uncut.clone();
    for growth in [ALONG, AROUND] {
        for _ in 0..growth.rounds {
            check()?;
            kept = grown(&kept, &terrain, growth);
        }
    }
    let back = kept.with(&uncut, false, |is_kept, is_uncut| is_kept && !is_uncut);
    kept = ground_regions(&kept, (&uncut, &back), &terrain, IN_GROWTH, check)?;
    let halls = radii(HALL * largest).into_iter().filter(|radius| *radius > largest).collect();
    let cut = discs.cut_off(&mut opened, halls, check)?;
    let wide = kept.with(&cut, false, |is_kept, radius| is_kept && radius > 0.0);
    // Corners of a hall are cut off by smaller discs, and came back with it: it does not go on into them.
    let low = uncut.with(&cut, false, |is_uncut, radius| is_uncut && radius == 0.0);
    ground_regions(&kept, (&low, &wide), &terrain, IN_HALLS, check)
}

/// What openings with discs need.
struct Discs<'a> {
    /// The cells that have points around.
    covered: &'a Cells<bool>,
    /// The cells that discs may reach.
    reached: &'a Cells<bool>,
    /// The width of a cell in metres.
    width: f64,
    /// The slope of the steepest ground.
    slope: f64,
}

impl Discs<'_> {
    /// Opens the `surface`, which is there where discs may reach, with discs of these radii in metres, each on the result of the one before. Returns
    /// for each cell the radius of the last opening that cut it off; 0 if none did.
    fn cut_off<E>(
        &self,
        surface: &mut Cells<f32>,
        radii: Vec<f64>,
        check: &dyn Fn() -> Result<(), E>,
    ) -> Result<Cells<f32>, E> {
        let Discs { covered, reached, width, slope } = *self;
        let mut cut = covered.each(0.0, |_| 0.0);
        for radius in radii {
            check()?;
            // A disc just so wide has the cells at its rim.
            let cells = radius / width + 0.01;
            if cells < 1.0 {
                continue;
            }
            let opened = only_where(&dilation(&only_where(&erosion(surface, cells), reached), cells), reached);
            let most = (slope * radius) as f32;
            let is_high = surface.with(&opened, false, |last, opened| last != EMPTY && last - opened > most);
            let is_cut = is_high.with(covered, false, |is_high, is_covered| is_high && is_covered);
            cut = cut.with(&is_cut, 0.0, |last, is_cut| if is_cut { radius as f32 } else { last });
            *surface = opened;
        }
        Ok(cut)
    }
}

/// Returns the radii of the discs in metres, up to the greatest.
fn radii(greatest: f64) -> Vec<f64> {
    let (by_one, by_two) = ((1..=BY_ONE).map(f64::from), (BY_ONE + 2..=BY_TWO).step_by(2).map(f64::from));
    let mut radii: Vec<f64> = by_one.chain(by_two).take_while(|radius| *radius <= greatest).collect();
    let mut next = f64::from(BY_TWO) * 1.1;
    while next <= greatest {
        radii.push(next);
        next *= 1.1;
    }
    // A building just so wide is cut off.
    if radii.last().is_some_and(|last| *last < greatest) {
        radii.push(greatest);
    }
    radii
}

/// How cells that openings have cut off come back.
#[derive(Clone, Copy, Debug)]
struct Growth {
    /// Only those come back that a disc of this radius in metres or a larger one cut off last.
    radius: f32,
    rounds: usize,
    /// So many of the eight neighbours agree.
    agreeing: usize,
    /// The surface bends by no more than this between a neighbour and the opposite one, as a change of its slope.
    bend: f32,
    /// It is no steeper than this.
    steepest: f32,
    /// Whether there must be points at the opposite neighbour.
    is_covered: bool,
}

/// Returns the cells that are `kept`, and those beside them where the ground goes on smoothly from one side to the other.
fn grown(kept: &Cells<bool>, terrain: &Terrain, growth: Growth) -> Cells<bool> {
    let Terrain { surface, covered, cut, width } = *terrain;
    kept.map(false, 1, |kept| {
        let (surface, covered) = (surface.window(kept.place, 1), covered.window(kept.place, 1));
        let cut = cut.window(kept.place, 0);
        let agrees = |[column, row]: [i32; 2], [right, up]: [i32; 2]| {
            let length = if right == 0 || up == 0 { width } else { width * std::f32::consts::SQRT_2 };
            let (here, there) = (surface.at(column, row), surface.at(column + right, row + up));
            let opposite = surface.at(column - right, row - up);
            kept.at(column + right, row + up)
                && (covered.at(column - right, row - up) || !growth.is_covered)
                && (there + opposite - 2.0 * here).abs() <= growth.bend * length
                && (here - there).abs() <= growth.steepest * length
        };
        kept.each(|column, row| {
            let may_come_back = || covered.at(column, row) && cut.at(column, row) >= growth.radius;
            let agreeing = || NEIGHBOUR.iter().filter(|side| agrees([column, row], **side)).count();
            kept.at(column, row) || may_come_back() && agreeing() >= growth.agreeing
        })
    })
}

/// Returns the `ground` with those of the `lowest` points that lie near the surface of the others.
fn joined(lowest: &Cells<f32>, mut ground: Cells<f32>, width: f32, tolerance: f32) -> Cells<f32> {
    let mut allowed = None;
    for _ in 0..JOINS {
        let surface = filled(&ground);
        let allowed = allowed.get_or_insert_with(|| {
            slopes(&surface, width).map(0.0, 1, |slopes| {
                slopes.each(|column, row| {
                    let around = NEIGHBOUR.iter().map(|[right, up]| slopes.at(column + right, row + up));
                    allowed_distance(tolerance, JOIN_BY_SLOPE, width * around.fold(slopes.at(column, row), f32::max))
                })
            })
        });
        let distance = lowest.with(
            &surface,
            EMPTY,
            |height, surface| if height == EMPTY { EMPTY } else { (height - surface).abs() },
        );
        let is_near = distance.with(allowed, false, |distance, allowed| distance != EMPTY && distance <= allowed);
        let added = only_where(lowest, &is_near);
        ground = ground.with(&added, EMPTY, |height, added| if height == EMPTY { added } else { height });
    }
    ground
}

/// Returns the cells whose lowest points lie near the plane of the ground around them, and of the `ground` also those that lie below it.
fn refined(lowest: &Cells<f32>, spots: &Cells<[u8; 2]>, ground: &Cells<f32>, width: f32, tolerance: f32) -> Cells<f32> {
    let expected = with_surroundings(ground, spots, &filled(ground), (width, [EMPTY; 2]), |around, column, row| {
        let plane = around.plane(column, row, false);
        [plane.at(from_middle(around.spot(column, row), width)), plane.allowed(tolerance, width)]
    });
    let above = lowest.with(&expected, [EMPTY; 2], |height, [expected, allowed]| [height - expected, allowed]);
    let is_near = above
        .with(ground, false, |[above, allowed], ground| above <= allowed && (above >= -allowed || ground != EMPTY));
    only_where(lowest, &is_near)
}

/// Returns how far a point may lie from the surface where it falls by so many metres in a cell.
fn allowed_distance(tolerance: f32, by_slope: f32, fall: f32) -> f32 {
    tolerance + by_slope * fall + BY_CLIFF * (fall - CLIFF).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discs_grow_up_to_the_largest_building() {
        assert_eq!(radii(20.0), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0]);
        assert_eq!(radii(2.5), [1.0, 2.0, 2.5]);
        assert_eq!(radii(25.0).len(), 16);
    }
}
