//! Polygons on a lattice as well-known text, whose numbers are exact: `MULTIPOLYGON (((0 0, 0.5 0, 0.5 0.5, 0 0)))`.

use crate::Lattice;
use crate::area::Polygons;

const START: &str = "MULTIPOLYGON (";

impl Lattice {
    /// Returns polygons as well-known text, in source units. [`Lattice::nearest`] finds only vertices that have one.
    pub fn text_of_polygons(&self, polygons: &[Vec<Vec<[i64; 2]>>]) -> String {
        let number = |axis: usize, i: i64| {
            self.exact_world(axis, i).map(|exact| exact.normalize().to_string()).unwrap_or_default()
        };
        let vertex = |&[x, y]: &[i64; 2]| format!("{} {}", number(0, x), number(1, y));
        let ring = |ring: &Vec<[i64; 2]>| {
            let closed: Vec<String> = ring.iter().chain(ring.first()).map(vertex).collect();
            format!("({})", closed.join(", "))
        };
        let polygon = |rings: &Vec<_>| format!("({})", rings.iter().map(ring).collect::<Vec<_>>().join(", "));
        format!("{START}{})", polygons.iter().map(polygon).collect::<Vec<_>>().join(", "))
    }

    /// Returns the polygons of a text that [`Lattice::text_of_polygons`] has made; `None` of any other.
    pub fn polygons_of_text(&self, text: &str) -> Option<Polygons> {
        let inner = text.strip_prefix(START)?.strip_suffix(')')?;
        let inner = inner.strip_prefix("((")?.strip_suffix("))")?;
        let vertex = |text: &str| {
            let (x, y) = text.split_once(' ')?;
            Some([self.wide_integer_of_text(0, x)?, self.wide_integer_of_text(1, y)?])
        };
        let ring = |text: &str| {
            let mut ring = text.split(", ").map(vertex).collect::<Option<Vec<_>>>()?;
            let last = ring.pop()?;
            (*ring.first()? == last).then_some(ring)
        };
        let polygon = |text: &str| text.split("), (").map(ring).collect::<Option<Vec<_>>>();
        inner.split(")), ((").map(polygon).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rust_decimal::Decimal;

    proptest! {
        #[test]
        fn polygons_are_read_back_as_they_were_written(
            polygons in prop::collection::vec(
                prop::collection::vec(prop::collection::vec(prop::array::uniform2(-(1i64 << 52)..1 << 52), 1..5), 1..4),
                1..4,
            ),
            step in 1i64..1000,
        ) {
            let offset = [Decimal::new(635_000_125, 3), Decimal::new(-5, 1), Decimal::ZERO];
            let lattice = Lattice::new(offset, Decimal::new(step, 3), Decimal::ONE).unwrap();
            let text = lattice.text_of_polygons(&polygons);
            prop_assert_eq!(lattice.polygons_of_text(&text), Some(polygons), "{}", text);
        }
    }

    #[test]
    fn other_texts_are_no_polygons_of_the_lattice() {
        let lattice = Lattice::new([Decimal::ZERO; 3], Decimal::new(5, 1), Decimal::ONE).unwrap();
        let square = "MULTIPOLYGON (((0 0, 0.5 0, 0.5 0.5, 0 0)))";
        assert_eq!(lattice.polygons_of_text(square), Some(vec![vec![vec![[0, 0], [1, 0], [1, 1]]]]));
        for (from, to) in
            [("0.5 0.5", "0.5 0.25"), (", 0 0)))", ")))"), ("MULTI", ""), ("0.5 0,", "a 0,"), (")))", "))")]
        {
            assert_eq!(lattice.polygons_of_text(&square.replace(from, to)), None, "{from}");
        }
    }
}
