//! Lines come in the coordinate reference system of the points, or are transformed into it, or are refused. Their heights come in the unit
//! of the points' heights.

use crate::lines::LineFile;
use crate::lines::options::{LineCrs, LineHeights, LineOptions, LinePurpose};
use crs::{Crs, CrsKind, CrsTransform, DatumNote, DatumRule, Sameness, Unit, same_length};
use sys::{Error, Result};

/// What the points of a job are in.
pub struct SystemOfPoints<'a> {
    /// Their coordinate reference system.
    pub crs: &'a Crs,
    /// The length of the unit of their heights in metres: what is known of it, or else that of x and y; `None` if neither is known.
    pub height_metres: Option<f64>,
    /// Which datums are one.
    pub datums: DatumRule,
}

/// Brings the features of `file` into the system of the `points`, and their heights into the unit of the points' heights.
///
/// # Errors
/// [`Error::Config`] if the lines are in another system, and there is no way from that to the one of the points.
pub fn bring_to_points(file: &mut LineFile, options: &LineOptions, points: &SystemOfPoints) -> Result<()> {
    let said = match &options.crs {
        LineCrs::OfPoints => Crs { vertical: points.height_metres, ..Crs::default() },
        LineCrs::Given { crs, .. } => (**crs).clone(),
        LineCrs::Auto => file.crs.clone(),
    };
    let own = Crs { vertical: options.height_unit.metres().or(said.vertical), ..said };
    let has_heights = options.heights == LineHeights::File;
    if options.crs != LineCrs::OfPoints && bring_plane(file, &own, points, has_heights)? {
        return Ok(());
    }
    if has_heights {
        convert_heights(file, &own, points);
        let depths = own.depths().filter(|_| points.crs.vertical_system.is_none());
        file.warnings.extend(depths);
    }
    Ok(())
}

/// Brings x and y into the system of the `points`. Returns whether heights have come with them.
fn bring_plane(file: &mut LineFile, own: &Crs, points: &SystemOfPoints, has_heights: bool) -> Result<bool> {
    let crs = points.crs;
    // Points in degrees are refused, so degrees are never the system of the points, even where these say none.
    let is_in_degrees = own.kind == CrsKind::Geographic && crs.kind != CrsKind::Geographic;
    // A text that nobody can read is not a missing one.
    let is_unread = |crs: &Crs| crs.wkt.is_some() && !crs.is_named();
    // Another unit of heights needs no other place.
    let without_unit = Crs { vertical: None, ..own.clone() };
    if is_in_degrees || is_unread(own) || is_unread(crs) || !without_unit.differences(crs).is_empty() {
        return transform(file, own, points, has_heights).map(|()| true);
    }
    if !own.is_named() || !crs.is_named() {
        warn_of_missing(file, own, crs);
        return Ok(false);
    }
    match own.sameness(crs) {
        Sameness::Known => {}
        Sameness::Assumed => {
            let names = own.names_of_datums(crs);
            file.warnings.push(assumed(&names));
        }
        Sameness::Refuted(_) => return transform(file, own, points, has_heights).map(|()| true),
    }
    Ok(false)
}

/// Converts heights into the unit of the points' heights, where the plane is the same.
fn convert_heights(file: &mut LineFile, own: &Crs, points: &SystemOfPoints) {
    // Points that say nothing are taken to be in the plane of the lines.
    let plane = points.crs.metres_per_unit().or(own.metres_per_unit());
    let to = points.height_metres.or(plane).unwrap_or(1.0);
    let Some(from) = own.vertical else {
        // Without a unit of height, heights are in the unit of x and y.
        if plane.is_some_and(|plane| !same_length(plane, to)) {
            file.warnings.push(format!(
                "it has no unit of heights: {} assumed, as for the points; fix: [[breaklines]] height_unit, if that is wrong",
                unit_name(to)
            ));
        }
        return;
    };
    if !same_length(from, to) {
        scale_heights(file, from / to);
        let why = match points.crs.vertical {
            Some(_) => "the unit of the points' heights",
            None => "the unit of x and y, because the points have no unit of heights",
        };
        file.warnings.push(format!("its heights are converted from {} to {}, {why}", unit_name(from), unit_name(to)));
    }
}

fn scale_heights(file: &mut LineFile, factor: f64) {
    let vertices = file.features.iter_mut().flat_map(|feature| feature.shape.vertices_mut());
    vertices.for_each(|vertex| vertex[2] *= factor);
    file.height_scale *= factor;
}

fn unit_name(metres: f64) -> String {
    Unit::from_metres(Some(metres)).name()
}

/// Warns if the lines or the points name no CRS, and the others do.
fn warn_of_missing(file: &mut LineFile, own: &Crs, points: &Crs) {
    if points.is_named() && file.warnings.is_empty() {
        file.warnings.push(format!(
            "it has no CRS: its {} are taken to be in that of the points, {}",
            file.purpose.features(),
            points.label()
        ));
    }
    if own.is_named() {
        file.warnings.push(format!(
            "its {} are in {}, and the points have no CRS: the same assumed for them; fix: [input] crs, if that is wrong",
            file.purpose.features(),
            own.label()
        ));
    }
}

fn assumed(names: &str) -> String {
    format!("a datum is unknown: {names} are assumed to be the same, though two datums may be hundreds of metres apart")
}

/// Transforms the features of `file`, which are in the system `own`, into that of the points.
fn transform(file: &mut LineFile, own: &Crs, points: &SystemOfPoints, has_heights: bool) -> Result<()> {
    let crs = points.crs;
    let refuse = |why: &str| other_system(file, own, points.crs, why);
    if !crs.is_named() {
        return Err(refuse("the CRS of the points is unknown"));
    }
    let heights = own.vertical_system.as_ref().zip(crs.vertical_system.as_ref());
    if let Some(difference) = heights.and_then(|(own, others)| own.difference(others)) {
        return Err(refuse(&format!("they differ in {difference}, and converting between such heights needs a geoid")));
    }
    let way = CrsTransform::between(own, crs, points.datums).map_err(|why| refuse(&why))?;
    let target = crs.label();
    for feature in &mut file.features {
        let number = feature.number;
        for vertex in feature.shape.vertices_mut() {
            let [x, y, z] = *vertex;
            let Some([to_x, to_y]) = way.apply([x, y]) else {
                return Err(Error::input(
                    &file.path,
                    format!("feature {number}: {x}, {y} lies outside the area of {target}, the system of the points"),
                ));
            };
            *vertex = [to_x, to_y, z];
        }
    }
    let from = own.metres_per_unit_of_height();
    let to = points.height_metres.unwrap_or_else(|| crs.metres_per_unit_of_height());
    let heights = match has_heights && !same_length(from, to) {
        true => {
            scale_heights(file, from / to);
            format!(", and their heights from {} to {}", unit_name(from), unit_name(to))
        }
        false => String::new(),
    };
    file.warnings.push(format!(
        "its {} are transformed from {} to {target}{heights}",
        file.purpose.features(),
        own.label()
    ));
    match way.datums() {
        DatumNote::Same => {}
        DatumNote::Assumed(names) => file.warnings.push(assumed(names)),
        DatumNote::TakenAlike(names) if file.purpose == LinePurpose::Breaklines => file.warnings.push(format!(
            "no datum shift between {names}, which may be a metre or two apart ([input] datums = \"close\")"
        )),
        DatumNote::TakenAlike(names) => {
            file.warnings.push(format!("no datum shift between {names}, which may be a metre or two apart"));
        }
    }
    if has_heights {
        file.warnings.extend(own.depths().filter(|_| crs.vertical_system.is_none()));
    }
    Ok(())
}

fn other_system(file: &LineFile, own: &Crs, points: &Crs, why: &str) -> Error {
    let (path, features) = (file.path.display(), file.purpose.features());
    let how = match points.epsg {
        Some(code) => format!("for example with `ogr2ogr -t_srs EPSG:{code} {features}.gpkg {path}`"),
        None => "for example in QGIS".into(),
    };
    if !points.is_named() {
        return Error::Config(format!(
            "{path} is in {}, but the points are in a plane without a CRS: {why}. Set [input] crs of the job to theirs; if the {features} have \
             the coordinates of the points, {}",
            own.label(),
            file.purpose.remedy_of_local(&file.path)
        ));
    }
    let points = points.label();
    let remedy = match file.purpose {
        LinePurpose::Breaklines => {
            "set crs in [[breaklines]], such as crs = \"points\" for the CRS of the points".into()
        }
        LinePurpose::Clip | LinePurpose::Places => file.purpose.remedy_of_crs(&file.path),
    };
    Error::Config(format!(
        "{path} is in {}, but the points are in {points}: {why}. Transform the {features} first, {how}; if the CRS of the file is \
         wrong, {remedy}",
        own.label()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lines::{LineFeature, LineShape};
    use breaklines::FeatureKind;
    use crs::CrsChoice;
    use sys::ErrorKind;
    use sys::Warnings;

    fn system(text: &str) -> Crs {
        match CrsChoice::try_from(text.to_string()).unwrap() {
            CrsChoice::Given { crs, .. } => *crs,
            other => panic!("{other:?}"),
        }
    }

    fn system_of(crs: &Crs, datums: DatumRule) -> SystemOfPoints<'_> {
        SystemOfPoints { crs, height_metres: crs.vertical.or(crs.metres_per_unit()), datums }
    }

    const SOUTH: [f64; 3] = [-93.0, 44.0, 100.0];

    /// Returns a file with a line of this vertex alone, as it lies among the points.
    fn brought(vertex: [f64; 3], own: &Crs, rest: &str, points: &Crs) -> Result<LineFile> {
        let shape = LineShape::Line(vec![vertex; 2]);
        let mut file = LineFile {
            path: "a.gpkg".into(),
            crs: own.clone(),
            purpose: LinePurpose::default(),
            height_scale: 1.0,
            features: vec![LineFeature { number: 1, name: None, kind: FeatureKind::Line, shape }],
            warnings: Warnings::default(),
        };
        let options = toml::from_str(&format!("files = [\"a\"]\n{rest}")).unwrap();
        bring_to_points(&mut file, &options, &system_of(points, DatumRule::Strict))?;
        Ok(file)
    }

    /// Returns where a vertex of a line comes to, and what is said.
    fn bring_vertex(vertex: [f64; 3], own: &Crs, choice: &str, points: &Crs) -> Result<([f64; 3], Warnings)> {
        let file = brought(vertex, own, &format!("crs = {choice:?}"), points)?;
        Ok((file.features[0].shape.outlines()[0][1], file.warnings))
    }

    fn bring(own: &Crs, choice: &str, points: &Crs) -> Result<Warnings> {
        bring_vertex(SOUTH, own, choice, points).map(|(_, warnings)| warnings)
    }

    #[test]
    fn lines_in_the_system_of_the_points_stay() {
        let [zone_15, degrees] = ["EPSG:26915", "EPSG:4326"].map(system);
        assert!(bring(&zone_15, "auto", &zone_15).unwrap().is_empty());
        assert!(bring(&Crs::default(), "auto", &Crs::default()).unwrap().is_empty());
        let taken = bring(&Crs::default(), "auto", &zone_15).unwrap();
        assert!(taken.iter().any(|warning| warning.contains("has no CRS")));
        let without = bring(&zone_15, "auto", &Crs::default()).unwrap();
        assert!(without.iter().any(|warning| warning.contains("the points have no CRS")));
        for points in [&zone_15, &Crs::default()] {
            assert!(bring(&degrees, "points", points).unwrap().is_empty());
        }
        assert!(bring(&degrees, "EPSG:26915", &zone_15).unwrap().is_empty());
    }

    #[test]
    fn datums_that_are_taken_for_one_or_assumed_to_be_are_named() {
        let [zone_15, wgs84] = ["EPSG:26915", "EPSG:4326"].map(system);
        let lines = |crs: &Crs, rule: DatumRule| {
            let shape = LineShape::Line(vec![SOUTH; 2]);
            let features = vec![LineFeature { number: 1, name: None, kind: FeatureKind::Line, shape }];
            let mut file = LineFile {
                path: "a.gpkg".into(),
                crs: crs.clone(),
                purpose: LinePurpose::default(),
                height_scale: 1.0,
                features,
                warnings: Warnings::default(),
            };
            bring_to_points(&mut file, &toml::from_str("files = [\"a\"]").unwrap(), &system_of(&zone_15, rule))
                .unwrap();
            file.warnings.iter().map(|warning| warning.to_string()).collect::<Vec<_>>().concat()
        };
        let alike = lines(&wgs84, DatumRule::Close);
        assert!(alike.contains("no datum shift between WGS 84 and NAD83"), "{alike}");
        let nameless = system(
            &zone_15
                .wkt
                .clone()
                .unwrap()
                .replace("NAD83\"", "unknown\"")
                .replace("North_American_Datum_1983", "unknown")
                .replace("26915", "0")
                .replace("4269", "0")
                .replace("6269", "0"),
        );
        let said = lines(&nameless, DatumRule::Strict);
        assert!(said.contains("an unnamed datum and NAD83 are assumed to be the same"), "{said}");
        let there = zone_15.clone();
        assert_eq!(lines(&there, DatumRule::Strict), "");
    }

    #[test]
    fn lines_in_another_system_are_transformed_or_refused() {
        let [zone_15, degrees, old, wgs84] = ["EPSG:26915", "EPSG:4269", "EPSG:26715", "EPSG:4326"].map(system);
        let projected_somehow = system(
            r#"PROJCS["My grid",GEOGCS["NAD83",DATUM["North_American_Datum_1983",
            SPHEROID["GRS 1980",6378137,298.257222101]]],UNIT["metre",1]]"#,
        );
        let unnamed = system(&projected_somehow.wkt.clone().unwrap().replace("My grid", "unnamed"));
        let ([x, y, z], said) = bring_vertex(SOUTH, &degrees, "auto", &zone_15).unwrap();
        // The central meridian of the zone.
        assert!((x - 500_000.0).abs() < 1e-6 && (4_870_000.0..4_880_000.0).contains(&y) && z == 100.0, "{x} {y} {z}");
        assert!(said.iter().any(|warning| warning.contains("transformed from")));
        let feet = system("EPSG:26849");
        let ([.., z], _) = bring_vertex(SOUTH, &degrees, "auto", &feet).unwrap();
        assert!((z - 100.0 * 3937.0 / 1200.0).abs() < 1e-9, "{z}");
        for (own, points, word) in [
            (&old, &zone_15, "us_noaa_conus.tif"),
            (&wgs84, &zone_15, "datums"),
            // Nothing says that these differ, and nothing that they are the same.
            (&projected_somehow, &zone_15, "has no readable projection"),
            (&unnamed, &zone_15, "has no readable projection"),
            (&zone_15, &unnamed, "the CRS of the points is unknown"),
            (&degrees, &Crs::default(), "the CRS of the points is unknown"),
        ] {
            let error = bring(own, "auto", points).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Usage);
            assert!(error.to_string().contains(word) && error.to_string().contains("crs = \"points\""), "{error}");
            assert_eq!(error.to_string().contains("Set [input] crs"), !points.is_named(), "{error}");
        }
        let beyond = bring_vertex([87.0, 0.0, 1.0], &degrees, "auto", &zone_15).unwrap_err();
        assert!(beyond.kind() == ErrorKind::Input && beyond.to_string().contains("feature 1"), "{beyond}");
    }
    /// Returns the height that 10 becomes, and what is said.
    fn height(own: &Crs, rest: &str, points: &Crs) -> (f64, String) {
        let file = brought([5e5, 49e5, 10.0], own, rest, points).unwrap();
        (file.features[0].shape.outlines()[0][0][2], file.warnings.iter().collect::<Vec<_>>().join("; "))
    }

    #[test]
    fn heights_come_in_the_unit_of_the_points_though_the_plane_is_the_same() {
        let [plane, metres, feet, state_feet] =
            ["EPSG:26915", "EPSG:26915+5703", "EPSG:26915+6360", "EPSG:26849"].map(system);
        const FOOT: f64 = 1200.0 / 3937.0;
        let auto = "";
        for (own, rest, points, expected, words) in [
            (&feet, auto, &plane, 10.0 * FOOT, "from US survey foot to metre, the unit of x and y"),
            (&feet, auto, &metres, 10.0 * FOOT, "from US survey foot to metre, the unit of the points' heights"),
            (&metres, auto, &feet, 10.0 / FOOT, "from metre to US survey foot"),
            (&plane, auto, &feet, 10.0, "US survey foot assumed"),
            (&plane, auto, &metres, 10.0, ""),
            (&feet, auto, &feet, 10.0, ""),
            (&plane, "height_unit = \"foot\"", &plane, 3.048, "from foot to metre"),
            (&plane, "height_unit = \"metre\"", &feet, 10.0 / FOOT, "from metre to US survey foot"),
            (&feet, "crs = \"points\"", &plane, 10.0, ""),
            (&feet, "crs = \"points\"\nheight_unit = \"us-foot\"", &plane, 10.0 * FOOT, "to metre"),
            // Points that say nothing are taken to be in the plane of the lines.
            (&feet, auto, &Crs::default(), 10.0 * FOOT, "to metre"),
            (&state_feet, auto, &Crs::default(), 10.0, ""),
            (&state_feet, auto, &state_feet, 10.0, ""),
        ] {
            let (z, said) = height(own, rest, points);
            let case = format!("{} {rest} {}: {z} {said}", own.label(), points.label());
            assert!((z - expected).abs() < 1e-9 && said.contains(words), "{case}");
            assert!(!words.is_empty() || !said.contains("heights"), "{case}");
        }
        let (z, said) = height(&feet, "heights = \"points\"", &plane);
        assert!(z == 10.0 && !said.contains("heights"), "{said}");
    }

    #[test]
    fn depths_over_heights_are_named() {
        let depths = Crs { vertical: Some(1.0), ..system("EPSG:26915+6357") };
        let (_, said) = height(&depths, "", &system("EPSG:26915"));
        assert!(said.contains("is a depth"), "{said}");
    }
}
