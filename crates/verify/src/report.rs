//! What `report.json` says of the results, and whether it is as the job wrote it.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use lattice::Lattice;
use lattice::VertexDigest;
use points::options::InputOptions;
use points::{PlausiblePoints, TextReading};
use tiles::checksums::{Checksum, read_file, seal};
use tiles::file_names::OutputFiles;
use tiles::frame::Extras;

/// What a report says; `None` for what it lacks.
#[derive(Clone, Debug, Default, Deserialize)]
pub(super) struct ReportedFacts {
    pub(super) sites: Option<u64>,
    /// The triangles in `tiles/`.
    pub(super) triangles: Option<u64>,
    /// The triangles that were left out.
    pub(super) cut_triangles: Option<u64>,
    /// The edges along breaklines; `None` if the job had none.
    pub(super) breaklines: Option<ReportedBreaklines>,
    /// How the vertices were selected; `None` if all points are vertices.
    pub(super) selection: Option<ReportedSelection>,
    /// The area that points were kept in; `None` for everywhere.
    pub(super) clip: Option<ReportedClip>,
    /// What became of the points of the inputs.
    pub(super) points: Option<ReportedPoints>,
    pub(super) lattice: Option<Lattice>,
    /// What the job wanted of its inputs.
    pub(super) input: Option<InputOptions>,
    /// How the job read its texts. Earlier versions did not say it.
    pub(super) texts: Option<TextReading>,
    /// Which points of binary files it kept, where it left some out because they lie far from all others.
    #[serde(default)]
    pub(super) plausible_points: Vec<PlausiblePoints>,
    /// The inputs that were left out because they are bad.
    #[serde(default)]
    pub(super) skipped: Vec<SkippedFile>,
    pub(super) inputs_fingerprint: Option<String>,
    pub(super) vertex_digest: Option<VertexDigest>,
    /// The checksum of the list of files.
    pub(super) file_list: Option<Checksum>,
    checksum: Option<Checksum>,
}

/// What a report says of breaklines.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(super) struct ReportedBreaklines {
    pub(super) subsegments: u64,
}

/// What a report says of the selection of vertices.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(super) struct ReportedSelection {
    /// The bound on the vertical distance of points from the mesh, in source units of height.
    pub(super) max_error: f64,
    /// The points that vertices were selected from: places, not those at the same place.
    pub(super) points: u64,
}

/// What a report says of the area that points were kept in.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct ReportedClip {
    /// Its polygons on the lattice, as well-known text.
    pub(super) area: String,
}

/// What a report says of points.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(super) struct ReportedPoints {
    /// Those that were dropped at breaklines.
    #[serde(default)]
    pub(super) at_breaklines: u64,
    /// Those whose height stands for nodata. Earlier versions left none out, and did not count them.
    #[serde(default)]
    pub(super) nodata: Option<u64>,
}

/// An input that was left out.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct SkippedFile {
    #[serde(deserialize_with = "sys::path_text::deserialize")]
    pub(super) file: PathBuf,
}

/// The report of a job, as far as it can be trusted.
#[derive(Debug, Default)]
pub(super) struct ReadReport {
    pub(super) facts: ReportedFacts,
    /// What is wrong with it. Then it has no facts.
    pub(super) failure: Option<String>,
    /// What cannot be proved for lack of it.
    pub(super) unproved: Option<String>,
}

impl ReadReport {
    /// Reads the report in the output `directory` of a job; there need not be one.
    pub(super) fn read(directory: &Path) -> ReadReport {
        let text = match read_file(&OutputFiles::new(directory).report()) {
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let unproved = "sites may be missing: there is no report.json with their number";
                return ReadReport { unproved: Some(unproved.into()), ..ReadReport::default() };
            }
            Err(error) => return ReadReport::failed(format!("it cannot be read: {error}")),
            Ok(text) => text,
        };
        match (serde_json::from_slice::<ReportedFacts>(&text), seal(&text)) {
            (Ok(facts), None) if facts.is_old() => {
                let unproved =
                    "report.json is of an earlier version, which left no checksums: files may have been changed";
                ReadReport { facts, failure: None, unproved: Some(unproved.into()) }
            }
            (Ok(facts), Some((own, found))) if own == found => ReadReport { facts, failure: None, unproved: None },
            (Err(error), _) => ReadReport::failed(format!("it is not a report of gdt-batch: {error}")),
            (Ok(_), _) => ReadReport::failed("it is not as the job wrote it: its own checksum does not fit".into()),
        }
    }

    /// Tells whether it is the report of a job, as the job wrote it.
    pub(super) fn is_of_a_job(&self) -> bool {
        self.facts.sites.is_some()
    }

    fn failed(what: String) -> ReadReport {
        ReadReport { failure: Some(format!("report.json: {what}")), ..ReadReport::default() }
    }
}

impl ReportedFacts {
    /// Tells whether a version of the program wrote it that left no checksums. No single change makes a newer report look so.
    fn is_old(&self) -> bool {
        let ReportedFacts { inputs_fingerprint, vertex_digest, file_list, checksum, .. } = self;
        inputs_fingerprint.is_none() && vertex_digest.is_none() && file_list.is_none() && checksum.is_none()
    }

    /// Returns what is wrong if the tiles lie on another lattice than the report says.
    pub(super) fn lattice_failure(&self, tiles: &Extras) -> Option<String> {
        let lattice = self.lattice.as_ref()?;
        let offset = lattice.offset.map(|offset| offset.to_string().parse::<f64>().unwrap_or(f64::NAN));
        let steps = [lattice.resolution, lattice.resolution_z].map(|step| step.to_string().parse().unwrap_or(f64::NAN));
        let is_same = offset == tiles.offset && steps == [tiles.resolution, tiles.resolution_z];
        (!is_same).then(|| {
            format!(
                "all tiles lie on a lattice with offset {:?} and steps {} and {}, where report.json says {offset:?}, {} and {}",
                tiles.offset, tiles.resolution, tiles.resolution_z, steps[0], steps[1]
            )
        })
    }
}
