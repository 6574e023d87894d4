//! Inputs that change because a configuration adds an operator.

use std::collections::BTreeSet;

use super::{Assembly, Placed};
use crate::setup::Setup;

/// An operator that reads other streams because another operator was added.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Redirected {
    /// The added operator.
    pub added: String,
    /// The operator whose inputs changed.
    pub operator: String,
    /// Streams that it reads now, of the added operator.
    pub reads: Vec<String>,
    /// Streams that it would read without the added operator, and does not read now.
    pub in_place_of: Vec<String>,
}

impl Assembly {
    /// Operators that read a stream of an operator that `[operator.NAME] kind = ...` adds, although their own `reads` does
    /// not name it, and that would read another stream without it.
    pub fn redirected(&self, setup: &Setup) -> Vec<Redirected> {
        let is_added = |name: &&String| setup.operator[*name].kind.is_some() && self.has(name);
        setup.operator.keys().filter(is_added).flat_map(|added| self.redirected_by(added, setup)).collect()
    }

    fn redirected_by(&self, added: &str, setup: &Setup) -> Vec<Redirected> {
        let mut without = setup.clone();
        without.operator.remove(added);
        // Where the rest needs the operator nothing else was read before.
        let Ok(before) = Self::new(&without) else { return Vec::new() };
        let Some(publisher) = self.operator(added) else { return Vec::new() };
        let published: BTreeSet<&str> = publisher.outputs.iter().map(|output| &*output.stream).collect();
        let changed = |placed: &Placed| {
            let is_named = setup.operator.get(&placed.name).is_some_and(|own| !own.reads.is_empty());
            let (old, new) = (streams(before.operator(&placed.name)?), streams(placed));
            let reads: Vec<String> =
                new.difference(&old).filter(|s| published.contains(**s)).map(own).collect();
            let in_place_of: Vec<String> = old.difference(&new).map(own).collect();
            let is_redirected = !is_named && !reads.is_empty() && !in_place_of.is_empty();
            let (added, operator) = (added.to_owned(), placed.name.clone());
            is_redirected.then_some(Redirected { added, operator, reads, in_place_of })
        };
        self.operators.iter().filter(|placed| placed.name != added).filter_map(changed).collect()
    }
}

fn own(stream: &&str) -> String {
    (*stream).to_owned()
}

/// All streams that an operator reads.
fn streams(placed: &Placed) -> BTreeSet<&str> {
    placed.inputs.iter().flat_map(|input| &input.from).map(|edge| &*edge.stream).collect()
}

#[cfg(test)]
mod tests {
    use swerve_text::Document;

    use super::*;
    use crate::registry::Registry;

    fn redirected(text: &str) -> Vec<Redirected> {
        let document = Document::parse("c.toml", text).unwrap();
        let setup = Setup::from_document_with(&Registry::standard(), &document, &[]);
        let setup = setup.unwrap_or_else(|problems| panic!("{problems:?}"));
        Assembly::new(&setup).unwrap().redirected(&setup)
    }

    #[test]
    fn added_detector_that_feeds_the_tracker_is_found_unless_it_was_asked_for() {
        let added = "[camera.front]\n[operator.extra]\nkind = \"camera_objects\"\n";
        let found = redirected(added);
        assert_eq!(found.len(), 1, "{found:?}");
        let Redirected { added: by, operator, reads, in_place_of } = &found[0];
        assert_eq!(
            [&**by, operator, &reads[0], &in_place_of[0]],
            ["extra", "tracker", "extra.boxes", "obstacles"]
        );
        let asked = format!("{added}[operator.tracker]\nreads = {{ boxes = \"extra\" }}\n");
        assert_eq!(redirected(&asked), []);
        assert_eq!(redirected(""), []);
    }
}
