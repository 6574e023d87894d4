//! Text packed by gzip (RFC 1952).

use crate::decoded;

/// Longest text that is unpacked, bytes.
const UNPACKED_MAX: usize = 512 << 20;

/// Same as [`decoded`], for a file that may be packed by gzip: at most 512 MiB of text.
///
/// # Errors
/// If the bytes are damaged or not UTF-8, or the text is too long.
pub fn unpacked(bytes: Vec<u8>) -> Result<String, String> {
    let plain = match bytes.starts_with(&[0x1f, 0x8b]) {
        false => bytes,
        true => {
            let packed = deflated(&bytes).ok_or("expected a file packed by gzip, found a broken head")?;
            miniz_oxide::inflate::decompress_to_vec_with_limit(packed, UNPACKED_MAX).map_err(|error| {
                format!("packed by gzip, but broken or beyond {UNPACKED_MAX} bytes: {error}")
            })?
        }
    };
    decoded(plain).map_err(|error| error.to_string())
}

/// Data after the header of a gzip file.
fn deflated(bytes: &[u8]) -> Option<&[u8]> {
    let ([_, _, 8, flags, ..], mut rest) = (bytes, bytes.get(10..)?) else { return None };
    if flags & 4 != 0 {
        let size = usize::from(u16::from_le_bytes([*rest.first()?, *rest.get(1)?]));
        rest = rest.get(2 + size..)?;
    }
    for flag in [8, 16] {
        if flags & flag != 0 {
            rest = rest.get(rest.iter().position(|byte| *byte == 0)? + 1..)?;
        }
    }
    if flags & 2 != 0 { rest.get(2..) } else { Some(rest) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gzip_text_is_decoded_and_damaged_gzip_reported() {
        // `printf '0 1 2 3\n' | gzip -n`, and the same with a file name.
        let body = [0x33, 0x50, 0x30, 0x54, 0x30, 0x52, 0x30, 0xe6, 0x02, 0x00, 0, 0, 0, 0, 8, 0, 0, 0];
        let head = |flags| vec![0x1f, 0x8b, 8, flags, 0, 0, 0, 0, 0, 3];
        for name in [head(0), [head(8), b"a.txt\0".to_vec()].concat()] {
            assert_eq!(unpacked([name, body.to_vec()].concat()).unwrap(), "0 1 2 3\n");
        }
        assert_eq!(unpacked(b"plain".to_vec()).unwrap(), "plain");
        for broken in [vec![0x1f, 0x8b], head(8), [head(0), vec![0xff; 9]].concat()] {
            assert!(unpacked(broken).unwrap_err().contains("gzip"));
        }
        assert!(unpacked(vec![0xff]).unwrap_err().contains("UTF-8"));
    }
}
