//! A job that is stopped while it writes contour lines, or goes on with others.

use crate::rig::{Rig, Setup};
use crate::scattered;

fn with_contours(options: &str) -> Setup {
    Setup::tiles_of(1_500).output(&format!("contours = {{ {options} }}"))
}

#[test]
fn contour_lines_that_were_stopped_anywhere_end_with_the_same_bytes() {
    let mut rig = Rig::new(&scattered::uniform(5_000, 20_000, 5), &with_contours("interval = 20.0"));
    rig.ends_alike_wherever_it_is_stopped(&[("trace", 1), ("trace", 4), ("line_producer", 1), ("line_producer", 5)]);
    rig.forget();
    rig.run_to("signal-line_producer", 2).stopped(&["error: interrupted"]);
    rig.expect(&with_contours("interval = 30.0"));
    let said = rig.run().succeeded().err;
    assert!(said.contains("[output] contours; the tiles stay"), "{said}");
    rig.is_complete("others");
}
