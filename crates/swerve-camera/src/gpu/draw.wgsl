// From triangles to images, in two steps: which triangle is seen at each pixel, and what it looks like.
//
// `frame` holds records of four-word rows; where they are and what is in them is told by the code that
// writes them. Positions are relative to the centre of the shadow maps' cell.

struct Round {
    // Row of the first sub-frame of this dispatch.
    first_sub_frame: u32,
    sub_frame_rows: u32,
    spare_a: u32,
    spare_b: u32,
}

@group(0) @binding(0) var<storage, read> vertices: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read> triangles: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> frame: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> clusters: array<vec4<u32>>;

@group(1) @binding(0) var<uniform> round: Round;
@group(1) @binding(1) var<storage, read> tiles: array<u32>;
@group(1) @binding(2) var<storage, read> lenses: array<vec2<f32>>;
@group(1) @binding(3) var<storage, read_write> images: array<u32>;
@group(1) @binding(4) var<storage, read_write> kept: array<u32>;
@group(1) @binding(5) var visible: texture_2d_array<u32>;

@group(2) @binding(0) var sun_fixed: texture_2d<f32>;
@group(2) @binding(1) var sun_moving: texture_2d<f32>;
@group(2) @binding(2) var sky_fixed: texture_2d<f32>;
@group(2) @binding(3) var sky_moving: texture_2d<f32>;

const NONE: u32 = 0xffffffffu;

fn row_f(at: u32) -> vec4<f32> {
    return bitcast<vec4<f32>>(frame[at]);
}

// Triangles

struct Drawn {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) id: u32,
}

// A cluster is (record of the item, number of the cluster among all meshes, record of the sub-frame).
@vertex
fn draw(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Drawn {
    let cluster = clusters[instance];
    let k = vertex / 3u;
    let corner = vertex - 3u * k;
    let triangle = triangles[cluster.y * 64u + k];
    let index = select(triangle.x, select(triangle.y, triangle.z, corner == 2u), corner > 0u);
    let p = vec4<f32>(vertices[2u * index].xyz, 1.0);
    let item = cluster.x;
    let at = vec3<f32>(dot(row_f(item), p), dot(row_f(item + 1u), p), dot(row_f(item + 2u), p));
    let sub_frame = cluster.z;
    let seen = vec4<f32>(at - row_f(sub_frame).xyz, 1.0);
    var out: Drawn;
    out.position = vec4<f32>(
        dot(row_f(sub_frame + 1u), seen), dot(row_f(sub_frame + 2u), seen),
        dot(row_f(sub_frame + 3u), seen), dot(row_f(sub_frame + 4u), seen),
    );
    out.id = instance * 64u + k + 1u;
    return out;
}

@fragment
fn mark(in: Drawn) -> @location(0) u32 {
    return in.id;
}

struct Base {
    @builtin(position) position: vec4<f32>,
    @location(0) from_middle: vec2<f32>,
    @location(1) @interpolate(flat) row: u32,
}

// The square around what stands on the ground, in which it hides the sky.
@vertex
fn base(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> Base {
    let row = clusters[instance].x;
    let place = row_f(row);
    let reach = row_f(row + 2u).x;
    let corner = vec2<f32>(select(-1.0, 1.0, (vertex & 1u) == 1u), select(-1.0, 1.0, vertex > 1u && vertex < 5u));
    var out: Base;
    out.from_middle = corner * reach;
    // The map has 1024 texels of 1/8 m.
    out.position = vec4<f32>((place.xy + out.from_middle) * vec2<f32>(1.0, -1.0) / 64.0, 0.5, 1.0);
    out.row = row;
    return out;
}

@fragment
fn hide(in: Base) -> @location(0) vec4<f32> {
    let half = row_f(in.row).zw;
    let turn = row_f(in.row + 1u);
    let more = row_f(in.row + 2u);
    let d = in.from_middle;
    let u = turn.x * d.x + turn.y * d.y;
    let v = turn.z * d.x + turn.w * d.y;
    let o = abs(vec2<f32>(u, v)) - half;
    let outside = length(max(o, vec2<f32>(0.0)));
    let distance = outside + min(max(o.x, o.y), 0.0);
    let fall = more.z;
    let t = unit((fall - distance) / (fall + 0.35));
    let value = floor(more.y * t * t) / 255.0;
    return vec4<f32>(value, 0.0, 0.0, 1.0);
}

// A rectangle of a map that is made empty again: its record holds two corners.
@vertex
fn erase(@builtin(vertex_index) vertex: u32, @builtin(instance_index) instance: u32) -> @builtin(position) vec4<f32> {
    let corners = row_f(clusters[instance].x);
    let x = select(corners.x, corners.z, (vertex & 1u) == 1u);
    let y = select(corners.y, corners.w, vertex > 1u && vertex < 5u);
    return vec4<f32>(x, y, 0.0, 1.0);
}

@fragment
fn nothing() -> @location(0) vec4<f32> {
    return vec4<f32>(0.0);
}

// Pixels
