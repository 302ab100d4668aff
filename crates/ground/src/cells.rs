//! Square cells with a value each, in blocks: there are blocks only where there are points, so a corridor across a country takes little memory.

use rayon::prelude::*;
use std::collections::HashMap;

/// The cells along a side of a block.
pub(crate) const SIDE: i32 = 64;
/// The cells of a block.
pub(crate) const CELLS: usize = (SIDE * SIDE) as usize;

/// The column and the row of a block, or of a cell.
pub(crate) type Place = [i32; 2];

/// Cells with values, row by row in each block.
#[derive(Clone, Debug)]
pub(crate) struct Cells<T> {
    /// The value of cells of other blocks.
    none: T,
    /// The blocks by column and row, ascending.
    places: Vec<Place>,
    values: Vec<Box<[T]>>,
    index: HashMap<Place, usize>,
}

impl<T: Copy + Send + Sync> Cells<T> {
    /// Returns cells without a block, which all have the value `none`.
    pub(crate) fn new(none: T) -> Cells<T> {
        Cells { none, places: Vec::new(), values: Vec::new(), index: HashMap::new() }
    }

    /// Returns the cells of the blocks at `places`, which differ, each with the values that `of` gives.
    pub(crate) fn of(none: T, mut places: Vec<Place>, of: impl Fn(Place) -> Box<[T]> + Sync) -> Cells<T> {
        places.sort_unstable();
        let values = places.par_iter().map(|place| of(*place)).collect();
        let index = places.iter().enumerate().map(|(number, place)| (*place, number)).collect();
        Cells { none, places, values, index }
    }

    /// Returns the cells of the blocks at `places`, which ascend, with these values.
    pub(crate) fn of_blocks(none: T, places: Vec<Place>, values: Vec<Box<[T]>>) -> Cells<T> {
        let index = places.iter().enumerate().map(|(number, place)| (*place, number)).collect();
        Cells { none, places, values, index }
    }

    /// Returns the values of all blocks, in the order of their places.
    pub(crate) fn values(&self) -> impl Iterator<Item = &[T]> {
        self.values.iter().map(|values| &**values)
    }

    /// Returns the number of cells in all blocks.
    pub(crate) fn count(&self) -> u64 {
        (self.places.len() * CELLS) as u64
    }

    /// Returns the places of all blocks.
    pub(crate) fn places(&self) -> &[Place] {
        &self.places
    }

    /// Returns the values of a block; `None` if it is not there.
    pub(crate) fn block(&self, place: Place) -> Option<&[T]> {
        self.index.get(&place).map(|&number| &*self.values[number])
    }

    /// Returns the values of a block to be changed. It is made if it is not there.
    pub(crate) fn block_mut(&mut self, place: Place) -> &mut [T] {
        let Cells { none, places, values, index } = self;
        let number = *index.entry(place).or_insert_with(|| {
            places.push(place);
            values.push(vec![*none; CELLS].into());
            values.len() - 1
        });
        &mut values[number]
    }

    /// Returns the value of a cell.
    pub(crate) fn at(&self, cell: Place) -> T {
        let (block, number) = split(cell);
        self.block(block).map_or(self.none, |values| values[number])
    }

    /// Returns cells of the same blocks, with the values that `of` gives for each block and the cells around it, up to `reach` cells away.
    pub(crate) fn map<U: Copy + Send + Sync>(
        &self,
        none: U,
        reach: i32,
        of: impl Fn(&Window<T>) -> Box<[U]> + Sync,
    ) -> Cells<U> {
        Cells::of(none, self.places.clone(), |place| of(&self.window(place, reach)))
    }

    /// Returns cells of the same blocks, with what `of` gives for each value.
    pub(crate) fn each<U: Copy + Send + Sync>(&self, none: U, of: impl Fn(T) -> U + Sync) -> Cells<U> {
        let values = self.values.par_iter().map(|values| values.iter().map(|value| of(*value)).collect()).collect();
        Cells { none, places: self.places.clone(), values, index: self.index.clone() }
    }

    /// Returns cells of the same blocks, with what `of` gives for each value and that of `other`, which has the same blocks.
    pub(crate) fn with<B: Copy + Send + Sync, U: Copy + Send + Sync>(
        &self,
        other: &Cells<B>,
        none: U,
        of: impl Fn(T, B) -> U + Sync,
    ) -> Cells<U> {
        let values = self.values.par_iter().zip(&other.values);
        let values = values.map(|(own, other)| own.iter().zip(&**other).map(|(own, other)| of(*own, *other)).collect());
        Cells { none, places: self.places.clone(), values: values.collect(), index: self.index.clone() }
    }

    /// Returns the values of a block and of the cells around it, up to `reach` cells away.
    pub(crate) fn window(&self, place: Place, reach: i32) -> Window<T> {
        let side = (SIDE + 2 * reach) as usize;
        let mut values = vec![self.none; side * side];
        let blocks = (reach + SIDE - 1) / SIDE;
        // Where the block at a distance begins in the window, and which of its cells lie in it.
        let along = |distance: i32| {
            let start = reach + distance * SIDE;
            let (from, to) = (start.max(0), (start + SIDE).min(side as i32));
            (from as usize..to as usize, (from - start) as usize)
        };
        for row in -blocks..=blocks {
            for column in -blocks..=blocks {
                let Some(block) = self.block([place[0] + column, place[1] + row]) else { continue };
                let ((columns, first_column), (rows, first_row)) = (along(column), along(row));
                for (number, row) in rows.enumerate() {
                    let start = (first_row + number) * SIDE as usize + first_column;
                    let into = row * side;
                    values[into + columns.start..into + columns.end]
                        .copy_from_slice(&block[start..start + columns.len()]);
                }
            }
        }
        Window { place, reach, side, values }
    }
}

/// Returns the block that a cell is in, and its number there.
pub(crate) fn split([column, row]: Place) -> (Place, usize) {
    let block = [column.div_euclid(SIDE), row.div_euclid(SIDE)];
    (block, (row.rem_euclid(SIDE) * SIDE + column.rem_euclid(SIDE)) as usize)
}

/// Returns the column and the row of a cell of a block.
#[cfg(test)]
pub(crate) fn cell_of(block: Place, number: usize) -> Place {
    let number = number as i32;
    [block[0] * SIDE + number % SIDE, block[1] * SIDE + number / SIDE]
}

/// The values of a block and of the cells around it.
#[derive(Debug)]
pub(crate) struct Window<T> {
    /// The block.
    pub(crate) place: Place,
    /// How many cells around it there are.
    pub(crate) reach: i32,
    /// The cells along a side.
    pub(crate) side: usize,
    /// All values, row by row.
    pub(crate) values: Vec<T>,
}

impl<T: Copy> Window<T> {
    /// Returns the value of a cell, whose column and row are counted from the first of the block.
    pub(crate) fn at(&self, column: i32, row: i32) -> T {
        self.values[(row + self.reach) as usize * self.side + (column + self.reach) as usize]
    }

    /// Returns what `of` gives for the column and the row of each cell of the block.
    pub(crate) fn each<U>(&self, of: impl Fn(i32, i32) -> U) -> Box<[U]> {
        (0..SIDE)
            .flat_map(|row| (0..SIDE).map(move |column| (column, row)))
            .map(|(column, row)| of(column, row))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_has_the_cells_around_a_block() {
        let mut cells = Cells::new(-1);
        for place in [[0, 0], [1, 0], [-1, -1], [0, 2]] {
            let block = cells.block_mut(place);
            block.iter_mut().enumerate().for_each(|(number, value)| {
                *value = place[0] * 1_000_000 + place[1] * 10_000 + number as i32;
            });
        }
        for reach in [0, 1, 5, 64, 70, 130] {
            let window = cells.window([0, 0], reach);
            for row in -reach..SIDE + reach {
                for column in -reach..SIDE + reach {
                    assert_eq!(window.at(column, row), cells.at([column, row]), "{reach}: {column}, {row}");
                }
            }
        }
        assert_eq!((cells.at([-1, -1]), cells.at([-65, 0])), (-1_010_000 + 4095, -1));
    }
}
