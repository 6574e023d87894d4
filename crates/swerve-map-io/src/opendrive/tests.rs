//! Published maps against samples of a reader that was written apart; small maps with values worked out by hand.

mod bad;
mod hand;
mod published;
mod second;
mod split;
