// Step G3: a pixel that has lost touch with its site takes the colour of the nearest other site among those of its neighbours. It has
// lost touch if none of the neighbours in the direction of the site (three, or one if the site lies straight along an axis) has its
// colour.
//
// A round is three dispatches: `find` lists all such pixels of the texture with their new colours, `arrange` computes how many
// workgroups the next two dispatches need, and `recolour` writes the colours. So the result does not depend on the order of the list.
// If the list overflows, which takes a texture full of islands, the labels stay as they are.

const NONE = 0xffffffffu;

struct Params {
    width: u32,
    height: u32,
    // The number of pixels for which the list has room.
    room: u32,
    // Workgroups of `find` in x and y.
    find_x: u32,
    find_y: u32,
}

struct Islands {
    count: atomic<u32>,
    // Two numbers per island: its pixel and its new label.
    list: array<u32>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> labels: array<u32>;
@group(0) @binding(2) var<storage, read_write> islands: Islands;
@group(0) @binding(3) var<storage, read_write> labels_out: array<u32>;
// The workgroups of the next `recolour` (numbers 0 to 2) and of the next `find` (numbers 3 to 5).
@group(0) @binding(4) var<storage, read_write> workgroups: array<u32>;

fn label_at(p: vec2i) -> u32 {
    return labels[u32(p.y) * params.width + u32(p.x)];
}

fn is_island(p: vec2i, label: u32) -> bool {
    let towards = sign(vec2i(i32(label & 0xffffu), i32(label >> 16u)) - p);
    let along_x = vec2i(towards.x, 0);
    let along_y = vec2i(0, towards.y);
    if all(towards == vec2i(0)) {
        return false;
    }
    // If the site lies straight along an axis, two of the three neighbours are the same pixel and the third is p itself.
    let touches_x = towards.x != 0 && label_at(p + along_x) == label;
    let touches_y = towards.y != 0 && label_at(p + along_y) == label;
    return !touches_x && !touches_y && label_at(p + towards) != label;
}

// Returns whether label a comes before label b in the order of (x, y).
fn is_before(a: u32, b: u32) -> bool {
    let turned_a = (a << 16u) | (a >> 16u);
    let turned_b = (b << 16u) | (b >> 16u);
    return turned_a < turned_b;
}

// Returns the nearest site, with the least (d^2, x, y), among the labels of the neighbours other than `label`.
fn other_colour(p: vec2i, label: u32) -> u32 {
    let size = vec2i(i32(params.width), i32(params.height));
    var best = NONE;
    var colour = NONE;
    for (var j = -1; j <= 1; j++) {
        for (var i = -1; i <= 1; i++) {
            let q = p + vec2i(i, j);
            if any(q < vec2i(0)) || any(q >= size) {
                continue;
            }
            let other = label_at(q);
            if other == label || other == NONE {
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

@compute @workgroup_size(32, 8)
fn find(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= params.width || id.y >= params.height {
        return;
    }
    let p = vec2i(id.xy);
    let label = label_at(p);
    if label == NONE || !is_island(p, label) {
        return;
    }
    let colour = other_colour(p, label);
    if colour == NONE {
        return;
    }
    let at = atomicAdd(&islands.count, 1u);
    if at < params.room {
        islands.list[2u * at] = id.y * params.width + id.x;
        islands.list[2u * at + 1u] = colour;
    }
}

@compute @workgroup_size(1)
fn arrange() {
    let count = atomicLoad(&islands.count);
    let is_active = count > 0u && count <= params.room;
    let groups = select(0u, (count + 63u) / 64u, is_active);
    workgroups[0] = min(groups, 65535u);
    workgroups[1] = (groups + 65534u) / 65535u;
    workgroups[2] = 1u;
    workgroups[3] = select(0u, params.find_x, is_active);
    workgroups[4] = select(0u, params.find_y, is_active);
    workgroups[5] = 1u;
}

@compute @workgroup_size(64)
fn recolour(@builtin(global_invocation_id) id: vec3u) {
    let i = id.y * 65535u * 64u + id.x;
    if i < min(atomicLoad(&islands.count), params.room) {
        labels_out[islands.list[2u * i]] = islands.list[2u * i + 1u];
    }
}
