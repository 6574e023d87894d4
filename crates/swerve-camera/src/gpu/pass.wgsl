// What is seen in each pixel, in which light: behind `shade.wgsl` and `draw.wgsl`.

// Surface that is seen on a ray.
struct Seen {
    // Inverse depth.
    w: f32,
    normal: vec3<f32>,
    uv: vec2<f32>,
    // Record of the surface.
    surface: u32,
}

// A ray from a place along a direction whose depth grows by 1.
struct Ray {
    origin: vec3<f32>,
    along: vec3<f32>,
}

fn ray_of(sub_frame: u32, x: f32, y: f32) -> Ray {
    var ray: Ray;
    ray.along = row_f(sub_frame + 5u).xyz * x + (row_f(sub_frame + 6u).xyz * y + row_f(sub_frame + 7u).xyz);
    ray.origin = row_f(sub_frame + 8u).xyz * x + (row_f(sub_frame + 9u).xyz * y + row_f(sub_frame + 10u).xyz);
    return ray;
}

// Where a ray meets the plane of a triangle, in the frame of its body; normal and texture coordinates only if
// they are `wanted`.
fn meet(id: u32, ray: Ray, wanted: bool) -> Seen {
    let cluster = clusters[id >> 6u];
    let triangle = triangles[cluster.y * 64u + (id & 63u)];
    let item = cluster.x;
    let x = row_f(item);
    let y = row_f(item + 1u);
    let z = row_f(item + 2u);
    let from_place = ray.origin - vec3<f32>(x.w, y.w, z.w);
    let eye = x.xyz * from_place.x + y.xyz * from_place.y + z.xyz * from_place.z;
    let along = x.xyz * ray.along.x + y.xyz * ray.along.y + z.xyz * ray.along.z;
    let a = vertices[2u * triangle.x];
    let b = vertices[2u * triangle.y];
    let c = vertices[2u * triangle.z];
    let p = b.xyz - a.xyz;
    let q = c.xyz - a.xyz;
    let n = cross(p, q);
    let from_eye = a.xyz - eye;
    let height = dot(n, from_eye);
    var seen: Seen;
    seen.w = dot(n, along) / select(height, 1e-20, height == 0.0);
    seen.surface = frame[item + 3u].x + 5u * (triangle.w & 0xffffu);
    if !wanted {
        return seen;
    }
    let d = along / max(seen.w, 1e-6) - from_eye;
    let over = 1.0 / max(dot(n, n), 1e-30);
    let beta = dot(cross(d, q), n) * over;
    let gamma = dot(cross(p, d), n) * over;
    let alpha = 1.0 - beta - gamma;
    let na = vertices[2u * triangle.x + 1u];
    let nb = vertices[2u * triangle.y + 1u];
    let nc = vertices[2u * triangle.z + 1u];
    let mean = na.xyz * alpha + nb.xyz * beta + nc.xyz * gamma;
    let across = vec3<f32>(dot(x.xyz, mean), dot(y.xyz, mean), dot(z.xyz, mean));
    let turned = dot(n, along) > 0.0;
    let size = max(length(across), 1e-20);
    seen.normal = select(across, -across, turned) / size;
    seen.uv = vec2<f32>(
        a.w * alpha + b.w * beta + c.w * gamma, na.w * alpha + nb.w * beta + nc.w * gamma,
    );
    return seen;
}

fn sampled(tile: u32, u: f32, v: f32, footprint: f32) -> f32 {
    let level = mip_level(footprint);
    let tu = texel(level, u);
    let tv = texel(level, v);
    let word = tiles[tile + texel_index(level, tu, tv)];
    return unpack_word(word, tu - floor(tu), tv - floor(tv));
}

fn environment(view: u32) -> Environment {
    var e: Environment;
    let a = row_f(view);
    let b = row_f(view + 1u);
    let c = row_f(view + 2u);
    let d = row_f(view + 3u);
    let f = row_f(view + 4u);
    let g = row_f(view + 5u);
    e.sun = a.xyz;
    e.exposure = a.w;
    e.sunlight = b.xyz;
    e.cloudiness = b.w;
    e.zenith = c.xyz;
    e.wetness = c.w;
    e.horizon = d.xyz;
    e.puddles = d.w;
    e.glow = f.xyz;
    e.rain = f.w;
    e.cloud = g.xyz;
    e.fog_1pm = g.w;
    e.ambient = row_f(view + 6u).xyz;
    e.bounce = row_f(view + 7u).xyz;
    e.fog = row_f(view + 8u).xyz;
    return e;
}

const SKY_SIDE: f32 = 1024.0;
const SUN_SIDE: f32 = 2048.0;

fn hidden_at(x: i32, y: i32, moving: bool) -> f32 {
    var value = textureLoad(sky_fixed, vec2<i32>(x, y), 0).x;
    if moving {
        value = max(value, textureLoad(sky_moving, vec2<i32>(x, y), 0).x);
    }
    return value;
}

// Share of the sky that is open over points near the ground.
fn openness(point: vec3<f32>, height: f32, moving: bool) -> f32 {
    let near = unit(1.0 - height * (1.0 / 0.7));
    if near <= 0.0 {
        return 1.0;
    }
    let x = point.x * 8.0 + (0.5 * SKY_SIDE - 0.5);
    let y = point.y * 8.0 + (0.5 * SKY_SIDE - 0.5);
    if x < 0.0 || y < 0.0 || x > SKY_SIDE - 2.0 || y > SKY_SIDE - 2.0 {
        return 1.0;
    }
    let ix = i32(x);
    let iy = i32(y);
    let tx = x - f32(ix);
    let ty = y - f32(iy);
    let a = hidden_at(ix, iy, moving);
    let b = hidden_at(ix + 1, iy, moving);
    let c = hidden_at(ix, iy + 1, moving);
    let d = hidden_at(ix + 1, iy + 1, moving);
    let low = a + (b - a) * tx;
    let high = c + (d - c) * tx;
    return 1.0 - (low + (high - low) * ty) * near;
}

// Whether the sun is seen past one texel, at a depth in steps of 1/128 m.
fn lit_at(x: i32, y: i32, depth: f32, moving: bool) -> f32 {
    var nearest = textureLoad(sun_fixed, vec2<i32>(x, y), 0).x;
    if moving {
        nearest = max(nearest, textureLoad(sun_moving, vec2<i32>(x, y), 0).x);
    }
    // Nothing is 0; the map spans 8192 m around the centre.
    let step = select(floor(clamp((nearest - 0.5) * (8192.0 * 128.0) + 32768.0, 1.0, 65535.0)), 0.0, nearest <= 0.0);
    return select(0.0, 1.0, step <= depth);
}

// Share of the sun that is seen, filtered over two by two texels.
fn sunshine(view: u32, at: vec3<f32>, normal: vec3<f32>, moving: bool) -> f32 {
    // Off the surface by a texel, so that it does not shadow itself.
    let point = at + normal * 0.09;
    let per_m = SUN_SIDE / 240.0;
    let x = dot(row_f(view + 9u).xyz, point) * per_m + (0.5 * SUN_SIDE - 0.5);
    let y = dot(row_f(view + 10u).xyz, point) * per_m + (0.5 * SUN_SIDE - 0.5);
    if x < 0.0 || y < 0.0 || x > SUN_SIDE - 2.0 || y > SUN_SIDE - 2.0 {
        return 1.0;
    }
    let depth = dot(row_f(view + 11u).xyz, point) * 128.0 + 32772.0;
    let ix = i32(x);
    let iy = i32(y);
    let tx = x - f32(ix);
    let ty = y - f32(iy);
    let a = lit_at(ix, iy, depth, moving);
    let b = lit_at(ix + 1, iy, depth, moving);
    let c = lit_at(ix, iy + 1, depth, moving);
    let d = lit_at(ix + 1, iy + 1, depth, moving);
    let low = a + (b - a) * tx;
    let high = c + (d - c) * tx;
    return low + (high - low) * ty;
}

// The sky in a direction; `focal` is pixels per unit of direction.
fn sky(view: u32, e: Environment, direction: vec3<f32>, focal: f32) -> vec3<f32> {
    let place = cloud_place(direction);
    let grain = place.z * place.z * 400.0 / focal;
    let tile = frame[view + 15u].z;
    let large = sampled(tile, place.x * 0.25, place.y * 0.25, grain * 0.3);
    let small = sampled(tile, place.x, place.y, grain * 4.0);
    return clouded(e, direction, open_sky(e, direction), large, small);
}

// `sends_back` is as rough ground, and into head lamps.
fn lamps_on(
    lamps: vec4<u32>,
    pixel: vec2<f32>,
    point: vec3<f32>,
    normal: vec3<f32>,
    sends_back: vec2<f32>,
) -> vec3<f32> {
    var light = vec3<f32>(0.0);
    for (var k = 0u; k < lamps.y; k++) {
        let row = lamps.x + 4u * k;
        let bounds = row_f(row + 3u);
        if pixel.y < bounds.z || pixel.y > bounds.w || pixel.x < bounds.x || pixel.x > bounds.y {
            continue;
        }
        var lamp: Lamp;
        let a = row_f(row);
        let b = row_f(row + 1u);
        let c = row_f(row + 2u);
        lamp.position = a.xyz;
        lamp.range = a.w;
        lamp.direction = b.xyz;
        lamp.cos_outer = b.w;
        lamp.intensity = c.xyz;
        lamp.over_fall = c.w;
        light += lamp.intensity * lamp_strength(lamp, point, normal, sends_back.y, sends_back.x);
    }
    return light;
}

fn surface_light(sub_frame: u32, view: u32, e: Environment, ray: Ray, pixel: vec2<f32>, seen: Seen) -> vec3<f32> {
    let switches = frame[view + 12u];
    let focal = row_f(sub_frame + 5u).w;
    let z = 1.0 / max(seen.w, 1e-6);
    let size = length(ray.along);
    let direction = ray.along / size;
    let point = ray.origin + ray.along * z;
    let facing = max(-dot(seen.normal, direction), 0.02);
    // Length of a pixel on the surface, squared, as a mean over both directions.
    let pixel_m = select(z, 1.0, (switches.x & 4u) != 0u) / focal;
    let footprint = pixel_m * pixel_m / facing;

    let row = seen.surface;
    let n0 = row_f(row);
    let n1 = row_f(row + 1u);
    let n2 = row_f(row + 2u);
    let n3 = row_f(row + 3u);
    let more = frame[row + 4u];
    var albedo = n0.xyz;
    if (more.y & 1u) != 0u {
        let tiles_per_m = n2.w;
        let side = tiles_per_m * 256.0;
        let t = sampled(more.x, seen.uv.x * tiles_per_m, seen.uv.y * tiles_per_m, footprint * side * side);
        albedo += vec3<f32>(n0.w, n1.x, n1.y) * t;
    }
    var polish = n2.z;
    var specular = n2.y;
    if (more.y & 4u) != 0u {
        let stain = sampled(frame[view + 15u].w, point.x / 16.0, point.y / 16.0, footprint * 256.0);
        let tone = ground_tone(e, stain, seen.normal.z, n3.x);
        albedo *= tone.x;
        polish = max(polish, tone.y);
        specular += tone.z;
    }
    let moving = (switches.x & 2u) != 0u;
    let open = openness(point, point.z + row_f(view + 11u).w, moving);
    let cosine = max(dot(seen.normal, e.sun), 0.0);
    var sun = 0.0;
    if (switches.x & 1u) != 0u && cosine > 0.0 {
        sun = cosine * sunshine(view, point, seen.normal, moving);
    }
    var light = daylight(e, seen.normal, sun, open);
    let lamps = frame[sub_frame + 15u];
    if lamps.y > 0u {
        light += lamps_on(lamps, pixel, point, seen.normal, n3.xy);
    }
    var colour = albedo * light;
    if (more.y & 2u) != 0u || ((more.y & 4u) != 0u && e.wetness > 0.0) {
        var gloss: Gloss;
        gloss.polish = polish;
        gloss.specular = specular;
        gloss.sharp = sun / max(cosine, 0.05);
        gloss.open = open;
        let mirror = mirrored(e, seen.normal, direction, facing, gloss);
        colour = colour * (1.0 - mirror.w) + mirror.xyz;
    }
    if (more.y & 8u) != 0u {
        colour += vec3<f32>(n1.z, n1.w, n2.x);
    }
    return blend(e.fog, colour, through_fog(e.fog_1pm * size * z));
}

// Answer of the sensor to a colour: three bytes.
fn exposed(view: u32, e: Environment, light: vec3<f32>, column: u32, row: u32) -> u32 {
    let optics = row_f(view + 13u);
    let grain = row_f(view + 14u);
    var gain = e.exposure;
    if optics.x > 0.0 {
        let down = row_f(view + 10u).w;
        gain *= vignette(optics.x, f32(column) * optics.y + optics.z, f32(row) * optics.w + down);
    }
    var colour = light;
    if e.rain > 0.0 {
        var streak = 0.0;
        let keys = frame[view + 12u];
        for (var layer = 0u; layer < 2u; layer++) {
            let at = streak_index(column, row, 2u + layer, select(keys.y, keys.z, layer == 1u));
            streak += f32(tiles[keys.w + at] & 255u) * (1.0 / 255.0);
        }
        colour = rained(colour, (e.horizon + 0.02) * (0.16 * e.rain), streak);
    }
    var signal = colour * gain;
    if grain.x > 0.0 || grain.y > 0.0 {
        let words = frame[view + 14u];
        let bits = noise_bits(words.z, column, row);
        for (var k = 0u; k < 3u; k++) {
            let draw = bitcast<f32>(tiles[words.w + ((bits >> (10u * k)) & 1023u)]);
            signal[k] += deviation(signal[k], grain.x, grain.y) * draw;
        }
    }
    return tone(signal.x) | (tone(signal.y) << 8u) | (tone(signal.z) << 16u);
}

// Shades the pixels of sub-frames, 64 in a block. Depths and instances go to their images at once; colours and
// classes, which are smaller than a word, wait side by side in `kept` for `pack`.
@compute @workgroup_size(64)
fn shade(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let sub_frame = round.first_sub_frame + group.y * round.sub_frame_rows;
    let place = frame[sub_frame + 11u];
    let rows = frame[sub_frame + 12u];
    let planes = frame[sub_frame + 13u];
    let lens = frame[sub_frame + 14u];
    let first = rows.x * place.z;
    let count = (rows.y - rows.x) * place.z;
    let own = (group.x + group.z * 32768u) * 64u + lane;
    if own >= count {
        return;
    }
    let is_last = rows.z + 1u == rows.w;
    let gives_ids = rows.z == rows.w / 2u;
    // The part of the word that this sub-frame does not write stays.
    let kept_at = lens.y + first + own;
    var word = 0u;
    if rows.w > 1u {
        word = kept[kept_at];
    }
    let pixel = first + own;
    let column = pixel % place.z;
    let row = pixel / place.z;
    var at = vec2<f32>(f32(column), f32(row));
    var texel_at = vec2<u32>(column, row - rows.x);
    if lens.x != NONE {
        at = lenses[lens.x + pixel];
        texel_at = vec2<u32>(u32(at.x + 0.5), u32(at.y + 0.5));
    }
    let ray = ray_of(sub_frame, at.x, at.y);
    let marked = textureLoad(visible, vec2<i32>(texel_at), i32(place.x), 0).x;
    var seen: Seen;
    if marked != 0u {
        seen = meet(marked - 1u, ray, planes.x != NONE);
    }
    if gives_ids {
        var class_id = 23u;
        var instance_id = 0u;
        var depth = 0x7f800000u;
        if marked != 0u {
            let words = frame[seen.surface + 4u];
            class_id = words.z;
            instance_id = words.w;
            var w = seen.w;
            if lens.x != NONE {
                let near = meet(marked - 1u, ray_of(sub_frame, f32(texel_at.x), f32(texel_at.y)), false).w;
                w = clamp(w, 0.67 * near, 1.5 * near);
            }
            depth = bitcast<u32>(1.0 / w);
        }
        if planes.y != NONE {
            images[planes.y + pixel] = depth;
        }
        if planes.w != NONE {
            images[planes.w + pixel] = instance_id;
        }
        word = (word & 0xffffffu) | (class_id << 24u);
    }
    if planes.x != NONE {
        let view = frame[sub_frame + 15u].z;
        let e = environment(view);
        var colour: vec3<f32>;
        if marked != 0u {
            colour = surface_light(sub_frame, view, e, ray, at, seen);
        } else {
            colour = sky(view, e, normalize(ray.along), row_f(sub_frame + 5u).w);
        }
        if rows.w > 1u {
            let sum = lens.w + 3u * pixel;
            if rows.z > 0u {
                colour += bitcast<vec3<f32>>(vec3<u32>(kept[sum], kept[sum + 1u], kept[sum + 2u]));
            }
            kept[sum] = bitcast<u32>(colour.x);
            kept[sum + 1u] = bitcast<u32>(colour.y);
            kept[sum + 2u] = bitcast<u32>(colour.z);
            colour *= 1.0 / f32(rows.w);
        }
        if is_last {
            word = (word & 0xff000000u) | exposed(view, e, colour, column, row);
        }
    }
    if planes.x != NONE || planes.z != NONE {
        kept[kept_at] = word;
    }
}

// Packs the colours and classes of sub-frames, four pixels by each.
@compute @workgroup_size(64)
fn pack(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let sub_frame = round.first_sub_frame + group.y * round.sub_frame_rows;
    let place = frame[sub_frame + 11u];
    let rows = frame[sub_frame + 12u];
    let planes = frame[sub_frame + 13u];
    let count = (rows.y - rows.x) * place.z;
    let own = ((group.x + group.z * 32768u) * 64u + lane) * 4u;
    if own >= count || rows.z + 1u != rows.w {
        return;
    }
    // Slabs begin at whole fours; what is behind the last pixel is nobody's.
    let from_pixel = rows.x * place.z + own;
    let at = frame[sub_frame + 14u].y + from_pixel;
    let a = kept[at];
    let b = kept[at + 1u];
    let c = kept[at + 2u];
    let d = kept[at + 3u];
    if planes.x != NONE {
        let to = planes.x + from_pixel / 4u * 3u;
        images[to] = (a & 0xffffffu) | (b << 24u);
        images[to + 1u] = ((b >> 8u) & 0xffffu) | (c << 16u);
        images[to + 2u] = ((c >> 16u) & 0xffu) | (d << 8u);
    }
    if planes.z != NONE {
        images[planes.z + from_pixel / 4u] =
            (a >> 24u) | ((b >> 24u) << 8u) | ((c >> 24u) << 16u) | (d & 0xff000000u);
    }
}
