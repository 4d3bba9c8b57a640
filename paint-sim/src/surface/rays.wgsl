// Rays and triangles in single precision, with bounds of its errors: an answer is given where it is certain that the processor, in double
// precision, comes to the same one.
//
// Corners are exact. With u = 2^-24, a corner relative to the origin of a ray is off by less than 2 u of itself and `offset`, a direction by u.
// Every bound below is at least twice the sum of the errors of its operations, so that neither its own rounding matters nor whether products
// and sums are contracted.

struct Settings {
    rays: u32,
    nodes: u32,
    // Largest coordinate of the triangles.
    size: f32,
    // By how much the processor's coordinates may be off.
    rounding: f32,
    // A zero of which the compiler does not know.
    zero: u32,
}

struct Ray {
    origin: vec3<f32>,
    start: f32,
    direction: vec3<f32>,
    end: f32,
    // What the origin has beyond single precision.
    rest: vec3<f32>,
    unused: f32,
}

@group(0) @binding(0) var<uniform> settings: Settings;
// Low corner and the node behind the subtree; high corner, and eight times the first triangle with their number.
@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
// Three corners, the first with the number of the triangle.
@group(0) @binding(2) var<storage, read> triangles: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> rays: array<Ray>;
@group(0) @binding(4) var<storage, read_write> results: array<u32>;

const U: f32 = 5.9604645e-8;
const TINY: f32 = 1e-30;

// Answers that are not the number of a triangle.
const NONE: u32 = 0xffffffffu;
const DOUBTFUL: u32 = 0xfffffffeu;
const DARK: u32 = 0xfffffffdu;

const MISS: u32 = 0u;
const HIT: u32 = 1u;
const DOUBT: u32 = 2u;

// Of the ray: by how much a corner relative to its origin is off.
var<private> offset: f32;
// Between which distances the triangle that was met lies.
var<private> nearest: f32;
var<private> farthest: f32;

fn sum_of(v: vec3<f32>) -> f32 {
    return v.x + v.y + v.z;
}

// On which side of an edge a ray passes: the product, and the bound of its error. `corner` is an end of the edge from the ray's origin.
fn side(direction: vec3<f32>, edge: vec3<f32>, corner: vec3<f32>) -> vec2<f32> {
    let e = abs(edge);
    let c = abs(corner);
    let terms = dot(abs(direction), e.yzx * c.zxy + e.zxy * c.yzx);
    let bound = 20.0 * U * terms + 4.0 * offset * sum_of(e) + TINY;
    return vec2(dot(direction, cross(edge, corner)), bound);
}

// On which side of the triangle's plane the ray's point at a distance lies: the product, and the bound.
fn height(ray: Ray, distance: f32, a: vec3<f32>, along: vec3<f32>, across: vec3<f32>) -> vec2<f32> {
    let to_corner = a - ray.direction * distance;
    let reach = sum_of(abs(to_corner));
    let lengths = vec2(sum_of(abs(along)), sum_of(abs(across)));
    let area = lengths.x * lengths.y;
    let place_bound = offset + 4.0 * U * (sum_of(abs(a)) + distance);
    let bound = 2.0 * area * (place_bound + 12.0 * U * reach) + TINY;
    return vec2(dot(cross(along, across), to_corner), bound);
}

fn corner(k: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(triangles[k].xyz);
}

// A corner from the origin of a ray. Without the detour a compiler could take the rest from the origin, where it is lost.
fn from_origin(ray: Ray, corner: vec3<f32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(corner - ray.origin) ^ vec3(settings.zero)) - ray.rest;
}

// Whether a ray meets a triangle between its start and its end.
fn meets(ray: Ray, first: u32) -> u32 {
    let corners = array(corner(first), corner(first + 1u), corner(first + 2u));
    let a = from_origin(ray, corners[0]);
    let b = from_origin(ray, corners[1]);
    let c = from_origin(ray, corners[2]);
    let u = side(ray.direction, corners[2] - corners[1], b);
    let v = side(ray.direction, corners[0] - corners[2], c);
    let w = side(ray.direction, corners[1] - corners[0], a);
    let left = u.x > u.y || v.x > v.y || w.x > w.y;
    let right = u.x < -u.y || v.x < -v.y || w.x < -w.y;
    if left && right {
        return MISS;
    }

    // What a ray meets lies between the corners.
    let depths = vec3(dot(a, ray.direction), dot(b, ray.direction), dot(c, ray.direction));
    let slack = 4.0 * offset + 12.0 * U * max(sum_of(abs(a)), max(sum_of(abs(b)), sum_of(abs(c))));
    nearest = min(depths.x, min(depths.y, depths.z)) - slack;
    farthest = max(depths.x, max(depths.y, depths.z)) + slack;
    let start = ray.start * (1.0 + 4.0 * U);
    let end = ray.end * (1.0 - 4.0 * U);
    if farthest < ray.start * (1.0 - 4.0 * U) || nearest > ray.end * (1.0 + 4.0 * U) {
        return MISS;
    }
    let through = (u.x > u.y && v.x > v.y && w.x > w.y) || (u.x < -u.y && v.x < -v.y && w.x < -w.y);
    if nearest > start && farthest < end {
        return select(DOUBT, HIT, through);
    }

    // The triangle reaches over an end of the ray.
    let along = corners[1] - corners[0];
    let across = corners[2] - corners[0];
    let low = height(ray, max(ray.start, nearest - slack), a, along, across);
    let high = height(ray, min(ray.end, farthest + slack), a, along, across);
    if !(abs(low.x) > low.y && abs(high.x) > high.y) {
        return DOUBT;
    }
    if (low.x > 0.0) == (high.x > 0.0) {
        return MISS;
    }
    return select(DOUBT, HIT, through);
}

// Narrows the distances between which the triangle lies to those of its plane.
fn narrow(ray: Ray, first: u32) {
    let a = from_origin(ray, corner(first));
    let along = corner(first + 1u) - corner(first);
    let across = corner(first + 2u) - corner(first);
    let normal = cross(along, across);
    let slope = dot(normal, ray.direction);
    if abs(slope) > 64.0 * U * sum_of(abs(along)) * sum_of(abs(across)) {
        let distance = dot(normal, a) / slope;
        let bound = 6.0 * height(ray, abs(distance), a, along, across).y / abs(slope) + 16.0 * U * abs(distance);
        nearest = max(nearest, distance - bound);
        farthest = min(farthest, distance + bound);
    }
}

// Whether a ray may touch a node's box before a distance.
fn enters(ray: Ray, inverse: vec3<f32>, node: u32, margin: f32, end: f32) -> bool {
    let low = (bitcast<vec3<f32>>(nodes[2u * node].xyz) - margin - ray.origin) * inverse;
    let high = (bitcast<vec3<f32>>(nodes[2u * node + 1u].xyz) + margin - ray.origin) * inverse;
    let near = min(low, high);
    let far = max(low, high);
    let first = max(max(near.x, near.y), max(near.z, ray.start));
    let last = min(min(far.x, far.y), min(far.z, end));
    return first - 16.0 * U * abs(first) <= last + 16.0 * U * abs(last);
}

struct Search {
    inverse: vec3<f32>,
    margin: f32,
}

fn begin(ray: Ray) -> Search {
    let reach = max(max(abs(ray.origin.x), abs(ray.origin.y)), abs(ray.origin.z));
    offset = 4.0 * U * U * reach + settings.rounding;
    let small = abs(ray.direction) < vec3(1e-20);
    let margin = 32.0 * U * (settings.size + reach);
    return Search(1.0 / select(ray.direction, vec3(1e-20), small), margin);
}

// Of each ray: DARK where something lies on it, NONE where nothing does, the only triangle that may, or DOUBTFUL.
@compute @workgroup_size(64)
fn occluded(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= settings.rays {
        return;
    }
    let ray = rays[id.x];
    let search = begin(ray);
    var answer = NONE;
    var node = 0u;
    while node < settings.nodes && answer != DARK {
        var next = nodes[2u * node].w;
        if enters(ray, search.inverse, node, search.margin, ray.end) {
            let leaf = nodes[2u * node + 1u].w;
            for (var k = 0u; k < (leaf & 7u) && answer != DARK; k++) {
                let triangle = 3u * (leaf / 8u + k);
                let met = meets(ray, triangle);
                if met == HIT {
                    answer = DARK;
                } else if met == DOUBT {
                    answer = select(DOUBTFUL, triangles[triangle].w, answer == NONE);
                }
            }
            next = node + 1u;
        }
        node = next;
    }
    results[id.x] = answer;
}

// Of each ray: the number of the triangle that it hits first, NONE or DOUBTFUL.
@compute @workgroup_size(64)
fn first(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= settings.rays {
        return;
    }
    let ray = rays[id.x];
    let search = begin(ray);
    var found = NONE;
    // Between which distances it lies, and from which on another one may.
    var low = ray.end;
    var high = 2.0 * ray.end;
    var other = 4.0 * ray.end;
    var node = 0u;
    while node < settings.nodes {
        var next = nodes[2u * node].w;
        if enters(ray, search.inverse, node, search.margin, min(high, 2.0 * ray.end)) {
            let leaf = nodes[2u * node + 1u].w;
            for (var k = 0u; k < (leaf & 7u); k++) {
                let triangle = 3u * (leaf / 8u + k);
                let met = meets(ray, triangle);
                if met != MISS {
                    narrow(ray, triangle);
                }
                if met == HIT && farthest < high {
                    if found != NONE {
                        other = min(other, low);
                    }
                    found = triangles[triangle].w;
                    low = nearest;
                    high = farthest;
                } else if met != MISS {
                    other = min(other, nearest);
                }
            }
            next = node + 1u;
        }
        node = next;
    }
    results[id.x] = select(found, DOUBTFUL, other <= high);
}
