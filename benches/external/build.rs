//! Sets the variable that copper's macros require (`LOG_INDEX_DIR`), so that users need not.

fn main() {
    cu29_build::setup();
}
