use nalgebra::Vector3;

use super::{PlyError, read};

const TEXT: &str = "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 2\nproperty float x\nproperty uchar ring\n\
                    property double y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
                    1.5 7 -2 3\n4 8 5 6e1\n3 0 1 1\n";

fn binary() -> Vec<u8> {
    let mut bytes =
        TEXT.split("1.5 7").next().unwrap_or_default().replace("ascii", "binary_little_endian").into_bytes();
    for (x, ring, y, z) in [(1.5_f32, 7_u8, -2.0_f64, 3.0_f32), (4.0, 8, 5.0, 60.0)] {
        bytes.extend(x.to_le_bytes());
        bytes.push(ring);
        bytes.extend(y.to_le_bytes());
        bytes.extend(z.to_le_bytes());
    }
    bytes
}

/// A header with a list among the properties of vertices and an element before them, and the body in a byte order.
fn with_lists(form: &str, ending: &str, is_big: bool) -> Vec<u8> {
    let header = [
        "ply",
        &format!("format {form} 1.0"),
        "comment with element vertex 9 in it",
        "obj_info a scanner",
        "element face 2",
        "property uchar flags",
        "property list uint8 int32 vertex_indices",
        "element sensor 1",
        "property double time_s",
        "element vertex 2",
        "property double x",
        "property list ushort short echoes",
        "property float64 y",
        "property int z",
        "element edge 1",
        "property int vertex1",
        "end_header",
        "",
    ];
    let mut bytes = header.join(ending).into_bytes();
    if form == "ascii" {
        let body = ["1 3 0 1 0", "2 0", "0.5", "691000.25 2 -1 7 5335000.125 -3", "", "1e3 0 2.5 4", "0", ""];
        bytes.extend(body.join(ending).into_bytes());
        return bytes;
    }
    let mut put = |little: &[u8]| {
        let order: Vec<u8> = if is_big { little.iter().rev().copied().collect() } else { little.to_vec() };
        bytes.extend(order);
    };
    put(&[1]);
    put(&[3]);
    [0_i32, 1, 0].iter().for_each(|i| put(&i.to_le_bytes()));
    put(&[2]);
    put(&[0]);
    put(&0.5_f64.to_le_bytes());
    put(&691_000.25_f64.to_le_bytes());
    put(&2_u16.to_le_bytes());
    [-1_i16, 7].iter().for_each(|i| put(&i.to_le_bytes()));
    put(&5_335_000.125_f64.to_le_bytes());
    put(&(-3_i32).to_le_bytes());
    put(&1e3_f64.to_le_bytes());
    put(&0_u16.to_le_bytes());
    put(&2.5_f64.to_le_bytes());
    put(&4_i32.to_le_bytes());
    put(&0_i32.to_le_bytes());
    bytes
}

#[test]
fn all_formats_give_the_same_points() {
    let points = [Vector3::new(691_000.25, 5_335_000.125, -3.0), Vector3::new(1e3, 2.5, 4.0)];
    for ending in ["\n", "\r\n", "\r"] {
        for (form, is_big) in [("ascii", false), ("binary_little_endian", false), ("binary_big_endian", true)]
        {
            let bytes = with_lists(form, ending, is_big);
            assert_eq!(read(&bytes).as_deref(), Ok(&points[..]), "{form} {ending:?}");
            let marked = [b"\xef\xbb\xbf", &bytes[..]].concat();
            assert_eq!(read(&marked).as_deref(), Ok(&points[..]), "{form} {ending:?}, byte-order mark");
            let second = bytes.windows(3).position(|at| at == b"1e3");
            let found = read(&bytes[..second.unwrap_or(bytes.len() - 5)]);
            assert!(matches!(found, Err(PlyError::Truncated { found: 1, .. })), "{form}: {found:?}");
        }
    }
}

#[test]
fn counts_beyond_the_file_are_rejected_without_delay() {
    for count in ["4294967296", "18446744073709551615"] {
        for property in ["uchar a", "list uint double a"] {
            let text = TEXT.replace(
                "element vertex",
                &format!("element face {count}\nproperty {property}\nelement vertex"),
            );
            for form in ["ascii", "binary_little_endian"] {
                let found = read(text.replace("ascii", form).as_bytes());
                assert_eq!(
                    found,
                    Err(PlyError::Truncated { expected: 2, found: 0 }),
                    "{count} {property} {form}"
                );
            }
        }
    }
}

#[test]
fn ascii_and_binary_files_give_the_same_points() {
    let points = read(TEXT.as_bytes()).expect("it is a cloud");
    assert_eq!(points, [Vector3::new(1.5, -2.0, 3.0), Vector3::new(4.0, 5.0, 60.0)]);
    assert_eq!(read(&binary()).expect("it is a cloud"), points);
}

#[test]
fn invalid_files_are_reported() {
    let bytes = binary();
    let cases: [(Vec<u8>, &str); 7] = [
        (b"plz\n".to_vec(), "expected a PLY file"),
        (bytes[..40].to_vec(), "expected a PLY file"),
        (
            bytes[..bytes.len() - 1].to_vec(),
            "truncated: the header announces 2 points, the file ends in point 1",
        ),
        (TEXT.replace("vertex 2", "vertex 99999999999").into(), "line 4: expected at most 20 million points"),
        (TEXT.replace("ascii 1.0", "ascii 2.0").into(), "line 2: expected `format ascii`, "),
        (TEXT.replace("float z", "float w").into(), "`z` is missing"),
        (TEXT.replace("-2 3", "-2 three").into(), "point 0: expected a number"),
    ];
    for (bytes, expected) in cases {
        let told = read(&bytes).map_err(|error| error.to_string());
        assert!(told.as_ref().is_err_and(|told| told.contains(expected)), "{told:?} is not {expected}");
    }
}

#[test]
fn truncated_files_are_rejected_at_any_length() {
    let bytes = binary();
    for len in 0..bytes.len() {
        let told = read(&bytes[..len]);
        assert!(matches!(told, Err(PlyError::NoHeader | PlyError::Truncated { .. })), "{len}: {told:?}");
    }
}
