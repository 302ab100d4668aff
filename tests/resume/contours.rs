//! A job that is stopped while it writes contour lines, or goes on with others.

use crate::rig::{Rig, Setup};
use crate::scattered;

fn with_contours(options: &str) -> Setup {
    Setup::tiles_of(1_500).output(&format!("contours = {{ {options} }}"))
}

#[test]
fn contour_lines_that_were_stopped_anywhere_end_with_the_same_bytes() {
    let mut rig = Rig::new(&scattered::uniform(5_000, 20_000, 5), &with_contours("interval = 20.0"));
    for (place, count) in [("trace", 1), ("trace", 4), ("line_producer", 1), ("line_producer", 5)] {
        rig.forget();
        let what = format!("signal-{place}");
        rig.run_to(&what, count).stopped(&["error: interrupted"]);
        rig.has_nothing_half_written(&what);
        assert!(rig.completes(&what)["resumed"].as_u64() >= Some(5));
    }
    rig.forget();
    while rig.run_to("committed", 1).was_killed() {
        rig.has_nothing_half_written("a kill after a phase");
    }
    rig.is_complete("kills after phases");
    rig.forget();
    rig.run_to("signal-line_producer", 2).stopped(&["error: interrupted"]);
    rig.expect(&with_contours("interval = 30.0"));
    let said = rig.run().succeeded().err;
    assert!(said.contains("[output] contours; the tiles stay"), "{said}");
    rig.is_complete("others");
}
