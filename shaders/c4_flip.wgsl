// Steps C2 and C4: flip edges between finite triangles, many in each round, until all that can be flipped are Delaunay.
//
// A triangle is a record of eight numbers: three corners counterclockwise, a note, three twins, a partner. Half-edge 8 t + i starts at
// corner i of triangle t; the twin of half-edge h is number h + 4. Triangles at infinity close the mesh, so every half-edge has a twin.
//
// An edge should be flipped if it fails the in-circle test and both triangles are counterclockwise afterwards. So sites that have
// crossed an edge on their way from their pixel to their true place are flipped back over it: if one of two triangles is inverted and
// both are counterclockwise after the flip, then the corner that has crossed the edge lies within the other triangle.
//
// A round is three dispatches:
// 1. `claim`: each dirty triangle tests its edges. For the first that should be flipped, it claims both triangles with a key of its own.
//    The highest key stays.
// 2. `commit`: an edge that has kept both its claims will be flipped. Both triangles note that.
// 3. `relink`: for each such edge one invocation writes both records. Where a neighbour is flipped too, its note tells where its half-edge
//    is afterwards; otherwise its link back is written here.
// No two invocations write to one place, except for claims and marks, whose order does not matter. So an atlas has always the same result.
// In another place of an atlas a leaf has other keys. Other edges are flipped first, and other few are left to the CPU.
//
// In round 1 all triangles are dirty. Later it is those that were changed or wanted a flip in the round before. Keys grow from round to
// round, so nothing is cleared between rounds.

struct Params {
    triangles: u32,
    // The number of the round, from 1.
    round: u32,
    // The length of a section of the marks.
    words: u32,
    // The number of invocations in a row of the dispatch.
    invocations: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// Two for each triangle: corners and note, twins and partner.
@group(0) @binding(1) var<storage, read> records: array<vec4u>;
@group(0) @binding(2) var<storage, read> sites: array<vec2i>;
@group(0) @binding(3) var<storage, read_write> claims: array<atomic<u32>>;
// A bit for each triangle in each of four sections: dirty in the rounds whose number is 0, 1 or 2 modulo 3; inverted.
@group(0) @binding(4) var<storage, read_write> marks: array<atomic<u32>>;
@group(0) @binding(5) var<storage, read_write> numbers: array<u32>;
@group(0) @binding(6) var<storage, read> final_claims: array<u32>;
@group(0) @binding(7) var<storage, read> final_marks: array<u32>;

// Corner 0 of a record without a triangle.
const FREE = 0xffffffffu;
// The x of the vertex at infinity.
const AT_INFINITY = -2147483648;
// Spreads the priorities of neighbouring edges. It is odd, so that no two edges share one.
const SPREAD = 0x0851f42du;

fn next(h: u32) -> u32 {
    return (h & ~3u) | ((0x09u >> (2u * (h & 3u))) & 3u);
}

fn previous(h: u32) -> u32 {
    return (h & ~3u) | ((0x12u >> (2u * (h & 3u))) & 3u);
}

// Returns what an edge claims its triangles with: the round in 4 bits, a priority in 28.
fn key(h: u32) -> u32 {
    let edge = ((h >> 3u) << 2u) | (h & 3u);
    return (params.round << 28u) | ((edge * SPREAD) & 0x0fffffffu);
}

// Returns the place of the mark that triangle t is dirty in a round.
fn dirty_word(round: u32, t: u32) -> u32 {
    return (round % 3u) * params.words + t / 32u;
}

fn has_bit(word: u32, t: u32) -> bool {
    return ((word >> (t & 31u)) & 1u) != 0u;
}

fn is_dirty(t: u32) -> bool {
    return params.round == 1u || has_bit(atomicLoad(&marks[dirty_word(params.round, t)]), t);
}

fn set_dirty_next(t: u32) {
    atomicOr(&marks[dirty_word(params.round + 1u, t)], 1u << (t & 31u));
}

fn note_inverted(t: u32, is_inverted: bool) {
    let word = 3u * params.words + t / 32u;
    let bit = 1u << (t & 31u);
    if is_inverted {
        atomicOr(&marks[word], bit);
    } else if params.round > 1u && has_bit(atomicLoad(&marks[word]), t) {
        atomicAnd(&marks[word], ~bit);
    }
}

// Returns whether edge uv of the triangles uvw and vuz should be flipped.
fn should_flip(u: vec2i, v: vec2i, w: vec2i, z: vec2i) -> bool {
    return in_circle(u, v, w, z) && orientation(z, w, u) > 0 && orientation(w, z, v) > 0;
}

@compute @workgroup_size(64)
fn claim(@builtin(global_invocation_id) id: vec3u) {
    let t = id.y * params.invocations + id.x;
    if t >= params.triangles {
        return;
    }
    if (t & 31u) == 0u {
        // The marks of the round before make room for those of the round after next.
        atomicStore(&marks[dirty_word(params.round + 2u, t)], 0u);
    }
    if !is_dirty(t) {
        return;
    }
    let corners = records[2u * t].xyz;
    if corners.x == FREE {
        return;
    }
    var u = sites[corners.x];
    var v = sites[corners.y];
    var w = sites[corners.z];
    if u.x == AT_INFINITY || v.x == AT_INFINITY || w.x == AT_INFINITY {
        return;
    }
    note_inverted(t, orientation(u, v, w) <= 0);
    let twins = records[2u * t + 1u].xyz;
    for (var i = 0u; i < 3u; i++) {
        let g = twins[i];
        let n = g >> 3u;
        // Where both triangles are dirty, the later one tests the edge.
        if n < params.triangles && n != t && !(n > t && is_dirty(n)) {
            let z = sites[records[2u * n][previous(g) & 3u]];
            if z.x != AT_INFINITY && should_flip(u, v, w, z) {
                let own = key(8u * t + i);
                atomicMax(&claims[t], own);
                atomicMax(&claims[n], own);
                set_dirty_next(t);
                return;
            }
        }
        let first = u;
        u = v;
        v = w;
        w = first;
    }
}

// Returns the half-edge of triangle t with whose key the triangle is claimed, or FREE.
fn own_claim(t: u32) -> u32 {
    let claimed = final_claims[t];
    var half_edge = FREE;
    for (var h = 8u * t; h < 8u * t + 3u; h++) {
        half_edge = select(half_edge, h, claimed == key(h));
    }
    return half_edge;
}

fn note_flip(h: u32, partner: u32) {
    numbers[(h & ~7u) + 3u] = (params.round << 2u) | (h & 3u);
    numbers[(h & ~7u) + 7u] = partner;
}

@compute @workgroup_size(64)
fn commit(@builtin(global_invocation_id) id: vec3u) {
    let t = id.y * params.invocations + id.x;
    if t >= params.triangles || !is_dirty(t) {
        return;
    }
    let h = own_claim(t);
    if h == FREE {
        return;
    }
    let g = numbers[h + 4u];
    if final_claims[g >> 3u] == final_claims[t] {
        note_flip(h, g);
        note_flip(g, h);
        set_dirty_next(g >> 3u);
    }
}

// Returns whether the triangle of half-edge h is flipped in this round.
fn is_flipped(h: u32) -> bool {
    return (numbers[(h & ~7u) + 3u] >> 2u) == params.round;
}

// Returns where half-edge h of a neighbour is after this round. The half-edge after a flipped one moves to the partner's place.
fn place(h: u32) -> u32 {
    let first = h & ~7u;
    if (h >> 3u) < params.triangles && is_flipped(h) && h == next(first | (numbers[first + 3u] & 3u)) {
        return numbers[first + 7u];
    }
    return h;
}

// Links half-edge h of a neighbour to its new twin, unless its triangle is flipped too and does that itself.
fn link_back(h: u32, twin: u32) {
    if (h >> 3u) < params.triangles && !is_flipped(h) {
        numbers[h + 4u] = twin;
    }
}

@compute @workgroup_size(64)
fn relink(@builtin(global_invocation_id) id: vec3u) {
    let t = id.y * params.invocations + id.x;
    if t >= params.triangles || !(params.round == 1u || has_bit(final_marks[dirty_word(params.round, t)], t)) {
        return;
    }
    let h = own_claim(t);
    if h == FREE || !is_flipped(h) {
        return;
    }
    let g = numbers[8u * t + 7u];
    let h_next = next(h);
    let g_next = next(g);
    let h_previous = previous(h);
    let g_previous = previous(g);
    let outer_h = numbers[h_next + 4u];
    let outer_g = numbers[g_next + 4u];
    numbers[h_next] = numbers[g_previous];
    numbers[g_next] = numbers[h_previous];
    numbers[h + 4u] = place(outer_g);
    numbers[g + 4u] = place(outer_h);
    numbers[h_next + 4u] = g_next;
    numbers[g_next + 4u] = h_next;
    numbers[h_previous + 4u] = place(numbers[h_previous + 4u]);
    numbers[g_previous + 4u] = place(numbers[g_previous + 4u]);
    link_back(outer_g, h);
    link_back(outer_h, g);
}
