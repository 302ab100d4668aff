//! Which point clouds of a list a job opens: those that, by the list, do not lie outside of what the job wants.
//!
//! A list says where a cloud lies in a system of its own. That tells something only if it is the system of the bounds: without `to_crs` that of
//! the files, if all lists name the same one.

use crate::plan::clip::clip_path;
use crs::{Crs, CrsChoice, NamedCrs, Sameness, TargetCrs};
use points::lines::options::LineOptions;
use points::lines::{LineShape, read_lines};
use points::options::InputOptions;
use points::{ListedBox, ListedCloud};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A box of a list may be off by this share of its size and by so many units: some programs round it.
const SLACK: (f64, f64) = (1e-3, 1.0);

/// The most bytes of a file of polygons that is read for its box alone.
const LARGEST_CLIP: u64 = 1 << 27;

/// The clouds of a list.
pub(crate) struct ListedInputs {
    /// The list.
    pub(crate) list: PathBuf,
    pub(crate) clouds: Vec<ListedCloud>,
}

/// A rectangle outside of which the job wants no point.
struct WantedArea {
    /// [xmin, ymin, xmax, ymax].
    rectangle: [f64; 4],
    /// Its system; `None` for that of the files.
    crs: Option<Crs>,
}

/// What the job wants, compared with what lists say.
pub(crate) struct ListedAreas {
    areas: Vec<WantedArea>,
    /// What the systems that lists name mean; `None` for one that is not known.
    systems: BTreeMap<Arc<str>, Option<Crs>>,
}

impl ListedAreas {
    /// Returns what the options want, for a job of these lists.
    pub(crate) fn of(options: &InputOptions, lists: &[ListedInputs]) -> ListedAreas {
        let areas: Vec<WantedArea> = area_of_bounds(options).into_iter().chain(area_of_clip(options)).collect();
        let claims = lists.iter().flat_map(|list| &list.clouds).filter_map(|cloud| cloud.claim.as_ref());
        let mut systems = BTreeMap::new();
        for claim in claims.filter(|_| !areas.is_empty()) {
            let named = || NamedCrs::try_from(claim.crs.to_string()).ok().map(|named| *named.crs);
            systems.entry(claim.crs.clone()).or_insert_with(named);
        }
        ListedAreas { areas, systems }
    }

    /// Splits the clouds of a list into those that are opened, and the number of the others.
    pub(crate) fn wanted(&self, clouds: Vec<ListedCloud>) -> (Vec<PathBuf>, usize) {
        let all = clouds.len();
        let wanted: Vec<PathBuf> = clouds
            .into_iter()
            .filter(|cloud| cloud.claim.as_ref().is_none_or(|claim| !self.are_apart(claim)))
            .map(|cloud| cloud.path)
            .collect();
        let outside = all - wanted.len();
        (wanted, outside)
    }

    /// Says that items of a list do not tell where they lie, where that matters: `None` if all others do.
    pub(crate) fn unusable_boxes(&self, list: &ListedInputs) -> Option<String> {
        let unusable: Vec<&String> = list.clouds.iter().filter_map(|cloud| cloud.unusable_box.as_ref()).collect();
        let first = unusable.first().filter(|_| !self.areas.is_empty())?;
        let others = match unusable.len() - 1 {
            0 => String::new(),
            others => format!(", and {others} more have no usable box either"),
        };
        Some(format!(
            "{}: {first}, which is unusable{others}: their files are opened, wherever they lie; fix: correct the list",
            list.list.display()
        ))
    }

    fn are_apart(&self, claim: &ListedBox) -> bool {
        let is_same_system = |area: &WantedArea| match (&area.crs, self.systems.get(&claim.crs)) {
            (None, _) => self.systems.len() == 1,
            (Some(wanted), Some(Some(listed))) => matches!(wanted.sameness(listed), Sameness::Known),
            _ => false,
        };
        self.areas.iter().any(|area| is_same_system(area) && are_apart(area.rectangle, claim.bounds))
    }
}

fn are_apart(wanted: [f64; 4], listed: [f64; 4]) -> bool {
    let slack = |axis: usize| SLACK.0 * (listed[axis + 2] - listed[axis]) + SLACK.1;
    (0..2).any(|axis| listed[axis + 2] + slack(axis) < wanted[axis] || listed[axis] - slack(axis) > wanted[axis + 2])
}

/// Returns the area of `[input] bounds`; `None` if there are none, or their system is found only with the points.
fn area_of_bounds(options: &InputOptions) -> Option<WantedArea> {
    let rectangle = options.bounds?.0;
    let crs = match (&options.to_crs, &options.crs) {
        (Some(TargetCrs::Named(target)), _) => Some((*target.crs).clone()),
        (Some(TargetCrs::Utm), _) => return None,
        (None, CrsChoice::Given { crs, .. }) => Some((**crs).clone()),
        (None, _) => None,
    };
    Some(WantedArea { rectangle, crs })
}

/// Returns the box of `[input] clip`; `None` without one, or if its file does not say its system. What is wrong with the file, the plan says,
/// which reads it again.
fn area_of_clip(options: &InputOptions) -> Option<WantedArea> {
    let path: &Path = clip_path(options).ok()??;
    if path.metadata().ok()?.len() > LARGEST_CLIP {
        return None;
    }
    let file = read_lines(path, &LineOptions::of_clip(path), LARGEST_CLIP).ok()?;
    let vertices = || {
        let areas = file.features.iter().filter_map(|feature| match &feature.shape {
            LineShape::Area(rings) => Some(rings),
            _ => None,
        });
        areas.flatten().flatten()
    };
    let least = |axis: usize| vertices().map(|vertex| vertex[axis]).fold(f64::INFINITY, f64::min);
    let greatest = |axis: usize| vertices().map(|vertex| vertex[axis]).fold(f64::NEG_INFINITY, f64::max);
    let rectangle = [least(0), least(1), greatest(0), greatest(1)];
    let crs = Some(file.crs.clone()).filter(|crs| crs.is_named() && rectangle[0] <= rectangle[2])?;
    Some(WantedArea { rectangle, crs: Some(crs) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(more: &str) -> InputOptions {
        toml::from_str(&format!("files = [\"a.vpc\"]\n{more}")).unwrap()
    }

    fn cloud(name: &str, crs: &str, bounds: [f64; 4]) -> ListedCloud {
        ListedCloud { path: name.into(), claim: Some(ListedBox { crs: crs.into(), bounds }), unusable_box: None }
    }

    /// Returns the clouds of a list that a job with these options opens.
    fn opened(options: &InputOptions, clouds: &[ListedCloud]) -> Vec<String> {
        let lists = [ListedInputs { list: "a.vpc".into(), clouds: clouds.to_vec() }];
        let (wanted, outside) = ListedAreas::of(options, &lists).wanted(clouds.to_vec());
        assert_eq!(wanted.len() + outside, clouds.len());
        wanted.into_iter().map(|path| path.display().to_string()).collect()
    }

    #[test]
    fn clouds_outside_the_bounds_are_not_opened() {
        let clouds = [
            cloud("near", "EPSG:25832", [0.0, 0.0, 100.0, 100.0]),
            cloud("touches", "EPSG:25832", [211.0, 0.0, 300.0, 100.0]),
            cloud("far", "EPSG:25832", [212.0, 0.0, 300.0, 100.0]),
            ListedCloud { path: "unknown".into(), claim: None, unusable_box: None },
        ];
        let bounds = "bounds = [50.0, 50.0, 210.0, 60.0]\n";
        let all = ["near", "touches", "far", "unknown"];
        assert_eq!(opened(&options(bounds), &clouds), ["near", "touches", "unknown"]);
        assert_eq!(opened(&options(""), &clouds), all);
        // The system of the bounds is that of the list, or not.
        for (line, is_same) in [
            ("crs = \"EPSG:25832\"", true),
            ("crs = \"EPSG:25833\"", false),
            ("to_crs = \"EPSG:25832\"", true),
            ("to_crs = \"EPSG:25833\"", false),
            ("to_crs = \"utm\"", false),
        ] {
            let found = opened(&options(&format!("{bounds}{line}")), &clouds);
            assert_eq!(found.len(), if is_same { 3 } else { 4 }, "{line}");
        }
        let mut mixed = clouds.to_vec();
        mixed.push(cloud("other", "EPSG:25833", [0.0, 0.0, 100.0, 100.0]));
        assert_eq!(opened(&options(bounds), &mixed).len(), 5, "which of two systems the bounds are in, no list says");
    }

    #[test]
    fn boxes_that_cannot_be_used_are_told_where_they_matter() {
        let unusable = |name: &str| {
            let what = Some(format!("item {name:?} (number 1) has proj:bbox []"));
            ListedCloud { path: name.into(), claim: None, unusable_box: what }
        };
        let told = |line: &str, clouds: Vec<ListedCloud>| {
            let lists = [ListedInputs { list: "a.vpc".into(), clouds }];
            ListedAreas::of(&options(line), &lists).unusable_boxes(&lists[0])
        };
        let bounds = "bounds = [50.0, 50.0, 210.0, 60.0]";
        let one = told(bounds, vec![unusable("a")]).unwrap();
        assert!(
            one.starts_with("a.vpc: item \"a\" (number 1) has proj:bbox [], which is unusable: their files"),
            "{one}"
        );
        assert!(told(bounds, vec![unusable("a"), unusable("b")]).unwrap().contains("and 1 more"));
        assert_eq!(told("", vec![unusable("a")]), None);
        assert_eq!(told(bounds, vec![cloud("near", "EPSG:25832", [0.0, 0.0, 100.0, 100.0])]), None);
    }

    #[test]
    fn clouds_outside_the_box_of_a_clip_are_not_opened() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("area.geojson");
        let area = |crs: &str| {
            format!(
                r#"{{"type": "FeatureCollection", {crs} "features": [{{"type": "Feature", "properties": {{}}, "geometry": {{"type": "Polygon",
                "coordinates": [[[0, 0], [9, 0], [9, 9], [0, 0]]]}}}}]}}"#
            )
        };
        let clouds = [
            cloud("near", "EPSG:25832", [5.0, 5.0, 100.0, 100.0]),
            cloud("far", "EPSG:25832", [50.0, 0.0, 100.0, 100.0]),
        ];
        let clip = format!("clip = {:?}", path.display().to_string());
        let named = r#""crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}},"#;
        for (crs, expected) in [(named, &["near"][..]), ("", &["near", "far"])] {
            std::fs::write(&path, area(crs)).unwrap();
            assert_eq!(opened(&options(&clip), &clouds), expected, "{crs}");
        }
    }
}
