//! Section 8: wall clock, record, replay.
