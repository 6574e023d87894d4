//! Points of a PLY file: text, or binary with the least byte first. Other elements than vertices and lists come after the
//! vertices or not at all.

use nalgebra::Vector3;
use thiserror::Error;

/// Most points of a file: those of a scan, not of a town.
pub const POINTS_MAX: usize = 20_000_000;
/// Longest header, bytes.
const HEADER_MAX: usize = 1 << 16;

/// Why bytes are no point cloud.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum PlyError {
    /// It begins otherwise.
    #[error("expected a PLY file: its first line is `ply`, and its header ends with a line `end_header`")]
    NoHeader,
    /// A line of the header.
    #[error("line {line}: expected {expected}, found `{found}`")]
    Header {
        /// From 1.
        line: usize,
        /// What belongs there.
        expected: &'static str,
        /// What is there.
        found: String,
    },
    /// A coordinate is not among the properties.
    #[error("element vertex: expected properties x, y and z of type float or double, `{0}` is missing")]
    NoCoordinate(&'static str),
    /// The file ends early.
    #[error("truncated: the header tells of {expected} points, the file ends in point {found}")]
    Truncated {
        /// Points by the header.
        expected: usize,
        /// Whole ones, from 0.
        found: usize,
    },
    /// A line of a point.
    #[error("point {0}: expected a number for each property")]
    NoNumber(usize),
}

/// Type of a property: its bytes, and whether it is a float.
#[derive(Clone, Copy)]
struct Kind {
    bytes: usize,
    is_float: bool,
}

fn kind(name: &str) -> Option<Kind> {
    let (bytes, is_float) = match name {
        "char" | "uchar" | "int8" | "uint8" => (1, false),
        "short" | "ushort" | "int16" | "uint16" => (2, false),
        "int" | "uint" | "int32" | "uint32" => (4, false),
        "float" | "float32" => (4, true),
        "double" | "float64" => (8, true),
        _ => return None,
    };
    Some(Kind { bytes, is_float })
}

/// Where the points are.
struct Layout {
    is_text: bool,
    points: usize,
    /// Name and type of each property of a vertex.
    properties: Vec<(String, Kind)>,
    /// Bytes of the header.
    header: usize,
}

/// The points of a file, in its order; coordinates that are no numbers stay in it.
///
/// # Errors
/// What is wrong with it.
pub fn read(bytes: &[u8]) -> Result<Vec<Vector3<f64>>, PlyError> {
    let layout = layout(bytes)?;
    let places = ["x", "y", "z"].map(|axis| {
        let place = layout.properties.iter().position(|(name, kind)| name == axis && kind.is_float);
        place.ok_or(PlyError::NoCoordinate(axis))
    });
    let [x, y, z] = places;
    let places = [x?, y?, z?];
    let body = &bytes[layout.header..];
    if layout.is_text { text(&layout, places, body) } else { binary(&layout, places, body) }
}

fn layout(bytes: &[u8]) -> Result<Layout, PlyError> {
    let head = &bytes[..bytes.len().min(HEADER_MAX)];
    let (mut at, mut line) = (0, 0);
    let (mut is_text, mut points, mut properties) = (None, None, Vec::new());
    let mut in_vertices = false;
    loop {
        let rest = &head[at..];
        let len = rest.iter().position(|byte| *byte == b'\n').ok_or(PlyError::NoHeader)?;
        let words = String::from_utf8_lossy(&rest[..len]);
        let words = words.trim_end_matches('\r');
        at += len + 1;
        line += 1;
        let wrong = |expected| PlyError::Header { line, expected, found: words.chars().take(80).collect() };
        if line == 1 {
            if words != "ply" {
                return Err(PlyError::NoHeader);
            }
            continue;
        }
        let all: Vec<_> = words.split_ascii_whitespace().collect();
        match all[..] {
            [] | ["comment" | "obj_info", ..] => {}
            ["format", "ascii", "1.0"] => is_text = Some(true),
            ["format", "binary_little_endian", "1.0"] => is_text = Some(false),
            ["format", ..] => return Err(wrong("`format ascii 1.0` or `format binary_little_endian 1.0`")),
            ["element", "vertex", count] => {
                let count = count.parse().ok().filter(|count| *count <= POINTS_MAX);
                points = Some(count.ok_or_else(|| wrong("at most 20 million points"))?);
                in_vertices = true;
            }
            ["element", _, _] if points.is_some() => in_vertices = false,
            ["element", ..] => return Err(wrong("`element vertex COUNT` before other elements")),
            ["property", "list", ..] if in_vertices => {
                return Err(wrong("no list among the properties of a vertex"));
            }
            ["property", of, name] if in_vertices => {
                let kind = kind(of).ok_or_else(|| wrong("a type of PLY, such as `float`"))?;
                properties.push((name.to_owned(), kind));
            }
            ["property", ..] if points.is_some() => {}
            ["end_header"] => break,
            _ => return Err(wrong("a line of a header: format, comment, element, property or end_header")),
        }
    }
    let missing = |expected| PlyError::Header { line, expected, found: "end_header".to_owned() };
    Ok(Layout {
        is_text: is_text.ok_or_else(|| missing("a line `format` before it"))?,
        points: points.ok_or_else(|| missing("a line `element vertex COUNT` before it"))?,
        properties,
        header: at,
    })
}

fn binary(layout: &Layout, places: [usize; 3], body: &[u8]) -> Result<Vec<Vector3<f64>>, PlyError> {
    let size: usize = layout.properties.iter().map(|(_, kind)| kind.bytes).sum();
    if body.len() / size < layout.points {
        return Err(PlyError::Truncated { expected: layout.points, found: body.len() / size });
    }
    let columns = places.map(|place| {
        let before: usize = layout.properties[..place].iter().map(|(_, kind)| kind.bytes).sum();
        (before, layout.properties[place].1.bytes)
    });
    let number = |row: &[u8], (from, len): (usize, usize)| {
        let cell = &row[from..from + len];
        let single = cell.try_into().map(f32::from_le_bytes).map(f64::from);
        single.or_else(|_| cell.try_into().map(f64::from_le_bytes)).unwrap_or(f64::NAN)
    };
    let rows = body.chunks_exact(size).take(layout.points);
    Ok(rows.map(|row| Vector3::from(columns.map(|column| number(row, column)))).collect())
}

fn text(layout: &Layout, places: [usize; 3], body: &[u8]) -> Result<Vec<Vector3<f64>>, PlyError> {
    let mut points = Vec::new();
    let rows = body.split(|byte| *byte == b'\n').filter(|row| !row.trim_ascii().is_empty());
    for row in rows.take(layout.points) {
        let wrong = || PlyError::NoNumber(points.len());
        let row = str::from_utf8(row).map_err(|_| wrong())?;
        let cells: Vec<f64> = row
            .split_ascii_whitespace()
            .map(|cell| cell.parse().map_err(|_| wrong()))
            .collect::<Result<_, _>>()?;
        if cells.len() != layout.properties.len() {
            return Err(wrong());
        }
        points.push(Vector3::from(places.map(|place| cells[place])));
    }
    let found = points.len();
    if found < layout.points {
        Err(PlyError::Truncated { expected: layout.points, found })
    } else {
        Ok(points)
    }
}

#[cfg(test)]
mod tests;
