//! Where the cells of a raster are.
//!
//! Cells are aligned: their edges are at whole multiples of the resolution from an origin in the CRS of the job, by default (0, 0), so that
//! rasters of neighbouring areas, and of other programs, share them. Columns count from the west and rows from the north, so along both
//! axes of the grid, which are x and -y.
//!
//! A lattice step, a cell and the origin are decimals. Their greatest common divisor is the **subunit** (of half a cell, so that a centre
//! is a whole number too): a lattice step has `step` subunits, a cell `pitch`, and the first centre is `first_center` subunits from the
//! lattice's zero.

use crate::raster::BLOCK;
use crate::raster::options::FileSide;
use crate::raster::whole_numbers::WholeNumber;
use delaunay::geometry::Bounds;
use lattice::Lattice;
use rust_decimal::Decimal;
use rust_decimal::prelude::ToPrimitive;

/// The most columns or rows that GDAL opens.
const MOST_ALONG: i128 = i32::MAX as i128;

/// How many cells a raster may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellLimit {
    /// As many as one file has: a terabyte before it is compressed.
    OneFile,
    /// As many as a grid of files with this side has.
    Files(u32),
}

/// The most files of a grid of files.
const MOST_FILES: i128 = 1 << 16;

impl CellLimit {
    fn cells(self) -> i128 {
        match self {
            CellLimit::OneFile => 1 << 38,
            CellLimit::Files(side) => MOST_FILES * i128::from(side).pow(2),
        }
    }
}

impl std::fmt::Display for CellLimit {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(match self {
            CellLimit::OneFile => "one file has at most 2^38 cells (1100 GB; cells_per_file makes several files)",
            CellLimit::Files(_) => "there are at most 65536 files of cells_per_file x cells_per_file cells",
        })
    }
}

/// Lengths in subunits are below 2 to the power of this: then products with a length in lattice steps, and sums of two, fit an `i128`.
const WIDE_BITS: u32 = 90;

/// The same for an `i64`. What is multiplied is also bounded by [`Subunits::longest`].
const NARROW_BITS: u32 = 60;

/// Where the cells of all rasters with the same options are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellAlignment {
    /// The x and the y of a corner of a cell.
    pub origin: [Decimal; 2],
    /// The side of a cell.
    pub resolution: Decimal,
}

impl CellAlignment {
    /// Returns the x of the edge and the y of the edge that are so many columns east and rows south of the origin.
    fn corner(&self, [columns, rows]: [i128; 2]) -> Option<[Decimal; 2]> {
        let shifted = |origin: Decimal, cells: i128| {
            let cells = Decimal::from(i64::try_from(cells).ok()?);
            origin.checked_add(self.resolution.checked_mul(cells)?)
        };
        Some([shifted(self.origin[0], columns)?, shifted(self.origin[1], -rows)?])
    }
}

/// The cells of a raster.
#[derive(Clone, Debug)]
pub struct RasterGrid {
    alignment: CellAlignment,
    /// Cells from the origin to the western and to the northern edge.
    first: [i128; 2],
    size: [u32; 2],
    wide: Subunits<i128>,
    narrow: Option<Subunits<i64>>,
}

/// The map from the lattice to the cells, in subunits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Subunits<T> {
    /// In a lattice step.
    pub(crate) step: T,
    /// In a cell.
    pub(crate) pitch: T,
    /// From the lattice's zero to the centre of the first column and of the first row.
    pub(crate) first_center: [T; 2],
    /// No triangle with a greater extent, in lattice steps, may be drawn with these numbers.
    pub(crate) longest: i64,
}

/// The columns or rows whose centres are beside a lattice coordinate.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Beside {
    /// The first whose centre is not before it.
    pub(crate) from: u32,
    /// The first whose centre is behind it.
    pub(crate) past: u32,
}

#[expect(clippy::arithmetic_side_effects, reason = "T is i64 or i128")]
impl<T: WholeNumber> Subunits<T> {
    /// Returns which of `cells` columns (axis 0) or rows (axis 1) are beside `coordinate`.
    #[inline(always)]
    pub(crate) fn beside(&self, axis: usize, coordinate: i32, cells: u32) -> Beside {
        let distance = T::from(coordinate) * self.step - self.first_center[axis];
        let (before, is_centre) = distance.divided(self.pitch);
        let past = before + T::from(1i32);
        let from = if is_centre { before } else { past };
        Beside { from: from.within(cells), past: past.within(cells) }
    }

    /// Returns the centre of a column or row.
    #[inline(always)]
    pub(crate) fn center(&self, axis: usize, cell: u32) -> T {
        self.first_center[axis] + self.pitch * T::from(cell)
    }
}

impl RasterGrid {
    /// Returns the grid of the cells of `alignment` that meet the box of lattice points `bounds`.
    ///
    /// # Errors
    /// A sentence that begins with a verb, if there are too many cells, or numbers have too many digits.
    pub fn new(
        lattice: &Lattice,
        alignment: CellAlignment,
        bounds: Bounds<2>,
        limit: CellLimit,
    ) -> Result<RasterGrid, String> {
        let numbers = Integers::of(lattice, &alignment).ok_or_else(too_many_digits)?;
        let [low, high] = [0, 1].map(|axis| match axis {
            0 => [bounds.min[0], bounds.max[0]],
            _ => [-bounds.max[1], -bounds.min[1]],
        });
        let mut first = [0; 2];
        let mut sides = [0; 2];
        for (axis, [least, most]) in [low, high].into_iter().enumerate() {
            let [from, to] = numbers.cells(axis, least, most).ok_or_else(too_many_digits)?;
            (first[axis], sides[axis]) = (from, to - from + 1);
        }
        let size = fitting(sides, alignment.resolution, limit)?;
        let wide = numbers.subunits(first).ok_or_else(too_many_digits)?;
        let past = [0, 1].map(|axis| first[axis] + sides[axis]);
        let has_corners = [first, past].iter().all(|cells| alignment.corner(*cells).is_some());
        if !wide.fits(size, WIDE_BITS) || !has_corners {
            return Err(too_many_digits());
        }
        Ok(RasterGrid { alignment, first, size, narrow: wide.narrow_for(size), wide })
    }

    /// Returns the grid of some of these columns and rows, each given as the first and the one after the last.
    pub fn part(&self, [columns, rows]: [[u32; 2]; 2]) -> RasterGrid {
        let begin = [columns[0], rows[0]].map(i128::from);
        let size = [columns[1] - columns[0], rows[1] - rows[0]];
        let first = [0, 1].map(|axis| self.first[axis] + begin[axis]);
        let first_center = [0, 1].map(|axis| self.wide.first_center[axis] + self.wide.pitch * begin[axis]);
        let wide = Subunits { first_center, ..self.wide };
        RasterGrid { alignment: self.alignment, first, size, narrow: wide.narrow_for(size), wide }
    }

    /// Returns the grid of the same cells over another lattice, whose points have coordinates in the same CRS.
    ///
    /// # Errors
    /// A sentence that begins with a verb, if numbers have too many digits.
    pub fn on_lattice(&self, lattice: &Lattice) -> Result<RasterGrid, String> {
        let numbers = Integers::of(lattice, &self.alignment).ok_or_else(too_many_digits)?;
        let wide = numbers.subunits(self.first).filter(|wide| wide.fits(self.size, WIDE_BITS));
        let wide = wide.ok_or_else(too_many_digits)?;
        Ok(RasterGrid { narrow: wide.narrow_for(self.size), wide, ..self.clone() })
    }

    /// Returns the grid with a column and a row more on each side: its cell (1, 1) is the cell (0, 0) of this one. Slopes need the heights
    /// there; no file has these cells.
    pub fn with_margin(&self) -> RasterGrid {
        let first = self.first.map(|first| first - 1);
        let first_center = self.wide.first_center.map(|center| center - self.wide.pitch);
        let size = self.size.map(|side| side.saturating_add(2));
        let wide = Subunits { first_center, ..self.wide };
        RasterGrid { alignment: self.alignment, first, size, narrow: wide.narrow_for(size), wide }
    }

    /// Returns the columns and the rows of the files of the raster, row by row. Files are cut at whole multiples of `side` cells from the
    /// origin: at the same places in neighbouring rasters. Without a side there is one file.
    pub fn files(&self, side: Option<FileSide>) -> Vec<[[u32; 2]; 2]> {
        let Some(side) = side.map(|side| u64::from(side.cells())) else {
            return vec![self.size.map(|cells| [0, cells])];
        };
        let cuts = |axis: usize| {
            let (before, end) = (self.first[axis].rem_euclid(i128::from(side)) as u64, u64::from(self.size[axis]));
            let next = move |at: &u64| Some((at + before) / side * side + side - before);
            let starts = std::iter::successors(Some(0), next).take_while(move |at| *at < end);
            starts.map(move |at| [at, next(&at).map_or(end, |past| past.min(end))].map(|cell| cell as u32))
        };
        cuts(1).flat_map(|rows| cuts(0).map(move |columns| [columns, rows])).collect()
    }

    /// Returns the numbers of columns and rows.
    #[inline]
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Returns the number of cells.
    #[inline]
    pub fn cells(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }

    /// Returns the x of the western edge and the y of the northern edge.
    pub fn corner(&self) -> [f64; 2] {
        // Every grid that `new` returns has corners.
        self.alignment.corner(self.first).map_or([f64::NAN; 2], |corner| corner.map(nearest))
    }

    /// Returns the side of a cell.
    pub fn cell_size(&self) -> f64 {
        nearest(self.alignment.resolution)
    }

    /// Returns the columns and the rows with a centre within a box of lattice points, each as the first and the one after the last.
    pub fn cells_within(&self, bounds: Bounds<2>) -> [[u32; 2]; 2] {
        let cells = |axis: usize, least: i32, most: i32| {
            let [first, last] = [least, most].map(|place| self.wide.beside(axis, place, self.size[axis]));
            [first.from, last.past]
        };
        let Bounds { min: [west, south], max: [east, north] } = bounds;
        [cells(0, west, east), cells(1, -north, -south)]
    }

    /// Returns the number of cells that the file holds with its overviews: blocks are whole, however few of their cells are needed.
    pub fn stored_cells(&self) -> u64 {
        let stored = |size: &[u32; 2]| blocks(*size).into_iter().map(|count| (count * BLOCK) as u64).product::<u64>();
        self.levels().iter().map(stored).sum()
    }

    pub(crate) fn wide(&self) -> &Subunits<i128> {
        &self.wide
    }

    pub(crate) fn narrow(&self) -> Option<&Subunits<i64>> {
        self.narrow.as_ref()
    }

    /// Returns the sizes in cells of the raster and of its overviews, each half as fine as the one before. The last fits one block.
    pub fn levels(&self) -> Vec<[u32; 2]> {
        let mut levels = vec![self.size];
        while let Some(size) = levels.last().copied().filter(|size| size.iter().any(|side| *side > BLOCK as u32)) {
            levels.push(size.map(|side| side.div_ceil(2)));
        }
        levels
    }
}

/// Returns the numbers of blocks along the sides of an image.
pub fn blocks(size: [u32; 2]) -> [usize; 2] {
    size.map(|side| (side as usize).div_ceil(BLOCK))
}

/// Returns the nearest number. The text of a decimal is always one.
fn nearest(exact: Decimal) -> f64 {
    exact.to_string().parse().unwrap_or(f64::NAN)
}

fn too_many_digits() -> String {
    "has too many digits to meet the lattice of the points exactly: give a number with fewer, and no greater than the terrain".into()
}

/// Returns the sides if there are not too many cells.
fn fitting(sides: [i128; 2], resolution: Decimal, limit: CellLimit) -> Result<[u32; 2], String> {
    let [columns, rows] = sides;
    let most = limit.cells();
    let fits = columns <= MOST_ALONG && rows <= MOST_ALONG && columns.saturating_mul(rows) <= most;
    // A narrow raster has files that are hardly filled.
    if let CellLimit::Files(side) = limit
        && fits
        && (columns / i128::from(side) + 2) * (rows / i128::from(side) + 2) > MOST_FILES
    {
        return Err(format!("makes {columns} x {rows} cells, and {limit}: set greater cells_per_file or resolution"));
    }
    if fits {
        return Ok(sides.map(|side| side as u32));
    }
    let [width, height] = sides.map(|side| side as f64);
    let share = (width * height / most as f64).sqrt().max(width.max(height) / MOST_ALONG as f64);
    let gigabytes = width * height * 4.0 / 1e9;
    Err(format!(
        "makes {columns} x {rows} cells, {gigabytes:.0} GB before compression, and {limit}, 2^31 - 1 along a side: set {} or more, or \
         narrower [input] bounds",
        two_digits(resolution.to_f64().unwrap_or(1.0) * share)
    ))
}

/// Returns a number as a text with two digits, rounded up.
fn two_digits(value: f64) -> String {
    let mut step = 1.0;
    while value / step >= 100.0 {
        step *= 10.0;
    }
    while value / step < 10.0 && step > 1e-15 {
        step /= 10.0;
    }
    let rounded = (value / step).ceil() * step;
    let digits = (0..16).find(|digits| step * 10f64.powi(*digits) >= 0.999).unwrap_or(0);
    format!("{rounded:.0$}", digits as usize)
}

/// The decimals as whole numbers of one unit.
struct Integers {
    /// From the origin of the cells to the lattice's zero along the axes of the grid.
    offset: [i128; 2],
    step: i128,
    cell: i128,
}

impl Integers {
    /// Returns `None` if the numbers have too many digits.
    fn of(lattice: &Lattice, alignment: &CellAlignment) -> Option<Integers> {
        let ([x, y, _], [from_x, from_y]) = (lattice.offset, alignment.origin);
        let all = [x, y, from_x, from_y, lattice.resolution, alignment.resolution].map(|d| d.normalize());
        let digits = all.iter().map(Decimal::scale).max()?;
        let integer = |d: Decimal| 10i128.checked_pow(digits - d.scale())?.checked_mul(d.mantissa());
        let [x, y, from_x, from_y, step, cell] = all.map(integer);
        let offset = [x?.checked_sub(from_x?)?, from_y?.checked_sub(y?)?];
        let numbers = Integers { offset, step: step?, cell: cell? };
        (numbers.step > 0 && numbers.cell > 0).then_some(numbers)
    }

    fn place(&self, axis: usize, coordinate: i32) -> Option<i128> {
        self.step.checked_mul(i128::from(coordinate))?.checked_add(self.offset[axis])
    }

    /// Returns the first and the last cell that meet what is between two lattice coordinates.
    fn cells(&self, axis: usize, least: i32, most: i32) -> Option<[i128; 2]> {
        let first = self.place(axis, least)?.div_euclid(self.cell);
        let beyond = -(self.place(axis, most)?.checked_neg()?.div_euclid(self.cell));
        Some([first, (beyond - 1).max(first)])
    }

    /// Returns the map to the cells from the cells `first` on.
    fn subunits(&self, first: [i128; 2]) -> Option<Subunits<i128>> {
        let twice = |value: i128| value.checked_mul(2);
        let center = |axis: usize| {
            let halves = twice(first[axis])?.checked_add(1)?;
            self.cell.checked_mul(halves)?.checked_sub(twice(self.offset[axis])?)
        };
        let (step, pitch, first_center) = (twice(self.step)?, twice(self.cell)?, [center(0)?, center(1)?]);
        let common = [pitch, first_center[0], first_center[1]].into_iter().fold(step, |a, b| gcd(a, b.abs()));
        let first_center = first_center.map(|value| value / common);
        Some(Subunits { step: step / common, pitch: pitch / common, first_center, longest: i64::MAX })
    }
}

fn gcd(a: i128, b: i128) -> i128 {
    if b == 0 { a } else { gcd(b, a % b) }
}

impl Subunits<i128> {
    /// Returns the greatest lengths of a raster of this size. Lattice coordinates are below 2^30.
    fn lengths(&self, size: [u32; 2]) -> Option<Vec<i128>> {
        let mut lengths = vec![self.step.checked_mul(1 << 30)?, self.pitch];
        for (center, side) in self.first_center.into_iter().zip(size) {
            lengths.extend([center, self.pitch.checked_mul(i128::from(side) + 1)?.checked_add(center)?]);
        }
        Some(lengths)
    }

    /// Returns whether all lengths of a raster of this size are below two to the power of `bits`.
    fn fits(&self, size: [u32; 2], bits: u32) -> bool {
        self.lengths(size).is_some_and(|lengths| lengths.iter().all(|length| length.abs() < 1 << bits))
    }

    fn narrow_for(&self, size: [u32; 2]) -> Option<Subunits<i64>> {
        self.fits(size, NARROW_BITS).then(|| self.narrow())
    }

    fn narrow(&self) -> Subunits<i64> {
        // Twice the square of the extent, in subunits by lattice steps, bounds what is computed, and so does the extent times a cell.
        let quarter = i128::from(i64::MAX) / 4;
        let most = (quarter / self.step).isqrt().min(quarter / self.pitch);
        Subunits {
            step: self.step as i64,
            pitch: self.pitch as i64,
            first_center: self.first_center.map(|center| center as i64),
            longest: most as i64,
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    fn decimal(text: &str) -> Decimal {
        Decimal::from_str_exact(text).unwrap()
    }

    fn lattice(x: &str, y: &str, step: &str) -> Lattice {
        Lattice::new([decimal(x), decimal(y), Decimal::ZERO], decimal(step), decimal("0.01")).unwrap()
    }

    /// Returns cells of this side whose edges are at whole multiples of it.
    pub(in crate::raster) fn aligned(resolution: Decimal) -> CellAlignment {
        CellAlignment { origin: [Decimal::ZERO; 2], resolution }
    }

    fn in_one_file(lattice: &Lattice, cell: &str, bounds: Bounds<2>) -> Result<RasterGrid, String> {
        RasterGrid::new(lattice, aligned(decimal(cell)), bounds, CellLimit::OneFile)
    }

    impl RasterGrid {
        /// Returns the grid with 128-bit numbers alone.
        pub(in crate::raster) fn without_narrow(mut self) -> RasterGrid {
            self.narrow = None;
            self
        }
    }

    #[test]
    fn edges_are_at_multiples_of_the_resolution() {
        let lattice = lattice("100.25", "-7", "0.01");
        // x from 100.25 to 102, y from -8 to -6.5.
        let bounds = Bounds { min: [0, -100], max: [175, 50] };
        let grid = in_one_file(&lattice, "0.5", bounds).unwrap();
        assert_eq!((grid.corner(), grid.size(), grid.cell_size()), ([100.0, -6.5], [4, 3], 0.5));
        let grid = in_one_file(&lattice, "1000", bounds).unwrap();
        assert_eq!((grid.corner(), grid.size()), ([0.0, 0.0], [1, 1]));
        // A terrain that is a line on an edge.
        let grid = in_one_file(&lattice, "0.25", Bounds { min: [0, 0], max: [0, 0] }).unwrap();
        assert_eq!((grid.corner(), grid.size()), ([100.25, -7.0], [1, 1]));
    }

    #[test]
    fn the_origin_is_a_corner_of_a_cell_and_of_a_file() {
        let lattice = lattice("100", "-7", "0.5");
        // x from 100 to 102, y from -8 to -6.5; centres are at whole numbers.
        let bounds = Bounds { min: [0, -2], max: [4, 1] };
        for origin in [["0.5", "0.5"], ["-300.5", "1000.5"]] {
            let alignment = CellAlignment { origin: origin.map(decimal), resolution: Decimal::ONE };
            let grid = RasterGrid::new(&lattice, alignment, bounds, CellLimit::OneFile).unwrap();
            assert_eq!((grid.corner(), grid.size()), ([99.5, -6.5], [3, 2]), "{origin:?}");
            assert_eq!(grid.cells_within(bounds), [[0, 3], [0, 2]]);
        }
        // 512 cells west of this origin and 512 north of it is a cut.
        let alignment = CellAlignment { origin: ["612.5", "-519.5"].map(decimal), resolution: Decimal::ONE };
        let grid = RasterGrid::new(&lattice, alignment, bounds, CellLimit::Files(512)).unwrap();
        let files = grid.files(side(512));
        assert_eq!(files, [[[0, 1], [0, 1]], [[1, 3], [0, 1]], [[0, 1], [1, 2]], [[1, 3], [1, 2]]]);
        assert_eq!(grid.part(files[3]).corner(), [100.5, -7.5]);
        let far = CellAlignment { origin: ["10000000000000000000000000", "0"].map(decimal), ..alignment };
        assert!(RasterGrid::new(&lattice, far, bounds, CellLimit::OneFile).unwrap_err().contains("too many digits"));
    }

    #[test]
    fn a_coordinate_knows_the_centres_beside_it() {
        // Centres at 0.25, 0.75 and so on; lattice places are quarters.
        let grid = in_one_file(&lattice("0", "0", "0.25"), "0.5", Bounds { min: [0, 0], max: [8, 8] }).unwrap();
        let beside = |place| {
            let Beside { from, past } = grid.narrow().unwrap().beside(0, place, 4);
            (from, past)
        };
        assert_eq!([-9, 0, 1, 2, 3, 8, 99].map(beside), [(0, 0), (0, 0), (0, 1), (1, 1), (1, 2), (4, 4), (4, 4)]);
        assert_eq!(grid.cells_within(Bounds { min: [1, 4], max: [2, 7] }), [[0, 1], [0, 2]]);
    }

    #[test]
    fn a_raster_that_is_too_fine_says_what_would_do() {
        let bounds = Bounds { min: [0, 0], max: [1_000_000, 1_000_000] };
        let grid = |cell: &str| in_one_file(&lattice("0", "0", "1"), cell, bounds);
        let said = grid("0.5").unwrap_err();
        assert!(
            said.starts_with("makes 2000000 x 2000000 cells, 16000 GB") && said.contains("set 2.0 or more"),
            "{said}"
        );
        assert!(grid("2.0").is_ok());
        assert_eq!([0.00123, 0.99, 9.91, 38.1, 381.4].map(two_digits), ["0.0013", "0.99", "10.0", "39", "390"]);
        let long = grid("2.0000000000000000000000001").unwrap_err();
        assert!(long.contains("too many digits"), "{long}");
    }

    #[test]
    fn the_last_overview_fits_a_block() {
        let grid = in_one_file(&lattice("0", "0", "1"), "1", Bounds { min: [0, 0], max: [1500, 513] }).unwrap();
        assert_eq!(grid.levels(), [[1500, 513], [750, 257], [375, 129]]);
        assert_eq!(blocks([1500, 513]), [3, 2]);
    }

    #[test]
    fn a_narrow_grid_has_no_more_files_than_a_wide_one() {
        let corridor = Bounds { min: [0, 0], max: [40_000_000, 400] };
        let grid =
            |side| RasterGrid::new(&lattice("0", "0", "1"), aligned(decimal("1")), corridor, CellLimit::Files(side));
        assert!(grid(512).unwrap_err().contains("at most 65536 files"));
        assert!(grid(2048).is_ok());
    }

    fn side(cells: u32) -> Option<FileSide> {
        FileSide::try_from(cells).ok()
    }

    #[test]
    fn files_are_cut_at_whole_multiples_and_hold_every_cell_once() {
        let bounds = Bounds { min: [-700, -1300], max: [900, 20] };
        let grid =
            RasterGrid::new(&lattice("0", "0", "1"), aligned(decimal("1")), bounds, CellLimit::Files(512)).unwrap();
        let files = grid.files(side(512));
        let mut cells = 0;
        for &[columns, rows] in &files {
            let part = grid.part([columns, rows]);
            cells += part.cells();
            let [west, north] = part.corner().map(|edge| edge as i64);
            assert!(columns[0] == 0 || west % 512 == 0, "{west}");
            assert!(rows[0] == 0 || north % 512 == 0, "{north}");
            let [middle, its] = [grid.wide().center(0, columns[0] + 3), part.wide().center(0, 3)];
            assert_eq!(middle, its);
            assert_eq!(grid.wide().center(1, rows[0] + 3), part.wide().center(1, 3));
        }
        // Columns from -700 to 900 are cut at -512, 0 and 512; rows from 20 down to -1300 at 0, -512 and -1024.
        assert_eq!((files.len(), cells), (16, grid.cells()));
        assert_eq!(
            grid.files(side(1 << 19)),
            [[[0, 700], [0, 20]], [[700, 1600], [0, 20]], [[0, 700], [20, 1320]], [[700, 1600], [20, 1320]]]
        );
    }

    #[test]
    fn two_lattices_have_the_same_cells() {
        let (coarse, fine) = (lattice("100", "-7", "0.5"), lattice("90.25", "3", "0.01"));
        let grid = in_one_file(&coarse, "1", Bounds { min: [0, -2], max: [4, 1] }).unwrap();
        let other = grid.on_lattice(&fine).unwrap();
        assert_eq!((other.corner(), other.size()), (grid.corner(), grid.size()));
        // x from 100 to 101 and y from -7.5 to -7, on both lattices.
        let cells = grid.cells_within(Bounds { min: [0, -1], max: [2, 0] });
        assert_eq!(other.cells_within(Bounds { min: [975, -1050], max: [1075, -1000] }), cells);
        assert_eq!(cells, [[0, 1], [1, 2]]);
    }

    proptest! {
        #[test]
        fn centres_are_where_decimals_say(
            offset in -1_000_000_000i64..1_000_000_000,
            step in 1i64..5_000,
            cell in 1i64..5_000_000,
            place in -30_000i32..30_000,
            origin in -1_000_000_000i64..1_000_000_000,
        ) {
            let lattice = Lattice::new([Decimal::new(offset, 4); 3], Decimal::new(step, 4), Decimal::ONE).unwrap();
            let bounds = Bounds { min: [-30_000; 2], max: [30_000; 2] };
            let alignment = CellAlignment { origin: [Decimal::new(origin, 5); 2], resolution: Decimal::new(cell, 5) };
            let Ok(grid) = RasterGrid::new(&lattice, alignment, bounds, CellLimit::OneFile) else { return Ok(()) };
            let [columns, rows] = grid.size();
            // In units of 5 decimals: the coordinate, and the first centres, which are half a cell inside.
            let world = |place: i32| i128::from(offset) * 20 + i128::from(step) * i128::from(place) * 20;
            let west = (grid.corner()[0] * 1e5).round() as i128;
            let north = (grid.corner()[1] * 1e5).round() as i128;
            prop_assert_eq!([(west - i128::from(origin)) % i128::from(cell), (north - i128::from(origin)) % i128::from(cell)], [0, 0]);
            let centre = |column: u32| 2 * west + (2 * i128::from(column) + 1) * i128::from(cell);
            for subunits in [grid.narrow().map(|s| s.beside(0, place, columns)), Some(grid.wide().beside(0, place, columns))] {
                let Beside { from, past } = subunits.unwrap();
                prop_assert!(from == columns || centre(from) >= world(place));
                prop_assert!(from == 0 || centre(from - 1) < world(place));
                prop_assert!(past == columns || centre(past) > world(place));
                prop_assert!(past == 0 || centre(past - 1) <= world(place));
            }
            let Beside { from, .. } = grid.wide().beside(1, -place, rows);
            let centre = |row: u32| 2 * north - (2 * i128::from(row) + 1) * i128::from(cell);
            prop_assert!(from == rows || centre(from) <= world(place));
            prop_assert!(from == 0 || centre(from - 1) > world(place));
        }
    }
}
