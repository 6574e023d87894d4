//! Output of `swerve timing --json`: every publication, in commit order.

use serde::{Serialize, Serializer};

use super::pipeline::Pipeline;
use super::trace::{Publication, Trace};

#[derive(Serialize)]
struct Row<'a> {
    operator: &'a str,
    stamp_ns: Option<i64>,
    watermark_ns: i64,
    visible_at_ns: i64,
    reused_from_ns: Option<i64>,
    reads: Reads<'a>,
}

/// An object with the stamp read at each input, in the order at, latest, feedback; empty for a bare watermark.
struct Reads<'a> {
    pipeline: &'a Pipeline,
    publication: &'a Publication,
}

impl Serialize for Reads<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let operators = &self.pipeline.operators;
        let names = operators[self.publication.operator].inputs().map(|i| &operators[i].name);
        serializer.collect_map(names.zip(self.publication.reads.iter().map(|stamp| stamp.map(|t| t.ns()))))
    }
}

/// Formats one array, with a publication on each line.
pub(crate) fn json(pipeline: &Pipeline, trace: &Trace) -> String {
    let row = |publication: &Publication| {
        let row = Row {
            operator: &pipeline.operators[publication.operator].name,
            stamp_ns: publication.stamp.map(|t| t.ns()),
            watermark_ns: publication.watermark.ns(),
            visible_at_ns: publication.visible_at.ns(),
            reused_from_ns: publication.reused_from.map(|t| t.ns()),
            reads: Reads { pipeline, publication },
        };
        serde_json::to_string(&row).expect("names and numbers are always JSON")
    };
    let rows: Vec<String> = trace.publications.iter().map(row).collect();
    format!("[{}]\n", rows.join(",\n"))
}
