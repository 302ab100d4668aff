//! Collecting the features of a file: one set of rules for kinds, heights and broken geometry, whatever the format.

use std::path::Path;

use crate::lines::attribute::WantedAttributes;
use crate::lines::feature::{LineFeature, LineShape, RawGeometry};
use crate::lines::lake_rings::{Flaw, flaw_of, remove_repeated, simplified};
use crate::lines::options::{LineHeights, LineOptions, LinePurpose, kind_of_name};
use breaklines::FeatureKind;
use sys::{Error, Result, Warnings};

/// Coordinates beyond this, and what Shapefiles write for "no data", are no places on the earth.
const BEYOND_THE_EARTH: f64 = 1e30;

/// Takes the features of a file in their order.
pub(super) struct FeatureCollector<'a> {
    path: &'a Path,
    options: &'a LineOptions,
    features: Vec<LineFeature>,
    without_geometry: LeftOut,
    too_short: LeftOut,
    without_inside: LeftOut,
    without_parts: LeftOut,
    of_other_kinds: LeftOut,
    crossing: LeftOut,
    hole_outside: LeftOut,
    enclosing_nothing: LeftOut,
    without_area: LeftOut,
    not_looked_at: LeftOut,
    /// A part of the feature at hand that is left out.
    left_out: Option<Part>,
}

/// A part of a feature.
#[derive(Clone, Copy)]
enum Part {
    Line,
    Outline,
    /// A line or a point where only polygons are read.
    NoArea,
}

/// How many features are left out or doubtful for one reason, and the first of them, with a place.
#[derive(Default)]
struct LeftOut {
    count: u64,
    first: u64,
    place: [f64; 2],
}

impl LeftOut {
    fn note(&mut self, number: u64) {
        if self.count == 0 {
            self.first = number;
        }
        self.count += 1;
    }

    fn note_at(&mut self, number: u64, place: [f64; 2]) {
        self.place = if self.count == 0 { place } else { self.place };
        self.note(number);
    }

    /// Returns a warning that names the place too.
    fn warning_at(&self, why: [&str; 2], what_to_do: &str) -> Option<String> {
        let [x, y] = self.place;
        self.warning(why).map(|warning| format!("{warning} at ({x}, {y}); fix: {what_to_do}"))
    }

    /// Returns a warning about one feature, or about several: what is said of one, and of several.
    fn warning(&self, [of_one, of_several]: [&str; 2]) -> Option<String> {
        match self.count {
            0 => None,
            1 => Some(format!("feature {} {of_one}", self.first)),
            count => Some(format!("{count} features {of_several}, the first is feature {}", self.first)),
        }
    }
}

impl<'a> FeatureCollector<'a> {
    pub(super) fn new(path: &'a Path, options: &'a LineOptions) -> FeatureCollector<'a> {
        FeatureCollector {
            path,
            options,
            features: Vec::new(),
            without_geometry: LeftOut::default(),
            too_short: LeftOut::default(),
            without_inside: LeftOut::default(),
            without_parts: LeftOut::default(),
            left_out: None,
            of_other_kinds: LeftOut::default(),
            crossing: LeftOut::default(),
            hole_outside: LeftOut::default(),
            without_area: LeftOut::default(),
            enclosing_nothing: LeftOut::default(),
            not_looked_at: LeftOut::default(),
        }
    }

    /// Adds feature `number`.
    ///
    /// # Errors
    /// `Input` names the feature if its kind is not known, a vertex is no place, or it has no heights.
    pub(super) fn add(&mut self, number: u64, geometry: RawGeometry, attributes: &WantedAttributes) -> Result<()> {
        let Some(kind) = self.kind(number, attributes)? else {
            self.of_other_kinds.note(number);
            return Ok(());
        };
        let height = match &self.options.height_field {
            None => None,
            Some(name) => Some(attributes.height.number().ok_or_else(|| {
                self.refuse(
                    number,
                    format!(
                        "has no number in {name:?}, which height_field names: give it one, or leave the feature out"
                    ),
                )
            })?),
        };
        let before = self.features.len();
        self.add_geometry(number, kind, height, geometry)?;
        let name = attributes.name.text();
        self.features.iter_mut().skip(before).for_each(|feature| feature.name.clone_from(&name));
        match (self.left_out.take(), self.features.len() > before) {
            (Some(Part::NoArea), true) => self.without_area.note(number),
            (Some(_), true) => self.without_parts.note(number),
            (Some(Part::Line), false) => self.too_short.note(number),
            (Some(Part::Outline), false) => self.without_inside.note(number),
            (Some(Part::NoArea), false) => self.without_area.note(number),
            (None, false) => self.without_geometry.note(number),
            (None, true) => {}
        }
        Ok(())
    }

    /// Returns the first vertex that `is_wanted`, with the number of its feature.
    pub(super) fn find_vertex(&self, is_wanted: impl Fn(&&[f64; 3]) -> bool) -> Option<(u64, [f64; 3])> {
        let vertex_of = |feature: &LineFeature| {
            let vertex = feature.shape.outlines().iter().flatten().find(&is_wanted)?;
            Some((feature.number, *vertex))
        };
        self.features.iter().find_map(vertex_of)
    }

    /// Returns the features, and what there is to say about those that are left out.
    pub(super) fn finish(self) -> (Vec<LineFeature>, Warnings) {
        let mut warnings = Warnings::default();
        let of = |count: &LeftOut, of_one: &str, of_several: &str| count.warning([of_one, of_several]);
        warnings.extend(of(
            &self.without_geometry,
            "has no geometry and is left out",
            "have no geometry and are left out",
        ));
        warnings.extend(of(
            &self.too_short,
            "is a line without two different vertices and is left out",
            "are lines without two different vertices and are left out",
        ));
        warnings.extend(of(
            &self.without_inside,
            "is an area whose outline encloses nothing, and is left out",
            "are areas whose outline encloses nothing, and are left out",
        ));
        warnings.extend(of(
            &self.without_area,
            "has lines or points, which are left out: only polygons are an area",
            "have lines or points, which are left out: only polygons are an area",
        ));
        warnings.extend(of(
            &self.without_parts,
            "has a part that is left out: a line without two different vertices, or an outline that encloses nothing",
            "have a part that is left out: a line without two different vertices, or an outline that encloses nothing",
        ));
        warnings.extend(of(
            &self.of_other_kinds,
            "has a value of kind_field that kinds does not list and is left out",
            "have a value of kind_field that kinds does not list and are left out",
        ));
        warnings.extend(self.crossing.warning_at(
            [
                "is a lake whose outlines cross, so water and land alternate",
                "are lakes whose outlines cross, so water and land alternate",
            ],
            "\"Fix geometries\" in QGIS",
        ));
        warnings.extend(self.hole_outside.warning_at(
            [
                "is a lake with a hole outside its outline, which is taken for water",
                "are lakes with a hole outside their outline, which \
             is taken for water",
            ],
            "make it a lake of its own, or remove it",
        ));
        warnings.extend(self.enclosing_nothing.warning_at(
            [
                "is a lake whose outlines enclose nothing, because they repeat, or a hole covers them",
                "are lakes whose outlines enclose \
             nothing, because they repeat, or a hole covers them",
            ],
            "remove what repeats or covers them",
        ));
        warnings.extend(of(
            &self.not_looked_at,
            "is a lake with too many holes or edges side by side: its outlines are not checked",
            "are lakes with too many holes or edges side by side: their outlines are not checked",
        ));
        (self.features, warnings)
    }

    /// Returns an error about feature `number`.
    pub(super) fn refuse(&self, number: u64, what: impl AsRef<str>) -> Error {
        Error::input(self.path, format!("feature {number} {}", what.as_ref()))
    }

    fn kind(&self, number: u64, attributes: &WantedAttributes) -> Result<Option<FeatureKind>> {
        let Some(name) = &self.options.kind_field else {
            return Ok(Some(self.options.kind.unwrap_or(FeatureKind::Line)));
        };
        let value = attributes.kind.text();
        if let Some(kinds) = &self.options.kinds {
            return Ok(value.and_then(|value| kinds.get(&value).copied()));
        }
        let kind = value.as_deref().and_then(kind_of_name);
        kind.map(Some).ok_or_else(|| {
            let value = value.map_or("nothing".into(), |value| format!("{value:?}"));
            let what =
                format!("has {value} in {name:?}, not line, river or lake: use kinds to map its values to these");
            self.refuse(number, what)
        })
    }

    fn add_geometry(
        &mut self,
        number: u64,
        kind: FeatureKind,
        height: Option<f64>,
        geometry: RawGeometry,
    ) -> Result<()> {
        match geometry {
            RawGeometry::Empty => Ok(()),
            RawGeometry::Other(_) | RawGeometry::Lines(_) if self.options.purpose == LinePurpose::Clip => {
                self.left_out = Some(Part::NoArea);
                Ok(())
            }
            RawGeometry::Other(what) => Err(self.refuse(
                number,
                format!("is {what}, but {}: leave it out, or make a line of it", self.options.purpose.requirement()),
            )),
            RawGeometry::Several(all) => {
                all.into_iter().try_for_each(|geometry| self.add_geometry(number, kind, height, geometry))
            }
            RawGeometry::Lines(lines) => {
                lines.into_iter().try_for_each(|line| self.add_line(number, kind, height, line))
            }
            RawGeometry::Areas(areas) => {
                areas.into_iter().try_for_each(|area| self.add_area(number, kind, height, area))
            }
        }
    }

    fn add_line(&mut self, number: u64, kind: FeatureKind, height: Option<f64>, line: Vec<[f64; 3]>) -> Result<()> {
        let line = self.checked(number, height, line)?;
        if line.len() < 2 {
            self.left_out = Some(Part::Line);
            return Ok(());
        }
        let shape = match (kind, is_closed(&line)) {
            (FeatureKind::Lake, true) => return self.add_area(number, kind, height, vec![line]),
            (FeatureKind::Lake, false) => {
                return Err(self.refuse(
                    number,
                    "is a line with two ends, but a lake is an area: close it, make it a polygon, or give it another kind",
                ));
            }
            _ => LineShape::Line(line),
        };
        self.features.push(LineFeature { number, name: None, kind, shape });
        Ok(())
    }

    fn add_area(
        &mut self,
        number: u64,
        kind: FeatureKind,
        height: Option<f64>,
        rings: Vec<Vec<[f64; 3]>>,
    ) -> Result<()> {
        let is_lake = kind == FeatureKind::Lake;
        let mut kept = Vec::with_capacity(rings.len());
        for (index, ring) in rings.into_iter().enumerate() {
            let mut ring = self.checked(number, height, ring)?;
            self.check_closed(number, &ring)?;
            while ring.len() > 1 && is_closed(&ring) {
                ring.pop();
            }
            if is_lake {
                ring = simplified(ring);
            }
            if ring.len() >= 3 {
                kept.push(ring);
                continue;
            }
            self.left_out = Some(Part::Outline);
            if index == 0 {
                // Islands without their lake are nothing.
                return Ok(());
            }
        }
        if is_lake {
            self.look_at_lake(number, &mut kept)?;
        }
        if !kept.is_empty() {
            self.features.push(LineFeature { number, name: None, kind, shape: LineShape::Area(kept) });
        }
        Ok(())
    }

    /// Checks that the ring of an area that points are kept in ends where it begins. Where it does not, a part may be missing.
    fn check_closed(&self, number: u64, ring: &[[f64; 3]]) -> Result<()> {
        let ends = ring.first().zip(ring.last()).filter(|(first, last)| first[..2] != last[..2]);
        match ends.filter(|_| self.options.purpose == LinePurpose::Clip) {
            Some(([x, y, _], [to_x, to_y, _])) => Err(self.refuse(
                number,
                format!(
                    "has a ring that is not closed: it begins at ({x}, {y}) and ends at ({to_x}, {to_y}). Close it (in QGIS: \"Fix \
                     geometries\")"
                ),
            )),
            None => Ok(()),
        }
    }

    /// Removes repeated holes of a lake, and notes what is wrong with its outlines.
    fn look_at_lake(&mut self, number: u64, rings: &mut Vec<Vec<[f64; 3]>>) -> Result<()> {
        let Some(outline) = rings.first().cloned() else { return Ok(()) };
        let mut holes = rings.split_off(1);
        if remove_repeated(&outline, &mut holes) {
            let [x, y, _] = outline[0];
            let what = format!(
                "has a hole that is the same as its outline, at ({x}, {y}), so that no lake is left: remove the hole"
            );
            return Err(self.refuse(number, what));
        }
        rings.append(&mut holes);
        match flaw_of(rings)? {
            None => {}
            Some(Flaw::Crossing(place)) => self.crossing.note_at(number, place),
            Some(Flaw::HoleOutside(place)) => self.hole_outside.note_at(number, place),
            Some(Flaw::EnclosesNothing(place)) => self.enclosing_nothing.note_at(number, place),
            Some(Flaw::TooMany) => self.not_looked_at.note(number),
        }
        Ok(())
    }

    /// Checks that all vertices of a line have heights.
    fn check_heights(&self, number: u64, line: &[[f64; 3]]) -> Result<()> {
        let has_height = |vertex: &[f64; 3]| vertex[2].abs() < BEYOND_THE_EARTH;
        let Some((index, vertex)) = line.iter().enumerate().find(|(_, vertex)| !has_height(vertex)) else {
            return Ok(());
        };
        if !line.iter().any(has_height) {
            return Err(self.refuse(
                number,
                "has no heights: a breakline takes x, y and z, and measures (M) are not heights. Give it heights (in QGIS: \"Drape\" \
                 with an elevation model), or name \
                 an attribute that has them with height_field, or set heights = \"points\" to take them from the points around",
            ));
        }
        let what = format!(
            "has a vertex without a height, its number {}, at ({}, {}): give it one, or set heights = \"points\" to take all heights from \
             the points around",
            index.saturating_add(1),
            vertex[0],
            vertex[1]
        );
        Err(self.refuse(number, what))
    }

    /// Returns the vertices with their heights, without those that repeat the one before.
    fn checked(&self, number: u64, height: Option<f64>, mut line: Vec<[f64; 3]>) -> Result<Vec<[f64; 3]>> {
        for (index, vertex) in line.iter_mut().enumerate() {
            let is_place = |value: f64| value.abs() < BEYOND_THE_EARTH;
            if !is_place(vertex[0]) || !is_place(vertex[1]) {
                let what = format!(
                    "has the vertex ({:?}, {:?}), its number {}, which is no place",
                    vertex[0],
                    vertex[1],
                    index + 1
                );
                return Err(self.refuse(number, what));
            }
            vertex[2] = match self.options.heights {
                LineHeights::File => height.unwrap_or(vertex[2]),
                LineHeights::Points => f64::NAN,
            };
        }
        if self.options.heights == LineHeights::File {
            self.check_heights(number, &line)?;
        }
        // NaN is no height, and all that have none are the same.
        line.dedup_by(|next, before| next.map(f64::to_bits) == before.map(f64::to_bits));
        Ok(line)
    }
}

/// Tells whether a line ends where it begins.
fn is_closed(line: &[[f64; 3]]) -> bool {
    line.len() > 2 && line.first().zip(line.last()).is_some_and(|(first, last)| first[..2] == last[..2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lines::attribute::Attribute;

    fn options(rest: &str) -> LineOptions {
        toml::from_str(&format!("files = [\"a\"]\n{rest}")).unwrap()
    }

    fn collect(
        rest: &str,
        geometry: RawGeometry,
        attributes: WantedAttributes,
    ) -> Result<(Vec<LineFeature>, Warnings)> {
        let options = options(rest);
        let mut collector = FeatureCollector::new(Path::new("a.shp"), &options);
        collector.add(7, geometry, &attributes)?;
        Ok(collector.finish())
    }

    fn line(z: f64) -> RawGeometry {
        RawGeometry::Lines(vec![vec![[0.0, 0.0, z], [0.0, 0.0, z], [1.0, 2.0, z]]])
    }

    fn with_heights(heights: [f64; 3]) -> RawGeometry {
        RawGeometry::Lines(vec![heights.iter().zip(0..).map(|(z, x)| [f64::from(x), 0.0, *z]).collect()])
    }

    fn square() -> Vec<[f64; 3]> {
        vec![[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [4.0, 4.0, 1.0], [0.0, 4.0, 1.0], [0.0, 0.0, 1.0]]
    }

    #[test]
    fn closed_lines_are_lakes_and_open_ones_are_not() {
        let none = WantedAttributes::NONE;
        let (features, _) = collect("kind = \"lake\"", RawGeometry::Lines(vec![square()]), none.clone()).unwrap();
        assert_eq!(features[0].shape, LineShape::Area(vec![square()[..4].to_vec()]));
        let error = collect("kind = \"lake\"", line(1.0), none.clone()).unwrap_err().to_string();
        assert!(error.starts_with("a.shp: feature 7 is a line with two ends"), "{error}");
        let (features, warnings) = collect("", line(1.0), none).unwrap();
        assert_eq!(features[0].shape, LineShape::Line(vec![[0.0, 0.0, 1.0], [1.0, 2.0, 1.0]]));
        assert!(warnings.is_empty());
    }

    #[test]
    fn what_is_too_little_is_left_out_and_counted() {
        for geometry in [RawGeometry::Empty, RawGeometry::Lines(Vec::new()), RawGeometry::Several(Vec::new())] {
            let (features, warnings) = collect("", geometry, WantedAttributes::NONE).unwrap();
            let all: Vec<&str> = warnings.iter().collect();
            assert!(features.is_empty() && all.len() == 1 && all[0].contains("no geometry"), "{all:?}");
        }
        for (geometry, words) in [
            (RawGeometry::Lines(vec![vec![[1.0, 1.0, 1.0]]]), "line without two different vertices"),
            (RawGeometry::Lines(vec![vec![[1.0, 1.0, 1.0]; 5]]), "line without two different vertices"),
            (RawGeometry::Areas(vec![vec![square()[..2].to_vec(), square()]]), "area whose outline encloses nothing"),
        ] {
            let (features, warnings) = collect("", geometry, WantedAttributes::NONE).unwrap();
            let all: Vec<&str> = warnings.iter().collect();
            assert!(features.is_empty() && all.len() == 1 && all[0].contains(words), "{all:?}");
        }
    }

    #[test]
    fn features_are_counted_once_whatever_their_parts() {
        let options = options("");
        let mut collector = FeatureCollector::new(Path::new("a.shp"), &options);
        let short = || vec![[1.0, 1.0, 1.0]];
        collector.add(1, RawGeometry::Lines(vec![short(), short()]), &WantedAttributes::NONE).unwrap();
        collector.add(2, RawGeometry::Lines(vec![short()]), &WantedAttributes::NONE).unwrap();
        collector.add(3, RawGeometry::Empty, &WantedAttributes::NONE).unwrap();
        collector.add(4, RawGeometry::Lines(vec![short(), square(), short()]), &WantedAttributes::NONE).unwrap();
        let (features, warnings) = collector.finish();
        let all: Vec<&str> = warnings.iter().collect();
        assert_eq!((features.len(), all.len()), (1, 3));
        let starts = [
            "feature 3 has no geometry and is left out",
            "2 features are lines without two different vertices and are left out, the first is feature 1",
            "feature 4 has a part that is left out",
        ];
        for (start, text) in starts.into_iter().zip(all) {
            assert!(text.starts_with(start), "{text}");
        }
    }

    #[test]
    fn vertices_that_are_no_places_name_the_feature() {
        for (geometry, word) in [
            (line(f64::NAN), "height_field"),
            (line(-1e39), "height_field"),
            (RawGeometry::Lines(vec![vec![[0.0, f64::NAN, 1.0], [1.0, 1.0, 1.0]]]), "its number 1"),
            (with_heights([1.0, f64::NAN, 3.0]), "a vertex without a height, its number 2, at (1, 0)"),
            (with_heights([1.0, 3.0, -3.4e38]), "a vertex without a height, its number 3"),
            (with_heights([-1.1e38, 1.0, 1.0]), "a vertex without a height, its number 1"),
            (RawGeometry::Other("a point"), "is a point"),
        ] {
            let error = collect("", geometry, WantedAttributes::NONE).unwrap_err().to_string();
            assert!(error.starts_with("a.shp: feature 7 ") && error.contains(word), "{error}");
        }
    }

    #[test]
    fn attributes_say_kind_and_height() {
        let with = |kind: &str, height: Attribute| WantedAttributes {
            kind: Attribute::Text(kind.into()),
            height,
            ..WantedAttributes::NONE
        };
        let (features, _) = collect("kind_field = \"T\"", line(1.0), with(" River ", Attribute::Missing)).unwrap();
        assert_eq!(features[0].kind, FeatureKind::River);
        let error =
            collect("kind_field = \"T\"", line(1.0), with("creek", Attribute::Missing)).unwrap_err().to_string();
        assert!(error.contains("\"creek\"") && error.contains("kinds"), "{error}");
        let table = "kind_field = \"T\"\nkinds = { \"46006\" = \"river\" }";
        let number = WantedAttributes { kind: Attribute::Number(46006.0), ..WantedAttributes::NONE };
        assert_eq!(collect(table, line(1.0), number).unwrap().0[0].kind, FeatureKind::River);
        let (features, warnings) = collect(table, line(1.0), with("7", Attribute::Missing)).unwrap();
        assert!(features.is_empty() && warnings.iter().any(|warning| warning.contains("kind_field")));
        let (features, _) =
            collect("height_field = \"Z\"", line(f64::NAN), with("", Attribute::Text(" 2.5".into()))).unwrap();
        assert_eq!(features[0].shape.outlines()[0][1], [1.0, 2.0, 2.5]);
        let error = collect("height_field = \"Z\"", line(1.0), with("", Attribute::Missing)).unwrap_err().to_string();
        assert!(error.contains("\"Z\""), "{error}");
    }
}
