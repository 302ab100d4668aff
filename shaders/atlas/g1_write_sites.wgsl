// Step G1: write the sites of all leaves into the atlas. Of several sites in one pixel, the one with the least number wins. Of the
// others, the losers, one may have the next pixel in the east if that is free, and another one the next pixel in the west. Then the
// winner and those two change places, so that they lie in the order of their x. All others are missing.
//
// It takes four dispatches:
// 1. `write`: each site asks for its pixel.
// 2. `claim_east`: each loser asks for the pixel in the east.
// 3. `claim_west`: each loser that has not got it asks for the pixel in the west.
// 4. `settle`: for each pixel with losers that have got a place, one invocation writes the sites in order: that of the loser in the
//    west, or else that of the loser in the east.
//
// All ask with atomicMax, so the order of the invocations does not matter. A claim has the lower 30 bits of the complement of the site's
// number. The upper two bits are 3 for a winner, and for every site that has its place at last, 1 for a loser that comes from the west,
// and 0 for one that comes from the east. So winners stay, and those from the west come before those from the east. There are less than
// 2^30 vertices: no adapter binds a buffer of so many sites.

struct Params {
    vertices: u32,
    leaves: u32,
    // The number of invocations in a row of the dispatch.
    invocations: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> leaves: array<Leaf>;
@group(0) @binding(2) var<storage, read> sites: array<vec2i>;
@group(0) @binding(3) var<storage, read_write> texture: array<atomic<u32>>;
// A bit for each vertex: it has lost its pixel.
@group(0) @binding(4) var<storage, read_write> losers_out: array<u32>;
@group(0) @binding(5) var<storage, read> losers: array<u32>;
// A bit for each vertex: it has no pixel. Between `claim_west` and `settle`: it has not got the pixel in the east.
@group(0) @binding(6) var<storage, read_write> missing: array<u32>;

// The x of the vertex at infinity.
const AT_INFINITY = -2147483648;
const NUMBER = 0x3fffffffu;
const FROM_WEST = 0x40000000u;

var<workgroup> gathered: array<atomic<u32>, 2>;

// Where a site belongs.
struct Home {
    // The number of its pixel in the atlas.
    at: u32,
    has_east: bool,
    has_west: bool,
}

fn leaf_of(site: u32) -> u32 {
    var low = 0u;
    var high = params.leaves;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if leaves[middle].first_site <= site {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// Returns the upper 32 bits of a * b.
fn upper_product(a: u32, b: u32) -> u32 {
    let al = a & 0xffffu;
    let ah = a >> 16u;
    let bl = b & 0xffffu;
    let bh = b >> 16u;
    let lh = al * bh;
    let hl = ah * bl;
    let middle = ((al * bl) >> 16u) + (lh & 0xffffu) + (hl & 0xffffu);
    return ah * bh + (lh >> 16u) + (hl >> 16u) + (middle >> 16u);
}

fn home(site: u32) -> Home {
    let leaf = leaf_of(site);
    let steps = bitcast<vec2u>(sites[site] - leaves[leaf].low);
    let x = upper_product(2u * steps.x + 1u, leaves[leaf].factor);
    let y = upper_product(2u * steps.y + 1u, leaves[leaf].factor);
    return Home(pixel_number(leaf, x, y), x + 1u < leaves[leaf].width, x > 0u);
}

fn is_site(i: u32) -> bool {
    return i < params.vertices && sites[i].x != AT_INFINITY;
}

@compute @workgroup_size(64)
fn write(@builtin(global_invocation_id) id: vec3u) {
    let i = id.y * params.invocations + id.x;
    if is_site(i) {
        atomicMax(&texture[home(i).at], ~i);
    }
}

// Collects a bit from each of the 64 invocations of a workgroup.
fn gather(local: u32, bit: bool) {
    if bit {
        atomicOr(&gathered[local / 32u], 1u << (local & 31u));
    }
    workgroupBarrier();
}

@compute @workgroup_size(64)
fn claim_east(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = id.y * params.invocations + id.x;
    var has_lost = false;
    if is_site(i) {
        let own = home(i);
        has_lost = atomicLoad(&texture[own.at]) != ~i;
        if has_lost && own.has_east {
            atomicMax(&texture[own.at + 1u], FROM_WEST | (~i & NUMBER));
        }
    }
    gather(local, has_lost);
    if (i & 31u) == 0u && i < params.vertices {
        losers_out[i / 32u] = atomicLoad(&gathered[local / 32u]);
    }
}

fn is_loser(i: u32) -> bool {
    return i < params.vertices && ((losers[i / 32u] >> (i & 31u)) & 1u) != 0u;
}

fn holds_east(i: u32, own: Home) -> bool {
    return own.has_east && atomicLoad(&texture[own.at + 1u]) == (FROM_WEST | (~i & NUMBER));
}

fn holds_west(i: u32, own: Home) -> bool {
    return own.has_west && atomicLoad(&texture[own.at - 1u]) == (~i & NUMBER);
}

@compute @workgroup_size(64)
fn claim_west(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = id.y * params.invocations + id.x;
    var has_place = true;
    if is_loser(i) {
        let own = home(i);
        has_place = holds_east(i, own);
        if !has_place && own.has_west {
            atomicMax(&texture[own.at - 1u], ~i & NUMBER);
        }
    }
    gather(local, !has_place);
    if (i & 31u) == 0u && i < params.vertices {
        missing[i / 32u] = atomicLoad(&gathered[local / 32u]);
    }
}

// Returns the number of the site that has pixel `at`, or has claimed it.
fn site_in(at: u32) -> u32 {
    return ~atomicLoad(&texture[at]) & NUMBER;
}

// Returns whether site a comes before site b.
fn is_before(a: u32, b: u32) -> bool {
    let p = sites[a];
    let q = sites[b];
    if p.x != q.x {
        return p.x < q.x;
    }
    return p.y < q.y || (p.y == q.y && a < b);
}

// Returns two sites in order.
fn in_order(a: u32, b: u32) -> vec2u {
    return select(vec2u(b, a), vec2u(a, b), is_before(a, b));
}

// Puts site i, which has got the pixel in the west, the winner of pixel `at`, and the site that has got the pixel in the east, if any,
// into their pixels.
fn put_west(at: u32, i: u32) {
    let pair = in_order(i, site_in(at));
    var middle = pair.y;
    var least = pair.x;
    let east = atomicLoad(&texture[at + 1u]);
    if (east >> 30u) == 1u {
        let upper = in_order(pair.y, ~east & NUMBER);
        atomicStore(&texture[at + 1u], ~upper.y);
        let lower = in_order(pair.x, upper.x);
        least = lower.x;
        middle = lower.y;
    }
    atomicStore(&texture[at - 1u], ~least);
    atomicStore(&texture[at], ~middle);
}

// Returns whether a loser of pixel `own` has got the pixel in the west. It may have been put in order meanwhile.
fn has_western(own: Home) -> bool {
    if !own.has_west {
        return false;
    }
    let west = atomicLoad(&texture[own.at - 1u]);
    if (west >> 30u) == 0u {
        return west != 0u;
    }
    return (west >> 30u) == 3u && home(~west).at == own.at;
}

@compute @workgroup_size(64)
fn settle(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) local: u32) {
    let i = id.y * params.invocations + id.x;
    var is_missing = false;
    if is_loser(i) {
        let own = home(i);
        if ((missing[i / 32u] >> (i & 31u)) & 1u) != 0u {
            is_missing = !holds_west(i, own);
            if !is_missing {
                put_west(own.at, i);
            }
        } else if !has_western(own) {
            let pair = in_order(i, site_in(own.at));
            atomicStore(&texture[own.at], ~pair.x);
            atomicStore(&texture[own.at + 1u], ~pair.y);
        }
    }
    gather(local, is_missing);
    // All have read the word that one of them writes now.
    storageBarrier();
    if (i & 31u) == 0u && i < params.vertices {
        missing[i / 32u] = atomicLoad(&gathered[local / 32u]);
    }
}
