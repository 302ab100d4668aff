//! What verification found, for people and programs.

use std::fmt;

use serde::Serialize;

use crate::border_matching::BorderMatches;
use crate::breaklines::CheckedBreaklines;
use crate::exact::cross;
use crate::findings::Findings;
use crate::hull::check_boundary;
use crate::inputs::InputProof;
use crate::report::{ReadReport, ReportedFacts};
use crate::terrain_tiles::TerrainTiles;
use crate::tile_files::TileFiles;
use crate::written_files::WrittenFiles;
use delaunay::geometry::Site;
use lattice::VertexDigest;

/// The counts of a verified mesh, and what does not hold.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Verdict {
    /// Tile files.
    pub tiles: u64,
    /// Distinct vertices.
    pub sites: u64,
    /// Triangles in `tiles/` and in `cut/`.
    pub triangles: u64,
    /// The triangles in `cut/`, which `hull` or `max_edge` left out of the terrain.
    pub cut: u64,
    /// Edges with a triangle on one side only.
    pub hull_edges: u64,
    /// Edges whose two triangles are in different tiles.
    pub edges_across_tiles: u64,
    /// Edges whose two triangles have all four corners on one circle.
    pub ties: u64,
    /// Edges along breaklines, if the job had any.
    pub breaklines: Option<u64>,
    /// Terrain tiles for globes, if the job wrote some.
    pub terrain_tiles: Option<u64>,
    /// 32 hexadecimal digits that depend on the triangles of the mesh, not on the tiles: see [`Digest`](crate::Digest).
    pub digest: String,
    /// The digest of the vertices, heights included: see [`VertexDigest`].
    pub vertex_digest: String,
    /// The files that are as the job wrote them, by their checksums.
    pub files: u64,
    /// The points of the inputs that the job wanted, if the vertices were compared with them.
    pub points: Option<u64>,
    /// The greatest vertical distance of a point from the mesh, in source units, if points were compared and not all are vertices.
    pub greatest_error: Option<f64>,
    /// What does not hold, in sentences.
    pub failures: Vec<String>,
    /// What could not be proved because something is missing: `cut/`, the report, or another file.
    pub unproved: Option<String>,
    /// The conclusion.
    pub verdict: Conclusion,
    /// Whether nothing is wrong with the mesh itself.
    #[serde(skip)]
    pub is_mesh_sound: bool,
}

/// What follows from everything that was found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Conclusion {
    /// The tiles are the exact Delaunay triangulation, and every file is as the job wrote it.
    Proved,
    /// Nothing is wrong, but something that the proof needs is missing.
    AsFarAsCanBeTold,
    /// Something is wrong.
    #[default]
    Failed,
}

/// The checked meshes of all tiles.
pub(super) struct CheckedMesh<'a> {
    pub(super) files: &'a TileFiles,
    pub(super) findings: Findings,
    pub(super) matches: BorderMatches,
    /// `None` if there is no list of edges along breaklines.
    pub(super) lines: Option<CheckedBreaklines>,
    /// `None` if there are no terrain tiles.
    pub(super) terrain: Option<TerrainTiles>,
}

impl Verdict {
    /// Draws the conclusion from everything that was found.
    pub(super) fn new(
        mesh: CheckedMesh,
        report: &ReadReport,
        written: &WrittenFiles,
        inputs: Option<InputProof>,
    ) -> Verdict {
        let CheckedMesh { files, mut findings, matches, lines, terrain } = mesh;
        let facts = &report.facts;
        let vertices = findings.vertices.join(matches.vertices);
        let mut verdict = Verdict {
            tiles: files.terrain as u64,
            sites: findings.inner_sites + matches.sites,
            triangles: findings.triangles,
            cut: findings.cut_triangles,
            hull_edges: matches.hull.len() as u64,
            edges_across_tiles: matches.edges_across_tiles,
            ties: findings.ties + matches.ties,
            digest: findings.digest.to_string(),
            vertex_digest: vertices.to_string(),
            ..Verdict::default()
        };
        findings.failures.merge(matches.failures);
        verdict.failures = findings.failures.sentences(|tile| files.name(tile));
        let gone = what_is_gone_of_cut(facts, written, verdict.cut);
        if let Some(gone) = &gone {
            verdict.doubt(format!(
                "{gone}: no edge is used twice in one direction, and all edges with two triangles are Delaunay, but triangles may \
                 overlap and sites may be missing"
            ));
        } else {
            verdict.check_hull(matches.hull, findings.double_area);
            verdict.check_euler();
            verdict.check_count("sites", verdict.sites, facts.sites);
            verdict.check_count("triangles left out", verdict.cut, facts.cut_triangles);
            verdict.check_vertices(vertices, facts.vertex_digest);
        }
        verdict.add_breaklines(lines, facts, gone.is_some());
        verdict.check_count("triangles", verdict.triangles - verdict.cut, facts.triangles);
        verdict.failures.extend(facts.lattice_failure(&files.extras));
        // Without cut/ its sites are missing too, which says nothing about the inputs.
        verdict.add_inputs(inputs, gone.is_some());
        verdict.is_mesh_sound = verdict.failures.is_empty();
        if let Some(TerrainTiles { tiles, failures, .. }) = terrain {
            verdict.terrain_tiles = Some(tiles);
            verdict.failures.extend(failures);
        }
        verdict.conclude(report, written)
    }

    /// The verdict if no tile can be used.
    pub(super) fn without_mesh(what: String, report: &ReadReport, written: &WrittenFiles) -> Verdict {
        Verdict { failures: vec![what], ..Verdict::default() }.conclude(report, written)
    }

    fn add_inputs(&mut self, inputs: Option<InputProof>, is_cut_gone: bool) {
        let Some(InputProof { points, greatest_error, failures, unproved }) = inputs else { return };
        (self.points, self.greatest_error) = (Some(points), greatest_error);
        if is_cut_gone {
            self.doubt("the vertices cannot be compared with the inputs without cut/".into());
        } else {
            self.failures.extend(failures);
            unproved.into_iter().for_each(|what| self.doubt(what));
        }
    }

    fn add_breaklines(&mut self, lines: Option<CheckedBreaklines>, facts: &ReportedFacts, is_cut_gone: bool) {
        let reported = facts.breaklines.map(|lines| lines.subsegments);
        let Some(CheckedBreaklines { edges, failure, missing }) = lines else {
            if let Some(reported) = reported {
                self.doubt(format!("breaklines.csv is gone, which lists {reported} edges that the mesh should have"));
            }
            return;
        };
        self.breaklines = Some(edges);
        self.failures.extend(failure);
        self.check_count("edges along breaklines", edges, reported);
        match missing {
            // They may be among what is gone.
            Some(missing) if is_cut_gone => self.doubt(missing),
            missing => self.failures.extend(missing),
        }
    }

    fn conclude(mut self, report: &ReadReport, written: &WrittenFiles) -> Verdict {
        self.files = written.unchanged;
        self.failures.extend(report.failure.iter().chain(&written.failures).cloned());
        report.unproved.iter().chain(&written.unproved).for_each(|what| self.doubt(what.clone()));
        self.verdict = match (self.failures.is_empty(), self.unproved.is_none()) {
            (true, true) => Conclusion::Proved,
            (true, false) => Conclusion::AsFarAsCanBeTold,
            (false, _) => Conclusion::Failed,
        };
        self
    }

    /// Adds something that cannot be proved.
    fn doubt(&mut self, what: String) {
        self.unproved = Some(match self.unproved.take() {
            Some(first) => format!("{first}; {what}"),
            None => what,
        });
    }

    /// Returns the conclusion as a sentence.
    pub fn sentence(&self) -> &'static str {
        match (self.verdict, self.is_mesh_sound, self.points.is_some()) {
            (Conclusion::Proved, _, true) if self.greatest_error.is_some() => {
                "proved: the exact Delaunay triangulation of points of the inputs, all others within max_error"
            }
            (Conclusion::Proved, _, true) => "proved: the exact Delaunay triangulation of the inputs' points",
            (Conclusion::Proved, _, false) => {
                "proved: the exact Delaunay triangulation of its vertices; --input compares them with the points"
            }
            (Conclusion::AsFarAsCanBeTold, ..) => "no error found, but not proved",
            (Conclusion::Failed, true, _) => "failed: files are not as the job wrote them",
            (Conclusion::Failed, false, true) => "failed: not the Delaunay triangulation of the inputs' points",
            (Conclusion::Failed, false, false) => "failed: not the Delaunay triangulation that the job wrote",
        }
    }

    /// Whether nothing is wrong; [`Verdict::unproved`] says what could not be proved.
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

    fn check_vertices(&mut self, found: VertexDigest, reported: Option<VertexDigest>) {
        if let Some(reported) = reported.filter(|reported| *reported != found) {
            self.failures.push(format!(
                "the vertices are not those of the job: their digest is {found}, report.json says {reported}"
            ));
        }
    }

    fn check_count(&mut self, name: &str, counted: u64, reported: Option<u64>) {
        if let Some(reported) = reported.filter(|&reported| reported != counted) {
            self.failures.push(format!("{counted} {name}, where report.json says {reported}"));
        }
    }
}

/// Says what is missing of the triangles that were left out of the terrain, of which `found` are there; `None` if nothing is known to be.
fn what_is_gone_of_cut(facts: &ReportedFacts, written: &WrittenFiles, found: u64) -> Option<String> {
    if let (Some(first), true) = (written.cut_gone.first(), found > 0) {
        const CUT: &str = "of cut/, which holds what hull and max_edge left out,";
        return Some(match written.cut_gone.len() {
            1 => format!("a file {CUT} is gone: {first}"),
            count => format!("{count} files {CUT} are gone, the first of them {first}"),
        });
    }
    let all = facts.cut_triangles.filter(|&count| count > 0 && found == 0);
    let gone = "triangles were left out (hull, max_edge), and the folder cut/ that should hold them is gone";
    all.map(|all| format!("{all} {gone}")).or_else(|| (!written.cut_gone.is_empty()).then(|| gone.to_owned()))
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
        if let Some(edges) = self.breaklines {
            writeln!(f, "{:<20}{:>34}", "along breaklines", edges)?;
        }
        if let Some(tiles) = self.terrain_tiles {
            writeln!(f, "{:<20}{:>34}", "terrain tiles", tiles)?;
        }
        writeln!(f, "{:<20}{:>34}", "digest", self.digest)?;
        writeln!(f, "{:<20}{:>34}", "digest of vertices", self.vertex_digest)?;
        writeln!(f, "{:<20}{:>34}", "unchanged files", self.files)?;
        if let Some(points) = self.points {
            writeln!(f, "{:<20}{:>34}", "points of the inputs", points)?;
        }
        if let Some(error) = self.greatest_error {
            writeln!(f, "{:<20}{error:>34}", "greatest error")?;
        }
        for failure in &self.failures {
            writeln!(f, "FAILS: {failure}")?;
        }
        if let Some(unproved) = &self.unproved {
            writeln!(f, "not proved: {unproved}")?;
        }
        writeln!(f, "{:<20}{:>34}", "verdict", self.sentence())
    }
}
