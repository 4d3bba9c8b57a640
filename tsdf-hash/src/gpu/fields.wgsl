// Blocks with their upper borders, as ray_cast/unpacked.rs unpacks them: which cells the surface crosses, then the nodes of the
// blocks where it does. `page_word` reads a page of the pool; it is generated, for as many pages as there are.

struct Request {
    count: u32,
    with_colour: u32,
    unknown_zero: u32,
    unused: u32,
}

@group(0) @binding(0) var<uniform> request: Request;
// Places of a block and of its seven upper neighbours: page and slot.
@group(0) @binding(1) var<storage, read> blocks: array<array<u32, 8>>;
// Ranges of cells, or nodes.
@group(0) @binding(2) var<storage, read_write> results: array<u32>;

const NOWHERE: u32 = 0xffffffffu;
const SLOT: u32 = 0xffffffu;
const BLOCK_WORDS: u32 = 1792u;
const WEIGHTS: u32 = 512u;
const COLOURS: u32 = 768u;
const ONE: f32 = 32767.0;
const NODES: u32 = 9u;
const ALL: u32 = 729u;
const LANES: u32 = 256u;
// Of a distance that was not observed; those that were are within ±1.
const UNOBSERVED: f32 = 4.0;
// 255 / 63
const PER_STEP: f32 = 4.0476190476;

var<workgroup> states: array<u32, ALL>;
var<workgroup> low: array<atomic<u32>, 3>;
var<workgroup> high: array<atomic<u32>, 3>;

struct Node {
    place: u32,
    voxel: u32,
}

// The voxel that is node (x, y, z) of a block.
fn find(block: u32, node: vec3<u32>) -> Node {
    let next = node / 8u;
    let own = node % 8u;
    return Node(blocks[block][next.x + 2u * next.y + 4u * next.z], own.x + 8u * (own.y + 8u * own.z));
}

fn word(node: Node, at: u32) -> u32 {
    return page_word(node.place >> 24u, (node.place & SLOT) * BLOCK_WORDS + at);
}

fn weight_of(node: Node) -> u32 {
    if node.place == NOWHERE {
        return 0u;
    }
    return (word(node, WEIGHTS + node.voxel / 2u) >> (16u * (node.voxel % 2u))) & 0xffffu;
}

fn position(node: u32) -> vec3<u32> {
    return vec3(node % NODES, node / NODES % NODES, node / (NODES * NODES));
}

// The range of the cells that have observed nodes on both sides: 4 bits each for the lowest along x, y, z and for the
// highest, plus one; 0 if there are none.
@compute @workgroup_size(256)
fn range(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group.x + groups.x * group.y;
    if block >= request.count {
        return;
    }
    if lane < 3u {
        atomicStore(&low[lane], 15u);
    }
    for (var node = lane; node < ALL; node += LANES) {
        let at = find(block, position(node));
        // 0: unobserved; 1: free; 2: solid.
        var state = 0u;
        if weight_of(at) > 0u {
            state = 1u + u32(bitcast<i32>(word(at, at.voxel)) < 0);
        }
        states[node] = state;
    }
    workgroupBarrier();
    for (var cell = lane; cell < 512u; cell += LANES) {
        let corner = vec3(cell % 8u, cell / 8u % 8u, cell / 64u);
        var any = 0u;
        for (var k = 0u; k < 8u; k++) {
            let node = corner + vec3(k & 1u, (k >> 1u) & 1u, k >> 2u);
            any |= states[node.x + NODES * (node.y + NODES * node.z)];
        }
        if any == 3u {
            for (var k = 0u; k < 3u; k++) {
                atomicMin(&low[k], corner[k]);
                atomicMax(&high[k], corner[k] + 1u);
            }
        }
    }
    workgroupBarrier();
    if lane == 0u {
        var packed = 0u;
        for (var k = 0u; k < 3u; k++) {
            packed |= (atomicLoad(&low[k]) << (4u * k)) | (atomicLoad(&high[k]) << (4u * k + 12u));
        }
        results[block] = select(0u, packed, atomicLoad(&high[0]) > 0u);
    }
}

// Three words for each node: mean distance; weight, and a bit for a colour; R, G, B of eight bits.
@compute @workgroup_size(256)
fn unpack(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    unknown_zero = request.unknown_zero;
    let block = group.x + groups.x * group.y;
    if block >= request.count {
        return;
    }
    for (var node = lane; node < ALL; node += LANES) {
        let at = find(block, position(node));
        let weight = weight_of(at);
        var distance = UNOBSERVED;
        var mark = weight;
        var colour = 0u;
        if weight > 0u {
            let sum = from_integer(bitcast<i32>(word(at, at.voxel)));
            distance = divide(sum, times(f32(weight), ONE));
            if request.with_colour == 1u {
                let red_green = word(at, COLOURS + 2u * at.voxel);
                let blue_count = word(at, COLOURS + 2u * at.voxel + 1u);
                let count = blue_count >> 16u;
                if count > 0u {
                    mark |= 0x10000u;
                    colour = mean(red_green & 0xffffu, count) | (mean(red_green >> 16u, count) << 8u) |
                        (mean(blue_count & 0xffffu, count) << 16u);
                }
            }
        }
        let out = 3u * (block * ALL + node);
        results[out] = bitcast<u32>(distance);
        results[out + 1u] = mark;
        results[out + 2u] = colour;
    }
}

fn mean(sum: u32, count: u32) -> u32 {
    return u32(plus(divide(times(f32(sum), PER_STEP), f32(count)), 0.5));
}
