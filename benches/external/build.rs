//! Sets what copper's macros ask of the crate that uses them (`LOG_INDEX_DIR`), so that no user has to.

fn main() {
    cu29_build::setup();
}
