//! Edges that are joined to lines as long as possible.

/// Returns lines of the numbers of their places, from `edges`, each of which is in one line: lines end where other than two edges meet. A line that
/// is closed ends where it begins. `places` is greater than every number.
pub fn polylines(edges: &[[u32; 2]], places: usize) -> Vec<Vec<u32>> {
    let mut walk = Walk::new(edges, places);
    let mut lines = Vec::new();
    for place in 0..places as u32 {
        while walk.degree(place) != 2 {
            let Some(line) = walk.line_from(place) else { break };
            lines.push(line);
        }
    }
    // Only rings are left.
    for place in 0..places as u32 {
        lines.extend(walk.line_from(place));
    }
    lines
}

struct Walk<'a> {
    edges: &'a [[u32; 2]],
    /// Where the edges of each place begin in `own`.
    starts: Vec<u32>,
    /// The edges of all places.
    own: Vec<u32>,
    is_used: Vec<bool>,
}

impl<'a> Walk<'a> {
    fn new(edges: &'a [[u32; 2]], places: usize) -> Walk<'a> {
        let mut starts = vec![0; places + 1];
        edges.iter().flatten().for_each(|end| starts[*end as usize + 1] += 1);
        (0..places).for_each(|place| starts[place + 1] += starts[place]);
        let (mut own, mut next) = (vec![0; 2 * edges.len()], starts.clone());
        for (number, edge) in (0..).zip(edges) {
            for end in edge {
                own[next[*end as usize] as usize] = number;
                next[*end as usize] += 1;
            }
        }
        Walk { edges, starts, own, is_used: vec![false; edges.len()] }
    }

    fn of(&self, place: u32) -> &[u32] {
        &self.own[self.starts[place as usize] as usize..self.starts[place as usize + 1] as usize]
    }

    fn degree(&self, place: u32) -> usize {
        self.of(place).len()
    }

    /// Takes an edge that is in no line yet, and returns its other end.
    fn step(&mut self, place: u32) -> Option<u32> {
        let edge = self.of(place).iter().copied().find(|edge| !self.is_used[*edge as usize])?;
        self.is_used[edge as usize] = true;
        let [a, b] = self.edges[edge as usize];
        Some(if a == place { b } else { a })
    }

    /// Returns the line from a place on; `None` if all edges there are in lines.
    fn line_from(&mut self, place: u32) -> Option<Vec<u32>> {
        let mut line = vec![place];
        let mut at = self.step(place)?;
        line.push(at);
        while self.degree(at) == 2
            && let Some(next) = self.step(at)
        {
            at = next;
            line.push(at);
        }
        Some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn lines_end_at_forks_and_rings_are_closed() {
        // A line 0-1-2 that forks into 3 and 4, and a ring of 5, 6 and 7.
        let edges = [[0, 1], [1, 2], [2, 3], [2, 4], [5, 6], [5, 7], [6, 7]];
        assert_eq!(polylines(&edges, 9), [vec![0, 1, 2], vec![2, 3], vec![2, 4], vec![5, 6, 7, 5]]);
        assert!(polylines(&[], 0).is_empty());
    }

    proptest! {
        #[test]
        fn every_edge_is_in_one_line(pairs in prop::collection::btree_set((0u32..12, 0u32..12), 0..30)) {
            let edges: Vec<[u32; 2]> = pairs.into_iter().filter(|(a, b)| a < b).map(|(a, b)| [a, b]).collect();
            let mut found: Vec<[u32; 2]> = Vec::new();
            for line in polylines(&edges, 12) {
                prop_assert!(line.len() > 1);
                found.extend(line.windows(2).map(|ends| [ends[0].min(ends[1]), ends[0].max(ends[1])]));
            }
            found.sort_unstable();
            prop_assert_eq!(found, edges);
        }
    }
}
