//! Reader of points in PLY files: ASCII, binary little-endian and binary big-endian, with arbitrary additional
//! elements and properties, lists included. Header lines end with LF, CR LF or CR.

use nalgebra::Vector3;
use thiserror::Error;

/// Largest number of points of a file.
pub const POINTS_MAX: usize = 20_000_000;
/// Largest length of the header, bytes.
const HEADER_MAX: usize = 1 << 16;

/// Error of reading a point cloud.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum PlyError {
    /// The header is missing.
    #[error("expected a PLY file: its first line is `ply`, and its header ends with a line `end_header`")]
    NoHeader,
    /// A line of the header is invalid.
    #[error("line {line}: expected {expected}, found `{found}`")]
    Header {
        /// Line number, from 1.
        line: usize,
        /// Expected content.
        expected: &'static str,
        /// Content of the line.
        found: String,
    },
    /// A coordinate is missing among the properties.
    #[error("element vertex: expected properties x, y and z with a number each, `{0}` is missing")]
    NoCoordinate(&'static str),
    /// The file is truncated.
    #[error("truncated: the header announces {expected} points, the file ends in point {found}")]
    Truncated {
        /// Number of points in the header.
        expected: usize,
        /// Number of complete points in the file.
        found: usize,
    },
    /// A value of a point is not a number.
    #[error("point {0}: expected a number for each property")]
    NoNumber(usize),
}

/// Numeric type of a property.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Kind {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// A property: one number, or a list preceded by its length.
#[derive(Clone, Copy)]
enum Shape {
    One(Kind),
    List { length: Kind, item: Kind },
}

struct Element {
    count: usize,
    properties: Vec<(String, Shape)>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    Text,
    LittleEndian,
    BigEndian,
}

/// Parsed header.
struct Layout {
    form: Form,
    /// Elements before the vertices.
    before: Vec<Element>,
    vertices: Element,
    /// Length of the header, bytes.
    header: usize,
}

/// Reads the points of a file in order; coordinates that are not finite are kept.
///
/// # Errors
/// The first error in the header or in a point.
pub fn read(bytes: &[u8]) -> Result<Vec<Vector3<f64>>, PlyError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let layout = layout(bytes)?;
    let [x, y, z] = ["x", "y", "z"].map(|axis| {
        let is_axis = |(name, shape): &(String, Shape)| name == axis && matches!(shape, Shape::One(_));
        layout.vertices.properties.iter().position(is_axis).ok_or(PlyError::NoCoordinate(axis))
    });
    let places = [x?, y?, z?];
    let body = &bytes[layout.header..];
    let mut reader: Box<dyn Numbers> = match layout.form {
        Form::Text => Box::new(Text { rows: body.split(|byte| matches!(byte, b'\n' | b'\r')), row: b"" }),
        form => Box::new(Binary { rest: body, is_big_endian: form == Form::BigEndian }),
    };
    let truncated = |found| PlyError::Truncated { expected: layout.vertices.count, found };
    for element in &layout.before {
        reader.skip(element).ok_or_else(|| truncated(0))?;
    }
    let mut points = Vec::new();
    for k in 0..layout.vertices.count {
        points.push(point(&mut *reader, &layout.vertices, places).map_err(|end| match end {
            End::Truncated => truncated(k),
            End::NoNumber => PlyError::NoNumber(k),
        })?);
    }
    Ok(points)
}

/// Error within a row.
enum End {
    Truncated,
    NoNumber,
}

/// Reader of numbers in the order of the file.
trait Numbers {
    /// Advances to the next row, which holds one element.
    fn next_row(&mut self) -> Result<(), End>;
    fn number(&mut self, kind: Kind) -> Result<f64, End>;
    /// Checks that the row has no further numbers.
    fn end_row(&mut self) -> Result<(), End>;
    /// Skips all rows of an element.
    fn skip(&mut self, element: &Element) -> Option<()>;
}

fn point(from: &mut dyn Numbers, vertex: &Element, places: [usize; 3]) -> Result<Vector3<f64>, End> {
    let mut point = Vector3::zeros();
    from.next_row()?;
    for (k, (_, shape)) in vertex.properties.iter().enumerate() {
        match *shape {
            Shape::One(kind) => {
                let value = from.number(kind)?;
                if let Some(axis) = places.iter().position(|place| *place == k) {
                    point[axis] = value;
                }
            }
            Shape::List { length, item } => {
                for _ in 0..list_length(from.number(length)?)? {
                    from.number(item)?;
                }
            }
        }
    }
    from.end_row()?;
    Ok(point)
}

fn list_length(value: f64) -> Result<u64, End> {
    if value >= 0.0 && value.fract() == 0.0 { Ok(value as u64) } else { Err(End::NoNumber) }
}

struct Binary<'a> {
    rest: &'a [u8],
    is_big_endian: bool,
}

impl Binary<'_> {
    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], End> {
        let (first, rest) = self.rest.split_first_chunk::<N>().ok_or(End::Truncated)?;
        self.rest = rest;
        let mut bytes = *first;
        if self.is_big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }
}

impl Numbers for Binary<'_> {
    fn next_row(&mut self) -> Result<(), End> {
        Ok(())
    }

    fn number(&mut self, kind: Kind) -> Result<f64, End> {
        Ok(match kind {
            Kind::I8 => f64::from(i8::from_le_bytes(self.bytes()?)),
            Kind::U8 => f64::from(u8::from_le_bytes(self.bytes()?)),
            Kind::I16 => f64::from(i16::from_le_bytes(self.bytes()?)),
            Kind::U16 => f64::from(u16::from_le_bytes(self.bytes()?)),
            Kind::I32 => f64::from(i32::from_le_bytes(self.bytes()?)),
            Kind::U32 => f64::from(u32::from_le_bytes(self.bytes()?)),
            Kind::F32 => f64::from(f32::from_le_bytes(self.bytes()?)),
            Kind::F64 => f64::from_le_bytes(self.bytes()?),
        })
    }

    fn end_row(&mut self) -> Result<(), End> {
        Ok(())
    }

    fn skip(&mut self, element: &Element) -> Option<()> {
        let size = |(_, shape): &(String, Shape)| match shape {
            Shape::One(kind) => Some(kind.bytes()),
            Shape::List { .. } => None,
        };
        if let Some(size) = element.properties.iter().map(size).sum::<Option<usize>>() {
            self.rest = self.rest.get(size.checked_mul(element.count)?..)?;
            return Some(());
        }
        for _ in 0..element.count {
            for (_, shape) in &element.properties {
                let size = match *shape {
                    Shape::One(kind) => kind.bytes(),
                    Shape::List { length, item } => {
                        let length = list_length(self.number(length).ok()?).ok()?;
                        usize::try_from(length).ok()?.checked_mul(item.bytes())?
                    }
                };
                self.rest = self.rest.get(size..)?;
            }
        }
        Some(())
    }
}

/// Reader of text with one line per row; empty lines are skipped.
struct Text<'a, R> {
    rows: R,
    row: &'a [u8],
}

impl<'a, R: Iterator<Item = &'a [u8]>> Numbers for Text<'a, R> {
    fn next_row(&mut self) -> Result<(), End> {
        self.row = self.rows.find(|row| !row.trim_ascii().is_empty()).ok_or(End::Truncated)?;
        Ok(())
    }

    fn number(&mut self, _: Kind) -> Result<f64, End> {
        let row = self.row.trim_ascii_start();
        let end = row.iter().position(u8::is_ascii_whitespace).unwrap_or(row.len());
        let (word, rest) = row.split_at(end);
        self.row = rest;
        str::from_utf8(word).ok().and_then(|word| word.parse().ok()).ok_or(End::NoNumber)
    }

    fn end_row(&mut self) -> Result<(), End> {
        if self.row.trim_ascii().is_empty() { Ok(()) } else { Err(End::NoNumber) }
    }

    fn skip(&mut self, element: &Element) -> Option<()> {
        (0..element.count).try_for_each(|_| self.next_row()).ok()
    }
}

/// Lines of a header, each with its number from 1 and the offset after it.
fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, usize, &[u8])> {
    let head = &bytes[..bytes.len().min(HEADER_MAX)];
    // The first line determines the line ending: after `\r` alone, a binary body may begin with any byte.
    let end = head.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(0);
    let ending: &[u8] = match head.get(end..) {
        Some([b'\r', b'\n', ..]) => b"\r\n",
        Some([b'\r', ..]) => b"\r",
        _ => b"\n",
    };
    let (mut at, mut number) = (0, 0);
    core::iter::from_fn(move || {
        let len = head[at..].windows(ending.len()).position(|next| next == ending)?;
        let line = &head[at..at + len];
        at += len + ending.len();
        number += 1;
        Some((number, at, line))
    })
}

fn layout(bytes: &[u8]) -> Result<Layout, PlyError> {
    let mut form = None;
    let mut elements: Vec<(String, Element)> = Vec::new();
    let mut lines = lines(bytes);
    let first = lines.next().is_some_and(|(_, _, line)| line.trim_ascii_end() == b"ply");
    first.then_some(()).ok_or(PlyError::NoHeader)?;
    loop {
        let (line, header, words) = lines.next().ok_or(PlyError::NoHeader)?;
        let words = String::from_utf8_lossy(words);
        let wrong = |expected| PlyError::Header { line, expected, found: words.chars().take(80).collect() };
        let of_type = |name: &str| Kind::named(name).ok_or_else(|| wrong("a type of PLY, such as `float`"));
        match words.split_ascii_whitespace().collect::<Vec<_>>()[..] {
            [] | ["comment" | "obj_info", ..] => {}
            ["format", "ascii", "1.0"] => form = Some(Form::Text),
            ["format", "binary_little_endian", "1.0"] => form = Some(Form::LittleEndian),
            ["format", "binary_big_endian", "1.0"] => form = Some(Form::BigEndian),
            ["format", ..] => {
                return Err(wrong(
                    "`format ascii`, `binary_little_endian` or `binary_big_endian`, and `1.0`",
                ));
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| wrong("`element NAME COUNT`"))?;
                if name == "vertex" && count > POINTS_MAX {
                    return Err(wrong("at most 20 million points"));
                }
                elements.push((name.to_owned(), Element { count, properties: Vec::new() }));
            }
            ["property", ..] if elements.is_empty() => {
                return Err(wrong("`element NAME COUNT` before properties"));
            }
            ["property", "list", length, item, name] => {
                let shape = Shape::List { length: of_type(length)?, item: of_type(item)? };
                elements
                    .last_mut()
                    .into_iter()
                    .for_each(|(_, e)| e.properties.push((name.to_owned(), shape)));
            }
            ["property", kind, name] => {
                let shape = Shape::One(of_type(kind)?);
                elements
                    .last_mut()
                    .into_iter()
                    .for_each(|(_, e)| e.properties.push((name.to_owned(), shape)));
            }
            ["end_header"] => {
                let missing = |expected| PlyError::Header { line, expected, found: "end_header".to_owned() };
                let vertices = elements.iter().position(|(name, _)| name == "vertex");
                let vertices = vertices.ok_or_else(|| missing("a line `element vertex COUNT` before it"))?;
                let mut before: Vec<Element> =
                    elements.into_iter().take(vertices + 1).map(|(_, e)| e).collect();
                let vertices = before.pop().ok_or(PlyError::NoHeader)?;
                let form = form.ok_or_else(|| missing("a line `format` before it"))?;
                return Ok(Layout { form, before, vertices, header });
            }
            _ => return Err(wrong("a line of a header: format, comment, element, property or end_header")),
        }
    }
}

#[cfg(test)]
mod tests;
