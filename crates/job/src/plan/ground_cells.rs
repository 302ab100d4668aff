//! How many cells the ground of `surface = "bare-earth"` takes, and whether the memory has room for them: by a sample of the points before they are
//! read, and by all of them then.

use crate::options::JobOptions;
use crate::plan::budget::{limit_for, working_memory};
use crate::progress::number_text::{grouped, mebibytes};
use ground::{BYTES_PER_CELL, CellCount, CoveredArea, MetricLattice, PointCollector};
use serde::{Deserialize, Serialize};

/// The most cells of the ground of a sample. They do not depend on `[limits] memory`: the colours depend on the sample.
pub(crate) const MOST_SAMPLE_CELLS: u64 = 1 << 21;

/// With fewer points, a sample does not tell how far apart all are.
const TELLING_SAMPLE: u64 = 4096;

/// All points may be so many times as far apart as a sample shows, to be sure.
const SURELY: f64 = 1.25;

/// What a plan knows of the cells of the ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GroundCells {
    /// How many there are for sure.
    pub(crate) least: u64,
    /// About how many there are if points lie everywhere in the boxes that headers claim.
    pub(crate) about: u64,
    /// Whether most of them are there for few points.
    pub(crate) is_scattered: bool,
}

/// What is known of a cloud before its points are read.
pub(crate) struct KnownCloud<'a> {
    pub(crate) lattice: MetricLattice,
    /// The sides of the boxes that headers claim, in metres.
    pub(crate) boxes: &'a [[f64; 2]],
    /// The sides of the box around all of them.
    pub(crate) extent: [f64; 2],
    /// The records that are decoded.
    pub(crate) records: u64,
    /// Those that the sample has seen.
    pub(crate) seen: u64,
    /// Those of them that the job keeps, as lattice integers.
    pub(crate) sample: &'a mut dyn Iterator<Item = [i32; 3]>,
}

impl GroundCells {
    /// Estimates the cells of a cloud.
    pub(crate) fn of(cloud: KnownCloud) -> GroundCells {
        let KnownCloud { lattice, boxes, extent, records, seen, sample } = cloud;
        let mut kept = 0u64;
        let mut area = CoveredArea::new(lattice);
        area.add(sample.inspect(|_| kept += 1));
        if kept == 0 {
            return GroundCells { least: 0, about: 0, is_scattered: false };
        }
        let times = (records as f64 / seen.max(1) as f64).max(1.0);
        // Fewer points cover no more of the squares for a point than all do. Where they have squares for themselves, they show nothing.
        let by_sample = if area.shows_density() { area.spacing() } else { f64::INFINITY };
        let square_metres = boxes.iter().map(|[width, height]| width * height).sum::<f64>().min(extent[0] * extent[1]);
        let spacing = by_sample.min((square_metres / (kept as f64 * times)).sqrt());
        // Boxes of neighbours have blocks in common: those of the whole are fewer then.
        let of_boxes = [boxes, &[extent]].map(|all| CellCount::of_rectangles(all, lattice, spacing).cells());
        let by_boxes = of_boxes[0].min(of_boxes[1]);
        // All points touch no more blocks than each point of the sample does, times the points that it stands for.
        let of_sample = area.cell_count_for(spacing);
        let extended = (of_sample.cells() as f64 * times) as u64;
        // The whole goes by squares too, which are more than a thin box.
        let tells = by_sample.is_finite() && (kept >= TELLING_SAMPLE || times == 1.0);
        let least = if tells { area.least_cells(SURELY * by_sample) } else { 0 };
        GroundCells {
            least,
            about: extended.min(by_boxes).max(least),
            is_scattered: of_sample.is_scattered() && extended < by_boxes / 4,
        }
    }

    /// Returns what is wrong if the memory has no room for the cells that there are for sure.
    pub(crate) fn too_many(self, options: &JobOptions) -> Option<String> {
        let GroundCells { least, about, is_scattered } = self;
        (!has_room(options, least)).then(|| refusal(options, "at least ", least, (about, is_scattered)))
    }

    /// Returns a warning if the memory may have no room for the ground.
    pub(crate) fn warning(self, options: &JobOptions) -> Option<String> {
        let GroundCells { about, is_scattered, .. } = self;
        (!has_room(options, about)).then(|| {
            format!(
                "surface = \"bare-earth\" stops for lack of memory if points cover all of the area: its {} cells of ground take {}, more than \
                 [limits] memory = \"{}\" allows; fix: {}",
                grouped(about),
                mebibytes(bytes_of(about)),
                options.limits.memory,
                remedy(about, is_scattered)
            )
        })
    }

    /// Returns the bytes that the ground takes, no more than it may.
    pub(crate) fn bytes(self, options: &JobOptions) -> u64 {
        bytes_of(self.about).min(working_memory(options))
    }
}

/// Returns what is wrong if the memory has no room for the ground of a cloud of which all points are known.
pub(crate) fn too_many_cells(options: &JobOptions, count: CellCount) -> Option<String> {
    let cells = count.cells();
    (!has_room(options, cells)).then(|| refusal(options, "", cells, (cells, count.is_scattered())))
}

/// Returns what is wrong if the memory has no room even for the squares with points of an `area` of which not all points are known. The plan has
/// `known` about its cells.
pub(crate) fn too_many_squares(options: &JobOptions, area: &CoveredArea, known: Option<GroundCells>) -> Option<String> {
    (!has_room(options, area.squares())).then(|| {
        let count = area.cell_count();
        let about = known.map_or(0, |known| known.about).max(count.cells());
        refusal(options, "at least ", count.cells(), (about, count.is_scattered()))
    })
}

/// Tells whether the memory has room for the ground in so many cells.
fn has_room(options: &JobOptions, cells: u64) -> bool {
    bytes_of(cells) <= working_memory(options)
}

/// Returns the bytes that the ground in so many cells takes.
fn bytes_of(cells: u64) -> u64 {
    cells.saturating_mul(BYTES_PER_CELL)
}

/// Says that the memory has no room for so many `cells`. With memory for `about` so many it has.
fn refusal(options: &JobOptions, at_least: &str, cells: u64, (about, is_scattered): (u64, bool)) -> String {
    format!(
        "surface = \"bare-earth\" takes {at_least}{} for {} cells of ground, more than [limits] memory = \"{}\" allows; fix: {}",
        mebibytes(bytes_of(cells)),
        grouped(cells),
        options.limits.memory,
        remedy(about, is_scattered)
    )
}

/// Returns what a user can do about so many cells.
fn remedy(cells: u64, is_scattered: bool) -> String {
    let limit = limit_for(bytes_of(cells));
    match is_scattered {
        true => format!(
            "[input] bounds without the points that lie far from all others, which take most of it, or [limits] memory = \"{limit}\""
        ),
        false => format!("[limits] memory = \"{limit}\", or a smaller area with [input] bounds or clip"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::{Limits, MemoryLimit};

    const LATTICE: MetricLattice = MetricLattice { horizontal: 0.01, vertical: 0.01, offset: [0; 2] };

    fn options(memory: u64) -> JobOptions {
        let text = r#"{"input":{"files":[]},"triangulation":{"backend":"auto"},"gpu":{"voronoi":"auto","adapter":null,"texture":"auto"},
            "output":{"directory":"out"},"limits":{}}"#;
        let options: JobOptions = serde_json::from_str(text).unwrap();
        JobOptions { limits: Limits { memory: MemoryLimit(memory), ..Limits::default() }, ..options }
    }

    /// Points `step` metres apart in a square of so many on a side.
    fn square(side: i32, step: i32) -> impl Iterator<Item = [i32; 3]> + Clone {
        (0..side * side).map(move |number| [number % side * step * 100, number / side * step * 100, 0])
    }

    /// The cells of all points, and what 128 places of 512 points tell of them.
    fn known(points: &[[i32; 3]]) -> (CellCount, GroundCells) {
        let mut area = CoveredArea::new(LATTICE);
        area.add(points.iter().copied());
        let side = |axis: usize| {
            let values = points.iter().map(|point| point[axis]);
            f64::from(values.clone().max().unwrap() - values.min().unwrap()) * LATTICE.horizontal
        };
        let places = (0..128).map(|place| place * points.len() / 128);
        let sample: Vec<[i32; 3]> = places.flat_map(|first| points.iter().skip(first).take(512)).copied().collect();
        let cloud = KnownCloud {
            lattice: LATTICE,
            boxes: &[[side(0), side(1)]],
            extent: [side(0), side(1)],
            records: points.len() as u64,
            seen: sample.len() as u64,
            sample: &mut sample.iter().copied(),
        };
        (area.cell_count(), GroundCells::of(cloud))
    }

    fn limit_in(text: &str) -> u64 {
        let (_, after) = text.rsplit_once("memory = \"").unwrap();
        MemoryLimit::try_from(after.split_once('"').unwrap().0.to_owned()).unwrap().0
    }

    #[test]
    fn a_cloud_that_fills_its_box_is_known_before_it_is_read() {
        for (side, step) in [(1500, 1), (1000, 2), (500, 30)] {
            let points: Vec<[i32; 3]> = square(side, step).collect();
            let (all, known) = known(&points);
            let ratio = known.about as f64 / all.cells() as f64;
            assert!(
                (0.8..1.5).contains(&ratio) && known.least <= all.cells() && !known.is_scattered,
                "{all:?}, {known:?}"
            );
        }
    }

    #[test]
    fn a_corridor_across_its_box_is_not_refused() {
        let points: Vec<[i32; 3]> =
            (0..600_000).map(|n| [n / 10 * 100 + n % 10, n / 10 * 90 + n % 10 * 100, 0]).collect();
        let (all, known) = known(&points);
        assert!(known.least <= all.cells() && known.about >= all.cells() / 2, "{all:?}, {known:?}");
    }

    #[test]
    fn far_points_among_many_are_refused_before_they_are_read() {
        let far =
            |n: i32| [(n as i64 * 7_919_777 % 20_000_000) as i32, (n as i64 * 104_729_333 % 20_000_000) as i32, 0];
        // Every fiftieth point lies anywhere within 200 km.
        let points: Vec<[i32; 3]> =
            square(1000, 1).enumerate().map(|(n, point)| if n % 50 == 7 { far(n as i32) } else { point }).collect();
        let (all, known) = known(&points);
        assert!(known.least > 1000 * 4096 && known.least <= all.cells() && known.is_scattered, "{all:?}, {known:?}");
        let ratio = known.about as f64 / all.cells() as f64;
        assert!((0.5..2.0).contains(&ratio), "{all:?}, {known:?}");
        let why = known.too_many(&options(256 << 20)).unwrap();
        assert!(why.contains("fix: [input] bounds without the points that lie far from all others"), "{why}");
    }

    #[test]
    fn the_memory_that_a_message_names_has_room_for_the_ground() {
        let small = options(256 << 20);
        for blocks in [900, 1_000, 12_345, 1_000_000] {
            let count = CellCount { blocks, lone: 0 };
            let why = too_many_cells(&small, count).unwrap();
            assert!(!why.contains("far from") && too_many_cells(&options(limit_in(&why)), count).is_none(), "{why}");
        }
        assert_eq!(too_many_cells(&small, CellCount { blocks: 700, lone: 0 }), None);
        let known = GroundCells { least: 5_000_000, about: 20_000_000, is_scattered: false };
        let texts = [known.too_many(&small).unwrap(), known.warning(&small).unwrap()];
        for text in texts {
            assert_eq!(known.warning(&options(limit_in(&text))), None, "{text}");
        }
        assert_eq!(GroundCells { least: 3_000_000, ..known }.too_many(&small), None);
        assert_eq!(known.bytes(&small), 192 << 20);
    }

    #[test]
    fn squares_that_do_not_fit_are_enough_to_stop() {
        let mut area = CoveredArea::new(LATTICE);
        area.add(square(700, 30));
        assert_eq!(too_many_squares(&options(128 << 20), &area, None), None);
        area.add(square(1800, 10));
        let why = too_many_squares(&options(128 << 20), &area, None).unwrap();
        assert!(why.contains("takes at least ") && limit_in(&why) > 128 << 20, "{why}");
    }
}
