//! The messages of a stream: as columns of numbers, and individually.

use ciborium::Value;
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList, PyType};
use swerve_core::Time;
use swerve_flow::{Event, Observer, Publication};
use swerve_log::PublicationRecord;
use swerve_msg::truth::PointInstances;
use swerve_msg::{Image, PointCloud};

/// The messages of one stream.
#[pyclass(frozen, module = "swerve._swerve")]
#[derive(Default)]
pub(crate) struct StreamData {
    /// Stream name.
    #[pyo3(get)]
    name: String,
    /// Name of the operator that publishes it.
    #[pyo3(get)]
    operator: String,
    /// Rust type of its messages.
    #[pyo3(get)]
    type_name: String,
    stamps: Vec<i64>,
    visible_at: Vec<i64>,
    origins: Vec<i64>,
    /// All payloads as CBOR, concatenated.
    bytes: Vec<u8>,
    /// End offset of each payload.
    ends: Vec<usize>,
}

/// Marks a missing origin.
const NO_ORIGIN: i64 = i64::MIN;

/// Maximum length of arrays that become separate columns.
const ARRAY_MAX: usize = 8;

fn ns(time: Time) -> i64 {
    time.ns()
}

impl StreamData {
    fn new(name: &str, operator: &str, type_name: &str) -> Self {
        Self { name: name.into(), operator: operator.into(), type_name: type_name.into(), ..Self::default() }
    }

    fn push_header(&mut self, stamp: Time, visible_at: Time, origin: Option<Time>) {
        self.stamps.push(ns(stamp));
        self.visible_at.push(ns(visible_at));
        self.origins.push(origin.map_or(NO_ORIGIN, ns));
        self.ends.push(self.bytes.len());
    }

    fn payload(&self, index: usize) -> &[u8] {
        let begin = index.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.bytes[begin..self.ends[index]]
    }
}

/// Streams of a run or a log, in the order of their first message.
#[derive(Default)]
pub(crate) struct Streams(Vec<StreamData>);

impl Streams {
    fn of(&mut self, name: &str, operator: &str, type_name: impl FnOnce() -> String) -> &mut StreamData {
        let index = self.0.iter().position(|stream| stream.name == name).unwrap_or_else(|| {
            self.0.push(StreamData::new(name, operator, &type_name()));
            self.0.len() - 1
        });
        &mut self.0[index]
    }

    /// Adds a message of a log.
    pub(crate) fn take(&mut self, record: &PublicationRecord) {
        let info = &record.stream;
        let stream = self.of(&info.stream, &info.operator, || info.type_name.clone());
        stream.bytes.extend_from_slice(&record.payload_cbor);
        let header = &record.header;
        stream.push_header(header.stamp, header.visible_at, header.origin);
    }

    /// Converts to a dictionary by name.
    pub(crate) fn into_dict(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let dict = PyDict::new(py);
        for stream in self.0 {
            dict.set_item(stream.name.clone(), Bound::new(py, stream)?)?;
        }
        Ok(dict)
    }
}

/// Collects the messages of a run.
pub(crate) struct Capture {
    pub(crate) streams: Streams,
    /// Streams to keep; all if `None`.
    wanted: Option<Vec<String>>,
}

impl Capture {
    pub(crate) fn new(wanted: Option<Vec<String>>) -> Self {
        Self { streams: Streams::default(), wanted }
    }

    /// Refuses names that are not among those of all streams.
    pub(crate) fn check(&self, known: &[&str]) -> anyhow::Result<()> {
        let unknown = |name: &&String| !known.contains(&name.as_str());
        if let Some(name) = self.wanted.iter().flatten().find(unknown) {
            let near = swerve_text::did_you_mean(name, known.iter().copied());
            anyhow::bail!("streams: unknown stream `{name}`, expected some of {}{near}", known.join(", "));
        }
        Ok(())
    }

    /// Images and point clouds are large: they are kept only if requested by name.
    fn wants(&self, publication: &Publication<'_>) -> bool {
        match (&self.wanted, publication.payload) {
            (_, None) => false,
            (Some(names), _) => names.iter().any(|name| name == publication.stream),
            (None, Some(payload)) => {
                !(payload.is::<Image>() || payload.is::<PointCloud>() || payload.is::<PointInstances>())
            }
        }
    }
}

impl Observer for Capture {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        if !self.wants(publication) {
            return;
        }
        let (Some(payload), Some(stamp)) = (publication.payload, publication.stamp) else { return };
        let type_name = || payload.type_name().to_owned();
        let stream = self.streams.of(publication.stream, publication.operator, type_name);
        payload.to_cbor(&mut stream.bytes);
        stream.push_header(stamp, publication.visible_at, publication.origin);
    }
}

/// One entry of a column.
enum Cell {
    Nothing,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
}

/// Columns by name, in order of first occurrence.
#[derive(Default)]
struct Columns(Vec<(String, Vec<Cell>)>);

impl Columns {
    /// Adds an entry of a row; fills earlier rows without one.
    fn note(&mut self, name: &str, row: usize, cell: Cell) {
        let index = self.0.iter().position(|(known, _)| known == name).unwrap_or_else(|| {
            self.0.push((name.to_owned(), Vec::new()));
            self.0.len() - 1
        });
        let cells = &mut self.0[index].1;
        cells.resize_with(row, || Cell::Nothing);
        cells.push(cell);
    }

    fn into_dict(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let dict = PyDict::new(py);
        for (name, cells) in &self.0 {
            dict.set_item(name, column(py, cells)?)?;
        }
        Ok(dict)
    }

    fn walk(&mut self, name: &str, row: usize, value: &Value) {
        match value {
            Value::Null => {}
            Value::Bool(yes) => self.note(name, row, Cell::Bool(*yes)),
            Value::Integer(number) => match i64::try_from(*number) {
                Ok(number) => self.note(name, row, Cell::Int(number)),
                Err(_) => self.note(name, row, Cell::Text(format!("{:016x}", i128::from(*number)))),
            },
            Value::Float(number) => self.note(name, row, Cell::Float(*number)),
            Value::Text(text) => self.note(name, row, Cell::Text(text.clone())),
            Value::Bytes(bytes) => self.note(&within(name, "bytes"), row, Cell::Int(bytes.len() as i64)),
            Value::Map(entries) => {
                for (key, value) in entries {
                    let Value::Text(key) = key else { continue };
                    self.walk(&within(name, key), row, value);
                }
            }
            Value::Array(values) => {
                let number = |value: &Value| matches!(value, Value::Float(_) | Value::Integer(_));
                if !values.is_empty() && values.len() <= ARRAY_MAX && values.iter().all(number) {
                    for (i, value) in values.iter().enumerate() {
                        self.walk(&within(name, &i.to_string()), row, value);
                    }
                } else {
                    self.note(&within(name, "count"), row, Cell::Int(values.len() as i64));
                }
            }
            _ => {}
        }
    }
}

fn within(name: &str, key: &str) -> String {
    if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") }
}

/// Little-endian bytes of numbers.
pub(crate) fn bytes_of<'py, const N: usize, T>(
    py: Python<'py>,
    numbers: impl IntoIterator<Item = T>,
    bytes: impl Fn(T) -> [u8; N],
) -> Bound<'py, PyBytes> {
    let all: Vec<u8> = numbers.into_iter().flat_map(bytes).collect();
    PyBytes::new(py, &all)
}

/// NumPy type of a column and its bytes; texts as a list.
fn column<'py>(py: Python<'py>, cells: &[Cell]) -> PyResult<(&'static str, Bound<'py, PyAny>)> {
    if cells.iter().any(|cell| matches!(cell, Cell::Text(_))) {
        let text = |cell: &Cell| match cell {
            Cell::Text(text) => Some(text.clone()),
            Cell::Int(number) => Some(number.to_string()),
            Cell::Float(number) => Some(number.to_string()),
            Cell::Bool(yes) => Some(yes.to_string()),
            Cell::Nothing => None,
        };
        return Ok(("O", PyList::new(py, cells.iter().map(text))?.into_any()));
    }
    if cells.iter().all(|cell| matches!(cell, Cell::Bool(_))) {
        let bytes = bytes_of(py, cells, |cell| [u8::from(matches!(cell, Cell::Bool(true)))]);
        return Ok(("?", bytes.into_any()));
    }
    if cells.iter().all(|cell| matches!(cell, Cell::Int(_))) {
        let bytes = bytes_of(py, cells, |cell| match cell {
            Cell::Int(number) => number.to_le_bytes(),
            _ => [0; 8],
        });
        return Ok(("<i8", bytes.into_any()));
    }
    let bytes = bytes_of(py, cells, |cell| {
        let number = match cell {
            Cell::Int(number) => *number as f64,
            Cell::Float(number) => *number,
            Cell::Bool(yes) => f64::from(u8::from(*yes)),
            Cell::Nothing | Cell::Text(_) => f64::NAN,
        };
        number.to_le_bytes()
    });
    Ok(("<f8", bytes.into_any()))
}

/// Numbers of little-endian bytes.
fn numbers_of(bytes: &[u8]) -> impl Iterator<Item = i64> {
    bytes.chunks_exact(8).map(|chunk| i64::from_le_bytes(chunk.try_into().unwrap_or_default()))
}

/// Parts of a stream, for pickle: name, operator, type; stamps, publication instants and origins; payloads and their ends.
type Parts<'py> = (String, String, String, [Bound<'py, PyBytes>; 3], [Bound<'py, PyBytes>; 2]);

#[pymethods]
impl StreamData {
    /// Puts a stream together from its parts.
    #[new]
    fn of_parts(
        name: String,
        operator: String,
        type_name: String,
        times: [Vec<u8>; 3],
        payloads: [Vec<u8>; 2],
    ) -> PyResult<Self> {
        let [stamps, visible_at, origins] = times.map(|bytes| numbers_of(&bytes).collect::<Vec<i64>>());
        let [bytes, ends] = payloads;
        let ends: Vec<usize> = numbers_of(&ends).filter_map(|end| usize::try_from(end).ok()).collect();
        let count = ends.len();
        let fits = [&stamps, &visible_at, &origins].into_iter().all(|times| times.len() == count);
        if !fits || !ends.is_sorted() || ends.last().copied().unwrap_or(0) != bytes.len() {
            return Err(PyValueError::new_err(format!("stream `{name}`: its parts do not fit together")));
        }
        Ok(Self { name, operator, type_name, stamps, visible_at, origins, bytes, ends })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyType>, Parts<'py>) {
        let (own, py) = (slf.get(), slf.py());
        let times = [own.stamps(py), own.visible_at(py), own.origins(py)];
        let ends = bytes_of(py, &own.ends, |end| (*end as i64).to_le_bytes());
        let payloads = [PyBytes::new(py, &own.bytes), ends];
        let texts = (own.name.clone(), own.operator.clone(), own.type_name.clone());
        (slf.get_type(), (texts.0, texts.1, texts.2, times, payloads))
    }

    fn __len__(&self) -> usize {
        self.ends.len()
    }

    /// Stamps of the messages, nanoseconds, as 64-bit integers.
    fn stamps<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        bytes_of(py, &self.stamps, |ns| ns.to_le_bytes())
    }

    /// Publication instants, nanoseconds.
    fn visible_at<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        bytes_of(py, &self.visible_at, |ns| ns.to_le_bytes())
    }

    /// Stamps of the sensor frames that the messages derive from, nanoseconds; the smallest integer if there is none.
    fn origins<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        bytes_of(py, &self.origins, |ns| ns.to_le_bytes())
    }

    /// CBOR bytes of a message.
    fn cbor<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyBytes>> {
        if index >= self.ends.len() {
            return Err(PyIndexError::new_err(format!("message {index} of {}", self.ends.len())));
        }
        Ok(PyBytes::new(py, self.payload(index)))
    }

    /// A message as plain Python.
    fn plain<'py>(&self, py: Python<'py>, index: usize) -> PyResult<Bound<'py, PyAny>> {
        if index >= self.ends.len() {
            return Err(PyIndexError::new_err(format!("message {index} of {}", self.ends.len())));
        }
        crate::convert::read_cbor(py, self.payload(index))
    }

    /// All numbers, texts and booleans of the messages, by dotted name: their NumPy type, and their bytes or (type `O`)
    /// a list. A list of messages is represented by the column of its length, `name.count`.
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let rows = self.ends.len();
        let columns = py.detach(|| {
            let mut columns = Columns::default();
            for row in 0..rows {
                let value: Value = ciborium::from_reader(self.payload(row))
                    .map_err(|error| PyValueError::new_err(error.to_string()))?;
                columns.walk("", row, &value);
            }
            columns.0.iter_mut().for_each(|(_, cells)| cells.resize_with(rows, || Cell::Nothing));
            Ok::<_, PyErr>(columns)
        })?;
        columns.into_dict(py)
    }

    /// Entries of a list of the messages, by its dotted name: for each entry the index of its message, as bytes, and the
    /// columns, as [`columns`](Self::columns).
    fn entries<'py>(
        &self,
        py: Python<'py>,
        list: &str,
    ) -> PyResult<(Bound<'py, PyBytes>, Bound<'py, PyDict>)> {
        let (mut columns, mut of) = (Columns::default(), Vec::new());
        for row in 0..self.ends.len() {
            let value: Value = ciborium::from_reader(self.payload(row))
                .map_err(|error| PyValueError::new_err(error.to_string()))?;
            for entry in list_at(&value, list) {
                let name = if entry.is_map() { "" } else { "value" };
                columns.walk(name, of.len(), entry);
                of.push(row as i64);
            }
        }
        columns.0.iter_mut().for_each(|(_, cells)| cells.resize_with(of.len(), || Cell::Nothing));
        Ok((bytes_of(py, &of, |row| row.to_le_bytes()), columns.into_dict(py)?))
    }
}

/// Entries of the list at a dotted name; none without such a list.
fn list_at<'a>(value: &'a Value, name: &str) -> &'a [Value] {
    let mut found = value;
    for part in name.split('.') {
        let entries = found.as_map().map_or(&[][..], Vec::as_slice);
        let Some((_, next)) = entries.iter().find(|(key, _)| key.as_text() == Some(part)) else { return &[] };
        found = next;
    }
    found.as_array().map_or(&[], Vec::as_slice)
}
