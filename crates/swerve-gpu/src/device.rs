//! Devices that back ends share.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use crate::adapter::{AdapterKind, AdapterReport, Adapters, NoAdapter, open_first};

/// Storage buffers that the shaders need in one stage.
const STORAGE_BUFFERS: u32 = 8;

/// A device that back ends share: images and lidars of one process, say.
///
/// Errors of the device never panic; the first is kept, see [`Gpu::error`].
#[derive(Debug)]
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    report: AdapterReport,
    limits: wgpu::Limits,
    error: Arc<Mutex<Option<String>>>,
}

/// Devices that [`Gpu::shared`] has given out: of graphics processors, of software.
static SHARED: Mutex<[Weak<Gpu>; 2]> = Mutex::new([Weak::new(), Weak::new()]);

impl Gpu {
    /// The device of a kind that others in this process use too; it is opened if nobody does, or if it has
    /// failed.
    ///
    /// # Errors
    /// If no adapter of the kind can be used.
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

    /// A device of a kind that nobody else uses.
    ///
    /// # Errors
    /// If no adapter of the kind can be used.
    pub fn fresh(kind: AdapterKind) -> Result<Arc<Self>, NoAdapter> {
        let mut adapters = Adapters::default();
        let gpu = open_first(&mut adapters, &mut |report| report.kind == Some(kind));
        gpu.map(Arc::new).ok_or_else(|| adapters.none(kind))
    }

    /// Opens a device of an adapter; the text says why not.
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

    /// The device, which makes buffers, textures and pipelines.
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// The queue, which takes commands.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// The adapter that it is of.
    pub fn report(&self) -> &AdapterReport {
        &self.report
    }

    /// Limits that the device was opened with: all that the adapter has.
    pub fn limits(&self) -> &wgpu::Limits {
        &self.limits
    }

    /// The first error since the device was opened: a lost device, an allocation that failed. What was
    /// computed from then on cannot be trusted, and no one should go on using the device.
    pub fn error(&self) -> Option<String> {
        self.error.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Whether the device can still be used.
    ///
    /// # Errors
    /// [`Gpu::error`].
    pub fn check(&self) -> Result<(), String> {
        self.error().map_or(Ok(()), Err)
    }

    /// Waits for a submission and runs the callbacks of buffers mapped by then; `None` for the last one.
    ///
    /// # Errors
    /// [`Gpu::error`].
    pub fn wait(&self, submission: Option<wgpu::SubmissionIndex>) -> Result<(), String> {
        self.run_callbacks(wgpu::PollType::Wait { submission_index: submission, timeout: None })
    }

    /// Runs the callbacks of buffers that are mapped by now, without waiting.
    ///
    /// # Errors
    /// [`Gpu::error`].
    pub fn poll(&self) -> Result<(), String> {
        self.run_callbacks(wgpu::PollType::Poll)
    }

    fn run_callbacks(&self, how: wgpu::PollType) -> Result<(), String> {
        // A lost device is a panic there.
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

/// Keeps an error if it is the first.
fn note(first: &Mutex<Option<String>>, error: &str) {
    let mut first = first.lock().unwrap_or_else(PoisonError::into_inner);
    if first.is_none() {
        *first = Some(error.split_whitespace().collect::<Vec<_>>().join(" "));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::probe;
    use crate::testing::adapter_or_skip;

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
    fn a_device_that_failed_is_not_given_out_again() {
        let Some(gpu) = adapter_or_skip(Gpu::fresh(AdapterKind::Software)) else { return };
        assert_eq!(gpu.error(), None);
        gpu.device().destroy();
        let _ = gpu.wait(None);
        assert!(gpu.wait(None).is_err() && gpu.error().is_some());
    }
}
