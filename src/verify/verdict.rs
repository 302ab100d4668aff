//! What verification found, for people and programs.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use crate::geometry::Site;
use crate::verify::exact::cross;
use crate::verify::part::Findings;
use crate::verify::rim::{Matched, Vertices};
use crate::verify::{Report, hull};

/// The figures of a verified mesh, and what does not hold.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// Tile files.
    pub tiles: u64,
    /// Distinct vertices.
    pub sites: u64,
    /// Triangles of all tiles, and those that were left out.
    pub triangles: u64,
    /// Those of them that `max_edge` left out of the terrain.
    pub cut: u64,
    /// Edges with a triangle on one side only.
    pub hull_edges: u64,
    /// Edges whose two triangles are in different tiles.
    pub edges_across_tiles: u64,
    /// Edges whose two triangles have all four corners on one circle.
    pub ties: u64,
    /// Says which triangles the mesh has, however it is tiled: 32 hexadecimal digits.
    pub digest: String,
    /// What does not hold, in sentences; empty where the mesh is the exact Delaunay triangulation.
    pub failures: Vec<String>,
    /// What cannot be proved of this mesh, where that is so: triangles were left out, and the files that hold them are gone.
    pub unproved: Option<String>,
}

impl Verdict {
    pub(super) fn new(
        tiles: usize,
        mut findings: Findings,
        matched: Matched,
        vertices: Vertices,
        report: Report,
        names: &[String],
    ) -> Verdict {
        let mut verdict = Verdict {
            tiles: tiles as u64,
            sites: findings.inner_sites + vertices.distinct,
            triangles: findings.triangles,
            cut: findings.cut,
            hull_edges: matched.hull.len() as u64,
            edges_across_tiles: matched.across_tiles,
            ties: findings.ties + matched.ties,
            digest: findings.digest.to_string(),
            failures: Vec::new(),
            unproved: None,
        };
        findings.faults.merge(matched.faults);
        findings.faults.merge(vertices.faults);
        verdict.failures = findings.faults.sentences(names);
        let gone = report.cut_triangles.filter(|&said| said > 0 && verdict.cut == 0);
        if let Some(gone) = gone {
            verdict.unproved = Some(format!(
                "{gone} triangles were left out (max_edge) and there is no cut/ to say which: no edge is used twice in one \
                 direction, and those with two triangles are Delaunay; whether triangles overlap or sites are missing is not known"
            ));
        } else {
            verdict.check_outline(matched.hull, findings.area);
            verdict.check_euler();
            verdict.check_number("sites", verdict.sites, report.sites);
            verdict.check_number("triangles left out", verdict.cut, report.cut_triangles);
        }
        verdict.check_number("triangles", verdict.triangles - verdict.cut, report.triangles);
        if report.sites.is_none() && verdict.unproved.is_none() {
            verdict.unproved =
                Some("that no site is missing: there is no report.json that says how many there are".into());
        }
        verdict
    }

    /// Whether the tiles are the exact Delaunay triangulation, as far as can be told: see [`Verdict::unproved`].
    pub fn holds(&self) -> bool {
        self.failures.is_empty()
    }

    fn check_outline(&mut self, edges: Vec<[Site; 2]>, area: i128) {
        let enclosed: i128 = edges.iter().map(|&[a, b]| cross(a, b)).sum();
        if let Err(failure) = hull::check(edges) {
            self.failures.push(failure);
        }
        if enclosed != area {
            self.failures.push(format!(
                "the triangles have an area of {area} half square lattice steps, the boundary encloses {enclosed}"
            ));
        }
    }

    fn check_euler(&mut self) {
        let euler = 2 * self.sites as i128 - self.hull_edges as i128 - 2;
        if self.triangles as i128 != euler {
            self.failures.push(format!(
                "{} triangles, where {} sites and {} hull edges make {euler} (Euler)",
                self.triangles, self.sites, self.hull_edges
            ));
        }
    }

    fn check_number(&mut self, name: &str, here: u64, said: Option<u64>) {
        if let Some(said) = said.filter(|&said| said != here) {
            self.failures.push(format!("{here} {name}, where report.json says {said}"));
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let figures = [
            ("tiles", self.tiles),
            ("sites", self.sites),
            ("triangles", self.triangles),
            ("hull edges", self.hull_edges),
            ("edges across tiles", self.edges_across_tiles),
            ("ties", self.ties),
        ];
        for (name, figure) in figures {
            writeln!(f, "{name:<20}{figure:>34}")?;
        }
        if self.cut > 0 {
            writeln!(f, "{:<20}{:>34}", "left out of these", self.cut)?;
        }
        writeln!(f, "{:<20}{:>34}", "digest", self.digest)?;
        for failure in &self.failures {
            writeln!(f, "FAILS: {failure}")?;
        }
        if let Some(unproved) = &self.unproved {
            writeln!(f, "not proved: {unproved}")?;
        }
        let verdict = match (self.holds(), self.unproved.is_some()) {
            (true, false) => "the exact Delaunay triangulation",
            (true, true) => "Delaunay as far as can be told",
            (false, _) => "not the Delaunay triangulation",
        };
        writeln!(f, "{:<20}{verdict:>34}", "verdict")
    }
}

/// What can be wrong in many places.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Fault {
    Unreadable,
    OffLattice,
    NotCounterclockwise,
    Overused,
    NotDelaunay,
    Unused,
    PlaceDiffers,
    ShadingDiffers,
}

impl Fault {
    fn sentence(self) -> &'static str {
        match self {
            Fault::Unreadable => "tiles that cannot be used",
            Fault::OffLattice => "vertices not on the lattice",
            Fault::NotCounterclockwise => "triangles not counterclockwise",
            Fault::Overused => "edges used more than once in one direction",
            Fault::NotDelaunay => "edges not Delaunay",
            Fault::Unused => "vertices without a triangle",
            Fault::PlaceDiffers => "sites at different places in different tiles",
            Fault::ShadingDiffers => "sites with different normals or colours in different tiles",
        }
    }
}

/// How often every fault was found, with one example: the first of the first tile, so that it is always the same.
#[derive(Debug, Default)]
pub(super) struct Faults(BTreeMap<Fault, Sightings>);

#[derive(Debug)]
struct Sightings {
    count: u64,
    tile: u32,
    example: String,
}

impl Faults {
    pub(super) fn note(&mut self, fault: Fault, tile: u32, example: impl FnOnce() -> String) {
        self.add(fault, 1, tile, example);
    }

    pub(super) fn merge(&mut self, other: Faults) {
        for (fault, Sightings { count, tile, example }) in other.0 {
            self.add(fault, count, tile, || example);
        }
    }

    fn add(&mut self, fault: Fault, count: u64, tile: u32, example: impl FnOnce() -> String) {
        match self.0.get_mut(&fault) {
            None => {
                self.0.insert(fault, Sightings { count, tile, example: example() });
            }
            Some(known) => {
                known.count += count;
                if tile < known.tile {
                    (known.tile, known.example) = (tile, example());
                }
            }
        }
    }

    fn sentences(&self, names: &[String]) -> Vec<String> {
        let sentence = |(fault, seen): (&Fault, &Sightings)| {
            let name = names.get(seen.tile as usize).map_or("?", String::as_str);
            format!("{} {}, the first in {name}: {}", seen.count, fault.sentence(), seen.example)
        };
        self.0.iter().map(sentence).collect()
    }
}
