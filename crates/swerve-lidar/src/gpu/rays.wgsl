// Rays of a lidar, one per invocation: the first surface through two levels of trees, and what the sensor makes of
// it. The same arithmetic as `bvh/`, `soup.rs` and `returns.rs`, which are the reference; the
// words are laid out by `scene_tree/flat.rs`.

// Entries of a walk's stack; the number is put in when the trees are known.
const STACK: u32 = STACK_SIZEu;

// Bits of a link: see `link` in `bvh/flat.rs`.
const NONE: u32 = 0xffffffffu;
const LEAF: u32 = 0x80000000u;
const TOP: u32 = 0x40000000u;
const INDEX: u32 = 0x1fffffffu;
// Farther than any range.
const FAR: f32 = 1e30;
// See `SLACK` in `bvh/ray.rs`.
const SLACK: f32 = 1.0000004;
// Parts of a direction are no smaller, so that nothing overflows.
const TINY: f32 = 1e-12;
// Flags above a surface's class.
const RETRO: u32 = 256u;
const KEEPS_CLASS: u32 = 512u;
// Flag above the class of a return.
const SEEN: u32 = 256u;

struct Params {
    // Columns, beams, roots of the tree of all that never moves and of that of the instances which do not move.
    counts: vec4u,
    // Whether an instance is hidden, its id; low and high half of the key of the noise.
    hidden: vec4u,
    // Least and largest range, how far rays go, reach squared over the reflectance it is for.
    range: vec4f,
    // Deviation and step of a range, share of dropouts, square of the distance at which intensity is full.
    noise: vec4f,
    // Extinction, gain of a retro-reflector, odds of being seen at the reach.
    air: vec4f,
}

struct Node {
    x0: vec4f,
    x1: vec4f,
    y0: vec4f,
    y1: vec4f,
    z0: vec4f,
    z1: vec4f,
    child: vec4u,
}

// Of each axis, four triangles side by side.
struct Block {
    corner: array<vec4f, 3>,
    edge_1: array<vec4f, 3>,
    edge_2: array<vec4f, 3>,
    normal: array<vec4f, 3>,
    surface: vec4u,
}

// Axes of the body and its origin; root of its mesh, instance id, class.
struct Placed {
    x: vec3f,
    root: u32,
    y: vec3f,
    instance: u32,
    z: vec3f,
    class_id: u32,
    origin: vec3f,
    unused: u32,
}

// Rows of the rotation, the origin in the last place of each; root of the tree of what moves, number of the column,
// sine and cosine of its azimuth as bits.
struct Column {
    x: vec4f,
    y: vec4f,
    z: vec4f,
    root: vec4u,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<Node>;
@group(0) @binding(2) var<storage, read> blocks: array<Block>;
@group(0) @binding(3) var<storage, read> surfaces: array<vec4u>;
@group(0) @binding(4) var<storage, read> top_nodes: array<Node>;
@group(0) @binding(5) var<storage, read> placed: array<Placed>;
@group(0) @binding(6) var<storage, read> columns: array<Column>;
@group(0) @binding(7) var<storage, read> beams: array<vec4f>;
// Range and intensity as bits, instance id, class with the flag that there is a return.
@group(0) @binding(8) var<storage, read_write> returns: array<vec4u>;
// Returns of each column; then, with room for all rays each and without gaps: x, y, z, intensity, instance id, and
// ring with the class above it.
@group(0) @binding(9) var<storage, read_write> points: array<u32>;

struct Ray {
    origin: vec3f,
    direction: vec3f,
    inverse: vec3f,
}

fn ray_of(origin: vec3f, direction: vec3f) -> Ray {
    let safe = select(direction, select(vec3f(TINY), vec3f(-TINY), direction < vec3f(0.0)),
        abs(direction) < vec3f(TINY));
    return Ray(origin, direction, 1.0 / safe);
}

// Triangle that was met: how far, which triangle (four times the block, and the lane), of which instance.
struct Met {
    distance: f32,
    place: u32,
    by: u32,
}

struct Lane {
    near: f32,
    link: u32,
}

// The nearer first.
fn ordered(a: Lane, b: Lane) -> array<Lane, 2> {
    if b.near < a.near {
        return array<Lane, 2>(b, a);
    }
    return array<Lane, 2>(a, b);
}

fn is_hidden(instance: u32) -> bool {
    return params.hidden.x != 0u && instance == params.hidden.y;
}

// The triangles of a block that are nearer than what was met, or as near and earlier.
fn meet_block(ray: Ray, index: u32, by: u32, met: ptr<function, Met>) {
    let n0 = blocks[index].normal[0];
    let n1 = blocks[index].normal[1];
    let n2 = blocks[index].normal[2];
    let sx = ray.origin.x - blocks[index].corner[0];
    let sy = ray.origin.y - blocks[index].corner[1];
    let sz = ray.origin.z - blocks[index].corner[2];
    let d = ray.direction;
    let det = d.x * n0 + d.y * n1 + d.z * n2;
    let flat = det == vec4f(0.0);
    let inverse = -1.0 / select(det, vec4f(1.0), flat);
    let distance = (sx * n0 + sy * n1 + sz * n2) * inverse;
    let in_reach = (distance > vec4f(0.0)) & (distance <= vec4f((*met).distance)) & !flat;
    if !any(in_reach) {
        return;
    }
    let rx = sy * d.z - sz * d.y;
    let ry = sz * d.x - sx * d.z;
    let rz = sx * d.y - sy * d.x;
    let u = (blocks[index].edge_2[0] * rx + blocks[index].edge_2[1] * ry + blocks[index].edge_2[2] * rz)
        * inverse;
    let v = -(blocks[index].edge_1[0] * rx + blocks[index].edge_1[1] * ry + blocks[index].edge_1[2] * rz)
        * inverse;
    let hits = in_reach & (u >= vec4f(0.0)) & (v >= vec4f(0.0)) & (u + v <= vec4f(1.0));
    for (var lane = 0u; lane < 4u; lane++) {
        if !hits[lane] {
            continue;
        }
        let place = index * 4u + lane;
        let t = distance[lane];
        let first = t < (*met).distance || (*met).place == NONE || by < (*met).by
            || (by == (*met).by && place < (*met).place);
        if t <= (*met).distance && first {
            // A surface that never moves has the instance's id with its surface.
            if by != NONE || !is_hidden(surfaces[blocks[index].surface[lane]].x) {
                *met = Met(t, place, by);
            }
        }
    }
}

// The four boxes of a node that the ray meets, the nearest first; those it does not meet are at FAR.
fn meet_node(ray: Ray, node: Node, reach: f32) -> array<Lane, 4> {
    let up = ray.inverse >= vec3f(0.0);
    let o = ray.origin;
    let i = ray.inverse;
    let nx = (select(node.x1, node.x0, up.x) - o.x) * i.x;
    let fx = (select(node.x0, node.x1, up.x) - o.x) * i.x;
    let ny = (select(node.y1, node.y0, up.y) - o.y) * i.y;
    let fy = (select(node.y0, node.y1, up.y) - o.y) * i.y;
    let nz = (select(node.z1, node.z0, up.z) - o.z) * i.z;
    let fz = (select(node.z0, node.z1, up.z) - o.z) * i.z;
    let near = max(max(nx, ny), max(nz, vec4f(0.0)));
    let far = min(min(fx, fy), fz) * SLACK;
    let key = select(vec4f(FAR), near, near <= min(far, vec4f(reach)));
    let a = ordered(Lane(key.x, node.child.x), Lane(key.y, node.child.y));
    let b = ordered(Lane(key.z, node.child.z), Lane(key.w, node.child.w));
    let first = ordered(a[0], b[0]);
    let last = ordered(a[1], b[1]);
    let middle = ordered(first[1], last[0]);
    return array<Lane, 4>(first[0], middle[0], middle[1], last[1]);
}

// The first surface within reach, through the tree of all that never moves and those of instances.
fn first_met(world: Ray, tops: vec3u, reach: f32) -> Met {
    var stack: array<Lane, STACK>;
    var height = 0u;
    for (var k = 2u; k > 0u; k--) {
        if tops[k] != NONE {
            stack[height] = Lane(0.0, tops[k]);
            height++;
        }
    }
    var met = Met(reach, NONE, NONE);
    var ray = world;
    // Inside an instance: which, and where the stack was.
    var by = NONE;
    var floor_height = 0u;
    var at = tops[0];
    loop {
        var goes_down = false;
        if at == NONE {
            // An empty tree.
        } else if (at & LEAF) == 0u {
            var node: Node;
            if (at & TOP) != 0u {
                node = top_nodes[at & INDEX];
            } else {
                node = nodes[at & INDEX];
            }
            let lanes = meet_node(ray, node, met.distance);
            if lanes[3].near < FAR {
                stack[height] = lanes[3];
                height++;
            }
            if lanes[2].near < FAR {
                stack[height] = lanes[2];
                height++;
            }
            if lanes[1].near < FAR {
                stack[height] = lanes[1];
                height++;
            }
            if lanes[0].near < FAR {
                at = lanes[0].link;
                goes_down = true;
            }
        } else if (at & TOP) != 0u {
            let index = at & INDEX;
            if placed[index].root != NONE && !is_hidden(placed[index].instance) {
                let start = world.origin - placed[index].origin;
                let d = world.direction;
                let x = placed[index].x;
                let y = placed[index].y;
                let z = placed[index].z;
                ray = ray_of(vec3f(dot(x, start), dot(y, start), dot(z, start)),
                    vec3f(dot(x, d), dot(y, d), dot(z, d)));
                by = index;
                floor_height = height;
                at = placed[index].root;
                goes_down = true;
            }
        } else {
            meet_block(ray, at & INDEX, by, &met);
        }
        if goes_down {
            continue;
        }
        at = NONE;
        loop {
            if by != NONE && height == floor_height {
                by = NONE;
                ray = world;
            }
            if height == 0u {
                break;
            }
            height--;
            let entry = stack[height];
            if entry.near <= met.distance {
                at = entry.link;
                break;
            }
        }
        if at == NONE {
            break;
        }
    }
    return met;
}

// Integers of 64 bits: low half, high half.

fn add_long(a: vec2u, b: vec2u) -> vec2u {
    let low = a.x + b.x;
    return vec2u(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn times_long(a: vec2u, b: vec2u) -> vec2u {
    let a0 = a.x & 0xffffu;
    let a1 = a.x >> 16u;
    let b0 = b.x & 0xffffu;
    let b1 = b.x >> 16u;
    let p0 = a0 * b0;
    let p1 = a0 * b1;
    let p2 = a1 * b0;
    let middle = (p0 >> 16u) + (p1 & 0xffffu) + (p2 & 0xffffu);
    let high = a1 * b1 + (p1 >> 16u) + (p2 >> 16u) + (middle >> 16u);
    return vec2u((middle << 16u) | (p0 & 0xffffu), high + a.x * b.y + a.y * b.x);
}

fn shifted(a: vec2u, by: u32) -> vec2u {
    return vec2u((a.x >> by) | (a.y << (32u - by)), a.y >> by);
}

fn mix_long(a: vec2u) -> vec2u {
    var x = times_long(a ^ shifted(a, 30u), vec2u(0x1ce4e5b9u, 0xbf58476du));
    x = times_long(x ^ shifted(x, 27u), vec2u(0x133111ebu, 0x94d049bbu));
    return x ^ shifted(x, 31u);
}

fn quarters(a: vec2u) -> u32 {
    return (a.x & 0xffffu) + (a.x >> 16u) + (a.y & 0xffffu) + (a.y >> 16u);
}

fn normal_number(hash: vec2u) -> f32 {
    let sum = quarters(mix_long(hash ^ vec2u(0x4f6cdd1du, 0x2545f491u)))
        + quarters(mix_long(hash ^ vec2u(0xde82ef95u, 0xd1342543u)));
    return (f32(sum) - 262140.0) * (1.2247449 / 65536.0);
}

// Answer of the sensor to light that returns; `Receiver::detect` in `returns.rs`.
fn notice(range: f32, cosine: f32, reflectance: f32, retro: bool, shot: u32) -> vec3f {
    if range < params.range.x {
        return vec3f(0.0);
    }
    let hash = mix_long(add_long(params.hidden.zw, times_long(vec2u(shot, 0u), vec2u(0x7f4a7c15u, 0x9e3779b9u))));
    var air = 1.0;
    if params.air.x > 0.0 {
        air = exp(-2.0 * params.air.x * range);
    }
    let light = reflectance * select(cosine, params.air.y, retro) * air / (range * range);
    let ratio = light * params.range.w;
    let lost = params.noise.z + (1.0 - params.noise.z) / (1.0 + params.air.z * ratio * ratio);
    if f32(hash.y >> 8u) * (1.0 / 16777216.0) < lost {
        return vec3f(0.0);
    }
    var measured = range;
    if params.noise.x > 0.0 {
        measured += params.noise.x * normal_number(hash);
    }
    if params.noise.y > 0.0 {
        measured = trunc(measured / params.noise.y + 0.5) * params.noise.y;
    }
    let counts = measured >= params.range.x && measured <= params.range.y;
    return vec3f(measured, clamp(light * params.noise.w, 0.0, 1.0), select(0.0, 1.0, counts));
}

// Return of a ray that met something.
fn returned(met: Met, direction: vec3f, shot: u32) -> vec4u {
    let block = met.place / 4u;
    let lane = met.place % 4u;
    var normal = vec3f(blocks[block].normal[0][lane], blocks[block].normal[1][lane],
        blocks[block].normal[2][lane]);
    let surface = surfaces[blocks[block].surface[lane]];
    var instance = surface.x;
    var class_id = surface.y & 255u;
    if met.by != NONE {
        normal = placed[met.by].x * normal.x + placed[met.by].y * normal.y + placed[met.by].z * normal.z;
        instance = placed[met.by].instance;
        if (surface.y & KEEPS_CLASS) == 0u {
            class_id = placed[met.by].class_id;
        }
    }
    let cosine = abs(dot(normal, direction)) * inverseSqrt(dot(normal, normal));
    let seen = notice(met.distance, cosine, bitcast<f32>(surface.z), (surface.y & RETRO) != 0u, shot);
    if seen.z == 0.0 {
        return vec4u(0u);
    }
    return vec4u(bitcast<u32>(seen.x), bitcast<u32>(seen.y), instance, class_id | SEEN);
}

@compute @workgroup_size(8, 8)
fn fire(@builtin(global_invocation_id) id: vec3u) {
    let ring = id.x;
    if ring >= params.counts.y || id.y >= params.counts.x {
        return;
    }
    let column = columns[id.y];
    let beam = beams[ring].xyz;
    let direction = vec3f(dot(column.x.xyz, beam), dot(column.y.xyz, beam), dot(column.z.xyz, beam));
    let origin = vec3f(column.x.w, column.y.w, column.z.w);
    let tops = vec3u(params.counts.z, params.counts.w, column.root.x);
    let met = first_met(ray_of(origin, direction), tops, params.range.z);
    var back = vec4u(0u);
    if met.place != NONE {
        back = returned(met, direction, column.root.y * params.counts.y + ring);
    }
    returns[id.y * params.counts.y + ring] = back;
}

// Invocations that share a column.
const TEAM: u32 = 64u;

var<workgroup> shares: array<u32, TEAM>;

// The sum of what the team has, given to all.
fn sum_of_team(own: u32, member: u32) -> u32 {
    workgroupBarrier();
    shares[member] = own;
    for (var half = TEAM / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if member < half {
            shares[member] += shares[member + half];
        }
    }
    return workgroupUniformLoad(&shares[0]);
}

// The sum of what the members up to this one have.
fn sum_until(own: u32, member: u32) -> u32 {
    workgroupBarrier();
    shares[member] = own;
    for (var reach = 1u; reach < TEAM; reach *= 2u) {
        workgroupBarrier();
        var more = 0u;
        if member >= reach {
            more = shares[member - reach];
        }
        workgroupBarrier();
        shares[member] += more;
    }
    workgroupBarrier();
    return shares[member];
}

// Counts the returns of each column.
@compute @workgroup_size(64)
fn count(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) member: u32) {
    let beam_count = params.counts.y;
    var own = 0u;
    for (var ring = member; ring < beam_count; ring += TEAM) {
        own += (returns[group.x * beam_count + ring].w & SEEN) / SEEN;
    }
    let all = sum_of_team(own, member);
    if member == 0u {
        points[group.x] = all;
    }
}

// Makes points of returns, by column and then by beam, without gaps.
@compute @workgroup_size(64)
fn place(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) member: u32) {
    let beam_count = params.counts.y;
    let rays = params.counts.x * beam_count;
    var own = 0u;
    for (var before = member; before < group.x; before += TEAM) {
        own += points[before];
    }
    var begin = params.counts.x + sum_of_team(own, member);
    let turned = bitcast<vec2f>(columns[group.x].root.zw);
    for (var first = 0u; first < beam_count; first += TEAM) {
        let ring = first + member;
        var back = vec4u(0u);
        if ring < beam_count {
            back = returns[group.x * beam_count + ring];
        }
        let is_seen = (back.w & SEEN) / SEEN;
        let until = sum_until(is_seen, member);
        if is_seen != 0u {
            let range = bitcast<f32>(back.x);
            let beam = beams[ring].xyz;
            let at = begin + until - 1u;
            points[at] = bitcast<u32>((beam.x * turned.y - beam.y * turned.x) * range);
            points[at + rays] = bitcast<u32>((beam.x * turned.x + beam.y * turned.y) * range);
            points[at + 2u * rays] = bitcast<u32>(beam.z * range);
            points[at + 3u * rays] = back.y;
            points[at + 4u * rays] = back.z;
            points[at + 5u * rays] = ring | (back.w & 255u) << 16u;
        }
        begin += workgroupUniformLoad(&shares[TEAM - 1u]);
    }
}
