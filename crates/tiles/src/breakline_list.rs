//! The list of the edges along breaklines, `breaklines.csv`: a line for each, with both ends in source coordinates, without rounding, and
//! the kind of line.

use breaklines::{Breaklines, FeatureKind};
use lattice::Lattice;

/// The first line.
pub const HEADER: &str = "x1,y1,z1,x2,y2,z2,kind";

/// Returns the lines of the list, each with its end of line.
pub fn lines_of<'a>(breaklines: &'a Breaklines, lattice: &'a Lattice) -> impl Iterator<Item = String> + 'a {
    let line = |ends: &[u32; 2]| {
        let [a, b] = ends.map(|site| &breaklines.sites()[site as usize]);
        let text = [a, b].map(|site| {
            let [x, y] = [0, 1].map(|axis| lattice.world_text(axis, site.place[axis]));
            format!("{x},{y},{}", lattice.world_text(2, site.z.unwrap_or_default()))
        });
        // Where a river flows into a lake, one end is the lake's, and the edge is still the river's.
        format!("{},{},{}\n", text[0], text[1], kind_name(a.kind.max(b.kind)))
    };
    [format!("{HEADER}\n")].into_iter().chain(breaklines.subsegments().iter().map(line))
}

/// Returns the lattice integers of both ends that a line of the list names; `None` if it is no such line.
pub fn ends_of(line: &str, lattice: &Lattice) -> Option<[[i32; 3]; 2]> {
    let mut values = line.split(',');
    let mut next = |axis: usize| lattice.integer_of_text(axis, values.next()?);
    let ends = [[next(0)?, next(1)?, next(2)?], [next(0)?, next(1)?, next(2)?]];
    values.next()?;
    values.next().is_none().then_some(ends)
}

fn kind_name(kind: FeatureKind) -> &'static str {
    match kind {
        FeatureKind::Lake => "lake",
        FeatureKind::River => "river",
        FeatureKind::Line => "line",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use breaklines::{BreaklineOptions, Feature, FeatureId, Vertex};
    use rust_decimal::Decimal;

    #[test]
    fn ends_are_read_back_as_they_were_written() {
        let offset = [Decimal::new(6_350_000_001, 4), Decimal::new(-7, 1), Decimal::ZERO];
        let lattice = Lattice::new(offset, Decimal::new(25, 2), Decimal::new(1, 3)).unwrap();
        let vertex = |x: i32, z: i32| Vertex { place: [x, -x], z: Some(z) };
        let id = FeatureId { file: 0, feature: 1 };
        let feature = Feature { kind: FeatureKind::River, id, paths: vec![vec![vertex(-3, 9), vertex(4000, -1)]] };
        let (built, _) = Breaklines::build(&[feature], &BreaklineOptions::new(1000, None)).unwrap();
        let lines: Vec<String> = lines_of(&built, &lattice).collect();
        assert_eq!(lines[0], format!("{HEADER}\n"));
        assert_eq!(lines.len(), built.subsegments().len() + 1);
        for (line, ends) in lines[1..].iter().zip(built.subsegments()) {
            let sites = ends.map(|site| &built.sites()[site as usize]);
            let expected = sites.map(|site| [site.place[0], site.place[1], site.z.unwrap()]);
            assert_eq!(ends_of(line.trim_end(), &lattice), Some(expected), "{line}");
            assert!(line.ends_with(",river\n"));
        }
        for wrong in [
            "",
            HEADER,
            "1,2,3,4,5,6",
            "635000.1,0,0,635000.0001,0,0,line",
            "635000.0001,-0.7,0,635000.0001,-0.7,0,line,1",
        ] {
            assert_eq!(ends_of(wrong, &lattice), None, "{wrong}");
        }
        assert!(ends_of("635000.0001,-0.7,0,635000.2501,-0.7,0.001,line", &lattice).is_some());
    }
}
