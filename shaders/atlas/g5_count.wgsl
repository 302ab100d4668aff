// Step G5 in an atlas: turns the number of triangles of each block into the number of those in all blocks before, in place, with the
// total after the last. So step G6 knows where to write.
//
// It reduces and then scans: `sum` adds up each 1024 blocks, `spread` starts each of them at the sum of those before. No workgroup waits
// for another, because not all devices promise that all of them make progress.

const GROUP = 1024u;
const LANES = 256u;

struct Params {
    blocks: u32,
    // The number of workgroups in a row of the dispatch.
    row: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// A number for each block, the total, then a sum for each 1024 blocks.
@group(0) @binding(1) var<storage, read_write> counts: array<u32>;

var<workgroup> items: array<u32, 1024>;
var<workgroup> sums: array<u32, 256>;

// Replaces the numbers in `sums` by their sums from the first to each.
fn add_up(lane: u32) {
    for (var step = 1u; step < LANES; step *= 2u) {
        var other = 0u;
        workgroupBarrier();
        if lane >= step {
            other = sums[lane - step];
        }
        workgroupBarrier();
        sums[lane] += other;
    }
    workgroupBarrier();
}

@compute @workgroup_size(256)
fn sum(@builtin(workgroup_id) id: vec3u, @builtin(local_invocation_index) lane: u32) {
    let group = id.y * params.row + id.x;
    if group * GROUP >= params.blocks {
        return;
    }
    var own = 0u;
    let end = min((group + 1u) * GROUP, params.blocks);
    for (var i = group * GROUP + lane; i < end; i += LANES) {
        own += counts[i];
    }
    sums[lane] = own;
    add_up(lane);
    if lane == 0u {
        counts[params.blocks + 1u + group] = sums[LANES - 1u];
    }
}

@compute @workgroup_size(256)
fn spread(@builtin(workgroup_id) id: vec3u, @builtin(local_invocation_index) lane: u32) {
    let group = id.y * params.row + id.x;
    if group * GROUP >= params.blocks {
        return;
    }
    var before = 0u;
    for (var i = lane; i < group; i += LANES) {
        before += counts[params.blocks + 1u + i];
    }
    for (var i = lane; i < GROUP; i += LANES) {
        var count = 0u;
        if group * GROUP + i < params.blocks {
            count = counts[group * GROUP + i];
        }
        items[i] = count;
    }
    sums[lane] = before;
    add_up(lane);
    let start = sums[LANES - 1u];
    workgroupBarrier();
    let first = 4u * lane;
    let four = vec4u(items[first], items[first + 1u], items[first + 2u], items[first + 3u]);
    sums[lane] = four.x + four.y + four.z + four.w;
    add_up(lane);
    var at = start + sums[lane] - (four.x + four.y + four.z + four.w);
    for (var i = 0u; i < 4u; i++) {
        items[first + i] = at;
        at += four[i];
    }
    workgroupBarrier();
    for (var i = lane; i < GROUP; i += LANES) {
        if group * GROUP + i < params.blocks {
            counts[group * GROUP + i] = items[i];
        }
    }
    // The last invocation has gone past the last block.
    if lane == LANES - 1u && params.blocks <= (group + 1u) * GROUP {
        counts[params.blocks] = at;
    }
}
