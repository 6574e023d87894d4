//! Graphics drivers: probable reasons why an API offers no adapter, from the files of the system.

use std::path::{Path, PathBuf};

/// Probable reason why an API (`vulkan` or `gl`) offers no adapter.
pub(crate) fn why_absent(api: &str) -> String {
    let (library, manifests) = match api {
        "vulkan" => ("libvulkan.so.1", vulkan_manifests()),
        _ => ("libEGL.so.1", None),
    };
    if !cfg!(target_os = "linux") {
        return format!("{api}: no driver offers an adapter");
    }
    if !has_library(library) {
        return format!("{api}: no loader: {library} is not installed");
    }
    match manifests {
        Some(0) => {
            format!("{api}: no driver: the loader {library} is there, but no driver file for it")
        }
        _ => format!("{api}: the loader {library} is there, but its drivers offer no adapter"),
    }
}

/// Number of driver manifests that the Vulkan loader would read.
fn vulkan_manifests() -> Option<usize> {
    for name in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        if let Some(files) = std::env::var_os(name) {
            return Some(std::env::split_paths(&files).filter(|path| path.exists()).count());
        }
    }
    let home = std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".local/share/vulkan/icd.d"));
    let fixed = ["/etc/vulkan/icd.d", "/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"];
    let folders = fixed.iter().map(PathBuf::from).chain(home);
    Some(folders.filter_map(|folder| std::fs::read_dir(folder).ok()).map(Iterator::count).sum())
}

/// Disables Mesa's Vulkan device-select layer if there is no display.
///
/// Without a display the layer writes `error: XDG_RUNTIME_DIR is invalid or not set in the environment.` to standard
/// error; it only orders adapters, which [`probe`](crate::probe) also does. Call it first in a program: it does nothing
/// once there is a second thread.
pub fn turn_off_display_layer() {
    const OFF: &str = "NODEVICE_SELECT";
    let folder = std::env::var_os("XDG_RUNTIME_DIR");
    let can_ask = folder.is_some_and(|folder| Path::new(&folder).is_absolute());
    let is_chosen = [OFF, "MESA_VK_DEVICE_SELECT"].iter().any(|name| std::env::var_os(name).is_some());
    let threads = std::fs::read_dir("/proc/self/task").map_or(0, Iterator::count);
    if can_ask || is_chosen || threads != 1 {
        return;
    }
    #[expect(unsafe_code, reason = "a layer is turned off by the environment alone")]
    // SAFETY: this is the only thread, so no other thread reads the environment concurrently.
    unsafe {
        std::env::set_var(OFF, "1");
    }
}

fn has_library(name: &str) -> bool {
    let listed = std::fs::read("/etc/ld.so.cache")
        .is_ok_and(|cache| cache.windows(name.len()).any(|window| window == name.as_bytes()));
    let given = std::env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    listed || std::env::split_paths(&given).any(|folder| Path::new(&folder).join(name).exists())
}
