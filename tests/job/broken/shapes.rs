//! Sound files whose points make no terrain, or a very odd one.

use std::fmt::Write;

use super::{Case, Content, Read, Refused, case};

fn rows(points: impl IntoIterator<Item = [f64; 3]>) -> Vec<u8> {
    let mut text = String::from("x,y,z\n");
    for [x, y, z] in points {
        writeln!(text, "{x},{y},{z}").unwrap();
    }
    text.into_bytes()
}

pub(super) fn cases() -> Vec<Case> {
    let no_triangle = || Refused(3, "three different places in x and y that are not on one line");
    let text = |name: &str, points: Vec<[f64; 3]>, gives| case(name, ".csv", rows(points), gives);
    let square = [[0.0, 0.0, 0.0], [9.0, 0.0, 1.0], [0.0, 9.0, 2.0], [9.0, 9.0, 3.0]];
    let line = |x: f64, y: f64| (0..50_000).map(|i| [x * i as f64, y * i as f64, (i % 7) as f64]).collect::<Vec<_>>();
    let and_square = |more: Vec<[f64; 3]>| [&square[..], &more].concat();
    let spot = Case {
        content: Content::Repeated(b"5,5,5\n".repeat(1000), 2000),
        ..case("two million points on one spot", ".csv", Vec::new(), no_triangle())
    };
    vec![
        text("no point", Vec::new(), Refused(3, "no point is left")),
        text("one point", vec![[1.0, 2.0, 3.0]], no_triangle()),
        text("two points", vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], no_triangle()),
        text("three in a row", vec![[1.0, 1.0, 3.0], [2.0, 2.0, 6.0], [3.0, 3.0, 0.0]], no_triangle()),
        text("a tower", (0..1000).map(|i| [7.0, 7.0, i as f64]).collect(), no_triangle()),
        spot,
        text("a level line", line(1.0, 0.0), no_triangle()),
        text("an upright line", line(0.0, 1.0), no_triangle()),
        text("a slanted line", line(3.0, -2.0), no_triangle()),
        text("a line and a point", [line(1.0, 1.0), vec![[7.0, 8.0, 9.0]]].concat(), Read(50_001, 0, "")),
        text("a square", square.to_vec(), Read(4, 0, "")),
        text("a needle", and_square(vec![[1e7, 1.0, 0.0]]), Read(5, 0, "")),
        text("far away", square.iter().map(|p| [p[0] + 1e12, p[1] - 1e12, p[2]]).collect(), Read(4, 0, "")),
        text(
            "farther than floating point reaches",
            square.iter().map(|p| [p[0] + 1e17, p[1], p[2]]).collect(),
            Refused(3, "make no triangle in steps of 100"),
        ),
        text("one point far away", and_square(vec![[1e15, 0.0, 0.0]]), Refused(3, "far from all other rows")),
        text("one point high above", and_square(vec![[5.0, 5.0, 3e15]]), Refused(3, "far from all other rows")),
        text("heights that differ by much", and_square(vec![[5.0, 5.0, 1e6]]), Read(5, 0, "")),
    ]
}
