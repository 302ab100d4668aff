//! Lines come in the coordinate reference system of the points, or are transformed into it, or are refused.

use crate::input::lines::LineFile;
use crate::input::lines::options::LineCrs;
use crate::input::{Crs, CrsKind, CrsTransform, DatumRule};
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
    let differences = own.differences(points);
    if is_in_degrees || !differences.is_empty() {
        return transform(file, &own, points, datums);
    }
    if !own.is_named() && points.is_named() && file.warnings.is_empty() {
        file.warnings
            .push(format!("it says no CRS: its lines are taken to be in that of the points, {}", points.label()));
    }
    if own.is_named() && !points.is_named() {
        let said =
            format!("its lines are in {}, and the points say no CRS: they are taken to be in the same", own.label());
        file.warnings.push(said);
    }
    Ok(())
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
    fn lines_in_another_system_are_transformed_or_refused() {
        let [zone_15, degrees, old, wgs84] = ["EPSG:26915", "EPSG:4269", "EPSG:26715", "EPSG:4326"].map(system);
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
