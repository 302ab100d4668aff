// What steps G4 and G6 share: a workgroup handles the corners of one block of 32 x 32 pixels. Corner (x, y) is the southwestern one of
// pixel (x, y), so the pixels around the corners are those of the block, a column west of it and a row south of it: the tile.

const BLOCK_SIDE = 32u;
const TILE_SIDE = 33u;

// The leaf and the southwestern pixel (y << 16 | x) of each block.
@group(0) @binding(1) var<storage, read> blocks: array<vec2u>;
@group(0) @binding(2) var<storage, read> leaves: array<Leaf>;
@group(0) @binding(3) var<storage, read> labels: array<u32>;

var<workgroup> tile: array<u32, 1089>;

// Returns the label of a pixel of a leaf. A coordinate of -1 is 2^32 - 1, which is outside too.
fn label(leaf: Leaf, x: u32, y: u32) -> u32 {
    if x >= leaf.width || y >= leaf.height {
        return FRAME;
    }
    return labels[leaf.base + y * leaf.stride + x];
}

// Reads the tile of the block whose southwestern pixel is (x, y). A barrier must follow.
fn fill_tile(leaf: Leaf, x: u32, y: u32, lane: u32) {
    for (var i = lane; i < TILE_SIDE * TILE_SIDE; i += 256u) {
        tile[i] = label(leaf, x + i % TILE_SIDE - 1u, y + i / TILE_SIDE - 1u);
    }
}

// Returns the labels around corner (x, y) of the block, counterclockwise from the southwest.
fn around(x: u32, y: u32) -> vec4u {
    let i = y * TILE_SIDE + x;
    return vec4u(tile[i], tile[i + 1u], tile[i + TILE_SIDE + 1u], tile[i + TILE_SIDE]);
}
