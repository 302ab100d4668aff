//! What a user should know about breaklines.

use crate::progress::number_text::{counted, grouped};
use breaklines::{BreaklineOptions, Disagreement, FeatureId, Findings, InLake, Rise, Uneven};
use delaunay::geometry::Site;
use lattice::Lattice;
use points::lines::LineFile;

/// Returns the warnings about what cutting the lines of `files` with these `options` has shown. `outside` features lie outside the box of the
/// points.
pub(super) fn sentences(
    files: &[LineFile],
    lattice: &Lattice,
    options: &BreaklineOptions,
    findings: &Findings,
    outside: u64,
) -> Vec<String> {
    let names = Names { files, lattice, findings };
    let mut found = Vec::new();
    if findings.subsegments == 0 {
        found.push(names.nothing(options, outside));
    }
    found.extend(findings.worst_in_lakes.first().map(|worst| names.in_lake(worst)));
    found.extend(findings.worst_disagreements.first().map(|worst| names.disagreement(worst)));
    found.extend(findings.worst_rises.first().map(|worst| names.rise(worst)));
    found.extend(findings.worst_uneven.first().map(|worst| names.uneven(worst)));
    if findings.empty_paths > 0 {
        found.push(format!(
            "[[breaklines]]: {} left out: smaller than a step of the lattice, or covered by a hole",
            one_or_several(findings.empty_paths, ["part of a feature is", "parts of features are"])
        ));
    }
    if findings.rivers_without_heights > 0 {
        found.push(format!(
            "[[breaklines]]: whether {} downstream is not checked: heights come from the points around",
            one_or_several(findings.rivers_without_heights, ["river rises", "rivers rise"])
        ));
    }
    if findings.places_not_compared > 0 {
        found.push(format!(
            "[[breaklines]]: at {} a line with heights meets one that takes them from the points around: whether they disagree is not \
             checked",
            counted(findings.places_not_compared, "place")
        ));
    }
    found
}

struct Names<'a> {
    files: &'a [LineFile],
    lattice: &'a Lattice,
    findings: &'a Findings,
}

/// Returns a number and what is said of one, or of several.
fn one_or_several(count: u64, [of_one, of_several]: [&str; 2]) -> String {
    format!("{} {}", grouped(count), if count == 1 { of_one } else { of_several })
}

impl Names<'_> {
    /// Says why there are no breaklines.
    fn nothing(&self, options: &BreaklineOptions, outside: u64) -> String {
        let features: u64 = self.files.iter().map(|file| file.features.len() as u64).sum();
        let why = if features == 0 {
            "the files have no usable feature".into()
        } else if self.findings.segments == 0 && self.findings.empty_paths > 0 && outside < features {
            "all features in the box of the points are smaller than a step of the lattice".into()
        } else if self.findings.segments == 0 {
            format!(
                "none of {} lies within the box of the points ({outside} far from it); fix: [[breaklines]] crs, if their CRS is wrong",
                counted(features, "feature")
            )
        } else {
            let floor = self.length(options.floor.into());
            format!(
                "all lines in the box of the points are shorter than {floor}; fix: a smaller [[breaklines]] spacing"
            )
        };
        format!("[[breaklines]]: there are no breaklines: {why}")
    }

    fn in_lake(&self, &InLake { id, lake, length, place }: &InLake) -> String {
        format!(
            "[[breaklines]]: parts of lines inside a lake are left out, because a lake is flat; the longest is {}: about {} of it lie \
             in {}, for example at {}; fix: cut it out of the lake as an island, to keep it",
            self.feature(id),
            self.length(length),
            self.feature(lake),
            self.at(place)
        )
    }

    fn disagreement(&self, &Disagreement { place, kept, other }: &Disagreement) -> String {
        format!(
            "[[breaklines]]: heights disagree at {} where lines meet; the worst is {}: {} has the height {}, which is used, and {} has \
             {} (lakes take precedence over rivers, rivers over lines, lower heights over higher ones)",
            counted(self.findings.disagreements, "place"),
            self.at(place),
            self.feature(kept.0),
            self.height(kept.1),
            self.feature(other.0),
            self.height(other.1)
        )
    }

    fn rise(&self, &Rise { id, place, steps }: &Rise) -> String {
        format!(
            "[[breaklines]]: {} downstream; the worst is {}, by {} at {}; heights are kept",
            one_or_several(self.findings.rising_rivers, ["river rises", "rivers rise"]),
            self.feature(id),
            self.difference(i64::from(steps)),
            self.at(place)
        )
    }

    fn uneven(&self, &Uneven { id, lowest, highest, place }: &Uneven) -> String {
        format!(
            "[[breaklines]]: {}; the worst is {}, which is {} higher at {} than its lowest height, {}, which all of it gets",
            one_or_several(self.findings.uneven_lakes, ["lake is not flat", "lakes are not flat"]),
            self.feature(id),
            self.difference(i64::from(highest) - i64::from(lowest)),
            self.at(place),
            self.height(lowest)
        )
    }

    fn feature(&self, id: FeatureId) -> String {
        let file = self.files.get(id.file as usize).map(|file| file.path.display().to_string()).unwrap_or_default();
        format!("feature {} of {file}", id.feature)
    }

    fn at(&self, [x, y]: Site) -> String {
        format!("({}, {})", self.lattice.world(0, x), self.lattice.world(1, y))
    }

    fn height(&self, z: i32) -> f64 {
        self.lattice.world(2, z)
    }

    /// A length in the plane in source units.
    fn length(&self, steps: u64) -> String {
        let exact = i64::try_from(steps).ok().and_then(|steps| self.lattice.resolution.checked_mul(steps.into()));
        exact.map_or_else(|| format!("{steps} steps"), |exact| exact.normalize().to_string())
    }

    /// A difference of heights in source units. A whole number of decimal steps shows no trace of binary.
    fn difference(&self, steps: i64) -> String {
        let exact = self.lattice.resolution_z.checked_mul(steps.into());
        exact.map_or_else(|| format!("{steps} steps"), |exact| exact.normalize().to_string())
    }
}
