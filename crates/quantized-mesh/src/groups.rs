//! Things by the vertex that they belong to, in little memory: a tile may have millions of vertices.

/// Things by vertex, in order for each.
pub(crate) struct Groups<T> {
    /// Where the things of each vertex begin.
    starts: Vec<u32>,
    things: Vec<T>,
}

impl<T: Copy + Default + Ord> Groups<T> {
    /// Groups things, each with its vertex, which is one of so many.
    pub(crate) fn new(vertices: usize, things: impl Iterator<Item = (u32, T)> + Clone) -> Groups<T> {
        // Where those of each vertex end: the places below are given from there down.
        let mut starts = vec![0u32; vertices + 1];
        things.clone().for_each(|(v, _)| starts[v as usize] += 1);
        let mut count = 0;
        for start in &mut starts {
            count += *start;
            *start = count;
        }
        let mut sorted = vec![T::default(); count as usize];
        for (v, thing) in things {
            let place = &mut starts[v as usize];
            *place -= 1;
            sorted[*place as usize] = thing;
        }
        starts.windows(2).for_each(|range| sorted[range[0] as usize..range[1] as usize].sort_unstable());
        Groups { starts, things: sorted }
    }

    fn range(&self, v: u32) -> std::ops::Range<usize> {
        self.starts[v as usize] as usize..self.starts[v as usize + 1] as usize
    }

    /// Returns the things of a vertex, in order.
    pub(crate) fn of(&self, v: u32) -> &[T] {
        &self.things[self.range(v)]
    }

    /// Returns them to be changed. They must stay in order.
    pub(crate) fn of_mut(&mut self, v: u32) -> &mut [T] {
        let range = self.range(v);
        &mut self.things[range]
    }

    /// Returns all vertices with their things.
    pub(crate) fn all(&self) -> impl Iterator<Item = (u32, &[T])> {
        (0..self.starts.len() as u32 - 1).map(|v| (v, self.of(v)))
    }
}
