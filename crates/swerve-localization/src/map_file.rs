//! Voxel map files, in tiles, so that a region can be located without reading the rest.
//!
//! ```text
//! "SWERVEVX"  version u32  tiles u32  resolution_m f64  tile_m f64
//! tiles:  x i32  y i32  voxels u32                      by x, then y
//! voxels: index 3 x i32  count u32  mean 3 x f32  covariance 6 x f32    tile by tile, by index
//! digest u64: FNV-1a over all before it
//! ```
//!
//! All numbers are little-endian. A map has a unique form: reading and writing it again gives the same bytes.

use thiserror::Error;

use crate::grid::REACH;
use crate::voxels::{POINTS_MIN, Voxel};

/// First bytes of a file.
const MAGIC: &[u8; 8] = b"SWERVEVX";
/// Version of the format.
pub const VERSION: u32 = 1;
/// Edge of a tile, in voxels.
const TILE_VOXELS: i32 = 64;
/// Half the edge of the square that is searched for the ground, metres.
const GROUND_M: f64 = 3.0;
const HEAD: usize = 32;
const TILE: usize = 12;
const VOXEL: usize = 52;
const DIGEST: usize = 8;

/// Content of a voxel map file.
#[derive(Clone, PartialEq, Debug)]
pub struct MapFile {
    /// Edge of a voxel, metres.
    pub resolution_m: f64,
    /// Voxels with a surface, sorted as by [`MapFile::new`].
    voxels: Vec<Voxel>,
}

/// Error of reading a map.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum MapError {
    /// The first bytes are different.
    #[error("expected a voxel map of Swerve: it begins otherwise")]
    Magic,
    /// The version is not supported.
    #[error(
        "expected a voxel map of version {VERSION}, found version {0}: build it again with `swerve map build`"
    )]
    Version(u32),
    /// The length does not match the header.
    #[error("truncated or damaged: its header makes {expected} bytes, it has {found}")]
    Length {
        /// Length according to the header, bytes.
        expected: u64,
        /// Actual length, bytes.
        found: u64,
    },
    /// The digest does not match the contents.
    #[error("damaged: its digest is {expected:016x}, that of its bytes {found:016x}")]
    Digest {
        /// Digest in the file.
        expected: u64,
        /// Digest of the contents.
        found: u64,
    },
    /// The digest matches, but the contents are invalid.
    #[error("no map: {0}")]
    Content(&'static str),
}

impl MapFile {
    /// Creates a map of these voxels.
    pub fn new(resolution_m: f64, mut voxels: Vec<Voxel>) -> Self {
        voxels.sort_unstable_by_key(|voxel| (tile(voxel), voxel.index));
        Self { resolution_m, voxels }
    }

    /// Voxels, tile by tile.
    pub fn voxels(&self) -> &[Voxel] {
        &self.voxels
    }

    /// Height of the ground at a position: that of the lowest surface within 3 m along each axis; `None` if there is
    /// none.
    pub fn ground_m(&self, [x_m, y_m]: [f64; 2]) -> Option<f64> {
        let at = |index: i32, mean_m: f32| (f64::from(index) + 0.5) * self.resolution_m + f64::from(mean_m);
        let near = self.voxels.iter().filter_map(|Voxel { index, mean_m, .. }| {
            let away = [at(index[0], mean_m[0]) - x_m, at(index[1], mean_m[1]) - y_m];
            let is_near = away.iter().all(|away_m| away_m.abs() <= GROUND_M);
            is_near.then(|| at(index[2], mean_m[2]))
        });
        near.min_by(f64::total_cmp)
    }

    /// Number of tiles.
    pub fn tiles(&self) -> usize {
        self.voxels.chunk_by(|a, b| tile(a) == tile(b)).count()
    }

    /// Serializes the map to the bytes of its file.
    pub fn write(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        let tiles: Vec<_> = self.voxels.chunk_by(|a, b| tile(a) == tile(b)).collect();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((tiles.len() as u32).to_le_bytes());
        bytes.extend(self.resolution_m.to_le_bytes());
        bytes.extend((self.resolution_m * f64::from(TILE_VOXELS)).to_le_bytes());
        for of in &tiles {
            let place = tile(&of[0]);
            place.into_iter().for_each(|i| bytes.extend(i.to_le_bytes()));
            bytes.extend((of.len() as u32).to_le_bytes());
        }
        for voxel in &self.voxels {
            voxel.index.into_iter().for_each(|i| bytes.extend(i.to_le_bytes()));
            bytes.extend(voxel.count.to_le_bytes());
            voxel.mean_m.into_iter().for_each(|x| bytes.extend(x.to_le_bytes()));
            voxel.covariance_m2.into_iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        }
        bytes.extend(digest(&bytes).to_le_bytes());
        bytes
    }

    /// Parses the bytes of a map file.
    ///
    /// # Errors
    /// If the version is different, the length is wrong, the digest does not match, or the contents are invalid.
    pub fn read(bytes: &[u8]) -> Result<Self, MapError> {
        if bytes.len() < MAGIC.len() || bytes[..MAGIC.len()] != *MAGIC {
            return Err(MapError::Magic);
        }
        let found = bytes.len() as u64;
        let mut head = Cursor(bytes.get(8..).unwrap_or_default());
        let short = || MapError::Length { expected: (HEAD + DIGEST) as u64, found };
        let version = u32::from_le_bytes(head.take().ok_or_else(short)?);
        if version != VERSION {
            return Err(MapError::Version(version));
        }
        let tiles = u32::from_le_bytes(head.take().ok_or_else(short)?);
        let resolution_m = f64::from_le_bytes(head.take().ok_or_else(short)?);
        let tile_m = f64::from_le_bytes(head.take().ok_or_else(short)?);
        // The length is checked before memory is allocated: a count may have any value.
        let places: u64 = HEAD as u64 + u64::from(tiles) * TILE as u64;
        let mut expected = places + DIGEST as u64;
        if found < expected {
            return Err(MapError::Length { expected, found });
        }
        let mut table = Vec::with_capacity(tiles as usize);
        for _ in 0..tiles {
            let (x, y) = (head.take().ok_or_else(short)?, head.take().ok_or_else(short)?);
            let count = u32::from_le_bytes(head.take().ok_or_else(short)?);
            expected += u64::from(count) * VOXEL as u64;
            table.push(([i32::from_le_bytes(x), i32::from_le_bytes(y)], count));
        }
        if found != expected {
            return Err(MapError::Length { expected, found });
        }
        let (body, end) = bytes.split_at(bytes.len() - DIGEST);
        let (of_file, of_bytes) = (u64::from_le_bytes(end.try_into().unwrap_or_default()), digest(body));
        if of_file != of_bytes {
            return Err(MapError::Digest { expected: of_file, found: of_bytes });
        }
        if !((0.01..=100.0).contains(&resolution_m) && tile_m == resolution_m * f64::from(TILE_VOXELS)) {
            return Err(MapError::Content("expected voxels of 0.01 to 100 m, and 64 of them along a tile"));
        }
        let mut voxels = Vec::new();
        for (place, count) in table {
            for _ in 0..count {
                let voxel = voxel(&mut head).ok_or(MapError::Content("a voxel ends early"))?;
                if tile(&voxel) != place {
                    return Err(MapError::Content("a voxel lies in another tile than its own"));
                }
                voxels.push(voxel);
            }
        }
        let in_order = voxels.is_sorted_by(|a, b| (tile(a), a.index) < (tile(b), b.index));
        if !in_order {
            return Err(MapError::Content("expected tiles and voxels in order, each once"));
        }
        if !voxels.iter().all(|voxel| is_sound(voxel, resolution_m)) {
            return Err(MapError::Content("a voxel's mean or covariance does not fit points inside it"));
        }
        Ok(Self { resolution_m, voxels })
    }
}

/// Tile of a voxel.
fn tile(voxel: &Voxel) -> [i32; 2] {
    [0, 1].map(|axis| voxel.index[axis].div_euclid(TILE_VOXELS))
}

fn voxel(from: &mut Cursor<'_>) -> Option<Voxel> {
    let mut index = [0; 3];
    for i in &mut index {
        *i = i32::from_le_bytes(from.take()?);
    }
    let count = u32::from_le_bytes(from.take()?);
    let (mut mean_m, mut covariance_m2) = ([0.0; 3], [0.0; 6]);
    for x in mean_m.iter_mut().chain(&mut covariance_m2) {
        *x = f32::from_le_bytes(from.take()?);
    }
    Some(Voxel { index, count, mean_m, covariance_m2 })
}

/// Returns true if points in a cube can have these moments.
fn is_sound(voxel: &Voxel, resolution_m: f64) -> bool {
    let within = |x: &f32, most: f64| f64::from(*x).abs() <= most;
    voxel.index.iter().all(|i| i.unsigned_abs() <= REACH.unsigned_abs())
        && voxel.count >= POINTS_MIN
        && voxel.mean_m.iter().all(|x| within(x, 0.51 * resolution_m))
        && voxel.covariance_m2.iter().all(|x| within(x, resolution_m * resolution_m))
}

fn digest(bytes: &[u8]) -> u64 {
    let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, step)
}

/// Reads bytes from the front.
struct Cursor<'a>(&'a [u8]);

impl Cursor<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*first)
    }
}

#[cfg(test)]
mod tests;
