//! Which vertices of breaklines stay in a simplified terrain.

use breaklines::Breaklines;
use delaunay::geometry::Site;

/// The line vertices inside a terrain that stay, and the other vertices that make room for them.
pub(crate) struct KeptLines {
    /// The vertices that stay, with their own heights.
    pub(crate) vertices: Vec<usize>,
    /// Whether a vertex must not be chosen. Empty if all may be.
    barred: Vec<bool>,
}

impl KeptLines {
    /// Chooses from the inner vertices of a terrain at `positions`, which are not `on` its boundary, at most `most` vertices of lines.
    /// Lines with too many keep every second, fourth, and so on, as long as the pieces are not longer than `longest` lattice steps. Lines
    /// that are still too dense then leave no trace: there is no room for their shape.
    pub(crate) fn choose(
        lines: Option<&Breaklines>,
        positions: &[[i32; 3]],
        on: &[bool],
        most: usize,
        longest: f64,
    ) -> KeptLines {
        let none = KeptLines { vertices: Vec::new(), barred: Vec::new() };
        let Some(lines) = lines else { return none };
        let place = |v: usize| -> Site { [positions[v][0], positions[v][1]] };
        let inner = (0..positions.len()).filter(|&v| !on[v]);
        let ranked: Vec<(usize, u8)> = inner.filter_map(|v| Some((v, lines.rank(place(v))?))).collect();
        let stay = |level: u8| ranked.iter().filter(move |(_, rank)| *rank >= level).map(|(v, _)| *v);
        let spacing = f64::from(lines.options().spacing);
        let longer = (1..32u8).take_while(|&level| spacing * f64::from(1u32 << level) <= longest);
        let level = std::iter::once(0).chain(longer).find(|&level| stay(level).count() <= most);
        let Some(level) = level.filter(|_| !ranked.is_empty()) else { return none };
        // Points of the cloud have already made room for the pieces of level 0.
        let bars = |v: usize| !on[v] && lines.bars(place(v), level);
        let barred = if level == 0 { Vec::new() } else { (0..positions.len()).map(bars).collect() };
        KeptLines { vertices: stay(level).collect(), barred }
    }

    /// Returns whether the vertex may be chosen.
    pub(crate) fn allows(&self, vertex: usize) -> bool {
        self.barred.get(vertex).is_none_or(|barred| !barred)
    }
}
