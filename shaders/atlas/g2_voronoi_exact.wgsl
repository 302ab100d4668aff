// Step G2, exact: the label of a pixel is the pixel (y << 16 | x) of its nearest site in its leaf: the site's pixel with the least
// (d^2, x, y).
//
// Columns come first, then rows. A column of a block is one word, whose bit i says whether row i of the block has a site (parallel
// banding, Cao et al. 2010). Together with the nearest sites south and north of the block, two bit operations find the nearest site of
// any pixel in its own column, so it need not be stored.
//
// Along a row, the columns of the labels never decrease, so a pixel examines only the columns between the labels of two pixels that
// are already known. Every 256th pixel comes first, then every 16th, then all. That bounds the work at about a hundred columns per
// pixel on average, for any input.

const NONE = 0xffffffffu;

struct Params {
    blocks: u32,
    // The number of workgroups, or in `some` of invocations, in a row of the dispatch.
    across: u32,
    // The distance between the pixels of this dispatch.
    stride: u32,
    // The distance between the pixels whose labels are known; 0 if none is known.
    known: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> leaves: array<Leaf>;
@group(0) @binding(2) var<storage, read> blocks: array<Block>;
@group(0) @binding(3) var<storage, read> texture: array<u32>;
@group(0) @binding(4) var<storage, read_write> words_out: array<u32>;
@group(0) @binding(5) var<storage, read> words: array<u32>;
@group(0) @binding(6) var<storage, read_write> south_out: array<u32>;
@group(0) @binding(7) var<storage, read_write> north_out: array<u32>;
@group(0) @binding(8) var<storage, read> south: array<u32>;
@group(0) @binding(9) var<storage, read> north: array<u32>;
@group(0) @binding(10) var<storage, read_write> labels: array<u32>;

var<workgroup> gathered: array<atomic<u32>, 32>;

// Gathers the words of a block. One workgroup per block, four rows per invocation.
@compute @workgroup_size(32, 8)
fn columns(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let block = group.y * params.across + group.x;
    if block >= params.blocks {
        return;
    }
    let leaf = blocks[block].leaf;
    let corner = corner_of(block);
    let first = pixel_number(leaf, corner.x + local.x, corner.y + 4u * local.y);
    let stride = leaves[leaf].stride;
    var rows = 0u;
    for (var i = 0u; i < 4u; i++) {
        rows |= u32(texture[first + i * stride] != 0u) << i;
    }
    if rows != 0u {
        atomicOr(&gathered[local.x], rows << (4u * local.y));
    }
    workgroupBarrier();
    if local.y == 0u {
        words_out[block * BLOCK_SIDE + local.x] = atomicLoad(&gathered[local.x]);
    }
}

// Carries the nearest sites across the blocks. One invocation per column of a leaf.
@compute @workgroup_size(64)
fn carry(@builtin(global_invocation_id) id: vec3u) {
    let i = id.y * params.across + id.x;
    let block = i / BLOCK_SIDE;
    if block >= params.blocks || corner_of(block).y != 0u {
        return;
    }
    let leaf = blocks[block].leaf;
    let stride = leaves[leaf].stride;
    let bands = leaves[leaf].height / BLOCK_SIDE + 1u;
    var last = NONE;
    for (var band = 0u; band < bands; band++) {
        let at = i + band * stride;
        let word = words[at];
        south_out[at] = last;
        if word != 0u {
            last = band * BLOCK_SIDE + firstLeadingBit(word);
        }
    }
    last = NONE;
    for (var band = bands; band > 0u; band--) {
        let at = i + (band - 1u) * stride;
        let word = words[at];
        north_out[at] = last;
        if word != 0u {
            last = (band - 1u) * BLOCK_SIDE + firstTrailingBit(word);
        }
    }
}

// Returns the row of the site in column x that is nearest to row y, or NONE if the column is empty. Of two at the same distance,
// the southern one wins. `column` is the number of the word of column x and row y.
fn nearest_in_column(column: u32, y: u32) -> u32 {
    let bit = y % BLOCK_SIDE;
    let first = y - bit;
    let word = words[column];
    let below = word & (NONE >> (31u - bit));
    let above = word & (NONE << bit);
    var s = first + firstLeadingBit(below);
    if below == 0u {
        s = south[column];
    }
    var n = first + firstTrailingBit(above);
    if above == 0u {
        n = north[column];
    }
    if s == NONE {
        return n;
    }
    return select(n, s, n == NONE || y - s <= n - y);
}

// Returns the label of pixel (x, y), which is known to lie in the columns from low to high. Searches outward from x.
fn nearest(leaf: u32, x: u32, y: u32, low: u32, high: u32) -> u32 {
    // The number of the word of column 0.
    let column = BLOCK_SIDE * leaves[leaf].first_block + y / BLOCK_SIDE * leaves[leaf].stride;
    var best = NONE;
    var label = NONE;
    var r = 0u;
    if x < low {
        r = low - x;
    }
    if x > high {
        r = x - high;
    }
    // A site at the same distance in the west still wins, so the loop includes equality.
    while r * r <= best && (x >= low + r || x + r <= high) {
        if x >= low + r && x - r <= high {
            let row = nearest_in_column(column + x - r, y);
            let dy = max(row, y) - min(row, y);
            let d = r * r + dy * dy;
            if row != NONE && d <= best {
                best = d;
                label = (row << 16u) | (x - r);
            }
        }
        if x + r <= high && x + r >= low && r > 0u {
            let row = nearest_in_column(column + x + r, y);
            let dy = max(row, y) - min(row, y);
            let d = r * r + dy * dy;
            if row != NONE && d < best {
                best = d;
                label = (row << 16u) | (x + r);
            }
        }
        r++;
    }
    return label;
}

// Labels pixel (x, y) of a leaf.
fn label_pixel(leaf: u32, x: u32, y: u32) {
    let width = leaves[leaf].width;
    let at = pixel_number(leaf, x, y);
    var low = 0u;
    var high = width - 1u;
    if params.known != 0u {
        let before = x % params.known;
        low = labels[at - before] & 0xffffu;
        if x - before + params.known < width {
            high = labels[at - before + params.known] & 0xffffu;
        }
    }
    labels[at] = nearest(leaf, x, y, low, high);
}

// Labels every stride-th pixel of a row. One invocation per pixel, or per row of a block if there is at most one.
@compute @workgroup_size(64)
fn some(@builtin(global_invocation_id) id: vec3u) {
    let i = id.y * params.across + id.x;
    let columns = max(BLOCK_SIDE / params.stride, 1u);
    let block = i / (BLOCK_SIDE * columns);
    if block >= params.blocks {
        return;
    }
    let leaf = blocks[block].leaf;
    let corner = corner_of(block);
    let x = corner.x + i % columns * params.stride;
    let y = corner.y + i / columns % BLOCK_SIDE;
    let is_known = params.known != 0u && x % params.known == 0u;
    if x % params.stride == 0u && !is_known && x < leaves[leaf].width && y < leaves[leaf].height {
        label_pixel(leaf, x, y);
    }
}

// Labels the pixels that are left, and the frame. One workgroup per eight rows of a block.
@compute @workgroup_size(32, 8)
fn all_pixels(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let i = group.y * params.across + group.x;
    let block = i / 4u;
    if block >= params.blocks {
        return;
    }
    let leaf = blocks[block].leaf;
    let corner = corner_of(block);
    let x = corner.x + local.x;
    let y = corner.y + i % 4u * 8u + local.y;
    if x >= leaves[leaf].width || y >= leaves[leaf].height {
        labels[pixel_number(leaf, x, y)] = FRAME;
    } else if x % params.known != 0u {
        label_pixel(leaf, x, y);
    }
}
