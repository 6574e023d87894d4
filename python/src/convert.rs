//! Conversion of plain Python values to TOML and CBOR and back.

use ciborium::Value;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};

/// Converts an error to a Python exception with the message of the terminal.
pub(crate) fn error(error: anyhow::Error) -> PyErr {
    PyValueError::new_err(swerve_report::output::message(&error))
}

/// Converts a CBOR value to plain Python: dictionaries, lists, numbers, texts, bytes.
pub(crate) fn plain<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Null => py.None().into_bound(py),
        Value::Bool(yes) => PyBool::new(py, *yes).to_owned().into_any(),
        Value::Integer(number) => i128::from(*number).into_pyobject(py)?.into_any(),
        Value::Float(number) => PyFloat::new(py, *number).into_any(),
        Value::Text(text) => PyString::new(py, text).into_any(),
        Value::Bytes(bytes) => PyBytes::new(py, bytes).into_any(),
        Value::Array(values) => {
            let list = PyList::empty(py);
            values.iter().try_for_each(|value| list.append(plain(py, value)?))?;
            list.into_any()
        }
        Value::Map(entries) => {
            let dict = PyDict::new(py);
            for (key, value) in entries {
                dict.set_item(plain(py, key)?, plain(py, value)?)?;
            }
            dict.into_any()
        }
        other => return Err(PyTypeError::new_err(format!("no message has a value such as {other:?}"))),
    })
}

/// Converts plain Python to a CBOR value.
pub(crate) fn cbor_value(any: &Bound<'_, PyAny>) -> PyResult<Value> {
    if any.is_none() {
        return Ok(Value::Null);
    }
    if let Ok(yes) = any.cast::<PyBool>() {
        return Ok(Value::Bool(yes.is_true()));
    }
    if let Ok(number) = any.cast::<PyInt>() {
        let number: i128 = number.extract()?;
        let fits = number.try_into().map_err(|_| PyValueError::new_err(format!("{number} is too big")))?;
        return Ok(Value::Integer(fits));
    }
    if let Ok(number) = any.cast::<PyFloat>() {
        return Ok(Value::Float(number.extract()?));
    }
    if let Ok(text) = any.cast::<PyString>() {
        return Ok(Value::Text(text.extract()?));
    }
    if let Ok(bytes) = any.cast::<PyBytes>() {
        return Ok(Value::Bytes(bytes.as_bytes().to_vec()));
    }
    if let Ok(dict) = any.cast::<PyDict>() {
        let entries = dict.iter().map(|(key, value)| Ok((cbor_value(&key)?, cbor_value(&value)?)));
        return Ok(Value::Map(entries.collect::<PyResult<_>>()?));
    }
    if any.is_instance_of::<PyList>() || any.is_instance_of::<PyTuple>() {
        let values = any.try_iter()?.map(|value| cbor_value(&value?));
        return Ok(Value::Array(values.collect::<PyResult<_>>()?));
    }
    // NumPy numbers are accepted, too.
    if let Ok(number) = any.extract::<f64>() {
        return Ok(Value::Float(number));
    }
    Err(PyTypeError::new_err(format!("a message cannot hold {}", any.repr()?)))
}

/// CBOR value of Rust data.
pub(crate) fn cbor_of(data: &impl serde::Serialize) -> PyResult<Value> {
    Value::serialized(data).map_err(|error| PyValueError::new_err(error.to_string()))
}

/// Encodes plain Python as CBOR.
pub(crate) fn cbor(any: &Bound<'_, PyAny>) -> PyResult<Vec<u8>> {
    let mut bytes = Vec::new();
    ciborium::into_writer(&cbor_value(any)?, &mut bytes)
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    Ok(bytes)
}

/// Decodes CBOR to plain Python.
pub(crate) fn read_cbor<'py>(py: Python<'py>, bytes: &[u8]) -> PyResult<Bound<'py, PyAny>> {
    let value: Value =
        ciborium::from_reader(bytes).map_err(|error| PyValueError::new_err(error.to_string()))?;
    plain(py, &value)
}

/// Decodes CBOR to plain Python.
#[pyfunction]
pub(crate) fn from_cbor<'py>(py: Python<'py>, bytes: &[u8]) -> PyResult<Bound<'py, PyAny>> {
    read_cbor(py, bytes)
}

/// Encodes plain Python as CBOR.
#[pyfunction]
pub(crate) fn to_cbor<'py>(py: Python<'py>, value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyBytes>> {
    Ok(PyBytes::new(py, &cbor(value)?))
}

/// Converts a value to TOML.
fn toml_value(any: &Bound<'_, PyAny>) -> PyResult<toml::Value> {
    if let Ok(yes) = any.cast::<PyBool>() {
        return Ok(toml::Value::Boolean(yes.is_true()));
    }
    if let Ok(number) = any.cast::<PyInt>() {
        return Ok(toml::Value::Integer(number.extract()?));
    }
    if let Ok(text) = any.cast::<PyString>() {
        return Ok(toml::Value::String(text.extract()?));
    }
    if let Ok(dict) = any.cast::<PyDict>() {
        return Ok(toml::Value::Table(toml_table(dict)?));
    }
    if any.is_instance_of::<PyList>() || any.is_instance_of::<PyTuple>() {
        let values = any.try_iter()?.map(|value| toml_value(&value?));
        return Ok(toml::Value::Array(values.collect::<PyResult<_>>()?));
    }
    if let Ok(number) = any.extract::<f64>() {
        return Ok(toml::Value::Float(number));
    }
    Err(PyTypeError::new_err(format!("a configuration cannot hold {}", any.repr()?)))
}

/// Converts a dictionary to a TOML table; `None` entries are left out.
pub(crate) fn toml_table(dict: &Bound<'_, PyDict>) -> PyResult<toml::Table> {
    let mut table = toml::Table::new();
    for (key, value) in dict.iter().filter(|(_, value)| !value.is_none()) {
        table.insert(key.extract()?, toml_value(&value)?);
    }
    Ok(table)
}

/// Converts a dictionary to assignments of dotted keys, as for `--set`.
pub(crate) fn sets(dict: Option<&Bound<'_, PyDict>>) -> PyResult<Vec<(String, toml::Value)>> {
    let Some(dict) = dict else { return Ok(Vec::new()) };
    dict.iter().map(|(key, value)| Ok((key.extract()?, toml_value(&value)?))).collect()
}
