//! The surface that people mean, and what a mesh of points will be: bare earth, or all that the laser met.

use serde::{Deserialize, Serialize};

use crate::points::chunk_request::ChunkRequest;
use crate::points::classes::{GROUND, is_ground, is_noise, is_unclassified};
use crate::points::counts::PointCounts;
use crate::points::record::PointRecord;
use crate::points::record_sink::RecordSink;
use crate::points::returns::{KeptReturns, PulseReturn};
use crate::source::Source;
use sys::Result;

/// The chunks in which a sample of a source looks.
const SAMPLED_CHUNKS: usize = 16;

/// The records at which it looks in each.
const SAMPLED_RECORDS: u64 = 4096;

/// Which surface a job makes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Surface {
    /// That of all points but noise.
    #[default]
    All,
    /// Bare earth: that of the points on the ground and on water, by their classes.
    Ground,
    /// Bare earth: that of the points that the program takes for ground, whatever their classes.
    BareEarth,
    /// That of first returns: roofs and tree tops.
    First,
    /// That of last returns.
    Last,
}

impl Surface {
    /// Returns the only classes that it is made of; `None` if it may be any.
    pub fn classes(self) -> Option<[u8; 4]> {
        (self == Surface::Ground).then_some(GROUND)
    }

    /// Returns the returns that it is made of.
    pub fn returns(self) -> KeptReturns {
        match self {
            Surface::First => KeptReturns::First,
            // A pulse that has more returns met something above the ground first.
            Surface::Last | Surface::BareEarth => KeptReturns::Last,
            Surface::All | Surface::Ground => KeptReturns::All,
        }
    }
}

/// Which points a mesh is made of, as far as a sentence tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshOf {
    /// Those of a surface.
    Surface(Surface),
    /// Those of classes or returns that the user has listed.
    Chosen,
}

/// How many points there are of the kinds that tell what their mesh will be.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SurfaceShares {
    /// All points, apart from noise.
    pub points: u64,
    /// Those of them on the ground or on water: of classes 2, 8, 9 and 20.
    pub ground: u64,
    /// Those of them whose class says nothing: 0 and 1.
    pub unclassified: u64,
}

impl SurfaceShares {
    /// Returns the shares of the points that a job keeps.
    pub fn of_kept(counts: &PointCounts) -> SurfaceShares {
        SurfaceShares { points: counts.kept, ground: counts.ground, unclassified: counts.unclassified }
    }

    /// Looks at some of the points of `source`; `None` if it holds none there.
    ///
    /// # Errors
    /// [`sys::Error::Io`] or [`sys::Error::Input`] if the file cannot be read or has changed since it was opened.
    pub fn sampled(source: &Source) -> Result<Option<SurfaceShares>> {
        let chunks = source.chunks();
        let places = chunks.min(SAMPLED_CHUNKS);
        let request = ChunkRequest { records: SAMPLED_RECORDS, ..ChunkRequest::all() };
        let mut shares = SurfaceShares::default();
        for place in 0..places {
            source.read_chunk((2 * place + 1) * chunks / (2 * places), request, &mut shares)?;
        }
        Ok((shares.points > 0).then_some(shares))
    }

    /// Adds a point of this class that the job wants, noise or not.
    pub fn add_wanted(&mut self, class: u8) {
        self.points += 1;
        self.ground += u64::from(is_ground(class));
        self.unclassified += u64::from(is_unclassified(class));
    }

    /// Adds `count` points of this class.
    pub fn add(&mut self, class: u8, count: u64) {
        if !is_noise(class) {
            self.points += count;
            self.ground += if is_ground(class) { count } else { 0 };
            self.unclassified += if is_unclassified(class) { count } else { 0 };
        }
    }

    /// Says what a mesh of these points is, which are those of `mesh`; `None` without points.
    pub fn sentence(&self, mesh: MeshOf) -> Option<String> {
        let SurfaceShares { points, ground, unclassified } = *self;
        if points == 0 {
            return None;
        }
        if mesh == MeshOf::Surface(Surface::BareEarth) {
            return Some("bare earth: the program finds the ground".into());
        }
        if ground == points {
            return Some("100 % ground: the mesh is bare earth".into());
        }
        if unclassified == points {
            return Some(
                "points are unclassified: the mesh includes any vegetation and buildings; [input] surface = \"bare-earth\" finds the ground"
                    .into(),
            );
        }
        let what = match mesh {
            MeshOf::Surface(Surface::All | Surface::Ground | Surface::BareEarth) => {
                "the mesh of all points includes vegetation or buildings"
            }
            MeshOf::Surface(Surface::First) => "the mesh of first returns includes roofs and tree tops",
            MeshOf::Surface(Surface::Last) => "the mesh of last returns includes buildings and dense vegetation",
            MeshOf::Chosen => "the mesh has the classes and returns that [input] selects",
        };
        let remedy = match mesh {
            MeshOf::Chosen => "",
            _ if ground > 0 => "; [input] surface = \"ground\" makes bare earth",
            _ => "; [input] surface = \"bare-earth\" finds the ground",
        };
        Some(format!("{} ground: {what}{remedy}", percent(ground, points)))
    }

    /// As [`SurfaceShares::sentence`], for the points of a sample.
    pub fn estimate(&self, mesh: MeshOf) -> Option<String> {
        let sentence = self.sentence(mesh)?;
        let is_share = sentence.starts_with(|c: char| c.is_ascii_digit());
        Some(if is_share {
            format!("about {}", sentence.replacen("ground:", "ground by a sample:", 1))
        } else {
            sentence
        })
    }
}

/// Returns the share of `part` in whole per cent. Only what is exact says 0 or 100.
pub fn percent(part: u64, all: u64) -> String {
    let share = part as f64 * 100.0 / all.max(1) as f64;
    match share.round() {
        0.0 if part > 0 => "less than 1 %".into(),
        100.0 if part < all => "more than 99 %".into(),
        share => format!("{share} %"),
    }
}

impl RecordSink for SurfaceShares {
    fn push(&mut self, _: u64, record: &PointRecord, _: impl Fn() -> String) -> Result<()> {
        if !record.withheld {
            self.add(record.class, 1);
        }
        Ok(())
    }

    fn push_out_of_bounds(&mut self, class: u8) {
        self.add(class, 1);
    }

    fn push_outlier(&mut self, class: u8, _: PulseReturn, _: impl FnOnce() -> String) {
        self.add(class, 1);
    }

    /// A record that cannot be read is no point.
    fn malformed(&mut self, _: u64, _: impl FnOnce() -> String) {}

    /// A sample has no bounds, so an index does not count.
    fn not_decoded(&mut self, _: u64) {}

    fn misplaced(&mut self, _: u64) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shares(classes: &[(u8, u64)]) -> SurfaceShares {
        let mut shares = SurfaceShares::default();
        classes.iter().for_each(|&(class, count)| shares.add(class, count));
        shares
    }

    #[test]
    fn sentences_say_what_the_mesh_is() {
        let say =
            |classes: &[(u8, u64)], surface| shares(classes).sentence(MeshOf::Surface(surface)).unwrap_or_default();
        assert_eq!(
            say(&[(2, 60), (9, 2), (5, 38), (7, 1000)], Surface::All),
            "62 % ground: the mesh of all points includes vegetation or buildings; [input] surface = \"ground\" makes bare earth"
        );
        assert!(
            say(&[(2, 1), (6, 2)], Surface::First).contains("33 % ground: the mesh of first returns includes roofs")
        );
        assert!(say(&[(2, 1), (6, 2)], Surface::Last).contains("last returns"));
        assert_eq!(say(&[(2, 7), (8, 1), (9, 1), (20, 1)], Surface::Ground), "100 % ground: the mesh is bare earth");
        assert!(say(&[(0, 3), (1, 4)], Surface::All).contains("surface = \"bare-earth\" finds the ground"));
        assert!(say(&[(2, 3), (1, 4)], Surface::BareEarth).starts_with("bare earth: the program finds"));
        let none = say(&[(5, 3), (1, 4)], Surface::All);
        assert!(
            none.starts_with("0 % ground") && none.ends_with("surface = \"bare-earth\" finds the ground"),
            "{none}"
        );
        assert_eq!(say(&[(7, 5)], Surface::All), "");
        let chosen = shares(&[(2, 1), (40, 1)]).sentence(MeshOf::Chosen).unwrap();
        assert_eq!(chosen, "50 % ground: the mesh has the classes and returns that [input] selects");
        assert!(shares(&[(2, 1)]).sentence(MeshOf::Chosen).unwrap().contains("bare earth"));
    }

    #[test]
    fn only_what_is_exact_is_none_or_all() {
        let texts = [(0, 9), (1, 1000), (5, 10), (999, 1000), (1000, 1000)].map(|(part, all)| percent(part, all));
        assert_eq!(texts, ["0 %", "less than 1 %", "50 %", "more than 99 %", "100 %"]);
    }
}
