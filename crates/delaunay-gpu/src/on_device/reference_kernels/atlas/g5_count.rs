//! Step G5 in an atlas: the twin of `shaders/atlas/g5_count.wgsl`.

/// Takes the number of triangles of each block; returns how many lie before each block, and the total.
pub fn count(counts: &[u32]) -> Vec<u32> {
    let mut starts = vec![0];
    for (i, count) in counts.iter().enumerate() {
        starts.push(starts[i] + count);
    }
    starts
}
