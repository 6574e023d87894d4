//! Devices shared between back ends.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};

use crate::adapter::AdapterReport;

/// Number of storage buffers that the shaders need in one stage.
const STORAGE_BUFFERS: u32 = 8;

/// A device shared between back ends of one process, for example cameras and lidars.
///
/// Device errors never panic; the first one is kept, see [`Gpu::error`].
#[derive(Debug)]
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    report: AdapterReport,
    limits: wgpu::Limits,
    error: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens a device on an adapter; the error text states the reason.
    pub(crate) fn open(adapter: &wgpu::Adapter, report: &AdapterReport) -> Result<Self, String> {
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
        let first = Arc::new(Mutex::new(None));
        let kept = Arc::clone(&first);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| note(&kept, &error.to_string())));
        let kept = Arc::clone(&first);
        device.set_device_lost_callback(move |reason, message| {
            note(&kept, &format!("the device is lost ({reason:?}) {message}"));
        });
        Ok(Self { device, queue, report: report.clone(), limits, error: first })
    }

    /// The device, which creates buffers, textures and pipelines.
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// The queue, which executes commands.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// Report on its adapter.
    pub fn report(&self) -> &AdapterReport {
        &self.report
    }

    /// Limits of the device: those of the adapter.
    pub fn limits(&self) -> &wgpu::Limits {
        &self.limits
    }

    /// First error since the device was opened, such as a lost device or a failed allocation. Results from then on
    /// are invalid, and the device must not be used any more.
    pub fn error(&self) -> Option<String> {
        self.error.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Checks that the device is usable.
    ///
    /// # Errors
    /// The error of [`Gpu::error`], if any.
    pub fn check(&self) -> Result<(), String> {
        self.error().map_or(Ok(()), Err)
    }

    /// Waits for a submission and runs the callbacks of buffers mapped by then; `None` waits for the last
    /// submission.
    ///
    /// # Errors
    /// The error of [`Gpu::error`], if any.
    pub fn wait(&self, submission: Option<wgpu::SubmissionIndex>) -> Result<(), String> {
        self.run_callbacks(wgpu::PollType::Wait { submission_index: submission, timeout: None })
    }

    /// Runs the callbacks of mapped buffers without waiting.
    ///
    /// # Errors
    /// The error of [`Gpu::error`], if any.
    pub fn poll(&self) -> Result<(), String> {
        self.run_callbacks(wgpu::PollType::Poll)
    }

    fn run_callbacks(&self, how: wgpu::PollType) -> Result<(), String> {
        // `poll` panics on a lost device.
        let polled = catch_unwind(AssertUnwindSafe(|| self.device.poll(how)));
        match polled {
            Ok(Ok(_)) => {}
            Ok(Err(wgpu::PollError::WrongSubmissionIndex(..))) => {
                note(&self.error, "the device is lost: it takes no more work");
            }
            Ok(Err(error)) => note(&self.error, &error.to_string()),
            Err(_) => note(&self.error, "the device is lost"),
        }
        self.check()
    }
}

/// Stores an error if it is the first.
fn note(first: &Mutex<Option<String>>, error: &str) {
    let mut first = first.lock().unwrap_or_else(PoisonError::into_inner);
    if first.is_none() {
        *first = Some(error.split_whitespace().collect::<Vec<_>>().join(" "));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{AdapterKind, probe};

    #[test]
    fn probed_adapters_open_as_reported() {
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
    fn shared_device_is_replaced_after_a_failure() {
        let Some(gpu) = swerve_tests::or_skip(Gpu::fresh(AdapterKind::Software)) else { return };
        assert_eq!(gpu.error(), None);
        gpu.device().destroy();
        let _ = gpu.wait(None);
        assert!(gpu.wait(None).is_err() && gpu.error().is_some());
    }
}
