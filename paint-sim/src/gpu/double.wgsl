// Double precision in integers: sums, products and quotients with the bits that IEEE 754 asks for (binary64, to nearest, ties to even), and
// so the same on every adapter. A number is its low word and its high one.
//
// On the way a significand has 64 bits: the leading one first, then the 52 others, then 11 that decide how it is rounded; the last of
// these also stands for all that lie below it.

alias Double = vec2<u32>;

const SIGN: u32 = 0x80000000u;
const SPECIAL: u32 = 0x7ff00000u;
const ZERO: Double = vec2(0u, 0u);
const NO_NUMBER: Double = vec2(0u, 0x7ff80000u);

fn sum64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2(low, a.y + b.y + u32(low < a.x));
}

fn difference64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    return vec2(a.x - b.x, a.y - b.y - u32(a.x < b.x));
}

fn below64(a: vec2<u32>, b: vec2<u32>) -> bool {
    return a.y < b.y || (a.y == b.y && a.x < b.x);
}

fn product32(a: u32, b: u32) -> vec2<u32> {
    let low = (a & 0xffffu) * (b & 0xffffu);
    let cross = (a >> 16u) * (b & 0xffffu) + (low >> 16u);
    let other = (a & 0xffffu) * (b >> 16u) + (cross & 0xffffu);
    return vec2((other << 16u) | (low & 0xffffu), (a >> 16u) * (b >> 16u) + (cross >> 16u) + (other >> 16u));
}

fn leading_zeros(m: vec2<u32>) -> u32 {
    return select(countLeadingZeros(m.y), 32u + countLeadingZeros(m.x), m.y == 0u);
}

// By less than 64.
fn shifted_left(m: vec2<u32>, by: u32) -> vec2<u32> {
    if by >= 32u {
        return vec2(0u, m.x << (by - 32u));
    }
    return vec2(m.x << by, (m.y << by) | ((m.x >> 1u) >> (31u - by)));
}

// The last bit stands for all that are lost.
fn shifted_right(m: vec2<u32>, by: u32) -> vec2<u32> {
    if by == 0u {
        return m;
    }
    if by > 63u {
        return vec2(u32((m.x | m.y) != 0u), 0u);
    }
    if by >= 32u {
        let lost = m.x | ((m.y << 1u) << (63u - by));
        return vec2((m.y >> (by - 32u)) | u32(lost != 0u), 0u);
    }
    let lost = m.x << (32u - by);
    return vec2((m.x >> by) | (m.y << (32u - by)) | u32(lost != 0u), m.y >> by);
}

struct Parts {
    significand: vec2<u32>,
    exponent: i32,
}

// Of what is neither zero nor special.
fn parts(a: Double) -> Parts {
    let exponent = i32((a.y >> 20u) & 0x7ffu);
    let fraction = vec2(a.x, a.y & 0xfffffu);
    if exponent > 0 {
        return Parts(shifted_left(fraction | vec2(0u, 0x100000u), 11u), exponent);
    }
    let zeros = leading_zeros(fraction);
    return Parts(shifted_left(fraction, zeros), 12 - i32(zeros));
}

// Rounds. The leading bit of the significand is the first one.
fn rounded(sign: u32, exact: Parts) -> Double {
    if exact.exponent > 2046 {
        return vec2(0u, sign | SPECIAL);
    }
    // Below the normal numbers the leading bit moves down.
    let m = shifted_right(exact.significand, u32(max(1 - exact.exponent, 0)));
    let kept = vec2((m.x >> 11u) | (m.y << 21u), m.y >> 11u);
    let rest = m.x & 0x7ffu;
    let up = rest > 0x400u || (rest == 0x400u && (kept.x & 1u) == 1u);
    // The leading bit adds into the exponent, and so does a carry.
    let result = sum64(sum64(kept, vec2(u32(up), 0u)), vec2(0u, u32(max(exact.exponent - 1, 0)) << 20u));
    return vec2(result.x, result.y | sign);
}

fn magnitude(a: Double) -> Double {
    return vec2(a.x, a.y & ~SIGN);
}

fn is_zero(a: Double) -> bool {
    return (a.x | (a.y & ~SIGN)) == 0u;
}

fn is_special(a: Double) -> bool {
    return (a.y & SPECIAL) == SPECIAL;
}

fn is_no_number(a: Double) -> bool {
    return below64(vec2(0u, SPECIAL), magnitude(a));
}

fn negative(a: Double) -> Double {
    return vec2(a.x, a.y ^ SIGN);
}

fn plus(a: Double, b: Double) -> Double {
    let swap = below64(magnitude(a), magnitude(b));
    let large = select(a, b, swap);
    let small = select(b, a, swap);
    let opposite = ((a.y ^ b.y) & SIGN) != 0u;
    if is_special(large) {
        if is_no_number(large) || (is_special(small) && opposite) {
            return NO_NUMBER;
        }
        return large;
    }
    // The leading bit is the second one here, so that a carry has a place.
    let exponents = vec2(i32((large.y >> 20u) & 0x7ffu), i32((small.y >> 20u) & 0x7ffu));
    let implicit = select(vec2(0u), vec2(0x100000u), exponents > vec2(0));
    let m = shifted_left(vec2(large.x, (large.y & 0xfffffu) | implicit.x), 10u);
    let n = shifted_left(vec2(small.x, (small.y & 0xfffffu) | implicit.y), 10u);
    let exponent = max(exponents.x, 1);
    let aligned = shifted_right(n, u32(exponent - max(exponents.y, 1)));
    var sum = sum64(m, aligned);
    if opposite {
        sum = difference64(m, aligned);
    }
    if (sum.x | sum.y) == 0u {
        return vec2(0u, a.y & b.y & SIGN);
    }
    let zeros = leading_zeros(sum);
    return rounded(large.y & SIGN, Parts(shifted_left(sum, zeros), exponent + 1 - i32(zeros)));
}

fn minus(a: Double, b: Double) -> Double {
    return plus(a, negative(b));
}

fn times(a: Double, b: Double) -> Double {
    let sign = (a.y ^ b.y) & SIGN;
    let none = is_zero(a) || is_zero(b);
    if is_special(a) || is_special(b) {
        if is_no_number(a) || is_no_number(b) || none {
            return NO_NUMBER;
        }
        return vec2(0u, sign | SPECIAL);
    }
    if none {
        return vec2(0u, sign);
    }
    let p = parts(a);
    let q = parts(b);
    let low = product32(p.significand.x, q.significand.x);
    let cross = product32(p.significand.x, q.significand.y);
    let other = product32(p.significand.y, q.significand.x);
    let both = sum64(cross, other);
    let middle = sum64(both, vec2(low.y, 0u));
    let carry = u32(below64(both, cross)) + u32(below64(middle, both));
    var m = sum64(product32(p.significand.y, q.significand.y), vec2(middle.y, carry));
    m.x |= u32((middle.x | low.x) != 0u);
    let zeros = leading_zeros(m);
    return rounded(sign, Parts(shifted_left(m, zeros), p.exponent + q.exponent - 1022 - i32(zeros)));
}

fn over(a: Double, b: Double) -> Double {
    let sign = (a.y ^ b.y) & SIGN;
    if is_no_number(a) || is_no_number(b) || (is_special(a) && is_special(b)) || (is_zero(a) && is_zero(b)) {
        return NO_NUMBER;
    }
    if is_special(a) || is_zero(b) {
        return vec2(0u, sign | SPECIAL);
    }
    if is_special(b) || is_zero(a) {
        return vec2(0u, sign);
    }
    let p = parts(a);
    let q = parts(b);
    // Integers of 53 bits, so that a remainder times 2^11 has 64.
    let divisor = shifted_right(q.significand, 11u);
    var rest = shifted_right(p.significand, 11u);
    var quotient = ZERO;
    if !below64(rest, divisor) {
        quotient = vec2(1u, 0u);
        rest = difference64(rest, divisor);
    }
    for (var k = 0; k < 5; k++) {
        rest = shifted_left(rest, 11u);
        // Never less than the digit, and hardly more.
        var digit = rest.y / divisor.y;
        var part = product32(digit, divisor.x) + vec2(0u, digit * divisor.y);
        while below64(rest, part) {
            digit -= 1u;
            part = difference64(part, divisor);
        }
        rest = difference64(rest, part);
        quotient = sum64(shifted_left(quotient, 11u), vec2(digit, 0u));
    }
    let zeros = leading_zeros(quotient);
    var m = shifted_left(quotient, zeros);
    m.x |= u32((rest.x | rest.y) != 0u);
    return rounded(sign, Parts(m, p.exponent - q.exponent + 1031 - i32(zeros)));
}

fn is_less(a: Double, b: Double) -> bool {
    if is_no_number(a) || is_no_number(b) || (is_zero(a) && is_zero(b)) {
        return false;
    }
    if ((a.y ^ b.y) & SIGN) != 0u {
        return (a.y & SIGN) != 0u;
    }
    return select(below64(a, b), below64(b, a), (a.y & SIGN) != 0u);
}

fn is_at_most(a: Double, b: Double) -> bool {
    return !(is_no_number(a) || is_no_number(b) || is_less(b, a));
}

// Of a number of single precision that is zero or normal.
fn widened(x: f32) -> Double {
    let word = bitcast<u32>(x);
    if (word & ~SIGN) == 0u {
        return vec2(0u, word);
    }
    return vec2(word << 29u, (word & SIGN) | (((word & ~SIGN) >> 3u) + (896u << 20u)));
}
