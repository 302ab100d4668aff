//! The triangles around each vertex of a mesh, by the edges across from it, in a form that needs no search: it says from which edge to
//! which those go on that are not in a list yet.
//!
//! Such an edge is called an arc here. It leads counterclockwise around the vertex, so the arcs of a fan follow each other. A vertex
//! has six on average; up to [`HELD`] of them lie together in memory, which all of them are compared with one corner at a time.

/// Arcs of a vertex that lie together. Few vertices have more.
pub(crate) const HELD: usize = 8;

/// The number of a vertex, or of arcs. In 16 bits where that is enough, because less memory is in the cache then.
pub(crate) trait Number: Copy + Eq {
    /// Two of these. The first is in the lower half of the bits, and one more than the second in the upper one: no arc is 0.
    type Arc: Copy + Default;

    /// No vertex.
    const NONE: Self;

    /// No vertex either.
    const LOST: Self;

    fn new(number: usize) -> Self;

    fn get(self) -> usize;

    /// Returns the next number, or this one if it is the greatest.
    fn one_more(self) -> Self;

    fn one_less(self) -> Self;

    fn arc(ends: [u32; 2]) -> Self::Arc;

    /// Returns the ends of an arc, if it is one.
    fn ends(arc: Self::Arc) -> Option<[u32; 2]>;

    /// Returns where the arc ends that begins at a vertex, or `NONE` if there is no such arc.
    fn after(arcs: &[Self::Arc; HELD], from: Self) -> Self;

    /// Returns one of two numbers without a branch, which would often be foretold wrongly.
    fn either(first: bool, of: [Self; 2]) -> Self;
}

macro_rules! number {
    ($number:ident, $arc:ident) => {
        impl Number for $number {
            type Arc = $arc;

            const NONE: $number = $number::MAX;
            const LOST: $number = $number::MAX - 1;

            #[inline(always)]
            fn new(number: usize) -> $number {
                number as $number
            }

            #[inline(always)]
            fn get(self) -> usize {
                self as usize
            }

            #[inline(always)]
            fn one_more(self) -> $number {
                self.saturating_add(1)
            }

            #[inline(always)]
            fn one_less(self) -> $number {
                self.wrapping_sub(1)
            }

            #[inline(always)]
            fn arc([from, to]: [u32; 2]) -> $arc {
                ($arc::from(to) + 1) << $number::BITS | $arc::from(from)
            }

            #[inline(always)]
            fn ends(arc: $arc) -> Option<[u32; 2]> {
                let to = ((arc >> $number::BITS) as $number).checked_sub(1)?;
                Some([arc as $number, to].map(u32::from))
            }

            #[inline(always)]
            fn after(arcs: &[$arc; HELD], from: $number) -> $number {
                let found = arcs.iter().fold(0, |found, &arc| {
                    let is_it = $arc::from(arc & $arc::from($number::MAX) == $arc::from(from));
                    found | (is_it.wrapping_neg() & arc)
                });
                ((found >> $number::BITS) as $number).wrapping_sub(1)
            }

            #[inline(always)]
            fn either(first: bool, [a, b]: [$number; 2]) -> $number {
                b ^ ($number::from(first).wrapping_neg() & (a ^ b))
            }
        }
    };
}

number!(u16, u32);
number!(u32, u64);

/// The greatest number of vertices with numbers in 16 bits.
pub(crate) const SHORT: usize = u16::LOST as usize;

/// The arcs around the vertices of a mesh.
pub(crate) struct ArcsAround<N: Number> {
    /// The first arcs of each vertex, then zeros.
    held: Vec<[N::Arc; HELD]>,
    /// The others with their vertices, ascending.
    more: Vec<(u32, [u32; 2])>,
}

impl<N: Number> ArcsAround<N> {
    /// Returns vertices from 0 to `vertices` without arcs.
    pub(crate) fn new(vertices: usize) -> ArcsAround<N> {
        ArcsAround { held: vec![[N::Arc::default(); HELD]; vertices], more: Vec::new() }
    }

    /// Adds an arc around vertex `v`, which has `count` of them so far.
    #[inline(always)]
    pub(crate) fn add(&mut self, v: u32, arc: [u32; 2], count: usize) {
        match self.held[v as usize].get_mut(count) {
            Some(held) => *held = N::arc(arc),
            None => self.more.push((v, arc)),
        }
    }

    /// Ends adding.
    pub(crate) fn sort(&mut self) {
        self.more.sort_by_key(|(v, _)| *v);
    }

    /// Returns the first arcs around vertex `v`.
    #[inline(always)]
    pub(crate) fn held(&self, v: u32) -> [N::Arc; HELD] {
        self.held[v as usize]
    }

    /// Appends all arcs around vertex `v` to `all`, which is empty.
    pub(crate) fn all(&self, v: u32, all: &mut Vec<[u32; 2]>) {
        all.extend(self.held[v as usize].iter().filter_map(|&arc| N::ends(arc)));
        if all.len() == HELD {
            let first = self.more.partition_point(|(of, _)| *of < v);
            all.extend(self.more[first..].iter().take_while(|(of, _)| *of == v).map(|(_, arc)| *arc));
        }
    }
}
