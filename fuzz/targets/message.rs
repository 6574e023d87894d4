#![no_main]
//! Messages between processes (postcard) and in logs (CBOR), read as each type that there is.

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| swerve_fuzz::read_as_each(bytes));
