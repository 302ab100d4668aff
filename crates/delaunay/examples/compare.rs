//! Triangulates a million points with this crate and with `spade`, and compares triangles and times.

use delaunay::Delaunay;
use spade::{DelaunayTriangulation, Point2, Triangulation};
use std::time::Instant;

const POINTS: usize = 1_000_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut state = 1_u64;
    let mut next = || {
        // xorshift64*: G. Marsaglia, "Xorshift RNGs", 2003; S. Vigna, 2016.
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        (state.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 36) as i32
    };
    let points: Vec<[i32; 2]> = (0..POINTS).map(|_| [next(), next()]).collect();

    let begun = Instant::now();
    let ours = Delaunay::of_integers(&points)?;
    let seconds = begun.elapsed().as_secs_f64();

    let begun = Instant::now();
    let theirs = points.iter().map(|&[x, y]| Point2::new(f64::from(x), f64::from(y))).collect();
    let theirs = DelaunayTriangulation::<Point2<f64>>::bulk_load(theirs)?;
    let seconds_of_spade = begun.elapsed().as_secs_f64();

    let sorted = |mut triangles: Vec<[[i32; 2]; 3]>| {
        triangles.iter_mut().for_each(|corners| corners.sort_unstable());
        triangles.sort_unstable();
        triangles
    };
    let of_spade = theirs.inner_faces().map(|face| face.positions().map(|place| [place.x as i32, place.y as i32]));
    let own = ours.triangles().iter().map(|corners| corners.map(|corner| points[corner as usize]));
    let is_same = sorted(of_spade.collect()) == sorted(own.collect());
    println!(
        "{} triangles in {seconds:.2} s; spade takes {:.1} times as long",
        ours.triangles().len(),
        seconds_of_spade / seconds
    );
    println!(
        "the triangles are {}",
        if is_same { "the same" } else { "others, which only cocircular points can explain" }
    );
    Ok(())
}
