//! Lines come in the coordinate reference system of the points, or are transformed into it, or are refused.

use crate::input::lines::LineFile;
use crate::input::lines::options::LineCrs;
use crate::input::{Crs, CrsKind, CrsTransform, DatumNote, DatumRule, Sameness};
use crate::{Error, Result};

/// Brings the features of `file` into the system of the `points`. `datums` says which datums are one.
///
/// # Errors
/// [`Error::Config`] if the lines are in another system, and there is no way from that to the one of the points.
pub(super) fn bring_to_points(file: &mut LineFile, choice: &LineCrs, points: &Crs, datums: DatumRule) -> Result<()> {
    let own = match choice {
        LineCrs::OfPoints => return Ok(()),
        LineCrs::Given { crs, .. } => (**crs).clone(),
        LineCrs::Auto => file.crs.clone(),
    };
    // Points in degrees are refused, so degrees are never the system of the points, even where these say none.
    let is_in_degrees = own.kind == CrsKind::Geographic && points.kind != CrsKind::Geographic;
    // A text that nobody can read is not a missing one.
    let is_unread = |crs: &Crs| crs.wkt.is_some() && !crs.is_named();
    if is_in_degrees || is_unread(&own) || is_unread(points) || !own.differences(points).is_empty() {
        return transform(file, &own, points, datums);
    }
    if !own.is_named() || !points.is_named() {
        warn_of_missing(file, &own, points);
        return Ok(());
    }
    match own.sameness(points) {
        Sameness::Known => {}
        Sameness::Assumed => {
            let names = own.names_of_datums(points);
            file.warnings.push(assumed(&names));
        }
        Sameness::Refuted(_) => return transform(file, &own, points, datums),
    }
    Ok(())
}

/// Warns if the lines or the points name no CRS, and the others do.
fn warn_of_missing(file: &mut LineFile, own: &Crs, points: &Crs) {
    if points.is_named() && file.warnings.is_empty() {
        file.warnings
            .push(format!("it says no CRS: its lines are taken to be in that of the points, {}", points.label()));
    }
    if own.is_named() {
        file.warnings.push(format!(
            "its lines are in {}, and the points say no CRS: they are taken to be in the same",
            own.label()
        ));
    }
}

fn assumed(names: &str) -> String {
    format!("not both datums are named: {names} are assumed to be one; two datums may be hundreds of metres apart")
}

/// Transforms the features of `file`, which are in the system `own`, into that of the points.
fn transform(file: &mut LineFile, own: &Crs, points: &Crs, datums: DatumRule) -> Result<()> {
    let refuse = |why: &str| other_system(file, own, points, why);
    if !points.is_named() {
        return Err(refuse("the points do not say where they are"));
    }
    let heights = own.vertical_system.as_ref().zip(points.vertical_system.as_ref());
    if let Some(difference) = heights.and_then(|(own, others)| own.difference(others)) {
        return Err(refuse(&format!("they differ in {difference}, and the way between such heights needs a geoid")));
    }
    let way = CrsTransform::between(own, points, datums).map_err(|why| refuse(&why))?;
    let factor = own.metres_per_unit_of_height() / points.metres_per_unit_of_height();
    let target = points.label();
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
            *vertex = [to_x, to_y, z * factor];
        }
    }
    file.warnings.push(format!("its lines are transformed from {} to {target}", own.label()));
    match way.datums() {
        DatumNote::Same => {}
        DatumNote::Assumed(names) => file.warnings.push(assumed(names)),
        DatumNote::TakenAlike(names) => file
            .warnings
            .push(format!("[input] datums = \"close\" takes {names} for one datum; they may be a metre or two apart")),
    }
    Ok(())
}

fn other_system(file: &LineFile, own: &Crs, points: &Crs, why: &str) -> Error {
    let path = file.path.display();
    let how = match points.epsg {
        Some(code) => format!("for example with `ogr2ogr -t_srs EPSG:{code} lines.gpkg {path}`"),
        None => "for example in QGIS".into(),
    };
    let points = if points.is_named() { points.label() } else { "a plane without a CRS".into() };
    Error::Config(format!(
        "{path} is in {}, but the points are in {points}: {why}. Transform the lines first, {how}; if what the file says is wrong, say what \
         it is with crs in [[breaklines]], such as crs = \"points\" for the CRS of the points",
        own.label()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Warnings;
    use crate::breaklines::FeatureKind;
    use crate::input::CrsChoice;
    use crate::input::lines::{LineFeature, LineShape};

    fn system(text: &str) -> Crs {
        match CrsChoice::try_from(text.to_string()).unwrap() {
            CrsChoice::Given { crs, .. } => *crs,
            other => panic!("{other:?}"),
        }
    }

    const SOUTH: [f64; 3] = [-93.0, 44.0, 100.0];

    /// Returns where a vertex of a line comes to, and what is said.
    fn bring_vertex(vertex: [f64; 3], own: &Crs, choice: &str, points: &Crs) -> Result<([f64; 3], Warnings)> {
        let shape = LineShape::Line(vec![vertex; 2]);
        let features = vec![LineFeature { number: 1, kind: FeatureKind::Line, shape }];
        let mut file = LineFile { path: "a.gpkg".into(), crs: own.clone(), features, warnings: Warnings::default() };
        let choice = LineCrs::try_from(choice.to_string()).unwrap();
        bring_to_points(&mut file, &choice, points, DatumRule::Strict)?;
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
        assert!(taken.iter().any(|warning| warning.contains("says no CRS")));
        let without = bring(&zone_15, "auto", &Crs::default()).unwrap();
        assert!(without.iter().any(|warning| warning.contains("the points say no CRS")));
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
            let features = vec![LineFeature { number: 1, kind: FeatureKind::Line, shape }];
            let mut file =
                LineFile { path: "a.gpkg".into(), crs: crs.clone(), features, warnings: Warnings::default() };
            bring_to_points(&mut file, &LineCrs::Auto, &zone_15, rule).unwrap();
            file.warnings.iter().map(|warning| warning.to_string()).collect::<Vec<_>>().concat()
        };
        let alike = lines(&wgs84, DatumRule::Close);
        assert!(alike.contains("takes WGS 84 and NAD83 for one datum"), "{alike}");
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
        assert!(said.contains("an unnamed datum and NAD83 are assumed to be one"), "{said}");
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
            (&projected_somehow, &zone_15, "does not say its projection"),
            (&unnamed, &zone_15, "does not say its projection"),
            (&zone_15, &unnamed, "do not say where they are"),
            (&degrees, &Crs::default(), "do not say where they are"),
        ] {
            let error = bring(own, "auto", points).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains(word) && error.to_string().contains("crs = \"points\""), "{error}");
        }
        let beyond = bring_vertex([87.0, 0.0, 1.0], &degrees, "auto", &zone_15).unwrap_err();
        assert!(beyond.exit_code() == 3 && beyond.to_string().contains("feature 1"), "{beyond}");
    }
}
