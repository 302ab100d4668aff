// Step G6 in an atlas: write the triangles as records of eight numbers, linked to their neighbours: three corners counterclockwise, 0,
// three twins, 0. Half-edge 8 t + i starts at corner i of triangle t; the twin of half-edge h is number h + 4.
//
// Between two pixels of different colours runs a piece of a Voronoi edge: an arm of the corners at both its ends. The arms of a corner go
// to the south (0), east (1), north (2) and west (3); arm k lies between the pixels k and k + 1 of southwest, southeast, northeast,
// northwest. Each half-edge of a triangle crosses one arm, except for the one along which a square is cut. Its twin is at the other end of
// the Voronoi edge that begins with that arm.
//
// The records of a leaf are in the order of its blocks, of the rows in a block, and of the corners in a row. What is left of the leaf's
// room is filled with records without a triangle, by all its blocks together.

struct Params {
    blocks: u32,
    // The number of workgroups in a row of the dispatch.
    row: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// The complement of the number of the site in each pixel.
@group(0) @binding(4) var<storage, read> texture: array<u32>;
// For each row of 32 corners of a block: the corners with triangles, those with two, those that are cut from the southwest to the
// northeast, and the number of triangles in the rows of the block before.
@group(0) @binding(5) var<storage, read> rows: array<vec4u>;
// The number of triangles before each block of the atlas, and of all.
@group(0) @binding(6) var<storage, read> starts: array<u32>;
// Two for each triangle.
@group(0) @binding(7) var<storage, read_write> records: array<vec4u>;
// Bits for each leaf.
@group(0) @binding(8) var<storage, read_write> flags: array<atomic<u32>>;

// A record without a triangle, a half-edge without a twin.
const FREE = 0xffffffffu;
// The longest Voronoi edge that is followed, in corners. Most have fewer than 20, but those in voids and between the hull and the rim of
// the texture may be as long as the texture.
const MAX_STEPS = 4096u;
// Why a leaf is flagged.
const TOO_MANY_TRIANGLES = 4u;
const LONG_EDGE = 8u;

// The triangles of the block: the corner, 1024 if it is the second of a square, 2048 if there are two, 4096 if they are cut from the
// southwest to the northeast.
var<workgroup> triangles: array<u32, 2048>;
const SECOND = 1024u;
const PAIR = 2048u;
const NORTHEAST = 4096u;

// A block and its leaf.
struct Place {
    leaf: Leaf,
    // The southwestern pixel of the block.
    x: u32,
    y: u32,
    // What to add to `starts` to get numbers of records.
    shift: u32,
    leaf_index: u32,
}

// Returns the number of the site of a label.
fn vertex(leaf: Leaf, pixel: u32) -> u32 {
    if pixel == FRAME {
        return leaf.first_site + leaf.sites;
    }
    return ~texture[leaf.base + (pixel >> 16u) * leaf.stride + (pixel & 0xffffu)];
}

// Returns the label of pixel k (southwest, southeast, northeast, northwest) of corner (x, y) of the leaf.
fn pixel_at(place: Place, x: u32, y: u32, k: u32) -> u32 {
    let px = x - u32(k == 0u || k == 3u);
    let py = y - u32(k < 2u);
    let column = px - place.x + 1u;
    let row = py - place.y + 1u;
    if column < TILE_SIDE && row < TILE_SIDE {
        return tile[row * TILE_SIDE + column];
    }
    return label(place.leaf, px, py);
}

// Returns the half-edge that crosses an arm of a corner with three arms or four. Missing is the arm that a corner with three lacks.
fn across(place: Place, x: u32, y: u32, arm: u32, missing: u32) -> u32 {
    let leaf = place.leaf;
    let block = leaf.first_block + y / BLOCK_SIDE * (leaf.stride / BLOCK_SIDE) + x / BLOCK_SIDE;
    let row = rows[block * BLOCK_SIDE + y % BLOCK_SIDE];
    let bit = x % BLOCK_SIDE;
    let before = (1u << bit) - 1u;
    let t = 8u * (place.shift + starts[block] + row.w + countOneBits(row.x & before) + countOneBits(row.y & before));
    if ((row.y >> bit) & 1u) == 0u {
        return t + arm - u32(missing < arm);
    }
    if ((row.z >> bit) & 1u) != 0u {
        return t + vec4u(0u, 1u, 9u, 10u)[arm];
    }
    return t + vec4u(0u, 8u, 9u, 2u)[arm];
}

// Follows the Voronoi edge that leaves a corner along an arm; returns the half-edge at its other end, or FREE if that is too far. On the
// way, one colour is always on the left and one on the right.
fn walk(place: Place, start_x: u32, start_y: u32, start_arm: u32, left: u32, right: u32) -> u32 {
    var x = start_x;
    var y = start_y;
    var arm = start_arm;
    for (var i = 0u; i < MAX_STEPS; i++) {
        x += u32(arm == 1u) - u32(arm == 3u);
        y += u32(arm == 2u) - u32(arm == 0u);
        let ahead_left = pixel_at(place, x, y, (arm + 1u) & 3u);
        let ahead_right = pixel_at(place, x, y, arm);
        // Where both colours face themselves across the corner, the pixels in the southwest and northeast are connected.
        let is_across = (arm & 1u) != 0u;
        if ahead_left == right && (ahead_right != left || is_across) {
            arm = (arm + 1u) & 3u;
        } else if ahead_right == left && (ahead_left != right || !is_across) {
            arm = (arm + 3u) & 3u;
        } else if ahead_left != left || ahead_right != right {
            var missing = select((arm + 3u) & 3u, arm, ahead_left == ahead_right);
            missing = select(missing, (arm + 1u) & 3u, ahead_left == left);
            return across(place, x, y, (arm + 2u) & 3u, missing);
        }
    }
    atomicOr(&flags[place.leaf_index], LONG_EDGE);
    return FREE;
}

// Lists the triangles of a corner.
fn list(block: u32, corner: u32) {
    let row = rows[block * BLOCK_SIDE + corner / BLOCK_SIDE];
    let bit = corner % BLOCK_SIDE;
    if ((row.x >> bit) & 1u) == 0u {
        return;
    }
    let before = (1u << bit) - 1u;
    let at = row.w + countOneBits(row.x & before) + countOneBits(row.y & before);
    if ((row.y >> bit) & 1u) == 0u {
        triangles[at] = corner;
        return;
    }
    let kind = corner | PAIR | select(0u, NORTHEAST, ((row.z >> bit) & 1u) != 0u);
    triangles[at] = kind;
    triangles[at + 1u] = kind | SECOND;
}

// Writes the record of a triangle of the list.
fn write(place: Place, triangle: u32, number: u32) {
    let colours = around(triangle % BLOCK_SIDE, triangle % SECOND / BLOCK_SIDE);
    let x = place.x + triangle % BLOCK_SIDE;
    let y = place.y + triangle % SECOND / BLOCK_SIDE;
    let is_second = (triangle & SECOND) != 0u;
    // The triangle has the pixels and the arms of the corner except for one.
    var missing = 0u;
    // The arm in whose place the square is cut, and the twin there.
    var cut = 4u;
    var partner = 0u;
    if (triangle & PAIR) == 0u {
        missing = select(missing, 1u, colours.y == colours.z);
        missing = select(missing, 2u, colours.z == colours.w);
        missing = select(missing, 3u, colours.w == colours.x);
    } else {
        if (triangle & NORTHEAST) != 0u {
            missing = select(3u, 1u, is_second);
            partner = select(8u * number + 8u, 8u * number - 6u, is_second);
        } else {
            missing = select(2u, 0u, is_second);
            partner = select(8u * number + 10u, 8u * number - 7u, is_second);
        }
        cut = (missing + 3u) & 3u;
    }
    var corners = vec4u();
    var twins = vec4u();
    for (var i = 0u; i < 3u; i++) {
        let arm = i + u32(i >= missing);
        let colour = colours[arm];
        var twin = partner;
        if arm != cut {
            twin = walk(place, x, y, arm, colours[(arm + 1u) & 3u], colour);
        }
        // Writing to element i would put the vectors into memory.
        let is_own = vec4u(0u, 1u, 2u, 3u) == vec4u(i);
        corners = select(corners, vec4u(vertex(place.leaf, colour)), is_own);
        twins = select(twins, vec4u(twin), is_own);
    }
    records[2u * number] = corners;
    records[2u * number + 1u] = twins;
}

@compute @workgroup_size(256)
fn make(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = group.y * params.row + group.x;
    if block >= params.blocks {
        return;
    }
    let leaf_index = blocks[block].x;
    let leaf = leaves[leaf_index];
    let southwest = blocks[block].y;
    let leaf_blocks = leaf.stride / BLOCK_SIDE * (leaf.height / BLOCK_SIDE + 1u);
    let leaf_start = starts[leaf.first_block];
    let all = starts[leaf.first_block + leaf_blocks] - leaf_start;
    let fits = all <= leaf.records;
    let place = Place(leaf, southwest & 0xffffu, southwest >> 16u, leaf.first_record - leaf_start, leaf_index);

    let used = select(0u, all, fits);
    let share = (leaf.records - used + leaf_blocks - 1u) / leaf_blocks;
    let first_spare = used + (block - leaf.first_block) * share;
    let end = min(first_spare + share, leaf.records);
    for (var i = first_spare + lane; i < end; i += 256u) {
        let spare = leaf.first_record + i;
        records[2u * spare] = vec4u(FREE, FREE, FREE, 0u);
        records[2u * spare + 1u] = vec4u(FREE, FREE, FREE, 0u);
    }
    if !fits {
        if lane == 0u {
            atomicOr(&flags[leaf_index], TOO_MANY_TRIANGLES);
        }
        return;
    }

    fill_tile(leaf, place.x, place.y, lane);
    for (var corner = lane; corner < BLOCK_SIDE * BLOCK_SIDE; corner += 256u) {
        list(block, corner);
    }
    workgroupBarrier();
    let first = starts[block];
    let count = starts[block + 1u] - first;
    for (var i = lane; i < count; i += 256u) {
        write(place, triangles[i], place.shift + first + i);
    }
}
