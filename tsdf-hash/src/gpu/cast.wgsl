// One ray per pixel through the unpacked blocks of its tile, as ray_cast/march.rs and ray_cast/cell.rs do it.

struct View {
    size: vec2<u32>,
    // Tiles of pixels per row of them.
    columns: u32,
    with_colour: u32,
    // Change of the direction from pixel to pixel, voxels per metre of depth.
    step: vec3<f32>,
    min_depth: f32,
    max_depth: f32,
    truncation: f32,
    min_slope: f32,
    grazing_tolerance: f32,
    min_step: f32,
    // Words of the scene before its blocks, its starts and its lists; directions of rows come first.
    visible: u32,
    starts: u32,
    lists: u32,
    unknown_zero: u32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> scene: array<u32>;
@group(0) @binding(2) var<storage, read> nodes: array<u32>;
// Depth, normal, colour, weight: six words.
@group(0) @binding(3) var<storage, read_write> pixels: array<u32>;

const SIDE: u32 = 8u;
const Y: u32 = 9u;
const Z: u32 = 81u;
const ALL: u32 = 729u;
const OBSERVED: f32 = 2.0;
const UNOBSERVED: f32 = 4.0;
const UNSEEN: u32 = 0x808080u;

struct Ray {
    // First node of the block, its words counted.
    block: u32,
    origin: vec3<f32>,
    direction: vec3<f32>,
    per_voxel: f32,
}

struct Cell {
    first: u32,
    along: vec3<f32>,
}

struct Pixel {
    depth: f32,
    normal: vec3<f32>,
    colour: u32,
    weight: u32,
}

const NONE: Pixel = Pixel(0.0, vec3(0.0), UNSEEN, 0u);

// What a ray did in a block.
struct Outcome {
    // 0: it left; 1: it ends.
    ends: bool,
    pixel: Pixel,
}

fn number(at: u32) -> f32 {
    return bitcast<f32>(scene[at]);
}

fn vector(at: u32) -> vec3<f32> {
    return vec3(number(at), number(at + 1u), number(at + 2u));
}

fn larger(a: f32, b: f32) -> f32 {
    return select(b, a, a > b);
}

fn smaller(a: f32, b: f32) -> f32 {
    return select(b, a, a < b);
}

fn cell_at(ray: Ray, t: f32) -> Cell {
    var cell = Cell(0u, vec3(0.0));
    var stride = 1u;
    for (var k = 0u; k < 3u; k++) {
        let point = plus(ray.origin[k], times(ray.direction[k], t));
        let p = smaller(larger(point, 0.0), 8.0);
        let below = nearest(smaller(minus(p, 0.5), 7.0));
        cell.along[k] = minus(p, below);
        cell.first += (u32(below) & 7u) * stride;
        stride *= Y;
    }
    return cell;
}

fn corners(ray: Ray, cell: Cell) -> array<f32, 8> {
    let first = ray.block + 3u * cell.first;
    var c: array<f32, 8>;
    for (var k = 0u; k < 8u; k++) {
        c[k] = bitcast<f32>(nodes[first + 3u * ((k & 1u) + Y * ((k >> 1u) & 1u) + Z * (k >> 2u))]);
    }
    return c;
}

fn whole(c: array<f32, 8>) -> bool {
    let most = max(max(max(c[0], c[1]), max(c[2], c[3])), max(max(c[4], c[5]), max(c[6], c[7])));
    return most < OBSERVED;
}

fn between(a: f32, b: f32, share: f32) -> f32 {
    return plus(a, times(share, minus(b, a)));
}

// The nearest corner.
fn nearest_of(cell: Cell) -> vec3<u32> {
    return select(vec3(0u), vec3(1u), cell.along > vec3(0.5));
}

// Corners of which the nearest is observed; those that are not take the value of their neighbour along x, else y, else z.
fn completed(corners: array<f32, 8>) -> array<f32, 8> {
    var c = corners;
    for (var stride = 1u; stride < 8u; stride *= 2u) {
        for (var k = 0u; k < 8u; k++) {
            if c[k] > OBSERVED {
                c[k] = c[k ^ stride];
            }
        }
    }
    return c;
}

// UNOBSERVED if the nearest corner is.
fn sample(ray: Ray, cell: Cell) -> f32 {
    var c = corners(ray, cell);
    if !whole(c) {
        if c[dot(nearest_of(cell), vec3(1u, 2u, 4u))] > OBSERVED {
            return UNOBSERVED;
        }
        c = completed(c);
    }
    let near = between(between(c[0], c[1], cell.along.x), between(c[2], c[3], cell.along.x), cell.along.y);
    let far = between(between(c[4], c[5], cell.along.x), between(c[6], c[7], cell.along.x), cell.along.y);
    return between(near, far, cell.along.z);
}

fn colour_of(ray: Ray, cell: Cell) -> u32 {
    var share: array<u32, 3>;
    for (var k = 0u; k < 3u; k++) {
        share[k] = u32(nearest(times(cell.along[k], 16.0)));
    }
    var layers: array<vec4<u32>, 2>;
    for (var z = 0u; z < 2u; z++) {
        var rows: array<vec4<u32>, 2>;
        for (var y = 0u; y < 2u; y++) {
            let at = ray.block + 3u * (cell.first + Y * y + Z * z);
            rows[y] = (16u - share[0]) * coloured(at) + share[0] * coloured(at + 3u);
        }
        layers[z] = ((16u - share[1]) * rows[0] + share[1] * rows[1]) >> vec4(4u);
    }
    let sums = (16u - share[2]) * layers[0] + share[2] * layers[1];
    if sums.w == 0u {
        return UNSEEN;
    }
    let rgb = min((sums.xyz + vec3(sums.w / 2u)) / vec3(sums.w), vec3(255u));
    return rgb.x | (rgb.y << 8u) | (rgb.z << 16u);
}

// R, G, B and one; zero without a colour.
fn coloured(at: u32) -> vec4<u32> {
    let rgb = nodes[at + 2u];
    return vec4(rgb & 255u, (rgb >> 8u) & 255u, rgb >> 16u, (nodes[at + 1u] >> 16u) & 1u);
}

// From two depths on either side of the surface: one step of the secant, one of Newton.
fn refine(ray: Ray, near: f32, above: f32, far: f32, below: f32) -> Pixel {
    let t = plus(near, times(minus(far, near), divide(above, minus(above, below))));
    let cell = cell_at(ray, t);
    var c = corners(ray, cell);
    if !whole(c) {
        if c[dot(nearest_of(cell), vec3(1u, 2u, 4u))] > OBSERVED {
            return NONE;
        }
        c = completed(c);
    }
    let x = cell.along.x;
    let y = cell.along.y;
    let z = cell.along.z;
    var rise_x: array<f32, 4>;
    var along_x: array<f32, 4>;
    for (var k = 0u; k < 4u; k++) {
        rise_x[k] = minus(c[2u * k + 1u], c[2u * k]);
        along_x[k] = plus(c[2u * k], times(x, rise_x[k]));
    }
    let rise_y = vec2(minus(along_x[1], along_x[0]), minus(along_x[3], along_x[2]));
    let along_y = vec2(plus(along_x[0], times(y, rise_y.x)), plus(along_x[2], times(y, rise_y.y)));
    let rise_z = minus(along_y.y, along_y.x);
    let value = plus(along_y.x, times(z, rise_z));
    let gx = between(between(rise_x[0], rise_x[1], y), between(rise_x[2], rise_x[3], y), z);
    let gy = between(rise_y.x, rise_y.y, z);
    let gz = rise_z;
    let d = ray.direction;
    let slope = plus(plus(times(gx, d.x), times(gy, d.y)), times(gz, d.z));
    if !(slope < 0.0) {
        return NONE;
    }
    let reach = times(view.min_step, ray.per_voxel);
    let depth = plus(t, smaller(larger(divide(-value, slope), -reach), reach));
    let scale = quotient(1.0, root(plus(plus(times(gx, gx), times(gy, gy)), times(gz, gz))));
    var colour = UNSEEN;
    if view.with_colour == 1u {
        colour = colour_of(ray, cell);
    }
    let nearest_node = cell.first + dot(nearest_of(cell), vec3(1u, Y, Z));
    let weight = nodes[ray.block + 3u * nearest_node + 1u] & 0xffffu;
    return Pixel(depth, vec3(times(gx, scale), times(gy, scale), times(gz, scale)), colour, weight);
}

fn through(ray: Ray, enter: f32, leave: f32) -> Outcome {
    var outside = false;
    var before = 0.0;
    var before_value = 0.0;
    var t = enter;
    loop {
        let value = sample(ray, cell_at(ray, t));
        var step = view.min_step;
        if value > OBSERVED {
            outside = false;
        } else if value >= 0.0 {
            outside = true;
            before = t;
            before_value = value;
            step = larger(times(value, view.truncation), view.min_step);
        } else if outside {
            return Outcome(true, refine(ray, before, before_value, t, value));
        } else if value > -view.grazing_tolerance {
            return Outcome(true, refine(ray, t, 0.0, t, value));
        } else {
            return Outcome(true, NONE);
        }
        if t >= leave {
            return Outcome(false, NONE);
        }
        t = smaller(plus(t, times(step, ray.per_voxel)), leave);
    }
    return Outcome(false, NONE);
}

fn cast_ray(direction: vec3<f32>, tile: u32) -> Pixel {
    var inverse: vec3<f32>;
    for (var k = 0u; k < 3u; k++) {
        inverse[k] = divide(1.0, select(direction[k], view.min_slope, abs(direction[k]) < view.min_slope));
    }
    let d = direction;
    let squared = plus(plus(times(d.x, d.x), times(d.y, d.y)), times(d.z, d.z));
    let per_voxel = quotient(1.0, root(squared));
    for (var k = scene[view.starts + tile]; k < scene[view.starts + tile + 1u]; k++) {
        let visible = view.visible + 10u * scene[view.lists + k];
        let low = vector(visible + 4u);
        let high = vector(visible + 7u);
        var enter = view.min_depth;
        var leave = view.max_depth;
        for (var axis = 0u; axis < 3u; axis++) {
            let a = times(low[axis], inverse[axis]);
            let b = times(high[axis], inverse[axis]);
            enter = max(enter, min(a, b));
            leave = min(leave, max(a, b));
        }
        if enter <= leave {
            let ray = Ray(scene[visible + 3u] * 3u * ALL, vector(visible), direction, per_voxel);
            let outcome = through(ray, enter, leave);
            if outcome.ends {
                return outcome.pixel;
            }
        }
    }
    return NONE;
}

@compute @workgroup_size(8, 8)
fn ray_cast(@builtin(global_invocation_id) id: vec3<u32>) {
    unknown_zero = view.unknown_zero;
    if any(id.xy >= view.size) {
        return;
    }
    let start = vector(3u * id.y);
    var direction: vec3<f32>;
    for (var k = 0u; k < 3u; k++) {
        direction[k] = plus(start[k], times(view.step[k], f32(id.x)));
    }
    let pixel = cast_ray(direction, id.y / SIDE * view.columns + id.x / SIDE);
    let out = 6u * (id.y * view.size.x + id.x);
    pixels[out] = bitcast<u32>(pixel.depth);
    pixels[out + 1u] = bitcast<u32>(pixel.normal.x);
    pixels[out + 2u] = bitcast<u32>(pixel.normal.y);
    pixels[out + 3u] = bitcast<u32>(pixel.normal.z);
    pixels[out + 4u] = pixel.colour;
    pixels[out + 5u] = pixel.weight;
}
