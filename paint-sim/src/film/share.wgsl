// The shares of shots that texels catch, behind `double.wgsl`: the same operations in the same order as `texel_share.rs`, and so the same bits.
// A leaf of the tree of texels with one shot that may reach it takes sixteen threads, one for each texel.

struct Settings {
    leaves: u32,
    most_pieces: u32,
    unused_0: u32,
    unused_1: u32,
    // Two in each group.
    numbers: array<vec4<u32>, 14>,
}

@group(0) @binding(0) var<uniform> settings: Settings;
@group(0) @binding(1) var<storage, read> shots: array<Double>;
// Point, normal, area and side of each.
@group(0) @binding(2) var<storage, read> texels: array<Double>;
// Shot, first texel and their number.
@group(0) @binding(3) var<storage, read> leaves: array<vec4<u32>>;
// Of each thread: the share, and the class of the texel by its points, 0 of one that catches nothing.
@group(0) @binding(4) var<storage, read_write> results: array<u32>;

// Among the numbers of the settings.
const SINGLE_SAMPLE_SIZE: u32 = 0u;
const TWO_POINT_SIZE: u32 = 1u;
const THREE_POINT_SIZE: u32 = 2u;
const REACH: u32 = 3u;
const LEAST_EXPONENT: u32 = 4u;
const ROUNDING: u32 = 5u;
const LOG2_E: u32 = 6u;
const LN_2: u32 = 7u;
const EXP: u32 = 8u;
const ONE: u32 = 17u;
const TWO: u32 = 18u;
const THREE: u32 = 22u;

// Among the numbers of a shot.
const SHOT: u32 = 36u;
const ORIGIN: u32 = 0u;
const FORMS: u32 = 3u;
const CENTER: u32 = 12u;
const MOST: u32 = 14u;
const RANGE: u32 = 15u;
const SCALE: u32 = 16u;
const DEVIATION: u32 = 17u;
const SLOPE: u32 = 18u;
const SECANT: u32 = 19u;
const SIDES: u32 = 20u;
const ELLIPTIC: u32 = 34u;

const HALF: Double = vec2(0u, 0x3fe00000u);
const LEAF: u32 = 16u;

var<private> shot: u32;

fn constant(k: u32) -> Double {
    let both = settings.numbers[k / 2u];
    return select(both.xy, both.zw, (k & 1u) == 1u);
}

fn of_shot(k: u32) -> Double {
    return shots[shot * SHOT + k];
}

fn dot3(a: array<Double, 3>, b: array<Double, 3>) -> Double {
    return plus(plus(times(a[0], b[0]), times(a[1], b[1])), times(a[2], b[2]));
}

fn vector_of_shot(k: u32) -> array<Double, 3> {
    return array(of_shot(k), of_shot(k + 1u), of_shot(k + 2u));
}

// Whether a ball may touch the cone.
fn may_intersect(ray: array<Double, 3>, depth: Double, radius: Double) -> bool {
    if is_less(depth, negative(radius)) || is_less(plus(of_shot(RANGE), radius), depth) {
        return false;
    }
    if !is_zero(of_shot(ELLIPTIC)) {
        for (var side = SIDES; side < ELLIPTIC; side += 7u) {
            let sideways = minus(dot3(ray, vector_of_shot(side)), times(of_shot(side + 3u), depth));
            let reach = times(of_shot(side + 4u), depth);
            let outside = !is_at_most(minus(sideways, reach), times(radius, of_shot(side + 5u)));
            if outside || !is_at_most(minus(negative(sideways), reach), times(radius, of_shot(side + 6u))) {
                return false;
            }
        }
        return true;
    }
    var sideways: array<Double, 3>;
    for (var k = 0u; k < 3u; k++) {
        sideways[k] = minus(ray[k], times(of_shot(FORMS + k), depth));
    }
    let reach = plus(times(of_shot(SLOPE), depth), times(radius, of_shot(SECANT)));
    return is_at_most(ZERO, reach) && is_at_most(dot3(sideways, sideways), times(reach, reach));
}

// Two terms of the series.
fn terms(k: u32, part: Double) -> Double {
    return plus(constant(EXP + k), times(constant(EXP + k + 1u), part));
}

fn exponential(exponent: Double) -> Double {
    var power = constant(LEAST_EXPONENT);
    if is_less(power, exponent) {
        power = exponent;
    }
    let whole = plus(times(power, constant(LOG2_E)), constant(ROUNDING));
    let part = minus(power, times(minus(whole, constant(ROUNDING)), constant(LN_2)));
    let low = times(part, part);
    let high = times(low, low);
    let ends = plus(plus(terms(4u, part), times(low, terms(6u, part))), times(high, constant(EXP + 8u)));
    let series = plus(plus(terms(0u, part), times(low, terms(2u, part))), times(high, ends));
    return times(series, vec2(0u, (whole.x << 20u) + constant(ONE).y));
}

// Paint per area and unit volume, over the distance of the point's plane from the nozzle.
fn density(point: array<Double, 3>) -> Double {
    let depth = point[0];
    if !(is_less(ZERO, depth) && is_at_most(depth, of_shot(RANGE))) {
        return ZERO;
    }
    let inverse = over(constant(ONE), depth);
    var square = ZERO;
    for (var k = 0u; k < 2u; k++) {
        let slope = minus(times(point[k + 1u], inverse), of_shot(CENTER + k));
        square = plus(square, times(slope, slope));
    }
    if !is_at_most(square, of_shot(MOST)) {
        return ZERO;
    }
    let spread = times(of_shot(SCALE), exponential(times(negative(HALF), square)));
    return times(spread, times(times(inverse, inverse), inverse));
}

// The three forms of a vector.
fn forms(vector: array<Double, 3>) -> array<Double, 3> {
    var values: array<Double, 3>;
    for (var k = 0u; k < 3u; k++) {
        values[k] = dot3(vector_of_shot(FORMS + 3u * k), vector);
    }
    return values;
}

fn scaled(vector: array<Double, 3>, by: Double) -> array<Double, 3> {
    return array(times(vector[0], by), times(vector[1], by), times(vector[2], by));
}

// A point of the rule on a side that is `size` long.
fn node(points: u32, k: u32, middle: Double, size: Double) -> Double {
    return plus(middle, times(constant(select(TWO, THREE, points == 3u) + 2u * k), size));
}

fn weight(points: u32, k: u32) -> Double {
    return constant(select(TWO, THREE, points == 3u) + 2u * k + 1u);
}

struct Square {
    facing: Double,
    area: Double,
    middle: array<Double, 3>,
    along: array<Double, 3>,
    across: array<Double, 3>,
}

// The share of a texel that is cut into pieces, each with so many points a side.
fn share(square: Square, pieces: u32, points: u32) -> Double {
    let number = widened(f32(pieces));
    let size = over(constant(ONE), number);
    var total = ZERO;
    for (var piece = 0u; piece < pieces * pieces; piece++) {
        let first = minus(over(widened(f32(piece / pieces) + 0.5), number), HALF);
        let second = minus(over(widened(f32(piece % pieces) + 0.5), number), HALF);
        var sum = ZERO;
        for (var point = 0u; point < points * points; point++) {
            let i = point / points;
            let j = point % points;
            let a = node(points, i, first, size);
            let b = node(points, j, second, size);
            var place: array<Double, 3>;
            for (var k = 0u; k < 3u; k++) {
                place[k] = plus(plus(square.middle[k], times(a, square.along[k])), times(b, square.across[k]));
            }
            sum = plus(sum, times(times(weight(points, i), weight(points, j)), density(place)));
        }
        total = plus(total, times(times(times(sum, square.facing), square.area), times(size, size)));
    }
    return total;
}

@compute @workgroup_size(64)
fn shares(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x / LEAF >= settings.leaves {
        return;
    }
    let leaf = leaves[id.x / LEAF];
    results[3u * id.x + 2u] = 0u;
    if id.x % LEAF >= leaf.z {
        return;
    }
    shot = leaf.x;
    let first = 8u * (leaf.y + id.x % LEAF);
    var ray: array<Double, 3>;
    for (var k = 0u; k < 3u; k++) {
        ray[k] = minus(texels[first + k], of_shot(ORIGIN + k));
    }
    let normal = array(texels[first + 3u], texels[first + 4u], texels[first + 5u]);
    let side = texels[first + 7u];
    let away = dot3(ray, normal);
    let depth = dot3(ray, vector_of_shot(FORMS));
    if is_at_most(ZERO, away) || !may_intersect(ray, depth, times(constant(REACH), side)) {
        return;
    }

    let deviation = times(depth, of_shot(DEVIATION));
    var points = 3u;
    var pieces = 1u;
    var class_of_texel = 2u;
    if is_at_most(side, times(constant(TWO_POINT_SIZE), deviation)) {
        points = 2u;
        class_of_texel = 1u;
    } else if !is_at_most(side, times(constant(THREE_POINT_SIZE), deviation)) {
        class_of_texel = 3u;
        pieces = settings.most_pieces;
        if is_less(ZERO, deviation) {
            let sizes = over(side, times(constant(THREE_POINT_SIZE), deviation));
            while pieces > 1u && !is_less(widened(f32(pieces - 1u)), sizes) {
                pieces -= 1u;
            }
        }
    }

    // Duff et al. 2017.
    let one = constant(ONE);
    let sign = one | vec2(0u, normal[2].y & SIGN);
    let a = over(negative(one), plus(sign, normal[2]));
    let b = times(times(normal[0], normal[1]), a);
    let sign_x = times(sign, normal[0]);
    let u = array(plus(one, times(times(sign_x, normal[0]), a)), times(sign, b), times(negative(sign), normal[0]));
    let v = array(b, plus(sign, times(times(normal[1], normal[1]), a)), negative(normal[1]));
    var extent = side;
    if is_at_most(side, times(constant(SINGLE_SAMPLE_SIZE), deviation)) {
        extent = ZERO;
    }
    let square = Square(negative(away), texels[first + 6u], forms(ray), forms(scaled(u, extent)), forms(scaled(v, extent)));
    let caught = share(square, pieces, points);
    results[3u * id.x] = caught.x;
    results[3u * id.x + 1u] = caught.y;
    results[3u * id.x + 2u] = class_of_texel;
}
