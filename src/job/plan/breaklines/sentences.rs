//! What a user should know about breaklines.

use crate::breaklines::{Disagreement, FeatureId, Findings, Rise, Uneven};
use crate::geometry::Site;
use crate::geometry::lattice::Lattice;
use crate::input::lines::LineFile;

/// Returns the warnings about what cutting the lines of `files` has shown. `outside` features lie outside the box of the points.
pub(super) fn sentences(files: &[LineFile], lattice: &Lattice, findings: &Findings, outside: u64) -> Vec<String> {
    let names = Names { files, lattice, findings };
    let mut found = Vec::new();
    if findings.subsegments == 0 {
        found.push(format!(
            "[[breaklines]]: no line lies in the box of the points, so there are no breaklines: {outside} features lie outside; look \
             at their CRS"
        ));
    }
    found.extend(findings.worst_disagreements.first().map(|worst| names.disagreement(worst)));
    found.extend(findings.worst_rises.first().map(|worst| names.rise(worst)));
    found.extend(findings.worst_uneven.first().map(|worst| names.uneven(worst)));
    if findings.empty_paths > 0 {
        found.push(format!(
            "[[breaklines]]: {} lines without two different vertices are left out",
            findings.empty_paths
        ));
    }
    found
}

struct Names<'a> {
    files: &'a [LineFile],
    lattice: &'a Lattice,
    findings: &'a Findings,
}

impl Names<'_> {
    fn disagreement(&self, &Disagreement { place, kept, other }: &Disagreement) -> String {
        format!(
            "[[breaklines]]: heights disagree at {} places where lines meet; the worst is {}: {} has the height {}, which is taken (a lake \
             before a river before a line), and {} has {}",
            self.findings.disagreements,
            self.at(place),
            self.feature(kept.0),
            self.height(kept.1),
            self.feature(other.0),
            self.height(other.1)
        )
    }

    fn rise(&self, &Rise { id, place, steps }: &Rise) -> String {
        format!(
            "[[breaklines]]: {} rivers rise on their way down; the worst is {}, by {} at {}; its heights are kept as they are",
            self.findings.rising_rivers,
            self.feature(id),
            self.difference(i64::from(steps)),
            self.at(place)
        )
    }

    fn uneven(&self, &Uneven { id, lowest, highest, place }: &Uneven) -> String {
        format!(
            "[[breaklines]]: {} lakes are not flat; the worst is {}, which is {} higher at {} than its lowest height, {}; that is the \
             height of all of it",
            self.findings.uneven_lakes,
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

    /// A difference of heights in source units. A whole number of decimal steps shows no trace of binary.
    fn difference(&self, steps: i64) -> String {
        let exact = self.lattice.resolution_z.checked_mul(steps.into());
        exact.map_or_else(|| format!("{steps} steps"), |exact| exact.normalize().to_string())
    }
}
