//! Proves that the edges of `breaklines.csv` are edges of the mesh, at the heights that it says, and that no vertex lies in one of their
//! closed discs.
//!
//! An edge ab of a Delaunay triangulation has no vertex in the closed disc with the diameter ab if this holds for the third corners of its
//! triangles: on the side of such a corner the disc is a part of the triangle's circle, which has no vertex inside.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::failures::Failure;
use crate::findings::Findings;
use delaunay::geometry::Site;
use lattice::Lattice;
use sys::{Error, Result};
use terrain::SourceGrid;
use tiles::breakline_list::{HEADER, ends_of};
use tiles::file_names::OutputFiles;

/// What an edge takes in memory for each byte of its line, with its ends and what finds them.
const BYTES_PER_BYTE: u64 = 3;

/// The edges that the mesh must have.
#[derive(Default)]
pub(super) struct BreaklineEdges {
    /// Both ends, the lesser first, sorted.
    edges: Vec<[Site; 2]>,
    is_found: Vec<AtomicBool>,
    heights: HashMap<Site, i32>,
    /// What is wrong with the list itself.
    failure: Option<String>,
}

/// Where a job with breaklines may have dropped points: in the discs of edges, and between edges alone, as in lakes.
pub(super) struct DroppedZones<'a> {
    lines: &'a BreaklineEdges,
    /// No edge is longer than the side of a cell along x or y.
    side: i64,
    /// The edges by the cell that their middle lies in.
    by_cell: HashMap<[i64; 2], Vec<[Site; 2]>>,
}

impl DroppedZones<'_> {
    /// Tells whether a point, which lies in this `triangle` if in any, may have been dropped.
    pub(super) fn hold(&self, point: Site, triangle: Option<[Site; 3]>) -> bool {
        let is_end = |corner: &Site| self.lines.heights.contains_key(corner);
        if triangle.is_some_and(|corners| corners.iter().all(is_end)) {
            return true;
        }
        let [column, row] = point.map(|value| i64::from(value).div_euclid(self.side));
        let cells = (-1..=1).flat_map(|down| (-1..=1).map(move |right| [column + right, row + down]));
        let mut near = cells.filter_map(|cell| self.by_cell.get(&cell)).flatten();
        near.any(|&[a, b]| is_in_disc(a, b, point))
    }
}

impl BreaklineEdges {
    /// Reads the list in the output `directory` of a job, which lies on its `lattice`; `None` if there is none.
    ///
    /// # Errors
    /// [`Error::Memory`] if `memory` bytes do not hold it, [`Error::Io`] if it cannot be read, and those of `lattice`.
    pub(super) fn read(
        directory: &Path,
        lattice: impl FnOnce() -> Result<Lattice>,
        memory: u64,
    ) -> Result<Option<BreaklineEdges>> {
        let path = OutputFiles::new(directory).breaklines();
        let file = match File::open(&path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
            file => file.map_err(Error::io("read", &path))?,
        };
        let bytes = file.metadata().map_err(Error::io("read", &path))?.len();
        let taken = bytes.saturating_mul(BYTES_PER_BYTE);
        if taken > memory {
            let wanted = taken.saturating_mul(4) >> 20;
            return Err(Error::Memory(format!(
                "the edges along breaklines take more than there is: set --memory \"{wanted} MiB\""
            )));
        }
        let lattice = &lattice()?;
        let mut found = BreaklineEdges::default();
        for (number, line) in (1..).zip(BufReader::new(file).split(b'\n')) {
            let line = line.map_err(Error::io("read", &path))?;
            let line = String::from_utf8_lossy(&line);
            if number == 1 && line == HEADER {
                continue;
            }
            match ends_of(&line, lattice) {
                Some(ends) if number > 1 => found.add(ends),
                _ => {
                    let name = path.file_name().unwrap_or_default().to_string_lossy();
                    found.failure = Some(format!("{name}: line {number} is no edge on the lattice of the tiles"));
                    break;
                }
            }
        }
        found.edges.sort_unstable();
        found.edges.dedup();
        found.is_found = found.edges.iter().map(|_| AtomicBool::new(false)).collect();
        Ok(Some(found))
    }

    fn add(&mut self, ends: [[i32; 3]; 2]) {
        let [a, b] = ends.map(|[x, y, z]| {
            self.heights.insert([x, y], z);
            [x, y]
        });
        self.edges.push([a.min(b), a.max(b)]);
    }

    /// Returns the ends of all edges, with their heights.
    pub(super) fn sites(&self) -> impl Iterator<Item = [i32; 3]> {
        self.heights.iter().map(|(&[x, y], &z)| [x, y, z])
    }

    /// Looks for the edges among those of the `triangles` of tile number `tile`, whose vertices are `points`.
    pub(super) fn check(
        &self,
        points: &[[i32; 3]],
        triangles: &[[u32; 3]],
        tile: u32,
        grid: &SourceGrid,
        findings: &mut Findings,
    ) {
        let is_end = |point: &[i32; 3]| {
            let site = [point[0], point[1]];
            let height = self.heights.get(&site);
            if height.is_some_and(|height| *height != point[2]) {
                findings.failures.note(Failure::NotAtHeightOfLine, tile, || grid.site_text(site));
            }
            height.is_some()
        };
        let is_end: Vec<bool> = points.iter().map(is_end).collect();
        for triangle in triangles {
            for corner in 0..3 {
                let [a, b, apex] = [0, 1, 2].map(|next| triangle[(corner + next) % 3] as usize);
                if !is_end[a] || !is_end[b] {
                    continue;
                }
                let [a, b, apex] = [a, b, apex].map(|v| [points[v][0], points[v][1]]);
                let Ok(edge) = self.edges.binary_search(&[a.min(b), a.max(b)]) else { continue };
                self.is_found[edge].store(true, Ordering::Relaxed);
                if is_in_disc(a, b, apex) {
                    findings.failures.note(Failure::InDisc, tile, || grid.site_text(apex));
                }
            }
        }
    }

    /// Returns where the job may have dropped points.
    pub(super) fn zones(&self) -> DroppedZones<'_> {
        let length = |&[a, b]: &[Site; 2]| (0..2).map(|k| (i64::from(a[k]) - i64::from(b[k])).abs()).max().unwrap_or(0);
        let side = self.edges.iter().map(length).max().unwrap_or(0).max(1);
        let mut by_cell = HashMap::<[i64; 2], Vec<[Site; 2]>>::new();
        for edge in &self.edges {
            let middle = [0, 1].map(|k| (i64::from(edge[0][k]) + i64::from(edge[1][k])).div_euclid(2));
            by_cell.entry(middle.map(|value| value.div_euclid(side))).or_default().push(*edge);
        }
        DroppedZones { lines: self, side, by_cell }
    }

    /// Returns a sentence about the edges that no triangle has.
    fn missing(&self, grid: &SourceGrid) -> Option<String> {
        let mut missing = self.edges.iter().zip(&self.is_found).filter(|(_, found)| !found.load(Ordering::Relaxed));
        let ([a, b], _) = missing.next()?;
        Some(format!(
            "{} edges of breaklines.csv are not edges of the mesh, the first {}",
            missing.count() + 1,
            grid.edge_text(*a, *b)
        ))
    }
}

/// What looking for the edges has shown.
pub(super) struct CheckedBreaklines {
    /// How many edges there are.
    pub(super) edges: u64,
    /// What is wrong with the list.
    pub(super) failure: Option<String>,
    /// The edges that no triangle has.
    pub(super) missing: Option<String>,
}

impl CheckedBreaklines {
    /// Returns what is left to say once all tiles are checked.
    pub(super) fn of(edges: &BreaklineEdges, grid: &SourceGrid) -> CheckedBreaklines {
        CheckedBreaklines {
            edges: edges.edges.len() as u64,
            failure: edges.failure.clone(),
            missing: edges.missing(grid),
        }
    }
}

/// Tells whether `p` lies in the closed disc that has ab as its diameter.
fn is_in_disc(a: Site, b: Site, p: Site) -> bool {
    let along = |axis: usize| {
        let from = |end: Site| i128::from(end[axis]) - i128::from(p[axis]);
        from(a) * from(b)
    };
    along(0) + along(1) <= 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use rust_decimal::Decimal;
    use tiles::frame::Extras;

    fn lattice() -> Lattice {
        Lattice::new([Decimal::ZERO; 3], Decimal::ONE, Decimal::ONE).unwrap()
    }

    fn grid() -> SourceGrid {
        let text = r#"{"offset": [0, 0, 0], "resolution": 1, "resolution_z": 1, "metres_per_unit": 1, "metres_per_unit_z": 1}"#;
        SourceGrid::new(&serde_json::from_str::<Extras>(text).unwrap()).unwrap()
    }

    fn check(list: &str, points: &[[i32; 3]]) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(OutputFiles::new(folder.path()).breaklines(), format!("{HEADER}\n{list}")).unwrap();
        let edges = BreaklineEdges::read(folder.path(), || Ok(lattice()), 1 << 20).unwrap().unwrap();
        let mut findings = Findings::default();
        edges.check(points, &[[0, 1, 2], [2, 1, 3]], 0, &grid(), &mut findings);
        let mut found = findings.failures.sentences(|_| "a tile".into());
        found.extend(edges.missing(&grid()));
        found.extend(edges.failure);
        found
    }

    const POINTS: [[i32; 3]; 4] = [[0, 0, 5], [10, 0, 5], [5, 9, 7], [16, 9, 5]];

    #[test]
    fn every_edge_is_looked_for_at_its_heights() {
        assert_eq!(check("0,0,5,10,0,5,line\n10,0,5,5,9,7,river\n", &POINTS), [""; 0]);
        for (list, word) in [
            ("0,0,5,16,9,5,line\n", "1 edges of breaklines.csv are not edges of the mesh"),
            ("0,0,6,10,0,5,line\n", "1 vertices at another height than their breakline"),
            ("0,0,5,10,0.5,5,line\n", "line 2 is no edge"),
            ("rubbish", "line 2 is no edge"),
        ] {
            let found = check(list, &POINTS);
            assert!(found.len() == 1 && found[0].contains(word), "{list}: {found:?}");
        }
    }

    #[test]
    fn a_vertex_in_the_closed_disc_is_found() {
        // A right angle is in the closed disc.
        for (apex, is_in) in [([5, 5, 7], true), ([5, 6, 7], false), ([4, 1, 7], true)] {
            let points = [POINTS[0], POINTS[1], apex, POINTS[3]];
            let found = check("0,0,5,10,0,5,line\n", &points);
            assert_eq!(found.iter().any(|sentence| sentence.contains("closed disc")), is_in, "{apex:?}: {found:?}");
        }
    }

    #[test]
    fn a_directory_without_a_list_has_no_edges() {
        let folder = tempfile::tempdir().unwrap();
        assert!(BreaklineEdges::read(folder.path(), || Ok(lattice()), 1).unwrap().is_none());
    }
}
