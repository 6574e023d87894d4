//! Inputs from outside, in place of sensors.

use core::marker::PhantomData;

use swerve_flow::{NamedOutputs, OutputInfo, Payload, Port, PortInfo};

use crate::kind::{Node, OperatorKind, Role, Settings};
use crate::site::Site;

/// A source of messages of type `T`.
pub(super) struct Source<T> {
    node: Node,
    is_there: fn(&Settings<'_>) -> bool,
    payload: PhantomData<fn() -> T>,
}

/// A source that takes part where `is_there` returns true.
pub(super) fn source<T: Payload>(
    kind: &'static str,
    doc: &'static str,
    is_there: fn(&Settings<'_>) -> bool,
) -> Source<T> {
    let node = Node::new(kind, doc).stays("it is fed from outside").role(Role::Input).origin();
    Source { node, is_there, payload: PhantomData }
}

impl<T: Payload> OperatorKind for Source<T> {
    fn node(&self) -> Node {
        self.node
    }

    fn is_there(&self, settings: &Settings<'_>) -> bool {
        (self.is_there)(settings)
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        <Port<T> as NamedOutputs>::ports()
    }

    fn inputs(&self, _: &Settings<'_>) -> Vec<PortInfo> {
        Vec::new()
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        site.add_source::<T>();
        Ok(())
    }
}
