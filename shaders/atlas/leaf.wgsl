// The table of leaves, as crates/delaunay-gpu/src/on_device/atlas.rs writes it. Rust puts this text in front of every shader that uses it. Such a shader declares
// `leaves` itself.

// What lies outside the width and height of a leaf has this label: the colour of infinity.
const FRAME = 0xffffffffu;

struct Leaf {
    // Pixel (x, y) is number base + y * stride + x of the atlas.
    base: u32,
    stride: u32,
    width: u32,
    height: u32,
    // After its sites comes the vertex at infinity.
    first_site: u32,
    sites: u32,
    first_record: u32,
    records: u32,
    low: vec2i,
    // Pixels in a lattice step, times 2^31.
    factor: u32,
    first_block: u32,
    unused: vec4u,
}

fn pixel_number(leaf: u32, x: u32, y: u32) -> u32 {
    return leaves[leaf].base + y * leaves[leaf].stride + x;
}
