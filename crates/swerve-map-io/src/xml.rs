//! Bounded reading of XML, and the problems found meanwhile.

use std::collections::BTreeMap;

use roxmltree::{Document, Error, Node, ParsingOptions};
use swerve_text::did_you_mean;

use crate::problem::{PROBLEMS_MAX, Problem, Problems, quoted};

/// Largest size of a file, bytes.
pub const FILE_MAX: u64 = 256 << 20;

/// Largest number of nodes: elements, texts, comments.
const NODES_MAX: u32 = 20_000_000;

/// Deepest nesting of elements.
const NESTING_MAX: usize = 256;

/// Largest number of a file: coordinates in metres and coefficients. Every polynomial of the standard is finite with it
/// over [`LENGTH_MAX_M`](super::opendrive::LENGTH_MAX_M).
const NUMBER_MAX: f64 = 1e9;

/// Most names of unknown elements that are kept; the rest is counted together.
const UNKNOWN_MAX: usize = 100;

/// Parses a file. DTDs are refused, so that there are no entities to expand.
pub fn parse<'t>(file: &str, text: &'t str) -> Result<Document<'t>, Problems> {
    let whole = |line: usize, column: usize, message: String| {
        Problems::new(file, vec![Problem { line, column, element: String::new(), message }], 0)
    };
    if text.len() as u64 > FILE_MAX {
        return Err(whole(
            1,
            1,
            format!("expected at most {} MiB, found {} bytes", FILE_MAX >> 20, text.len()),
        ));
    }
    let options = ParsingOptions { nodes_limit: NODES_MAX, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options).map_err(|error| {
        let at = error.pos();
        let message = match error {
            Error::DtdDetected => "expected no document type (DTD)".to_owned(),
            Error::NodesLimitReached => format!("expected at most {NODES_MAX} nodes"),
            Error::UnclosedRootNode | Error::UnexpectedEndOfStream | Error::NoRootNode => {
                "it ends too early, expected a whole XML document".to_owned()
            }
            error => format!("it is not XML: {error}"),
        };
        // At the end of a truncated text, which the parser does not locate.
        let (line, column) = match message.starts_with("it ends") {
            true => end_of(text),
            false => (at.row as usize, at.col as usize),
        };
        whole(line, column, message)
    })?;
    match too_deep(document.root()) {
        None => Ok(document),
        Some(node) => {
            let at = document.text_pos_at(node.range().start);
            let message = format!("expected at most {NESTING_MAX} nested elements");
            Err(whole(at.row as usize, at.col as usize, message))
        }
    }
}

/// Line and column of the end of a text.
fn end_of(text: &str) -> (usize, usize) {
    let last = text.rsplit('\n').next().unwrap_or("");
    (text.matches('\n').count() + 1, last.chars().count() + 1)
}

/// First element that is nested too deeply; without recursion.
fn too_deep<'a, 't>(root: Node<'a, 't>) -> Option<Node<'a, 't>> {
    let (mut node, mut depth) = (root, 0);
    loop {
        if let Some(child) = node.first_child() {
            (node, depth) = (child, depth + 1);
            if depth > NESTING_MAX {
                return Some(node);
            }
            continue;
        }
        while node.next_sibling().is_none() {
            node = node.parent()?;
            depth -= 1;
        }
        node = node.next_sibling()?;
    }
}

/// A problem at a byte of the text.
struct Finding {
    byte: usize,
    element: String,
    message: String,
}

#[derive(Default)]
struct Findings {
    kept: Vec<Finding>,
    more: usize,
}

impl Findings {
    fn push(&mut self, finding: impl FnOnce() -> Finding) {
        if self.kept.len() < PROBLEMS_MAX {
            self.kept.push(finding());
        } else {
            self.more += 1;
        }
    }

    /// Resolves all places in one pass over the text.
    fn resolved(mut self, file: &str, text: &str) -> Problems {
        self.kept.sort_by_key(|finding| finding.byte);
        let (mut line, mut line_start, mut from) = (1, 0, 0);
        let mut problems = Vec::with_capacity(self.kept.len());
        for Finding { byte, element, message } in self.kept {
            for (k, _) in text[from..byte].match_indices('\n') {
                (line, line_start) = (line + 1, from + k + 1);
            }
            from = byte;
            let column = text[line_start..byte].chars().count() + 1;
            problems.push(Problem { line, column, element, message });
        }
        Problems::new(file, problems, self.more)
    }
}

/// Reads elements and attributes and collects what is wrong with them.
#[derive(Default)]
pub struct Reader {
    /// Problems with which the file cannot be read.
    faults: Findings,
    /// Problems that leave the geometry as it is.
    defects: Findings,
    unknown: BTreeMap<String, usize>,
}

/// An element of the file.
pub type Element<'a> = Node<'a, 'a>;

impl Reader {
    /// Faults, defects and the number of unknown elements by name.
    pub fn finish(self, file: &str, text: &str) -> (Problems, Problems, BTreeMap<String, usize>) {
        (self.faults.resolved(file, text), self.defects.resolved(file, text), self.unknown)
    }

    /// Number of faults so far: where it grows, what follows from wrong values is not reported.
    pub fn faults(&self) -> usize {
        self.faults.kept.len() + self.faults.more
    }

    /// Reports that an element cannot be read.
    pub fn fault(&mut self, at: Element<'_>, message: impl FnOnce() -> String) {
        self.faults.push(|| finding(at, None, message()));
    }

    /// Reports that an attribute of an element cannot be read.
    pub fn fault_in(&mut self, at: Element<'_>, attribute: &str, message: impl FnOnce() -> String) {
        self.faults.push(|| finding(at, Some(attribute), format!("`{attribute}`: {}", message())));
    }

    /// Reports a defect of an element.
    pub fn defect(&mut self, at: Element<'_>, message: impl FnOnce() -> String) {
        self.defects.push(|| finding(at, None, message()));
    }

    /// Counts an element that is not known; refuses it where `carries_geometry`.
    pub fn unknown(&mut self, at: Element<'_>, known: &[&str], carries_geometry: bool) {
        let name = at.tag_name().name();
        if carries_geometry {
            self.fault(at, || {
                let hint = did_you_mean(name, known.iter().copied());
                format!("unknown element that carries geometry{hint}; expected one of {}", known.join(", "))
            });
            return;
        }
        let short: String = name.chars().take(64).collect();
        let is_new = !self.unknown.contains_key(&short);
        let key = if is_new && self.unknown.len() >= UNKNOWN_MAX { "(others)".to_owned() } else { short };
        *self.unknown.entry(key).or_default() += 1;
    }

    /// Child elements by name; others are unknown. Those with the coefficients of a polynomial carry geometry.
    pub fn children<'a>(&mut self, of: Element<'a>, known: &[&str]) -> Vec<Element<'a>> {
        self.children_where(of, known, |child| child.has_attribute("a") && child.has_attribute("b"))
    }

    /// As [`children`](Self::children), where all unknown elements carry geometry.
    pub fn geometric<'a>(&mut self, of: Element<'a>, known: &[&str]) -> Vec<Element<'a>> {
        self.children_where(of, known, |_| true)
    }

    fn children_where<'a>(
        &mut self,
        of: Element<'a>,
        known: &[&str],
        carries: impl Fn(Element<'a>) -> bool,
    ) -> Vec<Element<'a>> {
        let mut found = Vec::new();
        for child in of.children().filter(Node::is_element) {
            let name = child.tag_name().name();
            if known.contains(&name) {
                found.push(child);
            } else if !EXTENSIONS.contains(&name) {
                self.unknown(child, known, carries(child));
            } else {
                self.unknown(child, known, false);
            }
        }
        found
    }

    /// A required number, finite and of a magnitude that occurs on Earth; 0 where it is wrong.
    pub fn number(&mut self, of: Element<'_>, name: &str) -> f64 {
        self.number_if(of, name).unwrap_or_else(|| {
            if !of.has_attribute(name) {
                self.missing(of, name);
            }
            0.0
        })
    }

    /// Reports a missing attribute.
    pub fn missing(&mut self, of: Element<'_>, name: &str) {
        self.fault(of, || {
            let names = of.attributes().map(|attribute| attribute.name());
            let near = swerve_text::nearest(name, names);
            let hint = near.map_or_else(String::new, |near| format!("; found {}", quoted(near)));
            format!("attribute `{name}` is missing{hint}")
        });
    }

    /// A number that may be left out.
    pub fn number_or(&mut self, of: Element<'_>, name: &str, default: f64) -> f64 {
        self.number_if(of, name).unwrap_or(default)
    }

    /// A number, if it is there and valid.
    pub fn number_if(&mut self, of: Element<'_>, name: &str) -> Option<f64> {
        let text = of.attribute(name)?;
        number(text).map_err(|message| self.fault_in(of, name, || message)).ok()
    }

    /// A number that carries no geometry: where it is not one, that is a defect. Empty texts are missing numbers.
    pub fn lenient(&mut self, of: Element<'_>, name: &str) -> Option<f64> {
        let text = of.attribute(name).map(str::trim).filter(|text| !text.is_empty())?;
        let value = text.parse::<f64>().ok().filter(|value| value.is_finite() && value.abs() <= NUMBER_MAX);
        if value.is_none() {
            self.defect(of, || format!("`{name}`: expected a number, found {}", quoted(text)));
        }
        value
    }

    /// A required number that is not negative.
    pub fn distance(&mut self, of: Element<'_>, name: &str) -> f64 {
        let value = self.number(of, name);
        if value < 0.0 {
            self.fault_in(of, name, || format!("expected a number of at least 0, found {value}"));
        }
        value.max(0.0)
    }

    /// A required whole number.
    pub fn integer(&mut self, of: Element<'_>, name: &str) -> Option<i32> {
        let Some(text) = of.attribute(name) else {
            self.missing(of, name);
            return None;
        };
        let value = text.trim().parse::<i32>().ok().filter(|value| value.unsigned_abs() < 1_000_000);
        if value.is_none() {
            self.fault_in(of, name, || format!("expected a whole number, found {}", quoted(text)));
        }
        value
    }

    /// A required text.
    pub fn text(&mut self, of: Element<'_>, name: &str) -> String {
        let Some(text) = of.attribute(name) else {
            self.missing(of, name);
            return String::new();
        };
        text.to_owned()
    }

    /// A required name out of a list; `None` where it is another, which is a fault.
    pub fn name<'n>(&mut self, of: Element<'_>, name: &str, known: &[&'n str]) -> Option<&'n str> {
        let Some(text) = of.attribute(name) else {
            self.missing(of, name);
            return None;
        };
        let found = known.iter().find(|one| **one == text).copied();
        if found.is_none() {
            self.fault_in(of, name, || {
                let hint = did_you_mean(text, known.iter().copied());
                format!("expected one of {}, found {}{hint}", known.join(", "), quoted(text))
            });
        }
        found
    }
}

/// Number in a text, finite and of a magnitude that occurs on Earth.
///
/// # Errors
/// The expected number and the text.
pub fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() && value.abs() <= NUMBER_MAX => Ok(value),
        Ok(value) if value.is_nan() => Err("expected a finite number, found NaN".to_owned()),
        Ok(_) => {
            Err(format!("expected a number of magnitude at most {NUMBER_MAX:e}, found {}", quoted(text)))
        }
        Err(_) => Err(format!("expected a number, found {}", quoted(text))),
    }
}

/// Elements that may be anywhere and hold no geometry (ASAM OpenDRIVE 1.8, chapter 7).
const EXTENSIONS: [&str; 3] = ["userData", "include", "dataQuality"];

/// Text of an optional attribute; empty where it is missing.
pub fn optional(of: Element<'_>, name: &str) -> String {
    of.attribute(name).unwrap_or_default().to_owned()
}

fn finding(at: Element<'_>, attribute: Option<&str>, message: String) -> Finding {
    let named = attribute.and_then(|name| at.attribute_node(name));
    let byte = named.map_or_else(|| at.range().start, |attribute| attribute.range().start);
    Finding { byte, element: path(at), message }
}

/// Path of an element from the root's children: names, with the identity where there is one.
fn path(of: Element<'_>) -> String {
    let mut parts: Vec<String> = of
        .ancestors()
        .filter(|node| node.is_element() && node.parent_element().is_some())
        .take(12)
        .map(|node| {
            let name = node.tag_name().name();
            match node.attribute("id") {
                Some(id) => format!("{name} {}", quoted(id).trim_matches('"')),
                None => name.to_owned(),
            }
        })
        .collect();
    parts.reverse();
    if parts.is_empty() { of.tag_name().name().to_owned() } else { parts.join("/") }
}
