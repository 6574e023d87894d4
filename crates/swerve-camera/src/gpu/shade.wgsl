// Light, one pixel at a time: functions of their arguments alone, the same as those of the back end for CPUs.
//
// Radiances are relative to white paper in full sun; directions are of the map frame.

struct Environment {
    sun: vec3<f32>,
    exposure: f32,
    sunlight: vec3<f32>,
    cloudiness: f32,
    zenith: vec3<f32>,
    wetness: f32,
    horizon: vec3<f32>,
    puddles: f32,
    glow: vec3<f32>,
    rain: f32,
    cloud: vec3<f32>,
    fog_1pm: f32,
    ambient: vec3<f32>,
    bounce: vec3<f32>,
    fog: vec3<f32>,
}

struct Lamp {
    position: vec3<f32>,
    range: f32,
    direction: vec3<f32>,
    cos_outer: f32,
    intensity: vec3<f32>,
    over_fall: f32,
}

fn root(x: f32) -> f32 {
    return pow(x, 0.5);
}

fn unit(x: f32) -> f32 {
    return clamp(x, 0.0, 1.0);
}

fn blend(a: vec3<f32>, b: vec3<f32>, t: f32) -> vec3<f32> {
    return a + (b - a) * t;
}

// Mixes 32 bits.
fn mix_bits(bits: u32) -> u32 {
    var x = bits;
    x = x ^ (x >> 16u);
    x = x * 0x7feb352du;
    x = x ^ (x >> 15u);
    x = x * 0x846ca68bu;
    return x ^ (x >> 16u);
}

fn one_if(condition: bool) -> u32 {
    return select(0u, 1u, condition);
}

// Mip level for a footprint in texels squared: half its binary exponent, rounded up, at most 8.
fn mip_level(footprint: f32) -> u32 {
    return one_if(footprint >= 2.0) + one_if(footprint >= 8.0) + one_if(footprint >= 32.0)
        + one_if(footprint >= 128.0) + one_if(footprint >= 512.0) + one_if(footprint >= 2048.0)
        + one_if(footprint >= 8192.0) + one_if(footprint >= 32768.0);
}

// First word of a level within a tile of 256 x 256: the levels before it are a geometric series.
fn level_offset(level: u32) -> u32 {
    return (262144u - (262144u >> (2u * level))) / 3u;
}

// A texture coordinate in texels of a level, from the centre of the first.
fn texel(level: u32, t: f32) -> f32 {
    return clamp(t, -20000.0, 20000.0) * f32(256u >> level) - 0.5;
}

// Number of the word of a texel within its tile.
fn texel_index(level: u32, u: f32, v: f32) -> u32 {
    let shift = 8u - level;
    let mask = (1u << shift) - 1u;
    let iu = u32(i32(floor(u))) & mask;
    let iv = u32(i32(floor(v))) & mask;
    return level_offset(level) + ((iv << shift) | iu);
}

// Bilinear mean of the four bytes of a word, between 0 and 1.
fn unpack_word(word: u32, tu: f32, tv: f32) -> f32 {
    let a = f32(word & 255u);
    let b = f32((word >> 8u) & 255u);
    let c = f32((word >> 16u) & 255u);
    let d = f32(word >> 24u);
    let low = a + (b - a) * tu;
    let high = c + (d - c) * tu;
    return (low + (high - low) * tv) * (1.0 / 255.0);
}

// How wet ground changes: tone of its colour, polish and specular reflectance at least.
fn ground_tone(e: Environment, stain: f32, up: f32, ground: f32) -> vec3<f32> {
    let wet = ground * e.wetness;
    let level = 0.72 - 0.42 * e.puddles;
    let flatness = unit((up - 0.9) * 20.0);
    let puddle = unit((stain - level) * 9.0) * wet * flatness;
    let tone = 1.0 + ground * (stain - 0.5) * 0.7;
    let darker = tone * (1.0 - wet * 0.45) * (1.0 - puddle * 0.5);
    return vec3<f32>(darker, max(wet * 0.25, puddle * 0.95), puddle * 0.02);
}

// Light on a surface from sun, sky and ground; `sun` is the cosine times the share that is seen.
fn daylight(e: Environment, normal: vec3<f32>, sun: f32, open: f32) -> vec3<f32> {
    let up = (normal.z * 0.5 + 0.5) * open;
    let down = (0.5 - normal.z * 0.5) * (open * 0.7 + 0.3);
    return e.sunlight * sun + e.ambient * up + e.bounce * down;
}

// Share of a lamp's light that a surface reflects. The grains of `ground` stand up into light that comes along it.
fn lamp_strength(lamp: Lamp, point: vec3<f32>, normal: vec3<f32>, retro: f32, ground: f32) -> f32 {
    let to_lamp = lamp.position - point;
    let square = max(dot(to_lamp, to_lamp), 0.04);
    let over = 1.0 / root(square);
    let cone = 0.0 - dot(to_lamp, lamp.direction) * over;
    let beam = unit((cone - lamp.cos_outer) * lamp.over_fall);
    let cosine = max(dot(to_lamp, normal) * over, 0.2 * ground);
    let fade = unit(1.0 - square * (1.0 / (lamp.range * lamp.range)));
    // A lamp has a size: near it the light no longer grows with the inverse square.
    let spread = 1.0 / (square + 9.0);
    return beam * beam * fade * spread * (cosine + retro * 2.5);
}

struct Gloss {
    polish: f32,
    specular: f32,
    // Sunlight over the cosine of its incidence.
    sharp: f32,
    open: f32,
}

// Light that a polished surface mirrors, and its share of all light.
fn mirrored(e: Environment, normal: vec3<f32>, direction: vec3<f32>, facing: f32, gloss: Gloss) -> vec4<f32> {
    let out = direction + normal * (facing + facing);
    let base = 1.0 - min(facing, 1.0);
    let square = base * base;
    let fresnel = gloss.specular + (1.0 - gloss.specular) * (square * square * base);
    let share = fresnel * gloss.polish * gloss.open;
    // Sky above, a dark band of houses and trees at the horizon, the ground below.
    let sky = blend(e.horizon, e.zenith, root(max(out.z, 0.0)));
    let rim = unit((out.z - 0.08) * 7.0);
    let seen = blend(e.bounce * 1.6, sky, rim);
    let near = max(dot(out, e.sun), 0.0);
    let n2 = near * near;
    let n4 = n2 * n2;
    let n8 = n4 * n4;
    let n32 = n8 * n8 * n8 * n8;
    let wide = n8 * n2;
    let spot = n32 * n32 * 9.0 * gloss.polish + n32 * 2.0 + wide * 0.2;
    let glint = spot * gloss.polish * gloss.polish * gloss.sharp;
    return vec4<f32>(seen * share + e.sunlight * (glint * fresnel), share);
}

// Share of the light that fog lets through: Beer's law; exp(-x) by its series in the denominator.
fn through_fog(x: f32) -> f32 {
    return 1.0 / (1.0 + x * (1.0 + x * (0.5 + x * (1.0 / 6.0 + x * (1.0 / 24.0)))));
}

// The sky without clouds and haze.
fn open_sky(e: Environment, direction: vec3<f32>) -> vec3<f32> {
    let gradient = blend(e.horizon, e.zenith, root(max(direction.z, 0.0)));
    let near = max(dot(direction, e.sun), 0.0);
    let n2 = near * near;
    let n4 = n2 * n2;
    let n8 = n4 * n4;
    let n16 = n8 * n8;
    let n32 = n16 * n16;
    let n64 = n32 * n32;
    let n128 = n64 * n64;
    let n256 = n128 * n128;
    let n512 = n256 * n256;
    let n1024 = n512 * n512;
    let disc = select(0.0, 12.0, near > 0.99996);
    let halo = n4 * 0.10 + n64 * 0.35 + n1024 * 1.2;
    return gradient + e.glow * (halo + disc * (1.0 - e.cloudiness));
}

// Where a direction meets the layer of clouds, in tiles, and tiles per unit of direction.
fn cloud_place(direction: vec3<f32>) -> vec3<f32> {
    let over = 0.55 / (max(direction.z, 0.0) + 0.09);
    return vec3<f32>(direction.x * over, direction.y * over, over);
}

// Clouds of two sizes and haze before the sky.
fn clouded(e: Environment, direction: vec3<f32>, sky: vec3<f32>, large: f32, small: f32) -> vec3<f32> {
    let density = large * 0.72 + small * 0.28;
    let level = 0.66 - 0.46 * e.cloudiness;
    let cover = unit((density - level) * 5.0) * unit(max(direction.z, 0.0) * 9.0);
    let shade = 1.08 - unit((density - level) * 2.2) * 0.42;
    let colour = blend(sky, e.cloud * shade, cover * 0.92);
    // Haze towards the horizon, more of it in fog.
    let haze = max(1.0 / (1.0 + 60.0 * e.fog_1pm), 0.05);
    let thin = unit(direction.z * (9.0 * haze) + 0.25 * haze);
    return blend(e.fog, colour, thin);
}

// Fall-off towards the corners: a share of the light, `u` and `v` over focal length.
fn vignette(strength: f32, u: f32, v: f32) -> f32 {
    let fall = 1.0 / (1.0 + u * u + v * v);
    return 1.0 + strength * (fall * fall - 1.0);
}

// Word of a layer of rain streaks within its tile.
fn streak_index(column: u32, row: u32, size: u32, offset: u32) -> u32 {
    let x = (column * size / 4u + row / 24u + (offset & 255u)) & 255u;
    let y = (row * size / 5u + ((offset >> 8u) & 255u)) & 255u;
    return y * 256u + x;
}

// Rain before a colour; `streak` from 0 to 2.
fn rained(colour: vec3<f32>, rain: vec3<f32>, streak: f32) -> vec3<f32> {
    return colour * (1.0 - streak * 0.12) + rain * streak;
}

// Standard deviation of a signal by read-out and photons.
fn deviation(signal: f32, read: f32, shot: f32) -> f32 {
    return root(read * read + shot * shot * max(signal, 0.0));
}

// Hash of a pixel's noise.
fn noise_bits(key: u32, column: u32, row: u32) -> u32 {
    return mix_bits((key ^ (row * 0x9e3779b9u)) + column);
}

// Tone curve, 0 to 255: a filmic one followed by that of sRGB.
fn tone(x: f32) -> u32 {
    let t = root(clamp(x, 0.0, 64.0));
    let up = t * (t * 0.99746 - 0.017452);
    let down = t * (t - 0.088746) + 0.167746;
    return u32(unit(up / down) * 255.0 + 0.5);
}
