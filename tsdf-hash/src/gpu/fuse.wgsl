// The update of blocks by a frame, voxel by voxel as integration/integrator.rs does it. One workgroup per block, two neighbouring voxels per
// invocation: those whose weights share a word. No two invocations write the same word, so no order can show.

struct Frame {
    // Change of (u z, v z, z) from a voxel to the next along x, y and z.
    step: array<vec4<f32>, 3>,
    size: vec2<u32>,
    // The last column and row of the colour image.
    colour_last: vec2<f32>,
    colour_scale: vec2<f32>,
    colour_shift: vec2<f32>,
    // Voxels are touched this far in front of a surface, at least (behind it: negative) and at most.
    least_ahead: f32,
    colour_reach: f32,
    // Words of the frame before its colours; 0 without colours.
    colour_start: u32,
    // Of a channel.
    colour_bytes: u32,
    // One of the modes below.
    mode: u32,
    // The blocks of this pass among all.
    first: u32,
    count: u32,
    unknown_zero: u32,
    colour_width: u32,
    // Whether the pixels of the colour image are those of the depth image.
    is_aligned: u32,
    most_ahead: f32,
    // Words of the frame before its rims.
    rim_start: u32,
    // Free space beside rims is known from the one (behind them: negative) to the other in front.
    rim_behind: f32,
    rim_before: f32,
    half_voxel: f32,
    // A pixel's width at a metre.
    pixel: f32,
    per_metre: f32,
}

// Nothing is written but the count.
const COUNT: u32 = 0u;
const INTEGRATE: u32 = 1u;
const DEINTEGRATE: u32 = 2u;

const BLOCK_WORDS: u32 = 1792u;
const WEIGHTS: u32 = 512u;
const COLOURS: u32 = 768u;
const ONE: i32 = 32767;
// Where weights start to fall behind a surface, and by how much a step (7 / 65536): as in integrator.rs.
const FULL: f32 = 4096.0;
const FADING: f32 = 0.0001068115234375;
const MAX_COLOURS: u32 = 1040u;
// Of a rim: how many pixels it is away, in place of the last bits of its depth.
const RIM_PIXELS: u32 = 255u;

// The slot's bit for a block whose memory holds something else yet.
const FRESH: u32 = 0x80000000u;
// Of a count; its low bits count voxels.
const OVERFLOW: u32 = 0x10000u;
const OBSERVED: u32 = 0x20000u;

@group(0) @binding(0) var<uniform> frame: Frame;
// Projection of the block's first voxel, and its slot.
@group(0) @binding(1) var<storage, read> blocks: array<vec4<u32>>;
// Planes of four words, then rims, then colours.
@group(0) @binding(2) var<storage, read> pixels: array<u32>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;
@group(0) @binding(4) var<storage, read_write> pool: array<u32>;

var<workgroup> block_count: atomic<u32>;

struct Voxel {
    distance: i32,
    weight: u32,
    colour: vec2<u32>,
    // Of the count.
    mark: u32,
}

// A colour channel in six bits.
fn channel(at: u32) -> u32 {
    if frame.colour_bytes == 1u {
        let word = pixels[frame.colour_start + at / 4u];
        return (((word >> (8u * (at % 4u))) & 255u) * 63u + 127u) / 255u;
    }
    let word = pixels[frame.colour_start + at / 2u];
    return (((word >> (16u * (at % 2u))) & 65535u) * 63u + 32767u) / 65535u;
}

// The colour of the pixel nearest to a projection, or of the depth pixel itself, and a count of one; zero outside the colour
// image.
fn colour_at(u: f32, v: f32, depth_pixel: u32) -> vec4<u32> {
    var pixel = depth_pixel;
    if frame.is_aligned == 0u {
        let i = nearest(plus(times(u, frame.colour_scale.x), frame.colour_shift.x));
        let j = nearest(plus(times(v, frame.colour_scale.y), frame.colour_shift.y));
        let inside = i >= 0.0 && i <= frame.colour_last.x && j >= 0.0 && j <= frame.colour_last.y;
        if !inside {
            return vec4(0u);
        }
        pixel = u32(j) * frame.colour_width + u32(i);
    }
    return vec4(channel(3u * pixel), channel(3u * pixel + 1u), channel(3u * pixel + 2u), 1u);
}

fn observe(old: Voxel, distance: f32, seen: u32) -> Voxel {
    var voxel = old;
    let steps = nearest(clamp(distance, f32(-ONE), f32(ONE)));
    // Exact until it is rounded.
    let left = plus(f32(seen), times(times(f32(seen), min(plus(steps, FULL), 0.0)), FADING));
    let weight = u32(nearest(max(left, 1.0)));
    let change = i32(steps) * i32(weight);
    if frame.mode == DEINTEGRATE {
        voxel.distance -= change;
        voxel.weight = (voxel.weight - weight) & 0xffffu;
        // No sum of observations can leave this range: what was taken out was not in.
        if old.weight < weight || magnitude(voxel.distance) > voxel.weight * u32(ONE) {
            voxel.mark |= OVERFLOW;
        }
    } else {
        voxel.distance += change;
        voxel.weight = (voxel.weight + weight) & 0xffffu;
        if voxel.weight < weight {
            voxel.mark |= OVERFLOW;
        }
    }
    return voxel;
}

fn magnitude(x: i32) -> u32 {
    return select(bitcast<u32>(x), 0u - bitcast<u32>(x), x < 0);
}

fn observe_colour(old: Voxel, change: vec4<u32>) -> Voxel {
    var voxel = old;
    let sums = vec4(old.colour.x & 0xffffu, old.colour.x >> 16u, old.colour.y & 0xffffu, old.colour.y >> 16u);
    let next = select(sums + change, sums - change, frame.mode == DEINTEGRATE) & vec4(0xffffu);
    // What is left of so many colours is no more than so many times the brightest: what was taken out was not in.
    if next.w > MAX_COLOURS || (frame.mode == DEINTEGRATE && any(next.xyz > vec3(63u * next.w))) {
        voxel.mark |= OVERFLOW;
    }
    voxel.colour = vec2(next.x | (next.y << 16u), next.z | (next.w << 16u));
    return voxel;
}

// How far a voxel at a depth is from the rim that its pixel passes, in steps of the stored distance; -1 where that is not known.
fn beside(rim: u32, depth: f32) -> f32 {
    let rim_depth = bitcast<f32>(rim & ~RIM_PIXELS);
    let ahead = minus(rim_depth, depth);
    if rim == 0u || !(ahead >= frame.rim_behind && ahead <= frame.rim_before) {
        return -1.0;
    }
    let aside = times(times(f32(rim & RIM_PIXELS) - 0.5, frame.pixel), rim_depth);
    return times(max(max(minus(aside, frame.half_voxel), ahead), 0.0), frame.per_metre);
}

// What the frame makes of a voxel that projects to (u z, v z, z).
fn update(old: Voxel, projected: vec3<f32>) -> Voxel {
    let depth = projected.z;
    if !(depth > 0.0) {
        return old;
    }
    let inverse = quotient(1.0, depth);
    let u = times(projected.x, inverse);
    let v = times(projected.y, inverse);
    let pixel_u = nearest(u);
    let pixel_v = nearest(v);
    let right = f32(frame.size.x - 1u);
    let bottom = f32(frame.size.y - 1u);
    let inside = pixel_u >= 0.0 && pixel_u <= right && pixel_v >= 0.0 && pixel_v <= bottom;
    if !inside {
        return old;
    }
    let depth_pixel = u32(pixel_v) * frame.size.x + u32(pixel_u);
    let pixel = 4u * depth_pixel;
    let offset = bitcast<f32>(pixels[pixel]);
    let omega = bitcast<f32>(pixels[pixel + 1u]);
    let own = times(depth, omega);
    let ahead = minus(offset, own);
    if !(omega > 0.0 && ahead >= times(frame.least_ahead, omega)) {
        return old;
    }
    let within = ahead <= times(frame.most_ahead, omega);
    let free = beside(pixels[frame.rim_start + depth_pixel], depth);
    if !(within || free >= 0.0) {
        return old;
    }
    let along_u = times(bitcast<f32>(pixels[pixel + 2u]), minus(u, pixel_u));
    let along_v = times(bitcast<f32>(pixels[pixel + 3u]), minus(v, pixel_v));
    let distance = minus(offset, times(depth, plus(omega, plus(along_u, along_v))));
    let least = select(distance, min(distance, free), free >= 0.0);
    var voxel = observe(old, least, pixels[pixel + 3u] & 15u);
    voxel.mark += 1u;
    if within && frame.colour_start > 0u && abs(distance) < frame.colour_reach {
        let change = colour_at(u, v, depth_pixel);
        if change.w > 0u {
            voxel = observe_colour(voxel, change);
        }
    }
    return voxel;
}

@compute @workgroup_size(256)
fn fuse(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) pair: u32,
) {
    unknown_zero = frame.unknown_zero;
    let at = group.x + groups.x * group.y;
    if at >= frame.count {
        return;
    }
    let block = blocks[frame.first + at];
    let start = (block.w & ~FRESH) * BLOCK_WORDS;
    let fresh = (block.w & FRESH) != 0u;
    let x = f32(2u * pair % 8u);
    let y = f32(pair / 4u % 8u);
    let z = f32(pair / 32u);
    var row: array<f32, 3>;
    for (var k = 0u; k < 3u; k++) {
        row[k] = plus(plus(bitcast<f32>(block[k]), times(frame.step[1][k], y)), times(frame.step[2][k], z));
    }
    let weights = start + WEIGHTS + pair;
    var packed_weights = 0u;
    var mark = 0u;
    for (var k = 0u; k < 2u; k++) {
        let voxel_at = 2u * pair + k;
        let colours = start + COLOURS + 2u * voxel_at;
        var old = Voxel(0, 0u, vec2(0u), 0u);
        if !fresh {
            old = Voxel(
                bitcast<i32>(pool[start + voxel_at]),
                (pool[weights] >> (16u * k)) & 0xffffu,
                vec2(pool[colours], pool[colours + 1u]),
                0u,
            );
        }
        let along = x + f32(k);
        let projected = vec3(
            plus(row[0], times(frame.step[0].x, along)),
            plus(row[1], times(frame.step[0].y, along)),
            plus(row[2], times(frame.step[0].z, along)),
        );
        let voxel = update(old, projected);
        if frame.mode != COUNT && (fresh || (voxel.mark & 0xffffu) > 0u) {
            pool[start + voxel_at] = bitcast<u32>(voxel.distance);
            pool[colours] = voxel.colour.x;
            pool[colours + 1u] = voxel.colour.y;
        }
        packed_weights |= voxel.weight << (16u * k);
        mark = ((mark & 0xffffu) + (voxel.mark & 0xffffu)) | ((mark | voxel.mark) & OVERFLOW);
    }
    if packed_weights > 0u {
        mark |= OBSERVED;
    }
    if frame.mode != COUNT && (fresh || (mark & 0xffffu) > 0u) {
        pool[weights] = packed_weights;
    }
    // Counts add and flags unite: the order of the invocations does not show.
    if (mark & 0xffffu) > 0u {
        atomicAdd(&block_count, mark & 0xffffu);
    }
    if (mark >> 16u) > 0u {
        atomicOr(&block_count, mark & 0xffff0000u);
    }
    workgroupBarrier();
    if pair == 0u {
        counts[frame.first + at] = atomicLoad(&block_count);
    }
}
