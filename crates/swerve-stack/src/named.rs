//! Algorithms by name: built-in ones, and those of other crates.

use core::marker::PhantomData;
use std::borrow::Cow;
use std::sync::Arc;

use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};
use swerve_text::{KeyProblem, did_you_mean, list};

/// Keys of a kind or parameters of an algorithm that has none.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoKeys {}

/// Name of an algorithm: a built-in one, which the schema of `B` lists, or one that a [`Registry`](crate::Registry) adds.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(transparent, bound = "")]
pub struct Name<B>(Cow<'static, str>, PhantomData<B>);

impl<B> Name<B> {
    /// The algorithm of this name.
    pub const fn new(name: &'static str) -> Self {
        Self(Cow::Borrowed(name), PhantomData)
    }

    /// Name in files and tables.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl<B: JsonSchema> JsonSchema for Name<B> {
    fn schema_name() -> Cow<'static, str> {
        B::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        B::json_schema(generator)
    }
}

/// Algorithms of one trait by name, in the order of their registration.
pub(crate) struct Named<T: ?Sized>(Vec<(&'static str, Arc<T>)>);

impl<T: ?Sized> Named<T> {
    /// Adds an algorithm, or replaces the one of the same name.
    pub(crate) fn insert(&mut self, name: &'static str, algorithm: Arc<T>) {
        self.0.retain(|(known, _)| *known != name);
        self.0.push((name, algorithm));
    }

    /// Replaces every algorithm, and keeps its name.
    pub(crate) fn replace(&mut self, by: impl Fn(Arc<T>) -> Arc<T>) {
        for (_, algorithm) in &mut self.0 {
            *algorithm = by(algorithm.clone());
        }
    }

    /// The algorithm of this name.
    pub(crate) fn get(&self, name: &str) -> Option<&T> {
        self.0.iter().find(|(known, _)| *known == name).map(|(_, algorithm)| &**algorithm)
    }

    /// The same, shared.
    pub(crate) fn shared(&self, name: &str) -> Option<Arc<T>> {
        self.0.iter().find(|(known, _)| *known == name).map(|(_, algorithm)| algorithm.clone())
    }

    /// All names.
    pub(crate) fn names(&self) -> impl Iterator<Item = &'static str> {
        self.0.iter().map(|(name, _)| *name)
    }

    /// The algorithm that a key names.
    ///
    /// # Errors
    /// The key with the problem of the name.
    pub(crate) fn named(&self, key: &str, name: &str) -> Result<&T, Vec<KeyProblem>> {
        let unknown = || vec![(key.to_owned(), self.problem(name).unwrap_or_default())];
        self.get(name).ok_or_else(unknown)
    }

    /// Problem of a name that no algorithm has.
    pub(crate) fn problem(&self, name: &str) -> Option<String> {
        let all: Vec<&str> = self.names().collect();
        let near = did_you_mean(name, self.names());
        self.get(name).is_none().then(|| format!("expected one of {}, found \"{name}\"{near}", list(&all)))
    }
}

impl<T: ?Sized> Default for Named<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: ?Sized> Clone for Named<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

/// An algorithm's type, for the erased form of its trait.
pub(crate) struct Of<A>(PhantomData<fn() -> A>);

impl<A> Of<A> {
    pub(crate) const fn new() -> Self {
        Self(PhantomData)
    }
}
