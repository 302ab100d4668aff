// Step G2, exact: the label of a pixel is the pixel (y << 16 | x) of its nearest site: the site's pixel with the least (d^2, x, y).
//
// Columns come first, then rows. A column is cut into bands of 32 rows (parallel banding, Cao et al. 2010). Each band is one word,
// whose bit i says whether row i of the band has a site. Together with the nearest sites south and north of the band, two bit
// operations find the nearest site of any pixel in its own column, so it need not be stored.
//
// Along a row, the columns of the labels never decrease, so a pixel examines only the columns between the labels of two pixels that
// are already known. `rows` runs with wide strides first (256, then 16, then 1). That bounds the work at about a hundred columns per
// pixel on average, for any input.

const NONE = 0xffffffffu;
const BAND = 32u;

struct Params {
    width: u32,
    height: u32,
    // `rows`: the first row of this dispatch, and the distance between its pixels.
    first_row: u32,
    stride: u32,
    // `rows`: the distance between the pixels whose labels are known; 0 if none is known.
    known: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> texture: array<u32>;
@group(0) @binding(2) var<storage, read_write> words_out: array<u32>;
@group(0) @binding(3) var<storage, read> words: array<u32>;
@group(0) @binding(4) var<storage, read_write> south_out: array<u32>;
@group(0) @binding(5) var<storage, read_write> north_out: array<u32>;
@group(0) @binding(6) var<storage, read> south: array<u32>;
@group(0) @binding(7) var<storage, read> north: array<u32>;
@group(0) @binding(8) var<storage, read_write> labels: array<u32>;

// Gathers the word of a band. One invocation per column and band.
@compute @workgroup_size(64)
fn columns(@builtin(global_invocation_id) id: vec3u) {
    let x = id.x;
    let first = id.y * BAND;
    if x >= params.width || first >= params.height {
        return;
    }
    let rows = min(BAND, params.height - first);
    var word = 0u;
    for (var i = 0u; i < rows; i++) {
        if texture[(first + i) * params.width + x] != 0u {
            word |= 1u << i;
        }
    }
    words_out[id.y * params.width + x] = word;
}

// Carries the nearest sites across the bands. One invocation per column.
@compute @workgroup_size(64)
fn carry(@builtin(global_invocation_id) id: vec3u) {
    let x = id.x;
    if x >= params.width {
        return;
    }
    let bands = (params.height + BAND - 1u) / BAND;
    var last = NONE;
    for (var band = 0u; band < bands; band++) {
        let at = band * params.width + x;
        south_out[at] = last;
        if words[at] != 0u {
            last = band * BAND + firstLeadingBit(words[at]);
        }
    }
    last = NONE;
    for (var band = bands; band > 0u; band--) {
        let at = (band - 1u) * params.width + x;
        north_out[at] = last;
        if words[at] != 0u {
            last = (band - 1u) * BAND + firstTrailingBit(words[at]);
        }
    }
}

// Returns the row of the site in column x that is nearest to row y, or NONE if the column is empty. Of two at the same distance,
// the southern one wins.
fn nearest_in_column(x: u32, y: u32) -> u32 {
    let at = y / BAND * params.width + x;
    let bit = y % BAND;
    let first = y - bit;
    let below = words[at] & (NONE >> (31u - bit));
    let above = words[at] & (NONE << bit);
    var s = south[at];
    if below != 0u {
        s = first + firstLeadingBit(below);
    }
    var n = north[at];
    if above != 0u {
        n = first + firstTrailingBit(above);
    }
    if s == NONE {
        return n;
    }
    return select(n, s, n == NONE || y - s <= n - y);
}

// Labels every stride-th pixel of a row. One invocation per pixel.
@compute @workgroup_size(32, 8)
fn rows(@builtin(global_invocation_id) id: vec3u) {
    let x = id.x * params.stride;
    let y = params.first_row + id.y;
    if x >= params.width || y >= params.height || (params.known != 0u && x % params.known == 0u) {
        return;
    }
    let row = y * params.width;
    var low = 0u;
    var high = params.width - 1u;
    if params.known != 0u {
        let before = x - x % params.known;
        let label = labels[row + before];
        if label == NONE {
            labels[row + x] = NONE;
            return;
        }
        low = label & 0xffffu;
        if before + params.known < params.width {
            high = labels[row + before + params.known] & 0xffffu;
        }
    }
    labels[row + x] = nearest(x, y, low, high);
}

// Returns the label of pixel (x, y), which is known to lie in the columns from low to high. Searches outward from x.
fn nearest(x: u32, y: u32, low: u32, high: u32) -> u32 {
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
            let row = nearest_in_column(x - r, y);
            let dy = max(row, y) - min(row, y);
            let d = r * r + dy * dy;
            if row != NONE && d <= best {
                best = d;
                label = (row << 16u) | (x - r);
            }
        }
        if x + r <= high && x + r >= low && r > 0u {
            let row = nearest_in_column(x + r, y);
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
