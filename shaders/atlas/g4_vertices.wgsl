// Step G4 in an atlas: find the Voronoi vertices, which are the corners between four pixels of three or four colours. A corner does not
// count if two pixels of one colour face each other across it, because they are connected there. What lies outside a texture has a
// colour too, infinity. So the vertices on the rim are the triangles at infinity that close the mesh.
//
// Three colours make a triangle, four make two. Their square is cut here with the exact predicates, once for all who need to know.

struct Params {
    blocks: u32,
    // The number of workgroups in a row of the dispatch.
    row: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// The complement of the number of the site in each pixel.
@group(0) @binding(4) var<storage, read> texture: array<u32>;
@group(0) @binding(5) var<storage, read> sites: array<vec2i>;
// For each row of 32 corners of a block: the corners with triangles, those with two, those that are cut from the southwest to the
// northeast, and the number of triangles in the rows of the block before.
@group(0) @binding(6) var<storage, read_write> rows: array<vec4u>;
// The number of triangles of each block.
@group(0) @binding(7) var<storage, read_write> counts: array<u32>;

var<workgroup> vertices: array<atomic<u32>, 32>;
var<workgroup> pairs: array<atomic<u32>, 32>;
var<workgroup> northeast: array<atomic<u32>, 32>;
var<workgroup> row_counts: array<u32, 32>;
// The corners with two triangles, in any order: a list, so that all invocations share the work of cutting them.
var<workgroup> squares: array<u32, 1024>;
var<workgroup> square_count: atomic<u32>;

fn site(leaf: Leaf, pixel: u32) -> vec2i {
    return sites[~texture[leaf.base + (pixel >> 16u) * leaf.stride + (pixel & 0xffffu)]];
}

// Returns whether a square is cut from the southwest to the northeast.
fn is_cut_northeast(leaf: Leaf, colours: vec4u) -> bool {
    // Nothing but wrong labels makes a square with a corner at infinity.
    if any(colours == vec4u(FRAME)) {
        return false;
    }
    let a = site(leaf, colours.x);
    let b = site(leaf, colours.y);
    let c = site(leaf, colours.z);
    let d = site(leaf, colours.w);
    return orientation(a, b, c) > 0 && orientation(a, c, d) > 0 && !in_circle(a, b, c, d);
}

fn mark(corner: u32) {
    let x = corner % BLOCK_SIDE;
    let y = corner / BLOCK_SIDE;
    let colours = around(x, y);
    // At three or four sides between different colours, three or four colours meet.
    let differ = vec4u(colours != colours.yzwx);
    let sides = differ.x + differ.y + differ.z + differ.w;
    if sides < 3u || colours.x == colours.z || colours.y == colours.w {
        return;
    }
    atomicOr(&vertices[y], 1u << x);
    if sides == 4u {
        atomicOr(&pairs[y], 1u << x);
        squares[atomicAdd(&square_count, 1u)] = corner;
    }
}

@compute @workgroup_size(256)
fn find(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = group.y * params.row + group.x;
    if block >= params.blocks {
        return;
    }
    let leaf = leaves[blocks[block].x];
    let place = blocks[block].y;
    if lane < BLOCK_SIDE {
        atomicStore(&vertices[lane], 0u);
        atomicStore(&pairs[lane], 0u);
        atomicStore(&northeast[lane], 0u);
        atomicStore(&square_count, 0u);
    }
    fill_tile(leaf, place & 0xffffu, place >> 16u, lane);
    workgroupBarrier();
    for (var corner = lane; corner < BLOCK_SIDE * BLOCK_SIDE; corner += 256u) {
        mark(corner);
    }
    workgroupBarrier();
    let all = atomicLoad(&square_count);
    for (var i = lane; i < all; i += 256u) {
        let x = squares[i] % BLOCK_SIDE;
        let y = squares[i] / BLOCK_SIDE;
        if is_cut_northeast(leaf, around(x, y)) {
            atomicOr(&northeast[y], 1u << x);
        }
    }
    if lane < BLOCK_SIDE {
        row_counts[lane] = countOneBits(atomicLoad(&vertices[lane])) + countOneBits(atomicLoad(&pairs[lane]));
    }
    workgroupBarrier();
    if lane < BLOCK_SIDE {
        var before = 0u;
        for (var y = 0u; y < lane; y++) {
            before += row_counts[y];
        }
        let bits = vec3u(atomicLoad(&vertices[lane]), atomicLoad(&pairs[lane]), atomicLoad(&northeast[lane]));
        rows[block * BLOCK_SIDE + lane] = vec4u(bits, before);
        if lane == BLOCK_SIDE - 1u {
            counts[block] = before + row_counts[lane];
        }
    }
}
