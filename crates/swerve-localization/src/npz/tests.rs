use proptest::prelude::*;

use super::*;

/// An array as NumPy writes it.
fn npy(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let head = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let length = u16::try_from(head.len()).unwrap().to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], head.as_bytes(), data].concat()
}

/// An archive of one member.
fn npz(data: &[u8], deflated: bool) -> Vec<u8> {
    let packed = if deflated { miniz_oxide::deflate::compress_to_vec(data, 6) } else { data.to_vec() };
    let long = |n: usize| u32::try_from(n).unwrap().to_le_bytes();
    let method: [u8; 2] = if deflated { [8, 0] } else { [0, 0] };
    let same =
        [&method[..], &[0; 4], &crc32(data).to_le_bytes(), &long(packed.len()), &long(data.len()), &[5, 0]];
    let header = [b"PK\x03\x04\x14\x00\x00\x00", &same.concat()[..], b"\x00\x00", b"a.npy", &packed].concat();
    let entry = [b"PK\x01\x02\x14\x00\x14\x00\x00\x00", &same.concat()[..], &[0; 16], b"a.npy"].concat();
    let end =
        [b"PK\x05\x06\x00\x00\x00\x00\x01\x00\x01\x00", &long(entry.len())[..], &long(header.len()), &[0; 2]];
    [header, entry, end.concat()].concat()
}

#[test]
fn stored_and_deflated_arrays_are_read() {
    let numbers = [1.5_f64, -2.0, f64::MAX, 0.0, 5.0, 6.0];
    let data: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
    for deflated in [false, true] {
        let arrays = read(&npz(&npy("<f8", "(2, 3)", &data), deflated)).unwrap();
        assert_eq!(arrays["a"], Array { shape: vec![2, 3], values: numbers.to_vec() });
        assert_eq!(arrays["a"].rows::<3>().unwrap()[1], [0.0, 5.0, 6.0]);
        assert_eq!(arrays["a"].rows::<2>(), None);
    }
    let small = read(&npz(&npy("<i4", "()", &7_i32.to_le_bytes()), true)).unwrap();
    assert_eq!(small["a"], Array { shape: vec![], values: vec![7.0] });
}

#[test]
fn invalid_archives_are_reported() {
    let told = |bytes: &[u8]| read(bytes).unwrap_err().to_string();
    let good = npz(&npy("<f8", "(1,)", &[0; 8]), false);
    assert_eq!(told(b"text"), "archive: no zip archive: expected an `.npz` file as NumPy writes it");
    assert_eq!(told(&npz(&npy("<f8", "(2,)", &[0; 8]), true)), "a.npy: 1 numbers, expected 2 by its shape");
    let complex = told(&npz(&npy("<c16", "(1,)", &[0; 16]), true));
    assert_eq!(complex, "a.npy: numbers of type `<c16`, expected <f8, <f4, <i8, <i4, |u1 or |b1");
    let mut damaged = good;
    damaged[60] ^= 1;
    assert_eq!(told(&damaged), "a.npy: its checksum is another: the file is damaged");
}

proptest! {
    #[test]
    fn reader_never_panics_on_arbitrary_bytes(bytes in proptest::collection::vec(any::<u8>(), 0..200), at in 0_usize..400, deflated: bool) {
        let _any = read(&bytes);
        let mut file = npz(&npy("<f8", "(2, 2)", &[1; 32]), deflated);
        let at = at % file.len();
        for (to, byte) in file[at..].iter_mut().zip(&bytes) {
            *to ^= byte;
        }
        let _changed = read(&file);
    }
}
