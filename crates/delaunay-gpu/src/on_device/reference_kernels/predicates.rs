//! The exact predicates in 32-bit limbs: the twin of `shaders/predicates.wgsl`, which says why the numbers fit.

use delaunay::geometry::Site;

const NEAR: i32 = 32_768;

/// A number of 64 bits, the lowest limb first.
type Two = [u32; 2];
/// A number of 128 bits, the lowest limb first.
type Four = [u32; 4];

fn are_near(u: Site, v: Site) -> bool {
    [u, v].iter().flatten().all(|difference| difference.abs() < NEAR)
}

fn product(a: u32, b: u32) -> Two {
    let (al, ah, bl, bh) = (a & 0xffff, a >> 16, b & 0xffff, b >> 16);
    let (low, lh, hl) = (al * bl, al * bh, ah * bl);
    let middle = (low >> 16) + (lh & 0xffff) + (hl & 0xffff);
    [(low & 0xffff) | (middle << 16), ah * bh + (lh >> 16) + (hl >> 16) + (middle >> 16)]
}

fn add64(a: Two, b: Two) -> Two {
    let low = a[0].wrapping_add(b[0]);
    [low, a[1].wrapping_add(b[1]).wrapping_add((low < a[0]) as u32)]
}

fn negate64(a: Two) -> Two {
    [(!a[0]).wrapping_add(1), (!a[1]).wrapping_add((a[0] == 0) as u32)]
}

fn sign64(a: Two) -> i32 {
    if (a[1] as i32) < 0 { -1 } else { (a != [0; 2]) as i32 }
}

fn signed_product(a: i32, b: i32) -> Two {
    let size = product(a.unsigned_abs(), b.unsigned_abs());
    if (a ^ b) < 0 { negate64(size) } else { size }
}

fn add128(a: Four, b: Four) -> Four {
    let (mut sum, mut carry) = (Four::default(), 0);
    for i in 0..4 {
        let limb = a[i].wrapping_add(b[i]);
        sum[i] = limb.wrapping_add(carry);
        carry = (limb < a[i]) as u32 + (sum[i] < carry) as u32;
    }
    sum
}

fn negate128(a: Four) -> Four {
    add128(a.map(|limb| !limb), [1, 0, 0, 0])
}

fn difference(a: Site, b: Site) -> Site {
    [a[0] - b[0], a[1] - b[1]]
}

fn cross_near(u: Site, v: Site) -> i32 {
    u[0] * v[1] - u[1] * v[0]
}

fn cross_far(u: Site, v: Site) -> Two {
    add64(signed_product(u[0], v[1]), negate64(signed_product(u[1], v[0])))
}

/// Returns the sign of twice the area of triangle abc: positive if a, b, c turn left.
pub fn orientation(a: Site, b: Site, c: Site) -> i32 {
    let (u, v) = (difference(b, a), difference(c, a));
    if are_near(u, v) { cross_near(u, v).signum() } else { sign64(cross_far(u, v)) }
}

fn term_near(p: Site, q: Site, r: Site) -> Two {
    let cross = cross_near(q, r);
    let size = product((p[0] * p[0] + p[1] * p[1]) as u32, cross.unsigned_abs());
    if cross < 0 { negate64(size) } else { size }
}

fn sign_near(a: Site, b: Site, c: Site) -> i32 {
    sign64(add64(add64(term_near(a, b, c), term_near(b, c, a)), term_near(c, a, b)))
}

fn term_far(p: Site, q: Site, r: Site) -> Four {
    let lift = add64(signed_product(p[0], p[0]), signed_product(p[1], p[1]));
    let signed = cross_far(q, r);
    let is_negative = (signed[1] as i32) < 0;
    let cross = if is_negative { negate64(signed) } else { signed };
    let (low, high) = (product(lift[0], cross[0]), product(lift[1], cross[1]));
    let (inner_low, inner_high) = (product(lift[0], cross[1]), product(lift[1], cross[0]));
    let outer = [low[0], low[1], high[0], high[1]];
    let middle = |[low, high]: Two| [0, low, high, 0];
    let size = add128(add128(outer, middle(inner_low)), middle(inner_high));
    if is_negative { negate128(size) } else { size }
}

fn sign_far(a: Site, b: Site, c: Site) -> i32 {
    let sum = add128(add128(term_far(a, b, c), term_far(b, c, a)), term_far(c, a, b));
    if (sum[3] as i32) < 0 { -1 } else { (sum != [0; 4]) as i32 }
}

fn tie(a: Site, b: Site, c: Site, d: Site) -> bool {
    if a < d && b < d && c < d {
        false
    } else if a < c && b < c {
        orientation(a, b, d) > 0
    } else if a < b {
        orientation(a, d, c) > 0
    } else {
        orientation(d, b, c) > 0
    }
}

/// Returns whether `d` is inside the circle through the counterclockwise triangle `abc`. The canonical tie rule decides if `d` is
/// on the circle.
pub fn in_circle(a: Site, b: Site, c: Site, d: Site) -> bool {
    let [u, v, w] = [a, b, c].map(|p| difference(p, d));
    let side = if are_near(u, v) && are_near(w, w) { sign_near(u, v, w) } else { sign_far(u, v, w) };
    if side == 0 { tie(a, b, c, d) } else { side > 0 }
}

/// Decides about each four sites a, b, c, d: the orientation of abc, plus one, in bits 0 and 1; whether d is in their circle in bit 2.
/// The twin of `shaders/decide.wgsl`.
pub fn decide(quads: &[[Site; 4]]) -> Vec<u32> {
    let decision = |&[a, b, c, d]: &[Site; 4]| (orientation(a, b, c) + 1) as u32 | (in_circle(a, b, c, d) as u32) << 2;
    quads.iter().map(decision).collect()
}
