// Step G3: a pixel that has lost touch with its site takes the colour of the nearest other site among those of its neighbours. It has
// lost touch if none of the neighbours in the direction of the site (three, or one if the site lies straight along an axis) has its
// colour. The colour of the frame is never taken.
//
// A round is two dispatches. `find_all` or `find_near` marks the islands of every block, a bit each, and lists new colours for the first
// COLOURS of them, row by row. `recolour` writes those. The first round looks at all pixels, the later ones only at the islands of the
// round before and the pixels around them, since nothing else can have become an island. So the order of the invocations does not matter.
// After the last round, `find_left` flags the leaves that still have islands.

const NONE = 0xffffffffu;
// How many islands of a block one round removes.
const COLOURS = 32u;
// The flag of a leaf that has islands left.
const ISLANDS_LEFT = 1u;

struct Params {
    blocks: u32,
    // The number of workgroups in a row of the dispatch.
    across: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> leaves: array<Leaf>;
@group(0) @binding(2) var<storage, read> blocks: array<Block>;
@group(0) @binding(3) var<storage, read> labels: array<u32>;
// Words per block: a bit for each pixel, a word for each row.
@group(0) @binding(4) var<storage, read> islands: array<u32>;
@group(0) @binding(5) var<storage, read_write> islands_out: array<u32>;
@group(0) @binding(6) var<storage, read_write> colours_out: array<u32>;
@group(0) @binding(7) var<storage, read> colours: array<u32>;
@group(0) @binding(8) var<storage, read_write> labels_out: array<u32>;
@group(0) @binding(9) var<storage, read_write> flags: array<atomic<u32>>;

// The pixels to look at in each row of a block, and the islands in it.
var<workgroup> near: array<u32, 32>;
var<workgroup> found: array<atomic<u32>, 32>;

fn label_at(leaf: u32, p: vec2i) -> u32 {
    return labels[pixel_number(leaf, u32(p.x), u32(p.y))];
}

fn is_island(leaf: u32, p: vec2i, label: u32) -> bool {
    let towards = sign(vec2i(i32(label & 0xffffu), i32(label >> 16u)) - p);
    if all(towards == vec2i(0)) {
        return false;
    }
    // If the site lies straight along an axis, two of the three neighbours are the same pixel and the third is p itself.
    if towards.x != 0 && label_at(leaf, p + vec2i(towards.x, 0)) == label {
        return false;
    }
    if towards.y != 0 && label_at(leaf, p + vec2i(0, towards.y)) == label {
        return false;
    }
    return label_at(leaf, p + towards) != label;
}

// Returns whether label a comes before label b in the order of (x, y).
fn is_before(a: u32, b: u32) -> bool {
    let turned_a = (a << 16u) | (a >> 16u);
    let turned_b = (b << 16u) | (b >> 16u);
    return turned_a < turned_b;
}

// Returns the nearest site, with the least (d^2, x, y), among the labels of the neighbours other than `label`. North and east of the
// leaf there is always a pixel of the frame.
fn other_colour(leaf: u32, p: vec2i, label: u32) -> u32 {
    var best = NONE;
    var colour = NONE;
    for (var j = -1; j <= 1; j++) {
        for (var i = -1; i <= 1; i++) {
            let q = p + vec2i(i, j);
            if any(q < vec2i(0)) {
                continue;
            }
            let other = label_at(leaf, q);
            if other == label || other == FRAME {
                continue;
            }
            let away = vec2i(i32(other & 0xffffu), i32(other >> 16u)) - p;
            let d = u32(away.x * away.x + away.y * away.y);
            if d < best || (d == best && is_before(other, colour)) {
                best = d;
                colour = other;
            }
        }
    }
    return colour;
}

// Returns the new colour of a pixel if it is an island, or NONE.
fn new_colour(leaf: u32, p: vec2i) -> u32 {
    let label = label_at(leaf, p);
    if label == FRAME || !is_island(leaf, p, label) {
        return NONE;
    }
    return other_colour(leaf, p, label);
}

// Returns the new colour of a pixel of a block if it is an island, or NONE.
fn examine(block: u32, x: u32, row: u32) -> u32 {
    return new_colour(blocks[block].leaf, vec2i(corner_of(block) + vec2u(x, row)));
}

fn has_bit(word: u32, x: u32) -> bool {
    return ((word >> x) & 1u) != 0u;
}

// Finds the islands of a block among the pixels in `near`. One workgroup per block, four rows per invocation.
fn find(block: u32, local: vec3u) {
    let x = local.x;
    let first = 4u * local.y;
    for (var row = first; row < first + 4u; row++) {
        if has_bit(near[row], x) && examine(block, x, row) != NONE {
            atomicOr(&found[row], 1u << x);
        }
    }
    workgroupBarrier();
    // Islands are rare, so their colours are found again rather than kept.
    for (var row = first; row < first + 4u; row++) {
        if has_bit(atomicLoad(&found[row]), x) {
            let at = number_in_block(x, row);
            if at < COLOURS {
                colours_out[block * COLOURS + at] = examine(block, x, row);
            }
        }
    }
    if local.y == 0u {
        islands_out[block * BLOCK_SIDE + x] = atomicLoad(&found[x]);
    }
}

// Returns how many islands of the block come before pixel x of a row.
fn number_in_block(x: u32, row: u32) -> u32 {
    var count = countOneBits(atomicLoad(&found[row]) & ((1u << x) - 1u));
    for (var i = 0u; i < row; i++) {
        count += countOneBits(atomicLoad(&found[i]));
    }
    return count;
}

// Returns the islands of the round before in a row of the block that is `step` blocks away; 0 outside the leaf.
fn islands_before(block: u32, step: vec2i, row: u32) -> u32 {
    let leaf = blocks[block].leaf;
    let across = i32(leaves[leaf].stride / BLOCK_SIDE);
    let at = vec2i(corner_of(block) / BLOCK_SIDE) + step;
    if any(at < vec2i(0)) || at.x >= across || at.y > i32(leaves[leaf].height / BLOCK_SIDE) {
        return 0u;
    }
    return islands[(leaves[leaf].first_block + u32(at.y * across + at.x)) * BLOCK_SIDE + row];
}

// Returns the islands of the round before in a row from 1 south to 1 north of the block, and the pixels beside them.
fn widened(block: u32, row: i32) -> u32 {
    let step = select(select(0, 1, row > 31), -1, row < 0);
    let within = u32(row) & 31u;
    let word = islands_before(block, vec2i(0, step), within);
    let west = islands_before(block, vec2i(-1, step), within) >> 31u;
    let east = islands_before(block, vec2i(1, step), within) << 31u;
    return word | (word << 1u) | (word >> 1u) | west | east;
}

// Fills `near` with the islands of the round before and the pixels around them.
fn look_near(block: u32, local: vec3u) {
    if local.y == 0u {
        let row = i32(local.x);
        near[local.x] = widened(block, row - 1) | widened(block, row) | widened(block, row + 1);
    }
    workgroupBarrier();
}

@compute @workgroup_size(32, 8)
fn find_all(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let block = group.y * params.across + group.x;
    if block >= params.blocks {
        return;
    }
    if local.y == 0u {
        near[local.x] = NONE;
    }
    workgroupBarrier();
    find(block, local);
}

@compute @workgroup_size(32, 8)
fn find_near(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let block = group.y * params.across + group.x;
    if block >= params.blocks {
        return;
    }
    look_near(block, local);
    find(block, local);
}

@compute @workgroup_size(32, 8)
fn find_left(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let block = group.y * params.across + group.x;
    if block >= params.blocks {
        return;
    }
    look_near(block, local);
    for (var row = local.y; row < BLOCK_SIDE; row += 8u) {
        if has_bit(near[row], local.x) && examine(block, local.x, row) != NONE {
            atomicOr(&flags[blocks[block].leaf], ISLANDS_LEFT);
        }
    }
}

var<workgroup> counts: array<u32, 64>;

// Gives the islands that are listed their new colours. One invocation per row of a block.
@compute @workgroup_size(64)
fn recolour(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = (group.y * params.across + group.x) * 64u + local;
    let block = i / BLOCK_SIDE;
    var left = 0u;
    if block < params.blocks {
        left = islands[i];
    }
    counts[local] = countOneBits(left);
    workgroupBarrier();
    if left == 0u {
        return;
    }
    var at = 0u;
    for (var j = local & ~31u; j < local; j++) {
        at += counts[j];
    }
    let corner = corner_of(block);
    let first = pixel_number(blocks[block].leaf, corner.x, corner.y + local % BLOCK_SIDE);
    while left != 0u && at < COLOURS {
        labels_out[first + firstTrailingBit(left)] = colours[block * COLOURS + at];
        left &= left - 1u;
        at++;
    }
}
