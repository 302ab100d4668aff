// Step G5: prefix sums of the numbers of triangles, so that step G6 knows where to write and does no more work than its output needs.
//
// There are no barriers. `sum` adds 64 neighbours of one level to one number of the next, until one number is left, the total.
// `spread` then goes down again and replaces every number by the sum of those before it. All levels lie in one buffer.

const BLOCK = 64u;

struct Params {
    // The position of the level's first number, and how many numbers the level has.
    first: u32,
    length: u32,
    // The position of the next level's first number. In `spread`, `has_next` is 0 if the next level is the total.
    next: u32,
    has_next: u32,
    // The number of invocations in a row of the dispatch.
    invocations: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> counts: array<u32>;

@compute @workgroup_size(64)
fn sum(@builtin(global_invocation_id) id: vec3u) {
    let block = id.y * params.invocations + id.x;
    if block * BLOCK >= params.length {
        return;
    }
    var total = 0u;
    let end = min(block * BLOCK + BLOCK, params.length);
    for (var i = block * BLOCK; i < end; i++) {
        total += counts[params.first + i];
    }
    counts[params.next + block] = total;
}

@compute @workgroup_size(64)
fn spread(@builtin(global_invocation_id) id: vec3u) {
    let block = id.y * params.invocations + id.x;
    if block * BLOCK >= params.length {
        return;
    }
    var before = 0u;
    if params.has_next != 0u {
        before = counts[params.next + block];
    }
    let end = min(block * BLOCK + BLOCK, params.length);
    for (var i = block * BLOCK; i < end; i++) {
        let count = counts[params.first + i];
        counts[params.first + i] = before;
        before += count;
    }
}
