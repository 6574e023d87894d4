//! Orientation of photographs: cameras store the rows of their sensor and record the rotation of the image in its EXIF
//! data.
//! Source: CIPA DC-008, "Exchangeable image file format for digital still cameras: Exif", version 2.32, section 4.6.4,
//! tag 274.
//! 274.

/// Tag of the orientation.
const ORIENTATION: u16 = 274;
/// Type of its value: 16-bit integer.
const SHORT: u16 = 3;

/// Orientation by EXIF data, 1 to 8; 1 (unchanged) if missing.
pub(crate) fn orientation(exif: &[u8]) -> u16 {
    value(exif).filter(|value| (1..=8).contains(value)).unwrap_or(1)
}

fn value(exif: &[u8]) -> Option<u16> {
    let is_big_endian = match exif.get(..4)? {
        b"II*\0" => false,
        b"MM\0*" => true,
        _ => return None,
    };
    let short = |at: usize| {
        let bytes = exif.get(at..at.checked_add(2)?)?.try_into().ok()?;
        Some(if is_big_endian { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    };
    let long = |at: usize| {
        let (first, second) = (u32::from(short(at)?), u32::from(short(at.checked_add(2)?)?));
        Some(if is_big_endian { first << 16 | second } else { second << 16 | first })
    };
    let directory = usize::try_from(long(4)?).ok()?;
    let entries = usize::from(short(directory)?);
    let mut entries = (0..entries).map_while(|k| directory.checked_add(2 + 12 * k));
    let entry = entries.find(|at| short(*at) == Some(ORIENTATION))?;
    (short(entry + 2)? == SHORT).then(|| short(entry + 8)).flatten()
}

/// Rotates and mirrors an image of three bytes per pixel so that its first row is the top.
pub(crate) fn upright(
    [width, height]: [usize; 2],
    bytes: Vec<u8>,
    orientation: u16,
) -> ([usize; 2], Vec<u8>) {
    if !(2..=8).contains(&orientation) {
        return ([width, height], bytes);
    }
    let (right, bottom) = (width.saturating_sub(1), height.saturating_sub(1));
    let size = if orientation < 5 { [width, height] } else { [height, width] };
    // Column and row of the sensor for a column and row of the upright image.
    let of = |x: usize, y: usize| match orientation {
        2 => (right - x, y),
        3 => (right - x, bottom - y),
        4 => (x, bottom - y),
        5 => (y, x),
        6 => (y, bottom - x),
        7 => (right - y, bottom - x),
        _ => (right - y, x),
    };
    let mut turned = Vec::with_capacity(bytes.len());
    for y in 0..size[1] {
        for x in 0..size[0] {
            let (column, row) = of(x, y);
            turned.extend_from_slice(&bytes[3 * (row * width + column)..][..3]);
        }
    }
    (size, turned)
}

#[cfg(test)]
mod tests {
    use super::super::Picture;
    use super::*;

    /// EXIF data with one entry before the orientation.
    fn exif(orientation: u16, is_big_endian: bool) -> Vec<u8> {
        let short = |x: u16| if is_big_endian { x.to_be_bytes() } else { x.to_le_bytes() };
        let long = |x: u32| if is_big_endian { x.to_be_bytes() } else { x.to_le_bytes() };
        let mut bytes = if is_big_endian { b"MM\0*".to_vec() } else { b"II*\0".to_vec() };
        bytes.extend(long(10));
        bytes.extend([0, 0]);
        bytes.extend(short(2));
        for (tag, value) in [(256, 7), (ORIENTATION, orientation)] {
            bytes.extend([short(tag), short(SHORT)].concat());
            bytes.extend(long(1));
            bytes.extend([short(value), short(0)].concat());
        }
        bytes.extend(long(0));
        bytes
    }

    #[test]
    fn orientation_is_read_in_both_byte_orders_and_from_nothing_else() {
        for is_big_endian in [false, true] {
            for value in 1..=8 {
                assert_eq!(orientation(&exif(value, is_big_endian)), value);
            }
            assert_eq!(orientation(&exif(9, is_big_endian)), 1);
            let whole = exif(6, is_big_endian);
            (0..32).for_each(|len| assert_eq!(orientation(&whole[..len]), 1, "{len}"));
        }
        assert_eq!(orientation(b"MM\0*\xff\xff\xff\xff"), 1);
    }

    /// Figure of the standard: the letter F, three by five, as stored with each orientation.
    const F: [(u16, [&str; 5]); 8] = [
        (1, ["###", "#..", "##.", "#..", "#.."]),
        (2, ["###", "..#", ".##", "..#", "..#"]),
        (3, ["..#", "..#", ".##", "..#", "###"]),
        (4, ["#..", "#..", "##.", "#..", "###"]),
        (5, ["#####", "#.#..", "#....", "", ""]),
        (6, ["#....", "#.#..", "#####", "", ""]),
        (7, ["....#", "..#.#", "#####", "", ""]),
        (8, ["#####", "..#.#", "....#", "", ""]),
    ];

    #[test]
    fn all_orientations_of_a_file_give_the_same_upright_image() {
        let folder = tempfile::tempdir().unwrap();
        let pixels = |rows: &[&str]| -> Vec<u8> {
            rows.concat().bytes().flat_map(|pixel| [if pixel == b'#' { 9 } else { 200 }; 3]).collect()
        };
        for (value, rows) in F {
            let rows: Vec<&str> = rows.into_iter().filter(|row| !row.is_empty()).collect();
            let file = folder.path().join(format!("{value}.png"));
            let mut info = png::Info::with_size(rows[0].len() as u32, rows.len() as u32);
            (info.color_type, info.bit_depth) = (png::ColorType::Rgb, png::BitDepth::Eight);
            info.exif_metadata = Some(exif(value, value % 2 == 0).into());
            let out = std::fs::File::create(&file).unwrap();
            let mut writer = png::Encoder::with_info(out, info).unwrap().write_header().unwrap();
            writer.write_image_data(&pixels(&rows)).unwrap();
            writer.finish().unwrap();
            let picture = Picture::read(&file, crate::picture::MEGAPIXELS_MAX).unwrap();
            assert_eq!(picture.size, [3, 5], "{value}");
            assert_eq!(picture.bytes, pixels(&F[0].1), "{value}");
        }
    }
}
