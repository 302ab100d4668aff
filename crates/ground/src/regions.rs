//! Which regions that came back are ground, by their borders: an embankment goes on smoothly into the ground around it, and a roof or a bridge
//! falls off to it on most sides, even if it meets the ground on one.

use crate::cells::{Cells, Place, SIDE, split};
use crate::find::{NEIGHBOUR, Terrain};

/// Neighbours are one region if the surface between them is no steeper than this.
const STEEPEST: f32 = 1.5;
/// The border goes on into the ground where it is no steeper than this ...
const SMOOTH: f32 = 0.5;
/// ... and falls off where it is steeper than this, downwards, and no steeper on the other side: an edge, and not a single high point.
const STEP: f32 = 1.0;
/// How much a neighbour counts, straight on and across a corner.
const STRAIGHT: u8 = 10;
const ACROSS: u8 = 7;
/// A region is ground if so much of what goes on or falls off goes on: nine twentieths.
const GOES_ON: [u64; 2] = [9, 20];

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

/// Returns the cells that were kept `before`, and of those that came back `after` the regions that are ground. Calls `check` for each block.
///
/// # Errors
/// Those of `check`.
pub(crate) fn ground_regions<E>(
    before: &Cells<bool>,
    after: &Cells<bool>,
    terrain: &Terrain,
    check: &dyn Fn() -> Result<(), E>,
) -> Result<Cells<bool>, E> {
    let mut unseen = after.with(before, false, |after, before| after && !before);
    let borders = borders(before, &unseen, terrain);
    let mut kept = after.clone();
    for &place in after.places() {
        check()?;
        for number in 0..SIDE * SIDE {
            let cell = [place[0] * SIDE + number % SIDE, place[1] * SIDE + number / SIDE];
            if unseen.at(cell) {
                let (region, is_ground) = region_from(cell, &borders, &mut unseen);
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

/// Returns the cells of the region of `cell`, and tells whether it is ground. They are no longer `unseen` then.
fn region_from(cell: Place, borders: &Cells<Border>, unseen: &mut Cells<bool>) -> (Vec<Place>, bool) {
    let (mut region, mut smooth, mut falls) = (vec![cell], 0u64, 0u64);
    set(unseen, cell, false);
    let mut next = 0;
    while let Some(&cell) = region.get(next) {
        next += 1;
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
    let [part, whole] = GOES_ON;
    (region, whole * smooth >= part * (smooth + falls))
}

/// Returns the borders of the regions of the cells that have come `back`, among those that were kept `before`.
fn borders(before: &Cells<bool>, back: &Cells<bool>, terrain: &Terrain) -> Cells<Border> {
    let Terrain { surface, covered, width, .. } = *terrain;
    back.map(Border::default(), 1, |back| {
        let (surface, covered) = (surface.window(back.place, 1), covered.window(back.place, 1));
        let before = before.window(back.place, 1);
        back.each(|column, row| {
            let mut border = Border::default();
            if !back.at(column, row) {
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
                if back.at(there, above) {
                    border.inside |= u8::from(fall.abs() <= STEEPEST) << side;
                } else if before.at(there, above) && fall.abs() <= SMOOTH {
                    border.smooth += counts;
                } else if covered.at(there, above) && is_edge() {
                    border.falls += counts;
                }
            }
            border
        })
    })
}
