// What goes back to the CPU, in one buffer: the records of all leaves, with numbers as if each leaf were alone; then the bits of unfinished
// triangles and of missing sites, what is to be known of each leaf, and where the triangles of each block begin.

const FREE = 0xffffffffu;

@group(0) @binding(1) var<storage, read> leaves: array<Leaf>;

struct RecordParams {
    // Half records.
    halves: u32,
    leaves: u32,
    // The number of workgroups in a row of the dispatch.
    row: u32,
}

@group(0) @binding(0) var<uniform> record_params: RecordParams;
// Two for each triangle: corners and note, twins and partner.
@group(0) @binding(2) var<storage, read> records: array<vec4u>;
@group(0) @binding(3) var<storage, read_write> relative_records: array<vec4u>;

var<workgroup> leaf_of_group: u32;

// Returns the last leaf whose first record is at most `record`.
fn leaf_of_record(record: u32) -> u32 {
    var low = 0u;
    var high = record_params.leaves;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if leaves[middle].first_record <= record {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// A workgroup handles 64 records, which are of one leaf.
@compute @workgroup_size(128)
fn give_records(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let first = (group.y * record_params.row + group.x) * 128u;
    if first >= record_params.halves {
        return;
    }
    if lane == 0u {
        leaf_of_group = leaf_of_record(first / 2u);
    }
    workgroupBarrier();
    let leaf = leaves[leaf_of_group];
    let half = records[first + lane];
    let base = select(leaf.first_site, 8u * leaf.first_record, (lane & 1u) != 0u);
    let relative = select(half - base, half, half == vec4u(FREE));
    relative_records[first + lane] = vec4u(relative.xyz, 0u);
}

struct BitParams {
    // 32 records each.
    record_words: u32,
    // 32 sites each; those of a leaf begin a word.
    site_words: u32,
    leaves: u32,
    // Where the section of the marks begins that has the dirty triangles.
    dirty: u32,
    // The number of invocations in a row of the dispatch.
    invocations: u32,
}

@group(0) @binding(0) var<uniform> bit_params: BitParams;
// Bits for each triangle in four sections, the last for the inverted ones.
@group(0) @binding(4) var<storage, read> marks: array<u32>;
// A bit for each site of the atlas.
@group(0) @binding(5) var<storage, read> missing: array<u32>;
@group(0) @binding(6) var<storage, read_write> returned: array<u32>;

// Returns the word in which the missing sites of a leaf begin. No two leaves share a word.
fn first_word(leaf: u32) -> u32 {
    return leaves[leaf].first_site / 32u + leaf;
}

// Returns a word of the missing sites of a leaf, from number `first` of its sites on.
fn missing_word(leaf: Leaf, first: u32) -> u32 {
    if first >= leaf.sites {
        return 0u;
    }
    let at = leaf.first_site + first;
    var word = missing[at / 32u] >> (at % 32u);
    if at % 32u != 0u && at / 32u + 1u < arrayLength(&missing) {
        word |= missing[at / 32u + 1u] << (32u - at % 32u);
    }
    return word & (0xffffffffu >> (32u - min(leaf.sites - first, 32u)));
}

@compute @workgroup_size(64)
fn give_bits(@builtin(global_invocation_id) id: vec3u) {
    let i = id.y * bit_params.invocations + id.x;
    let records_end = 256u * bit_params.record_words;
    if i < bit_params.record_words {
        returned[records_end + i] = marks[bit_params.dirty + i] | marks[3u * bit_params.record_words + i];
    }
    if i < bit_params.site_words {
        var low = 0u;
        var high = bit_params.leaves;
        while high - low > 1u {
            let middle = (low + high) / 2u;
            if first_word(middle) <= i {
                low = middle;
            } else {
                high = middle;
            }
        }
        let word = missing_word(leaves[low], 32u * (i - first_word(low)));
        returned[records_end + bit_params.record_words + i] = word;
    }
}

struct StartParams {
    blocks: u32,
    leaves: u32,
    // Where in the buffer the numbers begin.
    first: u32,
    // The number of invocations in a row of the dispatch.
    invocations: u32,
}

@group(0) @binding(0) var<uniform> start_params: StartParams;
// The leaf and the southwestern pixel (y << 16 | x) of each block.
@group(0) @binding(7) var<storage, read> blocks: array<vec2u>;
// The number of triangles before each block of the atlas, and of all.
@group(0) @binding(8) var<storage, read> starts: array<u32>;
// Bits for each leaf.
@group(0) @binding(9) var<storage, read> flags: array<u32>;

// Writes the number of triangles and the flags of each leaf, then the first triangle of each block.
@compute @workgroup_size(64)
fn give_starts(@builtin(global_invocation_id) id: vec3u) {
    let i = id.y * start_params.invocations + id.x;
    if i < start_params.leaves {
        let leaf = leaves[i];
        let last = leaf.first_block + leaf.stride / 32u * (leaf.height / 32u + 1u);
        returned[start_params.first + 2u * i] = starts[last] - starts[leaf.first_block];
        returned[start_params.first + 2u * i + 1u] = flags[i];
    }
    if i < start_params.blocks {
        let before = starts[leaves[blocks[i].x].first_block];
        returned[start_params.first + 2u * start_params.leaves + i] = starts[i] - before;
    }
}
