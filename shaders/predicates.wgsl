// The exact decisions of crates/delaunay/src/geometry/predicates.rs, ties included, for sites whose coordinates differ by at most 2^30. Rust puts
// this text in front of every shader that uses it, because WGSL has no include.
//
// All numbers are whole. Error bounds of f32 would not hold where a driver compiles with fast math, and i64 is optional. A number of
// 64 or 128 bits is two or four limbs, the lowest first, in two's complement; sums wrap around like those of u32.

// Sites whose coordinates differ by less than this are near: their cross products fit 32 bits, their in-circle determinants 64. With
// m = 2^15 - 1, a cross product is at most 2 m^2 < 2^31. The determinant is at most 8 m^4 < 2^63, because lifts are at most
// 2 m^2, and those cross products that add up to it at most 4 m^2: twice the area of the square.
const NEAR = 32768;

fn are_near(u: vec2i, v: vec2i) -> bool {
    let farthest = max(abs(u), abs(v));
    return max(farthest.x, farthest.y) < NEAR;
}

// Returns a * b, in 64 bits.
fn product(a: u32, b: u32) -> vec2u {
    let al = a & 0xffffu;
    let ah = a >> 16u;
    let bl = b & 0xffffu;
    let bh = b >> 16u;
    let low = al * bl;
    let lh = al * bh;
    let hl = ah * bl;
    let middle = (low >> 16u) + (lh & 0xffffu) + (hl & 0xffffu);
    return vec2u((low & 0xffffu) | (middle << 16u), ah * bh + (lh >> 16u) + (hl >> 16u) + (middle >> 16u));
}

fn add64(a: vec2u, b: vec2u) -> vec2u {
    let low = a.x + b.x;
    return vec2u(low, a.y + b.y + u32(low < a.x));
}

fn negate64(a: vec2u) -> vec2u {
    return vec2u(~a.x + 1u, ~a.y + u32(a.x == 0u));
}

fn sign64(a: vec2u) -> i32 {
    return select(select(1, 0, (a.x | a.y) == 0u), -1, i32(a.y) < 0);
}

fn signed_product(a: i32, b: i32) -> vec2u {
    let size = product(u32(abs(a)), u32(abs(b)));
    return select(size, negate64(size), (a ^ b) < 0);
}

fn add128(a: vec4u, b: vec4u) -> vec4u {
    let x = a.x + b.x;
    let carry_x = u32(x < a.x);
    let y = a.y + b.y;
    let y_carried = y + carry_x;
    let carry_y = u32(y < a.y) + u32(y_carried < carry_x);
    let z = a.z + b.z;
    let z_carried = z + carry_y;
    let carry_z = u32(z < a.z) + u32(z_carried < carry_y);
    return vec4u(x, y_carried, z_carried, a.w + b.w + carry_z);
}

fn negate128(a: vec4u) -> vec4u {
    return add128(~a, vec4u(1u, 0u, 0u, 0u));
}

// Returns the cross product of two differences, at most 2^61.
fn cross_far(u: vec2i, v: vec2i) -> vec2u {
    return add64(signed_product(u.x, v.y), negate64(signed_product(u.y, v.x)));
}

// Returns the sign of twice the area of triangle abc: positive if a, b, c turn left.
fn orientation(a: vec2i, b: vec2i, c: vec2i) -> i32 {
    let u = b - a;
    let v = c - a;
    if are_near(u, v) {
        return sign(u.x * v.y - u.y * v.x);
    }
    return sign64(cross_far(u, v));
}

// Returns a term of the determinant: the lift of p times the cross product of q and r.
fn term_near(p: vec2i, q: vec2i, r: vec2i) -> vec2u {
    let cross = q.x * r.y - q.y * r.x;
    let size = product(u32(p.x * p.x + p.y * p.y), u32(abs(cross)));
    return select(size, negate64(size), cross < 0);
}

fn sign_near(a: vec2i, b: vec2i, c: vec2i) -> i32 {
    return sign64(add64(add64(term_near(a, b, c), term_near(b, c, a)), term_near(c, a, b)));
}

// As `term_near`. A term has at most 122 bits, three of them together 124.
fn term_far(p: vec2i, q: vec2i, r: vec2i) -> vec4u {
    let lift = add64(signed_product(p.x, p.x), signed_product(p.y, p.y));
    let signed = cross_far(q, r);
    let is_negative = i32(signed.y) < 0;
    let cross = select(signed, negate64(signed), is_negative);
    let outer = vec4u(product(lift.x, cross.x), product(lift.y, cross.y));
    let inner_low = vec4u(0u, product(lift.x, cross.y), 0u);
    let inner_high = vec4u(0u, product(lift.y, cross.x), 0u);
    let size = add128(add128(outer, inner_low), inner_high);
    return select(size, negate128(size), is_negative);
}

fn sign_far(a: vec2i, b: vec2i, c: vec2i) -> i32 {
    let sum = add128(add128(term_far(a, b, c), term_far(b, c, a)), term_far(c, a, b));
    return select(select(1, 0, all(sum == vec4u(0u))), -1, i32(sum.w) < 0);
}

// Returns whether a comes before b in the order of (x, y).
fn comes_before(a: vec2i, b: vec2i) -> bool {
    return a.x < b.x || (a.x == b.x && a.y < b.y);
}

// Decides for four sites on one circle: the last of them counts as outside the circle of the other three.
fn tie(a: vec2i, b: vec2i, c: vec2i, d: vec2i) -> bool {
    if comes_before(a, d) && comes_before(b, d) && comes_before(c, d) {
        return false;
    }
    if comes_before(a, c) && comes_before(b, c) {
        return orientation(a, b, d) > 0;
    }
    if comes_before(a, b) {
        return orientation(a, d, c) > 0;
    }
    return orientation(d, b, c) > 0;
}

// Returns whether d is inside the circle through the counterclockwise triangle abc. `tie` decides if d is on the circle.
fn in_circle(a: vec2i, b: vec2i, c: vec2i, d: vec2i) -> bool {
    let u = a - d;
    let v = b - d;
    let w = c - d;
    var side = 0;
    if are_near(u, v) && are_near(w, w) {
        side = sign_near(u, v, w);
    } else {
        side = sign_far(u, v, w);
    }
    if side != 0 {
        return side > 0;
    }
    return tie(a, b, c, d);
}
