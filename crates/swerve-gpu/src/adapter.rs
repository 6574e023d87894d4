//! Adapters: which there are, which can be used, and why the others cannot.
//!
//! Vulkan is asked first and OpenGL after it. An adapter counts only if a device can be had of it and the
//! device has what the shaders need: some drivers list adapters that they then cannot open.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::device::Gpu;
use crate::drivers;

/// Hardware that an adapter computes with.
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
    /// Its name, by the driver.
    pub name: String,
    /// Programming interface: `vulkan` or `gl`.
    pub api: &'static str,
    /// Name and version of the driver; may be empty.
    pub driver: String,
    /// `discrete`, `integrated`, `virtual`, `cpu` or `other`.
    pub device_type: &'static str,
    /// Hardware that it computes with; `None` if the driver does not say.
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

/// Adapters that [`probe`] found.
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
        let is_of_kind = |report: &&AdapterReport| report.kind == Some(kind);
        match self.found.iter().filter(is_of_kind).find(|report| report.refused.is_none()) {
            Some(report) => Ok(report),
            None => Err(self.none(kind)),
        }
    }

    /// Reasons why there is none of a kind.
    pub(crate) fn none(&self, kind: AdapterKind) -> NoAdapter {
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
    /// Kind that was asked for.
    pub kind: AdapterKind,
    /// Of each interface and adapter: why not.
    pub reasons: Vec<String>,
}

/// Interfaces in the order in which they are tried.
const APIS: [(wgpu::Backends, &str); 2] = [(wgpu::Backends::VULKAN, "vulkan"), (wgpu::Backends::GL, "gl")];

/// Looks for adapters and opens a device of each that may be used, to see whether it works.
///
/// No adapter is no error. Takes some tenths of a second.
pub fn probe() -> Adapters {
    let mut adapters = Adapters::default();
    open_first(&mut adapters, &mut |_| false);
    adapters
}

/// Opens adapters in order and reports on them, until `accept` takes one.
pub(crate) fn open_first(
    adapters: &mut Adapters,
    accept: &mut dyn FnMut(&AdapterReport) -> bool,
) -> Option<Gpu> {
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
