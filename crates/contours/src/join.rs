//! Joining the chains of one level into lines.

use crate::chain::Chain;
use crate::edge_key::EdgeKey;
use std::ops::Range;

/// Points of a line that follow each other where they are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    /// The place of the first, counted as in [`Chain::at`].
    pub at: u64,
    /// How many.
    pub points: u32,
}

/// A whole line of a level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// The first edge of a line that ends on the border of the terrain; the least edge of a ring, which begins there. It is in no other line
    /// of the level.
    pub key: EdgeKey,
    /// Whether it is a ring.
    pub is_closed: bool,
    /// The numbers of its pieces in [`JoinedLines::pieces`]. The first point of each is the last one of the piece before, or follows it.
    pub pieces: Range<usize>,
}

/// All lines of a level.
#[derive(Debug, Default)]
pub struct JoinedLines {
    /// The lines, by their keys.
    pub lines: Vec<Line>,
    /// The pieces of all lines.
    pub pieces: Vec<Piece>,
}

impl JoinedLines {
    /// Returns the pieces of a line.
    pub fn pieces_of(&self, line: &Line) -> &[Piece] {
        &self.pieces[line.pieces.clone()]
    }

    fn add(&mut self, key: EdgeKey, is_closed: bool, pieces: impl Iterator<Item = Piece>) {
        let first = self.pieces.len();
        self.pieces.extend(pieces);
        self.lines.push(Line { key, is_closed, pieces: first..self.pieces.len() });
    }
}

/// Joins the chains of one level in all tiles: where one ends, another may begin on the same edge. Leaves out lines around a point.
/// Where [`Chain::at`] counts bytes, `size` is the bytes of a point; otherwise it is 1.
pub fn join(chains: &[Chain], size: u64) -> JoinedLines {
    let mut joined = JoinedLines::default();
    for ring in chains.iter().filter(|chain| chain.is_closed()) {
        joined.add(ring.least, true, [Piece { at: ring.at, points: ring.points }].into_iter());
    }
    let mut open: Vec<Chain> = chains.iter().filter(|chain| !chain.is_closed()).copied().collect();
    open.sort_unstable_by_key(|chain| chain.start);
    let mut is_left: Vec<bool> = vec![true; open.len()];
    let mut ends: Vec<EdgeKey> = open.iter().map(|chain| chain.end).collect();
    ends.sort_unstable();
    let begins_on_border = |number: usize| ends.binary_search(&open[number].start).is_err();
    let from_border = (0..open.len()).filter(|number| begins_on_border(*number));
    // What is left after the lines from the border are rings.
    for first in from_border.chain(0..open.len()) {
        if is_left[first] {
            let line = follow(&open, &mut is_left, first);
            add_line(&mut joined, &open, &line, size);
        }
    }
    joined.lines.sort_unstable_by_key(|line| line.key);
    joined
}

/// Returns the numbers of the chains of a line in their order, from number `first` on.
fn follow(open: &[Chain], is_left: &mut [bool], first: usize) -> Vec<usize> {
    let mut line = Vec::new();
    let mut next = Some(first);
    while let Some(number) = next.filter(|number| is_left[*number]) {
        is_left[number] = false;
        line.push(number);
        next = open.binary_search_by_key(&open[number].end, |chain| chain.start).ok();
    }
    line
}

fn add_line(joined: &mut JoinedLines, open: &[Chain], line: &[usize], size: u64) {
    let chain = |number: &usize| &open[*number];
    if line.iter().map(chain).all(Chain::is_around_peak) {
        return;
    }
    let (Some(first), Some(last)) = (line.first().map(chain), line.last().map(chain)) else { return };
    let piece = |chain: &Chain| Piece { at: chain.at, points: chain.points };
    if first.start != last.end {
        return joined.add(first.start, false, line.iter().map(chain).map(piece));
    }
    let least = (0..line.len()).min_by_key(|number| chain(&line[*number]).least).unwrap_or(0);
    let (before, after) = line.split_at(least);
    let [cut, rest @ ..] = after else { return };
    let cut = chain(cut);
    let end = Piece { at: cut.at + u64::from(cut.least_at) * size, points: cut.points - cut.least_at };
    let begin = Piece { at: cut.at, points: cut.least_at + 1 };
    let between = rest.iter().chain(before).map(chain).map(piece);
    joined.add(cut.least, true, [end].into_iter().chain(between).chain([begin]));
}
