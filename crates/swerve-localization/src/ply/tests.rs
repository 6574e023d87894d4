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

#[test]
fn text_and_bytes_are_the_same_points() {
    let points = read(TEXT.as_bytes()).expect("it is a cloud");
    assert_eq!(points, [Vector3::new(1.5, -2.0, 3.0), Vector3::new(4.0, 5.0, 60.0)]);
    assert_eq!(read(&binary()).expect("it is a cloud"), points);
}

#[test]
fn what_is_wrong_is_told_in_one_line() {
    let bytes = binary();
    let cases: [(Vec<u8>, &str); 7] = [
        (b"plz\n".to_vec(), "expected a PLY file"),
        (bytes[..40].to_vec(), "expected a PLY file"),
        (
            bytes[..bytes.len() - 1].to_vec(),
            "truncated: the header tells of 2 points, the file ends in point 1",
        ),
        (TEXT.replace("vertex 2", "vertex 99999999999").into(), "line 4: expected at most 20 million points"),
        (TEXT.replace("ascii", "binary_big_endian").into(), "line 2: expected `format ascii 1.0` or"),
        (TEXT.replace("float z", "float w").into(), "`z` is missing"),
        (TEXT.replace("-2 3", "-2 three").into(), "point 0: expected a number"),
    ];
    for (bytes, expected) in cases {
        let told = read(&bytes).map_err(|error| error.to_string());
        assert!(told.as_ref().is_err_and(|told| told.contains(expected)), "{told:?} is not {expected}");
    }
}

#[test]
fn every_beginning_of_a_file_is_refused() {
    let bytes = binary();
    for len in 0..bytes.len() {
        let told = read(&bytes[..len]);
        assert!(matches!(told, Err(PlyError::NoHeader | PlyError::Truncated { .. })), "{len}: {told:?}");
    }
}
