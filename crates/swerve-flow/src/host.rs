//! The real clock, used only for the wall-clock executor, measured run times and statistics of this host.

use std::time::Instant;

/// Current time of the real clock.
#[expect(clippy::disallowed_methods, reason = "the one place of the engine that reads the real clock")]
pub(crate) fn now() -> Instant {
    Instant::now()
}

/// Nanoseconds since `begin`.
pub(crate) fn ns_since(begin: Instant) -> u64 {
    u64::try_from((now() - begin).as_nanos()).unwrap_or(u64::MAX)
}

/// Start of a step, for measuring its duration on this host.
#[derive(Clone, Copy)]
pub(crate) enum Begin {
    Clock(Instant),
    /// Reading of the processor's counter, which takes less than half as long, and the rate of the counter.
    Ticks(u64, ticks::Rate),
}

impl Begin {
    /// Starts a measurement now.
    #[inline]
    pub(crate) fn now() -> Self {
        match ticks::rate() {
            Some(rate) => Self::Ticks(ticks::read(), rate),
            None => Self::Clock(now()),
        }
    }

    /// Nanoseconds since the start.
    #[inline]
    pub(crate) fn ns(self) -> u64 {
        match self {
            Self::Clock(begin) => ns_since(begin),
            Self::Ticks(begin, rate) => ticks::ns(ticks::read().saturating_sub(begin), rate),
        }
    }
}

/// The processor's time stamp counter, if the system's clock is based on it: it then runs evenly and alike on all
/// cores.
#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
mod ticks {
    use core::time::Duration;
    use std::sync::OnceLock;
    use std::time::Instant;

    pub(super) use safe_arch::read_timestamp_counter as read;

    /// File with the source of the system's clock.
    const CLOCK_SOURCE: &str = "/sys/devices/system/clocksource/clocksource0/current_clocksource";

    /// Minimum duration over which the two clocks are compared.
    const COMPARED: Duration = Duration::from_millis(20);

    /// Maximum distance of two readings of the clock around one of the counter; beyond it, something else ran in
    /// between.
    const AT_ONCE: Duration = Duration::from_micros(1);

    /// Nanoseconds per 2^32 ticks.
    pub(super) type Rate = u64;

    /// Duration of `ticks` ticks, nanoseconds.
    #[inline]
    pub(super) fn ns(ticks: u64, rate: Rate) -> u64 {
        ((u128::from(ticks) * u128::from(rate)) >> 32) as u64
    }

    /// Rate, accurate to one in 10,000; `None` if the counter cannot be used.
    static RATE: OnceLock<Option<Rate>> = OnceLock::new();

    /// Returns the rate once it is known.
    #[inline]
    pub(super) fn rate() -> Option<Rate> {
        match RATE.get() {
            Some(rate) => *rate,
            None => compare(),
        }
    }

    #[cold]
    fn compare() -> Option<Rate> {
        static FIRST: OnceLock<Option<(Instant, u64)>> = OnceLock::new();
        let is_source = || std::fs::read_to_string(CLOCK_SOURCE).is_ok_and(|source| source.trim() == "tsc");
        let first = FIRST.get_or_init(|| is_source().then(|| (0..100).find_map(|_| both())).flatten());
        let Some((first, first_tick)) = first else { return *RATE.get_or_init(|| None) };
        let (now, tick) = both()?;
        let passed = now - *first;
        if passed < COMPARED || tick <= *first_tick {
            return None;
        }
        let rate = (passed.as_nanos() << 32) / u128::from(tick - first_tick);
        *RATE.get_or_init(|| u64::try_from(rate).ok())
    }

    /// Reads both clocks at the same moment; `None` if something else ran in between.
    fn both() -> Option<(Instant, u64)> {
        let (before, tick, after) = (super::now(), read(), super::now());
        (after - before < AT_ONCE).then_some((before, tick))
    }
}

#[cfg(not(all(target_arch = "x86_64", target_os = "linux")))]
mod ticks {
    /// Uninhabited: there is no counter.
    #[derive(Clone, Copy)]
    pub(super) enum Rate {}

    pub(super) fn rate() -> Option<Rate> {
        None
    }

    pub(super) fn read() -> u64 {
        0
    }

    pub(super) fn ns(_: u64, rate: Rate) -> u64 {
        match rate {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_takes_as_long_by_the_counter_as_by_the_clock() {
        let begin = now();
        // Until the clocks have been compared, and as long again.
        while ns_since(begin) < 30_000_000 {
            let _known_in_a_while = Begin::now();
        }
        // An interruption between two readings may be long but is rare: the smallest of several differences counts.
        let off = |_| {
            let (clock, counter) = (now(), Begin::now());
            while ns_since(clock) < 3_000_000 {}
            let (by_counter, by_clock) = (counter.ns(), ns_since(clock));
            (by_counter as f64 / by_clock as f64 - 1.0).abs()
        };
        let least = (0..10).map(off).fold(f64::INFINITY, f64::min);
        assert!(least < 1e-3, "{least}");
    }
}
