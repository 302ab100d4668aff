//! Lines come in the coordinate reference system of the points, or not at all.

use crate::input::lines::LineFile;
use crate::input::lines::options::LineCrs;
use crate::input::{Crs, CrsKind};
use crate::{Error, Result};

/// Brings the features of `file` into the system of the `points`. This is the one place where lines in another system could be
/// transformed; until then they are refused, with a sentence that says how to transform them.
///
/// # Errors
/// [`Error::Config`] if the lines are in another system.
pub(super) fn bring_to_points(file: &mut LineFile, choice: &LineCrs, points: &Crs) -> Result<()> {
    let own = match choice {
        LineCrs::OfPoints => return Ok(()),
        LineCrs::Given { crs, .. } => crs,
        LineCrs::Auto => &file.crs,
    };
    // Points in degrees are refused, so degrees are never the system of the points, even where these say none.
    if own.kind == CrsKind::Geographic && points.kind != CrsKind::Geographic {
        return Err(other_system(file, own, points, "the kind of coordinates"));
    }
    let differences = own.differences(points);
    if !differences.is_empty() {
        return Err(other_system(file, own, points, &differences.join(" and ")));
    }
    if !own.is_named() && points.is_named() && file.warnings.is_empty() {
        file.warnings
            .push(format!("it says no CRS: its lines are taken to be in that of the points, {}", points.label()));
    }
    Ok(())
}

fn other_system(file: &LineFile, own: &Crs, points: &Crs, differences: &str) -> Error {
    let path = file.path.display();
    let target = points.epsg.map_or("the points' CRS".into(), |code| format!("EPSG:{code}"));
    let points = if points.is_named() { points.label() } else { "a plane without a CRS".into() };
    Error::Config(format!(
        "{path} is in {}, but the points are in {points}. They differ in {differences}. Transform the lines first, for example with \
         `ogr2ogr -t_srs {target} lines.gpkg {path}`; if what the file says is wrong, say crs = \"points\" in [[breaklines]]",
        own.label()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Warnings;
    use crate::input::CrsChoice;

    fn system(text: &str) -> Crs {
        match CrsChoice::try_from(text.to_string()).unwrap() {
            CrsChoice::Given { crs, .. } => *crs,
            other => panic!("{other:?}"),
        }
    }

    fn bring(own: &Crs, choice: &str, points: &Crs) -> Result<Warnings> {
        let mut file =
            LineFile { path: "a.gpkg".into(), crs: own.clone(), features: Vec::new(), warnings: Warnings::default() };
        bring_to_points(&mut file, &LineCrs::try_from(choice.to_string()).unwrap(), points)?;
        Ok(file.warnings)
    }

    #[test]
    fn only_lines_in_the_system_of_the_points_pass() {
        let [zone_15, zone_16, degrees] = ["EPSG:26915", "EPSG:26916", "EPSG:4326"].map(system);
        assert!(bring(&zone_15, "auto", &zone_15).unwrap().is_empty());
        assert!(bring(&Crs::default(), "auto", &Crs::default()).unwrap().is_empty());
        let taken = bring(&Crs::default(), "auto", &zone_15).unwrap();
        assert!(taken.iter().any(|warning| warning.contains("says no CRS")));
        let error = bring(&zone_16, "auto", &zone_15).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("-t_srs EPSG:26915"), "{error}");
        // Even where the points say nothing.
        for points in [&zone_15, &Crs::default()] {
            assert!(bring(&degrees, "auto", points).unwrap_err().to_string().contains("kind of coordinates"));
            assert!(bring(&degrees, "points", points).unwrap().is_empty());
        }
        assert!(bring(&degrees, "EPSG:26915", &zone_15).unwrap().is_empty());
        assert!(bring(&zone_15, "EPSG:26916", &zone_15).is_err());
    }
}
