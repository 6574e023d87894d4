//! The slowest response of a run: from the sensor's frame to the result, publication by publication.

use std::collections::BTreeMap;

use swerve_core::{Span, Time};

use super::pipeline::Pipeline;
use super::trace::{Publication, Step, Trace};

/// Publications that each derive from the one before, starting with the sensor's, with the steps that computed them.
pub(crate) struct Chain<'a> {
    /// Links, from the frame to the result.
    pub(crate) links: Vec<(&'a Publication, &'a Step)>,
    /// Time from the stamp of the frame to the publication of the result.
    pub(crate) took: Span,
}

impl<'a> Chain<'a> {
    /// Returns the chain of the slowest result published up to `until`; of equally slow ones the first.
    pub(crate) fn slowest(pipeline: &Pipeline, trace: &'a Trace, until: Time) -> Option<Self> {
        let response = |p: &Publication| Some(p.visible_at - p.origin.filter(|_| p.stamp.is_some())?);
        let results = trace.publications.iter();
        let results = results.filter(|p| pipeline.is_sink(p.operator) && p.visible_at <= until);
        let slower = |best: (Span, &'a Publication), other: (Span, &'a Publication)| {
            if other.0 > best.0 { other } else { best }
        };
        let (took, result) = results.filter_map(|p| Some((response(p)?, p))).reduce(slower)?;
        let by_stamp: BTreeMap<(usize, Time), &Publication> =
            trace.publications.iter().filter_map(|p| Some(((p.operator, p.stamp?), p))).collect();
        let mut links = Vec::new();
        let mut next = Some(result);
        while let Some(publication) = next {
            links.push((publication, step_of(trace, publication)?));
            next = cause(pipeline, &by_stamp, publication);
        }
        links.reverse();
        Some(Self { links, took })
    }
}

/// Stamp of the step that computed a publication.
fn computed_for(publication: &Publication) -> Option<Time> {
    publication.reused_from.or(publication.stamp)
}

fn step_of<'a>(trace: &'a Trace, publication: &Publication) -> Option<&'a Step> {
    let stamp = computed_for(publication)?;
    trace.steps.iter().find(|step| step.operator == publication.operator && step.stamp == stamp)
}

/// Publication that the step read and that derives from the same frame, feedback last; `None` for a sensor's
/// publication. Following causes terminates: nothing is read before it is published, and feedback only later.
fn cause<'a>(
    pipeline: &Pipeline,
    by_stamp: &BTreeMap<(usize, Time), &'a Publication>,
    publication: &Publication,
) -> Option<&'a Publication> {
    // A repeat has the reads of the publication that it repeats.
    let first = publication.reused_from.and_then(|stamp| by_stamp.get(&(publication.operator, stamp)));
    let publication = first.copied().unwrap_or(publication);
    let read = pipeline.operators[publication.operator].inputs().zip(&publication.reads);
    let mut read = read.filter_map(|(input, stamp)| by_stamp.get(&(input, (*stamp)?)).copied());
    read.find(|read| read.origin == publication.origin)
}
