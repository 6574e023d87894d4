//! Published networks against their own lengths and counts; small networks with values worked out by hand; invalid files.

mod bad;
mod hand;
mod published;
