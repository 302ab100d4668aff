// The table of blocks, as crates/delaunay-gpu/src/on_device/atlas.rs writes it. Rust puts this text in front of every shader that uses it. Such a shader declares
// `blocks` itself.

const BLOCK_SIDE = 32u;

struct Block {
    leaf: u32,
    // The southwestern pixel (y << 16 | x).
    corner: u32,
}

fn corner_of(block: u32) -> vec2u {
    let corner = blocks[block].corner;
    return vec2u(corner & 0xffffu, corner >> 16u);
}
