#![no_main]
//! Configurations: any text is one, or is refused.

use swerve_stack::Setup;
use swerve_text::Document;

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Ok(document) = Document::parse("fuzzed.toml", text) {
        let _either_way = Setup::from_document(&document, &[]).is_ok();
    }
});
