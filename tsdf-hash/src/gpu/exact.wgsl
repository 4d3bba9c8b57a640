// Single precision with one result: what IEEE 754 says of each operation alone, as a processor computes it.
//
// A compiler of WGSL may fuse a product and a sum, may regroup sums, and may divide and take roots with errors of a few
// units in the last place. Every result here passes through a word that the compiler does not know (it is zero), so no
// operation sees where its operands come from; quotients and roots are finished in integers.

var<private> unknown_zero: u32;

fn rounded_once(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ unknown_zero);
}

fn plus(a: f32, b: f32) -> f32 {
    return rounded_once(a + b);
}

fn minus(a: f32, b: f32) -> f32 {
    return rounded_once(a - b);
}

fn times(a: f32, b: f32) -> f32 {
    return rounded_once(a * b);
}

// 1.5 2^23: adding it rounds a float below 2^22 to an integer, to even at a tie.
const ROUNDER: f32 = 12582912.0;

fn nearest(x: f32) -> f32 {
    return minus(plus(x, ROUNDER), ROUNDER);
}

// The sign and the magnitude of a word are exact in two halves; one sum rounds.
fn from_integer(x: i32) -> f32 {
    return plus(f32(x >> 16u) * 65536.0, f32(x & 0xffff));
}

const FRACTION: u32 = 0x7fffffu;
const LEADING: u32 = 0x800000u;

// a / b for positive normal a, b whose quotient is normal. With the mantissas as integers of 24 bits it is
// floor(2^s ma / mb), rounded by its remainder; the remainder of a guess is a few mb, so its low word says all. A quotient
// of two such numbers is never half way between two of them.
fn quotient(a: f32, b: f32) -> f32 {
    let wa = bitcast<u32>(a);
    let wb = bitcast<u32>(b);
    let ma = (wa & FRACTION) | LEADING;
    let mb = (wb & FRACTION) | LEADING;
    let less = u32(ma < mb);
    let guess = bitcast<f32>((wa & FRACTION) | 0x3f800000u) / bitcast<f32>((wb & FRACTION) | 0x3f800000u);
    var q = u32(guess * f32(LEADING << less));
    var rest = bitcast<i32>((ma << (23u + less)) - q * mb);
    let divisor = i32(mb);
    for (var k = 0; k < 4; k++) {
        if rest < 0 {
            q -= 1u;
            rest += divisor;
        }
        if rest >= divisor {
            q += 1u;
            rest -= divisor;
        }
    }
    q += u32(2 * rest > divisor);
    // The leading bit of q, which may have become 2^24, adds into the exponent.
    return bitcast<f32>((((wa >> 23u) - (wb >> 23u) + 126u - less) << 23u) + q);
}

// a / b for any finite a that is zero or normal, likewise any b but zero.
fn divide(a: f32, b: f32) -> f32 {
    if a == 0.0 {
        return 0.0;
    }
    let sign = (bitcast<u32>(a) ^ bitcast<u32>(b)) & 0x80000000u;
    return bitcast<f32>(bitcast<u32>(quotient(abs(a), abs(b))) | sign);
}

// The root of a positive normal number, likewise: floor(sqrt(2^s m)) with the exponent that is left over even.
fn root(x: f32) -> f32 {
    let word = bitcast<u32>(x);
    let m = (word & FRACTION) | LEADING;
    let exponent = word >> 23u;
    let odd = exponent & 1u;
    // x = 2^(exponent - 150) m; an odd exponent leaves 2^23 m, an even one 2^24 m.
    let guess = sqrt(bitcast<f32>((word & FRACTION) | (0x40000000u - (odd << 23u))));
    var q = u32(guess * f32(LEADING));
    var rest = bitcast<i32>((m << (24u - odd)) - q * q);
    for (var k = 0; k < 4; k++) {
        if rest < 0 {
            q -= 1u;
            rest += i32(2u * q + 1u);
        }
        if rest > i32(2u * q) {
            rest -= i32(2u * q + 1u);
            q += 1u;
        }
    }
    q += u32(rest > i32(q));
    return bitcast<f32>((((exponent + odd) / 2u + 62u) << 23u) + q);
}
