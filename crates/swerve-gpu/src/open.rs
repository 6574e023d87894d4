//! Detection of graphics adapters, and devices opened on them.
//!
//! Vulkan is tried before OpenGL. An adapter counts only if a device can be opened on it and meets the requirements
//! of the shaders: some drivers list adapters that they cannot open.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use crate::adapter::{AdapterKind, AdapterReport, Adapters, NoAdapter};
use crate::device::Gpu;
use crate::drivers;

/// Graphics APIs in the order in which they are tried.
const APIS: [(wgpu::Backends, &str); 2] = [(wgpu::Backends::VULKAN, "vulkan"), (wgpu::Backends::GL, "gl")];

/// Lists adapters and opens a device on each to test it.
///
/// The absence of adapters is not an error. Takes a few tenths of a second.
pub fn probe() -> Adapters {
    let mut adapters = Adapters::default();
    open_first(&mut adapters, &mut |_| false);
    adapters
}

/// Devices returned by [`Gpu::shared`]: GPU, software.
static SHARED: Mutex<[Weak<Gpu>; 2]> = Mutex::new([Weak::new(), Weak::new()]);

impl Gpu {
    /// The shared device of this kind in this process; opened if there is none or the previous one has failed.
    ///
    /// # Errors
    /// If no adapter of the kind is usable.
    pub fn shared(kind: AdapterKind) -> Result<Arc<Self>, NoAdapter> {
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        let place = &mut shared[usize::from(kind == AdapterKind::Software)];
        if let Some(gpu) = place.upgrade().filter(|gpu| gpu.error().is_none()) {
            return Ok(gpu);
        }
        let gpu = Self::fresh(kind)?;
        *place = Arc::downgrade(&gpu);
        Ok(gpu)
    }

    /// Opens an unshared device of this kind.
    ///
    /// # Errors
    /// If no adapter of the kind is usable.
    pub fn fresh(kind: AdapterKind) -> Result<Arc<Self>, NoAdapter> {
        let mut adapters = Adapters::default();
        let gpu = open_first(&mut adapters, &mut |report| report.kind == Some(kind));
        gpu.map(Arc::new).ok_or_else(|| adapters.none(kind))
    }
}

/// Opens adapters in order and reports on them, until `accept` takes one.
fn open_first(adapters: &mut Adapters, accept: &mut dyn FnMut(&AdapterReport) -> bool) -> Option<Gpu> {
    for (api, name) in APIS {
        let listed = list(api);
        if listed.is_empty() {
            adapters.absent.push(drivers::why_absent(name));
        }
        for adapter in listed {
            let mut report = describe(&adapter, name);
            let opened = if report.kind.is_some() {
                Gpu::open(&adapter, &report)
            } else {
                Err("the driver does not say what kind of device it is".to_owned())
            };
            report.refused = opened.as_ref().err().cloned();
            let taken = opened.is_ok() && accept(&report);
            adapters.found.push(report);
            if let (true, Ok(gpu)) = (taken, opened) {
                return Some(gpu);
            }
        }
    }
    None
}

fn list(api: wgpu::Backends) -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = api;
    descriptor.flags = wgpu::InstanceFlags::empty();
    // Contain panics of broken drivers where possible.
    let listed = catch_unwind(AssertUnwindSafe(|| {
        pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(api))
    }));
    let mut adapters = listed.unwrap_or_default();
    // Most capable first; the sort is stable.
    adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::VirtualGpu => 1,
        wgpu::DeviceType::IntegratedGpu => 2,
        _ => 3,
    });
    adapters
}

fn describe(adapter: &wgpu::Adapter, api: &'static str) -> AdapterReport {
    let info = adapter.get_info();
    let (device_type, kind) = match info.device_type {
        wgpu::DeviceType::DiscreteGpu => ("discrete", Some(AdapterKind::Gpu)),
        wgpu::DeviceType::IntegratedGpu => ("integrated", Some(AdapterKind::Gpu)),
        wgpu::DeviceType::VirtualGpu => ("virtual", Some(AdapterKind::Gpu)),
        wgpu::DeviceType::Cpu => ("cpu", Some(AdapterKind::Software)),
        wgpu::DeviceType::Other => ("other", None),
    };
    let driver = [info.driver, info.driver_info].join(" ").trim().to_owned();
    AdapterReport { name: info.name, api, driver, device_type, kind, refused: None }
}
