//! Numbers, intervals and points.

use swerve_geom::Point2;
use swerve_map_io::content::child;
use swerve_map_io::xml::{Element, Reader};

use crate::Interval;

/// Largest time step.
const STEP_MAX: f64 = 1e6;

/// Coordinates of a point; a height is not used.
pub(crate) fn coordinates(xml: &mut Reader, point: Element<'_>) -> Point2 {
    Point2::new(xml.measure(point, "x"), xml.measure(point, "y"))
}

/// The `exact` number in a child element; `None` if there is no such child.
pub(crate) fn exact(xml: &mut Reader, of: Element<'_>, name: &str) -> Option<f64> {
    let at = child(of, name)?;
    Some(xml.measure(at, "exact"))
}

/// The `exact` time step of a state.
pub(crate) fn step(xml: &mut Reader, of: Element<'_>) -> u32 {
    let Some(at) = xml.child(of, "time") else { return 0 };
    let value = xml.measure(at, "exact");
    whole(xml, at, value)
}

/// A number as a time step; 0 after a fault.
pub(crate) fn whole(xml: &mut Reader, at: Element<'_>, value: f64) -> u32 {
    if value.fract() != 0.0 || !(0.0..=STEP_MAX).contains(&value) {
        xml.fault(at, || {
            format!("expected a whole number of time steps from 0 to {STEP_MAX}, found {value}")
        });
        return 0;
    }
    value as u32
}

/// An interval in a child element: `intervalStart` and `intervalEnd`, or `exact`; `None` if there is no such child.
pub(crate) fn interval(xml: &mut Reader, of: Element<'_>, name: &str) -> Option<Interval> {
    let at = child(of, name)?;
    if child(at, "exact").is_some() {
        let value = xml.measure(at, "exact");
        return Some(Interval { from: value, to: value });
    }
    let interval = Interval { from: xml.measure(at, "intervalStart"), to: xml.measure(at, "intervalEnd") };
    if interval.to < interval.from {
        let Interval { from, to } = interval;
        xml.fault(at, || format!("expected `intervalStart` of at most `intervalEnd`, found {from} and {to}"));
    }
    Some(interval)
}
