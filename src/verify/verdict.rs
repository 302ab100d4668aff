//! What verification found, for people and programs.

use std::fmt;

use serde::Serialize;

use crate::geometry::Site;
use crate::verify::border_matching::BorderMatches;
use crate::verify::exact::cross;
use crate::verify::findings::Findings;
use crate::verify::hull::check_boundary;
use crate::verify::reported_counts::ReportedCounts;

/// The counts of a verified mesh, and what does not hold.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// Tile files.
    pub tiles: u64,
    /// Distinct vertices.
    pub sites: u64,
    /// Triangles in `tiles/` and in `cut/`.
    pub triangles: u64,
    /// The triangles in `cut/`, which `max_edge` left out of the terrain.
    pub cut: u64,
    /// Edges with a triangle on one side only.
    pub hull_edges: u64,
    /// Edges whose two triangles are in different tiles.
    pub edges_across_tiles: u64,
    /// Edges whose two triangles have all four corners on one circle.
    pub ties: u64,
    /// 32 hexadecimal digits that depend on the triangles of the mesh, not on the tiles: see [`Digest`](crate::verify::Digest).
    pub digest: String,
    /// What does not hold, in sentences; empty if the mesh is the exact Delaunay triangulation.
    pub failures: Vec<String>,
    /// What could not be proved: the files of the triangles that were left out are gone, or there is no report.
    pub unproved: Option<String>,
}

impl Verdict {
    /// Draws the conclusion from all findings; `tiles` is the number of the terrain's tiles, `names` are those of all files.
    pub(super) fn new(
        tiles: usize,
        mut findings: Findings,
        matches: BorderMatches,
        reported: ReportedCounts,
        names: &[String],
    ) -> Verdict {
        let mut verdict = Verdict {
            tiles: tiles as u64,
            sites: findings.inner_sites + matches.sites,
            triangles: findings.triangles,
            cut: findings.cut_triangles,
            hull_edges: matches.hull.len() as u64,
            edges_across_tiles: matches.edges_across_tiles,
            ties: findings.ties + matches.ties,
            digest: findings.digest.to_string(),
            failures: Vec::new(),
            unproved: None,
        };
        findings.failures.merge(matches.failures);
        verdict.failures = findings.failures.sentences(names);
        let gone = reported.cut_triangles.filter(|&count| count > 0 && verdict.cut == 0);
        if let Some(gone) = gone {
            verdict.unproved = Some(format!(
                "{gone} triangles were left out (max_edge), and the folder cut/ that should hold them is gone: no edge is used twice in \
                 one direction, and all edges with two triangles are Delaunay, but triangles may overlap and sites may be missing"
            ));
        } else {
            verdict.check_hull(matches.hull, findings.double_area);
            verdict.check_euler();
            verdict.check_count("sites", verdict.sites, reported.sites);
            verdict.check_count("triangles left out", verdict.cut, reported.cut_triangles);
        }
        verdict.check_count("triangles", verdict.triangles - verdict.cut, reported.triangles);
        if reported.sites.is_none() && verdict.unproved.is_none() {
            verdict.unproved =
                Some("sites may be missing: there is no report.json that says how many there are".into());
        }
        verdict
    }

    /// Whether the tiles are the exact Delaunay triangulation, except for what [`Verdict::unproved`] says.
    pub fn holds(&self) -> bool {
        self.failures.is_empty()
    }

    fn check_hull(&mut self, edges: Vec<[Site; 2]>, double_area: i128) {
        let enclosed: i128 = edges.iter().map(|&[a, b]| cross(a, b)).sum();
        if let Err(error) = check_boundary(edges) {
            self.failures.push(error.to_string());
        }
        if enclosed != double_area {
            self.failures.push(format!(
                "the triangles have an area of {double_area} half square lattice steps, the boundary encloses {enclosed}"
            ));
        }
    }

    fn check_euler(&mut self) {
        let euler = 2 * self.sites as i128 - self.hull_edges as i128 - 2;
        if self.triangles as i128 != euler {
            self.failures.push(format!(
                "there are {} triangles, but {} sites and {} hull edges need {euler} (Euler)",
                self.triangles, self.sites, self.hull_edges
            ));
        }
    }

    fn check_count(&mut self, name: &str, counted: u64, reported: Option<u64>) {
        if let Some(reported) = reported.filter(|&reported| reported != counted) {
            self.failures.push(format!("{counted} {name}, where report.json says {reported}"));
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counts = [
            ("tiles", self.tiles),
            ("sites", self.sites),
            ("triangles", self.triangles),
            ("hull edges", self.hull_edges),
            ("edges across tiles", self.edges_across_tiles),
            ("ties", self.ties),
        ];
        for (name, count) in counts {
            writeln!(f, "{name:<20}{count:>34}")?;
        }
        if self.cut > 0 {
            writeln!(f, "{:<20}{:>34}", "triangles left out", self.cut)?;
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
            (true, true) => "Delaunay, as far as it is proved",
            (false, _) => "not the Delaunay triangulation",
        };
        writeln!(f, "{:<20}{verdict:>34}", "verdict")
    }
}
