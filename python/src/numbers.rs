//! Zero-copy arrays for NumPy.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use swerve_flow::{AnyMessage, ErasedPayload};
use swerve_msg::{Image, Packable, Pixels, PointCloud};

/// Numbers in this module's memory that NumPy reads in place (`numpy.asarray`), without a copy and read-only.
#[pyclass(frozen, module = "swerve._swerve")]
pub(crate) struct Numbers {
    /// Owner of the numbers, which keeps them alive.
    _of: Arc<dyn ErasedPayload>,
    address: usize,
    shape: Vec<usize>,
    kind: &'static str,
}

#[pymethods]
impl Numbers {
    /// NumPy array interface, version 3.
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let interface = PyDict::new(py);
        interface.set_item("version", 3)?;
        interface.set_item("shape", PyTuple::new(py, &self.shape)?)?;
        interface.set_item("typestr", self.kind)?;
        interface.set_item("data", (self.address, true))?;
        Ok(interface)
    }

    /// Address of the first number.
    #[getter]
    fn address(&self) -> usize {
        self.address
    }
}

/// NumPy name of a number type.
trait Kind: Packable {
    const NAME: &'static str;
}

impl Kind for u8 {
    const NAME: &'static str = "|u1";
}
impl Kind for u16 {
    const NAME: &'static str = "<u2";
}
impl Kind for u32 {
    const NAME: &'static str = "<u4";
}
impl Kind for f32 {
    const NAME: &'static str = "<f4";
}

fn view<T: Kind>(of: &Arc<dyn ErasedPayload>, numbers: &[T], shape: Vec<usize>) -> Numbers {
    // An empty array has no address, and NumPy expects none for it.
    let address = if numbers.is_empty() { 0 } else { numbers.as_ptr().addr() };
    let shape = if shape.iter().product::<usize>() == numbers.len() { shape } else { vec![numbers.len()] };
    Numbers { _of: of.clone(), address, shape, kind: T::NAME }
}

/// Pixels of an image.
fn pixels(of: &Arc<dyn ErasedPayload>, image: &Image) -> Numbers {
    let (rows, columns) = (image.height_px as usize, image.width_px as usize);
    match &image.pixels {
        Pixels::Rgb8(numbers) => view(of, numbers, vec![rows, columns, 3]),
        Pixels::ClassU8(numbers) => view(of, numbers, vec![rows, columns]),
        Pixels::DepthF32M(numbers) => view(of, numbers, vec![rows, columns]),
        Pixels::InstanceU32(numbers) => view(of, numbers, vec![rows, columns]),
    }
}

/// Converts a message to plain Python, with zero-copy numbers of images and point clouds.
pub(crate) fn plain<'py>(py: Python<'py>, message: &AnyMessage) -> PyResult<Bound<'py, PyAny>> {
    let of = &message.payload;
    let any = (**of).as_any();
    if let Some(image) = any.downcast_ref::<Image>() {
        let Image { stamp, width_px, height_px, camera, ref pixels } = *image;
        let empty = Image { stamp, width_px, height_px, camera, pixels: Pixels::new(pixels.encoding()) };
        let dict = plain_payload(py, &empty)?;
        dict.set_item("pixels", self::pixels(of, image))?;
        return Ok(dict);
    }
    if let Some(cloud) = any.downcast_ref::<PointCloud>() {
        let empty = PointCloud { stamp: cloud.stamp, ..PointCloud::default() };
        let dict = plain_payload(py, &empty)?;
        let floats = [
            ("x_m", &cloud.x_m),
            ("y_m", &cloud.y_m),
            ("z_m", &cloud.z_m),
            ("intensity", &cloud.intensity),
            ("time_offset_s", &cloud.time_offset_s),
        ];
        for (name, numbers) in floats {
            dict.set_item(name, view(of, numbers, vec![numbers.len()]))?;
        }
        dict.set_item("ring", view(of, &cloud.ring, vec![cloud.ring.len()]))?;
        return Ok(dict);
    }
    plain_payload(py, &**of)
}

fn plain_payload<'py>(py: Python<'py>, payload: &dyn ErasedPayload) -> PyResult<Bound<'py, PyAny>> {
    let mut bytes = Vec::new();
    payload.to_cbor(&mut bytes);
    crate::convert::read_cbor(py, &bytes)
}

/// Image carried by a message, for NumPy.
pub(crate) fn image(payload: &Arc<dyn ErasedPayload>) -> Option<Numbers> {
    (**payload).as_any().downcast_ref::<Image>().map(|image| pixels(payload, image))
}
