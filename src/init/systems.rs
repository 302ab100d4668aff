//! What lets a job run though its clouds are in degrees or in different coordinate reference systems.

use crate::init::draft::{Draft, NeededLine};
use crs::{Crs, Unit};
use job::plan::inputs::input_paths;
use points::Source;
use rayon::prelude::*;
use std::collections::BTreeSet;
use sys::{Error, Result};

/// The most systems that a sentence names.
const MOST_NAMED: usize = 4;

/// Why datums are taken for one.
const WHY_CLOSE: &str = "The datums of the files differ by a metre or two. They are treated as one.";

/// CrsAttempts to run a draft that is refused as it is. Each is tried in turn.
pub(crate) struct CrsAttempts {
    draft: Draft,
    sources: Vec<Source>,
    waiting: std::vec::IntoIter<CrsAttempt>,
    /// Whether the plane has not been tried yet.
    may_be_plane: bool,
}

/// A way to bring all points onto one plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CrsAttempt {
    /// Into a UTM zone; with `close`, datums that are a metre or two apart count as one.
    Utm { close: bool },
    /// The coordinates are none that the records of the files can mean.
    Plane,
}

impl CrsAttempts {
    /// Returns the ways for `draft`. Opens its files, of which each is a point cloud.
    ///
    /// # Errors
    /// Those of opening them.
    pub(crate) fn of(draft: &Draft) -> Result<CrsAttempts> {
        let options = draft.options()?;
        let open = |path: &std::path::PathBuf| match points::open(path, &options.input.csv) {
            // What is left out has no say.
            Err(Error::Input { .. }) if draft.sets("on_bad_file") => Ok(None),
            opened => opened.map(Some),
        };
        let sources = input_paths(&options.input)?.par_iter().map(open).collect::<Result<Vec<_>>>()?;
        let ways = vec![CrsAttempt::Utm { close: false }, CrsAttempt::Utm { close: true }];
        let sources = sources.into_iter().flatten().collect();
        Ok(CrsAttempts { draft: draft.clone(), sources, waiting: ways.into_iter(), may_be_plane: true })
    }

    /// Returns the draft for the next way.
    pub(crate) fn next(&mut self) -> Option<Draft> {
        match self.waiting.next() {
            Some(way) => Some(self.draft.with(self.lines(way))),
            None => self.after_stray_points(),
        }
    }

    /// Returns the draft for files that all say that they are in degrees, and of which each has coordinates that are no place on earth;
    /// `None` if one of them can be in degrees, or if that was tried before.
    pub(crate) fn after_stray_points(&mut self) -> Option<Draft> {
        self.waiting = Vec::new().into_iter();
        // The columns of a text may be exchanged, or a row of it may be a mistake. So may x and y of another file.
        let is_nowhere = |source: &Source| {
            let [x, y] = [0, 1].map(|axis| farthest(source, axis));
            !source.format.is_text() && (x > 360.0 || y > 90.0) && (x > 90.0 || y > 180.0)
        };
        let all_say_degrees = self.sources.iter().all(|source| source.crs.horizontal == Unit::Degree);
        // Degrees and pixels have no plane in common.
        let is_plane = all_say_degrees && self.sources.iter().all(is_nowhere);
        (is_plane && std::mem::take(&mut self.may_be_plane)).then(|| self.draft.with(self.lines(CrsAttempt::Plane)))
    }

    fn lines(&self, way: CrsAttempt) -> Vec<NeededLine> {
        match way {
            CrsAttempt::Utm { close } => {
                let utm = NeededLine::of_input("to_crs", "utm", &self.why_utm());
                let close = close.then(|| NeededLine::of_input("datums", "close", WHY_CLOSE));
                self.open_lines([Some(utm), self.missing_crs(), close])
            }
            CrsAttempt::Plane => self.open_lines([Some(NeededLine::of_input("crs", "none", &self.why_plane()))]),
        }
    }

    /// Returns the lines whose keys the user has not set.
    fn open_lines(&self, lines: impl IntoIterator<Item = Option<NeededLine>>) -> Vec<NeededLine> {
        lines.into_iter().flatten().filter(|line| !self.draft.sets(line.key)).collect()
    }

    fn why_utm(&self) -> String {
        let mut systems = self.systems();
        let in_degrees = self.sources.iter().filter(|source| source.crs.horizontal == Unit::Degree).count();
        let more = systems.len().saturating_sub(MOST_NAMED);
        systems.truncate(MOST_NAMED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let reason = match (in_degrees, systems.len()) {
            (0, _) => format!("The files are in different systems: {}{more}.", systems.join("; ")),
            (_, 0 | 1) => "The coordinates are longitude and latitude, which would distort triangles.".to_string(),
            _ => format!("Some files are in degrees, which would distort triangles: {}{more}.", systems.join("; ")),
        };
        format!(
            "{reason} So all points are transformed into the UTM zone of their middle. Any projected CRS works here."
        )
    }

    fn why_plane(&self) -> String {
        let farthest = |axis: usize| self.sources.iter().map(|source| farthest(source, axis)).fold(0.0, f64::max);
        format!(
            "The CRS of the files is in degrees, but x goes to {:.2} and y to {:.2}, which is not on earth: they are treated as a plane.",
            farthest(0),
            farthest(1)
        )
    }

    /// Returns the line for texts whose columns are longitude and latitude of no named system, if all files that name none are such.
    fn missing_crs(&self) -> Option<NeededLine> {
        if self.draft.sets("crs") {
            return None;
        }
        let mut nameless = self.sources.iter().filter(|source| !source.crs.is_named());
        let first = nameless.next()?;
        let are_degrees = first.crs.horizontal == Unit::Degree && nameless.all(|s| s.crs.horizontal == Unit::Degree);
        let why = format!(
            "The columns of {} are longitude and latitude in an unknown CRS: WGS 84 is assumed. Change it if that is wrong.",
            first.path.display()
        );
        are_degrees.then(|| NeededLine::of_input("missing_crs", "EPSG:4326", &why))
    }

    /// Returns the names of all systems.
    fn systems(&self) -> Vec<String> {
        let name = |crs: &Crs| {
            if crs.is_named() { crs.label() } else { format!("one without a name, in {}", crs.horizontal.name()) }
        };
        self.sources.iter().map(|source| name(&source.crs)).collect::<BTreeSet<String>>().into_iter().collect()
    }
}

/// Returns how far x or y of a source goes from zero.
fn farthest(source: &Source, axis: usize) -> f64 {
    source.min[axis].abs().max(source.max[axis].abs())
}
