//! Adapters and devices.
//!
//! Vulkan is asked first and OpenGL after it. An adapter counts only if a device can be had of it and the
//! device has what the shaders need: some drivers list adapters that they then cannot open.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// What an adapter computes with.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum AdapterKind {
    /// A graphics processor: discrete, integrated, or lent to a virtual machine.
    Gpu,
    /// The machine's processor, through a driver that takes the part of a graphics processor.
    Software,
}

impl AdapterKind {
    /// Name in configurations and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gpu => "gpu",
            Self::Software => "software",
        }
    }
}

/// An adapter that a driver offers.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct AdapterReport {
    /// What the driver calls it.
    pub name: String,
    /// Programming interface: `vulkan` or `gl`.
    pub api: &'static str,
    /// Name and version of the driver; may be empty.
    pub driver: String,
    /// `discrete`, `integrated`, `virtual`, `cpu` or `other`.
    pub device_type: &'static str,
    /// What it computes with; `None` if the driver does not say.
    pub kind: Option<AdapterKind>,
    /// Why it cannot be used; `None` if it can.
    pub refused: Option<String>,
}

impl core::fmt::Display for AdapterReport {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} ({}, {}", self.name, self.api, self.device_type)?;
        if !self.driver.is_empty() {
            write!(f, ", {}", self.driver)?;
        }
        write!(f, ")")
    }
}

/// What [`probe`] found.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Adapters {
    /// Every adapter, in the order in which they are tried.
    pub found: Vec<AdapterReport>,
    /// Of each programming interface that offers none: why, as far as can be seen.
    pub absent: Vec<String>,
}

impl Adapters {
    /// The adapter that a back end of a kind uses.
    ///
    /// # Errors
    /// If none can be used, with all reasons.
    pub fn choose(&self, kind: AdapterKind) -> Result<&AdapterReport, NoAdapter> {
        let of_kind = |report: &&AdapterReport| report.kind == Some(kind);
        match self.found.iter().filter(of_kind).find(|report| report.refused.is_none()) {
            Some(report) => Ok(report),
            None => Err(self.none(kind)),
        }
    }

    /// Why there is none of a kind.
    fn none(&self, kind: AdapterKind) -> NoAdapter {
        let mut reasons = self.absent.clone();
        for report in &self.found {
            match (&report.refused, report.kind) {
                (Some(why), _) => reasons.push(format!("{report}: {why}")),
                (None, Some(other)) if other != kind => {
                    reasons.push(format!("{report}: is {}", described(other)));
                }
                _ => {}
            }
        }
        NoAdapter { kind, reasons }
    }
}

fn described(kind: AdapterKind) -> &'static str {
    match kind {
        AdapterKind::Gpu => "a graphics processor",
        AdapterKind::Software => "software, not a graphics processor",
    }
}

/// No adapter of a kind can be used.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("no {} adapter: {}", .kind.name(), .reasons.join("; "))]
pub struct NoAdapter {
    /// Of which kind.
    pub kind: AdapterKind,
    /// Of each interface and adapter: why not.
    pub reasons: Vec<String>,
}

/// Interfaces in the order in which they are tried.
const APIS: [(wgpu::Backends, &str); 2] = [(wgpu::Backends::VULKAN, "vulkan"), (wgpu::Backends::GL, "gl")];

/// What the shaders need of a device.
const STORAGE_BUFFERS: u32 = 8;

/// Looks for adapters and opens a device of each that may be used, to see whether it works.
///
/// No adapter is no error. Takes some tenths of a second.
pub fn probe() -> Adapters {
    let mut adapters = Adapters::default();
    each_adapter(&mut adapters, &mut |_| false);
    adapters
}

/// Opens adapters in order and reports on them, until `is_it` takes one.
fn each_adapter(adapters: &mut Adapters, is_it: &mut dyn FnMut(&AdapterReport) -> bool) -> Option<Gpu> {
    for (api, name) in APIS {
        let listed = list(api);
        if listed.is_empty() {
            adapters.absent.push(why_absent(name));
        }
        for adapter in listed {
            let mut report = describe(&adapter, name);
            let opened = if report.kind.is_some() {
                Gpu::open(&adapter, &report)
            } else {
                Err("the driver does not say what kind of device it is".to_owned())
            };
            report.refused = opened.as_ref().err().cloned();
            let taken = opened.is_ok() && is_it(&report);
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
    // A broken driver must not take the process along if it can be helped.
    let listed = catch_unwind(AssertUnwindSafe(|| {
        pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(api))
    }));
    let mut adapters = listed.unwrap_or_default();
    // Strong ones first; the sort is stable.
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

/// Why an interface offers no adapter, as far as files tell.
fn why_absent(api: &str) -> String {
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

/// Number of driver files that the Vulkan loader would read.
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

fn has_library(name: &str) -> bool {
    let listed = std::fs::read("/etc/ld.so.cache")
        .is_ok_and(|cache| cache.windows(name.len()).any(|window| window == name.as_bytes()));
    let given = std::env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    listed || std::env::split_paths(&given).any(|folder| Path::new(&folder).join(name).exists())
}

/// A device that back ends share: images and lidars of one process, say.
///
/// Errors of the device never panic; they are kept, see [`Gpu::trouble`].
#[derive(Debug)]
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    report: AdapterReport,
    limits: wgpu::Limits,
    trouble: Arc<Mutex<Option<String>>>,
}

/// Devices that [`Gpu::shared`] has given out: of graphics processors, of software.
static SHARED: Mutex<[Weak<Gpu>; 2]> = Mutex::new([Weak::new(), Weak::new()]);

impl Gpu {
    /// The device of a kind that others in this process use too; it is opened if nobody does, or if it is
    /// in trouble.
    ///
    /// # Errors
    /// If no adapter of the kind can be used.
    pub fn shared(kind: AdapterKind) -> Result<Arc<Self>, NoAdapter> {
        let mut shared = SHARED.lock().unwrap_or_else(PoisonError::into_inner);
        let place = &mut shared[usize::from(kind == AdapterKind::Software)];
        if let Some(gpu) = place.upgrade().filter(|gpu| gpu.trouble().is_none()) {
            return Ok(gpu);
        }
        let gpu = Self::fresh(kind)?;
        *place = Arc::downgrade(&gpu);
        Ok(gpu)
    }

    /// A device of a kind that nobody else uses.
    ///
    /// # Errors
    /// If no adapter of the kind can be used.
    pub fn fresh(kind: AdapterKind) -> Result<Arc<Self>, NoAdapter> {
        let mut adapters = Adapters::default();
        let gpu = each_adapter(&mut adapters, &mut |report| report.kind == Some(kind));
        gpu.map(Arc::new).ok_or_else(|| adapters.none(kind))
    }

    /// Opens a device of an adapter; the text says why not.
    fn open(adapter: &wgpu::Adapter, report: &AdapterReport) -> Result<Self, String> {
        let limits = adapter.limits();
        if limits.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS {
            let most = limits.max_storage_buffers_per_shader_stage;
            return Err(format!("{most} storage buffers per shader, {STORAGE_BUFFERS} are needed"));
        }
        let capabilities = adapter.get_downlevel_capabilities().flags;
        let needed = wgpu::DownlevelFlags::COMPUTE_SHADERS
            | wgpu::DownlevelFlags::VERTEX_STORAGE
            | wgpu::DownlevelFlags::FRAGMENT_WRITABLE_STORAGE;
        if !capabilities.contains(needed) {
            return Err(format!("lacks {:?}", needed - capabilities));
        }
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("swerve"),
            required_limits: limits.clone(),
            memory_hints: wgpu::MemoryHints::Performance,
            ..wgpu::DeviceDescriptor::default()
        };
        let opened =
            catch_unwind(AssertUnwindSafe(|| pollster::block_on(adapter.request_device(&descriptor))));
        let (device, queue) = match opened {
            Ok(Ok(both)) => both,
            Ok(Err(error)) => return Err(format!("no device: {error}")),
            Err(_) => return Err("no device: the driver failed".to_owned()),
        };
        let trouble = Arc::new(Mutex::new(None));
        let kept = Arc::clone(&trouble);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| note(&kept, &error.to_string())));
        let kept = Arc::clone(&trouble);
        device.set_device_lost_callback(move |reason, message| {
            note(&kept, &format!("the device is lost ({reason:?}) {message}"));
        });
        Ok(Self { device, queue, report: report.clone(), limits, trouble })
    }

    /// Buffers, textures and pipelines are made by it.
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// Takes commands.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// Which adapter it is of.
    pub fn report(&self) -> &AdapterReport {
        &self.report
    }

    /// What the device was opened with: all that the adapter has.
    pub fn limits(&self) -> &wgpu::Limits {
        &self.limits
    }

    /// The first error since the device was opened: a lost device, an allocation that failed. What was
    /// computed from then on cannot be trusted, and no one should go on using the device.
    pub fn trouble(&self) -> Option<String> {
        self.trouble.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Waits for a submission and runs the callbacks of buffers mapped by then; `None` for the last one.
    ///
    /// # Errors
    /// [`Gpu::trouble`].
    pub fn wait(&self, submission: Option<wgpu::SubmissionIndex>) -> Result<(), String> {
        self.poll(wgpu::PollType::Wait { submission_index: submission, timeout: None })
    }

    /// Runs the callbacks of buffers that are mapped by now, without waiting.
    ///
    /// # Errors
    /// [`Gpu::trouble`].
    pub(crate) fn look(&self) -> Result<(), String> {
        self.poll(wgpu::PollType::Poll)
    }

    fn poll(&self, how: wgpu::PollType) -> Result<(), String> {
        // A lost device is a panic there.
        let polled = catch_unwind(AssertUnwindSafe(|| self.device.poll(how)));
        match polled {
            Ok(Ok(_)) => {}
            Ok(Err(wgpu::PollError::WrongSubmissionIndex(..))) => {
                note(&self.trouble, "the device is lost: it takes no more work");
            }
            Ok(Err(error)) => note(&self.trouble, &error.to_string()),
            Err(_) => note(&self.trouble, "the device is lost"),
        }
        self.trouble().map_or(Ok(()), Err)
    }
}

fn note(trouble: &Mutex<Option<String>>, what: &str) {
    let mut trouble = trouble.lock().unwrap_or_else(PoisonError::into_inner);
    if trouble.is_none() {
        *trouble = Some(what.split_whitespace().collect::<Vec<_>>().join(" "));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::tests::given;

    fn report(kind: AdapterKind, refused: Option<&str>) -> AdapterReport {
        AdapterReport {
            name: "A 1".to_owned(),
            api: "vulkan",
            driver: String::new(),
            device_type: "discrete",
            kind: Some(kind),
            refused: refused.map(str::to_owned),
        }
    }

    #[test]
    fn the_first_usable_adapter_of_a_kind_is_chosen_or_all_reasons_are_given() {
        let mut adapters = Adapters {
            found: vec![
                report(AdapterKind::Software, None),
                report(AdapterKind::Gpu, Some("no device: Parent device is lost")),
            ],
            absent: vec!["gl: no loader: libEGL.so.1 is not installed".to_owned()],
        };
        assert_eq!(adapters.choose(AdapterKind::Software), Ok(&adapters.found[0]));
        let error = adapters.choose(AdapterKind::Gpu).expect_err("it was refused");
        assert_eq!(
            error.to_string(),
            "no gpu adapter: gl: no loader: libEGL.so.1 is not installed; A 1 (vulkan, discrete): is software, \
             not a graphics processor; A 1 (vulkan, discrete): no device: Parent device is lost"
        );
        adapters.found.push(report(AdapterKind::Gpu, None));
        assert_eq!(adapters.choose(AdapterKind::Gpu), Ok(&adapters.found[2]));
    }

    #[test]
    fn what_the_probe_says_holds_when_a_device_is_opened() {
        let adapters = probe();
        for kind in [AdapterKind::Gpu, AdapterKind::Software] {
            match (adapters.choose(kind), Gpu::shared(kind)) {
                (Ok(report), Ok(gpu)) => {
                    assert_eq!(gpu.report(), report);
                    assert!(Arc::ptr_eq(&gpu, &Gpu::shared(kind).unwrap()));
                    gpu.wait(None).unwrap();
                }
                (Err(none), Err(also)) => {
                    assert!(!none.reasons.is_empty());
                    assert_eq!(none, also);
                }
                (chosen, shared) => panic!("{chosen:?}, but {shared:?}"),
            }
        }
    }

    #[test]
    fn a_device_in_trouble_is_not_given_out_again() {
        let Some(gpu) = given(Gpu::fresh(AdapterKind::Software)) else { return };
        assert_eq!(gpu.trouble(), None);
        gpu.device().destroy();
        let _ = gpu.wait(None);
        assert!(gpu.wait(None).is_err() && gpu.trouble().is_some());
    }
}
