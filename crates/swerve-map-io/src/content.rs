//! Values that are texts of elements, and identities.

use crate::problem::quoted;
use crate::xml::{Element, Reader, number};

/// Text of an element without the space around it; empty if it has none.
pub fn content<'a>(of: Element<'a>) -> &'a str {
    of.text().unwrap_or_default().trim()
}

/// First child element of a name.
pub fn child<'a>(of: Element<'a>, name: &str) -> Option<Element<'a>> {
    all(of, name).next()
}

/// Child elements of a name.
pub fn all<'a, 'n>(of: Element<'a>, name: &'n str) -> impl Iterator<Item = Element<'a>> + use<'a, 'n> {
    of.children().filter(move |child| child.is_element() && child.tag_name().name() == name)
}

impl Reader {
    /// The first child element of a name; its absence is a fault.
    pub fn child<'a>(&mut self, of: Element<'a>, name: &str) -> Option<Element<'a>> {
        let found = child(of, name);
        if found.is_none() {
            self.fault(of, || format!("element `{name}` is missing"));
        }
        found
    }

    /// A required number in a child element; 0 where it is wrong.
    pub fn measure(&mut self, of: Element<'_>, name: &str) -> f64 {
        let Some(inner) = self.child(of, name) else { return 0.0 };
        number(content(inner)).unwrap_or_else(|message| {
            self.fault(inner, || message);
            0.0
        })
    }

    /// A number in a child element that carries no geometry: where it is not one, that is a defect.
    pub fn lenient_measure(&mut self, of: Element<'_>, name: &str) -> Option<f64> {
        let inner = child(of, name)?;
        number(content(inner)).map_err(|message| self.defect(inner, || message)).ok()
    }

    /// Identity of an element, a natural number of 32 bits.
    pub fn identity(&mut self, of: Element<'_>, name: &str) -> Option<u32> {
        let Some(text) = of.attribute(name) else {
            self.missing(of, name);
            return None;
        };
        let value = text.trim().parse::<u32>().ok();
        if value.is_none() {
            self.fault_in(of, name, || {
                format!("expected a whole number from 0 to {}, found {}", u32::MAX, quoted(text))
            });
        }
        value
    }
}
